"""Draw a part of a draft in cells: drawdown, threading, tie-up, treadling, floats and colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk.draw.draft_print.content import DraftContent, color_letter
from spacemap_vtk.draw.draft_print.layout import (
    NUMBERS_HEIGHT,
    NUMBERS_WIDTH,
    STRIP,
    STRIP_GAP,
    Band,
    Chart,
    beside_drawdown,
    drawn_band,
)
from spacemap_vtk.draw.draft_print.paper import FAINT, INK, NUMBER, Box, Page, word_width
from spacemap_vtk.ndarrays import Bools, Bytes, Floats, Ints

#: Colour of cells in which the end is on top, without yarn colours.
MARK = "#3a424d"
#: Colour of a float's mark, in colour.
_FLOAT = "#c8102e"
#: Every line after this many threads is heavier, and after twice as many once more.
GROUP = 5
#: Widths of the lines between cells, in points: between any, of a group, of two groups.
_LINES = 0.15, 0.4, 0.8
#: Smallest numbers in a cell, in points.
_LEAST_NUMBER = 4.6
#: Width of a digit over its size.
_DIGIT = 0.636 * 25.4 / 72
#: Opacity of the paper over cells of the page beside it.
_FADE = 0.62


class ChartStyle(NamedTuple):
    """How charts are drawn."""

    #: Whether without colours.
    mono: bool = False
    #: Whether end 1 is at the right and pick 1 at the top, beside the tie-up.
    from_top: bool = False


@dataclass(frozen=True)
class _Axis:
    """The threads of a chart along x or y, with those beyond its cuts."""

    #: Threads of the chart.
    band: Band
    #: Threads that are drawn.
    drawn: Band
    #: Place of the first drawn cell, and side of a cell, in mm.
    origin: float
    cell: float
    #: Whether thread numbers fall along the axis.
    falls: bool
    #: Number of the thread before thread 0.
    offset: int = 0

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.drawn[1] - self.drawn[0]

    @property
    def order(self) -> Ints:
        """Threads of the cells, along the axis."""
        threads = np.arange(*self.drawn)
        return threads[::-1] if self.falls else threads

    @property
    def end(self) -> float:
        """Place behind the last cell."""
        return self.origin + self.count * self.cell

    def place(self, thread: Any) -> Any:
        """Return the place of a thread's first side by number; its middle is at number + 0.5."""
        begin, end = self.drawn
        return self.origin + self.cell * ((end - thread) if self.falls else (thread - begin))

    def ink(self, thread: int) -> str:
        """Return the colour of text at a thread: grey beyond the cuts."""
        return INK if self.band[0] <= thread < self.band[1] else "#a9b0b9"

    def first(self, thread: int) -> float:
        """Return the coordinate at which a thread's cell begins, in mm."""
        return float(min(self.place(thread), self.place(thread + 1)))

    @property
    def cuts(self) -> list[float]:
        """Places where the chart is cut."""
        pairs = zip(self.band, self.drawn, strict=True)
        return [self.place(own) for own, drawn in pairs if own != drawn]

    @property
    def overlaps(self) -> list[tuple[float, float]]:
        """Place and length of the cells beyond each cut."""
        found = []
        for own, drawn in zip(self.band, self.drawn, strict=True):
            if own != drawn:
                first, last = sorted((self.place(own), self.place(drawn)))
                found.append((first, last - first))
        return found


def draw_chart(
    page: Page, content: DraftContent, chart: Chart, corner: tuple[float, float], style: ChartStyle
) -> Box:
    """Draw a chart with its left upper corner at a place; return what it covers."""
    return _ChartPainter(page, content, chart, corner, style).draw()


