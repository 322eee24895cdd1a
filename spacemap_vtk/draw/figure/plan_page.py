"""Draw a weaver's plan on a page: its tables, and the stripes of warp and weft in their colours.

The page is 180 mm wide, so that it fits the printed area of A4 and of letter paper.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.draw.figure.page import TEXT, PageStyle, Tile, lay_out_page, text_width
from spacemap_vtk.scenes.plan import ScenePlan
from spacemap_vtk.scenes.plan_tables import PlanTable, Quantity, plan_tables

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Height of a row of a table, in mm.
_ROW = 4.3
#: Font size of a table's title, in points.
_TITLE = 9.5
#: Height of a table's title, in mm.
_TITLE_HEIGHT = 6.0
#: Gap between two columns of a table, in mm.
_GAP = 3.0
#: Width of the labels of a table of pairs, in mm.
_LABELS = 36.0
#: Width and height of the sample of a colour, in mm.
_SWATCH = 4.5, 2.8
#: Gap below a table, in mm.
_BETWEEN = 2.0
#: Share of the room that text fills at most, because fonts on the screen are wider than measured.
_FILLED = 0.94
#: Most rows of a narrow table below each other; the others continue beside them.
_MOST_ROWS = 30
#: Number of narrow tables in a row.
_NARROW = 4
#: Height of the stripes of warp and weft, in mm.
_STRIPES = 5.0
#: Most stripes of colour that are drawn; more are finer than a dot.
_MOST_STRIPES = 4000
_COLOR = re.compile("#[0-9a-f]{6}")


def draw_plan(plan: ScenePlan, page_style: PageStyle | None = None) -> Figure:
    """Return a figure with all tables of a plan."""
    style = page_style or PageStyle(width=180.0, dpi=150.0)
    units = plan.settings.units
    cloth, warp, weft, yarns, *narrow = [
        _Table.from_plan(table, units) for table in plan_tables(plan)
    ]
    assumed = [narrow.pop()] if plan.assumed else []
    rows: list[list[Tile]] = [
        [_title_tile(plan)],
        [_stripes_tile(plan)],
        _tile_row([[cloth, weft], [warp]]),
        _tile_row([[yarns]]),
    ]
    parts = [part for table in narrow for part in table.parts()]
    for first in range(0, len(parts), _NARROW):
        chosen = [[part] for part in parts[first : first + _NARROW]]
        rows.append(_tile_row([*chosen, *([] for _ in range(_NARROW - len(chosen)))]))
    rows += [_tile_row([[table]]) for table in assumed]
    return lay_out_page(rows, style)


@dataclass(frozen=True)
class _Table:
    """A table of texts on the page."""

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]
    #: Whether each column is aligned to the right.
    right: tuple[bool, ...]

    @classmethod
    def from_plan(cls, table: PlanTable, units: str) -> _Table:
        right = tuple(
            any(isinstance(row[column], (int, Quantity)) for row in table.rows)
            for column in range(len(table.rows[0]))
        )
        return cls(table.title, table.headings, table.texts(units), right)

    def parts(self) -> Iterator[_Table]:
        """Yield parts with few rows, to be drawn beside each other."""
        for first in range(0, len(self.rows), _MOST_ROWS):
            title = self.title if first == 0 else f"{self.title}, continued"
            yield replace(self, title=title, rows=self.rows[first : first + _MOST_ROWS])

    def lines(self, width: float) -> list[tuple[str, ...]]:
        """Return the rows with texts wrapped to the width; a wrapped row is several lines."""
        if self.headings:
            return self.rows
        room = width if len(self.rows[0]) == 1 else width - _LABELS
        found = []
        for row in self.rows:
            text = f"• {row[0]}" if len(row) == 1 else row[-1]
            first, *more = _wrap(text, room)
            found.append((*row[:-1], first))
            found += [(*("" for _ in row[:-1]), text) for text in more]
        return found

    def height(self, width: float) -> float:
        return _TITLE_HEIGHT + _ROW * (len(self.lines(width)) + bool(self.headings))

    def draw(self, axes: Axes, style: PageStyle, top: float, width: float) -> None:
        """Draw the table below a height."""
        axes.text(
            0.0,
            top - 4.0,
            self.title,
            fontsize=_TITLE,
            fontweight="bold",
            color=style.ink,
            clip_on=False,
        )
        axes.plot([0.0, width], [top - 5.2] * 2, color=style.faint, linewidth=0.5)
        y = top - _TITLE_HEIGHT - 0.72 * _ROW
        places = self._places(width)
        if self.headings:
            self._draw_row(axes, style, y, self.headings, places, faint=True)
            y -= _ROW
        for row in self.lines(width):
            is_sum = row[0] in ("all", "repeat") and len(self.headings) > 0
            self._draw_row(axes, style, y, row, places, bold=is_sum)
            y -= _ROW

    def _places(self, width: float) -> list[float]:
        """Return where each column begins, or ends if it is aligned to the right."""
        if not self.headings:
            return [0.0] if len(self.rows[0]) == 1 else [0.0, _LABELS]
        columns = list(zip(self.headings, *self.rows, strict=True))
        widths = [max(map(_cell_width, column)) for column in columns]
        spare = width - sum(widths)
        gap = min(max(spare / max(len(widths) - 1, 1), 0.0), 4 * _GAP)
        places, x = [], 0.0
        for size, right in zip(widths, self.right, strict=True):
            places.append(x + size if right else x)
            x += size + gap
        return places

    def _draw_row(
        self,
        axes: Axes,
        style: PageStyle,
        y: float,
        row: Sequence[str],
        places: list[float],
        faint: bool = False,
        bold: bool = False,
    ) -> None:
        from matplotlib.patches import Rectangle

        pairs = not self.headings and len(row) > 1
        for column, (text, x) in enumerate(zip(row, places, strict=True)):
            right = bool(self.headings) and self.right[column]
            color = style.faint if faint or (pairs and column == 0) else style.ink
            if _COLOR.fullmatch(text):
                axes.add_patch(
                    Rectangle(
                        (x, y - 0.4), *_SWATCH, facecolor=text, edgecolor=style.faint, linewidth=0.3
                    )
                )
                x += _SWATCH[0] + 1.5
            more: dict[str, Any] = {"fontweight": "bold"} if bold else {}
            align = "right" if right else "left"
            axes.text(
                x, y, text.strip(), fontsize=TEXT, color=color, ha=align, clip_on=False, **more
            )


_width_of = lru_cache(2000)(text_width)


def _cell_width(text: str) -> float:
    swatch = _SWATCH[0] + 1.5 if _COLOR.fullmatch(text) else 0.0
    return _width_of(text) / _FILLED + swatch


def _wrap(text: str, width: float) -> list[str]:
    """Wrap a text to a width in mm."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _width_of(longer) > _FILLED * width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _tile_row(columns: Sequence[Sequence[_Table]]) -> list[Tile]:
    """Return tiles of equal height with tables below each other."""

    def height(width: float) -> float:
        return max(sum(table.height(width) + _BETWEEN for table in tables) for tables in columns)

    def tile(tables: Sequence[_Table]) -> Tile:
        def draw(axes: Axes, style: PageStyle) -> None:
            width, top = axes.get_xlim()[1], axes.get_ylim()[1]
            for table in tables:
                table.draw(axes, style, top, width)
                top -= table.height(width) + _BETWEEN

        return Tile(draw, height, has_letter=False)

    return [tile(tables) for tables in columns]


