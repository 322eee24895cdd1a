"""Sheets that hang are found in wider cells first, by steps that turn them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.elements.turning import TurningMoves
from spacemap_vtk.mechanics.modal import hanging
from spacemap_vtk.mechanics.modal.hanging import find_hung_state
from spacemap_vtk.mechanics.modal.model import Model

#: Mass per area [kg/m²], bending rigidity [N m], and the bending length [m] that follows.
MASS, RIGIDITY = 0.15, 1e-5
LENGTH = (RIGIDITY / (MASS * 9.81)) ** (1 / 3)
THICKNESS = 1e-3


def strip(cells: int, lengths: float = 4.0) -> Model:
    """Return a level strip along x, so many bending lengths long, held at one end."""
    box = (0, lengths * LENGTH, 0, lengths * LENGTH / 5, -THICKNESS / 2, THICKNESS / 2)
    points, tetrahedra = build_lattice(box, (cells, 6, 1))
    plate = apply_measurements(
        homogeneous_plate(isotropic(1e6, 0.0), THICKNESS),
        tensile=(1500.0,) * 2,
        bending=(RIGIDITY,) * 2,
    )
    held = np.repeat(points[:, :1] == 0, 3, axis=1)
    return Model(points, tetrahedra, plate, MASS / THICKNESS, held)


def weight(model: Model) -> np.ndarray:
    """Return the weight of the vertices, (3V,)."""
    return np.outer(model.nodal_mass, [0, 0, -9.81]).ravel()


def test_a_move_that_turns_a_free_sheet_is_the_finite_rotation() -> None:
    """A straight move ω × z of 0.6 rad stretches lines across ω by 17 %."""
    model = strip(7)
    surface = find_mid_surface(model.points, model.cells)
    assert surface is not None
    # From a shape that is bent and turned already.
    bent = model.points + 0.02 * np.sin(40 * model.points[:, [1, 2, 0]])
    start = surface.to_nodes(bent) @ Rotation.from_rotvec([0.4, -1.0, 0.3]).as_matrix().T
    moves = TurningMoves(model.points, surface, sp.identity(start.size, format="csr"))
    spin = np.array([0.2, -0.5, 0.25])
    found = start + moves.turn(start, np.cross(spin, start))
    expected = start @ Rotation.from_rotvec(spin).as_matrix().T
    count = len(surface.pairs)
    np.testing.assert_allclose(found[count:], expected[count:], atol=1e-12 * THICKNESS)
    # Nothing determines the place of the whole, which follows the straight move.
    shift = (found - expected)[:count]
    np.testing.assert_allclose(shift - shift[0], 0.0, atol=1e-6 * np.abs(start).max())


def test_a_small_move_that_turns_a_sheet_is_the_straight_one() -> None:
    model = strip(7)
    surface = model.pencil.surface
    assert surface is not None
    basis = model.pencil.basis.tocsr()
    start = model.pencil.nodes.positions
    moves = TurningMoves(model.points, surface, basis)
    random = np.random.default_rng(0).standard_normal(basis.shape[1])
    move = (basis @ random).reshape(-1, 3)
    move[len(surface.pairs) :] *= THICKNESS
    differences = [abs(moves.turn(start, s * move) / s - move).max() for s in (1e-5, 1e-6)]
    assert differences[0] == pytest.approx(10 * differences[1], rel=0.05)


def test_a_strip_that_is_found_in_wider_cells_first_hangs_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = strip(24)
    straight, _ = model.solve_equilibrium(weight(model))
    cells: list[tuple[int, bool]] = []
    solve = Model.solve_equilibrium

    def note(self: Model, *given: object) -> object:
        cells.append((len(self.cells), len(given) > 2 and given[2] is not None))
        return solve(self, *given)

    monkeypatch.setattr(Model, "solve_equilibrium", note)
    monkeypatch.setattr(hanging, "FEWEST", 100)
    progress: list[float] = []
    found, critical = find_hung_state(model, weight(model), progress.append)
    # Of the strip's cells those of a third of its bending length are narrow enough, and no wider.
    assert cells == [(len(model.cells) // 4, False), (len(model.cells), True)]
    np.testing.assert_allclose(found, straight, atol=1e-7)
    assert critical is None
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
