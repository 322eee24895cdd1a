"""Layout of a draft's grids on the screen, and lookup of the cell at a point."""

from __future__ import annotations

from typing import NamedTuple

from spacemap_vtk.scenes.editable_draft import EditableDraft

#: Margin around the draft, in pixels.
MARGIN = 10
#: Gap between grids, which contains the numbers, in pixels.
GAP = 24
#: Width of a strip of colours, in pixels.
STRIP = 13
#: Distance of a strip from its grid, in pixels.
STRIP_DISTANCE = 4
#: The parts before and after the drawdown stay visible if they take at most this fraction of the
#: widget.
FROZEN = 0.6


class GridCell(NamedTuple):
    """A cell: its panel, and its numbers along x and y from 1; 0 across a strip of colours."""

    panel: str
    x: int
    y: int


class ScrollAxis(NamedTuple):
    """One direction of the screen: a part before the drawdown, the drawdown, a part after it."""

    # Only the drawdown scrolls, and the parts before and after it stay visible, unless they leave
    # too little room: then everything scrolls.

    before: int
    """Pixels before the drawdown."""
    cells: int
    after: int
    cell: int
    """Pixels of a cell."""
    room: int
    """Pixels of the window."""
    offset: int
    """Pixels scrolled."""

    @property
    def length(self) -> int:
        """Length of the drawdown in pixels."""
        return self.cells * self.cell

    @property
    def is_frozen(self) -> bool:
        """Whether only the drawdown scrolls."""
        return self.before + self.after <= FROZEN * self.room

    @property
    def max_offset(self) -> int:
        """Largest offset."""
        return max(0, self.before + self.length + self.after - self.room)

    @property
    def drawdown_begin(self) -> int:
        """Pixel where the drawdown begins, visible or not."""
        return self.before - self.offset

    @property
    def clip_range(self) -> tuple[int, int]:
        """First and last pixel between which the drawdown is visible."""
        if not self.is_frozen:
            return 0, self.room
        return self.before, max(self.before, self.after_begin)

    @property
    def before_begin(self) -> int:
        """Pixel where the part before the drawdown begins."""
        return 0 if self.is_frozen else -self.offset

    @property
    def after_begin(self) -> int:
        """Pixel where the part after the drawdown begins."""
        if not self.is_frozen:
            return self.drawdown_begin + self.length
        return min(self.before + self.length, self.room - self.after)


