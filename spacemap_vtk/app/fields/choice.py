"""Editor of a choice."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import QComboBox, QHBoxLayout

from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.wheel import leave_wheel
from spacemap_vtk.parameters import Choice


class ChoiceEditor(Editor):
    """A combo box with the declared words."""

    def __init__(self, parameter: Choice) -> None:
        super().__init__(parameter)
        self.box = QComboBox()
        leave_wheel(self.box)
        self.box.addItems(parameter.choices)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.box)
        self.setFocusProxy(self.box)
        self.box.textActivated.connect(self._chosen)

    def show_value(self, value: Any) -> None:
        """Choose it."""
        self.box.setCurrentText(str(value))

    def _chosen(self, text: str) -> None:
        self.edited.emit(text, 0)