class _ChartPainter:
    """Draws the parts of one chart."""

    def __init__(
        self,
        page: Page,
        content: DraftContent,
        chart: Chart,
        corner: tuple[float, float],
        style: ChartStyle,
    ) -> None:
        self.page, self.content, self.chart, self.style = page, content, chart, style
        cell, (left, top) = chart.cell, corner
        _, shafts, _, above = beside_drawdown(content, chart.face)
        self.has_loom = chart.face and content.shows_loom
        self.top = top
        # The reverse is seen after the cloth is turned over, about an axis along the warp.
        drawn = [
            drawn_band(band, count)
            for band, count in zip((chart.ends, chart.picks), content.size, strict=True)
        ]
        offsets = content.first[0] - 1, content.first[1] - 1
        falls = style.from_top == chart.face
        self.x = _Axis(chart.ends, drawn[0], left, cell, falls, offsets[0])
        cloth_top = top + above + shafts * cell
        self.y = _Axis(chart.picks, drawn[1], cloth_top, cell, not style.from_top, offsets[1])
        self.threading_top = top + STRIP + STRIP_GAP
        self.treadling_left = self.x.end + NUMBERS_WIDTH
        self.mono = style.mono or (
            content.draft.warp.colors is None and content.draft.weft.colors is None
        )

    def draw(self) -> Box:
        """Draw everything; return what it covers."""
        cell = self.chart.cell
        columns = self.content.columns if self.has_loom else 0
        strip_left = self.treadling_left + columns * cell + STRIP_GAP
        self._draw_drawdown()
        # Between yarns in colour, their sides are drawn.
        self._draw_grid(self.x, self.y, fine=self.mono)
        if self.has_loom:
            self._draw_loom()
        self._draw_strips(strip_left)
        self._draw_floats()
        self._draw_cuts(strip_left + STRIP)
        self._draw_numbers()
        left = self.x.origin
        return Box(left, self.top, strip_left + STRIP - left, self.y.end - self.top)

    def _draw_drawdown(self) -> None:
        ends, picks = self.x.order, self.y.order
        up = self.content.on_face(self.chart.face)[np.ix_(picks, ends)]
        corner = self.x.origin, self.y.origin
        box = Box(*corner, self.x.end - corner[0], self.y.end - corner[1])
        if self.mono:
            self.page.fill(self._cells(up, corner), MARK, name="drawdown")
        else:
            numbers = np.where(
                up, self.content.color_numbers[0][ends], self.content.color_numbers[1][picks, None]
            )
            for number in np.unique(numbers):
                color = self.content.color_table[number] / 255.0
                self.page.fill(self._cells(numbers == number, corner), color)
            edges = interlacing_edges(up) * self.chart.cell + np.array(corner)
            self.page.draw_lines(edges, 0.35, _contrasting_grey(self.content.color_table))
        self.page.draw_box(box)

    def _cells(self, mask: Bools, corner: tuple[float, float]) -> Floats:
        boxes = merge_cells(mask) * self.chart.cell
        boxes[:, :2] += corner
        return boxes

    def _draw_grid(self, x: _Axis, y: _Axis, fine: bool = True) -> None:
        """Draw the lines between cells, heavier after groups of threads or shafts."""
        lines: list[list[Any]] = [[], [], []]
        for axis, across in ((x, y), (y, x)):
            for thread in range(axis.drawn[0], axis.drawn[1] + 1):
                number = axis.offset + thread
                weight = (number % GROUP == 0) + (number % (2 * GROUP) == 0)
                place = axis.place(thread)
                ends = (place, across.origin), (place, across.end)
                lines[weight].append(ends if axis is x else [point[::-1] for point in ends])
        for weight, width in enumerate(_LINES):
            if weight or fine:
                self.page.draw_lines(lines[weight], width, FAINT)

    def _draw_loom(self) -> None:
        content, cell = self.content, self.chart.cell
        loom = content.loom
        rows, across = (0, loom.shafts), (0, content.columns)
        shafts = _Axis(rows, rows, self.threading_top, cell, falls=True)
        columns = _Axis(across, across, self.treadling_left, cell, falls=False)
        self._draw_marks(
            [(end, number) for end in self.x.order for number in loom.threading[end]],
            (self.x, shafts),
            "threading",
        )
        pressed = content.treadling
        self._draw_marks(
            [(pick, number) for pick in self.y.order for number in pressed[pick]],
            (self.y, columns),
            "treadling",
        )
        self._draw_grid(self.x, shafts)
        self._draw_grid(columns, self.y)
        self._label_loom(shafts, columns)
        if content.has_treadles:
            self._draw_tieup(columns, shafts)

    def _draw_marks(
        self, marks: list[tuple[int, int]], axes: tuple[_Axis, _Axis], name: str
    ) -> None:
        """Draw threads' shafts or treadles: as numbers if they fit into cells, else as squares."""
        threads, numbers = axes
        cell = self.chart.cell
        if not marks:
            return
        places = np.array([(threads.first(t), numbers.first(n - 1)) for t, n in marks])
        if threads is self.y:
            places = places[:, ::-1]
        boxes = np.column_stack([places, np.full((len(places), 2), cell)])
        digits = len(str(numbers.count))
        size = min(5.0 * cell / 2.0, 8.0, (cell - 0.2) / (digits * _DIGIT))
        if size < _LEAST_NUMBER or (name == "treadling" and not self.content.has_treadles):
            self.page.fill(boxes, MARK, name=name)
            return
        self.page.fill(boxes, "#dfe4ea", name=name)
        for (x, y), (thread, number) in zip(places + 0.5 * cell, marks, strict=True):
            self.page.write(x, y, str(number), size, threads.ink(thread), centred=True)

    def _draw_tieup(self, columns: _Axis, shafts: _Axis) -> None:
        """Draw ties as dots if the shafts rise, as crosses if they sink."""
        cell, loom = self.chart.cell, self.content.loom
        ties = [
            (columns.place(treadle + 0.5), shafts.place(shaft - 0.5))
            for treadle, tied in enumerate(loom.tieup)
            for shaft in tied
        ]
        if loom.rising:
            self.page.draw_dots(ties, 0.33 * cell)
        else:
            arms = 0.3 * cell * np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]])
            lines = np.array(ties).reshape(-1, 1, 1, 2) + arms
            self.page.draw_lines(lines, 0.9)
        self._draw_grid(columns, shafts)

    def _label_loom(self, shafts: _Axis, columns: _Axis) -> None:
        middle = self.x.end + 0.5 * NUMBERS_WIDTH
        size = min(NUMBER, 5.0 * self.chart.cell / 2.0)
        for shaft in range(1, shafts.count + 1):
            y = shafts.place(shaft - 0.5)
            self.page.write(middle, y, str(shaft), size, FAINT, centred=True)
        room = word_width(str(columns.count), size) + 0.3
        step = next(k for k in (1, 2, 5, 10) if k * self.chart.cell >= room or k == 10)
        for column in range(step, columns.count + 1, step):
            x = columns.place(column - 0.5)
            y = self.y.origin - 0.5 * NUMBERS_HEIGHT
            self.page.write(x, y, str(column), size, FAINT, centred=True)

    def _draw_strips(self, left: float) -> None:
        """Draw the yarn of each thread: its colour, or its letter without colours."""
        cell = self.chart.cell
        for axis, family in ((self.x, 0), (self.y, 1)):
            numbers = self.content.color_numbers[family][axis.order]
            places = axis.origin + cell * np.arange(axis.count)
            across = self.top if family == 0 else left
            columns = [places, np.full_like(places, across)]
            sides = [np.full_like(places, cell), np.full_like(places, STRIP)]
            if family == 1:
                columns, sides = columns[::-1], sides[::-1]
            boxes = np.column_stack([*columns, *sides])
            if self.mono:
                self._write_letters(axis, numbers, boxes)
            else:
                for number in np.unique(numbers):
                    color = self.content.color_table[number] / 255.0
                    self.page.fill(boxes[numbers == number], color)
            edges = boxes[1:, [0, 1, 0, 1]]
            edges[:, 3 if family == 0 else 2] += STRIP
            self.page.draw_lines(edges, 0.15, FAINT)
            self.page.draw_box(
                Box(
                    boxes[0, 0],
                    boxes[0, 1],
                    boxes[-1, 0] + boxes[-1, 2] - boxes[0, 0],
                    boxes[-1, 1] + boxes[-1, 3] - boxes[0, 1],
                ),
                0.3,
                FAINT,
            )

    def _write_letters(self, axis: _Axis, numbers: Ints, boxes: Floats) -> None:
        if len(self.content.color_table) == 1:
            return
        for number, (x, y, width, height) in zip(numbers, boxes, strict=True):
            self.page.write(
                x + 0.5 * width,
                y + 0.5 * height,
                color_letter(number),
                5.0,
                centred=True,
            )

    def _draw_floats(self) -> None:
        """Mark long floats by lines with a dot at each end, on white so that they show on black."""
        cell = self.chart.cell
        for family, (across, along) in enumerate(((self.x, self.y), (self.y, self.x))):
            floats = self.content.long_floats(family, self.chart.face)
            last = floats.begin + floats.length
            shown = (floats.yarn >= across.drawn[0]) & (floats.yarn < across.drawn[1])
            shown &= (floats.begin < along.drawn[1]) & (last > along.drawn[0])
            middle = across.place(floats.yarn[shown] + 0.5)
            begin, last = floats.begin[shown], last[shown]
            starts, ends = begin >= along.drawn[0], last <= along.drawn[1]
            first = along.place(np.where(starts, begin + 0.5, along.drawn[0]))
            final = along.place(np.where(ends, last - 0.5, along.drawn[1]))
            lines = np.stack([middle, first, middle, final], axis=-1).reshape(-1, 2, 2)
            dots = np.concatenate([lines[starts, 0], lines[ends, 1]])
            if family == 1:
                lines, dots = lines[..., ::-1], dots[..., ::-1]
            color = INK if self.mono else _FLOAT
            self.page.draw_lines(lines, 2.4 * cell / 2.0, "white")
            self.page.draw_dots(dots, 0.38 * cell, "white")
            name = ("floats-warp", "floats-weft")[family]
            self.page.draw_lines(lines, 1.1 * cell / 2.0, color, name=name)
            self.page.draw_dots(dots, 0.25 * cell, color)

    def _draw_cuts(self, right: float) -> None:
        """Fade the cells beyond each cut, and draw the cut."""
        fades, cuts = [], []
        for first, length in self.x.overlaps:
            fades.append((first, self.top, length, self.y.end - self.top))
        for first, length in self.y.overlaps:
            fades.append((self.x.origin, first, right - self.x.origin, length))
        for place in self.x.cuts:
            cuts.append(((place, self.top - 1.5), (place, self.y.end + 1.5)))
        for place in self.y.cuts:
            cuts.append(((self.x.origin - 1.5, place), (right + 1.5, place)))
        self.page.fill(fades, "white", alpha=_FADE)
        self.page.draw_lines(cuts, 0.9, INK, dashes=(4.0, 2.0))

    def _draw_numbers(self) -> None:
        """Write the number of every fifth end and pick."""
        for axis, family in ((self.x, 0), (self.y, 1)):
            for thread in range(*axis.band):
                number = axis.offset + thread + 1
                if number % GROUP:
                    continue
                place, text = axis.place(thread + 0.5), str(number)
                if family == 0:
                    y = self.y.origin - 0.5 * NUMBERS_HEIGHT
                    self.page.write(place, y, text, NUMBER, centred=True)
                else:
                    self.page.write(
                        self.x.end + 0.5 * NUMBERS_WIDTH, place, text, NUMBER, centred=True
                    )


