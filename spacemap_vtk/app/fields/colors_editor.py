"""Editor of a series of colours."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QColorDialog, QWidget

from spacemap_vtk.app.fields.editor import LineEditor
from spacemap_vtk.app.widgets import column, row

_SIDE, _GAP = 20, 3
#: Side by side at most, in all the room and in half of it.
_IN_A_ROW, _IN_HALF = 11, 5


class ColorsEditor(LineEditor):
    """A swatch for each colour of the series, which opens a dialog, and their digits."""

    def __init__(self, parameter: Any) -> None:
        super().__init__(parameter)
        self.swatches = Swatches()
        self.line.setToolTip("Colours as #rrggbb; several with commas, repeated over the yarns")
        self._colors: list[str] = []
        column(self, row(None, self.swatches, None), self.line, spacing=4)
        self.swatches.chosen.connect(self._choose)

    def stack(self) -> None:
        self.swatches.in_a_row = _IN_HALF

    def show_value(self, value: Any) -> None:
        """Show swatches and digits."""
        self.show_text("" if value is None else self.parameter.show(value))
        self._colors = self.shown.split(", ") if self.shown else []
        self.swatches.show_colors(self._colors)
        self.line.setCursorPosition(0)

    def _choose(self, number: int) -> None:
        before = QColor(self._colors[number]) if self._colors else QColor("#2d6a8e")
        color = QColorDialog.getColor(before, self, self.parameter.label)
        if color.isValid():
            colors = self._colors or [""]
            changed = [*colors[:number], color.name(), *colors[number + 1 :]]
            self.edited.emit(changed if len(changed) > 1 else changed[0], 0)


class Swatches(QWidget):
    """Colours side by side; a click chooses one."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.colors: list[str] = []
        self.in_a_row = _IN_A_ROW
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setToolTip("Click to choose another colour")

    def show_colors(self, colors: list[str]) -> None:
        self.colors = colors
        count = max(1, len(colors))
        columns, rows = min(count, self.in_a_row), -(-count // self.in_a_row)
        self.setFixedSize(QSize(columns * (_SIDE + _GAP), rows * (_SIDE + _GAP)))
        self.update()

    def place(self, number: int) -> QRectF:
        row, column = divmod(number, self.in_a_row)
        step = _SIDE + _GAP
        return QRectF(column * step + 0.5, row * step + 0.5, _SIDE, _SIDE)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QColor("#8a94a3"))
        for number, color in enumerate(self.colors or [""]):
            painter.setBrush(QColor(color) if color else Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(self.place(number), 4, 4)
        painter.end()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        for number in range(max(1, len(self.colors))):
            if self.place(number).contains(event.position()):
                self.chosen.emit(number)
                return
