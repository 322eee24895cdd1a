"""Stages in VTK's executive: what fails, recovers, is stopped, and is warned of."""

from __future__ import annotations

import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from test_pipeline import Chain, point_array, points
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkFiltersSources import vtkSphereSource

import spacemap_vtk
from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    PatchTessellator,
    SpacemapWarning,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.errors import GeometryError, InputError, SizeError, SpacemapError
from spacemap_vtk.filters.algorithm import SAME_AS_INPUT
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.parameters import Real


def test_update_raises_the_error_of_the_failing_stage_and_recovers() -> None:
    chain = Chain()
    chain.update(time=0.1)
    chain.weave.warp_crimp_height = "0.6 mm"
    for _ in range(2):
        with pytest.raises(GeometryError, match=r"weave\.warp_crimp_height.*allowed: 0 mm to"):
            chain.update()
    assert chain.counts == [3, 1, 1, 1, 1, 1]  # once for each, though two stages need it
    chain.weave.warp_crimp_height = None
    chain.update()
    assert chain.counts == [4, 2, 2, 2, 2, 2]
    assert chain.surface.GetOutputDataObject(0).GetNumberOfCells() > 0


def test_error_in_the_middle_of_the_pipeline_names_its_stage() -> None:
    chain = Chain()
    chain.modal.fixed = ""
    chain.response.initial = "equilibrium"
    with pytest.raises(InputError, match=r"response\.initial.*rigid modes"):
        chain.update(time=0.0)
    chain.response.initial = "rest"
    chain.update()
    assert chain.counts == [1, 1, 1, 2, 1, 1]


def test_loop_in_the_pipeline_is_refused() -> None:
    warp, cage = BarycentricWarp(), TetraCage()
    connect((cage, connect(warp, cage)), warp)
    with pytest.raises(InputError, match="the pipeline is a loop: TetraCage is upstream of itself"):
        cage.update()
    cage.RemoveAllInputConnections(0)


def test_loop_closed_between_two_updates_is_refused() -> None:
    first, second = BarycentricWarp(), BarycentricWarp()
    second.SetInputConnection(first.GetOutputPort())
    with pytest.raises(InputError, match=r"input port \d of \w+ is not connected"):
        second.update()
    first.AddInputConnection(0, second.GetOutputPort())
    with pytest.raises(InputError, match="the pipeline is a loop"):
        second.update()
    first.RemoveAllInputConnections(0)


def test_errors_of_connect_give_a_cure() -> None:
    with pytest.raises(
        InputError, match=r"WeaveSource is a class\. Make an instance: WeaveSource\(\)"
    ):
        connect(WeaveSource, PatchTessellator())
    with pytest.raises(InputError, match="PatchTessellator is a class"):
        connect(WeaveSource(), PatchTessellator)
    with pytest.raises(InputError, match=r"cannot have an input; .*connect\(data, stage\)"):
        connect(PatchTessellator(), vtkPolyData())
    with pytest.raises(InputError, match="nothing to connect"):
        connect()


class Waiting(Stage):
    """Waits to be let go on."""

    inputs = ("vtkPointSet",)
    output_type = SAME_AS_INPUT
    length = Real(1.0, "A number.")
    begun, let = threading.Event(), threading.Event()

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        length = self.length
        self.begun.set()
        assert self.let.wait(300.0)
        output.ShallowCopy(inputs[0])
        add_array(output.GetFieldData(), "length", np.array([length]))


def test_second_thread_is_refused_and_its_changes_are_kept() -> None:
    weave = WeaveSource(ends=1, picks=1)
    waiting, surface = Waiting(), PatchTessellator(subdivisions=1)
    connect(weave, waiting)
    connect(weave, surface)
    with ThreadPoolExecutor(1) as other:
        running = other.submit(waiting.update)
        assert waiting.begun.wait(300.0)
        for stage in (waiting, surface):  # the weave is both's
            with pytest.raises(
                SpacemapError, match=r"another thread is updating .*threading\.Lock"
            ):
                stage.update()
        waiting.length = 2.0
        waiting.let.set()
        assert running.result() is waiting
    assert waiting.output.GetFieldData().GetArray("length").GetValue(0) == 1.0
    assert waiting.update().output.GetFieldData().GetArray("length").GetValue(0) == 2.0
    assert (waiting.update().executions, surface.update().executions) == (2, 1)


