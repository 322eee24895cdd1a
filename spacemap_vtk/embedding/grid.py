"""A background grid that tells in which tetrahedra a point may lie."""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.embedding.frames import Frames

_CELLS_PER_TETRAHEDRON = 2.0
_FEWEST_CELLS = 4096.0  # a coarse cage meets many points: fewer trials pay for more cells
_PAIRS = 2**15  # pairs of a tetrahedron and a cell that are looked at together


class Grid:
    """Equal cells over all tetrahedra, each with the tetrahedra that reach into it, in CSR form.

    Parameters
    ----------
    frames : Frames
        The tetrahedra.
    """

    def __init__(self, frames: Frames) -> None:
        self._frames = frames
        usable = np.flatnonzero(frames.usable)
        # wider by more than any tolerance, so that it bounds what counts as inside
        margin = 2.0 * frames.distance + 1e-8 * (frames.high[usable] - frames.low[usable]).max()
        low, high = frames.low[usable] - margin, frames.high[usable] + margin
        self._low, self._high = low.min(axis=0), high.max(axis=0)
        size = self._high - self._low
        self._shape = _shape(size, max(_CELLS_PER_TETRAHEDRON * len(usable), _FEWEST_CELLS))
        self._per_length = self._shape / size
        first, last = self._indices(low), self._indices(high)
        self._start, self._candidates = self._fill(usable, first, last - first + 1)

    def find(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return the lowest numbered tetrahedron that holds each point.

        Parameters
        ----------
        points : (n, 3) float64
            Finite.

        Returns
        -------
        (n,) int32
            -1 for points outside every tetrahedron.
        """
        found = np.full(len(points), -1, dtype=np.int32)
        near = ((points >= self._low) & (points <= self._high)).all(axis=1)
        open_ = np.flatnonzero(near)
        cell = self._number(self._indices(points[open_]))
        here, end = self._start[cell], self._start[cell + 1]
        # Each round tries every open point with its next candidate. Candidates are in ascending
        # order: the first that fits is the lowest.
        while True:
            left = here < end
            if not left.all():
                open_, here, end = open_[left], here[left], end[left]
            if not len(open_):
                return found
            candidate = self._candidates[here]
            fits = self._frames.inside(points[open_], candidate)
            found[open_[fits]] = candidate[fits]
            np.logical_not(fits, out=fits)
            open_, here, end = open_[fits], here[fits] + 1, end[fits]

    def _indices(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        result = ((points - self._low) * self._per_length).astype(np.int64)
        return np.clip(result, 0, self._shape - 1, out=result)

    def _number(self, indices: NDArray[np.int64]) -> NDArray[np.int64]:
        x, y, z = indices.T
        result: NDArray[np.int64] = x + self._shape[0] * (y + self._shape[1] * z)
        return result

    def _fill(
        self, usable: NDArray[np.intp], first: NDArray[np.int64], extent: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """Return (cells + 1,) starts and the candidates of each cell, ascending."""
        # Boxes of needles cover many cells that the needle misses: in blocks, and sieved at once.
        ends = np.cumsum(extent.prod(axis=1))
        cells, tetrahedra = [], []
        begin = 0
        while begin < len(usable):
            done = ends[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(ends, done + _PAIRS, side="right")))
            block = slice(begin, end)
            cell, place = self._pairs(first[block], extent[block])
            which = usable[block][place]
            half = 0.5 / self._per_length
            middle = [self._low[i] + (cell[i] + 0.5) / self._per_length[i] for i in range(3)]
            kept = self._frames.touch_boxes(which, middle, half)
            cells.append(self._number(np.stack(cell, axis=1)[kept]))
            tetrahedra.append(which[kept].astype(np.int32))
            begin = end
        all_cells = np.concatenate(cells)
        order = np.argsort(all_cells, kind="stable")
        counts = np.bincount(all_cells, minlength=int(prod(self._shape.tolist())))
        return np.concatenate(([0], np.cumsum(counts))), np.concatenate(tetrahedra)[order]

    @staticmethod
    def _pairs(
        first: NDArray[np.int64], extent: NDArray[np.int64]
    ) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
        """Return x, y, z of every cell of some boxes of cells, and the box that each is of."""
        counts = extent.prod(axis=1)
        box = np.repeat(np.arange(len(first)), counts)
        within = np.arange(len(box)) - np.repeat(np.cumsum(counts) - counts, counts)
        within, x = np.divmod(within, extent[box, 0])
        z, y = np.divmod(within, extent[box, 1])
        return [first[box, 0] + x, first[box, 1] + y, first[box, 2] + z], box


def _shape(size: NDArray[np.float64], cells: float) -> NDArray[np.int64]:
    """Return counts of about cubic cells along a box; a thin side gets one."""
    shape = np.ones(3, dtype=np.int64)
    remaining = cells
    for done, axis in enumerate(np.argsort(size)):
        sides = np.sort(size)[done:]
        edge = float(np.exp(np.mean(np.log(sides))) / remaining ** (1.0 / len(sides)))
        shape[axis] = max(1, round(float(size[axis]) / edge))
        remaining = max(1.0, remaining / float(shape[axis]))
    return shape
