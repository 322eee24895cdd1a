"""The command ``print``, which prints a draft for the loom."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

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
from spacemap_vtk.draw.draft_print.settings import PrintSettings, local_paper
from spacemap_vtk.jobs import PrintJob


def _option(name: str) -> Parameter:
    """Declare the option of a setting."""
    setting = PrintSettings.parameter(name)
    default = setting.automatic or setting.default_text.strip('"')
    default = "that of your country" if name == "paper" else default
    return Parameter(help=f"{setting.help} Default: {default}.", show_default=False)


def print_draft(
    scene: SceneName,
    /,
    *,
    output: Annotated[
        Path, output_option("A .pdf file, or .svg, .png, .jpg files of pages, as in page-%02d.svg.")
    ],
    paper: Annotated[Literal["a4", "letter"] | None, _option("paper")] = None,
    orientation: Annotated[Literal["portrait", "landscape"] | None, _option("orientation")] = None,
    faces: Annotated[Literal["both", "face", "reverse"] | None, _option("faces")] = None,
    floats: Annotated[str | None, _option("floats")] = None,
    cell: Annotated[str | None, _option("cell")] = None,
    ends: Annotated[str | None, _option("ends")] = None,
    picks: Annotated[str | None, _option("picks")] = None,
    pages: Annotated[str | None, _option("pages")] = None,
    start: Annotated[Literal["bottom-left", "top-right"] | None, _option("start")] = None,
    mono: Annotated[bool, flag(PrintSettings.parameter("mono").help)] = False,
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
    given = {
        **{"paper": paper or local_paper(), "orientation": orientation, "faces": faces},
        **{"floats": floats, "cell": cell, "ends": ends, "picks": picks, "pages": pages},
        **{"start": start, "mono": mono or None},
    }
    settings = PrintSettings()
    with name_options():
        for name, value in given.items():
            if value is not None:
                settings.set_from_scene(name, value)
        job = PrintJob(output, settings.given_values)
    run_job(job, open_scene(scene, set_), "Printing", quiet)
