"""Insets: the same picture, magnified, at the place that was asked for and at its scale."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.draw.inset import view_of_inset
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.flat_picture import pixels_per_metre
from spacemap_vtk.scenes.insets import Inset
from spacemap_vtk.scenes.scene import Scene

WEAVE = {"ends": 6, "picks": 6, "warp_color": "#2850a0", "weft_color": "#f0c820"}
SIZE = 240, 180


def drawn(size: tuple[int, int], **view: Any) -> NDArray[np.uint8]:
    scene = Scene({"weave": WEAVE, "view": {"irregularity": 0.0, **view}})
    picture = Picture(scene, [0.0], size)
    image = picture.draw(0.0).copy()
    picture.close()
    return image


@pytest.mark.parametrize("camera", ["three-quarter", "face"])
def test_an_inset_is_a_part_of_a_larger_picture(camera: str) -> None:
    inset = {"place": [0.55, 0.45], "magnification": 4, "shape": "square", "scale_bar": False}
    with_inset = drawn(SIZE, camera=camera, insets=[inset])
    side, edge = round(0.42 * SIZE[1]), round(0.025 * SIZE[1])
    # At the upper right, because the place is right of the middle and below it.
    close = with_inset[edge : edge + side, -edge - side : -edge].astype(float)
    large = drawn((4 * SIZE[0], 4 * SIZE[1]), camera=camera).astype(float)
    column, row = round(4 * 0.55 * SIZE[0]), round(4 * 0.55 * SIZE[1])
    part = large[row - side // 2 : row - side // 2 + side, column - side // 2 :][:, :side]
    inner = slice(4, -4)
    assert np.abs(close - part)[inner, inner].mean() < 6
    assert part[inner, inner].std() > 25  # there are yarns of both colours


def test_the_rest_of_the_picture_stays() -> None:
    view = {"camera": "front", "insets": [{"place": [0.6, 0.4], "magnification": 8}]}
    before, after = (drawn(SIZE, camera="front").astype(int), drawn(SIZE, **view).astype(int))
    differs = np.abs(after - before).max(axis=2) > 2
    assert not differs[:, : SIZE[0] // 2].any()
    assert differs[:, SIZE[0] // 2 :].any()


def test_the_scale_of_an_inset_is_that_of_the_flat_cloth_times_the_magnification() -> None:
    scene = Scene({"weave": WEAVE, "view": {"camera": "face"}})
    picture = Picture(scene, [0.0], SIZE)
    picture.draw(0.0)
    camera: vtkCamera = picture.panels[0].window.camera
    shown = view_of_inset(0, Inset(magnification=5), camera, scene.polygons, SIZE)
    picture.close()
    assert scene.woven is not None
    expected = 5 * pixels_per_metre(scene, scene.woven.cloth, SIZE)
    assert shown.pixels_per_metre == pytest.approx(expected, rel=0.03)


def test_an_inset_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="nothing to magnify here") as caught:
        drawn(SIZE, camera="front", insets=[{"place": [0.01, 0.5]}])
    assert (caught.value.section, caught.value.key) == ("view", "insets[0].place")


def test_two_insets_need_two_corners() -> None:
    with pytest.raises(InputError, match="two insets"):
        Scene({"view": {"insets": [{"corner": "upper left"}, {"place": [0.4, 0.4]}]}})


def test_an_inset_leaves_room_for_axes_and_scale_bar() -> None:
    scene = Scene({"weave": WEAVE, "view": {"camera": "face"}})
    picture = Picture(scene, [0.0], SIZE)
    picture.draw(0.0)
    camera = picture.panels[0].window.camera
    inset, plate = Inset(corner="lower left"), (8.0, 8.0, 90.0, 60.0)
    corner = [
        view_of_inset(0, inset, camera, scene.polygons, SIZE, 0.0, plates).corner
        for plates in ((), [plate], [(200.0, 8.0, 290.0, 60.0)])
    ]
    picture.close()
    assert corner[1] == (corner[0][0], corner[0][1] - 60)
    assert corner[2] == corner[0]
