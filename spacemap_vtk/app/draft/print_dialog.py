"""Dialog for a printed draft: paper, faces, floats to mark, part of the draft."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QCheckBox, QComboBox, QLineEdit, QWidget

from spacemap_vtk.app.form_dialog import FormDialog
from spacemap_vtk.draw.draft_print.settings import PrintSettings, local_paper
from spacemap_vtk.parameters import AUTOMATIC, Choice, Flag
from spacemap_vtk.textile.drafts.draft import Draft

#: Settings that are kept for the next draft, with this prefix of their keys.
_KEPT, _KEY = ("paper", "start", "mono"), "print/"
#: Labels of settings and choices, where those for commands are shorter than usual in dialogs.
_LABELS = {
    AUTOMATIC: "Automatic",
    "cell": "Least side of a cell",
    "floats": "Mark floats over",
    "start": "End 1 and pick 1",
    "mono": "Black and white",
    "bottom-left": "At the bottom left",
    "top-right": "At the top right",
}
#: Settings that the dialog does not ask for.
_HIDDEN = ("pages",)


class PrintDialog(FormDialog):
    """Ask how a draft is printed."""

    def __init__(self, parent: QWidget | None, draft: Draft) -> None:
        super().__init__(parent, "Print draft", "Save as PDF…")
        self._draft = draft
        #: Editor of each setting.
        self.fields: dict[str, QWidget] = {}
        for parameter in PrintSettings.parameters.values():
            if parameter.name in _HIDDEN:
                continue
            default = parameter.automatic or parameter.default_text.strip('"')
            kept = QSettings().value(_KEY + parameter.name) if parameter.name in _KEPT else None
            field: QWidget
            if isinstance(parameter, Choice):
                field = QComboBox()
                for word in (*([AUTOMATIC] if parameter.automatic else []), *parameter.choices):
                    field.addItem(_LABELS.get(word, word.replace("-", " ").capitalize()), word)
                usual = local_paper() if parameter.name == "paper" else parameter.default
                field.setCurrentIndex(field.findData(kept or usual or AUTOMATIC))
                field.currentIndexChanged.connect(self.update_summary)
            elif isinstance(parameter, Flag):
                field = QCheckBox(checked=kept == "true")
            else:
                field = QLineEdit(placeholderText=default)
                field.textChanged.connect(self.update_summary)
            field.setToolTip(f"{parameter.help}\n\nAllowed: {parameter.allowed}.")
            self.form.addRow(_LABELS.get(parameter.name, parameter.label), field)
            self.fields[parameter.name] = field
        self.finish()

    @property
    def settings(self) -> PrintSettings:
        """The settings; refused values raise an error."""
        settings = PrintSettings()
        for name, field in self.fields.items():
            value: Any
            if isinstance(field, QComboBox):
                value = field.currentData()
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

    def describe(self) -> str:
        """Return the size of what is printed."""
        settings = self.settings
        part, _ = settings.select(self._draft)
        settings.limits(part)
        return "{} ends and {} picks.".format(*part.size)
