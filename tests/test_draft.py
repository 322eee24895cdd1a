"""Drafts and the classical patterns."""

from __future__ import annotations

import doctest
from math import gcd

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from weaves import plain

from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.drafts import draft, drawdown, patterns
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown

matrices = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=9))


def test_examples() -> None:
    assert doctest.testmod(draft).failed == 0


def test_plain() -> None:
    weave = plain(7, 5)
    assert weave.shape == (5, 7)
    assert weave.dtype == bool
    assert weave[0, 0]
    assert drawdown.to_rows(weave)[:2] == ["1010101", "0101010"]
    assert drawdown.longest_floats(weave) == (1, 1)
    assert drawdown.mean_floats(weave) == (1, 1)
    assert drawdown.mean_floats([[1, 0]]) == (None, 1)  # no end changes side
    assert drawdown.repeat_size(weave) == (2, 2)


@pytest.mark.parametrize(("over", "under"), [(2, 1), (1, 2), (2, 2), (3, 1), (1, 4)])
@pytest.mark.parametrize("direction", ["right", "left"])
def test_twill(over: int, under: int, direction: str) -> None:
    size = over + under
    weave = tile_drawdown(patterns.twill(over, under, direction=direction), 3 * size, 2 * size)
    assert weave[0, 0]
    assert (weave[:size].sum(axis=0) == over).all()
    assert drawdown.longest_floats(weave) == (max(over, under),) * 2
    assert drawdown.mean_floats(weave) == (size / 2, size / 2)
    assert drawdown.repeat_size(weave) == (size, size)
    # a pick later the pattern stands one end further to the side it rises to
    step = 1 if direction == "right" else -1
    np.testing.assert_array_equal(weave[1], np.roll(weave[0], step))
    # an end, too, goes over all its picks in one run of the repeat
    assert np.count_nonzero(np.diff(weave[:size, 0].astype(int), append=weave[0, 0])) == 2


@pytest.mark.parametrize(("shafts", "step"), [(5, 2), (5, 3), (7, 2), (8, 3), (8, 5), (16, 7)])
def test_satin(shafts: int, step: int) -> None:
    weave = tile_drawdown(patterns.satin(shafts, step), 2 * shafts, 2 * shafts)
    assert drawdown.longest_floats(weave) == (shafts - 1, shafts - 1)
    assert drawdown.mean_floats(weave) == (shafts / 2, shafts / 2)
    assert drawdown.repeat_size(weave) == (shafts, shafts)
    unit = ~patterns.satin(shafts, step)
    assert (unit.sum(axis=0) == 1).all()
    assert (unit.sum(axis=1) == 1).all()
    assert unit[0, 0]
    # no binding point touches another, corners included
    for shift in (1, -1):
        assert not (unit & np.roll(unit, (1, shift), axis=(0, 1))).any()
    np.testing.assert_array_equal(patterns.satin(shafts, step, face="weft"), unit)


@pytest.mark.parametrize(
    ("shafts", "step"), [(5, 1), (5, 4), (5, 0), (6, 2), (8, 2), (8, 9), (4, 2), (5, -2), (5, 2.5)]
)
def test_invalid_satins_are_refused(shafts: int, step: int) -> None:
    with pytest.raises(InputError) as caught:
        patterns.satin(shafts, step)
    assert caught.value.key == "step"
    steps = [str(k) for k in range(2, shafts - 1) if gcd(k, shafts) == 1]
    assert caught.value.allowed == (", ".join(steps) or "none: use 5 shafts, or 7 or more")


def test_basket() -> None:
    weave = tile_drawdown(patterns.basket(3), 12, 6)
    assert weave.shape == (6, 12)
    assert drawdown.longest_floats(weave) == (3, 3)
    assert drawdown.repeat_size(weave) == (6, 6)
    np.testing.assert_array_equal(patterns.basket(1), plain(2, 2))


def test_sizes_are_checked() -> None:
    for size in (0, -1, 2.5, True, "7"):
        with pytest.raises(InputError, match="ends"):
            plain(size, 7)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="over"):
        patterns.twill(0, 2)
    with pytest.raises(InputError, match="n = 0"):
        patterns.basket(0)


@given(matrices)
def test_rows_and_from_matrix_are_inverse(matrix: np.ndarray) -> None:
    text = drawdown.to_rows(matrix)
    np.testing.assert_array_equal(drawdown.from_matrix(text), matrix)
    np.testing.assert_array_equal(drawdown.from_matrix(matrix.astype(int).tolist()), matrix)
    np.testing.assert_array_equal(drawdown.from_matrix(matrix), matrix)


@pytest.mark.parametrize(
    ("matrix", "stated"),
    [
        (["010", "01"], "row 2 has 2 ends, but row 1 has 3"),
        (["01", "0x"], "row 2 has 'x' at end 2"),
        ([[0, 1], [0, 2]], "row 2 has 2 at end 2"),
        ([[0, 1], [0, 1], []], "row 3 must consist of 0 and 1"),
        ([[0, 1], 5], "row 2 must consist of 0 and 1"),
        ([[0, [1]]], "row 1 has"),
        ([[0, None]], "row 1 has None at end 2"),
        ([], "at least one row"),
        ("0101", "at least one row"),
        (7, "at least one row"),
    ],
)
def test_from_matrix_names_the_row(matrix: object, stated: str) -> None:
    with pytest.raises(InputError, match=stated):
        drawdown.from_matrix(matrix)  # type: ignore[arg-type]


@given(matrices, st.integers(1, 20), st.integers(1, 20))
def test_tile(matrix: np.ndarray, ends: int, picks: int) -> None:
    cloth = tile_drawdown(matrix, ends, picks)
    assert cloth.shape == (picks, ends)
    whole = np.tile(matrix, (20, 20))
    np.testing.assert_array_equal(cloth, whole[:picks, :ends])


@given(matrices)
def test_repeat_is_the_smallest(matrix: np.ndarray) -> None:
    picks, ends = matrix.shape
    width, height = drawdown.repeat_size(matrix)
    np.testing.assert_array_equal(tile_drawdown(matrix[:height, :width], ends, picks), matrix)
    smaller = [(w, height) for w in range(1, width)] + [(width, h) for h in range(1, height)]
    for w, h in smaller:
        assert not np.array_equal(tile_drawdown(matrix[:h, :w], ends, picks), matrix)


@given(matrices)
def test_floats_by_counting(matrix: np.ndarray) -> None:
    def longest(line: str) -> int:
        return max(len(run) for run in line.replace("01", "0 1").replace("10", "1 0").split())

    expected = (
        max(map(longest, drawdown.to_rows(matrix.T))),
        max(map(longest, drawdown.to_rows(matrix))),
    )
    assert drawdown.longest_floats(matrix) == expected


def test_draft_checks_its_arrays() -> None:
    made = Draft(
        [[1, 0], [0, 1], [1, 1]], weft=DraftThreads(colors=[[1, 2, 3]] * 3), warnings=["odd"]
    )  # type: ignore[arg-type]
    assert made.drawdown.dtype == bool
    assert made.weft.colors is not None
    assert made.weft.colors.dtype == np.uint8
    assert made.warnings == ("odd",)
    assert made.warp.spacing is None
    with pytest.raises(AttributeError):
        made.title = "x"  # type: ignore[misc]
    with pytest.raises(InputError, match="warp_colors"):
        Draft(plain(3, 2), warp=DraftThreads(colors=np.zeros((2, 3), np.uint8)))
    for bad in ([1, 0], np.zeros((0, 3)), 1):
        with pytest.raises(InputError, match="drawdown"):
            Draft(bad)  # type: ignore[arg-type]
