"""Code shared by the commands: options, opening a scene, running a job, printing."""

from __future__ import annotations

import json
import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.errors import InfoMessage, InputError, escape_unprintable
from spacemap_vtk.scenes.cameras import CAMERAS
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.styles import LIGHTS, STYLES
from spacemap_vtk.units import parse_quantity

if TYPE_CHECKING:
    from rich.table import Table

    from spacemap_vtk.filters.base import Stage
    from spacemap_vtk.jobs.job import Job
    from spacemap_vtk.scenes.presets import Plan
    from spacemap_vtk.scenes.scene import Scene


#: Groups of options in the help of a command, in this order after its own options.
PICTURE = Group.create_ordered("Picture")
TIMES = Group.create_ordered("Times")
SCENE = Group.create_ordered("Scene")
CLOTH = Group.create_ordered("Cloth in motion")
MESSAGES = Group.create_ordered("Messages")


def flag(help: str, *names: str, **more: Any) -> Parameter:
    """Declare an option that is off, or empty, by default and has no negative form."""
    return Parameter(name=names or None, negative="", help=help, show_default=False, **more)


def output_option(help: str) -> Parameter:
    """Declare the option for the output file."""
    return Parameter(name=["--output", "-o"], help=help)


SceneFile = Annotated[
    str,
    Parameter(
        help='Scene file, or name of a built-in scene (see "spacemap scenes").',
        completer=completers.scenes_and_files,
    ),
]
SceneName = Annotated[
    str,
    Parameter(
        help='Scene file, draft, mesh, or name of a built-in scene (see "spacemap scenes").',
        completer=completers.scenes_and_files,
    ),
]
Set = Annotated[
    tuple[str, ...],
    flag(
        "Change a value of the scene, for example --set weave.ends=20; the value auto makes it "
        'automatic. Repeat the option for several keys (see "spacemap keys").',
        "--set",
        completer=completers.assignments,
        group=SCENE,
    ),
]
Errors = Annotated[
    bool | None,
    Parameter(
        help="Whether to estimate the error of each figure that is due to the cage's cells, by "
        "solutions in cells two and four times as wide. Default: yes, unless these cages take long "
        "to make (tetwild).",
        show_default=False,
    ),
]
SetLists = Annotated[
    tuple[str, ...],
    flag(
        "Value of a key, or several values separated by commas, for example "
        "--set weave.ends=5,7,9: one run or picture for each. Repeat the option for several keys "
        '(see "spacemap keys").',
        "--set",
        completer=completers.assignments,
        group=SCENE,
    ),
]
Paired = Annotated[
    bool,
    flag(
        "Pair the lists: the first values of all lists together, then the second ones, and so on. "
        "By default, every combination of the values is run.",
        "--zip",
        group=SCENE,
    ),
]
Time = Annotated[
    str | None,
    Parameter(help="Time in s, for example 0.4 or 400ms. Default: that of the scene.", group=TIMES),
]
#: Hint to the commands that accept several times.
SEVERAL_TIMES_HINT = (
    'For several times, as in --times 0,20ms, use "spacemap figure", "spacemap storyboard" or '
    '"spacemap export".'
)
Size = Annotated[
    str | None,
    Parameter(
        help="Width and height in pixels, for example 1920x1080. Default: that of the scene.",
        group=PICTURE,
    ),
]


def times_option(default: str, *names: str) -> Parameter:
    """Declare an option for times, given as one list or repeatedly."""
    text = f"Times in s, separated by commas, for example 0,20ms,0.04. Default: {default}."
    return flag(text, *names, group=TIMES)


