"""What is on the screen while the window's libraries are loaded: a picture of what will come."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPixmap
from PySide6.QtWidgets import QLabel

from spacemap_vtk.app.requirements import application
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.scenes import library


class Splash:
    """Shows the scene's small picture at once; goes when the window has drawn its first one."""

    def __init__(self, scene: str | None) -> None:
        self.app = application()
        name = Path(scene or "plain_weave").stem
        named = name if name in library.names() else "plain_weave"
        # Not a QSplashScreen: where there is no window manager, that waits a second for one.
        label = QLabel()
        label.setWindowFlags(Qt.WindowType.SplashScreen | Qt.WindowType.FramelessWindowHint)
        picture = _picture(named)
        label.setPixmap(picture)
        middle = self.app.primaryScreen().availableGeometry().center()
        label.move(middle - QRect(QPoint(), picture.size()).center())
        label.show()
        # Exposed, then painted: two turns of the loop.
        self.app.processEvents()
        self.app.processEvents()
        self.shown: QLabel | None = label

    def give_way_to(self, window: Any) -> None:
        """Go at the window's first picture, or when there will be none."""
        for told in (window.director.drawn, window.director.failed, window.engine.cancelled):
            told.connect(self.close)

    def close(self, *_: Any) -> None:
        if self.shown is not None:
            self.shown.close()
            self.shown = None


def _picture(name: str) -> QPixmap:
    picture = QPixmap(str(thumbnails.file_of(name)))
    width, height = thumbnails.SIZE
    card = QPixmap(width, height + 64)
    card.fill(QColor("#f4f6f8"))
    painter = QPainter(card)
    painter.drawPixmap(0, 0, picture)
    heading, rest = QFont(), QFont()
    heading.setPixelSize(22)
    heading.setBold(True)
    rest.setPixelSize(13)
    painter.setPen(QColor("#1f2730"))
    painter.setFont(heading)
    left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
    painter.drawText(QRect(20, height, width - 40, 38), left, "spacemap")
    painter.setFont(rest)
    painter.setPen(QColor("#66717e"))
    painter.drawText(QRect(20, height + 32, width - 40, 24), left, thumbnails.title_of(name))
    painter.end()
    return card
