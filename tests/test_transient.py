"""Steps of the nonlinear equations: pendulums, energy, small motions, order, going on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from spacemap_vtk import memory
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.mechanics.boundary import time_functions
from spacemap_vtk.mechanics.boundary.time_functions import step
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.response.cage_response import Motion, Response
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion

FloatArray = NDArray[np.float64]

#: Length of a pendulum [m], gravity [m/s²], and the period of its small swings [s].
LENGTH, GRAVITY = 0.2, 9.81
PERIOD = 2 * np.pi * np.sqrt(2 * LENGTH / 3 / GRAVITY)


def cage_of(model: Model) -> CageModes:
    """Return a cage without modes."""
    return CageModes(model, np.empty(0), np.empty((0, model.points.size)), np.empty(0))


def pendulum(degrees: float, loaded: bool = True, **options: Any) -> SteppedMotion:
    """Return a stiff sheet, hinged at its edge x = 0, let go at an angle."""
    thickness = 1e-4
    points, cells = build_lattice((-LENGTH, 0, 0, 0.05, -thickness / 2, thickness / 2), (2, 1, 1))
    plane = np.diag([1.0, 1.0, 0.5])
    plate = Plate(1e4 * plane, 1.0 * plane, 1e4 * np.eye(2), 1e4)
    # One end of each pair: the other turns about it.
    held = np.repeat((abs(points[:, :1]) < 1e-12) & (points[:, 2:] < 0), 3, axis=1)
    model = Model(points, cells, plate, 10000.0, held)
    cage = cage_of(model)
    angle, hinge = np.radians(degrees), np.array([0.0, 0.0, -thickness / 2])
    turn = np.array(
        [[np.sin(angle), 0, -np.cos(angle)], [0, 1, 0], [np.cos(angle), 0, np.sin(angle)]]
    )
    moved = hinge + (points - hinge) @ turn.T - points
    load = cage.load_vector("gravity", (0, 0, -GRAVITY), step())
    return SteppedMotion(cage, [load] if loaded else [], displacement=moved, **options)


def passages(motion: SteppedMotion, until: float) -> FloatArray:
    """Return when the end of a pendulum passes its lowest place."""
    times = np.linspace(0.0, until, 400)
    weights = (motion.points[:, 0] < 1e-9 - LENGTH) / 4
    x = motion.history(weights, times)[0, :, 0] - LENGTH
    k = np.flatnonzero(np.diff(np.sign(x)))
    found: FloatArray = times[k] - x[k] * (times[k + 1] - times[k]) / (x[k + 1] - x[k])
    return found


@pytest.mark.parametrize(
    "degrees", [*(pytest.param(each, marks=pytest.mark.nightly) for each in (30, 45, 60)), 90]
)
def test_large_swing_has_the_period_of_a_pendulum(degrees: float) -> None:
    """The period is 2 K(sin θ₀/2)/π times that of a small swing: 1.0174, 1.0400, 1.0732, 1.1803."""
    motion = pendulum(degrees, tolerance=np.inf, max_step=0.004)
    first, _, third = passages(motion, 1.6 * PERIOD)
    ratio = 2 / np.pi * ellipk(np.sin(np.radians(degrees) / 2) ** 2)
    assert (third - first) / PERIOD == pytest.approx(ratio, rel=1e-3)


def drift(motion: SteppedMotion, until: float) -> float:
    """Return the largest share of the energy put in that is nowhere."""
    motion.step_until(until)
    kinetic, strain, dissipated, work = motion.states[:, 2:6].T
    return float(abs(kinetic + strain + dissipated - work).max() / kinetic.max())


def test_energy_equals_work_for_any_step() -> None:
    for span, until in ((0.002, 0.1), (0.01, 0.5)):
        assert drift(pendulum(90, tolerance=np.inf, max_step=span), until) < 1e-9
    assert drift(pendulum(90, tolerance=1e-2), 0.2) < 1e-9


@pytest.mark.nightly
def test_energy_is_conserved_over_a_hundred_periods() -> None:
    motion = pendulum(90, tolerance=np.inf, max_step=0.004)
    assert drift(motion, 118 * PERIOD) < 1e-9
    assert (motion.states[:, 4] == 0.0).all()


#: Every kind of load, each at its own time.
LOADS: list[tuple[str, Any, Any, Any]] = [
    ("gravity", (0.0, 0.0, -3e-2), step(), None),
    ("pressure", 2e-2, time_functions.table([0, 0.02, 0.02], [1, 1, 0], 0.01), "+z"),
    ("force", (1e-8, 0.0, 2e-8), time_functions.harmonic(15.0), (0.0, 0.0, 0.0)),
    ("base_acceleration", (0.0, 0.0, 2e-2), time_functions.periodic([0, 0.02, 0.04], [0, 1, 0]), 0),
    ("base_displacement", (0.0, 2e-6, 4e-6), time_functions.table([0, 0.02], [0, 1], 0.015), None),
    ("base_displacement", (0.0, 0.0, 1e-6), time_functions.harmonic(9.0, 1.0), None),
    ("base_displacement", (0.0, 0.0, 1e-6), step(0.03), None),
]


#: Loads whose time functions are those of others in the list.
ALIKE = 1, 2, 3, 4, 5


@pytest.mark.parametrize(
    "k", [pytest.param(k, marks=[pytest.mark.nightly] * (k in ALIKE)) for k in range(len(LOADS))]
)
def test_small_motion_equals_the_modal_response(k: int) -> None:
    points, cells = build_lattice((0, 0.04, 0, 0.06, 0, 0.01), (2, 3, 1))
    held = np.repeat(points[:, 1:2] > 0.0599, 3, axis=1)
    model = Model(points, cells, isotropic(1e4, 0.3), 300.0, held)
    values, shapes, lost = model.modes(1000)
    values, shapes = values * model.modulus / model.density, shapes / model.density**0.5
    cage = CageModes(model, values, shapes.reshape(len(values), -1), lost)
    action, value, function, place = LOADS[k]
    loads = [cage.load_vector(action, 0.02 * np.array(value), function, place)]
    damping = Damping(alpha=2.0, beta=2e-4)
    modal = Response(cage, loads, damping)
    span = 2e-4 if k < 5 else 1e-4  # of a base that is shaken, or jumps
    stepped = SteppedMotion(cage, loads, damping, tolerance=np.inf, max_step=span)
    assert isinstance(stepped, Motion)
    times = np.array([0.005, 0.012, 0.0181, 0.031, 0.05])
    weights = np.arange(len(points)) / np.arange(len(points)).sum()
    exact = modal.history(weights, times)
    found = stepped.history(weights, times)
    for order, share in enumerate((1e-4 if k < 6 else 3e-4, 2e-3)):
        size = abs(exact[order]).max()
        np.testing.assert_allclose(found[order], exact[order], atol=share * size)
    last = stepped.at_time(times[-1])
    np.testing.assert_allclose(weights @ last[0], found[0, -1], rtol=1e-9)
    np.testing.assert_allclose(
        stepped.energies(times), modal.energies(times), atol=2e-3 * modal.energies(times).max()
    )


@pytest.mark.parametrize(
    ("hung", "ratio"),
    [
        pytest.param(False, 0.05, marks=pytest.mark.nightly),
        (True, (0.02, 0.2, 0.1)),
        pytest.param(False, (0.02, 0.2, 0.1), marks=pytest.mark.nightly),
        pytest.param(True, 0.05, marks=pytest.mark.nightly),
    ],
)
def test_damping_ratios_damp_modes_as_given(ratio: Any, hung: bool) -> None:
    """As the modes' closed forms, about a hung state too; energy is all there."""
    points, cells = build_lattice((0, 0.1, 0, 0.2, -1e-3, 1e-3), (2, 3, 1))
    plane = np.diag([1.0, 1.0, 0.5])
    plate = Plate(1e2 * plane, 1e-4 * plane, 40 * np.eye(2), 1e2)
    held = np.repeat(points[:, 1:2] > 0.1999, 3, axis=1)
    model = Model(points, cells, plate, 100.0, held)
    if hung:
        weight = cage_of(model).load_vector("gravity", (0, -GRAVITY, 0), step())
        rest, _ = model.solve_equilibrium(cage_of(model).vertex_forces(weight))
        model = Model(points, cells, plate, 100.0, held, False, rest)
    values, shapes, lost = model.modes(1000)
    values, shapes = values * model.modulus / model.density, shapes / model.density**0.5
    cage = CageModes(model, values, shapes.reshape(len(values), -1), lost)
    loads = [
        cage.load_vector("pressure", 1e-4, time_functions.table([0, 0.05, 0.05], [1, 1, 0]), "+z")
    ]
    modal = Response(cage, loads, Damping(ratio=ratio))
    motion = SteppedMotion(cage, loads, Damping(ratio=ratio), tolerance=np.inf, max_step=1e-3)
    weights, times = (points[:, 1] < 1e-9) / 6.0, np.linspace(0.05, 0.4, 6)
    exact, found = (m.history(weights, times)[0, :, 2] for m in (modal, motion))
    np.testing.assert_allclose(found, exact, atol=1e-3 * abs(exact).max())
    losses = [m.energies(times)[:, 2] for m in (motion, modal)]
    np.testing.assert_allclose(losses[0], losses[1], rtol=1e-2)
    assert hung or drift(motion, 0.4) < 1e-9  # what hangs holds far more than it moves with