def merge_cells(mask: Bools) -> Floats:
    """Cover the True cells of a mask with few rectangles (n, 4): column, row, columns, rows."""
    row, begin, end = _find_runs(mask)
    order = np.lexsort((row, end, begin))
    row, begin, end = row[order], begin[order], end[order]
    # Equal runs of rows that follow each other become one rectangle.
    new = np.ones(len(row), bool)
    new[1:] = (begin[1:] != begin[:-1]) | (end[1:] != end[:-1]) | (row[1:] != row[:-1] + 1)
    first = np.flatnonzero(new)
    rows = np.diff(np.append(first, len(row)))
    columns = (end - begin)[first]
    return np.column_stack([begin[first], row[first], columns, rows]).astype(float)


def interlacing_edges(up: Bools) -> Floats:
    """Return the visible sides of yarns as lines (n, 2, 2), in cells; `up`: the end is on top."""
    lines = []
    # An end on top has sides at its left and right, a pick on top has sides above and below.
    for on_top, is_pick in ((up, False), (~up.T, True)):
        sides = np.pad(on_top, ((0, 0), (1, 0))) | np.pad(on_top, ((0, 0), (0, 1)))
        place, begin, end = _find_runs(sides.T)
        line = np.stack([place, begin, place, end], axis=-1).reshape(-1, 2, 2)
        lines.append(line[..., ::-1] if is_pick else line)
    return np.concatenate(lines)


def _find_runs(mask: Bools) -> tuple[Ints, Ints, Ints]:
    """Return row, begin and end of all runs of True in the rows of a mask."""
    steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return row, begin, end


def _contrasting_grey(colors: Bytes) -> str:
    """Return the grey that differs most from all colours, by their luminance."""
    luminance = colors @ np.array([0.2126, 0.7152, 0.0722])
    greys = np.arange(0, 256, 17)
    best = greys[np.abs(greys[:, None] - luminance).min(axis=1).argmax()]
    return "#{0:02x}{0:02x}{0:02x}".format(int(best))
