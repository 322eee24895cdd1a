"""Draw a draft on a page: threading, tie-up, treadling or liftplan, and drawdown.

The drawdown shows the front of the cloth: ends are counted from the left and picks from below.
Shaft 1 is next to the drawdown. A black square is a mark; in the drawdown, the end lies over the
pick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.draw.figure.page import POINT, SMALL, PageStyle, Tile
from spacemap_vtk.ndarrays import Bools, Bytes, Floats
from spacemap_vtk.scenes.editable_draft import EditableDraft

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Gap between the grids, for numbers, in cells.
_GAP = 0.9
#: Least gap between the grids, in mm.
_LEAST_GAP = 3.0
#: Width of a strip of yarn colours, in cells.
_STRIP = 0.7
#: Gap before a strip, in cells.
_STRIP_GAP = 0.25
#: Largest side of a cell, in mm.
LARGEST = 4.5
#: Cells smaller than this have no lines between them, in mm.
_LEAST_LINED = 0.7
#: Every line with a multiple of this number is heavier.
_GROUP = 4


def draft_tile(draft: EditableDraft, caption: str) -> Tile:
    """Return a tile with the drawing of a draft."""
    rows = draft.size[1] + _GAP + draft.loom.shafts + _STRIP_GAP + _STRIP
    across = draft.size[0] + _GAP + draft.columns + _STRIP_GAP + _STRIP

    def gap(cell: float) -> float:
        return max(_GAP * cell, _LEAST_GAP)

    def cell_of(width: float) -> float:
        return min(width / across, (width - _LEAST_GAP) / (across - _GAP))

    def height(width: float) -> float:
        cell = cell_of(width)
        return cell * (rows - _GAP) + gap(cell)

    def draw(axes: Axes, page_style: PageStyle) -> None:
        cell = cell_of(axes.get_xlim()[1])
        _draw(axes, page_style, draft, cell, gap(cell))

    return Tile(draw, height, caption, across, across * LARGEST)


def _draw(axes: Axes, page_style: PageStyle, draft: EditableDraft, cell: float, gap: float) -> None:
    (ends, picks), loom = draft.size, draft.loom
    right, above = ends * cell + gap, picks * cell + gap
    grids = {
        "drawdown": (draft.drawdown, (0.0, 0.0)),
        "threading": (draft.marks("threading"), (0.0, above)),
        "treadling": (draft.marks("treadling"), (right, 0.0)),
    }
    if loom.liftplan is None:
        grids["tieup"] = draft.marks("tieup"), (right, above)
    for name, (marks, corner) in grids.items():
        _draw_grid(axes, page_style, name, marks, corner, cell)
    far_corner = (
        right + (draft.columns + _STRIP_GAP) * cell,
        above + (loom.shafts + _STRIP_GAP) * cell,
    )
    _draw_strip(axes, page_style, draft.warp, np.array([0.0, far_corner[1]]), cell, along=0)
    _draw_strip(axes, page_style, draft.weft, np.array([far_corner[0], 0.0]), cell, along=1)
    style: dict[str, Any] = {"fontsize": SMALL - 0.5, "color": page_style.faint, "clip_on": False}
    middle = {"ha": "center", "va": "center", **style}
    for count, begin in ((ends, 0.0), (draft.columns, right)):
        for number in _tick_numbers(count, cell):
            x = begin + (number - 0.5) * cell
            axes.text(x, above - 0.5 * gap, str(number), **middle)
    for count, begin in ((picks, 0.0), (loom.shafts, above)):
        for number in _tick_numbers(count, cell):
            y = begin + (number - 0.5) * cell
            axes.text(right - 0.5 * gap, y, str(number), **middle)


def _draw_grid(
    axes: Axes,
    page_style: PageStyle,
    name: str,
    marks: Bools,
    corner: tuple[float, float],
    cell: float,
) -> None:
    """Draw a grid whose black squares are a single shape; the first row is at the bottom."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import PathPatch, Rectangle
    from matplotlib.path import Path

    rows, columns = marks.shape
    size, back = cell * np.array([columns, rows]), "#232a33" if page_style.dark else "#ffffff"
    axes.add_patch(Rectangle(corner, *size, facecolor=back, linewidth=0))
    places = np.argwhere(marks)[:, ::-1]
    if len(places):
        turn = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
        vertices = corner + cell * (places[:, None] + turn).reshape(-1, 2)
        codes = [Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY] * len(places)
        shape = Path(vertices, codes)
        axes.add_patch(PathPatch(shape, facecolor=page_style.ink, linewidth=0, gid=name))
    fine: list[Floats] = []
    heavy: list[Floats] = []
    for count, axis in ((columns, 0), (rows, 1)):
        for number in range(count + 1):
            line = np.array([corner, corner], float)
            line[:, axis] += number * cell
            line[1, 1 - axis] += size[1 - axis]
            (heavy if number in (0, count) or number % _GROUP == 0 else fine).append(line)
    if cell >= _LEAST_LINED:
        axes.add_collection(LineCollection(fine, colors=page_style.faint, linewidths=0.2))
    frame = heavy if _GROUP * cell >= _LEAST_LINED else [heavy[0], heavy[-1]]
    axes.add_collection(
        LineCollection(frame, colors=page_style.faint, linewidths=0.45, clip_on=False)
    )


def _draw_strip(
    axes: Axes, page_style: PageStyle, colors: Bytes, corner: Floats, cell: float, along: int
) -> None:
    from matplotlib.collections import PolyCollection

    step, wide = np.zeros(2), np.zeros(2)
    step[along], wide[1 - along] = cell, _STRIP * cell
    begin = corner + np.arange(len(colors))[:, None] * step
    squares = np.stack([begin, begin + step, begin + step + wide, begin + wide], axis=1)
    edges = page_style.faint if cell >= _LEAST_LINED else "face"
    axes.add_collection(
        PolyCollection(list(squares), facecolors=colors / 255, edgecolors=edges, linewidths=0.2)
    )


def _tick_numbers(count: int, cell: float) -> list[int]:
    """Return the numbers that are written along a grid, with enough room between them."""
    step = 1
    while step * cell < 1.15 * SMALL * POINT * len(str(count)):
        step *= 2 if step > 1 else _GROUP
    return list(range(step, count + 1, step))