def _title_tile(plan: ScenePlan) -> Tile:
    units, project = plan.settings.units, plan.project
    size = " x ".join(
        Quantity(each, "width").text(units)
        for each in (project.finished_width, project.finished_length)
    )
    pieces = project.request.pieces
    subtitle = f"{pieces} pieces of {size}" if pieces > 1 else size

    def draw(axes: Axes, style: PageStyle) -> None:
        top = axes.get_ylim()[1]
        axes.text(0.0, top - 5.0, plan.title, fontsize=13.0, fontweight="bold", color=style.ink)
        axes.text(0.0, top - 10.0, subtitle, fontsize=_TITLE, color=style.faint)

    return Tile(draw, lambda width: 11.0, has_letter=False)


def _stripes_tile(plan: ScenePlan) -> Tile:
    """Return a tile with the colours of all ends, and of the picks of a piece, side by side."""
    bands = []
    for family, count in enumerate((plan.project.ends, plan.project.picks)):
        order = plan.project.orders[family]
        colors = np.array([color for color, _ in order], np.uint8)
        once = np.repeat(colors, [number for _, number in order], axis=0)
        which = np.linspace(0, count - 1, min(count, _MOST_STRIPES)).round().astype(np.intp)
        bands.append(once[which % len(once)])

    def draw(axes: Axes, style: PageStyle) -> None:
        width, top = axes.get_xlim()[1], axes.get_ylim()[1]
        label = 10.0
        for number, (name, band) in enumerate(zip(("warp", "weft"), bands, strict=True)):
            low = top - (number + 1) * _STRIPES - number * 1.2
            axes.text(
                0.0, low + 0.5 * _STRIPES, name, fontsize=TEXT, color=style.faint, va="center"
            )
            axes.imshow(
                band[None],
                extent=(label, width, low, low + _STRIPES),
                aspect="auto",
                interpolation="antialiased",
                zorder=0,
            )
        axes.set(xlim=(0.0, width), ylim=(0.0, top))

    return Tile(draw, lambda width: 2 * _STRIPES + 1.2, has_letter=False)
