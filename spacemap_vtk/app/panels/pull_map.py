"""Map of the biaxial pad: the state of the cloth over its stretches along warp and weft."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import (
    QBrush,
    QColor,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
    QResizeEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from spacemap_vtk.app.widgets import is_dark, painter_on
from spacemap_vtk.draw.actors.color_values import log_ticks
from spacemap_vtk.textile.crimp.biaxial import StretchMap

#: Margins of the map in pixels: left, right, above, below.
_MARGINS = (52, 12, 10, 40)
#: Radius of the point, in pixels.
_POINT_RADIUS = 6.0
#: Smallest distance between two marks of a scale, in pixels.
_MIN_MARK_DISTANCE = 46.0
#: Smallest half width of a region with a name, in pixels.
_MIN_REGION = 18.0
#: Colours of the lines of warp and weft, in the light and in the dark theme.
_COLORS = (("#c8502a", "#2c5f9e"), ("#ff8a5c", "#6cb4ee"))
#: Possible positions of a number along its line, as fractions of the line.
_LABEL_POSITIONS = (0.5, 0.35, 0.65, 0.22, 0.78, 0.1, 0.9)
#: Step of the point for one key press, as a stretch ratio.
_STEP = 0.002
#: Factor of this step while Shift is pressed.
_SHIFT_FACTOR = 5
_STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Down: (0, -1),
    Qt.Key.Key_Up: (0, 1),
}
_KEYS = (*_STEPS, Qt.Key.Key_Home, Qt.Key.Key_Escape)
_TIP = (
    "Arrow keys move the point by 0.2 %, with Shift by 1 %. Home: as woven. Esc: return to motion."
)


class PullMap(QWidget):
    """The map, with a point at the present stretch."""

    #: Stretch ratios along warp and weft.
    dragged = Signal(float, float)
    #: Whether a drag is in progress.
    dragging = Signal(bool)
    #: The user wants to see the motion again.
    reset_requested = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(220)
        self.setCursor(Qt.CursorShape.CrossCursor)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.map: StretchMap | None = None
        self.stretch = (1.0, 1.0)
        self._dragging = False
        self._picture: QPixmap | None = None
        self._label_rects: list[QRectF] = []

    def show_map(self, stretch_map: StretchMap | None) -> None:
        self.map, self._picture = stretch_map, None
        self.setToolTip("" if stretch_map is None else _TIP)
        self.update()

    def move_to(self, warp: float, weft: float) -> None:
        """Move the point."""
        self.stretch = (warp, weft)
        self.update()

    def position_of(self, warp: float, weft: float) -> QPointF:
        """Convert stretch ratios to a position in the widget."""
        assert self.map is not None
        frame, (x, y) = self.plot_rect(), (self.map.warp, self.map.weft)
        return QPointF(
            frame.left() + (warp - x[0]) / (x[-1] - x[0]) * frame.width(),
            frame.bottom() - (weft - y[0]) / (y[-1] - y[0]) * frame.height(),
        )

    def plot_rect(self) -> QRectF:
        left, right, top, bottom = _MARGINS
        return QRectF(self.rect()).adjusted(left, top, -right, -bottom)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Stretch the cloth to the values under the mouse."""
        if event.button() == Qt.MouseButton.LeftButton and self.map is not None:
            self._dragging = True
            self.dragging.emit(True)
            self._drag(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Continue the drag."""
        if self._dragging:
            self._drag(event.position())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._dragging and event.button() == Qt.MouseButton.LeftButton:
            self._dragging = False
            self.dragging.emit(False)

    def event(self, event: QEvent) -> bool:
        """Reserve the keys of the map, which the menus also use."""
        override = event.type() == QEvent.Type.ShortcutOverride
        if override and isinstance(event, QKeyEvent) and event.key() in _KEYS:
            event.accept()
        return bool(super().event(event))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the point, or return to the motion."""
        key = event.key()
        if self.map is None or key not in _KEYS:
            super().keyPressEvent(event)
        elif key == Qt.Key.Key_Escape:
            self.reset_requested.emit()
        elif key == Qt.Key.Key_Home:
            self._drag_to(1.0, 1.0)
        else:
            distances = (
                _SHIFT_FACTOR if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
            )
            self._drag_to(
                *(a + distances * _STEP * b for a, b in zip(self.stretch, _STEPS[key], strict=True))
            )

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Paint the map again in the new size."""
        super().resizeEvent(event)
        self._picture = None

    def changeEvent(self, event: QEvent) -> None:
        """Paint the map again in another theme."""
        if event.type() == QEvent.Type.PaletteChange:
            self._picture = None
        super().changeEvent(event)

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the map, which is cached, and the point over it."""
        if self.map is None:
            return
        if self._picture is None:
            self._picture = self._paint_map(self.map)
        painter = painter_on(self)
        painter.drawPixmap(0, 0, self._picture)
        frame, at, ink = (
            self.plot_rect(),
            self.position_of(*self.stretch),
            self.palette().text().color(),
        )
        painter.setPen(QPen(ink, 0.8, Qt.PenStyle.DotLine))
        painter.drawLine(QPointF(frame.left(), at.y()), QPointF(frame.right(), at.y()))
        painter.drawLine(QPointF(at.x(), frame.top()), QPointF(at.x(), frame.bottom()))
        painter.setPen(QPen(self.palette().base().color(), 2.0))
        painter.setBrush(self.palette().highlight())
        painter.drawEllipse(at, _POINT_RADIUS, _POINT_RADIUS)
        if self.hasFocus():
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(QPen(self.palette().highlight().color(), 1.2))
            painter.drawEllipse(at, _POINT_RADIUS + 3, _POINT_RADIUS + 3)
        painter.end()

    def _drag(self, position: QPointF) -> None:
        assert self.map is not None
        frame, (x, y) = self.plot_rect(), (self.map.warp, self.map.weft)
        share = (position.x() - frame.left()) / max(frame.width(), 1.0)
        height = (frame.bottom() - position.y()) / max(frame.height(), 1.0)
        self._drag_to(x[0] + share * (x[-1] - x[0]), y[0] + height * (y[-1] - y[0]))

    def _drag_to(self, warp: float, weft: float) -> None:
        assert self.map is not None
        x, y = self.map.warp, self.map.weft
        self.move_to(float(np.clip(warp, x[0], x[-1])), float(np.clip(weft, y[0], y[-1])))
        self.dragged.emit(*self.stretch)

    def _paint_map(self, stretch_map: StretchMap) -> QPixmap:
        ratio = self.devicePixelRatioF()
        picture = QPixmap(self.size() * ratio)
        picture.setDevicePixelRatio(ratio)
        picture.fill(Qt.GlobalColor.transparent)
        painter = painter_on(picture)
        small = painter.font()
        small.setPointSizeF(7.5)
        painter.setFont(small)
        frame, palette = self.plot_rect(), self.palette()
        ink, faint = palette.text().color(), palette.mid().color()
        painter.fillRect(frame, palette.base())
        painter.setClipRect(frame)
        painter.setPen(QPen(faint, 1.0))
        rest = self.position_of(1.0, 1.0)
        painter.drawLine(QPointF(frame.left(), rest.y()), QPointF(frame.right(), rest.y()))
        painter.drawLine(QPointF(rest.x(), frame.top()), QPointF(rest.x(), frame.bottom()))
        # The jammed regions cover the lines in them.
        warp_jam, weft_jam = self._jammed_regions(stretch_map)
        self._label_rects = []
        labels = self._paint_contours(painter, stretch_map, [warp_jam, weft_jam])
        painter.setPen(QPen(ink, 2.8))  # the inner half will be covered
        for part in (warp_jam, weft_jam):
            painter.drawPolygon(part)
        painter.setPen(Qt.PenStyle.NoPen)
        for brush in (palette.window(), QBrush(faint, Qt.BrushStyle.BDiagPattern)):
            painter.setBrush(brush)
            for part in (warp_jam, weft_jam):
                painter.drawPolygon(part)
        for area, text, color in labels:
            painter.fillRect(area, palette.base())
            painter.setPen(color)
            painter.drawText(area, Qt.AlignmentFlag.AlignCenter, text)
        painter.setPen(ink)
        self._name_regions(painter, stretch_map)
        painter.setClipping(False)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(frame)
        self._paint_scales(painter, stretch_map)
        painter.end()
        return picture

    def _jammed_regions(self, stretch_map: StretchMap) -> list[QPolygonF]:
        """Return the regions of the map in which the warp jams and in which the weft jams."""
        (left, right), (low, high) = stretch_map.warp[[0, -1]], stretch_map.weft[[0, -1]]
        margin_x, margin_y = (
            0.1 * (right - left),
            0.1 * (high - low),
        )  # puts the outer outlines out of view
        left, low = (
            min(left, stretch_map.jam[0].min()) - margin_x,
            min(low, stretch_map.jam[1].min()) - margin_y,
        )
        warp_jam = [(x, y) for x, y in zip(stretch_map.jam[0], stretch_map.weft, strict=True)]
        weft_jam = [(x, y) for x, y in zip(stretch_map.warp, stretch_map.jam[1], strict=True)]
        warp_jam = [
            (left, low),
            (warp_jam[0][0], low),
            *warp_jam,
            (warp_jam[-1][0], high + margin_y),
        ]
        weft_jam = [
            (left, low),
            (left, weft_jam[0][1]),
            *weft_jam,
            (right + margin_x, weft_jam[-1][1]),
        ]
        parts = (*warp_jam, (left, high + margin_y)), (*weft_jam, (right + margin_x, low))
        return [QPolygonF([self.position_of(*point) for point in part]) for part in parts]

    def _paint_contours(
        self, painter: QPainter, stretch_map: StretchMap, jams: list[QPolygonF]
    ) -> list[tuple[QRectF, str, QColor]]:
        """Paint lines of equal force, or else of yarn strain; return places for their numbers."""
        from contourpy import contour_generator  # installed with matplotlib; imported when needed

        palette, unjammed = self.palette(), self._unjammed_mask(stretch_map)
        forces = stretch_map.force.max() > 0.0
        fields = stretch_map.force if forces else stretch_map.strain
        maximum = float(np.where(unjammed, fields, 0.0).max())
        size, unit = (1.0, " N/m") if forces else (100.0, " %")
        if forces and maximum >= 1e4:
            size, unit = 1e-3, " kN/m"
        labels: list[tuple[QRectF, str, QColor]] = []

        painter.setPen(QPen(palette.text().color(), 1.0 if forces else 2.2))
        painter.drawPolyline(
            QPolygonF([self.position_of(*point) for point in stretch_map.exchange.T])
        )
        styles = Qt.PenStyle.SolidLine, Qt.PenStyle.DashLine
        for values, color, style in zip(fields, _COLORS[is_dark(self)], styles, strict=True):
            painter.setPen(QPen(QColor(color), 1.3, style))
            lines = contour_generator(stretch_map.warp, stretch_map.weft, values)
            for level in log_ticks(0.04 * maximum, maximum):
                text = f"{size * level:g}{unit}"
                for line in lines.lines(level):
                    points = [self.position_of(*point) for point in np.asarray(line)]
                    painter.drawPolyline(QPolygonF(points))
                    if (area := self._find_label_rect(painter, points, text, jams)) is not None:
                        labels.append((area, text, QColor(color)))
        return labels

    def _find_label_rect(
        self, painter: QPainter, points: list[QPointF], text: str, jams: list[QPolygonF]
    ) -> QRectF | None:
        """Find room for the number on a line."""
        area = painter.fontMetrics().boundingRect(text).toRectF().adjusted(-2, 0, 2, 0)
        for share in _LABEL_POSITIONS:
            area.moveCenter(points[int(share * (len(points) - 1))])
            free = not any(area.intersects(other) for other in self._label_rects)
            free = free and not any(jam.intersects(QPolygonF(area)) for jam in jams)
            if free and self.plot_rect().contains(area):
                self._label_rects.append(QRectF(area))
                return QRectF(area)
        return None

    def _unjammed_mask(self, stretch_map: StretchMap) -> NDArray[np.bool_]:
        """Return a mask of the stretches at which no yarn jams."""
        unjammed: NDArray[np.bool_] = stretch_map.warp >= stretch_map.jam[0][:, None]
        return unjammed & (stretch_map.weft[:, None] >= stretch_map.jam[1])

    def _name_regions(self, painter: QPainter, stretch_map: StretchMap) -> None:
        """Write the name of each region (jammed, slack, pressed) where the region is widest."""
        from scipy.ndimage import distance_transform_edt

        unjammed, frame = self._unjammed_mask(stretch_map), self.plot_rect()
        cell = frame.height() / len(stretch_map.weft), frame.width() / len(stretch_map.warp)
        regions: list[tuple[str, Any]] = [
            ("jammed", ~unjammed),
            ("slack", unjammed & stretch_map.slack),
        ]
        if not stretch_map.force.any():
            strains = stretch_map.strain.max(axis=0) > 1e-6
            regions.append(("pressed", unjammed & ~stretch_map.slack & ~strains))
        for name, mask in regions:
            # Distance to the border of the region and of the map; the name goes to the largest.
            distances = distance_transform_edt(np.pad(mask, 1), sampling=cell)[1:-1, 1:-1]
            row, column = np.unravel_index(int(np.argmax(distances)), distances.shape)
            if distances[row, column] < _MIN_REGION:
                continue
            area = painter.fontMetrics().boundingRect(name).toRectF().adjusted(-4, 0, 4, 0)
            area.moveCenter(self.position_of(stretch_map.warp[column], stretch_map.weft[row]))
            if name == "jammed":
                painter.fillRect(area, self.palette().window())
            if not any(area.intersects(other) for other in self._label_rects):
                painter.drawText(area, Qt.AlignmentFlag.AlignCenter, name)

    def _paint_scales(self, painter: QPainter, stretch_map: StretchMap) -> None:
        """Write the scales of both stretches, in percent."""
        frame, middle = self.plot_rect(), Qt.AlignmentFlag.AlignCenter
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        for mark in _scale_marks(stretch_map.warp, frame.width()):
            x = self.position_of(1.0 + mark / 100, 1.0).x()
            painter.drawText(QRectF(x - 25, frame.bottom() + 4, 50, 14), middle, _percent(mark))
        for mark in _scale_marks(stretch_map.weft, frame.height()):
            y = self.position_of(1.0, 1.0 + mark / 100).y()
            painter.drawText(QRectF(14, y - 7, frame.left() - 19, 14), right, _percent(mark))
        foot = QRectF(frame.left(), frame.bottom() + 20, frame.width(), 16)
        painter.drawText(foot, middle, "stretch along the warp [%]")
        painter.translate(2, frame.bottom())
        painter.rotate(-90)
        painter.drawText(QRectF(0, 0, frame.height(), 14), middle, "stretch along the weft [%]")
        painter.resetTransform()


def _scale_marks(stretch: NDArray[np.float64], pixels: float) -> NDArray[np.float64]:
    """Return round numbers in percent for the marks of a scale of given length in pixels."""
    low, high = 100.0 * (stretch[[0, -1]] - 1.0)
    steps = (
        step
        for step in (0.5, 1, 2, 5, 10, 20, 50)
        if pixels * step >= _MIN_MARK_DISTANCE * (high - low)
    )
    step = next(steps, 100)
    marks: NDArray[np.float64] = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    return marks + 0.0


def _percent(mark: float) -> str:
    return f"{mark:+g}" if mark else "0"
