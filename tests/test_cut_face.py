"""The face that a plane cuts through what is solid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkMassProperties, vtkTriangleFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource

from spacemap_vtk.datasets.arrays import points_of, to_array
from spacemap_vtk.draw.actors.cut_face import BRIGHTNESS, compute_cut_face
from spacemap_vtk.draw.actors.surface_actor import FAMILIES
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes.scene import Scene


def area(face: vtkPolyData) -> float:
    if not face.GetNumberOfCells():
        return 0.0
    points = points_of(face).astype(float)
    corners = points[vtk_to_numpy(face.GetPolys().GetConnectivityArray()).reshape(-1, 3)]
    sides = corners[:, 1:] - corners[:, :1]
    return float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2)


def ball(radius: float, inward: bool = False) -> vtkPolyData:
    source = vtkSphereSource()
    source.SetRadius(radius)
    source.SetThetaResolution(120)
    source.SetPhiResolution(120)
    source.Update()
    surface = source.GetOutput()
    if inward:
        for cell in range(surface.GetNumberOfCells()):
            surface.ReverseCell(cell)
    return surface


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, -2), (1, 2, 3)])
@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_ball_shows_a_disc(normal: tuple[float, ...], height: float) -> None:
    way = np.array(normal) / np.linalg.norm(normal)
    face = compute_cut_face(ball(1.0), (tuple(way.tolist()), tuple((height * way).tolist())))
    assert area(face) == pytest.approx(np.pi * (1 - height**2), rel=3e-3)
    np.testing.assert_allclose(points_of(face) @ way, height, atol=1e-5)


def test_a_hollow_ball_shows_a_ring() -> None:
    both = vtkAppendPolyData()
    both.AddInputData(ball(1.0))
    both.AddInputData(ball(0.6, inward=True))
    both.Update()
    face = compute_cut_face(both.GetOutput(), ((0.1, 0.2, 1.0), (0.0, 0.0, 0.01)))
    assert area(face) == pytest.approx(np.pi * (1 - 0.36), rel=3e-3)


def test_uncut_and_empty_surfaces_have_no_face() -> None:
    assert compute_cut_face(ball(1.0), ((0, 0, 1), (0, 0, 2))).GetNumberOfCells() == 0
    assert compute_cut_face(vtkPolyData(), ((0, 0, 1), (0, 0, 0))).GetNumberOfCells() == 0


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("pattern", [pytest.param("plain", marks=pytest.mark.nightly), "twill 2/2"])
def test_cut_faces_through_a_weave_add_up_to_its_volume(axis: int, pattern: str) -> None:
    scene = Scene({"weave": {"pattern": pattern, "ends": 4, "picks": 4}})
    scene.update(0.0)
    surface = scene.polygons
    triangles = vtkTriangleFilter()
    triangles.SetInputData(surface)
    volume = vtkMassProperties()
    volume.SetInputConnection(triangles.GetOutputPort())
    points = points_of(surface).astype(float)
    low, high = points[:, axis].min(), points[:, axis].max()
    # The middles of some slices; the middle one is the cloth's own plane of symmetry.
    count = 41
    total = 0.0
    for k in range(count):
        origin = [0.0, 0.0, 0.0]
        origin[axis] = low + (k + 0.5) / count * (high - low)
        normal = [0.0, 0.0, 0.0]
        normal[axis] = 1.0
        total += area(compute_cut_face(surface, (tuple(normal), tuple(origin))))  # type: ignore[arg-type]
    assert total * (high - low) / count == pytest.approx(volume.GetVolume(), rel=0.02)


def test_a_cut_face_has_yarn_numbers_and_interpolated_arrays() -> None:
    scene = Scene({"weave": {"ends": 3, "picks": 3}})
    scene.update(0.0)
    surface = vtkPolyData()
    surface.ShallowCopy(scene.polygons)
    surface.GetPointData().AddArray(to_array(points_of(surface)[:, 1].copy(), "shown"))
    face = compute_cut_face(surface, ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    family = vtk_to_numpy(face.GetCellData().GetArray("family"))
    yarn = vtk_to_numpy(face.GetCellData().GetArray("yarn"))
    # The three picks, and the middle end lengthwise.
    assert set(zip(family.tolist(), yarn.tolist(), strict=True)) == {(0, 1), (1, 3), (1, 4), (1, 5)}
    np.testing.assert_allclose(
        vtk_to_numpy(face.GetPointData().GetArray("shown")), points_of(face)[:, 1], atol=1e-9
    )


def draw(**view: Any) -> np.ndarray:
    scene = Scene({"weave": {"ends": 4, "picks": 4}, "surface": {"subdivisions": 3}, "view": view})
    picture = Picture(scene, [0.0], (240, 180))
    image = picture.draw(0.0).astype(int)
    picture.close()
    return image


def test_a_cut_face_has_a_uniform_colour() -> None:
    view = {"camera": "side", "clip_normal": [-1, 0, 0], "color": "family", "shadows": False}
    image = draw(**view)
    flat = np.array(list(bytes.fromhex(FAMILIES[1][1:]))) * BRIGHTNESS
    # Four sections of weft, each a disc of one colour; light makes no two pixels of a yarn equal.
    assert (np.abs(image - flat).max(axis=2) <= 1).sum() > 400
    whole = draw(**{**view, "clip_normal": "auto"})
    assert (np.abs(whole - flat).max(axis=2) <= 1).sum() < 40
