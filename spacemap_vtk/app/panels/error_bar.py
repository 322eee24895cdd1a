"""The bar above the view that shows errors and their cures."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QLabel, QPushButton, QSizePolicy, QWidget

from spacemap_vtk.app.widgets import row, tool_button
from spacemap_vtk.errors import SpacemapError, one_line, shown

#: Most letters of a list of allowed values.
_MOST = 200


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
        self.run = QPushButton("Run")
        close = tool_button("✕")
        close.clicked.connect(self.hide)
        row(self, (self.label, 1), self.run, close, margins=(10, 6, 6, 6))
        self._about = ""
        #: Replaces names of temporary files by words for the user.
        self.told: Callable[[str], str] = str
        self.hide()

    def watch(self, about: str, failing: Iterable[Any], righting: Iterable[Any]) -> None:
        """Report the errors of some signals as one kind; clear this kind at other signals."""
        matter = _Matter(about, self)
        for signal in failing:
            signal.connect(matter.report)
        for signal in righting:
            signal.connect(matter.clear)

    def say(self, error: BaseException, about: str) -> None:
        self.warn(_words(error), about)

    def warn(self, text: str, about: str, can_run: bool = False) -> None:
        """Show a message."""
        self._about = about
        text = self.told(text)
        self.run.setVisible(can_run)
        self.label.setText(text)
        self.show()

    def clear(self, about: str | None = None) -> None:
        """Hide the bar if it shows this kind of message; None hides it in any case."""
        if about in (None, self._about) and not self.isHidden():
            self.hide()

    @property
    def text(self) -> str:
        """The shown message; empty while the bar is hidden."""
        return "" if self.isHidden() else self.label.text()


class _Matter(QObject):
    """Slots for one kind of error."""

    # A QObject instead of a `partial`, which would keep the window alive.

    def __init__(self, about: str, bar: ErrorBar) -> None:
        super().__init__(bar)
        self._about = about

    def report(self, error: BaseException) -> None:
        self.parent().reported.emit(self._about, error)

    def clear(self) -> None:
        self.parent().clear(self._about)


def _words(error: BaseException) -> str:
    if not isinstance(error, SpacemapError):
        return one_line(error)
    # Without the file name: the window shows it, and it would push the cure out of view.
    where = f"{error.section}.{error.key}" if error.section and error.key else error.key or ""
    if where and error.value is not None:
        where += f" = {shown(error.value)}"
    text = f"{where}: {error.message}" if where else error.message
    if error.allowed:
        # A full list of file endings would leave no room for the view.
        few, more, _ = error.allowed[:_MOST].rpartition(", ")
        many = len(error.allowed) > _MOST and more
        text += f"; allowed: {few + ' and more' if many else error.allowed}"
    text += "."
    return f"{text} {error.cure}" if error.cure else text
