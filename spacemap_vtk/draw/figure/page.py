"""Lay out a page of a publication: rows of tiles with letters and captions.

Tiles draw into matplotlib axes whose unit is a millimetre of the page. A row is as high as its
highest tile. Lines and text remain vectors in SVG and PDF. Pictures have the resolution of the page
and are placed at whole dots, without resampling.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import StepProgress

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Margin of the page, in mm.
_EDGE = 1.5
#: Gap between tiles, in mm.
_GAP = 4.0
#: Height of a line of a caption, in mm.
_LINE = 3.3
#: Font size of text, in points.
TEXT = 7.0
#: Font size of small text, in points.
SMALL = 6.0
#: Length of a point, in mm.
POINT = 25.4 / 72
#: Width of a panel's letter, in mm.
_LETTER = 3.2
#: Largest width or height of a page in dots: that of a large picture.
_MAX_DOTS = 8192


@dataclass(frozen=True, kw_only=True)
class PageStyle:
    """The paper of a figure."""

    #: Width in mm.
    width: float = 180.0
    #: Resolution in dots per inch.
    dpi: float = 300.0
    #: Whether the paper is dark and the ink light.
    dark: bool = False
    #: Whether the paper is transparent.
    transparent: bool = False

    def __post_init__(self) -> None:
        if not self.dots(self.width) <= _MAX_DOTS:
            raise InputError(
                f"a figure of {self.dots(self.width)} dots is too wide",
                key="--dpi",
                value=self.dpi,
                allowed=f"up to {math.floor(_MAX_DOTS * 25.4 / self.width)} at a width of "
                f"{self.width:g} mm",
            )

    def dots(self, length: float) -> int:
        """Convert a length in mm to dots."""
        return round(length * self.dpi / 25.4)

    @property
    def color(self) -> str:
        """Colour of the paper."""
        return "#14181d" if self.dark else "#ffffff"

    @property
    def ink(self) -> str:
        """Colour of lines and text."""
        return "#e9edf2" if self.dark else "#1d232b"

    @property
    def faint(self) -> str:
        """Colour of less important lines and text."""
        return "#8a95a3" if self.dark else "#76808c"


@dataclass(frozen=True)
class Tile:
    """A part of a page."""

    #: Draws the tile into axes whose unit is mm.
    draw: Callable[[Axes, PageStyle], None]
    #: Returns the height for a width, in mm.
    height: Callable[[float], float]
    caption: str = ""
    #: Weight of the tile's width relative to its neighbours in the row.
    share: float = 1.0
    #: Largest width in mm.
    max_width: float = math.inf
    #: Whether this tile is labelled (a, b, c, …) if the page has several labelled ones.
    has_letter: bool = True


def new_figure(**settings: Any) -> Figure:
    """Return a figure that is drawn in memory, without LaTeX from a local matplotlibrc."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # matplotlib obeys a file "matplotlibrc" in the working folder. Somebody else may have put it
    # there, and it could run LaTeX with any commands.
    if Path(matplotlib.matplotlib_fname()).resolve().parent == Path.cwd():
        matplotlib.rcParams["text.usetex"] = False
    figure = Figure(**settings)
    FigureCanvasAgg(figure)
    return figure


def lay_out_page(
    rows: Sequence[Sequence[Tile]],
    page_style: PageStyle,
    report_progress: StepProgress = lambda done, of: None,
) -> Figure:
    """Return a figure with rows of tiles, as high as the tiles need."""
    placed, y = [], _EDGE
    for row in rows:
        widths = _tile_widths(row, page_style.width - 2 * _EDGE - _GAP * (len(row) - 1))
        captions = [_wrap_caption(tile, width) for tile, width in zip(row, widths, strict=True)]
        caption_height = _LINE * max(text.count("\n") + bool(text) for text in captions)
        heights = [tile.height(width) for tile, width in zip(row, widths, strict=True)]
        x = 0.5 * (page_style.width - sum(widths) - _GAP * (len(row) - 1))
        for tile, width, height, text in zip(row, widths, heights, captions, strict=True):
            # Lower tiles are at the bottom of their row, with the caption directly above each tile.
            low = y + caption_height + max(heights)
            placed.append((tile, (x, low - height, width, height), text))
            x += width + _GAP
        y += caption_height + max(heights) + _GAP
    dots = page_style.dots(page_style.width), page_style.dots(y - _GAP + _EDGE)
    if dots[1] > _MAX_DOTS:
        raise InputError(
            f"a figure of {dots[1]} dots is too high",
            key="--dpi",
            value=page_style.dpi,
            allowed=f"up to {math.floor(page_style.dpi * _MAX_DOTS / dots[1])} for these panels",
            cure="Or use fewer panels.",
        )
    figure = new_figure(
        figsize=(dots[0] / page_style.dpi, dots[1] / page_style.dpi),
        dpi=page_style.dpi,
        facecolor="none" if page_style.transparent else page_style.color,
    )
    has_letters = sum(tile.has_letter for tile, *_ in placed) > 1
    letters = iter("abcdefghijklmnopqrstuvwxyz")
    for count, (tile, (x, top, width, height), text) in enumerate(placed):
        report_progress(count, len(placed))
        left, across, high = page_style.dots(x), page_style.dots(width), page_style.dots(height)
        low = dots[1] - page_style.dots(top) - high
        rectangle = np.array([left, low, across, high]) / [*dots, *dots]
        axes = figure.add_axes(tuple(rectangle.tolist()))
        # The limits follow the rounding to whole dots, so that squares stay square.
        axes.set(xlim=(0, across * 25.4 / page_style.dpi), ylim=(0, high * 25.4 / page_style.dpi))
        axes.set_axis_off()
        letter = next(letters, "") if has_letters and tile.has_letter else ""
        if text:
            _draw_caption(axes, page_style, letter, text)
        tile.draw(axes, page_style)
    report_progress(len(placed), len(placed))
    return figure


def text_width(text: str) -> float:
    """Return the width of a line of text in mm."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=TEXT)
    return POINT * float(text_to_path.get_text_width_height_descent(text, font, False)[0])


def _tile_widths(row: Sequence[Tile], room: float) -> list[float]:
    shares = [tile.share for tile in row]
    widths = [room * share / sum(shares) for share in shares]
    fit = min(1.0, *(tile.max_width / width for tile, width in zip(row, widths, strict=True)))
    return [fit * width for width in widths]


def _wrap_caption(tile: Tile, width: float) -> str:
    """Wrap a caption to the width of its tile; the first line leaves room for the letter."""
    lines = [""]
    for word in tile.caption.split():
        longer = f"{lines[-1]} {word}".strip()
        room = width - _LETTER * (len(lines) == 1)
        if lines[-1] and text_width(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return "\n".join(lines)


def _draw_caption(axes: Axes, page_style: PageStyle, letter: str, text: str) -> None:
    top = axes.get_ylim()[1]
    first, *more = text.split("\n")
    style: dict[str, Any] = {"color": page_style.ink, "va": "baseline", "clip_on": False}
    base = top + 1.0 + _LINE * len(more)
    if letter:
        axes.text(0.0, base, letter, fontweight="bold", fontsize=TEXT + 1.5, **style)
    axes.text(_LETTER if letter else 0.0, base, first, fontsize=TEXT, **style)
    for number, line in enumerate(more, 1):
        axes.text(0.0, base - _LINE * number, line, fontsize=TEXT, **style)
