"""Editor of a weave's pattern: its name, and its repeat as a grid of squares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QComboBox,
    QGridLayout,
    QLabel,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from spacemap_vtk.app.fields.editor import Editor, ignore_wheel
from spacemap_vtk.app.fields.number_editors import next_burst
from spacemap_vtk.app.widgets import column, row
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.weave_parameters import pattern_repeat
from spacemap_vtk.parameters import Parameter
from spacemap_vtk.scenes.assignments import parse_value
from spacemap_vtk.scenes.pattern_choices import PATTERNS
from spacemap_vtk.textile.drafts import drawdown
from spacemap_vtk.textile.weave.resolve import WARP_COLOR, WEFT_COLOR

#: Largest and smallest side of a square, and largest height of the grid, in pixels.
_MAX_SQUARE = 26.0
_MIN_SQUARE = 3.0
_MAX_HEIGHT = 140
#: Width of the darker sides of a yarn, as a fraction of a square.
_EDGE = 0.14
#: Darkness of these sides: Qt's factor in percent.
_DARKER = 135


class PatternEditor(Editor):
    """A name to choose or type, and the repeat; a click on a square makes it a matrix."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.box = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)
        ignore_wheel(self.box)
        self.box.addItems(PATTERNS)
        self.line = self.box.lineEdit()
        self.grid = PatternGrid()
        self.size = QLabel(objectName="about")
        tools = QGridLayout(spacing=3)
        tools.addWidget(self.size, 0, 0, 1, 2)
        self.buttons: dict[str, QToolButton] = {}
        for text, tip, axis, more in (
            ("+ end", "Add an end to the repeat", 1, True),
            ("− end", "Remove an end from the repeat", 1, False),
            ("+ pick", "Add a pick to the repeat", 0, True),
            ("− pick", "Remove a pick from the repeat", 0, False),
        ):
            button = QToolButton(text=text, toolTip=tip)
            button.clicked.connect(self._resize_repeat)
            button.setProperty("change", (axis, more))
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            tools.addWidget(button, 2 - axis, int(more))
            self.buttons[text] = button
        tools.setRowStretch(3, 1)
        below = row(None, self.grid, tools, None, spacing=10)
        below.setAlignment(self.grid, Qt.AlignmentFlag.AlignTop)
        column(self, self.box, below, spacing=4)
        self.setFocusProxy(self.box)
        self.box.textActivated.connect(self._submit_text)
        self.line.textEdited.connect(self.is_new)
        self.line.editingFinished.connect(self._submit_text)
        self.grid.painted.connect(self._submit_repeat)
        self.grid.dragging.connect(self.dragging)

    def show_value(self, value: Any) -> None:
        """Show the name and the squares."""
        self.shown = (
            value if isinstance(value, str) else "[" + ", ".join(f'"{row}"' for row in value) + "]"
        )
        self.line.setText(self.shown)
        self.line.setCursorPosition(0)
        try:
            self.grid.show_repeat(pattern_repeat(value))
        except InputError:
            return
        picks, ends = self.grid.repeat.shape
        self.size.setText(f"{ends} ends, {picks} picks")

    def _submit_text(self) -> None:
        if self.is_new(self.line.text()):
            self.edited.emit(parse_value(self.line.text()), 0)

    def _submit_repeat(self, burst: int) -> None:
        self.edited.emit(drawdown.to_rows(self.grid.repeat), burst)

    def _resize_repeat(self) -> None:
        axis, more = self.sender().property("change")
        repeat = self.grid.repeat
        if more:
            # Continue the repeat diagonally, so that the new line fits the pattern.
            repeat = np.concatenate([repeat, np.roll(repeat, 1, 1 - axis).take([-1], axis)], axis)
        elif repeat.shape[axis] > 1:
            repeat = repeat.take(range(repeat.shape[axis] - 1), axis)
        self.edited.emit(drawdown.to_rows(repeat), 0)


class PatternGrid(QWidget):
    """One repeat, with the first end on the left and the first pick at the bottom."""

    #: The repeat has changed; the burst, a number that is the same during one drag.
    painted = Signal(int)
    dragging = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.repeat: NDArray[np.bool_] = np.ones((1, 1), bool)
        #: Colours of warp and weft, (n, 3), repeated over the yarns.
        self.colors = np.array([WARP_COLOR]), np.array([WEFT_COLOR])
        self._brush: bool | None = None
        self._burst = 0
        self.setToolTip("Upright yarn: the end lies over the pick. Click or drag to change.")

    @property
    def cell(self) -> float:
        """Width of a square in pixels."""
        picks, ends = self.repeat.shape
        return max(_MIN_SQUARE, min(_MAX_SQUARE, _MAX_HEIGHT / picks, 150 / ends))

    def show_repeat(self, repeat: NDArray[np.bool_]) -> None:
        self.repeat = np.array(repeat, bool)
        picks, ends = self.repeat.shape
        self.setFixedSize(QSize(int(ends * self.cell) + 2, int(picks * self.cell) + 2))
        self.update()

    def show_colors(self, warp: NDArray[np.uint8], weft: NDArray[np.uint8]) -> None:
        self.colors = warp, weft
        self.update()

    def square_rect(self, pick: int, end: int) -> QRectF:
        cell = self.cell
        return QRectF(1 + end * cell, 1 + (len(self.repeat) - 1 - pick) * cell, cell, cell)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter, side = QPainter(self), _EDGE * self.cell
        warp, weft = ([QColor(*color) for color in colors.tolist()] for colors in self.colors)
        for pick, squares in enumerate(self.repeat):
            for end, over in enumerate(squares):
                color = warp[end % len(warp)] if over else weft[pick % len(weft)]
                x, y, square = side * over, side * (not over), self.square_rect(pick, end)
                # Dark sides show the direction of the yarn for any colour.
                painter.fillRect(square, color.darker(_DARKER))
                painter.fillRect(square.adjusted(x, y, -x, -y), color)
        painter.end()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Invert a square, and start to paint with its new value."""
        square = self._square_at(event.position())
        if event.button() == Qt.MouseButton.LeftButton and square is not None:
            self._brush = not self.repeat[square]
            self._burst = next_burst()
            self.dragging.emit(True)
            self._paint(square)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        square = self._square_at(event.position())
        if self._brush is not None and square is not None:
            self._paint(square)

    def mouseReleaseEvent(self, _event: QMouseEvent) -> None:
        if self._brush is not None:
            self._brush = None
            self.dragging.emit(False)

    def _paint(self, square: tuple[int, int]) -> None:
        if self.repeat[square] != self._brush:
            self.repeat[square] = self._brush
            self.update()
            self.painted.emit(self._burst)

    def _square_at(self, at: QPointF) -> tuple[int, int] | None:
        picks, ends = self.repeat.shape
        end, row = int((at.x() - 1) // self.cell), int((at.y() - 1) // self.cell)
        pick = picks - 1 - row
        return (pick, end) if 0 <= end < ends and 0 <= pick < picks else None
