"""Open the window, click into view and draft, save what the screen shows, and count pixels.

Run by a test.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from typing import Any

import numpy as np
from PySide6.QtCore import QPoint, QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from window import settled, wait_until

from spacemap_vtk.app.draft.draft_layout import GridCell
from spacemap_vtk.app.main_window import MainWindow


def pixels_of(window: MainWindow) -> dict[str, int]:
    """Count the pixels of dots, lines and letters."""
    view, shown = window.view, window.view.scene_view
    window.document.set("view", "color", "displacement")
    wait_until(lambda: settled(window))
    for x in range(-60, 61, 12):
        view.click(view.canvas.rect().center().toPointF() + QPoint(x, 0).toPointF())
        if view.picks:
            break
    shown.surface.VisibilityOff()
    props: dict[str, Any] = {
        "supports": shown.supports,
        "cage": shown.cage,
        "pick": view.marks,
        "letters": shown.surface.color_bar,
    }
    counts = {}
    for name in props:
        images = []
        for on in (True, False):
            for other, prop in props.items():
                prop.SetVisibility(on and other == name)
            images.append(view.image().astype(int))
        # The coloured part of the scale has a fixed size; count only its letters.
        change = np.abs(images[0] - images[1])
        grey = np.ptp(images[0], axis=2) < 24 if name == "letters" else True
        counts[name] = int(((change.max(axis=2) > 40) & grey).sum())
    return counts


def main(picture: str) -> None:
    os.environ["SPACEMAP_CACHE"] = "off"
    QSettings.setDefaultFormat(QSettings.Format.IniFormat)
    folder = tempfile.mkdtemp()
    QSettings.setPath(QSettings.Format.IniFormat, QSettings.Scope.UserScope, folder)
    app = QApplication([])
    app.setApplicationName("spacemap")
    window = MainWindow()
    room = app.primaryScreen().availableSize()
    fits = window.width() <= room.width() and window.height() <= room.height()
    window.resize(1150, 640)
    window.start("plain_weave")
    window.document.set("surface", "subdivisions", 2)
    window.show()
    window.tabs.setCurrentWidget(window.draft)
    window.splitter.setSizes([260, 500, 390])
    window.tools.cameras["front"].trigger()
    wait_until(lambda: settled(window))
    window.move(0, 0)
    grid, view = window.draft.grid, window.view.canvas
    at = QPoint(*grid.current_layout().center(GridCell("threading", 3, 2)))
    QTest.mouseClick(grid.viewport(), Qt.MouseButton.LeftButton, pos=at)
    wait_until(lambda: settled(window))
    picked = []
    for x in range(-20, 24, 4):
        found = window.view.pick(view.width() / 2 + x, view.height() / 2)
        picked.append(None if found is None else (found.yarn, found.rest))
    result = {
        "fits": fits,
        "ratio": window.devicePixelRatioF(),
        "view": [view.width(), view.height()],
        "drawn": list(view.render_window.GetSize()),
        "threading": grid.shown.loom.threading,
        "picked": picked,
    }
    app.processEvents()
    app.primaryScreen().grabWindow(window.winId()).save(picture)
    result["pixels"] = pixels_of(window)
    window.discard()
    app.processEvents()
    print(json.dumps(result))


if __name__ == "__main__":
    main(sys.argv[1])
