"""A multifrontal Cholesky factorisation in numpy, and the inertia of an indefinite matrix.

SuperLU, scipy's own, stores both triangles, factorises a 95,000 row cube in 11 s, and hands out
the signs of its pivots only with a copy of everything. A symmetric matrix in nested-dissection
order is better served by dense LAPACK on the fronts of `spacemap_vtk.mechanics.fronts`: one
triangle, several times as fast, many right-hand sides at once, and inertia without keeping factors
at all.

Source: Duff and Reid, ACM TOMS 9 (1983) 302; Liu, SIAM Review 34 (1992) 82.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from spacemap_vtk import cancel
from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics import blas_threads
from spacemap_vtk.mechanics.fronts import dissection, fronts
from spacemap_vtk.memory import require
from spacemap_vtk.ndarrays import Floats, Ints, Progress

#: Columns that are eliminated at once where eigenvalues are counted: more than most fronts have,
#: and few enough to hear of progress, and to be stopped, several times a second.
PANEL = 384


class Analysis:
    """The fronts of a sparse symmetric pattern."""

    def __init__(self, matrix: sp.csr_matrix, vertices: Ints) -> None:
        node = np.unique(vertices, return_inverse=True)[1].ravel()
        count = int(node.max()) + 1
        pairs = matrix.tocoo()
        row, column = node[pairs.row], node[pairs.col]
        apart = row != column
        graph = sp.csr_matrix(
            (np.ones(int(apart.sum()), np.int32), (row[apart], column[apart])), shape=(count, count)
        )
        found, order = fronts(graph, dissection(graph))
        place = np.empty(count, np.int64)
        place[order] = np.arange(count)
        #: Rows in the order of elimination.
        self.order = np.argsort(place[node], kind="stable")
        start = np.concatenate([[0], np.cumsum(np.bincount(place[node], minlength=count))])
        #: First and last row, and the rows of the border, of each front.
        self.runs = [(int(start[f.first]), int(start[f.last])) for f in found]
        self.borders = [_ranges(start[f.border], start[f.border + 1]) for f in found]
        self.children = [f.children for f in found]
        #: Patterns that were ordered last, and the numbers of their entries in that order.
        self._ordered: dict[bool, tuple[Ints, Ints, sp.csc_matrix]] = {}

    @property
    def entries(self) -> int:
        """How many numbers the factors hold."""
        return sum(
            (last - first) * (last - first + len(border))
            for (first, last), border in zip(self.runs, self.borders, strict=True)
        )

    @property
    def work(self) -> Floats:
        """Multiplications up to the end of each front, as a share of all."""
        sizes = [(b - a, len(c)) for (a, b), c in zip(self.runs, self.borders, strict=True)]
        done = np.cumsum([w * (w * w / 3 + w * h + h * h) for w, h in sizes])
        return done / done[-1]

    def ordered(self, matrix: sp.csr_matrix, lower: bool = False) -> sp.csc_matrix:
        """Return a matrix, or its lower triangle, in the order of elimination."""
        # Steps and searches order one pattern a thousand times; that took as long as to eliminate.
        if not matrix.has_canonical_format:
            matrix = matrix.copy()
            matrix.sum_duplicates()
        kept = self._ordered.get(lower)
        if kept is None or not (
            np.array_equal(kept[0], matrix.indptr) and np.array_equal(kept[1], matrix.indices)
        ):
            numbers = np.arange(1, matrix.nnz + 1)
            made = sp.csr_matrix((numbers, matrix.indices, matrix.indptr), shape=matrix.shape)
            made = made[self.order][:, self.order]
            made = sp.tril(made, format="csc") if lower else made.tocsc()
            made.data -= 1
            kept = self._ordered[lower] = matrix.indptr, matrix.indices, made
        entries = kept[2]
        values = matrix.data[entries.data]
        return sp.csc_matrix((values, entries.indices, entries.indptr), shape=matrix.shape)

    def assembled(
        self, matrix: sp.csr_matrix, left: list[Floats | None]
    ) -> Iterator[tuple[int, Floats, Floats, Floats]]:
        """Yield each front, with what its children have left added in."""
        lower = self.ordered(matrix, lower=True)
        starts, rows, values = lower.indptr, lower.indices, lower.data
        place = np.empty(matrix.shape[0], np.int64)
        for number, ((first, last), border) in enumerate(zip(self.runs, self.borders, strict=True)):
            wide, high = last - first, len(border)
            pivot = np.zeros((wide, wide), order="F")
            side = np.zeros((high, wide), order="F")
            rest = np.zeros((high, high), order="F")
            place[first:last] = np.arange(wide)
            place[border] = np.arange(high)
            part = slice(starts[first], starts[last])
            row = rows[part]
            column = np.repeat(np.arange(wide), np.diff(starts[first : last + 1]))
            inner = row < last
            pivot[place[row[inner]], column[inner]] = values[part][inner]
            side[place[row[~inner]], column[~inner]] = values[part][~inner]
            for child in self.children[number]:
                update, left[child] = left[child], None
                where = self.borders[child]
                cut = int(np.searchsorted(where, last))
                at = place[where]
                assert update is not None
                _add(pivot, at[:cut], at[:cut], update[:cut, :cut])
                _add(side, at[cut:], at[:cut], update[cut:, :cut])
                _add(rest, at[cut:], at[cut:], update[cut:, cut:])
            yield number, pivot, side, rest


class Cholesky:
    """The factors of a sparse, symmetric, positive definite matrix."""

    def __init__(
        self, matrix: sp.csr_matrix, analysis: Analysis, progress: Progress | None = None
    ) -> None:
        require(
            14 * analysis.entries,
            f"factorising {matrix.shape[0]} degrees of freedom",
            cure="Use a coarser cage.",
        )
        self._analysis = analysis
        self._blocks: list[tuple[Floats, Floats]] = []
        left: list[Floats | None] = [None] * len(analysis.runs)
        share = analysis.work
        for number, pivot, side, rest in analysis.assembled(matrix, left):
            triangle, failed = lapack.dpotrf(pivot, lower=1, clean=1, overwrite_a=1)
            if failed:
                raise SolverError(
                    "the stiffness matrix cannot be factorised: it is not positive definite",
                    cure="Look for badly shaped tetrahedra in the cage",
                )
            if len(side):
                with blas_threads.several(side.size * len(side)):
                    side = blas.dtrsm(1, triangle, side, side=1, lower=1, trans_a=1, overwrite_b=1)
                    left[number] = blas.dsyrk(-1.0, side, beta=1.0, c=rest, lower=1, overwrite_c=1)
            self._blocks.append((triangle, side))
            if progress is not None:
                progress(float(share[number]))

    def solve(self, right: Floats) -> Floats:
        """Solve for many right-hand sides at once."""
        cancel.check()
        analysis = self._analysis
        x = np.ascontiguousarray(right[analysis.order])
        for (first, last), border, (triangle, side) in zip(
            analysis.runs, analysis.borders, self._blocks, strict=True
        ):
            mine = _divided(triangle, x[first:last], 1)
            x[first:last] = mine
            if len(border):
                x[border] -= _product(side, mine)
        for (first, last), border, (triangle, side) in zip(
            reversed(analysis.runs), reversed(analysis.borders), reversed(self._blocks), strict=True
        ):
            mine = x[first:last]
            if len(border):
                mine = mine - _product(side, x[border], 1)
            x[first:last] = _divided(triangle, mine, 0)
        solution = np.empty_like(x)
        solution[analysis.order] = x
        return solution


def negative_eigenvalues(
    matrix: sp.csr_matrix, analysis: Analysis, progress: Progress | None = None
) -> int:
    """Count the negative eigenvalues of a sparse symmetric matrix."""
    # By Sylvester's law of inertia they are those of the pivots, whatever congruence leads there.
    # Bunch and Kaufman's pivoting is confined to a panel of a front; no factors are kept.
    left: list[Floats | None] = [None] * len(analysis.runs)
    count, share = 0, np.append(0.0, analysis.work)
    for number, pivot, side, rest in analysis.assembled(matrix, left):
        before, after = share[number : number + 2]
        for first in range(0, len(pivot), PANEL):
            count += _eliminated(pivot[first:, first:], side[:, first:], rest)
            if progress is not None:
                done = min(1.0, (first + PANEL) / len(pivot))
                progress(float(before + done * (after - before)))
        left[number] = rest
    return count


def _eliminated(pivot: Floats, side: Floats, rest: Floats) -> int:
    """Eliminate the first panel of a front in place, and count its negative eigenvalues."""
    size, whole = min(PANEL, len(pivot)), len(pivot) <= PANEL
    below = side if whole else np.concatenate([pivot[size:, :size], side[:, :size]])
    factors, swaps, solved, failed = lapack.dsysv(
        pivot[:size, :size], below.T if len(below) else np.zeros((size, 1)), lower=1
    )
    if failed:
        raise SolverError("the eigenvalues cannot be counted at this shift")
    inside = len(pivot) - size
    for first in range(0, inside, PANEL):
        strip = slice(first, min(first + PANEL, inside))
        with blas_threads.several(below[first:].size * PANEL):
            change = _product(below[first:], solved[:, strip])
        pivot[size + first :, size:][:, strip] -= change[: inside - first]
        side[:, size:][:, strip] -= change[inside - first :]
    if len(side):
        with blas_threads.several(below[inside:].size * len(side)):
            blas.dgemm(-1.0, below[inside:], solved[:, inside:], beta=1.0, c=rest, overwrite_c=1)
    # A block of two has one eigenvalue of either sign, or it would not have been chosen.
    single = swaps >= 0
    return int((factors.diagonal()[single] < 0).sum()) + int((~single).sum()) // 2


def _product(block: Floats, right: Floats, transposed: int = 0) -> Floats:
    """Return A b, or Aᵀ b; of a large block in half the time that NumPy's product takes."""
    return blas.dgemm(1.0, block, right, trans_a=transposed)


def _divided(triangle: Floats, right: Floats, transposed: int) -> Floats:
    """Return L⁻¹ b, or L⁻ᵀ b; on the transposed of b, which lies in LAPACK's order."""
    return blas.dtrsm(1.0, triangle, right.T, side=1, lower=1, trans_a=transposed).T


def _add(block: Floats, rows: Ints, columns: Ints, values: Floats) -> None:
    """Add to the crossings of rows and columns, by slices where they are runs."""
    if len(rows) == 0 or len(columns) == 0:
        return
    if rows[-1] - rows[0] == len(rows) - 1 and columns[-1] - columns[0] == len(columns) - 1:
        block[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += values
    else:
        # Transposed, so that what lies together in memory is visited together.
        block.T[columns[:, None], rows] += values.T


def _ranges(starts: Ints, ends: Ints) -> Ints:
    """Return the numbers from each start to its end, in one array."""
    sizes = ends - starts
    return np.repeat(ends - np.cumsum(sizes), sizes) + np.arange(sizes.sum())
