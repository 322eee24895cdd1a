"""Which yarn is above at each crossing, seen along a direction; yarns that relax must keep it.

A crossing is known by the yarn that is crossed, the neighbouring cell in which that one lies, and
whether it is below. Along each yarn, crossings form a word that repeats itself with the cell. Two
yarns may be pushed over each other and back: two neighbouring crossings of the same two yarns with
the same one above are no change, and are left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.rods.contact import neighbouring_cells
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Straight pieces in each span.
_PIECES = 8


class Crossings(NamedTuple):
    """All crossings in a cell, each once."""

    yarns: Ints
    """(c, 2) Yarn above and yarn below."""
    parameters: Floats
    """(c, 2) Parameter of the crossing on both [spans]."""
    shift: Ints
    """(c, 2) Periods by which the yarn below is moved."""


class _Passage(NamedTuple):
    """A crossing seen from one of its yarns."""

    crossing: int
    other: int
    shift: tuple[int, int]
    is_above: bool


def find_crossings(
    yarns: Sequence[Yarn], cell: Floats, direction: ArrayLike = (0.0, 0.0, 1.0)
) -> Crossings:
    """Find the crossings of yarns, images included, seen against a direction."""
    # Images in neighbouring cells are included. Heights are compared along `direction`.
    from scipy.spatial import cKDTree

    at = np.arange(_PIECES + 1) / _PIECES
    samples, z = sample_yarns(yarns, at, np.ones(len(at))), unknowns(yarns, cell)
    up = np.asarray(direction, dtype=np.float64)
    plane = np.linalg.svd(up[None])[2][1:]
    place = samples.places(z).reshape(-1, len(at), 3)
    begin, end = place[:, :-1].reshape(-1, 3), place[:, 1:].reshape(-1, 3)
    owner = samples.yarn.reshape(-1, len(at))[:, :-1].ravel()
    start = samples.parameter.reshape(-1, len(at))[:, :-1].ravel()
    middle = (begin + end) / 2 @ plane.T
    way = (end - begin) @ plane.T
    reach = float(np.linalg.norm(way, axis=1).max())
    tree = cKDTree(middle)
    found = []
    for move in [np.zeros(2, dtype=np.int64), *neighbouring_cells(middle, cell @ plane.T, reach)]:
        if move.any():
            near = tree.sparse_distance_matrix(
                cKDTree(middle + move @ cell @ plane.T), reach, output_type="coo_matrix"
            )
            i, j = near.row, near.col
        else:
            i, j = tree.query_pairs(reach, output_type="ndarray").T
        shifted = move @ cell
        gap = (begin[j] + shifted - begin[i]) @ plane.T
        with np.errstate(divide="ignore", invalid="ignore"):
            area = _cross(way[i], way[j])
            s, t = _cross(gap, way[j]) / area, _cross(gap, way[i]) / area
        (on,) = np.nonzero((s >= 0.0) & (s < 1.0) & (t >= 0.0) & (t < 1.0))
        i, j, s, t = i[on], j[on], s[on], t[on]
        height = (begin[i] + s[:, None] * (end[i] - begin[i])) @ up
        other = (begin[j] + shifted + t[:, None] * (end[j] - begin[j])) @ up
        first = (start[i] + s / _PIECES, start[j] + t / _PIECES)
        over = (height > other)[:, None]
        pair = np.stack([owner[i], owner[j]], axis=1)
        where = np.stack(first, axis=1)
        found.append(
            Crossings(
                np.where(over, pair, pair[:, ::-1]),
                np.where(over, where, where[:, ::-1]),
                np.where(over, move, -move),
            )
        )
    return Crossings(*(np.concatenate(each) for each in zip(*found, strict=True)))


def crossing_words(
    yarns: Sequence[Yarn], cell: Floats, direction: ArrayLike = (0.0, 0.0, 1.0)
) -> list[list[tuple[int, tuple[int, int], bool]]]:
    """List the crossings along each yarn: the other yarn, its cell, whether this one is above."""
    # Pairs of crossings that are no change are left out.
    found = find_crossings(yarns, cell, direction)
    passages: dict[int, list[tuple[float, _Passage]]] = defaultdict(list)
    for number, (pair, where, shift) in enumerate(
        zip(found.yarns.tolist(), found.parameters.tolist(), found.shift.tolist(), strict=True)
    ):
        back = (-shift[0], -shift[1])
        passages[pair[0]].append((where[0], _Passage(number, pair[1], tuple(shift), True)))
        passages[pair[1]].append((where[1], _Passage(number, pair[0], back, False)))
    words = [[each for _, each in sorted(passages[k])] for k in range(len(yarns))]
    while (pair := _find_pair(words)) is not None:
        words = [[each for each in word if each.crossing not in pair] for word in words]
    return [[each[1:] for each in word] for word in words]


def same_words(
    first: Sequence[Sequence[tuple[int, tuple[int, int], bool]]],
    second: Sequence[Sequence[tuple[int, tuple[int, int], bool]]],
    periods: Sequence[tuple[int, int] | None],
) -> bool:
    """Check whether yarns have the same crossings, wherever their words begin."""
    return all(
        _same_word(list(a), list(b), own, periods)
        for a, b, own in zip(first, second, periods, strict=True)
    )


def _same_word(
    first: list[tuple[int, tuple[int, int], bool]],
    second: list[tuple[int, tuple[int, int], bool]],
    own: tuple[int, int] | None,
    periods: Sequence[tuple[int, int] | None],
) -> bool:
    if len(first) != len(second):
        return False

    def letters(word: list[tuple[int, tuple[int, int], bool]], turned: int) -> list[object]:
        found: list[object] = []
        for place in range(len(word)):
            turn, index = divmod(place + turned, len(word))
            other, shift, above = word[index]
            # In the next period of this yarn, its neighbours are those of the next cell.
            moved = tuple(shift[k] + turn * (own or (0, 0))[k] for k in range(2))
            found.append((other, _strand(moved, periods[other]), above))
        return found

    rotations = range(len(first)) if own is not None else (0,)
    wanted = letters(first, 0)
    size = len(first)
    return not first or any(
        letters(second, turned) == wanted for start in rotations for turned in (start, start - size)
    )


def _strand(shift: tuple[int, ...], periods: tuple[int, int] | None) -> tuple[int, ...]:
    """Return a number for the line that a yarn and its images in the direction of it form."""
    if not periods or not any(periods):
        return shift
    a, b = periods
    along = (shift[0] * a + shift[1] * b) // (a * a + b * b)
    return shift[0] - along * a, shift[1] - along * b


def _find_pair(words: Sequence[Sequence[_Passage]]) -> set[int] | None:
    """Find two crossings that are neighbours on both of their yarns, with the same one above."""
    beside: dict[frozenset[int], int] = defaultdict(int)
    for word in words:
        for one, two in zip(word, [*word[1:], *word[:1]], strict=True):
            if one.crossing != two.crossing and one[1:] == two[1:]:
                beside[frozenset((one.crossing, two.crossing))] += 1
    return next((set(pair) for pair, count in beside.items() if count >= 2), None)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
