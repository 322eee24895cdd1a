"""What a person sees in the window, and finds by its name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from PySide6.QtCore import QEvent, QModelIndex, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QTextDocumentFragment
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QGroupBox,
    QLabel,
    QLineEdit,
    QMenu,
    QMenuBar,
    QPlainTextEdit,
    QScrollArea,
    QSlider,
    QTabBar,
    QTableView,
    QTextEdit,
    QToolButton,
    QTreeView,
    QWidget,
)


class NotSeen(AssertionError):
    """What the text tells is not (yet) in the window."""


def front() -> QWidget:
    """Return what takes the mouse: a menu, a dialog, or the window."""
    app = QApplication.instance()
    widget = app.activePopupWidget() or app.activeModalWidget() or app.activeWindow()
    return widget or next(w for w in app.topLevelWidgets() if w.isVisible())


def everything() -> Iterator[QWidget]:
    """All that can be seen, from the front to the back."""
    first = front()
    tops = [first, *(w for w in QApplication.topLevelWidgets() if w is not first)]
    for top in tops:
        if top.isVisible():
            yield top
            yield from (w for w in top.findChildren(QWidget) if w.isVisible())


def plain(text: str) -> str:
    """A text as it is read: without marks for keys, tags and ends of lines."""
    if "<" in text and ">" in text:
        text = QTextDocumentFragment.fromHtml(text).toPlainText()
    text = re.sub(r"&(?=\w)", "", text)
    return " ".join(text.split())


def texts_of(widget: QWidget) -> Iterator[str]:
    """What a widget says."""
    if widget.isWindow():
        yield widget.windowTitle().replace("[*]", "*" if widget.isWindowModified() else "")
    if isinstance(widget, QLineEdit):
        yield widget.text() or widget.placeholderText()
    elif isinstance(widget, QComboBox):
        yield widget.currentText()
    elif isinstance(widget, (QLabel, QAbstractButton, QAbstractSpinBox)):
        yield widget.text()
    elif isinstance(widget, (QTextEdit, QPlainTextEdit)):
        yield widget.toPlainText()
    elif isinstance(widget, QGroupBox):
        yield widget.title()
    elif isinstance(widget, QTabBar):
        yield from (widget.tabText(n) for n in range(widget.count()))
    elif isinstance(widget, (QMenu, QMenuBar)):
        yield from (action.text() for action in widget.actions())
    elif isinstance(widget, QAbstractItemView):
        yield from (str(index.data() or "") for index in cells(widget))
        for column in range(columns(widget)):
            yield str(widget.model().headerData(column, Qt.Orientation.Horizontal) or "")
    yield from getattr(widget, "texts_seen", list)()


def columns(view: QAbstractItemView) -> int:
    # A list's model keeps it for itself.
    many = isinstance(view, (QTableView, QTreeView)) and view.model() is not None
    return view.model().columnCount() if many else 1


def cells(view: QAbstractItemView) -> Iterator[QModelIndex]:
    model, root = view.model(), view.rootIndex()
    for row in range(0 if model is None else model.rowCount(root)):
        for column in range(columns(view)):
            yield model.index(row, column, root)


def see(words: str, there: bool) -> None:
    """Make sure that something stands in the window, or does not."""
    bar = [w.statusBar().currentMessage() for w in everything() if hasattr(w, "statusBar")]
    told = [plain(text) for widget in everything() for text in texts_of(widget)] + bar
    if any(words in text for text in told) != there:
        near = sorted({t for t in told if set(words.split()) & set(t.split())}, key=len)
        raise NotSeen("it is not seen" + "".join(f"\n  but “{t}”" for t in near[:8]) * there)


#: A widget, and where in it; what else there is to know.
Spot = tuple[QWidget, QPoint]


def named(words: str, kind: str | None) -> list[Spot]:
    """All that can be clicked of that name."""
    spots: list[Spot] = []
    for widget in everything():
        if widget.window() is not front().window() and not isinstance(front(), QMenu):
            continue
        if isinstance(widget, QTabBar) and kind in (None, "tab"):
            for n in range(widget.count()):
                if widget.tabText(n) == words:
                    spots.append((widget, widget.tabRect(n).center()))
        elif isinstance(widget, QAbstractItemView):
            if kind in ("scene", "stage", "mode", "row", "file") or kind is None:
                spots += listed(widget, words, kind)
        elif kind in (None, "button", "box") and isinstance(widget, QAbstractButton):
            if plain(widget.text()) == words:
                at = widget.rect().center()
                if isinstance(widget, QToolButton) is False and kind == "box":
                    at = QPoint(10, widget.rect().center().y())
                spots.append((widget, at))
        elif kind is None and isinstance(widget, QLabel) and widget.openExternalLinks() is False:
            spots += link(widget, words)
    return spots


def listed(view: QAbstractItemView, words: str, kind: str | None) -> list[Spot]:
    names = {"scene": "gallery", "stage": "stages", "mode": "modes"}
    if kind in names and view.objectName() != names[kind]:
        return []
    spots = []
    for index in cells(view):
        if plain(str(index.data() or "")) == words and (kind != "mode" or index.column() == 0):
            view.scrollTo(index)
            spots.append((view.viewport(), view.visualRect(index).center()))
    return spots[:1] if kind else spots


def move(widget: QWidget, at: QPoint, held: Qt.MouseButton = Qt.MouseButton.NoButton) -> None:
    """Move the mouse, at once.

    QTest's goes by way of the screen: it lets timers run, and the move itself comes later.
    """
    where, none = (QPointF(at), QPointF(widget.mapToGlobal(at))), Qt.MouseButton.NoButton
    event = QMouseEvent(QEvent.Type.MouseMove, *where, none, held, Qt.KeyboardModifier.NoModifier)
    QApplication.sendEvent(widget, event)


def link(label: QLabel, words: str) -> list[Spot]:
    """Where the words of a link stand: found as the mouse would, by the cursor that it gets."""
    if f">{words}</a>" not in label.text():
        return []
    for y in range(4, label.height(), 4):
        for x in range(2, label.width(), 4):
            move(label, QPoint(x, y))
            if label.cursor().shape() == Qt.CursorShape.PointingHandCursor:
                return [(label, QPoint(x + 3, y))]
    return []


def the(words: str, kind: str | None, beside: str | None = None) -> Spot:
    """The one thing of that name, of several that in a line with a label."""
    spots = named(words, kind)
    if beside is not None:
        labels = [w for w in everything() if isinstance(w, QLabel) and plain(w.text()) == beside]
        heights = {label.mapToGlobal(label.rect().center()).y() for label in labels}
        spots = [
            (w, at) for w, at in spots if any(abs(w.mapToGlobal(at).y() - y) < 8 for y in heights)
        ]
    if not spots:
        raise NotSeen("there is nothing of that name")
    if len({id(widget) for widget, _ in spots}) > 1:
        raise LookupError(f"{len(spots)} things have that name: {[w for w, _ in spots]}")
    return in_sight(*spots[0])


def in_sight(widget: QWidget, at: QPoint) -> Spot:
    """Scroll to a widget as a person would, with the wheel."""
    above = widget.parentWidget()
    while above is not None:
        if isinstance(above, QScrollArea):
            above.ensureWidgetVisible(widget)
        above = above.parentWidget()
    if not widget.isEnabled():
        raise NotSeen("it is grey")
    if not widget.visibleRegion().contains(at):
        raise NotSeen("it is covered or cut off")
    return widget, at


_INPUTS = (QLineEdit, QComboBox, QAbstractSpinBox, QSlider, QPlainTextEdit)


def field(words: str, of: str | None, kinds: tuple[type, ...] = _INPUTS[:3]) -> Any:
    """The field beside a label; `of`: what stands over several such labels."""
    found: list[QWidget] = []
    labels = [w for w in everything() if isinstance(w, QLabel) and plain(w.text()) == words]
    if of is not None:
        labels = below(of, labels)
    for label in labels:
        beside = label.buddy()
        found += right_of(label, kinds) if beside is None else first(beside, kinds)
    if not found and of is None:
        for widget in everything():
            if isinstance(widget, kinds):
                names = [getattr(widget, "placeholderText", str)(), widget.toolTip()]
                names += [widget.currentText()] if isinstance(widget, QComboBox) else []
                if any(plain(name).startswith(words) for name in names if name):
                    found.append(widget)
    found = list(dict.fromkeys(found))
    if not found:
        raise NotSeen("there is no field of that name")
    if len(found) > 1:
        raise LookupError(f"{len(found)} fields have that name")
    in_sight(found[0], found[0].rect().center())
    return found[0]


def right_of(label: QLabel, kinds: tuple[type, ...]) -> list[QWidget]:
    """The field that stands in a line with a label."""
    at, owner = label.mapToGlobal(label.rect().center()), label.parentWidget()
    found = [w for w in owner.findChildren(QWidget) if isinstance(w, kinds) and w.isVisible()]
    places = [(w.mapFromGlobal(at), w) for w in found]
    beside = [(-p.x(), w) for p, w in places if 0 <= p.y() < w.height() and p.x() < 0]
    return [min(beside, key=lambda pair: pair[0])[1]] if beside else []


def below(title: str, labels: list[QLabel]) -> list[QLabel]:
    """Of some labels those that stand nearest to a title."""
    near: list[tuple[int, list[QLabel]]] = []
    for head in everything():
        if isinstance(head, (QLabel, QAbstractButton)) and plain(head.text()) == title:
            scope = head.parentWidget()
            while scope is not None and not any(scope.isAncestorOf(label) for label in labels):
                scope = scope.parentWidget()
            if scope is not None:
                inside = [label for label in labels if scope.isAncestorOf(label)]
                near.append((scope.width() * scope.height(), inside))
    return min(near, key=lambda pair: pair[0])[1] if near else []


def first(widget: QWidget, kinds: tuple[type, ...]) -> list[QWidget]:
    """A field, or the first one in a widget that holds it."""
    if isinstance(widget, kinds):
        return [widget]
    return [w for w in widget.findChildren(QWidget) if isinstance(w, kinds) and w.isVisible()][:1]
