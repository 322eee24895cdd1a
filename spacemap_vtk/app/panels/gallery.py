"""The tab of scenes: thumbnails of the program's scenes, and recent files."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QKeyEvent, QPainter, QPixmap, QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QFrame,
    QLabel,
    QListView,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QWidget,
)

from spacemap_vtk.app.widgets import column, note, row
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.scenes import library

#: Smallest width of a thumbnail, in pixels.
_MIN_WIDTH = 140
#: Height of a thumbnail over its width.
_ASPECT = 2 / 3
_NAME = Qt.ItemDataRole.UserRole


class Gallery(QWidget):
    """A thumbnail for each scene; a click or Enter opens the scene."""

    #: Name of a scene, or path of a file.
    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        heading = QLabel("Scenes", objectName="heading")
        about = note("Click a scene to open it. You can change everything in it.")
        self.new_button, self.open_button = QPushButton("New fabric"), QPushButton("Open file…")
        buttons = row(None, self.new_button, self.open_button)
        self.list = _ThumbnailList()
        for name in library.names():
            item = QListWidgetItem(thumbnails.title_of(name))
            item.setData(_NAME, name)
            item.setToolTip(f"{thumbnails.title_of(name)}\n{name}")
            self.list.addItem(item)
        self.list.chosen.connect(self.chosen)
        self._recent_label = QLabel("Recent files")
        self.recent = QListWidget(objectName="recent")
        self.recent.itemClicked.connect(lambda item: self.chosen.emit(item.data(_NAME)))
        _make_transparent(self.recent)
        column(
            self,
            heading,
            about,
            buttons,
            (self.list, 1),
            self._recent_label,
            self.recent,
            margins=(12, 10, 8, 8),
        )
        self._has_icons = False
        self.show_recent([])

    def showEvent(self, event: QShowEvent) -> None:
        """Load the thumbnails when the tab is first shown."""
        super().showEvent(event)
        if not self._has_icons:
            self._has_icons = True
            for number in range(self.list.count()):
                item = self.list.item(number)
                item.setIcon(_load_icon(item.data(_NAME)))

    def show_recent(self, files: list[str]) -> None:
        self.recent.clear()
        for name in files[:5]:
            item = QListWidgetItem(Path(name).name)
            item.setData(_NAME, name)
            item.setToolTip(name)
            self.recent.addItem(item)
        for widget in (self.recent, self._recent_label):
            widget.setVisible(bool(files))
        height = self.recent.sizeHintForRow(0) if files else 0
        self.recent.setFixedHeight(height * self.recent.count() + 6)


class _ThumbnailList(QListWidget):
    """Thumbnails in as many columns as fit."""

    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__(objectName="gallery", wordWrap=True)
        _make_transparent(self)
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setResizeMode(QListView.ResizeMode.Adjust)
        self.setMovement(QListView.Movement.Static)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        self.itemClicked.connect(self._choose)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Adapt the size of the thumbnails to the width."""
        super().resizeEvent(event)
        space = self.viewport().width() - 4
        cell = space // max(1, space // (_MIN_WIDTH + 16))
        width = cell - 12
        self.setIconSize(QSize(width, round(width * _ASPECT)))
        lines = 3 * self.fontMetrics().lineSpacing()  # the longest titles have three
        self.setGridSize(QSize(cell, round(width * _ASPECT) + lines + 16))
        for number in range(self.count()):  # equal widths, whatever the titles
            self.item(number).setSizeHint(self.gridSize() - QSize(4, 4))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Open the selected scene with Enter; arrow keys select."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self.currentItem():
            self._choose(self.currentItem())
        else:
            super().keyPressEvent(event)

    def _choose(self, item: QListWidgetItem) -> None:
        self.chosen.emit(item.data(_NAME))


def _make_transparent(pictures: QListWidget) -> None:
    """Make the background of a list transparent."""
    # A style sheet would paint the groove of the scroll bar black.
    pictures.setFrameShape(QFrame.Shape.NoFrame)
    pictures.viewport().setAutoFillBackground(False)


def _load_icon(name: str) -> QIcon:
    pixmap = QPixmap(str(thumbnails.file_of(name)))
    if pixmap.isNull():
        pixmap = QPixmap(*thumbnails.SIZE)
        pixmap.fill(QColor("#dfe6ee"))
        painter = QPainter(pixmap)
        painter.setPen(QColor("#66717e"))
        painter.drawText(pixmap.rect(), Qt.AlignmentFlag.AlignCenter, name)
        painter.end()
    icon = QIcon(pixmap)
    # Otherwise Qt would tint the thumbnail of the selected scene.
    icon.addPixmap(pixmap, QIcon.Mode.Selected)
    return icon
