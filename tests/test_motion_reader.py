"""Motion out of files, in place of solver and response."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from spacemap_vtk import BarycentricWarp, MotionReader, ObjectSource
from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import GeometryError, InputError, SpacemapError
from spacemap_vtk.scenes.scene import Scene

TIMES = [0.0, 0.5, 2.0]


def block() -> pv.UnstructuredGrid:
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, 3)] * 3, indexing="ij")
    return pv.StructuredGrid(x, y, z).cast_to_unstructured_grid()


def matrix(step: int) -> np.ndarray:
    """An affine motion for each step."""
    return np.array([[1, 0.1 * step, 0], [0, 1, 0.2 * step], [0, -0.3 * step, 1.0]])


def frames(name: str = "displacement") -> list[pv.UnstructuredGrid]:
    result = []
    for step in range(len(TIMES)):
        grid = block()
        grid[name] = grid.points @ (matrix(step) - np.eye(3)).T
        result.append(grid)
    return result


def as_pvd(folder: Path) -> Path:
    lines = []
    for step, (time, grid) in enumerate(zip(TIMES, frames(), strict=True)):
        grid.save(folder / f"s{step}.vtu")
        lines.append(f'<DataSet timestep="{time}" part="0" file="s{step}.vtu"/>')
    file = folder / "motion.pvd"
    file.write_text(
        f'<VTKFile type="Collection"><Collection>{"".join(lines)}</Collection></VTKFile>'
    )
    return file


def as_files(folder: Path, ending: str = "vtu") -> Path:
    for step, (time, grid) in enumerate(zip(TIMES, frames(), strict=True)):
        grid.field_data["TimeValue"] = [time]
        grid.save(folder / f"step_{step + 8}.{ending}")  # 8, 9, 10
    return folder / f"step_*.{ending}"


def as_series(folder: Path) -> Path:
    as_files(folder)
    names = [f"step_{step + 8}.vtu" for step in range(3)]
    entries = [{"name": n, "time": t} for n, t in zip(names, TIMES, strict=True)]
    file = folder / "motion.vtu.series"
    file.write_text(json.dumps({"file-series-version": "1.0", "files": entries}))
    return file


def written(folder: Path, ending: str) -> Path:
    """Let VTK write all steps of a motion that is read from a collection."""
    source = MotionReader(file=as_pvd(folder))
    file = folder / f"motion.{ending}"
    if ending == "vtkhdf":
        from vtkmodules.vtkIOHDF import vtkHDFWriter

        writer = vtkHDFWriter()
        writer.SetWriteAllTimeSteps(True)
    else:
        from vtkmodules.vtkIOExodus import vtkExodusIIWriter

        writer = vtkExodusIIWriter()
        writer.WriteAllTimeStepsOn()
    writer.SetFileName(str(file))
    writer.SetInputConnection(source.GetOutputPort())
    writer.Write()
    return file


MAKERS: dict[str, Callable[[Path], Path]] = {
    "pvd": as_pvd,
    "vtu files": as_files,
    "vtk files": lambda folder: as_files(folder, "vtk"),
    "series": as_series,
    "vtkhdf": lambda folder: written(folder, "vtkhdf"),
    "exodus": lambda folder: written(folder, "e"),
}


def displacement(stage: MotionReader) -> np.ndarray:
    return vtk_to_numpy(stage.GetOutputDataObject(0).GetPointData().GetArray("displacement"))


@pytest.mark.parametrize("kind", MAKERS)
def test_each_format_gives_times_and_interpolated_motion(tmp_path: Path, kind: str) -> None:
    stage = MotionReader(file=MAKERS[kind](tmp_path))
    stage.UpdateInformation()
    info = stage.GetOutputInformation(0)
    assert info.Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) == tuple(TIMES)
    assert info.Get(vtkStreamingDemandDrivenPipeline.TIME_RANGE()) == (0.0, 2.0)
    for time, step in ((0.0, 0.0), (0.5, 1.0), (0.2, 0.4), (2.0, 2.0), (1.25, 1.5), (9.0, 2.0)):
        stage.update(time)
        grid = pv.wrap(stage.GetOutputDataObject(0))
        assert (grid.n_points, grid.n_cells) == (
            27,
            8 * 6 if kind not in ("vtkhdf", "exodus") else 48,
        )
        expected = grid.points @ (matrix(1) - np.eye(3)).T * step
        np.testing.assert_allclose(displacement(stage), expected, atol=1e-6)


def test_object_follows_the_motion_and_is_located_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import spacemap_vtk.filters.barycentric_warp as module

    calls = []
    real = module.locate
    monkeypatch.setattr(module, "locate", lambda *a, **k: calls.append(1) or real(*a, **k))
    pv.Sphere(radius=0.9).save(tmp_path / "ball.vtp")
    ball, motion = ObjectSource(file=tmp_path / "ball.vtp"), MotionReader(file=as_pvd(tmp_path))
    warp = BarycentricWarp(outside="error")
    warp.SetInputConnection(0, ball.GetOutputPort())
    warp.SetInputConnection(1, motion.GetOutputPort())
    rest = pv.Sphere(radius=0.9).points
    for time, step in ((0.0, 0.0), (0.25, 0.5), (2.0, 2.0), (0.25, 0.5)):
        warp.update(time)
        moved = pv.wrap(warp.GetOutputDataObject(0)).points
        expected = rest + rest @ (matrix(1) - np.eye(3)).T * step
        np.testing.assert_allclose(moved, expected, atol=1e-6)
    assert len(calls) == 1
    assert (ball.executions, motion.executions, warp.executions) == (1, 4, 4)


def test_moving_points_are_read_and_scaled(tmp_path: Path) -> None:
    for step in range(3):
        grid = block()
        grid.points = 1e3 * grid.points @ matrix(step).T
        grid.save(tmp_path / f"p{step}.vtk")
    stage = MotionReader(file=tmp_path / "p*.vtk", moving_points=True, scale=1e-3)
    stage.update(1.5)  # without times the steps are counted
    rest = block().points
    np.testing.assert_allclose(
        displacement(stage), rest @ (matrix(1) - np.eye(3)).T * 1.5, atol=1e-6
    )
    np.testing.assert_allclose(pv.wrap(stage.GetOutputDataObject(0)).points, rest, atol=1e-6)


def scene_file(folder: Path, motion: Path) -> Path:
    pv.Sphere(radius=0.9).save(folder / "ball.ply")
    file = folder / "scene.toml"
    file.write_text(
        f'[object]\nfile = "ball.ply"\n[motion]\nfile = "{motion.name}"\n[view]\nshow = "both"\n'
    )
    return file


def test_scene_with_a_motion_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = scene_file(tmp_path, as_pvd(tmp_path))
    scene = Scene.read(file)
    assert [type(stage).__name__ for stage in scene.stages] == [
        *("ObjectSource", "MotionReader", "BarycentricWarp", "PatchTessellator")
    ]
    scene.update(2.0)
    moved = pv.wrap(scene.polygons).points
    np.testing.assert_allclose(moved, pv.Sphere(radius=0.9).points @ matrix(2).T, atol=1e-5)
    for arguments in (
        ("render", str(file), "-o", str(tmp_path / "a.png"), "--size", "60x40", "--time", "1"),
        ("export", str(file), "-o", str(tmp_path / "a.vtu"), "--what", "cage", "--time", "1"),
        ("storyboard", str(file), "-o", str(tmp_path / "b.png"), "--size", "210x60"),
        ("validate", str(file), "-q"),
    ):
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        assert caught.value.code == 0, capsys.readouterr()
    with pytest.raises(SystemExit) as caught:
        main(("modes", str(file)))
    assert caught.value.code == 2
    assert "a motion from a file and therefore no modes" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"response: cannot be combined with \[motion\]"):
        Scene({"motion": {"file": "a.pvd"}, "response": {}})


# --- what is refused ---------------------------------------------------------------------------


def test_missing_array_is_reported_with_the_existing_ones(tmp_path: Path) -> None:
    stage = MotionReader(file=as_pvd(tmp_path), array="U")
    with pytest.raises(InputError, match=r'step 0.*needs an array "U".*has "displacement"'):
        stage.update(0.0)
    stage.array = "displacement"
    stage.update(0.0)


def test_invalid_arrays_are_refused(tmp_path: Path) -> None:
    grid = block()
    grid["u"] = np.zeros(27)
    grid["v"] = np.full((27, 3), np.nan)
    grid.save(tmp_path / "a.vtu")
    with pytest.raises(InputError, match=r'"u" has shape \(27,\); allowed: three components'):
        MotionReader(file=tmp_path / "a.vtu", array="u").update()
    with pytest.raises(InputError, match="point 0 is not finite"):
        MotionReader(file=tmp_path / "a.vtu", array="v").update()


def test_changing_topology_is_refused(tmp_path: Path) -> None:
    file = as_pvd(tmp_path)
    other = block().extract_cells(range(7))
    other["displacement"] = np.zeros((other.n_points, 3))
    other.save(tmp_path / "s2.vtu")
    stage = MotionReader(file=file)
    stage.update(0.5)
    with pytest.raises(GeometryError, match=r"step 2 \(t = 2 s\): its cells differ"):
        stage.update(1.0)
    stage.update(0.25)


@pytest.mark.parametrize(
    "kind",
    [pytest.param(each, marks=[pytest.mark.nightly] * (each == "vtkhdf")) for each in MAKERS],
)
def test_truncated_files_are_refused(tmp_path: Path, kind: str) -> None:
    file = MAKERS[kind](tmp_path)
    victim = tmp_path / {
        "vtu files": "step_9.vtu",
        "vtk files": "step_9.vtk",
    }.get(kind, file.name)
    whole = victim.read_bytes()
    victim.write_bytes(whole[: len(whole) * 2 // 3])
    stage = MotionReader(file=file)
    with pytest.raises(SpacemapError) as caught:
        stage.update(0.5)
    assert victim.name in str(caught.value)


def test_file_name_may_contain_pattern_characters(tmp_path: Path) -> None:
    file = as_pvd(tmp_path).rename(tmp_path / "motion [1]*.pvd")
    stage = MotionReader(file=file)
    stage.update(TIMES[1])
    assert np.abs(displacement(stage)).max() > 0


def test_empty_or_missing_series_is_refused(tmp_path: Path) -> None:
    empty = tmp_path / "empty.pvd"
    empty.write_text("<VTKFile><Collection></Collection></VTKFile>")
    for file, words in (
        (empty, "no time steps"),
        (tmp_path / "none.pvd", "no such file"),
        (tmp_path / "x_*.vtu", "no file matches this pattern"),
        (None, "no file is given"),
    ):
        with pytest.raises(InputError, match=words):
            MotionReader(file=file).update()
    gone = as_pvd(tmp_path)
    (tmp_path / "s1.vtu").unlink()
    with pytest.raises(InputError, match=r"motion.pvd refers to .*s1.vtu, which does not exist"):
        MotionReader(file=gone).update()
