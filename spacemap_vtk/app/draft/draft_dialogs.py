"""Dialogs that ask for a draw and for a number of repeats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QLabel,
    QWidget,
)

from spacemap_vtk.app.widgets import CountBox, mark_bad, note
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.ndarrays import Ints
from spacemap_vtk.textile.drafts import draws

#: Most numbers in the preview of a draw.
_MAX_PREVIEW = 32


@dataclass(frozen=True)
class _Draw:
    """A kind of draw: its fields besides the first and last shaft, and how it is computed."""

    make: Callable[..., Ints]
    #: Label and default of each further argument; 0: the number of shafts.
    fields: tuple[tuple[str, int], ...] = ()
    about: str = ""


_DRAWS = {
    "Straight": _Draw(draws.straight_draw, about="In order, again and again."),
    "Point": _Draw(draws.point_draw, about="There and back; the turning threads are not doubled."),
    "Broken": _Draw(
        draws.broken_draw,
        (("Threads in a run", 0),),
        "Up, then down from half the shafts away: herringbone. Runs of 2 on 4 shafts: 1 2 4 3.",
    ),
    "Advancing": _Draw(
        draws.advancing_draw,
        (("Threads in a run", 4), ("Advance by", 1)),
        "Rising runs, each of which begins a little higher.",
    ),
    "With a step": _Draw(draws.straight_draw, (("Step", 2),), "Over shafts, as for satins."),
}


class _FormDialog(QDialog):
    """A dialog with a form, a note and buttons."""

    def __init__(self, parent: QWidget | None, title: str) -> None:
        super().__init__(parent, windowTitle=title)
        self.form = QFormLayout(self)
        self.form.setContentsMargins(16, 16, 16, 12)
        self.summary = note("", "note")
        self.summary.setMinimumSize(330, 4 * self.summary.fontMetrics().lineSpacing())
        standard = QDialogButtonBox.StandardButton
        self.buttons = QDialogButtonBox(standard.Ok | standard.Cancel)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)

    def finish(self) -> None:
        """Add the note and the buttons below the fields."""
        self.form.addRow(self.summary)
        self.form.addRow(self.buttons)

    def show_summary(self, text: str, bad: bool = False) -> None:
        """Show a text about the fields; a bad one forbids OK."""
        mark_bad(self.summary, bad)
        self.buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(not bad)
        self.summary.setText(text)


class DrawDialog(_FormDialog):
    """Ask for the draw of ends or picks."""

    def __init__(
        self, parent: QWidget | None, count: int, places: tuple[int, int], highest: int, what: str
    ) -> None:
        super().__init__(parent, "Fill with a draw")
        self._count = count
        self.kind = QComboBox()
        self.kind.addItems(list(_DRAWS))
        self.form.addRow("Draw", self.kind)
        tip = f"A larger number than in the other field draws downwards; up to {highest}"
        self.first, self.last = (
            CountBox(minimum=1, maximum=highest, value=place, toolTip=tip) for place in places
        )
        self.form.addRow(f"From {what}", self.first)
        self.form.addRow(f"To {what}", self.last)
        self.labels = QLabel(), QLabel()
        self.extra = CountBox(maximum=4096), CountBox(maximum=4096)
        for label, field in zip(self.labels, self.extra, strict=True):
            self.form.addRow(label, field)
        for field in (self.first, self.last, *self.extra):
            field.valueChanged.connect(self._preview)
        self.kind.currentTextChanged.connect(self._show_fields)
        self.finish()
        self._show_fields()

    @property
    def numbers(self) -> Ints:
        """Shaft or treadle of each thread."""
        draw = _DRAWS[self.kind.currentText()]
        extra = (field.value() for field, _ in zip(self.extra, draw.fields, strict=False))
        return draw.make(self._count, self.first.value(), self.last.value(), *extra)

    def _show_fields(self) -> None:
        fields = _DRAWS[self.kind.currentText()].fields
        for index, (label, field) in enumerate(zip(self.labels, self.extra, strict=True)):
            used = index < len(fields)
            self.form.setRowVisible(field, used)
            if used:
                name, default = fields[index]
                label.setText(name)
                field.setMinimum(min(default, 1))
                field.setSpecialValueText("" if default else "as many as shafts")
                field.setValue(default)
        self._preview()

    def _preview(self) -> None:
        try:
            numbers = self.numbers.tolist()
        except SpacemapError as error:
            self.show_summary(str(error), bad=True)
            return
        more = " …" if len(numbers) > _MAX_PREVIEW else ""
        words = " ".join(map(str, numbers[:_MAX_PREVIEW]))
        self.show_summary(f"{_DRAWS[self.kind.currentText()].about}\n{words}{more}")


class RepeatDialog(_FormDialog):
    """Ask how often ends or picks are repeated."""

    def __init__(self, parent: QWidget | None, count: int, what: str) -> None:
        super().__init__(parent, f"Repeat {what}")
        self._count, self._what = count, what
        self.times = CountBox(minimum=2, maximum=4096 // max(count, 1) or 2, value=2)
        self.mirrored = QCheckBox("Mirror every second copy")
        self.mirrored.setToolTip("The thread at each turn stands only once")
        self.form.addRow("Times", self.times)
        self.form.addRow(self.mirrored)
        self.times.valueChanged.connect(self._preview)
        self.mirrored.toggled.connect(self._preview)
        self.finish()
        self._preview()

    def _preview(self) -> None:
        step = self._count - self.mirrored.isChecked()
        count = self._count + step * (self.times.value() - 1)
        self.show_summary(f"{self._count} {self._what} become {count}; those after them move on.")
