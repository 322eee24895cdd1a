"""Pictures, films and data as files: ordered and carried out alike by command line and window.

``python -m spacemap_vtk.draw.order`` is a process of its own that can be ended at any moment. It
reads an order as JSON from its standard input, see `as_text`, and prints a line of JSON for each
step: ``{"done": 3, "of": 50}``, ``{"lost": ...}`` for what the file cannot hold, and at last
``{"told": ...}``, or ``{"error": ...}`` if it fails.
"""

from __future__ import annotations

import json
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk import extensions
from spacemap_vtk.draw.data_at import MOMENTS, common_scale, data_at, moments, pieces_of
from spacemap_vtk.errors import InputError, SpacemapError, SpacemapWarning
from spacemap_vtk.io.output import (
    check_output,
    require_room,
    telling_refusals,
    whole_file,
    whole_folder,
)
from spacemap_vtk.io.provenance import Record, recorded, recorded_at
from spacemap_vtk.io.registry import DATA, writer, writers, written
from spacemap_vtk.units import format_quantity
from spacemap_vtk.vanishing import ended_by_exceptions

if TYPE_CHECKING:
    from spacemap_vtk.draw.camera import Viewpoint
    from spacemap_vtk.draw.picture import Image
    from spacemap_vtk.ndarrays import Tell
    from spacemap_vtk.scenes.scene import Scene

#: Data that are others at another time, and what in a file's name stands for a number, or is
#: meant to.
_CHANGING = ("patches", "surface", "cage", "moving", *MOMENTS)
_NUMBER = re.compile(r"%(\d+[a-z]?|[dis])(?![a-z])")
#: Pieces where nobody says how many, and at most.
_PIECES, _MOST_PIECES = 4, 10_000

#: Rays for each pixel of a traced picture, and at most.
SAMPLES, MOST_SAMPLES = 64, 65_536

#: How far a process of its own stands back behind others.
_NICE = 5

#: Told in a sentence what a file cannot hold.
Lose = Callable[[str], object]