Fps = Annotated[
    str | None,
    Parameter(
        name="--fps", help="Frames per second of the film. Default: that of the scene.", group=TIMES
    ),
]
From = Annotated[
    str | None,
    Parameter(name="--from", help="First time in s. Default: that of the scene.", group=TIMES),
]
To = Annotated[
    str | None,
    Parameter(name="--to", help="End time in s. Default: that of the scene.", group=TIMES),
]
ColorBy = Annotated[
    str | None,
    Parameter(
        name="--color",
        help=f"Quantity shown by the colours: {', '.join(COLORINGS)}.",
        completer=completers.color_names,
        group=PICTURE,
    ),
]
Style = Annotated[
    str | None,
    Parameter(
        name="--style",
        help=f"Style of the picture: {', '.join(STYLES)}.",
        completer=completers.style_names,
        group=PICTURE,
    ),
]
Light = Annotated[
    str | None,
    Parameter(
        name="--light",
        help=f"Light on the scene: {', '.join(LIGHTS)}. Default: that of the style.",
        completer=completers.light_names,
        group=PICTURE,
    ),
]
Camera = Annotated[
    str | None,
    Parameter(
        name="--camera",
        help=f"Camera: {', '.join(CAMERAS)}, or one that the scene stores (view.cameras).",
        completer=completers.camera_names,
        group=PICTURE,
    ),
]
InsetPlaces = Annotated[
    tuple[str, ...],
    flag(
        "Draw a close-up of a place in a frame: the place as shares of the picture from the left "
        "and from below, and the magnification, for example --inset 0.4,0.6,8. Repeat the option "
        "for several (see view.insets).",
        "--inset",
        group=PICTURE,
    ),
]
ScaleBar = Annotated[
    bool,
    flag("Draw a scale bar; with perspective, for the camera's focal plane.", group=PICTURE),
]
Triad = Annotated[bool, flag("Draw the coordinate axes.", group=PICTURE)]
TimeStamp = Annotated[bool, flag("Draw the time.", group=PICTURE)]
Quiet = Annotated[bool, flag("Print no progress and no warnings.", "--quiet", "-q", group=MESSAGES)]
Json = Annotated[bool, flag("Print JSON, for other programs.", "--json", group=MESSAGES)]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Motion:
    """Options that make cloth in motion of any textile (`spacemap_vtk.scenes.presets`)."""

    hang: Annotated[
        bool, flag("Hang the cloth as a curtain, drawn together on a rail.", group=CLOTH)
    ] = False
    drape: Annotated[
        bool,
        flag("Lay the cloth on a round table, over which it hangs in folds.", group=CLOTH),
    ] = False
    drop: Annotated[
        bool, flag("Let the cloth fall onto a ball; a film shows how it lands.", group=CLOTH)
    ] = False
    swing: Annotated[bool, flag("Let level cloth fall that is held by one edge.", group=CLOTH)] = (
        False
    )
    yarn: Annotated[
        str | None,
        Parameter(
            help='Yarn of this cloth, for example "8/2 cotton" (see "spacemap yarns"). Default: '
            "that of the scene, or cotton as thick as its yarns.",
            group=CLOTH,
        ),
    ] = None
    cloth_size: Annotated[
        str | None,
        Parameter(
            help="Size of this cloth, for example 40cm, or 40x60cm along weft and warp. Default: "
            "whole repeats, large enough to fold under its own weight.",
            group=CLOTH,
        ),
    ] = None
    save_scene: Annotated[
        Path | None,
        Parameter(help="Also write the scene as a .toml file, to change it there.", group=CLOTH),
    ] = None

    @property
    def preset(self) -> str | None:
        """Name of the chosen preset; None without one."""
        names = [name for name in ("hang", "drape", "drop", "swing") if getattr(self, name)]
        if len(names) > 1:
            raise InputError(f"cannot be combined with --{names[1]}", key=f"--{names[0]}")
        for name, value in (("--yarn", self.yarn), ("--cloth-size", self.cloth_size)):
            if value is not None and not names:
                raise InputError(
                    "needs --hang, --drape, --drop or --swing",
                    key=name,
                    value=value,
                    cure="Without a motion, set the yarn by --set weave.warp_yarn=… and the size "
                    "by --set weave.ends=….",
                )
        return names[0] if names else None

    @property
    def planner(self) -> Callable[[Scene], Plan] | None:
        """Function that plans the chosen preset for a scene; None without one."""
        preset = self.preset
        if preset is None:
            return None
        from spacemap_vtk.scenes.presets import make_plan

        size = self.size
        return lambda scene: make_plan(scene, preset, yarn=self.yarn, size=size)

    @property
    def size(self) -> tuple[float, ...] | None:
        """Sides of the cloth [m]; None if they are not given."""
        if self.cloth_size is None:
            return None
        words = self.cloth_size.lower().split("x")
        unit = words[-1].lstrip("0123456789. ")
        if words[-1] and not unit:
            raise InputError(
                "needs a unit",
                key="--cloth-size",
                value=self.cloth_size,
                cure=f"Write for example {'x'.join(words)}cm.",
            )
        with suppress(InputError):
            sides = tuple(
                parse_quantity(word if word[-1:].isalpha() else word + unit, "m") for word in words
            )
            if len(sides) <= 2 and all(1e-3 <= side <= 100.0 for side in sides):
                return sides
        raise InputError(
            "must be a size of cloth",
            key="--cloth-size",
            value=self.cloth_size,
            allowed="one or two lengths of 1 mm to 100 m, for example 40cm or 40x60cm",
        )


