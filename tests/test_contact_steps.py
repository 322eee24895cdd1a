"""Time steps of cloth that touches obstacles, against closed forms and conservation laws."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_contact import (
    GRAVITY,
    PLATE,
    SCENE,
    rest,
    sheet,
)

from spacemap_vtk.datasets.modal_model import bodies_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.obstacle import Obstacle as ObstacleRecord
from spacemap_vtk.mechanics.boundary.time_functions import step, table
from spacemap_vtk.mechanics.contact.obstacle_step import (
    ObstacleStep,
    SteppedObstacle,
    begin_stepping,
)
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.obstacles import BodyMotion, Cylinder, Obstacle, Plane, Sphere
from spacemap_vtk.mechanics.equilibrium.energy_terms import assemble_blocks
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion
from spacemap_vtk.scenes.scene import Scene

FloatArray = NDArray[np.float64]
#: Thickness of the cloths [m], and their mass per area [kg/m²].
THICK, MASS = 3e-4, 0.15


def cloth(side: float, cells: int, body: Obstacle, mu: float = 0.0) -> Model:
    """Return a free square cloth around the origin."""
    half = side / 2
    points, tetrahedra, terms = sheet((-half, half, -half, half), (cells, cells), [body], mu, THICK)
    free = np.zeros(points.shape, dtype=bool)
    return Model(points, tetrahedra, PLATE, MASS / THICK, free, terms=terms)


def motion_of(model: Model, gravity: Any = (0, 0, -GRAVITY), **options: Any) -> SteppedMotion:
    """Return the motion of a model from t = 0 on, with a gravity that begins there."""
    cage = CageModes(model, np.empty(0), np.empty((0, model.points.size)), np.empty(0))
    options.setdefault("damping", Damping())
    return SteppedMotion(cage, [cage.load_vector("gravity", gravity, step())], **options)


def middle(motion: SteppedMotion, times: Any) -> FloatArray:
    """Return the mean displacement of the vertices, (t, 3)."""
    count = len(motion.points)
    return motion.history(np.full(count, 1 / count), np.atleast_1d(times))[0]


def drift(motion: SteppedMotion) -> float:
    """Return how far the sum of all energies departs from its start, as a share of the kinetic."""
    kinetic, held, lost, work = motion.energies(motion.states[:-1, 0]).T
    total = kinetic + held + lost - work
    return float(abs(total - total[0]).max() / kinetic.max())


def samples_of(motion: SteppedMotion, row: FloatArray) -> FloatArray:
    """Return the positions of the samples of the first obstacle in a state, (E, m, 3)."""
    (term, *_) = motion._obstacles()
    head = motion._head
    nodal = motion._integrator._nodal(row[head : head + (len(row) - head) // 2])
    return term.obstacle_term.samples.positions(nodal)


@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_work_of_a_step_is_what_the_energy_loses(mu: float) -> None:
    """For any move of the nodes; what friction dissipates and the obstacle does is counted."""
    points, _, (term,) = sheet((0, 1, 0, 1), (3, 3), [Sphere(1.0, (0.4, 0.5, -0.97))], mu, 0.1)
    assert isinstance(term, ObstacleTerm)
    random = np.random.default_rng(0)
    begun = begin_stepping(term, points)
    slip = 0.002 * random.normal(size=begun.slip.shape) * (mu > 0)
    begun = SteppedObstacle(begun.obstacle_term, slip)
    start = points + 0.003 * random.normal(size=points.shape)
    end = start + 0.02 * random.normal(size=points.shape)
    moves = ObstacleStep(begun, start, np.array([0.001, 0.0, 0.002]))
    later, lost, work = moves.finish(end)
    gained = later.energy(end) - begun.energy(start)
    held = float(np.vdot(moves.forces(end), end - start))
    assert held == pytest.approx(gained + lost - work, rel=1e-12)
    assert (lost > 0) == (mu > 0)


def test_tangent_of_a_step_is_the_derivative_of_its_forces() -> None:
    points, _, (term,) = sheet((0, 1, 0, 1), (3, 3), [Sphere(1.0, (0.4, 0.5, -0.97))], 0.0, 0.1)
    random = np.random.default_rng(1)
    start = points + 0.003 * random.normal(size=points.shape)
    end = start + 0.02 * random.normal(size=points.shape)
    moves = ObstacleStep(begin_stepping(term, start), start, np.zeros(3))
    way = random.normal(size=points.shape)
    change = (moves.forces(end + 1e-7 * way) - moves.forces(end - 1e-7 * way)) / 2e-7
    matrix = assemble_blocks([(term.nodes, moves.tangent(end))], points.size)
    expected = (matrix @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(change, expected, atol=1e-5 * abs(expected).max())


def test_cloth_that_falls_flat_bounces_back_to_where_it_was() -> None:
    """It turns within half a period of its springs, and rises as it fell."""
    model, height = cloth(0.1, 4, Plane((0, 0, -5e-3))), 5e-3 - THICK / 2
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    motion = motion_of(model, max_step=1e-3)
    rate = math.sqrt(term.stiffness / MASS)
    speed = math.sqrt(2 * GRAVITY * height)
    # On the springs it swings about the depth at rest.
    depth = GRAVITY / rate**2
    touching = 2 * (math.pi - math.atan2(speed / rate, depth)) / rate
    back = 2 * speed / GRAVITY + touching
    assert middle(motion, back)[0, 2] == pytest.approx(0.0, abs=2e-6)
    lowest = middle(motion, back / 2)[0, 2]
    assert -lowest - height == pytest.approx(depth + math.hypot(depth, speed / rate), rel=1e-3)
    assert drift(motion) < 1e-10


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_cloth_that_falls_onto_a_sphere_keeps_its_energy(mu: float) -> None:
    motion = motion_of(cloth(0.2, 6, Sphere(0.05, (0, 0, -0.055)), mu), tolerance=0.1)
    motion.step_until(0.07)
    assert drift(motion) < 1e-10
    friction, pushed = motion.contact_energies(motion.states[:-1, 0]).T
    assert pushed.max() == 0.0
    assert (np.diff(friction) >= 0.0).all()
    assert (friction[-1] > 0.0) == (mu > 0.0)


@pytest.mark.parametrize("speed", [1.0, 30.0])
def test_nothing_passes_through_a_thin_disc(speed: float) -> None:
    """In the longest step the cloth would move by a hundred times the disc's thickness, or more."""
    disc = Cylinder(0.1, 2e-4, 1e-4, (0, 0, -5e-3))
    model = cloth(0.05, 3, disc)
    velocity = np.tile([0.0, 0.0, -speed], (len(model.points), 1))
    motion = motion_of(model, velocity=velocity, tolerance=math.inf)
    motion.step_until(12e-3 / speed)
    lowest = min(samples_of(motion, row)[..., 2].min() for row in motion.states)
    assert -5e-3 < lowest < -5e-3 + 1e-4 + THICK / 2
    later = motion.at_time(11e-3 / speed)[1, :, 2].mean()
    assert later == pytest.approx(speed, rel=0.02)
    assert drift(motion) < 1e-9


