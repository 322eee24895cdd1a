"""Editor of a list of records: a card for each, made from its declared parameters."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QComboBox, QFrame, QLabel, QMenu, QToolButton, QWidget

from spacemap_vtk.app.fields.basic_editors import side_label
from spacemap_vtk.app.fields.editor import Editor, ignore_wheel
from spacemap_vtk.app.fields.parameter_row import ParameterRow, make_editor
from spacemap_vtk.app.widgets import column, row, tool_button
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.records import Record
from spacemap_vtk.mechanics.boundary.places import SIDES
from spacemap_vtk.parameters import Parameter


class RecordCards(Editor):
    """Cards of records, and a button to add one of some kind."""

    def __init__(self, parameter: Parameter[Any], kinds: Iterable[str], noun: str) -> None:
        super().__init__(parameter)
        self.cards: list[RecordCard] = []
        self.kinds = list(kinds)
        self._tables: list[dict[str, Any]] = []
        self.add_button = QToolButton(text=f"Add {noun} ▾")
        self.add_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self.add_button)
        for kind in self.kinds:
            menu.addAction(label_of(kind)).setData(kind)
        menu.triggered.connect(self._add)
        self.add_button.setMenu(menu)
        self._layout = column(self, self.add_button)

    def as_value(self, tables: list[dict[str, Any]]) -> list[Any]:
        """Return the value in a scene file for the tables of all records."""
        return tables

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new record of a kind."""
        raise NotImplementedError

    def row_names(self, record: Any) -> list[str]:
        """Return the keys of the rows of a record."""
        raise NotImplementedError

    def kind_of(self, record: Any) -> str:
        """Return the kind of a record."""
        raise NotImplementedError

    def change_kind(self, record: Any, kind: str) -> dict[str, Any]:
        """Return the changes that make a record one of another kind; None removes a value."""
        raise NotImplementedError

    def change_value(self, record: Any, name: str, value: Any) -> dict[str, Any]:
        """Return all changes that follow from that of one value."""
        return {name: value}

    def is_optional(self, record: Any, name: str) -> bool:
        """Return whether a record may have no value of this name."""
        return True

    def show_value(self, value: Any) -> None:
        """Show the records on cards."""
        # Reuse cards that have the same rows: making a card costs as much as a frame.
        for number, record in enumerate(value):
            present = self.cards[number : number + 1]
            if not present or present[0].keys != self.row_names(record):
                self._remove_cards(present)
                self._insert_card(RecordCard(self, number, record))
        self._remove_cards(self.cards[len(value) :])
        for card, record in zip(self.cards, value, strict=True):
            card.show_record(record)
        self._tables = [{k: _as_written(v) for k, v in r._values.items()} for r in value]

    def _insert_card(self, card: RecordCard) -> None:
        card.edited.connect(self.change)
        card.dragging.connect(self.dragging)
        card.restored.connect(self.restored)
        self._layout.insertWidget(card.number, card)
        self.cards.insert(card.number, card)

    def _remove_cards(self, cards: list[RecordCard]) -> None:
        for card in cards:
            self.cards.remove(card)
            self._layout.removeWidget(card)
            card.hide()
            card.deleteLater()

    def _add(self, action: Any) -> None:
        self._submit([*self._tables, self.first_values(action.data())])

    def change(self, number: int, changes: dict[str, Any] | None, burst: int = 0) -> None:
        """Emit the records with some values of one changed, or without it."""
        tables = [dict(table) for table in self._tables]
        if changes is None:
            del tables[number]
        else:
            changed = tables[number] | changes
            tables[number] = {key: value for key, value in changed.items() if value is not None}
        self._submit(tables, burst)

    def _submit(self, tables: list[dict[str, Any]], burst: int = 0) -> None:
        try:
            value = self.as_value(tables)
        except InputError as error:
            self.refused.emit(error)
        else:
            self.edited.emit(value, burst)


class RecordCard(QFrame):
    """A card for one record: its kind and its values."""

    #: Index of the record, changed values (None removes the record), and burst.
    edited = Signal(int, object, int)
    #: Index of the record on whose card the mouse was pressed.
    pressed = Signal(int)
    dragging = Signal(bool)
    #: As `Editor.restored`.
    restored = Signal()

    def __init__(self, owner: RecordCards, number: int, record: Record) -> None:
        super().__init__(objectName="card")
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self._owner = owner
        self.number, self.keys = number, owner.row_names(record)
        self.kind = QComboBox()
        self.kind.activated.connect(self._change_kind)
        ignore_wheel(self.kind)
        for kind in owner.kinds:
            self.kind.addItem(label_of(kind), kind)
        self.remove_button = tool_button("✕", f"Remove this {record.noun}")
        self.remove_button.clicked.connect(lambda: self.edited.emit(number, None, 0))
        head = row(None, QLabel(f"{number + 1}."), (self.kind, 1), self.remove_button)
        self.rows: dict[str, ParameterRow] = {}
        for name in self.keys:
            parameter = type(record).parameters[name]
            shown = ParameterRow(parameter, make_editor(parameter))
            shown.resettable = owner.is_optional(record, name)
            shown.edited.connect(self._change_value)
            shown.dragging.connect(self.dragging)
            shown.restored.connect(self.restored)
            self.rows[name] = shown
        rows: list[QWidget] = list(self.rows.values())
        column(self, head, *rows, margins=(8, 6, 6, 4), spacing=4)

    def show_record(self, record: Record) -> None:
        """Show another record that has the rows of this card."""
        self._record = record
        with QSignalBlocker(self.kind):
            self.kind.setCurrentIndex(self.kind.findData(self._owner.kind_of(record)))
        for name, shown in self.rows.items():
            shown.show_value(getattr(record, name), name not in record._values)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        super().mousePressEvent(event)
        self.pressed.emit(self.number)

    def _change_kind(self, _index: int) -> None:
        chosen = self.kind.currentData()
        if chosen != self._owner.kind_of(self._record):
            self.edited.emit(self.number, self._owner.change_kind(self._record, chosen), 0)

    def _change_value(self, name: str, written: object, burst: int) -> None:
        changes = self._owner.change_value(self._record, name, written)
        self.edited.emit(self.number, changes, burst)


def label_of(kind: str) -> str:
    """Return a kind in words."""
    if kind in SIDES:
        return side_label(kind)
    return kind.replace("_", " ").capitalize()


def _as_written(value: Any) -> Any:
    """Convert a valid value to its form in a scene file."""
    if isinstance(value, tuple):
        return [_as_written(item) for item in value]
    return str(value) if isinstance(value, Path) else value
