"""Bernstein polynomials, arcs by cubics, and VTK's point order of a Bézier quadrilateral.

Source: G. Farin, "Curves and Surfaces for CAGD", chapters 4 and 5; the point order is that of
``vtkHigherOrderQuadrilateral::PointIndexFromIJK``.
"""

from __future__ import annotations

from math import comb, tan

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats, Ints


def bernstein(degree: int, t: ArrayLike) -> Floats:
    """Evaluate the Bernstein polynomials of a degree.

    Parameters
    ----------
    degree : int
        Degree.
    t : array_like, shape (n,)
        Parameters from 0 to 1.

    Returns
    -------
    ndarray, shape (n, degree + 1)
        Values.
    """
    values = np.asarray(t, dtype=np.float64).reshape(-1, 1)
    power = np.arange(degree + 1)
    binomial = np.array([comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    return binomial * values**power * (1.0 - values) ** power[::-1]


def bernstein_derivative(degree: int, t: ArrayLike) -> Floats:
    """Evaluate the first derivatives of the Bernstein polynomials of a degree.

    Parameters
    ----------
    degree : int
        Degree.
    t : array_like, shape (n,)
        Parameters from 0 to 1.

    Returns
    -------
    ndarray, shape (n, degree + 1)
        Derivatives.
    """
    lower = degree * bernstein(degree - 1, t)
    result = np.zeros((len(lower), degree + 1))
    result[:, 1:] = lower
    result[:, :-1] -= lower
    return result


def arc_handle(angle: float) -> float:
    """Return the handle length, over the radius, of the cubic that approximates an arc."""
    # The cubic meets the arc at its ends and its middle, and has its tangents at the ends. Its
    # largest radial error, over the radius, is 3.7e-7 for 30 degrees, 2.4e-5 for 60 and 2.7e-4 for
    # 90. It grows with the sixth power of the angle.
    return 4.0 / 3.0 * tan(angle / 4.0)


def rational_handles(angle: Floats | float) -> tuple[Floats, Floats]:
    """Compute handles and weights of rational cubics that are exact arcs below half a turn."""
    total = 1.0 + 2.0 * np.cos(0.5 * angle)
    return 2.0 * np.sin(0.5 * angle) / total, total / 3.0


def quadrilateral_order(p: int, q: int) -> Ints:
    """Number the points of a tensor-product patch as in VTK's Bézier quadrilateral.

    Parameters
    ----------
    p, q : int
        Degrees along u and v.

    Returns
    -------
    ndarray of int, shape ((p + 1) (q + 1),)
        Columns of a cell's connectivity, u running fastest.
    """
    # VTK lists the four corners first, then the inner points of the four edges, then those of the
    # face.
    if min(p, q) < 1:
        raise InputError(
            "the degree is too low", key="degree", value=min(p, q), allowed="at least 1"
        )
    order = np.empty((q + 1, p + 1), dtype=np.int64)
    order[0, 0], order[0, p], order[q, p], order[q, 0] = range(4)
    # Opposite edges run in the same direction, not around the face.
    first = 4
    for edge in (order[0, 1:p], order[1:q, p], order[q, 1:p], order[1:q, 0]):
        edge[:] = np.arange(first, first + len(edge))
        first += len(edge)
    order[1:q, 1:p] = np.arange(first, order.size).reshape(q - 1, p - 1)
    return order.ravel()
