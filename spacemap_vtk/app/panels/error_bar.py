"""The bar above the view that shows errors and their cures."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QLabel, QPushButton, QSizePolicy, QWidget

from spacemap_vtk.app.widgets import row, tool_button
from spacemap_vtk.errors import SpacemapError, format_error, format_value

#: Most letters of a list of allowed values.
_MAX_LENGTH = 200


class ErrorBar(QWidget):
    """Bar with the present error or warning; hidden if there is none."""

    # A message stays until its cause is gone, another message replaces it, or the user closes it.

    #: The kind of the error, and the error.
    reported = Signal(str, object)

    def __init__(self) -> None:
        super().__init__(objectName="error")
        # Without this attribute, a style sheet does not colour a subclass of QWidget.
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        # Messages quote files. As rich text, Qt would load the image of a quoted <img src=…>.
        self.label = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        self.label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        #: Starts a cancelled run again.
        self.run_button = QPushButton("Run")
        close = tool_button("✕", "Close this message")
        close.clicked.connect(self.hide)
        row(self, (self.label, 1), self.run_button, close, margins=(10, 6, 6, 6))
        self._kind = ""
        #: Replaces names of temporary files by words for the user.
        self.replace_paths: Callable[[str], str] = str
        self.hide()

    def connect_signals(
        self, kind: str, error_signals: Iterable[Any], clear_signals: Iterable[Any]
    ) -> None:
        """Report the errors of some signals as one kind; clear this kind at other signals."""
        error_kind = _ErrorKind(kind, self)
        for signal in error_signals:
            signal.connect(error_kind.report)
        for signal in clear_signals:
            signal.connect(error_kind.clear)

    def show_error(self, error: BaseException, kind: str) -> None:
        self.show_warning(_format_error(error), kind)

    def show_warning(self, text: str, kind: str, can_run: bool = False) -> None:
        """Show a message."""
        self._kind = kind
        text = self.replace_paths(text)
        self.run_button.setVisible(can_run)
        self.label.setText(text)
        self.show()

    def clear(self, kind: str | None = None) -> None:
        """Hide the bar if it shows this kind of message; None hides it in any case."""
        if kind in (None, self._kind) and not self.isHidden():
            self.hide()

    @property
    def text(self) -> str:
        """The shown message; empty while the bar is hidden."""
        return "" if self.isHidden() else self.label.text()


class _ErrorKind(QObject):
    """Slots for one kind of error."""

    # A QObject instead of a `partial`, which would keep the window alive.

    def __init__(self, kind: str, bar: ErrorBar) -> None:
        super().__init__(bar)
        self._kind = kind

    def report(self, error: BaseException) -> None:
        self.parent().reported.emit(self._kind, error)

    def clear(self) -> None:
        self.parent().clear(self._kind)


def _format_error(error: BaseException) -> str:
    if not isinstance(error, SpacemapError):
        return format_error(error)
    # Without the file name: the window shows it, and it would push the cure out of view.
    where = f"{error.section}.{error.key}" if error.section and error.key else error.key or ""
    if where and error.value is not None:
        where += f" = {format_value(error.value)}"
    text = f"{where}: {error.message}" if where else error.message
    if error.allowed:
        # A full list of file endings would leave no room for the view.
        first, more, _ = error.allowed[:_MAX_LENGTH].rpartition(", ")
        many = len(error.allowed) > _MAX_LENGTH and more
        text += f"; allowed: {first + ' and more' if many else error.allowed}"
    text += "."
    return f"{text} {error.window_cure}" if error.window_cure else text
