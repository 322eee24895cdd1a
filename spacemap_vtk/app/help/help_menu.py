"""The menu "Help": manual, command palette, guided walks, keys, about."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from PySide6 import __version__ as qt_version
from PySide6.QtCore import QObject
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QMainWindow, QMessageBox, QToolBar
from vtkmodules.vtkCommonCore import vtkVersion

from spacemap_vtk import __version__
from spacemap_vtk.app.help.command_palette import CommandPalette, Entry
from spacemap_vtk.app.help.guide import Guide, Walk
from spacemap_vtk.app.help.manual import Manual, online_address
from spacemap_vtk.app.help.menu_tree import MenuEntry, menu_entries
from spacemap_vtk.app.help.palette_entries import action_entries
from spacemap_vtk.app.help.shortcuts import Groups, key_groups, show_keys
from spacemap_vtk.app.widgets import action


class HelpMenu(QObject):
    """Fill the menu, which is the last of the window's menu bar."""

    def __init__(
        self,
        window: QMainWindow,
        tools: QToolBar,
        window_entries: Callable[[], Iterator[Entry]],
        walks: Iterable[Walk],
    ) -> None:
        super().__init__(window)
        self._window, self._tools = window, tools
        #: Yields what the palette finds besides the actions.
        self._window_entries = window_entries
        self.commands = CommandPalette(window)
        self.commands.chosen.connect(lambda entry: entry.run())
        self.manual: Manual | None = None
        self.guide = Guide(window)
        menu = window.menuBar().addMenu("&Help")
        for name, key, slot in (
            ("Manual", "F1", self.show_manual),
            ("Find a command…", "Ctrl+Shift+P", self.find_command),
            ("Keyboard and mouse", "Shift+F1", self._show_keys),
            ("About spacemap", "", self._show_about),
        ):
            # Drop Qt's argument "checked".
            shown = action(self, name, partial(_call, slot))
            shown.setShortcut(QKeySequence(key))
            if name.startswith("About"):
                menu.addSeparator()
            menu.addAction(shown)
            if name == "Manual":
                inside = menu.addMenu("Guided walks")
                for walk in walks:
                    begin = partial(_call, partial(self.guide.start, walk))
                    inside.addAction(action(self, walk.title, begin))

    @property
    def entries(self) -> list[MenuEntry]:
        """All actions of the menus and of the tool bar."""
        return list(menu_entries(self._window.menuBar(), self._tools))

    @property
    def key_groups(self) -> Groups:
        """Keys and mouse actions by topic."""
        return key_groups(self.entries)

    @property
    def palette_entries(self) -> list[Entry]:
        """All that the command palette finds now."""
        return [*action_entries(self.entries), *self._window_entries()]

    def show_manual(self) -> None:
        """Show the manual, which stays open beside the window."""
        if self.manual is None:
            self.manual = Manual(self._window)
        self.manual.show()
        self.manual.raise_()

    def find_command(self) -> None:
        """Open the command palette."""
        self.commands.open_with(self.palette_entries)

    def _show_keys(self) -> None:
        show_keys(self._window, self.key_groups)

    def _show_about(self) -> None:
        address = online_address()
        QMessageBox.about(
            self._window,
            "About spacemap",
            f"<h3>spacemap {__version__}</h3>"
            "<p>Woven fabric and other textiles, yarn by yarn: drawn, moved and measured.</p>"
            f"<p>VTK {vtkVersion().GetVTKVersion()}, Qt for Python {qt_version}, "
            f"Python {platform.python_version()}. MIT licence.</p>"
            + (f'<p><a href="{address}">{address}</a></p>' if address else ""),
        )


def _call(slot: object, *_: object) -> None:
    assert callable(slot)
    slot()