def test_threads_with_own_pipelines_get_identical_results() -> None:
    def moved(number: int) -> list[bytes]:
        chain, found = Chain(), []
        chain.modal.density = 300.0 + number % 2
        for step in range(4):
            chain.update(time=0.01 * step)
            found += [
                points(chain.surface).tobytes(),
                point_array(chain.response, "velocity").tobytes(),
            ]
        return found

    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(moved, range(6))) == [moved(0), moved(1)] * 3


def test_vtk_update_does_not_reuse_a_failed_output() -> None:
    chain = Chain()
    chain.weave.warp_crimp_height = 1.0
    chain.surface.Update()
    chain.surface.Update()
    assert chain.surface.executions == 0
    chain.weave.warp_crimp_height = None
    chain.surface.Update()
    assert chain.surface.executions == 1


def test_unconnected_input_is_named() -> None:
    with pytest.raises(InputError, match="input port 0 of ModalSolver is not connected"):
        ModalSolver().update()
    weave, warp = WeaveSource(), BarycentricWarp()
    warp.SetInputConnection(0, weave.GetOutputPort())
    with pytest.raises(InputError, match="input port 1"):
        warp.update()


def test_wrong_data_is_refused_with_a_message() -> None:
    sphere = vtkSphereSource()
    solver = ModalSolver()
    solver.SetInputConnection(sphere.GetOutputPort())
    with pytest.raises(SpacemapError, match="vtkUnstructuredGrid"):
        solver.update()
    weave = WeaveSource(ends=2, picks=2)
    solver = ModalSolver()
    solver.SetInputConnection(weave.GetOutputPort())
    with pytest.raises(GeometryError, match="linear tetrahedra"):
        solver.update()
    cage = TetraCage()
    cage.SetInputConnection(weave.GetOutputPort())
    response = ModalResponse()
    response.SetInputConnection(cage.GetOutputPort())
    with pytest.raises(InputError, match="ModalSolver before it"):
        response.update()
    surface = PatchTessellator()
    bare = vtkUnstructuredGrid()
    bare.SetPoints(vtkPoints())
    surface.SetInputDataObject(bare)
    with pytest.raises(GeometryError, match="no cells"):
        surface.update()
    empty = vtkTrivialProducer()
    empty.SetOutput(vtkPolyData())
    cage.SetInputConnection(empty.GetOutputPort())
    with pytest.raises(GeometryError, match="no points"):
        cage.update()


def test_request_larger_than_memory_is_refused_before_it_runs() -> None:
    with pytest.raises(SizeError, match="GiB"):
        WeaveSource(ends=100_000, picks=100_000).update()
    chain = Chain()
    chain.cage.divisions = (50_000, 50_000, 50_000)
    with pytest.raises(SizeError, match=r"cage\.divisions"):
        chain.update()


def test_run_can_be_aborted() -> None:
    chain = Chain()
    chain.modal.modes = 30
    chain.cage.divisions = (16, 16, 2)
    seen = []

    def stop(caller: Any, event: str) -> None:
        seen.append(caller.GetProgress())
        caller.SetAbortExecute(1)

    chain.modal.AddObserver("ProgressEvent", stop)
    with pytest.raises(SpacemapError, match="ModalSolver was cancelled"):
        chain.update()
    assert seen