@dataclass
class Order:
    """What is to be written; one that cannot be carried out is refused when it is made."""

    #: ``"picture"``, ``"film"``, ``"storyboard"``, ``"shapes"`` (of modes), ``"plot"``,
    #: ``"biaxial"`` (tests of the cloth), ``"figure"``, or a key of
    #: `spacemap_vtk.io.registry.DATA`; empty: the data that the output's ending stands for first.
    what: str
    #: The file; of numbered frames, and of data in numbered files, with ``%04d`` in it.
    output: Path
    #: Of a picture, and of data of one moment, one; of a storyboard and of what lasts some, in s;
    #: none: as the scene says.
    times: Sequence[float] = ()
    #: In pixels; by default as the scene says, of a film in a .gif half of that.
    size: tuple[int, int] | None = None
    #: What each panel of a picture or film shows, ``"fabric"``, ``"cage"`` or ``"both"``; none: as
    #: the scene says.
    panels: Sequence[str] = ()
    #: Where a picture or film is seen from; by default as the scene says.
    place: Viewpoint | None = None
    #: Whether only the edges of the fabric's facets are drawn in a picture or film.
    wireframe: bool = False
    #: What moves a storyboard's scene, row by row: keys of `spacemap_vtk.scenes.motions.MOTIONS`;
    #: none: as the scene says, its cage above its fabric.
    motions: Sequence[str] = ()
    #: Processes that draw a film; by default as many as there is work and memory for.
    workers: int | None = None
    #: Whether frames are drawn again that a film which was stopped has left.
    again: bool = False
    #: How far a surface that moves may be from its motion [m]; by default so that nobody sees it.
    tolerance: float | None = None
    #: Of each patch of a surface that moves; by default as the scene says, or as a player bears.
    subdivisions: int = 0
    #: Parts that data are made and written in, one after another, where the format has them.
    pieces: int = 0
    #: Whether a picture is a film's frame: seen from where its film is.
    framed: bool = False
    #: Of a plot: a place at rest in m, by default where the first mode moves most, and what of it.
    point: Sequence[float] = ()
    quantity: str = "displacement"
    #: Of what moves: what yarns are as curves, see `spacemap_vtk.draw.seen_yarns.STRANDS`.
    curves: str = "yarns"
    #: Of a picture: rays that are traced for each pixel; 0: it is drawn.
    samples: int = 0
    #: Of a figure: fields of `spacemap_vtk.draw.figure_page.FigureAsked`.
    page: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, told: Mapping[str, Any], output: Path) -> Order:
        """Return the order that `told` has told, of a file that may be another's."""
        from spacemap_vtk.draw.camera import Viewpoint

        try:
            given = dict(told)
            if given.get("place"):
                given["place"] = Viewpoint.from_json(given["place"])
            for key in ("times", "point"):
                given[key] = [float(value) for value in given.get(key, ())]
            if given.get("size"):
                width, height = map(int, given["size"])
                given["size"] = width, height
            for key, kind in (("tolerance", float), ("pieces", int), ("subdivisions", int)):
                if given.get(key):
                    given[key] = kind(given[key])
            for key in ("panels", "motions"):
                given[key] = [str(word) for word in given.get(key, ())]
            return cls(**{**given, "what": str(given["what"]), "output": output})
        except (TypeError, ValueError, KeyError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"no order that this program knows: {error}") from None

    @property
    def told(self) -> dict[str, Any]:
        """What is asked for, but for how and whither, as JSON has it."""
        plain = json.loads(json.dumps(asdict(self), default=str))
        usual = {each.name: each.default for each in fields(self)}
        how = ("output", "workers", "again")
        return {
            key: value
            for key, value in plain.items()
            if key not in how and value not in (usual[key], [])
        }

    def __post_init__(self) -> None:
        if self.what in _STILLS:
            check_output(self.output, written("picture"))
        elif self.what in _PLOTS:
            table = {".csv": "table"} if self.what == "biaxial" else {}
            check_output(self.output, written("plot") | table)
        elif self.what == "film":
            check_output(self.output, written("film") | written("frames"), self.numbered)
            writer(self.output, "frames" if self.numbered else "film").check(self.output)
            if self.numbered:
                self._check_number("frames need")
        else:
            ending = self.output.suffix.lower()
            if not self.what and ending in written():
                self.what = writer(self.output).holds[0]
            wanted = None if ending in written() or self.what not in DATA else self.what
            check_output(self.output, written(wanted), self.numbered)
            if ending not in written(self.what):
                raise InputError(
                    f"{ending} files do not hold that",
                    key="what",
                    value=self.what,
                    allowed=", ".join(kind for kind in DATA if ending in written(kind)),
                )
            if self.numbered:
                self._check_number("a series needs")
            format_ = writer(self.output, self.what)
            format_.check(self.output)
            if format_.pieces:
                self.pieces = self.pieces or _PIECES
            if not 0 <= self.pieces <= (_MOST_PIECES if format_.pieces else 0):
                there = ", ".join(e for each in writers() if each.pieces for e in each.endings)
                raise InputError(
                    f"no number of pieces of a {ending}",
                    key="pieces",
                    value=self.pieces,
                    allowed=f"1 to {_MOST_PIECES}, of {there}",
                )

    @property
    def numbered(self) -> bool:
        """Whether a film is written as numbered frames, or data in a file for each time."""
        ending = self.output.suffix.lower()
        if self.what == "film":
            return ending in written("frames")
        if self.what not in _CHANGING or ending not in written(self.what):
            return False
        format_ = writer(self.output, self.what)
        return not (format_.times or format_.pieces) and bool(_NUMBER.search(self.output.name))

    @property
    def lasts(self) -> bool:
        """Whether data of many times are written."""
        if self.what not in DATA:
            return False
        return self.what == "moving" or self.numbered or writer(self.output, self.what).times

    def _check_number(self, what: str) -> None:
        name = self.output
        if not re.fullmatch(r"[^%]*%0?\d*d[^%]*", name.name):
            stem = re.sub("%[0-9]*[a-z]?", "", name.stem).rstrip("-_")
            example = f"{stem}-%04d{name.suffix}"
            raise InputError(
                f"{name}: {what} one number in {'their' if what[-1] == 'd' else 'its'} name",
                allowed=f"for example {name.with_name(example)}",
            )


def carry_out(
    order: Order, scene: Scene, tell: Tell, whole: bool = True, lose: Lose | None = None
) -> str:
    """Write what is ordered: whole or not at all, unless the caller sees to that; say what came."""
    lose = lose or scene.warn
    with recorded(_record(order, scene)):
        if order.what == "film":
            return _write_film(order, scene, tell, whole)
        if order.what in _STILLS:
            # Before there is anything to be removed if the program is ended.
            image = _STILLS[order.what](order, scene, tell)
            with _file(order, whole) as file:
                writer(file, "picture").write(file, image)
            return ""
        if order.what in _PLOTS:
            tell(0, 1)
            with _file(order, whole) as file:
                _PLOTS[order.what](order, scene, file, tell)
            tell(1, 1)
            return ""
        moves = order.what in ("moving", "modes") and not order.numbered
        return (_write_moving if moves else _write_data)(order, scene, tell, whole, lose)


