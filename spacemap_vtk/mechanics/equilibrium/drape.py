"""Drape of cloth: the shadow of a surface, and Cusick's drape coefficient."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats, Ints

#: Number of lines on which a shadow is measured: four digits are correct, or all for a polygon
#: between lines.
LINES = 2000


def shadow_area(points: Floats, triangles: Ints, direction: ArrayLike, lines: int = LINES) -> float:
    """Compute the area of a surface's shadow, in which overlapping parts count once.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    triangles : ndarray of int64, shape (T, 3)
        Triangles of the surface, with any orientation.
    direction : array_like of float, shape (3,)
        Direction of parallel light; any length but zero.
    lines : int
        Number of parallel lines on which the covered length is summed; on each the sum is exact.

    Returns
    -------
    float
        Area [m²].

    Raises
    ------
    InputError
        If the direction is zero.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0]])
    >>> shadow_area(corners, np.array([[0, 1, 2], [0, 2, 3]]), [0, 0, -1])
    6.0
    """
    light = np.asarray(direction, dtype=np.float64)
    if not light.any():
        raise InputError("the direction of the light must not be zero")
    # In the SVD of the light's direction, the last two rows span the plane across it.
    plane = np.linalg.svd(light[None])[2][1:]
    corners = (points @ plane.T)[triangles]
    corners = np.take_along_axis(corners, corners[..., 1:].argsort(axis=1), axis=1)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    width, height = high - low
    if not (width > 0 and height > 0):
        return 0.0
    step = height / lines
    # Which lines cross which triangle, at heights (k + ½) step.
    ends = np.ceil((corners[:, ::2, 1] - low[1]) / step - 0.5).astype(np.int64)
    counts = ends[:, 1] - ends[:, 0]
    owner = np.repeat(np.arange(len(corners)), counts)
    line = np.arange(len(owner)) - np.repeat(counts.cumsum() - counts - ends[:, 0], counts)
    (x0, y0), (x1, y1), (x2, y2) = corners[owner].transpose(1, 2, 0)
    y = low[1] + (line + 0.5) * step
    upper = y > y1
    xa, ya, xb, yb = (np.where(upper, *pair) for pair in ((x1, x0), (y1, y0), (x2, x1), (y2, y1)))
    with np.errstate(divide="ignore", invalid="ignore"):
        short = np.where(yb > ya, xa + (xb - xa) * (y - ya) / (yb - ya), xb)
    long = x0 + (x2 - x0) * (y - y0) / (y2 - y0)
    # All lines are laid end to end on one line. An interval that overlaps earlier ones counts only
    # from where they end.
    place = line * 2 * width - low[0]
    start, end = np.minimum(long, short) + place, np.maximum(long, short) + place
    order = start.argsort()
    start, end = start[order], end[order]
    reached = np.maximum.accumulate(np.concatenate([[-np.inf], end[:-1]]))
    return float(np.maximum(end - np.maximum(start, reached), 0.0).sum() * step)


def drape_coefficient(shadow: float, cloth: float, disc: float) -> float:
    """Compute which share of the cloth that overhangs a disc its shadow covers.

    Parameters
    ----------
    shadow : float
        Area of the shadow of the draped cloth, disc included [m²].
    cloth : float
        Area of the cloth, laid flat [m²].
    disc : float
        Area of the disc [m²].

    Returns
    -------
    float
        1 for a stiff plate, 0 for cloth that hangs straight down.

    Raises
    ------
    InputError
        If no cloth overhangs the disc.

    Notes
    -----
    G. E. Cusick, "The measurement of fabric drape", J. Textile Inst. 59 (1968) T253; ISO 9073-9.
    In this standard test the cloth is round with a diameter of 300 mm, and the disc has 180 mm.

    Examples
    --------
    >>> drape_coefficient(shadow=0.05, cloth=0.09, disc=0.02)
    0.42857142857142855
    """
    if not cloth > disc >= 0.0:
        raise InputError(
            "the disc must be smaller than the cloth", value=disc, allowed=f"below {cloth:.4g} m²"
        )
    return (shadow - disc) / (cloth - disc)
