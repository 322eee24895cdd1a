"""Elements that a displacement turns inside out.

A solid's are its tetrahedra, of quadratic ones the corners; a sheet's are its quadrilaterals,
whose upper side then lies below the lower one. A sheet may fold more tightly than it is thick,
which turns tetrahedra of it inside out and is no fault.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.ndarrays import Floats, Ints

#: An element whose volume is a smaller share than this of what it was is flat, and either sign of
#: it is rounding.
_FLAT = 1e-9


def inverted(
    points: Floats, displacement: Floats, cells: Ints, surface: MidSurface | None = None
) -> int:
    """Return how many elements a displacement (V, 3) turns inside out."""
    before, after = (_handedness(at, cells, surface) for at in (points, points + displacement))
    return int(np.count_nonzero(after / before < -_FLAT))


def warning(
    points: Floats, displacement: Floats, cells: Ints, surface: MidSurface | None = None
) -> str:
    """Return a warning of elements that are turned inside out, with their number; empty if none.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices, undeformed or hung [m].
    displacement : ndarray of float64, shape (V, 3)
        From there [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.
    surface : MidSurface, optional
        Of the sheet that the cage is.

    Returns
    -------
    str
        A sentence.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> warning(corners, -2 * corners, np.array([[0, 1, 2, 3]])).split(",")[0]
    '1 of 1 tetrahedra are turned inside out'
    """
    count = inverted(points, displacement, cells, surface)
    if not count:
        return ""
    total, kind = (
        (len(cells), "tetrahedra")
        if surface is None
        else (len(surface.quads), "cells of the sheet")
    )
    return (
        f"{count} of {total} {kind} are turned inside out, and so is what lies in them; lower the "
        "loads or make the cage stiffer"
    )


def _handedness(points: Floats, cells: Ints, surface: MidSurface | None) -> Floats:
    """Return the triple product of three directions in each element."""
    if surface is None:
        corner = points.T.take(cells[:, :4].T, axis=1)  # (3, 4, T)
        one, two, three = (corner[:, k] - corner[:, 0] for k in (1, 2, 3))
    else:
        middle, half = np.split(surface.nodal(points), 2)
        middle, half = (part.T.take(surface.quads.T, axis=1) for part in (middle, half))
        one, two = middle[:, 2] - middle[:, 0], middle[:, 3] - middle[:, 1]
        three = half.sum(axis=1)
    return np.asarray(
        one[0] * (two[1] * three[2] - two[2] * three[1])
        + one[1] * (two[2] * three[0] - two[0] * three[2])
        + one[2] * (two[0] * three[1] - two[1] * three[0])
    )