def test_warnings_point_to_the_line_of_the_script_once() -> None:
    chain = Chain()
    with pytest.warns(SpacemapWarning, match="too stiffly") as reported:
        chain.surface.update(time=0.0)
    assert {Path(each.filename) for each in reported} == {Path(__file__)}
    text = Path(__file__).read_text("utf-8").splitlines()[reported[0].lineno - 1]
    assert "chain.surface.update(time=0.0)" in text  # the last line that is not the package's
    assert [str(each.message) for each in reported] == [
        *chain.modal.warnings,
        *chain.response.warnings,
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error", SpacemapWarning)
        chain.update(time=0.01)
        chain.modal.density = 400.0  # it runs again, and says the same
        chain.update()
    chain.modal.poissons_ratio = 0.49
    with pytest.warns(SpacemapWarning, match="volumetric locking") as reported:
        chain.update()
    assert len(reported) == 2  # one has another number in it


def test_warning_filter_error_raises_from_update() -> None:
    chain = Chain()
    with warnings.catch_warnings():
        warnings.simplefilter("error", SpacemapWarning)
        for _ in range(2):
            with pytest.raises(SpacemapWarning, match="too stiffly"):
                chain.update(time=0.0)
    chain.update(time=0.0)
    assert chain.surface.GetOutputDataObject(0).GetNumberOfCells() > 0


def test_ignored_warning_is_silent() -> None:
    chain = Chain()
    with warnings.catch_warnings(record=True) as reported:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", SpacemapWarning)
        chain.update(time=0.0)
    assert reported == []
    assert "too stiffly" in chain.modal.warnings[0]


def test_warning_is_issued_once_with_any_filter() -> None:
    chain = Chain()
    with warnings.catch_warnings(record=True) as reported:
        warnings.simplefilter("always")
        for frame in range(3):
            chain.update(time=0.01 * frame)
            chain.modal.Modified()
    assert [each.category for each in reported] == [SpacemapWarning] * len(reported)
    assert len({str(each.message) for each in reported}) == len(reported)


@pytest.mark.parametrize("how", ["Update", "consumer"])
def test_warnings_are_issued_through_vtk_updates(how: str) -> None:
    chain = Chain()
    normals = vtkPolyDataNormals()
    normals.SetInputConnection(chain.surface.GetOutputPort())
    with pytest.warns(SpacemapWarning, match="too stiffly") as reported:
        (chain.surface if how == "Update" else normals).Update()
    assert Path(reported[0].filename) == Path(__file__)


def test_common_mistakes_work_or_give_a_cure() -> None:
    weave, cage = WeaveSource(ends=2, picks=2), TetraCage(divisions=(2, 2, 1))
    assert pv.wrap(weave.output).n_cells > 0  # nothing has been updated
    connect(weave, cage)
    assert cage.output.GetNumberOfCells() == 20
    assert cage.GetOutput() is cage.update().output
    assert (weave.executions, cage.executions) == (1, 1)
    for guess in ("ant.ply", np.zeros((3, 3)), vtkPoints):
        with pytest.raises(InputError, match=r"is not a VTK data object; .*pyvista.read"):
            cage(guess)
    for time in ("10 ms", [0.0, 0.1]):
        with pytest.raises(InputError, match="must be a time; allowed: a finite number of seconds"):
            cage.update(time=time)  # type: ignore[arg-type]
    assert set(spacemap_vtk.__all__) <= set(dir(spacemap_vtk))


def test_one_cage_encloses_and_moves_all_blocks() -> None:
    near, far = pv.Cube(), pv.Cube(center=(3, 0, 0))
    for blocks in (pv.MultiBlock([near, far]), pv.PartitionedDataSet([near, far])):
        cage = connect(blocks, TetraCage(divisions=(2, 1, 1))).update().output
        assert cage.GetNumberOfPoints() == 12
        assert cage.GetBounds()[:2] == pytest.approx((-0.5, 3.5))
    moving = pv.wrap(cage)
    moving["displacement"] = np.tile([0.0, 0.0, 1.0], (12, 1))
    blocks = pv.MultiBlock([near, far])
    moved = pv.wrap(BarycentricWarp()(blocks, moving))
    for block, before in zip(moved, (near, far), strict=True):
        np.testing.assert_allclose(block.points, before.points + np.array([0, 0, 1]), atol=1e-6)
    solver, response = ModalSolver(youngs_modulus=1e3, modes=3), ModalResponse()
    swinging = connect((blocks, connect(moving, solver, response)), BarycentricWarp())
    lows = [
        pv.wrap(swinging.update(time=time).output).bounds[4] for time in (0.0, 0.01, 0.02, 0.02)
    ]
    assert lows[0] > lows[1] > lows[2] == lows[3]
    assert swinging.executions == 3
    # A cage in one block is that block; of several no one knows where they hang together.
    assert ModalSolver(modes=3)(pv.MultiBlock([moving])).GetNumberOfPoints() == 12
    with pytest.raises(InputError, match=r"not vtkUnstructuredGrid, vtkPolyData; .*combine"):
        ModalSolver()(pv.MultiBlock([moving, near]))


def test_missing_file_is_reported_at_every_update(tmp_path):
    motion = spacemap_vtk.MotionReader(file=tmp_path / "missing")
    for _ in range(2):
        with pytest.raises(InputError, match="no such file"):
            motion.update()
