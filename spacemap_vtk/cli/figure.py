"""The command ``figure``, which lays out a page for a publication."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    ColorBy,
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
from spacemap_vtk.scenes.assignments import swept
from spacemap_vtk.units import parse_quantity

#: Accepted widths of a page in m; accepted dots per inch.
_WIDTH_RANGE, _DPI_RANGE = (0.04, 1.2), (30.0, 1200.0)


def figure(
    scene: SceneName,
    /,
    *,
    output: Annotated[Path, output_option(f"A {describe_writers('plot')} file.")],
    panels: Annotated[
        str | None,
        Parameter(
            help="What stands on the page, from above, separated by commas: pictures, draft, "
            "cloth, section. By default pictures of what moves, and all else of a still cloth."
        ),
    ] = None,
    times: Annotated[
        tuple[str, ...],
        times_option(
            "by default the beginning, a quarter and a half of the first mode's swing",
            *("--times", "--time"),
        ),
    ] = (),
    set_: SetLists = (),
    paired: Paired = False,
    color: ColorBy = None,
    style: Style = None,
    cage: Annotated[bool, flag("Cages in a row over the pictures.")] = False,
    columns: Annotated[int | None, Parameter(help="Pictures in a row.")] = None,
    end: Annotated[
        int | None, Parameter(help="The end that is cut along, from 1; by default in the middle.")
    ] = None,
    pick: Annotated[
        int | None, Parameter(help="The pick that is cut along, from 1; by default in the middle.")
    ] = None,
    width: Annotated[
        str, Parameter(help="Of the page: 180mm is two columns of many journals, 88mm is one.")
    ] = "180mm",
    dpi: Annotated[float, Parameter(help="Dots per inch of its pictures.")] = 300.0,
    dark: Annotated[bool, flag("Light ink on dark paper.")] = False,
    transparent: Annotated[
        bool, flag("No paper: what the figure is laid on shows through.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Lay out a page: pictures, draft and cloth, Peirce's sections.

    Pictures are seen from one place and have one scale of colours; a key below has the axes, a
    round length (without perspective, or in the plane of the camera's focus) and the colours.
    Sections and drafts are drawn from the cloth's own curves and matrices, and stay lines and
    letters in an .svg or a .pdf.

    A swing at three times, coloured: "spacemap figure plain_weave -o swing.pdf"

    A weaver's draft beside its cloth, and Peirce's sections with their dimensions:
    "spacemap figure cloth.wif -o cloth.svg"

    The sections alone, along the third end and the fifth pick, for one column:
    "spacemap figure satin_8_3 -o section.pdf --panels section --end 3 --pick 5 --width 88mm"

    Cages over fabrics at four times, for a dark slide: "spacemap figure plain_weave -o slide.png
    --cage --times 0,20ms,40ms,60ms --dark --transparent"

    Three dampings (rows) at three times (columns): "spacemap figure plain_weave -o damping.pdf
    --set response.alpha=0,5,50 --times 20ms,60ms,100ms --color displacement"
    """
    chosen = open_scene(scene, color=color, style=style)
    lists = []
    for assignment in set_:
        if len(swept(assignment, chosen.parts).values) > 1:
            lists.append(assignment)
        else:
            chosen.set(assignment)
    if not _DPI_RANGE[0] <= dpi <= _DPI_RANGE[1]:
        raise InputError("no resolution", key="--dpi", value=dpi, allowed="30 to 1200")
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
        "no width of a page", key="--width", value=text, allowed="40mm to 1200mm, with its unit"
    )
