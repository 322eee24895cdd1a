"""Edits of selected parts of a draft; each returns a new draft."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Ints
from spacemap_vtk.scenes.editable_draft import EditableDraft
from spacemap_vtk.textile.drafts import blocks, draws, loom_edits, orders
from spacemap_vtk.textile.drafts.loom import Loom, to_marks
from spacemap_vtk.textile.drafts.patterns import build_pattern

#: Names of the parts of a draft, by panel.
PANEL_NAMES = {
    "threading": "threading",
    "tieup": "tie-up",
    "treadling": "treadling",
    "drawdown": "drawdown",
    "warp": "warp colours",
    "weft": "weft colours",
}
#: Panels whose threads run across, so that their blocks are transposed.
_UPRIGHT = ("threading", "tieup", "warp")
#: Panels in whose columns ends stand, and in whose rows picks.
END_PANELS = ("threading", "warp", "drawdown")
PICK_PANELS = ("treadling", "weft", "drawdown")
#: Panels of colours.
STRIPS = ("warp", "weft")


class Selection(NamedTuple):
    """A rectangle of a panel, by the numbers of its first and last column and row, from 1."""

    panel: str
    x: tuple[int, int]
    y: tuple[int, int]

    @classmethod
    def between(cls, panel: str, corner: tuple[int, int], other: tuple[int, int]) -> Selection:
        """Select from one corner to another."""
        # Across a strip of colours, cells have the number 0.
        x, y = ((max(min(pair), 1), max(*pair, 1)) for pair in zip(corner, other, strict=True))
        return cls(panel, x, y)

    @property
    def columns(self) -> slice:
        """Indices of the columns."""
        return slice(self.x[0] - 1, self.x[1])

    @property
    def rows(self) -> slice:
        """Indices of the rows."""
        return slice(self.y[0] - 1, self.y[1])

    @property
    def threads(self) -> slice:
        """Indices of the ends, picks or treadles."""
        return self.columns if self.panel in _UPRIGHT else self.rows

    @property
    def places(self) -> tuple[int, int]:
        """First and last shaft or treadle."""
        return self.y if self.panel in _UPRIGHT else self.x

    def contains(self, other: Selection) -> bool:
        """Return whether another selection lies within this one."""
        return self.panel == other.panel and all(
            own[0] <= given[0] and given[1] <= own[1]
            for own, given in ((self.x, other.x), (self.y, other.y))
        )

    def with_threads(self, first: int, last: int) -> Selection:
        """Return a selection of the same places of other threads, numbered from 1."""
        numbers = first, last
        return self._replace(x=numbers) if self.panel in _UPRIGHT else self._replace(y=numbers)

    def with_places(self, first: int, last: int) -> Selection:
        """Return a selection of other shafts or treadles of the same threads."""
        numbers = first, last
        return self._replace(y=numbers) if self.panel in _UPRIGHT else self._replace(x=numbers)

    def describe(self, lifted: bool = False) -> str:
        """Return what is selected, such as "threading, ends 5–12, shafts 1–4"."""
        across, down = {
            "threading": ("end", "shaft"),
            "tieup": ("treadle", "shaft"),
            "treadling": ("shaft" if lifted else "treadle", "pick"),
            "drawdown": ("end", "pick"),
            "warp": ("end", ""),
            "weft": ("", "pick"),
        }[self.panel]
        parts = [_count_words(*each) for each in ((across, self.x), (down, self.y)) if each[0]]
        name = "liftplan" if lifted and self.panel == "treadling" else PANEL_NAMES[self.panel]
        return ", ".join([name, *parts])


def _count_words(name: str, numbers: tuple[int, int]) -> str:
    first, last = numbers
    return f"{name} {first}" if first == last else f"{name}s {first}–{last}"


def read_panel(shown: EditableDraft, panel: str) -> NDArray:
    """Return marks or colours of a panel, (rows, columns, ...), as they are numbered."""
    if panel == "warp":
        return shown.warp[None]
    if panel == "weft":
        return shown.weft[:, None]
    return shown.marks(panel)


def write_panel(shown: EditableDraft, panel: str, values: NDArray) -> EditableDraft:
    """Return a copy with other marks or colours of a panel."""
    if panel in STRIPS:
        colors = values[0] if panel == "warp" else values[:, 0]
        return shown.with_colors(panel, np.ascontiguousarray(colors))
    if panel == "drawdown" and not shown.is_pattern:
        raise InputError(
            "the loom determines the drawdown",
            cure="Edit the threading, tie-up or treadling instead",
        )
    return shown.with_marks(panel, values)


def select_all(shown: EditableDraft, panel: str) -> Selection:
    """Select a whole panel."""
    rows, columns = read_panel(shown, panel).shape[:2]
    return Selection(panel, (1, columns), (1, rows))


def is_inside(shown: EditableDraft, selection: Selection) -> bool:
    """Return whether a selection is a part of a draft."""
    if selection.panel == "tieup" and shown.loom.liftplan is not None:
        return False
    whole = select_all(shown, selection.panel)
    return selection.x[1] <= whole.x[1] and selection.y[1] <= whole.y[1]


def read_block(shown: EditableDraft, selection: Selection) -> NDArray:
    """Return the selected block, a row for each thread."""
    part = read_panel(shown, selection.panel)[selection.rows, selection.columns]
    return part.swapaxes(0, 1) if selection.panel in _UPRIGHT else part


def change_block(
    shown: EditableDraft, selection: Selection, change: Callable[[NDArray], NDArray]
) -> EditableDraft:
    """Return a copy with the selected block changed by a function."""
    values = read_panel(shown, selection.panel).copy()
    block = change(read_block(shown, selection))
    upright = selection.panel in _UPRIGHT
    values[selection.rows, selection.columns] = block.swapaxes(0, 1) if upright else block
    return write_panel(shown, selection.panel, values)


def clear(shown: EditableDraft, selection: Selection) -> EditableDraft:
    """Remove the selected marks."""
    return change_block(shown, selection, np.zeros_like)


def invert(shown: EditableDraft, selection: Selection) -> EditableDraft:
    """Exchange marked and empty cells."""
    return change_block(shown, selection, np.logical_not)


def mirror(shown: EditableDraft, selection: Selection, axis: int) -> EditableDraft:
    """Mirror a block; axis 1 exchanges left and right, axis 0 top and bottom."""
    along = 1 - axis if selection.panel in _UPRIGHT else axis
    return change_block(shown, selection, lambda block: np.flip(block, along))


def shift(shown: EditableDraft, selection: Selection, right: int, up: int) -> EditableDraft:
    """Shift a block within itself in the directions of rising numbers; it goes on from behind."""
    steps = (right, up) if selection.panel in _UPRIGHT else (up, right)
    return change_block(shown, selection, lambda block: np.roll(block, steps, (0, 1)))


def move(
    shown: EditableDraft, selection: Selection, right: int, up: int, copies: bool = False
) -> tuple[EditableDraft, Selection]:
    """Move a block, or a copy, over columns and rows within its panel; return also its place."""
    whole = select_all(shown, selection.panel)
    right = min(max(right, 1 - selection.x[0]), whole.x[1] - selection.x[1])
    up = min(max(up, 1 - selection.y[0]), whole.y[1] - selection.y[1])
    corners = ((x + right, y + up) for x, y in zip(selection.x, selection.y, strict=True))
    placed, block = Selection.between(selection.panel, *corners), read_block(shown, selection)
    # A thread has always a colour, so colours are copied.
    if not copies and selection.panel not in STRIPS:
        shown = clear(shown, selection)
    return change_block(shown, placed, lambda _: block), placed


def paste(
    shown: EditableDraft, selection: Selection, block: NDArray, overlay: bool = False
) -> EditableDraft:
    """Paste a block from the first selected cell; a larger selection is filled with copies."""
    # What would lie beyond the last end or pick is cut off.
    _check_kind(selection.panel, block)
    rows, columns = read_block(shown, selection).shape[:2]
    block = blocks.tile_block(block, max(rows, len(block)), max(columns, block.shape[1]))
    whole = select_all(shown, selection.panel)
    first, room = selection.threads.start, whole.places[1] - selection.places[0] + 1
    if block.dtype == bool and block[: whole.threads.stop - first, room:].any():
        raise _reaches_beyond(selection.panel)
    return change_block(
        shown,
        whole,
        lambda grid: blocks.paste_block(grid, block, first, selection.places[0] - 1, overlay),
    )


def paste_threads(
    shown: EditableDraft, selection: Selection, block: NDArray
) -> tuple[EditableDraft, Selection]:
    """Insert a block as new ends or picks before the selected ones; return also its place."""
    _check_kind(selection.panel, block)
    _check_threads(selection.panel)
    before = selection.threads.start
    family = 0 if selection.panel in END_PANELS else 1
    shown = insert_threads(shown, family, before, len(block))
    placed = selection.with_threads(before + 1, before + len(block))
    placed = placed.with_places(placed.places[0], placed.places[0])
    if selection.panel not in STRIPS:
        columns = select_all(shown, selection.panel).places[1]
        shown = clear(shown, placed.with_places(1, columns))
    shown = paste(shown, placed, block)
    return shown, placed.with_places(placed.places[0], placed.places[0] + block.shape[1] - 1)


def interleave(
    shown: EditableDraft, selection: Selection, block: NDArray
) -> tuple[EditableDraft, Selection]:
    """Insert a thread of a block, repeated, after each selected one; return also their place."""
    # Each selected thread is doubled, and the second one gets the next thread of the block.
    _check_kind(selection.panel, block)
    _check_threads(selection.panel)
    first, count = selection.threads.start, selection.threads.stop - selection.threads.start
    shown = double_threads(shown, 0 if selection.panel in END_PANELS else 1, selection.threads)
    places = select_all(shown, selection.panel).places[1]
    whole = selection.with_threads(first + 1, first + 2 * count).with_places(1, places)
    if block.shape[1] > places:
        raise _reaches_beyond(selection.panel)
    new = blocks.paste_block(
        np.zeros((count, *read_block(shown, whole).shape[1:]), block.dtype),
        blocks.tile_block(block, count, block.shape[1]),
        0,
        0,
    )

    def write_second(grid: NDArray) -> NDArray:
        grid = grid.copy()
        grid[1::2] = new
        return grid

    return change_block(shown, whole, write_second), whole


def _check_threads(panel: str) -> None:
    if panel not in ("threading", "treadling", *STRIPS):
        raise InputError("ends and picks can be inserted in threading, treadling and colours only")


def _reaches_beyond(panel: str) -> InputError:
    return InputError(
        f"the marks to paste reach beyond the {PANEL_NAMES[panel]}",
        cure="Add shafts or treadles, or paste at a lower one",
    )


def _check_kind(panel: str, block: NDArray) -> None:
    if (block.dtype == bool) == (panel in STRIPS):
        held, needed = ("marks", "colours") if block.dtype == bool else ("colours", "marks")
        raise InputError(
            f"the clipboard holds {held}; the {PANEL_NAMES[panel]} need {needed}",
            cure=f"Copy {needed} first",
        )


def fill_with_numbers(shown: EditableDraft, selection: Selection, numbers: Ints) -> EditableDraft:
    """Give each selected thread one mark: its shaft or treadle."""
    columns = select_all(shown, selection.panel).places[1]
    # All marks of the threads, not only those in the selected shafts: an end is on one shaft.
    full = selection.with_places(1, columns)
    if numbers.max() > columns:
        raise InputError(
            f"the draw needs {numbers.max()} shafts or treadles", allowed=f"up to {columns}"
        )
    return change_block(
        shown, full, lambda _: to_marks([(number,) for number in numbers.tolist()], columns)
    )


def fill_with_weave(shown: EditableDraft, selection: Selection, name: str) -> EditableDraft:
    """Fill a block with the repeat of a weave, such as "twill 2/2"."""
    unit = build_pattern(name)
    return change_block(shown, selection, lambda block: blocks.tile_block(unit, *block.shape))


def fill_with_color(
    shown: EditableDraft, selection: Selection, color: tuple[int, int, int]
) -> EditableDraft:
    """Give the selected threads one colour."""
    return change_block(
        shown, selection, lambda block: np.full_like(block, np.array(color, dtype=block.dtype))
    )


def move_to_network(shown: EditableDraft, selection: Selection, initial: int) -> EditableDraft:
    """Move the first mark of each selected thread onto a network."""
    whole = select_all(shown, selection.panel)
    rows = shown.loom.threading if selection.panel == "threading" else shown.treadling
    line = [row[0] if row else 1 for row in rows[selection.threads]]
    columns = whole.places[1]
    return fill_with_numbers(shown, selection, draws.network_draw(line, columns, initial))


def repeat_to_end(shown: EditableDraft, selection: Selection) -> EditableDraft:
    """Repeat a block over the threads after it; their former marks are replaced."""
    block = read_block(shown, selection)
    last = select_all(shown, selection.panel).threads.stop
    area = selection.with_threads(selection.threads.start + 1, last)
    return change_block(shown, area, lambda grid: blocks.tile_block(block, *grid.shape[:2]))


def insert_threads(shown: EditableDraft, family: int, before: int, added: int) -> EditableDraft:
    """Insert empty ends (family 0) or picks (1) before an index, in the colour of a neighbour."""
    order = orders.insert_order(shown.size[family], before, added)
    inserted = arrange(shown, family, order)
    panel = "drawdown" if shown.is_pattern else ("threading", "treadling")[family]
    whole = select_all(inserted, panel)
    new = before + 1, before + added
    return clear(inserted, whole._replace(x=new) if family == 0 else whole._replace(y=new))


def delete_threads(shown: EditableDraft, family: int, part: slice) -> EditableDraft:
    """Remove ends (family 0) or picks (1)."""
    order = orders.delete_order(shown.size[family], part)
    if not len(order):
        raise InputError("a draft needs at least one end and one pick")
    return arrange(shown, family, order)


def reverse_threads(shown: EditableDraft, family: int, part: slice) -> EditableDraft:
    """Reverse the order of ends (family 0) or picks (1), with their colours."""
    return arrange(shown, family, orders.reverse_order(shown.size[family], part))


def repeat_threads(
    shown: EditableDraft, family: int, part: slice, times: int, mirrored: bool = False
) -> EditableDraft:
    """Repeat ends (family 0) or picks (1) with their colours; those after them move on."""
    order = orders.repeat_order(shown.size[family], part, times, mirrored)
    return arrange(shown, family, order)


def double_threads(shown: EditableDraft, family: int, part: slice) -> EditableDraft:
    """Insert a copy of each end (family 0) or pick (1) after it."""
    return arrange(shown, family, orders.interleave_order(shown.size[family], part))


def arrange(shown: EditableDraft, family: int, order: Ints) -> EditableDraft:
    """Put the ends (family 0) or picks (1) into another order."""
    return shown.arrange(ends=order) if family == 0 else shown.arrange(picks=order)


def weave_as_drawn_in(shown: EditableDraft) -> EditableDraft:
    """Treadle in the order of the threading; there are then as many picks as ends."""
    loom = loom_edits.weave_as_drawn_in(shown.loom)
    ends, picks = shown.size
    if picks != ends:
        shown = shown.arrange(picks=np.arange(ends) % picks)
    return shown.with_loom(loom)


def reduce_loom(shown: EditableDraft) -> EditableDraft:
    """Weave the same cloth with the fewest shafts and treadles, numbered as they are first used."""
    return shown.with_loom(Loom.from_drawdown(shown.drawdown))


def exchange(shown: EditableDraft, what: str, first: int, second: int) -> EditableDraft:
    """Exchange two shafts or treadles; the cloth stays the same."""
    return shown.with_loom(loom_edits.exchange(shown.loom, what, first, second))


def color_as_warp(shown: EditableDraft) -> EditableDraft:
    """Give the picks the colours of the ends, in the same order."""
    return shown.with_colors("weft", np.resize(shown.warp, shown.weft.shape))


def turn_over(shown: EditableDraft) -> EditableDraft:
    """Turn the cloth over around the warp: its reverse becomes its face, its last end the first."""
    turned = shown.arrange(ends=np.arange(shown.size[0])[::-1])
    if shown.is_pattern:
        return replace(turned, drawdown=~turned.drawdown)
    return turned.with_loom(loom_edits.swap_faces(turned.loom))


def turn_draft(shown: EditableDraft) -> EditableDraft:
    """Exchange warp and weft, with their colours and spacings."""
    source, loom, drawdown = shown.source, loom_edits.turn_loom(shown.loom), ~shown.drawdown.T
    if source.loom is not None:
        ends, picks = shown.size
        warp, weft = source.weft.repeat(picks), source.warp.repeat(ends)
        source = replace(source, drawdown=drawdown, loom=loom, warp=warp, weft=weft)
    return replace(
        shown, warp=shown.weft, weft=shown.warp, source=source, loom=loom, drawdown=drawdown
    )
