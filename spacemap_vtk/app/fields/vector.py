"""Editor of a vector."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import QGridLayout, QLabel

from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.number import NumberEditor
from spacemap_vtk.parameters import AUTOMATIC, Vector


class VectorEditor(Editor):
    """A line and a slider for each component; the unit stands once, and others can be typed."""

    def __init__(self, parameter: Vector) -> None:
        super().__init__(parameter)
        self.components: list[NumberEditor] = []
        self._value: tuple[Any, ...] | None = None
        layout = QGridLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setHorizontalSpacing(6)
        for column, label in enumerate(parameter.labels):
            editor = NumberEditor(parameter.component, bare=True)
            editor.setObjectName(label)
            editor.edited.connect(self._edited)
            editor.held.connect(self.held)
            editor.restored.connect(self._restored)
            editor.line.setMinimumWidth(34)
            editor.slider.setMinimumWidth(34)
            head = f"{label}  [{parameter.unit}]" if parameter.unit else label
            name = QLabel(head if column == 0 else label)
            name.setObjectName("about")
            layout.addWidget(name, 0, column)
            layout.addWidget(editor, 1, column)
            layout.setColumnStretch(column, 1)
            self.components.append(editor)
        self.setFocusProxy(self.components[0])

    def show_value(self, value: Any) -> None:
        """Show the components in SI."""
        self._value = value
        for number, editor in enumerate(self.components):
            editor.show_value(None if value is None else value[number])

    def _restored(self) -> None:
        if all(editor.line.text() == editor.shown for editor in self.components):
            self.restored.emit()

    def _edited(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            self.edited.emit(AUTOMATIC, burst)  # all components or none
            return
        moved = self.components.index(self.sender())
        # Of a vector that was automatic, the other components begin at zero.
        values = list(self._value or [0.0] * len(self.components))
        values[moved] = 0.0 if written is None else written
        self.edited.emit(values, burst)
