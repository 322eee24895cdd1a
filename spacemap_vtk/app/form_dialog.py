"""A dialog with a form, a text about what is entered, and buttons."""

from __future__ import annotations

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QWidget

from spacemap_vtk.app.widgets import mark_bad, note
from spacemap_vtk.errors import SpacemapError


class FormDialog(QDialog):
    """Ask for values; subclasses add fields to `form`, then call `finish`."""

    def __init__(
        self, parent: QWidget | None, title: str, accept: str = "OK", width: int = 380
    ) -> None:
        super().__init__(parent, windowTitle=title)
        self.form = QFormLayout(self)
        self.form.setContentsMargins(16, 16, 16, 12)
        #: Describes what is entered, or why it is refused.
        self.summary = note("", "note")
        self.summary.setMinimumSize(width, 3 * self.summary.fontMetrics().lineSpacing())
        standard = QDialogButtonBox.StandardButton
        self._buttons = QDialogButtonBox(standard.Ok | standard.Cancel)
        self._buttons.accepted.connect(self.accept)
        self._buttons.rejected.connect(self.reject)
        self.accept_button = self._buttons.button(standard.Ok)
        self.accept_button.setText(accept)

    def describe(self) -> str:
        """Describe what is entered, or raise an error."""
        return ""

    def finish(self) -> None:
        """Add summary and buttons below the fields."""
        self.form.addRow(self.summary)
        self.form.addRow(self._buttons)
        self.update_summary()

    def update_summary(self, *_: object) -> None:
        """Describe what is entered, or explain why it is not possible."""
        try:
            text, bad = self.describe(), False
        except SpacemapError as error:
            text, bad = str(error), True
        mark_bad(self.summary, bad)
        self.accept_button.setEnabled(not bad)
        self.summary.setText(text)
