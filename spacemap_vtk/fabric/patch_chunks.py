"""Bézier patches in chunks that stay in the processor's cache.

Each chunk goes through four steps: gather the control points, one matrix product with the stacked
Bernstein matrices ``[B; Bu; Bv]``, cross product, normalisation. What the speed hangs on, each
measured:

- Scratch is component-major (x, y, z apart), so that every ufunc runs over contiguous memory; only
  the last operation on each component writes into the interleaved result.
- Within a block the patches are the last axis and the samples the one before. So the points of a
  block lie sample after sample, not patch after patch.
- A block is so narrow that OpenBLAS does its product in the calling thread. From about 2**18
  multiplications on it would start its own threads, which fight with ours: seconds, not ms.
"""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

Floats = NDArray[np.floating[Any]]

_BLAS_SERIAL = 2**18  # multiplications that OpenBLAS does without threads of its own
_CHUNK_BYTES = 5 * 2**20  # scratch of a chunk of float32; more leaves the cache, less is overhead

# |du x dv| below this, over the square of the patch's size, is not trusted: it may be the rounding
# error (1e-6 and less in float32) of a collapsed edge. Such samples are looked at one by one.
_SUSPECT = 1e-4


class Chunk(NamedTuple):
    """Consecutive patches, in blocks of equal width."""

    first: int  # number of the first patch
    blocks: int
    width: int  # patches a block
    rows: slice | NDArray[np.int64]  # the control points in use
    gather: NDArray[np.int64]  # (blocks, control points, width), places in rows

    @property
    def row_count(self) -> int:
        """Number of control points in use."""
        rows = self.rows
        return rows.stop - rows.start if isinstance(rows, slice) else len(rows)

    def net(self, block: Any, column: Any) -> NDArray[np.int64]:
        """Return the numbers of the control points of some patches.

        Parameters
        ----------
        block, column : int or (n,) int
            Where the patches stand.

        Returns
        -------
        (size,) or (n, size) int64
            Rows of the table of control points.
        """
        places = self.gather[block, :, column]
        return places + self.rows.start if isinstance(self.rows, slice) else self.rows[places]


