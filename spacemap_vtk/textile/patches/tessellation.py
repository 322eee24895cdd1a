"""Evaluate many Bézier patches of one degree, with normals, on a regular grid of parameters.

Patches are processed in chunks, several at once in threads.
`spacemap_vtk.textile.patches.patch_chunks` explains what determines the speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from math import log2
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.memory import ArrayPool, is_streamed
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats
from spacemap_vtk.parallel import MANY_POINTS, for_each, load_loops
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative, quadrilateral_order
from spacemap_vtk.textile.patches.normals import RobustNormals
from spacemap_vtk.textile.patches.patch_chunks import (
    Bicubic,
    Chunk,
    Scratch,
    cut_into_chunks,
    multiply,
    narrow_indices,
)

#: Number of surface points, summed over steps, from which a small surface uses compiled loops. By
#: then NumPy has lost about as much time, 10 ns per point, as loading the loops takes.
COMPILE_AFTER = 50_000_000


class Tessellation:
    """The surface of Bézier patches, prepared once for any positions of the control points.

    Patches share no surface points: each point has the normal of its patch. Where the normal is
    undefined (an edge collapsed into a point, as at the pole of a cap), it is evaluated slightly
    inside the patch.

    Parameters
    ----------
    connectivity : (P, (p + 1)(q + 1)) array_like of int
        Control points of each patch, in the order of VTK_BEZIER_QUADRILATERAL.
    degree : (int, int)
        Degrees p along u and q along v, each at least 1.
    subdivisions : int
        Number of quadrilaterals along each side of a patch, at least 1.
    threads : int, optional
        Number of threads; by default one for each processor.

    Raises
    ------
    InputError
        A degree or the subdivisions are below 1.
    GeometryError
        The connectivity does not match the degree, or contains a negative number.

    Notes
    -----
    The normal is ``du x dv`` normalised, and polygons run counter-clockwise around it.

    Results may be kept for any time. Their memory is reused only after the last array on it is
    gone.

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
                "there must be subdivisions",
                key="subdivisions",
                value=subdivisions,
                allowed="at least 1",
            )
        p, q = degree
        order = quadrilateral_order(p, q)
        patches = np.asarray(connectivity)
        if patches.ndim != 2 or patches.shape[1] != len(order):
            raise GeometryError(
                f"connectivity of shape {patches.shape} does not fit patches of degree {p} x {q}",
                allowed=f"{len(order)} control points per patch",
            )
        if patches.size and patches.min() < 0:
            raise GeometryError("a patch refers to a negative point number")
        self.degree = p, q
        self.subdivisions = subdivisions
        self.patch_count = len(patches)
        # Below some 10^5 points starting a thread costs more time than it saves.
        many = self.point_count > MANY_POINTS
        self._threads = threads or (None if many else 1)
        self._least_points = int(patches.max()) + 1 if patches.size else 0
        self._recycler = ArrayPool(keep=3)  # positions, normals and an interpolated array
        self._idle_scratch: list[Scratch] = []
        self._basis = _stacked_basis(p, q, subdivisions)
        #: Evaluator with compiled loops, once they are in use.
        self.bicubic: Bicubic | None = None
        #: Whether the surface gets compiled loops after enough steps.
        self.can_compile = self.degree == (3, 3)
        self._evaluated = 0
        self._corners = [p, len(order) - 1 - p, len(order) - 1]
        samples = (subdivisions + 1) ** 2
        self._chunks = cut_into_chunks(patches[:, order], 3 * samples, narrow=many)
        self._load_loops(many)
        some = self._chunks[:: max(1, len(self._chunks) // 16)]
        nets = [chunk.net(np.array([0, -1])) for chunk in some]
        #: Control points of a few patches, from which the size of the patches is estimated.
        self._sample_nets = np.concatenate(nets) if nets else np.empty((0, len(order)), np.int64)
        #: Robust normals of each chunk that were evaluated last, with their data.
        self._robust_normals: dict[int, RobustNormals] = {}
        #: Matrices of the last scales and types: for points, and for interpolated arrays.
        self._matrix_cache: dict[tuple[float, np.dtype[Any]], tuple[AnyFloats, AnyFloats]] = {}

    def evaluate(
        self,
        control_points: ArrayLike,
        dtype: DTypeLike = np.float32,
        weights: ArrayLike | None = None,
    ) -> tuple[AnyFloats, AnyFloats]:
        """Compute the surface points and their unit normals.

        All values are relative to each patch's first control point. So a fabric far from the origin
        loses only the digits that the type of the result cannot hold.

        Parameters
        ----------
        control_points : (N, 3) array_like
            In m, float32 or float64.
        dtype : dtype_like
            Type of the computation and of the result: float32 or float64.
        weights : (N,) array_like, optional
            Weights of the control points of rational patches, above 0; all 1 by default.

        Returns
        -------
        positions : (P (n + 1)**2, 3) float
            In m; `quads` refers to these point numbers.
        normals : (P (n + 1)**2, 3) float
            Unit vectors; NaN only where a control point is not finite.

        Raises
        ------
        GeometryError
            The shape is wrong, there are fewer points than the patches refer to, or a weight is not
            positive.
        InputError
            The type is neither float32 nor float64.
        """
        points = self._check_rows(control_points)
        if points.ndim != 2 or points.shape[1] != 3:
            raise GeometryError(f"the control points have shape {points.shape}", allowed="(N, 3)")
        kind = np.dtype(dtype)
        if kind not in (np.float32, np.float64):
            raise InputError(
                "unsupported type", key="dtype", value=kind, allowed="float32, float64"
            )
        rational = None if weights is None else self._check_weights(weights)
        # Squares of cross products are fourth powers of lengths; micrometres would underflow.
        scale = _patch_size(points.take(self._sample_nets, axis=0))
        stacked, with_origin = self._matrices(scale, kind)
        self._evaluated += self.point_count
        positions = self._recycler.empty((self.point_count, 3), kind)
        normals = self._recycler.empty((self.point_count, 3), kind)
        samples = len(with_origin)
        if points.dtype not in (np.float32, np.float64):
            points = points.astype(np.float64)
        bicubic = self.bicubic if rational is None else None
        streamed = is_streamed(positions, normals)

        def evaluate_chunk(chunk: Chunk) -> None:
            surface, across = self._part(positions, chunk), self._part(normals, chunk)
            if bicubic is not None:
                found = bicubic.evaluate(chunk, points, scale, surface, across, streamed=streamed)
            else:
                found = multiply_chunk(chunk, surface, across)
            if len(found):
                with np.errstate(all="ignore"):  # infinite control points
                    robust = self._get_robust_normals(chunk, found).compute(
                        points, rational, self._loops
                    )
                across.reshape(-1, 3)[found] = robust

        def multiply_chunk(chunk: Chunk, surface: AnyFloats, across: AnyFloats) -> NDArray[np.intp]:
            with self._scratch() as scratch, np.errstate(all="ignore"):
                net = scratch.net(chunk, points[chunk.rows], kind)
                apart = scratch.separate_components(net)
                if rational is None:
                    multiply(with_origin, _flatten(net), _flatten(surface))
                    slopes = scratch.multiply(stacked[samples:], apart)
                else:
                    values = scratch.multiply_rational(chunk, stacked, apart, rational, samples)
                    slopes = values[:, samples:]
                    _add_origin(values[:, :samples], net, surface)
                return scratch.normals(apart, slopes, across, self._corners, scale)

        for_each(self._chunks, lambda: evaluate_chunk, self._threads)
        return positions, normals

    def interpolate(
        self, values: ArrayLike, weights: ArrayLike | None = None, dtype: DTypeLike | None = None
    ) -> AnyFloats:
        """Interpolate an array of the control points at the surface points.

        Parameters
        ----------
        values : (N,) or (N, k) array_like
            One row for each control point. They are control values of a Bézier function on each
            patch, like positions; so displacements and all linear functions of position are exact.
        weights : (N,) array_like, optional
            As for `evaluate`.
        dtype : dtype_like, optional
            Type of the computation and of the result, float32 or float64; by default float32 for
            float32, and float64 for all other types.

        Returns
        -------
        (P (n + 1)**2,) or (P (n + 1)**2, k) float
            One row for each surface point.

        Raises
        ------
        GeometryError
            There are fewer rows than control points, or more than two axes.
        """
        table = self._check_rows(values)
        if table.ndim not in (1, 2):
            raise GeometryError(
                f"the point array has shape {table.shape}", allowed="(N,) or (N, k)"
            )
        rational = None if weights is None else self._check_weights(weights)
        columns = table if table.ndim == 2 else table[:, None]
        kind = np.dtype(dtype or (np.float32 if table.dtype == np.float32 else np.float64))
        if columns.dtype not in (np.float32, np.float64):
            columns = columns.astype(kind)
        matrices, with_origin = self._matrices(1.0, kind)
        matrix = matrices[: len(with_origin)]
        result = self._recycler.empty((self.point_count, columns.shape[1]), kind)
        bicubic = self.bicubic if rational is None else None
        streamed = is_streamed(result)

        # Values that are equal at all control points stay equal to the last bit.
        def interpolate_chunk(chunk: Chunk) -> None:
            part = self._part(result, chunk)
            if bicubic is not None:
                bicubic.interpolate(chunk, columns, part, streamed=streamed)
                return
            with self._scratch() as scratch, np.errstate(all="ignore"):
                for start in range(0, columns.shape[1], 3):
                    few = slice(start, start + 3)
                    rows = columns[:, few][chunk.rows].astype(kind, copy=False)
                    net = scratch.net(chunk, rows, kind)
                    if rational is None:
                        out = part if columns.shape[1] <= 3 else np.empty_like(part[..., few])
                        multiply(with_origin, _flatten(net), _flatten(out))
                        if out is not part:
                            part[..., few] = out
                    else:
                        values = scratch.multiply_rational(
                            chunk, matrix, scratch.separate_components(net), rational, len(matrix)
                        )
                        _add_origin(values, net, part[..., few])

        for_each(self._chunks, lambda: interpolate_chunk, self._threads)
        return result.reshape(-1, *table.shape[1:])

    def views(self, *arrays: AnyFloats) -> Iterator[tuple[Any, ...]]:
        """Yield runs of patches with their parts of arrays of the surface points.

        Parameters
        ----------
        *arrays : ndarray of float, shape (point_count, k)
            Arrays of the surface points.

        Yields
        ------
        tuple
            Numbers of the patches as a slice; a view of each array, (samples, patches, k), u
            fastest.
        """
        for chunk in self._chunks:
            which = slice(chunk.first, chunk.first + chunk.patch_count)
            yield which, *(self._part(array, chunk) for array in arrays)

    @property
    def point_count(self) -> int:
        """Number of surface points, ``P (n + 1)**2``."""
        return self.patch_count * (self.subdivisions + 1) ** 2

    @cached_property
    def quads(self) -> AnyInts:
        """Quadrilaterals, (P n**2, 4), patch by patch, u fastest.

        Point numbers are int32 if they fit.
        """
        n = self.subdivisions
        place = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
        corners = np.stack((place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]), axis=2)
        kind = np.int32 if self.point_count < 2**31 else np.int64
        result = np.empty((self.patch_count, corners.size), kind)
        # Chunk by chunk, so that writes stay in the cache and a user can cancel in between.
        for chunk in self._chunks:
            within = result[chunk.first : chunk.first + chunk.patch_count]
            np.multiply(corners.ravel(), chunk.patch_count, out=within)
            within += (chunk.first * place.size + np.arange(chunk.patch_count))[:, None]
        result.flags.writeable = False  # all callers share it
        return result.reshape(-1, 4)

    @property
    def is_worth_compiling(self) -> bool:
        """Whether `compile` pays: after this many steps more are likely."""
        return self.can_compile and self._evaluated > COMPILE_AFTER

    def compile(self) -> None:
        """Switch to compiled loops if there is a compiler; they round differently."""
        self._load_loops(True)
        self.can_compile = False

    def _load_loops(self, many: bool) -> None:
        self._loops = (
            load_loops("spacemap_vtk.textile.patches.patch_loops", many)
            if self.can_compile
            else None
        )
        if self._loops is not None:
            self.bicubic, self.can_compile = Bicubic(self._loops, self.subdivisions), False
            self._chunks = [narrow_indices(chunk) for chunk in self._chunks]

    def _check_rows(self, values: ArrayLike) -> NDArray[Any]:
        table = np.asarray(values)
        if table.ndim < 1 or len(table) < self._least_points:
            raise GeometryError(
                f"the patches use point {self._least_points - 1}, but there are "
                f"{len(table) if table.ndim else 0} rows",
                allowed=f"at least {self._least_points}",
            )
        return table

    def _check_weights(self, weights: ArrayLike) -> NDArray[Any]:
        table = self._check_rows(weights)
        if table.ndim != 1 or not (table > 0.0).all():
            raise GeometryError("each control point needs one positive rational weight")
        return table

    @contextmanager
    def _scratch(self) -> Iterator[Scratch]:
        """Lend working memory and keep it: new pages would cost a small surface a fifth."""
        try:
            scratch = self._idle_scratch.pop()
        except IndexError:
            scratch = Scratch(self._chunks, 3 * self._basis.shape[1], self._basis.shape[2])
        try:
            yield scratch
        finally:
            self._idle_scratch.append(scratch)

    def _part(self, array: AnyFloats, chunk: Chunk) -> AnyFloats:
        """View a chunk's rows as (samples, count, columns)."""
        samples = (self.subdivisions + 1) ** 2
        rows = array[chunk.first * samples : (chunk.first + chunk.patch_count) * samples]
        return rows.reshape(samples, chunk.patch_count, -1)

    def _matrices(self, scale: float, kind: np.dtype[Any]) -> tuple[AnyFloats, AnyFloats]:
        """Return B over Bu and Bv for patches of a size, and B with the origin; both are cached."""
        matrices = self._matrix_cache.get((scale, kind))
        if matrices is None:
            basis = self._basis.copy()
            basis[1:] /= scale
            stacked = basis.reshape(-1, basis.shape[2]).astype(kind)
            matrices = stacked, _append_ones(stacked[: len(stacked) // 3])
            self._matrix_cache = {
                **dict(list(self._matrix_cache.items())[-2:]),
                (scale, kind): matrices,
            }
        return matrices

    def _get_robust_normals(self, chunk: Chunk, found: NDArray[np.intp]) -> RobustNormals:
        """Return robust normals of suspect samples; poles of caps are suspect at each step."""
        normals = self._robust_normals.get(chunk.first)
        if normals is None or not np.array_equal(normals.samples, found):
            normals = RobustNormals(chunk, found, self.degree, self.subdivisions)
            self._robust_normals[chunk.first] = normals
        return normals


def _stacked_basis(p: int, q: int, subdivisions: int) -> Floats:
    """Compute B, Bu and Bv, (3, samples, control points), u fastest in both."""
    t = np.arange(subdivisions + 1) / subdivisions
    u, v = bernstein(p, t), bernstein(q, t)
    du, dv = bernstein_derivative(p, t), bernstein_derivative(q, t)
    return np.stack((np.kron(v, u), np.kron(v, du), np.kron(dv, u)))


def _append_ones(matrix: AnyFloats) -> AnyFloats:
    """Extend a matrix so that it adds the last row of a net to its products with the others."""
    # The row is last, so it is added last: the sum of the others is small and keeps its digits.
    return np.concatenate((matrix, np.ones((len(matrix), 1), matrix.dtype)), axis=1)


def _flatten(rows: AnyFloats) -> AnyFloats:
    """View (n, count, k) as (n, count * k)."""
    return rows.reshape(len(rows), -1)


def _add_origin(values: AnyFloats, net: AnyFloats, out: AnyFloats) -> None:
    """Write (k, samples, count) values plus the last row of their net, (count, k)."""
    for column, component in enumerate(values):
        np.add(component, net[-1, :, column], out=out[..., column])


def _patch_size(nets: NDArray[Any]) -> float:
    """Estimate the size of the patches from the nets of a few; 1 if they have none."""
    # A power of two, so that division by it is exact.
    sizes = (nets.max(axis=1) - nets.min(axis=1)).max(axis=1).astype(np.float64)
    finite = [size for size in sizes.tolist() if 0 < size < np.inf]
    return 2.0 ** round(log2(max(finite, default=1.0)))
