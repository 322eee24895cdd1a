"""All actions of a menu bar, with their menus: for the list of keys and the command palette."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenuBar, QToolBar


class MenuEntry(NamedTuple):
    """An action and where it is."""

    path: tuple[str, ...]
    """Titles of the menus that lead to it."""
    action: QAction

    @property
    def title(self) -> str:
        """Name of the action without the mark of a keyboard access."""
        return _plain(self.action.text())


def menu_entries(bar: QMenuBar, tools: QToolBar) -> Iterator[MenuEntry]:
    """Yield each action of the menus once, then those that are only in the tool bar."""
    seen: set[QAction] = set()

    def walk(actions: list[QAction], path: tuple[str, ...]) -> Iterator[MenuEntry]:
        for action in actions:
            if (menu := action.menu()) is not None:
                yield from walk(menu.actions(), (*path, _plain(action.text())))
            elif action.text() and not action.isSeparator() and action not in seen:
                seen.add(action)
                yield MenuEntry(path, action)

    yield from walk(bar.actions(), ())
    yield from walk([action for action in tools.actions() if action.menu() is None], ("View",))


def _plain(text: str) -> str:
    return text.replace("&", "")