def _record(order: Order, scene: Scene) -> Record:
    from spacemap_vtk.scenes.origin import record_of

    times = list(order.times) or ([scene.view.time] if order.what in ("picture", *DATA) else [])
    if not order.times and (order.what == "film" or (order.lasts and scene.moves)):
        times = [scene.animation.start, scene.animation.stop]
    return record_of(scene, order.told, times[:1] + times[-1:] if len(times) > 1 else times)


def _picture(order: Order, scene: Scene, tell: Tell) -> Image:
    from spacemap_vtk.draw.picture import Picture
    from spacemap_vtk.scenes.face import draw_beginning, picture_size

    size = order.size or picture_size(scene)
    _fill_background(order, scene, "picture")
    if order.place is None:
        draw_beginning(scene, size)
    time = order.times[0] if order.times else scene.view.time
    if order.samples:
        raytraced: Callable[..., Image] = extensions.load("renderers", "raytrace")
        return raytraced(scene, time, size, order.samples, tell)
    tell(0, 1)
    times = scene.animation.frame_times() if order.framed else [time]
    clear = scene.view.transparent
    picture = Picture(
        scene, times, size, order.panels, order.place, clear=clear, wireframe=order.wireframe
    )
    image = picture.draw(time)
    picture.close()
    tell(1, 1)
    return image


def _storyboard(order: Order, scene: Scene, tell: Tell) -> Image:
    from spacemap_vtk.draw.sheets import motions_board, storyboard, swing_times

    times = order.times or swing_times(scene)
    if order.motions:
        return motions_board(scene, order.motions, times, order.size, tell)
    return storyboard(scene, times, order.size, tell)


def _shapes(_order: Order, scene: Scene, tell: Tell) -> Image:
    from spacemap_vtk.draw.sheets import mode_sheet

    return mode_sheet(scene, tell)


#: What is one picture, and what draws it.
_STILLS: dict[str, Callable[[Order, Scene, Tell], Image]] = {
    "picture": _picture,
    "storyboard": _storyboard,
    "shapes": _shapes,
}


def _plot(order: Order, scene: Scene, file: Path, _tell: Tell) -> None:
    from spacemap_vtk.draw.plots import motion_plot

    motion_plot(scene, file, list(order.point) or None, order.quantity)


def _biaxial(_order: Order, scene: Scene, file: Path, _tell: Tell) -> None:
    from spacemap_vtk.draw.plots import biaxial_plot

    biaxial_plot(scene, file)


def _figure(order: Order, scene: Scene, file: Path, tell: Tell) -> None:
    from spacemap_vtk.draw.figure_page import FigureAsked, figure_of

    made = figure_of(scene, FigureAsked.of(order.page or {}, order.panels, order.times), tell)
    writer(file, "plot").write(file, made)


#: What is a plot, and what draws it.
_PLOTS: dict[str, Callable[[Order, Scene, Path, Tell], None]] = {
    "plot": _plot,
    "biaxial": _biaxial,
    "figure": _figure,
}


