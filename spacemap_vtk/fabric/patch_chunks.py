"""Bézier patches in chunks that stay in the processor's cache.

Each chunk goes through these steps: gather the control points, one matrix product straight into the
positions, one for the slopes, cross product, normalisation. What the speed hangs on, each measured:

- The patches are the last axis but that of x, y, z, and the samples the one before. So the points
  of a chunk lie sample after sample, not patch after patch, and a product with points as rows
  writes them where they belong.
- For the normals x, y and z lie apart, so that every ufunc runs over contiguous memory; only the
  last operation on each writes into the interleaved result.
- The products are done in blocks of columns, so narrow that OpenBLAS does each in the calling
  thread (see `spacemap_vtk.parallel.BLAS_SERIAL`).
- What is written lies on the borders of 64 bytes (`spacemap_vtk.memory.aligned`): on others each
  vector that is stored crosses one in two, and a product of two arrays takes twice as long.
"""

from __future__ import annotations

from math import prod
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from spacemap_vtk.fabric.bezier import bernstein, bernstein_derivative
from spacemap_vtk.memory import aligned
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Ints
from spacemap_vtk.parallel import BLAS_SERIAL

# Scratch of a chunk of float32. More leaves the cache; with less, calls are so short that threads
# wait for the interpreter's lock: half of this takes a quarter longer in two threads.
_CHUNK_BYTES = 2**23

#: Patches of which x, y and z fill whole lines of the cache, in single and in double precision.
_LINES = 16

#: |du x dv| below this, over the square of the patch's size, is not trusted: it may be the rounding
#: error (1e-6 and less in float32) of a collapsed edge. Such samples are looked at one by one.
SUSPECT = 1e-4


class Chunk(NamedTuple):
    """Consecutive patches."""

    first: int  # number of the first patch
    rows: slice | Ints  # the control points in use
    gather: AnyInts  # (control points, patches), places in rows

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return self.gather.shape[1]

    def net(self, patch: Any) -> Ints:
        """Return the numbers of the control points of some patches."""
        places = self.gather[:, patch].T.astype(np.int64)
        return places + self.rows.start if isinstance(self.rows, slice) else self.rows[places]


