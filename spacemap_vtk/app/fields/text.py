"""Editor for any kind of parameter: a line of text, as a scene file would have it."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import QHBoxLayout, QLineEdit

from spacemap_vtk.app.fields.editor import Editor, written_from
from spacemap_vtk.parameters import Parameter


class TextEditor(Editor):
    """A line of text; Enter or leaving the line sets it."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.line = QLineEdit()
        self.line.setPlaceholderText(parameter.automatic)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.line)
        self.setFocusProxy(self.line)
        self.line.textEdited.connect(self.is_new)
        self.line.editingFinished.connect(self._finished)

    def show_value(self, value: Any) -> None:
        """Show it with its unit."""
        self.shown = "" if value is None else _bare(self.parameter.show(value))
        self.line.setText(self.shown)

    def _finished(self) -> None:
        # Leaving a line that nobody touched is no edit.
        if self.is_new(self.line.text()):
            text = self.line.text()
            written = None if text == "" and self.parameter.optional else written_from(text)
            self.edited.emit(written, 0)


def _bare(text: str) -> str:
    """Leave out quotes round the whole: people do not type them."""
    quoted = len(text) >= 2 and text[0] == text[-1] == '"' and '"' not in text[1:-1]
    return text[1:-1] if quoted else text
