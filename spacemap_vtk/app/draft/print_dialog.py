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
from spacemap_vtk.draw.draft_print.settings import STARTS, PrintSettings, local_paper
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.textile.drafts.draft import Draft

#: Fields of `PrintSettings` that are chosen: labels, and the shown name of each value.
_CHOICES = {
    "paper": ("Paper", {"a4": "A4", "letter": "Letter"}),
    "orientation": (
        "Orientation",
        {"auto": "Fewest pages", "portrait": "Portrait", "landscape": "Landscape"},
    ),
    "faces": ("Faces", {"both": "Both", "face": "Face", "reverse": "Reverse"}),
    "start": (
        "First end and pick",
        {STARTS[0]: "Bottom left, as the cloth", STARTS[1]: "Top right, beside the tie-up"},
    ),
}
#: Fields that are typed: labels, and explanations.
_LINES = {
    "floats": (
        "Mark floats longer than",
        "Number of threads that a float passes, or a length such as 10mm",
    ),
    "cell": ("Least cell", "Side of a cell, 2mm or more; larger cells need more pages"),
    "ends": ("Ends", "Empty for all, or a part such as 1-200"),
    "picks": ("Picks", "Empty for all, or a part such as 1-200"),
}
#: Fields that are kept for the next draft, with this prefix in the settings.
_KEPT, _KEY = ("paper", "start"), "print/"


class PrintDialog(QDialog):
    """Ask how a draft is printed."""

    def __init__(self, parent: QWidget, draft: Draft) -> None:
        super().__init__(parent, windowTitle="Print draft")
        self._draft = draft
        usual = PrintSettings(paper=local_paper())
        form = QFormLayout(self)
        form.setContentsMargins(16, 16, 16, 12)
        self.boxes: dict[str, QComboBox] = {}
        for key, (label, names) in _CHOICES.items():
            box = QComboBox()
            for value, name in names.items():
                box.addItem(name, value)
            kept = QSettings().value(_KEY + key) if key in _KEPT else None
            box.setCurrentIndex(max(0, box.findData(kept or getattr(usual, key))))
            form.addRow(label, box)
            self.boxes[key] = box
        self.lines: dict[str, QLineEdit] = {}
        for key, (label, tip) in _LINES.items():
            line = QLineEdit(getattr(usual, key), toolTip=tip, placeholderText="all")
            line.textChanged.connect(self._check)
            form.addRow(label, line)
            self.lines[key] = line
        tip = "Black where an end is on top, letters for the yarns"
        self.mono = QCheckBox("Without colours", toolTip=tip)
        form.addRow(self.mono)
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
    def fields(self) -> dict[str, Any]:
        """Values of `PrintSettings` by field."""
        chosen = {key: box.currentData() for key, box in self.boxes.items()}
        typed = {key: line.text().strip() for key, line in self.lines.items()}
        return {**chosen, **typed, "mono": self.mono.isChecked()}

    def accept(self) -> None:
        """Keep paper and direction for the next draft, and accept."""
        for key in _KEPT:
            QSettings().setValue(_KEY + key, self.boxes[key].currentData())
        super().accept()

    def _check(self) -> None:
        """Describe what is printed, or explain why it is not possible."""
        try:
            settings = PrintSettings(**self.fields)
            part, _ = settings.select(self._draft)
            settings.limits(part)
            text, bad = "{} ends and {} picks.".format(*part.size), False
        except SpacemapError as error:
            text, bad = str(error), True
        mark_bad(self.summary, bad)
        self.save_button.setEnabled(not bad)
        self.summary.setText(text)
