"""The command ``figure``, which lays out a page for a publication."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    PICTURE,
    ColorBy,
    Light,
    Paired,
    Quiet,
    SceneName,
    SetLists,
    Style,
    flag,
    open_scene,
    output_option,
    parse_times,
    run_job,
    times_option,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import describe_writers
from spacemap_vtk.jobs import FigureJob
from spacemap_vtk.scenes.assignments import parse_value_list
from spacemap_vtk.units import parse_quantity

#: Allowed widths of a page, in m.
_WIDTH_RANGE = 0.04, 1.2
#: Allowed resolutions, in dots per inch.
_DPI_RANGE = 30.0, 1200.0


def figure(
    scene: SceneName,
    /,
    *,
    output: Annotated[Path, output_option(f"A {describe_writers('plot')} file.")],
    panels: Annotated[
        str | None,
        Parameter(
            help="Parts of the page from top to bottom, separated by commas: pictures, draft, "
            "cloth, section. Default: pictures of a moving scene; draft, cloth and section of a "
            "still one."
        ),
    ] = None,
    times: Annotated[
        tuple[str, ...],
        times_option(
            "the start, a quarter and a half of the first mode's period",
            *("--times", "--time"),
        ),
    ] = (),
    set_: SetLists = (),
    paired: Paired = False,
    color: ColorBy = None,
    style: Style = None,
    light: Light = None,
    cage: Annotated[
        bool, flag("Draw the cages in a row above the pictures.", group=PICTURE)
    ] = False,
    columns: Annotated[int | None, Parameter(help="Number of pictures in a row.")] = None,
    end: Annotated[
        int | None,
        Parameter(
            help="End along which the section is cut, counted from 1. Default: the middle one."
        ),
    ] = None,
    pick: Annotated[
        int | None,
        Parameter(
            help="Pick along which the section is cut, counted from 1. Default: the middle one."
        ),
    ] = None,
    width: Annotated[
        str,
        Parameter(help="Width of the page; many journals use 88mm for one column, 180mm for two."),
    ] = "180mm",
    dpi: Annotated[float, Parameter(help="Resolution of the pictures, in dots per inch.")] = 300.0,
    dark: Annotated[bool, flag("Draw light lines on a dark page.")] = False,
    transparent: Annotated[bool, flag("Make the background transparent.")] = False,
    quiet: Quiet = False,
) -> None:
    """Lay out a page for a publication: pictures, draft and cloth, Peirce's sections.

    All pictures share one camera and one colour scale; a legend below has the axes, a scale bar
    (without perspective, or for the camera's focal plane) and the colours. Sections and
    drafts are lines and text in an .svg or .pdf.

    A motion at three times, coloured:

        spacemap figure plain_weave -o swing.pdf

    A draft next to its cloth, and Peirce's sections with their dimensions:

        spacemap figure cloth.wif -o cloth.svg

    Only the sections along the third end and the fifth pick, for one column:

        spacemap figure satin_8_3 -o section.pdf --panels section --end 3 \\
            --pick 5 --width 88mm

    Cages above fabrics at four times, for a dark slide:

        spacemap figure plain_weave -o slide.png --cage --dark --transparent \\
            --times 0,20ms,40ms,60ms

    Three dampings (rows) at three times (columns):

        spacemap figure plain_weave -o damping.pdf --color displacement \\
            --set response.alpha=0,5,50 --times 20ms,60ms,100ms
    """
    chosen = open_scene(scene, color=color, style=style, light=light)
    lists = []
    for assignment in set_:
        if len(parse_value_list(assignment, chosen.parts).values) > 1:
            lists.append(assignment)
        else:
            chosen.set(assignment)
    if not _DPI_RANGE[0] <= dpi <= _DPI_RANGE[1]:
        raise InputError(
            "the resolution is out of range", key="--dpi", value=dpi, allowed="30 to 1200"
        )
    from spacemap_vtk.draw.figure.figure_page import FigurePage

    page = FigurePage(
        panels=[] if panels is None else [word.strip() for word in panels.split(",")],
        times=parse_times(times),
        lists=lists,
        paired=paired,
        cage=cage,
        columns=columns,
        end=end,
        pick=pick,
        width=1e3 * _parse_width(width),
        dpi=dpi,
        dark=dark,
        transparent=transparent,
    )
    job = FigureJob(output, page)
    if color is None and not panels and chosen.moves and chosen.view.color == "own":
        chosen.assign("view", "color", "displacement")
    run_job(job, chosen, "Drawing", quiet)


def _parse_width(text: str) -> float:
    with suppress(InputError):
        if _WIDTH_RANGE[0] <= (found := parse_quantity(text, "m")) <= _WIDTH_RANGE[1]:
            return found
    raise InputError(
        "must be the width of a page", key="--width", value=text, allowed="40mm to 1200mm"
    )
