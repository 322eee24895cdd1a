"""What is visible of a cloth, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacemap_vtk.draw.actors.cloth_appearance import (
    NODES,
    REACH,
    TILTS,
    TURNS,
    ClothAppearance,
    appearance_of,
)
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.visible_surface import sample_surface, view_surface
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

PLAIN = np.indices((12, 12)).sum(axis=0) % 2


def test_open_share_is_that_of_the_gaps() -> None:
    cloth = Cloth(
        drawdown=PLAIN,
        warp=Threads(diameter=0.3, spacing=0.5),
        weft=Threads(diameter=0.2, spacing=0.6),
    )
    table = ClothAppearance(cloth).tables(tilted=False).views[0]
    shares = table[: NODES**2, :2].sum(axis=0)
    warp, weft = 0.3 / 0.5, 0.2 / 0.6
    assert table[-1, 0] == pytest.approx((1 - warp) * (1 - weft), abs=0.01)
    # At half of the crossings a yarn lies on top and shows all of its width; at the others, what
    # the other leaves.
    assert shares == pytest.approx([warp * (1 - weft / 2), weft * (1 - warp / 2)], abs=0.015)


def test_normals_of_a_tube_are_those_of_a_circle() -> None:
    # A straight end over picks that are hardly there: its normals are spread evenly across.
    cloth = Cloth(
        drawdown=np.ones((12, 12)),
        warp=Threads(diameter=0.3, spacing=0.5),
        weft=Threads(diameter=1e-3, spacing=0.5),
    )
    facets = sample_surface(cloth, YarnSelection(slice(0, 12), slice(0, 12)), 16.3)
    visible = view_surface(facets, np.array([0.0, 0.0, 1.0]), 16.3)
    across = visible.normals[visible.family == 0][:, 0]
    assert np.mean(across) == pytest.approx(0.0, abs=0.02)
    assert np.mean(across**2) == pytest.approx(1 / 3, abs=0.02)


def test_less_is_open_the_more_the_cloth_is_tilted() -> None:
    threads = Threads(diameter=0.25, spacing=0.5)
    cloth = Cloth(drawdown=PLAIN, warp=threads, weft=threads)
    open_ = ClothAppearance(cloth).tables(tilted=True).views[:, -1, 0]
    front = open_[: len(TILTS) * TURNS].reshape(len(TILTS), TURNS)
    assert (np.diff(front, axis=0) < 0.0).all()
    # Seen along the picks, the gaps between ends close where their projected width is zero.
    assert front[-1].max() < 0.01


def test_each_place_has_the_shares_of_its_own_weave() -> None:
    threads = Threads(diameter=0.25, spacing=0.5)
    made = ClothAppearance(Cloth(drawdown=PLAIN, warp=threads, weft=threads))
    shares = made.light_shares(1, shadows=False)[made.numbers]
    over, width = PLAIN == 1, 0.5
    assert np.mean(shares[over], axis=0)[:, REACH] == pytest.approx(
        [width, width * (1 - width)], abs=0.01
    )
    assert np.mean(shares[~over], axis=0)[:, REACH] == pytest.approx(
        [width * (1 - width), width], abs=0.01
    )
    # No yarn reaches into the crossing beside it.
    assert shares.sum(axis=(0, 1, 2))[[0, -1]].max() == 0.0
    # Shadows move light to the yarns on top and keep the mean.
    shaded = made.light_shares(1, shadows=True)[made.numbers]
    assert shaded.mean(axis=(0, 1)) == pytest.approx(shares.mean(axis=(0, 1)), abs=1e-3)
    assert (shaded[over][:, 0, REACH] > shares[over][:, 0, REACH]).all()


def test_a_cloth_of_one_crossing_has_an_appearance() -> None:
    threads = Threads(diameter=0.25, spacing=0.5)
    made = ClothAppearance(Cloth(drawdown=[[1]], warp=threads, weft=threads))
    assert np.isfinite(made.tables(tilted=True).views).all()
    assert made.numbers.tolist() == [[0]]


def test_cloths_of_other_colours_share_an_appearance() -> None:
    threads = Threads(diameter=0.25, spacing=0.5)
    cloth = Cloth(drawdown=PLAIN, warp=threads, weft=threads)
    made = appearance_of(cloth)
    red = replace(cloth, warp=replace(threads, colors=np.array([[255, 0, 0]], np.uint8)))
    assert appearance_of(red) is made
    for changed in (
        replace(cloth, weft=replace(threads, diameter=0.2)),
        replace(cloth, drawdown=~cloth.drawdown),
    ):
        assert appearance_of(changed) is not made
    assert appearance_of(cloth) is made
