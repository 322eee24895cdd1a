"""The ruler of the view."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import QPointF, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402


def click(window: Any, x: float, y: float) -> QPointF:
    """Click the first point of the fabric to the right of a position; return where."""
    canvas = window.view.canvas
    for step in range(60):
        at = QPointF(round(x * canvas.width()) + step, round(y * canvas.height()))
        if window.view.pick(at.x(), at.y()) is not None:
            QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=at.toPoint())
            return at
    raise AssertionError("no fabric there")


def test_ruler_measures_distances_and_angles_on_the_moving_cloth(open_scene: Any) -> None:
    window = open_scene()
    view, keys = window.view, window.tools.keys
    window.tools.cameras["front"].trigger()
    window.tools.orthographic.trigger()
    keys.ruler.trigger()
    assert "Click two points" in window.status_text.full_text
    at = [click(window, x, y) for x, y in ((0.3, 0.35), (0.6, 0.35), (0.6, 0.65))]
    ruler = view.ruler
    # In parallel projection, pixels measure lengths in the plane of the view.
    scale = 2.0 * view.canvas.camera.GetParallelScale() / view.canvas.height()
    pixels = np.array([[p.x(), p.y()] for p in at])
    across = np.linalg.norm(np.diff(pixels, axis=0), axis=1) * scale
    depth = np.diff(ruler.points[:, 2])
    assert ruler.lengths == pytest.approx(np.hypot(across, depth).tolist(), rel=0.06)
    assert ruler.angle == pytest.approx(90.0, abs=12.0)
    texts = [text for _, text in view.scene_view.annotations.labels]
    assert texts == [*(f"{1e3 * length:.4g} mm" for length in ruler.lengths), f"{ruler.angle:.1f}°"]
    assert f"{ruler.angle:.1f}°" in window.status_text.full_text
    assert view.picks == []  # nothing is plotted
    # The points stay on the cloth as it moves.
    before = ruler.points.copy()
    window.times.go_to(0.08)
    wait_until(lambda: settled(window) and view.frame.time == 0.08)
    assert np.abs(ruler.points - before).max() > 1e-5
    for point, pick in zip(ruler.points, ruler.picks, strict=True):
        assert np.linalg.norm(point - np.array(pick.label(view.frame, None)[0])) == 0.0
    # The fourth click begins again, Escape removes the points, and the ruler switches off.
    click(window, 0.4, 0.5)
    assert len(ruler.picks) == 1
    keys.appearance_actions[-1].trigger()
    assert ruler.picks == []
    assert not view.marks.GetVisibility()
    keys.ruler.trigger()
    assert "facets" in window.status_text.full_text
    click(window, 0.4, 0.5)
    assert len(view.picks) == 1
    view.clear_picks()
    window.tools.orthographic.trigger()
