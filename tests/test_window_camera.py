"""The camera of the view: presets, clicks on axes, turntable and background."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from window import WIDE, require_display, settled, turn_wheel, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

from spacemap_vtk.draw.actors.surface_actor import color_bar_share  # noqa: E402
from spacemap_vtk.draw.camera import project_points  # noqa: E402
from spacemap_vtk.draw.scene_view import extent_of  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.cameras import CAMERAS  # noqa: E402


def image(window: Any) -> np.ndarray:
    return window.view.image().astype(int)


def test_every_camera_preset_gives_another_picture(open_scene: Any) -> None:
    window = open_scene()
    pictures = []
    assert {*CAMERAS} - {"side"} == {*window.tools.cameras}  # "side" is another name of "right"
    for name in window.tools.cameras:
        window.tools.cameras[name].trigger()
        pictures.append(image(window))
        assert pictures[-1].std() > 20
    assert all(np.abs(a - b).max() > 60 for a, b in pairwise(pictures))
    window.tools.orthographic.trigger()
    assert np.abs(image(window) - pictures[-1]).max() > 60


@pytest.mark.nightly
def test_face_camera_has_no_perspective(open_scene: Any) -> None:
    window = open_scene(str(library.folder() / "drafts" / "twill_2_2.wif"))
    camera, parallel = window.view.canvas.camera, window.tools.orthographic
    assert camera.GetParallelProjection()
    assert parallel.isChecked()
    seen = image(window)[:-150]  # above the axes
    assert (seen.std(axis=2) > 15).mean() > 0.4  # the cloth fills part of the width
    window.tools.cameras["front"].trigger()
    assert not camera.GetParallelProjection()
    assert not parallel.isChecked()
    window.tools.cameras["face"].trigger()
    assert parallel.isChecked()
    parallel.trigger()
    assert not camera.GetParallelProjection()


def test_background_follows_the_theme_unless_the_scene_sets_it(open_scene: Any) -> None:
    window = open_scene()
    document, dark = window.document, window.menus.dark
    dark.trigger()
    assert image(window)[[0, -1], 0].max() < 90
    document.set("view", "background", "#ffffff")
    assert image(window)[-1, 0].min() > 250
    document.set("view", "background", None)
    assert image(window)[-1, 0].max() < 90
    dark.trigger()
    assert image(window)[[0, -1], 0].min() > 200


def test_click_on_an_axis_looks_along_it(open_scene: Any) -> None:
    window = open_scene()
    widget, camera = window.view.canvas, window.view.canvas.camera
    signs = window.view.scene_view.annotations
    for way, axis in ((0, 0), (1, 1), (0, 2), (0, 2)):
        window.view.image()
        before = np.array(camera.GetDirectionOfProjection())
        x, y, _ = signs.ends[way, axis] / widget.devicePixelRatioF()
        at = QPoint(round(x), round(widget.height() - y))
        QTest.mouseClick(widget, Qt.MouseButton.LeftButton, pos=at)
        wanted = -np.eye(3)[axis] * (1, -1)[way]
        # A click on the axis that points at the viewer shows the far side.
        wanted = -wanted if np.allclose(before, wanted) else wanted
        np.testing.assert_allclose(camera.GetDirectionOfProjection(), wanted, atol=1e-9)
    # The axes belong to the window; the scene's pictures do not change.
    shown = image(window)
    window.tools.part_actions["triad"].trigger()
    assert np.abs(image(window) - shown).max() > 60
    assert not window.document.scene.view.triad
    window.tools.part_actions["triad"].trigger()


@pytest.mark.nightly
def test_turntable_keeps_the_up_axis(open_scene: Any) -> None:
    window = open_scene()
    window.resize(*WIDE)
    widget, camera = window.view.canvas, window.view.canvas.camera
    # From the side and from above, each drag would roll a trackball.
    for name in ("right", "top"):
        for on in (False, True):
            window.tools.cameras[name].trigger()
            window.tools.turntable.setChecked(on)
            at = QPoint(300, 300)
            QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=at)
            for step in [QPoint(25, 25), QPoint(25, -20)] * 8:
                at += step
                QTest.mouseMove(widget, at)
            QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=at)
            QTest.qWait(20)
            seen = camera.GetModelViewTransformMatrix()  # its first row points to the right
            assert (abs(seen.GetElement(0, 1)) < 1e-9) == on
            assert not on or seen.GetElement(1, 1) > 0.0
            assert abs(seen.GetElement(0, 0)) < 0.99
    window.tools.turntable.setChecked(False)


@pytest.mark.nightly
def test_resizing_keeps_the_scene_in_view_until_the_camera_is_moved(open_scene: Any) -> None:
    window = open_scene()

    def clear(share: float) -> bool:
        """Return whether a column of the picture shows only the smooth background."""
        picture = image(window)
        column = picture[:, min(picture.shape[1] - 1, round(share * picture.shape[1]))]
        return bool(np.abs(np.diff(column, axis=0)).max() < 8)

    window.resize(1000, 760)
    wait_until(lambda: settled(window))
    assert clear(0.0)
    assert clear(1.0)
    window.tools.coloring.setCurrentIndex(window.tools.coloring.findData("displacement"))
    wait_until(lambda: settled(window))
    size = window.view.view_size
    assert clear(0.0)
    assert clear(1.0 - color_bar_share(size) - 2 / size[0])
    camera = window.view.canvas.renderer.GetActiveCamera()
    camera.Azimuth(10.0)
    before = camera.GetPosition()
    window.resize(1300, 760)
    wait_until(lambda: settled(window))
    assert camera.GetPosition() == before


def test_camera_follows_the_size_of_the_cloth_until_the_user_zooms(open_scene: Any) -> None:
    window = open_scene()
    camera, document = window.view.canvas.camera, window.document

    def is_in_picture() -> bool:
        points = extent_of(window.view.frame, loads=False)
        aspect = window.view.canvas.width() / window.view.canvas.height()
        clip = project_points(camera, points, aspect)
        return bool((np.abs(clip[:, :2]) <= clip[:, 3:]).all())

    before = camera.GetDistance()
    for ends in (8, 10, 12):  # each step is small
        document.set("weave", "ends", ends)
        wait_until(lambda: settled(window))
        assert is_in_picture()
    assert camera.GetDistance() > 1.3 * before
    camera.Azimuth(20.0)  # a turned camera keeps its direction
    turned = camera.GetDirectionOfProjection()
    document.set("weave", "ends", 24)
    wait_until(lambda: settled(window))
    assert is_in_picture()
    np.testing.assert_allclose(camera.GetDirectionOfProjection(), turned, atol=1e-9)
    turn_wheel(window.view.canvas, 120)
    placed = camera.GetPosition()
    document.set("weave", "ends", 36)
    wait_until(lambda: settled(window))
    assert camera.GetPosition() == placed
