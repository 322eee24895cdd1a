"""Changing a loom by hand, compared with changes of the drawdown itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.drafts.loom import Loom

TWILL = Loom(
    threading=((1,), (2,), (3,), (4,)),
    tieup=((1, 2), (2, 3), (3, 4), (1, 4)),
    treadling=((1,), (2,), (3,), (4,)),
)


@st.composite
def looms(draw: st.DrawFn) -> Loom:
    shafts, treadles = draw(st.integers(1, 5)), draw(st.integers(1, 5))

    def rows(count: int, highest: int) -> tuple[tuple[int, ...], ...]:
        row = st.lists(st.integers(1, highest), max_size=3, unique=True)
        return tuple(tuple(sorted(draw(row))) for _ in range(count))

    return Loom(
        rows(draw(st.integers(1, 6)), shafts),
        rows(treadles, shafts),
        rows(draw(st.integers(1, 6)), treadles),
        rising=draw(st.booleans()),
        shafts=shafts,
        treadles=treadles,
    )


def test_a_new_heddle_changes_only_its_end() -> None:
    before = TWILL.drawdown()
    after = TWILL.replace_threading(1, (3,)).drawdown()
    np.testing.assert_array_equal(after[:, 0], before[:, 2])
    np.testing.assert_array_equal(after[:, 1:], before[:, 1:])
    assert not TWILL.replace_threading(2, ()).drawdown()[:, 1].any()  # in no heddle: it floats


def test_a_new_treadle_changes_only_its_pick() -> None:
    before = TWILL.drawdown()
    after = TWILL.replace_treadling(4, (1,)).drawdown()
    np.testing.assert_array_equal(after[3], before[0])
    np.testing.assert_array_equal(after[:3], before[:3])
    both = TWILL.replace_treadling(4, (1, 2)).drawdown()[3]
    np.testing.assert_array_equal(both, before[0] | before[1])


def test_a_new_tie_changes_only_the_picks_of_its_treadle() -> None:
    after = TWILL.replace_tie(2, Loom.toggle(TWILL.tieup[1], 1)).drawdown()
    changed = after != TWILL.drawdown()
    assert np.argwhere(changed).tolist() == [[1, 0]]
    # A treadle that has no tie yet.
    wide = TWILL.resize(4, 6)
    assert wide.replace_tie(6, (2,)).tieup[4:] == ((), (2,))


@given(looms())
def test_a_liftplan_weaves_the_same_and_so_do_its_treadles(loom: Loom) -> None:
    lifted = loom.with_liftplan
    np.testing.assert_array_equal(lifted.drawdown(), loom.drawdown())
    np.testing.assert_array_equal(lifted.with_treadles.drawdown(), loom.drawdown())
    assert lifted.with_treadles.liftplan is None
    assert lifted.rising == loom.rising


@given(looms(), st.integers(1, 12), st.integers(1, 12))
def test_a_repeated_loom_weaves_the_repeated_cloth(loom: Loom, ends: int, picks: int) -> None:
    np.testing.assert_array_equal(
        loom.repeat(ends, picks).drawdown(), tile_drawdown(loom.drawdown(), ends, picks)
    )
    np.testing.assert_array_equal(
        loom.with_liftplan.repeat(ends, picks).drawdown(),
        tile_drawdown(loom.drawdown(), ends, picks),
    )


@given(looms(), st.integers(0, 9), st.integers(0, 9))
def test_resizing_keeps_used_shafts_and_treadles(loom: Loom, shafts: int, treadles: int) -> None:
    other = loom.resize(shafts, treadles)
    most = loom.highest_used
    assert (other.shafts, other.treadles) == (max(shafts, most[0]), max(treadles, most[1]))
    np.testing.assert_array_equal(other.drawdown(), loom.drawdown())
    assert loom.resize(*most).highest_used == most


@pytest.mark.parametrize(
    "change",
    [
        lambda: TWILL.replace_threading(5, (1,)),
        lambda: TWILL.replace_threading(1, (0,)),
        lambda: TWILL.replace_treadling(0, (1,)),
        lambda: TWILL.replace_tie(5, (1,)),
        lambda: TWILL.with_liftplan.replace_tie(1, (1,)),
    ],
)
def test_edits_of_missing_rows_are_refused(change: object) -> None:
    with pytest.raises(InputError):
        change()  # type: ignore[operator]
