"""Apply strokes of the mouse to a draft, cell by cell, and moves of its selected block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from PySide6.QtGui import QColor

from spacemap_vtk.app.draft.draft_layout import GridCell
from spacemap_vtk.scenes.draft_edits import PANEL_NAMES, Selection, move
from spacemap_vtk.scenes.editable_draft import EditableDraft
from spacemap_vtk.textile.drafts.loom import Loom


class Stroke:
    """A mouse stroke: the pressed cell and all cells that it is dragged over."""

    # The first cell decides: if it has a mark, the stroke removes marks, otherwise it sets marks.
    # An end is on one shaft and a pick on one treadle, unless `several`.

    #: Where the selected block is now; a stroke leaves nothing selected.
    place: Selection | None = None

    def __init__(self, shown: EditableDraft, cell: GridCell, several: bool, color: QColor) -> None:
        self.panel = cell.panel
        self.name = PANEL_NAMES[cell.panel]
        self._color = color.red(), color.green(), color.blue()
        if cell.panel == "drawdown":
            self._sets_marks = not shown.drawdown[cell.y - 1, cell.x - 1]
        elif cell.panel not in ("warp", "weft"):
            row, number, _ = _marks_of(shown, cell)
            self._sets_marks = number not in row
        # Otherwise, a new mark replaces the present one of its end or pick.
        self._several = several or cell.panel == "tieup" or shown.loom.liftplan is not None

    def apply(self, shown: EditableDraft, cell: GridCell) -> EditableDraft:
        """Return the draft with the stroke applied to a cell."""
        if self.panel in ("warp", "weft"):
            return self._paint(shown, cell)
        if self.panel == "drawdown":
            index = cell.y - 1, cell.x - 1
            if shown.drawdown[index] == self._sets_marks:
                return shown
            drawdown = shown.drawdown.copy()
            drawdown[index] = self._sets_marks
            return replace(shown, drawdown=drawdown)
        row, number, with_marks = _marks_of(shown, cell)
        marks = row
        if self._sets_marks and not self._several:
            marks = (number,)
        elif (number in row) != self._sets_marks:
            marks = shown.loom.toggle(row, number)
        return shown if marks == row else shown.with_loom(with_marks(marks))

    def _paint(self, shown: EditableDraft, cell: GridCell) -> EditableDraft:
        colors = shown.yarn_colors(self.panel)
        index = (cell.x or cell.y) - 1
        if tuple(colors[index].tolist()) == self._color:
            return shown
        colors = colors.copy()
        colors[index] = np.array(self._color, dtype=np.uint8)
        return shown.with_colors(self.panel, colors)


class Move:
    """A drag of the selected block, or of a copy of it."""

    def __init__(
        self, shown: EditableDraft, selection: Selection, cell: GridCell, copies: bool
    ) -> None:
        self.panel = cell.panel
        self.name = f"{PANEL_NAMES[cell.panel]}: {'copy' if copies else 'move'}"
        self._begin = shown, selection, cell, copies
        self.place: Selection | None = selection
        #: Whether it was dragged to another cell, and perhaps back.
        self.has_moved = False

    def apply(self, _shown: EditableDraft, cell: GridCell) -> EditableDraft:
        """Return the first draft with the block moved as far as the mouse."""
        self.has_moved = True
        shown, selection, begin, copies = self._begin
        moved, self.place = move(shown, selection, cell.x - begin.x, cell.y - begin.y, copies)
        return moved


def _marks_of(
    shown: EditableDraft, cell: GridCell
) -> tuple[tuple[int, ...], int, Callable[[tuple[int, ...]], Loom]]:
    """Return the marks of an end, pick or treadle, the cell's number, and a setter of marks."""
    loom = shown.loom
    if cell.panel == "threading":
        return loom.threading[cell.x - 1], cell.y, partial(loom.replace_threading, cell.x)
    if cell.panel == "treadling":
        return shown.treadling[cell.y - 1], cell.x, partial(loom.replace_treadling, cell.y)
    tied = loom.tieup[cell.x - 1] if cell.x <= len(loom.tieup) else ()
    return tied, cell.y, partial(loom.replace_tie, cell.x)
