"""Plot of the frequency response below the table of modes; a click selects the nearest mode."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPaintEvent, QPalette, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.plots.curves import Spectrum, compute_spectrum, motion_key
from spacemap_vtk.app.widgets import painter_on, single_shot
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.draw.actors.color_values import log_ticks
from spacemap_vtk.draw.figure.plots import prefixed_unit
from spacemap_vtk.draw.frame import Frame

_Role = QPalette.ColorRole
#: Margins of the plot in pixels: left, right, top, bottom. Below: least distance of two numbers
#: of the axis.
_MARGINS = (46, 8, 24, 18)
_MIN_NUMBER_DISTANCE = 34
#: Shown decades below the highest peak.
_DECADES = 5
#: Time without changes until the response is computed, in ms.
_REST_TIME = 250
_TIP = (
    "Amplitude of the point that moves most in the first mode, under sinusoidal loads in phase. "
    "Click near a peak to animate its mode."
)


class ResponsePlot(QWidget):
    """Amplitude over frequency, both logarithmic, with a line for each mode."""

    #: Index of the clicked mode.
    chosen = Signal(int)
    #: The computed `Spectrum`.
    found = Signal(object)

    def __init__(self, document: Document, engine: Engine) -> None:
        super().__init__()
        self.setFixedHeight(132)
        self.setToolTip(_TIP)
        self.hide()
        self._document, self._engine = document, engine
        self.spectrum: Spectrum | None = None
        self.frequencies: NDArray[np.float64] = np.zeros(0)
        self.mode: int | None = None
        self._faded = False
        #: Keys of the drawn motion, and of the motion whose response was requested.
        self._drawn = self._requested = ""
        self._rest_timer = single_shot(self, self._request, _REST_TIME)
        engine.background_ready.connect(self._receive)

    def follow(self, frame: Frame) -> None:
        """Request the response if the motion of the scene has changed."""
        if frame.mode is None:
            before = self._drawn
            self._drawn = (
                motion_key(self._document) if frame.values == self._document.values else ""
            )
            # Not during a drag: the work would slow it down, and each coarse frame has another
            # response.
            at_rest = not frame.coarse or self._drawn == before
            if at_rest and self._drawn != self._requested and not self._rest_timer.isActive():
                self._rest_timer.start()

    @property
    def is_current(self) -> bool:
        """Whether the requested response belongs to the drawn motion."""
        return self._drawn == self._requested

    def fade(self, old: bool) -> None:
        """Draw the curve in grey while it belongs to former modes."""
        self._faded = old
        self.update()

    def clear(self) -> None:
        """Hide the plot until a new response is computed."""
        self._drawn = self._requested = ""
        self.spectrum = None
        self.hide()

    def request_again(self) -> None:
        """Request the response again, as another tab may have replaced the work while hidden."""
        self._requested = ""
        self._rest_timer.start()

    def _request(self) -> None:
        if not self.parentWidget().isVisible() or self._drawn in ("", self._requested):
            return
        if self._engine.busy:
            self._rest_timer.start()
        else:
            self._requested = self._drawn
            self._engine.start_background(compute_spectrum)

    def _receive(self, result: Any) -> None:
        if not isinstance(result, Spectrum) or not self._requested:
            return  # the result was requested by another tab, or belongs to a closed scene
        self.spectrum = result
        self.setVisible(bool(result.response.any()))
        self.found.emit(result)
        self.update()

    def plot_rect(self) -> QRectF:
        left, right, top, bottom = _MARGINS
        return QRectF(self.rect()).adjusted(left, top, -right, -bottom)

    def x_of(self, frequency: Any) -> Any:
        """Convert frequencies in Hz to x positions in the widget."""
        assert self.spectrum is not None
        low, high = np.log(self.spectrum.frequencies[[0, -1]])
        frame = self.plot_rect()
        return frame.left() + (np.log(frequency) - low) / (high - low) * frame.width()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Select the mode with the nearest frequency."""
        swinging = np.flatnonzero(self.frequencies > 0.0)
        if event.button() == Qt.MouseButton.LeftButton and len(swinging):
            away = abs(self.x_of(self.frequencies[swinging]) - event.position().x())
            self.chosen.emit(int(swinging[np.argmin(away)]))

    def paintEvent(self, _: QPaintEvent) -> None:
        if self.spectrum is None:
            return
        frequencies, response = self.spectrum.frequencies, self.spectrum.response
        colors, frame = self.palette(), self.plot_rect()
        faint, line = (colors.color(r) for r in (_Role.PlaceholderText, _Role.Mid))
        accent = colors.color(_Role.Highlight)
        unit, size = prefixed_unit("m", float(response.max()))
        top = math.ceil(math.log10(response.max() / size) * 4) / 4
        high = frame.height() / _DECADES
        painter = painter_on(self)
        font = self.font()
        font.setPointSizeF(font.pointSizeF() * 0.8)
        painter.setFont(font)
        painter.fillRect(frame, colors.color(_Role.Base))
        painter.setPen(colors.color(_Role.WindowText))
        painter.drawText(QPointF(2, frame.top() - 10), f"Amplitude [{unit}] over frequency [Hz]")
        for power in range(math.ceil(top) - _DECADES, math.floor(top) + 1):
            y = frame.top() + (top - power) * high
            if y <= frame.bottom():
                painter.setPen(QPen(line, 0.6))
                painter.drawLine(QPointF(frame.left(), y), QPointF(frame.right(), y))
                painter.setPen(faint)
                rect = QRectF(0, y - 8, frame.left() - 4, 16)
                painter.drawText(rect, Qt.AlignmentFlag.AlignRight, f"{10.0**power:g}")
        last_x = -math.inf
        for value in log_ticks(*frequencies[[0, -1]]):
            x = float(self.x_of(value))
            if x - last_x >= _MIN_NUMBER_DISTANCE and x + _MIN_NUMBER_DISTANCE / 2 < self.width():
                last_x = x
                rect = QRectF(
                    x - _MIN_NUMBER_DISTANCE / 2, frame.bottom() + 2, _MIN_NUMBER_DISTANCE, 16
                )
                painter.drawText(rect, Qt.AlignmentFlag.AlignHCenter, f"{value:g}")
        painter.setClipRect(frame)
        inside = self.frequencies > 0.0
        for number in np.flatnonzero(inside):
            at, chosen = float(self.x_of(self.frequencies[number])), number == self.mode
            painter.setPen(QPen(accent if chosen else line, 2.0 if chosen else 0.6))
            painter.drawLine(QPointF(at, frame.top()), QPointF(at, frame.bottom()))
        painter.setPen(QPen(line if self._faded else accent, 1.3))
        levels = top - np.log10(np.maximum(response / size, 10.0 ** (top - 2 * _DECADES)))
        ys = frame.top() + levels * high
        points = [QPointF(x, y) for x, y in zip(self.x_of(frequencies), ys, strict=True)]
        painter.drawPolyline(QPolygonF(points))
        painter.end()
