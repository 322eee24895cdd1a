"""Selecting and editing parts of a draft in the window: mouse, keys, menus, faces, counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, scene_of, settled, wait_until

require_display()

from PySide6.QtCore import QEvent, QPoint, Qt, QTimer  # noqa: E402
from PySide6.QtGui import QColor, QContextMenuEvent  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication, QInputDialog  # noqa: E402

from spacemap_vtk.app.draft.draft_dialogs import DrawDialog, RepeatDialog  # noqa: E402
from spacemap_vtk.app.draft.draft_layout import GridCell  # noqa: E402
from spacemap_vtk.scenes.draft_edits import Selection  # noqa: E402

LEFT, SHIFT = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier
CONTROL = Qt.KeyboardModifier.ControlModifier


def position(window: Any, panel: str, x: int, y: int) -> QPoint:
    return QPoint(*window.draft.grid.current_layout().center(GridCell(panel, x, y)))


def select(
    qtbot: Any, window: Any, panel: str, begin: tuple[int, int], end: tuple[int, int]
) -> None:
    """Drag with Shift from one cell to another."""
    view = window.draft.grid.viewport()
    qtbot.mousePress(view, LEFT, SHIFT, pos=position(window, panel, *begin))
    qtbot.mouseMove(view, position(window, panel, *end))
    qtbot.mouseRelease(view, LEFT, SHIFT, pos=position(window, panel, *end))


def open_menu(window: Any, panel: str, x: int, y: int) -> Any:
    """Open the context menu of a cell."""
    grid, at = window.draft.grid, position(window, panel, x, y)
    reason = QContextMenuEvent.Reason.Mouse
    event = QContextMenuEvent(reason, at, grid.viewport().mapToGlobal(at))
    QApplication.sendEvent(grid.viewport(), event)
    menu = window.draft.commands.menu
    wait_until(menu.isVisible)
    return menu


def test_block_is_copied_from_threading_to_treadling(
    draft_of: Any, qtbot: Any, twill: Path
) -> None:
    window = draft_of(twill)
    draft, grid = window.draft, window.draft.grid
    before = grid.shown
    select(qtbot, window, "threading", (2, 1), (4, 4))
    assert grid.selection == Selection("threading", (2, 4), (1, 4))
    selected = (
        "Selected: threading, ends 2–4, shafts 1–4. Drag it to move it, with Ctrl to copy it."
    )
    assert draft.hint.text() == selected
    assert grid.shown is before
    qtbot.keyClick(grid, Qt.Key.Key_C, CONTROL)
    assert QApplication.clipboard().text() == ".X..\n..X.\n...X"
    # The cell under the mouse is the place to paste.
    qtbot.keyClick(grid, Qt.Key.Key_Escape)
    assert grid.selection is None
    qtbot.mouseMove(grid.viewport(), position(window, "treadling", 1, 1))
    qtbot.keyClick(grid, Qt.Key.Key_V, CONTROL)
    assert grid.shown.loom.treadling[:4] == ((2,), (3,), (4,), (4,))
    assert window.menus.actions["Undo"].text() == "Undo treadling: paste"
    wait_until(lambda: settled(window))
    np.testing.assert_array_equal(scene_of(window).woven.cloth.drawdown, grid.shown.drawdown)
    assert window.document.history.count() == 1
    window.menus.actions["Undo"].trigger()
    assert grid.shown.loom == before.loom
    # Arrow keys with Shift select, too; Ctrl+H mirrors, and Delete removes marks.
    qtbot.mouseMove(grid.viewport(), position(window, "tieup", 1, 1))
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Up):
        qtbot.keyClick(grid, key, SHIFT)
    assert grid.selection == Selection("tieup", (1, 2), (1, 2))
    qtbot.keyClick(grid, Qt.Key.Key_H, CONTROL)
    assert grid.shown.loom.tieup[:2] == ((2,), (1, 2, 3))
    qtbot.keyClick(grid, Qt.Key.Key_Delete)
    assert grid.shown.loom.tieup[:2] == ((), (3,))


def test_selected_block_is_dragged(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    grid = window.draft.grid
    view, before = grid.viewport(), grid.shown.loom

    def drag(begin: tuple[int, int], end: tuple[int, int], *keys: Any) -> None:
        qtbot.mousePress(view, LEFT, *keys, pos=position(window, "threading", *begin))
        qtbot.mouseMove(view, position(window, "threading", *end))
        qtbot.mouseRelease(view, LEFT, *keys, pos=position(window, "threading", *end))

    select(qtbot, window, "threading", (1, 1), (2, 2))
    drag((1, 1), (1, 3))
    assert grid.shown.loom.threading == ((3,), (4,), *before.threading[2:])
    assert grid.selection == Selection("threading", (1, 2), (3, 4))
    assert window.menus.actions["Undo"].text() == "Undo threading: move"
    # A copy stays within the grid, wherever the mouse goes.
    drag((2, 4), (8, 1), CONTROL)
    assert grid.selection == Selection("threading", (7, 8), (1, 2))
    assert grid.shown.loom.threading == ((3,), (4,), *before.threading[2:6], (1, 3), (2, 4))
    assert window.document.history.count() == 2
    # A click within the selection marks a cell, as anywhere else.
    qtbot.mouseClick(view, LEFT, pos=position(window, "threading", 7, 2))
    assert grid.selection is None
    assert grid.shown.loom.threading[6] == (2,)
    for _ in range(3):
        window.menus.actions["Undo"].trigger()
    assert grid.shown.loom == before


def test_menus_edit_threads_and_show_what_is_selected(
    draft_of: Any, qtbot: Any, twill: Path
) -> None:
    window = draft_of(twill)
    grid, actions = window.draft.grid, window.draft.commands.actions
    before = grid.shown
    menu = open_menu(window, "threading", 3, 2)
    assert window.draft.commands.header.text() == "Threading, all"
    assert not actions["Copy"].isEnabled()
    assert not actions["Insert… picks"].isVisible()
    assert actions["Insert ends or picks"].text() == "Insert ends before 3…"
    assert actions["Delete ends or picks"].text() == "Delete end 3"
    actions["Point draw"].trigger()
    menu.close()
    assert [row[0] for row in grid.shown.loom.threading] == [1, 2, 3, 4, 3, 2, 1, 2]
    assert actions["Insert… picks"].isVisible()
    # A drag in the drawdown of a loom selects ends and picks.
    view = grid.viewport()
    qtbot.mousePress(view, LEFT, pos=position(window, "drawdown", 3, 2))
    qtbot.mouseMove(view, position(window, "drawdown", 4, 4))
    qtbot.mouseRelease(view, LEFT, pos=position(window, "drawdown", 4, 4))
    menu = open_menu(window, "drawdown", 4, 3)
    assert window.draft.commands.header.text() == "Drawdown, ends 3–4, picks 2–4"
    assert not actions["Invert marks"].isEnabled()
    actions["Delete picks"].trigger()
    menu.close()
    assert grid.shown.size == (8, 5)
    assert window.document.scene.source.picks is None
    wait_until(lambda: settled(window))
    rows = [0, 4, 5, 6, 7]
    after = scene_of(window).woven.cloth
    assert after.drawdown.shape == (5, 8)
    np.testing.assert_array_equal(after.weft.colors, before.weft[rows])

    def accept_three() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QInputDialog)
        dialog.setIntValue(3)
        dialog.accept()

    QTimer.singleShot(100, accept_three)
    grid.select(Selection("warp", (8, 8), (1, 1)))
    qtbot.keyClick(grid, Qt.Key.Key_Insert)
    assert grid.shown.size == (11, 5)
    assert grid.shown.loom.threading[7:10] == ((), (), ())
    for _ in range(3):
        window.menus.actions["Undo"].trigger()
    assert grid.shown.loom == before.loom
    # The draft of a hidden tab may be out of date: the menu offers to show it.
    window.tabs.setCurrentWidget(window.modes)
    assert not actions["Select all"].isEnabled()
    window.draft.commands.header.trigger()
    assert window.tabs.currentWidget() is window.draft
    assert actions["Select all"].isEnabled()


def test_reverse_floats_and_counts_are_shown(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    draft, grid = window.draft, window.draft.grid
    grid.change(grid.shown.with_loom(grid.shown.loom.replace_threading(3, ())), "threading")
    picture = grid.viewport().grab().toImage()
    draft.float_box.setChecked(True)
    # End 3 is in no heddle: the face shows only its picks, and it floats on the reverse.
    assert not grid.floats[:, 2].any()
    draft.reverse_button.setChecked(True)
    np.testing.assert_array_equal(np.flatnonzero(grid.floats.all(axis=0)), [2])
    # Turned over, end 1 is at the right.
    assert position(window, "drawdown", 1, 1).x() > position(window, "drawdown", 8, 1).x()
    assert grid.viewport().grab().toImage() != picture
    draft.counts_button.setChecked(True)
    rows = draft.counts_view.as_text().splitlines()
    assert rows[:5] == [
        "2\tHeddles\tshaft 1",
        "2\tHeddles\tshaft 2",
        "1\tHeddles\tshaft 3",
        "2\tHeddles\tshaft 4",
        "7\tHeddles\tall shafts",
    ]
    assert rows[9] == "8\tWarp float, reverse\tend 3, picks 1–8"
    summary = draft.counts_view.summary.text()
    assert "Warp floats over 3: 0 on the face, 1 on the reverse; longest 8" in summary
    draft.reverse_button.setChecked(False)
    draft.counts_view.table.selectRow(9)
    assert grid.selection == Selection("drawdown", (3, 3), (1, 8))
    assert draft.reverse_button.isChecked()
    QTest.keyClick(draft.counts_view.table, Qt.Key.Key_C, CONTROL)
    assert QApplication.clipboard().text() == rows[9]


def test_narrow_tab_shows_all_colours_and_the_whole_hint(
    draft_of: Any, qtbot: Any, twill: Path
) -> None:
    window = draft_of(twill, wait=False)
    draft = window.draft
    # With the colours added here, the palette needs a second row in the narrow tab.
    row = draft.palette_row
    for name in ("#102030", "#405060", "#708090"):
        row.choose(QColor(name))
    for width in (1500, 1000):
        window.resize(width, 700)
        qtbot.wait(50)
        assert row.rect_of(len(row.colors)).bottom() < row.height()
        assert draft.hint.sizeHint().height() <= draft.hint.height() + 2
        assert draft.tools.width() >= draft.tools.minimumSizeHint().width()


@pytest.mark.nightly
def test_dialogs_fill_with_draws_and_repeat(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    grid, actions = window.draft.grid, window.draft.commands.actions
    before = grid.shown

    def accept_draw() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, DrawDialog)
        dialog.kind.setCurrentText("Broken")
        assert dialog.extra[0].text() == "as many as shafts"
        assert "1 2 3 4 2 1 4 3" in dialog.summary.text()
        dialog.extra[0].setValue(2)
        assert "1 2 4 3 1 2 4 3" in dialog.summary.text()
        dialog.accept()

    QTimer.singleShot(100, accept_draw)
    grid.select(Selection("threading", (1, 8), (1, 4)))
    qtbot.keyClick(grid, Qt.Key.Key_D, CONTROL | SHIFT)
    assert [row[0] for row in grid.shown.loom.threading] == [1, 2, 4, 3, 1, 2, 4, 3]
    # The window's Ctrl+D, for the dark theme, is another key.
    assert not window.menus.dark.isChecked()

    def accept_repeat() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, RepeatDialog)
        dialog.mirrored.setChecked(True)
        assert "8 ends become 15" in dialog.summary.text()
        dialog.accept()

    QTimer.singleShot(100, accept_repeat)
    qtbot.keyClick(grid, Qt.Key.Key_R, CONTROL | SHIFT)
    assert grid.shown.size == (15, 8)
    np.testing.assert_array_equal(grid.shown.drawdown, grid.shown.drawdown[:, ::-1])

    def accept_insert() -> None:
        # Under a dialog, the mouse leaves the draft.
        QApplication.sendEvent(grid, QEvent(QEvent.Type.Leave))
        QApplication.activeModalWidget().accept()

    grid.select(None)
    qtbot.mouseMove(grid.viewport(), position(window, "treadling", 1, 6))
    QTimer.singleShot(100, accept_insert)
    qtbot.keyClick(grid, Qt.Key.Key_Insert)
    assert grid.shown.loom.treadling[4:7] == ((1,), (), (2,))
    for name in ("Turn the draft", "Turn the cloth over", "Weave as drawn in"):
        actions[name].trigger()
    assert grid.shown.size == (9, 9)
    assert window.errors.text == ""
    wait_until(lambda: settled(window))
    np.testing.assert_array_equal(scene_of(window).woven.cloth.drawdown, grid.shown.drawdown)
    for _ in range(6):
        window.menus.actions["Undo"].trigger()
    assert grid.shown.loom == before.loom


@pytest.mark.nightly
def test_pattern_is_edited_as_blocks_and_stays_a_pattern(draft_of: Any, qtbot: Any) -> None:
    window = draft_of("plain_weave")
    grid, actions = window.draft.grid, window.draft.commands.actions
    ends, picks = grid.shown.size
    grid.select(Selection("drawdown", (1, ends), (1, picks)))
    before = grid.shown.drawdown
    actions["Invert marks"].trigger()
    np.testing.assert_array_equal(grid.shown.drawdown, ~before)
    qtbot.keyClick(grid, Qt.Key.Key_Delete, CONTROL)
    assert "at least one end" in window.draft.hint.text()
    grid.select(Selection("drawdown", (2, 3), (1, picks)))
    qtbot.keyClick(grid, Qt.Key.Key_Delete, CONTROL)
    assert grid.shown.size == (ends - 2, picks)
    assert grid.shown.is_pattern
    assert window.document.scene.source.ends == ends - 2
    wait_until(lambda: settled(window))
    drawn = scene_of(window).woven.cloth.drawdown
    np.testing.assert_array_equal(drawn, np.delete(~before, [1, 2], 1))
