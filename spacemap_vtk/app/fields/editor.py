"""What all editors of a parameter share, and those that have a line to type in."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtWidgets import QLineEdit, QWidget

from spacemap_vtk.parameters import Parameter
from spacemap_vtk.units import pretty


class Editor(QWidget):
    """Shows and edits one value; base of one class for each kind of parameter."""

    #: Whether it takes a line of its own, below its name.
    wide = True
    #: A value as a scene file would have it, and a number that is the same during one drag.
    edited = Signal(object, int)
    #: Whether a drag goes on.
    held = Signal(bool)
    #: The text is again that of the value that holds: what was refused since is gone.
    restored = Signal()

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__()
        self.parameter = parameter
        #: The value that holds, as text.
        self.shown = ""

    def show_value(self, value: Any) -> None:
        """Show a checked value; emits nothing."""
        raise NotImplementedError

    def show_in_use(self, value: Any) -> None:
        """Learn what the value is in force where it is automatic."""

    def stack(self) -> None:
        """Stand in half the room, beside another one."""

    def limit(self, low: float, high: float) -> None:
        """Learn the interval in which a value is feasible at present."""

    def is_new(self, text: str) -> bool:
        """Return whether a text is not that of the value that holds; if it is, that is told."""
        if text == self.shown:
            self.restored.emit()
        return text != self.shown


class LineEditor(Editor):
    """Has a line; Enter or leaving it sets what is typed."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.line = QLineEdit(placeholderText=parameter.automatic)
        self.line.textEdited.connect(self.is_new)
        self.setFocusProxy(self.line)
        self.line.editingFinished.connect(self._typed)

    def show_in_use(self, value: Any) -> None:
        """Show it in grey, in place of where it comes from."""
        if isinstance(value, float):
            value = float(f"{value:.4g}")
        elif isinstance(value, tuple) and all(isinstance(each, float) for each in value):
            value = self.parameter.convert([float(f"{each:.4g}") for each in value])
        text = self.parameter.automatic if value is None else pretty(self.parameter.show(value))
        self.line.setPlaceholderText(text)

    def show_text(self, text: str) -> None:
        """Let the line have the text of the value that holds."""
        self.shown = text
        self.line.setText(text)

    def written(self, text: str) -> Any:
        """Return what a text stands for in a scene file."""
        return text.strip() or None

    def _typed(self) -> None:
        # Leaving a line that nobody touched is no edit.
        if self.is_new(self.line.text()):
            self.edited.emit(self.written(self.line.text()), 0)


def leave_wheel(widget: QWidget) -> None:
    """Keep the wheel from a slider or a choice: who scrolls past it would change its value."""
    widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_Passing(widget))


class _Passing(QObject):
    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        """Let who stands around the widget have the wheel: it scrolls the page of fields."""
        if event.type() != QEvent.Type.Wheel:
            return False
        event.ignore()
        return True
