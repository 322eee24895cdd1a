"""Floats of both faces, counted a second time crossing by crossing."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spacemap_vtk.textile.drafts.drawdown import longest_floats
from spacemap_vtk.textile.drafts.floats import find_floats
from spacemap_vtk.textile.drafts.patterns import satin

DRAWDOWNS = arrays(bool, st.tuples(st.integers(1, 7), st.integers(1, 7)))


def count_floats(drawdown: np.ndarray, family: int, face: bool) -> list[tuple[int, int, int]]:
    found = []
    for yarn, line in enumerate(drawdown.T if family == 0 else drawdown):
        place = 0
        for end_is_over, run in groupby(line.tolist()):
            length = len(list(run))
            if end_is_over == ((family == 0) == face):
                found.append((yarn, place, length))
            place += length
    return found


@given(DRAWDOWNS, st.sampled_from([0, 1]), st.booleans())
def test_floats_are_those_of_a_count_by_hand(drawdown: np.ndarray, family: int, face: bool) -> None:
    floats = find_floats(drawdown, family, face)
    assert list(zip(*map(np.ndarray.tolist, floats), strict=True)) == count_floats(
        drawdown, family, face
    )


@given(DRAWDOWNS)
def test_the_longest_floats_are_those_of_the_drawdown(drawdown: np.ndarray) -> None:
    faces = [
        max(find_floats(drawdown, family, face).longest for face in (True, False))
        for family in (0, 1)
    ]
    assert tuple(faces) == longest_floats(drawdown)


def test_a_warp_satin_floats_with_the_warp_on_its_face_and_the_weft_on_its_reverse() -> None:
    cloth = np.tile(satin(8, 3), (3, 3))
    longest = {
        (family, face): find_floats(cloth, family, face).longest
        for family in (0, 1)
        for face in (True, False)
    }
    assert longest == {(0, True): 7, (0, False): 1, (1, True): 1, (1, False): 7}
    # Each of the 24 ends has three binding points and two floats between them. In each repeat of
    # eight, one end is bound at the first pick and one at the last; both have a third float.
    assert len(find_floats(cloth, 0).longer_than(6).yarn) == 2 * 24 + 3 + 3
