"""A number that yarns keep unless they pass through each other: a value of Alexander's polynomial.

Two courses of a knit can be pulled apart, so that their linking numbers are 0 however they are
knitted. What holds a knit is seen in the group of its complement. Each piece of yarn from one
crossing below another yarn to the next has an unknown c; a crossing gives an equation

    c_left = t_over c_right + (1 - t_below) c_over

of the piece above and of the two pieces of the yarn below, left and right of it. Images in other
cells have the same unknown, times u^a v^b. The determinant of the equations is the polynomial of
J. W. Alexander, "Topological Invariants of Knots and Links", Trans. AMS 30 (1928), 275, in the
variables t of each yarn, u and v, but for a unit, t^a u^b v^c. At numbers of modulus 1 its modulus
has no such unit: it depends on nothing but on how the yarns are entangled.

Different yarns may have equal values: one that is tucked has that of one that misses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.crossings import ASKEW, Crossings, find_crossings
from spacemap_vtk.textile.rods.yarns import Yarn

#: Angles of the variables u and v, and of t of the first and of each further yarn [rad]; any.
_PERIODS, _FIRST, _STEP = np.array([1.9, 2.7]), 0.8, 1.3
#: Largest error of a value.
_ERROR = 1e-6


def require_same_crossings(value: float, yarns: Sequence[Yarn], cell: Floats) -> None:
    """Raise GeometryError unless yarns in a cell have the given value of Alexander's polynomial."""
    if abs(alexander_value(yarns, find_crossings(yarns, cell, ASKEW)) - value) > _ERROR:
        raise GeometryError(
            "yarns have passed through each other while they relaxed",
            cure="Choose a longer stitch_length, or a simpler pattern.",
        )


def alexander_value(yarns: Sequence[Yarn], crossings: Crossings) -> float:
    """Compute the logarithm of the modulus of Alexander's polynomial at a fixed place."""
    # Yarns have no ends; the crossings are those in a cell, seen from any direction. The value is
    # equal for yarns that can be moved to each other, in a cell that may change, too.
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    meridian = np.exp(1j * (_FIRST + _STEP * np.arange(len(yarns))))
    periods = np.array([yarn.periods for yarn in yarns]) @ _PERIODS
    over, below = crossings.yarns.T
    # Pieces are numbered along each yarn by the crossing below which they begin.
    order = np.lexsort((crossings.parameters[:, 1], below))
    counts = np.bincount(below, minlength=len(yarns))
    firsts = np.concatenate([[0], np.cumsum(np.maximum(counts, 1))])
    begins = np.split(crossings.parameters[order, 1], np.cumsum(counts)[:-1])
    rows, columns, values = [], [], []

    def add(row: int, yarn: int, number: int, value: complex) -> None:
        turn, number = divmod(number, max(int(counts[yarn]), 1))
        rows.append(row)
        columns.append(int(firsts[yarn]) + number)
        values.append(value * np.exp(1j * turn * periods[yarn]))

    for yarn, count in enumerate(counts):
        if not count:
            add(int(firsts[yarn]), yarn, 0, 1.0)
            add(int(firsts[yarn]), yarn, 1, -1.0)
    places = np.cumsum(np.concatenate([[0], counts[:-1]]))
    for position, crossing in enumerate(order):
        yarn, upper = int(below[crossing]), int(over[crossing])
        number = position - int(places[yarn])
        row = int(firsts[yarn]) + number
        moved = np.exp(1j * float(crossings.shift[crossing] @ _PERIODS))
        right, left = (
            (number - 1, number) if crossings.signs[crossing] > 0 else (number, number - 1)
        )
        at = np.searchsorted(begins[upper], crossings.parameters[crossing, 0], side="right") - 1
        add(row, yarn, left, moved)
        add(row, yarn, right, -moved * meridian[upper])
        add(row, upper, int(at), meridian[yarn] - 1.0)
    shape = (int(firsts[-1]),) * 2
    matrix = csc_matrix((values, (rows, columns)), shape=shape)
    if not periods.any():
        # The equations of a knot are dependent: any one follows from the others.
        matrix = matrix[:-1, :-1]
    factors = splu(matrix)
    return float(np.log(abs(factors.U.diagonal())).sum())
