"""Points that ride along with a mesh, in compiled loops: one pass over the memory.

Needs Numba; see `spacemap_vtk.parallel`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import compiled


@compiled
def apply(
    weights: Floats,
    tetrahedron: NDArray[np.int32],
    corners: NDArray[np.int32],
    values: Floats,
    out: NDArray[Any],
) -> None:
    """Write values at points."""
    for point in range(len(tetrahedron)):
        cell = np.intp(tetrahedron[point])
        for column in range(values.shape[1]):
            total = 0.0
            for k in range(weights.shape[1]):
                total += weights[point, k] * values[np.intp(corners[cell, k]), column]
            out[point, column] = total


@compiled
def carry(
    maps: Floats, tetrahedron: NDArray[np.int32], points: NDArray[Any], out: NDArray[Any]
) -> None:
    """Write values at points, by the affine maps of tetrahedra."""
    for point in range(len(tetrahedron)):
        row = maps[np.intp(tetrahedron[point])]
        x, y, z = points[point, 0] - row[0], points[point, 1] - row[1], points[point, 2] - row[2]
        for column in range(out.shape[1]):
            k = 3 + 4 * column
            out[point, column] = row[k] + row[k + 1] * x + row[k + 2] * y + row[k + 3] * z


@compiled
def displace(
    maps: Floats,
    tetrahedron: NDArray[np.int32],
    points: NDArray[Any],
    moved: NDArray[Any],
    shift: NDArray[Any],
) -> None:
    """Write displacement and new position of points, by the affine maps of tetrahedra."""
    for point in range(len(tetrahedron)):
        row = maps[np.intp(tetrahedron[point])]
        x, y, z = points[point, 0] - row[0], points[point, 1] - row[1], points[point, 2] - row[2]
        for axis in range(3):
            k = 3 + 4 * axis
            shift[point, axis] = row[k] + row[k + 1] * x + row[k + 2] * y + row[k + 3] * z
            # of the rounded displacement, so that the two agree to the last bit
            moved[point, axis] = points[point, axis] + shift[point, axis]
