"""Editor of a file's path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QLineEdit, QPushButton

from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.parameters import Parameter


class FileEditor(Editor):
    """A path, and a button that opens a dialog."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.line = QLineEdit()
        self.line.setPlaceholderText(parameter.automatic)
        self.button = QPushButton("Browse…")
        #: What to call a file.
        self.told: Callable[[Path], str] = str
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.line, 1)
        layout.addWidget(self.button)
        self.setFocusProxy(self.line)
        self.line.textEdited.connect(self.is_new)
        self.line.editingFinished.connect(self._typed)
        self.button.clicked.connect(self._browse)

    def show_value(self, value: Any) -> None:
        """Show the path."""
        self._file = "" if value is None else str(value)
        self.shown = "" if value is None else self.told(value)
        self.line.setText(self.shown)

    def _typed(self) -> None:
        if self.is_new(self.line.text()):
            self.edited.emit(self.line.text() or None, 0)

    def _browse(self) -> None:
        file, _ = QFileDialog.getOpenFileName(self, self.parameter.label, self._file)
        if file:
            self.edited.emit(file, 0)
