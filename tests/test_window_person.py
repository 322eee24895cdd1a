"""Keyboard use: shortcuts, fast input, and closing at any moment."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from window import drag, require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtWidgets import QApplication, QStyle, QStyleOptionSlider  # noqa: E402

from spacemap_vtk.scenes.pipeline import section_classes  # noqa: E402

LEFT, CONTROL = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier


def open_active(open_scene: Any, qtbot: Any) -> Any:
    """Open a window that has the keyboard focus."""
    window = open_scene()
    with qtbot.waitActive(window):
        window.activateWindow()
    window.setFocus()
    return window


def press(qtbot: Any, window: Any, key: Any, *keys: Any) -> None:
    qtbot.keyClick(window, key, *keys)


def test_keys_play_step_switch_parts_and_undo(open_scene: Any, qtbot: Any) -> None:
    window = open_active(open_scene, qtbot)
    press(qtbot, window, Qt.Key.Key_Space)
    assert window.times.playing
    press(qtbot, window, Qt.Key.Key_Space)
    assert not window.times.playing
    press(qtbot, window, Qt.Key.Key_Home)
    assert window.times.time == 0.0
    press(qtbot, window, ".")
    step = window.times.time
    assert step > 0.0
    press(qtbot, window, Qt.Key.Key_End)
    assert window.times.time == 0.2
    press(qtbot, window, ",")
    assert window.times.time == pytest.approx(0.2 - step)
    wait_until(lambda: settled(window))
    image = window.view.image().astype(int)
    press(qtbot, window, "2")
    front = window.view.image().astype(int)
    assert np.abs(front - image).max() > 60
    press(qtbot, window, "C")
    assert np.abs(window.view.image().astype(int) - front).max() > 30
    window.document.set("weave", "ends", 5)
    press(qtbot, window, "Z", CONTROL)
    assert window.document.scene.source.ends == 7
    press(qtbot, window, "Z", CONTROL | Qt.KeyboardModifier.ShiftModifier)
    assert window.document.scene.source.ends == 5


def test_letters_typed_into_a_field_are_no_shortcuts(open_scene: Any, qtbot: Any) -> None:
    window = open_active(open_scene, qtbot)
    window.stages.select("weave")
    line = window.properties.rows["pattern"].editor
    line = getattr(line, "line", line)
    cage = window.view.options.cage
    type_into(line, "twill 2/2")
    assert window.document.scene.source.pattern == "twill 2/2"
    assert window.view.options.cage == cage
    assert not window.times.playing


@pytest.mark.nightly
def test_enter_focuses_the_view_and_tab_continues_from_the_field(
    open_scene: Any, qtbot: Any
) -> None:
    window = open_active(open_scene, qtbot)
    window.stages.select("weave")
    line = window.properties.rows["warp_diameter"].editor.line
    view = window.view.canvas

    def tab() -> Any:
        qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        return QApplication.focusWidget()

    line.setFocus()
    after = tab()
    type_into(line, "wide")  # an error to be corrected
    qtbot.wait(20)
    assert QApplication.focusWidget() is line
    type_into(line, "0.2 mm")
    wait_until(view.hasFocus)
    qtbot.keyClick(view, Qt.Key.Key_Space)
    assert window.times.playing
    qtbot.keyClick(view, Qt.Key.Key_Space)
    assert not window.times.playing
    assert tab() is after
    # After a click into the view, Tab continues with the next widget.
    view.setFocus()
    assert tab() is not after
    type_into(window.properties.search, "diameter")
    qtbot.wait(20)
    assert window.properties.search.hasFocus()
    window.properties.search.clear()


def test_undo_works_from_a_field_and_a_count(open_scene: Any, qtbot: Any) -> None:
    window = open_active(open_scene, qtbot)
    window.stages.select("weave")
    line = window.properties.rows["warp_diameter"].editor.line
    type_into(line, "0.2 mm")
    assert window.document.scene.source.warp_diameter == pytest.approx(0.2e-3)
    press(qtbot, line, "Z", CONTROL)
    assert window.document.scene.source.warp_diameter == pytest.approx(0.25e-3)
    assert line.text() == "0.25 mm"
    press(qtbot, line, "Z", CONTROL | Qt.KeyboardModifier.ShiftModifier)
    assert window.document.scene.source.warp_diameter == pytest.approx(0.2e-3)
    # Text that is not yet entered is undone in the line.
    qtbot.keyClicks(line, "5")
    press(qtbot, line, "Z", CONTROL)
    assert line.text() == "0.2 mm"
    assert window.document.scene.source.warp_diameter == pytest.approx(0.2e-3)
    window.tabs.setCurrentWidget(window.draft)
    spin = window.draft.counts["ends"]
    spin.setFocus()
    press(qtbot, spin, Qt.Key.Key_Up)
    # While a run will end soon, the change waits for it.
    wait_until(lambda: window.document.scene.source.ends == 8)
    press(qtbot, spin, "Z", CONTROL)
    assert window.document.scene.source.ends == 7


@pytest.mark.parametrize(
    "moment",
    [
        "playing",
        "loading",
        *(pytest.param(each, marks=pytest.mark.nightly) for each in ("stroke", "curves", "swing")),
    ],
)
def test_window_can_be_closed_at_any_moment(open_window: Any, qtbot: Any, moment: str) -> None:
    window = open_window(wait=moment != "loading")
    if moment == "playing":
        qtbot.mouseClick(window.times.play, LEFT)
        qtbot.wait(100)
    elif moment == "stroke":
        window.tabs.setCurrentWidget(window.draft)
        grid = window.draft.grid
        across, down = grid.current_layout().panels["threading"]
        at = QPoint(across.pixel_of(3) + 3, down.pixel_of(2) + 3)
        qtbot.mousePress(grid.viewport(), LEFT, pos=at)
        assert grid.is_stroking
    elif moment == "curves":
        window.tabs.setCurrentWidget(window.plots)
        wait_until(lambda: window.engine.background is not None)
    elif moment == "swing":
        window.modes.table.cellClicked.emit(1, 0)
        qtbot.wait(50)
    window.discard()
    assert not window.engine.isRunning()
    assert not window.isVisible()


@pytest.mark.nightly
def test_error_of_another_stage_does_not_end_a_drag(open_scene: Any, qtbot: Any) -> None:
    window = open_scene()
    window.stages.select("response")
    qtbot.wait(50)
    slider = window.properties.rows["alpha"].editor.slider
    option = QStyleOptionSlider()
    slider.initStyleOption(option)
    handle = slider.style().subControlRect(
        QStyle.ComplexControl.CC_Slider, option, QStyle.SubControl.SC_SliderHandle, slider
    )
    qtbot.mousePress(slider, LEFT, pos=handle.center())
    window.document.set("weave", "warp_diameter", "1.9 mm")  # a jammed cloth
    wait_until(lambda: window.errors.text)
    assert window.properties.section == "response"
    qtbot.mouseRelease(slider, LEFT, pos=handle.center())
    window.document.history.undo()
    wait_until(lambda: settled(window))
    # After the drag, the invalid field is shown.
    window.document.set("weave", "warp_diameter", "1.9 mm")
    wait_until(lambda: window.errors.text)
    assert window.properties.section == "weave"


@pytest.mark.parametrize("deeds", [20, pytest.param(150, marks=pytest.mark.nightly)])
def test_fast_random_input_breaks_nothing(open_window: Any, qtbot: Any, deeds: int) -> None:
    """Perform many random actions; an exception or a message of VTK fails the test."""
    window, dice = open_window(), random.Random(6)

    def slide() -> None:
        window.stages.select(dice.choice(["weave", "modal", "response", "surface"]))
        rows = list(window.properties.rows.values())
        sliders = [s for r in rows if (s := getattr(r.editor, "slider", None))]
        sliders = [s for s in sliders if s.isVisible() and s.isEnabled()]
        if sliders:
            drag(dice.choice(sliders), dice.choice([-6, -2, 2, 6]))

    def write() -> None:
        section = dice.choice(list(section_classes()))
        window.stages.select(section)
        rows = list(window.properties.rows.values())
        lines = [x for r in rows if (x := getattr(r.editor, "line", None)) and x.isVisible()]
        if lines:
            type_into(
                dice.choice(lines), dice.choice(["", "3", "-1", "abc", "0.2 mm", "1e-3", "~"])
            )

    def draw() -> None:
        window.tabs.setCurrentWidget(window.draft)
        grid = window.draft.grid
        if grid.isVisible():
            view = grid.viewport()
            spots = [
                QPoint(dice.randrange(view.width()), dice.randrange(view.height())) for _ in "ab"
            ]
            button = dice.choice([LEFT, Qt.MouseButton.RightButton])
            qtbot.mousePress(view, button, pos=spots[0])
            qtbot.mouseMove(view, spots[1])
            qtbot.mouseRelease(view, button, pos=spots[1])

    def plot() -> None:
        window.tabs.setCurrentWidget(window.plots)
        canvas = window.plots.canvas
        if canvas is None:  # made with the first curves
            return
        at = QPoint(dice.randrange(canvas.width()), dice.randrange(canvas.height()))
        qtbot.mouseClick(canvas, LEFT, pos=at)

    def swing() -> None:
        window.tabs.setCurrentWidget(window.modes)
        if window.modes.table.rowCount():
            window.modes.table.cellClicked.emit(dice.randrange(window.modes.table.rowCount()), 0)

    def look() -> None:
        view = window.view.canvas
        at = QPoint(dice.randrange(view.width()), dice.randrange(view.height()))
        qtbot.mouseClick(view, LEFT, pos=at)
        dice.choice(list(window.tools.cameras.values())).trigger()

    def step() -> None:
        dice.choice([window.times.play, window.times.last, window.times.back]).click()

    def back() -> None:
        dice.choice([window.document.history.undo, window.document.history.redo])()

    for _ in range(deeds):
        dice.choice([slide, write, draw, plot, swing, look, step, back, back])()
        qtbot.wait(dice.choice([0, 5, 30]))
        # Keep the requested work small.
        weave = window.document.scene.source
        if max(weave.ends or 0, weave.picks or 0) > 30:
            window.document.open("plain_weave")
    window.document.open("plain_weave")
    window.modes.stop()
    window.times.pause()
    wait_until(lambda: settled(window), 60)
    assert window.errors.text == ""
    assert window.stages.states["surface"] == "fresh"
    assert window.view.image().std() > 20
