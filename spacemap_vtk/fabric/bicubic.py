"""Chunks of bicubic patches, handed to compiled loops where there are very many.

`spacemap_vtk.fabric.patch_chunks` does the same for any degree with matrix products.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric.bezier import bernstein, bernstein_derivative
from spacemap_vtk.fabric.patch_chunks import SUSPECT, Chunk, Floats


class Bicubic:
    """Compiled evaluation of bicubic patches that are not rational."""

    def __init__(self, loops: ModuleType, subdivisions: int) -> None:
        self._loops = loops
        t = np.arange(subdivisions + 1) / subdivisions
        self._curve = np.stack((bernstein(3, t), bernstein_derivative(3, t)))

    def evaluate(
        self, chunk: Chunk, points: Floats, scale: float, positions: Floats, normals: Floats
    ) -> NDArray[np.int64]:
        """Write the points of a chunk and their unit normals."""
        kind = positions.dtype
        curve = self._curve.copy()
        curve[1] /= scale
        suspects = np.empty(positions.size // 3, np.int64)
        count = self._loops.evaluate(
            np.ascontiguousarray(points[chunk.rows]),
            chunk.gather,
            curve.astype(kind),
            kind.type(1 / scale),
            kind.type(SUSPECT),
            positions.reshape(-1),
            normals.reshape(-1),
            suspects,
        )
        return suspects[:count]

    def interpolate(
        self, chunk: Chunk, columns: NDArray[Any], origin: Floats, values: Floats
    ) -> None:
        """Write an array of the control points, carried over to the points of a chunk."""
        rows = columns[chunk.rows]
        if rows.dtype.kind != "f":  # each type more is compiled anew
            rows = rows.astype(values.dtype)
        self._loops.interpolate(
            np.ascontiguousarray(rows),
            origin,
            chunk.gather,
            self._curve.astype(values.dtype),
            values.reshape(-1),
        )
