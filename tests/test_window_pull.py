"""The pull tab: its map, and the cloth that follows mouse and keys."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from window import require_display, scene_of, settled, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

from spacemap_vtk.scenes import library  # noqa: E402

ELASTIC = {"inextensible": False, "tension": "50 N", "contact": "10 N"}


def show_map(window: Any, **yarns: Any) -> Any:
    """Show the pull tab of a scene with a section [yarns]."""
    if yarns:
        window.document.set_many("yarns", yarns)
    else:
        window.document.switch("yarns")
    wait_until(lambda: settled(window))
    window.tabs.setCurrentWidget(window.pull)
    wait_until(lambda: window.pull.map.map is not None)
    return window.pull.map


def drag(window: Any, *stretches: tuple[float, float], wait: int = 10) -> None:
    """Drag from the present stretch over some stretches, and release at the last."""
    pad = window.pull.map
    at = pad.position_of(*pad.stretch).toPoint()
    QTest.mousePress(pad, Qt.MouseButton.LeftButton, pos=at)
    for stretch in stretches:
        at = pad.position_of(*stretch).toPoint()
        QTest.mouseMove(pad, at)
        QTest.qWait(wait)
    QTest.mouseRelease(pad, Qt.MouseButton.LeftButton, pos=at)


def is_stretched(window: Any) -> bool:
    frame = window.view.frame
    return settled(window) and frame.mode == -1 and not frame.coarse


def size_of(data: Any) -> np.ndarray:
    return np.ptp(np.array(data.GetBounds()).reshape(3, 2), axis=1)


def test_cloth_follows_the_mouse_and_yarns_keep_their_length(open_scene: Any) -> None:
    window = open_scene()
    pad = show_map(window)
    # This square cloth jams beyond +5.287 %; Peirce's geometry gives the exchange curve.
    found = pad.map
    assert np.interp(1.06, found.warp, found.jam[1]) == pytest.approx(0.910090, abs=1e-5)
    assert np.interp(1.02896, *found.exchange) == pytest.approx(1 - 0.03640, abs=5e-4)
    before = {stage.section: stage.executions for stage in scene_of(window).stages}
    drag(window, (1.01, 0.99), (1.02, 0.975), (1.03, 0.96))
    wait_until(lambda: is_stretched(window))
    assert pad.stretch == pytest.approx((1.03, 0.96), abs=2e-3)  # a pixel
    # At rest, the surface is as fine as the scene says, and the cloth has the stretched size.
    cage = window.view.frame.cage
    moved = vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
    wide, high, _ = np.ptp(vtk_to_numpy(cage.GetPoints().GetData()) + moved, axis=0)
    assert (high / size_of(cage)[1], wide / size_of(cage)[0]) == pytest.approx(
        pad.stretch, abs=1e-6
    )
    strain = vtk_to_numpy(window.view.frame.surface.GetCellData().GetArray("yarn_strain"))
    assert strain.max() < 1e-6
    assert "Yarn strain 0.00 and 0.00 %" in window.pull.state_text.text()
    assert {s.section: s.executions for s in scene_of(window).stages} == before
    QTest.mouseClick(window.pull.back_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and window.view.frame.mode is None)
    assert pad.stretch == (1.0, 1.0)


@pytest.mark.nightly
def test_keys_move_the_point_and_a_jam_is_reported(open_scene: Any) -> None:
    window = open_scene()
    pad = show_map(window)
    shown = window.times.time
    QTest.mouseClick(pad, Qt.MouseButton.LeftButton, pos=pad.position_of(1.0, 0.95).toPoint())
    start = pad.stretch
    QTest.keyClick(pad, Qt.Key.Key_Right)
    QTest.keyClick(pad, Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    assert pad.stretch == pytest.approx((start[0] + 0.002, start[1] - 0.01), abs=1e-9)
    assert "slack" in window.pull.state_text.text()
    assert "jams" not in window.pull.state_text.text()
    for _ in range(5):
        for key in (Qt.Key.Key_Down, Qt.Key.Key_Right):
            QTest.keyClick(pad, key, Qt.KeyboardModifier.ShiftModifier)
    assert "The weft jams" in window.pull.state_text.text()
    QTest.keyClick(pad, Qt.Key.Key_Home)
    assert pad.stretch == (1.0, 1.0)
    assert window.times.time == shown  # the key does not trigger the menu
    wait_until(lambda: is_stretched(window))
    QTest.keyClick(pad, Qt.Key.Key_Escape)
    wait_until(lambda: settled(window) and window.view.frame.mode is None)


def test_drag_on_the_map_stretches_the_cloth(open_scene: Any) -> None:
    window = open_scene()
    pad = show_map(window, **ELASTIC)
    force = pad.map.force
    assert force.max() > 1.0
    np.testing.assert_allclose(force[0], force[1].T, rtol=1e-6, atol=1e-6)  # a square cloth
    drag(window, (1.03, 1.03))
    wait_until(lambda: is_stretched(window))
    assert "N/m" in window.pull.state_text.text()


@pytest.mark.nightly
def test_map_follows_a_changed_cloth_and_keeps_the_stretch(open_scene: Any) -> None:
    window = open_scene()
    pad = show_map(window, **ELASTIC)
    before = pad.map
    drag(window, (1.05, 1.02))
    wait_until(lambda: is_stretched(window))
    text = window.pull.state_text.text()
    window.document.set("yarns", "tension", "100 N")
    wait_until(lambda: pad.map is not before and is_stretched(window))
    assert pad.map.force.max() > before.force.max()
    assert window.pull.state_text.text() != text
    assert window.director.swing.warp == pad.stretch[0]
    # Without the section there is no map, and the motion is shown.
    window.document.set("yarns", "inextensible", True)
    wait_until(lambda: not pad.map.force.any())
    window.document.history.undo()
    window.document.history.undo()
    wait_until(lambda: np.array_equal(pad.map.force, before.force))


def test_button_adds_crimp_interchange(open_scene: Any) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.pull)
    assert window.pull.add_button.isVisible()
    assert window.pull.map.map is None
    QTest.mouseClick(window.pull.map, Qt.MouseButton.LeftButton, pos=QPoint(90, 90))
    assert window.view.frame.mode is None
    QTest.mouseClick(window.pull.add_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and window.pull.map.map is not None)
    assert not window.pull.add_button.isVisible()
    assert window.stages.states["yarns"] == "fresh"
    window.document.history.undo()
    wait_until(lambda: settled(window) and window.pull.map.map is None)
    assert window.stages.states["yarns"] == "off"
    window.document.open(library.find("lever_in_tetwild_cage"))
    wait_until(lambda: "woven" in window.pull.hint.text())
