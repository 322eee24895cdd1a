"""What the window's parts are put together from: columns and rows, buttons, notes, timers."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from PySide6.QtCore import QObject, QSize, Qt, QTimer
from PySide6.QtGui import QAction, QKeySequence, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QBoxLayout,
    QHBoxLayout,
    QLabel,
    QLayout,
    QTableWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

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


def tool_button(text: str, tip: str = "", checkable: bool = False) -> QToolButton:
    """Return a flat button."""
    button = QToolButton()
    button.setText(text)
    button.setToolTip(tip)
    button.setCheckable(checkable)
    button.setAutoRaise(True)
    return button


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
    made = QAction(name, owner)
    made.setCheckable(checkable)
    made.setData(data)
    if key:
        made.setShortcut(QKeySequence(key))
    if tip:
        made.setToolTip(tip)
    if slot is not None:
        made.triggered.connect(slot)
    return made


def note(text: str = "", name: str = "about") -> QLabel:
    """Return a paragraph, whose name the style sheet knows."""
    label = QLabel(text)
    label.setObjectName(name)
    label.setWordWrap(True)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


def table(name: str, headings: Sequence[str]) -> QTableWidget:
    """Return a table to read, without lines, whose name the style sheet knows."""
    made = QTableWidget(0, len(headings))
    made.setObjectName(name)
    made.setHorizontalHeaderLabels(headings)
    made.verticalHeader().hide()
    made.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    made.setShowGrid(False)
    made.setAlternatingRowColors(True)
    return made


def later(owner: QObject, slot: Callable[[], object], milliseconds: int = 0) -> QTimer:
    """Return a timer that calls once when it is started."""
    timer = QTimer(owner)
    timer.setSingleShot(True)
    timer.setInterval(milliseconds)
    timer.timeout.connect(slot)
    return timer


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