def test_cloth_slides_down_a_slope_with_the_acceleration_of_coulomb() -> None:
    """a = g (sin α - μ cos α); friction dissipates μ m g cos α for each metre."""
    angle, mu = math.radians(30), 0.3
    down = GRAVITY * math.sin(angle), GRAVITY * math.cos(angle)
    model, _ = rest(cloth(0.1, 4, Plane((0, 0, -1e-3)), mu), (0, 0, -down[1]))
    motion = motion_of(model, (down[0], 0, 0))
    x = middle(motion, [0.1, 0.15, 0.2])[:, 0]
    assert (x[2] - 2 * x[1] + x[0]) / 0.05**2 == pytest.approx(down[0] - mu * down[1], rel=1e-4)
    friction = np.diff(motion.contact_energies(np.array([0.1, 0.2]))[:, 0])
    # Energies are linear between the states.
    assert friction[0] == pytest.approx(mu * MASS * 0.01 * down[1] * (x[2] - x[0]), rel=0.02)
    assert drift(motion) < 1e-10


def test_cloth_on_a_slope_below_the_angle_of_friction_stays() -> None:
    """It moves by what the springs of friction give way, and hardly any energy is dissipated."""
    angle = math.radians(16)
    model, _ = rest(cloth(0.1, 4, Plane((0, 0, -1e-3)), 0.3), (0, 0, -GRAVITY * math.cos(angle)))
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    # The load rises slowly, so that friction carries no more than it.
    cage = CageModes(model, np.empty(0), np.empty((0, model.points.size)), np.empty(0))
    pull = GRAVITY * math.sin(angle)
    load = cage.load_vector("gravity", (pull, 0, 0), table([0.0, 0.05], [0.0, 1.0]))
    motion = SteppedMotion(cage, [load], Damping(alpha=200.0), tolerance=0.1)
    moved = middle(motion, [0.1, 0.2])[:, 0]
    np.testing.assert_allclose(moved, MASS * pull / term.stiffness, rtol=1e-2)
    assert motion.contact_energies(np.array([0.2]))[0, 0] < 0.1 * MASS * 0.01 * pull * moved[1]


