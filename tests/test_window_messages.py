"""Messages stay until their cause is gone; failures of old requests stop nothing later."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QFileDialog, QToolButton, QWhatsThis  # noqa: E402

from spacemap_vtk.errors import SolverError  # noqa: E402
from spacemap_vtk.scenes import report  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

#: A scene whose frames are drawn quickly.
SMALL = """
weave = { ends = 3, picks = 3 }
cage = { divisions = [2, 2, 1] }
response = {}
"""


def frames_drawn(window: Any, count: int) -> None:
    """Wait for a number of further frames."""
    frames: list[Any] = []
    link = window.director.drawn.connect(frames.append)
    wait_until(lambda: len(frames) >= count)
    window.director.drawn.disconnect(link)


def play(window: Any) -> None:
    window.times.play.click()
    frames_drawn(window, 3)


@pytest.mark.nightly
def test_messages_stay_while_playing(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tmp_path / "small.toml"
    scene.write_text(SMALL)
    window = open_scene(scene)
    play(window)
    # A refused value, until the field is valid.
    window.stages.select("weave")
    line = window.properties.rows["warp_diameter"].editor.line
    type_into(line, "wide")
    frames_drawn(window, 2)
    assert "wide" in window.errors.text
    type_into(line, "0.24 mm")
    frames_drawn(window, 2)
    assert window.errors.text == ""
    # An invalid time, until a valid one is typed.
    type_into(window.times.line, "soon")
    frames_drawn(window, 2)
    assert "soon" in window.errors.text
    window.document.set("view", "ghost", True)
    frames_drawn(window, 2)
    assert "soon" in window.errors.text
    type_into(window.times.line, "10 ms")
    assert window.errors.text == ""
    # A failed save, until it succeeds; changes do not clear its message.
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(names.pop(0)), ""))
    names = [tmp_path / "no" / "scene.toml", tmp_path / "scene.toml"]
    window.menus.actions["Save as…"].trigger()
    window.document.set("view", "ghost", None)
    frames_drawn(window, 2)
    assert "could not be written" in window.errors.text
    window.menus.actions["Save as…"].trigger()
    assert window.errors.text == ""
    # An export, likewise.
    window.exports.start("cage", tmp_path / "no" / "cage.vtu")
    frames_drawn(window, 2)
    assert "does not exist" in window.errors.text
    window.exports.start("cage", tmp_path / "cage.vtu")
    wait_until(lambda: (tmp_path / "cage.vtu").exists() and not window.exports.busy)
    assert window.errors.text == ""
    # A message that the user has closed stays closed.
    window.exports.start("cage", tmp_path / "no" / "cage.vtu")
    window.errors.findChild(QToolButton).click()
    frames_drawn(window, 2)
    assert window.errors.text == ""
    assert window.times.playing


@pytest.mark.nightly
def test_frame_of_the_motion_clears_a_run_error_and_a_mode_does_not(open_scene: Any) -> None:
    window = open_scene()
    window.document.set_many("response", {"damping_ratio": 0.05, "alpha": 3.0})
    wait_until(lambda: "damping_ratio" in window.errors.text)
    # A failed run ends a mode animation; the last requested run has failed by now.
    wait_until(lambda: not window.engine.busy and not window.director.rest_timer.isActive())
    # A mode needs no damping, so its frames do not clear the error.
    window.tabs.setCurrentWidget(window.modes)
    window.modes.table.cellClicked.emit(1, 0)
    frames_drawn(window, 2)
    assert "damping_ratio" in window.errors.text
    assert window.stages.states["response"] == "failed"
    window.modes.stop()
    window.document.set("response", "alpha", None)
    wait_until(lambda: settled(window) and window.errors.text == "")
    assert window.stages.states["response"] == "fresh"


@pytest.mark.nightly
def test_failure_of_an_older_run_does_not_end_a_mode_just_clicked(open_scene: Any) -> None:
    window = open_scene()
    request = window.director._last_request
    window.modes.table.cellClicked.emit(1, 0)
    window.engine.failed.emit(SolverError("refused"), request)
    frames_drawn(window, 3)
    assert window.modes.mode == 1


@pytest.mark.nightly
def test_failing_mode_animation_ends(open_scene: Any) -> None:
    window = open_scene()
    window.modes.table.cellClicked.emit(1, 0)
    frames_drawn(window, 3)
    messages: list[Any] = []
    window.director.failed.connect(messages.append)
    window.document.set("weave", "warp_diameter", "1.9 mm")
    wait_until(lambda: messages and window.modes.mode is None and not window.engine.busy)
    assert window.errors.text != ""
    QTest.qWait(300)
    # The user can change other stages to correct it.
    window.stages.select("surface")
    QTest.qWait(300)
    assert window.properties.section == "surface"
    assert len(messages) < 4


@pytest.mark.nightly
def test_late_failure_does_not_stop_a_newer_request(open_scene: Any) -> None:
    window = open_scene()
    messages: list[Any] = []
    window.director.failed.connect(messages.append)
    window.document.set("weave", "warp_diameter", "1.9 mm")
    wait_without_window(lambda: not window.engine.busy)
    # The run has failed, but the window has not processed the signal.
    window.document.set("weave", "warp_diameter", "0.24 mm")
    wait_until(lambda: settled(window))
    assert len(messages) == 1
    assert window.errors.text == ""
    assert not window.properties.rows["warp_diameter"].property("bad")
    # A failure of a closed scene is not reported.
    window.document.set("weave", "warp_diameter", "1.9 mm")
    wait_without_window(lambda: not window.engine.busy)
    window.document.new()
    wait_until(lambda: settled(window))
    assert len(messages) == 1


def wait_without_window(done: Callable[[], bool]) -> None:
    """Wait like `wait_until`, but without processing events."""
    end = time.monotonic() + 300.0
    while not done():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("alone", [pytest.param(True, marks=pytest.mark.nightly), False])
def test_undo_includes_the_waiting_change_of_a_drag(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch, alone: bool
) -> None:
    window = open_scene()
    document, undo = window.document, window.menus.actions["Undo"]
    document.set("modal", "youngs_modulus", 1500.0)
    assert (undo.text(), undo.isEnabled()) == ("Undo Modal solver: Young's modulus", True)
    begin = document.text
    if not alone:
        document.set("response", "alpha", 5.0, burst=1)
    monkeypatch.setattr(document, "congested", lambda: True)
    for value in (6.0, 7.0):
        document.set("response", "alpha", value, burst=1)
    # Within the 1/20 s that the change may wait.
    undo.trigger()
    assert document.text == begin
    assert undo.text() == "Undo Modal solver: Young's modulus"
    window.menus.actions["Redo"].trigger()
    assert document.value_in_file("response", "alpha") == 7.0
    # The waiting change is an edit, so there is nothing to redo after it.
    undo.trigger()
    document.set("response", "alpha", 8.0, burst=2)
    document.history.redo()
    assert document.value_in_file("response", "alpha") == 8.0
    assert not window.menus.actions["Redo"].isEnabled()
    assert (undo.text(), undo.isEnabled()) == ("Undo Modal response: Alpha", True)
    document.history.undo()
    undo.trigger()
    assert not undo.isEnabled()
    assert document.history.isClean()


@pytest.mark.nightly
def test_drag_ends_when_its_slider_is_deleted(open_scene: Any) -> None:
    window = open_scene()
    window.stages.select("modal")
    slider = window.properties.rows["youngs_modulus"].editor.slider
    slider.setSliderDown(True)
    assert window.director.is_dragging
    # By a key while the mouse is pressed: the fine frame must not be delayed forever.
    window.stages.select("weave")
    assert not window.director.is_dragging
    window.document.set("weave", "warp_diameter", "0.24 mm")
    wait_until(lambda: settled(window))


def test_surface_too_large_to_draw_is_refused_and_the_last_one_stays(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    messages: list[str] = []
    window.director.failed.connect(lambda *words: messages.append(" ".join(map(str, words))))
    shown = window.view.frame.surface.GetNumberOfCells()
    # Enough memory for the surface, but not for OpenGL's copy.
    monkeypatch.setattr("spacemap_vtk.app.work.pipeline.DRAWN_POINT", 300)
    monkeypatch.setattr("spacemap_vtk.memory.NEVER_REFUSED", 0)
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 150 * 4 * shown)
    window.document.set("surface", "subdivisions", 2 * window.document.scene.surface.subdivisions)
    wait_until(lambda: messages and not window.engine.busy)
    assert f"to draw {4 * shown} polygons would need" in messages[-1]
    assert window.view.frame.surface.GetNumberOfCells() <= shown


STRIP = """
weave = { ends = 3, picks = 9 }
cage = { divisions = [1, 8, 1] }
modal = { elements = "sheet", youngs_modulus = "4 kPa", density = "300 kg/m3", fixed = "+y" }
response = { alpha = 0.5, gravity = [0.0, 0.0, "-1 g"], duration = "1 s" }
"""


def test_a_long_message_ends_before_the_progress_bar(open_scene: Any) -> None:
    window = open_scene("plain_weave")
    bar, progress = window.statusBar(), window.exports.progress
    pictures = []
    progress.show()
    for count in (40, 400):
        bar.showMessage("Moment " * count)
        wait_until(lambda: progress.isVisible() and progress.x() > 0)
        pictures.append(
            bar.grab(bar.rect().adjusted(0, 0, progress.x() - bar.width(), 0)).toImage()
        )
        assert bar.toolTip() == bar.currentMessage()
    # Both are cut at the same place, before which there is room.
    assert pictures[0] == pictures[1]
    image, ratio = pictures[0], pictures[0].devicePixelRatio()
    edge = image.pixelColor(image.width() - 1, 0)
    columns = range(image.width() - round(5 * ratio), image.width())
    assert all(
        image.pixelColor(x, y) == edge for x in columns for y in range(2, image.height() - 2)
    )
    bar.clearMessage()
    progress.hide()


def test_too_large_motion_is_reported_with_its_cure(open_scene: Any, tmp_path: Path) -> None:
    file = tmp_path / "strip.toml"
    file.write_text(STRIP)
    window = open_scene(file)
    figures = report.report_motion(Scene.read(file))
    assert figures is not None
    assert figures["large"]
    # At t = 0 nothing is deformed: the message is about the whole motion.
    assert window.times.time == 0.0
    angle = f"turns by up to {figures['largest_rotation_deg']:.3g}°"
    assert angle in window.status_text.full_text
    for words in (angle, "times as long", "[transient]"):
        assert words in window.status_text.toolTip()
    # A long text ends in dots, and the link exists as long as its words are visible.
    window.status_text.resize(
        3 * window.status_text.fontMetrics().horizontalAdvance(window.status_text.full_text) // 4,
        20,
    )
    assert window.status_text.text().endswith("…")
    assert angle in window.status_text.text()
    window.status_text.resize(
        window.status_text.fontMetrics().horizontalAdvance(window.status_text.full_text) + 20, 20
    )
    assert '<a href="rotation">switch on Rotation strain</a>' in window.status_text.text()
    # A click on the link applies the cure.
    for x in range(0, window.status_text.width(), 8):
        QTest.mouseClick(
            window.status_text,
            Qt.MouseButton.LeftButton,
            pos=QPoint(x, window.status_text.height() // 2),
        )
    assert "rotation" in window.document.values
    wait_until(lambda: settled(window) and window.stages.states["rotation"] == "fresh")
    assert "lengths change" not in window.status_text.full_text
    assert "times as long" in window.status_text.full_text
    window.menus.actions["Undo"].trigger()
    wait_until(lambda: settled(window) and "lengths change" in window.status_text.full_text)
    # The status line shows the first words, the button shows everything.
    assert len(window.status_text.full_text.split()) < 25
    assert window.details_button.isVisible()
    # A small motion gives no warning.
    window.document.set("response", "gravity", [0.0, 0.0, "-0.01 g"])
    wait_until(lambda: settled(window) and "turns" not in window.status_text.full_text)
    assert window.status_text.toolTip() == ""
    assert not window.details_button.isVisible()


def test_warnings_are_short_and_hidden_for_unchanged_examples(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene("lever_in_tetwild_cage")  # 12 modes are few
    window.tabs.setCurrentWidget(window.modes)
    assert "⚠" not in window.status_text.full_text
    assert (window.details_button.isVisible(), window.details_button.text()) == (True, "Notes")
    # After a change by the user, warnings are shown.
    window.document.set("modal", "modes", 11)
    wait_until(lambda: settled(window) and "⚠" in window.status_text.full_text)
    messages = window.status_text.full_text.partition("⚠")[2]
    assert "of the mass" in messages
    assert len(messages.split()) <= 16
    assert not set('[]="') & set(messages)
    full_width = window.status_text.fontMetrics().horizontalAdvance(window.status_text.full_text)
    assert full_width <= 900  # in a window of 1,280 pixels
    # A click shows the whole text.
    shown: list[str] = []
    monkeypatch.setattr(QWhatsThis, "showText", lambda at, text, owner: shown.append(text))
    QTest.mouseClick(window.details_button, Qt.MouseButton.LeftButton)
    assert "raise modal.modes" in shown[0]
    window.document.history.undo()
    wait_until(lambda: settled(window) and "⚠" not in window.status_text.full_text)