def cut_into_chunks(patches: NDArray[np.int64], rows: int) -> list[Chunk]:
    """Cut patches into chunks; only the last ones are smaller.

    Parameters
    ----------
    patches : (P, size) int64
        Control points of each patch, u fastest.
    rows : int
        Rows of the largest matrix that `Scratch.multiply` will be given.

    Returns
    -------
    list of Chunk
        In the order of the patches.
    """
    size = patches.shape[1]
    width = max(8, _BLAS_SERIAL // (rows * size) // 16 * 16)
    floats = 4 * rows + 2 * rows // 3 + 3 * size + 3 * (size + 1)
    blocks = max(1, _CHUNK_BYTES // (4 * floats * width))
    result, first, count = [], 0, len(patches)
    while first < count:
        left = count - first
        if left < width:
            width = left
        shape = min(blocks, left // width), width
        part = patches[first : first + prod(shape)]
        low, high = int(part.min()), int(part.max()) + 1
        used: slice | NDArray[np.int64] = slice(low, high)
        # neighbouring patches share points with near numbers, unless someone has shuffled them
        if high - low > part.size:
            used, part = np.unique(part, return_inverse=True)
            part = part.reshape(-1, size)
        else:
            part = part - low
        gather = np.ascontiguousarray(part.reshape(*shape, size).transpose(0, 2, 1))
        result.append(Chunk(first, *shape, used, gather))
        first += prod(shape)
    return result


class Scratch:
    """One thread's working memory, and the steps that use it.

    Parameters
    ----------
    chunks : list of Chunk
        All that will be worked on.
    matrix : (int, int)
        Shape of the matrix of `multiply`.
    table : dtype
        Type of the arrays of `gather`.
    kind : dtype_like
        Type to work in, float32 or float64.
    """

    def __init__(
        self, chunks: list[Chunk], matrix: tuple[int, int], table: np.dtype[Any], kind: DTypeLike
    ) -> None:
        rows, size = matrix
        most = max(chunk.blocks * chunk.width for chunk in chunks)
        used = max(chunk.row_count for chunk in chunks)
        # Gathered in the table's own precision: it must not be cut to ours before the difference
        # with the patch's first point is taken.
        source = table if table in (np.float32, np.float64) else np.dtype(kind)
        self._used = np.empty((3, used), source)
        self._gathered = np.empty(3 * size * most, source)
        self._net = self._gathered if source == kind else np.empty(3 * size * most, kind)
        self._origin = np.empty(3 * most, source)
        self._values = np.empty(3 * rows * most, kind)
        self._normal = np.empty(rows * most, kind)
        self._temporary = np.empty((2, rows // 3 * most), kind)

    def gather(self, chunk: Chunk, table: NDArray[Any]) -> tuple[Floats, Floats]:
        """Gather the control values of a chunk, relative to the first of each patch.

        Parameters
        ----------
        chunk : Chunk
            The patches.
        table : (N, k) ndarray
            A row for each control point; k is at most 3.

        Returns
        -------
        net : (k, blocks, size, width) float
            Differences; valid until the next call.
        origin : (k, blocks, width) float
            The first control value of each patch.
        """
        axes = table.shape[1]
        used = self._used[:axes, : chunk.row_count]
        used[:] = table[chunk.rows].T
        shape = (axes, *chunk.gather.shape)
        gathered, net = (part[: prod(shape)].reshape(shape) for part in (self._gathered, self._net))
        # "clip" is the mode without a buffered copy; every index is in range
        np.take(used, chunk.gather, axis=1, out=gathered, mode="clip")
        shape = (axes, chunk.blocks, chunk.width)
        origin = self._origin[: prod(shape)].reshape(shape)
        origin[:] = gathered[:, :, 0]
        np.subtract(gathered, origin[:, :, None], out=net, casting="same_kind")
        return net, origin.astype(net.dtype, copy=False)

    def multiply(self, chunk: Chunk, matrix: Floats, net: Floats) -> Floats:
        """Multiply the control nets of a chunk by a matrix.

        Parameters
        ----------
        chunk : Chunk
            The patches.
        matrix : (rows, size) float
            Its number of rows is that of the constructor.
        net : (k, blocks, size, width) float
            From `gather`.

        Returns
        -------
        (k, blocks, rows, width) float
            Valid until the next call.
        """
        shape = (len(net), chunk.blocks, len(matrix), chunk.width)
        values = self._values[: prod(shape)].reshape(shape)
        return np.matmul(matrix, net, out=values)

    def multiply_rational(
        self,
        chunk: Chunk,
        matrix: Floats,
        net: Floats,
        weights: NDArray[Any],
        samples: int,
    ) -> Floats:
        """Multiply the control nets of rational patches by Bernstein matrices, and divide.

        Parameters
        ----------
        chunk : Chunk
            The patches.
        matrix : (rows, size) float
            The Bernstein matrix, or that of position and both derivatives.
        net : (k, blocks, size, width) float
            From `gather`; on return times the weights.
        weights : (N,) float
            Weight of each control point.
        samples : int
            Rows of the Bernstein matrix alone.

        Returns
        -------
        (k, blocks, rows, width) float
            Valid until the next call. The derivatives follow from those of numerator and
            denominator, ``(N' - (N / W) W') / W``.
        """
        local = weights[chunk.rows][chunk.gather].astype(net.dtype, copy=False)
        np.multiply(net, local, out=net)
        values, total = self.multiply(chunk, matrix, net), np.matmul(matrix, local)
        point, weight = values[:, :, :samples], total[:, :samples]
        point /= weight
        for first in range(samples, len(matrix), samples):
            slope = values[:, :, first : first + samples]
            slope -= point * total[:, first : first + samples]
            slope /= weight
        return values

    def normals(
        self,
        chunk: Chunk,
        net: Floats,
        values: Floats,
        out: Floats,
        corners: tuple[int, ...],
        scale: float,
    ) -> NDArray[np.intp]:
        """Write the unit normals.

        Parameters
        ----------
        chunk : Chunk
            The patches.
        net, values : ndarray
            From `gather` and, for the stacked matrices of position and derivatives, `multiply`.
        out : (blocks, samples, width, 3) float
            Where to write.
        corners : (int, int, int)
            Places in the net of all corners but the first.
        scale : float
            Length by which the matrices of the derivatives were divided.

        Returns
        -------
        (n, 3) int
            Block, sample and column of normals not to be trusted, NaN among them.
        """
        samples = values.shape[2] // 3
        shape = (chunk.blocks, samples, chunk.width)
        du, dv = values[:, :, samples : 2 * samples], values[:, :, 2 * samples :]
        normal = self._normal[: 3 * prod(shape)].reshape(3, *shape)
        length, product = (part[: prod(shape)].reshape(shape) for part in self._temporary)
        for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.multiply(du[y], dv[z], out=normal[x])
            np.multiply(du[z], dv[y], out=product)
            np.subtract(normal[x], product, out=normal[x])
        np.multiply(normal[0], normal[0], out=length)
        for component in normal[1:]:
            np.multiply(component, component, out=product)
            np.add(length, product, out=length)
        # the size of a patch: its other corners as seen from the first
        diagonal = net[:, :, corners] / scale
        size = np.square(diagonal, out=diagonal).sum(axis=(0, 2))
        suspect = length <= np.square(_SUSPECT * size)[:, None]
        np.sqrt(length, out=length)
        np.divide(1, length, out=length)
        for axis in range(3):
            np.multiply(normal[axis], length, out=out[..., axis])
        # of a flat array, because argwhere would take a tenth of the whole evaluation
        found = np.flatnonzero(suspect.reshape(-1))
        return np.stack(np.unravel_index(found, shape), axis=1)
