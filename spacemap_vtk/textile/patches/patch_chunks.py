"""Evaluate Bézier patches in chunks that stay in the processor's cache.

Each chunk passes through these steps: gather the control points, compute the positions with one
matrix product and the slopes with another, then cross products and normalisation. The speed depends
on the following, each measured:

- The last axis is x, y, z, the one before it the patches, and the one before that the samples. So
  the points of a chunk are stored sample after sample, not patch after patch, and a product with
  points as rows writes them to the right place.
- For normals, x, y and z are separate arrays, so that every ufunc runs over contiguous memory. Only
  the last operation writes into the interleaved result.
- Products are computed in blocks of columns that are narrow enough for OpenBLAS to compute each in
  the calling thread (see `spacemap_vtk.parallel.BLAS_SERIAL`).
- Results begin at multiples of 64 bytes (`spacemap_vtk.memory.allocate_aligned`). Otherwise each
  stored vector crosses a cache line, and a product of two arrays takes twice as long.
"""

from __future__ import annotations

from math import prod
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from spacemap_vtk.memory import allocate_aligned
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Ints
from spacemap_vtk.parallel import BLAS_SERIAL
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative

# Scratch memory of a chunk in float32. A larger chunk leaves the cache. In a smaller one calls are
# so short that threads wait for the interpreter's lock: half of this takes a quarter longer in two
# threads.
_CHUNK_BYTES = 2**23

#: Number of patches whose x, y and z fill whole cache lines, in single and in double precision.
_LINES = 16

#: |du x dv| below this, over the square of the patch's size, is suspect: it may be the rounding
#: error (1e-6 and less in float32) of a collapsed edge. Suspect samples are examined one by one.
SUSPECT = 1e-4


class Chunk(NamedTuple):
    """Consecutive patches and the control points that they use."""

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
        # Neighbouring patches use points with similar numbers, unless the points are shuffled.
        if high - low > part.size:
            used, part = np.unique(part, return_inverse=True)
            part = part.reshape(-1, size)
        else:
            part = part - low
        # NumPy's own index type, so that `take` needs no copy; `narrow_indices` saves memory.
        chunk = Chunk(first, used, np.ascontiguousarray(part.T, np.intp))
        result.append(narrow_indices(chunk) if narrow else chunk)
    return result


def narrow_indices(chunk: Chunk) -> Chunk:
    """Store a chunk's indices in few bits, because they are read from memory at every step."""
    # At least 16 bits: compiled loops are compiled again for each type.
    largest = int(chunk.gather.max(initial=0))
    kind = np.promote_types(np.uint16, np.min_scalar_type(largest))
    return chunk._replace(gather=chunk.gather.astype(kind, copy=False))


def multiply(matrix: AnyFloats, columns: AnyFloats, out: AnyFloats) -> AnyFloats:
    """Multiply in the calling thread only."""
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
    """Working memory of one thread, and the steps that use it."""

    def __init__(self, chunks: list[Chunk], rows: int, size: int) -> None:
        most = max(chunk.patch_count for chunk in chunks)
        # Enough for float64; the system allocates no pages for what float32 leaves unused.
        self._places = np.empty(size * most, np.intp)
        self._gathered = allocate_aligned(3 * size * most)
        self._net = allocate_aligned(3 * (size + 1) * most)
        self._components = allocate_aligned(3 * size * most)
        self._values = allocate_aligned(3 * rows * most)
        self._normal = [allocate_aligned(rows // 3 * most) for _ in range(3)]
        self._length, self._product = (allocate_aligned(rows // 3 * most) for _ in range(2))

    def net(self, chunk: Chunk, rows: NDArray[Any], kind: DTypeLike) -> AnyFloats:
        """Gather the rows of each patch relative to its first one, which is appended."""
        places: NDArray[Any] = chunk.gather
        if places.dtype != np.intp:
            places = _view_start(self._places, places.shape, np.intp)
            places[:] = chunk.gather
        shape = *places.shape, rows.shape[1]
        net = _view_start(self._net, (len(places) + 1, *shape[1:]), kind)
        same = rows.dtype == kind
        gathered = net[:-1] if same else _view_start(self._gathered, shape, rows.dtype)
        # "clip" is the mode without a buffered copy; every index is in range.
        np.take(rows, places, axis=0, out=gathered, mode="clip")
        origin = gathered[0].copy()
        net[-1] = origin
        gathered -= origin  # before the cast: both at once take longer
        if not same:
            net[:-1] = gathered
        return net

    def separate_components(self, net: AnyFloats) -> AnyFloats:
        """Separate the components of a net."""
        size, count, columns = net.shape
        result = _view_start(self._components, (columns, size - 1, count), net.dtype)
        for column, component in enumerate(result):
            component[:] = net[:-1, :, column]
        return result

    def multiply(self, matrix: AnyFloats, apart: AnyFloats) -> AnyFloats:
        """Multiply the control nets of a chunk by a matrix."""
        shape = len(apart), len(matrix), apart.shape[-1]
        return multiply(matrix, apart, _view_start(self._values, shape, apart.dtype))

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
        """Write the unit normals; return the suspect samples."""
        samples = slopes.shape[1] // 2
        shape = samples, slopes.shape[2]
        du, dv = slopes[:, :samples], slopes[:, samples:]
        *normal, length, product = (
            _view_start(part, shape, slopes.dtype)
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
        # Size of a patch: distances of its other corners from the first.
        diagonal = apart[:, corners] / scale
        size = np.square(diagonal, out=diagonal).sum(axis=(0, 1))
        suspect = length <= np.square(SUSPECT * size)
        np.sqrt(length, out=length)
        np.divide(1, length, out=length)
        for axis in range(3):
            np.multiply(normal[axis], length, out=out[..., axis])
        return np.flatnonzero(suspect)  # most often at poles of caps


def _view_start(memory: NDArray[Any], shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
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
        """Write the points of a chunk, and their unit normals if an array is given for them."""
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
            positions[:0].reshape(-1) if normals is None else normals.reshape(-1),
            suspects,
            streamed and chunk.patch_count % _LINES == 0,
        )
        return suspects[:count]

    def interpolate(
        self, chunk: Chunk, columns: NDArray[Any], values: AnyFloats, *, streamed: bool = False
    ) -> None:
        """Interpolate an array of the control points at the points of a chunk."""
        if columns.shape[1] == 3:  # like positions, relative to the first control point of a patch
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
