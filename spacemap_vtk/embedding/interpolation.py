"""Interpolate values at the vertices of a tetrahedral mesh to embedded points.

Implements equation (8) of Furukawa, Kitagawa and Shimizu, with a weight for each node of a point's
tetrahedron: four, or ten, or sixteen for the spline. For many points one compiled loop does the
work. For few points, or without Numba, small dense products do it, one for each run of points in a
tetrahedron. The speed of both is limited by reading the weights, and a second thread helps. Many
points in linear tetrahedra need no weights (see `spacemap_vtk.embedding.affine`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.embedding.locate import Location, locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.tetrahedra import shape_functions, shape_slopes
from spacemap_vtk.memory import ArrayPool
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parallel import MANY_POINTS, blocks, for_each, load_loops
from spacemap_vtk.units import format_quantity

_BLOCK = 2**17  # points in one block: its product stays in the cache until it is copied
_ROW = 32  # points of a tetrahedron in one product: half and twice as many are slower

#: Coordinates in single or double precision.
Points = NDArray[Any]
#: Function that processes one block of points.
BlockFunction = Callable[[slice], None]
#: Function that writes the values at the points of a block, (n, k), from those at vertices, (V, k).
_Writer = Callable[[Floats, Points], None]


class EmbeddedPoints:
    """Fixed points embedded in a mesh, for any values at its vertices.

    Notes
    -----
    Results may be kept for any time. Their memory is reused only after the last array on it is
    gone.
    """

    _threads: int | None
    _blocks: Sequence[slice]

    def __init__(self, points: int, vertices: int) -> None:
        self.point_count, self.vertex_count, self._recycler = points, vertices, ArrayPool()

    def _make_writer(
        self, table: Floats, out: Points, points: Points | None = None
    ) -> BlockFunction:
        """Make the function that computes the values at a block of points."""
        raise NotImplementedError

    def _make_mover(
        self, table: Floats, points: Points, moved: Points, shift: Points
    ) -> BlockFunction:
        """Make the function that moves a block of points."""
        write = self._make_writer(table, shift, points)

        def move(block: slice) -> None:
            write(block)
            np.add(points[block], shift[block], out=moved[block])  # while it is in the cache

        return move

    def apply(self, values: ArrayLike) -> Floats:
        """Interpolate values at the vertices to the located points.

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
            The number of rows is not the number of vertices, or there are more than two axes.
        """
        table = np.ascontiguousarray(values, dtype=np.float64)
        if table.ndim not in (1, 2) or len(table) != self.vertex_count:
            raise InputError(
                f"the values at the vertices of the cage have shape {np.shape(values)}",
                allowed=f"({self.vertex_count},) or ({self.vertex_count}, k)",
            )
        columns = table.reshape(len(table), -1)
        result = self._recycler.empty((self.point_count, columns.shape[1]), np.float64)
        write = self._make_writer(columns, result)
        for_each(self._blocks, lambda: write, self._threads)
        return result.reshape(-1, *table.shape[1:])

    def displace(self, points: Points, displacement: ArrayLike) -> tuple[Points, Points]:
        """Move points with the mesh.

        Parameters
        ----------
        points : (N, 3) float32 or float64
            The located points, in m, or others that replace them.
        displacement : (V, 3) array_like
            Displacement of the vertices in m.

        Returns
        -------
        moved : (N, 3) of the points' type
            Points plus displacement, in m.
        displacement : (N, 3) of the points' type
            Displacement of the points, in m.

        Raises
        ------
        InputError
            The number of points differs from the located ones, or the displacement is not (V, 3).
        """
        table = check_displacement(displacement, self.vertex_count)
        if points.shape != (self.point_count, 3):
            raise InputError(
                f"the points have shape {points.shape}", allowed=f"({self.point_count}, 3)"
            )
        moved = self._recycler.empty(points.shape, points.dtype)
        shift = self._recycler.empty(points.shape, points.dtype)
        move = self._make_mover(table, points, moved, shift)
        for_each(self._blocks, lambda: move, self._threads)
        return moved, shift


class Interpolation(EmbeddedPoints):
    """Barycentric interpolation from the vertices of a mesh to fixed points.

    Affine functions of position are reproduced up to rounding, inside and outside. Quadratic
    tetrahedra also reproduce quadratic functions inside.

    Parameters
    ----------
    location : Location
        Result of `locate` for the points.
    tetrahedra : (T, 4) or (T, 10) array_like of int
        Tetrahedra in which they were located, with midpoints if they are quadratic.
    vertex_count : int
        Number of vertices of that mesh.
    threads : int, optional
        Number of threads; by default one for each processor.

    Notes
    -----
    The weights belong to the geometry at the time of `locate`. If points or vertices change later,
    they are outdated, and this class cannot notice it.

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
        count, corners = len(location.tetrahedron), np.asarray(tetrahedra).astype(np.int32)
        super().__init__(count, vertex_count)
        self._threads = threads
        self._blocks = blocks(count, _BLOCK)
        self._writes: list[_Writer] = []
        ride = load_loops("spacemap_vtk.embedding.interpolation_loops", count > MANY_POINTS)
        for rows in self._blocks:
            weights, tetrahedron = location.weights[rows], location.tetrahedron[rows]
            if corners.shape[1] == 10 and weights.shape[1] == 4:
                weights = quadratic_weights(weights)
            self._writes.append(_make_writer(ride, weights, tetrahedron, corners))

    def _make_writer(
        self, table: Floats, out: Points, points: Points | None = None
    ) -> BlockFunction:
        return lambda block: self._writes[block.start // _BLOCK](table, out[block])


def check_displacement(values: ArrayLike, vertex_count: int) -> Floats:
    """Convert displacements of vertices to a checked table."""
    table = np.ascontiguousarray(values, dtype=np.float64)
    if table.shape != (vertex_count, 3):
        raise InputError(
            f"the displacements have shape {table.shape}",
            allowed=f"({vertex_count}, 3): a row for each vertex of the cage",
        )
    if not np.isfinite(table).all():
        wrong = int((~np.isfinite(table).all(axis=1)).sum())
        raise InputError(
            f"{wrong} of the cage's {vertex_count} displacements are not finite numbers"
        )
    return table


def _make_writer(
    ride: ModuleType | None,
    weights: Floats,
    tetrahedron: NDArray[np.int32],
    corners: NDArray[np.int32],
) -> _Writer:
    """Prepare the interpolation to one block of points."""
    # Views of the location where possible, and 32-bit vertex numbers: reading memory limits speed.
    if ride is not None:
        return partial(ride.apply_weights, np.ascontiguousarray(weights), tetrahedron, corners)
    # Points of a tetrahedron are sorted together, in rows of equal length, padded with zero
    # weights. A product of many small matrices takes half the time of a sparse one, and needs no
    # SciPy.
    owners, counts = np.unique(tetrahedron, return_counts=True)
    length = min(len(tetrahedron) // len(owners), _ROW)
    rows = -(-counts // length)
    begin = length * (np.cumsum(rows) - rows) - (np.cumsum(counts) - counts)
    place = np.empty(len(tetrahedron), np.intp)
    place[np.argsort(tetrahedron, kind="stable")] = np.arange(len(place)) + begin.repeat(counts)
    padded = np.zeros((length * rows.sum(), weights.shape[1]))
    padded[place] = weights
    padded = padded.reshape(-1, length, weights.shape[1])
    nodes = corners[owners.repeat(rows)]

    def write(values: Floats, out: Points) -> None:
        made = np.matmul(padded, values.take(nodes, axis=0)).reshape(-1, values.shape[1])
        if out.dtype == made.dtype:
            made.take(place, axis=0, out=out, mode="clip")  # the mode without a buffered copy
        else:
            out[...] = made.take(place, axis=0)

    return write


def quadratic_weights(weights: Floats) -> Floats:
    """Compute the weights of a quadratic tetrahedron's ten nodes from those of its corners."""
    # Inside, they are the shape functions. Outside, a quadratic function would soon turn back. So
    # the field continues along its tangent at the boundary, and affine motions are reproduced at
    # any distance.
    outside = np.flatnonzero((weights < 0).any(axis=1))
    if not len(outside):
        return shape_functions(weights)
    inside = weights.copy()
    inside[outside] = np.maximum(weights[outside], 0.0)
    inside[outside] /= inside[outside].sum(axis=1, keepdims=True)
    result = shape_functions(inside)
    away = weights[outside] - inside[outside]
    result[outside] += np.einsum("nai,ni->na", shape_slopes(inside[outside]), away)
    return result


def point_weights(points: Floats, cells: Ints, place: Floats) -> Floats:
    """Compute the weights of a cage's vertices in the motion of a point.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    place : ndarray of float64, shape (3,)
        The point at rest [m].

    Returns
    -------
    ndarray of float64, shape (V,)
        Weights with the sum 1.

    Raises
    ------
    InputError
        The point lies outside the cage.
    """
    where = locate([place], points, cells[:, :4], threads=1)
    if where.outside:
        low, high = (
            [float(f"{x:.6g}") for x in end] for end in (points.min(axis=0), points.max(axis=0))
        )
        distance = format_quantity(where.largest_distance, "m")
        raise InputError(
            f"the point lies {distance} outside the cage",
            key="point",
            value=[float(x) for x in place],
            allowed=f"a point inside the cage, whose box extends from {low} to {high} m",
        )
    functions = where.weights[:1]
    if cells.shape[1] == 10:
        functions = shape_functions(functions)
    result = np.zeros(len(points))
    result[cells[where.tetrahedron[0]]] = functions[0]
    return result
