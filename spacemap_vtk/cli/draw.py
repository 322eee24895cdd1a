"""Commands that write files: pictures, films, data."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import (
    ColorBy,
    Fps,
    From,
    Quiet,
    ScaleBar,
    SceneFile,
    SceneName,
    Set,
    Size,
    Style,
    Time,
    TimeStamp,
    To,
    Triad,
    flag,
    name_options,
    open_scene,
    output_option,
    parse_times,
    run_job,
    times_option,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.output import atomic_file, check_output
from spacemap_vtk.jobs import (
    DataJob,
    FilmJob,
    ModesJob,
    MovingJob,
    PictureJob,
    StoryboardJob,
    make_data_job,
)
from spacemap_vtk.jobs.job import Job
from spacemap_vtk.jobs.picture import MOST_SAMPLES, SAMPLES
from spacemap_vtk.units import parse_quantity

PictureFile = Annotated[Path, output_option(f"A {registry.describe_writers('picture')} file.")]


def render(
    scene: SceneName,
    /,
    *,
    output: PictureFile,
    time: Time = None,
    size: Size = None,
    color: ColorBy = None,
    style: Style = None,
    scale_bar: ScaleBar = False,
    triad: Triad = False,
    time_stamp: TimeStamp = False,
    raytrace: Annotated[
        bool,
        flag(
            "Trace rays of light from fibre to fibre (slow; needs the extra [raytrace]): for "
            "close-ups, with --set view.zoom=6."
        ),
    ] = False,
    samples: Annotated[
        int | None,
        Parameter(
            help="Rays for each pixel, with --raytrace; by default 64. Noise falls with them."
        ),
    ] = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw a scene, a draft or a mesh at one time."""
    if samples is not None and not (raytrace and 1 <= samples <= MOST_SAMPLES):
        raise InputError(
            "no number of rays" if raytrace else "nothing is traced",
            key="--samples",
            value=samples,
            allowed=f"1 to {MOST_SAMPLES}, with --raytrace",
        )
    job = PictureJob(output, samples=(samples or SAMPLES) if raytrace else 0)
    signs = {"scale_bar": scale_bar, "triad": triad, "time_stamp": time_stamp}
    chosen = open_scene(scene, set_, time=time, size=size, color=color, style=style, signs=signs)
    run_job(job, chosen, "Drawing", quiet)