def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    """Of a block that is shaken so that it bends far."""
    points, cells = build_lattice((0, 0.02, 0, 0.06, 0, 0.01), (1, 3, 1))
    held = np.repeat(points[:, 1:2] > 0.0599, 3, axis=1)
    cage = cage_of(Model(points, cells, isotropic(2e4, 0.3), 300.0, held))
    load = cage.load_vector("gravity", (5.0, 0.0, 30.0), time_functions.harmonic(5.0))
    ends = []
    for span in (2e-3, 1e-3, 5e-4):
        motion = SteppedMotion(cage, [load], Damping(beta=1e-3), tolerance=np.inf, max_step=span)
        ends.append(motion.at_time(0.1)[:2])
    coarse, fine = abs(ends[0] - ends[1]), abs(ends[1] - ends[2])
    assert abs(ends[2][0]).max() > 0.01
    for k in range(2):
        assert coarse[k].max() / fine[k].max() == pytest.approx(16.0, rel=0.15)


def test_error_stays_within_the_tolerance() -> None:
    exact = passages(pendulum(60, tolerance=np.inf, max_step=2e-3), 0.21)[0]
    for bound in (1e-1, 1e-2):
        found = passages(pendulum(60, tolerance=bound, max_step=1.0), 0.21)[0]
        assert abs(found / exact - 1) < bound / 10  # the bound is of ten periods


