"""Set headings, paragraphs and groups with boxes to tick in columns, on as many pages as needed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from spacemap_vtk.draw.draft_print.groups import Groups
from spacemap_vtk.draw.draft_print.paper import (
    BODY,
    FAINT,
    INK,
    Box,
    Page,
    word_width,
    wrap_words,
)

#: Height of a row of text, in mm.
ROW = 4.3
#: Side of a box to tick, and the step to the next one, in mm.
_TICK, _TICK_STEP = 2.7, 3.5
#: More repetitions than this share boxes by tens.
_MOST_TICKS = 40
_TEN = 10
#: Gap between columns, in mm.
_GAP = 6.0


@dataclass(frozen=True)
class Row:
    """One row of a column: texts with their places, and boxes to tick."""

    texts: list[tuple[float, str]] = field(default_factory=list)
    ticks: list[float] = field(default_factory=list)
    is_heading: bool = False
    #: Whether the next row must be in the same column.
    keep: bool = False


def heading_rows(text: str) -> list[Row]:
    """Return the rows of a heading."""
    return [Row(keep=True), Row([(0.0, text)], is_heading=True, keep=True)]


def paragraph_rows(words: list[str], width: float) -> list[Row]:
    """Return the rows of a paragraph."""
    return [Row([(0.0, line)]) for line in wrap_words(words, width)]


def group_rows(groups: Groups, thread: str, width: float) -> list[Row]:
    """Return the rows of a sequence by groups: in short, then each group with boxes to tick."""
    lines = groups.lines()
    rows: list[Row] = []
    if len(lines) > 1 and groups.has_repeats:
        rows += paragraph_rows(["In short:", *groups.write_phrase()], width)
        rows.append(Row(keep=True))
    labels = [
        f"{thread if line.end == line.begin + 1 else thread + 's'} {groups.write_range(line)}"
        for line in lines
    ]
    left = max(map(word_width, labels)) + 2.0
    for label, line in zip(labels, lines, strict=True):
        # A group of one token needs no box for each thread.
        ticks = line.count if len(line.tokens) > 1 else 1
        rows += _line_rows(label, left, ticks, groups.write_line(line), width)
    return rows


def _line_rows(label: str, left: float, count: int, words: list[str], width: float) -> list[Row]:
    """Return the rows of a group: its threads, a box for each repetition, its tokens."""
    ticks = count
    if count > _MOST_TICKS:
        ticks = math.ceil(count / _TEN)
        words = [*words, f"(a box for {_TEN})"]
    room = width - left
    per_row = max(1, int(room / _TICK_STEP))
    rows = []
    for begin in range(0, ticks, per_row):
        places = [left + _TICK_STEP * k for k in range(min(per_row, ticks - begin))]
        rows.append(Row(ticks=places, keep=True))
    # Text follows the last boxes if most of the row is left, else it begins a row of its own.
    used = len(rows[-1].ticks) * _TICK_STEP + 1.0
    indent = used if used < 0.5 * room else 0.0
    first, *rest = wrap_words(words, room - indent)
    if indent:
        rest = wrap_words(" ".join(rest).split(" "), room) if rest else []
        rows[-1].texts.append((left + indent, first))
    else:
        rest = wrap_words(words, room)
    rows += [Row([(left, text)], keep=True) for text in rest]
    rows[0].texts.insert(0, (0.0, label))
    rows[-1] = Row(rows[-1].texts, rows[-1].ticks)
    return rows


@dataclass
class Flow:
    """Rows in columns over pages."""

    rows: list[Row]
    #: Room on the first page, and on each further one.
    first: Box
    further: Box
    columns: int = 2

    @property
    def column_width(self) -> float:
        """Width of a column in mm."""
        return column_width(self.further.width, self.columns)

    def pages(self) -> list[list[list[Row]]]:
        """Return the columns of rows of each page; the first page may be empty."""
        found: list[list[list[Row]]] = []
        rows = list(self.rows)
        while rows or not found:
            box = self.further if found else self.first
            most = max(0, int(box.height / ROW))
            columns = []
            for _ in range(self.columns):
                count = _break_at(rows, most)
                if not count and found:
                    count = most  # rows that belong together are longer than a column
                column, rows = rows[:count], rows[count:]
                while column and not (column[0].texts or column[0].ticks):
                    column = column[1:]
                columns.append(column)
            found.append(columns)
        return found


def column_width(width: float, columns: int) -> float:
    """Return the width of each of some columns in mm."""
    return (width - _GAP * (columns - 1)) / columns


def _break_at(rows: list[Row], most: int) -> int:
    """Return how many rows go into a column, so that none is parted from what it belongs to."""
    if len(rows) <= most:
        return len(rows)
    count = most
    while count and rows[count - 1].keep:
        count -= 1
    return count


def draw_columns(page: Page, box: Box, columns: list[list[Row]]) -> None:
    """Draw the columns of a page."""
    width = column_width(box.width, len(columns))
    ticks = []
    for number, rows in enumerate(columns):
        left = box.left + number * (width + _GAP)
        for k, row in enumerate(rows):
            base = box.top + (k + 0.75) * ROW
            for x, text in row.texts:
                size = BODY + 1.5 if row.is_heading else BODY
                page.write(left + x, base, text, size, bold=row.is_heading)
            ticks += [(left + x, base - _TICK + 0.35) for x in row.ticks]
    corners = [
        ((x + i, y + j), (x + k, y + m))
        for x, y in ticks
        for i, j, k, m in (
            (0, 0, _TICK, 0),
            (_TICK, 0, _TICK, _TICK),
            (_TICK, _TICK, 0, _TICK),
            (0, _TICK, 0, 0),
        )
    ]
    page.draw_lines(corners, 0.5, INK, name="ticks")


def draw_rule(page: Page, y: float) -> None:
    """Draw a line across a page."""
    body = page.body
    page.draw_lines([((body.left, y), (body.right, y))], 0.5, FAINT)
