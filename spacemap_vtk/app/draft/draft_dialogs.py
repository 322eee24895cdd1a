"""Dialogs that ask for a draw and for a number of repeats."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtWidgets import QCheckBox, QComboBox, QLabel, QWidget

from spacemap_vtk.app.form_dialog import FormDialog
from spacemap_vtk.app.widgets import CountBox
from spacemap_vtk.ndarrays import Ints
from spacemap_vtk.textile.drafts.draws import make_draw

#: Most numbers in the preview of a draw.
_MAX_PREVIEW = 32


@dataclass(frozen=True)
class _Draw:
    """A draw with its fields besides the first and last shaft."""

    kind: str
    #: Label and default of each further argument; 0: the number of shafts.
    fields: tuple[tuple[str, int], ...] = ()
    about: str = ""


_DRAWS = {
    "Straight": _Draw("straight", about="In order, again and again."),
    "Point": _Draw("point", about="There and back; the turning threads are not doubled."),
    "Broken": _Draw(
        "broken",
        (("Threads in a run", 0),),
        "Up, then down from half the shafts away: herringbone. Runs of 2 on 4 shafts: 1 2 4 3.",
    ),
    "Advancing": _Draw(
        "advancing",
        (("Threads in a run", 4), ("Advance by", 1)),
        "Rising runs, each of which begins a little higher.",
    ),
    "With a step": _Draw("straight", (("Step", 2),), "Over shafts, as for satins."),
}


class DrawDialog(FormDialog):
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
            field.valueChanged.connect(self.update_summary)
        self.kind.currentTextChanged.connect(self._show_fields)
        self.finish()
        self._show_fields()

    @property
    def numbers(self) -> Ints:
        """Shaft or treadle of each thread."""
        draw = _DRAWS[self.kind.currentText()]
        extra = (field.value() for field, _ in zip(self.extra, draw.fields, strict=False))
        places = self.first.value(), self.last.value()
        return make_draw(draw.kind, self._count, *places, *extra)

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
        self.update_summary()

    def describe(self) -> str:
        """Describe the draw, and return the first of its numbers."""
        numbers = self.numbers.tolist()
        more = " …" if len(numbers) > _MAX_PREVIEW else ""
        words = " ".join(map(str, numbers[:_MAX_PREVIEW]))
        return f"{_DRAWS[self.kind.currentText()].about}\n{words}{more}"


class RepeatDialog(FormDialog):
    """Ask how often ends or picks are repeated."""

    def __init__(self, parent: QWidget | None, count: int, what: str) -> None:
        super().__init__(parent, f"Repeat {what}")
        self._count, self._what = count, what
        self.times = CountBox(minimum=2, maximum=4096 // max(count, 1) or 2, value=2)
        self.mirrored = QCheckBox("Mirror every second copy")
        self.mirrored.setToolTip("The thread at each turn stands only once")
        self.form.addRow("Times", self.times)
        self.form.addRow(self.mirrored)
        self.times.valueChanged.connect(self.update_summary)
        self.mirrored.toggled.connect(self.update_summary)
        self.finish()

    def describe(self) -> str:
        """Return the number of threads."""
        step = self._count - self.mirrored.isChecked()
        count = self._count + step * (self.times.value() - 1)
        return f"{self._count} {self._what} become {count}; those after them move on."


class ExchangeDialog(FormDialog):
    """Ask which shafts or treadles are exchanged."""

    def __init__(
        self, parent: QWidget | None, what: str, count: int, proposal: tuple[int, int]
    ) -> None:
        super().__init__(parent, f"Exchange {what}s", "Exchange")
        self._what = what
        self.numbers = tuple(CountBox(minimum=1, maximum=count, value=n) for n in proposal)
        for label, field in zip((what.capitalize(), "and"), self.numbers, strict=True):
            self.form.addRow(label, field)
            field.valueChanged.connect(self.update_summary)
        self.finish()

    def describe(self) -> str:
        """Return what changes."""
        rows = "threading" if self._what == "shaft" else "treadling"
        return f"They change places in the {rows} and in the tie-up, so the cloth stays the same."
