"""ModalResponse: loads, starts, damping, truncation and results, on a cage."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import VTK_QUADRATIC_TETRA, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

from spacemap_vtk import ModalResponse, ModalSolver, TetraCage, WeaveSource
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import to_cells, to_points
from spacemap_vtk.datasets.modal_model import model_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.load import Load
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints

RAMP = {"time": "ramp", "rise": "10 ms"}
EVERY_LOAD: list[dict[str, Any]] = [
    {"pressure": "0.2 Pa", "on": "+z", **RAMP},
    {"traction": [0.1, 0.0, 0.3], "on": "-y", "time": "pulse", "length": "20 ms"},
    {
        "force": ["1 uN", 0, "-2 uN"],
        "at": ["1.5 mm", "0.2 mm", "0.1 mm"],
        "time": "harmonic",
        "frequency": 20,
    },
    {"gravity": [1.0, 0.0, 0.0], "time": "periodic", "times": [0, 0.01, 0.02], "values": [0, 1, 0]},
    {
        "base_acceleration": [0, "0.1 g", "0.2 g"],
        "time": "table",
        "times": [0.0, 0.01, 0.01, 0.04],
        "values": [0.0, 1.0, -1.0, 0.5],
    },
]


class Chain:
    def __init__(self, *, modes: int = 12, fixed: str = "+y", **values: Any) -> None:
        self.weave = WeaveSource(ends=4, picks=3)
        self.cage = TetraCage(divisions=(3, 3, 1))
        self.modal = ModalSolver(youngs_modulus=1e3, modes=modes, fixed=fixed)
        self.response = ModalResponse(**values)
        self.cage.SetInputConnection(self.weave.GetOutputPort())
        self.modal.SetInputConnection(self.cage.GetOutputPort())
        self.response.SetInputConnection(self.modal.GetOutputPort())

    def at(self, time: float, name: str = "displacement") -> np.ndarray:
        self.response.update(time)
        output = self.response.GetOutputDataObject(0)
        for data in (output.GetPointData(), output.GetCellData(), output.GetFieldData()):
            if data.GetArray(name) is not None:
                return vtk_to_numpy(data.GetArray(name)).copy()
        raise AssertionError(name)

    @property
    def model(self) -> Any:
        self.modal.update()
        return model_of(self.modal.GetOutputDataObject(0))


def forces(model: Any, load: Load) -> np.ndarray:
    """Nodal forces of a load with factor 1, by a route of their own."""
    points = model.points
    value = getattr(load, load.action)
    if load.action in ("gravity", "base_acceleration"):
        sign = 1 if load.action == "gravity" else -1
        return sign * np.asarray(model.mass @ np.tile(value, len(points)))
    result = np.zeros_like(points)
    if load.action == "force":
        distance = np.linalg.norm(points - load.at, axis=1)
        near = distance < distance.min() + 1e-9  # they share the force
        result[near] = np.asarray(value) / near.sum()
        return result.ravel()
    axis, end = "xyz".index(load.on[1]), (points.max, points.min)[load.on[0] == "-"]
    wall = abs(points[:, axis] - end(axis=0)[axis]) < 1e-9
    if load.action == "pressure":
        value = np.zeros(3)
        value[axis] = -load.pressure if load.on[0] == "+" else load.pressure
    for tetrahedron in model.cells:
        on = [v for v in tetrahedron if wall[v]]
        if len(on) == 3:
            a, b, c = points[on]
            result[on] += np.linalg.norm(np.cross(b - a, c - a)) / 6 * np.asarray(value)
    return result.ravel()


@pytest.mark.parametrize(
    "k", [*(pytest.param(k, marks=pytest.mark.nightly) for k in range(len(EVERY_LOAD))), "all"]
)
def test_all_modes_give_the_response_of_the_full_system(k: int | str) -> None:
    chosen = EVERY_LOAD if k == "all" else [EVERY_LOAD[k]]
    chain = Chain(modes=1000, alpha=3.0, beta=1e-4, gravity=(0, 0, 0), loads=chosen)
    model, free = chain.model, chain.model.free
    K, M = (m[free][:, free].toarray() for m in (model.stiffness, model.mass))
    inverse = np.linalg.inv(M)
    loads = [(forces(model, load)[free], load.function) for load in chain.response.loads]
    n = len(K)
    stiff, damped = inverse @ K, inverse @ (3.0 * M + 1e-4 * K)
    pushed = [(inverse @ force, function) for force, function in loads]
    state = np.zeros(2 * n)
    marks = [0.0, 0.01, 0.02, 0.03, 0.04]
    for begin, end in itertools.pairwise(marks):
        middle = (begin + end) / 2

        def rate(t: float, y: np.ndarray, middle: float = middle) -> np.ndarray:
            a = -stiff @ y[:n] - damped @ y[n:]
            for push, f in pushed:
                sine = hasattr(f, "omega")
                a += push * (
                    f.value(t) if sine else f.value(middle) + f.slope(middle) * (t - middle)
                )
            return np.concatenate([y[n:], a])

        state = solve_ivp(rate, (begin, end), state, "DOP853", rtol=1e-11, atol=1e-15).y[:, -1]
        u, v = chain.at(end).ravel()[free], chain.at(end, "velocity").ravel()[free]
        np.testing.assert_allclose(u, state[:n], atol=1e-8 * abs(state[:n]).max())
        np.testing.assert_allclose(v, state[n:], atol=1e-7 * abs(state[n:]).max())


@pytest.mark.parametrize("modes", [1, 12])
def test_the_static_limit_is_exact_with_any_number_of_modes(modes: int) -> None:
    for load in EVERY_LOAD:
        still = {k: v for k, v in load.items() if k not in ("time", "rise", "length")}
        for key in ("frequency", "times", "values"):
            still.pop(key, None)
        chain = Chain(modes=modes, gravity=(0, 0, 0), loads=[still], initial="equilibrium")
        exact = chain.model.statics(forces(chain.model, Load(**still)))[0]
        error = abs(chain.at(0.3).ravel() - exact).max()
        assert error <= 1e-10 * abs(exact).max(), still
        chain.response.residual_vectors = False
        assert abs(chain.at(0.3).ravel() - exact).max() > 1e-3 * abs(exact).max()


def test_a_slow_ramp_of_gravity_ends_at_the_static_shape() -> None:
    loads = [{"gravity": [0, -1, 0], "time": "ramp", "rise": 1e4}]
    chain = Chain(modes=3, gravity=(0, 0, 0), loads=loads, damping_ratio=0.5)
    exact = chain.model.statics(forces(chain.model, Load(gravity=[0, -1, 0])))[0]
    np.testing.assert_allclose(chain.at(2e4).ravel(), exact, atol=1e-10 * abs(exact).max())


def test_energies_balance_and_equal_those_of_the_fields() -> None:
    chain = Chain(alpha=3.0, loads=EVERY_LOAD)
    model = chain.model
    for time in (0.0, 0.013, 0.05, 0.3):
        kinetic, strain, lost, work = (
            float(chain.at(time, name)[0])
            for name in ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
        )
        u, v = chain.at(time).ravel(), chain.at(time, "velocity").ravel()
        assert kinetic == pytest.approx(0.5 * v @ (model.mass @ v), rel=1e-9)
        assert strain == pytest.approx(0.5 * u @ (model.stiffness @ u), rel=1e-9)
        assert kinetic + strain + lost == pytest.approx(work, rel=1e-10)
        assert lost >= 0.0


def test_acceleration_is_the_rate_of_velocity() -> None:
    chain = Chain(alpha=3.0, loads=EVERY_LOAD)
    before, after = chain.at(0.0499999, "velocity"), chain.at(0.0500001, "velocity")
    slope = (after - before) / 2e-7
    expected = chain.at(0.05, "acceleration")
    np.testing.assert_allclose(slope, expected, atol=1e-5 * abs(expected).max())


def test_work_of_stress_is_the_strain_energy() -> None:
    chain = Chain(initial="equilibrium")
    strain, stress = chain.at(0.0, "strain"), chain.at(0.0, "stress")
    points, cells = chain.model.points, chain.model.cells
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    volumes = abs(np.linalg.det(edges)) / 6
    twice = np.array([1, 1, 1, 2, 2, 2])
    energy = 0.5 * volumes @ (strain * stress * twice).sum(axis=1)
    assert energy == pytest.approx(float(chain.at(0.0, "strain_energy")[0]), rel=1e-9)
    tensor = stress[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 3, 3)
    deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    expected = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
    np.testing.assert_allclose(chain.at(0.0, "von_mises"), expected)
    chain.response.configure(stress=False, energy=False)
    chain.response.update()
    output = chain.response.GetOutputDataObject(0)
    assert output.GetCellData().GetArray("stress") is None
    assert output.GetFieldData().GetArray("external_work") is None


# --- a moving base ------------------------------------------------------------------------------


def test_slow_base_displacement_moves_the_whole_cage() -> None:
    loads = [{"base_displacement": ["1 mm", 0, "2 mm"], "time": "ramp", "rise": 1e3}]
    chain = Chain(gravity=(0, 0, 0), loads=loads, damping_ratio=0.3)
    moved = chain.at(500.0)
    fixed = np.all(~chain.model.free.reshape(-1, 3), axis=1)
    np.testing.assert_allclose(moved[fixed], np.tile([5e-4, 0, 1e-3], (fixed.sum(), 1)))
    np.testing.assert_allclose(moved, np.tile([5e-4, 0, 1e-3], (len(moved), 1)), atol=1e-9)
    np.testing.assert_allclose(chain.at(500.0, "velocity")[:, 2], 2e-6, rtol=1e-6)


def test_base_displacement_and_base_acceleration_agree() -> None:
    """D = sin Ωt / Ω² and d̈ = -sin Ωt are one motion, but for the frame it is seen from."""
    omega = 2 * math.pi * 30.0
    common = {"time": "harmonic", "frequency": 30.0, "steady": True}
    there = [{"base_displacement": [0, 0, 1 / omega**2], **common}]
    pushed = [{"base_acceleration": [0, 0, -1.0], **common}]
    moving = Chain(gravity=(0, 0, 0), loads=there)
    shaken = Chain(gravity=(0, 0, 0), loads=pushed)
    for time in (0.0, 0.011, 0.4):
        base = np.array([0, 0, math.sin(omega * time) / omega**2])
        np.testing.assert_allclose(moving.at(time), shaken.at(time) + base, atol=1e-15)
        apart = moving.at(time, "acceleration") - shaken.at(time, "acceleration")
        np.testing.assert_allclose(apart, np.tile(-(omega**2) * base, (len(apart), 1)), atol=1e-9)


@pytest.mark.parametrize(
    "time",
    [
        {"time": "step"},
        {"time": "ramp", "rise": "10 ms"},
        {"time": "table", "times": [0.01, 0.02], "values": [1.0, 2.0]},
        {"time": "harmonic", "frequency": 20.0, "phase": 90.0},
        {"time": "harmonic", "frequency": 20.0, "steady": True},
    ],
)
def test_before_zero_velocity_and_acceleration_are_those_of_the_displacement(
    time: dict[str, Any],
) -> None:
    base = {"base_displacement": ["1 mm", 0, 0], **time}
    chain = Chain(loads=[base], initial_velocity=(0, 0, 0.1), alpha=2.0)
    held = chain.at(0.0)
    np.testing.assert_array_equal(chain.at(-0.3), held)
    for name in ("velocity", "acceleration"):
        assert not chain.at(-0.3, name).any()
    motion = chain.response.motion
    assert motion is not None
    times = np.array([-0.3, -0.2, -0.1, 0.0])
    for vertex in (0, len(held) - 1):
        history = motion.history(np.eye(len(held))[vertex], times)
        np.testing.assert_allclose(history[0], np.tile(held[vertex], (4, 1)), atol=1e-17)
        assert not history[1:, :3].any()
    assert abs(chain.at(0.0, "velocity")).max() >= 0.05  # what starts then, starts then
    kinetic, strain, dissipated, work = motion.energies(times)[0]
    assert kinetic == dissipated == 0.0
    assert strain == work == pytest.approx(motion.energies(times)[3, 1])


def test_base_cannot_move_without_supports() -> None:
    chain = Chain(fixed="", loads=[{"base_displacement": [0, 0, 1]}])
    with pytest.raises(
        InputError, match=r"response\.loads\[0\]\.base_displacement.*base cannot move"
    ):
        chain.response.update(0.1)


# --- starts -------------------------------------------------------------------------------------


def test_cage_released_from_equilibrium_moves_freely() -> None:
    pull = {"force": [0, "-1 uN", 0], "at": [0, 0, 0], "time": "pulse", "length": "50 ms"}
    chain = Chain(loads=[pull], initial="equilibrium", alpha=30.0)
    still = chain.at(0.0)
    np.testing.assert_allclose(chain.at(0.0499), still, atol=1e-13 * abs(still).max())
    assert abs(chain.at(0.06) - still).max() > 0.01 * abs(still).max()
    free = Chain(initial="equilibrium")
    np.testing.assert_allclose(chain.at(50.0), free.at(0.0), atol=1e-9 * abs(still).max())


def test_free_cage_with_initial_velocity_flies() -> None:
    thrown = {"gravity": (0, 0, -10.0), "initial_velocity": (1.0, 0, 5.0)}
    chain = Chain(fixed="", alpha=0.0, **thrown)
    rows = len(chain.at(0.0))
    np.testing.assert_allclose(
        chain.at(0.0, "velocity"), np.tile([1.0, 0, 5.0], (rows, 1)), atol=1e-11
    )
    flown = chain.at(0.7)
    np.testing.assert_allclose(flown, np.tile([0.7, 0, 3.5 - 5 * 0.49], (rows, 1)), atol=1e-9)
    chain.response.initial_displacement = (0, 2.0, 0)
    np.testing.assert_allclose(chain.at(0.7) - flown, np.tile([0, 2.0, 0], (rows, 1)), atol=1e-9)


def test_given_fields_come_from_point_arrays() -> None:
    chain = Chain(modes=1000)
    chain.modal.update()
    grid = vtkUnstructuredGrid()
    grid.ShallowCopy(chain.modal.GetOutputDataObject(0))
    rng = np.random.default_rng(3)
    free = chain.model.free.reshape(-1, 3)
    fields = {name: 1e-6 * rng.standard_normal(free.shape) for name in ("push", "shape", "speed")}
    for name, values in fields.items():
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    producer = vtkTrivialProducer()
    producer.SetOutput(grid)
    chain.response.SetInputConnection(producer.GetOutputPort())
    chain.response.configure(
        gravity=(0, 0, 0),
        initial_displacement_array="shape",
        initial_velocity_array="speed",
        loads=[{"array": "push"}],
    )
    np.testing.assert_allclose(chain.at(0.0), fields["shape"] * free, atol=1e-18)
    np.testing.assert_allclose(chain.at(0.0, "velocity"), fields["speed"] * free, atol=1e-15)
    residual = chain.model.mass @ chain.at(0.0, "acceleration").ravel()
    residual += chain.model.stiffness @ chain.at(0.0).ravel()
    residual += chain.model.mass @ chain.at(0.0, "velocity").ravel()  # alpha is 1
    np.testing.assert_allclose(residual[free.ravel()], fields["push"][free], atol=1e-15)
    chain.response.initial_velocity_array = "sped"
    with pytest.raises(InputError, match=r'needs an array "sped".* and \d+ more.*mean "speed"'):
        chain.response.update()
    array = numpy_to_vtk(np.where(fields["push"] > 0, np.nan, 0.0), deep=True)
    array.SetName("wind")
    grid.GetPointData().AddArray(array)
    chain.response.configure(initial_velocity_array="", loads=[{"array": "wind"}])
    with pytest.raises(InputError, match=r'loads\[0\]\.array: \d+ of the \d+ vectors .*"wind"'):
        chain.response.update()


# --- truncation ---------------------------------------------------------------------------------


def test_too_few_modes_in_a_loaded_direction_are_reported() -> None:
    chain = Chain(modes=2, gravity=(0, -9.81, 0))
    chain.response.update(0.1)
    assert any("of the mass along y" in text for text in chain.response.warnings)
    assert not any("along x" in text for text in chain.response.warnings)
    chain.modal.modes = 1000
    chain.response.update()
    assert not any("of the mass" in text for text in chain.response.warnings)


def test_effective_masses_sum_to_the_movable_mass() -> None:
    chain = Chain(modes=1000)
    chain.response.update(0.0)
    modes = chain.response.motion.modes
    np.testing.assert_allclose(modes.effective_masses.sum(axis=0), modes.model.movable_mass)


def test_order_of_requested_times_does_not_matter() -> None:
    chain = Chain(alpha=3.0, loads=EVERY_LOAD)
    early = {name: chain.at(0.033, name) for name in ("displacement", "external_work")}
    chain.at(3.0)
    for name, value in early.items():
        np.testing.assert_allclose(chain.at(0.033, name), value, rtol=1e-12)
    assert chain.modal.executions == 1
    np.testing.assert_array_equal(chain.at(-1.0), chain.at(0.0))


@pytest.mark.parametrize("fixed", ["+y", "+y -x:x"])
def test_quadratic_tetrahedra_accept_partial_supports(fixed: str) -> None:
    loads = [
        {"pressure": "0.2 Pa", "on": "+z"},
        {"traction": [0.1, 0.0, 0.3], "on": "-y", "time": "harmonic", "frequency": 20},
    ]
    chain = Chain(modes=5, fixed=fixed, loads=loads[:1], alpha=2.0, initial="equilibrium")
    chain.cage.order = 2
    model = chain.model
    assert model.cells.shape[1] == 10
    # Springs hold weight and pressure, vertex by vertex; five modes and two residual vectors do it.
    weight = np.outer(model.nodal_mass, [0, 0, -9.80665])
    pushed = (model.stiffness @ chain.at(0.1).ravel()).reshape(-1, 3) - weight
    pushed[~model.free.reshape(-1, 3)] = 0.0
    top = model.points[:, 2] > model.points[:, 2].max() - 1e-9
    most = abs(pushed).max()
    assert abs(pushed[~top]).max() <= 1e-8 * most
    assert abs(pushed[:, :2]).max() <= 1e-8 * most
    assert (pushed[top, 2] < 1e-8 * most).all()
    # Of the pressure's force, the part on the middles of edges in the support is missing.
    area = np.prod(np.ptp(model.points[top], axis=0)[:2])
    assert 0.9 * 0.2 * area < -pushed.sum() < 0.2 * area
    chain.response.configure(loads=loads, initial="rest")
    for time in (0.01, 0.2):
        names = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
        *parts, work = (float(chain.at(time, name)[0]) for name in names)
        assert sum(parts) == pytest.approx(work, rel=1e-10)
        u = chain.at(time).ravel()
        assert parts[1] == pytest.approx(0.5 * u @ (model.stiffness @ u), rel=1e-8)
    assert len(chain.at(0.2, "von_mises")) == len(model.cells)


def test_curves_over_the_same_times_share_their_states(monkeypatch):
    chain = Chain()
    chain.at(0.01)
    motion, times = chain.response.motion, np.linspace(0.0, 0.1, 7)
    moving = np.argsort(abs(motion.at_time(0.05)[0]).max(axis=1))[-2:]
    weights = np.eye(len(chain.model.points))[moving]
    asked, at = [], motion.modal.at_time
    monkeypatch.setattr(motion.modal, "at_time", lambda time: (asked.append(time), at(time))[1])
    curves = [motion.history(weight, times) for weight in weights]
    energies = motion.energies(times)
    assert asked == times.tolist()
    # Other times, though in the same array, are asked for anew.
    times += 0.05
    for weight, curve in zip(weights, curves, strict=True):
        again = motion.history(weight, times)
        assert not np.allclose(again, curve)
        for k, time in enumerate(times):
            expected = weight @ motion.at_time(time)
            np.testing.assert_allclose(again[:, k], expected, rtol=1e-9, atol=1e-12)
    assert not np.allclose(motion.energies(times), energies, atol=0.0)
    np.testing.assert_array_equal(motion.energies(times)[3], motion.energy(times[3]))


@pytest.mark.parametrize("time", [math.nan, math.inf])
def test_non_finite_time_is_refused(time):
    chain = Chain()
    with pytest.raises(InputError, match=r"time = .*a finite number of seconds"):
        chain.at(time)
    chain.at(0.01)
    with pytest.raises(InputError, match="a finite number of seconds"):
        chain.response.motion.history(np.full(len(chain.model.points), 0.0), np.array([0.0, time]))
    with pytest.raises(InputError, match="a finite number of seconds"):
        chain.response.motion.energies(np.array([time]))


def sheet(length: float, divisions: tuple[int, int, int]) -> vtkTrivialProducer:
    """Return a producer of a square of quadratic tetrahedra, half a millimetre thick."""
    points, cells = add_midpoints(*build_lattice((0, length, 0, length, 0, 5e-4), divisions))
    grid = vtkUnstructuredGrid()
    grid.SetPoints(to_points(points))
    grid.SetCells(VTK_QUADRATIC_TETRA, to_cells(cells))
    producer = vtkTrivialProducer()
    producer.SetOutput(grid)
    return producer


@pytest.mark.nightly
@pytest.mark.parametrize(("length", "few"), [(0.125, False), (0.8, True)])
def test_very_thin_cage_reports_its_correct_digits(length: float, few: bool) -> None:
    producer = sheet(length, (5, 5, 1))
    for _ in range(2):  # solved, and read from the cache
        modal = ModalSolver(modes=10)
        modal.SetInputConnection(producer.GetOutputPort())
        response = ModalResponse(gravity=(0.0, 0.0, -9.81e-4), initial="equilibrium")
        response.SetInputConnection(modal.GetOutputPort())
        response.update(0.0)
        digits = [text for text in response.warnings if "of the shape at rest" in text]
        assert len(digits) == few
        points = response.GetOutputDataObject(0).GetPointData()
        sag = -vtk_to_numpy(points.GetArray("displacement"))[:, 2].min()
        beam = 12 * 300.0 * 9.81e-4 * length**4 / (8 * 1e6 * 5e-4**2)
        assert 0.85 * beam < sag < beam
        del modal, response
    # its own plane is another matter
    modal = ModalSolver(modes=10)
    modal.SetInputConnection(producer.GetOutputPort())
    response = ModalResponse(gravity=(0.0, -9.81e-4, 0.0))
    response.SetInputConnection(modal.GetOutputPort())
    response.update(0.0)
    assert not any("digits of the shape at rest" in text for text in response.warnings)


@pytest.mark.parametrize("damped", [True, False])
def test_at_huge_times_damped_motion_rests_and_lost_phases_are_reported(damped):
    chain = Chain(alpha=2.0 if damped else 0.0, loads=[{"pressure": "0.2 Pa", "on": "+z"}])
    chain.at(1e3)
    assert not chain.response.warnings
    late = chain.at(1e12)
    lost = [
        text for text in chain.response.warnings if "lost in rounding after so many periods" in text
    ]
    assert len(lost) == (not damped)
    assert np.isfinite(late).all()
    if damped:
        chain.response.configure(initial="equilibrium")
        np.testing.assert_allclose(late, chain.at(0.0), rtol=1e-9, atol=1e-12 * abs(late).max())
    else:  # a swing about the shape at rest goes no further than there and back
        most = abs(Chain(loads=chain.response.loads, initial="equilibrium").at(0.0)).max()
        assert abs(late).max() < 3 * most
