"""The layers and lines of a cloth that is seen from afar."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.textile.geometry.cloth_texture import grid_lines, visible_colors
from spacemap_vtk.textile.geometry.partition import cloth_bounds
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads


def test_a_crossing_has_the_colours_of_the_yarns_that_are_visible_there() -> None:
    random = np.random.default_rng(3)
    weaves = random.integers(0, 4, (5, 7))
    shares = random.random((4, 3), np.float32)
    for number in (0, 1):
        yarns = random.random((7 if number == 0 else 5, 3), np.float32)
        lines = yarns if number == 0 else yarns[:, None]
        at_crossings = np.broadcast_to(lines, (5, 7, 3))
        found = visible_colors(weaves, shares, number, yarns)
        assert np.allclose(found, visible_colors(weaves, shares, number, at_crossings))
        # A part of the picks is the same part of the whole.
        part = visible_colors(weaves[2:4], shares, number, yarns, 2)
        assert np.array_equal(part, found[2:4])
        for pick, end in ((2, 3), (1, 5), (0, 0)):
            own = (end, pick)[number]
            beside = [min(max(own + step, 0), len(yarns) - 1) for step in (-1, 0, 1)]
            share = shares[weaves[pick, end]]
            assert np.allclose(found[pick, end, :3], share @ yarns[beside])
            assert np.isclose(found[pick, end, 3], share.sum())


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