def test_belt_carries_a_cloth_along() -> None:
    """It slides for v/(μ g); friction then has dissipated m v²/2, and the belt has done m v²."""
    mu, speed = 0.3, 0.5
    model, _ = rest(cloth(0.1, 4, Plane((0, 0, -1e-3)), mu))
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    along = BodyMotion(np.array([1.0, 0, 0]), table([0.0, 10.0], [0.0, 10.0 * speed]))
    model.terms = (term.replace(motion=along),)
    motion = motion_of(model, (0, 0, 0), tolerance=1e-2)
    slides = speed / (mu * GRAVITY)
    moved = middle(motion, [0.9 * slides, 1.1 * slides, 1.6 * slides])[:, 0]
    assert moved[0] == pytest.approx(mu * GRAVITY * (0.9 * slides) ** 2 / 2, rel=5e-3)
    assert moved[2] - moved[1] == pytest.approx(speed * slides / 2, rel=5e-3)
    friction, work = motion.contact_energies(np.array([1.6 * slides]))[0]
    mass = MASS * 0.01
    assert friction == pytest.approx(mass * speed**2 / 2, rel=5e-3)
    assert work == pytest.approx(mass * speed**2, rel=5e-3)
    assert drift(motion) < 1e-10


def test_plate_that_rises_does_the_work_of_lifting() -> None:
    """m g h, once the cloth is at rest again; it starts and stops smoothly."""
    height, rise = 0.02, 0.2
    times = np.linspace(0.0, rise, 41)
    model, _ = rest(cloth(0.1, 4, Plane((0, 0, -1e-3))))
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    lift = table(times, (1 - np.cos(math.pi * times / rise)) / 2)
    model.terms = (term.replace(motion=BodyMotion(np.array([0, 0, height]), lift)),)
    motion = motion_of(model, (0, 0, 0), tolerance=0.1)
    assert middle(motion, 1.5 * rise)[0, 2] - middle(motion, 0.0)[0, 2] == pytest.approx(
        height, rel=1e-2
    )
    work = motion.contact_energies(np.array([1.5 * rise]))[0, 1]
    assert work == pytest.approx(MASS * 0.01 * GRAVITY * height, rel=1e-2)
    assert drift(motion) < 1e-10


def test_cloth_at_rest_on_a_sphere_stays_there() -> None:
    """With the friction of the equilibrium; its unbalanced forces cause small vibrations."""
    model, found = rest(cloth(0.1, 6, Sphere(0.05, (0, 0, -0.06)), 0.3))
    motion = motion_of(model, (0, 0, 0), tolerance=0.1)
    moved = motion.at_time(0.02)[0] - found.displacement
    assert abs(moved).max() < 1e-6 * 0.1


