"""The biaxial pad: a map of stretches along warp and weft, on which the cloth is pulled."""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import QLabel, QPushButton, QSizePolicy, QWidget

from spacemap_vtk.app.document import Document
from spacemap_vtk.app.job import Pull
from spacemap_vtk.app.widgets import column, note
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.fabric.biaxial import StretchMap, stretch_map
from spacemap_vtk.fabric.interchange import Interchange
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange

_HINT = "Drag on the map to stretch the cloth along warp and weft. Grey: yarns jam. "
_LINES = (
    "Lines: equal force along the warp and along the weft, in N/m.",
    "Lines: crossings pressed to so much of their height, and yarn strain, in %.",
)
_NONE = "Yarns trade crimp in a woven scene with a section [yarns]: add it from the list of stages."
#: Pixels left of, right of, above and below the map.
_MARGINS = (46, 12, 10, 34)
#: Pixels of the dot's radius, and of a mark's text; how far marks are apart.
_DOT, _WIDE, _MARK = 5.0, 45.0, 0.05
#: Stretches of so many kinds of crossings at most, for the map.
_STATES = 30_000


class PullMap(QWidget):
    """The map, with a dot where the cloth is."""

    #: Stretches along warp and weft.
    dragged = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(220)
        self.setCursor(Qt.CursorShape.CrossCursor)
        self.map: StretchMap | None = None
        self.at = (1.0, 1.0)
        self._picture: QPixmap | None = None

    def show_map(self, found: StretchMap | None) -> None:
        self.map, self._picture = found, None
        self.go(1.0, 1.0)

    def go(self, warp: float, weft: float) -> None:
        """Put the dot somewhere."""
        self.at = (warp, weft)
        self.update()

    def place(self, warp: float, weft: float) -> QPointF:
        """Return where stretches are on the widget."""
        assert self.map is not None
        frame, (low, high) = self.frame(), self.map.warp[[0, -1]]
        return QPointF(
            frame.left() + (warp - low) / (high - low) * frame.width(),
            frame.bottom() - (weft - low) / (high - low) * frame.height(),
        )

    def frame(self) -> QRectF:
        left, right, top, bottom = _MARGINS
        return QRectF(left, top, self.width() - left - right, self.height() - top - bottom)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Pull the cloth to where the mouse is."""
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._drag(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Pull on."""
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._drag(event.position())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Paint the map anew."""
        super().resizeEvent(event)
        self._picture = None

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the map, once, and the dot over it."""
        if self.map is None:
            return
        if self._picture is None:
            self._picture = self._painted(self.map)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.drawPixmap(0, 0, self._picture)
        painter.setPen(QPen(self.palette().base().color(), 1.5))
        painter.setBrush(QColor("#d9642c"))
        painter.drawEllipse(self.place(*self.at), _DOT, _DOT)
        painter.end()

    def _drag(self, position: QPointF) -> None:
        if self.map is None:
            return
        frame, (low, high) = self.frame(), self.map.warp[[0, -1]]
        share = (position.x() - frame.left()) / max(frame.width(), 1.0)
        up = (frame.bottom() - position.y()) / max(frame.height(), 1.0)
        warp, weft = (low + (high - low) * min(max(s, 0.0), 1.0) for s in (share, up))
        self.go(float(warp), float(weft))
        self.dragged.emit(*self.at)

    def _painted(self, found: StretchMap) -> QPixmap:
        ratio = self.devicePixelRatioF()
        picture = QPixmap(self.size() * ratio)
        picture.setDevicePixelRatio(ratio)
        picture.fill(Qt.GlobalColor.transparent)
        painter = QPainter(picture)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        small = painter.font()
        small.setPointSizeF(7.5)
        painter.setFont(small)
        frame, palette = self.frame(), self.palette()
        painter.fillRect(frame, palette.base())
        painter.setClipRect(frame)
        self._lines(painter, found)
        low, high = found.warp[[0, -1]]
        # what lies past the border is covered, lines and all
        outside = [*found.border.T, (2.0, low), (0.0, 0.0), (low, 2.0)]
        painter.setBrush(palette.mid())
        painter.setPen(QPen(palette.text().color(), 1.4))
        painter.drawPolygon(QPolygonF([self.place(*point) for point in outside]))
        painter.setClipping(False)
        painter.setPen(palette.text().color())
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(frame)
        step = _MARK * (1 + ((high - low) / _MARK * _WIDE > frame.width()))
        for mark in np.arange(np.ceil((low - 1) / step), (high - 1) / step) * step + 1.0:
            text, at = f"{100.0 * (mark - 1.0):+.0f} %", self.place(float(mark), float(mark))
            below = QRectF(at.x() - 25, frame.bottom() + 2, 50, 14)
            painter.drawText(below, Qt.AlignmentFlag.AlignCenter, text)
            beside = QRectF(0, at.y() - 7, frame.left() - 4, 14)
            right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            painter.drawText(beside, right, text)
        foot = QRectF(frame.left(), frame.bottom() + 16, frame.width(), 16)
        painter.drawText(foot, Qt.AlignmentFlag.AlignCenter, "along the warp; upwards: the weft")
        painter.end()
        return picture

    def _lines(self, painter: QPainter, found: StretchMap) -> None:
        """Paint lines of equal force, or of what yarns do that do not stretch."""
        if found.force.max() > 0.0:
            levels = _round_levels(float(found.force.max()))
            fields = [(f, levels, c, 1.0) for f, c in zip(found.force, _COLORS, strict=True)]
        else:
            fields = [
                (found.distance, [0.7, 0.8, 0.9, 0.98], _COLORS[1], 100.0),
                (found.strain.max(axis=0), [0.002, 0.02, 0.05, 0.1, 0.2], _COLORS[0], 100.0),
            ]
        from contourpy import contour_generator  # with matplotlib, and not before it is needed

        for values, levels, color, unit in fields:
            lines = contour_generator(found.warp, found.weft, values)
            painter.setPen(QPen(QColor(color), 1.1))
            for level in levels:
                for line in lines.lines(level):
                    points = [self.place(*point) for point in np.asarray(line)]
                    painter.drawPolyline(QPolygonF(points))
                    middle = points[2 * len(points) // 3]
                    painter.drawText(middle + QPointF(2, -2), f"{unit * level:g}")


_COLORS = ("#d9642c", "#2c7fb8")


def _round_levels(largest: float) -> list[float]:
    """Return 1, 2 and 5 times powers of ten, down to some hundredths of the largest."""
    last = int(np.floor(np.log10(largest)))
    levels = [k * 10.0**n for n in range(last - 2, last + 1) for k in (1.0, 2.0, 5.0)]
    return [level for level in levels if 0.04 * largest <= level <= largest]


class PullTab(QWidget):
    """Pull the cloth along warp and weft."""

    #: A `Pull` to show; None for the motion.
    pulled = Signal(object)

    def __init__(self, document: Document) -> None:
        super().__init__()
        self._document = document
        self.map = PullMap()
        self.hint = note(_NONE)
        self.told = QLabel()
        self.told.setWordWrap(True)
        self.back = QPushButton("Back to the motion")
        self.back.setEnabled(False)
        column(self, self.hint, (self.map, 1), self.told, self.back, margins=(6, 6, 6, 6))
        self._crossings: Interchange | None = None
        self._known: Any = None
        self.map.dragged.connect(self._pull)
        self.back.clicked.connect(self.stop)
        document.changed.connect(self._follow)
        document.replaced.connect(self._follow)

    def stop(self) -> None:
        """Show the motion again."""
        if self.release():
            self.pulled.emit(None)

    def release(self) -> bool:
        """Let go of the cloth, and say whether it was held."""
        held = self.back.isEnabled()
        self.back.setEnabled(False)
        self.map.go(1.0, 1.0)
        self.told.clear()
        return held

    def showEvent(self, event: QShowEvent) -> None:
        """Find the map when it is first seen."""
        super().showEvent(event)
        self._follow()

    def _follow(self) -> None:
        """Find the map of the present cloth, if it is seen."""
        if not self.isVisible():
            return
        scene = self._document.scene
        stage = scene.stage("crimp")
        known = (scene.weave.settings, None if stage is None else stage.settings)
        if known == self._known:
            return
        self._known, self._crossings, found = known, None, None
        if scene.woven and isinstance(stage, CrimpInterchange):
            try:
                cloth = scene.weave.cloth
                self._crossings = Interchange(cloth, stage.yarns(cloth))
                found = self._map(self._crossings, cloth.families)
            except SpacemapError:
                pass  # the run says so
        self.release()
        self.hint.setText(_NONE if found is None else _HINT + _LINES[not found.force.any()])
        self.map.show_map(found)

    def _map(self, crossings: Interchange, families: Any) -> StretchMap:
        crimp = max(float(family.crimp.crimp) for family in families)
        side = int(np.clip(np.sqrt(_STATES / crossings.kinds), 9, 41))
        border = crossings.jam_border()
        low = max(0.5, min(float(border.min()), 1.0 - crimp) - 0.03)
        return stretch_map(crossings, low, 1.05 + crimp, side)

    def _pull(self, warp: float, weft: float) -> None:
        crossings = self._crossings
        if crossings is None:
            return
        found = crossings.resultants([[warp], [weft]])
        words = [f"Warp {100 * (warp - 1):+.2f} %, weft {100 * (weft - 1):+.2f} %."]
        if found.force.any():
            words.append("Force {:.4g} and {:.4g} N/m.".format(*found.force[:, 0]))
        words.append("Yarn strain {:.2f} and {:.2f} %.".format(*100.0 * found.strain[:, 0]))
        if np.any(found.stretch[:, 0] > [warp, weft]):
            words.append("It jams.")
        self.told.setText(" ".join(words))
        self.back.setEnabled(True)
        self.pulled.emit(Pull(warp, weft))
