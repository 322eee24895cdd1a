"""Make the pictures of the window, docs/gui.png among them.

xvfb-run -a -s "-screen 0 1600x1000x24" python docs/gui.py docs
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ["SPACEMAP_CACHE"] = "off"

from PySide6.QtCore import QCoreApplication, QEvent, QPoint, QSettings
from PySide6.QtWidgets import QApplication

from spacemap_vtk.app.draft.draft_layout import GridCell
from spacemap_vtk.app.launch import MainWindow
from spacemap_vtk.scenes.draft_edits import Selection
from spacemap_vtk.textile.drafts.loom import Loom

#: A diamond twill: pointed threading, and a treadling that follows it.
POINT = tuple((8 - abs(k - 7),) for k in range(15))
DIAMOND = Loom(
    POINT,
    tuple(tuple(sorted((k + step) % 8 + 1 for step in (0, 1, 2, 4))) for k in range(8)),
    POINT,
)


def weave_diamond(window: MainWindow) -> None:
    """Weave a diamond twill with two stripes, in the paper's cage."""
    stripes = ["#2d6a8e"] * 3 + ["#b5443c"] + ["#2d6a8e"] * 7 + ["#b5443c"] + ["#2d6a8e"] * 3
    values = {"ends": 15, "picks": 15, "warp_color": stripes, "weft_color": "#ead7b0"}
    window.document.set_many("weave", values)
    # The paper's load would turn this larger cloth further than a linear motion can show.
    window.document.set("response", "gravity", [0.0, -2.0, 2.0])
    window.draft._set_loom(DIAMOND, "loom")
    window.splitter.setSizes([270, 640, 530])
    window.menus.actions["Go to end"].trigger()
    wait(lambda: window.view.frame.time == window.times.time)
    window.view.reset_camera()
    window.times.go_to(0.02)


def select_in_draft(window: MainWindow) -> None:
    """Select a block of the threading and open its menu; mark floats and show counts."""
    window.splitter.setSizes([270, 430, 740])
    draft = window.draft
    draft.float_box.setChecked(True)
    draft.counts_button.setChecked(True)
    draft.grid.select(Selection("threading", (9, 16), (1, 4)))
    QApplication.processEvents()
    # Beside the draft, which it would hide.
    x, y = draft.grid.current_layout().center(GridCell("weft", 0, draft.grid.shown.size[1]))
    draft.grid.menu_requested.emit(draft.grid.viewport().mapToGlobal(QPoint(x + 10, y - 90)))
    wait(draft.commands.menu.isVisible)


def wait_for_plots(window: MainWindow) -> None:
    """Wait for the plots."""
    wait(lambda: window.plots.curves is not None)


def wait(done: Callable[[], bool], seconds: float = 60.0) -> None:
    """Process events until a condition holds."""
    end = time.monotonic() + seconds
    while not done() and time.monotonic() < end:
        QApplication.processEvents()
        time.sleep(0.01)


def save_picture(
    file: Path,
    tab: str,
    dark: bool,
    prepare: Callable[[MainWindow], None],
    scene: str = "plain_weave",
    only_tab: bool = False,
) -> None:
    """Save a screenshot of a window with a scene, or of its tab."""
    window = MainWindow()
    window.resize(1440, 900)
    if window.menus.dark.isChecked() != dark:
        window.menus.dark.trigger()
    window.start(scene)
    window.show()
    window.tabs.setCurrentWidget(getattr(window, tab))
    wait(lambda: window.view.frame is not None)
    prepare(window)
    # The window draws the last state again, with smooth edges.
    end = time.monotonic() + 2.0
    wait(lambda: time.monotonic() > end and not window.engine.busy)
    part = window.tabs if only_tab else window
    at = part.mapToGlobal(QPoint(0, 0))
    # Of the screen, because menus are windows of their own.
    picture = QApplication.primaryScreen().grabWindow(0, at.x(), at.y(), *part.size().toTuple())
    picture.save(str(file), quality=85 if file.suffix == ".jpg" else -1)
    window.discard()
    QApplication.processEvents()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    QSettings.setDefaultFormat(QSettings.Format.IniFormat)
    own = QSettings.Scope.UserScope
    QSettings.setPath(QSettings.Format.IniFormat, own, tempfile.mkdtemp())
    app = QApplication([])
    app.setApplicationName("spacemap")
    save_picture(folder / "gui.png", "draft", False, weave_diamond)
    tab = folder / "draft_tab.jpg", "draft", False, select_in_draft
    save_picture(*tab, "drafts/herringbone.wif", only_tab=True)
    save_picture(folder / "gui_plots.png", "plots", True, wait_for_plots)
