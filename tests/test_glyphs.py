"""Loads, supports, the ghost of the rest shape, and cuts in pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, points_of
from spacemap_vtk.draw.actors.glyphs import GhostActor, LoadActor, cut_of, rest_points
from spacemap_vtk.draw.actors.load_arrows import ARROW_COLORS, load_arrows
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 4, "picks": 4},
    "cage": {"divisions": [3, 3, 1]},
    "modal": {"youngs_modulus": "100 Pa"},
    "response": {"gravity": [0.0, -3.0, 3.0]},
    "surface": {"subdivisions": 3},
    "view": {"show": "both", "camera": "front"},
}


def draw(time: float = 0.02, **view: Any) -> np.ndarray:
    picture = Picture(Scene({**VALUES, "view": {**VALUES["view"], **view}}), [time], (240, 180))
    image = picture.draw(time).astype(int)
    picture.close()
    return image


def near(image: np.ndarray, color: str, most: int = 60) -> np.ndarray:
    """Return which pixels are of about a colour."""
    return np.abs(image - list(bytes.fromhex(color[1:]))).max(axis=2) < most


def test_supports_can_be_left_out() -> None:
    orange = [near(draw(supports=on, show="cage"), "#d9642c").sum() for on in (True, False)]
    assert orange[0] > 30
    assert orange[1] == 0


def test_arrows_are_not_clipped_and_have_the_length_of_their_load() -> None:
    load = {"force": [0.0, 0.0, 1e-10], "at": [0.0, -1.0, 0.0], "time": "pulse"}
    response = {"gravity": [0.0, 0.0, 0.0], "loads": [{**load, "length": "10 ms"}]}
    pink = []
    for time in (0.0, 0.02):
        scene = Scene({**VALUES, "response": response, "view": {"loads": True, "camera": "side"}})
        picture = Picture(scene, [0.0, 0.02], (240, 180))
        image = picture.draw(time).astype(int)
        picture.close()
        pink.append((image[:, :, 0] > image[:, :, 1] + 25) & (image[:, :, 2] > image[:, :, 1] + 10))
    assert pink[0].sum() > 20
    assert pink[1].sum() == 0
    # All of the arrow is in the picture, though it begins outside the cage.
    for edge in (pink[0][0], pink[0][-1], pink[0][:, 0], pink[0][:, -1]):
        assert not edge.any()


def test_the_ghost_shows_the_rest_shape() -> None:
    scene = Scene(VALUES)
    scene.update(0.0)
    rest = points_of(scene.polygons).copy()
    scene.update(0.02)
    assert np.abs(points_of(scene.polygons) - rest).max() > 1e-4
    np.testing.assert_allclose(rest_points(scene.polygons), rest, atol=1e-9)
    # Pale: what the moved fabric leaves free is a little darker than the background.
    plain, pale = draw(show="fabric", ghost=False), draw(show="fabric", ghost=True)
    assert plain.shape == pale.shape
    assert np.mean(np.abs(pale - plain).max(axis=2) > 8) > 0.01
    still = [draw(0.0, show="fabric", ghost=on) for on in (False, True)]
    assert np.mean(np.abs(still[1] - still[0]).max(axis=2) > 40) < 0.01


def test_the_ghost_of_a_hanging_cloth_is_flat() -> None:
    """Flat, and nearly without light and shade, however steep the cloth beside it hangs."""
    modal = {"elements": "sheet", "fixed": "-x", "gravity": [0, 0, -9.8], "areal_mass": 0.3}
    modal |= {"bending_rigidity": "1e-3 uN.m", "modes": 2}
    scene = Scene({**VALUES, "weave": {"ends": 12, "picks": 4}, "modal": modal, "response": {}})
    scene.update(0.0)
    moved, ghost = scene.polygons, GhostActor()
    assert np.ptp(points_of(moved)[:, 2]) > 3e-3
    assert moved.GetPointData().GetNormals() is not None
    ghost.show(moved, closed=True)
    shown = ghost.GetMapper().GetInput()
    assert np.ptp(points_of(shown)[:, 2]) < 1.1e-3
    assert shown.GetPointData().GetNormals() is None
    assert moved.GetPointData().GetNormals() is not None
    assert ghost.GetProperty().GetBackfaceCulling()
    ghost.show(moved)
    assert not ghost.GetProperty().GetBackfaceCulling()


@pytest.mark.parametrize(
    ("normal", "gone"), [([-1, 0, 0], np.s_[:, 130:]), ([0, 2, 0], np.s_[110:, :])]
)
def test_a_clipping_plane_hides_one_side(normal: list[float], gone: Any) -> None:
    """Yarns are blue or sand, the background is neither."""
    whole, cut = (
        (np.ptp(draw(0.0, show="fabric", clip_normal=n), axis=2) > 60) for n in ("auto", normal)
    )
    assert whole[gone].sum() > 1000
    assert cut[gone].sum() == 0
    assert cut.sum() > 0.4 * whole.sum()


def test_the_plane_passes_through_the_centre_or_a_given_point() -> None:
    scene = Scene(VALUES)
    scene.update(0.02)
    assert cut_of(scene.view, scene.polygons) is None
    scene.set("view.clip_normal=[0, 0, 1]")
    normal, origin = cut_of(scene.view, scene.polygons) or ((), ())
    assert normal == (0.0, 0.0, 1.0)
    rest = rest_points(scene.polygons)
    np.testing.assert_allclose(origin, (rest.min(axis=0) + rest.max(axis=0)) / 2)
    scene.set('view.clip_origin=["1 mm", 0, 0]')
    assert cut_of(scene.view, scene.polygons) == ((0.0, 0.0, 1.0), (0.001, 0.0, 0.0))


@pytest.mark.parametrize(("tiny", "why"), [(0, "the zero vector"), (1e-300, "must be 0, or")])
def test_a_zero_normal_is_refused(tiny: float, why: str) -> None:
    with pytest.raises(InputError, match=rf"view\.clip_normal.*{why}"):
        Scene({"view": {"clip_normal": [0, tiny, 0]}})


def test_a_still_scene_is_drawn_without_cage_and_loads() -> None:
    view = {"ghost": True, "loads": True, "supports": True}
    picture = Picture(Scene({"weave": {"ends": 3, "picks": 3}, "view": view}), [0.0], (120, 90))
    assert picture.draw(0.0).std() > 20
    picture.close()


def test_the_camera_has_room_for_the_longest_arrow() -> None:
    load = {"force": [0.0, 0.0, 1e-10], "at": [0.0, -1.0, 0.0], "time": "pulse"}
    response = {"gravity": [0.0, 0.0, 0.0], "loads": [{**load, "length": "10 ms"}]}
    scene = Scene({**VALUES, "response": response, "view": {"loads": True, "camera": "side"}})
    # Nothing acts any more at the time that the camera is aimed for.
    picture = Picture(scene, [0.02], (240, 180))
    arrow = near(picture.draw(0.0).astype(int), ARROW_COLORS["force"], 90)
    picture.close()
    assert arrow.sum() > 20
    for edge in (arrow[0], arrow[-1], arrow[:, 0], arrow[:, -1]):
        assert not edge.any()


def test_the_gravity_arrow_begins_at_the_surface_of_the_cage() -> None:
    """The faces of a box, and of one that hangs askew: never beside the cage."""
    scene = Scene({**VALUES, "response": {"gravity": [0.0, -9.81, 0.0]}})
    scene.update(0.0)
    cage = scene.deformed_cage
    corners = points_of(cage).astype(float)
    low, high = corners.min(axis=0), corners.max(axis=0)
    arrows = load_arrows(scene.response, cage, 0.0)
    middle = (low + high) / 2
    np.testing.assert_allclose(arrows.starts, [[middle[0], low[1], middle[2]]], atol=1e-6)
    # Turned by 60 degrees about x, the sheet's own underside is below its middle.
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, -(0.75**0.5)], [0.0, 0.75**0.5, 0.5]])
    moved = vtkUnstructuredGrid()
    moved.DeepCopy(cage)
    add_array(moved.GetPointData(), "displacement", (corners - middle) @ turn.T + middle - corners)
    arrows = load_arrows(scene.response, moved, 0.0)
    thickness = (high - low)[2]
    below = thickness / 2 / 0.75**0.5
    np.testing.assert_allclose(arrows.starts, [middle - [0.0, below, 0.0]], atol=1e-6)


def test_markers_neither_cast_nor_receive_shadows() -> None:
    view = {"supports": False, "cage_color": "#ff00ff", "clip_normal": "auto"}
    fabric, both = draw(show="fabric", **view), draw(show="both", **view)
    # Round each line, a pixel that is partly its own.
    line = binary_dilation(np.abs(both - fabric).max(axis=2) > 24, iterations=2)
    assert 0.02 < line.mean() < 0.9
    assert np.abs(both - fabric)[~line].max() <= 24
    assert (np.abs(both - fabric)[~line].max(axis=1) > 3).mean() < 0.01


def test_an_arrow_behind_the_cloth_keeps_its_colour() -> None:
    """Where it is in sight between yarns."""
    load = {"force": [0.0, 1e-10, 1e-11], "at": [0.0, 0.0, -1.0]}
    scene = {
        **VALUES,
        "weave": {"ends": 4, "picks": 4, "warp_spacing": "2 mm", "weft_spacing": "2 mm"},
        "cage": {"divisions": [4, 3, 1]},
        "response": {"gravity": [0.0, 0.0, 0.0], "loads": [load]},
    }
    images = []
    for shadows in (True, False):
        view = {"loads": True, "shadows": shadows, "camera": "front"}
        picture = Picture(Scene({**scene, "view": view}), [0.0], (240, 180))
        images.append(picture.draw(0.0).astype(int))
        picture.close()
    red, green, blue = np.moveaxis(images[1], 2, 0)
    # Not where it shines through a yarn, which has a shadow.
    ink = (red > green + 60) & (blue > green + 25)
    # Nor at its edges: what has shadows is drawn large and made small, what has none by samples.
    ink = binary_erosion(ink)
    assert ink.sum() > 20
    assert np.abs(images[0] - images[1])[ink].max(axis=1).mean() < 3


def test_an_arrow_behind_the_cloth_shines_through() -> None:
    load = {"force": [0.0, 0.0, 1e-10], "at": [0.0, 0.0, -1.0]}
    response = {"gravity": [0.0, 0.0, 0.0], "loads": [load]}
    images = []
    for loads in (True, False):
        view = {"loads": loads, "camera": "three-quarter", "shadows": False}
        picture = Picture(Scene({**VALUES, "response": response, "view": view}), [0.0], (240, 180))
        images.append(picture.draw(0.0).astype(int))
        picture.close()
    changed = np.abs(images[0] - images[1]).max(axis=2) > 24
    assert changed.sum() > 40
    ink = list(bytes.fromhex(ARROW_COLORS["force"][1:]))
    before, after = (
        np.abs(image - ink).sum(axis=1) for image in (images[1][changed], images[0][changed])
    )
    assert (after < before).mean() > 0.9


@pytest.mark.nightly
def test_dots_scale_with_the_picture() -> None:
    orange = []
    for height in (600, 1200):
        scene = Scene({**VALUES, "view": {"show": "cage", "camera": "front"}})
        picture = Picture(scene, [0.0], (height, height))
        image = picture.draw(0.0).astype(int)
        picture.close()
        orange.append(int(near(image, "#d9642c", 90).sum()))
    assert orange[1] / orange[0] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize(("back", "lines"), [("#ffffff", "#39424e"), ("#10151b", "#96a4b4")])
def test_the_cage_is_visible_on_every_background(back: str, lines: str) -> None:
    view = {"show": "cage", "supports": False, "background": back, "background_top": back}
    assert near(draw(**view), lines, 30).sum() > 200
    assert near(draw(**view, cage_color="#ff0000"), "#ff0000", 60).sum() > 200


def test_arrows_on_the_hidden_side_are_hidden() -> None:
    loads = [{"pressure": 1e-6, "on": "-z"}]
    scene = Scene({**VALUES, "response": {"gravity": [0.0, -9.81, 0.0], "loads": loads}})
    scene.update(0.0)
    arrows = load_arrows(scene.response, scene.deformed_cage, 0.0)
    actor = LoadActor()
    shown = {}
    for name, cut in (("whole", None), ("left", ((-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))):
        actor.show(arrows, cut)
        shown[name] = points_of(actor.GetMapper().GetInput())
    pushing = np.array(arrows.kinds) == "pressure"
    assert pushing.sum() == len(arrows.kinds) - 1
    left = arrows.places[:, 0] <= 0.0
    assert 0 < left.sum() < pushing.sum()
    # The weight is of all of it.
    assert len(shown["whole"]) == len(arrows.kinds)
    np.testing.assert_allclose(shown["left"], arrows.starts[left | ~pushing])


def test_line_scale_sets_the_width_of_lines_and_dots() -> None:
    shares = []
    for scale in (1.0, 3.0):
        scene = Scene.read("plain_weave")
        scene.view.configure(line_scale=scale, supports=False, background_top="#ffffff")
        picture = Picture(scene, [0.02], (640, 480), ["cage"])
        dark = 255.0 - picture.draw(0.02).astype(float).mean(axis=2)
        picture.close()
        # The ink, in which lines that share a pixel count once.
        shares.append(dark.sum())
    assert 2.0 < shares[1] / shares[0] < 3.0
