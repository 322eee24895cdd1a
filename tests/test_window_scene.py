"""Around the fabric: loads, clip plane, background, picked points, colour scale."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from window import require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

from spacemap_vtk.app.view.view_bar import BACKGROUNDS  # noqa: E402
from spacemap_vtk.datasets.arrays import points_of  # noqa: E402
from spacemap_vtk.draw import frame  # noqa: E402
from spacemap_vtk.draw.actors.load_arrows import load_arrows  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402
from spacemap_vtk.scenes.styles import STYLES  # noqa: E402


def arrows_of(loads: list[dict[str, Any]], time: float, gravity: Any = (0, 0, 0)) -> Any:
    values = {
        "weave": {"ends": 3, "picks": 3},
        "cage": {"divisions": [2, 2, 1]},
        "response": {"gravity": list(gravity), "loads": loads},
    }
    scene = Scene(values)
    scene.update(time)
    return load_arrows(scene.response, scene.deformed_cage, time), scene


def test_gravity_arrow_points_down_below_the_cage() -> None:
    arrows, scene = arrows_of([], 0.0, (0.0, -9.8, 0.0))
    assert arrows.kinds == ("gravity",)
    way = arrows.vectors[0] / np.linalg.norm(arrows.vectors[0])
    np.testing.assert_allclose(way, [0, -1, 0], atol=1e-12)
    assert abs(arrows.starts[0, 1] - points_of(scene.deformed_cage)[:, 1].min()) < 1e-9


def test_pressure_arrows_end_at_their_side_and_scale_with_the_factor() -> None:
    load = {"pressure": 1.0, "on": "+z", "time": "table", "times": [0, 1], "values": [0.5, 1.0]}
    lengths = []
    for time in (0.0, 1.0):
        arrows, scene = arrows_of([load], time)
        assert set(arrows.kinds) == {"pressure"}
        assert len(arrows.starts) == 8  # two triangles on each of the four hexahedra
        np.testing.assert_allclose(arrows.vectors[:, :2], 0.0, atol=1e-15)
        assert (arrows.vectors[:, 2] < 0).all()
        tips = arrows.starts + arrows.vectors
        cage = scene.deformed_cage
        from vtkmodules.util.numpy_support import vtk_to_numpy

        moved = points_of(cage) + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
        side = moved[np.isclose(points_of(cage)[:, 2], points_of(cage)[:, 2].max())]
        assert (
            side[:, 2].min() - 1e-9
            <= tips[:, 2].min()
            <= tips[:, 2].max()
            <= (side[:, 2].max() + 1e-9)
        )
        lengths.append(np.linalg.norm(arrows.vectors, axis=1).max())
    assert abs(lengths[0] / lengths[1] - 0.5) < 1e-9


def test_arrows_of_suction_force_and_ended_loads() -> None:
    pull, _ = arrows_of([{"pressure": -1.0, "on": "-z"}], 0.1)
    assert (pull.vectors[:, 2] < 0).all()
    force = {"force": [0.0, 0.0, 2e-6], "at": [1.0, -1.0, 1.0]}
    arrows, scene = arrows_of([force], 0.0)
    tip = (arrows.starts + arrows.vectors)[0]
    corner = points_of(scene.deformed_cage)
    nearest = corner[np.linalg.norm(corner - [1.0, -1.0, 1.0], axis=1).argmin()]
    np.testing.assert_allclose(tip, nearest, atol=1e-9)
    gone, _ = arrows_of([{**force, "time": "pulse", "length": 0.1}], 0.2)
    assert len(gone.starts) == 0


def test_dead_loads_are_drawn_in_the_equilibrium() -> None:
    pull = {"traction": [0.0, -2.0, 0.0], "on": "-y"}
    values = {
        "weave": {"ends": 3, "picks": 6},
        "cage": {"divisions": [1, 4, 1]},
        "modal": {"elements": "sheet", "fixed": "+y", "dead_loads": [pull]},
        "response": {"gravity": [0, 0, 0]},
        "view": {"loads": True},
    }
    scene = Scene(values)
    for time in (-1.0, 0.0, 5.0):
        scene.update(time)
        arrows = frame.arrows_of(scene, time)
        assert arrows is not None
        assert set(arrows.kinds) == {"traction"}
        np.testing.assert_allclose(arrows.vectors[:, [0, 2]], 0.0, atol=1e-15)
        assert (arrows.vectors[:, 1] < 0).all()
        # The arrows start at the deformed side.
        data = scene.deformed_cage.GetPointData()
        hung = points_of(scene.deformed_cage) + vtk_to_numpy(data.GetArray("equilibrium"))
        np.testing.assert_allclose(arrows.starts[:, 1], hung[:, 1].min(), rtol=1e-3)
    scene.set("modal.hang=false")
    scene.update(0.0)
    arrows = frame.arrows_of(scene, 0.0)
    assert arrows is not None
    assert arrows.kinds == ()


def test_load_arrows_follow_the_time(open_scene: Any) -> None:
    window = open_scene("gust")
    window.tools.part_actions["loads"].trigger()
    without = window.view.image().astype(int)
    window.tools.part_actions["loads"].trigger()
    assert np.abs(window.view.image().astype(int) - without).max() > 60
    assert {"gravity", "pressure", "traction"} == set(window.view.frame.arrows.kinds)
    type_into(window.times.line, "0.5")
    wait_until(lambda: settled(window) and window.view.frame.time == 0.5)
    assert "pressure" not in window.view.frame.arrows.kinds


def test_clip_plane_cuts_moves_and_is_remembered(open_scene: Any) -> None:
    window = open_scene()
    window.tools.cameras["front"].trigger()
    uncut = window.view.image().astype(int)
    window.tools.clip.trigger()
    half = window.view.image().astype(int)
    width = half.shape[1]

    def colored(image: np.ndarray) -> np.ndarray:
        # Yarns are blue or sand-coloured; the tint of the plane is faint.
        return (np.ptp(image, axis=2) > 70).sum(axis=0)

    right = slice(int(width * 0.56), int(width * 0.75))
    assert colored(uncut)[right].sum() > 2000
    assert colored(half)[right].sum() < 0.15 * colored(uncut)[right].sum()
    # The mouse moves the plane.
    window.tools.cameras["three-quarter"].trigger()
    QTest.qWait(100)
    origin = np.array(window.view.scene_view.cut[1])
    widget, at = window.view.canvas, None
    middle = QPoint(widget.width() // 2, widget.height() // 2)
    for step in range(-30, 40, 10):
        at = middle + QPoint(step, 60)
        QTest.mouseMove(widget, at)
        QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=at)
        for k in range(8):
            QTest.mouseMove(widget, at + QPoint(10 * k, 0))
            QTest.qWait(5)
        QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=at + QPoint(70, 0))
        if np.linalg.norm(np.array(window.view.scene_view.cut[1]) - origin) > 1e-5:
            break
    moved = np.array(window.view.scene_view.cut[1])
    assert np.linalg.norm(moved - origin) > 1e-5
    # The scene stores the plane as one change, which can be undone.
    wait_until(lambda: window.document.scene.view.clip_origin is not None)
    np.testing.assert_allclose(window.document.scene.view.clip_origin, moved, rtol=1e-4, atol=1e-9)
    window.document.history.undo()
    np.testing.assert_allclose(window.view.scene_view.cut[1], origin, atol=1e-9)
    window.document.history.redo()
    np.testing.assert_allclose(window.view.scene_view.cut[1], moved, rtol=1e-4, atol=1e-9)
    # Without the cut, and then cut at the same place.
    window.tools.clip.trigger()
    assert window.view.scene_view.cut is None
    window.tools.clip.trigger()
    np.testing.assert_allclose(window.view.scene_view.cut[1], moved, rtol=1e-4, atol=1e-9)
    window.tools.clip_sides[0].trigger()
    np.testing.assert_allclose(window.view.scene_view.cut[1], origin, atol=1e-4)
    window.tools.clip_sides[2].trigger()
    np.testing.assert_allclose(np.abs(window.view.scene_view.cut[0]), [0, 0, 1])
    window.tools.clip.trigger()
    window.tools.cameras["front"].trigger()
    assert np.abs(window.view.image().astype(int) - uncut).mean() < 1.0


@pytest.mark.nightly
def test_new_scene_is_not_clipped(open_scene: Any) -> None:
    window = open_scene()
    window.tools.clip.trigger()
    assert window.view.scene_view.cut is not None
    window.document.open("twill_2_2")
    wait_until(lambda: settled(window))
    assert window.view.scene_view.cut is None
    assert not window.tools.clip.isChecked()


def test_background_is_one_undo_step(open_scene: Any) -> None:
    window = open_scene()
    before = window.document.text
    for name, (bottom, *_) in BACKGROUNDS.items():
        window.tools.backgrounds[name].trigger()
        wait_until(lambda: settled(window))
        corner = window.view.image()[-4, 4].astype(int)
        color = list(bytes.fromhex((bottom or "#ffffff")[1:]))
        assert np.abs(corner - color).max() < 8, name
        if name != "Automatic":
            assert window.document.history.count() == 1
            window.document.history.undo()
        assert window.document.text == before, name


def test_style_can_be_chosen_and_undone(open_scene: Any) -> None:
    window = open_scene()
    before = window.document.text
    window.tools.styles["blueprint"].trigger()
    wait_until(lambda: settled(window))
    corner = window.view.image()[-4, 4].astype(int)
    assert np.abs(corner - STYLES["blueprint"].bottom_color).max() < 3
    assert 'style = "blueprint"' in window.document.text
    window.document.history.undo()
    assert window.document.text == before
    assert window.tools.styles["studio"].isChecked()


def test_picked_points_are_listed_and_move_with_the_cloth(open_scene: Any) -> None:
    window = open_scene()
    window.tools.cameras["front"].trigger()
    type_into(window.times.line, "0")
    wait_until(lambda: settled(window) and window.view.frame.time == 0.0)
    lists: list[list[Any]] = []
    window.view.picks_changed.connect(lists.append)
    widget = window.view.canvas
    middle = QPoint(widget.width() // 2, widget.height() // 2)
    left, shift = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier
    for k, modifier in ((0, Qt.KeyboardModifier.NoModifier), (1, shift), (2, shift)):
        QTest.mouseClick(widget, left, modifier, middle + QPoint(0, 90 * (k - 1)))
    assert [len(picks) for picks in lists] == list(range(1, len(lists) + 1))
    assert len(lists) >= 2
    assert window.view.picks == lists[-1]
    bounds_before = np.array(window.view.marks.GetMapper().GetInput().GetBounds())
    type_into(window.times.line, "20 ms")
    wait_until(lambda: settled(window) and window.view.frame.time == 0.02)
    moved = np.array(window.view.marks.GetMapper().GetInput().GetBounds())
    assert np.abs(moved - bounds_before).max() > 1e-4
    # A click without Shift starts a new list, and another scene clears it.
    QTest.mouseClick(widget, left, Qt.KeyboardModifier.NoModifier, middle)
    assert len(window.view.picks) <= 1 or len(lists[-1]) == 1
    window.document.open("twill_2_2")
    wait_until(lambda: settled(window))
    assert window.view.picks == []
    assert lists[-1] == []


@pytest.mark.nightly
def test_point_of_an_object_can_be_picked(open_scene: Any) -> None:
    window = open_scene("animal_in_carved_cage")
    widget = window.view.canvas
    QTest.mouseClick(
        widget, Qt.MouseButton.LeftButton, pos=QPoint(widget.width() // 2, widget.height() // 2)
    )
    assert window.view.picks
    assert window.view.picks[0].yarn is None
    assert "moved by" in window.status_text.full_text


@pytest.mark.nightly
def test_colour_scale_never_shrinks_while_playing(open_scene: Any) -> None:
    window = open_scene()
    # Without the frame at 20 ms, which would widen the scale from the start.
    type_into(window.times.line, "0")
    wait_until(lambda: settled(window) and window.view.frame.time == 0.0)
    window.document.set("view", "color", "displacement")
    tops = []
    for text, time in (("0", 0.0), ("20 ms", 0.02), ("5 ms", 0.005)):
        type_into(window.times.line, text)
        wait_until(
            lambda time=time: (
                settled(window)
                and window.view.frame.time == time
                and window.view.frame.color == "displacement"
            )
        )
        tops.append(window.view.scene_view.span[1][1])
    assert tops[0] < tops[1] == tops[2]
    window.document.set("modal", "youngs_modulus", "20 kPa")
    wait_until(lambda: settled(window))
    assert window.view.scene_view.span[1][1] < tops[2]
