"""Cells of a sheet that pass through each other."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.contact.crossing import count_crossed_cells
from spacemap_vtk.mechanics.elements.shell import MidSurface, find_mid_surface
from spacemap_vtk.ndarrays import Floats


def make_strip(count: int) -> tuple[Floats, MidSurface]:
    """Return the vertices and mid-surface of a strip of cells of 1 cm along x."""
    box = (0.0, 0.01 * count, 0.0, 0.02, -1e-4, 1e-4)
    points, cells = build_lattice(box, (count, 2, 1))
    surface = find_mid_surface(points, cells)
    assert surface is not None
    return points, surface


def wind(points: Floats, radius: Floats) -> Floats:
    """Wind a strip up, with a radius at each vertex, by its length over 1 cm in rad."""
    angle = points[:, 0] / 0.01 * 0.5
    radius = radius + points[:, 2]
    return np.column_stack([radius * np.sin(angle), points[:, 1], radius * np.cos(angle)])


def test_a_flat_sheet_and_a_spiral_do_not_cross_themselves() -> None:
    points, surface = make_strip(20)
    assert count_crossed_cells(points, surface) == 0
    # One turn and a half, 2 mm further out after each.
    out = 0.02 + 0.002 * points[:, 0] / 0.01 * 0.5 / (2 * np.pi)
    assert count_crossed_cells(wind(points, out), surface) == 0


def test_rounding_lets_no_level_sheet_cross_itself() -> None:
    points, surface = make_strip(20)
    for seed in range(60):
        rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
        assert count_crossed_cells(points @ rotation.T, surface) == 0


@pytest.mark.parametrize("shift", [0.0, 0.05])
def test_a_coil_whose_end_dips_below_its_beginning_crosses_itself(shift: float) -> None:
    points, surface = make_strip(20)
    # The radius is that of the beginning again where the strip has one turn and a quarter. There,
    # and nowhere else, a row of two cells passes through another one.
    turn = points[:, 0] / 0.01 * 0.5 / (2 * np.pi)
    out = 0.02 + 0.01 * np.where(turn < 1.0, turn, np.maximum(1.0 - 4.0 * (turn - 1.0), -1.0))
    bent = wind(points, out + shift)
    found = count_crossed_cells(bent, surface)
    assert 2 <= found <= 8
    # The cells that cross are those around that place: without them nothing does.
    near = points[surface.pairs[surface.quads].reshape(len(surface.quads), -1), 0].mean(axis=1)
    later = surface._replace(quads=surface.quads[near < 0.12])
    assert count_crossed_cells(bent, later) == 0
