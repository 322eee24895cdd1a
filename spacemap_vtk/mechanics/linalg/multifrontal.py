"""Multifrontal factors of a sparse matrix, and the inertia of an indefinite one.

Why not SuperLU, which scipy brings: it stores both triangles, factorises a cube of 95,000 rows in
11 s, and gives the signs of its pivots only with a copy of everything. For a symmetric matrix in
nested-dissection order, dense LAPACK on fronts is better. It stores one triangle, is several times
as fast, solves for many right-hand sides at once, and finds the inertia without keeping factors.

See `spacemap_vtk.mechanics.linalg.fronts` for what a front is. Source: Duff and Reid, ACM TOMS 9
(1983) 302.
"""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from spacemap_vtk import cancel
from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.mechanics.linalg.fronts import Analysis
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Floats, Ints, Progress

#: Number of columns that are eliminated at once when eigenvalues are counted. Most fronts have
#: fewer, and several times a second the progress is reported and the work can be stopped.
PANEL = 384


class Cholesky:
    """Factors of a sparse, symmetric, positive definite matrix."""

    def __init__(
        self, matrix: sp.csr_matrix, analysis: Analysis, progress: Progress | None = None
    ) -> None:
        if not analysis.fits_in_memory:
            require_memory(
                14 * analysis.entries,
                f"factorising {matrix.shape[0]} degrees of freedom",
                cure="Use a coarser cage.",
            )
            analysis.fits_in_memory = True
        self._analysis = analysis
        self._fundamental_fronts: list[tuple[Floats, Floats]] = []
        left: list[Floats | None] = [None] * len(analysis.runs)
        share = analysis.work
        for number, pivot, side, rest in analysis.assemble_fronts(matrix, left):
            triangle, failed = lapack.dpotrf(pivot, lower=1, clean=0, overwrite_a=1)
            if failed:
                raise SolverError(
                    "the stiffness matrix cannot be factorised: it is not positive definite",
                    cure="Look for badly shaped tetrahedra in the cage",
                )
            if len(side):
                with blas_threads.use_threads_for(side.size * len(side)):
                    side = blas.dtrsm(1, triangle, side, side=1, lower=1, trans_a=1, overwrite_b=1)
                    left[number] = blas.dsyrk(-1.0, side, beta=1.0, c=rest, lower=1, overwrite_c=1)
            self._fundamental_fronts.append((triangle, side))
            if progress is not None:
                progress(float(share[number]))

    def solve(self, right: Floats) -> Floats:
        """Solve for many right-hand sides (N, m) at once, or for one."""
        cancel.check()
        analysis = self._analysis
        x = np.ascontiguousarray(right[analysis.order])
        x = x.ravel() if x.shape[1] == 1 else x
        for (first, last), border, (triangle, side) in zip(
            analysis.runs, analysis.borders, self._fundamental_fronts, strict=True
        ):
            mine = _solve_triangle(triangle, x[first:last], 1)
            x[first:last] = mine
            if len(border):
                x[border] -= _multiply(side, mine)
        for (first, last), border, (triangle, side) in zip(
            reversed(analysis.runs),
            reversed(analysis.borders),
            reversed(self._fundamental_fronts),
            strict=True,
        ):
            mine = x[first:last]
            if len(border):
                mine = mine - _multiply(side, x[border], 1)
            x[first:last] = _solve_triangle(triangle, mine, 0)
        solution = np.empty_like(right)
        solution[analysis.order] = x.reshape(right.shape)
        return solution


class _SquareFront(NamedTuple):
    """What is kept of a front: the factors of its pivots with their swaps, C, and P⁻¹ B."""

    pivot: Floats
    swaps: Ints
    below: Floats
    right: Floats


