"""How much light reaches an obstacle's surface past the cloth: soft shadows and contact shading.

Light comes from all sides. For each of many directions, the objects in the way are sampled into a
depth map, and each point of the surface is compared with it (as
M. Sattler et al., "Hardware-accelerated ambient occlusion computation", 2004).
"""

from __future__ import annotations

import math

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.mechanics.contact.obstacles import frame_along
from spacemap_vtk.mechanics.contact.surfaces import Surface
from spacemap_vtk.ndarrays import AnyInts, Floats, Singles

#: Number of directions of light, on the whole sphere, and of samples of an object in the way.
DIRECTIONS, SAMPLES = 192, 30_000
#: The same while something moves.
FEW_DIRECTIONS, FEW_SAMPLES = 32, 8_000
#: Width of the depth maps' cells over the mean distance of samples.
_CELL = 2.0
#: Rounds in which values are averaged with those of neighbouring points.
_ROUNDS = 3
#: Most cells along a side of a depth map.
_MOST_CELLS = 1024


def exposure(
    points: Floats,
    normals: Floats,
    casters: Floats,
    spacing: float,
    directions: int = DIRECTIONS,
) -> Floats:
    """Return the share of light that reaches points past casters `spacing` m apart, (n,)."""
    middle = points.mean(axis=0)
    # Rows of x, y and z in single precision, which halve the time.
    places, facing, things = (
        np.ascontiguousarray(rows.T, dtype=np.float32)
        for rows in (points - middle, normals, casters - middle)
    )
    open_, total = np.zeros((2, len(points)), np.float32)
    level = bool((normals == normals[0]).all())
    spread = _spiral_about(normals[0], directions) if level else _spiral(directions)
    for direction in spread.astype(np.float32):
        weight = np.ones(len(points)) if level else np.maximum(direction @ facing, 0.0)
        lit = np.flatnonzero(weight)
        if len(lit):
            weight = weight[lit]
            hidden = _hidden_share(places[:, lit], things, direction, _CELL * spacing)
            total[lit] += weight
            open_[lit] += weight * (1.0 - hidden)
    return np.divide(open_, total, out=np.ones(len(points)), where=total > 0.0)


def sample_surface(surface: vtkPolyData, count: int = SAMPLES) -> tuple[Floats, float]:
    """Sample a surface evenly: return points (m, 3) and their mean distance [m]."""
    polygons, points = surface.GetPolys(), points_of(surface)
    starts = vtk_to_numpy(polygons.GetOffsetsArray()).astype(np.int64)
    if len(starts) < 2:
        size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
        return points[:: 1 + len(points) // count].astype(np.float64), size / 100
    # The facets of many yarns are small and alike: some of them are enough.
    few = slice(None, None, 1 + (len(starts) - 1) // (2 * count))
    counts = np.diff(starts)[few]
    corners = _fan(starts[:-1][few], counts, vtk_to_numpy(polygons.GetConnectivityArray()))
    a, b, c = (points[column].astype(np.float64) for column in corners.T)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    whole = float(area.sum())
    if whole == 0.0:
        return np.zeros((0, 3)), 0.0
    # One sample in each of equal parts of the area; within its triangle it is anywhere.
    places = (np.arange(count) + 0.5) * (whole / count)
    which = np.minimum(np.searchsorted(np.cumsum(area), places), len(area) - 1)
    u, v = np.random.default_rng(0).random((2, count, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    samples = a[which] + u * (b - a)[which] + v * (c - a)[which]
    return samples, math.sqrt(whole * (len(starts) - 1) / len(counts) / count)


def smooth_over_edges(values: Floats, surface: Surface) -> Floats:
    """Average the values of points (n,) with their neighbours': directions cast no single edges."""
    # Points with the same place and normal are one, so that no seam shows; 0.0 removes signs of 0.
    places = np.hstack([surface.points / np.ptp(surface.points), surface.normals])
    _, same = np.unique(np.round(places, 6) + 0.0, axis=0, return_inverse=True)
    same = same.ravel()
    triangles = same[surface.triangles]
    ends = np.concatenate([triangles, np.roll(triangles, 1, axis=1)]).ravel()
    others = np.concatenate([np.roll(triangles, 1, axis=1), triangles]).ravel()
    values = np.bincount(same, values) / np.bincount(same)
    count = np.bincount(ends, minlength=len(values))
    for _ in range(_ROUNDS):
        sums = np.bincount(ends, values[others], len(values))
        values = np.where(count > 0, 0.5 * (values + sums / np.maximum(count, 1)), values)
    return values[same]


def _fan(starts: AnyInts, counts: AnyInts, corners: AnyInts) -> AnyInts:
    """Cut polygons into triangles, (m, 3): a fan around the first corner of each."""
    inner = counts - 2
    number = np.arange(int(inner.sum())) - np.repeat(np.cumsum(inner) - inner, inner)
    first = np.repeat(starts, inner)
    return np.column_stack(
        [corners[first], corners[first + number + 1], corners[first + number + 2]]
    )


def _spiral(count: int) -> Floats:
    """Return evenly spread directions, (count, 3), on a spiral of Fibonacci."""
    height = 1.0 - (2 * np.arange(count) + 1) / count
    return _at_heights(height)


def _spiral_about(normal: Floats, count: int) -> Floats:
    """Return directions over a level surface, as dense as their light on it is strong."""
    heights = np.sqrt(1.0 - (np.arange(count) + 0.5) / count)
    return _at_heights(heights) @ frame_along(normal)


def _at_heights(height: Floats) -> Floats:
    turn, level = math.pi * (1.0 + 5.0**0.5) * np.arange(len(height)), np.sqrt(1.0 - height**2)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), height])


def _hidden_share(points: Singles, casters: Singles, direction: Singles, cell: float) -> Singles:
    """Return the share of each point (3, n) that is hidden by casters (3, m) from a direction."""
    x, y, z = direction
    across = np.array([-y, x, 0.0] if abs(z) < 0.9 else [0.0, -z, y], np.float32)
    across /= np.linalg.norm(across)
    axes = np.stack([across, np.cross(direction, across), direction])
    seen, thrown = axes @ points, axes @ casters
    low, high = thrown[:2].min(axis=1), thrown[:2].max(axis=1)
    cell = max(cell, float((high - low).max()) / _MOST_CELLS)
    columns, rows = (np.floor((high - low) / cell).astype(int) + 3).tolist()
    across, above = ((thrown[:2] - low[:, None]) * np.float32(1.0 / cell)).astype(np.int32) + 1
    nearest = np.full(columns * rows, -np.inf, np.float32)
    np.maximum.at(nearest, above * columns + across, thrown[2])
    # Interpolated between the four nearest cells, so that shadows have no steps.
    right, up = (seen[:2] - low[:, None]) * np.float32(1.0 / cell) + np.float32(0.5)
    inside = (right >= 0.0) & (up >= 0.0) & (right < columns - 1) & (up < rows - 1)
    within = np.flatnonzero(inside)
    right, up, depth = right[within], up[within], seen[2, within]
    column, row = right.astype(np.int32), up.astype(np.int32)
    right, up, corner = right - column, up - row, row * columns + column
    left = np.float32(1.0) - right
    lower = left * (nearest[corner] > depth) + right * (nearest[corner + 1] > depth)
    corner += columns
    upper = left * (nearest[corner] > depth) + right * (nearest[corner + 1] > depth)
    hidden = np.zeros(points.shape[1], np.float32)
    hidden[within] = lower + up * (upper - lower)
    return hidden