def test_states_computed_elsewhere_continue_with_their_friction() -> None:
    def begin() -> SteppedMotion:
        model = cloth(0.1, 4, Sphere(0.05, (0, 0, -0.055)), 0.3)
        return motion_of(model, (1.0, 0, -GRAVITY), tolerance=0.1, damping=Damping(beta=1e-4))

    whole, first, second = begin(), begin(), begin()
    whole.step_until(0.05)
    first.step_until(0.04)
    assert abs(first.slips).max() > 0.0
    assert not second.resume(first.states.copy())
    assert second.resume(first.states.copy(), first.slips)
    # The length of a step depends on the tangent, which is computed anew.
    moved = [motion.at_time(0.05)[0] for motion in (whole, second)]
    np.testing.assert_allclose(moved[1], moved[0], atol=1e-4 * abs(moved[0]).max())


def test_cloth_beyond_the_middle_of_an_obstacle_is_refused() -> None:
    disc = Cylinder(0.1, 2e-3, 1e-3)
    with pytest.raises(InputError, match="reaches through an obstacle at the start"):
        motion_of(cloth(0.05, 3, disc))


FALL = (
    SCENE.replace("[modal]", "[modal]\nhang = false")
    + """
[transient]
tolerance = 0.1
beta = "0.1 ms"
"""
).replace("[8, 8, 1]", "[6, 6, 1]")


def test_scene_with_obstacles_reports_what_friction_dissipates(tmp_path: Path) -> None:
    (tmp_path / "fall.toml").write_text(FALL, encoding="utf-8")
    scene = Scene.read(tmp_path / "fall.toml")
    scene.update(0.1)
    field = scene.cage_stage.output.GetFieldData()
    names = "kinetic_energy", "strain_energy", "dissipated_energy", "external_work"
    kinetic, held, lost, work = (field.GetArray(name).GetValue(0) for name in names)
    assert kinetic + held + lost == pytest.approx(work, rel=1e-9)
    assert 0.0 < field.GetArray("friction_energy").GetValue(0) < lost
    assert field.GetArray("obstacle_work").GetValue(0) == 0.0


def test_scene_with_a_moving_obstacle_shows_where_it_is(tmp_path: Path) -> None:
    """A linear motion about its place at t = 0 refuses it."""
    moving = SCENE.replace("[modal]", "[modal]\nhang = false")
    moving = moving.replace("friction = 0.3", 'displacement = [0, 0, "-10 mm"]\nrise = "20 ms"')
    (tmp_path / "moving.toml").write_text(
        moving + "[transient]\ntolerance = 1.0\n", encoding="utf-8"
    )
    scene = Scene.read(tmp_path / "moving.toml")
    scene.update(0.01)
    (body,) = bodies_of(scene.cage_stage.output)
    np.testing.assert_allclose(body["center"], [0.0, 0.0, -0.025])
    (tmp_path / "linear.toml").write_text(moving + "[response]\n", encoding="utf-8")
    with pytest.raises(InputError, match="does not support obstacles that move") as error:
        Scene.read(tmp_path / "linear.toml").update(0.0)
    assert "[transient]" in str(error.value)


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"rise": 0.1}, "rise"),
        ({"displacement": (0, 0, 1)}, "rise"),
        ({"displacement": (0, 0, 1), "time": "table", "times": (0, 1), "values": (1, 2)}, "values"),
        (
            {"displacement": (0, 0, 1), "time": "table", "times": (0, 1, 1), "values": (0, 1, 2)},
            "values",
        ),
        ({"displacement": (0, 0, 1), "time": "harmonic", "frequency": 2.0, "rise": 1.0}, "rise"),
    ],
)
def test_motions_that_jump_or_lack_a_value_are_refused(given: Any, key: str) -> None:
    with pytest.raises(InputError) as error:
        ObstacleRecord(shape="plane", **given)
    assert error.value.key == key
