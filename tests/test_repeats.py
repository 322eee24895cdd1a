"""Repeats of threadings: the smallest description, compared with a search of all descriptions."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spacemap_vtk.textile.drafts.repeats import (
    LONGEST,
    NO_BORDER,
    Repeat,
    border_depths,
    count_symbols,
    cut_into_bands,
    expand,
    find_repeats,
    phrase_length,
)

STRAIGHT = [1, 2, 3, 4, 5, 6, 7, 8]


@cache
def fewest_symbols(sequence: tuple[int, ...]) -> int:
    """Search all ways to split a sequence, or to write it as copies of a part."""
    count = len(sequence)
    if count < 2:
        return count
    splits = [
        fewest_symbols(sequence[:cut]) + fewest_symbols(sequence[cut:]) for cut in range(1, count)
    ]
    copies = [
        2 + fewest_symbols(sequence[:size])
        for size in range(1, count // 2 + 1)
        if count % size == 0 and sequence == sequence[:size] * (count // size)
    ]
    return min(splits + copies)


@given(st.lists(st.integers(1, 3), max_size=14))
def test_no_description_is_smaller(sequence: list[int]) -> None:
    phrase = find_repeats(sequence)
    assert list(expand(phrase)) == sequence
    assert count_symbols(phrase) == fewest_symbols(tuple(sequence))


@st.composite
def nested_sequences(draw: st.DrawFn, depth: int = 3) -> list[int]:
    if depth == 0:
        return draw(st.lists(st.integers(1, 8), min_size=1, max_size=5))
    parts = draw(st.lists(nested_sequences(depth - 1), min_size=1, max_size=3))
    return [token for part in parts for token in part] * draw(st.integers(1, 4))


@given(nested_sequences())
def test_a_phrase_expands_to_its_sequence_and_is_never_longer(sequence: list[int]) -> None:
    phrase = find_repeats(sequence)
    assert list(expand(phrase)) == sequence
    assert phrase_length(phrase) == len(sequence)
    assert count_symbols(phrase) <= len(sequence)


def test_repeats_begin_with_their_lowest_shaft_and_early() -> None:
    assert find_repeats(STRAIGHT * 3 + [1, 2]) == (Repeat(3, tuple(STRAIGHT)), 1, 2)
    assert find_repeats([7, 8, *STRAIGHT * 3, 1]) == (7, 8, Repeat(3, tuple(STRAIGHT)), 1)


def test_short_repeats_that_save_nothing_are_written_out() -> None:
    assert find_repeats([1, 2, 1, 2]) == (1, 2, 1, 2)
    assert find_repeats([1, 2, 1, 2, 1, 2]) == (Repeat(3, (1, 2)),)


def test_repeats_within_repeats_are_found() -> None:
    block = [1, 2] * 4 + [3, 4] * 3
    assert find_repeats(block * 5) == (Repeat(5, (Repeat(4, (1, 2)), Repeat(3, (3, 4)))),)


def test_threads_of_several_heddles_are_tokens_like_others() -> None:
    rows = [(1,), (1, 3), ()] * 4
    assert find_repeats(rows) == (Repeat(4, ((1,), (1, 3), ())),)


def test_long_sequences_are_described_in_parts() -> None:
    sequence = [1, 2, 3] * (LONGEST // 2)
    phrase = find_repeats(sequence)
    assert list(expand(phrase)) == sequence
    assert len(phrase) < 10


def test_borders_are_deeper_within_repeats() -> None:
    depths = border_depths((Repeat(2, (Repeat(2, (1, 2)), 5)), 7))
    assert depths.tolist() == [0, 9, 2, 9, 1, 1, 9, 2, 9, 1, 0, 0]


@given(st.lists(st.integers(0, NO_BORDER), min_size=2, max_size=13), st.integers(1, 6))
def test_bands_are_the_best_of_all(depths: list[int], most: int) -> None:
    count = len(depths) - 1
    bands = cut_into_bands(np.array(depths), most)
    assert [begin for begin, _ in bands] == [0, *(end for _, end in bands[:-1])]
    assert bands[-1][1] == count

    def rating(cuts: list[int]) -> tuple[int, int, int]:
        sizes = np.diff([0, *cuts, count])
        return len(sizes), sum(depths[cut] for cut in cuts), int((sizes**2).sum())

    @cache
    def all_cuts(begin: int) -> list[list[int]]:
        found = [[]] if count - begin <= most else []
        for cut in range(begin + 1, min(begin + most, count - 1) + 1):
            found += [[cut, *rest] for rest in all_cuts(cut)]
        return found

    assert rating([end for _, end in bands[:-1]]) == min(map(rating, all_cuts(0)))


@pytest.mark.parametrize("most", [10, 7, 8])
def test_bands_end_at_blocks_where_this_needs_no_further_band(most: int) -> None:
    bands = cut_into_bands(border_depths(find_repeats([1, 2, 3, 4] * 2 + [5, 6] * 4)), most)
    sizes = [end - begin for begin, end in bands]
    assert sizes == ([8, 8] if most >= 8 else [6, 6, 4] if sizes[0] == 6 else [4, 6, 6])