def animate(
    scene: SceneName,
    /,
    *,
    output: Annotated[
        Path,
        output_option(
            f"A {registry.describe_writers('film')} file, or frames such as frames/%04d.png."
        ),
    ],
    size: Size = None,
    color: ColorBy = None,
    style: Style = None,
    scale_bar: ScaleBar = False,
    triad: Triad = False,
    time_stamp: TimeStamp = False,
    workers: Annotated[
        int | None,
        Parameter(
            help="Processes that draw side by side; by default one for each core, as far as memory "
            "and the work go."
        ),
    ] = None,
    again: Annotated[bool, flag("Draw again what is there of a film that was stopped.")] = False,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Make a film of a scene, or numbered frames.

    The section [animation] says which times it shows, and how many frames a second. Without
    --size, a GIF is drawn at half the scene's size. An .mp4 needs the extra [movie]. Numbered
    frames appear all together, when the last is drawn.

    A film that is stopped, by Ctrl-C or because the machine goes down, leaves its frames in a
    folder beside it, as film.mp4.frames: the same command goes on from there. Frames of another
    scene, or of other settings, are never used. The folder goes when the film is whole.
    """
    with name_options():
        job = FilmJob(output, workers=workers, again=again)
    signs = {"scale_bar": scale_bar, "triad": triad, "time_stamp": time_stamp}
    chosen = open_scene(scene, set_, size=size, color=color, style=style, signs=signs)
    if size:
        job = replace(job, size=chosen.view.size)
    try:
        run_job(job, chosen, "Drawing frames", quiet)
    except BaseException as error:
        from spacemap_vtk.jobs.frames import BusyError, FrameFolder

        kept = FrameFolder(output)
        if kept.count and not isinstance(error, BusyError):
            print(
                f"spacemap: {kept.count} frames are kept in {kept.folder}: the same command goes "
                "on from there",
                file=sys.stderr,
            )
        raise


def storyboard(
    scene: SceneFile = "plain_weave",
    /,
    *,
    output: PictureFile,
    times: Annotated[
        tuple[str, ...],
        times_option("by default over the first mode's period", "--times", "--time"),
    ] = (),
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
    """
    names = () if motions is None else [word.strip() for word in motions.split(",")]
    with name_options():
        job = StoryboardJob(output, parse_times(times), motions=names)
    chosen = open_scene(scene, set_, size=size)
    if size:
        job = replace(job, size=chosen.view.size)
    run_job(job, chosen, "Drawing columns", quiet)


def export(
    scene: SceneName,
    /,
    *,
    output: Annotated[Path, output_option(f"A {registry.describe_writers()} file.")],
    what: Annotated[
        str | None,
        Parameter(
            help=f"{', '.join(registry.DATA)}; by default what the ending stands for first: "
            "patches for .vtu.",
            completer=completers.data_kinds,
        ),
    ] = None,
    time: Time = None,
    color: ColorBy = None,
    times: Annotated[
        tuple[str, ...],
        times_option("by default those of a film, see the section [animation]"),
    ] = (),
    start: From = None,
    stop: To = None,
    fps: Fps = None,
    tolerance: Annotated[
        str | None,
        Parameter(
            help="How far the surface in an .html, .glb or .usdc may be from its motion, as in "
            "0.01mm; by default a fiftieth of the thinnest yarn. The less, the larger the file."
        ),
    ] = None,
    curves: Annotated[
        str | None,
        Parameter(
            help="What a .usdc has as curves with widths, for a renderer's hair: yarns (default), "
            "plies, fibres, or a number of fibres for each yarn."
        ),
    ] = None,
    subdivisions: Annotated[
        int | None,
        Parameter(
            help="Of each patch of the surface in a .glb or .usdc that moves; by default as the "
            "scene says, or fewer where there would be more than half a million points."
        ),
    ] = None,
    pieces: Annotated[
        int | None,
        Parameter(
            help="Parts that a .pvtp or .pvtu is made and written in, yarns by yarns, so that all "
            "need not fit into memory; 4 by default."
        ),
    ] = None,
    modes: Annotated[bool, flag("Mode shapes in place of the motion: --what modes.")] = False,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Write a scene's data for other programs.

    The fabric's Bézier patches, the cage with its motion, the surface as triangles or polygons, the
    draft, or the surface with its motion: the output's ending tells which.

    Where a series is written, it is of the film's times, or of --times, or --from, --to and --fps:
    a .pvd lists files in a folder beside, a .vtkhdf has all in itself, cloth_%04d.vtp (or .stl,
    .ply, .glb ...) is a file for each time. It appears when the last is written, and nothing of it
    where it is stopped. What --color shows rides along as an array.

    An .html is a page of its own, opened by a double click, that turns, plays and scrubs; colours
    of stress and the like change there, with their scale. A .glb plays in presentations and
    Blender. Their motion is a sum of few shapes (morph targets), as many as the tolerance asks for;
    how many, how near and how large the file is are told. With --modes it has a shape and a swing
    for each mode; --set modal.modes=12 for fewer.

    A .pvtp (surface) or .pvtu (patches) lists files of pieces in a folder beside, as ParaView does.
    """
    if pieces is not None and pieces < 1:
        raise InputError("no number of pieces", key="--pieces", value=pieces, allowed="1 or more")
    with name_options():
        job = make_data_job(output, "modes" if modes else what or "", pieces=pieces or 0)
    chosen = open_scene(scene, set_, time=time, color=color, start=start, stop=stop, fps=fps)
    given = {"--times": times or None, "--from": start, "--to": stop, "--fps": fps}
    if found := [option for option, value in given.items() if value is not None]:
        _check_times(job, found)
    with name_options():
        if isinstance(job, (DataJob, MovingJob)):
            if times:
                job = replace(job, times=parse_times(times))
            elif time is not None:
                job = replace(job, times=[chosen.view.time])
        if tolerance is not None:
            job = _with_tolerance(job, tolerance)
        if curves is not None:
            job = _with_curves(job, curves)
        if subdivisions is not None:
            job = _with_subdivisions(job, subdivisions)
    run_job(job, chosen, "Computing", quiet)


def convert(
    draft: Annotated[Path, Parameter(help=f"{registry.describe_readers('draft')}.")],
    output: Annotated[Path, Parameter(help=f"A {registry.describe_writers('draft')} file.")],
    /,
    *,
    trim: Annotated[
        bool, flag("Cut off ends in no heddle at the sides, picks without a shed before and after.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Turn a weaver's draft into another format.

    Threading, tie-up, treadling or liftplan, colours, spacings and thicknesses go from one file to
    the other unchanged; what the new format cannot hold is told. Nothing is drawn, so that drafts
    without room for their yarns are converted, too. A scene as a draft: "spacemap export SCENE
    -o cloth.wif".

    "spacemap convert cloth.dtx cloth.wif", "spacemap convert drawdown.png cloth.dtx"
    """
    from spacemap_vtk.io.drafts.draft_file import read_draft

    check_output(output, registry.writer_endings("draft"))
    format_ = registry.writer(output, "draft")
    format_.check(output)
    known = [ending for each in registry.readers("draft") for ending in each.endings]
    if draft.suffix.lower() not in known:
        raise InputError(
            f"{draft}: not a draft",
            allowed=", ".join(known),
            cure='Of a scene "spacemap export" makes a draft.',
        )
    found = read_draft(registry.require_file(draft, ", ".join(known)), trim)
    with atomic_file(output) as file:
        format_.write(file, found)
    if not quiet:
        for text in (*found.warnings, *(format_.loses(found) if format_.loses else ())):
            print(f"spacemap: warning: {text}", file=sys.stderr)


def _check_times(job: Job, options: list[str]) -> None:
    if not job.is_series:
        lasting = [each for each in registry.writers() if each.times or "moving" in each.holds]
        raise InputError(
            f"a {job.output.suffix} holds one moment of {job.kind}",
            key=options[0],
            allowed=", ".join(ending for each in lasting for ending in each.endings)
            + f", or numbered files such as {job.output.stem}_%04d{job.output.suffix}",
            cure="Or choose the moment with --time.",
        )
    if options[0] == "--times" and len(options) > 1:
        raise InputError(
            f"beside {options[1]}", key="--times", cure="Give either the times or their range."
        )


def _with_tolerance(job: Job, text: str) -> Job:
    if not isinstance(job, MovingJob):
        raise InputError(f"nothing is left out of {job.kind}", key="tolerance", value=text)
    with suppress(InputError):
        return replace(job, tolerance=parse_quantity(text, "m"))
    raise InputError(
        "not a tolerance", key="tolerance", value=text, allowed="a length above 0, as in 0.01mm"
    )


def _with_curves(job: Job, curves: str) -> Job:
    if not (isinstance(job, MovingJob) and job.holds_curves):
        raise InputError(
            f"{job.output.name} holds no curves to choose", key="curves", allowed="of a .usdc"
        )
    return replace(job, curves=curves)


def _with_subdivisions(job: Job, subdivisions: int) -> Job:
    if not isinstance(job, (MovingJob, ModesJob)):
        raise InputError(
            f"{job.kind} has those of the scene",
            key="subdivisions",
            value=subdivisions,
            cure=f"Say --set surface.subdivisions={subdivisions}.",
        )
    return replace(job, subdivisions=subdivisions)
