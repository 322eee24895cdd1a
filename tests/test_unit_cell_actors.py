"""A unit cell in three dimensions: which voxels, slices and directions its actors draw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.cli.options import open_scene
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.surface_actor import YARNS, rgb_table
from spacemap_vtk.draw.actors.unit_cell_actors import CellLook, UnitCellActors, shown_voxels
from spacemap_vtk.draw.unit_cell_values import yarn_numbers
from spacemap_vtk.scenes.composite import unit_cell_model
from spacemap_vtk.unit_cell.phases import UnitCellModel


@pytest.fixture(scope="module")
def model() -> UnitCellModel:
    return unit_cell_model(open_scene("plain_weave", ["unit_cell.voxels=16"]))


def count_faces(chosen: np.ndarray) -> int:
    """Count the faces between chosen voxels and others."""
    padded = np.pad(chosen.astype(int), 1)
    return int(sum(abs(np.diff(padded, axis=axis)).sum() for axis in range(3)))


def test_voxels_are_drawn_by_share_by_yarn_and_behind_the_slice(model: UnitCellModel) -> None:
    cell, share = UnitCellActors(model), model.voxels.fraction
    numbers = yarn_numbers(model)
    for look, chosen in (
        (CellLook(threshold=0.3, slice=False), share >= 0.3),
        (
            CellLook(voxels="yarn", yarn=numbers[1], slice=False),
            (model.voxels.yarn == numbers[1]) & (share >= 0.5),
        ),
        (CellLook(threshold=0.9, index=5), (share >= 0.9) & (np.arange(8) < 5)[:, None, None]),
    ):
        np.testing.assert_array_equal(shown_voxels(model, look), chosen)
        cell.show(look)
        assert cell.voxels.GetMapper().GetInput().GetNumberOfCells() == count_faces(chosen)
    cell.show(CellLook(voxels="none"))
    assert not cell.voxels.GetVisibility()


def test_a_slice_has_the_colours_of_its_voxels(model: UnitCellModel) -> None:
    cell = UnitCellActors(model)
    cell.show(CellLook(across="y", index=3))
    plane = cell.slice.GetMapper().GetInput()
    colors = vtk_to_numpy(plane.GetCellData().GetArray("color")).reshape(8, 16, 3)
    number, share = model.voxels.yarn[:, 3], model.voxels.fraction[:, 3]
    for rank, yarn in enumerate(yarn_numbers(model)):
        inside = (number == yarn) & (share > 1 - 1e-9)
        assert (colors[inside] == rgb_table(YARNS)[rank]).all()
    low, high = np.array(plane.GetBounds()).reshape(3, 2)[1]
    assert low == high == pytest.approx(3.1 * model.spacing[1])


def test_glyphs_have_the_directions_of_fibres_and_a_sheared_cell_leans(
    model: UnitCellModel,
) -> None:
    cell = UnitCellActors(model)
    cell.show(CellLook(directions=True, slice=False))
    glyphs = cell.glyphs.GetMapper().GetInput()
    place = np.floor(points_of(glyphs) / model.spacing).astype(int)
    own = model.voxels.direction[tuple(place[:, ::-1].T)]
    along = vtk_to_numpy(glyphs.GetPointData().GetArray("direction"))
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    np.testing.assert_allclose(along, own, atol=1e-6)
    assert len(along) == (model.voxels.fraction >= 0.5).sum()
    lean = np.array([[1.0, 0.5, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 1.25]])
    sheared = UnitCellActors(replace(model, gradient=lean))
    sheared.show(CellLook(threshold=0.0, slice=False))
    size = model.spacing * model.voxels.fraction.shape[::-1]
    low, high = np.array(sheared.voxels.GetBounds()).reshape(3, 2).T
    np.testing.assert_allclose(low, 0.0, atol=1e-9)
    np.testing.assert_allclose(high, lean @ size, rtol=1e-6)
