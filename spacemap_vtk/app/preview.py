"""A small picture of a scene, over the view until the scene itself is drawn."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QWidget

from spacemap_vtk.app.widgets import later

#: Milliseconds after which a scene that is not drawn yet shows its picture: most are quicker.
_DELAY = 300
_CAPTION = "A small picture of the scene, shown until it is computed"
#: Share of the view that the picture leaves free.
_MARGIN = 0.06


class Preview(QWidget):
    """Covers the view with a picture, which the mouse does not feel."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()
        self._picture = QPixmap()
        self._appear = later(self, self._show, _DELAY)

    def begin(self, file: Path | None) -> None:
        """Show a picture soon, unless `end` comes first; without a file show nothing."""
        self.end()
        self._picture = QPixmap() if file is None else QPixmap(str(file))
        if not self._picture.isNull():
            self._appear.start()

    def end(self) -> None:
        """Show nothing: the scene is drawn, or will not be."""
        self._appear.stop()
        self.hide()

    def _show(self) -> None:
        parent = self.parentWidget()
        self.setGeometry(parent.rect())
        self.raise_()
        self.show()

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the picture as large as there is room, and what it is below."""
        room, painter = self.rect(), QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        line = 2 * self.fontMetrics().lineSpacing()
        most = room.size() * (1.0 - 2.0 * _MARGIN) - QSize(0, line)
        size = self._picture.size().scaled(most, Qt.AspectRatioMode.KeepAspectRatio)
        place = QRect(room.topLeft(), size)
        place.moveCenter(room.center())
        painter.drawPixmap(place, self._picture)
        below = QRect(room.left(), place.bottom(), room.width(), line)
        painter.setPen(QColor("#66717e"))
        painter.drawText(below, Qt.AlignmentFlag.AlignCenter, _CAPTION)
        painter.end()
