"""Relaxed yarns against closed forms, published values and other solutions."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics
from spacemap_vtk.textile.rods.knit import relax_knit
from spacemap_vtk.textile.rods.loops import POINTS, draw_loops
from spacemap_vtk.textile.rods.relax import relax_again, relax_yarns
from spacemap_vtk.textile.rods.stiffness import cell_stiffness
from spacemap_vtk.textile.rods.stitches import plan_passes
from spacemap_vtk.textile.rods.tubes import spline_lines
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Stiffness of contact of `relax_knit`, for a bending stiffness and a diameter of 1.
CONTACT = 1.2e4
NO_CELL = np.zeros((2, 3))
GIVEN = np.zeros((2, 3), dtype=bool)
RECTANGLE = np.array([[True, False, False], [False, True, False]])


def spacings(rows):
    """Relax a knit of 16 diameters in a stitch; return it, wale and course spacing."""
    found = relax_knit(rows, 16.0)
    return found, found.cell[0, 0] / len(rows[0]), found.cell[1, 1] / len(rows)


def test_gradient_and_tangent_are_the_derivatives_of_the_energy():
    random = np.random.default_rng(0)
    yarns = [
        Yarn(random.normal(size=(8, 3)), (1, 0), 1.0),
        Yarn(random.normal(size=(7, 3)), None, 0.8),
    ]
    cell = np.array([[3.0, 0.1, 0.2], [0.3, 2.5, -0.1]])
    z, move, step = unknowns(yarns, cell), random.normal(size=(17, 3)), 1e-5
    samples = sample_yarns(yarns)
    # the tangent of bending is Gauss and Newton's
    for bending, checks_tangent in ((0.6, False), (0.0, True)):
        mechanics = RodMechanics(
            np.array([3.0, 2.0]), np.full(2, bending), 40.0, np.array([0.1, 0.1])
        )
        energy = RodEnergy(samples, mechanics)
        pairs = energy.pairs_within(z, 1.5)
        here, ahead, back = (energy.evaluate(z + k * step * move, pairs) for k in (0.0, 1.0, -1.0))
        assert here.parts[2] > 0.0
        slope = (ahead.energy - back.energy) / (2 * step)
        assert np.vdot(here.gradient, move) == pytest.approx(slope, rel=1e-8)
        if checks_tangent:
            turn = (ahead.gradient - back.gradient).ravel() / (2 * step)
            assert here.tangent() @ move.ravel() == pytest.approx(turn, abs=1e-8 * abs(turn).max())


@pytest.mark.parametrize("slide", [0.0, 0.013, 0.3])
def test_crossed_yarns_have_the_energy_of_their_overlap_wherever_they_cross(slide):
    # With r² = h² + x² + y² and h = 1 - δ: ½ k ∬ (1 - r)² dx dy = π k (δ³/3 - δ⁴/4).
    overlap, line = 5e-3, 0.6 * np.arange(8.0)
    along = np.stack([line - 2.1 + slide, 0 * line, 0 * line], axis=1)
    across = np.stack([0 * line, line - 2.1, 0 * line + 1.0 - overlap], axis=1)
    mechanics = RodMechanics(np.ones(2), np.ones(2), CONTACT, np.full(2, 0.6))
    energy = RodEnergy(sample_yarns([Yarn(along, None), Yarn(across, None)]), mechanics)
    z = unknowns([Yarn(along), Yarn(across)], NO_CELL)
    found = energy.evaluate(z, energy.pairs_within(z, 1.0)).parts[2]
    exact = np.pi * CONTACT * (overlap**3 / 3 - overlap**4 / 4)
    assert found == pytest.approx(exact, rel=0.03)


def test_a_bent_yarn_becomes_a_ring():
    angle = 2 * np.pi * np.arange(24) / 24
    oval = np.stack([1.3 * np.cos(angle), 0.9 * np.sin(angle), 0 * angle], axis=1)
    length = 2 * np.pi
    mechanics = RodMechanics(np.array([1e5]), np.ones(1), 0.0, np.array([length / 24]))
    found = relax_yarns([Yarn(oval, (0, 0), 0.1)], NO_CELL, mechanics, GIVEN)
    assert found.state.parts[1] == pytest.approx(2 * np.pi**2 / length, rel=1e-5)


@pytest.mark.parametrize(("room", "crimp"), [(2.0, 0.14350), (3.0, 0.05848)])
def test_taut_yarns_of_plain_weave_have_peirce_s_crimp(room, crimp):
    along = np.arange(16) / 16 * 2 * room
    wave = 0.5 * np.cos(np.pi * along / room)
    yarns = []
    for k, sign in ((0, 1.0), (1, -1.0)):
        place = np.full(16, room * k)
        yarns.append(Yarn(np.stack([along, place, sign * wave], axis=1), (1, 0)))
    for k, sign in ((0, -1.0), (1, 1.0)):
        place = np.full(16, room * k)
        yarns.append(Yarn(np.stack([place, along, sign * wave], axis=1), (0, 1)))
    cell = 2 * room * np.eye(2, 3)
    mechanics = RodMechanics(np.ones(4), np.full(4, 1e-6), 1e3, np.full(4, 0.9 * room / 8))
    found = relax_yarns(yarns, cell, mechanics, GIVEN)
    assert found.lengths / (2 * room) - 1.0 == pytest.approx(crimp, rel=0.01)


@pytest.mark.nightly
def test_a_trefoil_is_as_short_as_the_tightest_that_is_known():
    angle = 2 * np.pi * np.arange(60) / 60
    knot = np.stack(
        [
            np.sin(angle) + 2 * np.sin(2 * angle),
            np.cos(angle) - 2 * np.cos(2 * angle),
            -np.sin(3 * angle),
        ],
        axis=1,
    )
    mechanics = RodMechanics(np.ones(1), np.full(1, 1e-9), 4e3, np.array([0.22]))
    found = relax_yarns([Yarn(0.75 * knot, (0, 0))], NO_CELL, mechanics, GIVEN)
    # Przybyl and Pieranski: 16.372 for a hard rope
    rope = found.lengths[0] / (1.0 - found.overlap)
    assert 16.36 < rope < 16.372 * 1.006


def test_stockinette_has_the_loops_of_another_solution():
    found, wale, course = spacings(["k"])
    assert 16 / course == pytest.approx(5.42, rel=0.005)
    assert 16 / wale == pytest.approx(3.97, rel=0.005)
    assert found.overlap < 0.005


@pytest.mark.nightly
def test_short_loops_have_the_shape_of_another_solution():
    cell = relax_knit(["k"], 14.0).cell
    assert 14.0 / cell[1, 1] == pytest.approx(6.11, rel=0.01)
    assert 14.0 / cell[0, 0] == pytest.approx(3.49, rel=0.01)


@pytest.mark.nightly
def test_rib_is_narrow_and_garter_short_and_both_are_thick():
    plain, wale, course = spacings(["k"])
    thick = np.ptp(plain.yarns[0].points[:, 2]) + 1.0
    rib, narrow, _ = spacings(["kp"])
    assert narrow / wale == pytest.approx(0.50, abs=0.03)
    assert (np.ptp(rib.yarns[0].points[:, 2]) + 1.0) / thick == pytest.approx(2.4, abs=0.1)
    _, _, short = spacings(["k", "p"])
    assert 0.69 < short / course < 0.75


@pytest.mark.nightly
@pytest.mark.parametrize("length", [16.0, 25.0])
def test_ten_perturbed_starts_come_to_one_state(length):
    guess, random = draw_loops(plan_passes(["k"]), length), np.random.default_rng(0)
    mechanics = RodMechanics(np.array([1e3]), np.ones(1), CONTACT, np.array([length / POINTS]))
    energies, cells = [], []
    for _ in range(10):
        yarn = guess.yarns[0]
        moved = yarn.points + 0.05 * random.normal(size=yarn.points.shape)
        start = [yarn._replace(points=moved)]
        found = relax_yarns(start, guess.cell, mechanics, RECTANGLE)
        energies.append(found.state.energy)
        cells.append(np.diag(found.cell))
    assert np.ptp(energies) < 1e-4 * energies[0]
    assert np.ptp(cells, axis=0) == pytest.approx(0.0, abs=5e-3 * cells[0].min())


def test_yarns_that_start_in_each_other_are_refused():
    line = np.arange(8.0)
    yarns = [
        Yarn(np.stack([line, 0 * line, 0 * line], axis=1), (1, 0)),
        Yarn(np.stack([0 * line + 4.0, line - 4.0, 0 * line + 0.1], axis=1), (0, 1)),
    ]
    mechanics = RodMechanics(np.ones(2), np.ones(2), 1e3, np.ones(2))
    with pytest.raises(GeometryError, match="not clear which is above"):
        relax_yarns(yarns, 8.0 * np.eye(2, 3), mechanics, GIVEN)


def flat_stiffness(found, count=1, length=16.0):
    mechanics = RodMechanics(
        np.full(count, 1e3), np.ones(count), CONTACT, np.full(count, length / POINTS)
    )
    return mechanics, cell_stiffness(found.yarns, found.cell, mechanics, RECTANGLE)


def test_straight_yarns_bend_as_beams_side_by_side():
    along = np.arange(8) / 8 * 4.0
    yarn = Yarn(np.stack([along, 0 * along, 0 * along], axis=1), (1, 0))
    cell = np.array([[4.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    mechanics = RodMechanics(np.array([1e3]), np.array([2.0]), 1e3, np.array([0.5]))
    found = cell_stiffness([yarn], cell, mechanics, GIVEN)
    assert found.bending[0, 0] == pytest.approx(2.0 / 3.0, rel=1e-4)
    assert found.membrane[0, 0] == pytest.approx(1e3 / 3.0, rel=1e-6)


def test_stockinette_curls_to_the_back_at_its_sides_and_to_the_face_at_its_ends():
    found = spacings(["k"])[0]
    mechanics, stiffness = flat_stiffness(found)
    assert stiffness.moment[0] < -0.1
    assert stiffness.moment[1] > 0.1
    # the membrane against the energies of strained cells, in which the yarns come to rest
    energies = []
    for strain in (-1e-3, 0.0, 1e-3):
        cell = found.cell * [[1.0], [1.0 + strain]]
        energy = RodEnergy(sample_yarns(found.yarns), mechanics)
        energies.append(relax_again(energy, unknowns(found.yarns, cell), GIVEN).energy)
    area = found.cell[0, 0] * found.cell[1, 1]
    second = (energies[0] - 2 * energies[1] + energies[2]) / 1e-6 / area
    assert stiffness.membrane[1, 1] == pytest.approx(second, rel=0.02)


@pytest.mark.nightly
def test_rib_and_garter_do_not_curl():
    for rows in (["kp"], ["k", "p"]):
        stiffness = flat_stiffness(spacings(rows)[0], len(rows))[1]
        # stockinette has 0.15; loops of rib lean by a little to one side
        assert abs(stiffness.moment).max() < 1e-4
        assert np.linalg.eigvalsh(stiffness.membrane).min() > 0.0


def test_frames_do_not_twist_along_a_helix():
    # along a helix a frame without twist turns about the tangent by the torsion
    turn = np.linspace(0.0, 6 * np.pi, 200)
    rise = 0.4
    helix = np.stack([np.cos(turn), np.sin(turn), rise * turn], axis=1)
    lines = spline_lines([helix], np.array([0.2]))
    tangent, normal = np.stack(lines.tangent, axis=1), np.stack(lines.normal, axis=1)
    inwards = -np.stack(lines.place, axis=1) * [1.0, 1.0, 0.0]
    inwards /= np.linalg.norm(inwards, axis=1)[:, None]
    across = np.cross(tangent, inwards)
    angle = np.unwrap(np.arctan2((normal * across).sum(axis=1), (normal * inwards).sum(axis=1)))
    steps = np.linalg.norm(np.diff(np.stack(lines.place), axis=1), axis=0)
    length = np.append(0.0, np.cumsum(steps))
    # the spline's radius is 0.15 % smaller than that of its control points
    assert np.polyfit(length, angle, 1)[0] == pytest.approx(-rise / (1 + rise**2), rel=4e-3)
