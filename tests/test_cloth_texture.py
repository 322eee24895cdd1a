"""The layers and lines of a cloth that is seen from afar."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.textile.geometry.cloth_texture import color_layers, grid_lines
from spacemap_vtk.textile.geometry.partition import cloth_bounds
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.double_weave import Layers
from spacemap_vtk.textile.weave.threads import Threads


def test_each_crossing_has_its_two_yarns_once() -> None:
    random = np.random.default_rng(3)
    drawdown = random.random((5, 7)) < 0.5
    warp, weft = (random.integers(1, 256, (n, 3), np.uint8) for n in (7, 5))
    ends_over, picks_over, ends_under, picks_under = color_layers(drawdown, warp, weft)
    assert np.array_equal(
        ends_over[..., :3] + ends_under[..., :3], np.broadcast_to(warp, (5, 7, 3))
    )
    both = picks_over[..., :3] + picks_under[..., :3]
    assert np.array_equal(both, np.broadcast_to(weft[:, None], (5, 7, 3)))
    assert np.array_equal(ends_over[..., 3] == 255, drawdown)
    assert np.array_equal(picks_over[..., 3] == 255, ~drawdown)


def test_the_rear_cloth_is_shaded_on_both_faces() -> None:
    plain = np.indices((8, 8)).sum(axis=0) % 2 == 0
    drawdown = np.zeros((8, 8), dtype=bool)
    drawdown[::2, ::2], drawdown[1::2, 1::2], drawdown[1::2, ::2] = plain[:4, :4], plain[:4, :4], 1
    second = np.arange(8) % 2 == 1
    white = np.full((1, 3), 200, np.uint8)
    made = color_layers(drawdown, white, white, Layers(drawdown, second, second))
    front, back = (one[..., 0] + two[..., 0] for one, two in (made[:2], made[2:]))
    assert (front[::2] == 200).all()
    assert (front[1::2, ::2] == 200).all()
    assert (front[1::2, 1::2] == 120).all()
    assert (back[::2, ::2] == 120).all()
    assert (back[1::2] == 200).all()


def test_grid_lines_end_at_the_edges_of_the_cloth() -> None:
    spacing = np.array([1e-3, 2e-3, 1e-3, 3e-3])
    cloth = Cloth(
        drawdown=np.indices((4, 5)).sum(axis=0) % 2 == 0,
        warp=Threads(diameter=4e-4, spacing=spacing),
        weft=Threads(diameter=4e-4, spacing=1e-3),
    )
    bounds = cloth_bounds(cloth).reshape(3, 2)
    for number in (0, 1):
        lines = grid_lines(cloth, number, cloth.size[number])
        assert np.allclose(lines[[0, -1]], bounds[number])
        places = cloth.yarns[number].position
        assert ((lines[:-1] < places) & (places < lines[1:])).all()
