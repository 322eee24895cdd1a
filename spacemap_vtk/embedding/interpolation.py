"""Values at the vertices of a tetrahedral mesh, carried over to points that ride along.

Equation (8) of Furukawa, Kitagawa and Shimizu: one sparse product with four weights a row (ten in
quadratic tetrahedra). It is bound by the memory that the weights take, so that it gains by a second
thread; one affine map for each tetrahedron reads as much, and must put its points back into order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix

from spacemap_vtk.embedding.locate import Location
from spacemap_vtk.embedding.quadratic import quadratic_weights
from spacemap_vtk.errors import InputError
from spacemap_vtk.parallel import for_each
from spacemap_vtk.recycler import Recycler

_BLOCK = 2**16  # points a block: its product is still in the cache when it is put into the result


class Interpolation:
    """Barycentric interpolation to fixed points, for any values at the vertices.

    An affine function of the vertices is reproduced within rounding, inside and outside; in
    quadratic tetrahedra a quadratic one too, inside.

    Parameters
    ----------
    location : Location
        Where the points lie.
    tetrahedra : (T, 4) or (T, 10) array_like of int
        The tetrahedra that they were located in, with their midpoints if they are quadratic.
    vertex_count : int
        Number of vertices of that mesh.
    threads : int, optional
        Threads to work in; all processors if not given.

    Notes
    -----
    The weights are those of the geometry at the time of `locate`; when points or vertices have
    changed they are stale, which nothing here can notice.

    Results lie in memory that is used again once the last array over it is gone; they may be kept
    as long as one likes.

    Examples
    --------
    >>> from spacemap_vtk.embedding.locate import locate
    >>> corners, cage = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 1, 2, 3]]
    >>> ride = Interpolation(locate([[0.5, 0.25, 0.125]], corners, cage), cage, 4)
    >>> ride.apply(2 * corners).tolist()
    [[1.0, 0.5, 0.25]]
    """

    def __init__(
        self,
        location: Location,
        tetrahedra: ArrayLike,
        vertex_count: int,
        *,
        threads: int | None = None,
    ) -> None:
        corners = np.asarray(tetrahedra).astype(np.int32)
        self.point_count = len(location.tetrahedron)
        self.vertex_count = vertex_count
        self._threads = threads
        self._recycler = Recycler()
        self._blocks: list[tuple[slice, Any]] = []
        nodes = corners.shape[1]
        starts = np.arange(0, nodes * _BLOCK + 1, nodes, dtype=np.int32)
        for begin in range(0, self.point_count, _BLOCK):
            rows = slice(begin, min(begin + _BLOCK, self.point_count))
            # a view of the location's weights, and 32 bits for vertex numbers: what is read counts
            weights = location.weights[rows]
            if nodes == 10 and weights.shape[1] == 4:
                weights = quadratic_weights(weights)
            vertices = corners[location.tetrahedron[rows]].reshape(-1)
            count = rows.stop - begin
            matrix = csr_matrix(
                (weights.reshape(-1), vertices, starts[: count + 1]),
                shape=(count, vertex_count),
                copy=False,
            )
            self._blocks.append((rows, matrix))

    def apply(self, values: ArrayLike) -> NDArray[np.float64]:
        """Interpolate.

        Parameters
        ----------
        values : (V,) or (V, k) array_like
            Values at the vertices, of any unit.

        Returns
        -------
        (N,) or (N, k) float64
            Values at the points, of the same unit.

        Raises
        ------
        InputError
            There are not as many rows as vertices, or more than two axes.
        """
        table = np.ascontiguousarray(values, dtype=np.float64)
        if table.ndim not in (1, 2) or len(table) != self.vertex_count:
            raise InputError(
                f"values of shape {np.shape(values)} at the vertices of the cage",
                allowed=f"({self.vertex_count},) or ({self.vertex_count}, k)",
            )
        result = self._recycler.empty((self.point_count, *table.shape[1:]), np.float64)

        def do(block: tuple[slice, Any]) -> None:
            rows, matrix = block
            result[rows] = matrix @ table

        for_each(self._blocks, lambda: do, self._threads)
        return result

    def displace(
        self, points: NDArray[Any], displacement: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Move the points with the mesh.

        Parameters
        ----------
        points : (N, 3) float32 or float64
            The points that were located, in m.
        displacement : (V, 3) array_like
            Displacement of the vertices in m.

        Returns
        -------
        moved : (N, 3) of the points' type
            Points plus displacement, in m.
        displacement : (N, 3) of the points' type
            In m.

        Raises
        ------
        InputError
            The points are not as many as were located, or the displacement is not (V, 3).
        """
        table = np.ascontiguousarray(displacement, dtype=np.float64)
        if points.shape != (self.point_count, 3) or table.shape != (self.vertex_count, 3):
            raise InputError(
                f"points of shape {points.shape} and displacements of shape {table.shape}",
                allowed=f"({self.point_count}, 3) and ({self.vertex_count}, 3)",
            )
        moved = self._recycler.empty(points.shape, points.dtype)
        shift = self._recycler.empty(points.shape, points.dtype)

        def do(block: tuple[slice, Any]) -> None:
            # the sum is made while the block is in the cache
            rows, matrix = block
            shift[rows] = matrix @ table
            np.add(points[rows], shift[rows], out=moved[rows])

        for_each(self._blocks, lambda: do, self._threads)
        return moved, shift
