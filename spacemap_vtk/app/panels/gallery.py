"""The tab of scenes: recent files and the program's scenes in groups, each with its thumbnail."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import (
    QAction,
    QColor,
    QIcon,
    QKeyEvent,
    QPainter,
    QPixmap,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QFrame,
    QLabel,
    QLineEdit,
    QListView,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from spacemap_vtk.app.documents.file_thumbnails import thumbnail_of
from spacemap_vtk.app.widgets import column, note, row, tool_button
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.draw.thumbnails import Entry
from spacemap_vtk.scenes import library

#: Smallest width of a thumbnail in pixels, unless there would be one column.
_MIN_WIDTH = 124
#: Height of a thumbnail over its width.
_ASPECT = 2 / 3
#: Space between two thumbnails, in pixels.
_GAP = 8
#: Most lines of a title.
_LINES = 3
#: Most recent files.
_MOST_RECENT = 6
_RECENT = "Recent files"
_HINT = "Click a scene to open it, or drop a file on the window."
_NAME = Qt.ItemDataRole.UserRole
#: Lower-case words by which an item is found, and the text of its group.
_WORDS, _GROUP = Qt.ItemDataRole.UserRole + 1, Qt.ItemDataRole.UserRole + 2


class Gallery(QWidget):
    """A thumbnail for each scene and recent file; a click or Enter opens it."""

    #: Name of a scene, or path of a file.
    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        heading = QLabel("Scenes", objectName="heading")
        self.new_button, self.open_button = QPushButton("New fabric"), QPushButton("Open file…")
        buttons = row(None, self.new_button, self.open_button)
        self.search = QLineEdit(placeholderText="Search scenes", clearButtonEnabled=True)
        self.search.textChanged.connect(self._filter)
        self.search.returnPressed.connect(self._open_first)
        self.list = _ThumbnailList()
        self._recent: list[str] = []
        #: A button for each preset of motion.
        self.presets: list[QToolButton] = []
        for group, scenes in groupby(thumbnails.entries(), lambda entry: entry.group):
            self.list.add_heading(group)
            for entry in scenes:
                self.list.add_thumbnail(entry)
        self.list.chosen.connect(self.chosen)
        self.nothing = note("No scene matches. Search for words of a title or a name.")
        self.nothing.hide()
        column(
            self,
            heading,
            note(_HINT),
            buttons,
            self.search,
            self.nothing,
            (self.list, 1),
            margins=(12, 10, 8, 8),
        )
        self._has_icons = False

    def show_presets(self, presets: Iterable[QAction]) -> None:
        """Add a button for each preset of motion, above the scenes."""
        buttons: list[QToolButton] = []
        for preset in presets:
            buttons.append(tool_button(preset.text()))
            buttons[-1].setDefaultAction(preset)
            buttons[-1].setAutoRaise(False)
            buttons[-1].setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.presets = buttons
        for line in range(0, len(buttons), 2):  # three side by side would widen the tabs
            self.layout().insertLayout(3 + line // 2, row(None, *buttons[line : line + 2]))

    def showEvent(self, event: QShowEvent) -> None:
        """Load the thumbnails when the tab is first shown."""
        super().showEvent(event)
        if not self._has_icons:
            self._has_icons = True
            for item in self.list.thumbnails:
                if item.icon().isNull():
                    item.setIcon(_load_icon(thumbnails.file_of(item.data(_NAME)), item.text()))

    def show_recent(self, files: list[str]) -> None:
        """Show the user's recent files first; the program's scenes are below anyway."""
        own = [name for name in files if Path(name).parent != library.folder().resolve()]
        self._recent = own[:_MOST_RECENT]
        self.list.remove_group(_RECENT)
        if self._recent:
            self.list.add_heading(_RECENT, 0)
        for place, name in enumerate(self._recent, 1):
            entry = Entry(name, Path(name).name, _RECENT)
            item = self.list.add_thumbnail(entry, place)
            item.setIcon(_load_icon(thumbnail_of(Path(name)), Path(name).suffix))
        self._filter(self.search.text())

    def update_recent(self) -> None:
        """Show the thumbnails of recent files again, as one of them has just been drawn."""
        self.show_recent(self._recent)

    def _filter(self, text: str) -> None:
        self.nothing.setVisible(not self.list.filter_words(text.lower().split()))

    def _open_first(self) -> None:
        """Open the first scene that matches the search."""
        shown = [item for item in self.list.thumbnails if not item.isHidden()]
        if self.search.text() and shown:
            self.chosen.emit(shown[0].data(_NAME))


class _ThumbnailList(QListWidget):
    """Thumbnails in as many columns as fit, below the headings of their groups."""

    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__(objectName="gallery", wordWrap=True)
        # A style sheet would paint the groove of the scroll bar black.
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.viewport().setAutoFillBackground(False)
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setResizeMode(QListView.ResizeMode.Adjust)
        self.setMovement(QListView.Movement.Static)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        self.setAcceptDrops(False)  # the window takes dropped files
        self._sizes = QSize(), QSize()
        self.itemClicked.connect(self._choose)

    @property
    def thumbnails(self) -> list[QListWidgetItem]:
        """All items but the headings."""
        items = [self.item(number) for number in range(self.count())]
        return [item for item in items if item.data(_NAME) is not None]

    def add_heading(self, group: str, place: int | None = None) -> None:
        """Add the heading of a group."""
        item = QListWidgetItem(group)
        item.setFlags(Qt.ItemFlag.NoItemFlags)
        item.setData(_GROUP, group)
        font = item.font()
        font.setBold(True)
        item.setFont(font)
        item.setTextAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignBottom)
        item.setSizeHint(self._sizes[1])
        self.insertItem(self.count() if place is None else place, item)

    def add_thumbnail(self, entry: Entry, place: int | None = None) -> QListWidgetItem:
        """Add an item without its picture."""
        item = QListWidgetItem(entry.title)
        item.setData(_NAME, entry.name)
        item.setData(_GROUP, entry.group)
        item.setData(_WORDS, entry.words)
        item.setToolTip(f"{entry.title}\n{entry.name}")
        item.setTextAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
        item.setSizeHint(self._sizes[0])
        self.insertItem(self.count() if place is None else place, item)
        return item

    def remove_group(self, group: str) -> None:
        """Remove a group and its heading."""
        for number in reversed(range(self.count())):
            if self.item(number).data(_GROUP) == group:
                self.takeItem(number)

    def filter_words(self, words: list[str]) -> bool:
        """Show only items that match all words, and their headings; return whether any does."""
        groups = set()
        for item in self.thumbnails:
            shown = all(word in item.data(_WORDS) for word in words)
            item.setHidden(not shown)
            groups |= {item.data(_GROUP)} if shown else set()
        for number in range(self.count()):
            if self.item(number).data(_NAME) is None:
                self.item(number).setHidden(self.item(number).data(_GROUP) not in groups)
        return bool(groups)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Adapt the size of the thumbnails to the width."""
        super().resizeEvent(event)
        space = self.viewport().width() - 2
        cell = space // max(2, space // (_MIN_WIDTH + _GAP))
        width = cell - _GAP
        picture, line = round(width * _ASPECT), self.fontMetrics().lineSpacing()
        self.setIconSize(QSize(width, picture))
        # Equal sizes, whatever the titles; a heading fills its row.
        self._sizes = QSize(cell, picture + _LINES * line + 6), QSize(space, 2 * line)
        for number in range(self.count()):
            item = self.item(number)
            item.setSizeHint(self._sizes[item.data(_NAME) is None])

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Open the selected scene with Enter; arrow keys select."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self.currentItem():
            self._choose(self.currentItem())
        else:
            super().keyPressEvent(event)

    def _choose(self, item: QListWidgetItem) -> None:
        if (name := item.data(_NAME)) is not None:
            self.chosen.emit(name)


def _load_icon(file: Path | None, words: str) -> QIcon:
    """Return a picture as an icon; without one, a card with some words."""
    pixmap = QPixmap() if file is None else QPixmap(str(file))
    if pixmap.isNull():
        pixmap = QPixmap(*thumbnails.SIZE)
        pixmap.fill(QColor("#dfe6ee"))
        painter = QPainter(pixmap)
        font = painter.font()
        font.setPixelSize(48)
        painter.setFont(font)
        painter.setPen(QColor("#66717e"))
        painter.drawText(pixmap.rect(), Qt.AlignmentFlag.AlignCenter, words)
        painter.end()
    icon = QIcon(pixmap)
    # Otherwise Qt would tint the thumbnail of the selected scene.
    icon.addPixmap(pixmap, QIcon.Mode.Selected)
    return icon
