"""Rows of the properties: label, editor and note of a parameter; groups and pairs of rows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel, QToolButton, QWidget

from spacemap_vtk.app.fields.basic_editors import (
    ChoiceEditor,
    ColorEditor,
    ColorsEditor,
    FileEditor,
    FlagEditor,
    SupportsEditor,
    TextEditor,
    few_choices,
)
from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.number_editors import NumberEditor, VectorEditor
from spacemap_vtk.app.fields.parameter_info import format_interval
from spacemap_vtk.app.fields.pattern_editor import PatternEditor
from spacemap_vtk.app.widgets import column, mark_bad, note, row, tool_button
from spacemap_vtk.parameters import AUTOMATIC, Integer, Parameter
from spacemap_vtk.units import typeset_units

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


#: Width of the labels in pixels, which aligns the editors.
_LABEL_WIDTH = 94


class ParameterRow(QWidget):
    """Label, editor, button "auto" if the parameter can be automatic, reset button, and note."""

    #: Name, value as in a scene file (None for the default), and burst.
    edited = Signal(str, object, int)
    #: Whether a drag is in progress.
    dragging = Signal(bool)
    #: As `Editor.restored`.
    restored = Signal()

    def __init__(self, parameter: Parameter[Any], editor: Editor, half_label: str = "") -> None:
        super().__init__()
        # `half_label` is the label of a row of half the width, beside another row; otherwise empty.
        self.parameter = parameter
        self.editor = editor
        self.note = note(name="note")
        self.note.hide()
        back = f"Reset to the default: {typeset_units(parameter.default_text)}"
        self.reset = tool_button("↺", back)
        policy = self.reset.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.reset.setSizePolicy(policy)
        self.label = QLabel(half_label or parameter.label)
        self.label.setBuddy(self.editor)
        self.automatic: QToolButton | None = None
        if parameter.automatic:
            tip = f"Automatic: {parameter.automatic}"
            self.automatic = tool_button("auto", tip, checkable=True, objectName="auto")
            self.automatic.clicked.connect(self._toggle_automatic)
        right = [self.automatic] if self.automatic is not None else []
        if half_label or editor.wide:
            head = row(None, self.label, None, *right, self.reset, spacing=2)
            column(self, head, self.editor, self.note, margins=(0, 0, 0, 2), spacing=1)
        else:
            self.label.setFixedWidth(_LABEL_WIDTH)
            self.label.setWordWrap(True)
            line = row(None, self.label, (self.editor, 1), *right, self.reset, spacing=2)
            column(self, line, self.note, margins=(0, 0, 0, 2), spacing=1)
        if half_label:
            editor.set_half_width()
        when = f" Has an effect only if {parameter.condition}." if parameter.condition else ""
        self.setToolTip(typeset_units(f"{parameter.help}{when}\n\nAllowed: {parameter.allowed}."))
        #: Whether the value can be reset; some values of a time function are required.
        self.resettable = True
        self.automatic_value: Any = None
        #: Kind of the error that the row is marked with, as in `ErrorBar.say`; empty without one.
        self.error_kind = ""
        self._used = self._idle = ""
        #: Whether the value has an effect or is written; whether the row matches the search.
        self._is_relevant = self._matches_search = True
        self.editor.edited.connect(self._submit)
        self.editor.dragging.connect(self.dragging)
        self.editor.restored.connect(self.restored)
        self.reset.clicked.connect(lambda: self.edited.emit(parameter.name, None, 0))

    def show_value(self, value: Any, is_default: bool) -> None:
        self.editor.show_value(value)
        if self.automatic is not None:
            self.automatic.setChecked(value is None)
        self.reset.setVisible(self.resettable and not is_default)
        self._show_in_use()
        self.mark_error(None)

    def show_idle(self, reason: str, written: bool) -> None:
        """Hide a row whose value has no effect; disable it instead if the value is written."""
        self._is_relevant = not reason or written
        self.setVisible(self._is_relevant and self._matches_search)
        idle = f"no effect: {reason}" if reason else ""
        if idle != self._idle:
            self._idle = idle
            self.mark_error(None)

    def match_search(self, words: list[str]) -> None:
        """Hide the row unless its label, key, group and help contain all words."""
        parameter = self.parameter
        text = f"{parameter.label} {parameter.name} {parameter.group} {parameter.help}".lower()
        self._matches_search = all(word in text for word in words)
        self.setVisible(self._is_relevant and self._matches_search)

    def show_automatic_value(self, value: Any) -> None:
        """Set the value in use while the parameter is automatic."""
        if value != self.automatic_value:
            self.automatic_value = value
            self._show_in_use()

    def _show_in_use(self) -> None:
        if self.automatic is not None:
            self.editor.show_in_use(self.automatic_value if self.automatic.isChecked() else None)

    def show_feasible(self, interval: tuple[float, float] | None) -> None:
        """Show the feasible interval."""
        text = typeset_units(format_interval(self.parameter, interval))
        self.editor.setToolTip(f"{self.toolTip()}\n{text}" if text else "")
        if interval is not None:
            self.editor.set_feasible(*interval)

    def show_used(self, figure: str) -> None:
        """Show the value that the last run used; empty if unknown."""
        text = f"in use: {typeset_units(figure)}" if figure else ""
        if text != self._used:
            self._used = text
            if not self.note.property("bad"):
                self.mark_error(None)

    def mark_error(self, message: str | None, error_kind: str = "") -> None:
        """Mark the row as refused with a reason, or remove the mark with None."""
        self.error_kind = error_kind
        # A row without effect is disabled, unless it is refused: then the user must be able to
        # correct it.
        for widget in filter(None, (self.label, self.editor, self.automatic)):
            widget.setEnabled(not self._idle or message is not None)
        text = message or self._idle or self._used
        self.note.setText(text)
        self.note.setVisible(bool(text))
        for widget in (self.note, self.editor, self):
            mark_bad(widget, message is not None)

    def _submit(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            written = self._automatic_text
        self.edited.emit(self.parameter.name, written, burst)

    @property
    def _automatic_text(self) -> str | None:
        """Value in a scene file for "automatic"; None if that is the default."""
        return None if self.parameter.optional else AUTOMATIC

    def _toggle_automatic(self, checked: bool) -> None:
        if checked:
            self.edited.emit(self.parameter.name, self._automatic_text, 0)
        elif self.automatic_value is not None:
            # Start with the automatic value, so that nothing changes at first.
            text = self.parameter.format(self.automatic_value)
            self.edited.emit(self.parameter.name, _as_written(self.automatic_value, text), 0)
        else:
            self.editor.setFocus()


class RowGroup(QWidget):
    """Rows below a heading that folds them."""

    def __init__(self, title: str) -> None:
        super().__init__()
        self.title = title
        self.rows: list[QWidget] = []
        self.head = tool_button(
            title, "Show or hide these parameters", checkable=True, objectName="group"
        )
        self.head.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.body = QWidget()
        self._matches_search = False
        self.head.toggled.connect(self._show_body)

    def lay_out(self, folded: bool) -> None:
        """Lay out the rows after all have been added."""
        column(self.body, *self.rows, spacing=4)
        column(self, self.head, self.body, spacing=2)
        self.head.setChecked(not folded)
        self._show_body()

    def unfold(self, searching: bool) -> None:
        """Show the rows during a search, even if they are folded."""
        self._matches_search = searching
        self._show_body()

    def _show_body(self) -> None:
        opened = self.head.isChecked()
        self.body.setVisible(opened or self._matches_search)
        arrows = Qt.ArrowType
        self.head.setArrowType(arrows.DownArrow if opened else arrows.RightArrow)


class RowPair(QWidget):
    """The rows of warp and weft side by side, below their common label."""

    def __init__(self, warp: ParameterRow, weft: ParameterRow) -> None:
        super().__init__()
        self.rows = warp, weft
        title_text = warp.parameter.label.split(maxsplit=1)[1]
        title = QLabel(title_text.capitalize(), toolTip=warp.toolTip())
        pair = row(None, (warp, 1), (weft, 1), spacing=10)
        for side in self.rows:  # a note below one row does not stretch the other
            pair.setAlignment(side, Qt.AlignmentFlag.AlignTop)
        column(self, title, pair, spacing=0)


def make_editor(parameter: Parameter[Any]) -> Editor:
    """Create the editor for a parameter of any kind except loads, whose editor contains rows."""
    component: Any = getattr(parameter, "component", None)
    if isinstance(parameter, Integer) and few_choices(parameter):
        return ChoiceEditor(parameter)
    if parameter.kind == "series" and component.kind in ("real", "integer"):
        return NumberEditor(parameter)
    if parameter.kind == "series" and component.kind == "color":
        return ColorsEditor(parameter)
    return _EDITORS.get(parameter.kind, TextEditor)(parameter)


def _as_written(value: Any, text: str) -> Any:
    if isinstance(value, tuple) and not text.startswith("#"):
        return list(value)
    return value if isinstance(value, int) else text
