"""Carry out a sweep: a picture, a scene and figures for each run, a table and a contact sheet.

Runs are independent of each other, and of who carries them out: a worker gets values and returns
bytes, which are written here. A worker may therefore be a process or a remote machine. Files are
written whole or not at all, and a sweep that was interrupted continues where it was.
"""

from __future__ import annotations

import json
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from spacemap_vtk.datasets.arrays import array_of
from spacemap_vtk.draw.figure.contact_sheet import contact_sheet
from spacemap_vtk.errors import InputError, SpacemapWarning, format_error
from spacemap_vtk.io.formats.toml import format_scene
from spacemap_vtk.io.output import (
    atomic_file,
    atomic_files,
    explain_disk_errors,
    format_csv,
    write_parts,
)
from spacemap_vtk.io.registry import writer
from spacemap_vtk.jobs.picture import PictureJob
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.ndarrays import StepProgress
from spacemap_vtk.scenes import object_report, report
from spacemap_vtk.scenes.assignments import ValueList
from spacemap_vtk.scenes.figure_list import (
    Figure,
    cloth_figures,
    equilibrium_figures,
    format_for_table,
    heading_with_unit,
    mode_figures,
    motion_figures,
    object_figures,
    textile_figures,
    yarn_figures,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.sweep import Run, Sweep
from spacemap_vtk.temporary_files import temporary_folder
from spacemap_vtk.units import format_quantity
from spacemap_vtk.workers import process_count, run_in_processes, run_on_cluster

# Files in the folder besides those of the runs.
TABLE = "table.csv"
SHEET = "contact_sheet.png"
RECORD = "sweep.json"
#: Text that identifies a record of a sweep.
_MARK = "files of a spacemap sweep"
#: Seconds between two updates of the table while a sweep runs.
_TABLE_INTERVAL = 2.0
#: Lets one thread of a process draw and solve at a time: VTK collects the garbage of all threads.
_lock = threading.Lock()


@dataclass
class RunResult:
    """Result of a run."""

    #: Headings and entries of the table.
    figures: dict[str, str] = field(default_factory=dict)
    #: Why the run failed; empty if it did not.
    error: str = ""
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0.0
    #: Contents of the picture files, one for each time.
    pictures: list[bytes] = field(default_factory=list)


def execute_run(run: Run) -> RunResult:
    """Run a scene, and return its figures and pictures."""
    result, begin = RunResult(), perf_counter()
    with _lock, blas_threads.use_one_thread(), warnings.catch_warnings():
        warnings.simplefilter("ignore", SpacemapWarning)
        try:
            scene = run.scene()
            for figure in _compute_figures(scene, run.times):
                if figure.value is not None:
                    result.figures[figure.heading] = figure.entry
            result.pictures = [_draw_picture(scene, t) for t in run.times or [scene.view.time]]
            result.warnings = scene.warnings
        except Exception as error:  # reported in the row of this run
            result.error = format_error(error)
    result.seconds = perf_counter() - begin
    return result


def _compute_figures(scene: Scene, requested: Sequence[float]) -> Iterator[Figure]:
    """Yield the figures that `info` and `modes` show, and the largest displacement at each time."""
    if scene.woven is not None:
        found = report.report_fabric(scene, requested[0] if requested and scene.moves else None)
        for warp, weft in yarn_figures(found):
            yield warp
            yield weft
        yield from cloth_figures(found, both=True)
        yield from motion_figures(found.get("motion"))
    else:
        if scene.textile is not None:
            yield from textile_figures(scene.textile)
        yield from object_figures(object_report.report_object(scene))
    if scene.stage("solver") is not None:
        modes = report.report_modes(scene)
        yield from mode_figures(modes)
        yield from equilibrium_figures(modes["hung"])
    if scene.moves:
        times = requested or [scene.view.time]
        for time in times:
            scene.update_stage(scene.cage_stage, time)
            displacement = array_of(scene.deformed_cage.GetPointData(), "displacement", "the cage")
            largest = float(np.sqrt((displacement.astype(float) ** 2).sum(axis=1).max()))
            key = "largest displacement"
            if len(times) > 1:
                key += f" at {format_quantity(time, 's')}"
            yield Figure(key, key, "", largest, "m")


def _draw_picture(scene: Scene, time: float) -> bytes:
    with temporary_folder() as folder:
        job = PictureJob(folder / "picture.png", time)
        job.run(scene, atomic=False)
        return job.output.read_bytes()


def execute_sweep(
    sweep: Sweep,
    folder: Path,
    report_progress: StepProgress = lambda done, of: None,
    *,
    workers: int | None = None,
    cluster: str = "",
    redo: bool = False,
) -> dict[str, RunResult]:
    """Carry out all runs that have no result yet, and return all results by the run's name."""
    sweep.check()
    own_files = _check_folder(folder, sweep)
    results = (
        {}
        if redo
        else {run.name: result for run in sweep.runs if (result := _load_result(folder, run))}
    )
    waiting = [run for run in sweep.runs if run.name not in results]
    runs = len(waiting)
    count = 1 if cluster else process_count(runs, runs, sweep.memory, workers)
    with explain_disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    _write(folder / RECORD, json.dumps({"of": _MARK, "files": sorted(own_files)}, indent=1))
    report_progress(len(results), len(sweep.runs))
    function = f"{__name__}:{execute_run.__name__}"
    answers = (
        run_on_cluster(cluster, execute_run, waiting)
        if cluster
        else run_in_processes(function, waiting, count)
    )
    written = perf_counter()
    try:
        with closing(answers):
            for number, answer in answers:
                run = waiting[number]
                results[run.name] = (
                    answer if isinstance(answer, RunResult) else RunResult({}, str(answer))
                )
                _write_run(folder, run, results[run.name])
                if perf_counter() - written > _TABLE_INTERVAL:
                    _write(folder / TABLE, table_csv(sweep, results))
                    written = perf_counter()
                report_progress(len(results), len(sweep.runs))
    finally:
        # The results so far are written even if the sweep is interrupted.
        if results:
            _write(folder / TABLE, table_csv(sweep, results))
            errors = {name: result.error for name, result in results.items() if result.error}
            files = {
                run.name: picture_paths(folder, run) for run in sweep.runs if run.name in results
            }
            files = {name: paths for name, paths in files.items() if name not in errors}
            sheet = contact_sheet(sweep, sweep.title, files, errors)
            with atomic_file(folder / SHEET) as file:
                writer(file, "picture").write(file, sheet)
    return results


def picture_paths(folder: Path, run: Run) -> list[Path]:
    """Return the paths of a run's pictures."""
    names = [run.name]
    if len(run.times) > 1:
        time_texts = [format_quantity(time, "s").replace(" ", "") for time in run.times]
        names = [f"{run.name}_t={time}" for time in time_texts]
    return [folder / f"{name}.png" for name in names]


def table_rows(sweep: Sweep, results: Mapping[str, RunResult]) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the table: values, figures, duration and error of each run."""
    figures = dict.fromkeys(name for run in results.values() for name in run.figures)
    keys = [heading_with_unit(each.name, each.parameter.unit) for each in sweep.axes]
    rows = []
    for run in sweep.runs:
        result = results.get(run.name, RunResult(error="not run"))
        values = [_format_value(*each) for each in zip(sweep.axes, run.chosen, strict=True)]
        numbers = [result.figures.get(name, "") for name in figures]
        rows.append([run.name, *values, *numbers, f"{result.seconds:.3g}", result.error])
    return ["run", *keys, *figures, "seconds [s]", "message"], rows


def table_csv(sweep: Sweep, results: Mapping[str, RunResult]) -> str:
    """Return the table as CSV."""
    headings, rows = table_rows(sweep, results)
    return format_csv([headings, *rows])


def _format_value(each: ValueList, value: Any) -> str:
    checked = each.parameter.check(value)
    number = isinstance(checked, (int, float)) and not isinstance(checked, bool)
    return format_for_table(checked, each.parameter.unit) if number else each.label(value)


def _check_folder(folder: Path, sweep: Sweep) -> set[str]:
    """Return the names of all files of a sweep; refuse to overwrite files of another origin."""
    if folder.exists() and not folder.is_dir():
        raise InputError(
            f"{folder} is a file, but a sweep writes a folder", cure="Choose another name."
        )
    own_files: set[str] = set()
    record = folder / RECORD
    if record.is_file():
        try:
            record_data = json.loads(record.read_text(encoding="utf-8"))
            own_files = set(record_data["files"]) if record_data["of"] == _MARK else set()
        except (ValueError, KeyError, TypeError):
            own_files = set()
    files = {TABLE, SHEET, RECORD}
    for run in sweep.runs:
        files |= {path.name for path in picture_paths(folder, run)}
        files |= {f"{run.name}.toml", f"{run.name}.json"}
    if foreign := sorted(name for name in files - own_files if (folder / name).exists()):
        raise InputError(
            f"{folder / foreign[0]} exists already and does not belong to this sweep",
            cure="Choose a new folder.",
        )
    return own_files | files


def _load_result(folder: Path, run: Run) -> RunResult | None:
    """Return the result of the same run in an earlier sweep; None if there is none or it failed."""
    try:
        record = json.loads((folder / f"{run.name}.json").read_text(encoding="utf-8"))
        same = record["digest"] == run.digest and not record["error"]
        complete = all(path.is_file() for path in picture_paths(folder, run))
        if not same or not complete:
            return None
        return RunResult(record["figures"], "", record["warnings"], record["seconds"])
    except (OSError, ValueError, KeyError):
        return None


def _write_run(folder: Path, run: Run, result: RunResult) -> None:
    with atomic_files(folder / f"{run.name}.json") as temporary:
        for path, content in zip(picture_paths(temporary, run), result.pictures, strict=False):
            write_parts(path, [content])
        comment = f"From a sweep of {run.file.name}: {', '.join(run.labels) or 'one run'}."
        scene = format_scene(run.scene_values, comment)
        write_parts(temporary / f"{run.name}.toml", [scene.encode()])
        record = {"digest": run.digest, **asdict(replace(result, pictures=[]))}
        text = json.dumps(record, indent=1, ensure_ascii=False)
        write_parts(temporary / f"{run.name}.json", [text.encode()])


def _write(path: Path, text: str) -> None:
    with atomic_file(path) as file:
        write_parts(file, [text.encode()])