def _write_film(order: Order, scene: Scene, tell: Tell, whole: bool) -> str:
    from spacemap_vtk.draw.filming import FilmJob, KeptFrames, write_film
    from spacemap_vtk.scenes.face import picture_size

    if not scene.moves:
        raise InputError(
            "nothing in this scene moves, and all frames of its film would be the same",
            cure="Add a section [response], as --set response.alpha=1 does, or draw a picture: "
            "spacemap render.",
        )
    scene.check()
    width, height = order.size or picture_size(scene)
    if order.size is None and order.output.suffix.lower() == ".gif":
        width, height = max(16, width // 2), max(16, height // 2)
    _fill_background(order, scene, "frames" if order.numbered else "film")
    job = FilmJob.of(scene, (width, height), order.panels, order.place, order.wireframe)
    kept = KeptFrames(order.output, job.digest, order.again)
    with telling_refusals(order.output, "" if whole else order.output.name), kept.held():
        with _file(order, whole) as file:
            plain = order.numbered and order.output.suffix.lower() == ".png"
            format_ = None if plain else writer(file, "frames" if order.numbered else "film")
            told = write_film(file, format_, scene, job, kept, tell, order.workers)
        kept.remove()  # not before the film is there
    return told


def _fill_background(order: Order, scene: Scene, what: str) -> None:
    """Draw a background where a format cannot be without."""
    if scene.view.transparent and not writer(order.output, what).alpha:
        scene.warn(f"a {order.output.suffix} cannot be transparent, and has its background")
        scene.view.transparent = False


def _write_data(order: Order, scene: Scene, tell: Tell, whole: bool, lose: Lose) -> str:
    format_ = writer(order.output, order.what)
    times = moments(scene, order.times) if order.lasts else order.times or [scene.view.time]
    if format_.pieces:
        with _file(order, whole) as file:
            format_.write(file, pieces_of(scene, order.what, times[0], order.pieces, tell))
            return f"{_several(order.pieces, 'piece')}, {_bytes(file.parent) / 1e6:.3g} MB"
    steps = len(times) + 1
    tell(0, steps)
    if not order.lasts:
        # Before there is anything to be removed if the program is ended.
        content = data_at(scene, order.what, times[0], order.tolerance)
        tell(1, steps)
        for text in format_.loses(content) if format_.loses else ():
            lose(text)
        with _file(order, whole) as file:
            format_.write(file, content)
        tell(steps, steps)
        return ""

    span = common_scale(scene, order.what, times)

    def series(folder: Path) -> Iterator[tuple[float, Any]]:
        # One after another: all together need not fit into memory.
        taken = 0
        for done, time in enumerate(times, 1):
            yield time, data_at(scene, order.what, time, order.tolerance, span)
            if done <= 2:
                more, taken = _bytes(folder) - taken, _bytes(folder)
                if done == 2:  # what stays the same may be in the first alone
                    left = (len(times) - 2) * more
                    require_room(folder / order.output.name, left, f"{len(times)} times")
            tell(done, steps)

    with _file(order, whole) as file:
        if order.numbered:
            for number, (time, content) in enumerate(series(file.parent)):
                for text in format_.loses(content) if format_.loses and not number else ():
                    lose(text)
                with recorded_at(time):
                    format_.write(file.with_name(file.name % number), content)
        else:
            format_.write(file, series(file.parent))
        size = _bytes(file.parent)
    tell(steps, steps)
    return f"{_several(len(times), 'time')}, {size / 1e6:.3g} MB"


def _bytes(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def _write_moving(order: Order, scene: Scene, tell: Tell, whole: bool, lose: Lose) -> str:
    from spacemap_vtk.draw.moving import mode_shapes, moving

    format_ = writer(order.output, order.what)
    most, numbers = format_.most, format_.numbers
    if order.what == "modes":
        made = mode_shapes(scene, tell, most, order.subdivisions, lose)
    else:
        times = moments(scene, order.times)
        made = moving(
            *(scene, times, order.tolerance, tell, None, most, numbers, order.curves),
            sides=order.subdivisions,
            say=lose,
        )
    with _file(order, whole) as file:
        format_.write(file, made)
        size = file.stat().st_size
    count = len(made.targets)
    words = [_several(count, "target")] if count else []
    if "largest_error" in made.about:
        near = format_quantity(made.about["largest_error"], "m", 3)
        words.append(f"{made.about['frames']} frames, each within {near}")
    return ", ".join([*words, f"{size / 1e6:.3g} MB"])


def _several(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count > 1)}"


@contextmanager
def _file(order: Order, whole: bool) -> Iterator[Path]:
    """Yield the path to write to."""
    if not whole:
        yield order.output
    elif order.what in (*_STILLS, *_PLOTS) or (order.what == "film" and not order.numbered):
        with whole_file(order.output) as file:
            yield file
    else:  # data may take other files beside
        with whole_folder(order.output) as folder:
            yield folder / order.output.name


def as_text(order: Order, values: Mapping[str, Any], base: Path) -> str:
    """Return an order for a process of its own, with its scene as a file in a folder has it."""
    return json.dumps({"values": values, "base": str(base), "order": asdict(order)}, default=str)


def main() -> None:
    """Carry out the order on standard input; whoever ordered makes its files whole."""
    warnings.simplefilter("ignore", SpacemapWarning)  # whoever ordered shows what stages doubt
    if hasattr(os, "nice"):
        os.nice(_NICE)  # ... and goes on working meanwhile
    try:
        from spacemap_vtk.scenes.scene import Scene

        told = json.loads(sys.stdin.read())
        order = Order.of(told["order"], Path(told["order"]["output"]))
        scene = Scene(told["values"], Path(told["base"]))
        # Of its folder the user has never heard.
        with ended_by_exceptions(), telling_refusals(order.output, order.output.name):
            if order.what != "draft":
                scene.check()
            told = carry_out(
                order,
                scene,
                lambda done, of: _say({"done": done, "of": of}),
                whole=False,
                lose=lambda text: _say({"lost": text}),
            )
            _say({"told": told})
    except Exception as error:
        known = isinstance(error, SpacemapError)
        names = ("message", "section", "key", "value", "allowed", "cure")
        why = {name: getattr(error, name, None) for name in names} if known else {}
        _say({"error": {**why, "message": why.get("message") or str(error)}})
        sys.exit(1)


def _say(line: dict[str, Any]) -> None:
    print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
