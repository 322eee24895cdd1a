"""The wheel scrolls a page of fields, whatever lies under the mouse."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QWidget


class _Passing(QObject):
    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        """Let who stands around the widget have the wheel."""
        if event.type() != QEvent.Type.Wheel:
            return False
        event.ignore()
        return True


def leave_wheel(widget: QWidget) -> None:
    """Keep the wheel from a slider or a choice: who scrolls past it would change its value."""
    widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_Passing(widget))
