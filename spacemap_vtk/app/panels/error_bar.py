"""The bar over the view that says what is wrong, and what helps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QLabel, QPushButton, QSizePolicy, QWidget

from spacemap_vtk.app.widgets import row, tool_button
from spacemap_vtk.errors import SpacemapError, one_line, shown

#: Letters of what is allowed.
_MOST = 200


class ErrorBar(QWidget):
    """Hidden while all is well."""

    # What it says stays until that is put right, another takes its place, or the user closes it.

    #: What is wrong, and the error.
    reported = Signal(str, object)

    def __init__(self) -> None:
        super().__init__(objectName="error")
        # Without this a style sheet does not colour a widget of one's own.
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        # What a file says is quoted here: of <img src=…> Qt would read the picture.
        self.label = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        self.label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        #: Goes on with a run that was cancelled.
        self.run = QPushButton("Run")
        close = tool_button("✕")
        close.clicked.connect(self.hide)
        row(self, (self.label, 1), self.run, close, margins=(10, 6, 6, 6))
        self._about = ""
        #: Puts words in place of what nobody knows of.
        self.told: Callable[[str], str] = str
        self.hide()

    def watch(self, about: str, failing: Iterable[Any], righting: Iterable[Any]) -> None:
        """Report what some signals bring, and clear it at others."""
        matter = _Matter(about, self)
        for signal in failing:
            signal.connect(matter.report)
        for signal in righting:
            signal.connect(matter.clear)

    def say(self, error: BaseException, about: str) -> None:
        self.warn(_words(error), about)

    def warn(self, text: str, about: str, can_run: bool = False) -> None:
        """Show a sentence."""
        self._about = about
        text = self.told(text)
        self.run.setVisible(can_run)
        self.label.setText(text)
        self.show()

    def clear(self, about: str | None = None) -> None:
        """Say nothing any more."""
        if about in (None, self._about) and not self.isHidden():
            self.hide()

    @property
    def text(self) -> str:
        """What it says; empty while it is hidden."""
        return "" if self.isHidden() else self.label.text()


class _Matter(QObject):
    """Something that can go wrong. Not a `partial`, which would keep the window."""

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
    # The window knows which file is open: its name would only push the cure out of sight.
    where = f"{error.section}.{error.key}" if error.section and error.key else error.key or ""
    if where and error.value is not None:
        where += f" = {shown(error.value)}"
    text = f"{where}: {error.message}" if where else error.message
    if error.allowed:
        # All endings of files would leave no room for the picture.
        few, more, _ = error.allowed[:_MOST].rpartition(", ")
        many = len(error.allowed) > _MOST and more
        text += f"; allowed: {few + ' and more' if many else error.allowed}"
    text += "."
    return f"{text} {error.cure}" if error.cure else text
