"""Editor of a colour."""

from __future__ import annotations

from typing import Any

from PySide6.QtGui import QColor
from PySide6.QtWidgets import QColorDialog, QHBoxLayout, QLineEdit, QPushButton

from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.parameters import Parameter


class ColorEditor(Editor):
    """A patch of the colour, which opens a dialog, and its digits."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.button = QPushButton()
        self.button.setFixedWidth(40)
        self.button.setToolTip("Choose a colour")
        self.line = QLineEdit()
        self.line.setPlaceholderText(parameter.automatic)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.button)
        layout.addWidget(self.line, 1)
        self.setFocusProxy(self.line)
        self.line.textEdited.connect(self.is_new)
        self.line.editingFinished.connect(self._typed)
        self.button.clicked.connect(self._choose)

    def show_value(self, value: Any) -> None:
        """Show patch and digits."""
        self.shown = "" if value is None else self.parameter.show(value)
        self.line.setText(self.shown)
        fill = self.shown or "transparent"
        self.button.setStyleSheet(
            f"background-color: {fill}; border: 1px solid #8a94a3; border-radius: 4px;"
        )

    def _typed(self) -> None:
        if self.is_new(self.line.text()):
            self.edited.emit(self.line.text() or None, 0)

    def _choose(self) -> None:
        color = QColorDialog.getColor(QColor(self.shown), self, self.parameter.label)
        if color.isValid():
            self.edited.emit(color.name(), 0)
