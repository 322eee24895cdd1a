"""Editor of true and false."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import QCheckBox, QHBoxLayout

from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.parameters import Parameter


class FlagEditor(Editor):
    """A check box."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.box = QCheckBox("On")
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.box)
        self.setFocusProxy(self.box)
        self.box.clicked.connect(self._clicked)

    def show_value(self, value: Any) -> None:
        """Check or clear the box."""
        self.box.setChecked(bool(value))

    def _clicked(self, checked: bool) -> None:
        self.edited.emit(checked, 0)
