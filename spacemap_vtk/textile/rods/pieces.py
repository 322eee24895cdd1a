"""Pieces of textiles: yarns of a cell, repeated; and figures of a cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Places across and along a cell at which it is seen whether a yarn covers them.
_GRID = 96


def repeat_yarns(
    yarns: Sequence[Yarn], cell: Floats, repeats: Sequence[int]
) -> tuple[list[Floats], Ints]:
    """Repeat the yarns of a cell over a piece.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns that go on along one of the periods; one that repeats itself after m periods becomes
        m yarns side by side.
    cell : ndarray of float64, shape (2, 3)
        Period vectors [m].
    repeats : sequence of int, length 2
        Number of cells along both.

    Returns
    -------
    lines : list of ndarray of float64, shape (n, 3)
        Control points of each yarn [m].
    which : ndarray of int64, shape (lines,)
        Yarn of the cell of each line.
    """
    lines, which = [], []
    for number, yarn in enumerate(yarns):
        periods = yarn.periods or (0, 0)
        axis = 0 if periods[0] else 1
        turns, count = periods[axis], len(yarn.points)
        for beside in range(repeats[1 - axis] if cell[1 - axis].any() else 1):
            for turn in range(turns):
                start = -(turn * count) // turns
                index = start + np.arange(repeats[axis] * count // turns + 3)
                period, index = np.divmod(index, count)
                moved = (turn + turns * period)[:, None] * cell[axis] + beside * cell[1 - axis]
                lines.append(yarn.points[index] + moved)
                which.append(number)
    return lines, np.array(which)


def count_lines(yarns: Sequence[Yarn], cell: Floats, repeats: Sequence[int]) -> Ints:
    """Return the yarn of the cell of each line of a piece, without its points.

    Parameters
    ----------
    yarns : sequence of Yarn
        As for `repeat_yarns`.
    cell : ndarray of float64, shape (2, 3)
        Period vectors [m].
    repeats : sequence of int, length 2
        Number of cells along both.

    Returns
    -------
    ndarray of int64, shape (lines,)
        Numbers of yarns.
    """
    counts = []
    for yarn in yarns:
        periods = yarn.periods or (0, 0)
        axis = 0 if periods[0] else 1
        counts.append(periods[axis] * (repeats[1 - axis] if cell[1 - axis].any() else 1))
    return np.repeat(np.arange(len(yarns)), counts)


def cover(yarns: Sequence[Yarn], cell: Floats) -> float:
    """Compute the share of a cell along x and y that yarns cover, seen along z.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns of the cell.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, one along x and one along y [m].

    Returns
    -------
    float
        From 0 to 1.
    """
    from scipy.spatial import cKDTree

    at = np.arange(8) / 8
    samples = sample_yarns(yarns, at, np.ones(8))
    place = samples.places(unknowns(yarns, cell))[:, :2]
    sides = np.array([cell[0, 0], cell[1, 1]])
    grid = (np.stack(np.meshgrid(*[np.arange(_GRID)] * 2), axis=-1).reshape(-1, 2) + 0.5) / _GRID
    covered = np.zeros(len(grid), dtype=bool)
    for diameter in np.unique(samples.diameter):
        own = samples.diameter[samples.yarn] == diameter
        tree = cKDTree(np.mod(place[own], sides), boxsize=sides)
        covered |= tree.query(grid * sides)[0] < diameter / 2
    return float(covered.mean())
