"""Embed points in linear tetrahedra: the map of each tetrahedron is affine.

Equation (8) of Furukawa, Kitagawa and Shimizu is the sum of a point's four weights times the values
at the corners. Within a tetrahedron this is one affine function of position. So only the number of
its tetrahedron is stored for a point: 4 bytes instead of four weights, and a step reads each point
once. The maps are few and stay in the cache.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.embedding.gradients import has_volume
from spacemap_vtk.embedding.interpolation import (
    BlockFunction,
    EmbeddedPoints,
    Points,
    check_displacement,
)
from spacemap_vtk.embedding.locate import Location, locate
from spacemap_vtk.memory import is_streamed
from spacemap_vtk.ndarrays import AnyInts, Floats
from spacemap_vtk.parallel import MANY_POINTS, blocks, load_loops

# Number of points in one block for NumPy: a block's part of the tables of maps must stay in the
# cache, while calls stay few.
_BLOCK = 2**13
# Number of points in one block for compiled loops, which only need blocks to share among threads.
_COMPILED_BLOCK = 2**17


class AffineInterpolation(EmbeddedPoints):
    """Interpolation from the vertices of linear tetrahedra to fixed points.

    Affine functions of position are reproduced up to rounding, inside and outside.

    Parameters
    ----------
    points : (N, 3) float32 or float64
        Located points, in m. The array is kept, not copied.
    location : Location
        Result of `locate` for the points; weights are not needed.
    vertices : (V, 3) float64
        Vertices at rest, in m.
    tetrahedra : (T, 4) int
        Vertex numbers.
    clamp : bool, optional
        Whether points outside move like the nearest point of the cage; otherwise the affine map of
        their tetrahedron is continued.
    threads : int, optional
        Number of threads; by default one for each processor.

    Examples
    --------
    >>> from spacemap_vtk.embedding.locate import locate
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> cage, points = np.array([[0, 1, 2, 3]]), np.array([[0.5, 0.25, 0.125]])
    >>> ride = AffineInterpolation(points, locate(points, corners, cage), corners, cage)
    >>> ride.displace(points, corners)[0].tolist()
    [[1.0, 0.5, 0.25]]
    """

    def __init__(
        self,
        points: NDArray[Any],
        location: Location,
        vertices: Floats,
        tetrahedra: AnyInts,
        clamp: bool = False,
        *,
        threads: int | None = None,
    ) -> None:
        super().__init__(len(points), len(vertices))
        self._points, self._tetrahedron = points, location.tetrahedron
        self._cells = np.asarray(tetrahedra)
        corners = vertices[self._cells]
        self._origins = corners[:, 0]
        edges = corners[:, 1:] - corners[:, :1]  # (T, 3, 3), one edge a row
        self._flat = np.flatnonzero(~has_volume(vertices, self._cells))
        edges[self._flat] = np.eye(3)
        self._edges, self._inverse = edges, np.linalg.inv(edges)
        self._clamped = np.flatnonzero(location.is_outside) if clamp else np.empty(0, np.intp)
        self._feet = np.empty((0, 4))
        if len(self._clamped):
            self._feet = locate(points[self._clamped], vertices, tetrahedra, "clamp").weights
        many = len(points) > MANY_POINTS
        self._threads = threads or (None if many else 1)  # for few points, threads cost more
        self._loops: ModuleType | None = load_loops(
            "spacemap_vtk.embedding.interpolation_loops", many
        )
        width = _BLOCK if self._loops is None else _COMPILED_BLOCK
        self._blocks = blocks(len(points), width)

    def _make_mover(
        self, table: Floats, points: Points, moved: Points, shift: Points
    ) -> BlockFunction:
        if self._loops is None:
            return super()._make_mover(table, points, moved, shift)
        # For each map: origin, displacement there, and its slopes, four numbers each.
        maps = np.zeros((len(self._cells), 5, 4))
        maps[:, 0, :3] = self._origins
        maps[:, 1, :3] = table[self._cells[:, 0]]
        maps[:, 2:, :3] = self._slopes(table)
        displace, streamed = self._loops.displace, is_streamed(moved, shift)
        rows = np.ascontiguousarray(points)

        def move(block: slice) -> None:
            flat = (array[block].reshape(-1) for array in (rows, moved, shift))
            displace(maps.reshape(-1), self._tetrahedron[block], *flat, streamed)

        return move

    def displace(self, points: Points, displacement: ArrayLike) -> tuple[Points, Points]:
        moved, shift = super().displace(points, displacement)
        if len(self._clamped):
            shift[self._clamped] = self._clamped_values(np.asarray(displacement, np.float64))
            moved[self._clamped] = points[self._clamped] + shift[self._clamped]
        return moved, shift

    def apply(self, values: ArrayLike) -> Floats:
        result = super().apply(values)
        if len(self._clamped):
            result[self._clamped] = self._clamped_values(np.asarray(values, np.float64))
        return result

    def gradients(self, displacement: ArrayLike) -> Floats:
        """Compute the deformation gradient F of each tetrahedron.

        Parameters
        ----------
        displacement : (V, 3) array_like
            Displacement of the vertices, in m.

        Returns
        -------
        (T, 3, 3) float64
            dx'/dx; the identity for a flat tetrahedron, which has no map.
        """
        table = check_displacement(displacement, self.vertex_count)
        return np.eye(3) + self._slopes(table).transpose(0, 2, 1)

    def _slopes(self, columns: Floats) -> Floats:
        """Compute the slopes of each column along x, y and z, (T, 3, k)."""
        values = columns[self._cells]
        gained = values[:, 1:] - values[:, :1]
        gained[self._flat] = 0.0
        slopes = self._inverse @ gained
        # One step of refinement: the inverse of a sliver has few correct digits, its edges all.
        slopes += self._inverse @ (gained - self._edges @ slopes)
        return slopes

    def _maps(self, columns: Floats) -> Floats:
        """Return first corners, and for each column its value there and its slopes, (T, 3 + 4k)."""
        result = np.empty((len(self._cells), 3 + 4 * columns.shape[1]))
        result[:, :3] = self._origins
        each = result[:, 3:].reshape(len(result), -1, 4)
        each[:, :, 0] = columns[self._cells[:, 0]]
        each[:, :, 1:] = self._slopes(columns).transpose(0, 2, 1)
        return result

    def _clamped_values(self, columns: Floats) -> Floats:
        """Compute the values at the clamped points."""
        corners = self._cells[self._tetrahedron[self._clamped]]
        return np.einsum("na,na...->n...", self._feet, columns[corners])

    def _make_writer(
        self, table: Floats, out: Points, points: Points | None = None
    ) -> BlockFunction:
        maps, points = self._maps(table), self._points if points is None else points
        if self._loops is not None:
            carry = self._loops.apply_maps
            return lambda block: carry(maps, self._tetrahedron[block], points[block], out[block])
        # One row for each coefficient, so that each operation runs over contiguous memory.
        rows = np.ascontiguousarray(maps.T)

        def write(block: slice) -> None:
            # "clip" is the mode without a buffered copy; every number is in range.
            found = rows.take(self._tetrahedron[block], axis=1, mode="clip")
            away = np.ones((4, found.shape[1]))
            np.subtract(points[block].T, found[:3], out=away[1:])
            terms = found[3:].reshape(-1, 4, found.shape[1])
            out[block] = np.einsum("kan,an->kn", terms, away).T

        return write
