"""Paper, and a page that is drawn on in millimetres."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.draw.figure.page import POINT, new_figure
from spacemap_vtk.ndarrays import Bytes, Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties

#: Margin of a page that every printer leaves, in mm: a quarter of an inch.
MARGIN = 6.4
#: Colour of lines and text.
INK = "#1d232b"
#: Colour of less important lines and text.
FAINT = "#66707c"
#: Resolution of pages that are pictures, in dots per inch.
_DPI = 150.0
#: Fonts with letters of more languages, on several systems.
_MORE_FONTS = (
    *("Noto Sans CJK JP", "Noto Sans JP", "IPAexGothic", "Hiragino Sans", "Yu Gothic"),
    *("Microsoft YaHei", "PingFang SC", "Malgun Gothic", "Apple SD Gothic Neo"),
)
#: Decimals of coordinates in points.
_DECIMALS = 2
#: Half the height of a digit over its size.
_HALF_DIGIT = 0.365
#: Room for the number of a page beside its title, in mm.
PAGE_NUMBER = 30.0
#: Size of text, in points.
BODY = 8.0
#: Size of numbers at grids, in points.
NUMBER = 6.0


class Box(NamedTuple):
    """A rectangle on a page, in mm from its left upper corner."""

    left: float
    top: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """The right side."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """The lower side."""
        return self.top + self.height


def word_width(word: str, size: float = BODY, bold: bool = False) -> float:
    """Return the width of a text in mm."""
    return _unit_width(word, bold) * size * POINT


@lru_cache(maxsize=8192)
def _unit_width(word: str, bold: bool) -> float:
    """Return the width of a text over the size of its letters."""
    from matplotlib.textpath import text_to_path

    font = _font(100.0, bold)
    with _missing_letters_allowed():
        return 0.01 * float(text_to_path.get_text_width_height_descent(word, font, False)[0])


@lru_cache(maxsize=256)
def _font(size: float, bold: bool) -> FontProperties:
    from matplotlib.font_manager import FontProperties

    return FontProperties(family=_families(), size=size, weight="bold" if bold else "normal")


@lru_cache(maxsize=1)
def _families() -> list[str]:
    """Return matplotlib's own font, then installed ones for letters that it lacks."""
    from matplotlib.font_manager import get_font_names

    installed = get_font_names()
    return ["DejaVu Sans", *(name for name in _MORE_FONTS if name in installed)]


