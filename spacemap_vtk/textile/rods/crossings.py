"""Which yarn is above at each crossing, seen along a direction; yarns that relax must keep it.

Crossings come and go in pairs, and change their order along a yarn, while yarns move past each
other. What cannot change is the sum of signs of all crossings of two lines: see `linking_numbers`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.rods.contact import neighbouring_cells
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Straight pieces in each span.
_PIECES = 8
#: Direction along which yarns that lie straight above each other do not hide each other.
ASKEW = (0.013, 0.007, 1.0)


class Crossings(NamedTuple):
    """All crossings in a cell, each once."""

    yarns: Ints
    """(c, 2) Yarn above and yarn below."""
    parameters: Floats
    """(c, 2) Parameter of the crossing on both [spans]."""
    shift: Ints
    """(c, 2) Periods by which the yarn below is moved."""
    signs: Ints
    """(c,) 1 where the yarn below runs from the right to the left of the one above, else -1."""


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
    plane[0] *= np.sign(np.linalg.det([*plane, up]))
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
                np.where(over[:, 0], 1, -1) * np.sign(area[on]).astype(np.int64),
            )
        )
    return Crossings(*(np.concatenate(each) for each in zip(*found, strict=True)))


def linking_numbers(yarns: Sequence[Yarn], cell: Floats) -> dict[tuple[int, ...], int]:
    """Sum the signs of the crossings of every two lines that yarns and their images form."""
    # Yarns that do not pass through each other keep these sums, however they move. A key is two
    # yarns and the periods by which the second one is moved. Sums of 0 are left out, and those of a
    # line with itself, which moves can change.
    periods = [yarn.periods or (0, 0) for yarn in yarns]
    found = find_crossings(yarns, cell, ASKEW)
    sums: Counter[tuple[int, ...]] = Counter()
    for pair, shift, sign in zip(
        found.yarns.tolist(), found.shift.tolist(), found.signs.tolist(), strict=True
    ):
        first, second = sorted(pair)
        turned = -1 if pair[0] > pair[1] else 1
        moves = [
            _least_move((way * shift[0], way * shift[1]), periods[first], periods[second])
            for way in ((turned, -turned) if first == second else (turned,))
        ]
        move = min(moves)
        if first != second or move != (0, 0):
            sums[(first, second, *move)] += sign
    return {key: value for key, value in sums.items() if value}


def _least_move(
    move: tuple[int, int], first: tuple[int, int], second: tuple[int, int]
) -> tuple[int, int]:
    """Return the same of all moves that differ by whole periods of two yarns."""
    # Euclid's algorithm on the first components leaves (a, b) and (0, c).
    (a, b), (p, q) = first, second
    while p:
        whole = a // p
        (a, b), (p, q) = (p, q), (a - whole * p, b - whole * q)
    x, y = move
    if a:
        whole = x // a
        x, y = x - whole * a, y - whole * b
    else:
        q = gcd(b, q)
    return x, (y % abs(q) if q else y)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
