"""Decide the pages of a printed draft: paper upright or across, size of the cells, where to cut."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from spacemap_vtk.draw.draft_print.content import DraftContent
from spacemap_vtk.draw.draft_print.paper import MARGIN, Box
from spacemap_vtk.draw.draft_print.settings import PAPERS
from spacemap_vtk.textile.drafts.repeats import border_depths, cut_into_bands

#: Largest side of a cell, and one that is large enough for anybody, in mm.
LARGEST_CELL, _LARGE_CELL = 4.5, 3.0
#: Width of the gaps between grids, which contain numbers of picks and shafts, in mm.
NUMBERS_WIDTH = 5.6
#: Height of the gaps between grids, which contain numbers of ends and treadles, in mm.
NUMBERS_HEIGHT = 3.4
#: Width of a strip of yarn colours, and its distance from its grid, in mm.
STRIP, STRIP_GAP = 2.2, 0.6
#: Height of the heading and of the legend of a page, in mm.
HEADING, LEGEND = 12.0, 6.0
#: Room at each side for the numbers of the pages beside it, in mm.
_NEIGHBOURS = 3.6
#: Gap between two charts, and room for the caption above a chart, in mm.
_GAP, _CAPTION = 6.0, 5.0
#: Cells of the page beside it that a page repeats at a cut.
OVERLAP = 2

#: Begin and end, from 0, of the threads on a page.
Band = tuple[int, int]


class Chart(NamedTuple):
    """A part of the drawdown that is drawn with the loom beside it, or without."""

    ends: Band
    picks: Band
    face: bool
    cell: float
    """In mm."""


@dataclass(frozen=True)
class ChartGrid:
    """The pages of a face: bands of ends times bands of picks."""

    ends: list[Band]
    picks: list[Band]
    cell: float
    face: bool

    @property
    def count(self) -> int:
        """Number of pages."""
        return len(self.ends) * len(self.picks)

    def chart(self, column: int, row: int) -> Chart:
        """Return the chart of a page."""
        return Chart(self.ends[column], self.picks[row], self.face, self.cell)


def paper_size(paper: str, across: bool) -> tuple[float, float]:
    """Return width and height of a page in mm."""
    width, height = PAPERS[paper]
    return (height, width) if across else (width, height)


def chart_box(paper: str, across: bool, several: bool) -> Box:
    """Return where a chart is on its page."""
    width, height = paper_size(paper, across)
    side = MARGIN + (_NEIGHBOURS if several else 0.0)
    top = MARGIN + HEADING + (_NEIGHBOURS if several else 0.0)
    return Box(side, top, width - 2 * side, height - top - side - LEGEND)


def beside_drawdown(content: DraftContent, face: bool) -> tuple[int, int, float, float]:
    """Return cells and mm beside the drawdown, and cells and mm above it."""
    strip = STRIP_GAP + STRIP
    if face and content.shows_loom:
        columns, shafts = content.columns, content.loom.shafts
        return columns, shafts, NUMBERS_WIDTH + strip, NUMBERS_HEIGHT + strip
    return 0, 0, NUMBERS_WIDTH + strip, NUMBERS_HEIGHT + strip


def drawn_band(band: Band, count: int) -> Band:
    """Return the threads that are drawn for a band: also some of the pages beside it."""
    return max(band[0] - OVERLAP, 0), min(band[1] + OVERLAP, count)


def chart_width(content: DraftContent, chart: Chart) -> float:
    """Return the width of a chart in mm."""
    columns, _, wide, _ = beside_drawdown(content, chart.face)
    begin, end = drawn_band(chart.ends, content.size[0])
    return (end - begin + columns) * chart.cell + wide


def fit_cell(content: DraftContent, face: bool, box: Box, ends: int, picks: int) -> float:
    """Return the largest cell with which so many ends and picks fit into a box, in mm."""
    columns, shafts, wide, high = beside_drawdown(content, face)
    return min((box.width - wide) / (ends + columns), (box.height - high) / (picks + shafts))


def place_whole_draft(
    content: DraftContent, box: Box, least: float, faces: tuple[bool, ...]
) -> list[tuple[Chart, Box]]:
    """Place charts of the whole draft in a box; empty if cells would be smaller than `least`."""
    ends, picks = content.size
    beside = [beside_drawdown(content, face) for face in faces]
    columns, shafts, wide, high = (sum(each) for each in zip(*beside, strict=True))
    gaps, count = _GAP * (len(faces) - 1), len(faces)
    caption = _CAPTION * count
    # Of two charts the first one is wider and higher: only it has threading and treadling.
    side_by_side = min(
        (box.width - wide - gaps) / (count * ends + columns),
        (box.height - beside[0][3] - _CAPTION) / (picks + beside[0][1]),
    )
    stacked = min(
        (box.width - beside[0][2]) / (ends + beside[0][0]),
        (box.height - high - caption) / (count * picks + shafts),
    )
    # Side by side they leave room for the groups below.
    is_row = side_by_side >= min(stacked, max(_LARGE_CELL, least))
    cell = min(side_by_side if is_row else stacked, max(LARGEST_CELL, least))
    if cell < least:
        return []
    charts: list[tuple[Chart, Box]] = []
    left, top = box.left, box.top + _CAPTION
    for face, (columns, shafts, wide, high) in zip(faces, beside, strict=True):
        width, height = (ends + columns) * cell + wide, (picks + shafts) * cell + high
        if is_row and charts:
            # The picks of both faces are beside each other.
            top += beside[0][1] * cell
        place = Box(left, top, width, height)
        charts.append((Chart((0, ends), (0, picks), face, cell), place))
        if is_row:
            left += width + _GAP
        else:
            top += height + _CAPTION
    return charts


def plan_charts(
    content: DraftContent, paper: str, across: bool | None, least: float, faces: tuple[bool, ...]
) -> tuple[bool, list[ChartGrid]]:
    """Return whether the paper lies across, and the pages of each face."""
    # The better direction needs fewer pages, or else has larger cells.
    choices = (False, True) if across is None else (across,)
    plans = [
        (way, [_plan_face(content, paper, way, least, face) for face in faces]) for way in choices
    ]

    def rating(plan: tuple[bool, list[ChartGrid]]) -> tuple[int, float]:
        return sum(grid.count for grid in plan[1]), -plan[1][0].cell

    return min(plans, key=rating)


def _plan_face(
    content: DraftContent, paper: str, across: bool, least: float, face: bool
) -> ChartGrid:
    ends, picks = content.size
    whole = fit_cell(content, face, chart_box(paper, across, False), ends, picks)
    if whole >= least:
        return ChartGrid([(0, ends)], [(0, picks)], min(whole, max(LARGEST_CELL, least)), face)
    box = chart_box(paper, across, True)
    columns, shafts, wide, high = beside_drawdown(content, face)
    bands = []
    for count, room, phrase in (
        (ends, (box.width - wide) / least - columns, content.borders[0]),
        (picks, (box.height - high) / least - shafts, content.borders[1]),
    ):
        most = math.floor(room + 1e-9)
        fits = count <= most
        bands.append(
            [(0, count)]
            if fits
            else cut_into_bands(border_depths(phrase), max(most - 2 * OVERLAP, 1))
        )
    widest = []
    for cut, count in zip(bands, (ends, picks), strict=True):
        drawn = (drawn_band(band, count) for band in cut)
        widest.append(max(end - begin for begin, end in drawn))
    cell = fit_cell(content, face, box, *widest)
    return ChartGrid(bands[0], bands[1], min(cell, max(LARGEST_CELL, least)), face)
