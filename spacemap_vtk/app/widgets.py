"""Building blocks of the window: layouts, buttons, actions, notes, tables and timers."""

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
    QPaintEvent,
    QResizeEvent,
    QValidator,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QBoxLayout,
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QLayout,
    QProgressBar,
    QSpinBox,
    QStatusBar,
    QStyle,
    QStyleOptionComboBox,
    QStylePainter,
    QTableWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

#: Alignment of numbers in a table, and of words beside a mark.
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter

#: Item of a layout: a widget or layout, one with a stretch factor, or None for empty space.
Item: TypeAlias = "QWidget | QLayout | tuple[QWidget | QLayout, int] | None"


def column(owner: QWidget | None, *items: Item, **options: Any) -> QBoxLayout:
    """Lay out items vertically; without an owner, for use inside another layout."""
    return _fill_layout(QVBoxLayout() if owner is None else QVBoxLayout(owner), items, **options)


def row(owner: QWidget | None, *items: Item, **options: Any) -> QBoxLayout:
    """Lay out items horizontally; without an owner, for use inside another layout."""
    return _fill_layout(QHBoxLayout() if owner is None else QHBoxLayout(owner), items, **options)


def _fill_layout(
    layout: QBoxLayout,
    items: tuple[Item, ...],
    margins: tuple[int, int, int, int] = (0, 0, 0, 0),
    spacing: int | None = None,
) -> QBoxLayout:
    layout.setContentsMargins(*margins)
    if spacing is not None:
        layout.setSpacing(spacing)
    for item in items:
        content, share = item if isinstance(item, tuple) else (item, 0)
        if content is None:
            layout.addStretch(1)
        elif isinstance(content, QLayout):
            layout.addLayout(content, share)
        else:
            layout.addWidget(content, share)
    return layout


def tool_button(text: str, tip: str = "", **properties: Any) -> QToolButton:
    """Create a flat button; `properties` are those of Qt."""
    return QToolButton(text=text, toolTip=tip, autoRaise=True, **properties)


def action(
    owner: QObject,
    name: str,
    slot: Callable[..., object] | None = None,
    key: str = "",
    tip: str = "",
    data: object = None,
    checkable: bool = False,
) -> QAction:
    """Create an action for menus, tool bars and keys."""
    new_action = QAction(name, owner, checkable=checkable, shortcut=QKeySequence(key))
    new_action.setData(data)
    if tip:
        new_action.setToolTip(tip)
    if slot is not None:
        new_action.triggered.connect(slot)
    return new_action


def note(text: str = "", name: str = "about", **properties: Any) -> QLabel:
    """Create a paragraph of text; the style sheet refers to `name`."""
    options = {"wordWrap": True, "textFormat": Qt.TextFormat.PlainText, **properties}
    return QLabel(text, objectName=name, **options)


