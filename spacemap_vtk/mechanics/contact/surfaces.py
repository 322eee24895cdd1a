"""Surfaces of obstacles as triangles, to be drawn and written; contact itself needs none.

Each surface is made in the obstacle's own frame: its centre is the origin and its axis is z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Floats, Ints

#: Facets over a quarter of a turn.
_QUARTER = 24
#: Facets over a quarter of a turn across an edge.
_EDGE = 8
#: Facets along a straight part.
_STRAIGHT = 24
#: How much narrower the cells in the middle of a plane are than their mean: shadows need fine ones
#: where the cage touches.
_GRADING = 0.4


class Surface(NamedTuple):
    """Triangles with smooth normals."""

    points: Floats
    """(n, 3), positions [m]."""
    normals: Floats
    """(n, 3), outward unit normals."""
    triangles: Ints
    """(m, 3), point indices, counter-clockwise seen from outside."""


def plane_surface(half: float, cells: int) -> Surface:
    """Make a square of the plane z = 0, with finer cells in its middle.

    Parameters
    ----------
    half : float
        Half of its side [m].
    cells : int
        Number of cells along a side.

    Returns
    -------
    Surface
        Facing z.
    """
    share = np.linspace(-1.0, 1.0, cells + 1)
    line = half * (_GRADING * share + (1.0 - _GRADING) * share**3)
    x, y = np.meshgrid(line, line)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    normals = np.tile([0.0, 0.0, 1.0], (x.size, 1))
    return Surface(points, normals, _grid_triangles(len(line), len(line)))


def turned_surface(radius: float, height: float, rounding: float) -> Surface:
    """Make a cylinder about z with rounded rims; with `rounding` = `radius` = `height`/2 a sphere.

    Parameters
    ----------
    radius : float
        Outer radius [m].
    height : float
        Length along z [m].
    rounding : float
        Radius of the rims [m].

    Returns
    -------
    Surface
        Facets along the outline are as fine as those around it where it is straight.
    """
    core = np.array([radius, height / 2]) - rounding
    turn = np.linspace(0.0, np.pi / 2, _QUARTER if core.max() <= 0.0 else _EDGE)
    rim = np.column_stack([np.sin(turn), np.cos(turn)])
    straight = np.linspace(0.0, 1.0, _STRAIGHT)[:, None]
    # From the middle of the top to the equator. Sharp rims have two points, with a normal each.
    top = straight * [core[0], 0.0] + [0.0, core[1] + rounding]
    side = [core[0] + rounding, core[1]] - straight * [0.0, core[1]]
    upper = np.concatenate([top, core + rounding * rim, side])
    facing = np.concatenate([0.0 * top + [0.0, 1.0], rim, 0.0 * side + [1.0, 0.0]])
    outline = np.concatenate([upper, upper[::-1] * [1.0, -1.0]])
    facing = np.concatenate([facing, facing[::-1] * [1.0, -1.0]])
    around = np.linspace(0.0, 2 * np.pi, 4 * _QUARTER + 1)
    way = np.column_stack([np.cos(around), np.sin(around)])

    def turned(line: Floats) -> Floats:
        level = line[:, None, :1] * way
        along = np.broadcast_to(line[:, None, 1:], (*level.shape[:2], 1))
        return np.concatenate([level, along], axis=2).reshape(-1, 3)

    triangles = _grid_triangles(len(outline), len(way))[:, ::-1]
    return _without_slivers(Surface(turned(outline), turned(facing), triangles))


def box_surface(size: ArrayLike, rounding: float) -> Surface:
    """Make a box with rounded edges.

    Parameters
    ----------
    size : array_like of float, shape (3,)
        Lengths of the sides along x, y and z [m].
    rounding : float
        Radius of the edges [m].

    Returns
    -------
    Surface
        Faces have their own points, so that sharp edges stay sharp.
    """
    half = np.asarray(size, dtype=np.float64) / 2
    core = half - rounding
    # A ray from the core through the outer box meets the rounded surface; over half an edge the
    # normal turns by 45°.
    edge = rounding * np.tan(np.linspace(0.0, np.pi / 4, _EDGE)[1:])
    lines = []
    for inner in core:
        flat = np.linspace(-inner, inner, _STRAIGHT if inner > 0.0 else 1)
        lines.append(np.concatenate([-inner - edge[::-1], flat, inner + edge]))
    points, normals, triangles, count = [], [], [], 0
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (1.0, -1.0):
            u, v = np.meshgrid(lines[first], lines[second])
            outer = np.empty((u.size, 3))
            outer[:, first], outer[:, second] = u.ravel(), v.ravel()
            outer[:, axis] = side * half[axis]
            nearest = outer.clip(-core, core)
            normal = outer - nearest if rounding > 0.0 else side * np.eye(3)[[axis] * u.size]
            normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            corners = _grid_triangles(len(lines[second]), len(lines[first]))
            points.append(nearest + rounding * normal)
            normals.append(normal)
            triangles.append(count + (corners if side > 0.0 else corners[:, ::-1]))
            count += u.size
    return _without_slivers(
        Surface(np.concatenate(points), np.concatenate(normals), np.concatenate(triangles))
    )


def _grid_triangles(rows: int, columns: int) -> Ints:
    """Return two triangles for each cell of a grid of points, row by row."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, above = first + 1, first + columns
    corners = [[first, right, above + 1], [first, above + 1, above]]
    return np.concatenate([np.column_stack(each) for each in corners])


def _without_slivers(surface: Surface) -> Surface:
    """Remove triangles of zero area, such as those at a pole."""
    a, b, c = (surface.points[corners] for corners in surface.triangles.T)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return surface._replace(triangles=surface.triangles[area > 1e-9 * area.max()])
