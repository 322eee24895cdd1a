"""Cloth with many yarns: drawn as a sheet, with separate yarns near the camera."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, scene_of, settled, wait_until

require_display()

from spacemap_vtk.app.work import pipeline  # noqa: E402
from spacemap_vtk.app.work.frame_request import FrameRequest, Pull, Swing  # noqa: E402
from spacemap_vtk.datasets.arrays import points_of  # noqa: E402
from spacemap_vtk.draw.camera import CameraView, Viewpoint, project_points  # noqa: E402
from spacemap_vtk.draw.detail import yarn_parts  # noqa: E402
from spacemap_vtk.draw.frame import Frame  # noqa: E402
from spacemap_vtk.scenes import level_of_detail  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

SCENE = """
[weave]
ends = {yarns}
picks = {yarns}
warp_color = "#c03a2b"
weft_color = "#f0e6d2"
[cage]
divisions = [6, 6, 1]
[modal]
elements = "sheet"
modes = 6
[response]
gravity = [0, 0, "0.2 g"]
"""


@pytest.fixture
def opened(open_window: Any, tmp_path: Path) -> Any:
    def show(yarns: int) -> Any:
        file = tmp_path / "many.toml"
        file.write_text(SCENE.format(yarns=yarns))
        return open_window(str(file))

    return show


@pytest.mark.nightly
def test_cloth_with_three_hundred_yarns_follows_the_time(opened: Any) -> None:
    window = opened(300)
    frame = window.view.frame
    assert frame.cloth is not None
    assert not frame.coarse
    wait_until(lambda: any("a sheet in their" in text for text in window.view.frame.warnings))
    image = window.view.image()
    assert np.ptp(image[image.shape[0] // 2].astype(int), axis=0).max() > 60
    window.times.go_to(0.1)
    wait_until(lambda: settled(window) and abs(window.view.frame.time - 0.1) < 1e-9)
    assert np.ptp(np.array(window.view.frame.surface.GetBounds())[4:]) > 1e-3
    assert scene_of(window).warp.executions == 0


def at_rest(window: Any) -> bool:
    return settled(window) and not window.view.steering


def test_near_yarns_are_built_in_view(opened: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_of_detail, "WINDOW_PATCHES", 100)
    monkeypatch.setattr(level_of_detail, "NEAR_PATCHES", 12_000)
    window = opened(60)
    view = window.view
    wait_until(lambda: at_rest(window))
    # All yarns would be many more cells: the sheet is not replaced by yarns.
    assert view.frame.cloth is not None
    assert view.frame.yarns is None
    assert any("zoom in" in text for text in view.frame.warnings)
    runs = scene_of(window).modal.executions
    view.reset_camera("front")
    x, y = view.canvas.width() / 2, view.canvas.height() / 2
    afar = view.pick(x, y)
    view.zoom(8.0)
    assert view.steering
    wait_until(lambda: at_rest(window) and view.frame.yarns is not None)
    assert not any("zoom in" in text for text in view.frame.warnings)
    assert scene_of(window).modal.executions == runs
    assert scene_of(window).warp.executions == 0
    # Yarns replace the sheet in the same colours and can be picked.
    fine = view.image()
    found = next(pick for d in range(0, 30, 3) if (pick := view.pick(x + d, y)) is not None)
    assert 25 < (found.number or 0) < 36
    assert found.yarn == (found.number or 0) - 1 + 60 * (found.family or 0)
    # The sheet has the same crossing there.
    ends_and_picks = [(p.number, p.crossed)[:: 1 - 2 * p.family] for p in (afar, found)]
    assert np.abs(np.diff(ends_and_picks, axis=0)).max() <= 1
    over = scene_of(window).woven.cloth.drawdown[tuple(np.subtract(ends_and_picks[0][::-1], 1))]
    assert afar.family == 1 - over
    view.steer(True)
    coarse = view.image()
    assert np.abs(fine.mean(axis=(0, 1)) - coarse.mean(axis=(0, 1))).max() < 12
    # After the camera was turned, another part is built.
    part = window.engine.pipeline._near_yarns.part
    view.canvas.camera.Azimuth(2.0)
    view.steer(False)
    wait_until(lambda: at_rest(window) and view.frame.camera_view == view.camera_view)
    assert view.frame.yarns is not None
    view.zoom(0.125)
    wait_until(lambda: at_rest(window) and view.frame.yarns is None)
    assert part is not None


@pytest.mark.parametrize(
    ("swing", "coarse"),
    [(None, True), (Swing(1, 0.1, 0.25), False), (Pull(1.02, 0.97), False)],
)
def test_near_yarns_move_like_the_whole_cloth(
    swing: Swing | Pull | None, coarse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = {"weave": {"ends": 9, "picks": 9}, "cage": {}, "response": {"gravity": [0, 0, 9.8]}}
    scene = Scene({**values, "view": {"color": "velocity"}, "yarns": {}})
    settings = {name: part.settings for name, part in scene.parts.items()}
    seen = CameraView(
        Viewpoint((0.0, 0.0, 0.03), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 0.0, (300, 300)
    )
    given = {**values, "view": {"color": "velocity"}, "yarns": {}}
    job = FrameRequest(
        given, Path(), settings, 1, 0.02, coarse=coarse, swing=swing, camera_view=seen
    )

    def draw_frame(few: int) -> Frame:
        monkeypatch.setattr(level_of_detail, "WINDOW_PATCHES", few)
        nothing: Any = lambda *_: None  # noqa: E731
        return pipeline.Pipeline(nothing, nothing).run(job)

    whole, frame = draw_frame(10**6), draw_frame(100)
    assert whole.cloth is None
    assert frame.cloth is not None
    assert frame.yarns is not None
    bounds = whole.surface.GetBounds()
    np.testing.assert_allclose(frame.yarns.GetBounds(), bounds, atol=2e-5)
    assert bool(frame.yarns.GetPointData().HasArray("velocity")) is (swing is None)


@pytest.mark.nightly
def test_run_for_the_view_is_cancelled_when_the_camera_moves(
    opened: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(level_of_detail, "WINDOW_PATCHES", 100)
    window = opened(24)
    view, director = window.view, window.director
    wait_until(lambda: at_rest(window) and view.frame.yarns is not None)
    frame, going, wait = view.frame, threading.Event(), threading.Event()

    def slow(*_: Any) -> str:
        going.set()
        wait.wait(20.0)
        return ""

    monkeypatch.setattr(yarn_parts.NearYarns, "follow_view", slow)
    view.zoom(1.5)
    wait_until(going.is_set)
    assert director._follows_camera
    view.steer(True)
    wait.set()
    wait_until(lambda: settled(window))
    assert view.frame is frame
    assert window.errors.text == ""
    assert "stale" not in window.stages.states.values()
    monkeypatch.undo()
    view.steer(False)
    wait_until(lambda: at_rest(window) and view.frame is not frame)


@pytest.mark.nightly
def test_fewer_facets_are_drawn_while_the_camera_moves(
    open_window: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "_HEAVY_QUADS", 1000)
    window = open_window("twill_2_2")
    view = window.view
    assert view.frame.preview is not None
    wait_until(lambda: not view.steering)
    actors = view.scene_view.surface, view.scene_view.preview
    assert [actor.GetVisibility() for actor in actors] == [1, 0]
    view.steer(True)
    assert [actor.GetVisibility() for actor in actors] == [0, 1]
    cells = [actor.GetMapper().GetInput().GetNumberOfCells() for actor in actors]
    assert 0 < cells[1] < cells[0] / 2
    view.steer(False)
    wait_until(lambda: not view.steering)
    assert [actor.GetVisibility() for actor in actors] == [1, 0]


@pytest.mark.nightly
@pytest.mark.parametrize("way_back", ["untick", pytest.param("undo", marks=pytest.mark.nightly)])
def test_sheet_returns_to_rest_when_its_motion_is_removed(
    way_back: str, open_window: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(level_of_detail, "WINDOW_PATCHES", 100)
    file = tmp_path / "still.toml"
    file.write_text("[weave]\nends = 24\npicks = 24\n")
    window = open_window(str(file))
    view, document = window.view, window.document
    flat = view.frame.surface.GetBounds()

    document.switch("modal", True)
    document.set_many("modal", {"youngs_modulus": "1 kPa", "gravity": [0, 0, 0]})
    document.set("response", "gravity", [0, 0, -9.8])
    window.times.go_to(0.3)
    wait_until(lambda: settled(window) and view.frame.time == 0.3)
    moved = view.frame.surface.GetBounds()
    depth = moved[5] - moved[4]
    assert depth > 2 * (flat[1] - flat[0])  # it has fallen a long way
    # Zoom in on the lower end so that the flat sheet would be out of view.
    view.canvas.camera.SetFocalPoint(0.0, 0.0, moved[4])
    view.canvas.camera.SetPosition(0.5 * depth, 0.0, moved[4])

    if way_back == "untick":
        document.switch("modal", False)
    else:
        document.history.setIndex(0)
    wait_until(lambda: settled(window) and view.frame.cage is None)
    assert view.frame.surface.GetBounds() == flat
    # The view is not left empty.
    x, y, _, w = project_points(
        view.canvas.camera, points_of(view.frame.surface), view.width() / view.height()
    ).T
    assert (abs(x) <= w).all()
    assert (abs(y) <= w).all()
