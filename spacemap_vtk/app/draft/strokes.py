"""What a stroke of the mouse does to a draft, cell by cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PySide6.QtGui import QColor

from spacemap_vtk.app.draft.layout import Place
from spacemap_vtk.scenes.shown import Shown

#: What people call the edits, for the undo menu.
NAMES = {
    "threading": "threading",
    "tieup": "tie-up",
    "treadling": "treadling",
    "drawdown": "drawdown",
    "warp": "warp colours",
    "weft": "weft colours",
}


class Stroke:
    """A press of the button, and all cells that it is dragged over."""

    # The first cell decides: a mark that is there goes, and so do others under the drag; a cell
    # without gets one. An end is on one shaft and a pick on one treadle, unless `several`.

    def __init__(self, shown: Shown, place: Place, several: bool, color: QColor) -> None:
        self.panel = place.panel
        self.name = NAMES[place.panel]
        self._color = color.red(), color.green(), color.blue()
        marked = self._marked(shown, place)
        # A second mark beside another: the other one goes with the first stroke.
        self._wanted = not marked
        self._several = several or shown.loom.liftplan is not None

    @staticmethod
    def _marked(shown: Shown, place: Place) -> bool:
        loom = shown.loom
        if place.panel == "threading":
            return place.y in loom.threading[place.x - 1]
        if place.panel == "treadling":
            return place.x in shown.lifted[place.y - 1]
        if place.panel == "tieup":
            return place.x <= len(loom.tieup) and place.y in loom.tieup[place.x - 1]
        if place.panel == "drawdown":
            return bool(shown.drawdown[place.y - 1, place.x - 1])
        return False

    def applied(self, shown: Shown, place: Place) -> Shown:
        """Return the draft after a cell has been passed."""
        if self.panel in ("warp", "weft"):
            return self._painted(shown, place)
        if self._marked(shown, place) == self._wanted:
            alone = self._several or not self._wanted or self.panel in ("tieup", "drawdown")
            if alone or len(self._row(shown, place)) == 1:
                return shown
        if self.panel == "drawdown":
            drawdown = shown.drawdown.copy()
            drawdown[place.y - 1, place.x - 1] = self._wanted
            return replace(shown, drawdown=drawdown)
        loom = shown.loom
        if self.panel == "tieup":
            row = loom.tieup[place.x - 1] if place.x <= len(loom.tieup) else ()
            return shown.with_loom(loom.tied(place.x, loom.toggled(row, place.y)))
        number = place.y if self.panel == "threading" else place.x
        row = self._row(shown, place)
        alone = self._wanted and not self._several
        row = (number,) if alone else loom.toggled(row, number)
        if self.panel == "threading":
            return shown.with_loom(loom.threaded(place.x, row))
        return shown.with_loom(loom.treadled(place.y, row))

    def _row(self, shown: Shown, place: Place) -> tuple[int, ...]:
        if self.panel == "threading":
            return shown.loom.threading[place.x - 1]
        return shown.lifted[place.y - 1] if self.panel == "treadling" else ()

    def _painted(self, shown: Shown, place: Place) -> Shown:
        colors = shown.strip(self.panel)
        index = (place.x or place.y) - 1
        if tuple(colors[index].tolist()) == self._color:
            return shown
        colors = colors.copy()
        colors[index] = np.array(self._color, dtype=np.uint8)
        return shown.painted(self.panel, colors)
