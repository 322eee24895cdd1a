"""Make the pages of a printed draft."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from spacemap_vtk.draw.draft_print.chart import GROUP, ChartStyle, draw_chart
from spacemap_vtk.draw.draft_print.content import (
    DraftContent,
)
from spacemap_vtk.draw.draft_print.cover import (
    describe_limit,
    draft_texts,
    draw_cover,
    draw_overview,
    draw_whole_draft,
    face_name,
    has_more_notes,
)
from spacemap_vtk.draw.draft_print.group_flow import (
    Flow,
    Row,
    column_width,
    draw_columns,
    draw_rule,
)
from spacemap_vtk.draw.draft_print.layout import (
    HEADING,
    ChartGrid,
    chart_box,
    chart_width,
    drawn_band,
    paper_size,
    place_whole_draft,
    plan_charts,
)
from spacemap_vtk.draw.draft_print.listing import list_draft, list_notes
from spacemap_vtk.draw.draft_print.page_map import SMALL_MAP, draw_small_map
from spacemap_vtk.draw.draft_print.paper import (
    BODY,
    FAINT,
    NUMBER,
    PAGE_NUMBER,
    Box,
    Page,
    shorten_text,
)
from spacemap_vtk.draw.draft_print.settings import FACES, STARTS, PrintSettings
from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.loom import Loom

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Whether the paper lies across; None: whichever needs fewer pages.
_ACROSS = {None: None, "portrait": False, "landscape": True}
#: Most pages of a printed draft.
MOST_PAGES = 200


class DraftSheet:
    """A draft, laid out on pages that are drawn one after another."""

    def __init__(
        self, draft: Draft, settings: PrintSettings, title: str = "", remarks: Sequence[str] = ()
    ) -> None:
        self.settings = settings
        self.title = draft.title or title or "Draft"
        part, first = settings.select(draft)
        whole = None if part.size == draft.size else draft.size
        derived = draft.loom == Loom.from_drawdown(draft.drawdown)
        cell = 1e3 * settings.cell
        self.content = DraftContent(part, cell, settings.limits(part), first, whole, derived)
        self._style = ChartStyle(settings.mono, settings.start == STARTS[1])
        self._remarks = [*remarks, *self._own_remarks()]
        self._across, grids = plan_charts(
            self.content,
            settings.paper,
            _ACROSS[settings.orientation],
            cell,
            FACES[settings.faces],
        )
        self._refuse(1 + sum(grid.count for grid in grids))
        upright = paper_size(settings.paper, False)
        self._cover = Page(upright)
        room = self._draw_cover()
        charts = place_whole_draft(self.content, room, cell, FACES[settings.faces])
        draw_whole_draft(self._cover, self.content, charts, self._style)
        bottom = max((box.bottom + 4.0 for _, box in charts), default=room.bottom)
        left = Box(room.left, bottom, room.width, max(room.bottom - bottom, 0.0))
        #: Pages of charts; none if the whole draft is on the first page.
        self.grids: list[ChartGrid] = [] if charts else grids
        body = self._cover.body
        further = Box(body.left, body.top + HEADING, body.width, body.height - HEADING - 2.0)
        flow = Flow(self._listing(), left, further)
        self._flow, self._columns = flow, flow.pages()
        self.count = len(self._columns) + sum(grid.count for grid in self.grids)
        self._refuse(self.count)
        #: Numbers of the pages that are drawn.
        self.numbers = settings.select_pages(self.count)
        self._room = room

    def pages(self) -> Iterator[tuple[int, Figure]]:
        """Draw the requested pages one after another, with their numbers."""
        for number in self.numbers:
            yield number, self._draw_page(number)

    def _draw_page(self, number: int) -> Figure:
        texts = len(self._columns)
        first_pages = []
        first_page = texts + 1
        for grid in self.grids:
            first_pages.append(first_page)
            first_page += grid.count
        if number == 1:
            return self._finish_cover(first_pages)
        if number <= texts:
            page = Page(paper_size(self.settings.paper, False))
            self._draw_heading(page, "Groups to mark off", number)
            draw_columns(page, self._flow.further, self._columns[number - 1])
            return page.figure
        index = max(k for k, first in enumerate(first_pages) if first <= number)
        grid = self.grids[index]
        row, column = divmod(number - first_pages[index], len(grid.ends))
        return self._draw_chart_page(grid, column, row, first_pages[index])

    def _finish_cover(self, first_pages: list[int]) -> Figure:
        if self.grids:
            draw_overview(
                self._cover, self.content, self._room, self.grids, first_pages, self._style
            )
        draw_columns(self._cover, self._flow.first, self._columns[0])
        self._write_page_number(self._cover, 1)
        return self._cover.figure

    def _listing(self) -> list[Row]:
        body = self._cover.body
        rows = list_draft(self.content, column_width(body.width, 2))
        if has_more_notes(self.content, body.width):
            rows += list_notes(self.content, column_width(body.width, 2))
        return rows

    def _own_remarks(self) -> list[str]:
        content = self.content
        remarks = [describe_limit(self.settings.float_limit).capitalize() + "."]
        if not content.shows_loom:
            treadles = f" and {content.loom.treadles} treadles" if content.has_treadles else ""
            where = "they are listed by groups" if content.lists_loom else "they are left out"
            remarks.append(
                f"With {content.loom.shafts} shafts{treadles} threading and treadling do not fit "
                f"beside the drawdown; {where}."
            )
        return remarks

    def _refuse(self, count: int) -> None:
        if count > MOST_PAGES:
            ends, picks = self.content.size
            raise InputError(
                f"the printed draft of {ends} x {picks} threads has {count} pages",
                allowed=f"up to {MOST_PAGES} pages",
                cure="Print a part, for example with --ends 1-200 --picks 1-200, or one face with "
                "--faces face.",
            )

    def _draw_cover(self) -> Box:
        content = self.content
        subtitle = "   ".join(draft_texts(content)) or "Weaver's draft"
        return draw_cover(
            self._cover, content, self.title, subtitle, self._remarks, self._draw_legend
        )

    def _write_page_number(self, page: Page, number: int) -> None:
        body = page.body
        text = f"page {number} of {self.count}"
        page.write(body.right, body.top + 5.0, text, right=True)

    def _draw_heading(self, page: Page, subtitle: str, number: int) -> None:
        body = page.body
        size = BODY + 2.5
        title = shorten_text(self.title, body.width - PAGE_NUMBER - SMALL_MAP, size, bold=True)
        page.write(body.left, body.top + 4.5, title, size, bold=True)
        page.write(body.left, body.top + 9.0, subtitle)
        self._write_page_number(page, number)
        draw_rule(page, body.top + 10.5)

    def _draw_legend(self, page: Page) -> None:
        """Explain the signs at the foot of a page."""
        body = page.body
        parts = [f"lines are heavier every {GROUP} and {2 * GROUP} threads"]
        if self.content.shows_loom:
            treadle = " and treadle 1 are" if self.content.has_treadles else " is"
            parts.append(f"shaft 1{treadle} next to the drawdown")
        parts.append(f"●–● {describe_limit(self.settings.float_limit)}")
        page.write(body.left, body.bottom - 0.8, ";  ".join(parts), NUMBER + 0.5, FAINT)

    def _draw_chart_page(self, grid: ChartGrid, column: int, row: int, first_page: int) -> Figure:
        content, settings = self.content, self.settings
        page = Page(paper_size(settings.paper, self._across))
        number = first_page + row * len(grid.ends) + column
        chart = grid.chart(column, row)
        ends, picks = (
            f"{first + begin}–{first + end - 1}"
            for first, (begin, end) in zip(content.first, (chart.ends, chart.picks), strict=True)
        )
        self._draw_heading(page, f"{face_name(grid.face)}: ends {ends}, picks {picks}", number)
        box = chart_box(settings.paper, self._across, grid.count > 1)
        width = chart_width(content, chart)
        left = box.left + max(0.0, 0.5 * (box.width - width))
        covered = draw_chart(page, content, chart, (left, box.top), self._style)
        self._name_neighbours(page, grid, (column, row), first_page, covered)
        from_top = self._style.from_top
        draw_small_map(page, grid, content.size, (column, row), from_top)
        self._draw_legend(page)
        return page.figure

    def _name_neighbours(
        self, page: Page, grid: ChartGrid, place: tuple[int, int], first_page: int, covered: Box
    ) -> None:
        """Write the numbers of the neighbouring pages at the four sides of this page."""
        from_top = self._style.from_top
        right = -1 if from_top == grid.face else 1
        up = -1 if from_top else 1
        # Beside the middle of the drawdown.
        chart = grid.chart(*place)
        ends, picks = (
            drawn_band(band, count)
            for band, count in zip((chart.ends, chart.picks), self.content.size, strict=True)
        )
        middle = (
            covered.left + 0.5 * (ends[1] - ends[0]) * grid.cell,
            covered.bottom - 0.5 * (picks[1] - picks[0]) * grid.cell,
        )
        for (dx, dy), (x, y), turn in (
            ((-right, 0), (covered.left - 2.6, middle[1]), 90),
            ((right, 0), (covered.right + 2.6, middle[1]), 90),
            ((0, up), (middle[0], covered.top - 2.2), 0),
            ((0, -up), (middle[0], covered.bottom + 2.4), 0),
        ):
            column, row = place[0] + dx, place[1] + dy
            if 0 <= column < len(grid.ends) and 0 <= row < len(grid.picks):
                text = f"page {first_page + row * len(grid.ends) + column}"
                page.write(x, y, text, NUMBER + 1.0, centred=True, upright=bool(turn))
