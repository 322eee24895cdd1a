"""Pictures show what the window shows: loads, supports, the ghost of the rest shape, a cut."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import points_of
from spacemap_vtk.scenes.glyphs import cut_of, rest_of
from spacemap_vtk.scenes.picture import Picture
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 4, "picks": 4},
    "cage": {"divisions": [3, 3, 1]},
    "modal": {"youngs_modulus": "100 Pa"},
    "response": {"gravity": [0.0, -3.0, 3.0]},
    "surface": {"subdivisions": 3},
    "view": {"show": "both", "camera": "front"},
}


def drawn(time: float = 0.02, **view: Any) -> np.ndarray:
    picture = Picture(Scene({**VALUES, "view": {**VALUES["view"], **view}}), [time], (240, 180))
    image = picture.draw(time).astype(int)
    picture.close()
    return image


def near(image: np.ndarray, color: str, most: int = 60) -> np.ndarray:
    """Return which pixels are of about a colour."""
    return np.abs(image - list(bytes.fromhex(color[1:]))).max(axis=2) < most


def test_supports_can_be_left_out() -> None:
    orange = [near(drawn(supports=on, show="cage"), "#d9642c").sum() for on in (True, False)]
    assert orange[0] > 30
    assert orange[1] == 0


def test_loads_are_drawn_whole_and_as_strong_as_they_are() -> None:
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


def test_the_ghost_is_where_the_fabric_was() -> None:
    scene = Scene(VALUES)
    scene.update(0.0)
    rest = points_of(scene.polygons).copy()
    scene.update(0.02)
    assert np.abs(points_of(scene.polygons) - rest).max() > 1e-4
    np.testing.assert_allclose(rest_of(scene.polygons), rest, atol=1e-9)
    # Pale: what the moved fabric leaves free is a little darker than the background.
    plain, pale = drawn(show="fabric", ghost=False), drawn(show="fabric", ghost=True)
    assert plain.shape == pale.shape
    assert np.mean(np.abs(pale - plain).max(axis=2) > 8) > 0.01
    still = [drawn(0.0, show="fabric", ghost=on) for on in (False, True)]
    assert np.mean(np.abs(still[1] - still[0]).max(axis=2) > 40) < 0.01


@pytest.mark.parametrize(
    ("normal", "gone"), [([-1, 0, 0], np.s_[:, 130:]), ([0, 2, 0], np.s_[110:, :])]
)
def test_a_plane_cuts_what_lies_behind_it(normal: list[float], gone: Any) -> None:
    """Yarns are blue or sand, the background is neither."""
    whole, cut = (
        (np.ptp(drawn(0.0, show="fabric", clip_normal=n), axis=2) > 60) for n in ("auto", normal)
    )
    assert whole[gone].sum() > 1000
    assert cut[gone].sum() == 0
    assert cut.sum() > 0.4 * whole.sum()


def test_the_plane_goes_through_the_middle_at_rest_or_a_point() -> None:
    scene = Scene(VALUES)
    scene.update(0.02)
    assert cut_of(scene.view, scene.polygons) is None
    scene.set("view.clip_normal=[0, 0, 1]")
    normal, origin = cut_of(scene.view, scene.polygons) or ((), ())
    assert normal == (0.0, 0.0, 1.0)
    rest = rest_of(scene.polygons)
    np.testing.assert_allclose(origin, (rest.min(axis=0) + rest.max(axis=0)) / 2)
    scene.set('view.clip_origin=["1 mm", 0, 0]')
    assert cut_of(scene.view, scene.polygons) == ((0.0, 0.0, 1.0), (0.001, 0.0, 0.0))


def test_a_direction_of_no_length_is_refused() -> None:
    with pytest.raises(InputError, match=r"view\.clip_normal.*no direction"):
        Scene({"view": {"clip_normal": [0, 0, 0]}})


def test_a_still_scene_has_none_of_it_and_is_drawn() -> None:
    view = {"ghost": True, "loads": True, "supports": True}
    picture = Picture(Scene({"weave": {"ends": 3, "picks": 3}, "view": view}), [0.0], (120, 90))
    assert picture.draw(0.0).std() > 20
    picture.close()
