"""The menus and their shortcuts; the menu "Help" is in the folder `help`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby

from PySide6.QtCore import QEvent, QObject, QSettings, Qt, Signal
from PySide6.QtGui import QAction, QGuiApplication, QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QLineEdit,
    QMainWindow,
    QMenu,
    QWidget,
)
from shiboken6 import isValid

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.documents.files import FileCommands
from spacemap_vtk.app.documents.scene_as_code import as_command, as_script
from spacemap_vtk.app.panels.properties import Properties
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.panels.undo_list import UndoList
from spacemap_vtk.app.theme import apply_theme
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.view.view_bar import ViewBar
from spacemap_vtk.app.widgets import single_shot
from spacemap_vtk.app.work.exports import Exports
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.errors import InputError

_ENTER_KEYS = Qt.Key.Key_Return, Qt.Key.Key_Enter
_TAB_KEYS = Qt.Key.Key_Tab, Qt.Key.Key_Backtab


class Menus(QObject):
    """Fill the menu bar of a window."""

    #: The error that explains why a command is not possible.
    refused = Signal(object)
    #: A sentence about what is now in the clipboard.
    copied = Signal(str)

    def __init__(
        self,
        window: QMainWindow,
        document: Document,
        files: FileCommands,
        exports: Exports,
        times: TimeBar,
        tools: ViewBar,
        view: View3D,
        properties: Properties,
        panels: Iterable[QAction],
        presets: Iterable[QAction],
    ) -> None:
        super().__init__(window)
        self._properties = properties
        self._document, self._files, self._times = document, files, times
        self._tools, self._view = tools, view
        self.actions: dict[str, QAction] = {}
        self.undo_list: UndoList | None = None
        keys = QKeySequence.StandardKey
        menu = self._add_menu("&File")
        self._add_action(menu, "New", keys.New, files.new)
        self._add_action(menu, "Open…", keys.Open, files.open)
        self.recent = menu.addMenu("Recent files")
        self.recent.aboutToShow.connect(self._fill_recent)
        self.scenes = menu.addMenu("Scenes")
        for kind, entries in groupby(thumbnails.entries(), lambda entry: entry.group):
            group = self.scenes.addMenu(kind)
            for entry in entries:
                self._add_action(group, entry.title, None, self._open_named).setData(entry.name)
        menu.addSeparator()
        self._add_action(menu, "Save", keys.Save, files.save)
        self._add_action(menu, "Save as…", "Ctrl+Shift+S", files.save_as)
        menu.addSeparator()
        self._add_action(menu, "Save screenshot…", "Ctrl+P", lambda: files.save_picture(view))
        inside = menu.addMenu("Export")
        self._add_action(inside, "Export picture…", "Ctrl+Shift+E", exports.picture)
        self._add_action(inside, "Export film…", "Ctrl+Shift+F", exports.film)
        self._add_action(inside, "Export figure page…", None, exports.figure)
        self._add_action(inside, "Run a sweep…", None, exports.sweep)
        self._add_action(inside, "Export data…", "Ctrl+E", exports.data)
        irregular = self._add_action(inside, "Irregular yarns in data", None, lambda: None)
        irregular.setCheckable(True)
        irregular.toggled.connect(exports.set_irregular)
        irregular.setToolTip("Export yarns as irregular as pictures show them, not as measured")
        self._add_action(menu, "Print draft…", None, exports.draft)
        menu.addSeparator()
        self._add_action(menu, "Close", keys.Close, window.close, keys.Quit)
        menu = self._add_menu("&Edit")
        # Not the actions of Qt's undo stack, which ignore a change that is still waiting.
        history = document.history
        undo = self._add_action(menu, "Undo", keys.Undo, self._undo)
        redo = self._add_action(menu, "Redo", keys.Redo, history.redo, "Ctrl+Y")
        for action in (undo, redo):
            action.setObjectName(action.text())
            action.setEnabled(False)
        history.canUndoChanged.connect(undo.setEnabled)
        for signal in (properties.refused, properties.accepted):
            signal.connect(self._update_undo)
        history.canRedoChanged.connect(redo.setEnabled)
        history.undoTextChanged.connect(lambda name: undo.setText(f"Undo {name}".strip()))
        history.redoTextChanged.connect(lambda name: redo.setText(f"Redo {name}".strip()))
        self._add_action(menu, "Undo list…", None, self._show_undo_list)
        menu.addSeparator()
        menu.setToolTipsVisible(True)
        self._add_action(menu, "Copy picture", "Ctrl+Shift+C", self._copy_picture)
        fine = self._add_action(menu, "Copy exported picture", None, exports.copy_picture)
        fine.setToolTip("Draw the picture as for a file, with the size of the last export")
        self._add_action(menu, "Copy as command line", None, lambda: self._copy(as_command))
        self._add_action(menu, "Copy as Python script", None, lambda: self._copy(as_script))
        self.cloth = menu = self._add_menu("&Cloth")
        menu.setToolTipsVisible(True)
        for preset in presets:
            menu.addAction(preset)
            self.actions[f"Cloth: {preset.text()}"] = preset
        menu.addSeparator()
        menu.addAction(tools.let_go)
        self.time = menu = self._add_menu("&Time")
        self._add_action(menu, "Play or pause", "Space", times.play.click)
        self._add_action(menu, "Go to start", "Home", times.go_to_start)
        self._add_action(menu, "Go to end", "End", times.go_to_end)
        self._add_action(menu, "Previous frame", ",", times.step_back)
        self._add_action(menu, "Next frame", ".", times.step_forward)
        menu = self._add_menu("&View")
        menu.addMenu("Show").addActions([*tools.part_actions.values()])
        menu.addAction(tools.keys.ruler)
        menu.addSeparator()
        for name, choices in (
            ("Lines and points", tools.keys.appearance_actions),
            ("Colour by", tools.coloring_actions),
            ("Camera", tools.camera_actions),
            ("Clip plane", [tools.clip, *tools.clip_sides]),
            ("Style", [*tools.styles.values()]),
            ("Light", [*tools.lights.values()]),
            ("Background", [*tools.backgrounds.values()]),
        ):
            inside = menu.addMenu(name)
            inside.addActions(choices)
            if name == "Camera":
                inside.insertMenu(tools.orthographic, tools.saved_cameras.saved)
                inside.addMenu(tools.saved_cameras.deleted)
                inside.addMenu("Zoom").addActions(tools.keys.camera_actions)
        menu.addSeparator()
        inside = menu.addMenu("Window")
        for shown in panels:
            inside.addAction(shown)
            self.actions[shown.text()] = shown
        self.dark = self._add_action(inside, "Dark theme", "Ctrl+D", self._set_theme)
        self.dark.setCheckable(True)
        stored, scheme = QSettings().value("dark"), QGuiApplication.styleHints().colorScheme()
        follows = scheme == Qt.ColorScheme.Dark  # until the user chooses a theme
        self.dark.setChecked(follows if stored is None else stored == "true")
        self._apply_theme()
        _FieldKeyFilter(window, view.canvas)

    def _add_menu(self, title: str) -> QMenu:
        return self.parent().menuBar().addMenu(title)

    def _add_action(
        self, menu: QMenu, name: str, key: object, slot: Callable[..., object], *more: object
    ) -> QAction:
        action = QAction(name, self)
        if key is not None:
            _set_shortcuts(action, key, *more)
        action.triggered.connect(slot)
        menu.addAction(action)
        self.actions[name] = action
        return action

    def _undo(self) -> None:
        """Undo; if a value was refused, that is the last action, and its field is restored."""
        if not self._properties.restore_refused():
            self._document.history.undo()

    def _show_undo_list(self) -> None:
        if self.undo_list is None:
            self.undo_list = UndoList(self.parent(), self._document.history)
        self.undo_list.show()

    def _update_undo(self, _: object) -> None:
        refused = any(row.error_kind == "value" for row in self._properties.rows.values())
        self.actions["Undo"].setEnabled(refused or self._document.history.canUndo())

    def _fill_recent(self) -> None:
        self.recent.clear()
        for name in self._files.recent:
            action = self.recent.addAction(name)
            action.setData(name)
            action.triggered.connect(self._open_named)
        self.recent.setToolTipsVisible(True)

    def _open_named(self) -> None:
        self._files.switch_to(self.sender().data())

    def _copy_picture(self) -> None:
        """Copy the picture of the view as it is shown."""
        image = self._view.canvas.grabFramebuffer()
        QGuiApplication.clipboard().setImage(image)
        size = f"{image.width()} × {image.height()} pixels"
        self.copied.emit(f"The picture is in the clipboard, {size}")

    def _copy(self, text_of: Callable[[Document, float], str]) -> None:
        """Copy the scene as text; refused if a file of it exists only temporarily."""
        if unsaved := self._document.unsaved_file:
            self.refused.emit(
                InputError(
                    f"{unsaved} is not saved in a file yet",
                    cure="Save the scene, then copy again.",
                )
            )
            return
        try:
            text = text_of(self._document, self._times.time)
        except InputError as error:
            self.refused.emit(error)
        else:
            QGuiApplication.clipboard().setText(text)
            self.copied.emit("The text is in the clipboard")

    def _set_theme(self) -> None:
        QSettings().setValue("dark", "true" if self.dark.isChecked() else "false")
        self._apply_theme()

    def _apply_theme(self) -> None:
        apply_theme(QApplication.instance(), self.dark.isChecked())
        self._view.set_dark(self.dark.isChecked())


class _FieldKeyFilter(QObject):
    """Pass keys on to the window that Qt's input fields would otherwise consume."""

    # Undo and redo are passed on if the field has nothing to undo. After Enter, the view gets the
    # keyboard focus, so that Space plays; Tab then continues from the field.

    def __init__(self, parent: QWidget, view: QWidget) -> None:
        super().__init__(parent)
        self._view = view
        #: The field that had the focus before Enter gave it to the view.
        self._last_field: QWidget | None = None
        self._enter_pressed = single_shot(self, self._focus_view, 0)
        view.installEventFilter(self)
        # Filter only the events of the focused field: a filter for all widgets would slow down
        # every event.
        QApplication.instance().focusChanged.connect(self._watch_field)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Pass a key to the window's shortcuts, or move the focus between field and view."""
        if not isinstance(event, QKeyEvent):
            return False
        pressed = event.type() == QEvent.Type.KeyPress
        if watched is self._view:
            field = self._last_field
            if not (pressed and field and isValid(field) and event.key() in _TAB_KEYS):
                return False
            field.setFocus()
            return QApplication.sendEvent(field, event)
        if pressed and event.key() in _ENTER_KEYS:
            self._enter_pressed.start()  # after the field has processed Enter
        if event.type() != QEvent.Type.ShortcutOverride:
            return False
        line = watched if isinstance(watched, QLineEdit) else watched.findChild(QLineEdit)
        keys = QKeySequence.StandardKey
        # A refused value is undone as a whole, not letter by letter.
        if line is None:  # a combo box without an input field
            return False
        idle = (event.matches(keys.Undo) and (_is_refused(line) or not line.isUndoAvailable())) or (
            event.matches(keys.Redo) and not line.isRedoAvailable()
        )
        if idle:
            event.ignore()
        return idle

    def _watch_field(self, before: QWidget | None, now: QWidget | None) -> None:
        if before is self._view:
            self._last_field = None
        elif before is not None:
            before.removeEventFilter(self)
        if isinstance(now, (QLineEdit, QAbstractSpinBox, QComboBox)):
            now.installEventFilter(self)

    def _focus_view(self) -> None:
        """Give the focus to the view, unless the value was refused or it is a search field."""
        line = QApplication.focusWidget()
        if not isinstance(line, (QLineEdit, QAbstractSpinBox)) or _is_refused(line):
            return
        searched = isinstance(line, QLineEdit) and line.isClearButtonEnabled()
        if line.window() is self.parent() and not searched:
            self._view.setFocus()
            self._last_field = line


def _is_refused(widget: QWidget | None) -> bool:
    """Return whether a widget or one of its parents is marked as refused."""
    while widget is not None and not widget.property("bad"):
        widget = widget.parentWidget()
    return widget is not None


def _set_shortcuts(action: QAction, *keys: object) -> None:
    # A standard key can map to the same keys as another one; Qt wants each once.
    action.setShortcuts(list(dict.fromkeys(QKeySequence(key) for key in keys)))
