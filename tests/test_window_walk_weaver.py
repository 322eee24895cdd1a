"""The tutorial docs/tutorials/weaver.md in the window."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import (
    enlarge_for_pictures,
    keep_picture,
    require_display,
    scene_of,
    settled,
    turn_wheel,
    wait_until,
)

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtGui import QContextMenuEvent  # noqa: E402
from PySide6.QtWidgets import QApplication, QFileDialog  # noqa: E402

from spacemap_vtk.app.draft.draft_layout import GridCell  # noqa: E402
from spacemap_vtk.io.drafts.wif import read_wif  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


@pytest.mark.nightly
def test_weaver_corrects_a_draft(
    open_window: Any, qtbot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window(None, wait=False)
    enlarge_for_pictures(window)
    draft = window.draft

    def click(panel: str, across: int, up: int) -> None:
        at = QPoint(*draft.grid.current_layout().center(GridCell(panel, across, up)))
        qtbot.mouseClick(draft.grid.viewport(), LEFT, pos=at)

    # 1. A draft written by weaving software.
    file = tmp_path / "32-shaft_twill.wif"
    shutil.copy(library.folder() / file.name, file)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(file), ""))
    qtbot.mouseClick(window.gallery.open_button, LEFT)
    wait_until(lambda: settled(window))
    assert window.windowTitle().startswith("32-shaft_twill.wif")

    # 2. The draft tab shows it.
    window.tabs.setCurrentWidget(draft)
    wait_until(lambda: settled(window))
    assert draft.counts["ends"].value() == 62
    assert draft.counts["shafts"].value() == 32

    # 3. A threading error, and its undo.
    document = window.document
    woven = document.scene.source.cloth.drawdown
    click("threading", 3, 9)
    assert (document.scene.source.cloth.drawdown[:, 2] != woven[:, 2]).any()
    window.stages.select("weave")
    name = window.properties.rows["draft"].editor.line
    assert name.text() == "32-shaft_twill.wif (edited)"
    assert window.isWindowModified()
    window.menus.actions["Undo"].trigger()
    np.testing.assert_array_equal(document.scene.source.cloth.drawdown, woven)
    assert not window.isWindowModified()

    # 4. One end in green.
    colors = document.scene.source.cloth.warp.colors
    qtbot.mouseClick(draft.palette_row, LEFT, pos=draft.palette_row.rect_of(10).center())
    click("warp", 31, 1)
    wait_until(lambda: settled(window))
    changed = (scene_of(window).source.cloth.warp.colors != colors).any(axis=1)
    assert np.flatnonzero(changed).tolist() == [30]
    keep_picture(window, "weaver.jpg")

    # 5. A point draw, whose ends are threaded up and back, and its undo.
    threading = draft.grid.shown.loom.threading
    at = QPoint(*draft.grid.current_layout().center(GridCell("threading", 20, 16)))
    view = draft.grid.viewport()
    reason = QContextMenuEvent.Reason.Mouse
    QApplication.sendEvent(view, QContextMenuEvent(reason, at, view.mapToGlobal(at)))
    wait_until(draft.commands.menu.isVisible)
    draft.commands.actions["Point draw"].trigger()
    draft.commands.menu.close()
    assert [row[0] for row in draft.grid.shown.loom.threading[29:35]] == [30, 31, 32, 31, 30, 29]
    for _ in range(2):
        qtbot.mouseClick(draft.reverse_button, LEFT)
    window.menus.actions["Undo"].trigger()
    assert draft.grid.shown.loom.threading == threading

    # 6. A liftplan, and treadles again.
    treadled = draft.loom_kind.currentIndex()
    draft.loom_kind.setCurrentText("Liftplan")
    draft.loom_kind.activated.emit(draft.loom_kind.currentIndex())
    assert draft.loom_kind.currentIndex() != treadled
    window.menus.actions["Undo"].trigger()
    assert draft.loom_kind.currentIndex() == treadled

    # 7. It is saved next to the original draft.
    mine = tmp_path / "mine.wif"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(mine), ""))
    qtbot.mouseClick(draft.save_button, LEFT)
    assert read_wif(mine).loom == draft.grid.shown.loom

    # 8. Near yarns are drawn as yarns, and a screenshot is saved.
    turn_wheel(window.view.canvas, 120)
    wait_until(lambda: settled(window))
    picture = tmp_path / "mine.png"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(picture), ""))
    window.menus.actions["Save screenshot…"].trigger()
    assert picture.read_bytes().startswith(b"\x89PNG")
