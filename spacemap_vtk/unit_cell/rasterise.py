"""Voxels of the yarns in a box: share of yarn, yarn number and direction of the fibres.

The surface of each yarn is cut into triangles. Each voxel is crossed by a few vertical lines;
between the points where a line enters and leaves a yarn, the voxels are filled exactly.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Ints

#: Corners are rounded to this share of the distance between two lines, so that integer arithmetic
#: decides on which side of an edge a line lies: neighbouring triangles then never share a line.
_GRID = 4096
#: Lines that are tested at a time.
_MOST_TESTS = 2**20
#: Share of lines that may enter a yarn without leaving it.
_MOST_OPEN = 1e-3


@dataclass(frozen=True)
class Voxels:
    """Yarns in a box of voxels; arrays have the shape (nz, ny, nx)."""

    fraction: Floats
    """Share of yarn, 0 to 1."""
    yarn: NDArray[np.int32]
    """Number of the yarn with the largest share; −1 where there is none."""
    direction: Floats
    """Unit tangent of that yarn, (nz, ny, nx, 3); 0 where there is none."""
    area: Floats
    """Area of that yarn's section over its mean area; 1 where there is none."""
    overlap: float
    """Volume of yarns that lies inside other yarns, over the volume of all yarns."""
    base: Floats | None = None
    """Gradient of the map from the box to the repeat, (3, 3), if the repeat is not rectangular.
    Directions and areas are those in the box."""


def rasterise(
    points: Floats,
    tangents: Floats,
    area: Floats,
    yarn: Ints,
    shape: tuple[int, int, int],
    lines: int = 4,
) -> Voxels:
    """Fill voxels with yarns.

    Parameters
    ----------
    points : ndarray, shape (patches, m, n, 3)
        Points of closed surfaces, patch by patch, in voxels: the box reaches from 0 to nx, ny, nz.
        Their normals ∂u × ∂v point all outwards, or all inwards.
    tangents : ndarray, shape (patches, m, n, 3)
        Tangents of the yarns at these points.
    area : ndarray, shape (patches, m, n)
        Area of the yarn's section there, over its mean area.
    yarn : ndarray of int, shape (patches,)
        Yarn of each patch.
    shape : tuple of int
        nx, ny and nz, the numbers of voxels.
    lines : int
        Lines along each side of a voxel.

    Returns
    -------
    Voxels
        Share, number and direction of yarns.

    Raises
    ------
    GeometryError
        If surfaces are not closed inside the box.
    """
    nx, ny, nz = shape
    hits = _cross(points, tangents, area, np.asarray(yarn), lines, nx, ny)
    # Voxel column of each line.
    column = hits.line // (nx * lines) // lines * nx + hits.line % (nx * lines) // lines
    bottom, top = _pair(hits)
    line_yarn, line_column = hits.yarn[bottom], column[bottom]
    direction = hits.tangent[bottom] + hits.tangent[top]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    size = (hits.area[bottom] + hits.area[top]) / 2
    # Yarns in each column of voxels, and their share of each voxel.
    place = line_column * (int(line_yarn.max(initial=0)) + 1) + line_yarn
    found, owner = np.unique(place, return_inverse=True)
    low, high = (np.clip(hits.height[end], 0, nz) for end in (bottom, top))
    shares = _fill(owner, low, high, np.ones(len(owner)), len(found), nz) / lines**2
    along = np.stack(
        [_fill(owner, low, high, part, len(found), nz) for part in (*direction.T, size)], axis=-1
    )
    along /= lines**2
    columns, yarns = np.divmod(found, int(line_yarn.max(initial=0)) + 1)
    return _combine(shares, along, columns, yarns, shape)


@dataclass(frozen=True)
class _Hits:
    """Points where vertical lines cross surfaces."""

    line: Ints
    yarn: Ints
    height: Floats
    side: NDArray[np.int8]
    """1 if the normal points upwards, −1 downwards."""
    tangent: Floats
    area: Floats


