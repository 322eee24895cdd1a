"""Editor of a vector."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import QHBoxLayout, QLabel, QLineEdit

from spacemap_vtk.app.fields.editor import Editor, written_from
from spacemap_vtk.parameters import Vector


class VectorEditor(Editor):
    """A line for each component, which knows its unit."""

    def __init__(self, parameter: Vector) -> None:
        super().__init__(parameter)
        self.vector = parameter
        self.lines: list[QLineEdit] = []
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        for label in parameter.labels:
            line = QLineEdit()
            line.setMinimumWidth(36)
            line.editingFinished.connect(self._finished)
            layout.addWidget(QLabel(label))
            layout.addWidget(line, 1)
            self.lines.append(line)
        if parameter.unit:
            layout.addWidget(QLabel(parameter.unit))
        self.setFocusProxy(self.lines[0])
        self._shown = [""] * len(self.lines)

    def show_value(self, value: Any) -> None:
        """Show the components in SI."""
        self._shown = [f"{number:.6g}" for number in value] if value else [""] * len(self.lines)
        for line, text in zip(self.lines, self._shown, strict=True):
            line.setText(text)

    def _finished(self) -> None:
        texts = [line.text() for line in self.lines]
        if texts == self._shown:
            return
        # Refused texts are kept in sight; the same ones are not offered twice.
        self._shown = texts
        self.edited.emit([written_from(text) for text in texts], 0)
