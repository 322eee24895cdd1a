"""Many Bézier patches of one degree, evaluated with their normals on a regular grid of parameters.

Patches are worked through in chunks (see `spacemap_vtk.textile.patches.patch_chunks`, which also
says what the speed hangs on), several at once in threads.
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
from spacemap_vtk.memory import Recycler, is_streamed
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats
from spacemap_vtk.parallel import WORTHWHILE, for_each, loops
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative, quadrilateral_order
from spacemap_vtk.textile.patches.normals import RobustNormals
from spacemap_vtk.textile.patches.patch_chunks import (
    Bicubic,
    Chunk,
    Scratch,
    cut_into_chunks,
    multiply,
    narrowed,
)

#: Surface points, over all steps, from which a small surface has earned compiled loops: until then
#: NumPy has taken about as much longer, 10 ns a point, as it takes to load them.
EARNED = 50_000_000


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
        many = self.point_count > WORTHWHILE
        self._threads = threads or (None if many else 1)
        self._least_points = int(patches.max()) + 1 if patches.size else 0
        self._recycler = Recycler(keep=3)  # positions, normals and an array carried over
        self._idle: list[Scratch] = []
        self._basis = _stacked_basis(p, q, subdivisions)
        #: What evaluates by compiled loops.
        self.bicubic: Bicubic | None = None
        #: Whether it will have them once it has taken enough steps.
        self.earns_loops = self.degree == (3, 3)
        self._evaluated = 0
        self._corners = [p, len(order) - 1 - p, len(order) - 1]
        samples = (subdivisions + 1) ** 2
        self._chunks = cut_into_chunks(patches[:, order], 3 * samples, narrow=many)
        self._take_loops(many)
        some = self._chunks[:: max(1, len(self._chunks) // 16)]
        nets = [chunk.net(np.array([0, -1])) for chunk in some]
        #: Control points of a few patches, which tell how large they are.
        self._some = np.concatenate(nets) if nets else np.empty((0, len(order)), np.int64)
        #: Of each chunk the normals that were evaluated again last, with what goes with them.
        self._repaired: dict[int, RobustNormals] = {}
        #: Matrices of the last scales and types: those of points, and of arrays carried over.
        self._kept: dict[tuple[float, np.dtype[Any]], tuple[AnyFloats, AnyFloats]] = {}

    def evaluate(
        self,
        control_points: ArrayLike,
        dtype: DTypeLike = np.float32,
        weights: ArrayLike | None = None,
    ) -> tuple[AnyFloats, AnyFloats]:
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
            In m; the point numbers that `quads` refer to.
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
        scale = _magnitude(points.take(self._some, axis=0))
        stacked, with_origin = self._matrices(scale, kind)
        self._evaluated += self.point_count
        positions = self._recycler.empty((self.point_count, 3), kind)
        normals = self._recycler.empty((self.point_count, 3), kind)
        samples = len(with_origin)
        if points.dtype not in (np.float32, np.float64):
            points = points.astype(np.float64)
        bicubic = self.bicubic if rational is None else None
        streamed = is_streamed(positions, normals)

        def do(chunk: Chunk) -> None:
            surface, across = self._part(positions, chunk), self._part(normals, chunk)
            if bicubic is not None:
                found = bicubic.evaluate(chunk, points, scale, surface, across, streamed=streamed)
            else:
                found = by_products(chunk, surface, across)
            if len(found):
                with np.errstate(all="ignore"):  # infinite control points
                    robust = self._robust(chunk, found).of(points, rational, self._loops)
                across.reshape(-1, 3)[found] = robust

        def by_products(chunk: Chunk, surface: AnyFloats, across: AnyFloats) -> NDArray[np.intp]:
            with self._scratch() as scratch, np.errstate(all="ignore"):
                net = scratch.net(chunk, points[chunk.rows], kind)
                apart = scratch.apart(net)
                if rational is None:
                    multiply(with_origin, _flat(net), _flat(surface))
                    slopes = scratch.multiply(stacked[samples:], apart)
                else:
                    values = scratch.multiply_rational(chunk, stacked, apart, rational, samples)
                    slopes = values[:, samples:]
                    _add_origin(values[:, :samples], net, surface)
                return scratch.normals(apart, slopes, across, self._corners, scale)

        for_each(self._chunks, lambda: do, self._threads)
        return positions, normals

    def interpolate(
        self, values: ArrayLike, weights: ArrayLike | None = None, dtype: DTypeLike | None = None
    ) -> AnyFloats:
        """Carry an array of the control points over to the surface points.

        Parameters
        ----------
        values : (N,) or (N, k) array_like
            One row a control point; taken as control values of a Bézier function on each patch, as
            positions are. So a displacement, or any linear function of position, comes out exact.
        weights : (N,) array_like, optional
            As for `evaluate`.
        dtype : dtype_like, optional
            Type to work in and to return, float32 or float64; by default float32 for float32, and
            float64 for all else.

        Returns
        -------
        (P (n + 1)**2,) or (P (n + 1)**2, k) float
            One row a surface point.

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
        kind = np.dtype(dtype or (np.float32 if table.dtype == np.float32 else np.float64))
        if columns.dtype not in (np.float32, np.float64):
            columns = columns.astype(kind)
        matrices, with_origin = self._matrices(1.0, kind)
        matrix = matrices[: len(with_origin)]
        result = self._recycler.empty((self.point_count, columns.shape[1]), kind)
        bicubic = self.bicubic if rational is None else None
        streamed = is_streamed(result)

        # What is the same at all control points comes out the same at all others, to the last bit.
        def do(chunk: Chunk) -> None:
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
                        multiply(with_origin, _flat(net), _flat(out))
                        if out is not part:
                            part[..., few] = out
                    else:
                        values = scratch.multiply_rational(
                            chunk, matrix, scratch.apart(net), rational, len(matrix)
                        )
                        _add_origin(values, net, part[..., few])

        for_each(self._chunks, lambda: do, self._threads)
        return result.reshape(-1, *table.shape[1:])

    def views(self, *arrays: AnyFloats) -> Iterator[tuple[Any, ...]]:
        """Yield runs of patches, and of arrays of the surface's points their part.

        Parameters
        ----------
        *arrays : ndarray of float, shape (point_count, k)
            Whatever belongs to the points.

        Yields
        ------
        tuple
            The patches' numbers as a slice; of each array a view, (samples, patches, k), u fastest.
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
        """Quadrilaterals, (P n**2, 4): all of one patch, u fastest, before the next patch.

        Point numbers are int32 where that will do.
        """
        n = self.subdivisions
        place = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
        corners = np.stack((place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]), axis=2)
        kind = np.int32 if self.point_count < 2**31 else np.int64
        result = np.empty((self.patch_count, corners.size), kind)
        # Chunk by chunk: what is written is in the cache, and a user can end it in between.
        for chunk in self._chunks:
            within = result[chunk.first : chunk.first + chunk.patch_count]
            np.multiply(corners.ravel(), chunk.patch_count, out=within)
            within += (chunk.first * place.size + np.arange(chunk.patch_count))[:, None]
        result.flags.writeable = False  # it is shared by every caller
        return result.reshape(-1, 4)

    @property
    def has_earned_loops(self) -> bool:
        """Whether `compile` pays: who has taken so many steps will take more."""
        return self.earns_loops and self._evaluated > EARNED

    def compile(self) -> None:
        """Go on with compiled loops where there is a compiler; they round otherwise."""
        self._take_loops(True)
        self.earns_loops = False

    def _take_loops(self, many: bool) -> None:
        self._loops = (
            loops("spacemap_vtk.textile.patches.patch_loops", many) if self.earns_loops else None
        )
        if self._loops is not None:
            self.bicubic, self.earns_loops = Bicubic(self._loops, self.subdivisions), False
            self._chunks = [narrowed(chunk) for chunk in self._chunks]

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

    @contextmanager
    def _scratch(self) -> Iterator[Scratch]:
        """Lend working memory, which is kept: fresh pages would cost a small surface a fifth."""
        try:
            scratch = self._idle.pop()
        except IndexError:
            scratch = Scratch(self._chunks, 3 * self._basis.shape[1], self._basis.shape[2])
        try:
            yield scratch
        finally:
            self._idle.append(scratch)

    def _part(self, array: AnyFloats, chunk: Chunk) -> AnyFloats:
        """View of a chunk's rows as (samples, count, columns)."""
        samples = (self.subdivisions + 1) ** 2
        rows = array[chunk.first * samples : (chunk.first + chunk.patch_count) * samples]
        return rows.reshape(samples, chunk.patch_count, -1)

    def _matrices(self, scale: float, kind: np.dtype[Any]) -> tuple[AnyFloats, AnyFloats]:
        """Return B over Bu and Bv of patches of a size, and B with the origin: kept for steps."""
        kept = self._kept.get((scale, kind))
        if kept is None:
            basis = self._basis.copy()
            basis[1:] /= scale
            stacked = basis.reshape(-1, basis.shape[2]).astype(kind)
            kept = stacked, _with_ones(stacked[: len(stacked) // 3])
            self._kept = {**dict(list(self._kept.items())[-2:]), (scale, kind): kept}
        return kept

    def _robust(self, chunk: Chunk, found: NDArray[np.intp]) -> RobustNormals:
        """Return what is evaluated again: poles of caps are so at each step of a motion."""
        kept = self._repaired.get(chunk.first)
        if kept is None or not np.array_equal(kept.found, found):
            kept = RobustNormals(chunk, found, self.degree, self.subdivisions)
            self._repaired[chunk.first] = kept
        return kept


def _stacked_basis(p: int, q: int, subdivisions: int) -> Floats:
    """Return B, Bu and Bv, (3, samples, control points); u is fastest in both."""
    t = np.arange(subdivisions + 1) / subdivisions
    u, v = bernstein(p, t), bernstein(q, t)
    du, dv = bernstein_derivative(p, t), bernstein_derivative(q, t)
    return np.stack((np.kron(v, u), np.kron(v, du), np.kron(dv, u)))


def _with_ones(matrix: AnyFloats) -> AnyFloats:
    """Return a matrix that adds the last row of a net to what it makes of the others."""
    # Last, so that it is added last: the sum of the others is small, and keeps its digits.
    return np.concatenate((matrix, np.ones((len(matrix), 1), matrix.dtype)), axis=1)


def _flat(rows: AnyFloats) -> AnyFloats:
    """View (n, count, k) as (n, count * k)."""
    return rows.reshape(len(rows), -1)


def _add_origin(values: AnyFloats, net: AnyFloats, out: AnyFloats) -> None:
    """Write (k, samples, count) values plus the last row of their net, (count, k)."""
    for column, component in enumerate(values):
        np.add(component, net[-1, :, column], out=out[..., column])


def _magnitude(nets: NDArray[Any]) -> float:
    """Return about the size of the patches, from the nets of a few; 1 if they have none."""
    # A power of two, so that to divide by it costs no digit.
    sizes = (nets.max(axis=1) - nets.min(axis=1)).max(axis=1).astype(np.float64)
    finite = [size for size in sizes.tolist() if 0 < size < np.inf]
    return 2.0 ** round(log2(max(finite, default=1.0)))
