"""The six filters in VTK's own executive: what runs again, what fails, what is freed."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pencils import stiffness_and_mass
from scipy.linalg import expm
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline, vtkTrivialProducer
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkFiltersGeneral import vtkShrinkPolyData, vtkTransformFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    PatchTessellator,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.algorithm import SAME_AS_INPUT
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.mechanics.elements.materials import isotropic


class Chain:
    """The main pipeline."""

    def __init__(self) -> None:
        self.weave = WeaveSource(ends=4, picks=3)
        self.cage = TetraCage(divisions=(3, 3, 1))
        self.modal = ModalSolver(youngs_modulus=1e3, modes=12)
        self.response = ModalResponse(alpha=2.0)
        self.warp = BarycentricWarp()
        self.surface = PatchTessellator(subdivisions=2)
        self.cage.SetInputConnection(self.weave.GetOutputPort())
        self.modal.SetInputConnection(self.cage.GetOutputPort())
        self.response.SetInputConnection(self.modal.GetOutputPort())
        self.warp.SetInputConnection(0, self.weave.GetOutputPort())
        self.warp.SetInputConnection(1, self.response.GetOutputPort())
        self.surface.SetInputConnection(self.warp.GetOutputPort())

    @property
    def stages(self) -> list[Stage]:
        return [self.weave, self.cage, self.modal, self.response, self.warp, self.surface]

    @property
    def counts(self) -> list[int]:
        return [stage.executions for stage in self.stages]

    def update(self, time: float | None = None) -> None:
        self.surface.update(time)


def point_array(stage: Any, name: str) -> np.ndarray[Any, Any]:
    return vtk_to_numpy(stage.GetOutputDataObject(0).GetPointData().GetArray(name)).copy()


def points(stage: Any) -> np.ndarray[Any, Any]:
    return vtk_to_numpy(stage.GetOutputDataObject(0).GetPoints().GetData()).copy()


# --- what runs again -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "runs"),
    [
        (lambda c: None, [0, 0, 0, 0, 0, 0]),
        (lambda c: c.response.configure(gravity=(0, -1, 0)), [0, 0, 0, 1, 1, 1]),
        (lambda c: c.response.configure(alpha=3.0), [0, 0, 0, 1, 1, 1]),
        (lambda c: c.response.configure(beta=1e-4), [0, 0, 0, 1, 1, 1]),
        (lambda c: c.modal.configure(youngs_modulus=2e3), [0, 0, 1, 1, 1, 1]),
        (lambda c: c.modal.configure(fixed="-x"), [0, 0, 1, 1, 1, 1]),
        (lambda c: c.cage.configure(divisions=(2, 3, 1)), [0, 1, 1, 1, 1, 1]),
        (lambda c: c.weave.configure(warp_diameter="0.2 mm"), [1, 1, 1, 1, 1, 1]),
        (lambda c: c.surface.configure(subdivisions=3), [0, 0, 0, 0, 0, 1]),
        (lambda c: c.warp.configure(outside="clamp"), [0, 0, 0, 0, 1, 1]),
        (lambda c: c.modal.configure(youngs_modulus="1 kPa", modes=12), [0, 0, 0, 0, 0, 0]),
    ],
)
def test_only_stages_downstream_of_a_change_run(
    change: Callable[[Chain], None], runs: list[int]
) -> None:
    chain = Chain()
    chain.update(time=0.05)
    assert chain.counts == [1] * 6
    change(chain)
    chain.update()
    assert chain.counts == [1 + n for n in runs]


def test_new_time_runs_response_warp_and_surface_only() -> None:
    chain = Chain()
    chain.update(time=0.0)
    chain.update(time=0.1)
    chain.update(time=0.1)
    chain.update()
    assert chain.counts == [1, 1, 1, 2, 2, 2]
    assert np.abs(point_array(chain.surface, "displacement")).max() > 0
    chain.update(time=0.0)
    assert chain.counts == [1, 1, 1, 3, 3, 3]
    assert np.abs(point_array(chain.surface, "displacement")).max() == 0


def test_time_range_reaches_the_last_stage() -> None:
    chain = Chain()
    chain.response.duration = 3.0
    chain.surface.UpdateInformation()
    key = vtkStreamingDemandDrivenPipeline.TIME_RANGE()
    for stage in (chain.response, chain.warp, chain.surface):
        assert stage.GetOutputInformation(0).Get(key) == (0.0, 3.0)
    for stage in (chain.weave, chain.cage, chain.modal):
        assert not stage.GetOutputInformation(0).Has(key)


def test_time_steps_are_offered_and_other_times_are_exact() -> None:
    chain = Chain()
    chain.response.configure(duration=0.5, frames=6)
    chain.surface.UpdateInformation()
    key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    for stage in (chain.response, chain.warp, chain.surface):
        np.testing.assert_allclose(
            stage.GetOutputInformation(0).Get(key), [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
        )
    usual = Chain()
    usual.response.configure(duration=60.0, frames=2)
    for count, time in enumerate((0.1, 0.137, 0.2, 0.7), start=1):  # on a step, between, after
        chain.update(time)
        chain.update(time)
        usual.update(time)
        assert chain.counts == [1, 1, 1, count, count, count]
        np.testing.assert_array_equal(points(chain.surface), points(usual.surface))
    chain.response.frames = 0
    chain.surface.UpdateInformation()
    information = chain.surface.GetOutputInformation(0)
    assert not information.Has(key)
    assert information.Get(vtkStreamingDemandDrivenPipeline.TIME_RANGE()) == (0.0, 0.5)
    chain.update(0.1)
    usual.update(0.1)
    np.testing.assert_array_equal(points(chain.surface), points(usual.surface))
    for frames in (-1, 100_001):
        with pytest.raises(InputError, match="at least 0 and at most 100000"):
            chain.response.frames = frames


def test_time_of_the_first_run_is_reused() -> None:
    chain = Chain()
    chain.update()
    chain.update(time=0.0)
    assert chain.counts == [1] * 6
    # A copy says of which time it is; what moves it on is at its own.
    chain.update(time=0.02)
    grid = vtkUnstructuredGrid()
    grid.ShallowCopy(chain.response.output)
    again = connect(grid, ModalResponse())
    for time in (0.01, 0.02):
        again.update(time)
        chain.update(time)
        shown = point_array(again, "displacement")
        assert np.abs(shown).max() > 0
        fresh = connect(grid, ModalResponse()).update(time)
        np.testing.assert_array_equal(shown, point_array(fresh, "displacement"))
    assert again.executions == 2


def test_weights_are_reused_until_the_geometry_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    import spacemap_vtk.filters.barycentric_warp as module

    calls = []
    real = module.locate
    monkeypatch.setattr(module, "locate", lambda *a, **k: calls.append(1) or real(*a, **k))
    chain = Chain()
    for time in (0.0, 0.1, 0.2):
        chain.update(time)
    chain.response.gravity = (1.0, 0.0, 0.0)
    chain.modal.density = 200.0
    chain.update()
    assert len(calls) == 1
    before = points(chain.warp)
    # Another geometry with the very same counts: stale weights would go unnoticed.
    chain.weave.warp_spacing = "0.6 mm"
    chain.update()
    assert len(calls) == 2
    assert points(chain.warp).shape == before.shape
    chain.response.gravity = (0.0, 0.0, 0.0)
    chain.update()
    np.testing.assert_allclose(points(chain.warp), points(chain.weave), atol=1e-15)


def test_equal_mesh_read_again_reuses_the_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    import spacemap_vtk.filters.barycentric_warp as module

    calls = []
    real = module.locate
    monkeypatch.setattr(module, "locate", lambda *a, **k: calls.append(1) or real(*a, **k))
    chain = Chain()
    chain.update(time=0.1)
    warp = BarycentricWarp()
    source = vtkTrivialProducer()
    for _ in range(3):
        copy = vtkUnstructuredGrid()
        copy.DeepCopy(chain.response.GetOutputDataObject(0))
        source.SetOutput(copy)
        warp.SetInputConnection(0, chain.weave.GetOutputPort())
        warp.SetInputConnection(1, source.GetOutputPort())
        warp.update()
    assert warp.executions == 3
    assert len(calls) == 2  # the chain's own, and one for the copies


# --- as VTK's own, from 9.4 on ------------------------------------------------------------------


def test_operators_calls_and_outputs_are_those_of_vtk() -> None:
    chain = Chain()
    for stage in chain.stages:
        for port in range(stage.GetNumberOfInputPorts()):
            stage.RemoveAllInputConnections(port)
    weave, cage, modal, response, warp, surface = chain.stages
    patches = (weave >> surface)()
    assert patches.GetNumberOfCells() == surface.update().output.GetNumberOfCells() > 0
    assert surface.output is surface.GetOutputDataObject(0)
    assert (weave >> surface).update().output is surface.output
    assert chain.counts == [1, 0, 0, 0, 0, 1]

    # a tuple is an input for each port, as VTK's own `select_ports` would connect them
    moved = (weave, weave >> cage >> modal >> response) >> warp >> surface
    assert surface.update(time=0.05) is surface
    assert chain.counts == [1, 1, 1, 1, 1, 2]
    usual = Chain()
    usual.update(0.05)
    np.testing.assert_array_equal(points(surface), points(usual.surface))
    result = moved()
    assert chain.counts == [1, 1, 1, 1, 1, 2]
    kept = vtk_to_numpy(result.GetPoints().GetData()).copy()
    surface.update(time=0.0)
    np.testing.assert_array_equal(vtk_to_numpy(result.GetPoints().GetData()), kept)
    assert np.abs(points(surface) - kept).max() > 0

    # VTK's own filters at either end
    shrink = vtkShrinkPolyData()
    shrunk = (surface >> shrink).update().output
    assert shrunk.GetNumberOfPoints() == 4 * surface.output.GetNumberOfCells()
    ball = vtkSphereSource()
    np.testing.assert_array_equal((ball >> surface)().GetBounds(), ball.update().output.GetBounds())


def test_calling_a_stage_with_data_keeps_its_connections() -> None:
    chain = Chain()
    chain.update(0.05)
    usual = points(chain.warp)
    moving = vtkUnstructuredGrid()
    moving.ShallowCopy(chain.response.output)
    twice = numpy_to_vtk(2 * point_array(chain.response, "displacement"))
    twice.SetName("displacement")
    moving.GetPointData().AddArray(twice)
    rest = points(chain.weave)
    patches = chain.weave()
    del chain.weave  # VTK's outputs hold no producers
    moved = vtk_to_numpy(chain.warp(patches, moving).GetPoints().GetData())
    np.testing.assert_allclose(moved - rest, 2 * (usual - rest), atol=1e-12)
    chain.warp.update()
    np.testing.assert_array_equal(points(chain.warp), usual)
    surface = PatchTessellator()
    with pytest.raises(InputError, match=r"input port 0 of \w+ is not connected"):
        surface()
    with pytest.raises(InputError, match="too many inputs for PatchTessellator: 2; allowed: 1"):
        surface(patches, patches)
    with pytest.raises(InputError, match="too many inputs for BarycentricWarp: 3; allowed: 2"):
        (patches, moving, moving) >> chain.warp
    with pytest.raises(GeometryError, match="overlap"):
        (WeaveSource(warp_diameter="0.6 mm") >> surface)()


# --- what is right -----------------------------------------------------------------------------


@pytest.mark.nightly
def test_cage_of_the_published_experiment() -> None:
    weave, cage = WeaveSource(ends=7, picks=7), TetraCage(divisions=(5, 5, 1))
    cage.SetInputConnection(weave.GetOutputPort())
    modal = ModalSolver(modes=180, fixed="+y")
    modal.SetInputConnection(cage.GetOutputPort())
    modal.update()
    grid = modal.GetOutputDataObject(0)
    assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells()) == (72, 125)
    assert point_array(modal, "fixed").sum() == 12
    assert grid.GetFieldData().GetArray("eigenvalues").GetNumberOfTuples() == 180
    assert "stiffly" in modal.warnings[0]
    cage.order = 2
    modal.update()
    assert modal.warnings == ()


@pytest.mark.parametrize("initial", ["rest", "equilibrium"])
@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 0.0), (3.0, 1e-4), (500.0, 0.05)])
def test_displacement_and_velocity_equal_the_unreduced_system(
    initial: str, alpha: float, beta: float
) -> None:
    """All modes against expm of M u'' + C u' + K u = f as a first-order system."""
    chain = Chain()
    chain.modal.modes = 10_000
    gravity = np.array([1.0, -2.0, 9.81])
    chain.response.configure(alpha=alpha, beta=beta, gravity=gravity, initial=initial)
    chain.update(time=0.0)
    vertices, grid = points(chain.modal), chain.modal.GetOutputDataObject(0)
    tets = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
    k, m = stiffness_and_mass(vertices, tets, isotropic(1e3, 0.3), 300.0)
    free = np.repeat(point_array(chain.modal, "fixed") == 0, 3)
    load = (m @ np.tile(gravity, len(vertices)))[free]
    k, m = k.toarray()[np.ix_(free, free)], m.toarray()[np.ix_(free, free)]
    n = len(load)
    # State (u, v, 1), scaled so that expm sees numbers of one size.
    scale = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(m, k)).real.max())
    system = np.zeros((2 * n + 1, 2 * n + 1))
    system[:n, n : 2 * n] = scale * np.eye(n)
    system[n : 2 * n, :n] = -np.linalg.solve(m, k) / scale
    system[n : 2 * n, n : 2 * n] = -np.linalg.solve(m, alpha * m + beta * k)
    system[n : 2 * n, -1] = np.linalg.solve(m, load) / scale
    start = np.zeros(2 * n + 1)
    start[-1] = 1.0
    if initial == "equilibrium":
        start[:n] = np.linalg.solve(k, load)
    static = np.abs(np.linalg.solve(k, load)).max()
    for time in (0.0, 0.003, 0.04):
        state = expm(system * time) @ start
        chain.update(time)
        u = point_array(chain.response, "displacement").ravel()
        v = point_array(chain.response, "velocity").ravel()
        assert np.abs(u[~free]).max() == 0.0
        np.testing.assert_allclose(u[free], state[:n], atol=1e-9 * static)
        np.testing.assert_allclose(v[free], scale * state[n:-1], atol=1e-9 * static * scale)


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-2, 2), min_size=12, max_size=12), st.sampled_from([0.0, 1e-3, -0.1, 0.4])
)
def test_affine_motion_of_the_cage_is_reproduced(numbers: list[float], shift: float) -> None:
    matrix, offset = np.reshape(numbers[:9], (3, 3)), np.array(numbers[9:])
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(2, 3, 1))
    cage.SetInputConnection(weave.GetOutputPort())
    cage.update()
    grid = vtkUnstructuredGrid()
    grid.DeepCopy(cage.GetOutputDataObject(0))
    vertices = points(cage) + np.array([shift * 1e-3, 0.0, 0.0])  # some points fall outside
    moved = vtkPoints()
    moved.SetData(numpy_to_vtk(vertices, deep=True))
    grid.SetPoints(moved)
    displacement = numpy_to_vtk(vertices @ matrix.T + offset, deep=True)
    displacement.SetName("displacement")
    grid.GetPointData().AddArray(displacement)
    warp = BarycentricWarp()
    warp.SetInputConnection(0, weave.GetOutputPort())
    warp.SetInputDataObject(1, grid)
    warp.update()
    rest = points(weave)
    expected = rest @ matrix.T + offset
    np.testing.assert_allclose(point_array(warp, "displacement"), expected, atol=1e-12)
    np.testing.assert_allclose(points(warp), rest + expected, atol=1e-12)
    assert bool(warp.warnings) == (shift != 0.0)


