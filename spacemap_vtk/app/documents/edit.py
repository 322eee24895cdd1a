"""Undoable changes of the document."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple
from weakref import WeakMethod

from PySide6.QtGui import QUndoCommand, QUndoStack


class Version(NamedTuple):
    """A text of the document, with the data that give its relative paths their meaning."""

    text: str
    folder: Path
    """Folder that relative paths start from."""
    overwritten: int
    """Number of drafts that had been overwritten."""


class Edit(QUndoCommand):
    """A change, stored as the text before and after, so that undo restores comments exactly."""

    def __init__(
        self,
        restore: Callable[[Version], None],
        name: str,
        before: Version,
        after: Version,
        burst: int,
    ) -> None:
        # Before the line break is what the list of changes shows, after it what follows "Undo".
        super().__init__(f"{name[:1].upper()}{name[1:]}\n{name}")
        # A weak reference: the document owns the undo stack that owns this edit.
        self._restore = WeakMethod(restore)
        self._before, self._after, self._burst = before, after, burst
        self._done = True

    def id(self) -> int:
        """Return a number by which Qt decides which edits it offers for merging."""
        return 1 if self._burst else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Merge a later edit of the same drag into this one."""
        if not isinstance(other, Edit) or other._burst != self._burst:
            return False
        if other.text() != self.text():
            return False
        self._after = other._after
        return True

    def redo(self) -> None:
        """Apply the edit again; Qt's first call does nothing, as the edit is already applied."""
        if not self._done:
            self._restore_version(self._after)
        self._done = True

    def undo(self) -> None:
        self._restore_version(self._before)
        self._done = False

    def _restore_version(self, version: Version) -> None:
        restore = self._restore()
        if restore is not None:
            restore(version)


class History(QUndoStack):
    """Undo stack of a `Document`, its parent; applies a waiting change before undo and redo."""

    def undo(self) -> None:
        self.parent().apply_waiting_change()
        super().undo()

    def redo(self) -> None:
        self.parent().apply_waiting_change()
        super().redo()

    def isClean(self) -> bool:
        """Return whether the document equals its saved state."""
        self.parent().apply_waiting_change()
        return super().isClean()
