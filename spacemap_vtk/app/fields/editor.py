"""What all editors of a parameter share."""

from __future__ import annotations

import tomllib
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from spacemap_vtk.parameters import Parameter


class Editor(QWidget):
    """Shows and edits one value; base of one class for each kind of parameter."""

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

    def limit(self, low: float, high: float) -> None:
        """Learn the interval in which a value is feasible at present."""

    def is_new(self, text: str) -> bool:
        """Return whether a text is not that of the value that holds; if it is, that is told."""
        if text == self.shown:
            self.restored.emit()
        return text != self.shown


def written_from(text: str) -> Any:
    """Return what a user's text stands for in a scene file."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()
