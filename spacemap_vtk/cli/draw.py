"""Commands that write files: pictures, films, data."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import (
    PICTURE,
    Camera,
    ColorBy,
    Fps,
    From,
    InsetPlaces,
    Light,
    Motion,
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

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.jobs.picture import MOST_SAMPLES, SAMPLES
from spacemap_vtk.units import parse_quantity

#: Most crossings of cloth in motion whose size is not given, in a file that contains every yarn.
_FILE_CROSSINGS = 20_000

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
    light: Light = None,
    camera: Camera = None,
    inset: InsetPlaces = (),
    scale_bar: ScaleBar = False,
    triad: Triad = False,
    time_stamp: TimeStamp = False,
    raytrace: Annotated[
        bool,
        flag(
            "Trace rays of light between the fibres, for close-ups (slow; needs the extra "
            "[raytrace]).",
            group=PICTURE,
        ),
    ] = False,
    samples: Annotated[
        int | None,
        Parameter(
            help="Rays per pixel with --raytrace; more give less noise. Default: 64.",
            group=PICTURE,
        ),
    ] = None,
    motion: Motion | None = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw a picture of a scene, a draft or a mesh.

    For example:

        spacemap render plain_weave -o cloth.png
        spacemap render plain_weave -o cloth.png --time 40ms --color displacement
        spacemap render drape -o drape.png --size 1920x1080 --style paper
        spacemap render twill_2_2 -o relief.png --light raking --inset 0.4,0.5,8
        spacemap render draft.wif -o curtain.png --hang --yarn "8/2 cotton" --cloth-size 40cm
    """
    if samples is not None and not (raytrace and 1 <= samples <= MOST_SAMPLES):
        raise InputError(
            "the number of rays is out of range" if raytrace else "needs --raytrace",
            key="--samples",
            value=samples,
            allowed=f"1 to {MOST_SAMPLES}, with --raytrace",
        )
    job = PictureJob(output, samples=(samples or SAMPLES) if raytrace else 0)
    annotations = {"scale_bar": scale_bar, "triad": triad, "time_stamp": time_stamp}
    chosen = open_scene(
        scene,
        set_,
        motion,
        time=time,
        size=size,
        color=color,
        style=style,
        light=light,
        camera=camera,
        insets=inset,
        annotations=annotations,
    )
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
    light: Light = None,
    camera: Camera = None,
    inset: InsetPlaces = (),
    scale_bar: ScaleBar = False,
    triad: Triad = False,
    time_stamp: TimeStamp = False,
    orbit: Annotated[
        str | None,
        Parameter(
            help="Angle through which the camera goes round the scene during the film, for example "
            "360deg. Default: that of the scene.",
            group=PICTURE,
        ),
    ] = None,
    workers: Annotated[
        int | None,
        Parameter(
            help="Number of processes. Default: one for each core, as far as memory allows and the "
            "work is worth it."
        ),
    ] = None,
    again: Annotated[
        bool, flag("Draw all frames again, also those kept from a stopped film.")
    ] = False,
    motion: Motion | None = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Make a film of a scene, or numbered frames.

    The scene's section [animation] sets the times and the frames per second. Without --size, a GIF
    has half the scene's size. An .mp4 needs the extra [movie]. Numbered frames appear together when
    the last one is drawn.

    For example:

        spacemap animate plain_weave -o cloth.gif
        spacemap animate drape -o drape.mp4 --size 1280x720 --set animation.stop=2s
        spacemap animate plain_weave -o frames/%04d.png --color velocity
        spacemap animate tricot -o round.mp4 --orbit 360deg --set animation.stop=8s

    A stopped film (by Ctrl-C, or because the machine goes down) leaves its frames in a folder next
    to it, for example film.mp4.frames. The same command continues from there; frames of another
    scene or of other settings are never used. The folder is removed when the film is complete.
    """
    with name_options():
        job = FilmJob(output, workers=workers, again=again)
    annotations = {"scale_bar": scale_bar, "triad": triad, "time_stamp": time_stamp}
    chosen = open_scene(
        scene,
        set_,
        motion,
        size=size,
        color=color,
        style=style,
        light=light,
        camera=camera,
        orbit=orbit,
        insets=inset,
        annotations=annotations,
    )
    if size:
        job = replace(job, size=chosen.view.size)
    try:
        run_job(job, chosen, "Drawing frames", quiet)
    except BaseException as error:
        from spacemap_vtk.jobs.frames import BusyError, FrameFolder

        frames = FrameFolder(output)
        if frames.count and not isinstance(error, BusyError):
            print(
                f"spacemap: {frames.count} frames are kept in {frames.folder}; the same command "
                "continues from there",
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
        times_option("one period of the first mode", "--times", "--time"),
    ] = (),
    motions: Annotated[
        str | None,
        Parameter(
            help="Methods of motion to compare, separated by commas, one row each: response "
            "(modes), rotation (modes with rotations restored), transient (time steps). Default: "
            "that of the scene."
        ),
    ] = None,
    size: Size = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Draw the motion of a scene as a row of pictures at several times.

    The cage (a) is above, the fabric (b) below; time runs to the right. --motions compares several
    methods for the same loads, damping and initial state.

    For example:

        spacemap storyboard plain_weave -o storyboard.png
        spacemap storyboard plain_weave -o storyboard.png --times 0,20ms,40ms
        spacemap storyboard plain_weave -o methods.png --motions response,rotation
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
            help=f"Data to write: {', '.join(registry.DATA)}. Default: the first kind listed for "
            "the ending above.",
            completer=completers.data_kinds,
        ),
    ] = None,
    time: Time = None,
    color: ColorBy = None,
    times: Annotated[
        tuple[str, ...],
        times_option("those of the film, from the section [animation]"),
    ] = (),
    start: From = None,
    stop: To = None,
    fps: Fps = None,
    tolerance: Annotated[
        str | None,
        Parameter(
            help="Largest error of the moving surface in an .html, .glb or .usdc, for example "
            "0.01mm; smaller values give larger files. Default: 1/50 of the thinnest yarn."
        ),
    ] = None,
    curves: Annotated[
        str | None,
        Parameter(
            help="Curves in a .usdc, for hair shaders: yarns, plies, fibres, or the number of "
            "fibres per yarn. Default: yarns."
        ),
    ] = None,
    subdivisions: Annotated[
        int | None,
        Parameter(
            help="Facets along each side of a patch in a moving .glb or .usdc. Default: that of "
            "the scene, or fewer if there were more than half a million points."
        ),
    ] = None,
    pieces: Annotated[
        int | None,
        Parameter(
            help="Number of pieces in which a .pvtp or .pvtu is computed and written, so that it "
            "need not fit into memory. Default: 4."
        ),
    ] = None,
    modes: Annotated[
        bool, flag("Write mode shapes instead of the motion; same as --what modes.")
    ] = False,
    irregular: Annotated[
        bool,
        flag(
            "Write yarns as irregular in position, width and brightness as pictures show them, "
            "with the same seed; see view.irregularity. Default: regular yarns, as measured."
        ),
    ] = False,
    motion: Motion | None = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Write a scene's data for other programs.

    The ending of the output selects the data: Bézier patches, the cage with its motion, the surface
    (still or moving), the draft, and others. --color adds the shown quantity as an array.

    For example:

        spacemap export plain_weave -o cloth.stl --time 40ms
        spacemap export plain_weave -o cloth.html --color stress
        spacemap export plain_weave -o modes.glb --modes --set modal.modes=12
        spacemap export plain_weave -o cloth.pvd --from 0 --to 1s --fps 10
        spacemap export plain_weave -o cloth_%04d.ply --times 0,20ms,40ms

    Series of times: a .pvd lists files in a folder next to it, a .vtkhdf stores all times,
    cloth_%04d.vtp (or .stl, .ply, .glb, ...) is one file for each time. By default the times are
    those of the film. The files appear when the last one is written; a stopped export leaves none.

    Moving surfaces: an .html is a page that opens by a double click, where the surface can be
    turned and played; a .glb plays in presentations and in Blender. The motion is a sum of a few
    shapes (morph targets), as many as --tolerance requires. With --modes, each mode is an
    animation of its own.

    Pieces: a .pvtp (surface) or .pvtu (patches) lists files of pieces in a folder next to it, as
    in ParaView.
    """
    if pieces is not None and pieces < 1:
        raise InputError(
            "the number of pieces is out of range",
            key="--pieces",
            value=pieces,
            allowed="1 or more",
        )
    with name_options():
        job = make_data_job(output, "modes" if modes else what or "", pieces=pieces or 0)
    chosen = open_scene(
        scene,
        set_,
        motion,
        crossings=_FILE_CROSSINGS,
        time=time,
        color=color,
        start=start,
        stop=stop,
        fps=fps,
    )
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
        if irregular:
            job = _with_irregularity(job, chosen)
    run_job(job, chosen, "Computing", quiet)


