"""Changes of the document that can be undone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple
from weakref import WeakMethod

from PySide6.QtGui import QUndoCommand, QUndoStack


class Version(NamedTuple):
    """A text that a document had: what its paths mean depends on when that was."""

    text: str
    folder: Path
    """Relative paths count from it."""
    overwritten: int
    """How many drafts had been written over."""


class Edit(QUndoCommand):
    """A change, kept as the text before and after: comments come back exactly."""

    def __init__(
        self,
        restore: Callable[[Version], None],
        name: str,
        before: Version,
        after: Version,
        burst: int,
    ) -> None:
        super().__init__(name)
        # Weak: the document has the stack that this lies on.
        self._restore = WeakMethod(restore)
        self._before, self._after, self._burst = before, after, burst
        self._done = True

    def id(self) -> int:
        """Return the number that lets Qt offer edits for merging."""
        return 1 if self._burst else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Take in a later edit of the same drag."""
        if not isinstance(other, Edit) or other._burst != self._burst:
            return False
        if other.text() != self.text():
            return False
        self._after = other._after
        return True

    def redo(self) -> None:
        """Do it again; the first time it is done already."""
        if not self._done:
            self._go_to(self._after)
        self._done = True

    def undo(self) -> None:
        self._go_to(self._before)
        self._done = False

    def _go_to(self, version: Version) -> None:
        restore = self._restore()
        if restore is not None:
            restore(version)


class History(QUndoStack):
    """The edits of a `Document`, its parent: what still waits there is taken in before."""

    def undo(self) -> None:
        self.parent().catch_up()
        super().undo()

    def redo(self) -> None:
        self.parent().catch_up()
        super().redo()

    def isClean(self) -> bool:
        """Return whether the document is as it was saved."""
        self.parent().catch_up()
        return super().isClean()
