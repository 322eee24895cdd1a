"""Undo and redo from a field that has nothing of its own to undo."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QLineEdit, QWidget


class UndoKeys(QObject):
    """Leaves undo and redo to the window's menu where a line of text has none of its own."""

    # Qt's lines keep both keys for themselves, even when there is nothing to undo in them: after
    # Enter in a field Ctrl+Z would do nothing at all.

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        # Only the line that has the keyboard is watched: to watch all costs at every event.
        QApplication.instance().focusChanged.connect(self._follow)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Pass a key on to the window's shortcuts."""
        if event.type() != QEvent.Type.ShortcutOverride or not isinstance(event, QKeyEvent):
            return False
        line = watched if isinstance(watched, QLineEdit) else watched.findChild(QLineEdit)
        keys = QKeySequence.StandardKey
        idle = (event.matches(keys.Undo) and not line.isUndoAvailable()) or (
            event.matches(keys.Redo) and not line.isRedoAvailable()
        )
        if idle:
            event.ignore()
        return idle

    def _follow(self, before: QWidget | None, now: QWidget | None) -> None:
        if isinstance(before, (QLineEdit, QAbstractSpinBox)):
            before.removeEventFilter(self)
        if isinstance(now, (QLineEdit, QAbstractSpinBox)):
            now.installEventFilter(self)
