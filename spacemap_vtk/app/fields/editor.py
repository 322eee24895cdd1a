"""Base classes of the editors of parameters."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtWidgets import QLineEdit, QWidget

from spacemap_vtk.parameters import Parameter
from spacemap_vtk.units import typeset_units


class Editor(QWidget):
    """Widget that shows and edits one value; base of the editors of all kinds of parameters."""

    #: Whether the editor needs a separate line below its label.
    wide = True
    #: A value as in a scene file, and the burst: a number that is the same during one drag.
    edited = Signal(object, int)
    #: The error of an input that is no value for a scene file.
    refused = Signal(object)
    #: Whether a drag is in progress.
    dragging = Signal(bool)
    #: The text is again that of the present value, so that a refused text is gone.
    restored = Signal()

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__()
        self.parameter = parameter
        #: The present value as text.
        self.shown = ""

    def show_value(self, value: Any) -> None:
        """Show a valid value, without emitting a signal."""
        raise NotImplementedError

    def show_in_use(self, value: Any) -> None:
        """Show the value in use while the parameter is automatic."""

    def set_half_width(self) -> None:
        """Change to a layout of half the width, beside another editor."""

    def set_feasible(self, low: float, high: float) -> None:
        """Set the interval of feasible values."""

    def is_new(self, text: str) -> bool:
        """Return whether a text differs from the present value's; if not, emit `restored`."""
        if text == self.shown:
            self.restored.emit()
        return text != self.shown


class LineEditor(Editor):
    """Editor with an input line; the typed value is set by Enter or by leaving the line."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.line = QLineEdit(placeholderText=parameter.automatic)
        self.line.textEdited.connect(self.is_new)
        self.setFocusProxy(self.line)
        self.line.editingFinished.connect(self._submit)

    def show_in_use(self, value: Any) -> None:
        """Show the value in use in grey; without one, show the meaning of "automatic"."""
        if isinstance(value, float):
            value = float(f"{value:.4g}")
        elif isinstance(value, tuple) and all(isinstance(each, float) for each in value):
            value = self.parameter.convert([float(f"{each:.4g}") for each in value])
        text = (
            self.parameter.automatic
            if value is None
            else typeset_units(self.parameter.format(value))
        )
        self.line.setPlaceholderText(text)

    def show_text(self, text: str) -> None:
        """Show the text of the present value."""
        self.shown = text
        self.line.setText(text)

    def parse_text(self, text: str) -> Any:
        """Convert a text to a value for a scene file; None for the default."""
        return text.strip() or None

    def _submit(self) -> None:
        # Leaving a line without a change is not an edit.
        if self.is_new(self.line.text()):
            self.edited.emit(self.parse_text(self.line.text()), 0)


def ignore_wheel(widget: QWidget) -> None:
    """Let a widget ignore the mouse wheel: scrolling the page would change its value."""
    widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_WheelFilter(widget))


class _WheelFilter(QObject):
    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        """Pass wheel events on to the page of fields, which scrolls."""
        if event.type() != QEvent.Type.Wheel:
            return False
        event.ignore()
        return True
