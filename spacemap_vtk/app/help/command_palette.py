"""The command palette: search all actions, scenes, stages, tabs and parameters, and run one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QFrame,
    QHeaderView,
    QLineEdit,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from spacemap_vtk.app.widgets import RIGHT, column

#: Most entries that are shown.
_MOST = 80
_SIZE = 560, 380
_MOVES = Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown


class Entry(NamedTuple):
    """Something that the palette can do."""

    title: str
    place: str
    """Where it is in the window, and its keys."""
    run: Callable[[], object]
    words: str = ""
    """Further words that a search finds, such as synonyms."""


class CommandPalette(QDialog):
    """A search field above the entries that match; Enter or a click runs one."""

    #: The entry that was chosen.
    chosen = Signal(object)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Popup)
        self.setObjectName("commands")
        self.search = QLineEdit(placeholderText="Search actions, scenes and parameters")
        self.list = QTreeWidget(rootIsDecorated=False, uniformRowHeights=True)
        self.list.setHeaderHidden(True)
        self.list.setColumnCount(2)
        self.list.setFrameShape(QFrame.Shape.NoFrame)
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        header = self.list.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
        self._entries: list[Entry] = []
        #: The entries that match, as listed.
        self.shown: list[Entry] = []
        self.search.textChanged.connect(self._filter)
        self.search.installEventFilter(self)
        self.list.itemClicked.connect(lambda _: self._run())
        column(self, self.search, (self.list, 1), margins=(8, 8, 8, 8))

    def open_with(self, entries: Iterable[Entry]) -> None:
        """Show entries over the upper middle of the window."""
        self._entries = list(entries)
        self.search.clear()
        self._filter("")
        window = self.parentWidget()
        width, height = min(_SIZE[0], window.width() - 40), min(_SIZE[1], window.height() - 80)
        self.setGeometry(0, 0, width, height)
        top = window.mapToGlobal(window.rect().center())
        self.move(top.x() - width // 2, window.mapToGlobal(window.rect().topLeft()).y() + 60)
        self.show()
        self.search.setFocus()

    def _filter(self, text: str) -> None:
        words = text.lower().split()
        ranked = []
        for number, entry in enumerate(self._entries):
            title = entry.title.lower()
            everything = f"{title} {entry.place} {entry.words}".lower()
            if all(word in everything for word in words):
                begins = title.startswith(text.lower().strip())
                in_title = all(word in title for word in words)
                ranked.append((not begins, not in_title, number))
        self.shown = [self._entries[number] for *_, number in sorted(ranked)[:_MOST]]
        self.list.clear()
        for entry in self.shown:
            item = QTreeWidgetItem([entry.title, entry.place])
            item.setTextAlignment(1, RIGHT)
            item.setForeground(1, self.palette().placeholderText())
            self.list.addTopLevelItem(item)
        if self.shown:
            self.list.setCurrentItem(self.list.topLevelItem(0))

    def _run(self) -> None:
        if self.shown:
            entry = self.shown[self.list.currentIndex().row()]
            self.close()
            self.chosen.emit(entry)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let keys of the search field select and run entries."""
        if not isinstance(event, QKeyEvent) or event.type() != QEvent.Type.KeyPress:
            return False
        if event.key() in _MOVES:
            QApplication.sendEvent(self.list, event)
            return True
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._run()
            return True
        return False
