"""Few shapes of which a motion is a sum at any time, as animations in other programs have it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks

#: Points times times that are decomposed, and points of which targets are made together.
_POINTS, _PART = 2**20, 2**15


class MorphTargets(NamedTuple):
    """Shapes and how much of each there is at some times."""

    #: Displacements at full weight [m], (K, n, 3); orthogonal to each other.
    shapes: Floats
    #: From -1 to 1, (T, K), their columns orthogonal, too.
    weights: Floats
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
        where that is less than the rounding of the displacements. Of very many points (a million
        over all times) evenly chosen ones decide, and the error is theirs.

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
    count, points, parts = displacements.shape
    # Of many points as many as say what the others do: neighbours move alike.
    few = displacements[:, :: -(-points * count // _POINTS)]
    left = few.reshape(count, -1).astype(np.float64)
    # of little moving much, or much moving little: times need not be fewer than coordinates
    times = np.linalg.svd(left, full_matrices=False)[0]
    taken, error = 0, _largest(left, parts)
    while error > tolerance and taken < times.shape[1]:
        left -= np.outer(times[:, taken], times[:, taken] @ left)
        taken, error = taken + 1, _largest(left, parts)
    weights = times[:, :taken]
    shapes = np.empty((taken, points, parts))
    for some in blocks(points, _PART):  # all in double precision would not fit
        part = displacements[:, some].reshape(count, -1)
        made = weights.T @ part.astype(np.float64)
        shapes[:, some] = made.reshape(taken, part.shape[1] // parts, parts)
    peaks = np.abs(weights).max(axis=0, initial=0.0)
    # of what does not move at all there may be terms of nothing
    kept = (peaks > 0.0) & shapes.any(axis=(1, 2))
    weights, peaks = weights[:, kept], peaks[kept]
    return MorphTargets(shapes[kept] * peaks[:, None, None], weights / peaks, error)


def _largest(displacements: Floats, parts: int) -> float:
    squares = np.square(displacements).reshape(len(displacements), -1, parts).sum(axis=2)
    return float(np.sqrt(squares.max(initial=0.0)))
