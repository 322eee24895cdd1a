"""Commands that write files: pictures, films, data."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    ColorBy,
    Quiet,
    Set,
    Size,
    Time,
    opened,
    tell_warnings,
)
from spacemap_vtk.cli.progress import progress
from spacemap_vtk.draw.order import Order, carry_out
from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.output import whole_file

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene

_OUTPUT = ["--output", "-o"]
PictureFile = Annotated[
    Path, Parameter(name=_OUTPUT, help=f"A {registry.written_words('picture')} file.")
]


def render(
    scene: str,
    /,
    *,
    output: PictureFile,
    time: Time = None,
    size: Size = None,
    color: ColorBy = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw a scene, a draft or a mesh at one time.

    Parameters
    ----------
    scene : str
        Scene file, draft, mesh, or name of a scene (see "spacemap scenes").
    """
    order = Order("picture", output)
    chosen = opened(scene, set_, time=time, size=size, color=color)
    _carry_out(order, chosen, "Drawing", quiet)


def animate(
    scene: str,
    /,
    *,
    output: Annotated[
        Path,
        Parameter(
            name=_OUTPUT,
            help=f"A {registry.written_words('film')} file, or frames such as frames/%04d.png.",
        ),
    ],
    size: Size = None,
    color: ColorBy = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Make a film of a scene, or numbered frames.

    The section [animation] says which times it shows, and how many frames a second. Without
    --size, a GIF is drawn at half the scene's size. An .mp4 needs the extra [movie]. Numbered
    frames appear all together, when the last is drawn.

    Parameters
    ----------
    scene : str
        Scene file, draft, mesh, or name of a scene (see "spacemap scenes").
    """
    order = Order("film", output)
    chosen = opened(scene, set_, size=size, color=color)
    order.size = chosen.view.size if size else None
    _carry_out(order, chosen, "Drawing frames", quiet)


def storyboard(
    scene: str = "plain_weave",
    /,
    *,
    output: PictureFile,
    times: Annotated[
        str | None,
        Parameter(help="Times in s, separated by commas; by default over the first mode's period."),
    ] = None,
    motions: Annotated[
        str | None,
        Parameter(
            help="What moves it, in a row each, by the same loads, damping and start: response "
            "(by modes), rotation (modes, their turning rebuilt), transient (by steps), separated "
            "by commas; by default as the scene says."
        ),
    ] = None,
    size: Size = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw a motion as the paper's figure 6 does.

    The cage (a) above, the fabric (b) below, time to the right. With --motions the same scene moved
    in several ways, one below the other.

    Parameters
    ----------
    scene : str
        Scene file, or name of a scene (see "spacemap scenes").
    """
    order = Order("storyboard", output)
    chosen = opened(scene, set_, size=size)
    if not chosen.moves:
        raise InputError(
            f"{scene}: a storyboard needs a scene that moves", cure="Add a section [response]."
        )
    order.times = () if times is None else _times(times)
    order.motions = () if motions is None else _motions(motions)
    order.size = chosen.view.size if size else None
    _carry_out(order, chosen, "Drawing columns", quiet)


def export(
    scene: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=_OUTPUT, help=f"A {registry.written_words()} file.")],
    what: Annotated[
        str | None,
        Parameter(
            help="patches, cage, surface or draft; by default what the ending stands for first: "
            "patches for .vtu."
        ),
    ] = None,
    time: Time = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Write a scene's data for other programs.

    The fabric's Bézier patches, the cage with its motion, the surface as triangles or polygons, or
    the draft: the output's ending tells which.

    Parameters
    ----------
    scene : str
        Scene file, draft, mesh, or name of a scene (see "spacemap scenes").
    """
    try:
        order = Order(what or "", output)
    except InputError as error:
        error.key = error.key and f"--{error.key}"  # in the words of the command line
        raise
    chosen = opened(scene, set_, time=time)
    _carry_out(order, chosen, "Computing", quiet)


def convert(
    draft: Annotated[Path, Parameter(help=f"{registry.read_words('draft')}.")],
    output: Annotated[Path, Parameter(help=f"A {registry.written_words('draft')} file.")],
    /,
    *,
    trim: Annotated[
        bool,
        Parameter(
            negative="",
            help="Cut off ends in no heddle at the sides, picks without a shed before and after.",
            show_default=False,
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Turn a weaver's draft into another format.

    Threading, tie-up, treadling or liftplan, colours, spacings and thicknesses go from one file to
    the other unchanged; what the new format cannot hold is told. Nothing is drawn, so that drafts
    without room for their yarns are converted, too. A scene as a draft: "spacemap export SCENE
    -o cloth.wif".

    "spacemap convert cloth.dtx cloth.wif", "spacemap convert drawdown.png cloth.dtx"

    Parameters
    ----------
    draft : Path
        What is read.
    output : Path
        What is written: whole, or not at all.
    """
    from spacemap_vtk.io.draft_file import read_draft

    Order("draft", output)  # refuses what cannot be written
    known = [ending for each in registry.readers("draft") for ending in each.endings]
    if draft.suffix.lower() not in known:
        raise InputError(
            f"{draft}: not a draft",
            allowed=", ".join(known),
            cure='Of a scene "spacemap export" makes a draft.',
        )
    found = read_draft(registry.existing(draft, ", ".join(known)), trim)
    format_ = registry.writer(output, "draft")
    with whole_file(output) as file:
        format_.write(file, found)
    if not quiet:
        for text in (*found.warnings, *(format_.loses(found) if format_.loses else ())):
            print(f"spacemap: warning: {text}", file=sys.stderr)


def _carry_out(order: Order, scene: Scene, doing: str, quiet: bool) -> None:
    with progress(scene, doing, quiet) as tell:
        carry_out(order, scene, tell)
    tell_warnings(scene, quiet)


def _motions(text: str) -> list[str]:
    from spacemap_vtk.scenes.motions import MOTIONS

    names = [word.strip() for word in text.split(",")]
    if unknown := [name for name in names if name not in MOTIONS]:
        raise InputError(
            "no such motion", key="--motions", value=unknown[0], allowed=", ".join(MOTIONS)
        )
    return names


def _times(text: str) -> list[float]:
    from spacemap_vtk.units import parse_quantity

    refused = InputError(
        "not a list of times",
        key="--times",
        value=text,
        allowed="up to 100 times of at least 0 s, as in 0,20ms,0.04",
    )
    try:
        times = [parse_quantity(word, "s") for word in text.split(",")]
    except InputError as error:
        raise refused from error
    if not all(0.0 <= t < math.inf for t in times) or len(times) > 100:
        raise refused
    return times
