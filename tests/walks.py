"""Plays a written walk on the real window, word by word: mouse, keys, and what is then seen."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from PySide6.QtCore import QEventLoop, QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QKeySequence, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QLineEdit,
    QMenu,
    QMenuBar,
    QWidget,
)
from seen import NotSeen, Spot, field, front, move, plain, see, the
from shiboken6 import isValid
from window import settled

from spacemap_vtk.app.draft.layout import Place
from spacemap_vtk.app.job import Swing
from spacemap_vtk.units import parse_quantity

LEFT = Qt.MouseButton.LeftButton
#: Seconds that something may take to be seen, or to be there for the mouse.
PATIENCE = 120.0
#: How often in a row it is looked whether the window rests before a picture is kept.
_STILL = 25
#: How the sentences of a walk begin that are done; a name stands in ** **, what is typed in ` `.
_BOLD, _CODE = r"\*\*(.+?)\*\*", r"`([^`]+)`"
_KIND = r"(?:the (tab|stage|scene|mode|row|file|box|button|colour) )?"
#: So many times.
_TIMES = {"twice": 2, "three times": 3, "five times": 5, "ten times": 10, "twenty times": 20}
_OFTEN = f"(?: ({'|'.join(_TIMES)}))?"


class Walk:
    """A text, the window that it is about, and the place for pictures of its steps."""

    def __init__(self, file: Path, window: Any, pictures: Path, look: str, each: bool) -> None:
        self.name, self.window, self.look = file.stem, window, look
        self._pictures, self._each = pictures, each
        self._deeds = list(self._read(file.read_text("utf-8")))
        self._at, self._begun, self._quiet, self._pause = 0, 0.0, 0, 0
        self._error: BaseException | None = None
        self._loop = QEventLoop()
        #: Whether the mouse is in the midst of something: nothing else is done meanwhile.
        self.held = False

    def play(self) -> None:
        """Do what the text says, from its first step to its last."""
        self._begun = time.monotonic()
        QTimer.singleShot(0, self._tick)
        self._loop.exec()
        if self._error is not None:
            raise self._error

    def _tick(self) -> None:
        if self._error is not None or self._at == len(self._deeds):
            self._put_away()
            self._loop.quit()
            return
        # A dialog keeps who has opened it until it is closed: of one timer no second tick comes.
        QTimer.singleShot(self._pause, self._tick)
        # To look again and again takes from the window the time that it needs.
        self._pause = 40
        if self.held:
            return
        words, waits, find, act = self._deeds[self._at]
        try:
            if waits and not self._rests():
                self._quiet, self._pause = 0, 10  # that is quickly asked
                raise NotSeen("the window is not at rest")
            self._quiet += 1
            found = find()
        except NotSeen as error:
            if time.monotonic() > self._begun + PATIENCE:
                self._fail(words, error)
            return
        except Exception as error:
            self._fail(words, error)
            return
        self._at += 1
        self._begun, self._quiet, self._pause = time.monotonic(), 0, 20
        try:
            act(found)
        except Exception as error:
            self._fail(words, error)

    def _fail(self, words: str, error: BaseException) -> None:
        told = AssertionError(f"{self.name}, “{' '.join(words.split())}”: {error}")
        told.__cause__ = error
        self._error = told
        self._shoot(f"{self.name}-failed.png")

    def _put_away(self) -> None:
        """Close dialogs, which would never end."""
        for widget in QApplication.topLevelWidgets():
            if widget is not self.window and widget.isVisible():
                widget.close()

    def _rests(self) -> bool:
        """Whether nothing goes on of which a person would wait for the end."""
        window = self.window
        if not isValid(window):
            return True
        playing = window.times.playing or isinstance(window.director.swing, Swing)
        before = front()
        active = isinstance(before, QMenu) or QApplication.activeWindow() is before.window()
        if not active:
            before.activateWindow()
        # What was cancelled may be left coarse: nobody waits for a smooth picture then.
        given_up = window.errors.run.isVisible() and not window.engine.busy
        return active and (before is not window or playing or given_up or settled(window))

    # -- reading ------------------------------------------------------------------------------

    def _read(self, text: str) -> Iterator[tuple[str, bool, Callable[[], Any], Callable[..., Any]]]:
        steps = re.split(r"^\d+\. ", text, flags=re.M)[1:]
        for number, step in enumerate(steps, 1):
            step = re.split(r"^#", step, flags=re.M)[0]
            pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", step)
            step = re.sub(r"!\[[^\]]*\]\([^)]+\)", "", step)
            step = re.sub(r"<!--.*?-->", "", step, flags=re.S)
            yield from self._deeds_of(" ".join(step.split()))
            # Else nobody would look at them.
            names = [f"{self.name}-{number:02}.png"] if self._each else []
            for name in names + (pictures if names and self.look == "light-1" else []):
                yield (name, True, self._painted, lambda _, n=name: self._shoot(n))

    def _painted(self) -> None:
        # Not seconds: a process that others have held up has drawn nothing in them.
        if self._quiet < _STILL or (isValid(self.window) and self.window.engine.beside is not None):
            raise NotSeen("tabs and fields follow, and what is drawn takes a while to be seen")

    def _deeds_of(self, step: str) -> Iterator[Any]:
        end = 0
        for match in re.finditer("|".join(f"(?P<{n}>{p})" for n, (p, _) in _GRAMMAR.items()), step):
            self._reject(step[end : match.start()])
            end = match.end()
            pattern, make = _GRAMMAR[match.lastgroup or ""]
            given = re.fullmatch(pattern, match[0])
            assert given is not None
            hasty = step[: match.start()].endswith("At once ")
            for find, act in make(self, *given.groups()):
                yield match[0], not hasty, find, act
        self._reject(step[end:])

    @staticmethod
    def _reject(words: str) -> None:
        assert not re.search(r"[*`]", words), f"nobody would know what to do: “{words.strip()}”"

    def _shoot(self, name: str) -> None:
        """Keep what the screen shows, with menus and dialogs."""
        if not isValid(self.window):
            return
        self._pictures.mkdir(parents=True, exist_ok=True)
        at = self.window.frameGeometry()
        screen = self.window.screen()
        screen.grabWindow(0, at.x(), at.y(), at.width(), at.height()).save(
            str(self._pictures / name), quality=70
        )


# -- doing ------------------------------------------------------------------------------------

Deeds = Iterator[tuple[Callable[[], Any], Callable[[Any], Any]]]


def _click(
    walk: Walk, how: str, kind: str | None, words: str, beside: str | None, often: str | None
) -> Deeds:
    def act(spot: Spot) -> None:
        for _ in range(_TIMES.get(often or "", 1)):
            QTest.mouseClick(spot[0], LEFT, pos=spot[1])
            if how == "Double-click":
                QTest.mouseDClick(spot[0], LEFT, pos=spot[1])

    yield lambda: the(words, kind, beside), act


def _menu(walk: Walk, path: str) -> Deeds:
    names = [name.strip() for name in path.split(">")]

    def find(name: str) -> Spot:
        holder: Any = front() if isinstance(front(), QMenu) else None
        for menu in [holder] if holder else front().findChildren(QMenuBar):
            for action in menu.actions():
                if plain(action.text()) == name and action.isVisible():
                    if not action.isEnabled():
                        raise NotSeen("it is grey in the menu")
                    return menu, menu.actionGeometry(action).center()
        raise NotSeen(f"no menu has “{name}”")

    for name in names:
        yield (lambda n=name: find(n)), (lambda spot: QTest.mouseClick(spot[0], LEFT, pos=spot[1]))


def _type(walk: Walk, text: str, words: str, of: str | None, only: str | None) -> Deeds:
    def act(editor: QWidget) -> None:
        line = editor if isinstance(editor, QLineEdit) else editor.findChild(QLineEdit) or editor
        QTest.mouseClick(line, LEFT)
        QTest.keySequence(line, QKeySequence("Ctrl+A"))
        QTest.keyClicks(line, text)
        offered = QApplication.instance().activePopupWidget()
        if offered is not None:  # to go on from what is typed; Enter would take one of that
            QTest.keyClick(offered, Qt.Key.Key_Escape)
        if only is None:
            QTest.keyClick(line, Qt.Key.Key_Return)

    yield lambda: field(words, of), act


def _press(walk: Walk, keys: str, often: str | None) -> Deeds:
    def act(_: None) -> None:
        app = QApplication.instance()
        for _ in range(_TIMES.get(often or "", 1)):
            target = app.activePopupWidget() or app.focusWidget() or front()
            QTest.keySequence(target, QKeySequence(keys))

    yield lambda: None, act


def _choose(walk: Walk, item: str, words: str, of: str | None) -> Deeds:
    def act(box: QComboBox) -> None:
        QTest.mouseClick(box, LEFT)
        view, place = box.view(), box.findText(item)
        if place < 0:
            raise LookupError(f"it offers {[box.itemText(n) for n in range(box.count())]}")
        low, high = sorted((place, box.currentIndex()))
        # The keys pass by what is only a line between.
        steps = sum(bool(box.itemText(n)) for n in range(low, high))
        for _ in range(steps):
            QTest.keyClick(view, Qt.Key.Key_Down if low != place else Qt.Key.Key_Up)
        QTest.keyClick(view, Qt.Key.Key_Return)

    yield lambda: field(words, of, (QComboBox,)), act


def _drag(walk: Walk, widget: QWidget, here: QPoint, there: QPoint) -> None:
    walk.held = True
    QTest.mousePress(widget, LEFT, pos=here)
    for step in range(1, 5):  # each draws a picture
        move(widget, here + (there - here) * step / 4, LEFT)
        QTest.qWait(10)
    QTest.mouseRelease(widget, LEFT, pos=there)
    walk.held = False


def _hand(walk: Walk, how: str) -> Deeds:
    """The mouse in the view."""

    def act(_: None) -> None:
        view = walk.window.view.plotter
        at = view.rect().center()
        if how == "Click the middle of the view":
            QTest.mouseClick(view, LEFT, pos=at)
        elif how == "Drag across the view":
            _drag(walk, view, at, at + QPoint(96, -32))
        else:
            turn = QPoint(0, 120 if "up" in how else -120)
            wheel = QWheelEvent(
                QPointF(at), QPointF(view.mapToGlobal(at)), QPoint(), turn,
                Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier,
                Qt.ScrollPhase.NoScrollPhase, False,
            )  # fmt: skip
            QApplication.sendEvent(view, wheel)

    yield lambda: None, act


def _mark(walk: Walk, how: str, panel: str, across: str, up: str) -> Deeds:
    """A square of the draft."""

    def act(_: None) -> None:
        grid = walk.window.draft.grid
        at = QPoint(*grid.layout_now().center(Place(panel, int(across), int(up))))
        QTest.mouseClick(grid.viewport(), LEFT, pos=at)

    yield lambda: None, act


def _dye(walk: Walk, number: str) -> Deeds:
    """One of the colours below the draft."""

    def act(_: None) -> None:
        colors = walk.window.draft.palette_row
        QTest.mouseClick(colors, LEFT, pos=colors.rect_of(int(number) - 1).center())

    yield lambda: None, act


def _pull(walk: Walk, warp: str, weft: str) -> Deeds:
    def find() -> None:
        if walk.window.pull.map.map is None:
            raise NotSeen("there is no map")

    def act(_: None) -> None:
        pad = walk.window.pull.map
        here = pad.place(*pad.at).toPoint()
        there = pad.place(1 + float(warp) / 100, 1 + float(weft) / 100).toPoint()
        _drag(walk, pad, here, there)

    yield find, act


def _resize(walk: Walk, width: str, height: str) -> Deeds:
    yield lambda: None, lambda _: walk.window.resize(int(width), int(height))


def _close(walk: Walk) -> Deeds:
    yield lambda: None, lambda _: walk.window.close()


def _seen(walk: Walk, no: str | None, words: str) -> Deeds:
    yield lambda: see(words, there=no is None), lambda _: None


def _past(walk: Walk, time: str) -> Deeds:
    def find() -> None:
        if walk.window.times.time <= parse_quantity(time, "s"):
            raise NotSeen("the time does not get there")

    yield find, lambda _: None


def _file(walk: Walk, name: str) -> Deeds:
    def find() -> None:
        if not Path(name).is_file() or not Path(name).stat().st_size:
            raise NotSeen("there is no such file")

    yield find, lambda _: None


_OF = rf"(?: of {_BOLD})?"
#: What a walk may say: how it is written, and what is then done.
_GRAMMAR: dict[str, tuple[str, Callable[..., Deeds]]] = {
    "menu": (rf"[Cc]hoose {_BOLD} in the menu", _menu),
    "click": (
        rf"([Cc]lick|Double-click) (?:on )?{_KIND}{_BOLD}(?: beside {_BOLD})?{_OFTEN}",
        _click,
    ),
    "type": (rf"(?:[Tt]ype |and |, ){_CODE} into {_BOLD}{_OF}( without Enter)?", _type),
    "press": (rf"[Pp]ress {_CODE}{_OFTEN}", _press),
    "choose": (rf"[Cc]hoose {_BOLD} (?:in|under) {_BOLD}{_OF}", _choose),
    "hand": (
        r"(Click the middle of the view|Drag across the view|Turn the wheel (?:up|down) over it)",
        _hand,
    ),
    "mark": (
        r"([Cc]lick) (?:in the )?(threading|treadling|tieup|drawdown|warp|weft) at (\d+), (\d+)",
        _mark,
    ),
    "dye": (r"[Cc]lick the colour (\d+)", _dye),
    "pull": (r"[Pp]ull the point to ([-+][\d.]+) %, ([-+][\d.]+) %", _pull),
    "resize": (r"[Mm]ake the window (\d+) × (\d+) pixels", _resize),
    "close": (r"[Cc]lose the window", _close),
    "file": (rf"[Tt]he file {_CODE} is there", _file),
    "past": (rf"until past {_CODE}", _past),
    "start": (rf"Start {_CODE}", lambda walk, words: iter(())),
    "seen": (r"([Nn]o )?(?<!\*)\*([^*]+\*?)\*(?!\*)", _seen),
}