def read_scene(
    name: str, assignments: Sequence[str], motion: Motion | None, crossings: int | None = None
) -> Scene:
    """Read a scene, make cloth in motion of it if asked for, and set values."""
    from spacemap_vtk.scenes.scene import Scene

    scene = Scene.read(name)
    for assignment in assignments:
        scene.set(assignment)
    if motion is None or motion.preset is None:
        return scene
    from spacemap_vtk.scenes import presets

    try:
        made = presets.apply(
            scene, motion.preset, yarn=motion.yarn, size=motion.size, crossings=crossings
        )
    except InputError as error:
        if error.section is None and error.key in ("yarn", "size"):
            error.key = {"yarn": "--yarn", "size": "--cloth-size"}[error.key]
        raise
    for assignment in assignments:  # explicit values replace those of the preset
        made.set(assignment)
    return made


def open_scene(
    name: str,
    assignments: Sequence[str] = (),
    motion: Motion | None = None,
    *,
    time: str | None = None,
    size: str | None = None,
    color: str | None = None,
    style: str | None = None,
    start: str | None = None,
    stop: str | None = None,
    fps: str | None = None,
    light: str | None = None,
    camera: str | None = None,
    orbit: str | None = None,
    insets: Sequence[str] = (),
    crossings: int | None = None,
    annotations: Mapping[str, bool] | None = None,
) -> Scene:
    """Read a scene and apply the command line's changes to it."""
    # Imported here, because they import VTK, which no command's help needs.
    from spacemap_vtk.scenes.scene_record import describe_outside_files

    scene = read_scene(name, assignments, motion, crossings)
    if time is not None and "," in time:
        raise InputError(
            "must be a single time",
            key="--time",
            value=time,
            allowed="one",
            cure=SEVERAL_TIMES_HINT,
        )
    for option, section, key, value in (
        ("--time", "view", "time", time),
        ("--from", "animation", "start", start),
        ("--to", "animation", "stop", stop),
        ("--fps", "animation", "frames_per_second", fps),
        ("--color", "view", "color", color),
        ("--style", "view", "style", style),
        ("--light", "view", "light", light),
        ("--camera", "view", "camera", camera),
        ("--orbit", "animation", "orbit", orbit),
    ):
        if value is not None:
            try:
                scene.assign(section, key, value)
            except InputError as error:
                error.section, error.key = None, option  # the user wrote the option, not the key
                raise
    for key, given in (annotations or {}).items():
        if given:
            scene.assign("view", key, True)
    if insets:
        scene.assign("view", "insets", [_parse_inset(text) for text in insets])
    if size is not None:
        try:
            scene.assign("view", "size", size.lower().split("x"))
        except InputError as error:
            # Use the form of the command line, where a size is not a list.
            side: Any = type(scene.view).parameters["size"]
            raise InputError(
                "must be a size in pixels",
                key="--size",
                value=size,
                allowed=f"width x height, for example 1920x1080, each {side.component.allowed}",
            ) from error
    for text in describe_outside_files(scene):
        scene.warn(text)
    if motion is not None and motion.save_scene is not None:
        from spacemap_vtk.scenes.presets import write_scene

        write_scene(scene, motion.save_scene)
    return scene


def _parse_inset(text: str) -> dict[str, Any]:
    """Parse the place and the magnification of an inset."""
    try:
        x, y, *magnification = map(float, text.split(","))
    except ValueError:
        magnification = [0.0, 0.0]
    if len(magnification) > 1:
        raise InputError(
            "must be a place in the picture, and a magnification",
            key="--inset",
            value=text,
            allowed="X,Y,MAGNIFICATION with shares of the picture from the left and from below, "
            "for example 0.4,0.6,8",
        )
    inset: dict[str, Any] = {"place": [x, y]}
    if magnification:
        inset["magnification"] = magnification[0]
    return inset


