"""The biaxial pad: its map, and the cloth that follows the mouse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from window import require_display, scene_of, settled, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402


def drag_to(window: Any, *stretches: tuple[float, float]) -> None:
    """Press where the cloth is at rest, move over some stretches, let go at the last."""
    pad = window.pull.map
    at = pad.place(1.0, 1.0).toPoint()
    QTest.mousePress(pad, Qt.MouseButton.LeftButton, pos=at)
    for stretch in stretches:
        at = pad.place(*stretch).toPoint()
        QTest.mouseMove(pad, at)
        # Qt's own move has no button: what a hand holds down is pressed again
        QTest.mousePress(pad, Qt.MouseButton.LeftButton, pos=at)
        QTest.qWait(10)
    QTest.mouseRelease(pad, Qt.MouseButton.LeftButton, pos=at)


def size_of(window: Any) -> np.ndarray:
    """Return the widths of the surface that is drawn."""
    return np.ptp(np.array(window.view.frame.surface.GetBounds()).reshape(3, 2), axis=1)


def test_the_cloth_follows_the_mouse_and_yarns_keep_their_length(open_scene: Any) -> None:
    window = open_scene()
    window.document.add("yarns")
    wait_until(lambda: settled(window))
    window.tabs.setCurrentWidget(window.pull)
    wait_until(lambda: window.pull.map.map is not None)
    found = window.pull.map.map
    # the jam of this square cloth, and where its map says that crossings are pressed
    near = np.abs(found.border - [[1.052870], [1.0 - 0.089910]]).max(axis=0).min()
    assert near < 5e-3
    executions = {stage.section: stage.executions for stage in scene_of(window).stages}
    drag_to(window, (1.01, 0.99), (1.02, 0.975), (1.04, 0.94))
    wait_until(lambda: settled(window) and window.view.frame.swing == -1)
    warp, weft = window.pull.map.at
    cage = np.ptp(np.array(window.view.frame.cage.GetBounds()).reshape(3, 2), axis=1)
    wide, high, _ = size_of(window)
    assert abs(high / cage[1] - warp) < 0.03
    assert abs(wide / cage[0] - weft) < 0.03
    assert "Yarn strain 0.00 and 0.00 %" in window.pull.told.text()
    assert {s.section: s.executions for s in scene_of(window).stages} == executions
    QTest.mouseClick(window.pull.back, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and window.view.frame.swing is None)
    assert window.pull.map.at == (1.0, 1.0)


def test_a_drag_draws_twenty_frames_a_second(open_scene: Any) -> None:
    """Frames of the engine; how fast they are drawn is the machine's."""
    window = open_scene()
    window.document.set_many("yarns", {"inextensible": False, "tension": "50 N", "contact": "10 N"})
    wait_until(lambda: settled(window))
    window.tabs.setCurrentWidget(window.pull)
    wait_until(lambda: window.pull.map.map is not None)
    assert window.pull.map.map.force.max() > 1.0
    drag_to(window, (1.03, 1.03))
    wait_until(lambda: settled(window) and window.view.frame.swing == -1)
    assert "Force" in window.pull.told.text()
    from time import process_time

    pipeline, asked = window.engine.pipeline, window.director._asked
    begun = process_time()
    for _ in range(10):
        pipeline._swing_warp.Modified()
        pipeline.run(asked)
    assert process_time() - begun < 10 / 20
    image = window.pull.map.grab().toImage()
    colours = {image.pixelColor(x, 100).name() for x in range(0, image.width(), 2)}
    assert len(colours) > 3


def test_a_scene_without_yarns_says_what_it_lacks(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.pull)
    wait_until(lambda: "[yarns]" in window.pull.hint.text())
    assert window.pull.map.map is None
    QTest.mouseClick(window.pull.map, Qt.MouseButton.LeftButton, pos=QPoint(90, 90))
    assert window.view.frame.swing is None
