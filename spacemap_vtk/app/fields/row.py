"""A parameter's row among the properties, and the editor that its kind gets there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QLabel, QWidget

from spacemap_vtk.app.fields.colors_editor import ColorsEditor
from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.known import told_interval
from spacemap_vtk.app.fields.lines import (
    ChoiceEditor,
    ColorEditor,
    FileEditor,
    FlagEditor,
    TextEditor,
)
from spacemap_vtk.app.fields.number import NumberEditor, VectorEditor
from spacemap_vtk.app.fields.pattern import PatternEditor
from spacemap_vtk.app.fields.supports_editor import SupportsEditor
from spacemap_vtk.app.widgets import column, mark, note, row, tool_button
from spacemap_vtk.parameters import Parameter

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


class ParameterRow(QWidget):
    """Name, "automatic" where that is a value, reset, editor, and a line for what is to be said."""

    #: Name, value as a scene file would have it (None: the default), burst.
    edited = Signal(str, object, int)
    #: Whether a drag goes on.
    held = Signal(bool)
    #: As `Editor.restored`.
    restored = Signal()

    def __init__(self, parameter: Parameter[Any], editor: Editor) -> None:
        super().__init__()
        self.parameter = parameter
        self.editor = editor
        self.note = note(name="note")
        self.note.hide()
        back = f"Back to the default: {parameter.show(parameter.default)}"
        self.reset = tool_button("↺", back)
        self.label = QLabel(parameter.label)
        self.label.setBuddy(self.editor)
        self.automatic: QCheckBox | None = None
        if parameter.automatic:
            self.automatic = QCheckBox("automatic")
            self.automatic.setToolTip(f"Automatic: {parameter.automatic}")
            self.automatic.clicked.connect(self._automatic_clicked)
        right = [self.automatic] if self.automatic is not None else []
        head = row(None, self.label, None, *right, self.reset, spacing=4)
        column(self, head, self.editor, self.note, margins=(0, 0, 0, 4), spacing=2)
        when = f" Counts where {parameter.counts}." if parameter.counts else ""
        self.setToolTip(f"{parameter.help}{when}\n\nAllowed: {parameter.allowed}.")
        self.resolved: Any = None
        #: What it is marked for, as `ErrorBar.say` has it; empty where nothing is wrong.
        self.about = ""
        self._feasible = self._in_force = ""
        self._idle = ""
        self.editor.edited.connect(self._edited)
        self.editor.held.connect(self.held)
        self.editor.restored.connect(self.restored)
        self.reset.clicked.connect(self._reset)

    def show_value(self, value: Any, is_default: bool) -> None:
        self.editor.show_value(value)
        if self.automatic is not None:
            self.automatic.setChecked(value is None)
        self.reset.setEnabled(not is_default)
        self.mark(None)

    def show_idle(self, why: str, written: bool) -> None:
        """Hide the row where its value counts for nothing; one that is written stays, in grey."""
        self.setVisible(not why or written)
        idle = f"does not count: {why}" if why else ""
        if idle != self._idle:
            self._idle = idle
            for widget in filter(None, (self.label, self.editor, self.automatic)):
                widget.setEnabled(not why)
            self.mark(None)

    def show_feasible(self, interval: tuple[float, float] | None) -> None:
        """Show the interval in which the value is feasible at present."""
        self._feasible = told_interval(self.parameter, interval)
        if interval is not None:
            self.editor.limit(*interval)
        if not self.note.property("bad"):
            self.mark(None)

    def show_in_force(self, figure: str) -> None:
        """Show what the last run has made of the value; empty: nothing is known."""
        text = f"in force: {figure}" if figure else ""
        if text != self._in_force:
            self._in_force = text
            if not self.note.property("bad"):
                self.mark(None)

    def mark(self, message: str | None, about: str = "") -> None:
        """Mark the row as refused, with the reason; None: as good."""
        self.about = about
        text = message or self._idle or self._feasible or self._in_force
        self._say(text, bad=message is not None)

    def _say(self, text: str, bad: bool) -> None:
        self.note.setText(text)
        self.note.setVisible(bool(text))
        for widget in (self.note, self.editor, self):
            mark(widget, bad)

    def _edited(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            written = None  # what is automatic is so by default
        self.edited.emit(self.parameter.name, written, burst)

    def _reset(self) -> None:
        self.edited.emit(self.parameter.name, None, 0)

    def _automatic_clicked(self, checked: bool) -> None:
        if checked:
            self.edited.emit(self.parameter.name, None, 0)
        elif self.resolved is not None:
            # Begin from what "automatic" has chosen, so that nothing jumps.
            text = self.parameter.show(self.resolved)
            self.edited.emit(self.parameter.name, _plain(self.resolved, text), 0)
        else:
            self.editor.setFocus()


def editor_of(parameter: Parameter[Any]) -> Editor:
    """Return a new editor for any kind but loads, whose editor is made of rows."""
    component: Any = getattr(parameter, "component", None)
    if parameter.kind == "series" and component.kind in ("real", "integer"):
        return NumberEditor(parameter)
    if parameter.kind == "series" and component.kind == "color":
        return ColorsEditor(parameter)
    return _EDITORS.get(parameter.kind, TextEditor)(parameter)


def _plain(value: Any, text: str) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return value if isinstance(value, int) else text
