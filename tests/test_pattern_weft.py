"""Pattern wefts over tabby: which picks they are, and how they close the cloth."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.drafts.pattern_weft import find_pattern_weft
from spacemap_vtk.textile.weave.pattern_sections import close_over_tabby

TWILL = [(1, 2), (2, 3), (3, 4), (4, 1)]


def weave(threading: list[int], sheds: list[tuple[int, ...]]) -> Bools:
    return np.array([[shaft in shed for shaft in threading] for shed in sheds])


def with_tabby(
    sheds: list[tuple[int, ...]], tabby: tuple[tuple[int, ...], ...]
) -> list[tuple[int, ...]]:
    pairs = ((shed, tabby[number % 2]) for number, shed in enumerate(sheds))
    return [shed for pair in pairs for shed in pair]


def test_overshot_and_summer_and_winter_have_a_pattern_weft() -> None:
    # Four blocks of overshot on opposites, six picks each; two blocks of summer and winter.
    overshot = weave(
        [1, 2, 1, 2, 3, 2, 3, 2, 3, 4, 3, 4, 1, 4, 1, 4],
        with_tabby([shed for shed in TWILL for _ in range(6)], ((1, 3), (2, 4))),
    )
    winter = weave(
        [1, 3, 2, 3, 1, 3, 2, 3, 1, 4, 2, 4, 1, 4, 2, 4],
        with_tabby([(1, 4), (2, 4), (2, 4), (1, 4), (1, 3), (2, 3)] * 2, ((1, 2), (3, 4))),
    )
    for drawdown in (overshot, winter):
        found = find_pattern_weft(drawdown)
        assert found is not None
        assert found.pattern.tolist() == [True, False] * (len(drawdown) // 2)
        assert (found.tabby == ~found.pattern).all()
    # Plain borders are neither; a wrong crossing does not hide the pattern weft.
    tabby = weave([1, 2, 3, 4] * 4, [(1, 3), (2, 4)] * 4)
    wrong = np.tile(np.vstack([tabby, overshot, tabby[:7]]), 4)
    wrong[17, 3] ^= True
    found = find_pattern_weft(wrong)
    assert found is not None
    assert found.pattern.sum() == 24
    assert found.tabby[7:56].sum() == 25
    assert not found.tabby[:7].any()


def test_other_weaves_have_none() -> None:
    # Huck: the plain picks on both sides of a float open the same shed.
    huck = weave([1, 2, 1, 2, 1, 4, 3, 4, 3, 4] * 2, [(1, 3), (1, 2, 3), (1, 3), (2, 4), (4,)] * 4)
    weaves = [
        np.indices((8, 8)).sum(axis=0) % 2 == 0,
        *(tile_drawdown(each, 16, 16) for each in (patterns.twill(2, 2), patterns.satin(5, 2))),
        tile_drawdown(patterns.basket(2), 16, 16),
        huck,
        np.ones((4, 4), dtype=bool),
    ]
    assert [find_pattern_weft(each) for each in weaves] == [None] * len(weaves)


def test_thickness_decides_about_short_floats() -> None:
    # A 2/2 twill in the sheds of a plain weave floats over two ends only.
    drawdown = weave([1, 2, 3, 4] * 4, with_tabby(TWILL * 2, ((1, 3), (2, 4))))
    assert find_pattern_weft(drawdown) is None
    found = find_pattern_weft(drawdown, [2.0, 1.0] * 8)
    assert found is not None
    assert found.pattern.tolist() == [True, False] * 8


def test_pattern_picks_take_the_room_that_the_tabby_yields() -> None:
    pattern = np.array([False] * 6 + [True, False] * 10 + [False] * 6)
    laid = close_over_tabby(pattern, 16.0, ratio=3.0, filling=0.9)
    apart = np.diff(laid.position)
    np.testing.assert_allclose(laid.width[:-1] + laid.width[1:], 1.8 * apart)
    np.testing.assert_allclose(laid.width.sum(), 0.9 * 16.0)
    np.testing.assert_allclose(laid.width[pattern] / laid.width[~pattern].max(), 3.0)
    # The floats of one tabby after the other are covered without a gap.
    covered = laid.float_width[pattern]
    np.testing.assert_allclose(covered, np.diff(laid.position[pattern])[0])
    # In a cloth without borders they cover all of it, and the sett is that of the draft.
    whole = close_over_tabby(np.tile([True, False], 12), 24.0)
    np.testing.assert_allclose(whole.float_width[::2].sum(), 24.0)
    np.testing.assert_allclose(np.diff(whole.position), 1.0)
    for bad in ({"ratio": 0.9}, {"filling": 0.0}, {"filling": 1.1}):
        with pytest.raises(InputError, match=next(iter(bad))):
            close_over_tabby(pattern, 1.0, **bad)


def arc(radius: float, middle: tuple[float, float], half: float, side: float) -> Floats:
    y = np.linspace(-half, half, 801)
    return np.stack([y + middle[0], middle[1] + side * np.sqrt(radius**2 - y**2)], axis=1)


@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0, 4.0])
@pytest.mark.parametrize("aspect", [1.0, 1.6, 4.0])
def test_wide_floats_do_not_touch_the_tabby_below(ratio: float, aspect: float) -> None:
    # Points of the lower arc of a float, drawn out, against points of the tabby's upper arc.
    laid = close_over_tabby(np.tile([True, False], 3), 6.0, ratio)
    width, tabby = laid.width[2:4]
    height, low = width / aspect, tabby / aspect
    radius, small = ((a * a + b * b) / (4.0 * b) for a, b in ((width, height), (tabby, low)))
    half = min(0.5 * laid.float_width[2], radius)
    float_ = arc(radius, (0.0, radius), half, -1.0)
    crown = arc(small, (laid.position[3] - laid.position[2], low - small), 0.5 * tabby, 1.0)
    # Both lie on the ends, at height 0; the float must be above the crown where both are.
    above = np.interp(crown[:, 0], *float_.T, left=np.nan, right=np.nan) - crown[:, 1]
    assert np.nanmin(above) > -1e-5 * height
    # (2) leaves room for all but equal yarns.
    distance = np.hypot(crown[400, 0], radius - (low - small))
    assert distance >= radius + small - 1e-12
    # The axis of the float is that of level crowns, raised by `rise`.
    np.testing.assert_allclose(laid.rise[2] * height, 0.5 * (height - low))
