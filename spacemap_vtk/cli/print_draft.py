"""The command ``print``, which prints a draft for the loom."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    Quiet,
    SceneName,
    Set,
    flag,
    name_options,
    open_scene,
    output_option,
    run_job,
)
from spacemap_vtk.draw.draft_print.settings import (
    FACES,
    ORIENTATIONS,
    PAPERS,
    STARTS,
    PrintSettings,
    local_paper,
)
from spacemap_vtk.jobs import PrintJob

_USUAL = PrintSettings()


def print_draft(
    scene: SceneName,
    /,
    *,
    output: Annotated[
        Path,
        output_option(
            "A .pdf file, or .svg, .png or .jpg files of single pages, as in page-%02d.svg."
        ),
    ],
    paper: Annotated[
        str | None,
        Parameter(help=f"{', '.join(PAPERS)}. Default: that of your country (LC_PAPER, LANG)."),
    ] = None,
    orientation: Annotated[
        str, Parameter(help=f"{', '.join(ORIENTATIONS)}; auto takes the one with fewer pages.")
    ] = _USUAL.orientation,
    faces: Annotated[
        str, Parameter(help=f"Faces of the cloth that are drawn: {', '.join(FACES)}.")
    ] = _USUAL.faces,
    floats: Annotated[
        str,
        Parameter(
            help="Mark floats over more threads than this, or longer than this, for example 10mm."
        ),
    ] = _USUAL.floats,
    cell: Annotated[
        str, Parameter(help="Least side of a cell; larger cells give more pages.")
    ] = _USUAL.cell,
    ends: Annotated[
        str, Parameter(help="Print only these ends, for example 1-200.", show_default=False)
    ] = _USUAL.ends,
    picks: Annotated[
        str, Parameter(help="Print only these picks, for example 1-200.", show_default=False)
    ] = _USUAL.picks,
    pages: Annotated[
        str,
        Parameter(help="Write only these pages, for example 3 or 3-5.", show_default=False),
    ] = _USUAL.pages,
    start: Annotated[
        str,
        Parameter(
            help=f"Where end 1 and pick 1 are: {', '.join(STARTS)} (beside the tie-up). "
            "bottom-left shows the cloth as the window and the pictures do."
        ),
    ] = _USUAL.start,
    mono: Annotated[
        bool, flag("Without colours: black where an end is on top, letters for yarns.")
    ] = False,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Print a draft for the loom on as many pages as it needs.

    The first page has title, notes, yarns, longest floats and an overview; a small draft is drawn
    there whole. Then come threading, treadling and colours by groups, with boxes to tick, and
    heddles on each shaft; then pages with threading, tie-up, treadling (or liftplan) and drawdown,
    cut between groups where possible, and the reverse of the cloth. Cells are never smaller than
    2 mm. Long floats are marked by lines.

    For example:

        spacemap print draft.wif -o draft.pdf
        spacemap print draft.wif -o draft.pdf --paper letter --start top-right --floats 10mm
        spacemap print large.wif -o part.pdf --ends 1-200 --picks 1-120 --mono
        spacemap print twill_2_2 -o page-%02d.png --set weave.ends=40

    A draft as a figure on a page of a publication is drawn by "spacemap figure".
    """
    with name_options():
        settings = PrintSettings(
            paper=paper or local_paper(),
            orientation=orientation,
            faces=faces,
            floats=floats,
            cell=cell,
            ends=ends,
            picks=picks,
            pages=pages,
            start=start,
            mono=mono,
        )
        job = PrintJob(output, settings)
    run_job(job, open_scene(scene, set_), "Printing", quiet)
