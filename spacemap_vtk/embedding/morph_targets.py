"""Few shapes of which a motion is a sum at any time, as animations in other programs have it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class MorphTargets(NamedTuple):
    """Shapes and how much of each there is at some times."""

    #: Displacements at full weight [m], (K, n, 3); orthogonal to each other.
    shapes: FloatArray
    #: From -1 to 1, (T, K), their columns orthogonal, too.
    weights: FloatArray
    #: The largest distance of any point at any time from where it should be [m].
    error: float


def morph_targets(displacements: NDArray[np.floating], tolerance: float) -> MorphTargets:
    """Find the fewest leading singular shapes that keep every point near its place at every time.

    Parameters
    ----------
    displacements : ndarray of float, shape (T, n, 3)
        Of n points at T times [m], from where they are drawn without any shape. Or (T, n, 1), of
        any number that each point has: then shapes and error are such numbers.
    tolerance : float
        Largest distance [m]. Of what is inside a cage the same holds as of the cage's vertices: a
        mean of theirs with weights that are positive and add up to 1 is no further off than they.

    Returns
    -------
    MorphTargets
        Of no shapes where nothing moves further than that. The error is above the tolerance only
        where that is less than the rounding of the displacements.

    Notes
    -----
    A singular value decomposition of the displacements, (T, 3n): its first K terms are the nearest
    of all matrices of rank K in the mean of squares (Eckart and Young, 1936); here the largest
    distance counts, so that terms are taken away until it is small enough.

    Examples
    --------
    >>> import numpy as np
    >>> from spacemap_vtk.embedding.morph_targets import morph_targets
    >>> swing = np.sin(np.linspace(0.0, 6.0, 50))[:, None, None] * np.ones((4, 3))
    >>> morph_targets(swing, 1e-9).weights.shape
    (50, 1)
    """
    left = displacements.reshape(len(displacements), -1).astype(np.float64)
    # of little moving much, or much moving little: times need not be fewer than coordinates
    times, sizes, shapes = np.linalg.svd(left, full_matrices=False)
    parts = displacements.shape[-1]
    count, error = 0, _largest(left, parts)
    while error > tolerance and count < len(sizes):
        left -= np.outer(times[:, count] * sizes[count], shapes[count])
        count, error = count + 1, _largest(left, parts)
    weights = times[:, :count] * sizes[:count]
    peaks = np.abs(weights).max(axis=0, initial=0.0)
    kept = peaks > 0.0  # of what does not move at all a column of zeros may come
    weights, peaks = weights[:, kept], peaks[kept]
    full = shapes[:count][kept] * peaks[:, None]
    return MorphTargets(full.reshape(-1, *displacements.shape[1:]), weights / peaks, error)


def _largest(displacements: FloatArray, parts: int) -> float:
    squares = np.square(displacements).reshape(len(displacements), -1, parts).sum(axis=2)
    return float(np.sqrt(squares.max(initial=0.0)))
