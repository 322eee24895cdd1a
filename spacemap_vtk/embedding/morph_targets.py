"""Decompose a motion into a few shapes with weights over time, as other animation programs do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks

#: Largest product of points and times that is decomposed.
_POINTS = 2**20
#: Number of points per block of targets.
_PART = 2**15


class MorphTargets(NamedTuple):
    """Shapes, and their weights at some times."""

    #: Displacements at full weight [m], (K, n, 3); orthogonal to each other.
    shapes: Floats
    #: From -1 to 1, (T, K); columns are orthogonal too.
    weights: Floats
    #: Largest distance of any point at any time from its true position [m].
    error: float


def find_morph_targets(displacements: NDArray[np.floating], tolerance: float) -> MorphTargets:
    """Find the fewest leading singular shapes that keep every point within a tolerance.

    Parameters
    ----------
    displacements : ndarray of float, shape (T, n, 3)
        Displacements of n points at T times [m], relative to the drawing without shapes. Or
        (T, n, 1) for one number per point; then shapes and error are such numbers.
    tolerance : float
        Largest distance [m]. If it holds for the vertices of a cage, it holds for points inside:
        they are means of vertices with positive weights that add up to 1.

    Returns
    -------
    MorphTargets
        No shapes if nothing moves further than the tolerance. The error exceeds the tolerance only
        if this is less than the rounding of the displacements. For very many points (a million over
        all times) an evenly chosen part decides, and the error is that of this part.

    Notes
    -----
    Uses a singular value decomposition of the displacements, (T, 3n). Its first K terms are the
    closest matrix of rank K in the mean of squares (Eckart and Young, 1936). Here the largest
    distance counts, so terms are subtracted until it is small enough.

    Examples
    --------
    >>> import numpy as np
    >>> from spacemap_vtk.embedding.morph_targets import find_morph_targets
    >>> swing = np.sin(np.linspace(0.0, 6.0, 50))[:, None, None] * np.ones((4, 3))
    >>> find_morph_targets(swing, 1e-9).weights.shape
    (50, 1)
    """
    count, points, parts = displacements.shape
    # Of many points, an evenly chosen part is enough, because neighbours move alike.
    few = displacements[:, :: -(-points * count // _POINTS)]
    left = few.reshape(count, -1).astype(np.float64)
    # The reduced form serves both shapes of matrix: many times of few points, or the reverse.
    times = np.linalg.svd(left, full_matrices=False)[0]
    count_used, error = 0, _largest_distance(left, parts)
    while error > tolerance and count_used < times.shape[1]:
        left -= np.outer(times[:, count_used], times[:, count_used] @ left)
        count_used, error = count_used + 1, _largest_distance(left, parts)
    weights = times[:, :count_used]
    shapes = np.empty((count_used, points, parts))
    for some in blocks(points, _PART):  # in blocks: all in double precision would not fit
        part = displacements[:, some].reshape(count, -1)
        made = weights.T @ part.astype(np.float64)
        shapes[:, some] = made.reshape(count_used, part.shape[1] // parts, parts)
    peaks = np.abs(weights).max(axis=0, initial=0.0)
    # If nothing moves, there may be terms that are zero.
    kept = (peaks > 0.0) & shapes.any(axis=(1, 2))
    weights, peaks = weights[:, kept], peaks[kept]
    return MorphTargets(shapes[kept] * peaks[:, None, None], weights / peaks, error)


def _largest_distance(displacements: Floats, parts: int) -> float:
    squares = np.square(displacements).reshape(len(displacements), -1, parts).sum(axis=2)
    return float(np.sqrt(squares.max(initial=0.0)))
