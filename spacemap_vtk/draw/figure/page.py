"""A page of a publication: tiles in rows, lettered and captioned, pictures and lines alike.

Tiles draw into axes of matplotlib that count in millimetres of the page. Of one row all are as high
as the highest. Lines and letters stay lines and letters in an SVG and a PDF; pictures have the
page's dots, and are put there dot by dot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Room round the page, and between tiles, in mm; height of a line of a caption.
_EDGE, _GAP, _LINE = 1.5, 4.0, 3.3
#: Sizes of letters in points; millimetres of a point; room for a panel's letter, in mm.
TEXT, SMALL, POINT, _LETTER = 7.0, 6.0, 25.4 / 72, 3.2
#: Dots that a page may have: as many as a large picture's.
_MOST = 8192


@dataclass(frozen=True, kw_only=True)
class Paper:
    """What a figure is drawn on."""

    #: In mm, and in dots per inch.
    width: float = 180.0
    dpi: float = 300.0
    #: Whether ink is light.
    dark: bool = False
    #: Whether nothing is behind it.
    transparent: bool = False

    def __post_init__(self) -> None:
        if not self.dots(self.width) <= _MOST:
            raise InputError(
                f"a figure of {self.dots(self.width)} dots is too wide",
                key="--dpi",
                value=self.dpi,
                allowed=f"up to {math.floor(_MOST * 25.4 / self.width)} at a width of "
                f"{self.width:g} mm",
            )

    def dots(self, length: float) -> int:
        """Return how many dots a length in mm has."""
        return round(length * self.dpi / 25.4)

    @property
    def color(self) -> str:
        """Of the paper."""
        return "#14181d" if self.dark else "#ffffff"

    @property
    def ink(self) -> str:
        """Of lines and letters."""
        return "#e9edf2" if self.dark else "#1d232b"

    @property
    def faint(self) -> str:
        """Of what is less important."""
        return "#8a95a3" if self.dark else "#76808c"


@dataclass(frozen=True)
class Tile:
    """A part of a page."""

    #: Draws into axes that count in mm.
    draw: Callable[[Axes, Paper], None]
    #: Height of a width, in mm.
    height: Callable[[float], float]
    caption: str = ""
    #: Of the width of its row, beside those of its neighbours; and at most, in mm.
    share: float = 1.0
    most: float = math.inf
    #: Whether it gets a letter, where several do.
    lettered: bool = True


def new_figure(**settings: Any) -> Figure:
    """Return a figure that is drawn in memory, its words by matplotlib itself."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # Of the folder that a command runs in matplotlib obeys a "matplotlibrc", a stranger's maybe,
    # who could have LaTeX run.
    if Path(matplotlib.matplotlib_fname()).resolve().parent == Path.cwd():
        matplotlib.rcParams["text.usetex"] = False
    figure = Figure(**settings)
    FigureCanvasAgg(figure)
    return figure


def page(
    rows: Sequence[Sequence[Tile]], paper: Paper, tell: Tell = lambda done, of: None
) -> Figure:
    """Return a figure of tiles, row by row, as high as they ask for."""
    placed, y = [], _EDGE
    for row in rows:
        widths = _widths(row, paper.width - 2 * _EDGE - _GAP * (len(row) - 1))
        captions = [_wrapped(tile, width) for tile, width in zip(row, widths, strict=True)]
        head = _LINE * max(text.count("\n") + bool(text) for text in captions)
        heights = [tile.height(width) for tile, width in zip(row, widths, strict=True)]
        x = 0.5 * (paper.width - sum(widths) - _GAP * (len(row) - 1))
        for tile, width, height, text in zip(row, widths, heights, captions, strict=True):
            # Low ones stand at the bottom of their row, each caption over its tile.
            low = y + head + max(heights)
            placed.append((tile, (x, low - height, width, height), text))
            x += width + _GAP
        y += head + max(heights) + _GAP
    dots = paper.dots(paper.width), paper.dots(y - _GAP + _EDGE)
    if dots[1] > _MOST:
        raise InputError(
            f"a figure of {dots[1]} dots is too high",
            key="--dpi",
            value=paper.dpi,
            allowed=f"up to {math.floor(paper.dpi * _MOST / dots[1])} for these panels",
            cure="Or ask for fewer of them.",
        )
    figure = new_figure(
        figsize=(dots[0] / paper.dpi, dots[1] / paper.dpi),
        dpi=paper.dpi,
        facecolor="none" if paper.transparent else paper.color,
    )
    several = sum(tile.lettered for tile, *_ in placed) > 1
    letters = iter("abcdefghijklmnopqrstuvwxyz")
    for count, (tile, (x, top, width, height), text) in enumerate(placed):
        tell(count, len(placed))
        left, across, high = paper.dots(x), paper.dots(width), paper.dots(height)
        low = dots[1] - paper.dots(top) - high
        rectangle = np.array([left, low, across, high]) / [*dots, *dots]
        axes = figure.add_axes(tuple(rectangle.tolist()))
        # By whole dots: a square stays one.
        axes.set(xlim=(0, across * 25.4 / paper.dpi), ylim=(0, high * 25.4 / paper.dpi))
        axes.set_axis_off()
        letter = next(letters, "") if several and tile.lettered else ""
        if text:
            _caption(axes, paper, letter, text)
        tile.draw(axes, paper)
    tell(len(placed), len(placed))
    return figure


def letters_wide(text: str) -> float:
    """Return how wide a line of text is, in mm."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=TEXT)
    return POINT * float(text_to_path.get_text_width_height_descent(text, font, False)[0])


def _widths(row: Sequence[Tile], room: float) -> list[float]:
    shares = [tile.share for tile in row]
    widths = [room * share / sum(shares) for share in shares]
    fit = min(1.0, *(tile.most / width for tile, width in zip(row, widths, strict=True)))
    return [fit * width for width in widths]


def _wrapped(tile: Tile, width: float) -> str:
    """Return a caption in lines that are no wider than its tile, the first after the letter."""
    lines = [""]
    for word in tile.caption.split():
        longer = f"{lines[-1]} {word}".strip()
        room = width - _LETTER * (len(lines) == 1)
        if lines[-1] and letters_wide(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return "\n".join(lines)


def _caption(axes: Axes, paper: Paper, letter: str, text: str) -> None:
    top = axes.get_ylim()[1]
    first, *more = text.split("\n")
    style: dict[str, Any] = {"color": paper.ink, "va": "baseline", "clip_on": False}
    base = top + 1.0 + _LINE * len(more)
    if letter:
        axes.text(0.0, base, letter, fontweight="bold", fontsize=TEXT + 1.5, **style)
    axes.text(_LETTER if letter else 0.0, base, first, fontsize=TEXT, **style)
    for number, line in enumerate(more, 1):
        axes.text(0.0, base - _LINE * number, line, fontsize=TEXT, **style)
