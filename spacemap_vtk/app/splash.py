"""Splash screen: a picture of the scene, shown while the window's libraries load."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPixmap
from PySide6.QtWidgets import QLabel

from spacemap_vtk.app.requirements import create_application
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.scenes import library


class Splash:
    """Show a scene's thumbnail at once, until the window has drawn its first picture."""

    def __init__(self, scene: str | None) -> None:
        self.app = create_application()
        name = Path(scene or "plain_weave").stem
        named = name if name in library.names() else "plain_weave"
        # Not a QSplashScreen: without a window manager it waits one second for one.
        label = QLabel()
        label.setWindowFlags(Qt.WindowType.SplashScreen | Qt.WindowType.FramelessWindowHint)
        picture = _make_card(named)
        label.setPixmap(picture)
        middle = self.app.primaryScreen().availableGeometry().center()
        label.move(middle - QRect(QPoint(), picture.size()).center())
        label.show()
        # The label is exposed in the first pass of the event loop and painted in the second.
        self.app.processEvents()
        self.app.processEvents()
        self.label: QLabel | None = label

    def close_after_first_frame(self, window: Any) -> None:
        """Close when the window shows a thumbnail or its first picture, or has failed to."""
        shown = window.view.preview.painted, window.director.drawn
        for signal in (*shown, window.director.failed, window.engine.cancelled):
            signal.connect(self.close)

    def close(self, *_: Any) -> None:
        if self.label is not None:
            self.label.close()
            self.label = None


def _make_card(name: str) -> QPixmap:
    picture = QPixmap(str(thumbnails.file_of(name)))
    width, height = thumbnails.SIZE
    card = QPixmap(width, height + 64)
    card.fill(QColor("#f4f6f8"))
    painter = QPainter(card)
    painter.drawPixmap(0, 0, picture)
    heading, small = QFont(), QFont()
    heading.setPixelSize(22)
    heading.setBold(True)
    small.setPixelSize(13)
    painter.setPen(QColor("#1f2730"))
    painter.setFont(heading)
    left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
    painter.drawText(QRect(20, height, width - 40, 38), left, "spacemap")
    painter.setFont(small)
    painter.setPen(QColor("#66717e"))
    painter.drawText(QRect(20, height + 32, width - 40, 24), left, thumbnails.title_of(name))
    painter.end()
    return card
