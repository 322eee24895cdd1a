"""Apply strokes of the mouse to a draft, cell by cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from PySide6.QtGui import QColor

from spacemap_vtk.app.draft.draft_layout import GridCell
from spacemap_vtk.scenes.editable_draft import EditableDraft
from spacemap_vtk.textile.drafts.loom import Loom

#: Names of the edits in the undo menu.
EDIT_NAMES = {
    "threading": "threading",
    "tieup": "tie-up",
    "treadling": "treadling",
    "drawdown": "drawdown",
    "warp": "warp colours",
    "weft": "weft colours",
}


class Stroke:
    """A mouse stroke: the pressed cell and all cells that it is dragged over."""

    # The first cell decides: if it has a mark, the stroke removes marks, otherwise it sets marks.
    # An end is on one shaft and a pick on one treadle, unless `several`.

    def __init__(
        self, shown: EditableDraft, grid_cell: GridCell, several: bool, color: QColor
    ) -> None:
        self.panel = grid_cell.panel
        self.name = EDIT_NAMES[grid_cell.panel]
        self._color = color.red(), color.green(), color.blue()
        # A new mark replaces the present one of its end or pick, unless `several`.
        if grid_cell.panel == "drawdown":
            self._sets_marks = not shown.drawdown[grid_cell.y - 1, grid_cell.x - 1]
        elif grid_cell.panel not in ("warp", "weft"):
            row, number, _ = _marks_of(shown, grid_cell)
            self._sets_marks = number not in row
        several = several or grid_cell.panel == "tieup" or shown.loom.liftplan is not None
        self._several = several

    def apply(self, shown: EditableDraft, grid_cell: GridCell) -> EditableDraft:
        """Return the draft with the stroke apply to a cell."""
        if self.panel in ("warp", "weft"):
            return self._paint(shown, grid_cell)
        if self.panel == "drawdown":
            index = grid_cell.y - 1, grid_cell.x - 1
            if shown.drawdown[index] == self._sets_marks:
                return shown
            drawdown = shown.drawdown.copy()
            drawdown[index] = self._sets_marks
            return replace(shown, drawdown=drawdown)
        row, number, changed = _marks_of(shown, grid_cell)
        marks = row
        if self._sets_marks and not self._several:
            marks = (number,)
        elif (number in row) != self._sets_marks:
            marks = shown.loom.toggle(row, number)
        return shown if marks == row else shown.with_loom(changed(marks))

    def _paint(self, shown: EditableDraft, grid_cell: GridCell) -> EditableDraft:
        colors = shown.yarn_colors(self.panel)
        index = (grid_cell.x or grid_cell.y) - 1
        if tuple(colors[index].tolist()) == self._color:
            return shown
        colors = colors.copy()
        colors[index] = np.array(self._color, dtype=np.uint8)
        return shown.with_colors(self.panel, colors)


def _marks_of(
    shown: EditableDraft, grid_cell: GridCell
) -> tuple[tuple[int, ...], int, Callable[[tuple[int, ...]], Loom]]:
    """Return the marks of an end, pick or treadle, the cell's number, and a setter of marks."""
    loom = shown.loom
    if grid_cell.panel == "threading":
        return (
            loom.threading[grid_cell.x - 1],
            grid_cell.y,
            partial(loom.replace_threading, grid_cell.x),
        )
    if grid_cell.panel == "treadling":
        return (
            shown.treadling[grid_cell.y - 1],
            grid_cell.x,
            partial(loom.replace_treadling, grid_cell.y),
        )
    tied = loom.tieup[grid_cell.x - 1] if grid_cell.x <= len(loom.tieup) else ()
    return tied, grid_cell.y, partial(loom.replace_tie, grid_cell.x)
