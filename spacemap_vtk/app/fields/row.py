"""A parameter's row among the properties, the editor that its kind gets, and rows together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel, QToolButton, QWidget

from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.known import told_interval
from spacemap_vtk.app.fields.lines import (
    ChoiceEditor,
    ColorEditor,
    ColorsEditor,
    FileEditor,
    FlagEditor,
    SupportsEditor,
    TextEditor,
    few,
)
from spacemap_vtk.app.fields.number import NumberEditor, VectorEditor
from spacemap_vtk.app.fields.pattern import PatternEditor
from spacemap_vtk.app.widgets import column, mark, note, row, tool_button
from spacemap_vtk.parameters import AUTOMATIC, Integer, Parameter
from spacemap_vtk.units import pretty

_EDITORS: dict[str, Callable[[Any], Editor]] = {
    "real": NumberEditor,
    "integer": NumberEditor,
    "flag": FlagEditor,
    "choice": ChoiceEditor,
    "vector": VectorEditor,
    "color": ColorEditor,
    "file": FileEditor,
    "supports": SupportsEditor,
    "pattern": PatternEditor,
}


#: Pixels of the names, so that lines stand below each other.
_NAMES = 94


class ParameterRow(QWidget):
    """Name, editor, "auto" where that is a value, reset, and a line for what is to be said."""

    #: Name, value as a scene file would have it (None: the default), burst.
    edited = Signal(str, object, int)
    #: Whether a drag goes on.
    held = Signal(bool)
    #: As `Editor.restored`.
    restored = Signal()

    def __init__(self, parameter: Parameter[Any], editor: Editor, beside: str = "") -> None:
        super().__init__()
        # `beside`: its name where it has half the room, next to another one; else empty.
        self.parameter = parameter
        self.editor = editor
        self.note = note(name="note")
        self.note.hide()
        back = f"Back to the default: {pretty(parameter.usually)}"
        self.reset = tool_button("↺", back)
        kept = self.reset.sizePolicy()
        kept.setRetainSizeWhenHidden(True)
        self.reset.setSizePolicy(kept)
        self.label = QLabel(beside or parameter.label)
        self.label.setBuddy(self.editor)
        self.automatic: QToolButton | None = None
        if parameter.automatic:
            tip = f"Automatic: {parameter.automatic}"
            self.automatic = tool_button("auto", tip, checkable=True, objectName="auto")
            self.automatic.clicked.connect(self._automatic_clicked)
        right = [self.automatic] if self.automatic is not None else []
        if beside or editor.wide:
            head = row(None, self.label, None, *right, self.reset, spacing=2)
            column(self, head, self.editor, self.note, margins=(0, 0, 0, 2), spacing=1)
        else:
            self.label.setFixedWidth(_NAMES)
            self.label.setWordWrap(True)
            line = row(None, self.label, (self.editor, 1), *right, self.reset, spacing=2)
            column(self, line, self.note, margins=(0, 0, 0, 2), spacing=1)
        if beside:
            editor.stack()
        when = f" Counts where {parameter.counts}." if parameter.counts else ""
        self.setToolTip(pretty(f"{parameter.help}{when}\n\nAllowed: {parameter.allowed}."))
        #: Whether it may be left out: a load's time function cannot do without some.
        self.resettable = True
        self.resolved: Any = None
        #: What it is marked for, as `ErrorBar.say` has it; empty where nothing is wrong.
        self.about = ""
        self._in_force = self._idle = ""
        #: Whether its value counts or is written, and whether it is what is searched for.
        self._there = self._sought = True
        self.editor.edited.connect(self._edited)
        self.editor.held.connect(self.held)
        self.editor.restored.connect(self.restored)
        self.reset.clicked.connect(lambda: self.edited.emit(parameter.name, None, 0))

    def show_value(self, value: Any, is_default: bool) -> None:
        self.editor.show_value(value)
        if self.automatic is not None:
            self.automatic.setChecked(value is None)
        self.reset.setVisible(self.resettable and not is_default)
        self._show_in_use()
        self.mark(None)

    def show_idle(self, why: str, written: bool) -> None:
        """Hide the row where its value counts for nothing; one that is written stays, in grey."""
        self._there = not why or written
        self.setVisible(self._there and self._sought)
        idle = f"does not count: {why}" if why else ""
        if idle != self._idle:
            self._idle = idle
            self.mark(None)

    def seek(self, words: list[str]) -> None:
        """Hide the row unless all these words stand in its name, its key or its help."""
        parameter = self.parameter
        text = f"{parameter.label} {parameter.name} {parameter.group} {parameter.help}".lower()
        self._sought = all(word in text for word in words)
        self.setVisible(self._there and self._sought)

    def show_resolved(self, value: Any) -> None:
        """Learn what the value has come to where it is automatic."""
        if value != self.resolved:
            self.resolved = value
            self._show_in_use()

    def _show_in_use(self) -> None:
        if self.automatic is not None:
            self.editor.show_in_use(self.resolved if self.automatic.isChecked() else None)

    def show_feasible(self, interval: tuple[float, float] | None) -> None:
        """Show the interval in which the value is feasible at present."""
        told = pretty(told_interval(self.parameter, interval))
        self.editor.setToolTip(f"{self.toolTip()}\n{told}" if told else "")
        if interval is not None:
            self.editor.limit(*interval)

    def show_in_force(self, figure: str) -> None:
        """Show what the last run has made of the value; empty: nothing is known."""
        text = f"in force: {pretty(figure)}" if figure else ""
        if text != self._in_force:
            self._in_force = text
            if not self.note.property("bad"):
                self.mark(None)

    def mark(self, message: str | None, about: str = "") -> None:
        """Mark the row as refused, with the reason; None: as good."""
        self.about = about
        # What a run refuses, because it does not count, can be put right where it stands.
        for widget in filter(None, (self.label, self.editor, self.automatic)):
            widget.setEnabled(not self._idle or message is not None)
        text = message or self._idle or self._in_force
        self.note.setText(text)
        self.note.setVisible(bool(text))
        for widget in (self.note, self.editor, self):
            mark(widget, message is not None)

    def _edited(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            written = self._automatically
        self.edited.emit(self.parameter.name, written, burst)

    @property
    def _automatically(self) -> str | None:
        """What is written of an automatic value: nothing where it is so by default."""
        return None if self.parameter.optional else AUTOMATIC

    def _automatic_clicked(self, checked: bool) -> None:
        if checked:
            self.edited.emit(self.parameter.name, self._automatically, 0)
        elif self.resolved is not None:
            # Begin from what "automatic" has chosen, so that nothing jumps.
            text = self.parameter.show(self.resolved)
            self.edited.emit(self.parameter.name, _plain(self.resolved, text), 0)
        else:
            self.editor.setFocus()


class Group(QWidget):
    """Rows below a heading; a click on that folds them."""

    def __init__(self, title: str) -> None:
        super().__init__()
        self.title = title
        self.rows: list[QWidget] = []
        self.head = tool_button(title, "Fold or unfold", checkable=True, objectName="group")
        self.head.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.body = QWidget()
        self._sought = False
        self.head.toggled.connect(self._show)

    def lay_out(self, folded: bool) -> None:
        """Take the rows in, once all are there."""
        column(self.body, *self.rows, spacing=4)
        column(self, self.head, self.body, spacing=2)
        self.head.setChecked(not folded)
        self._show()

    def unfold(self, sought: bool) -> None:
        """Show the rows, folded or not, while they are searched."""
        self._sought = sought
        self._show()

    def _show(self) -> None:
        opened = self.head.isChecked()
        self.body.setVisible(opened or self._sought)
        arrows = Qt.ArrowType
        self.head.setArrowType(arrows.DownArrow if opened else arrows.RightArrow)


class Pair(QWidget):
    """The warp's row and the weft's, side by side below what both are called."""

    def __init__(self, warp: ParameterRow, weft: ParameterRow) -> None:
        super().__init__()
        self.rows = warp, weft
        words = warp.parameter.label.split(maxsplit=1)[1]
        title = QLabel(words.capitalize(), toolTip=warp.toolTip())
        both = row(None, (warp, 1), (weft, 1), spacing=10)
        for side in self.rows:  # what is said below one leaves the other together
            both.setAlignment(side, Qt.AlignmentFlag.AlignTop)
        column(self, title, both, spacing=0)


def editor_of(parameter: Parameter[Any]) -> Editor:
    """Return a new editor for any kind but loads, whose editor is made of rows."""
    component: Any = getattr(parameter, "component", None)
    if isinstance(parameter, Integer) and few(parameter):
        return ChoiceEditor(parameter)
    if parameter.kind == "series" and component.kind in ("real", "integer"):
        return NumberEditor(parameter)
    if parameter.kind == "series" and component.kind == "color":
        return ColorsEditor(parameter)
    return _EDITORS.get(parameter.kind, TextEditor)(parameter)


def _plain(value: Any, text: str) -> Any:
    if isinstance(value, tuple) and not text.startswith("#"):
        return list(value)
    return value if isinstance(value, int) else text
