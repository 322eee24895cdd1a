"""Versions of the scene on the page, for undo and redo."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

#: Most versions that are kept.
_MOST_VERSIONS = 500


class Opened(NamedTuple):
    """A scene as it was opened, or made by a preset; its changes start from here."""

    number: int
    """Different for each scene that was opened or made."""
    base: Path | None
    """File whose folder is the base of relative paths."""
    title: str
    """Title of the scene when it was opened; another pattern gives it another one."""
    pattern: tuple[Any, Any]
    """Pattern and draft of the weave."""
    warnings: tuple[str, ...] = ()
    """Warnings about the file."""


class Version(NamedTuple):
    """A state of the scene. Its values are never modified; each change makes new ones."""

    values: dict[str, Any]
    """The scene as in a scene file."""
    opened: Opened
    """The scene from which it was changed."""


class History:
    """The versions up to the newest one, and which of them is shown."""

    def __init__(self, first: Version) -> None:
        self._versions, self._names, self._shown = [first], [""], 0
        #: Name of the drag that has made the shown version; empty if none is in progress.
        self._drag = ""

    @property
    def version(self) -> Version:
        """The shown version."""
        return self._versions[self._shown]

    @property
    def undo_name(self) -> str:
        """What undo would undo; empty if there is nothing."""
        return self._names[self._shown]

    @property
    def redo_name(self) -> str:
        """What redo would do again; empty if there is nothing."""
        following = self._names[self._shown + 1 :]
        return following[0] if following else ""

    def add(self, version: Version, name: str, dragging: bool = False) -> None:
        """Add the version after a change; all changes of a drag make one version."""
        if self._drag == name:
            self._versions[self._shown] = version
        elif version == self.version:
            dragging = False
        else:
            kept = slice(max(0, self._shown + 2 - _MOST_VERSIONS), self._shown + 1)
            self._versions = [*self._versions[kept], version]
            self._names = [*self._names[kept], name]
            self._shown = len(self._versions) - 1
            self._names[0] = ""
        self._drag = name if dragging else ""

    def undo(self) -> None:
        """Show the version before."""
        self._go_to(self._shown - 1)

    def redo(self) -> None:
        """Show the version after."""
        self._go_to(self._shown + 1)

    def _go_to(self, index: int) -> None:
        self._drag = ""
        if 0 <= index < len(self._versions):
            self._shown = index