class PanelSpan(NamedTuple):
    """A panel along one direction."""

    begin: int
    """Pixel where its first cell begins."""
    cells: int
    """Cells; 0 where the panel is one strip without cells in this direction."""
    size: int
    """Pixels of a cell."""
    low: int
    high: int
    """Between which pixels it is seen."""
    reversed: bool
    """Whether the last number comes first."""

    def number_at(self, pixel: float) -> int | None:
        """Return the number of the cell at a pixel."""
        if not self.low <= pixel < self.high:
            return None
        index = int((pixel - self.begin) // self.size)
        if not 0 <= index < max(self.cells, 1):
            return None
        if not self.cells:
            return 0
        return self.cells - index if self.reversed else index + 1

    def nearest_number(self, pixel: float) -> int:
        """Return the number of the visible cell that is nearest to a pixel."""
        end = min(self.high, self.begin + max(self.cells, 1) * self.size)
        number = self.number_at(min(max(pixel, self.low, self.begin), end - 1))
        return 1 if number is None else number

    def pixel_of(self, number: int) -> int:
        """Return the pixel where a cell begins."""
        index = self.cells - number if self.reversed else max(number - 1, 0)
        return self.begin + self.size * index

    @property
    def visible_cells(self) -> range:
        """The visible cells, counted from 0 in the order of the screen."""
        first = max(0, (self.low - self.begin) // self.size)
        last = min(max(self.cells, 1), -(-(self.high - self.begin) // self.size))
        return range(first, max(first, last))


class DraftLayout:
    """Positions of all grids and strips of a draft."""

    # The threading is above the drawdown, the treadling to its right, the tie-up in the corner
    # between these. Strips of colours are above the threading and right of the treadling. As on
    # paper, everything is counted from the corner where the four grids meet; `as_cloth` counts ends
    # from the left and picks from below, as in the cloth seen from its front.

    def __init__(
        self,
        shown: EditableDraft,
        cell: int,
        room: tuple[int, int],
        offset: tuple[int, int] = (0, 0),
        as_cloth: bool = False,
        from_reverse: bool = False,
    ) -> None:
        (ends, picks), shafts, columns = shown.size, shown.loom.shafts, shown.columns
        self.cell = cell
        top_margin = MARGIN + STRIP + STRIP_DISTANCE
        x = ScrollAxis(
            MARGIN, ends, GAP + columns * cell + STRIP_DISTANCE + STRIP + MARGIN, cell, room[0], 0
        )
        y = ScrollAxis(top_margin + shafts * cell + GAP, picks, MARGIN, cell, room[1], 0)
        #: Largest scroll offsets.
        self.max_offset = x.max_offset, y.max_offset
        self.offset = min(max(offset[0], 0), x.max_offset), min(max(offset[1], 0), y.max_offset)
        self.x, self.y = (
            axis._replace(offset=at) for axis, at in zip((x, y), self.offset, strict=True)
        )
        x, y = self.x, self.y
        # On its reverse, the cloth is turned over around the warp: its ends run the other way.
        ends_reversed = as_cloth == from_reverse
        along_ends = PanelSpan(x.drawdown_begin, ends, cell, *x.clip_range, ends_reversed)
        along_picks = PanelSpan(y.drawdown_begin, picks, cell, *y.clip_range, as_cloth)
        right, end = x.after_begin + GAP, x.after_begin + GAP + columns * cell
        treadles = PanelSpan(right, columns, cell, right, end, False)
        # Shaft 1 is next to the cloth, at the bottom of the threading.
        top = y.before_begin + top_margin
        heddles = PanelSpan(top, shafts, cell, top, top + shafts * cell, True)
        strip, side = (
            PanelSpan(begin, 0, STRIP, begin, begin + STRIP, False)
            for begin in (y.before_begin + MARGIN, end + STRIP_DISTANCE)
        )
        self.panels: dict[str, tuple[PanelSpan, PanelSpan]] = {
            "threading": (along_ends, heddles),
            "treadling": (treadles, along_picks),
            "drawdown": (along_ends, along_picks),
            "warp": (along_ends, strip),
            "weft": (side, along_picks),
        }
        if shown.loom.liftplan is None:
            self.panels["tieup"] = treadles, heddles

    def cell_at(self, x: float, y: float, panel: str | None = None) -> GridCell | None:
        """Return the cell under a point."""
        for name, (across, down) in self.panels.items():
            if panel in (None, name):
                column, row = across.number_at(x), down.number_at(y)
                if column is not None and row is not None:
                    return GridCell(name, column, row)
        return None

    def nearest_cell(self, x: float, y: float, panel: str) -> GridCell:
        """Return the visible cell of a panel that is nearest to a point."""
        across, down = self.panels[panel]
        return GridCell(panel, across.nearest_number(x), down.nearest_number(y))

    def center(self, place: GridCell) -> tuple[int, int]:
        """Return the centre of a cell, visible or not."""
        across, down = self.panels[place.panel]
        return across.pixel_of(place.x) + across.size // 2, down.pixel_of(place.y) + down.size // 2


def fit_cell_size(shown: EditableDraft, space: tuple[int, int], smallest: int, largest: int) -> int:
    """Return the largest size of a cell with which the whole draft is visible."""
    ends, picks = shown.size
    width = space[0] - 2 * MARGIN - GAP - STRIP_DISTANCE - STRIP
    height = space[1] - 2 * MARGIN - GAP - STRIP_DISTANCE - STRIP
    cell = min(width // (ends + shown.columns), height // (picks + shown.loom.shafts))
    return min(max(cell, smallest), largest)
