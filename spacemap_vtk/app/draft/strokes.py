"""Apply strokes of the mouse to a draft, cell by cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from PySide6.QtGui import QColor

from spacemap_vtk.app.draft.layout import Place
from spacemap_vtk.scenes.shown import Shown
from spacemap_vtk.textile.drafts.loom import Loom

#: Names of the edits in the undo menu.
NAMES = {
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

    def __init__(self, shown: Shown, place: Place, several: bool, color: QColor) -> None:
        self.panel = place.panel
        self.name = NAMES[place.panel]
        self._color = color.red(), color.green(), color.blue()
        # A new mark replaces the present one of its end or pick, unless `several`.
        if place.panel == "drawdown":
            self._wanted = not shown.drawdown[place.y - 1, place.x - 1]
        elif place.panel not in ("warp", "weft"):
            row, number, _ = _row(shown, place)
            self._wanted = number not in row
        several = several or place.panel == "tieup" or shown.loom.liftplan is not None
        self._several = several

    def applied(self, shown: Shown, place: Place) -> Shown:
        """Return the draft with the stroke applied to a cell."""
        if self.panel in ("warp", "weft"):
            return self._painted(shown, place)
        if self.panel == "drawdown":
            here = place.y - 1, place.x - 1
            if shown.drawdown[here] == self._wanted:
                return shown
            drawdown = shown.drawdown.copy()
            drawdown[here] = self._wanted
            return replace(shown, drawdown=drawdown)
        row, number, changed = _row(shown, place)
        marks = row
        if self._wanted and not self._several:
            marks = (number,)
        elif (number in row) != self._wanted:
            marks = shown.loom.toggled(row, number)
        return shown if marks == row else shown.with_loom(changed(marks))

    def _painted(self, shown: Shown, place: Place) -> Shown:
        colors = shown.strip(self.panel)
        index = (place.x or place.y) - 1
        if tuple(colors[index].tolist()) == self._color:
            return shown
        colors = colors.copy()
        colors[index] = np.array(self._color, dtype=np.uint8)
        return shown.painted(self.panel, colors)


def _row(
    shown: Shown, place: Place
) -> tuple[tuple[int, ...], int, Callable[[tuple[int, ...]], Loom]]:
    """Return the marks of an end, pick or treadle, the cell's number, and a setter of marks."""
    loom = shown.loom
    if place.panel == "threading":
        return loom.threading[place.x - 1], place.y, partial(loom.threaded, place.x)
    if place.panel == "treadling":
        return shown.lifted[place.y - 1], place.x, partial(loom.treadled, place.y)
    tied = loom.tieup[place.x - 1] if place.x <= len(loom.tieup) else ()
    return tied, place.y, partial(loom.tied, place.x)