def test_any_point_set_can_be_warped_and_keeps_its_type() -> None:
    chain = Chain()
    chain.update(time=0.05)
    sphere = vtkSphereSource()
    sphere.SetRadius(2e-4)
    warp = BarycentricWarp()
    warp.SetInputConnection(0, sphere.GetOutputPort())
    warp.SetInputConnection(1, chain.response.GetOutputPort())
    warp.update(time=0.05)
    assert isinstance(warp.GetOutputDataObject(0), vtkPolyData)
    assert np.abs(point_array(warp, "displacement")).max() > 0
    # A filter of VTK's own between two of ours.
    from vtkmodules.vtkCommonTransforms import vtkTransform

    move, shift = vtkTransformFilter(), vtkTransform()
    shift.Translate(0, 0, 1e-5)
    move.SetTransform(shift)
    move.SetInputConnection(warp.GetOutputPort())
    chain.cage.SetInputConnection(move.GetOutputPort())
    chain.response.gravity = (0, 0, 0)
    other = Chain()
    warp.SetInputConnection(1, other.response.GetOutputPort())
    chain.cage.update()
    assert chain.cage.GetOutputDataObject(0).GetNumberOfCells() == 45


# --- what is freed -----------------------------------------------------------------------------


def test_stage_survives_collection_of_its_python_owner() -> None:
    class Page:
        weave: WeaveSource
        me: Page

    surface, page = PatchTessellator(subdivisions=1), Page()
    page.weave, page.me = WeaveSource(ends=2, picks=2), page
    connect(page.weave, surface).update()
    del page
    gc.collect()
    weave = surface.GetInputConnection(0, 0).GetProducer()
    assert (weave.ends, weave.executions) == (2, 1)
    weave.ends = 3
    before = surface.output.GetNumberOfCells()
    assert surface.update().output.GetNumberOfCells() > before


