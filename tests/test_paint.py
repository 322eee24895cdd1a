"""Textures and colours of materials: points have the colours that their file states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import ObjectSource
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.texture_atlas import pixels_of
from spacemap_vtk.scenes.scene import Scene

SQUARES = """mtllib two.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 2 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl left
f 1/1 2/2 3/3 4/4
usemtl right one
f 2/1 5/2 6/3 3/4
"""


def gradient(path: Path, swapped: bool = False) -> None:
    """A picture whose red is u and whose green is v; blue tells the two apart."""
    v, u = np.mgrid[255:-1:-1, 0:256]
    blue = np.full_like(u, 255 * swapped)
    Image.fromarray(np.stack((u, v, blue), axis=2).astype(np.uint8)).save(path)


def draw(source: ObjectSource) -> np.ndarray:
    """The colour at each point, by the nearest pixel."""
    pixels = pixels_of(source.picture).astype(float)
    at = vtk_to_numpy(source.GetOutputDataObject(0).GetPointData().GetTCoords())
    height, width, _ = pixels.shape
    size = np.array([width, height])
    column, row = np.clip(np.floor(at * size), 0, size - 1).astype(int).T
    return pixels[row, column, :3] / 255


def two_squares(folder: Path, library: str) -> Path:
    (folder / "two.obj").write_text(SQUARES)
    (folder / "two.mtl").write_text(library)
    return folder / "two.obj"


def updated(**values: object) -> ObjectSource:
    source = ObjectSource(**values)
    source.update()
    return source


def test_two_textures_of_an_obj_are_drawn(tmp_path: Path) -> None:
    gradient(tmp_path / "a.png")
    gradient(tmp_path / "b c.png", swapped=True)
    library = "newmtl left\nKd 0 0 0\nmap_Kd a.png\n\nnewmtl right one\nmap_Kd b c.png\n"
    source = updated(file=two_squares(tmp_path, library))
    mesh = pv.wrap(source.GetOutputDataObject(0))
    assert source.warnings == ()
    x, y, _ = mesh.points.T
    assert mesh.active_texture_coordinates.shape == (8, 2)
    second = np.arange(8) >= 4  # the points on the border are there twice
    expected = np.stack((x - second, y, second), axis=1)
    np.testing.assert_allclose(draw(source), expected, atol=0.02)


def test_a_plain_material_and_a_textured_one_are_drawn(tmp_path: Path) -> None:
    gradient(tmp_path / "a.png")
    library = "newmtl left\nmap_Kd a.png\nnewmtl right one\nKd 0.2 0.4 0.6\n"
    source = updated(file=two_squares(tmp_path, library))
    np.testing.assert_allclose(draw(source)[4:], [[0.2, 0.4, 0.6]] * 4, atol=0.003)


def test_vertex_colours_are_drawn(tmp_path: Path) -> None:
    library = "newmtl left\nKd 1 0 0\nnewmtl right one\nKd 0 0.5 1\n"
    source = updated(file=two_squares(tmp_path, library))
    assert source.picture is None
    mesh = pv.wrap(source.GetOutputDataObject(0))
    np.testing.assert_array_equal(mesh.cell_data["color"], [[255, 0, 0], [0, 128, 255]])


@pytest.mark.parametrize("word", ["nan", "red", "1e999"])
def test_an_invalid_colour_causes_a_warning(tmp_path: Path, word: str) -> None:
    library = f"newmtl left\nKd {word} 0 0\nnewmtl right one\nKd 0 0.5 1\n"
    source = updated(file=two_squares(tmp_path, library))
    assert f'"Kd {word} 0 0" is not a colour' in source.warnings[0]


def test_a_missing_texture_causes_a_warning(tmp_path: Path) -> None:
    source = updated(file=two_squares(tmp_path, "newmtl left\nmap_Kd gone.png\n"))
    assert source.picture is None
    assert "gone.png: no such file" in source.warnings[0]
    (tmp_path / "two.mtl").unlink()
    source = updated(file=tmp_path / "two.obj")
    assert "two.mtl does not exist: the object is drawn without materials" in source.warnings[0]


def test_a_repeated_texture_is_drawn(tmp_path: Path) -> None:
    gradient(tmp_path / "a.png")
    file = two_squares(tmp_path, "newmtl left\nmap_Kd a.png\nnewmtl right one\nmap_Kd a.png\n")
    file.write_text(SQUARES.replace("vt 1 1", "vt 2.5 1.25"))
    source = updated(file=file)
    corner = draw(source)[2]
    np.testing.assert_allclose(corner, [0.5, 0.25, 0.0], atol=0.02)


@pytest.mark.parametrize("ending", ["gltf", "vtp"])
def test_a_gltf_texture_can_be_replaced(tmp_path: Path, ending: str) -> None:
    gradient(tmp_path / "a.png")
    plane, file = pv.Plane(i_resolution=7, j_resolution=5), tmp_path / f"plane.{ending}"
    values = {}
    if ending == "gltf":
        prepare_offscreen()
        plotter = pv.Plotter(off_screen=True, window_size=(40, 30))
        plotter.add_mesh(plane, texture=pv.read_texture(tmp_path / "a.png"))
        plotter.add_mesh(pv.Cube(center=(0, 0, 3)), color="blue")
        plotter.export_gltf(str(file), rotate_scene=False)
        plotter.close()
    else:
        plane.save(file)
        values = {"texture": tmp_path / "a.png"}
    source = updated(file=file, **values)
    points = vtk_to_numpy(source.GetOutputDataObject(0).GetPoints().GetData())
    flat = np.abs(points[:, 2]) < 1e-6
    expected = np.column_stack((points[flat, :2] + 0.5, np.zeros(flat.sum())))
    np.testing.assert_allclose(draw(source)[flat], expected, atol=0.02)
    if ending == "gltf":
        np.testing.assert_allclose(draw(source)[~flat], [[0, 0, 1]] * (~flat).sum(), atol=0.01)


def test_a_texture_needs_texture_coordinates(tmp_path: Path) -> None:
    gradient(tmp_path / "a.png")
    pv.Cube().save(tmp_path / "cube.stl")
    with pytest.raises(InputError, match="no texture coordinates"):
        updated(file=tmp_path / "cube.stl", texture=tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes((tmp_path / "a.png").read_bytes()[:200])
    with pytest.raises(InputError, match=r"a\.png"):
        updated(file=tmp_path / "cube.stl", texture=tmp_path / "a.png")


def test_a_texture_moves_with_the_object(tmp_path: Path) -> None:
    red = np.zeros((8, 8, 3), dtype=np.uint8)
    red[..., 0] = 255
    Image.fromarray(red).save(tmp_path / "red.png")
    pv.Plane(i_resolution=9, j_resolution=9).save(tmp_path / "plane.vtp")
    values = {"file": tmp_path / "plane.vtp", "texture": tmp_path / "red.png"}
    scene = Scene({"object": values, "cage": {"divisions": [2, 2, 1]}})
    picture = Picture(scene, [0.05], (60, 40), ["fabric"])
    image = picture.draw(0.05).astype(int)
    picture.close()
    reds = image[..., 0] - image[..., 1:].max(axis=2)
    assert (reds > 60).sum() > 200
