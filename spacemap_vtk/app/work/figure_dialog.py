"""Dialog for a page for a publication: its parts, width and colours."""

from __future__ import annotations

from PySide6.QtWidgets import QCheckBox, QComboBox, QLineEdit, QWidget

from spacemap_vtk.app.form_dialog import FormDialog
from spacemap_vtk.draw.figure.figure_page import FigurePage
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import parse_quantity

#: Parts of the page by name; an empty list: those that suit the scene.
_PARTS: dict[str, list[str]] = {
    "Those that suit the scene": [],
    "Pictures": ["pictures"],
    "Draft and cloth": ["draft", "cloth"],
    "Sections": ["section"],
    "Everything": ["pictures", "draft", "cloth", "section"],
}
#: Widths of pages in mm.
_WIDTHS = {"Two columns (180 mm)": 180.0, "One column (88 mm)": 88.0, "Slide (254 mm)": 254.0}


class FigureDialog(FormDialog):
    """Ask what a page shows, and how wide it is."""

    def __init__(self, parent: QWidget | None, scene: Scene) -> None:
        super().__init__(parent, "Export figure page", "Save…")
        form = self.form
        self.parts, self.width_choice = QComboBox(), QComboBox()
        woven = scene.woven is not None
        self.parts.addItems([name for name in _PARTS if woven or name in [*_PARTS][:2]])
        self.width_choice.addItems(list(_WIDTHS))
        self.times = QLineEdit(placeholderText="the start, a quarter and a half of a period")
        self.times.setToolTip("Times of the pictures, separated by commas, for example 0, 20 ms")
        self.cage = QCheckBox("Cages in a row above the pictures")
        self.dark = QCheckBox("Light lines on a dark page")
        self.transparent = QCheckBox("Transparent background")
        form.addRow("Parts", self.parts)
        form.addRow("Width", self.width_choice)
        if scene.moves:
            form.addRow("Times", self.times)
            form.addRow("", self.cage)
        form.addRow("", self.dark)
        form.addRow("", self.transparent)
        self.times.textChanged.connect(self.update_summary)
        self.finish()

    @property
    def page(self) -> FigurePage:
        """The page; refused values raise an error."""
        words = filter(None, map(str.strip, self.times.text().split(",")))
        return FigurePage(
            panels=_PARTS[self.parts.currentText()],
            times=[parse_quantity(word, "s") for word in words],
            cage=self.cage.isChecked(),
            width=_WIDTHS[self.width_choice.currentText()],
            dark=self.dark.isChecked(),
            transparent=self.transparent.isChecked(),
        )

    def describe(self) -> str:
        """Return what pictures of the page have in common."""
        _ = self.page
        return "Pictures share one camera and one colour scale."
