"""Distance of each point of a fabric's surface from the next yarn, in the fabric's current state.

`yarn_clearance` finds the least distance of a cloth at rest exactly. Here yarns are surfaces of
points that may have moved in any way, and every point gets a distance. Trees find nearest points.
Two different yarn numbers have a lowest binary digit in which they differ. So for each digit, yarns
that agree in the lower digits are searched among each other, those with 0 against those with 1.
Where the lowest digits differ between neighbours, yarns that differ in higher digits only are far
apart, and their search ends soon.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.ndarrays import AnyFloats, Bools, Floats, Ints
from spacemap_vtk.textile.weave.cloth import Cloth

#: Distances that differ by less than this share of the largest coordinate count as equal, for
#: points in single precision.
_TOLERANCE = 16 * float(np.finfo(np.float32).eps)


def point_clearances(
    points: ArrayLike,
    normals: ArrayLike,
    yarn: ArrayLike,
    reach: ArrayLike,
    measured: Bools | None = None,
    surface: Bools | None = None,
) -> Floats:
    """Compute the distance from each point to the surface of the nearest other yarn.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Points of the yarns' surfaces, in m.
    normals : (n, 3) array_like of float
        Their outward unit normals.
    yarn : (n,) array_like of int
        Yarn of each point, from 0.
    reach : float or (n,) array_like of float
        Half the distance between neighbouring points of a surface, in m. Within it the surface
        around a point counts as flat, with an error of ``reach**2 / diameter``.
    measured : (n,) ndarray of bool, optional
        Points that get a distance; by default all.
    surface : (n,) ndarray of bool, optional
        Points that define the surfaces; by default all. One of several coincident points is enough.

    Returns
    -------
    (n,) ndarray of float64
        In m; negative where yarns overlap, infinite if there is only one yarn or for other points.

    Examples
    --------
    >>> points, normals = [[0, 0, 0], [0, 0.2, 1]], [[0, 0, 1], [0, 0, -1]]
    >>> point_clearances(points, normals, [0, 1], reach=0.3).tolist()
    [1.0, 1.0]
    """
    from scipy.spatial import cKDTree  # imported here: it takes a tenth of a second

    place = np.asarray(points, np.float64)
    outward, number = np.asarray(normals, np.float64), np.asarray(yarn, np.int64)
    around = np.broadcast_to(np.asarray(reach, np.float64), len(place))
    found, farthest = np.full(len(place), np.inf), float(around.max(initial=0.0))
    tied = _TOLERANCE * float(np.abs(place).max(initial=0.0))
    is_measured, is_surface = (
        np.ones(len(place), bool) if some is None else some for some in (measured, surface)
    )

    def update_distances(mine: Ints, others: Ints) -> None:
        """Update the distances of some points to the nearest of some others."""
        mine, others = mine[is_measured[mine]], others[is_surface[others]]
        if not len(mine) or not len(others):
            return
        most = float(found[mine].max()) + farthest  # points beyond cannot be nearer
        # Four points may be equally near up to rounding, as at a cut end, which would choose one.
        distance, nearest = cKDTree(place[others]).query(
            place[mine], k=4, distance_upper_bound=most, workers=-1
        )
        row, column = np.nonzero(np.isfinite(distance) & (distance <= distance[:, :1] + tied))
        mine, there = mine[row], others[nearest[row, column]]
        away = place[mine] - place[there]
        across = np.einsum("nk,nk->n", away, outward[there])
        along = np.linalg.norm(away - across[:, None] * outward[there], axis=1)
        beyond = np.maximum(along - around[there], 0.0)
        np.minimum.at(found, mine, np.where(beyond > 0.0, np.hypot(across, beyond), across))

    groups = [np.arange(len(place))]
    for digit in range(int(number.max(initial=0)).bit_length()):
        halves = [(g[number[g] >> digit & 1 == 0], g[number[g] >> digit & 1 == 1]) for g in groups]
        for zeros, ones in halves:
            update_distances(zeros, ones)
            update_distances(ones, zeros)
        groups = [half for two in halves for half in two if len(half)]
    return found


def average_at_crossings(
    cloth: Cloth,
    part: tuple[slice, slice],
    facets: tuple[ArrayLike, Floats, Floats],
    values: AnyFloats,
) -> Floats:
    """Average values over the outward halves of the yarns at some crossings.

    Parameters
    ----------
    cloth : Cloth
        At rest.
    part : (slice, slice)
        Ends and picks of these crossings.
    facets : tuple
        Yarn of each facet (n,), ends before picks; x and y of its centre at rest (n, 2), in m; and
        the area that it covers seen from above (n,), negative if it faces down.
    values : (n,) ndarray of float
        Values to average.

    Returns
    -------
    (2, picks, ends) ndarray of float64
        Means for the end and the pick of each crossing; NaN where there is no facet.
    """
    numbers, middle, area = np.asarray(facets[0], np.int64), *facets[1:]
    family = (numbers >= cloth.size[0]).astype(np.int64)
    place = []
    for number, some in enumerate(part):
        at = cloth.yarns[number].position
        crossed = np.searchsorted(0.5 * (at[1:] + at[:-1]), middle[:, number])
        own = numbers - cloth.size[0] * number
        place.append(np.where(family == number, own, crossed) - some.start)
    drawdown = cloth.drawdown[part[1], part[0]]
    shape = 2, *drawdown.shape
    there = (place[0] >= 0) & (place[0] < shape[2]) & (place[1] >= 0) & (place[1] < shape[1])
    which, row, column = family[there], place[1][there], place[0][there]
    above = drawdown[row, column] == (which == 0)
    weight = np.maximum(np.where(above, area[there], -area[there]), 0.0)
    cell = np.ravel_multi_index((which, row, column), shape)
    total = np.bincount(cell, weight, drawdown.size * 2)
    summed = np.bincount(cell, weight * values[there], len(total))
    with np.errstate(invalid="ignore"):
        return np.asarray(summed / total).reshape(shape)


def extrapolate_values(
    weaves: Ints, over: Bools, strains: Floats, cells: Ints, known: Ints, values: Floats
) -> NDArray[np.float32]:
    """Extrapolate values from known crossings to all, by local weave and strain.

    Parameters
    ----------
    weaves : (picks, ends) ndarray of int64
        Number of the local weave of each crossing.
    over : (picks, ends) ndarray of bool
        The drawdown.
    strains : (cells, k) ndarray of float64
        Strains of the cloth.
    cells : (picks, ends) ndarray of int64
        Cell of each crossing.
    known : (m,) ndarray of int64
        Known crossings, numbered row by row.
    values : (2, m) ndarray of float64
        Their values, for warp and weft.

    Returns
    -------
    (2, picks, ends) ndarray of float32
        Crossings of one weave have one value at rest. Strain changes it linearly, with one fit for
        all yarns that lie over and one for all that lie under.
    """
    found = np.zeros((2, *weaves.shape), np.float32)
    weave, lies, strain = weaves.ravel()[known], over.ravel()[known], strains[cells.ravel()[known]]
    count = int(weaves.max()) + 1
    for made, given in zip(found, values, strict=True):
        for state in (False, True):
            mine = (lies == state) & np.isfinite(given)
            if not mine.any():
                continue
            own, samples = weave[mine], np.column_stack([strain[mine], given[mine]])
            number = np.maximum(np.bincount(own, minlength=count), 1)
            sums = [np.bincount(own, column, count) / number for column in samples.T]
            mean = np.stack(sums, axis=1)
            mean[np.bincount(own, minlength=count) == 0] = samples.mean(axis=0)
            apart = samples - mean[own]
            slope = np.linalg.lstsq(apart[:, :-1], apart[:, -1], rcond=1e-6)[0]
            at_rest = (mean[:, -1] - mean[:, :-1] @ slope).astype(np.float32)
            bent = (strains @ slope).astype(np.float32)
            chosen = over == state
            made[chosen] = at_rest[weaves[chosen]] + bent[cells[chosen]]
    return found
