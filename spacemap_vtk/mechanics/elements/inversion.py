"""Elements that a displacement turns inside out.

The elements of a solid are its tetrahedra (of quadratic ones, the corners). Those of a sheet are
its quadrilaterals; one is inside out if its upper side lies below the lower one. A sheet may fold
more tightly than it is thick, which turns some of its tetrahedra inside out and is not an error.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.ndarrays import Floats, Ints

#: An element whose volume falls below this share of its original volume is flat, and the sign of
#: its volume is rounding.
_FLAT = 1e-9


def count_inverted(
    points: Floats, displacement: Floats, cells: Ints, surface: MidSurface | None = None
) -> int:
    """Count the elements that a displacement turns inside out.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices, undeformed or in equilibrium [m].
    displacement : ndarray of float64, shape (V, 3)
        Displacement from there [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.
    surface : MidSurface, optional
        Mid-surface, if the cage is a sheet.

    Returns
    -------
    int
        Number of tetrahedra, or of quadrilaterals of a sheet.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> count_inverted(corners, -2 * corners, np.array([[0, 1, 2, 3]]))
    1
    """
    before, after = (_handedness(at, cells, surface) for at in (points, points + displacement))
    return int(np.count_nonzero(after / before < -_FLAT))


def _handedness(points: Floats, cells: Ints, surface: MidSurface | None) -> Floats:
    """Compute the triple product of three directions in each element."""
    if surface is None:
        corner = points.T.take(cells[:, :4].T, axis=1)  # (3, 4, T)
        first, second, third = (corner[:, k] - corner[:, 0] for k in (1, 2, 3))
    else:
        middle, half = np.split(surface.to_nodes(points), 2)
        middle, half = (part.T.take(surface.quads.T, axis=1) for part in (middle, half))
        first, second = middle[:, 2] - middle[:, 0], middle[:, 3] - middle[:, 1]
        third = half.sum(axis=1)
    return np.asarray(
        first[0] * (second[1] * third[2] - second[2] * third[1])
        + first[1] * (second[2] * third[0] - second[0] * third[2])
        + first[2] * (second[0] * third[1] - second[1] * third[0])
    )