def convert(
    draft: Annotated[Path, Parameter(help=f"{registry.describe_readers('draft')}.")],
    output: Annotated[Path, Parameter(help=f"A {registry.describe_writers('draft')} file.")],
    /,
    *,
    trim: Annotated[
        bool, flag("Cut off ends in no heddle at the sides, and picks in no shed at both ends.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Convert a weaver's draft to another format.

    Threading, tie-up, treadling or liftplan, colours, spacings and thicknesses stay unchanged; a
    warning names what the new format cannot store. Drafts whose yarns do not fit are converted too.
    To write a scene as a draft, use "spacemap export SCENE -o cloth.wif".

    For example:

        spacemap convert cloth.dtx cloth.wif
        spacemap convert drawdown.png cloth.dtx
        spacemap convert wide.wif cloth.wif --trim
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
            cure='To write a scene as a draft, use "spacemap export".',
        )
    found = read_draft(registry.require_file(draft, ", ".join(known)), trim)
    with atomic_file(output) as file:
        format_.write(file, found)
    if not quiet:
        for text in (*found.warnings, *(format_.loses(found) if format_.loses else ())):
            print(f"spacemap: warning: {text}", file=sys.stderr)


def _check_times(job: Job, options: list[str]) -> None:
    if not job.is_series:
        series = [each for each in registry.writers() if each.times or "moving" in each.holds]
        raise InputError(
            f"a {job.output.suffix} file stores one time of {job.kind}",
            key=options[0],
            allowed=", ".join(ending for each in series for ending in each.endings)
            + f", or numbered files such as {job.output.stem}_%04d{job.output.suffix}",
            cure="Choose one time with --time.",
        )
    if options[0] == "--times" and len(options) > 1:
        raise InputError(
            f"cannot be combined with {options[1]}",
            key="--times",
            cure="Give either the times or their range.",
        )


def _with_tolerance(job: Job, text: str) -> Job:
    if not isinstance(job, MovingJob):
        raise InputError(f"{job.kind} are written without a tolerance", key="tolerance", value=text)
    with suppress(InputError):
        return replace(job, tolerance=parse_quantity(text, "m"))
    raise InputError(
        "must be a length", key="tolerance", value=text, allowed="above 0, for example 0.01mm"
    )


def _with_curves(job: Job, curves: str) -> Job:
    if not (isinstance(job, MovingJob) and job.holds_curves):
        raise InputError(
            f"{job.output.name} cannot store curves", key="curves", allowed=".usdc or .usda"
        )
    return replace(job, curves=curves)


def _with_irregularity(job: Job, scene: Scene) -> Job:
    from spacemap_vtk.scenes.irregular_data import require_irregular

    require_irregular(scene, job.kind)
    assert isinstance(job, (DataJob, MovingJob, ModesJob))
    return replace(job, irregular=True)


def _with_subdivisions(job: Job, subdivisions: int) -> Job:
    if not isinstance(job, (MovingJob, ModesJob)):
        raise InputError(
            f"{job.kind} uses the subdivisions of the scene",
            key="subdivisions",
            value=subdivisions,
            cure=f"Use --set surface.subdivisions={subdivisions}.",
        )
    return replace(job, subdivisions=subdivisions)
