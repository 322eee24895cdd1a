"""One renderer shows frames: whatever it has shown before leaves nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from spacemap_vtk.datasets.arrays import add_array, elements_of, points_of
from spacemap_vtk.draw.actors.glyphs import CageActor, cut_of, moved_points
from spacemap_vtk.draw.actors.surface_actor import Span
from spacemap_vtk.draw.camera import aim_camera
from spacemap_vtk.draw.frame import Frame, frame_of
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.offscreen import OffscreenWindow
from spacemap_vtk.draw.scene_view import SceneView, ViewOptions, extent_of
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.scenes.scene import Scene

# Most tests need the same modes.
pytestmark = pytest.mark.usefixtures("kept_modes")

VALUES: dict[str, Any] = {
    "weave": {"ends": 3, "picks": 3},
    "cage": {"divisions": [2, 2, 1]},
    "modal": {"youngs_modulus": "100 Pa"},
    "response": {"gravity": [0.0, -3.0, 3.0]},
    "surface": {"subdivisions": 2},
}
SIZE = (200, 150)


class Shown:
    """A view of a scene in a window that nobody sees."""

    def __init__(self, scene: Scene) -> None:
        self.window = OffscreenWindow(SIZE, samples=4)
        self.view = SceneView(self.window.renderer, has_shadows=True)
        self.scene = scene
        aim_camera(
            self.window.camera, moved_points(scene.deformed_cage), 4 / 3, "three-quarter", 1.0
        )

    def image(
        self, frame: Frame, look: ViewOptions, span: Span | None = None, **view: Any
    ) -> np.ndarray:
        self.scene.view.configure(**view)
        self.view.fit(self.scene.view, SIZE, 1.0, 1.0)
        cut = cut_of(self.scene.view, frame.surface)
        self.view.show(frame, self.scene.view, look, span, cut)
        return self.window.draw().astype(int)


@contextmanager
def open_view() -> Iterator[Shown]:
    """Not a fixture, which would keep the scene's stages beyond the test."""
    prepare_offscreen()
    scene = Scene(VALUES)
    scene.update(0.02)
    shown = Shown(scene)
    yield shown
    shown.window.close()


PLAIN = {"ghost": False, "loads": False, "supports": False, "clip_normal": None}
BUSY = {"ghost": True, "loads": True, "supports": True, "clip_normal": (1.0, 0.0, 0.0)}


def test_an_earlier_frame_leaves_no_traces() -> None:
    with open_view() as shown:
        scene = shown.scene
        plain = frame_of(scene, 0.02)
        before = shown.image(plain, ViewOptions(cage=False), **PLAIN)
        count = shown.window.renderer.GetViewProps().GetNumberOfItems()
        scene.set("view.color=displacement")
        scene.update(0.05)
        busy = frame_of(scene, 0.05)
        look = ViewOptions(wireframe=True)
        assert np.abs(shown.image(busy, look, (0.0, 1e-3), **BUSY) - before).max() > 60
        assert shown.view.scale_width > 0.0
        np.testing.assert_array_equal(shown.image(plain, ViewOptions(cage=False), **PLAIN), before)
        assert shown.view.scale_width == 0.0
        # Brought up to date in place: no actor has come.
        assert shown.window.renderer.GetViewProps().GetNumberOfItems() == count


@pytest.mark.parametrize("name", ["ghost", "loads", "supports", "clip_normal"])
def test_each_option_changes_the_picture(name: str) -> None:
    with open_view() as shown:
        frame = frame_of(shown.scene, 0.02)
        images = [
            shown.image(frame, ViewOptions(), **{**PLAIN, name: on[name]}) for on in (PLAIN, BUSY)
        ]
        assert np.abs(images[1] - images[0]).max() > 20


def test_the_clipping_plane_moves_without_a_new_frame() -> None:
    with open_view() as shown:
        frame = frame_of(shown.scene, 0.02)
        for origin in ((0.0, 0.0, 0.0), (4e-4, 0.0, 0.0)):
            whole = shown.image(
                frame, ViewOptions(), clip_normal=(1.0, 0.0, 0.0), clip_origin=origin
            )
        shown.image(frame, ViewOptions(), clip_normal=(0.0, 1.0, 0.0))
        shown.view.apply_cut(((1.0, 0.0, 0.0), (4e-4, 0.0, 0.0)))
        np.testing.assert_array_equal(shown.window.draw(), whole)


def test_back_faces_are_hidden_only_for_closed_yarns() -> None:
    with open_view() as shown:
        frame = frame_of(shown.scene, 0.02)
        assert frame.closed
        view = SceneView(shown.window.renderer, has_shadows=False)
        for closed in (True, False):
            view.show(replace(frame, closed=closed), shown.scene.view, ViewOptions())
            assert view.surface.GetProperty().GetBackfaceCulling() == closed


@pytest.mark.parametrize("order", [1, 2])
def test_each_cage_edge_is_drawn_once_and_quadratic_edges_are_bent(order: int) -> None:
    scene = Scene({**VALUES, "cage": {"divisions": [2, 1, 1], "order": order}})
    scene.update(0.02)
    cage, actor = scene.deformed_cage, CageActor()
    actor.show(cage)
    lines = actor.GetMapper().GetInput()
    corners = elements_of(cage)[:, :4]
    edges = {tuple(sorted(c)) for t in corners for c in zip(t, np.roll(t, 1), strict=True)}
    edges |= {tuple(sorted(t[[k, k + 2]])) for t in corners for k in (0, 1)}
    assert lines.GetNumberOfLines() == order * len(edges)
    np.testing.assert_allclose(points_of(lines), moved_points(cage), atol=1e-9)
    # A dense one has those of its surface, of which two triangles share each, here 18 by n².
    box, n = TetraCage(divisions=(7, 7, 7), order=order), 7
    box.SetInputDataObject(0, cage)
    dense = box.update().output
    add_array(dense.GetPointData(), "displacement", np.zeros((dense.GetNumberOfPoints(), 3)))
    actor.show(dense, 1.0, thin=True)
    assert actor.GetMapper().GetInput().GetNumberOfLines() == order * 18 * n * n
    assert 0.0 < actor.GetProperty().GetOpacity() < 0.5


def test_the_view_of_a_hanging_cloth_excludes_its_rest_shape() -> None:
    """Held by one edge and made level, it hangs straight down: nothing of it is level any more."""
    weave = {"ends": 6, "picks": 6}
    modal = {"elements": "sheet", "youngs_modulus": "10 Pa", "gravity": [0, 0, -9.8], "modes": 4}
    scene = Scene({"weave": weave, "cage": {"divisions": [4, 8, 1]}, "modal": modal})
    scene.update(0.0)
    frame = frame_of(scene, 0.0)
    across = np.ptp(points_of(scene.source.output), axis=0)
    seen = np.ptp(extent_of(frame, loads=False), axis=0)
    hung = np.ptp(points_of(frame.surface), axis=0)
    assert hung[1] < 0.6 * across[1] < hung[2]
    np.testing.assert_allclose(seen, hung, atol=0.1 * across[1])