class Through(Stage):
    """Hands its input on."""

    inputs = ("vtkPointSet",)
    output_type = SAME_AS_INPUT

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        output.ShallowCopy(inputs[0])


@pytest.mark.parametrize(
    "asked",
    [
        {"time": 0.5},
        *(pytest.param(each, marks=pytest.mark.nightly) for each in ({}, {"piece": Piece(0, 1)})),
    ],
)
def test_update_keeps_the_interpreter_lock(asked: dict[str, Any]) -> None:
    # VTK's collector may need it, holding a lock of its own that a thread with Python's waits for.
    ticks, ended = [], threading.Event()

    def tick() -> None:
        while not ended.wait(0.0005):
            ticks.append(1)

    stage, thread, usual = Through(), threading.Thread(target=tick), sys.getswitchinterval()
    sys.setswitchinterval(60.0)
    try:
        thread.start()
        seen = []
        for update in (lambda maker: stage.update(**asked), lambda maker: maker.Update()):
            ball, maker = vtkSphereSource(), vtkPolyDataNormals()
            ball.SetThetaResolution(300)
            ball.SetPhiResolution(300)
            maker.SetInputConnection(ball.GetOutputPort())
            stage.SetInputConnection(maker.GetOutputPort())
            before = len(ticks)
            update(maker)
            seen.append(len(ticks) - before)
    finally:
        sys.setswitchinterval(usual)
        ended.set()
        thread.join()
    assert seen[0] <= 1
    assert seen[1] > 5
