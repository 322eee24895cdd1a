"""Palette of colours for painting a draft or the chart of a knit."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPoint, QRect, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QColorDialog, QSizePolicy, QToolTip, QWidget

from spacemap_vtk.app.widgets import painter_on
from spacemap_vtk.ndarrays import Bytes

#: Side of a colour, and gap between colours, in pixels.
_SIDE = 22
_GAP = 5
#: Colours offered in addition to the given ones.
_DEFAULT_COLORS = ("#1f2730", "#f4efe6", "#2d6a8e", "#e8c78f", "#b5443c", "#4f7d4f", "#7d3c57")
_MAX_COLORS = 24


class Palette(QWidget):
    """Colours to choose by a click; a double click changes one everywhere, + adds one."""

    #: The colour to paint with.
    chosen = Signal(object)
    #: A colour, and its replacement.
    changed = Signal(object, object)

    def __init__(self) -> None:
        super().__init__()
        self.colors: list[QColor] = []
        self.color = QColor(_DEFAULT_COLORS[2])
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setMouseTracking(True)

    def clear(self) -> None:
        """Clear the palette for another scene."""
        self.colors = []

    def show_colors(self, colors: Bytes) -> None:
        """Add colours, (n, 3); present ones keep their places."""
        unique, first = np.unique(colors, axis=0, return_index=True)
        given = [QColor(*unique[i].tolist()) for i in np.argsort(first)[:_MAX_COLORS]]
        self._add_colors(*given, *(QColor(word) for word in _DEFAULT_COLORS))

    def choose(self, color: QColor) -> None:
        """Select the colour to paint with."""
        self._add_colors(color)
        self.color = color
        self.update()
        self.chosen.emit(color)

    def rect_of(self, index: int) -> QRect:
        """Return the rectangle of a colour; the index after the last is the +."""
        columns = max(1, (self.width() - _GAP) // (_SIDE + _GAP))
        row, column = divmod(index, columns)
        step = _SIDE + _GAP
        return QRect(_GAP + column * step, _GAP + row * step, _SIDE, _SIDE)

    def heightForWidth(self, width: int) -> int:
        """Return the height of all rows."""
        columns = max(1, (width - _GAP) // (_SIDE + _GAP))
        return _GAP + -(-(len(self.colors) + 1) // columns) * (_SIDE + _GAP)

    def sizeHint(self) -> QSize:
        """Return the size of the rows."""
        return QSize(240, self.heightForWidth(max(self.width(), 240)))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Let the layout know another number of rows: it keeps the former height otherwise."""
        super().resizeEvent(event)
        if event.oldSize().width() != event.size().width():
            self.updateGeometry()

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the colours, with a ring around the selected one."""
        painter = painter_on(self)
        line, ring = self.palette().mid().color(), self.palette().highlight().color()
        for index, color in enumerate((*self.colors, Qt.BrushStyle.NoBrush)):
            rect = self.rect_of(index)
            painter.setBrush(color)
            painter.setPen(QPen(line, 1))
            painter.drawRoundedRect(rect, 4, 4)
            if color == self.color:
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.setPen(QPen(ring, 2.5))
                painter.drawRoundedRect(rect.adjusted(-2, -2, 2, 2), 6, 6)
        painter.setPen(self.palette().windowText().color())
        painter.drawText(rect, Qt.AlignmentFlag.AlignCenter, "+")
        painter.end()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Select a colour, or add one."""
        index = self._index_at(event.position().toPoint())
        if index is None or event.button() != Qt.MouseButton.LeftButton:
            return
        if index < len(self.colors):
            self.choose(self.colors[index])
        else:
            color = QColorDialog.getColor(self.color, self, "Add colour")
            if color.isValid():
                self.choose(color)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Change a colour everywhere."""
        index = self._index_at(event.position().toPoint())
        if index is None or index >= len(self.colors):
            return
        old = self.colors[index]
        new = QColorDialog.getColor(old, self, "Replace this colour everywhere")
        if new.isValid() and new != old:
            if new not in self.colors:
                self.colors[index] = new
            self.changed.emit(old, new)
            self.choose(new)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Show a tooltip for the colour under the mouse."""
        index = self._index_at(event.position().toPoint())
        if index is not None:
            text = "Add a colour"
            if index < len(self.colors):
                text = f"{self.colors[index].name()}: double-click to replace it everywhere"
            QToolTip.showText(event.globalPosition().toPoint(), text, self)

    def _add_colors(self, *colors: QColor) -> None:
        for color in colors:
            if color not in self.colors:
                self.colors.append(color)
        self.updateGeometry()
        self.update()

    def _index_at(self, at: QPoint) -> int | None:
        places = range(len(self.colors) + 1)
        return next((place for place in places if self.rect_of(place).contains(at)), None)
