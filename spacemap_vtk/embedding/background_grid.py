"""A background grid that lists, for each cell, the tetrahedra in which a point may lie."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk import cancel
from spacemap_vtk.embedding.frames import Frames
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints
from spacemap_vtk.parallel import for_each

_CELLS_PER_TETRAHEDRON = 4.0
_FEWEST_CELLS = 4096.0  # a coarse cage is used for many points, so more cells save more trials
_PAIRS = 2**16  # number of pairs of a tetrahedron and a cell in one block
_SLACK = 1e-6  # in cells: exceeds the rounding of the position where a face cuts a row
_FAR = 1e9  # in cells: exceeds the number of cells along any side


class BackgroundGrid:
    """Equal cells over all tetrahedra, each with the tetrahedra that reach into it, in CSR form."""

    def __init__(self, frames: Frames, threads: int | None = None) -> None:
        self._frames = frames
        self._threads = threads
        usable = np.flatnonzero(frames.usable)
        # Wider than any tolerance, so that the grid contains all points that count as inside.
        margin = 2.0 * frames.distance + 1e-8 * (frames.high[usable] - frames.low[usable]).max()
        low, high = frames.low[usable] - margin, frames.high[usable] + margin
        self._low, self._high = low.min(axis=0), high.max(axis=0)
        size = self._high - self._low
        self._shape = _choose_shape(size, max(_CELLS_PER_TETRAHEDRON * len(usable), _FEWEST_CELLS))
        self._per_length = self._shape / size
        first, last = self._indices(low), self._indices(high)
        self._start, self._candidates = self._fill(usable, first, last - first + 1)

    def find(self, points: Floats) -> NDArray[np.int32]:
        """Find the lowest numbered tetrahedron that contains each point."""
        found = np.full(len(points), -1, dtype=np.int32)
        near = ((points >= self._low) & (points <= self._high)).all(axis=1)
        open_ = np.flatnonzero(near)
        cell = self._number(self._indices(points[open_]))
        here, end = self._start[cell], self._start[cell + 1]
        # Each round tries the next candidate of every open point. Candidates are in ascending
        # order, so the first that fits is the lowest.
        while True:
            cancel.check()
            left = here < end
            if not left.all():
                open_, here, end = open_[left], here[left], end[left]
            if not len(open_):
                return found
            candidate = self._candidates[here]
            fits = self._frames.contains(points[open_], candidate)
            found[open_[fits]] = candidate[fits]
            np.logical_not(fits, out=fits)
            open_, here, end = open_[fits], here[fits] + 1, end[fits]

    def _indices(self, points: Floats) -> Ints:
        result = ((points - self._low) * self._per_length).astype(np.int64)
        return np.clip(result, 0, self._shape - 1, out=result)

    def _number(self, indices: Ints) -> Ints:
        x, y, z = indices.T
        return x + self._shape[0] * (y + self._shape[1] * z)

    def _fill(
        self, usable: NDArray[np.intp], first: Ints, extent: Ints
    ) -> tuple[Ints, NDArray[np.int32]]:
        """Compute (cells + 1,) starts and the candidates of each cell, ascending."""
        # The bounding box of a needle covers many cells that the needle misses. So boxes are
        # processed in blocks, and cells are filtered immediately, row by row.
        ends = np.cumsum(extent.prod(axis=1))
        blocks: list[tuple[int, slice]] = []
        begin = 0
        while begin < len(usable):
            done = ends[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(ends, done + _PAIRS, side="right")))
            blocks.append((len(blocks), slice(begin, end)))
            begin = end
        planes = self._frames.planes(self._low, 1.0 / self._per_length)
        found: list[Any] = [None] * len(blocks)

        def fill_block(job: tuple[int, slice]) -> None:
            number, block = job
            row, place = self._rows(first[block], extent[block])
            which = usable[block][place]
            begin, end = self._reach(planes, which, row)
            np.maximum(begin, first[block, 0][place], out=begin)
            np.minimum(end, (first[block, 0] + extent[block, 0])[place], out=end)
            counts = np.maximum(end - begin, 0)
            start = begin + self._shape[0] * (row[0] + self._shape[1] * row[1])
            cells = np.repeat(start - np.cumsum(counts) + counts, counts)
            cells += np.arange(len(cells))
            found[number] = cells.astype(np.int32), np.repeat(which, counts).astype(np.int32)

        for_each(blocks, lambda: fill_block, self._threads)
        cells, tetrahedra = (np.concatenate(part) for part in zip(*found, strict=True))
        from scipy.sparse import coo_matrix  # imported here: it takes a tenth of a second

        # Conversion to CSR sorts by counting: rows of cells, each with its tetrahedra in order.
        there = np.ones(len(cells), dtype=np.int8)
        shape = int(prod(self._shape.tolist())), int(usable[-1]) + 1
        table = coo_matrix((there, (cells, tetrahedra)), shape=shape).tocsr()
        return table.indptr.astype(np.int64), table.indices.astype(np.int32, copy=False)

    @staticmethod
    def _rows(first: Ints, extent: Ints) -> tuple[list[Ints], Ints]:
        """List y and z of every row of some boxes of cells, and the box of each row."""
        counts = extent[:, 1] * extent[:, 2]
        box = np.repeat(np.arange(len(first)), counts)
        within = np.arange(len(box)) - np.repeat(np.cumsum(counts) - counts, counts)
        z, y = np.divmod(within, extent[box, 1])
        return [first[box, 1] + y, first[box, 2] + z], box

    @staticmethod
    def _reach(planes: Floats, which: AnyInts, row: list[Ints]) -> tuple[Ints, Ints]:
        """Find the range of cells in each row that no face of a tetrahedron cuts off."""
        # Each face cuts a row once, so one division replaces a test of every cell.
        low = np.full(len(which), -_FAR)
        high = np.full(len(which), _FAR)
        for plane in planes:
            slope, along_y, along_z, offset = plane[:, which]
            rest = offset + along_y * row[0] + along_z * row[1]
            with np.errstate(divide="ignore", invalid="ignore"):
                bound = -rest / slope
            # Without a slope the whole row is inside, or none of it.
            bound = np.where(slope == 0.0, np.where(rest >= 0.0, -_FAR, _FAR), bound)
            np.maximum(low, bound, out=low, where=slope >= 0.0)
            np.minimum(high, bound, out=high, where=slope < 0.0)
        np.clip(low, -_FAR, _FAR, out=low)
        np.clip(high, -_FAR, _FAR, out=high)
        begin, end = (
            np.ceil(low - _SLACK).astype(np.int64),
            np.floor(high + _SLACK).astype(np.int64),
        )
        return begin, end + 1


def _choose_shape(size: Floats, cells: float) -> Ints:
    """Choose numbers of nearly cubic cells along a box; a thin side gets one."""
    shape = np.ones(3, dtype=np.int64)
    remaining = cells
    for done, axis in enumerate(np.argsort(size)):
        sides = np.sort(size)[done:]
        edge = float(np.exp(np.mean(np.log(sides))) / remaining ** (1.0 / len(sides)))
        shape[axis] = max(1, round(float(size[axis]) / edge))
        remaining = max(1.0, remaining / float(shape[axis]))
    return shape
