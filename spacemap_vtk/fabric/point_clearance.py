"""How far each point of a fabric's surface is from the next yarn, as the fabric lies now.

`yarn_clearance` finds the least distance of a cloth as woven, exactly; here the yarns are surfaces
of points, moved in any way, and every point gets its distance. Nearest points are found with trees:
two different numbers of yarns have a lowest binary digit in which they differ, so for each digit
yarns that agree in those below it are looked up among each other, the ones among the zeros. Where
the lowest digits tell neighbours apart, all that differ in higher ones are far, and soon passed by.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.ndarrays import AnyFloats, Bools, Floats, Ints

#: Of the largest coordinate: so far apart distances are taken for equal, of points in single
#: precision.
_TIED = 16 * float(np.finfo(np.float32).eps)


def gaps(
    points: ArrayLike,
    normals: ArrayLike,
    yarn: ArrayLike,
    reach: ArrayLike,
    asked: Bools | None = None,
    known: Bools | None = None,
) -> Floats:
    """Return the distance from each point to the surface of the next other yarn.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Points of the yarns' surfaces, in m.
    normals : (n, 3) array_like of float
        Their outward unit normals.
    yarn : (n,) array_like of int
        The yarn of each, from 0 on.
    reach : float or (n,) array_like of float
        Half the distance between neighbouring points of a surface, in m: so far around a point its
        surface is taken for flat, which leaves an error of ``reach**2 / diameter``.
    asked : (n,) ndarray of bool, optional
        Which points get their distance; by default all.
    known : (n,) ndarray of bool, optional
        Which points tell where surfaces are; by default all. Of some at the same place one is
        enough.

    Returns
    -------
    (n,) ndarray of float64
        In m; below 0 where yarns overlap, infinite where there is one yarn only, or none is asked.

    Examples
    --------
    >>> gaps([[0, 0, 0], [0, 0.2, 1]], [[0, 0, 1], [0, 0, -1]], [0, 1], reach=0.3).tolist()
    [1.0, 1.0]
    """
    from scipy.spatial import cKDTree  # with all it brings: a tenth of a second

    place = np.asarray(points, np.float64)
    outward, number = np.asarray(normals, np.float64), np.asarray(yarn, np.int64)
    around = np.broadcast_to(np.asarray(reach, np.float64), len(place))
    found, farthest = np.full(len(place), np.inf), float(around.max(initial=0.0))
    tied = _TIED * float(np.abs(place).max(initial=0.0))
    wanted, there_are = (
        np.ones(len(place), bool) if some is None else some for some in (asked, known)
    )

    def look_up(mine: Ints, others: Ints) -> None:
        """Let each of some points know how far the next of some others is."""
        mine, others = mine[wanted[mine]], others[there_are[others]]
        if not len(mine) or not len(others):
            return
        most = float(found[mine].max()) + farthest  # beyond that nothing is nearer
        # four, which may be as near but for rounding, as at a cut end: it would choose one
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

    alike = [np.arange(len(place))]
    for digit in range(int(number.max(initial=0)).bit_length()):
        halves = [(g[number[g] >> digit & 1 == 0], g[number[g] >> digit & 1 == 1]) for g in alike]
        for zeros, ones in halves:
            look_up(zeros, ones)
            look_up(ones, zeros)
        alike = [half for two in halves for half in two if len(half)]
    return found


def crossing_means(
    cloth: Cloth,
    part: tuple[slice, slice],
    facets: tuple[ArrayLike, Floats, Floats],
    values: AnyFloats,
) -> Floats:
    """Return the mean of what is seen of yarns at some crossings: of the half that looks outwards.

    Parameters
    ----------
    cloth : Cloth
        As woven.
    part : (slice, slice)
        Ends and picks that cross there.
    facets : tuple
        Of facets of its yarns: the yarn of each (n,), the ends before the picks; x and y of its
        middle at rest (n, 2), in m; and what it covers, seen from above (n,), below 0 if it looks
        down.
    values : (n,) ndarray of float
        What is to be averaged.

    Returns
    -------
    (2, picks, ends) ndarray of float64
        Of the end and the pick that cross there; NaN where no facet is.
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


def spread_over(
    weaves: Ints, over: Bools, strains: Floats, cells: Ints, known: Ints, values: Floats
) -> NDArray[np.float32]:
    """Return a number for each crossing, where some are known: it goes with weave and strain.

    Parameters
    ----------
    weaves : (picks, ends) ndarray of int64
        Number of the weave round each crossing.
    over : (picks, ends) ndarray of bool
        The drawdown.
    strains : (cells, k) ndarray of float64
        How the cloth is strained.
    cells : (picks, ends) ndarray of int64
        Where.
    known : (m,) ndarray of int64
        Crossings, row by row.
    values : (2, m) ndarray of float64
        Theirs, of warp and weft.

    Returns
    -------
    (2, picks, ends) ndarray of float32
        Crossings of one weave have one number at rest; all that lie over, and all that lie under,
        change it alike with strain, as a linear fit has it.
    """
    found = np.zeros((2, *weaves.shape), np.float32)
    weave, lies, strain = weaves.ravel()[known], over.ravel()[known], strains[cells.ravel()[known]]
    count = int(weaves.max()) + 1
    for made, given in zip(found, values, strict=True):
        for state in (False, True):
            mine = (lies == state) & np.isfinite(given)
            if not mine.any():
                continue
            own, told = weave[mine], np.column_stack([strain[mine], given[mine]])
            number = np.maximum(np.bincount(own, minlength=count), 1)
            sums = [np.bincount(own, column, count) / number for column in told.T]
            mean = np.stack(sums, axis=1)
            mean[np.bincount(own, minlength=count) == 0] = told.mean(axis=0)
            apart = told - mean[own]
            slope = np.linalg.lstsq(apart[:, :-1], apart[:, -1], rcond=1e-6)[0]
            at_rest = (mean[:, -1] - mean[:, :-1] @ slope).astype(np.float32)
            bent = (strains @ slope).astype(np.float32)
            chosen = over == state
            made[chosen] = at_rest[weaves[chosen]] + bent[cells[chosen]]
    return found
