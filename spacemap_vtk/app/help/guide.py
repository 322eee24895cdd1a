"""Guided walks: a note beside a widget says what to do next, and goes on when it is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt, QTimer, Signal
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QFrame, QLabel, QMainWindow, QPushButton, QTabWidget, QWidget

from spacemap_vtk.app.widgets import column, note, row

#: How often it is checked whether a step is done, in ms.
_CHECK = 200
#: Width of the note and of the frame around the widget, and the space between, in pixels.
_WIDTH, _LINE, _GAP = 280, 3, 10
#: A widget of less height gets the note below it, in pixels.
_FLAT = 60

#: A widget; or a tab widget and the page whose tab is meant.
Target: TypeAlias = "QWidget | tuple[QTabWidget, QWidget]"


class Step(NamedTuple):
    """One thing to do."""

    text: str
    target: Callable[[], Target]
    """Returns what the note points to now."""
    is_done: Callable[[], bool] | None = None
    """Whether the user has done it; None: only the button leads on."""


class Walk(NamedTuple):
    """A title, and a function that returns the steps when the walk starts."""

    title: str
    start: Callable[[], Sequence[Step]]


class Guide(QObject):
    """Show the steps of one walk at a time."""

    #: The walk has ended; whether at its last step.
    ended = Signal(bool)

    def __init__(self, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self.steps: Sequence[Step] = ()
        self.number = 0
        #: Whether the present step has been seen undone: only then does doing it lead on.
        self._is_open = False
        self.bubble = QFrame(window, objectName="guide")
        self.bubble.setAutoFillBackground(True)
        self.bubble.setFixedWidth(_WIDTH)
        self.heading = QLabel()
        font = self.heading.font()
        font.setBold(True)
        self.heading.setFont(font)
        self.text = note(name="step")
        self.back_button, self.next_button = QPushButton("Back"), QPushButton("Skip")
        self.close_button = QPushButton("End")
        self.back_button.clicked.connect(lambda: self._go_to(self.number - 1))
        self.next_button.clicked.connect(lambda: self._go_to(self.number + 1))
        self.close_button.clicked.connect(self.stop)
        buttons = row(None, self.close_button, None, self.back_button, self.next_button)
        column(self.bubble, self.heading, self.text, buttons, margins=(12, 10, 12, 10), spacing=8)
        #: Where the note was when what is below it was last painted.
        self._repainted = QRect()
        #: Frame around the widget: left, right, top, bottom.
        self.frame = [QWidget(window) for _ in range(4)]
        for widget in (*self.frame, self.bubble):
            # The view is a native window, which would cover widgets that are not.
            widget.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
            widget.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
            widget.setAutoFillBackground(True)
            widget.hide()
        for line in self.frame:
            line.setBackgroundRole(QPalette.ColorRole.Highlight)
            line.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._timer = QTimer(self, interval=_CHECK)
        self._timer.timeout.connect(self._check)
        window.installEventFilter(self)

    def start(self, walk: Walk) -> None:
        """Begin a walk at its first step."""
        self.steps, self.number = walk.start(), 0
        self._go_to(0)
        self._timer.start()

    def stop(self) -> None:
        """End the walk."""
        at_end = bool(self.steps) and self.number >= len(self.steps) - 1
        self._timer.stop()
        self.steps = ()
        for widget in (*self.frame, self.bubble):
            widget.hide()
        self._repaint_below()
        self.ended.emit(at_end)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        """Follow the window's size."""
        if event.type() == QEvent.Type.Resize and self.steps:
            self._place()
        return False

    def _is_done(self, number: int) -> bool:
        is_done = self.steps[number].is_done
        return is_done is not None and is_done()

    def _go_to(self, number: int) -> None:
        # Forwards, leave out what is done already.
        while number >= self.number and number < len(self.steps) - 1 and self._is_done(number):
            number += 1
        if number >= len(self.steps):
            self.stop()
            return
        self.number = max(number, 0)
        self._is_open = not self._is_done(self.number)
        is_last = self.number == len(self.steps) - 1
        self.heading.setText(f"Step {self.number + 1} of {len(self.steps)}")
        self.text.setText(self.steps[self.number].text)
        self.next_button.setText("Finish" if is_last else "Skip")
        self.back_button.setEnabled(self.number > 0)
        self.close_button.setVisible(not is_last)
        self._place()

    def _check(self) -> None:
        """Go on if the step is done, and follow a widget that has moved."""
        is_done = self._is_done(self.number)
        if is_done and self._is_open:
            self._go_to(self.number + 1)
        else:
            self._is_open = not is_done
            self._place()

    def _place(self) -> None:
        """Put the frame around the widget and the note beside it, within the window."""
        area = self._area(self.steps[self.number].target())
        # Not `adjustSize`, which can use the height of the text before.
        self.bubble.layout().activate()
        self.bubble.resize(_WIDTH, self.bubble.layout().totalHeightForWidth(_WIDTH))
        size, window = self.bubble.size(), self._window.rect()
        left_end = min(area.left(), window.width() - size.width() - _GAP)
        below, above, left, right = (
            QPoint(left_end, area.bottom() + _GAP),
            QPoint(left_end, area.top() - size.height() - _GAP),
            QPoint(area.left() - size.width() - _GAP, area.top()),
            QPoint(area.right() + _GAP, area.top()),
        )
        places = [below, above, left, right] if area.height() < _FLAT else [left, right, below]
        fitting = [place for place in places if window.contains(QRect(place, size))]
        if fitting and area.height() * area.width() < window.height() * window.width() / 3:
            self.bubble.move(fitting[0])
        else:  # in a corner of what is large
            inside = QPoint(size.width() + _GAP, size.height() + _GAP)
            self.bubble.move(area.bottomRight() - inside)
        self._repaint_below()
        left, top, width, height = area.left(), area.top(), area.width(), area.height()
        for line, rect in zip(
            self.frame,
            (
                QRect(left, top, _LINE, height),
                QRect(left + width - _LINE, top, _LINE, height),
                QRect(left, top, width, _LINE),
                QRect(left, top + height - _LINE, width, _LINE),
            ),
            strict=True,
        ):
            line.setGeometry(rect)
        for widget in (*self.frame, self.bubble):
            widget.show()
            widget.raise_()

    def _repaint_below(self) -> None:
        """Repaint where the note was, which Qt leaves there: it is a native window."""
        shown = self.bubble.geometry() if self.bubble.isVisible() else QRect()
        if shown != self._repainted:
            self._window.update(self._repainted)
            self._repainted = shown

    def _area(self, target: Target) -> QRect:
        """Return where a widget or tab is in the window."""
        if isinstance(target, tuple):
            tabs, page = target
            widget: QWidget = tabs.tabBar()
            rect = tabs.tabBar().tabRect(tabs.indexOf(page))
        else:
            widget, rect = target, target.rect()
        area = QRect(widget.mapTo(self._window, rect.topLeft()), rect.size())
        return area.adjusted(-_LINE, -_LINE, _LINE, _LINE).intersected(self._window.rect())
