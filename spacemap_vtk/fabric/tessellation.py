"""Many Bézier patches of one degree, evaluated with their normals on a regular grid of parameters.

Patches are worked through in chunks (see `spacemap_vtk.fabric.patch_chunks`, which also says what
the speed hangs on), several at once in threads.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.fabric.bezier import bernstein, bernstein_derivative, quadrilateral_order
from spacemap_vtk.fabric.normals import robust_normals
from spacemap_vtk.fabric.patch_chunks import Chunk, Floats, Scratch, cut_into_chunks
from spacemap_vtk.parallel import for_each
from spacemap_vtk.recycler import Recycler

#: Surface points from which a second thread pays.
_WORTH_A_THREAD = 100_000


class Tessellation:
    """The surface of Bézier patches, prepared once for any positions of the control points.

    Points are not shared between patches: each has the normals of its own patch. Where the normal
    is undefined (an edge collapsed into a point, as at the pole of a cap) it is that of a place
    slightly inside the patch.

    Parameters
    ----------
    connectivity : (P, (p + 1)(q + 1)) array_like of int
        Control points of each patch, in the order of VTK_BEZIER_QUADRILATERAL.
    degree : (int, int)
        Degrees p along u and q along v, each at least 1.
    subdivisions : int
        Quadrilaterals along each side of a patch, at least 1.
    threads : int, optional
        Threads to work in; all processors if not given.

    Raises
    ------
    InputError
        A degree or the subdivisions are below 1.
    GeometryError
        The connectivity does not fit the degree, or holds a negative number.

    Notes
    -----
    The normal is ``du x dv`` normalised, and polygons run counter-clockwise round it.

    Results lie in memory that is used again once the last array over it is gone; they may be kept
    as long as one likes.

    Examples
    --------
    >>> tessellation = Tessellation([[0, 1, 2, 3]], (1, 1), 2)
    >>> positions, normals = tessellation.evaluate([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> positions.shape, normals[0].tolist(), tessellation.quads.shape
    ((9, 3), [0.0, 0.0, 1.0], (4, 4))
    """

    def __init__(
        self,
        connectivity: ArrayLike,
        degree: tuple[int, int],
        subdivisions: int,
        *,
        threads: int | None = None,
    ) -> None:
        if subdivisions < 1:
            raise InputError(
                "no such surface", key="subdivisions", value=subdivisions, allowed="at least 1"
            )
        p, q = degree
        order = quadrilateral_order(p, q)
        patches = np.asarray(connectivity)
        if patches.ndim != 2 or patches.shape[1] != len(order):
            raise GeometryError(
                f"connectivity of shape {patches.shape} does not fit patches of degree {p} x {q}",
                allowed=f"{len(order)} control points a patch",
            )
        if patches.size and patches.min() < 0:
            raise GeometryError("a patch refers to a negative point number")
        self.degree = p, q
        self.subdivisions = subdivisions
        self.patch_count = len(patches)
        # Below some 10^5 points a thread costs more to start than it saves.
        self._threads = threads or (None if self.point_count > _WORTH_A_THREAD else 1)
        self._least_points = int(patches.max()) + 1 if patches.size else 0
        self._recycler = Recycler(keep=3)  # positions, normals and an array carried over
        self._basis = _stacked_basis(p, q, subdivisions)
        self._corners = (p, len(order) - 1 - p, len(order) - 1)
        self._chunks = cut_into_chunks(
            patches.astype(np.int64, copy=False)[:, order], 3 * (subdivisions + 1) ** 2
        )

    def evaluate(
        self,
        control_points: ArrayLike,
        dtype: DTypeLike = np.float32,
        weights: ArrayLike | None = None,
    ) -> tuple[Floats, Floats]:
        """Return the surface points and their unit normals.

        The work is done relative to each patch's first control point, so a fabric far from the
        origin loses no digits but those that the result's own type cannot hold.

        Parameters
        ----------
        control_points : (N, 3) array_like
            In m, float32 or float64.
        dtype : dtype_like
            Type to work in and to return: float32 or float64.
        weights : (N,) array_like, optional
            Weights of the control points of rational patches, above 0; all 1 by default.

        Returns
        -------
        positions : (P (n + 1)**2, 3) float
            In m; the point numbers that `quads` and `triangles` refer to.
        normals : (P (n + 1)**2, 3) float
            Unit vectors; NaN only where a control point is not finite.

        Raises
        ------
        GeometryError
            The shape is wrong, there are fewer points than the patches refer to, or a weight is not
            above 0.
        InputError
            Another type is asked for.
        """
        points = self._checked(control_points)
        if points.ndim != 2 or points.shape[1] != 3:
            raise GeometryError(f"control points of shape {points.shape}", allowed="(N, 3)")
        kind = np.dtype(dtype)
        if kind not in (np.float32, np.float64):
            raise InputError("no such surface", key="dtype", value=kind, allowed="float32, float64")
        rational = None if weights is None else self._checked_weights(weights)
        # Squares of cross products are fourth powers of lengths: micrometres underflow float32.
        scale = _magnitude(points, self._chunks)
        basis = self._basis.copy()
        basis[1:] /= scale
        stacked = basis.reshape(-1, basis.shape[2]).astype(kind)
        positions = self._recycler.empty((self.point_count, 3), kind)
        normals = self._recycler.empty((self.point_count, 3), kind)
        suspects: list[tuple[Chunk, NDArray[np.intp]]] = []

        def worker() -> Callable[[Chunk], None]:
            scratch = Scratch(self._chunks, stacked.shape, points.dtype, kind)

            def do(chunk: Chunk) -> None:
                with np.errstate(all="ignore"):
                    net, origin = scratch.gather(chunk, points)
                    third = len(stacked) // 3
                    if rational is None:
                        values = scratch.multiply(chunk, stacked, net)
                    else:
                        values = scratch.multiply_rational(chunk, stacked, net, rational, third)
                    surface = self._part(positions, chunk)
                    for axis in range(3):
                        np.add(
                            values[axis, :, :third], origin[axis][:, None], out=surface[..., axis]
                        )
                    found = scratch.normals(
                        chunk, net, values, self._part(normals, chunk), self._corners, scale
                    )
                if len(found):
                    suspects.append((chunk, found))

            return do

        for_each(self._chunks, worker, self._threads)
        if suspects:
            self._repair(normals, points, rational, suspects)
        return positions, normals

    def interpolate(self, values: ArrayLike, weights: ArrayLike | None = None) -> Floats:
        """Carry an array of the control points over to the surface points.

        Parameters
        ----------
        values : (N,) or (N, k) array_like
            One row a control point; taken as control values of a Bézier function on each patch, as
            positions are. So a displacement, or any linear function of position, comes out exact.
        weights : (N,) array_like, optional
            As for `evaluate`.

        Returns
        -------
        (P (n + 1)**2,) or (P (n + 1)**2, k) float
            Of float32 for float32, of float64 for all else.

        Raises
        ------
        GeometryError
            There are fewer rows than control points, or more than two axes.
        """
        table = self._checked(values)
        if table.ndim not in (1, 2):
            raise GeometryError(f"point array of shape {table.shape}", allowed="(N,) or (N, k)")
        rational = None if weights is None else self._checked_weights(weights)
        columns = table if table.ndim == 2 else table[:, None]
        kind = np.dtype(np.float32 if table.dtype == np.float32 else np.float64)
        matrix = self._basis[0].astype(kind)
        result = self._recycler.empty((self.point_count, columns.shape[1]), kind)

        def worker() -> Callable[[Chunk], None]:
            scratch = Scratch(self._chunks, matrix.shape, table.dtype, kind)

            def do(chunk: Chunk) -> None:
                part = self._part(result, chunk)
                with np.errstate(all="ignore"):
                    for start in range(0, columns.shape[1], 3):
                        net, origin = scratch.gather(chunk, columns[:, start : start + 3])
                        if rational is None:
                            products = scratch.multiply(chunk, matrix, net)
                        else:
                            products = scratch.multiply_rational(
                                chunk, matrix, net, rational, len(matrix)
                            )
                        for i, product in enumerate(products):
                            np.add(product, origin[i][:, None], out=part[..., start + i])

            return do

        for_each(self._chunks, worker, self._threads)
        return result.reshape(-1, *table.shape[1:])

    @property
    def point_count(self) -> int:
        """Number of surface points, ``P (n + 1)**2``."""
        return self.patch_count * (self.subdivisions + 1) ** 2

    @cached_property
    def quads(self) -> NDArray[np.int64]:
        """Quadrilaterals, (P n**2, 4) int64: all of one patch, u fastest, before the next patch."""
        n = self.subdivisions
        place = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
        corners = np.stack((place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]), axis=2)
        result = np.empty((self.patch_count, corners.size), dtype=np.int64)
        # Chunk by chunk: what is written is in the cache, and a user can end it in between.
        for chunk in self._chunks:
            patch = np.arange(chunk.blocks * chunk.width)
            block, column = np.divmod(patch, chunk.width)
            first = (chunk.first + block * chunk.width) * place.size + column
            within = result[chunk.first : chunk.first + len(patch)]
            np.multiply(corners.ravel(), chunk.width, out=within)
            within += first[:, None]
        return _frozen(result.reshape(-1, 4))

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """Triangles, (2 P n**2, 3) int64: each of `quads` cut along its first diagonal."""
        return _frozen(self.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))

    @cached_property
    def patch_of_cell(self) -> NDArray[np.int64]:
        """Patch of each of `quads`, (P n**2,) int64; ``array[patch_of_cell]`` carries one over."""
        return _frozen(np.repeat(np.arange(self.patch_count), self.subdivisions**2))

    def _checked(self, values: ArrayLike) -> NDArray[Any]:
        table = np.asarray(values)
        if table.ndim < 1 or len(table) < self._least_points:
            raise GeometryError(
                f"the patches refer to point {self._least_points - 1}, and there are "
                f"{len(table) if table.ndim else 0} rows",
                allowed=f"at least {self._least_points}",
            )
        return table

    def _checked_weights(self, weights: ArrayLike) -> NDArray[Any]:
        table = self._checked(weights)
        if table.ndim != 1 or not (table > 0.0).all():
            raise GeometryError(
                "rational weights that are no positive numbers, one for each control point"
            )
        return table

    def _part(self, array: Floats, chunk: Chunk) -> Floats:
        """View of a chunk's rows as (blocks, samples, width, columns)."""
        samples = (self.subdivisions + 1) ** 2
        start = chunk.first * samples
        rows = array[start : start + chunk.blocks * chunk.width * samples]
        return rows.reshape(chunk.blocks, samples, chunk.width, -1)

    def _repair(
        self,
        normals: Floats,
        points: NDArray[Any],
        weights: NDArray[Any] | None,
        suspects: list[tuple[Chunk, NDArray[np.intp]]],
    ) -> None:
        """Evaluate some normals again, with care: all at once, for each call costs 0.3 ms."""
        nets, places, samples = [], [], []
        for chunk, found in suspects:
            block, sample, column = found.T
            nets.append(chunk.net(block, column))
            rows = (self.subdivisions + 1) ** 2
            places.append(
                (chunk.first + block * chunk.width) * rows + sample * chunk.width + column
            )
            samples.append(sample)
        v, u = np.divmod(np.concatenate(samples), self.subdivisions + 1)
        n, net = self.subdivisions, np.concatenate(nets)
        with np.errstate(all="ignore"):  # infinite control points
            normals[np.concatenate(places)] = robust_normals(
                points[net],
                self.degree,
                u / n,
                v / n,
                None if weights is None else weights[net].astype(np.float64),
            )


def _stacked_basis(p: int, q: int, subdivisions: int) -> NDArray[np.float64]:
    """Return B, Bu and Bv, (3, samples, control points); u is fastest in both."""
    t = np.arange(subdivisions + 1) / subdivisions
    u, v = bernstein(p, t), bernstein(q, t)
    du, dv = bernstein_derivative(p, t), bernstein_derivative(q, t)
    return np.stack((np.kron(v, u), np.kron(v, du), np.kron(dv, u)))


def _magnitude(points: NDArray[Any], chunks: list[Chunk]) -> float:
    """Return about the size of the patches, from a few of them; 1 if they have none."""
    sizes = []
    for chunk in chunks[:: max(1, len(chunks) // 16)]:
        net = points[chunk.net(0, 0)].astype(np.float64)
        sizes.append(float(np.ptp(net, axis=0).max()))
    finite = [size for size in sizes if 0 < size < np.inf]
    return max(finite, default=1.0)


def _frozen(array: NDArray[np.int64]) -> NDArray[np.int64]:
    array.flags.writeable = False  # it is shared by every caller
    return array
