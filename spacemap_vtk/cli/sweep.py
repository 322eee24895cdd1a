"""The command ``sweep``, which runs a scene over lists of values."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    ColorBy,
    Paired,
    Quiet,
    SceneName,
    SetLists,
    Size,
    flag,
    number_table,
    open_scene,
    output_option,
    parse_times,
    print_warnings,
    progress,
    times_option,
)
from spacemap_vtk.errors import InputError, SpacemapError

if TYPE_CHECKING:
    from spacemap_vtk.jobs.sweep import RunResult
    from spacemap_vtk.scenes.sweep import Sweep

#: Beginnings of the headings of figures that are printed first if they differ between runs. The
#: table's file contains all figures.
_FIRST_COLUMNS = (
    *("sag", "drape coefficient", "warp crimp [", "weft crimp [", "areal mass", "cover ["),
    *("mode 1 [", "largest displacement", "largest rotation", "thickness"),
    *("least clearance", "deformed clearance", "sheet bending length"),
)
#: Most warnings that are printed for all runs together.
_MOST_WARNINGS = 5


def sweep(
    scene: SceneName,
    /,
    *,
    output: Annotated[
        Path,
        output_option("Output folder; it is created if it does not exist."),
    ],
    set_: SetLists = (),
    paired: Paired = False,
    time: Annotated[tuple[str, ...], times_option("that of the scene", "--time", "--times")] = (),
    size: Size = None,
    color: ColorBy = None,
    workers: Annotated[
        int | None,
        Parameter(help="Number of processes. Default: one for each core, as far as memory allows."),
    ] = None,
    cluster: Annotated[
        str | None,
        Parameter(
            help="Address of the scheduler of a Dask cluster that runs the scenes instead, for "
            "example tcp://host:8786. Its workers need this program, and the scene's files under "
            "the same paths. Needs the extra [cluster]."
        ),
    ] = None,
    again: Annotated[bool, flag("Repeat the runs that are already in the folder.")] = False,
    quiet: Quiet = False,
) -> None:
    """Run a scene for lists of values, with a table and a contact sheet.

    For each run, the output folder gets a picture, a scene file (.toml) and the figures (.json);
    table.csv lists the values and figures of all runs with their units, contact_sheet.png shows all
    pictures. Runs that are already in the folder are kept: the same command continues a stopped
    sweep, and more values add runs. A run that fails, for example because its yarns do not fit, is
    listed with its error and does not stop the others; the exit status is then 1.

    Nine runs, every spacing with every count:

        spacemap sweep yarn_to_cloth -o cloth \\
            --set weave.warp_spacing=0.45mm,0.5mm,0.6mm \\
            --set 'weave.warp_count=20 tex,25 tex,30 tex'

    Three runs of square cloths, with smaller pictures, in four processes:

        spacemap sweep plain_weave -o square --size 640x480 --workers 4 \\
            --zip --set weave.ends=5,7,9 --set weave.picks=5,7,9

    Commas within brackets or quotes belong to one value: --set
    "modal.gravity=[0,0,-5],[0,0,-9.8]" has two vectors (like [[0,0,-5],[0,0,-9.8]]), --set
    'modal.fixed="-x, +x",+y' two texts. linspace(0.4 mm, 0.6 mm, 5) gives five values with equal
    differences, geomspace(1 kPa, 1 MPa, 4) four values with equal ratios.
    """
    if workers is not None and (workers < 1 or cluster is not None):
        raise InputError(
            "the number of processes is out of range"
            if workers < 1
            else "cannot be combined with --cluster",
            key="--workers",
            value=workers,
            allowed="at least 1, without --cluster",
        )
    times = parse_times(time, "--time")
    chosen = open_scene(scene, size=size, color=color)
    fixed: list[tuple[str, str, Any]] = []
    if times:
        fixed.append(("view", "time", times[0]))
    if size is not None:
        fixed.append(("view", "size", list(chosen.view.size)))
    if color is not None:
        fixed.append(("view", "color", color))
    from spacemap_vtk.jobs.sweep import SHEET, TABLE, execute_sweep
    from spacemap_vtk.scenes.sweep import read_sweep

    asked = read_sweep(scene, set_, paired=paired, times=times, fixed=fixed)
    with progress(None, "Running", quiet) as report_progress:
        found = execute_sweep(
            asked, output, report_progress, workers=workers, cluster=cluster or "", redo=again
        )
    if not quiet:
        _print_table(asked, found)
        print(f"{output / TABLE}, {output / SHEET}")
        print_warnings(chosen, quiet)
        _print_run_warnings(found)
    failed = [run for run in asked.runs if found[run.name].error]
    if failed:
        first = f"{', '.join(failed[0].labels)}: " if failed[0].labels else ""
        raise SpacemapError(
            f"{len(failed)} of {len(found)} runs failed, the others are complete; "
            f"{first}{found[failed[0].name].error}"
        )


def _print_table(sweep: Sweep, found: Mapping[str, RunResult]) -> None:
    """Print the values and the figures that differ, as many as fit the width."""
    from rich.console import Console

    from spacemap_vtk.jobs.sweep import table_rows

    headings, rows = table_rows(sweep, found)
    rows = [[_round_number(cell) for cell in row] for row in rows]
    last = len(headings) - 2  # the column of seconds; the message follows
    columns = list(range(1, 1 + len(sweep.axes)))
    differ = [
        k
        for k in range(columns[-1] + 1 if columns else 1, last)
        if len({row[k] for row in rows if not row[-1]}) > 1
    ]
    first = [k for name in _FIRST_COLUMNS for k in differ if headings[k].startswith(name)]
    console = Console(markup=False)
    room = console.width - 2
    shown = []
    for k in (*columns, last, *dict.fromkeys((*first, *differ))):
        room -= 2 + max(
            len(word) for word in (*_wrap_heading(headings[k]), *(row[k] for row in rows))
        )
        if room > 0 or k in columns or k == last:
            shown.append(k)
    shown.sort()
    shown_table = number_table(
        ("\n".join(_wrap_heading(headings[k])) for k in shown), title=sweep.title
    )
    for row in rows:
        cells = [row[k] or "–" for k in shown]
        shown_table.add_row(*cells[:-1], "failed" if row[-1] else cells[-1])
    console.print(shown_table)


def _round_number(entry: str) -> str:
    """Round a number to four digits; return words unchanged."""
    try:
        return f"{float(entry):.4g}" if "." in entry else entry
    except ValueError:
        return entry


def _wrap_heading(heading: str) -> list[str]:
    """Split a heading into short lines, the unit in the last."""
    name, bracket, unit = heading.partition(" [")
    words = name.replace(".", ". ").replace("_", "_ ").replace(" ", "\n").split("\n")
    return [*words, *([bracket.strip() + unit] if unit else [])]


def _print_run_warnings(found: Mapping[str, RunResult]) -> None:
    """Print the stages' warnings; of those that differ only in numbers, the first."""
    groups: dict[str, list[str]] = {}
    for result in found.values():
        for text in dict.fromkeys(result.warnings):
            groups.setdefault(re.sub(r"[0-9.]+", "#", text), []).append(text)
    for texts in list(groups.values())[:_MOST_WARNINGS]:
        like = "" if len(set(texts)) == 1 else ", with different numbers"
        count = f"{len(texts)} of {len(found)} runs{like}"
        print(f"spacemap: warning: {texts[0]} ({count})", file=sys.stderr)
    if len(groups) > _MOST_WARNINGS:
        more = len(groups) - _MOST_WARNINGS
        print(f"spacemap: warning: {more} more, see the .json of each run", file=sys.stderr)