def cut_into_chunks(patches: AnyInts, rows: int, *, narrow: bool = True) -> list[Chunk]:
    """Cut patches into chunks; only the last ones are smaller."""
    count, size = patches.shape
    floats = 4 * rows + 2 * rows // 3 + 9 * (size + 1)
    width = max(8, _CHUNK_BYTES // (4 * floats))
    width -= width % _LINES if width > _LINES else 0
    result = []
    for first in range(0, count, width):
        part = patches[first : first + width]
        low, high = int(part.min()), int(part.max()) + 1
        used: slice | Ints = slice(low, high)
        # neighbouring patches share points with near numbers, unless someone has shuffled them
        if high - low > part.size:
            used, part = np.unique(part, return_inverse=True)
            part = part.reshape(-1, size)
        else:
            part = part - low
        # Few are kept as NumPy takes them.
        chunk = Chunk(first, used, np.ascontiguousarray(part.T, np.intp))
        result.append(narrowed(chunk) if narrow else chunk)
    return result


def narrowed(chunk: Chunk) -> Chunk:
    """Return a chunk with places in few bits: they are read from memory at every step."""
    # Not narrower than 16 bits: compiled loops are made anew for each type.
    largest = int(chunk.gather.max(initial=0))
    kind = np.promote_types(np.uint16, np.min_scalar_type(largest))
    return chunk._replace(gather=chunk.gather.astype(kind, copy=False))


def multiply(matrix: AnyFloats, columns: AnyFloats, out: AnyFloats) -> AnyFloats:
    """Multiply in this thread alone."""
    width = max(8, BLAS_SERIAL // matrix.size // 16 * 16)
    whole = columns.shape[-1] // width * width
    if whole:
        blocks, results = (
            a[..., :whole].reshape(*a.shape[:-1], -1, width).swapaxes(-2, -3)
            for a in (columns, out)
        )
        np.matmul(matrix, blocks, out=results)
    if whole < columns.shape[-1]:
        np.matmul(matrix, columns[..., whole:], out=out[..., whole:])
    return out


class Scratch:
    """One thread's working memory, and the steps that use it."""

    def __init__(self, chunks: list[Chunk], rows: int, size: int) -> None:
        most = max(chunk.patch_count for chunk in chunks)
        # Enough for float64; of what float32 leaves unused the system never makes pages.
        self._places = np.empty(size * most, np.intp)
        self._gathered = aligned(3 * size * most)
        self._net = aligned(3 * (size + 1) * most)
        self._apart = aligned(3 * size * most)
        self._values = aligned(3 * rows * most)
        self._normal = [aligned(rows // 3 * most) for _ in range(3)]
        self._length, self._product = (aligned(rows // 3 * most) for _ in range(2))

    def net(self, chunk: Chunk, rows: NDArray[Any], kind: DTypeLike) -> AnyFloats:
        """Gather what a chunk's rows have, relative to the first of each patch, which is last."""
        places: NDArray[Any] = chunk.gather
        if places.dtype != np.intp:
            places = _part(self._places, places.shape, np.intp)
            places[:] = chunk.gather
        shape = *places.shape, rows.shape[1]
        net = _part(self._net, (len(places) + 1, *shape[1:]), kind)
        same = rows.dtype == kind
        gathered = net[:-1] if same else _part(self._gathered, shape, rows.dtype)
        # "clip" is the mode without a buffered copy; every index is in range
        np.take(rows, places, axis=0, out=gathered, mode="clip")
        origin = gathered[0].copy()
        net[-1] = origin
        gathered -= origin  # before it is cast: to do both at once takes longer
        if not same:
            net[:-1] = gathered
        return net

    def apart(self, net: AnyFloats) -> AnyFloats:
        """Part the components of a net."""
        size, count, columns = net.shape
        result = _part(self._apart, (columns, size - 1, count), net.dtype)
        for column, component in enumerate(result):
            component[:] = net[:-1, :, column]
        return result

    def multiply(self, matrix: AnyFloats, apart: AnyFloats) -> AnyFloats:
        """Multiply the control nets of a chunk by a matrix."""
        shape = len(apart), len(matrix), apart.shape[-1]
        return multiply(matrix, apart, _part(self._values, shape, apart.dtype))

    def multiply_rational(
        self, chunk: Chunk, matrix: AnyFloats, apart: AnyFloats, weights: NDArray[Any], samples: int
    ) -> AnyFloats:
        """Multiply the control nets of rational patches by Bernstein matrices, and divide."""
        local = weights[chunk.rows][chunk.gather].astype(apart.dtype, copy=False)
        np.multiply(apart, local, out=apart)
        values = self.multiply(matrix, apart)
        total = multiply(matrix, local, np.empty_like(values[0]))
        point, weight = values[:, :samples], total[:samples]
        point /= weight
        for first in range(samples, len(matrix), samples):
            slope = values[:, first : first + samples]
            slope -= point * total[first : first + samples]
            slope /= weight
        return values

    def normals(
        self, apart: AnyFloats, slopes: AnyFloats, out: AnyFloats, corners: list[int], scale: float
    ) -> NDArray[np.intp]:
        """Write the unit normals."""
        samples = slopes.shape[1] // 2
        shape = samples, slopes.shape[2]
        du, dv = slopes[:, :samples], slopes[:, samples:]
        *normal, length, product = (
            _part(part, shape, slopes.dtype)
            for part in (*self._normal, self._length, self._product)
        )
        for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.multiply(du[y], dv[z], out=normal[x])
            np.multiply(du[z], dv[y], out=product)
            np.subtract(normal[x], product, out=normal[x])
        np.multiply(normal[0], normal[0], out=length)
        for component in normal[1:]:
            np.multiply(component, component, out=product)
            np.add(length, product, out=length)
        # the size of a patch: its other corners as seen from the first
        diagonal = apart[:, corners] / scale
        size = np.square(diagonal, out=diagonal).sum(axis=(0, 1))
        suspect = length <= np.square(SUSPECT * size)
        np.sqrt(length, out=length)
        np.divide(1, length, out=length)
        for axis in range(3):
            np.multiply(normal[axis], length, out=out[..., axis])
        return np.flatnonzero(suspect)  # most often at poles of caps


def _part(memory: NDArray[Any], shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
    """View the beginning of some memory as an array."""
    return memory.view(kind)[: prod(shape)].reshape(shape)


class Bicubic:
    """Compiled evaluation of chunks of bicubic patches that are not rational."""

    def __init__(self, loops: ModuleType, subdivisions: int) -> None:
        self._loops = loops
        t = np.arange(subdivisions + 1) / subdivisions
        self._curve = np.stack((bernstein(3, t), bernstein_derivative(3, t)))

    def evaluate(
        self,
        chunk: Chunk,
        points: AnyFloats,
        scale: float,
        positions: AnyFloats,
        normals: AnyFloats | None = None,
        *,
        streamed: bool = False,
    ) -> Ints:
        """Write the points of a chunk and their unit normals, or the points alone."""
        kind = positions.dtype
        curve = self._curve.copy()
        curve[1] /= scale
        suspects = np.empty(positions.size // 3, np.int64)
        count = self._loops.evaluate(
            np.ascontiguousarray(points[chunk.rows]).reshape(-1),
            chunk.gather,
            curve.astype(kind),
            kind.type(1 / scale),
            kind.type(SUSPECT),
            positions.reshape(-1),
            None if normals is None else normals.reshape(-1),
            suspects,
            streamed and chunk.patch_count % _LINES == 0,
        )
        return suspects[:count]

    def interpolate(
        self, chunk: Chunk, columns: NDArray[Any], values: AnyFloats, *, streamed: bool = False
    ) -> None:
        """Write an array of the control points, carried over to the points of a chunk."""
        if columns.shape[1] == 3:  # as places are, each patch from its own first control point
            self.evaluate(chunk, columns, 1.0, values, streamed=streamed)
            return
        origin = columns[0].astype(values.dtype)
        origin[~np.isfinite(origin)] = 0
        self._loops.interpolate(
            np.ascontiguousarray(columns[chunk.rows]),
            origin,
            chunk.gather,
            self._curve.astype(values.dtype),
            values.reshape(-1),
        )
