"""Commands that edit a draft: their actions, keys and menus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QPoint, Qt, Signal
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import QDialog, QInputDialog, QMenu, QMenuBar

from spacemap_vtk.app.draft.draft_dialogs import DrawDialog, ExchangeDialog, RepeatDialog
from spacemap_vtk.app.draft.draft_view import DraftGrid
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.ndarrays import Ints
from spacemap_vtk.scenes import draft_edits as edits
from spacemap_vtk.scenes.draft_edits import PANEL_NAMES, STRIPS, Selection
from spacemap_vtk.scenes.editable_draft import EditableDraft
from spacemap_vtk.textile.drafts import blocks
from spacemap_vtk.textile.drafts.draws import make_draw
from spacemap_vtk.textile.drafts.patterns import GRAMMAR

#: Grids of marks, and those with a number for each end or pick.
_GRIDS = ("threading", "tieup", "treadling", "drawdown")
_DRAWN = ("threading", "treadling")
_ALL = (*_GRIDS, *STRIPS)
#: Weaves offered to fill a block.
_WEAVES = ("plain", "twill 2/2", "twill 3/1", "twill 1/3", "satin 5/2", "satin 8/3", "basket 2")
_FAMILY_NAMES = ("ends", "picks")
_Edit = Callable[[EditableDraft, Selection], EditableDraft]
#: A family, 0 for ends and 1 for picks, and the indices of some of its threads.
_Threads = tuple[int, slice]
_ThreadEdit = Callable[[EditableDraft, int, slice], EditableDraft]


class _Use(NamedTuple):
    """Where a command can be used."""

    panels: tuple[str, ...]
    #: Whether it changes the marks or colours of a panel.
    writes: bool = True
    needs_selection: bool = False


_ANYWHERE = _Use(_ALL, writes=False)


class DraftActions(QObject):
    """Create the commands of a draft's grid, and apply them to its selection."""

    #: Why a command is not possible, or what it did.
    message = Signal(str)
    #: The draft is hidden, and shall be shown.
    show_requested = Signal()

    def __init__(self, grid: DraftGrid, views: Sequence[QAction]) -> None:
        super().__init__(grid)
        self._grid = grid
        self._uses: dict[QAction, _Use] = {}
        #: Commands by name, for each menu.
        self.actions: dict[str, QAction] = {}
        #: What the commands apply to; if the draft is hidden, a command that shows it.
        self.header = QAction(self)
        self.header.triggered.connect(self.show_requested)
        #: The menu of the window and of the tab's button.
        self.menu = QMenu("&Draft", grid)
        self.menu.addAction(self.header)
        self.menu.addSeparator()
        self._add_clipboard(self.menu)
        self.menu.addSeparator()
        self._add_fills(self.menu.addMenu("Fill with"))
        self._add_changes(self.menu.addMenu("Change marks"))
        threads = self.menu.addMenu("Ends and picks")
        use = _Use(tuple(panel for panel in _ALL if panel != "tieup"), writes=False)
        for name, slot, key in (
            ("Insert ends or picks", self._ask_insert, "Ins"),
            ("Repeat ends or picks", self._ask_repeat, "Ctrl+Shift+R"),
            ("Delete ends or picks", self._delete, "Ctrl+Del"),
        ):
            self._add(threads, name, slot, key, use).setObjectName(name)
        threads.addSeparator()
        for family in (0, 1):
            self._add_threads(threads, family)
        self._add_whole(self.menu.addMenu("Whole draft"))
        self.menu.addActions(list(views))
        self.menu.aboutToShow.connect(self._update)
        self.menu.aboutToHide.connect(self._show_all)
        for signal in (grid.about_to_act, grid.selected, grid.shown_changed):
            signal.connect(self._update)
        grid.keys = [action for action in self.actions.values() if action.shortcuts()]
        grid.menu_requested.connect(self._show_menu)

    def _add(
        self,
        menu: QMenu,
        name: str,
        slot: Callable[[], object],
        key: object = None,
        use: _Use = _ANYWHERE,
        label: str = "",
    ) -> QAction:
        action = QAction(label or name, self)
        if key is not None:
            is_standard = isinstance(key, QKeySequence.StandardKey)
            action.setShortcuts(key if is_standard else [QKeySequence(key)])
            # The grid claims the keys while it has the focus: see DraftGrid.event.
            action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        action.triggered.connect(lambda: slot())
        menu.addAction(action)
        self._uses[action] = use
        self.actions[name] = action
        return action

    def _add_clipboard(self, menu: QMenu) -> None:
        keys = QKeySequence.StandardKey
        copied = _Use(_ALL, writes=False, needs_selection=True)
        changed = _Use(_ALL, needs_selection=True)
        self._add(menu, "Cut", self._cut, keys.Cut, changed._replace(panels=_GRIDS))
        self._add(menu, "Copy", self._copy, keys.Copy, copied)
        self._add(menu, "Paste", self._paste, keys.Paste, _Use(_ALL))
        more = menu.addMenu("Paste special")
        overlay = partial(self._paste, overlay=True)
        self._add(more, "Add to the marks", overlay, None, _Use(_GRIDS))
        threads = _Use((*_DRAWN, *STRIPS))
        insert = partial(self._paste_threads, "insert", edits.paste_threads)
        self._add(more, "Insert as new threads", insert, "Ctrl+Shift+V", threads)
        between = partial(self._paste_threads, "interleave", edits.interleave)
        self._add(more, "Interleave with the selection", between, None, threads)
        flips = ("Mirrored left to right", 1), ("Mirrored top to bottom", 0)
        for name, axis in flips:
            self._add(more, name, partial(self._paste, axis=axis), None, _Use(_ALL))
        clear = partial(self._apply, "delete marks", edits.clear)
        self._add(menu, "Delete marks", clear, keys.Delete, changed._replace(panels=_GRIDS))
        self._add(menu, "Select all", self._select_all, keys.SelectAll)

    def _add_fills(self, menu: QMenu) -> None:
        drawn = _Use(_DRAWN)
        for kind in ("straight", "point", "broken"):
            name = f"{kind.capitalize()} draw"
            self._add(menu, name, partial(self._fill, kind), None, drawn)
        self._add(menu, "Draw…", self._ask_draw, "Ctrl+Shift+D", drawn)
        self._add(menu, "Network…", self._ask_network, None, drawn)
        menu.addSeparator()
        weave = _Use(("tieup", "treadling", "drawdown"))
        self._add(menu, "Weave…", self._ask_weave, None, weave)
        self._add(menu, "Colour", self._fill_color, None, _Use(STRIPS), label="Selected colour")

    def _add_changes(self, menu: QMenu) -> None:
        for name, axis, key in (
            ("Mirror left to right", 1, "Ctrl+H"),
            ("Mirror top to bottom", 0, "Ctrl+U"),
        ):
            edit = partial(edits.mirror, axis=axis)
            self._add(menu, name, partial(self._apply, "mirror", edit), key, _Use(_ALL))
        shifts = menu.addMenu("Shift")
        for name, steps in (
            ("Left", (-1, 0)),
            ("Right", (1, 0)),
            ("Up", (0, -1)),
            ("Down", (0, 1)),
        ):
            self._add(
                shifts,
                f"Shift {name.lower()}",
                partial(self._shift, *steps),
                f"Alt+{name}",
                _Use(_ALL),
                label=name,
            )
        invert = partial(self._apply, "invert", edits.invert)
        self._add(menu, "Invert marks", invert, "Ctrl+I", _Use(_GRIDS))
        repeat = partial(self._apply, "repeat", edits.repeat_to_end)
        use = _Use(_ALL, needs_selection=True)
        self._add(menu, "Repeat to the end", repeat, "Ctrl+R", use)

    def _add_threads(self, menu: QMenu, family: int) -> None:
        """Add the commands of whole ends or picks, with their colours and spacings."""
        name = _FAMILY_NAMES[family]
        inside = menu.addMenu(name.capitalize())
        use = _Use((edits.END_PANELS, edits.PICK_PANELS)[family], writes=False)
        for label, slot in (
            ("Insert…", self._ask_insert),
            ("Repeat…", self._ask_repeat),
            ("Double", self._double),
            ("Reverse order", self._reverse),
            ("Delete", self._delete),
        ):
            self._add(
                inside, f"{label} {name}", partial(slot, family=family), None, use, label=label
            )

    def _add_whole(self, menu: QMenu) -> None:
        for name, edit, about in (
            ("Weave as drawn in", edits.weave_as_drawn_in, "Treadle in the order of the threading"),
            ("Weft colours as the warp", edits.color_as_warp, "In the same order as in the warp"),
            (
                "Fewest shafts and treadles",
                edits.reduce_loom,
                "Weave the same cloth; ends that always move together share a shaft",
            ),
            ("Turn the draft", edits.turn_draft, "Exchange warp and weft"),
            ("Turn the cloth over", edits.turn_over, "Weave it with its reverse up"),
        ):
            undo_name = name[0].lower() + name[1:]
            action = self._add(menu, name, partial(self._change, undo_name, edit))
            action.setToolTip(about)
        for what in ("shaft", "treadle"):
            self._add(menu, f"Exchange {what}s…", partial(self._ask_exchange, what))
        menu.setToolTipsVisible(True)

    def add_to(self, bar: QMenuBar, before: QAction) -> None:
        """Insert the menu into a menu bar."""
        # A menu of the grid would belong to a native window within the main window, which Qt
        # cannot show it for.
        self.menu.setParent(bar.window(), self.menu.windowFlags())
        bar.insertMenu(before, self.menu)
        self._update()

    def describe(self) -> str:
        """Describe what the commands apply to."""
        grid = self._grid
        if grid.shown is None:
            return "no draft"
        if grid.selection is not None:
            return grid.selection.describe(grid.shown.loom.liftplan is not None)
        return f"{self._panel_name(grid.place.panel)}, all"

    def _panel_name(self, panel: str) -> str:
        shown = self._grid.shown
        lifted = shown is not None and shown.loom.liftplan is not None
        return "liftplan" if lifted and panel == "treadling" else PANEL_NAMES[panel]

    def _update(self) -> None:
        """Enable what can be applied to the selection."""
        grid = self._grid
        hidden = not grid.isVisible()
        text = "show the draft" if hidden else self.describe()
        self.header.setText(text[0].upper() + text[1:])
        self.header.setEnabled(hidden)
        self._name_threads()
        for action, use in self._uses.items():
            # A hidden draft may be older than the scene.
            shown = None if hidden else grid.shown
            enabled = shown is not None and grid.place.panel in use.panels
            if enabled and use.needs_selection:
                enabled = grid.selection is not None
            if enabled and use.writes and grid.place.panel == "drawdown":
                enabled = shown is not None and shown.is_pattern
            if enabled and action is self.actions["Weave…"] and grid.place.panel == "treadling":
                enabled = shown is not None and shown.loom.liftplan is not None
            action.setEnabled(enabled)
        for menu in reversed(self.menu.findChildren(QMenu)):  # those within others first
            commands = (action for action in menu.actions() if not action.isSeparator())
            menu.menuAction().setEnabled(any(action.isEnabled() for action in commands))

    def _name_threads(self) -> None:
        """Let the commands of ends or picks say which ones they change."""
        family, part = self._threads(None)
        what = _FAMILY_NAMES[family]
        first, last = part.start + 1, part.stop
        some = f"{what[:-1]} {first}" if first == last else f"{what} {first}–{last}"
        repeated = some if self._grid.selection is not None else f"all {what}"
        for name, label in (
            ("Insert ends or picks", f"Insert {what} before {first}…"),
            ("Repeat ends or picks", f"Repeat {repeated}…"),
            ("Delete ends or picks", f"Delete {some}"),
        ):
            self.actions[name].setText(label)

    def _show_menu(self, at: QPoint) -> None:
        """Show the menu at a point, without what the panel under it does not have."""
        panel = self._grid.place.panel
        for action, use in self._uses.items():
            action.setVisible(panel in use.panels)
        for menu in reversed(self.menu.findChildren(QMenu)):
            commands = (action for action in menu.actions() if not action.isSeparator())
            menu.menuAction().setVisible(any(action.isVisible() for action in commands))
        self.menu.popup(at)

    def _show_all(self) -> None:
        for action in (*self._uses, *(m.menuAction() for m in self.menu.findChildren(QMenu))):
            action.setVisible(True)

    def _change(self, name: str, edit: Callable[[EditableDraft], EditableDraft]) -> None:
        """Edit the draft in one undo step, or tell why that is not possible."""
        grid = self._grid
        if grid.shown is None:
            return
        try:
            changed = edit(grid.shown)
        except SpacemapError as error:
            self.message.emit(_sentence(error))
        else:
            grid.change(changed, name)

    def _apply(self, name: str, edit: _Edit, place: Selection | None = None) -> None:
        """Apply an edit to a place, usually the selection or the whole panel."""
        if self._grid.shown is not None:
            selection = place or self._grid.target
            name = f"{self._panel_name(selection.panel)}: {name}"
            self._change(name, lambda shown: edit(shown, selection))

    def _copy(self) -> None:
        grid = self._grid
        if grid.shown is not None and grid.selection is not None:
            block = edits.read_block(grid.shown, grid.selection)
            QGuiApplication.clipboard().setText(blocks.write_block(block))
            self.message.emit(f"Copied: {self.describe()}.")

    def _cut(self) -> None:
        if self._grid.selection is not None:
            self._copy()
            self._apply("cut", edits.clear)

    def _clipboard_block(self) -> NDArray | None:
        try:
            return blocks.read_block(QGuiApplication.clipboard().text())
        except SpacemapError as error:
            self.message.emit(_sentence(error))
            return None

    def _paste(self, overlay: bool = False, axis: int | None = None) -> None:
        block, place = self._clipboard_block(), self._grid.place
        if block is None:
            return
        if axis is not None:
            upright = place.panel in ("threading", "tieup", "warp")
            block = np.flip(block, 1 - axis if upright else axis)
        self._apply("paste", partial(edits.paste, block=block, overlay=overlay), place)

    def _paste_threads(
        self,
        name: str,
        paste: Callable[[EditableDraft, Selection, NDArray], tuple[EditableDraft, Selection]],
    ) -> None:
        """Paste new ends or picks, and select them."""
        grid, block = self._grid, self._clipboard_block()
        if block is None or grid.shown is None:
            return
        place = grid.target if name == "interleave" else grid.place
        try:
            changed, placed = paste(grid.shown, place, block)
        except SpacemapError as error:
            self.message.emit(_sentence(error))
        else:
            grid.change(changed, f"{self._panel_name(place.panel)}: {name}")
            grid.select(placed)

    def _select_all(self) -> None:
        if self._grid.shown is not None:
            self._grid.select(edits.select_all(self._grid.shown, self._grid.place.panel))

    def _drawn_places(self) -> tuple[int, tuple[int, int], int]:
        """Return the number of threads to fill, the first and last place, and the highest one."""
        grid = self._grid
        assert grid.shown is not None
        target, whole = grid.target, edits.select_all(grid.shown, grid.target.panel)
        first, last = target.places
        count = target.threads.stop - target.threads.start
        return count, target.places if last > first else whole.places, whole.places[1]

    def _fill(self, kind: str) -> None:
        if self._grid.shown is not None and self._grid.place.panel in _DRAWN:
            count, places, _ = self._drawn_places()
            numbers = make_draw(kind, count, *places)
            self._fill_numbers(f"{kind} draw", numbers, self._grid.target)

    def _fill_numbers(self, name: str, numbers: Ints, place: Selection) -> None:
        self._apply(name, partial(edits.fill_with_numbers, numbers=numbers), place)

    # Commands that ask keep their place: under a dialog, the mouse leaves the cell that it was on.

    def _ask_draw(self) -> None:
        shown = self._grid.shown
        if shown is None or self._grid.place.panel not in _DRAWN:
            return
        place, lifted = self._grid.target, shown.loom.liftplan is not None
        what = "shaft" if place.panel == "threading" or lifted else "treadle"
        dialog = DrawDialog(self._grid.window(), *self._drawn_places(), what)
        if dialog.exec() == QDialog.DialogCode.Accepted:
            name = f"{dialog.kind.currentText().lower()} draw"
            self._fill_numbers(name, dialog.numbers, place)

    def _ask_network(self) -> None:
        if self._grid.shown is None:
            return
        place, window = self._grid.target, self._grid.window()
        text = "Threads move up to the next shaft of a network of a straight draw.\nIts shafts:"
        initial, accepted = QInputDialog.getInt(window, "Network", text, 4, 2, 64)
        if accepted:
            self._apply("network", partial(edits.move_to_network, initial=initial), place)

    def _ask_weave(self) -> None:
        if self._grid.shown is None:
            return
        place, window = self._grid.target, self._grid.window()
        text = f"Name of a weave:\n{GRAMMAR}"
        name, accepted = QInputDialog.getItem(window, "Fill with a weave", text, _WEAVES)
        if accepted:
            self._apply(name, partial(edits.fill_with_weave, name=name), place)

    def _fill_color(self) -> None:
        color = self._grid.color
        rgb = color.red(), color.green(), color.blue()
        self._apply("fill", partial(edits.fill_with_color, color=rgb))

    def _shift(self, across: int, down: int) -> None:
        if self._grid.shown is not None:
            steps = self._grid.number_steps(self._grid.target.panel, across, down)
            self._apply("shift", partial(edits.shift, right=steps[0], up=steps[1]))

    def _threads(self, family: int | None, all_without_selection: bool = False) -> _Threads:
        """Return the family of the panel in use, and its selected ends or picks."""
        grid = self._grid
        if family is None:
            family = 0 if grid.place.panel in edits.END_PANELS else 1
        if all_without_selection and grid.selection is None and grid.shown is not None:
            return family, slice(0, grid.shown.size[family])
        return family, grid.place.columns if family == 0 else grid.place.rows

    def _change_threads(self, name: str, edit: _ThreadEdit, threads: _Threads) -> None:
        family, part = threads
        self._change(f"{name} {_FAMILY_NAMES[family]}", lambda shown: edit(shown, family, part))

    def _double(self, family: int) -> None:
        self._change_threads("double", edits.double_threads, self._threads(family, True))

    def _reverse(self, family: int) -> None:
        self._change_threads("reverse", edits.reverse_threads, self._threads(family, True))

    def _delete(self, family: int | None = None) -> None:
        self._change_threads("delete", edits.delete_threads, self._threads(family))

    def _ask_exchange(self, what: str) -> None:
        grid = self._grid
        if grid.shown is None:
            return
        loom = grid.shown.loom
        count = loom.shafts if what == "shaft" else loom.treadles
        first, last = grid.place.places if grid.selection is not None else (1, 2)
        dialog = ExchangeDialog(grid.window(), what, count, (min(first, count), min(last, count)))
        if dialog.exec() == QDialog.DialogCode.Accepted:
            first, last = (field.value() for field in dialog.numbers)
            self._change(
                f"exchange {what}s {first} and {last}",
                lambda shown: edits.exchange(shown, what, first, last),
            )

    def _ask_insert(self, family: int | None = None) -> None:
        family, part = self._threads(family)
        what, window = _FAMILY_NAMES[family], self._grid.window()
        text = f"Number of empty {what} before {what[:-1]} {part.start + 1}:"
        count, accepted = QInputDialog.getInt(window, f"Insert {what}", text, 1, 1, 4096)
        if accepted:
            self._change(
                f"insert {what}",
                lambda shown: edits.insert_threads(shown, family, part.start, count),
            )

    def _ask_repeat(self, family: int | None = None) -> None:
        family, part = self._threads(family, True)
        what = _FAMILY_NAMES[family]
        dialog = RepeatDialog(self._grid.window(), part.stop - part.start, what)
        if dialog.exec() == QDialog.DialogCode.Accepted:
            times, mirrored = dialog.times.value(), dialog.mirrored.isChecked()
            self._change(
                f"repeat {what}",
                lambda shown: edits.repeat_threads(shown, family, part, times, mirrored),
            )


def _sentence(error: SpacemapError) -> str:
    text = str(error)
    return f"{text[:1].upper()}{text[1:]}".rstrip(".") + "."
