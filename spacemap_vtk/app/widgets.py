"""What the window's parts are put together from: columns and rows, buttons, notes, timers."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from PySide6.QtCore import QObject, QSize, Qt, QTimer, Signal
from PySide6.QtGui import (
    QAction,
    QFocusEvent,
    QKeyEvent,
    QKeySequence,
    QPaintDevice,
    QPainter,
    QResizeEvent,
    QValidator,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QBoxLayout,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLayout,
    QSpinBox,
    QTableWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

#: Of numbers in a table, and of words beside a mark.
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter

#: What stands in a row or column: alone, with its share of the room, or None for room left empty.
Item: TypeAlias = "QWidget | QLayout | tuple[QWidget | QLayout, int] | None"


def column(owner: QWidget | None, *items: Item, **look: Any) -> QBoxLayout:
    """Put items one below the other; without an owner for use within another layout."""
    return _filled(QVBoxLayout() if owner is None else QVBoxLayout(owner), items, **look)


def row(owner: QWidget | None, *items: Item, **look: Any) -> QBoxLayout:
    """Put items side by side, likewise."""
    return _filled(QHBoxLayout() if owner is None else QHBoxLayout(owner), items, **look)


def _filled(
    layout: QBoxLayout,
    items: tuple[Item, ...],
    margins: tuple[int, int, int, int] = (0, 0, 0, 0),
    spacing: int | None = None,
) -> QBoxLayout:
    layout.setContentsMargins(*margins)
    if spacing is not None:
        layout.setSpacing(spacing)
    for item in items:
        what, share = item if isinstance(item, tuple) else (item, 0)
        if what is None:
            layout.addStretch(1)
        elif isinstance(what, QLayout):
            layout.addLayout(what, share)
        else:
            layout.addWidget(what, share)
    return layout


def tool_button(text: str, tip: str = "", **more: Any) -> QToolButton:
    """Return a flat button, with more of Qt's properties."""
    return QToolButton(text=text, toolTip=tip, autoRaise=True, **more)


def action(
    owner: QObject,
    name: str,
    slot: Callable[..., object] | None = None,
    key: str = "",
    tip: str = "",
    data: object = None,
    checkable: bool = False,
) -> QAction:
    """Return what menus, bars and keys do alike."""
    made = QAction(name, owner, checkable=checkable, shortcut=QKeySequence(key))
    made.setData(data)
    if tip:
        made.setToolTip(tip)
    if slot is not None:
        made.triggered.connect(slot)
    return made


def note(text: str = "", name: str = "about", **more: Any) -> QLabel:
    """Return a paragraph, whose name the style sheet knows."""
    look = {"wordWrap": True, "textFormat": Qt.TextFormat.PlainText, **more}
    return QLabel(text, objectName=name, **look)


def narrow(box: QComboBox, letters: int) -> QComboBox:
    """Let a choice be as narrow as so many letters, and its words be cut."""
    box.setMinimumContentsLength(letters)
    box.setSizeAdjustPolicy(box.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    return box


class CountBox(QSpinBox):
    """A field for a whole number, which also accepts the digits of a number out of range."""

    # Qt's own refuses the digit that leads out of the range: of 99999 it keeps 999 without a word.

    #: Emits why the typed number is out of range, and an empty text once it is in range.
    strayed = Signal(str)

    def __init__(self, **look: Any) -> None:
        super().__init__(**look)
        self.setCorrectionMode(QSpinBox.CorrectionMode.CorrectToNearestValue)
        self.lineEdit().textEdited.connect(lambda: self.strayed.emit(self.complaint))

    @property
    def complaint(self) -> str:
        """Why the typed number is refused; empty if it is accepted."""
        typed = self.cleanText().strip()
        if typed.isdecimal() and self.minimum() <= int(typed) <= self.maximum():
            return ""
        allowed = f"{self.minimum()} to {self.maximum()}{self.suffix()}"
        return f"{typed or 'nothing'} is out of range: allowed is {allowed}"

    def validate(self, text: str, place: int) -> object:
        """Let any digits be typed."""
        digits = text.removesuffix(self.suffix()).strip()
        if digits.isdecimal() and int(digits) > self.maximum():
            return QValidator.State.Intermediate, text, place
        return super().validate(text, place)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Bring what was typed into the range with Enter."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._bound()
        super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """Bring what was typed into the range as the box is left."""
        self._bound()
        super().focusOutEvent(event)

    def _bound(self) -> None:
        # Qt itself would replace a number that is too large by the minimum.
        typed = self.cleanText().strip()
        if self.complaint and typed.isdecimal():
            self.setValue(min(max(int(typed), self.minimum()), self.maximum()))


def table(name: str, headings: Sequence[str]) -> QTableWidget:
    """Return a table to read, without lines, whose name the style sheet knows."""
    made = QTableWidget(0, len(headings), objectName=name, alternatingRowColors=True)
    made.setHorizontalHeaderLabels(headings)
    made.verticalHeader().hide()
    made.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    made.setShowGrid(False)
    return made


def later(owner: QObject, slot: Callable[[], object], milliseconds: int = 0) -> QTimer:
    """Return a timer that calls once when it is started."""
    timer = QTimer(owner, singleShot=True, interval=milliseconds)
    timer.timeout.connect(slot)
    return timer


def painter_on(device: QPaintDevice) -> QPainter:
    """Return a painter whose edges are smooth."""
    # Whoever paints with it ends it: one that waits for Python to free it can end Qt.
    painter = QPainter(device)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    return painter


def is_dark(widget: QWidget) -> bool:
    """Return whether a widget is light on dark."""
    return bool(widget.palette().window().color().lightness() < 128)


class OneLine(QLabel):
    """A line that ends in dots where there is no room for it; some words of it are a link."""

    def __init__(self) -> None:
        super().__init__()
        #: What it tells in full.
        self.whole = ""
        self._link = "", ""

    def tell(self, text: str, words: str = "", link: str = "") -> None:
        """Tell something; a click on its words, if there are such, follows the link."""
        self.whole, self._link = text, (words, link)
        self._fit()

    def minimumSizeHint(self) -> QSize:
        """Ask for no room: the window can be as narrow as its other parts let it."""
        return QSize(0, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show as much as there is room for now."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        width = self.contentsRect().width()
        shown = self.fontMetrics().elidedText(self.whole, Qt.TextElideMode.ElideRight, width)
        words, link = self._link
        linked = bool(words) and words in shown
        self.setTextFormat(Qt.TextFormat.RichText if linked else Qt.TextFormat.PlainText)
        if linked:
            shown = html.escape(shown).replace(words, f'<a href="{link}">{words}</a>')
        self.setText(shown)


def mark(widget: QWidget, bad: bool) -> bool:
    """Mark a widget as refused or as good; return whether that is another word than before."""
    if bool(widget.property("bad")) == bad:
        return False
    widget.setProperty("bad", bad)
    # A style sheet looks at a property only when it is told to.
    for each in (widget, *widget.findChildren(QWidget)):
        each.style().unpolish(each)
        each.style().polish(each)
    return True
