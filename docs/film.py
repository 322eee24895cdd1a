"""Make the film of the documentation, from a draft to a cloth on a table: python docs/film.py

It takes some fifteen minutes on two cores. Frames are kept in build/film, so that a stopped film
goes on where it was; remove the folder of a shot to draw it again. Names draw only the frames of
these shots, also beside another process: python docs/film.py fall orbit.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from spacemap_vtk.draw.camera import VIEW_ANGLE, Viewpoint
from spacemap_vtk.draw.compose import gradient_background
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.io.formats.film import write_film
from spacemap_vtk.ndarrays import Bytes, Floats
from spacemap_vtk.scenes.editable_draft import EditableDraft, make_editable_draft
from spacemap_vtk.scenes.presets import apply, make_plan
from spacemap_vtk.scenes.scene import Scene

HERE = Path(__file__).parent
DRAFT = HERE.parent / "scenes" / "drafts" / "overshot.wif"
FRAMES = HERE.parent / "build" / "film"
FILM, STILL = HERE / "film.mp4", HERE / "film.jpg"

#: Width and height in pixels, and frames per second.
SIZE, RATE = (1280, 720), 24
#: Number of frames of the film that show each frame of a moving cloth or of a camera in space.
HOLD = 2
#: Rate factor of the encoder: the film has 4 MB.
CRF = 32
#: Duration of the change from one shot to the next, and of the appearance of a caption [s].
FADE = 0.6
INK, FAINT, PAPER = "#1d232b", "#5f6a76", "#ffffff"

#: Pixels per yarn of the drawdown, and of a mark beside it; left and upper edge of the drawdown.
CELL, MARK = 4, 8
LEFT, TOP, GAP = 620, 112, 12
#: Moments at which threading, tie-up, and treadling with drawdown begin to appear [s].
THREADING, TIEUP, WEAVING, WOVEN = 1.0, 3.2, 4.4, 11.0

#: Height from which the cloth falls [m], drag of the air [1/s], and duration of the fall [s].
HEIGHT, DRAG, FALL = 18e-3, 6.0, 0.6
#: How long the film shows the fall [s].
SLOW = 6.0


class Eye(NamedTuple):
    """A camera that looks at a place."""

    #: Place at which the camera looks [m].
    focus: tuple[float, float, float]
    #: Distance from there [m].
    distance: float
    #: Angle above the horizon, and angle about the vertical, in degrees.
    elevation: float
    azimuth: float

    @property
    def viewpoint(self) -> Viewpoint:
        """The camera as the program places it."""
        high, turn = math.radians(self.elevation), math.radians(self.azimuth)
        away = np.array(
            [math.cos(high) * math.cos(turn), math.cos(high) * math.sin(turn), math.sin(high)]
        )
        up = np.array(
            [-math.sin(high) * math.cos(turn), -math.sin(high) * math.sin(turn), math.cos(high)]
        )
        position = np.array(self.focus) + self.distance * away
        return Viewpoint(tuple(position.tolist()), self.focus, tuple(up.tolist()))

    def toward(self, other: Eye, share: float) -> Eye:
        """Return the camera on its way to another one; `share` is from 0 to 1."""
        s = share * share * (3.0 - 2.0 * share)
        focus = [(1 - s) * a + s * b for a, b in zip(self.focus, other.focus, strict=True)]
        distance = self.distance ** (1 - s) * other.distance**s
        angles = [(1 - s) * a + s * b for a, b in zip(self[2:], other[2:], strict=True)]
        return Eye(tuple(focus), distance, *angles)


#: Function that draws a frame.
Draw = Callable[[], Bytes]


class Shot(NamedTuple):
    """A part of the film."""

    seconds: float
    #: Texts from below, and the moments at which they appear [s].
    captions: Sequence[tuple[float, str]]
    #: Yields a function for each frame; the last frame stays until the end of the shot.
    frames: Callable[[], Iterator[Draw]]
    #: Number of frames of the film for which each is shown.
    hold: int = 1


@lru_cache
def draft() -> EditableDraft:
    """Return the draft."""
    woven = Scene.read(DRAFT).woven
    assert woven is not None
    return make_editable_draft(woven)


@lru_cache
def paper() -> Bytes:
    """Return an empty frame."""
    style = Scene.read(DRAFT).view.resolved_style
    return np.asarray(gradient_background(SIZE, style.bottom_color, style.top_color))[..., :3]


def steps(begin: float, end: float, time: float, count: int) -> int:
    """Return how many of some things have appeared at a time, one after the other."""
    return round(count * min(1.0, max(0.0, (time - begin) / (end - begin))))


def put(page: Bytes, cells: Bytes, left: int, top: int, size: tuple[int, int]) -> None:
    """Paint cells, each `size` pixels wide and high; the first row is the lowest."""
    wide = np.repeat(np.repeat(cells[::-1], size[1], axis=0), size[0], axis=1)
    page[top : top + wide.shape[0], left : left + wide.shape[1]] = wide


def put_marks(page: Bytes, marks: Bytes, left: int, top: int, size: tuple[int, int]) -> None:
    """Paint a grid of marks."""
    ink = np.array([[255, 255, 255], [38, 50, 62]], np.uint8)
    put(page, ink[marks.astype(int)], left, top, size)
    high, wide = marks.shape[0] * size[1], marks.shape[1] * size[0]
    part = page[top - 1 : top + high + 1, left - 1 : left + wide + 1]
    part[[0, -1]] = part[:, [0, -1]] = 150


def draw_draft(time: float) -> Bytes:
    """Draw the draft, which appears end by end and pick by pick."""
    page, shown = paper().copy(), draft()
    ends, picks = shown.size
    right, above = LEFT + ends * CELL + GAP, TOP - GAP - shown.loom.shafts * MARK
    threading = shown.marks("threading").copy()
    threading[:, steps(THREADING, TIEUP, time, ends) :] = False
    tieup = shown.marks("tieup") & (time >= TIEUP)
    woven = steps(WEAVING, WOVEN, time, picks)
    treadling = shown.marks("treadling").copy()
    treadling[woven:] = False
    put_marks(page, threading, LEFT, above, (CELL, MARK))
    put_marks(page, tieup, right, above, (MARK, MARK))
    put_marks(page, treadling, right, TOP, (MARK, CELL))
    warp = np.broadcast_to(shown.warp[None], (picks, ends, 3))
    cloth = np.where(shown.drawdown[..., None], warp, shown.weft[:, None]).astype(np.uint8)
    # Ends that are not woven yet lie on the loom.
    cloth[woven:] = (0.35 * warp + 0.65 * 255)[woven:].astype(np.uint8)
    put(page, cloth, LEFT, TOP, (CELL, CELL))
    if 0 < woven < picks:
        row = TOP + (picks - woven) * CELL
        page[row - 1 : row + 1, LEFT : right + treadling.shape[1] * MARK] = [200, 60, 40]
    return page


def draft_frames() -> Iterator[Draw]:
    """Yield the frames of the draft."""
    for number in range(round(WOVEN * RATE) + 1):
        yield lambda number=number: draw_draft(number / RATE)


def scale() -> float:
    """Return the metres per pixel at which the cloth covers its drawdown."""
    ends = draft().size[0]
    return extent()[0] / (ends * CELL)


@lru_cache
def extent() -> tuple[float, float]:
    """Return the width and height of one repeat [m]."""
    woven = Scene.read(DRAFT).woven
    assert woven is not None
    return tuple(woven.extent[:2])


def over_drawdown(middle: tuple[float, float]) -> Eye:
    """Return a camera above a repeat of the cloth, which appears where its drawdown is."""
    ends, picks = draft().size
    across = LEFT + ends * CELL / 2 - SIZE[0] / 2
    below = TOP + picks * CELL / 2 - SIZE[1] / 2
    return above((middle[0] - across * scale(), middle[1] + below * scale()), scale())


def moving_eye(
    picture: Picture, first: Eye, last: Eye, seconds: float, time: float = 0.0
) -> Iterator[Draw]:
    """Yield the frames of a camera that moves in a still picture."""
    picture.panels[0].window.set_samples(0)
    picture.panels[0].window.renderer.UseFXAAOn()
    drawn: list[Bytes] = []

    def draw(eye: Eye) -> Bytes:
        if not drawn:
            drawn.append(picture.draw(time))
        return picture.draw_from(eye.viewpoint)

    count = round(seconds * RATE / HOLD)
    for number in range(count + 1):
        yield lambda number=number: draw(first.toward(last, number / count))


#: Near the yarns, in a part of the pattern with long floats.
NEAR = Eye((6e-3, -4e-3, 0.0), 22e-3, 38.0, -68.0)
#: Metres per pixel at the end of the way down to the cloth, and duration of this way [s].
NEAREST, ZOOM = 40e-6, 6.0
#: How much larger the pictures are of which frames show parts.
ENLARGE, SLOWLY = 1.4, 1.25
#: Before the table on which the cloth lies.
TABLE = Eye((0.0, 0.0, -50e-3), 0.50, 27.0, -62.0)


def above(middle: Sequence[float], pixel: float) -> Eye:
    """Return a camera above a place, with metres per pixel."""
    distance = pixel * SIZE[1] / 2 / math.tan(math.radians(VIEW_ANGLE / 2))
    return Eye((middle[0], middle[1], 0.0), distance, 90.0, -90.0)


def draw_large(scene: Scene, eye: Eye, factor: float) -> Image.Image:
    """Draw a large picture, of which frames show parts."""
    picture = Picture(scene, [0.0], enlarged(factor), viewpoint=eye.viewpoint)
    image = Image.fromarray(picture.draw(0.0)[..., :3])
    picture.close()
    return image


def enlarged(factor: float) -> tuple[int, int]:
    """Return the size of a frame times a factor."""
    return round(factor * SIZE[0]), round(factor * SIZE[1])


def part_of(large: Image.Image, left: float, top: float, share: float) -> Bytes:
    """Return a part of a large picture as a frame; all numbers are shares of its sides."""
    width, height = large.size
    box = (left * width, top * height, (left + share) * width, (top + share) * height)
    return np.asarray(large.resize(SIZE, Image.Resampling.LANCZOS, box=box))


def zoom_frames() -> Iterator[Draw]:
    """Yield the frames of a camera that comes down on the cloth: parts of few large pictures."""
    # Seen from straight above, flat cloth looks the same in a part of a picture from higher up.
    first, last = over_drawdown((0.0, 0.0)), above(NEAR.focus, NEAREST)
    ratio = first.distance / last.distance
    levels = math.ceil(math.log(ratio) / math.log(ENLARGE))

    def on_way(share: float) -> Eye:
        """Return the camera at a share of the way, so that each view contains the next one."""
        distance = first.distance * ratio**-share
        way = (first.distance - distance) / (first.distance - last.distance)
        focus = [a + way * (b - a) for a, b in zip(first.focus, last.focus, strict=True)]
        return Eye(tuple(focus), distance, 90.0, -90.0)

    eyes = [on_way(math.log(ENLARGE) / math.log(ratio) * level) for level in range(levels)]

    @lru_cache
    def large(level: int) -> Image.Image:
        return draw_large(Scene.read(DRAFT), eyes[level], ENLARGE)

    def draw(share: float) -> Bytes:
        eye = on_way(share * share * (3.0 - 2.0 * share))
        level = max(n for n, each in enumerate(eyes) if each.distance >= eye.distance * (1 - 1e-9))
        start = eyes[level]
        part = eye.distance / start.distance
        width = SIZE[0] * scale() * start.distance / first.distance
        x = (eye.focus[0] - start.focus[0]) / width
        y = (start.focus[1] - eye.focus[1]) / (width * SIZE[1] / SIZE[0])
        return part_of(large(level), 0.5 + x - part / 2, 0.5 + y - part / 2, part)

    count = round(ZOOM * RATE)
    for number in range(count + 1):
        yield lambda number=number: draw(number / count)


def still_frames(scene: Callable[[], Scene], eye: Eye, seconds: float) -> Iterator[Draw]:
    """Yield the frames of a camera that comes slowly nearer: parts of one large picture."""

    @lru_cache
    def large() -> Image.Image:
        return draw_large(scene(), eye, SLOWLY)

    count = round(seconds * RATE)
    for number in range(count + 1):
        part = 1.0 + number / count * (1.0 / SLOWLY - 1.0)
        yield lambda part=part: part_of(large(), (1 - part) / 2, (1 - part) / 2, part)


def back_frames() -> Iterator[Draw]:
    """Yield the frames of the zoom backwards, twice as fast."""
    for file in sorted((FRAMES / "zoom").glob("*.png"))[::-2]:
        yield lambda file=file: read(file)


def grow_frames() -> Iterator[Draw]:
    """Yield the frames of a camera that goes away from the whole cloth."""
    width, height = extent()
    picture = Picture(fall_scene(), [0.0], SIZE, viewpoint=lowered(TABLE).viewpoint)
    first = over_drawdown((width / 2, -height / 2))
    yield from moving_eye(picture, first, lowered(TABLE), 4.5)
    picture.close()


def fall_scene() -> Scene:
    """Return a scene in which the cloth falls onto the table of the preset "drape"."""
    given = Scene.read(DRAFT)
    values, drape = make_plan(given, "drop").values, apply(DRAFT, "drape")
    obstacles = make_plan(given, "drape").values["modal"]["obstacles"]
    for table, body in zip(obstacles, drape.modal.obstacles, strict=True):
        table["center"] = [*body.center[:2], body.center[2] - HEIGHT]
    # Nothing pins the falling cloth: friction holds it on the table.
    obstacles[0]["friction"] = 0.3
    values["modal"]["obstacles"] = obstacles
    values["transient"] |= {"alpha": DRAG, "duration": FALL, "frames": 121}
    values["animation"] = {"stop": FALL}
    return Scene(values, DRAFT)


def lowered(eye: Eye) -> Eye:
    """Return a camera that sees the table of the fall as another one that of the drape."""
    x, y, z = eye.focus
    return eye._replace(focus=(x, y, z - HEIGHT))


def fall_frames() -> Iterator[Draw]:
    """Yield the frames of the fall."""
    count = round(SLOW * RATE / HOLD)
    times = [FALL * number / count for number in range(count + 1)]
    picture = Picture(fall_scene(), times, SIZE, viewpoint=lowered(TABLE).viewpoint)
    picture.panels[0].window.set_samples(0)
    picture.panels[0].window.renderer.UseFXAAOn()
    for time in times:
        yield lambda time=time: picture.draw(time)
    picture.close()


def orbit_frames() -> Iterator[Draw]:
    """Yield the frames of a camera that goes round the cloth on the table."""
    scene = apply(DRAFT, "drape")
    picture = Picture(scene, [0.0], SIZE, viewpoint=TABLE.viewpoint)
    yield from moving_eye(picture, TABLE, TABLE._replace(azimuth=TABLE.azimuth + 100.0), 8.0)
    picture.close()


#: Near a fold at the rim of the table.
RIM = Eye((42e-3, -42e-3, -14e-3), 95e-3, 15.0, -80.0)


def end_frames() -> Iterator[Draw]:
    """Yield the last picture of the orbit."""
    yield lambda: read(sorted((FRAMES / "orbit").glob("*.png"))[-1])


SHOTS = {
    "draft": Shot(
        12.0,
        [
            (0.0, "From a weaver's draft\nto a cloth on a table"),
            (THREADING, "Threading: which shaft lifts each end"),
            (TIEUP, "Tie-up: which shafts each treadle lifts"),
            (WEAVING, "Treadling, pick by pick, and the drawdown:\nwhich yarn lies on top"),
        ],
        draft_frames,
    ),
    "zoom": Shot(
        7.0,
        [(0.6, "The drawdown becomes cloth: each yarn has its exact path")],
        zoom_frames,
    ),
    "near": Shot(
        5.0,
        [(0.6, "Crimp, sections and fibres follow from counts and setts")],
        lambda: still_frames(lambda: Scene.read(DRAFT), NEAR, 5.0),
    ),
    "back": Shot(3.1, [], back_frames),
    "grow": Shot(
        5.7,
        [(0.5, "Four repeats: 276 by 276 yarns of cotton, 17 cm wide")],
        grow_frames,
        HOLD,
    ),
    "fall": Shot(
        8.8,
        [
            (
                0.6,
                "The cloth falls, ten times slower than in reality:\n"
                "time steps with contact, friction and the drag of air",
            ),
        ],
        fall_frames,
        HOLD,
    ),
    "orbit": Shot(
        8.4,
        [(0.6, "At rest: the equilibrium under its own weight, computed apart from the fall")],
        orbit_frames,
        HOLD,
    ),
    "rim": Shot(
        5.5,
        [(0.6, "At the rim of the table: the same yarns, bent with the cloth")],
        lambda: still_frames(lambda: apply(DRAFT, "drape"), RIM, 5.5),
    ),
    "end": Shot(4.5, [(0.4, "$ spacemap render draft.wif --drape -o cloth.png")], end_frames),
}
#: Shots whose frames take so long to draw that they are kept.
KEPT = ("zoom", "near", "grow", "fall", "orbit", "rim")


def read(file: Path) -> Bytes:
    """Read a frame that is kept."""
    with Image.open(file) as image:
        return np.asarray(image.convert("RGB"))


def frames_of(name: str) -> Iterator[Bytes]:
    """Yield the frames of a shot, drawn or kept."""
    folder = FRAMES / name
    for number, draw in enumerate(SHOTS[name].frames()):
        file = folder / f"{number:04d}.png"
        if name not in KEPT:
            yield draw()
        elif file.is_file():
            yield read(file)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            image, part = draw()[..., :3], file.with_suffix(f".{os.getpid()}")
            Image.fromarray(image).save(part, "PNG", compress_level=1)
            part.rename(file)
            print(name, number, flush=True)
            yield image


@lru_cache
def draw_caption(text: str, name: str) -> Floats:
    """Draw a caption; return red, green, blue and coverage, (height, width, 4), from 0 to 1."""
    figure = new_figure(figsize=(SIZE[0] / 100, SIZE[1] / 100), dpi=100, facecolor="none")
    lines = text.count("\n")
    box = {"boxstyle": "round,pad=0.5,rounding_size=0.25", "edgecolor": "none"}
    if name == "draft" and not text.startswith("From"):
        below = [caption for _, caption in SHOTS["draft"].captions].index(text)
        figure.text(0.055, 0.60 - 0.1 * below, text, size=14, color=INK, va="top", linespacing=1.5)
    elif name == "draft":
        figure.text(0.055, 0.80, text, size=26, color=INK, va="top", weight="bold", linespacing=1.3)
        figure.text(0.055, 0.075, "spacemap_vtk", size=14, color=FAINT)
    elif name == "end":
        box |= {"facecolor": "#1d232b", "alpha": 0.92, "pad": 0.5}
        box["boxstyle"] = "round,pad=0.7,rounding_size=0.25"
        figure.text(
            0.5, 0.1, text, size=19, color="#e9edf2", ha="center", family="monospace", bbox=box
        )
    else:
        box |= {"facecolor": PAPER, "alpha": 0.8}
        figure.text(0.04, 0.07 + 0.0 * lines, text, size=15, color=INK, bbox=box, linespacing=1.4)
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba()).astype(np.float64) / 255


def add_captions(image: Bytes, name: str, time: float) -> Bytes:
    """Draw the captions of a moment over a frame; those of the draft stay."""
    shot = SHOTS[name]
    begins = [begin for begin, _ in shot.captions]
    ends = [*begins[1:], shot.seconds + FADE][: len(begins)]
    if name == "draft":
        ends = [math.inf] * len(begins)
    for (begin, text), end in zip(shot.captions, ends, strict=True):
        if begin == 0.0 == time or begin <= time < end:
            layer = draw_caption(text, name)
            share = min(1.0, (time - begin) / FADE, max(0.0, (end - time) / FADE)) if begin else 1.0
            rows = np.flatnonzero(layer[..., 3].any(axis=1))
            part = slice(rows[0], rows[-1] + 1)
            cover = share * layer[part, :, 3:]
            image = image.copy()
            image[part] = np.rint((1 - cover) * image[part] + cover * 255 * layer[part, :, :3])
    return image


def film_frames() -> Iterator[Bytes]:
    """Yield all frames; each shot appears in the last frame of the one before."""
    before: Bytes | None = None
    for name, shot in SHOTS.items():
        frames, image, count = frames_of(name), None, round(shot.seconds * RATE)
        for number in range(count):
            if number % shot.hold == 0:
                image = next(frames, image)
            assert image is not None
            shown = add_captions(image, name, number / RATE)
            share = (number + 1) / (FADE * RATE)
            if before is not None and share < 1.0 and name != "back":
                shown = np.rint((1 - share) * before + share * shown).astype(np.uint8)
            yield shown
        before = shown


def main(names: Sequence[str]) -> None:
    """Make the film, or draw the frames of some shots."""
    for name in names:
        for _ in frames_of(name):
            pass
    if names:
        return
    write_film(FILM, film_frames(), RATE, CRF)
    with Image.open(sorted((FRAMES / "orbit").glob("*.png"))[0]) as image:
        image.convert("RGB").save(STILL, quality=88, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
