"""Dialog for a printed draft: paper, faces, floats to mark, part of the draft."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QLineEdit,
    QWidget,
)

from spacemap_vtk.app.widgets import mark_bad, note
from spacemap_vtk.draw.draft_print.settings import PrintSettings, local_paper
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.parameters import AUTOMATIC, Choice, Flag
from spacemap_vtk.textile.drafts.draft import Draft

#: Settings that are kept for the next draft, with this prefix of their keys.
_KEPT, _KEY = ("paper", "start", "mono"), "print/"
#: Settings that the dialog does not ask for.
_HIDDEN = ("pages",)


class PrintDialog(QDialog):
    """Ask how a draft is printed."""

    def __init__(self, parent: QWidget | None, draft: Draft) -> None:
        super().__init__(parent, windowTitle="Print draft")
        self._draft = draft
        #: Editor of each setting.
        self.fields: dict[str, QWidget] = {}
        form = QFormLayout(self)
        form.setContentsMargins(16, 16, 16, 12)
        for parameter in PrintSettings.parameters.values():
            if parameter.name in _HIDDEN:
                continue
            default = parameter.automatic or parameter.default_text.strip('"')
            kept = QSettings().value(_KEY + parameter.name) if parameter.name in _KEPT else None
            field: QWidget
            if isinstance(parameter, Choice):
                field = QComboBox()
                field.addItems([*([AUTOMATIC] if parameter.automatic else []), *parameter.choices])
                usual = local_paper() if parameter.name == "paper" else parameter.default
                field.setCurrentText(str(kept or usual or AUTOMATIC))
                field.currentTextChanged.connect(self._check)
            elif isinstance(parameter, Flag):
                field = QCheckBox(checked=kept == "true")
            else:
                field = QLineEdit(placeholderText=default)
                field.textChanged.connect(self._check)
            field.setToolTip(f"{parameter.help}\n\nAllowed: {parameter.allowed}.")
            form.addRow(parameter.label, field)
            self.fields[parameter.name] = field
        self.summary = note("", "note")
        self.summary.setMinimumSize(360, 3 * self.summary.fontMetrics().lineSpacing())
        button = QDialogButtonBox.StandardButton
        buttons = QDialogButtonBox(button.Save | button.Cancel)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        self.save_button = buttons.button(button.Save)
        self.save_button.setText("Save as PDF…")
        form.addRow(self.summary)
        form.addRow(buttons)
        self._check()

    @property
    def settings(self) -> PrintSettings:
        """The settings; refused values raise an error."""
        settings = PrintSettings()
        for name, field in self.fields.items():
            value: Any
            if isinstance(field, QComboBox):
                value = field.currentText()
            elif isinstance(field, QCheckBox):
                value = field.isChecked()
            else:
                value = field.text().strip() if isinstance(field, QLineEdit) else ""
            if value not in ("", AUTOMATIC):
                settings.set_from_scene(name, value)
        return settings

    def accept(self) -> None:
        """Keep some settings for the next draft, and accept."""
        settings = self.settings
        for name in _KEPT:
            value = getattr(settings, name)
            QSettings().setValue(_KEY + name, str(value).lower())
        super().accept()

    def _check(self) -> None:
        """Describe what is printed, or explain why it is not possible."""
        try:
            settings = self.settings
            part, _ = settings.select(self._draft)
            settings.limits(part)
            text, bad = "{} ends and {} picks.".format(*part.size), False
        except SpacemapError as error:
            text, bad = str(error), True
        mark_bad(self.summary, bad)
        self.save_button.setEnabled(not bad)
        self.summary.setText(text)
