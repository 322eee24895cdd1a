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
    from spacemap_vtk.scenes.runs import Sweep

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
        output_option("A folder; it is made where it is not there."),
    ],
    set_: SetLists = (),
    paired: Paired = False,
    time: Annotated[
        tuple[str, ...], times_option("by default the scene's", "--time", "--times")
    ] = (),
    size: Size = None,
    color: ColorBy = None,
    workers: Annotated[
        int | None,
        Parameter(
            help="Processes that work side by side; by default one for each core, as far as memory "
            "goes."
        ),
    ] = None,
    cluster: Annotated[
        str | None,
        Parameter(
            help="In place of these the workers of a Dask cluster, by its scheduler's address, as "
            "in tcp://host:8786. They have this program, and find a scene's files where they are "
            "here. Needs the extra [cluster]."
        ),
    ] = None,
    again: Annotated[bool, flag("Compute again what is in the folder already.")] = False,
    quiet: Quiet = False,
) -> None:
    """Run a scene over lists of values, into a folder.

    Each run has its picture, its scene as a .toml that renders alone, and its figures as .json;
    table.csv has the values and the figures of all, with their units, contact_sheet.png all
    pictures. Runs that are there already are kept, so that a sweep that was stopped goes on, and
    one with more values adds to what it has. A run that fails, such as of yarns that have no room,
    stands in the table with its message, and does not stop the others; the exit status is then 1.

    Commas within brackets or quotes belong to a value: --set "modal.gravity=[0,0,-5],[0,0,-9.8]"
    goes through two vectors (as [[0,0,-5],[0,0,-9.8]] does), --set 'modal.fixed="-x, +x",+y'
    through two texts. linspace(0.4 mm, 0.6 mm, 5) stands for five values with even steps from the
    first to the last, geomspace(1 kPa, 1 MPa, 4) for four each of which is as many times the one
    before.

    Nine runs, every spacing with every count:

    "spacemap sweep yarn_to_cloth -o cloth --set weave.warp_spacing=0.45mm,0.5mm,0.6mm
    --set 'weave.warp_count=20 tex,25 tex,30 tex'"

    Three runs, of square cloths, smaller pictures, on four processes:

    "spacemap sweep plain_weave -o square --zip --set weave.ends=5,7,9 --set weave.picks=5,7,9
    --size 640x480 --workers 4"
    """
    if workers is not None and (workers < 1 or cluster is not None):
        raise InputError(
            "no number of processes" if workers < 1 else "a cluster has workers of its own",
            key="--workers",
            value=workers,
            allowed="at least 1, and no --cluster",
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
    from spacemap_vtk.scenes.runs import sweep_of

    asked = sweep_of(scene, set_, paired=paired, times=times, fixed=fixed)
    with progress(None, "Running", quiet) as tell:
        found = execute_sweep(
            asked, output, tell, workers=workers, cluster=cluster or "", again=again
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
            f"{len(failed)} of {len(found)} runs failed, the others are whole; "
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
    told = number_table(("\n".join(_wrap_heading(headings[k])) for k in shown), title=sweep.title)
    for row in rows:
        cells = [row[k] or "–" for k in shown]
        told.add_row(*cells[:-1], "failed" if row[-1] else cells[-1])
    console.print(told)


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
    alike: dict[str, list[str]] = {}
    for result in found.values():
        for text in dict.fromkeys(result.warnings):
            alike.setdefault(re.sub(r"[0-9.]+", "#", text), []).append(text)
    for texts in list(alike.values())[:_MOST_WARNINGS]:
        like = "" if len(set(texts)) == 1 else ", with other numbers"
        count = f"{len(texts)} of {len(found)} runs{like}"
        print(f"spacemap: warning: {texts[0]} ({count})", file=sys.stderr)
    if len(alike) > _MOST_WARNINGS:
        more = len(alike) - _MOST_WARNINGS
        print(f"spacemap: warning: {more} more, in the .json of each run", file=sys.stderr)
