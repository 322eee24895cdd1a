"""Cloth as a sheet beside its yarns in files: it moves with them, and has their numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from test_morph_surface import SMALL, change_scene

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.moving_surface import FarCloth, MovingSurface
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.draw.morph_surface import make_mode_surface, make_moving_surface

TIMES = np.linspace(0.0, 0.06, 7).tolist()


def shading_of(made: MovingSurface) -> FarCloth:
    assert made.shading is not None
    assert made.shading.far is not None
    return made.shading.far


@pytest.mark.parametrize("color", ["own", "stress"])
def test_the_sheet_moves_with_the_cage_and_has_the_mean_numbers(color: str) -> None:
    scene = change_scene("plain_weave", *SMALL, f"view.color={color}")
    made = make_moving_surface(scene, TIMES, 2e-6, lambda done, of: None, numbers=True, shaded=True)
    far, sheet = shading_of(made), ClothSheet(scene)
    columns, rows = (np.linspace(0.0, 1.0, n + 1) for n in sheet.cells)
    places = np.stack(np.meshgrid(far.rows, far.columns, indexing="ij"), axis=-1).reshape(-1, 2)
    for number in (2, 6):
        moved = points_of(sheet.deform_at(TIMES[number])).reshape(len(rows), len(columns), 3)
        expected = RegularGridInterpolator((rows, columns), moved)(places)
        found = far.points + np.tensordot(made.clips[0].weights[number], far.targets, 1)
        assert np.abs(found - expected).max() < 2e-6
    if color == "own":
        assert far.values is None
        return
    assert made.numbers is not None
    assert far.values is not None
    assert far.values.mean() == pytest.approx(made.numbers.values.mean(), rel=0.15)
    assert far.values.min() >= made.numbers.values.min()
    assert far.values.max() <= made.numbers.values.max()


def test_the_sheet_swings_in_the_shapes_of_the_modes() -> None:
    scene = change_scene("plain_weave", *SMALL, "modal.modes=2")
    made = make_mode_surface(scene, lambda done, of: None, shaded=True)
    far = shading_of(made)
    largest = (np.linalg.norm(each, axis=-1).max(axis=-1) for each in (far.targets, made.targets))
    assert next(largest) == pytest.approx(next(largest), rel=0.1)
