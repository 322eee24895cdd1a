"""A thumbnail of a scene, or a caption, over the view until the scene is drawn."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QRect, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QWidget

from spacemap_vtk.app.widgets import single_shot

#: Delay before the caption appears, in ms; most scenes are drawn earlier.
_DELAY = 300
_CAPTION = "Preview. The scene is being computed."
#: Captions over the picture of the former scene, and over an empty view.
_FORMER = "This is the former picture. The new one is being computed."
_EMPTY = "The scene is being computed."
#: Margins of the announcement, in pixels.
_PADDING = 12, 6
#: Free margin around the thumbnail, as a fraction of the view.
_MARGIN = 0.06


class Preview(QWidget):
    """Cover the view with a thumbnail or a caption; both let mouse events through."""

    #: The thumbnail has been painted.
    painted = Signal()

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()
        self._picture = QPixmap()
        self._has_caption, self._announcement = False, _EMPTY
        self._delay_timer = single_shot(self, self._show_caption, _DELAY)
        parent.installEventFilter(self)

    def begin(self, file: Path | None) -> None:
        """Show a thumbnail, after a delay with a caption, until `end` is called; None: nothing."""
        self.end()
        self._picture = QPixmap() if file is None else QPixmap(str(file))
        if not self._picture.isNull():
            self._begin()

    def announce(self, has_picture: bool) -> None:
        """Write over the view, or its former picture, that the scene is being computed."""
        if self.isHidden():
            self._picture = QPixmap()
            self._announcement = _FORMER if has_picture else _EMPTY
            self._begin()

    def _begin(self) -> None:
        self._has_caption = False
        self._delay_timer.start()
        self.setGeometry(self.parentWidget().rect())
        self.raise_()
        self.show()

    def end(self) -> None:
        """Hide the thumbnail: the scene is drawn, or will not be."""
        self._delay_timer.stop()
        self.hide()

    def _show_caption(self) -> None:
        self._has_caption = True
        self.update()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Stay as large as the view."""
        if event.type() == QEvent.Type.Resize and not self.isHidden():
            self.setGeometry(self.parentWidget().rect())
        return False

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the thumbnail as large as the view allows, with a caption below it."""
        area, painter = self.rect(), QPainter(self)
        if self._picture.isNull():
            if self._has_caption:
                self._paint_announcement(painter)
            painter.end()
            return
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        line = 2 * self.fontMetrics().lineSpacing()
        largest = area.size() * (1.0 - 2.0 * _MARGIN) - QSize(0, line)
        size = self._picture.size().scaled(largest, Qt.AspectRatioMode.KeepAspectRatio)
        place = QRect(area.topLeft(), size)
        place.moveCenter(area.center())
        painter.drawPixmap(place, self._picture)
        self.painted.emit()
        if self._has_caption:
            below = QRect(area.left(), place.bottom(), area.width(), line)
            painter.setPen(QColor("#66717e"))
            painter.drawText(below, Qt.AlignmentFlag.AlignCenter, _CAPTION)
        painter.end()

    def _paint_announcement(self, painter: QPainter) -> None:
        """Paint the announcement on a plate at the top of the view."""
        metrics, (across, above) = self.fontMetrics(), _PADDING
        plate = metrics.boundingRect(self._announcement).adjusted(-across, -above, across, above)
        plate.moveCenter(self.rect().center())
        plate.moveTop(2 * above)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self.palette().toolTipBase())
        painter.drawRoundedRect(plate, above, above)
        painter.setPen(self.palette().toolTipText().color())
        painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, self._announcement)