@contextmanager
def _missing_letters_allowed() -> Iterator[None]:
    """Suppress the warning about letters that no font has; they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Glyph .* missing")
        yield


class Label(NamedTuple):
    """A line of text on a page; y is its baseline, in mm from above."""

    x: float
    y: float
    text: str
    size: float
    color: str
    bold: bool
    #: Whether it is read from below, upwards.
    upright: bool


class Page:
    """A page of paper; x to the right and y down, in mm."""

    def __init__(self, size: tuple[float, float]) -> None:
        self.size = size
        self.figure: Figure = new_figure(
            figsize=(size[0] / 25.4, size[1] / 25.4), dpi=_DPI, facecolor="white"
        )
        self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        # The axes' unit is a point, as in PDF and SVG: rounded coordinates make small files.
        self._axes.set(xlim=(0.0, size[0] / POINT), ylim=(0.0, size[1] / POINT))
        self._axes.set_axis_off()
        self._labels: list[Label] = []
        self._axes.add_artist(_label_artist(self._labels, size[1]))

    @property
    def body(self) -> Box:
        """The page without its margins."""
        return Box(MARGIN, MARGIN, self.size[0] - 2 * MARGIN, self.size[1] - 2 * MARGIN)

    def write(
        self,
        x: float,
        y: float,
        text: str,
        size: float = BODY,
        color: str = INK,
        *,
        centred: bool = False,
        right: bool = False,
        bold: bool = False,
        upright: bool = False,
    ) -> None:
        """Write a line of text from (x, y) on, to it, or centred about it in both directions."""
        length = word_width(text, size, bold)
        shift = 0.5 * length if centred else length if right else 0.0
        lower = _HALF_DIGIT * size * POINT if centred else 0.0
        place = (x + lower, y + shift) if upright else (x - shift, y + lower)
        self._labels.append(Label(*place, text, size, color, bold, upright))

    def fill(self, rectangles: ArrayLike, color: Any, alpha: float = 1.0, name: str = "") -> None:
        """Fill rectangles (n, 4) of left, top, width and height, as a single shape."""
        boxes = np.asarray(rectangles, dtype=float).reshape(-1, 4)
        if len(boxes):
            turn = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
            corners = boxes[:, None, :2] + turn * boxes[:, None, 2:]
            style = {"facecolor": color, "linewidth": 0.0, "alpha": alpha, "gid": name or None}
            self._add(corners, **style)

    def draw_lines(
        self,
        lines: ArrayLike,
        width: float,
        color: Any = INK,
        name: str = "",
        dashes: tuple[float, ...] = (),
    ) -> None:
        """Draw lines (n, 2, 2) between two points, as a single shape; the width is in points."""
        ends = np.asarray(lines, dtype=float).reshape(-1, 2, 2)
        if len(ends):
            style: dict[str, Any] = {"edgecolor": color, "linewidth": width, "fill": False}
            style["linestyle"] = (0, dashes) if dashes else "solid"
            self._add(ends, closed=False, gid=name or None, capstyle="butt", **style)

    def draw_box(self, box: Box, width: float = 0.5, color: Any = INK) -> None:
        """Draw the outline of a rectangle."""
        x, y = (box.left, box.right), (box.top, box.bottom)
        corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])])
        style = {"edgecolor": color, "linewidth": width, "fill": False}
        self._add(corners[None], **style)

    def draw_dots(self, centres: ArrayLike, radius: float, color: Any = INK) -> None:
        """Draw filled circles around points (n, 2), as a single shape."""
        points = np.asarray(centres, dtype=float).reshape(-1, 1, 2)
        if len(points):
            # A short line with round ends takes fewer numbers than a circle.
            lines = np.repeat(points, 2, axis=1)
            lines[:, 1, 0] += 2.0 * 10.0**-_DECIMALS * POINT
            style = {"edgecolor": color, "linewidth": 2.0 * radius / POINT, "fill": False}
            # Snapped to pixels, the lines would have no length and vanish from pictures.
            self._add(lines, closed=False, capstyle="round", snap=False, **style)

    def draw_cells(self, pixels: Bytes, box: Box) -> None:
        """Draw an image of exact cells (rows, columns, 3), the first row at the top."""
        corners = np.array([[box.left, box.bottom], [box.right, box.top]])
        (left, low), (right, high) = self._to_points(corners)
        extent = (left, right, low, high)
        self._axes.imshow(
            pixels, extent=extent, origin="upper", interpolation="none", aspect="auto"
        )

    def _to_points(self, places: Floats) -> Floats:
        """Convert places in mm, y down, to points, y up."""
        converted = np.array([0.0, self.size[1]]) + np.array([1.0, -1.0]) * places
        return np.round(converted / POINT, _DECIMALS)

    def _add(self, polygons: Floats, closed: bool = True, **style: Any) -> None:
        """Draw polygons (n, points, 2) as one shape; a closed one ends where it begins."""
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path

        count, corners = polygons.shape[:2]
        codes = np.full((count, corners), Path.LINETO, np.uint8)
        codes[:, 0] = Path.MOVETO
        if closed:
            codes[:, -1] = Path.CLOSEPOLY
        path = Path(self._to_points(polygons.reshape(-1, 2)), codes.ravel())
        # Unlike add_patch, this measures no data limits, which are fixed.
        self._axes.add_artist(PathPatch(path, **style))


def _label_artist(labels: Sequence[Label], height: float) -> Artist:
    """Return an artist that draws labels, also those that are added later."""
    from matplotlib.artist import Artist
    from matplotlib.colors import to_rgba

    # An artist for each label takes ten times as long: matplotlib lays each out by itself.
    class Labels(Artist):
        """Draw the labels of a page."""

        zorder = 10.0

        def draw(self, renderer: Any) -> None:
            """Draw them."""
            dots, canvas_height = renderer.points_to_pixels(72.0) / 25.4, height
            renderer.open_group("labels", self.get_gid())
            context = renderer.new_gc()
            with _missing_letters_allowed():
                for label in labels:
                    context.set_foreground(to_rgba(label.color), isRGBA=True)
                    y = label.y if renderer.flipy() else canvas_height - label.y
                    font, angle = _font(label.size, label.bold), 90.0 if label.upright else 0.0
                    renderer.draw_text(context, label.x * dots, y * dots, label.text, font, angle)
            context.restore()
            renderer.close_group("labels")

    return Labels()


def fit_box(box: Box, columns: float, rows: float, most: float = np.inf) -> Box:
    """Return the largest box of square cells, not larger than `most` mm, centred across `box`."""
    cell = min(box.width / columns, box.height / rows, most)
    width = cell * columns
    return Box(box.left + 0.5 * (box.width - width), box.top, width, cell * rows)


def shorten_text(text: str, width: float, size: float, bold: bool = False) -> str:
    """Return a text that is cut to a width in mm."""
    while text and word_width(text, size, bold) > width:
        text = text[:-2].rstrip() + "…"
    return text


def _split_word(word: str, width: float, size: float) -> Iterator[str]:
    """Yield a word in pieces that fit into a width; most words are one piece."""
    while word_width(word, size) > width and len(word) > 1:
        count = max(1, int(len(word) * width / word_width(word, size)))
        while count > 1 and word_width(word[:count], size) > width:
            count -= 1
        yield word[:count]
        word = word[count:]
    yield word


def wrap_words(words: list[str], width: float, size: float = BODY) -> list[str]:
    """Break words into lines of at most this width in mm."""
    lines: list[str] = []
    used, space = 0.0, 0.318 * size * POINT
    pieces = (piece for word in words for piece in _split_word(word, width, size))
    for piece in pieces:
        length = word_width(piece, size)
        if lines and used + space + length <= width:
            lines[-1] += f" {piece}"
            used += space + length
        else:
            lines.append(piece)
            used = length
    return lines
