"""Maps of the pages of a face: over the whole cloth, and small in the heading of each page."""

from __future__ import annotations

from dataclasses import dataclass

from spacemap_vtk.draw.draft_print.chart import ChartStyle
from spacemap_vtk.draw.draft_print.layout import ChartGrid
from spacemap_vtk.draw.draft_print.paper import INK, PAGE_NUMBER, Box, Page, word_width

#: Colour of cuts on the first page.
_CUT = "#c8102e"
#: Largest width and height of the small map, in mm.
SMALL_MAP, _SMALL_HEIGHT = 30.0, 9.0


@dataclass(frozen=True)
class PageMap:
    """The pages of a face on a picture of the whole cloth."""

    grid: ChartGrid
    #: Numbers of ends and picks of the cloth.
    size: tuple[int, int]
    box: Box
    from_top: bool

    def x(self, end: float) -> float:
        """Return the place of a number of ends, in mm."""
        falls = self.from_top == self.grid.face
        return self.box.left + self.box.width / self.size[0] * (
            self.size[0] - end if falls else end
        )

    def y(self, pick: float) -> float:
        """Return the y coordinate of the border after the first `pick` picks, in mm."""
        ends_up = self.size[1] - pick
        return self.box.top + self.box.height / self.size[1] * (pick if self.from_top else ends_up)

    @property
    def cuts(self) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """Lines along which the cloth is cut."""
        box = self.box
        xs = [self.x(begin) for begin, _ in self.grid.ends[1:]]
        ys = [self.y(begin) for begin, _ in self.grid.picks[1:]]
        return [((x, box.top), (x, box.bottom)) for x in xs] + [
            ((box.left, y), (box.right, y)) for y in ys
        ]

    def page_box(self, column: int, row: int) -> Box:
        """Return the place of a page."""
        x = sorted(map(self.x, self.grid.ends[column]))
        y = sorted(map(self.y, self.grid.picks[row]))
        return Box(x[0], y[0], x[1] - x[0], y[1] - y[0])


def draw_page_map(page: Page, pages: PageMap, first_page: int, style: ChartStyle) -> None:
    """Draw the cuts over a picture of the cloth, and the number of each page."""
    grid = pages.grid
    if grid.count == 1:
        return
    page.draw_lines(pages.cuts, 1.6, "white")
    page.draw_lines(pages.cuts, 0.8, INK if style.mono else _CUT)
    for row in range(len(grid.picks)):
        for column in range(len(grid.ends)):
            box = pages.page_box(column, row)
            text = str(first_page + row * len(grid.ends) + column)
            room = box.width - 1.0, box.height - 1.0
            size = min(11.0, 11.0 * room[0] / (word_width(text, 11.0) + 2.0), 2.0 * room[1])
            if size < 4.5:
                continue
            wide, tall = word_width(text, size, bold=True) + 1.6, 0.46 * size
            x, y = box.left + 0.5 * box.width, box.top + 0.5 * box.height
            page.fill([(x - 0.5 * wide, y - 0.5 * tall, wide, tall)], "white", 0.9)
            page.write(x, y, text, size, centred=True, bold=True)


def draw_small_map(
    page: Page, grid: ChartGrid, size: tuple[int, int], place: tuple[int, int], from_top: bool
) -> None:
    """Draw a small map of the pages at the top of a page, with this page filled."""
    if grid.count == 1:
        return
    scale = min(SMALL_MAP / size[0], _SMALL_HEIGHT / size[1])
    width, height = scale * size[0], scale * size[1]
    box = Box(page.body.right - PAGE_NUMBER - width, page.body.top + 0.5, width, height)
    pages = PageMap(grid, size, box, from_top)
    page.fill([pages.page_box(*place)], "#9aa4b0")
    page.draw_lines(pages.cuts, 0.4)
    page.draw_box(box, 0.5)