class SquareFactors:
    """Factors of an unsymmetric matrix whose pattern is symmetric, by compiled loops."""

    # Of A = [P B; C D] with the pivots P of a front, the factors of P, C, and X = P⁻¹ B are kept;
    # the update is -C X. P⁻¹ itself would halve the time of a solution, but takes half of that of
    # a factorisation, and a time step solves three or four times with each. Rows are exchanged
    # within P only.

    def __init__(
        self, lower: sp.csc_matrix, upper: Floats, analysis: Analysis, loops: ModuleType
    ) -> None:
        # `lower` is the lower triangle in the order of elimination; `upper` are the values of the
        # upper triangle at the mirror image of its entries.
        self._analysis = analysis
        self._fronts: list[_SquareFront] = []
        left: list[Floats | None] = [None] * len(analysis.runs)
        place = np.empty(lower.shape[0], np.int64)
        for number, ((first, last), border) in enumerate(
            zip(analysis.runs, analysis.borders, strict=True)
        ):
            cancel.check()
            wide, high = last - first, len(border)
            pivot = np.zeros((wide, wide), order="F")
            below = np.zeros((high, wide), order="F")
            right = np.zeros((wide, high), order="F")
            rest = np.zeros((high, high), order="F")
            place[first:last] = np.arange(wide)
            place[border] = np.arange(high)
            pattern = lower.indptr, lower.indices
            loops.fill_rows(*pattern, upper, first, last, place, pivot.T, right.T)
            loops.fill_columns(*pattern, lower.data, first, last, place, pivot.T, below.T)
            for child in analysis.children[number]:
                update, left[child] = left[child], None
                assert update is not None
                where = analysis.borders[child]
                cut = int(np.searchsorted(where, last))
                blocks = pivot.T, below.T, right.T, rest.T
                loops.add_square(update.T, place[where], cut, *blocks)
            factors, swaps, failed = lapack.dgetrf(pivot, overwrite_a=1)
            if failed:
                raise SolverError("the matrix is singular")
            if high:
                right = lapack.dgetrs(factors, swaps, right, overwrite_b=1)[0]
                left[number] = blas.dgemm(-1.0, below, right, beta=1.0, c=rest, overwrite_c=1)
            self._fronts.append(_SquareFront(factors, swaps, below, right))

    def solve(self, right: Floats) -> Floats:
        """Solve for a right-hand side, (N,)."""
        analysis = self._analysis
        x = right[analysis.order]
        parts = list(zip(analysis.runs, analysis.borders, self._fronts, strict=True))
        for (first, last), border, front in parts:
            x[first:last] = lapack.dgetrs(front.pivot, front.swaps, x[first:last])[0]
            if len(border):
                x[border] -= front.below @ x[first:last]
        for (first, last), border, front in reversed(parts):
            if len(border):
                x[first:last] -= front.right @ x[border]
        solution = np.empty_like(x)
        solution[analysis.order] = x
        return solution


def count_negative_eigenvalues(
    matrix: sp.csr_matrix, analysis: Analysis, progress: Progress | None = None
) -> int:
    """Count the negative eigenvalues of a sparse symmetric matrix."""
    # By Sylvester's law of inertia their number is that of the negative pivots, for any congruence.
    # Bunch and Kaufman's pivoting is confined to a panel of a front; no factors are kept.
    left: list[Floats | None] = [None] * len(analysis.runs)
    count, share = 0, np.append(0.0, analysis.work)
    for number, pivot, side, rest in analysis.assemble_fronts(matrix, left):
        before, after = share[number : number + 2]
        for first in range(0, len(pivot), PANEL):
            count += _eliminate_panel(pivot[first:, first:], side[:, first:], rest)
            if progress is not None:
                done = min(1.0, (first + PANEL) / len(pivot))
                progress(float(before + done * (after - before)))
        left[number] = rest
    return count


def _eliminate_panel(pivot: Floats, side: Floats, rest: Floats) -> int:
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
        with blas_threads.use_threads_for(below[first:].size * PANEL):
            change = _multiply(below[first:], solved[:, strip])
        pivot[size + first :, size:][:, strip] -= change[: inside - first]
        side[:, size:][:, strip] -= change[inside - first :]
    if len(side):
        with blas_threads.use_threads_for(below[inside:].size * len(side)):
            blas.dgemm(-1.0, below[inside:], solved[:, inside:], beta=1.0, c=rest, overwrite_c=1)
    # A pivot block of two rows has one eigenvalue of each sign; otherwise it is not chosen.
    single = swaps >= 0
    return int((factors.diagonal()[single] < 0).sum()) + int((~single).sum()) // 2


def _multiply(block: Floats, right: Floats, transposed: int = 0) -> Floats:
    """Compute A b, or Aᵀ b; for a large block in half the time of NumPy's product."""
    if right.ndim == 1:  # the product of matrices would copy the block
        return blas.dgemv(1.0, block, right, trans=transposed)
    return blas.dgemm(1.0, block, right, trans_a=transposed)


def _solve_triangle(triangle: Floats, right: Floats, transposed: int) -> Floats:
    """Compute L⁻¹ b, or L⁻ᵀ b."""
    if right.ndim == 1:
        return blas.dtrsv(triangle, right, lower=1, trans=1 - transposed)
    # From the transpose of b, which is in LAPACK's order.
    return blas.dtrsm(1.0, triangle, right.T, side=1, lower=1, trans_a=transposed).T