def parse_times(given: Sequence[str], option: str = "--times") -> list[float]:
    """Parse the times of an option that may be given repeatedly."""
    text = ",".join(given)
    refused = InputError(
        "must be a list of times",
        key=option,
        value=text,
        allowed="up to 100 times of at least 0 s, for example 0,20ms,0.04",
    )
    try:
        times = [parse_quantity(word, "s") for word in text.split(",")] if given else []
    except InputError as error:
        raise refused from error
    if not all(0.0 <= t < math.inf for t in times) or len(times) > 100:
        raise refused
    return times


@contextmanager
def name_options() -> Iterator[None]:
    """Replace the fields of a job by option names in its errors."""
    try:
        yield
    except InputError as error:
        if error.key and not error.key.startswith("--"):
            error.key = f"--{error.key}"
        raise


def run_job(job: Job, scene: Scene, doing: str, quiet: bool) -> None:
    """Run a job with a progress bar; print losses, warnings and results."""

    def report_loss(text: str) -> None:
        if not quiet:
            print(f"spacemap: warning: {text}", file=sys.stderr, flush=True)

    with progress(scene, doing, quiet) as report_progress:
        result = job.run(scene, report_progress, report_loss)
    print_warnings(scene, quiet, brief=job.kind == "picture")
    if not quiet and result:
        print(f"{job.output}: {result}")


def print_warnings(scene: Scene, quiet: bool, brief: bool = False) -> None:
    """Print the scene's warnings; if `brief`, at most one that comes from the draft."""
    if quiet:
        return
    texts = scene.warnings
    if brief and len(texts) > 1 and scene.draft_file is not None and scene.woven is not None:
        of_draft = [text for text in texts if text in scene.woven.cloth.warnings]
        others = [text for text in texts if text not in of_draft]
        shown = others or of_draft[:1]
        if hidden := len(texts) - len(shown):
            shown[-1] += f" (and {hidden} more: spacemap info {scene.file})"
        texts = shown
    for text in texts:
        kind = "note" if isinstance(text, InfoMessage) else "warning"
        print(f"spacemap: {kind}:", escape_unprintable(text, "\n"), file=sys.stderr)


def number_table(headings: Iterable[str], words: int = 0, **more: Any) -> Table:
    """Return a table of numbers whose first columns are words."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, **more)
    for column, heading in enumerate(headings):
        justify: Any = "left" if column < words else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    return table


def print_labelled(rows: Iterable[tuple[str, str]]) -> None:
    """Print figures below each other, each with its label."""
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row(*row)
    print_plain(table)


def print_missing_errors(errors: bool | None, figures: Mapping[str, Any]) -> None:
    """Print why figures have no errors, if these were asked for."""
    if errors is not False and figures.get("errors_missing"):
        print_labelled([("errors", f"not estimated: {figures['errors_missing']}")])


def print_plain(table: Any) -> None:
    """Print a table or a title without interpreting brackets as markup."""
    from rich.console import Console

    console = Console(markup=False)
    columns = getattr(table, "columns", ())
    if columns and all(column.no_wrap for column in columns):
        # No digit is cut off: a narrow terminal breaks the lines of a wide table of numbers.
        wide = console.options.update(max_width=10_000)
        console.width = max(console.width, console.measure(table, options=wide).maximum)
    console.print(table, highlight=False)


def print_json(figures: Any) -> None:
    """Print figures for programs; infinite and undefined numbers become null."""
    print(json.dumps(_finite(figures), indent=2, ensure_ascii=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


#: Seconds before a progress bar appears.
_BAR_DELAY = 1.0


@contextmanager
def progress(scene: Scene | None, what: str, quiet: bool) -> Iterator[Callable[[int, int], object]]:
    """Show a progress bar for work on a scene, with the running stage next to it."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[stage]}"),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(what, total=1, stage="")

    def show_stage(stage: Stage, event: str) -> None:
        words = [type(stage).__name__]
        try:
            if event == "ProgressEvent":
                words += [stage.GetProgressText() or "", f"{stage.GetProgress():.0%}"]
            bar.update(task, stage="" if event == "EndEvent" else " ".join(filter(None, words)))
        except KeyboardInterrupt:  # from an observer VTK would end the program
            stage.SetAbortExecute(1)

    observers = [
        (stage, stage.AddObserver(event, show_stage))
        for stage in (scene.stages if scene else ())
        for event in ("StartEvent", "ProgressEvent", "EndEvent")
    ]
    timer = threading.Timer(_BAR_DELAY, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda done, of: bar.update(task, completed=done, total=of)
    finally:
        timer.cancel()
        bar.stop()
        for stage, observer in observers:
            stage.RemoveObserver(observer)