# At 1e-3 of its length the second mode is no longer linear: it ends 8e-4 of its amplitude off.
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("mode", "amplitude"),
    [
        (0, 1e-3),
        (1, 1e-4),
        *((mode, 3e-5) for mode in (0, 1)),
    ],
)
def test_mode_oscillates_at_its_frequency(mode: int, amplitude: float) -> None:
    """Over ten periods, undamped, with the default tolerance; of a strip with 5.9 and 37 Hz."""
    length, rigidity = 0.2, 0.0178
    points, cells = build_lattice((0, length, 0, 0.02, -1.5e-4, 1.5e-4), (5, 1, 1))
    plane = np.diag([1.0, 1.0, 0.5])
    plate = Plate(1e3 * plane, rigidity * plane, 400 * np.eye(2), 1e3)
    held = np.repeat(points[:, :1] < 1e-9, 3, axis=1)
    # Along y as well: all modes bend the strip out of its plane.
    held[:, 1] = True
    model = Model(points, cells, plate, 333.0, held)
    values, shapes, _ = model.modes(10)
    omega = float(np.sqrt(values[mode] * model.modulus / model.density))
    shape = shapes[mode].reshape(-1, 3)
    tip = points[:, 0] > length - 1e-9
    start = shape * amplitude * length / shape[tip, 2].mean()
    motion = SteppedMotion(cage_of(model), displacement=start)
    times = np.linspace(0.0, 20 * np.pi / omega, 401)
    moved = motion.history(tip / tip.sum(), times)[0, :, 2] / (amplitude * length)
    np.testing.assert_allclose(moved, np.cos(omega * times), atol=1e-4)
    assert len(motion.states) < 1500


