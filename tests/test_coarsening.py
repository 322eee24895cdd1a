"""The same sheet in cells twice as wide."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary.fittings import Fittings
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.modal.coarsening import coarsen, refine
from spacemap_vtk.mechanics.modal.model import Model


def sheet(normal: int, cells: tuple[int, int], **more: Fittings) -> Model:
    """Return a sheet of 2 by 3 across an axis, held by the side where the first axis is least."""
    sides = np.array([[0, 2], [0, 3], [-0.005, 0.005]])
    turned = np.roll(sides, normal + 1, axis=0).ravel()
    points, tetrahedra = build_lattice(turned, np.roll([*cells, 1], normal + 1))
    held = np.repeat(points[:, [(normal + 1) % 3]] == 0, 3, axis=1)
    plate = apply_measurements(
        homogeneous_plate(isotropic(1e6, 0.3), 0.01, normal), bending=(1e-2, 2e-2)
    )
    return Model(points, tetrahedra, plate, 300.0, held, **more)


@pytest.mark.parametrize("normal", [0, 1, 2])
@pytest.mark.parametrize("cells", [(8, 12), (9, 13)], ids=["even", "odd"])
def test_a_sheet_in_cells_twice_as_wide_is_the_same_sheet(normal, cells):
    fine = sheet(normal, cells)
    half = coarsen(fine)
    assert half is not None
    other = sheet(normal, (cells[0] // 2, cells[1] // 2))
    assert half.points.shape == other.points.shape
    assert half.nodal_mass.sum() == pytest.approx(fine.nodal_mass.sum(), rel=1e-12)
    np.testing.assert_array_equal(np.ptp(half.points, axis=0), np.ptp(fine.points, axis=0))
    rates = half.modes(5).eigenvalues * half.modulus
    if cells[0] % 2 == 0:  # the very same vertices
        np.testing.assert_allclose(rates, other.modes(5).eigenvalues * other.modulus, rtol=1e-9)
    np.testing.assert_allclose(rates, fine.modes(5).eigenvalues * fine.modulus, rtol=0.35)


@pytest.mark.parametrize("cells", [(4, 12), (5, 12), (8, 12)])
def test_a_parabola_in_wider_cells_is_that_parabola(cells):
    fine = sheet(2, cells)
    half = coarsen(fine)
    assert half is not None
    bent, expected = (model.points[:, :1] ** 2 * [0.0, 0.0, 1.0] for model in (half, fine))
    np.testing.assert_allclose(refine(half, fine, bent), expected, atol=1e-12)


def test_meshes_without_wider_cells_are_not_coarsened():
    assert coarsen(sheet(2, (3, 12))) is None
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.01), (8, 8, 1))
    held = np.repeat(points[:, :1] == 0, 3, axis=1)
    assert coarsen(Model(points, cells, isotropic(1e6, 0.3), 300.0, held)) is None
    heavy = Fittings(masses=np.ones(len(sheet(2, (8, 8)).points)))
    assert coarsen(sheet(2, (8, 8), fittings=heavy)) is None


@pytest.mark.parametrize(("cells", "kept"), [(8, True), (6, False)])
def test_a_sheet_whose_pins_would_be_lost_is_not_coarsened(cells, kept):
    points, tetrahedra = build_lattice((-1, 1, -1, 1, -0.005, 0.005), (cells, cells, 1))
    held = np.repeat(np.linalg.norm(points[:, :2], axis=1)[:, None] < 0.1, 3, axis=1)
    plate = homogeneous_plate(isotropic(1e6, 0.3), 0.01, 2)
    half = coarsen(Model(points, tetrahedra, plate, 300.0, held))
    assert (half is not None) == kept
    if half is not None:
        assert np.count_nonzero(~half.free) == np.count_nonzero(held) == 6
