"""Editor of loads: a card for each load, made from its declared parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QLabel,
    QMenu,
    QToolButton,
    QWidget,
)

from spacemap_vtk.app.fields.editor import Editor, ignore_wheel
from spacemap_vtk.app.fields.parameter_row import ParameterRow, make_editor
from spacemap_vtk.app.widgets import column, row, tool_button
from spacemap_vtk.filters.load import ACTIONS, TIME_KEYS, Load, Loads

#: First values of a new load, by action.
_ACTION_DEFAULTS: dict[str, dict[str, Any]] = {
    "pressure": {"pressure": "1 Pa", "on": "-z"},
    "traction": {"traction": ["1 Pa", 0.0, 0.0], "on": "-z"},
    "force": {"force": ["1 mN", 0.0, 0.0], "at": [0.0, 0.0, 0.0]},
    "array": {"array": "force"},
    "gravity": {"gravity": [0.0, "-1 g", 0.0]},
    "base_acceleration": {"base_acceleration": [0.0, 0.0, "1 g"]},
    "base_displacement": {"base_displacement": [0.0, 0.0, "1 mm"]},
}
#: First values of the required parameters of time functions.
_TIME_DEFAULTS: dict[str, Any] = {
    "length": "100 ms",
    "rise": "100 ms",
    "times": [0.0, 0.1],
    "values": [1.0, 0.0],
    "frequency": "10 Hz",
}
assert set(_ACTION_DEFAULTS) == set(ACTIONS)


class LoadsEditor(Editor):
    """Cards of the loads, and a button to add a load."""

    def __init__(self, parameter: Loads) -> None:
        super().__init__(parameter)
        self.cards: list[_LoadCard] = []
        self._tables: list[dict[str, Any]] = []
        self.add_button = QToolButton(text="Add load ▾")
        self.add_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self.add_button)
        self._declared = parameter
        for action in parameter.actions:
            menu.addAction(action.replace("_", " ").capitalize()).setData(action)
        menu.triggered.connect(self.add_load)
        self.add_button.setMenu(menu)
        self._layout = column(self, self.add_button)

    def show_value(self, value: Any) -> None:
        tables = [load._values for load in value]
        # Reuse cards that have the same rows: making a card costs as much as a frame.
        for number, load in enumerate(value):
            present = self.cards[number : number + 1]
            if not present or present[0].keys != _row_names(load, self._declared):
                self._remove_cards(present)
                self._insert_card(_LoadCard(number, load, self._declared))
        self._remove_cards(self.cards[len(value) :])
        for card, load in zip(self.cards, value, strict=True):
            card.show_load(load)
        self._tables = [{k: _as_written(v) for k, v in table.items()} for table in tables]

    def _insert_card(self, card: _LoadCard) -> None:
        card.edited.connect(self._change_load)
        card.dragging.connect(self.dragging)
        card.restored.connect(self.restored)
        self._layout.insertWidget(card.number, card)
        self.cards.insert(card.number, card)

    def _remove_cards(self, cards: list[_LoadCard]) -> None:
        for card in cards:
            self.cards.remove(card)
            self._layout.removeWidget(card)
            card.hide()
            card.deleteLater()

    def add_load(self, action: Any) -> None:
        self.edited.emit([*self._tables, dict(_ACTION_DEFAULTS[action.data()])], 0)

    def _change_load(self, number: int, changes: dict[str, Any] | None, burst: int) -> None:
        tables = [dict(table) for table in self._tables]
        if changes is None:
            del tables[number]
        else:
            changed = tables[number] | changes
            tables[number] = {key: value for key, value in changed.items() if value is not None}
        self.edited.emit(tables, burst)


class _LoadCard(QFrame):
    """A card for one load: action, place and time function."""

    #: Index of the load, changed values (None removes the load), and burst.
    edited = Signal(int, object, int)
    dragging = Signal(bool)
    #: As `Editor.restored`.
    restored = Signal()

    def __init__(self, number: int, load: Load, declared: Loads) -> None:
        super().__init__(objectName="card")
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self.number, self.keys = number, _row_names(load, declared)
        self.action = QComboBox()
        self.action.activated.connect(self._change_action)
        ignore_wheel(self.action)
        for action in declared.actions:
            self.action.addItem(action.replace("_", " ").capitalize(), action)
        self.remove_button = tool_button("✕", "Remove this load")
        self.remove_button.clicked.connect(lambda: self.edited.emit(number, None, 0))
        head = row(None, QLabel(f"{number + 1}."), (self.action, 1), self.remove_button)
        self.rows: dict[str, QWidget] = {}
        for name in self.keys:
            parameter = Load.parameters[name]
            row_widget = ParameterRow(parameter, make_editor(parameter))
            row_widget.resettable = name in TIME_KEYS[load.time][1]
            row_widget.edited.connect(self._change_value)
            row_widget.dragging.connect(self.dragging)
            row_widget.restored.connect(self.restored)
            self.rows[name] = row_widget
        column(self, head, *self.rows.values(), margins=(8, 6, 6, 4), spacing=4)

    def show_load(self, load: Load) -> None:
        """Show a load of the same kind."""
        self._load = load
        with QSignalBlocker(self.action):
            self.action.setCurrentIndex(self.action.findData(load.action))
        for name, shown in self.rows.items():
            shown.show_value(getattr(load, name), name not in load._values)

    def _change_action(self, _index: int) -> None:
        chosen = self.action.currentData()
        if chosen != self._load.action:
            cleared = dict.fromkeys([self._load.action, "on", "at", "follower"])
            self.edited.emit(self.number, {**cleared, **_ACTION_DEFAULTS[chosen]}, 0)

    def _change_value(self, name: str, written: object, burst: int) -> None:
        changes: dict[str, Any] = {name: written}
        if name == "time":
            needed, possible = TIME_KEYS[str(written)]
            others = {key for pair in TIME_KEYS.values() for keys in pair for key in keys}
            changes |= dict.fromkeys(others - set(needed) - set(possible))
            changes |= {key: _TIME_DEFAULTS[key] for key in needed if key not in self._load._values}
        self.edited.emit(self.number, changes, burst)


def _row_names(load: Load, declared: Loads) -> list[str]:
    """Return the keys of the rows of a load, starting with its action."""
    place = ACTIONS[load.action]
    needed, possible = TIME_KEYS[load.time]
    times = ["time", *needed, *possible] if declared.timed else []
    follower = ["follower"] if load.action == "pressure" and declared.timed else []
    return [load.action, *([place] if place else []), *follower, *times]


def _as_written(value: Any) -> Any:
    """Convert a valid value to its form in a scene file."""
    if isinstance(value, tuple):
        return [_as_written(item) for item in value]
    return str(value) if isinstance(value, Path) else value