@pytest.mark.nightly
@pytest.mark.parametrize(("periods", "grown"), [(3, 1.5), (10, 8.0)])
def test_parametric_resonance_grows_as_in_mathieus_equation(periods: int, grown: float) -> None:
    """A small sideways motion of a strip whose tension is modulated at twice its frequency.

    Undamped, with the default tolerance. Mathieu's coefficients are squared
    frequencies of the strip at rest under its mean and its extreme tensions.
    """
    length, mean, change = 0.2, 50.0, 35.0  # accelerations along the strip [m/s²]
    points, cells = build_lattice((0, length, 0, 0.02, -1.5e-4, 1.5e-4), (4, 1, 1))
    plane = np.diag([1.0, 1.0, 0.5])
    # So stiff along that its longitudinal vibration (400 Hz) adds 0.1 % to the tension's changes.
    plate = Plate(1e4 * plane, 0.0178 * plane, 400 * np.eye(2), 1e4)
    held = np.repeat(points[:, :1] < 1e-9, 3, axis=1)
    held[:, 1] = True

    def under(pull: float) -> tuple[Model, float, FloatArray]:
        """Return the strip at rest under a pull, its lowest frequency squared, and that mode."""
        flat = cage_of(Model(points, cells, plate, 333.0, held))
        rest, _ = flat.model.solve_equilibrium(
            flat.vertex_forces(flat.load_vector("gravity", (pull, 0, 0), step()))
        )
        model = Model(points, cells, plate, 333.0, held, False, rest)
        values, shapes, _ = model.modes(1)
        return model, values[0] * model.modulus / model.density, shapes[0].reshape(-1, 3)

    model, square, shape = under(mean)
    slack, taut = under(mean - change)[1], under(mean + change)[1]
    omega = square**0.5
    tip = points[:, 0] > length - 1e-9
    start = shape * 5e-4 * length / shape[tip, 2].mean()
    cage = cage_of(model)
    load = cage.load_vector("gravity", (change, 0, 0), time_functions.harmonic(omega / np.pi))
    motion = SteppedMotion(cage, [load], displacement=model.displacement + start, settled=True)
    times = np.linspace(0.0, 2 * periods * np.pi / omega, 40 * periods + 1)
    moved = motion.history(tip / tip.sum(), times)[0, :, 2] / (5e-4 * length)

    def mathieu(time: float, state: FloatArray) -> list[float]:
        stiffness = square + (taut - slack) / 2 * np.sin(2 * omega * time)
        return [state[1], -stiffness * state[0]]

    exact = solve_ivp(
        mathieu, times[[0, -1]], [1, 0], method="DOP853", rtol=1e-10, atol=1e-10, t_eval=times
    ).y[0]
    assert abs(exact).max() > grown
    np.testing.assert_allclose(moved, exact, atol=0.005 * abs(exact).max())


def curtain(cells: int, gust: float = 0.5, **options: Any) -> SteppedMotion:
    """Return a curtain of 0.3 m, hung by a side, in a gust [Pa]: its weight is 1.47 Pa."""
    points, tetrahedra = build_lattice((0, 0.3, 0, 0.3, -1.5e-4, 1.5e-4), (cells, cells, 1))
    plane = np.array([[1, 0.1, 0], [0.1, 1, 0], [0, 0, 0.1]])
    plate = Plate(1500 * plane, 1e-5 * plane, 500 * np.eye(2), 1500.0)
    held = np.repeat(points[:, 1:2] > 0.2999, 3, axis=1)
    cage = cage_of(Model(points, tetrahedra, plate, 500.0, held))
    loads = [
        cage.load_vector("gravity", (0, -GRAVITY, 0), step()),
        cage.load_vector("pressure", gust, time_functions.table([0, 0.3, 0.3], [1, 1, 0]), "+z"),
    ]
    return SteppedMotion(cage, loads, Damping(1.0, 1e-3), **{"tolerance": 1e-2} | options)


@pytest.mark.parametrize(
    ("cells", "until"), [(6, 0.5), pytest.param(12, 2.0, marks=pytest.mark.nightly)]
)
def test_a_curtain_swings_in_a_gust(cells: int, until: float) -> None:
    motion = curtain(cells)
    motion.step_until(until)
    assert drift(motion, until) < 1e-9
    lowest = motion.points[:, 1] < 1e-9
    gone = motion.at_time(0.3)[0][lowest, 2].mean()
    assert -0.2 < gone < -0.05
    # It stretches by half its weight, and no more than twice that where it is set off by it.
    column = (motion.points[:, 0] < 1e-9) & (motion.points[:, 2] > 0)
    place = (motion.points + motion.at_time(until)[0])[column]
    place = place[np.argsort(motion.points[column, 1])]
    length = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    assert abs(length / 0.3 - 1) < 2 * 0.15 * GRAVITY * 0.3 / 1500


