"""Points that ride along with a mesh, in compiled loops: one pass over the memory.

Needs Numba; see `spacemap_vtk.parallel`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.parallel import compiled


@compiled
def apply(
    weights: NDArray[np.float64],
    tetrahedron: NDArray[np.int32],
    corners: NDArray[np.int32],
    values: NDArray[np.float64],
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
def displace(
    weights: NDArray[np.float64],
    tetrahedron: NDArray[np.int32],
    corners: NDArray[np.int32],
    displacement: NDArray[np.float64],
    points: NDArray[Any],
    moved: NDArray[Any],
    shift: NDArray[Any],
) -> None:
    """Write displacement and new position of points."""
    for point in range(len(tetrahedron)):
        cell = np.intp(tetrahedron[point])
        x, y, z = 0.0, 0.0, 0.0
        for k in range(weights.shape[1]):
            weight, node = weights[point, k], np.intp(corners[cell, k])
            x += weight * displacement[node, 0]
            y += weight * displacement[node, 1]
            z += weight * displacement[node, 2]
        shift[point, 0], shift[point, 1], shift[point, 2] = x, y, z
        # of the rounded displacement, so that the two agree to the last bit
        moved[point, 0] = points[point, 0] + shift[point, 0]
        moved[point, 1] = points[point, 1] + shift[point, 1]
        moved[point, 2] = points[point, 2] + shift[point, 2]
