"""Move embedded points in compiled loops, with one pass over the memory.

Needs Numba; see `spacemap_vtk.parallel`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import compile_function
from spacemap_vtk.simd import map_point, stream_line

#: Number of points that `displace` writes at a time; they fill whole cache lines.
_BUFFER = 128


@compile_function
def apply_weights(
    weights: Floats,
    tetrahedron: NDArray[np.int32],
    corners: NDArray[np.int32],
    values: Floats,
    out: NDArray[Any],
) -> None:
    """Write values at points, from weights of the nodes."""
    for point in range(len(tetrahedron)):
        cell = np.intp(tetrahedron[point])
        for column in range(values.shape[1]):
            total = 0.0
            for k in range(weights.shape[1]):
                total += weights[point, k] * values[np.intp(corners[cell, k]), column]
            out[point, column] = total


@compile_function
def apply_maps(
    maps: Floats, tetrahedron: NDArray[np.int32], points: NDArray[Any], out: NDArray[Any]
) -> None:
    """Write values at points, from affine maps of the tetrahedra."""
    for point in range(len(tetrahedron)):
        row = maps[np.intp(tetrahedron[point])]
        x, y, z = points[point, 0] - row[0], points[point, 1] - row[1], points[point, 2] - row[2]
        for column in range(out.shape[1]):
            k = 3 + 4 * column
            out[point, column] = row[k] + row[k + 1] * x + row[k + 2] * y + row[k + 3] * z


@compile_function
def displace(
    maps: Floats,
    tetrahedron: NDArray[np.int32],
    points: NDArray[Any],
    moved: NDArray[Any],
    shift: NDArray[Any],
    streamed: bool,
) -> None:
    """Write displacement and new position of points, from affine maps of the tetrahedra."""
    # Arrays of points are flat; `maps` has the layout that `map_point` reads. Streamed results
    # begin at multiples of 64 bytes.
    # Some points at a time go to memory that stays in the cache; from there whole lines are copied.
    own_shift = np.empty(3 * _BUFFER + 8, points.dtype)
    own_moved = np.empty(3 * _BUFFER + 8, points.dtype)
    line = 64 // points.itemsize
    for first in range(0, len(tetrahedron), _BUFFER):
        count = min(_BUFFER, len(tetrahedron) - first)
        for point in range(count):
            cell = np.intp(tetrahedron[first + point])
            map_point(maps, cell, points, 3 * (first + point), own_shift, own_moved, 3 * point)
        whole = 3 * count // line * line if streamed else 0
        for k in range(0, whole, line):
            stream_line(shift, 3 * first + k, own_shift, k)
        for k in range(0, whole, line):
            stream_line(moved, 3 * first + k, own_moved, k)
        if whole < 3 * count:
            rest = slice(3 * first + whole, 3 * (first + count))
            shift[rest] = own_shift[whole : 3 * count]
            moved[rest] = own_moved[whole : 3 * count]
