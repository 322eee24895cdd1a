"""How cloth drapes: the shadow of a shape, and Cusick's drape coefficient."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats, Ints

#: Lines on which a shadow is measured: four digits of it hold, and all of a polygon between lines.
LINES = 2000


def shadow(points: Floats, triangles: Ints, direction: ArrayLike, lines: int = LINES) -> float:
    """Return the area of the shadow of a surface: what lies one above the other counts once.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    triangles : ndarray of int64, shape (T, 3)
        Of the surface, turned either way.
    direction : array_like of float, shape (3,)
        Of parallel light, of any length but zero.
    lines : int
        Number of parallel lines on which the covered length is summed, exactly on each.

    Returns
    -------
    float
        In m².

    Raises
    ------
    InputError
        If the direction is zero.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0]])
    >>> shadow(corners, np.array([[0, 1, 2], [0, 2, 3]]), [0, 0, -1])
    6.0
    """
    light = np.asarray(direction, dtype=np.float64)
    if not light.any():
        raise InputError("light of no direction casts no shadow")
    # The plane across the light: the last rows of what has it as its first.
    plane = np.linalg.svd(light[None])[2][1:]
    corners = (points @ plane.T)[triangles]
    corners = np.take_along_axis(corners, corners[..., 1:].argsort(axis=1), axis=1)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    width, height = high - low
    if not (width > 0 and height > 0):
        return 0.0
    step = height / lines
    # Which lines meet which triangle, at heights (k + ½) step.
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
    # Lines one after the other on a single one; of what overlaps only what reaches further counts.
    place = line * 2 * width - low[0]
    start, end = np.minimum(long, short) + place, np.maximum(long, short) + place
    order = start.argsort()
    start, end = start[order], end[order]
    reached = np.maximum.accumulate(np.concatenate([[-np.inf], end[:-1]]))
    return float(np.maximum(end - np.maximum(start, reached), 0.0).sum() * step)


def drape_coefficient(shadow: float, cloth: float, disc: float) -> float:
    """Return which share of what hangs over a disc the shadow still covers.

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
        1 for a plate, 0 for what hangs down limply.

    Raises
    ------
    InputError
        If nothing hangs over.

    Notes
    -----
    G. E. Cusick, "The measurement of fabric drape", J. Textile Inst. 59 (1968) T253; ISO 9073-9.
    There the cloth is round, of 300 mm, and the disc has 180 mm.

    Examples
    --------
    >>> drape_coefficient(shadow=0.05, cloth=0.09, disc=0.02)
    0.42857142857142855
    """
    if not cloth > disc >= 0.0:
        raise InputError(
            "no cloth hangs over the disc", value=disc, allowed=f"less than {cloth:.4g} m²"
        )
    return (shadow - disc) / (cloth - disc)
