"""The draft tab: threading, tie-up, treadling, drawdown and colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from window import require_display, scene_of, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt, QTimer  # noqa: E402
from PySide6.QtGui import QColor  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication, QColorDialog  # noqa: E402

from spacemap_vtk.app.draft.draft_layout import GridCell  # noqa: E402
from spacemap_vtk.io.drafts.wif import read_wif  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

LEFT, CONTROL = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier


def cell_position(window: Any, panel: str, x: int, y: int) -> QPoint:
    return QPoint(*window.draft.grid.current_layout().center(GridCell(panel, x, y)))


def click(qtbot: Any, window: Any, panel: str, x: int, y: int, *keys: Any) -> None:
    at = cell_position(window, panel, x, y)
    qtbot.mouseClick(window.draft.grid.viewport(), LEFT, *keys, pos=at)


def drawdown_of(window: Any) -> np.ndarray:
    """Return the drawdown of the drawn fabric."""
    wait_until(lambda: settled(window))
    return scene_of(window).woven.cloth.drawdown


def executions(window: Any) -> dict[str, int]:
    return {s.section: s.executions for s in scene_of(window).stages}


def test_cloth_follows_the_threading(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    before, counts, image = drawdown_of(window), executions(window), window.view.image().astype(int)
    click(qtbot, window, "threading", 2, 4)
    after = drawdown_of(window)
    # End 2 now equals end 4, and nothing else has changed.
    np.testing.assert_array_equal(after[:, 1], before[:, 3])
    np.testing.assert_array_equal(np.delete(after, 1, 1), np.delete(before, 1, 1))
    np.testing.assert_array_equal(window.draft.grid.shown.drawdown, after)
    assert np.abs(window.view.image().astype(int) - image).max() > 60
    # Each stage has run once more, and one undo restores everything.
    assert executions(window) == {name: count + 1 for name, count in counts.items()}
    assert window.document.history.count() == 1
    window.menus.actions["Undo"].trigger()
    np.testing.assert_array_equal(drawdown_of(window), before)
    np.testing.assert_array_equal(window.draft.grid.shown.drawdown, before)
    assert window.document.value_in_file("weave", "draft") == "twill.wif"
    window.menus.actions["Redo"].trigger()
    np.testing.assert_array_equal(drawdown_of(window), after)


def test_drag_threads_several_ends_in_one_undo_step(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    view = window.draft.grid.viewport()
    qtbot.mousePress(view, LEFT, pos=cell_position(window, "threading", 8, 1))
    # A fast drag: two mouse moves over six ends.
    for end, shaft in ((5, 4), (2, 1)):
        qtbot.mouseMove(view, cell_position(window, "threading", end, shaft))
        qtbot.wait(20)
    qtbot.mouseRelease(view, LEFT, pos=cell_position(window, "threading", 2, 1))
    assert window.draft.grid.shown.loom.threading[1:] == ((1,), (2,), (3,), (4,), (3,), (2,), (1,))
    wait_until(lambda: settled(window))
    assert window.document.history.count() == 1
    np.testing.assert_array_equal(drawdown_of(window), window.draft.grid.shown.drawdown)
    window.document.history.undo()
    assert window.draft.grid.shown.loom.threading[7] == (4,)


@pytest.mark.nightly
def test_tie_up_treadling_and_second_marks_can_be_edited(
    draft_of: Any, qtbot: Any, twill: Path
) -> None:
    window = draft_of(twill)
    loom = window.draft.grid.shown.loom
    click(qtbot, window, "tieup", 1, 3)
    assert window.draft.grid.shown.loom.tieup[0] == (1, 2, 3)
    click(qtbot, window, "tieup", 1, 3)
    assert window.draft.grid.shown.loom.tieup == loom.tieup
    click(qtbot, window, "treadling", 3, 1)
    assert window.draft.grid.shown.loom.treadling[0] == (3,)
    click(qtbot, window, "treadling", 2, 1, CONTROL)
    assert window.draft.grid.shown.loom.treadling[0] == (2, 3)
    click(qtbot, window, "threading", 1, 1)
    assert window.draft.grid.shown.loom.threading[0] == ()  # not threaded, so it floats
    assert not drawdown_of(window)[:, 0].any()
    # The drawdown of a loom cannot be painted; a message says why.
    before = window.document.text
    click(qtbot, window, "drawdown", 4, 4)
    assert "threading" in window.draft.hint.text()
    assert window.document.text == before


@pytest.mark.nightly
def test_liftplan_and_treadles_weave_the_same_cloth(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    # The treadles are not pressed in order; they keep their numbers after both conversions.
    window.draft._set_loom(window.draft.grid.shown.loom.replace_treadling(1, (3,)), "treadling")
    before, tied = drawdown_of(window), window.draft.grid.shown.loom
    window.draft.loom_kind.setFocus()
    qtbot.keyClick(window.draft.loom_kind, Qt.Key.Key_Down)
    qtbot.keyClick(window.draft.loom_kind, Qt.Key.Key_Up)
    assert window.draft.grid.shown.loom == tied
    qtbot.keyClick(window.draft.loom_kind, Qt.Key.Key_Down)
    shown = window.draft.grid.shown
    assert shown.loom.liftplan[:2] == ((3, 4), (2, 3))
    assert "tieup" not in window.draft.grid.current_layout().panels
    np.testing.assert_array_equal(drawdown_of(window), before)
    click(qtbot, window, "treadling", 1, 1)
    np.testing.assert_array_equal(drawdown_of(window)[0], before[0] | (np.arange(8) % 4 == 0))
    qtbot.keyClick(window.draft.loom_kind, Qt.Key.Key_Up)
    loom = window.draft.grid.shown.loom
    assert loom.liftplan is None
    assert loom.treadles == 5
    np.testing.assert_array_equal(loom.drawdown(), drawdown_of(window))


def test_sinking_shed_inverts_the_drawdown(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    before = drawdown_of(window)
    box = window.draft.rising
    qtbot.mouseClick(box, LEFT, pos=QPoint(8, box.height() // 2))
    np.testing.assert_array_equal(drawdown_of(window), ~before)


def test_yarns_shafts_and_treadles_can_be_counted(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    before, counts = drawdown_of(window), window.draft.counts
    type_into(counts["ends"].lineEdit(), "12")
    assert window.document.scene.source.ends == 12
    np.testing.assert_array_equal(drawdown_of(window), np.tile(before, (1, 2))[:, :12])
    assert window.draft.grid.shown.loom.shafts == 4  # the loom of the draft, repeated
    type_into(counts["shafts"].lineEdit(), "6")
    assert window.draft.grid.shown.loom.shafts == 6
    # Shafts in use stay, whatever is typed, and letters are ignored.
    type_into(counts["shafts"].lineEdit(), "2")
    assert window.draft.grid.shown.loom.shafts == 4
    type_into(counts["picks"].lineEdit(), "many")
    assert window.draft.grid.shown.size == (12, 8)
    click(qtbot, window, "threading", 12, 1)
    assert drawdown_of(window).shape == (8, 12)
    assert window.errors.text == ""


def test_drawdown_of_a_pattern_can_be_painted(draft_of: Any, qtbot: Any) -> None:
    window = draft_of("plain_weave")
    before, view = drawdown_of(window), window.draft.grid.viewport()
    assert not before[0, 1]
    qtbot.mousePress(view, LEFT, pos=cell_position(window, "drawdown", 2, 1))
    qtbot.mouseMove(view, cell_position(window, "drawdown", 2, 4))
    qtbot.mouseRelease(view, LEFT, pos=cell_position(window, "drawdown", 2, 4))
    after = drawdown_of(window)
    assert after[:4, 1].all()
    after[:4, 1] = before[:4, 1]
    np.testing.assert_array_equal(after, before)
    assert window.document.history.count() == 1
    assert Scene(window.document.values).source.pattern[0][:2] == "11"
    # A new loom is derived: end 2 has its own shaft now.
    assert window.draft.grid.shown.loom.shafts == 3
    # A pattern becomes a draft when its loom is changed.
    click(qtbot, window, "tieup", 1, 2)
    assert window.document.scene.source.draft is not None
    np.testing.assert_array_equal(drawdown_of(window), window.draft.grid.shown.drawdown)


def test_strips_are_painted_with_palette_and_dialog_colours(
    draft_of: Any, qtbot: Any, twill: Path
) -> None:
    window = draft_of(twill)
    draft = window.draft

    def choose(color: str) -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QColorDialog)
        dialog.setCurrentColor(QColor(color))
        dialog.accept()

    QTimer.singleShot(200, lambda: choose("#112233"))
    plus = draft.palette_row.rect_of(len(draft.palette_row.colors)).center()
    qtbot.mouseClick(draft.palette_row, LEFT, pos=plus)
    assert draft.grid.color.name() == "#112233"
    view = draft.grid.viewport()
    qtbot.mousePress(view, LEFT, pos=cell_position(window, "warp", 1, 0))
    qtbot.mouseMove(view, cell_position(window, "warp", 3, 0))
    qtbot.mouseRelease(view, LEFT, pos=cell_position(window, "warp", 3, 0))
    wait_until(lambda: settled(window))
    colors = scene_of(window).woven.cloth.warp.colors
    assert (colors[:3] == (0x11, 0x22, 0x33)).all()
    assert not (colors[3:] == (0x11, 0x22, 0x33)).all(axis=1).any()
    assert window.document.history.count() == 1
    # A double click replaces a colour everywhere; undo restores it.
    QTimer.singleShot(200, lambda: choose("#aa3300"))
    index = [color.name() for color in draft.palette_row.colors].index("#112233")
    qtbot.mouseDClick(draft.palette_row, LEFT, pos=draft.palette_row.rect_of(index).center())
    wait_until(lambda: settled(window))
    assert (scene_of(window).woven.cloth.warp.colors[:3] == (0xAA, 0x33, 0)).all()
    window.document.history.undo()
    window.document.history.undo()
    assert window.document.value_in_file("weave", "warp_color") is None
    # Ctrl and a click pick a colour.
    click(qtbot, window, "weft", 0, 2, CONTROL)
    assert draft.grid.color.name() == "#e8c78f"


@pytest.mark.nightly
def test_swatches_keep_their_places(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    draft, view = window.draft, window.draft.grid.viewport()
    row = draft.palette_row

    def stand() -> list[Any]:
        places = [row.mapToGlobal(row.rect_of(index).center()) for index in range(len(row.colors))]
        return [*zip(map(QColor.name, row.colors), places, strict=True)]

    before = stand()
    # The last colour is selected, and a colour without yarns stays.
    qtbot.mouseClick(row, LEFT, pos=row.rect_of(len(before) - 1).center())
    qtbot.mousePress(view, LEFT, pos=cell_position(window, "warp", 1, 0))
    qtbot.mouseMove(view, cell_position(window, "warp", 8, 0))
    qtbot.mouseRelease(view, LEFT, pos=cell_position(window, "warp", 8, 0))
    assert window.document.value_in_file("weave", "warp_color") == before[-1][0]
    assert stand() == before
    draft.hint.setText("a long hint " * 30)
    qtbot.wait(20)
    assert stand() == before
    # The pattern's squares have the yarns' colours.
    window.document.open("plain_weave")
    window.stages.select("weave")
    window.document.set_many(
        "weave", {"warp_color": "#112233", "weft_color": ["#aa3300", "#ffffff"]}
    )
    grid = window.properties.rows["pattern"].editor.grid

    def color(pick: int, end: int) -> str:
        return (
            grid.grab().toImage().pixelColor(grid.square_rect(pick, end).center().toPoint()).name()
        )

    wait_until(lambda: color(0, 0) == "#112233")
    assert (color(0, 1), color(1, 0)) == ("#aa3300", "#ffffff")


def test_draft_can_be_edited_with_the_keyboard(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    grid, keys = window.draft.grid, Qt.Key
    click(qtbot, window, "threading", 2, 2)
    click(qtbot, window, "threading", 2, 2)
    assert window.focusWidget() is grid
    for key in (keys.Key_Right, keys.Key_Up, keys.Key_Up, keys.Key_Return):
        qtbot.keyClick(grid, key)
    assert grid.shown.loom.threading[:3] == ((1,), (2,), (4,))
    assert "end 3, threaded on 4" in window.draft.hint.text()
    window.menus.actions["Undo"].trigger()
    assert grid.shown.loom.threading[2] == (3,)
    # From one grid to the next.
    for _ in range(4):
        qtbot.keyClick(grid, keys.Key_Down)
    assert "end 3" in window.draft.hint.text()
    assert "pick 8" in window.draft.hint.text()
    # A hidden cell scrolls into view.
    for _ in range(14):
        qtbot.keyClick(grid, "+")
    for _ in range(9):
        qtbot.keyClick(grid, keys.Key_Down)
    assert "pick 1 " in window.draft.hint.text()


@pytest.mark.nightly
def test_draft_with_32_shafts_fits_into_the_tab(draft_of: Any, qtbot: Any) -> None:
    window = draft_of(library.folder() / "32-shaft_twill.wif", wait=False)
    window.splitter.setSizes([260, 300, 640])
    qtbot.wait(50)
    grid, loom = window.draft.grid, read_wif(library.folder() / "32-shaft_twill.wif").loom
    layout = grid.current_layout()
    assert layout.max_offset == (0, 0)
    picture = grid.viewport().grab().toImage()
    for end, (shaft,) in enumerate(loom.threading, start=1):
        at = layout.center(GridCell("threading", end, shaft))
        beside = layout.center(GridCell("threading", end, shaft % 32 + 1))
        assert picture.pixelColor(*at).lightness() < 80
        assert picture.pixelColor(*beside).lightness() > 200
    over = grid.shown.drawdown
    for end, pick in ((1, 1), (17, 40), (62, 62)):
        color = picture.pixelColor(*layout.center(GridCell("drawdown", end, pick)))
        family = grid.shown.warp[end - 1] if over[pick - 1, end - 1] else grid.shown.weft[pick - 1]
        assert np.abs(np.array(color.getRgb()[:3]) - family).max() < 60
    # Hovering describes and highlights the cell.
    qtbot.mouseMove(grid.viewport(), QPoint(*layout.center(GridCell("drawdown", 17, 40))))
    qtbot.wait(50)
    assert "end 17" in window.draft.hint.text()
    assert "pick 40" in window.draft.hint.text()
    assert f"shaft {loom.threading[16][0]}" in window.draft.hint.text()
    assert grid.viewport().grab().toImage() != picture
    # Larger cells scroll; the threading stays where its ends are.
    for _ in range(8):
        qtbot.mouseClick(window.draft.zoom_in_button, LEFT)
    layout = grid.current_layout()
    assert layout.max_offset[0] > 0
    grid.horizontalScrollBar().setValue(layout.max_offset[0])
    now = grid.current_layout()
    assert now.center(GridCell("threading", 5, 1))[0] == now.center(GridCell("drawdown", 5, 1))[0]
    qtbot.mouseClick(window.draft.fit_button, LEFT)
    assert grid.current_layout().max_offset == (0, 0)
    # As on paper: the first end right, the first pick above.
    first = grid.current_layout().center(GridCell("drawdown", 1, 1))
    qtbot.mouseClick(window.draft.cloth_button, LEFT)
    last = grid.current_layout().center(GridCell("drawdown", 1, 1))
    assert last[0] > first[0]
    assert last[1] < first[1]


def test_drawdown_has_the_orientation_of_the_cloth(draft_of: Any, qtbot: Any, twill: Path) -> None:
    # A draft without symmetry: 8 ends, 6 picks, and one end threaded out of line.
    (twill.parent / "still.toml").write_text('[weave]\ndraft = "twill.wif"\npicks = 6\n')
    window = draft_of(twill.parent / "still.toml")
    click(qtbot, window, "threading", 2, 4)
    wait_until(lambda: settled(window))
    window.tools.cameras["front"].trigger()
    view, layout, shown = window.view, window.draft.grid.current_layout(), window.draft.grid.shown
    surface, renderer = pv.wrap(view.frame.surface), view.canvas.renderer
    yarns = [surface.extract_cells(surface["yarn"] == k).center for k in range(14)]
    left_to_right = sorted(center[0] for center in yarns[:8])
    down = sorted((center[1] for center in yarns[8:]), reverse=True)
    across, along = layout.panels["drawdown"]
    for row, y in enumerate(down):
        for column, x in enumerate(left_to_right):
            renderer.SetWorldPoint(x, y, 0.0, 1.0)
            renderer.WorldToDisplay()
            at = np.array(renderer.GetDisplayPoint()[:2]) / view.canvas.devicePixelRatioF()
            seen = view.pick(at[0], view.canvas.height() - 1 - at[1])
            cell = layout.cell_at(
                across.begin + (column + 0.5) * across.size, along.begin + (row + 0.5) * along.size
            )
            over = shown.drawdown[cell.y - 1, cell.x - 1]
            assert (seen.family, seen.number) == ((0, cell.x) if over else (1, cell.y))


@pytest.mark.nightly
def test_hovering_and_zooming_run_no_stage(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    before = executions(window)
    for end in range(1, 9):
        qtbot.mouseMove(window.draft.grid.viewport(), cell_position(window, "drawdown", end, 3))
    qtbot.mouseClick(window.draft.zoom_in_button, LEFT)
    qtbot.mouseClick(window.draft.colors_button, LEFT)
    window.tabs.setCurrentWidget(window.modes)
    qtbot.wait(400)
    assert executions(window) == before


@pytest.mark.nightly
def test_draft_tab_explains_that_a_mesh_has_no_draft(draft_of: Any) -> None:
    window = draft_of(next(library.folder().rglob("*.ply")))
    assert "not woven" in window.draft.placeholder.text()
    assert not window.draft.grid.isVisible()
    window.document.open("plain_weave")
    assert window.draft.grid.isVisible()


@pytest.mark.nightly
def test_typed_counts_keep_their_digits(draft_of: Any, twill: Path) -> None:
    window = draft_of(twill)
    ends, hint = window.draft.counts["ends"], window.draft.hint
    line = ends.lineEdit()
    line.setFocus()
    line.selectAll()
    QTest.keyClicks(line, "99999")
    assert line.text() == "99999"
    assert "99999" in hint.text()
    assert "1 to 4096" in hint.text()
    line.selectAll()
    QTest.keyClicks(line, "10")
    assert "out of range" not in hint.text()
    QTest.keyClick(line, Qt.Key.Key_Return)
    assert window.document.scene.source.ends == 10


def test_a_draft_that_replaces_a_pattern_does_not_warn_of_it(open_scene: Any) -> None:
    window = open_scene("plain_weave")  # its file gives the pattern "plain"
    window.tabs.setCurrentWidget(window.draft)
    wait_until(lambda: window.draft.grid.shown is not None)
    window.draft.counts["shafts"].setValue(window.draft.grid.shown.loom.shafts + 1)
    wait_until(lambda: window.document.scene.draft_file is not None and settled(window))
    assert not any("no effect" in text for text in window.view.frame.warnings)
