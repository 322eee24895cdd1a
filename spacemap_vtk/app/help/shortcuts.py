"""The page of all keys and mouse actions, grouped by topic."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFrame, QLabel, QScrollArea, QWidget

from spacemap_vtk.app.help.menu_tree import MenuEntry
from spacemap_vtk.app.widgets import column, row

#: Mouse actions in the view: those of VTK and those of this program.
MOUSE = (
    ("Drag", "Rotate"),
    ("Shift+drag", "Pan (or middle button)"),
    ("Ctrl+drag", "Roll"),
    ("Wheel", "Zoom (or drag with the right button)"),
    ("Click", "Pick a point of a yarn and plot it"),
    ("Shift+click", "Pick another point"),
    ("Click an axis", "Look along it"),
)
#: Titles of menus whose names alone do not say that they concern the view.
_TITLES = {"View": "Show", "Zoom": "Camera"}
#: Keys that few keyboards have; Qt adds them to Cut, Copy and Paste.
_RARE = re.compile(r"F1[3-9]|F[23]\d|Cut|Copy|Paste|(Ctrl|Shift)\+.*(Ins|Del)")
_COLUMNS = 3

Groups = dict[str, list[tuple[str, str]]]


def key_groups(entries: Iterable[MenuEntry]) -> Groups:
    """Return keys and names of all actions with a shortcut, by topic, and the mouse actions."""
    groups: Groups = {}
    for path, action in entries:
        if not action.shortcuts():
            continue
        topic = _TITLES.get(path[-1], path[-1])
        key, *more = (key.toString() for key in action.shortcuts())
        more = [other for other in more if not _RARE.fullmatch(other)]
        also = f" (or {', '.join(more)})" if more else ""
        # The text of "Undo" contains what would be undone.
        name = (action.objectName() or action.text()).replace("&", "").rstrip("…")
        groups.setdefault(topic, []).append((key, name + also))
    return {**groups, "Mouse in the view": list(MOUSE)}


def show_keys(parent: QWidget, groups: Groups) -> None:
    """Show the keys in a dialog that fits on a small screen."""
    dialog = QDialog(parent)
    dialog.setWindowTitle("Keyboard and mouse")
    lines = sum(len(lines) + 2 for lines in groups.values())
    pages, filled = [""], 0
    for topic, keys in groups.items():
        if filled > lines * len(pages) / _COLUMNS - len(keys) / 2 and len(pages) < _COLUMNS:
            pages.append("")
        pages[-1] += _as_html(topic, keys)
        filled += len(keys) + 2
    labels = [QLabel(page, textFormat=Qt.TextFormat.RichText) for page in pages]
    for label in labels:
        label.setAlignment(Qt.AlignmentFlag.AlignTop)
    body = QWidget()
    row(body, *labels, margins=(12, 8, 12, 8), spacing=32)
    area = QScrollArea(widgetResizable=True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setWidget(body)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    buttons.rejected.connect(dialog.reject)
    column(dialog, (area, 1), buttons, margins=(0, 0, 8, 8))
    room = dialog.screen().availableSize()
    size = body.sizeHint()
    dialog.resize(min(size.width() + 30, room.width()), min(size.height() + 60, room.height() - 60))
    dialog.exec()


def _as_html(topic: str, keys: list[tuple[str, str]]) -> str:
    rows = "".join(
        f"<tr><td style='padding-right: 16px'><code>{html.escape(key)}</code></td>"
        f"<td>{html.escape(name)}</td></tr>"
        for key, name in keys
    )
    return f"<h4>{html.escape(topic)}</h4><table>{rows}</table>"
