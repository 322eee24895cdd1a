"""Commands that write files: pictures, films, data."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from spacemap_vtk.cli.options import Quiet, Set, Shown, Size, Time, opened, tell_warnings
from spacemap_vtk.cli.progress import progress
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output, whole_file, whole_folder
from spacemap_vtk.io.registry import writer as writer_of
from spacemap_vtk.io.registry import written, written_words

if TYPE_CHECKING:
    from spacemap_vtk.draw.picture import Image
    from spacemap_vtk.scenes.scene import Scene

STILL_FORMATS = {".png": "picture", ".jpg": "picture", ".jpeg": "picture"}
FILM_FORMATS = {".gif": "film", ".mp4": "film", ".png": "numbered frames, as in frames/%04d.png"}

Output = Annotated[Path, Parameter(name=["--output", "-o"])]


def render(
    scene: str,
    /,
    *,
    output: Output,
    time: Time = None,
    size: Size = None,
    color: Shown = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw a scene, a draft or a mesh at one time.

    Parameters
    ----------
    scene : str
        Scene file, draft, mesh, or name of a scene (see "spacemap scenes").
    output : Path
        A .png or .jpg file.
    """
    check_output(output, STILL_FORMATS)
    opened_scene = opened(scene, set_, time=time, size=size, color=color)
    from spacemap_vtk.draw.film import write_picture
    from spacemap_vtk.draw.picture import Picture

    at = opened_scene.view.time
    with progress(opened_scene, "Drawing", 1, quiet):
        picture = Picture(opened_scene, [at])
        image = picture.draw(at)
        picture.close()
    with whole_file(output) as file:
        write_picture(file, image)
    tell_warnings(opened_scene, quiet)


def animate(
    scene: str,
    /,
    *,
    output: Output,
    size: Size = None,
    color: Shown = None,
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
    output : Path
        A .gif or .mp4 file, or frames such as frames/%04d.png.
    """
    numbered = output.suffix.lower() == ".png"
    check_output(output, FILM_FORMATS, numbered)
    from spacemap_vtk.draw.film import require_encoder, write_film, write_frames

    require_encoder(output)
    if numbered and not re.fullmatch(r"[^%]*%0?\d*d[^%]*", output.name):
        example = re.sub("%[0-9]*[a-z]?", "", output.stem) + "-%04d.png"
        raise InputError(
            f"{output}: frames need one number in their name",
            allowed=f"for example {output.with_name(example)}",
        )
    opened_scene = opened(scene, set_, size=size, color=color)
    from spacemap_vtk.draw.picture import Picture

    opened_scene.check()
    if size is None and output.suffix.lower() == ".gif":
        opened_scene.view.size = tuple(max(16, side // 2) for side in opened_scene.view.size)
    times = opened_scene.animation.frame_times()
    rate = opened_scene.animation.frames_per_second
    with progress(opened_scene, "Drawing frames", len(times), quiet) as tell:
        picture = Picture(opened_scene, times)

        def images() -> Iterator[Image]:
            for done, time in enumerate(times, 1):
                yield picture.draw(time)
                tell(done)

        if numbered:
            with whole_folder(output) as folder:
                write_frames(folder / output.name, images())
        else:
            with whole_file(output) as file:
                write_film(file, images(), rate)
        picture.close()
    tell_warnings(opened_scene, quiet)


def storyboard(
    scene: str = "plain_weave",
    /,
    *,
    output: Output,
    times: Annotated[
        str | None,
        Parameter(help="Times in s, separated by commas; by default over the first mode's period."),
    ] = None,
    size: Size = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw a motion as the paper's figure 6 does.

    The cage (a) above, the fabric (b) below, time to the right.

    Parameters
    ----------
    scene : str
        Scene file, or name of a scene (see "spacemap scenes").
    output : Path
        A .png or .jpg file.
    """
    check_output(output, STILL_FORMATS)
    opened_scene = opened(scene, set_, size=size)
    if not opened_scene.moves:
        raise InputError(
            f"{scene}: a storyboard needs a scene that moves", cure="Add a section [response]."
        )
    if times is not None:
        moments = _times(times)
    elif opened_scene.stage("solver"):
        moments = _one_swing(opened_scene)
    else:
        first, last = opened_scene.deforming.time_range([]) or (0.0, 0.0)
        moments = _seven(first, last)
    from spacemap_vtk.draw.film import write_picture
    from spacemap_vtk.draw.sheets import storyboard as drawn

    chosen = (2240, 640) if size is None else tuple(opened_scene.view.size)
    with progress(opened_scene, "Drawing columns", len(moments), quiet) as tell:
        image = drawn(opened_scene, moments, chosen, tell)
    with whole_file(output) as file:
        write_picture(file, image)
    tell_warnings(opened_scene, quiet)


def export(
    scene: str,
    /,
    *,
    output: Annotated[
        Path,
        Parameter(name=["--output", "-o"], help=f"A {written_words()} file."),
    ],
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
    check_output(output, written())
    from spacemap_vtk.scenes.export import content, times_of

    writer = writer_of(output)
    kind = what or writer.holds[0]
    if kind not in writer.holds:
        raise InputError(
            f"{output.suffix.lower()} files do not hold that",
            key="--what",
            value=kind,
            allowed=", ".join(writer.holds),
        )
    opened_scene = opened(scene, set_, time=time)
    times = times_of(opened_scene, writer, opened_scene.view.time)
    with progress(opened_scene, "Computing", len(times), quiet) as tell:
        data = content(opened_scene, kind, writer, times, tell)
        with whole_folder(output) as folder:
            writer.write(folder / output.name, data)
    tell_warnings(opened_scene, quiet)


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


def _one_swing(scene: Scene) -> list[float]:
    """Return seven times over a period of the first mode that has one."""
    from spacemap_vtk.scenes import report

    frequencies = [mode["frequency_hz"] for mode in report.modes(scene)["modes"]]
    swinging = [f for f in frequencies if f > 0.0]
    period = 1 / swinging[0] if swinging else scene.animation.stop
    return [float(f"{time:.3g}") for time in _seven(0.0, period)]


def _seven(first: float, last: float) -> list[float]:
    """Return times as far apart as each other, both ends among them."""
    import numpy as np

    return np.linspace(first, last, 7).tolist()
