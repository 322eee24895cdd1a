"""Yarns that are set in their shape: closed forms, derivatives, and strained cells."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.filters.textile_sheet import law_of_textile, sheet_of_textile
from spacemap_vtk.filters.textiles.braid import Braid
from spacemap_vtk.filters.textiles.kind import TextileKind
from spacemap_vtk.filters.textiles.knit import Knit
from spacemap_vtk.filters.textiles.warp_knit import WarpKnit
from spacemap_vtk.filters.textiles.woven import Layers, Leno, Mesh
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics, State
from spacemap_vtk.textile.rods.relax import LAST, Relaxed, relax_yarns
from spacemap_vtk.textile.rods.stiffness import cell_area, set_stiffness
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

MM = 1e-3
HELD = np.zeros((2, 3), dtype=bool)
NO_CELL = np.zeros((2, 3))


def evaluate(yarn: Yarn, at_rest: Yarn, bending: float = 1.0) -> State:
    """Return the state of a yarn that is set in another shape, and hardly resists stretch."""
    mechanics = RodMechanics(
        np.full(1, 1e-9), np.full(1, bending), 0.0, np.ones(1), set_in=unknowns([at_rest], NO_CELL)
    )
    energy, z = RodEnergy(sample_yarns([yarn]), mechanics), unknowns([yarn], NO_CELL)
    return energy.evaluate(z, energy.pairs_within(z, 0.1))


def draw_arc(radius: float, angle: float, count: int = 60) -> Yarn:
    """Draw an arc, whose spline is as long as that of a straight yarn of equal length."""
    step = angle / (count - 3)
    turn = step * (np.arange(count) - (count - 1) / 2)
    # the spline of points on a circle is nearer to its middle by a share of (1 - cos step)/3
    away = radius / (1.0 - (1.0 - np.cos(step)) / 3)
    points = np.stack([away * np.sin(turn), away * np.cos(turn), 0 * turn], axis=1)
    return Yarn(points, None, 0.01)


def draw_line(length: float, count: int = 60) -> Yarn:
    """Draw a straight yarn along x."""
    along = length / (count - 3) * (np.arange(count) - (count - 1) / 2)
    return Yarn(np.stack([along, 0 * along, 0 * along], axis=1), None, 0.01)


def test_an_arc_has_no_energy_where_it_is_set_and_all_of_its_bending_when_straight():
    radius, angle = 2.0, np.radians(140.0)
    arc, line = draw_arc(radius, angle), draw_line(radius * angle)
    assert evaluate(arc, arc).energy == pytest.approx(0.0, abs=1e-12)
    # ½ B κ₀² L, both ways
    full = 0.5 / radius**2 * radius * angle
    assert evaluate(line, arc).parts[1] == pytest.approx(full, rel=1e-3)
    assert evaluate(arc, line).parts[1] == pytest.approx(full, rel=1e-3)
    # bent the other way round: twice the curvature
    back = arc._replace(points=arc.points * [1.0, -1.0, 1.0])
    assert evaluate(back, arc).parts[1] == pytest.approx(4 * full, rel=1e-3)


def test_a_wider_ring_has_the_energy_of_its_change_of_curvature():
    angle = 2 * np.pi / 40 * np.arange(40)
    ring = Yarn(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), (0, 0), 0.01)
    wide = ring._replace(points=1.5 * ring.points)
    change = 1.0 - 1.0 / 1.5
    found = evaluate(wide, ring, 3.0).parts[1]
    assert found == pytest.approx(0.5 * 3.0 * change**2 * 2 * np.pi, rel=0.01)


@pytest.mark.parametrize("size", [0.0, 0.05])
def test_gradient_and_tangent_of_set_yarns_are_derivatives(size):
    random = np.random.default_rng(0)
    yarns = [
        Yarn(random.normal(size=(8, 3)), (1, 0), 1.0),
        Yarn(random.normal(size=(7, 3)), None, 0.8),
    ]
    cell = np.array([[3.0, 0.1, 0.2], [0.3, 2.5, -0.1]])
    rest, step = unknowns(yarns, cell), 1e-6
    mechanics = RodMechanics(
        np.array([3.0, 2.0]), np.full(2, 0.6), 40.0, np.array([0.1, 0.1]), set_in=rest
    )
    energy = RodEnergy(sample_yarns(yarns), mechanics)
    z = rest + size * random.normal(size=rest.shape)
    move = random.normal(size=rest.shape)
    pairs = energy.pairs_within(z, 1.5)
    here, ahead, back = (energy.evaluate(z + k * step * move, pairs) for k in (0.0, 1.0, -1.0))
    if size == 0.0:
        # no force where they are set, not even of those that overlap there
        assert abs(here.gradient).max() < 1e-10
        exact, convex = here.tangent(), here.tangent(1.0)
        assert abs(exact - convex).max() < 1e-12 * abs(exact).max()
        return
    assert here.parts[2] > 0.0
    slope = (ahead.energy - back.energy) / (2 * step)
    assert np.vdot(here.gradient, move) == pytest.approx(slope, rel=1e-8)
    turn = (ahead.gradient - back.gradient).ravel() / (2 * step)
    assert here.tangent() @ move.ravel() == pytest.approx(turn, abs=1e-8 * abs(turn).max())


def strain(kind: TextileKind, path: list[tuple[float, float]]) -> tuple[Relaxed, float]:
    """Strain the cell of set yarns in steps; return the last state, and its area at rest."""
    rest = kind.rest()
    mechanics = kind.mechanics_of_sheet(rest)._replace(set_in=unknowns(rest.yarns, rest.cell))
    yarns, before = rest.yarns, np.ones(3)
    for x, y in path:
        now = np.array([1.0 + x, 1.0 + y, 1.0])
        moved = [yarn._replace(points=yarn.points * now / before) for yarn in yarns]
        state = relax_yarns(moved, rest.cell * now, mechanics, HELD, stages=[LAST])
        yarns, before = state.yarns, now
    return state, float(rest.cell[0, 0] * rest.cell[1, 1])


def test_a_mesh_that_is_pulled_has_its_linear_stiffness_and_none_where_wires_part():
    mesh = Mesh(diameter=MM, spacing=3 * MM, weft_spacing=3 * MM, tension=60.0, bending=2e-8)
    rest = mesh.rest()
    stiff = set_stiffness(rest.yarns, rest.cell, mesh.mechanics_of_sheet(rest)).membrane
    for way in ((1.0, 0.0), (0.6, 0.8)):
        pulled, area = strain(mesh, [(0.003 * way[0], 0.003 * way[1])])
        linear = 0.5 * 0.003**2 * np.array(way) @ stiff[:2, :2] @ way
        assert pulled.state.energy / area == pytest.approx(linear, rel=0.05)
    pressed, area = strain(mesh, [(-0.003, 0.0)])
    assert pressed.state.energy / area < 0.02 * 0.5 * 0.003**2 * stiff[0, 0]


KINDS: dict[str, TextileKind] = {
    "mesh": Mesh(diameter=MM, spacing=3 * MM, weft_spacing=3 * MM, tension=60.0, bending=2e-8),
    "leno": Leno(diameter=MM, tension=60.0, bending=2e-8),
    "tricot": WarpKnit(diameter=MM, tension=60.0, bending=2e-8),
    "blocked": Knit(diameter=MM, wale_spacing=5 * MM, tension=60.0, bending=2e-8),
    "orthogonal": Layers(layers=2, diameter=MM, tension=60.0, bending=2e-8),
}


@pytest.mark.nightly
@pytest.mark.parametrize("name", KINDS)
def test_the_law_of_set_yarns_has_the_energies_of_its_strained_cell(name):
    kind = KINDS[name]
    law, membrane = law_of_textile(kind), sheet_of_textile(kind).plate.membrane
    unit = kind.require_bending() / kind.scale**3
    # between two rays
    for x, y, most in ((0.02, 0.03, 0.1), (0.06, 0.035, 0.1), (-0.01, -0.03, 0.15)):
        state, area = strain(kind, [(k / 4 * x, k / 4 * y) for k in (1, 2, 3, 4)])
        energy = state.state.energy / area * unit
        found = law.respond(np.array([1.0 + x]), np.array([1.0 + y]), np.zeros(1)).energy[0]
        assert found == pytest.approx(energy, rel=most)
    at_rest = law.evaluate(np.zeros((1, 3))).tangent[0]
    # loops that hold each other at few places part in any strain; crossings are pressed by a pull
    share = at_rest[0, 0] / membrane[0, 0]
    assert share < 0.3 if name in ("tricot", "blocked") else share == pytest.approx(1.0, rel=1e-3)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["mesh", "leno", "tricot"])
def test_set_yarns_that_are_pulled_with_free_sides_contract_as_their_cell_does(name):
    from scipy.optimize import brentq

    kind = KINDS[name]
    law, rest = law_of_textile(kind), kind.rest()
    mechanics = kind.mechanics_of_sheet(rest)._replace(set_in=unknowns(rest.yarns, rest.cell))
    width_is_free = np.array([[True, False, False], [False, False, False]])
    yarns, cell, before = rest.yarns, rest.cell, 1.0
    unit = kind.require_bending() / kind.scale**3
    for stretch in (1.005, 1.01, 1.02, 1.03, 1.05):
        ratio = np.array([1.0, stretch / before, 1.0])
        moved = [yarn._replace(points=yarn.points * ratio) for yarn in yarns]
        state = relax_yarns(moved, cell * ratio, mechanics, width_is_free, stages=[LAST])
        yarns, cell, before = state.yarns, state.cell, stretch
    force = state.state.gradient[-1, 1] / rest.cell[0, 0] * unit

    def pull(width: float) -> np.ndarray:
        return law.respond(np.array([width]), np.array([stretch]), np.zeros(1)).first[:2, 0]

    width = brentq(lambda x: pull(x)[0], 0.8, 1.05)
    assert width == pytest.approx(cell[0, 0] / rest.cell[0, 0], abs=0.01)
    assert pull(width)[1] == pytest.approx(force, rel=0.3)


def test_a_plait_that_is_pulled_is_as_stiff_as_its_yarns_and_stiffens():
    braid = Braid(form="flat", carriers=3, diameter=MM, tension=60.0, bending=2e-8)
    law, plate = law_of_textile(braid), sheet_of_textile(braid).plate
    stretch = np.array([1.0, 1.002, 1.01, 1.03])
    none = np.zeros(4)
    pulled = law.respond(none + 1.0, stretch, none).first[1]
    modulus = 1.0 / np.linalg.inv(plate.membrane)[1, 1]
    rest, kind_unit = braid.rest(), braid.require_bending() / braid.scale**3
    mechanics = braid.mechanics_of_sheet(rest)._replace(set_in=unknowns(rest.yarns, rest.cell))
    ratio = np.array([1.0, 1.01, 1.0])
    moved = [yarn._replace(points=yarn.points * ratio) for yarn in rest.yarns]
    state = relax_yarns(moved, rest.cell * ratio, mechanics, HELD, stages=[LAST])
    width = cell_area(rest.yarns, rest.cell) / rest.cell[1, 1]
    assert pulled[2] == pytest.approx(state.state.gradient[-1, 1] / width * kind_unit, rel=0.05)
    assert (np.diff(np.diff(pulled) / np.diff(stretch)) > 0.0).all()
    assert law.evaluate(np.zeros((1, 3))).tangent[0, 1, 1] == pytest.approx(modulus, rel=0.02)
    # pressed, it only bends
    pressed = law.respond(np.ones(1), np.array([0.99]), np.zeros(1)).first[1, 0]
    assert -0.01 * pulled[2] < pressed < 0.0