def _cross(
    points: Floats, tangents: Floats, area: Floats, yarn: Ints, lines: int, nx: int, ny: int
) -> _Hits:
    """Intersect the triangles of all patches with the vertical lines of nx × ny voxels."""
    # Lines stand at whole numbers in these coordinates.
    flat = np.rint((points[..., :2] * lines - 0.5) * _GRID).astype(np.int64)
    corner: Ints = np.arange(flat[..., 0].size).reshape(flat.shape[:-1])
    a, b, c, d = (
        corner[:, i : corner.shape[1] - 1 + i, j : corner.shape[2] - 1 + j].ravel()
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    # In the order of the corners, du × dv is the normal.
    triangles = np.stack([np.concatenate([a, a]), np.concatenate([b, c]), np.concatenate([c, d])])
    owner = np.repeat(yarn, (corner.shape[1] - 1) * (corner.shape[2] - 1))
    owner = np.concatenate([owner, owner])
    flat = flat.reshape(-1, 2)
    corners = flat[triangles]
    ab, ac = corners[1] - corners[0], corners[2] - corners[0]
    double = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    first = -(-corners.min(axis=0) // _GRID)
    last = corners.max(axis=0) // _GRID
    size = np.array([nx, ny]) * lines
    first, last = np.maximum(first, 0), np.minimum(last, size - 1)
    used = np.flatnonzero((double != 0) & (first <= last).all(axis=1))
    # Triangles of the same order of size together.
    span = (last - first + 1)[used]
    groups = np.ceil(np.log2(span)).astype(np.int64)
    key = groups[:, 0] * 64 + groups[:, 1]
    values = np.concatenate([points[..., 2:], tangents, area[..., None]], axis=-1).reshape(-1, 5)
    found = [_empty_hits()]
    for one in np.unique(key):
        box = 2 ** np.array(divmod(int(one), 64))
        chosen = used[key == one]
        step = max(1, _MOST_TESTS // int(box.prod()))
        for start in range(0, len(chosen), step):
            some = chosen[start : start + step]
            place = np.stack(np.meshgrid(*map(np.arange, box), indexing="ij"), axis=-1)
            line = first[some, None] + place.reshape(1, -1, 2)
            inside = (line <= last[some, None]).all(axis=-1)
            turned = np.sign(double[some])[:, None]
            weights = []
            for k in range(3):
                begin, end = corners[(k + 1) % 3, some, None], corners[(k + 2) % 3, some, None]
                edge = (end - begin) * turned[..., None]
                away = line * _GRID - begin
                weight = edge[..., 0] * away[..., 1] - edge[..., 1] * away[..., 0]
                # A line on an edge belongs to the triangle on the same side of it.
                ours = (edge[..., 1] < 0) | ((edge[..., 1] == 0) & (edge[..., 0] > 0))
                inside &= (weight > 0) | ((weight == 0) & ours)
                weights.append(weight)
            row, which = np.nonzero(inside)
            number = some[row]
            total = abs(double[number])
            value = sum(
                (weights[k][row, which] / total)[:, None] * values[triangles[k, number]]
                for k in range(3)
            )
            chosen_lines = line[row, which]
            found.append(
                _Hits(
                    chosen_lines[:, 1] * size[0] + chosen_lines[:, 0],
                    owner[number],
                    value[:, 0],
                    np.sign(double[number]).astype(np.int8),
                    value[:, 1:4],
                    value[:, 4],
                )
            )
    return _Hits(*(np.concatenate(part) for part in zip(*map(astuple, found), strict=True)))


def _pair(hits: _Hits) -> tuple[Ints, Ints]:
    """Find where each line enters and leaves a yarn; returns indices into the hits."""
    order = np.lexsort((hits.height, hits.line, hits.yarn))
    same = (np.diff(hits.line[order]) == 0) & (np.diff(hits.yarn[order]) == 0)
    starts = np.concatenate([[True], ~same])[: len(order)]
    side = hits.side[order].astype(np.int64)
    if side[starts].sum() > 0:  # all normals point inwards
        side = -side
    # Inside a yarn the sum of the sides from below is −1; where it is not, the surface is open.
    level = side.cumsum()
    group = np.cumsum(starts) - 1
    ends = np.append(np.flatnonzero(starts)[1:], len(order)) - 1
    good = np.diff(np.concatenate([[0], level[ends]])) == 0
    if (~good).sum() > _MOST_OPEN * max(1, len(good)):
        raise GeometryError(
            "the surface of a yarn is not closed inside the unit cell",
            cure="Make the piece of cloth larger than its repeat.",
        )
    level -= np.concatenate([[0], level[ends]])[group]
    entering = good[group] & (side < 0) & (level == -1)
    leaving = good[group] & (side > 0) & (level == 0)
    return order[entering], order[leaving]


def _fill(owner: Ints, low: Floats, high: Floats, value: Floats, count: int, nz: int) -> Floats:
    """Integrate values over the voxels between two heights, (count, nz)."""
    # Each end of an interval is a step; its share of the voxel that contains it is the first
    # difference, and the rest goes to the voxel above.
    total = np.zeros(count * (nz + 2))
    for height, sign in ((low, 1.0), (high, -1.0)):
        below = np.minimum(height.astype(np.int64), nz)
        rest = height - below
        start = owner * (nz + 2) + below
        total += np.bincount(start, sign * value * (1 - rest), len(total))
        total += np.bincount(start + 1, sign * value * rest, len(total))
    return total.reshape(count, nz + 2).cumsum(axis=1)[:, :nz]


def _combine(
    shares: Floats, along: Floats, columns: Ints, yarns: Ints, shape: tuple[int, int, int]
) -> Voxels:
    """Put the yarns of each column of voxels together."""
    nx, ny, nz = shape
    total = np.zeros((ny * nx, nz))
    best = np.zeros((ny * nx, nz))
    yarn = np.full((ny * nx, nz), -1, np.int32)
    along_best = np.zeros((ny * nx, nz, 4))
    # The entries are sorted by column. In each turn come the next yarns of all columns.
    turn = np.arange(len(columns)) - np.searchsorted(columns, columns)
    for one in range(int(turn.max(initial=-1)) + 1):
        chosen = np.flatnonzero(turn == one)
        there, share = columns[chosen], shares[chosen]
        total[there] += share
        larger = share > best[there] + 1e-9
        row, level = np.nonzero(larger)
        best[there[row], level] = share[row, level]
        yarn[there[row], level] = yarns[chosen[row]]
        along_best[there[row], level] = along[chosen[row], level]
    direction = along_best[..., :3]
    area = np.divide(along_best[..., 3], best, out=np.ones_like(best), where=best > 0)
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    direction = np.divide(direction, length, out=direction, where=length > 0)
    volume = total.sum()
    beyond = np.maximum(total - 1, 0).sum()
    shaped = (ny, nx, nz)
    return Voxels(
        np.minimum(total, 1).reshape(shaped).transpose(2, 0, 1).copy(),
        yarn.reshape(shaped).transpose(2, 0, 1).copy(),
        direction.reshape(*shaped, 3).transpose(2, 0, 1, 3).copy(),
        area.reshape(shaped).transpose(2, 0, 1).copy(),
        float(beyond / volume) if volume else 0.0,
    )


def _empty_hits() -> _Hits:
    whole = np.empty(0, np.int64)
    return _Hits(whole, whole, np.empty(0), np.empty(0, np.int8), np.empty((0, 3)), np.empty(0))


def stack(layer: Voxels, heights: list[int], shifts: list[tuple[int, int]], depth: int) -> Voxels:
    """Put copies of a layer of voxels on top of each other.

    Parameters
    ----------
    layer : Voxels
        One layer.
    heights : list of int
        First level of voxels of each copy; copies may reach into each other.
    shifts : list of (int, int)
        Voxels along x and y by which each copy is moved; what leaves the cell comes back.
    depth : int
        Levels of voxels of the result.

    Returns
    -------
    Voxels
        All copies together.
    """
    rows, width = layer.fraction.shape[1:]
    total = np.zeros((depth, rows, width))
    best, yarn = np.zeros_like(total), np.full(total.shape, -1, np.int32)
    direction, area = np.zeros((*total.shape, 3)), np.ones_like(total)
    count = int(layer.yarn.max(initial=-1)) + 1
    volume = 0.0
    for copy, (height, (x, y)) in enumerate(zip(heights, shifts, strict=True)):
        moved = [
            np.roll(part, (y, x), axis=(1, 2))
            for part in (layer.fraction, layer.yarn, layer.direction, layer.area)
        ]
        there = slice(height, height + len(layer.fraction))
        share = moved[0]
        total[there] += share
        volume += share.sum()
        larger = share > best[there]
        best[there][larger] = share[larger]
        yarn[there][larger] = moved[1][larger] + np.int32(copy * count)
        direction[there][larger] = moved[2][larger]
        area[there][larger] = moved[3][larger]
    beyond = float(np.maximum(total - 1, 0).sum() / volume) if volume else 0.0
    overlap = max(beyond, layer.overlap)
    return Voxels(np.minimum(total, 1), yarn, direction, area, overlap, layer.base)
