"""Barycentric coordinates in many tetrahedra.

Only element-wise arithmetic is used, no BLAS and no einsum. Their result for a point can depend on
the other points in the array, but a point must always get the same tetrahedron.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.embedding.triangles import cross, dot
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import AnyInts, Bools, Floats

# A tetrahedron whose volume is less than this share of its longest edge cubed is flat. The rounding
# error of its volume alone is one part in 10**15.
_FLAT = 1e-12
# Tolerance of the inside test in barycentric coordinates.
_TOLERANCE = 1e-9
# Further tolerance of the inside test, in units of the rounding of the coordinates.
_ROUNDINGS = 4.0


class Frames:
    """Affine frames of tetrahedra, computed once."""

    def __init__(self, vertices: Floats, tetrahedra: AnyInts, rounding: float) -> None:
        corners = vertices[tetrahedra]  # (T, 4, 3)
        first = corners[:, 0]
        edges = corners[:, 1:] - first[:, None]
        a, b, c = edges.transpose(1, 2, 0)  # each (3, T)
        gradients = np.stack((cross(b, c), cross(c, a), cross(a, b)))  # (3, 3, T)
        volume = dot(a, gradients[0])
        longest = np.sqrt(
            np.max([dot(d, d) for d in (a, b, c, b - a, c - b, a - c)], axis=0, initial=0.0)
        )
        self.usable = np.abs(volume) > _FLAT * longest**3
        if not self.usable.any():
            raise GeometryError(
                f"all {len(tetrahedra)} tetrahedra of the cage are flat",
                allowed="at least one with a volume",
            )
        self.positive = volume > 0
        self.low, self.high = corners.min(axis=1), corners.max(axis=1)
        self.distance = _ROUNDINGS * rounding * float(np.abs(vertices[tetrahedra]).max())
        # Flat ones stay in the table so that numbers are unchanged, but they are never used.
        gradients /= np.where(self.usable, volume, 1.0)
        last = -gradients.sum(axis=0)
        steepness = np.sqrt([dot(last, last), *(dot(g, g) for g in gradients)])
        self.tolerance = (_TOLERANCE + self.distance * steepness).T  # (T, 4)
        # One row for each tetrahedron, so that a lookup reads contiguous memory.
        self._table = np.concatenate(
            (first, gradients.transpose(2, 0, 1).reshape(-1, 9), self.tolerance), axis=1
        )
        self._edges = edges.reshape(-1, 9)

    def weights(self, points: Floats, which: AnyInts) -> Floats:
        """Compute barycentric coordinates that reproduce the points."""
        rows = self._table[which]
        away = (points - rows[:, :3]).T
        weights = _transform(rows[:, 3:12].T, away)
        # One step of refinement: in a sliver the inverse has few correct digits, while the product
        # with the edges has all.
        edges = self._edges[which].T.reshape(3, 3, -1)
        rest = [
            away[i]
            - (weights[0] * edges[0, i] + weights[1] * edges[1, i] + weights[2] * edges[2, i])
            for i in range(3)
        ]
        result = np.empty((len(which), 4))
        for i, (weight, correction) in enumerate(
            zip(weights, _transform(rows[:, 3:12].T, rest), strict=True)
        ):
            result[:, i + 1] = weight + correction
        result[:, 0] = 1.0 - (result[:, 1] + result[:, 2] + result[:, 3])
        return result

    def contains(self, points: Floats, which: AnyInts) -> Bools:
        """Check whether points lie in tetrahedra, including boundary and tolerance."""
        rows = np.take(self._table, which, axis=0)
        away = [points[:, i] - rows[:, i] for i in range(3)]
        x, y, z = _transform(rows[:, 3:12].T, away)
        tolerance = rows[:, 12:].T
        result: Bools = x >= -tolerance[1]
        result &= y >= -tolerance[2]
        result &= z >= -tolerance[3]
        result &= x + y + z <= 1.0 + tolerance[0]
        return result

    def planes(self, low: Floats, size: Floats) -> Floats:
        """Compute planes that show whether a face separates a tetrahedron from a grid cell."""
        gradients = self._table[:, 3:12].T.reshape(3, 3, -1)
        slopes = np.concatenate((-gradients.sum(axis=0, keepdims=True), gradients))
        away = (low + 0.5 * size)[:, None] - self._table[:, :3].T
        result = np.empty((4, 4, len(self._table)))
        for i, slope in enumerate(slopes):
            np.multiply(slope, size[:, None], out=result[i, :3])
            reach = 0.5 * np.abs(result[i, :3]).sum(axis=0)
            # Slightly more, to allow for the rounding of this sum.
            spare = 2.0 * self.tolerance[:, i] + 1e-12
            result[i, 3] = dot(slope, away) + (i == 0) + reach * (1 + 1e-9) + spare
        return result


def _transform(matrix: Floats, vector: Any) -> list[Floats]:  # 9 rows, 3 rows -> 3 rows
    return [
        matrix[3 * i] * vector[0] + matrix[3 * i + 1] * vector[1] + matrix[3 * i + 2] * vector[2]
        for i in range(3)
    ]
