"""A body at any positions: energy, forces and stiffness on what its supports leave free."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy import linalg as la
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.factors import Solve, factorise
from spacemap_vtk.mechanics.multifrontal import Analysis
from spacemap_vtk.mechanics.strains import Strains
from spacemap_vtk.ndarrays import Floats, Ints, Progress

#: Share of its diagonal that is added to a stiffness, so that motions without energy are solved
#: for; and the most that it is raised to, where rounding leaves a definite one indefinite.
SHIFT, MOST_SHIFT = 1e-13, 1e-8

#: Up to here the lowest eigenvalue is found densely.
_DENSE = 60


class Part(NamedTuple):
    """Elements of one kind at some positions."""

    kind: Strains
    strain: Floats
    """ε, (E, Q, s)."""
    gradients: Floats
    """G, (E, Q, s, n, 3)."""
    stress: Floats
    """C ε, (E, Q, s)."""


class Body:
    """Elements of any kinds under a dead load; nodal vectors z are ``start + T q``."""

    def __init__(
        self,
        strains: Sequence[Strains],
        basis: sp.csr_matrix,
        start: Floats,
        load: Floats,
        progress: Progress,
    ) -> None:
        self.strains, self.basis, self.start, self.load = strains, basis.tocsr(), start, load
        self._across = self.basis.T
        #: Linear systems that were solved.
        self.steps = 0
        self._progress, self._shift = progress, SHIFT
        found = [crossings(kind.nodes, self.basis) for kind in strains]
        ends = np.cumsum([9 * kind.nodes.size * kind.nodes.shape[1] for kind in strains])
        self._entry = np.concatenate(
            [each[0] + first for each, first in zip(found, [0, *ends[:-1]], strict=True)]
        )
        self._weight = np.concatenate([each[1] for each in found])
        size = self.basis.shape[1]
        keys, slots = np.unique(np.concatenate([each[2] for each in found]), return_inverse=True)
        self._slot, self._columns = slots.ravel(), keys % size
        self._starts = np.searchsorted(keys, np.arange(size + 1) * size)
        # Rows with the same neighbours, those of one vertex or pair, are eliminated together.
        pattern = self._csr(np.ones(len(keys), dtype=np.int64))
        names = pattern @ np.random.default_rng(0).integers(1 << 62, size=size)
        self._analysis = Analysis(pattern, names)

    def _csr(self, values: NDArray[Any]) -> sp.csr_matrix:
        size = self.basis.shape[1]
        return sp.csr_matrix((values, self._columns, self._starts), shape=(size, size))

    @property
    def order(self) -> Ints:
        """Coordinates in the order of elimination."""
        return self._analysis.order

    def pattern(self) -> sp.csr_matrix:
        """Return a matrix of ones, of the pattern of every tangent."""
        return self._csr(np.ones(len(self._columns)))

    def matrix(self, blocks: Sequence[NDArray[Any]]) -> sp.csr_matrix:
        """Return Tᵀ M T of matrices (E, 3 n, 3 n) of each kind of element."""
        values = np.concatenate([block.ravel() for block in blocks])[self._entry]
        return self._csr(np.bincount(self._slot, values * self._weight, len(self._columns)))

    def at(self, z: Floats) -> list[Part]:
        """Return all strains and stresses at some positions."""
        return [
            Part(kind, strain, gradients, kind.stresses(strain))
            for kind in self.strains
            for strain, gradients in [kind.at(z)]
        ]

    def tangent(
        self, parts: list[Part], stresses: list[Floats] | None = None, firm: float = 0.0
    ) -> sp.csr_matrix:
        """Return K, with other stresses, and without a share of those that do not pull."""
        blocks = [
            part.kind.tangent_of(
                stress + firm * (part.kind.pulling(stress) - stress), part.gradients
            )
            for part, stress in zip(parts, stresses or [p.stress for p in parts], strict=True)
        ]
        return self.matrix(blocks)

    def forces(self, parts: list[Part], share: float) -> Floats:
        """Return what a share of the load leaves unbalanced, (N,)."""
        total = -share * self.load
        for kind, _, gradients, stress in parts:
            total += kind.summed(stress, gradients, len(total))
        return self.along_free(total)

    def along_free(self, nodal: Floats) -> Floats:
        """Return Tᵀ f of nodal forces (V, 3)."""
        return self._across @ nodal.ravel()

    def moved(self, q: Floats) -> Floats:
        """Return T q as a move of nodal vectors, (V, 3)."""
        return (self.basis @ q).reshape(-1, 3)

    def turn(self, move: Floats) -> float:
        """Return the largest rotation of a move [rad], above zero."""
        return max(np.finfo(float).tiny, *(kind.turn(move) for kind in self.strains))

    def inside_out(self, z: Floats) -> bool:
        """Tell whether an element is: its energy would be as low as that of its mirror image."""
        return any(
            bool((kind.handedness(z) * kind.handedness(self.start) <= 0).any())
            for kind in self.strains
        )

    def along(self, parts: list[Part], move: Floats, share: float) -> Floats:
        """Return the energy at z + a Δz less that at z: the coefficients of a⁴ to 1."""
        powers = np.zeros(5)
        for kind, _, gradients, stress in parts:
            first, second = kind.changes(gradients, move), kind.squares(move)[0]
            push, bend = kind.stresses(first), kind.stresses(second)
            powers[:4] += [
                float(np.vdot(second, bend)) / 2,
                float(np.vdot(second, push)),
                float(np.vdot(first, push)) / 2 + float(np.vdot(stress, second)),
                float(np.vdot(stress, first)),
            ]
        powers[3] -= share * np.vdot(self.load, move)
        return powers

    def solution(self, matrix: sp.csr_matrix) -> Solve:
        """Return the solution with a matrix, which has to be definite."""
        self.report()
        self.steps += 1
        solve = factorise(self._shifted(matrix), lambda: self._analysis, self.report).solve
        return lambda right: solve(right.reshape(len(right), -1)).reshape(right.shape)

    def definite(self, matrix: sp.csr_matrix) -> Solve:
        """Return the solution with a matrix that is definite but for rounding."""
        while True:
            try:
                return self.solution(matrix)
            except SolverError:
                if self._shift >= MOST_SHIFT:
                    raise
                self._shift *= 100

    def unsymmetric(self, matrix: sp.csr_matrix) -> Solve:
        """Return the solution with a matrix of the tangent's pattern that need not be symmetric."""
        order = self._analysis.order
        try:
            solve = splu(
                self._analysis.ordered(matrix),
                permc_spec="NATURAL",
                diag_pivot_thresh=0.01,
                options={"SymmetricMode": True},
            ).solve
        except RuntimeError as error:
            raise SolverError("the matrix of a step is singular") from error

        def solved(right: Floats) -> Floats:
            result = np.empty_like(right)
            result[order] = solve(right[order])
            return result

        return solved

    def lowest(self, matrix: sp.csr_matrix, definite: sp.csr_matrix) -> tuple[float, Floats, Solve]:
        """Return the lowest eigenvalue of a matrix against another, its vector, and 1/the other."""
        solve, size = self.definite(definite), matrix.shape[0]
        definite = self._shifted(definite)
        if size <= _DENSE:
            values, vectors = la.eigh(matrix.toarray(), definite.toarray(), subset_by_index=[0, 0])
            return float(values[0]), vectors[:, 0], solve

        def divided(right: Floats) -> Floats:
            self.report()
            return solve(right)

        # Less one, as ARPACK's tolerance is a share of the eigenvalue, and that may be nearly zero.
        try:
            values, vectors = eigsh(
                matrix - definite,
                1,
                definite,
                which="SA",
                Minv=LinearOperator(matrix.shape, divided, dtype=np.float64),
                v0=np.random.default_rng(0).standard_normal(size),
                ncv=min(size, 40),
                tol=1e-5,
            )
        except ArpackError as error:
            raise SolverError(
                f"the lowest eigenvalue of a stiffness was not found: {error}",
                cure="Look for badly shaped tetrahedra in the cage",
            ) from error
        return float(values[0]) + 1.0, vectors[:, 0], solve

    def free_share(self) -> float:
        """Return the share of the load that no strain resists, however it is deformed."""
        # A part that the load only turns comes to rest; where every form is blind it moves on.
        blocks = [kind.resisted() for kind in self.strains]
        matrix = self.matrix([block / abs(block).max(initial=1e-300) for block in blocks])
        load = self.along_free(self.load)
        moved = self.solution(matrix)(load)
        work = float(moved @ load)
        return 1.0 - float(moved @ (matrix @ moved)) / work if work else 0.0

    def report(self, _: float = 0.0) -> None:
        """Tell how far it is, and hear whether to stop."""
        self._progress(1.0 - float(np.exp(-self.steps / 40)))

    def _shifted(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        return matrix + sp.diags(self._shift * matrix.diagonal(), format="csr")


def crossings(nodes: Ints, basis: sp.csr_matrix) -> tuple[Ints, Floats, Ints]:
    """Return entries of elements' matrices, with what weight, and as what Tᵀ K T has them."""
    elements, wide = len(nodes), 3 * nodes.shape[1]
    part = basis[(3 * nodes[:, :, None] + np.arange(3)).ravel()]
    filled = np.diff(part.indptr)
    row = np.repeat(np.arange(elements * wide), filled)
    count = filled.reshape(elements, wide).sum(axis=1)
    each = np.repeat(count, count)  # every entry of an element meets all of its entries
    left = np.repeat(np.arange(len(row)), each)
    first = np.repeat(np.cumsum(count) - count, count)
    right = np.arange(len(left)) - np.repeat(np.cumsum(each) - each - first, each)
    column = part.indices.astype(np.int64)
    return (
        row[left] * wide + row[right] % wide,
        part.data[left] * part.data[right],
        column[left] * basis.shape[1] + column[right],
    )
