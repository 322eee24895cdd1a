"""How far each point of a fabric's surface is from the next yarn, as the fabric lies now.

`yarn_clearance` finds the least distance of a cloth as woven, exactly; here the yarns are surfaces
of points, moved in any way, and every point gets its distance. Nearest points are found with trees:
two different numbers of yarns differ in some binary digit, so for each digit the points of yarns
with a 1 are looked up among those with a 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def gaps(
    points: ArrayLike, normals: ArrayLike, yarn: ArrayLike, reach: float
) -> NDArray[np.float64]:
    """Return the distance from each point to the surface of the next other yarn.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Points of the yarns' surfaces, in m.
    normals : (n, 3) array_like of float
        Their outward unit normals.
    yarn : (n,) array_like of int
        The yarn of each, from 0 on.
    reach : float
        Half the distance between neighbouring points of a surface, in m: so far around a point its
        surface is taken for flat, which leaves an error of ``reach**2 / diameter``.

    Returns
    -------
    (n,) ndarray of float64
        In m; below 0 where yarns overlap, infinite where there is one yarn only.

    Examples
    --------
    >>> gaps([[0, 0, 0], [0, 0.2, 1]], [[0, 0, 1], [0, 0, -1]], [0, 1], reach=0.3).tolist()
    [1.0, 1.0]
    """
    from scipy.spatial import cKDTree  # with all it brings: a tenth of a second

    place = np.asarray(points, np.float64)
    outward, number = np.asarray(normals, np.float64), np.asarray(yarn, np.int64)
    found = np.full(len(place), np.inf)
    for digit in range(int(number.max(initial=0)).bit_length()):
        side = (number >> digit & 1).astype(bool)
        groups = np.flatnonzero(side), np.flatnonzero(~side)
        for mine, others in (groups, groups[::-1]):
            if len(mine) and len(others):
                _, nearest = cKDTree(place[others]).query(place[mine], workers=-1)
                there = others[nearest]
                away = place[mine] - place[there]
                across = np.einsum("nk,nk->n", away, outward[there])
                along = np.linalg.norm(away - across[:, None] * outward[there], axis=1)
                beyond = np.maximum(along - reach, 0.0)
                distance = np.where(beyond > 0.0, np.hypot(across, beyond), across)
                found[mine] = np.minimum(found[mine], distance)
    return found
