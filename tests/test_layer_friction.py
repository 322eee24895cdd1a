"""Friction between layers of cloth, against Coulomb's closed forms and conservation laws."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from test_contact import GRAVITY, PLATE
from test_contact_steps import MASS, THICK, drift, motion_of
from test_self_contact import has_library

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary.time_functions import step, table
from spacemap_vtk.mechanics.contact.layer_friction import (
    LayerFriction,
    LayerStep,
    begin_stepping_layers,
)
from spacemap_vtk.mechanics.contact.obstacle_term import contact_stiffness
from spacemap_vtk.mechanics.contact.resting import Resting, find_resting_state, rested_terms
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.equilibrium.energy_terms import assemble_blocks, assemble_tangent
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion

pytestmark = has_library

CELL = 0.01


class Pile(NamedTuple):
    """Layers of cloth on top of each other."""

    model: Model
    contact: SelfContact
    friction: LayerFriction
    displacement: NDArray[np.float64]
    """(V, 3), from layers side by side to the pile [m]."""
    layer: NDArray[np.int64]
    """(V,), number of the layer of each vertex, from the bottom."""

    @property
    def above(self) -> NDArray[np.bool_]:
        """Vertices above the lowest layer."""
        return self.layer > 0


def pile(mu: float, angle: float = 0.0, layers: int = 2, gap: float = 0.0) -> Pile:
    """Return a held layer and smaller ones on it, whose weight the contact carries on the whole."""
    points, cells, layer = [], [], []
    for number in range(layers):
        size = (5, 3) if number == 0 else (2, 2)
        x = 0.2 * number
        box = (x, x + size[0] * CELL, 0, size[1] * CELL, -THICK / 2, THICK / 2)
        own, tetrahedra = build_lattice(box, (*size, 1))
        cells.append(tetrahedra + sum(map(len, points)))
        points.append(own)
        layer.append(np.full(len(own), number))
    vertices, tetrahedra, number = map(np.concatenate, (points, cells, layer))
    surface = find_mid_surface(vertices, tetrahedra)
    assert surface is not None
    given = vertices, surface, THICK, contact_stiffness(PLATE, CELL)
    contact, friction = SelfContact(*given), LayerFriction(SelfContact(*given), mu)
    fixed = np.repeat((number == 0)[:, None], 3, axis=1)
    terms: list[Any] = [contact, friction]
    model = Model(vertices, tetrahedra, PLATE, MASS / THICK, fixed, terms=terms)
    moved = np.zeros(vertices.shape)
    for k in range(1, layers):
        moved[number == k] = [5.2e-3 + 1e-3 * k - 0.2 * k, 4.8e-3, 1.45 * k * THICK]
    weight = model.nodal_mass[number > 0].sum() * GRAVITY * math.cos(angle)

    def surplus(height: float) -> float:
        moved[number > 0, 2] = height * number[number > 0]
        held: float = contact.forces(vertices + moved)[number > 0, 2].sum()
        return held + weight

    if gap == 0.0:
        gap = brentq(surplus, 1.02 * THICK, 1.5 * THICK, xtol=1e-14)
    surplus(gap)
    return Pile(model, contact, friction, moved, number)


def mean_path(found: Pile, motion: SteppedMotion, times: Any) -> NDArray[np.float64]:
    """Return the mean displacement along x of the upper layer since the start."""
    weights = found.above / found.above.sum()
    x = motion.history(weights, np.append(0.0, times))[0, :, 0]
    return np.asarray(x[1:] - x[0])


def test_forces_and_tangent_are_derivatives_of_the_energy() -> None:
    """Of sides that stick, and of sides that slide."""
    found = pile(0.3, gap=1.2 * THICK)
    random = np.random.default_rng(0)
    place = found.model.points + found.displacement
    place += 1e-6 * random.normal(size=place.shape)
    term = found.friction.advance_friction(place)
    place = place + np.where(found.above[:, None], [2e-5, 1e-5, 0], 0)
    place[:, 0] += 2e-5 * random.normal(size=len(place))
    touching, sliding = term.evaluate(place).count()
    assert 0 < sliding < touching
    way = random.normal(size=place.shape)
    ahead, behind = place + 1e-10 * way, place - 1e-10 * way
    slope = (term.energy(ahead) - term.energy(behind)) / 2e-10
    assert slope == pytest.approx(float(np.vdot(term.forces(place), way)), rel=1e-5)
    change = (term.forces(ahead) - term.forces(behind)) / 2e-10
    expected = (assemble_tangent([term], place) @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(change, expected, atol=1e-5 * abs(expected).max())


def test_every_side_carries_what_presses_on_it() -> None:
    """Both sides of the middle one of three layers, too; each side has half of the friction."""
    found = pile(0.3, layers=3, gap=1.3 * THICK)
    place = found.model.points + found.displacement
    grips = found.friction.find_grips(found.contact.to_middle(place))
    held = found.contact.forces(place)[:, 2]
    lowest, middle, top = (-held[found.layer == k].sum() for k in range(3))
    assert lowest < 0.0 < top
    surface = found.model.pencil.surface
    assert surface is not None
    layers = found.layer[surface.pairs[:, 0]][grips.sides // 2]
    below, above = (grips.press[(layers == 1) & (grips.sides % 2 == k)].sum() for k in range(2))
    assert below == pytest.approx(-lowest, rel=1e-9)
    assert above == pytest.approx(top, rel=1e-9)
    assert middle == pytest.approx(below - above, rel=1e-6)


def test_work_of_a_step_is_what_the_energy_loses_and_its_tangent_is_exact() -> None:
    found = pile(0.3, gap=1.2 * THICK)
    random = np.random.default_rng(1)
    start = found.model.points + found.displacement
    start += 1e-6 * random.normal(size=start.shape)
    begun = begin_stepping_layers(found.friction, start)
    slip = begun.slip.copy()
    touching = begun.begin_step(start, 0.0, 0.0)._grips.sides
    slip[touching, :2] = 1e-7 * random.normal(size=(len(touching), 2))
    begun = begun.with_slip(slip)
    end = start + 1e-5 * random.normal(size=start.shape)
    moves: LayerStep = begun.begin_step(start, 0.0, 1.0)
    later, lost, work = moves.finish(end)
    done = float(np.vdot(moves.forces(end), end - start))
    assert done == pytest.approx(later.energy(end) - begun.energy(start) + lost, rel=1e-12)
    assert lost > 0.0 == work
    moves.forces(end)
    begun.follow(end)
    way = random.normal(size=start.shape)
    change = (moves.forces(end + 1e-10 * way) - moves.forces(end - 1e-10 * way)) / 2e-10
    matrix = assemble_blocks([(begun.nodes, moves.tangent(end))], start.size)
    expected = (matrix @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(change, expected, atol=1e-5 * abs(expected).max())


def test_layer_slides_down_another_with_the_acceleration_of_coulomb() -> None:
    """a = g (sin α - μ cos α); friction dissipates μ m g cos α for each metre."""
    angle, mu = math.radians(30), 0.3
    found = pile(mu, angle)
    down = GRAVITY * math.sin(angle), GRAVITY * math.cos(angle)
    # The steps resolve how the layer springs on the barrier.
    motion = motion_of(
        found.model,
        (down[0], 0, -down[1]),
        displacement=found.displacement,
        tolerance=0.1,
        max_step=4e-4,
    )
    x = mean_path(found, motion, [0.01, 0.015, 0.02])
    assert (x[2] - 2 * x[1] + x[0]) / 0.005**2 == pytest.approx(down[0] - mu * down[1], rel=5e-3)
    friction = np.diff(motion.contact_energies(np.array([0.01, 0.02]))[:, 0])
    mass = MASS * (2 * CELL) ** 2
    assert friction[0] == pytest.approx(mu * mass * down[1] * (x[2] - x[0]), rel=0.01)
    assert drift(motion) < 1e-10


def test_layer_on_a_slope_below_the_angle_of_friction_stays() -> None:
    """It moves by what the springs of friction give way, and then stays there."""
    angle, mu = math.radians(16), 0.3
    found = pile(mu, angle)
    cage = CageModes(found.model, np.empty(0), np.empty((0, found.model.points.size)), np.empty(0))
    pull = GRAVITY * math.sin(angle)
    loads = [
        cage.load_vector("gravity", (pull, 0, 0), table([0.0, 0.02], [0.0, 1.0])),
        cage.load_vector("gravity", (0, 0, -GRAVITY * math.cos(angle)), step()),
    ]
    motion = SteppedMotion(
        cage, loads, Damping(alpha=400.0), displacement=found.displacement, tolerance=0.1
    )
    x = mean_path(found, motion, [0.05, 0.1, 0.2])
    assert x == pytest.approx(MASS * pull / found.contact.stiffness, rel=0.02)
    assert abs(x[2] - x[1]) < 1e-2 * x[0]
    assert drift(motion) < 1e-8


def test_layer_that_is_pulled_resists_with_the_friction_of_its_weight() -> None:
    """At rest; its end is held and pulled in steps, first within the springs, then beyond."""
    mu = 0.3
    found = pile(mu)
    model, points = found.model, found.model.points
    end = found.above & (points[:, 0] < 0.2 + 1e-9)
    held = ~model.free.reshape(-1, 3)
    held[end] = True
    model = Model(points, model.cells, PLATE, model.density, held, terms=model.terms)
    weight = np.outer(model.nodal_mass, (0, 0, -GRAVITY)).ravel()
    start = Resting(found.displacement, np.empty((0, 3)))
    state = find_resting_state(model, weight, start=start)
    pulls = []
    for move in (0.0, 1e-7, 2e-6, 2e-6):
        moved = state.displacement.copy()
        moved[end, 0] -= move
        state = find_resting_state(model, weight, start=Resting(moved, state.anchors))
        place = points + state.displacement
        rubbing = rested_terms(model.terms, place, state.anchors)[1]
        assert isinstance(rubbing, LayerFriction)
        pulled = -rubbing.forces(place)[found.above, 0].sum()
        pressed = -found.contact.forces(place)[found.above, 2].sum()
        pulls.append(pulled / pressed)
    assert pulls[0] == pytest.approx(0.0, abs=1e-3)
    assert 0.01 < pulls[1] < 0.9 * mu
    assert pulls[2:] == pytest.approx([mu, mu], rel=1e-3)


def test_states_computed_elsewhere_continue_with_their_friction() -> None:
    found = pile(0.3)

    def begin() -> SteppedMotion:
        way = GRAVITY * math.sin(0.2), 0.0, -GRAVITY
        return motion_of(found.model, way, displacement=found.displacement, tolerance=1.0)

    first, second = begin(), begin()
    first.step_until(0.005)
    assert abs(first.slips).max() > 0.0
    assert not second.resume(first.states.copy())
    assert second.resume(first.states.copy(), first.slips)
    # The length of a step depends on the tangent, which is computed anew.
    moved = [mean_path(found, motion, [0.006]) for motion in (first, second)]
    assert moved[1] == pytest.approx(moved[0], rel=0.05)