class NarrowComboBox(QComboBox):
    """A combo box that shrinks to a width of some letters, and shortens its text with dots."""

    def __init__(self, letters: int, **options: Any) -> None:
        super().__init__(**options)
        self.setMinimumContentsLength(letters)
        self.setSizeAdjustPolicy(self.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the box with its shortened text."""
        option = QStyleOptionComboBox()
        self.initStyleOption(option)
        kind, part = QStyle.ComplexControl.CC_ComboBox, QStyle.SubControl.SC_ComboBoxEditField
        room = self.style().subControlRect(kind, option, part, self).width() - 2
        shortened = Qt.TextElideMode.ElideRight
        option.currentText = self.fontMetrics().elidedText(option.currentText, shortened, room)
        painter = QStylePainter(self)
        painter.drawComplexControl(kind, option)
        painter.drawControl(QStyle.ControlElement.CE_ComboBoxLabel, option)
        painter.end()


class CountBox(QSpinBox):
    """A field for a whole number, which also accepts the digits of a number out of range."""

    # QSpinBox silently drops digits that leave the range: typing 99999 gives 999.

    #: Emits why the typed number is out of range, and an empty text once it is in range.
    range_error_changed = Signal(str)

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.setCorrectionMode(QSpinBox.CorrectionMode.CorrectToNearestValue)
        self.lineEdit().textEdited.connect(lambda: self.range_error_changed.emit(self.range_error))

    @property
    def range_error(self) -> str:
        """Why the typed number is refused; empty if it is accepted."""
        typed = self.cleanText().strip()
        if typed.isdecimal() and self.minimum() <= int(typed) <= self.maximum():
            return ""
        allowed = f"{self.minimum()} to {self.maximum()}{self.suffix()}"
        return f"{typed or 'nothing'} is out of range; allowed: {allowed}"

    def validate(self, text: str, place: int) -> object:
        """Accept all digits, also those of a number out of range."""
        digits = text.removesuffix(self.suffix()).strip()
        if digits.isdecimal() and int(digits) > self.maximum():
            return QValidator.State.Intermediate, text, place
        return super().validate(text, place)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Limit the typed number to the range on Enter."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._clamp()
        super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """Limit the typed number to the range when the field loses the focus."""
        self._clamp()
        super().focusOutEvent(event)

    def _clamp(self) -> None:
        # Qt would replace a number that is too large by the minimum.
        typed = self.cleanText().strip()
        if self.range_error and typed.isdecimal():
            self.setValue(min(max(int(typed), self.minimum()), self.maximum()))


def table(name: str, headings: Sequence[str]) -> QTableWidget:
    """Create a read-only table without grid lines; the style sheet refers to `name`."""
    widget = QTableWidget(0, len(headings), objectName=name, alternatingRowColors=True)
    widget.setHorizontalHeaderLabels(headings)
    widget.verticalHeader().hide()
    widget.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    widget.setShowGrid(False)
    return widget


def results_table(headings: Sequence[str]) -> QTableWidget:
    """Create a read-only table with narrow rows, whose columns are as wide as their texts."""
    widget = QTableWidget(0, len(headings))
    widget.setHorizontalHeaderLabels(headings)
    widget.verticalHeader().hide()
    widget.verticalHeader().setDefaultSectionSize(22)
    widget.setShowGrid(False)
    widget.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    widget.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    return widget


def show_share(bar: QProgressBar, share: float) -> None:
    """Show the share of some work that is done; an unknown share, 0, as a busy indicator."""
    # After its last step the work may still need time to join the results.
    bar.setRange(0, 100 if share > 0.0 else 0)
    bar.setValue(min(int(100 * share), 99))


def single_shot(owner: QObject, slot: Callable[[], object], milliseconds: int = 0) -> QTimer:
    """Create a timer that calls `slot` once after each start."""
    timer = QTimer(owner, singleShot=True, interval=milliseconds)
    timer.timeout.connect(slot)
    return timer


def painter_on(device: QPaintDevice) -> QPainter:
    """Create a painter with antialiasing."""
    # The caller must call ``end()``: a painter that only Python's garbage collector frees can
    # crash Qt.
    painter = QPainter(device)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    return painter


def is_dark(widget: QWidget) -> bool:
    """Return whether a widget has the dark theme."""
    return bool(widget.palette().window().color().lightness() < 128)


class ElidedLabel(QLabel):
    """A line of text, shortened with dots if necessary; some of its words can be a link."""

    def __init__(self) -> None:
        super().__init__()
        #: The unshortened text.
        self.full_text = ""
        self._link = "", ""

    def show_text(self, text: str, words: str = "", link: str = "") -> None:
        """Show a text; `words` in it become a link."""
        self.full_text, self._link = text, (words, link)
        self._shorten()

    def minimumSizeHint(self) -> QSize:
        """Return a width of 0, so that the text does not limit the width of the window."""
        return QSize(0, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Shorten the text to the new width."""
        super().resizeEvent(event)
        self._shorten()

    def _shorten(self) -> None:
        width = self.contentsRect().width()
        shown = self.fontMetrics().elidedText(self.full_text, Qt.TextElideMode.ElideRight, width)
        words, link = self._link
        linked = bool(words) and words in shown
        self.setTextFormat(Qt.TextFormat.RichText if linked else Qt.TextFormat.PlainText)
        if linked:
            shown = html.escape(shown).replace(words, f'<a href="{link}">{words}</a>')
        self.setText(shown)


class StatusBar(QStatusBar):
    """A status bar that shortens long messages with dots; the tool tip is the whole message."""

    def __init__(self) -> None:
        super().__init__()
        self.messageChanged.connect(self.setToolTip)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the message as far as it has room beside the permanent widgets."""
        message = self.currentMessage()
        if not message:
            super().paintEvent(event)
            return
        shown = [w for w in self.findChildren(QWidget) if w.parent() is self and w.isVisible()]
        room = self.rect().adjusted(6, 0, 0, 0)
        room.setRight(min([w.x() for w in shown], default=room.right()) - 6)
        text = self.fontMetrics().elidedText(message, Qt.TextElideMode.ElideRight, room.width())
        QPainter(self).drawText(room, Qt.AlignmentFlag.AlignVCenter, text)


def mark_bad(widget: QWidget, bad: bool) -> bool:
    """Mark a widget as bad or not; return whether this changed."""
    if bool(widget.property("bad")) == bad:
        return False
    widget.setProperty("bad", bad)
    for part in (widget, *widget.findChildren(QWidget)):
        restyle(part)
    return True


def restyle(widget: QWidget) -> None:
    """Apply the style sheet again: Qt evaluates properties in it only when it polishes a widget."""
    widget.style().unpolish(widget)
    widget.style().polish(widget)
