"""Widget with the chart of a knit: symbols and colours of stitches, the first row at the bottom."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QFont,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from spacemap_vtk.app.draft.draft_painter import DraftColors
from spacemap_vtk.app.widgets import is_dark, painter_on
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.editable_knit import STITCHES, EditableKnit
from spacemap_vtk.textile.rods.stitches import stitches_made

#: Symbols of the stitches; knit stitches are blank.
SYMBOLS = {
    "k": "",
    "p": "●",
    "t": "∩",
    "m": "―",
    "f": "═",
    "yo": "○",
    "k2tog": "╱",
    "ssk": "╲",
    "sk2p": "λ",
    "s2kp": "Λ",
    "c4f": "╲╱",
    "c4b": "╱╲",
}
#: Keys that set a stitch, by their text.
KEYS = {
    "k": "k",
    "p": "p",
    "t": "t",
    "m": "m",
    "f": "f",
    "y": "yo",
    "/": "k2tog",
    "\\": "ssk",
    "s": "sk2p",
    "v": "s2kp",
    "<": "c4f",
    ">": "c4b",
}
_STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, 1),
    Qt.Key.Key_Down: (0, -1),
}
#: Keys with which letters are commands of the menus.
_COMMANDS = (
    Qt.KeyboardModifier.ControlModifier
    | Qt.KeyboardModifier.AltModifier
    | Qt.KeyboardModifier.MetaModifier
)
#: Largest and smallest size of a cell, and room for numbers, for the colours of rows and around.
_LARGEST, _SMALLEST, _NUMBERS, _STRIP, _MARGIN = 34, 7, 24, 16, 6


class KnitChart(QWidget):
    """Show a repeat of a knit and report strokes of the mouse; the owner decides what they do."""

    #: The edited chart, at the end of a stroke, and the name of the edit.
    edited = Signal(object, str)
    #: Description of the stitch under the mouse.
    hovered = Signal(str)
    #: Stitches that cannot be knitted yet are to be discarded.
    cancelled = Signal()
    #: A colour picked with the right button.
    color_picked = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.shown: EditableKnit | None = None
        #: Letter to set, or empty to paint colours.
        self.letter = "p"
        #: Colour to paint with.
        self.color = QColor("#2d6a8e")
        self._before: EditableKnit | None = None
        self._on_strip = False
        self._last: tuple[int, int] | None = None
        self._under: tuple[int | None, int] | None = None
        self._sets = ""
        #: Stitch at which keys write.
        self.place = (0, 0)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    def show_knit(self, shown: EditableKnit | None) -> None:
        """Show a chart."""
        self.shown, self._before, self._under = shown, None, None
        if shown is not None:
            x, y = (min(at, size - 1) for at, size in zip(self.place, shown.size, strict=True))
            self.place = x, y
        self.update()

    @property
    def is_stroking(self) -> bool:
        """Whether a stroke is in progress."""
        return self._before is not None

    @property
    def cell(self) -> float:
        """Size of a cell, so that the whole chart is visible [pixels]."""
        assert self.shown is not None
        stitches, rows = self.shown.size
        wide = (self.width() - 2 * (_NUMBERS + _MARGIN) - _STRIP) / stitches
        high = (self.height() - _NUMBERS - 2 * _MARGIN) / rows
        return max(_SMALLEST, min(_LARGEST, wide, high))

    def rect_of(self, x: int | None, y: int) -> QRectF:
        """Return the rectangle of a stitch, or of the colour of a row if x is None."""
        assert self.shown is not None
        stitches, rows = self.shown.size
        cell = self.cell
        across = stitches * cell + _STRIP + _MARGIN
        left = max(_NUMBERS + _MARGIN, (self.width() - across) / 2)
        top = _MARGIN + (rows - 1 - y) * cell
        if x is None:
            return QRectF(left, top, _STRIP, cell)
        return QRectF(left + _STRIP + _MARGIN + x * cell, top, cell, cell)

    def place_at(self, at: QPointF) -> tuple[int | None, int] | None:
        """Return the stitch at a point, from 0; x is None on the strip of the rows' colours."""
        if self.shown is None:
            return None
        stitches, rows = self.shown.size
        cell, corner = self.cell, self.rect_of(0, rows - 1)
        x, up = (at.x() - corner.x()) / cell, (at.y() - corner.y()) / cell
        if not 0 <= up < rows:
            return None
        y = rows - 1 - int(up)
        if 0 <= x < stitches:
            return int(x), y
        return (None, y) if self.rect_of(None, y).contains(at) else None

    def describe(self, x: int | None, y: int) -> str:
        """Describe a stitch; stitches are counted from the right, as charts are read."""
        assert self.shown is not None
        if x is None:
            return f"row {y + 1}: paint the colour of the whole row"
        color = QColor(*self.shown.colors[y, x].tolist()).name()
        word = str(self.shown.stitches[y, self.shown.start_of(x, y)])
        name = STITCHES.get(word, f"cable of {stitches_made(word)}")
        return f"row {y + 1}, stitch {self.shown.size[0] - x}: {name}, {color}"

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Start a stroke, or pick a colour with the right button."""
        place = self.place_at(event.position())
        if place is None or self.shown is None:
            return
        x, y = place
        if event.button() == Qt.MouseButton.RightButton:
            self.color_picked.emit(QColor(*self.shown.colors[y, x or 0].tolist()))
        elif event.button() == Qt.MouseButton.LeftButton:
            self._before, self._on_strip, self._last = self.shown, x is None, (x or 0, y)
            self.place = x or 0, y
            # A stroke that starts on the chosen stitch sets knit stitches instead.
            word = "" if x is None else self.shown.stitches[y, self.shown.start_of(x, y)]
            same = word == self.letter
            self._sets = "k" if same else self.letter
            self._apply(x, y)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Continue a stroke, or describe the stitch under the mouse."""
        place = self.place_at(event.position())
        if self._before is None or self._last is None:
            self._hover(place)
            return
        is_cable = self.letter.startswith("c") and not self._on_strip
        if place is None or (place[0] is None) != self._on_strip or is_cable:
            return
        end = place[0] or 0, place[1]
        # Fill in the stitches that a fast mouse has skipped.
        steps = max(abs(end[0] - self._last[0]), abs(end[1] - self._last[1]))
        for step in range(1, steps + 1):
            x, y = (round(a + (b - a) * step / steps) for a, b in zip(self._last, end, strict=True))
            self._apply(None if self._on_strip else x, y)
        self._last = end

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """End a stroke."""
        if self._before is not None and event.button() == Qt.MouseButton.LeftButton:
            before, self._before = self._before, None
            paints = self._on_strip or not self.letter
            if self.shown is not before:
                self.edited.emit(self.shown, "colours of stitches" if paints else "stitches")

    def leaveEvent(self, _event: QEvent) -> None:
        """Remove the highlight."""
        self._hover(None)

    def event(self, event: QEvent) -> bool:
        """Reserve the keys of stitches, which the menus also use."""
        override = event.type() == QEvent.Type.ShortcutOverride
        if override and isinstance(event, QKeyEvent) and _is_own_key(event):
            event.accept()
        return bool(super().event(event))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move with the arrow keys, set stitches with letters, and the chosen one with space."""
        key, text = event.key(), event.text().lower()
        if self.shown is None or self.is_stroking or event.modifiers() & _COMMANDS:
            super().keyPressEvent(event)
        elif key == Qt.Key.Key_Escape:
            self.cancelled.emit()
        elif key in _STEPS:
            self._step(*_STEPS[key])
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._move_to(0, self.place[1] + 1)
        elif key == Qt.Key.Key_Backspace:
            self._step(-1, 0)
            self._write("k", advance=False)
        elif text == " ":
            self._write(self.letter)
        elif text in KEYS:
            self._write(KEYS[text])
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        """Show where keys write."""
        super().focusInEvent(event)
        self.update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """Hide where keys write."""
        super().focusOutEvent(event)
        self.update()

    def _step(self, across: int, up: int) -> None:
        """Move on by a stitch; from the end of a row, to the next row."""
        assert self.shown is not None
        stitches = self.shown.size[0]
        rows, x = divmod(self.place[0] + across, stitches)
        self._move_to(x, self.place[1] + up + rows)

    def _move_to(self, x: int, y: int) -> None:
        """Move the place at which keys write, from the last row to the first one."""
        assert self.shown is not None
        y %= self.shown.size[1]
        self.place = x, y
        self.hovered.emit(self.describe(x, y))
        self.update()

    def _write(self, word: str, advance: bool = True) -> None:
        """Set a stitch, or a colour if the word is empty, and move on behind it."""
        before, (x, y), chosen = self.shown, self.place, self.letter
        assert before is not None
        self.letter = self._sets = word
        self._apply(x, y)
        self.letter = chosen
        if advance:
            assert self.shown is not None
            start = self.shown.start_of(x, y)
            size = stitches_made(str(self.shown.stitches[y, start]))
            self._step(start + size - x, 0)
        if self.shown is not before:
            self.edited.emit(self.shown, "stitches" if word else "colours of stitches")

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint stitches, numbers, and the stitch under the mouse."""
        painter = painter_on(self)
        if self.shown is not None:
            self._paint(painter, self.shown, DraftColors.for_theme(is_dark(self)))
        painter.end()

    def sizeHint(self) -> QSize:
        """Return a size that is enough for a small chart."""
        return QSize(320, 320)

    def _paint(self, painter: QPainter, shown: EditableKnit, inks: DraftColors) -> None:
        stitches, rows = shown.size
        font = QFont(self.font())
        for y in range(rows):
            for x in range(stitches):
                rect, color = self.rect_of(x, y), QColor(*shown.colors[y, x].tolist())
                painter.setPen(QPen(inks.group, 1))
                painter.setBrush(color)
                painter.drawRect(rect)
                painter.setPen(_contrast(color))
                font.setPixelSize(max(6, round(0.62 * self.cell)))
                painter.setFont(font)
                word = str(shown.stitches[y, x])
                if not word.startswith("c"):
                    symbol = SYMBOLS.get(word, "")
                    painter.drawText(rect, Qt.AlignmentFlag.AlignCenter, symbol)
            for x in range(stitches):
                if (size := stitches_made(str(shown.stitches[y, x]))) > 1:
                    color = QColor(*shown.colors[y, x].tolist())
                    rect = self.rect_of(x, y).united(self.rect_of(x + size - 1, y))
                    _paint_cable(painter, rect, shown.stitches[y, x].endswith("f"), color)
            painter.setPen(QPen(inks.group, 1))
            uniform = (shown.colors[y] == shown.colors[y, :1]).all()
            painter.setBrush(QColor(*shown.colors[y, 0].tolist()) if uniform else inks.back)
            painter.drawRect(self.rect_of(None, y))
        font.setPixelSize(11)
        painter.setFont(font)
        painter.setPen(inks.text)
        step = max(1, round(14 / self.cell))
        for y in range(0, rows, step):
            # A row of lace that makes more or fewer stitches than it uses is not knittable yet.
            painter.setPen(inks.text if shown.surplus(y) == 0 else QColor("#d03030"))
            rect = self.rect_of(stitches - 1, y).translated(self.cell + 4, 0)
            rect.setWidth(_NUMBERS)
            centre = Qt.AlignmentFlag.AlignVCenter
            painter.drawText(rect, Qt.AlignmentFlag.AlignLeft | centre, str(y + 1))
        painter.setPen(inks.text)
        for count in range(0, stitches, max(1, round(20 / self.cell))):
            rect = self.rect_of(stitches - 1 - count, 0).translated(0, self.cell)
            rect.setHeight(_NUMBERS)
            painter.drawText(rect, Qt.AlignmentFlag.AlignCenter, str(count + 1))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        if self._under is not None:
            painter.setPen(QPen(inks.highlight, 2))
            painter.drawRect(self.rect_of(*self._under))
        if self.hasFocus():
            painter.setPen(QPen(inks.highlight, 3))
            painter.drawRect(self.rect_of(*self.place).adjusted(1, 1, -1, -1))

    def _apply(self, x: int | None, y: int) -> None:
        """Change a stitch, or the colour of a stitch or a row."""
        shown = self.shown
        assert shown is not None
        if x is None or not self.letter:
            color = self.color.red(), self.color.green(), self.color.blue()
            old = shown.colors[y] if x is None else shown.colors[y, x]
            changes = (old != color).any()
            self.shown = shown.with_color(x, y, color) if changes else shown
        elif shown.stitches[y, shown.start_of(x, y)] != self._sets:
            try:
                self.shown = shown.with_stitch(x, y, self._sets)
            except InputError as error:
                self.hovered.emit(error.message)
        self.update()

    def _hover(self, place: tuple[int | None, int] | None) -> None:
        if place != self._under:
            self._under = place
            self.hovered.emit("" if place is None else self.describe(*place))
            self.update()


def _is_own_key(event: QKeyEvent) -> bool:
    """Return whether the chart uses a key, so that menus may not."""
    is_own = event.text().lower() in (*KEYS, " ") or event.key() in _STEPS
    return is_own and not event.modifiers() & _COMMANDS


def _paint_cable(painter: QPainter, rect: QRectF, is_left: bool, color: QColor) -> None:
    """Paint the two strands of a cable: the one in front whole, the other one behind it."""
    inside = rect.adjusted(2, 2, -2, -2)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(color)
    painter.drawRect(rect.adjusted(1, 1, -1, -1))
    lines = (inside.bottomLeft(), inside.topRight()), (inside.bottomRight(), inside.topLeft())
    for back, (begin, end) in zip((True, False), lines if is_left else lines[::-1], strict=True):
        if not back:
            painter.setPen(QPen(color, 7))
            painter.drawLine(begin + 0.3 * (end - begin), begin + 0.7 * (end - begin))
        painter.setPen(QPen(_contrast(color), 2))
        painter.drawLine(begin, end)


def _contrast(color: QColor) -> QColor:
    """Return black or white, whichever is legible on a colour."""
    return QColor("#1f2730" if color.lightness() > 128 else "#ffffff")
