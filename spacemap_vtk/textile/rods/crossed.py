"""Textiles of ends along y and picks along x in a given cell: wire mesh and leno.

Their yarns are taut: bent by what they cross, and straight elsewhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.rods.crossings import Crossings, find_crossings
from spacemap_vtk.textile.rods.guess import Guess, make_taut
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points between two crossings.
POINTS = 8
#: How far the crossing end of a leno lies beside the standing one in the drawing, in diameters.
_BESIDE = 1.2


def straight_yarn(along: int, place: Floats, length: float, points: int, diameter: float) -> Yarn:
    """Draw a straight yarn along x (0) or y (1) through a place, that repeats itself."""
    line = np.tile(np.asarray(place, dtype=np.float64), (points, 1))
    line[:, along] += np.arange(points) * length / points
    return Yarn(line, (1, 0) if along == 0 else (0, 1), diameter)


def draw_mesh(over: Bools, spacings: ArrayLike, diameters: ArrayLike) -> Guess:
    """Draw a plain mesh or any other weave of one layer.

    Parameters
    ----------
    over : ndarray of bool, shape (picks, ends)
        Whether each end is above each pick.
    spacings : array_like of float, shape (2,)
        Spacing of the ends, and of the picks [m].
    diameters : array_like of float, shape (2,)
        Diameters of both [m].

    Returns
    -------
    Guess
        The ends, and then the picks, of a repeat.
    """
    picks, ends = over.shape
    across, along = np.asarray(spacings, dtype=np.float64)
    first, second = np.asarray(diameters, dtype=np.float64)
    cell = np.array([[ends * across, 0.0, 0.0], [0.0, picks * along, 0.0]])
    flat = [
        straight_yarn(1, np.array([(end + 0.5) * across, 0, 0]), cell[1, 1], picks * POINTS, first)
        for end in range(ends)
    ] + [
        straight_yarn(0, np.array([0, (pick + 0.5) * along, 0]), cell[0, 0], ends * POINTS, second)
        for pick in range(picks)
    ]
    crossings = find_crossings(flat, cell)
    end, pick = crossings.yarns.min(axis=1), crossings.yarns.max(axis=1) - ends
    return _lift(flat, cell, crossings, end, over[pick, end])


def draw_leno(spacings: ArrayLike, diameters: ArrayLike) -> Guess:
    """Draw a leno: of each pair of ends, one crosses below the other one between all picks.

    Parameters
    ----------
    spacings : array_like of float, shape (2,)
        Spacing of the pairs of ends, and of the picks [m].
    diameters : array_like of float, shape (2,)
        Diameters of the ends and of the picks [m].

    Returns
    -------
    Guess
        Standing end, crossing end, and two picks. The standing end is below the picks, the
        crossing end above them.
    """
    across, along = np.asarray(spacings, dtype=np.float64)
    first, second = np.asarray(diameters, dtype=np.float64)
    cell = np.array([[across, 0.0, 0.0], [0.0, 2 * along, 0.0]])
    count = 4 * POINTS
    middle = np.array([across / 2, 0.0, 0.0])
    standing = straight_yarn(1, middle, cell[1, 1], count, first)
    crossing = straight_yarn(1, middle, cell[1, 1], count, first)
    crossing.points[:, 0] += _BESIDE * first * np.sin(2 * np.pi * (np.arange(count) - 1) / count)
    picks = [
        straight_yarn(0, np.array([0.0, (pick + 0.5) * along, 0.0]), across, 2 * POINTS, second)
        for pick in range(2)
    ]
    flat = [standing, crossing, *picks]
    crossings = find_crossings(flat, cell)
    low, high = crossings.yarns.min(axis=1), crossings.yarns.max(axis=1)
    # The standing end (0) is above the crossing end (1), below the picks (2, 3), and those below
    # the crossing end.
    return _lift(flat, cell, crossings, low, (low == 1) | (high == 1))


def _lift(
    flat: list[Yarn], cell: Floats, crossings: Crossings, yarn: Ints, is_above: Bools
) -> Guess:
    """Lift flat yarns, given whether one yarn of each crossing is above, and pull them taut."""
    above = np.where(crossings.yarns[:, 0] == yarn, is_above, ~is_above)
    yarns = lift_yarns(flat, crossings, above)
    return Guess(yarns, cell, make_taut(yarns, cell))
