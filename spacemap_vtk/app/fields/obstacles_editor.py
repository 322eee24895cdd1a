"""Editor of obstacles: a card for each obstacle, made from its declared parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QApplication, QFileDialog, QWidget

from spacemap_vtk.app.fields.first_values import round_value
from spacemap_vtk.app.fields.loads_editor import TIME_DEFAULTS
from spacemap_vtk.app.fields.record_cards import RecordCard, RecordCards
from spacemap_vtk.app.widgets import restyle
from spacemap_vtk.filters.obstacle import SHAPES, Obstacle, Obstacles
from spacemap_vtk.filters.time_keys import TIME_KEYS

#: First values of a new obstacle, over the size of the cloth.
_SIZES: dict[str, dict[str, Any]] = {
    "plane": {},
    "sphere": {"radius": 0.25},
    "cylinder": {"radius": 0.1, "axis": [1.0, 0.0, 0.0]},
    "box": {"size": [0.5, 0.5, 0.3]},
    "disc": {"radius": 0.3},
    "mesh": {},
}
#: Depth of the centre of a new obstacle below the lowest point of the cloth, as a share of the
#: cloth's size. Its top is then a tenth of this size below the cloth; a plane lies lower.
_BELOW = {"plane": 0.3, "sphere": 0.35, "cylinder": 0.2, "box": 0.25, "disc": 0.1, "mesh": 0.1}
#: Places of new obstacles are rounded to this share of the cloth's size.
_DIGITS = 0.01
#: Keys of a motion.
_MOTION = ("time", "start", "rise", "times", "values", "frequency")
assert set(_SIZES) == set(SHAPES)


class ObstaclesEditor(RecordCards):
    """Cards of the obstacles, each with its shape, place, friction and motion."""

    # One card can be selected, by a click on it or into one of its fields.

    #: Number and `Obstacle` of the selected card, also after a change of its values; or None, None.
    selected = Signal(object, object)

    def __init__(self, parameter: Obstacles) -> None:
        super().__init__(parameter, SHAPES, parameter.record.noun)
        self._obstacles: Sequence[Obstacle] = ()
        self._selected: int | None = None
        QApplication.instance().focusChanged.connect(self._select_focused)
        #: Size of the cloth [m], its lowest point below its middle, and the direction of gravity.
        self.size, self.lowest, self.down = 0.1, np.zeros(3), np.array([0.0, 0.0, -1.0])

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new obstacle: below the cloth, and smaller."""
        center = self.lowest + self.size * _BELOW[kind] * self.down
        step = 10.0 ** np.floor(np.log10(self.size * _DIGITS))
        values = {"shape": kind, "center": [round_value(round(c / step) * step) for c in center]}
        up = [round_value(part) + 0.0 for part in -self.down]
        if up != [0.0, 0.0, 1.0] and kind in ("plane", "disc", "box"):
            values["normal" if kind == "plane" else "axis"] = up
        return {**values, **self._sized(kind)}

    def select(self, number: int | None) -> None:
        """Select the card of an obstacle, or none."""
        if number != self._selected:
            self._selected = number
            self._show_selected()

    def show_value(self, value: Sequence[Obstacle]) -> None:
        """Show the obstacles on cards; the selected one stays selected while none is removed."""
        super().show_value(value)
        if self._selected is not None and len(value) < len(self._obstacles):
            self._selected = None
        changed, self._obstacles = value != self._obstacles, value
        if changed:
            self._show_selected()

    def hideEvent(self, event: QHideEvent) -> None:
        """Select nothing while another page is shown."""
        super().hideEvent(event)
        if not event.spontaneous():
            self.select(None)

    def _insert_card(self, card: RecordCard) -> None:
        super()._insert_card(card)
        card.pressed.connect(self.select)

    def _add(self, action: Any) -> None:
        before = len(self.cards)
        super()._add(action)
        if len(self.cards) > before:
            self.select(before)

    def _select_focused(self, _before: QWidget | None, now: QWidget | None) -> None:
        for card in self.cards if now is not None else ():
            if card.isAncestorOf(now):
                self.select(card.number)

    def _show_selected(self) -> None:
        number = self._selected
        for card in self.cards:
            card.setProperty("selected", card.number == number)
            restyle(card)
        self.selected.emit(number, None if number is None else self._obstacles[number])

    def set_bounds(self, bounds: Sequence[float], gravity: Sequence[float]) -> None:
        """Set bounds [m] and gravity of the cloth; new obstacles fit to it and lie below it."""
        low, high = np.reshape(bounds, (3, 2)).T
        self.size = float((high - low).max()) or self.size
        if any(gravity):
            self.down = np.array(gravity) / np.linalg.norm(gravity)
        self.lowest = (low + high) / 2 + (np.abs(self.down) @ (high - low) / 2) * self.down

    def kind_of(self, record: Obstacle) -> str:
        """Return the shape of an obstacle."""
        return str(record.shape)

    def change_kind(self, record: Obstacle, kind: str) -> dict[str, Any]:
        """Return the changes for another shape."""
        cleared = {key for pair in SHAPES.values() for keys in pair for key in keys}
        return {**dict.fromkeys(sorted(cleared)), "shape": kind, **self._sized(kind)}

    def change_value(self, record: Obstacle, name: str, value: Any) -> dict[str, Any]:
        """Return the changes; a displacement needs a time function, which has keys of its own."""
        changes: dict[str, Any] = {name: value}
        if name == "displacement" and value is None:
            changes |= dict.fromkeys(_MOTION)
        elif name == "displacement" and record.displacement is None:
            changes |= {"time": "ramp", "rise": TIME_DEFAULTS["rise"]}
        elif name == "time":
            needed, possible = TIME_KEYS[str(value)]
            changes |= dict.fromkeys(set(_MOTION) - {"time", *needed, *possible})
            defaults = {**TIME_DEFAULTS, "values": [0.0, 1.0]}
            changes |= {key: defaults[key] for key in needed if key not in record._values}
        return changes

    def is_optional(self, record: Obstacle, name: str) -> bool:
        """Return whether an obstacle may do without this key."""
        needed = SHAPES[record.shape][0]
        return name not in needed and name not in TIME_KEYS[record.time][0]

    def row_names(self, record: Obstacle) -> list[str]:
        """Return the keys of the rows of an obstacle."""
        needed, possible = SHAPES[record.shape]
        moves: list[str] = []
        if record.displacement is not None:
            own = TIME_KEYS[record.time]
            moves = ["time", *(key for keys in own for key in keys if key in _MOTION)]
        return ["center", *needed, *possible, "gap", "friction", "path", "displacement", *moves]

    def _sized(self, kind: str) -> dict[str, Any]:
        if kind == "mesh":
            return {"file": QFileDialog.getOpenFileName(self, "Closed mesh of an obstacle")[0]}
        scaled = dict(_SIZES[kind])
        if "radius" in scaled:
            scaled["radius"] = round_value(self.size * scaled["radius"])
        if "size" in scaled:
            scaled["size"] = [round_value(self.size * side) for side in scaled["size"]]
        return scaled
