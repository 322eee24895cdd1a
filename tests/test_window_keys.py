"""The view's keys, pressed as a person presses them: with the mouse over it and the keyboard in it.

Where xdotool is, the X server sends them; elsewhere Qt does.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import QEvent, QPoint, Qt  # noqa: E402
from PySide6.QtGui import QCursor, QGuiApplication, QKeyEvent, QKeySequence  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication  # noqa: E402

from spacemap_vtk.draw.camera import VIEW_ANGLE  # noqa: E402

Press = Callable[..., None]
#: Names of keys in X that differ from Qt's.
X_NAMES = {"+": "plus", "-": "minus"}


@pytest.fixture
def hand() -> Press:
    """Return a function that presses a key in the focused widget."""
    if shutil.which("xdotool") is not None and QGuiApplication.platformName() == "xcb":
        return lambda key: subprocess.run(["xdotool", "key", X_NAMES.get(key, key)], check=True)

    def press(key: str) -> None:
        pressed = QKeySequence(key)[0]
        QTest.keyClick(QApplication.focusWidget(), pressed.key(), pressed.keyboardModifiers())

    return press


@pytest.fixture
def view_of(open_scene: Any) -> Iterator[Callable[[], Any]]:
    """Open a window whose view has the focus, with the mouse over the cloth."""
    before = QCursor.pos()

    def open_() -> Any:
        window = open_scene()
        window.activateWindow()
        wait_until(window.isActiveWindow)
        window.view.canvas.setFocus()
        point(window, QPoint(0, 0))
        return window

    yield open_
    QCursor.setPos(before)


def point(window: Any, off: QPoint) -> None:
    """Move the mouse to a position relative to the centre of the view."""
    canvas = window.view.canvas
    at = canvas.mapToGlobal(canvas.rect().center() + off)
    QCursor.setPos(at)
    wait_until(lambda: QCursor.pos() == at)


def distance(window: Any) -> float:
    return float(window.view.canvas.camera.GetDistance())


def direction(window: Any) -> np.ndarray:
    return np.array(window.view.canvas.camera.GetDirectionOfProjection())


def image(window: Any) -> np.ndarray:
    return window.view.image().astype(int)


def test_arrow_keys_zoom_in_the_view_and_select_in_lists(view_of: Any, hand: Press) -> None:
    window = view_of()
    start = distance(window)
    hand("Up")
    wait_until(lambda: distance(window) == pytest.approx(start / 1.05))
    hand("Down")
    hand("Down")
    wait_until(lambda: distance(window) == pytest.approx(start * 1.05))
    window.tools.orthographic.trigger()
    scale = window.view.canvas.camera.GetParallelScale()
    hand("Up")
    wait_until(lambda: window.view.canvas.camera.GetParallelScale() == pytest.approx(scale / 1.05))
    window.stages.setFocus()
    item = window.stages.currentItem()
    hand("Down")
    wait_until(lambda: window.stages.currentItem() is not item)
    assert distance(window) == pytest.approx(start * 1.05)


def test_r_fits_the_view_and_1_looks_from_three_quarters(view_of: Any, hand: Press) -> None:
    window = view_of()
    fitted, at_first = image(window), direction(window)
    camera = window.view.canvas.camera
    camera.Azimuth(25.0)
    camera.Dolly(4.0)
    window.view.render()
    turned = direction(window)
    near = distance(window)
    hand("r")
    wait_until(lambda: distance(window) > 2 * near)
    np.testing.assert_allclose(direction(window), turned, atol=1e-9)
    # The view angle of saved pictures.
    assert camera.GetViewAngle() == VIEW_ANGLE
    # Everything is visible and fills the height or the width.
    edges = np.abs(np.diff(image(window), axis=1)).max(axis=2) > 30
    rows, columns = np.nonzero(edges.any(axis=1))[0], np.nonzero(edges.any(axis=0))[0]
    shares = [(lot[-1] - lot[0]) / n for lot, n in zip((rows, columns), edges.shape, strict=True)]
    assert 0.7 < max(shares) < 0.98
    hand("1")
    wait_until(lambda: np.allclose(direction(window), at_first))
    assert np.abs(image(window) - fitted).max() < 8
    hand("v")  # PyVista's key
    wait_until(lambda: np.allclose(direction(window), -1 / np.sqrt(3)))


@pytest.mark.nightly
def test_w_switches_the_wireframe(view_of: Any, hand: Press) -> None:
    window = view_of()
    before = image(window)
    # Near enough that the edges of the facets do not touch.
    camera = window.view.canvas.camera
    camera.Dolly(8.0)
    window.view.render()
    near = image(window)
    hand("w")
    wait_until(lambda: window.tools.keys.wireframe.isChecked())
    holes = np.abs(image(window) - near).max(axis=2) > 30
    assert holes.mean() > 0.3
    # Later frames show edges too.
    window.times.go_to(0.1)
    wait_until(lambda: settled(window) and window.view.frame.time == 0.1)
    assert window.view.scene_view.surface.GetProperty().GetRepresentationAsString() == "Wireframe"
    window.times.go_to(0.02)
    hand("w")
    wait_until(lambda: settled(window) and not window.tools.keys.wireframe.isChecked())
    hand("1")
    wait_until(lambda: np.abs(image(window) - before).max() < 8)


@pytest.mark.nightly
def test_plus_and_minus_change_the_line_width_of_the_scene(view_of: Any, hand: Press) -> None:
    window = view_of()
    document = window.document
    before, scene = image(window), document.text
    shown = window.view.scene_view
    line, dot = (actor.GetProperty() for actor in (shown.cage, shown.supports))
    widths = line.GetLineWidth(), dot.GetPointSize()
    for _ in range(4):
        hand("+")
    wait_until(lambda: document.value_in_file("view", "line_scale") == 2.44)
    # Later frames keep the width.
    window.times.go_to(0.01)
    wait_until(lambda: settled(window) and window.view.frame.time == 0.01)
    assert line.GetLineWidth() == pytest.approx(2.44 * widths[0])
    assert dot.GetPointSize() == pytest.approx(2.44 * widths[1])
    window.times.go_to(0.02)
    wait_until(lambda: settled(window) and window.view.frame.time == 0.02)
    assert (np.abs(image(window) - before).max(axis=2) > 60).mean() > 0.01
    hand("-")
    wait_until(lambda: document.value_in_file("view", "line_scale") == 1.95)
    document.history.undo()
    assert document.value_in_file("view", "line_scale") == 2.44
    for _ in range(4):
        hand("-")
    wait_until(lambda: document.value_in_file("view", "line_scale") is None)
    wait_until(lambda: settled(window))
    assert document.text == scene
    assert np.abs(image(window) - before).max() < 8
    # The smallest width, and no smaller.
    document.set("view", "line_scale", 0.1)
    hand("-")
    wait_until(lambda: "line_scale" in window.errors.text)
    assert document.value_in_file("view", "line_scale") == 0.1


def test_p_picks_and_shift_f_flies_to_the_point_under_the_mouse(view_of: Any, hand: Press) -> None:
    window = view_of()
    window.tools.cameras["front"].trigger()
    QTest.qWait(100)
    off = next(
        QPoint(x, 60)
        for x in range(0, 100, 10)
        if window.view.pick(
            window.view.canvas.width() // 2 + x, window.view.canvas.height() // 2 + 60
        )
    )
    point(window, off)
    hand("p")
    wait_until(lambda: window.view.picks)
    (picked,) = window.view.picks
    assert window.status_text.full_text == picked.text
    before, far, way = np.array(window.view.viewpoint.focus), distance(window), direction(window)
    assert np.linalg.norm(before - picked.position) > 1e-4
    hand("Shift+f")
    wait_until(lambda: distance(window) == pytest.approx(far / 1.3))
    np.testing.assert_allclose(window.view.viewpoint.focus, picked.position, atol=1e-12)
    np.testing.assert_allclose(direction(window), way, atol=1e-9)
    # Outside the cloth there is nothing to pick or to fly to.
    window.tools.cameras["front"].trigger()
    place = window.view.viewpoint
    point(window, QPoint(0, 5 - window.view.canvas.height() // 2))
    hand("p")
    hand("Shift+f")
    QTest.qWait(200)
    assert window.view.picks == [picked]
    assert window.view.viewpoint == place


@pytest.mark.nightly
def test_other_keys_do_not_change_the_view(view_of: Any) -> None:
    window = view_of()
    used_keys = {
        key[0].key()
        for action in [*window.menus.actions.values(), *window.tools.all_actions]
        for key in action.shortcuts()
    }
    before, props = image(window), window.view.canvas.renderer.GetViewProps().GetNumberOfItems()
    for code in (*range(Qt.Key.Key_A, Qt.Key.Key_Z + 1), Qt.Key.Key_Left, Qt.Key.Key_Eacute):
        if code not in used_keys:
            key = Qt.Key(code)
            QTest.keyClick(window.view.canvas, key)
            text = QKeySequence(key).toString()
            # As VTK's interactor styles receive them: with their letter.
            for kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
                QApplication.sendEvent(
                    window.view.canvas,
                    QKeyEvent(kind, code, Qt.KeyboardModifier.NoModifier, text.lower()),
                )
    QTest.qWait(100)
    assert window.isVisible()
    assert window.view.canvas.renderer.GetViewProps().GetNumberOfItems() == props
    assert np.abs(image(window) - before).max() < 8


def test_help_lists_every_key_of_the_view(open_scene: Any) -> None:
    window = open_scene()
    groups = window.help.key_groups
    keys = {key: topic for topic, lines in groups.items() for key, _ in lines}
    for key in ("R", "Shift+F", "Up", "Down", "W", "+", "-", "P", "V", "Ctrl+2", "T", "H", "X"):
        assert key in keys
    assert keys["V"] == keys["R"] == "Camera"
    assert keys["Ctrl+Z"] == "Edit"
    assert keys["Wheel"] == "Mouse in the view"
    # Keys that few keyboards have are left out.
    assert ("Ctrl+C", "Copy") in groups["Draft"]