@pytest.mark.nightly
def test_whipping_cloth_needs_no_tiny_steps() -> None:
    """A gust of twice the weight."""
    motion = curtain(12, 2 * 0.15 * GRAVITY, tolerance=0.1)
    motion.step_until(0.8)
    assert len(motion.states) < 1000
    assert drift(motion, 0.8) < 1e-9


def test_stopped_motion_continues_from_its_last_state() -> None:
    class Stopped(Exception):
        pass

    def stop(share: float) -> None:
        assert 0.0 < share <= 1.0
        if share > 0.5:
            raise Stopped

    whole = pendulum(45, tolerance=1e-2)
    whole.step_until(0.2)
    part = pendulum(45, tolerance=1e-2)
    with pytest.raises(Stopped):
        part.step_until(0.2, stop)
    assert 0.1 < part.last_time < 0.2
    other = pendulum(45, tolerance=1e-2)
    assert other.resume(part.states.copy())
    before = part.last_time
    part.step_until(0.2)
    assert part.last_time > before
    np.testing.assert_array_equal(part.states, whole.states)
    other.step_until(0.2)
    np.testing.assert_allclose(other.at_time(0.2)[0], whole.at_time(0.2)[0], atol=1e-4 * LENGTH)
    # Whatever was asked for in between.
    asked = pendulum(45, tolerance=1e-2)
    for time in (0.05, 0.01, 0.2):
        asked.at_time(time)
    np.testing.assert_array_equal(asked.states, whole.states)
    assert not pendulum(30).resume(part.states)
    assert not other.resume(part.states[:, :-1])
    assert not other.resume(np.full_like(part.states, np.nan))


def test_motion_is_at_rest_before_zero() -> None:
    motion = pendulum(90)
    displacement, velocity, acceleration = motion.at_time(-1.0)
    end = np.argmin(motion.points[:, 0])
    np.testing.assert_allclose(displacement[end], 0.0, atol=1e-12)
    assert not velocity.any()
    assert not acceleration.any()
    assert motion.energies(np.array([-1.0]))[0, 3] == pytest.approx(0.0, abs=1e-12)


def test_unsupported_loads_and_damping_are_refused() -> None:
    points, cells = build_lattice((0, 1, 0, 1, 0, 1), (1, 1, 1))
    held = np.repeat(points[:, 2:] > 0.5, 3, axis=1)
    cage = cage_of(Model(points, cells, isotropic(1e4, 0.3), 300.0, held))
    with pytest.raises(InputError, match=r"ratio.*Raise modal.modes"):
        SteppedMotion(cage, [], Damping(ratio=0.02))
    forever = cage.load_vector("gravity", (0, 0, 1), time_functions.harmonic(2.0, steady=True))
    with pytest.raises(InputError, match="steady"):
        SteppedMotion(cage, [forever])
    with pytest.raises(InputError, match="not a time"):
        SteppedMotion(cage).at_time(float("nan"))


def test_time_beyond_memory_is_refused_before_stepping() -> None:
    points, cells = build_lattice((0, 1, 0, 1, 0, 1), (1, 1, 1))
    held = np.repeat(points[:, 2:] > 0.5, 3, axis=1)
    motion = SteppedMotion(cage_of(Model(points, cells, isotropic(1e4, 0.3), 300.0, held)))
    with pytest.raises(SizeError, match=r"5e\+13 steps or more, up to 1e\+12 s, would need"):
        motion.at_time(1e12)
    assert len(motion.states) == 1


def test_states_that_do_not_fit_into_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = pendulum(30, tolerance=np.inf, max_step=0.004)
    monkeypatch.setattr(memory, "NEVER_REFUSED", 0)
    # Enough for 75 steps, not for twice the 64 that there is room for at first.
    monkeypatch.setattr(memory, "available_bytes", lambda: motion.states[0].nbytes * 100)
    with pytest.raises(SizeError, match=r"keeping more than 64 steps of 30 degrees.*coarser cage"):
        motion.step_until(0.3)
    reached = motion.last_time
    monkeypatch.undo()
    motion.step_until(reached + 0.01)
    assert motion.last_time > reached + 0.01
