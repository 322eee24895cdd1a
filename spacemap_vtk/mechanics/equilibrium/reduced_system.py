"""Energy, forces and tangent of energy terms in the coordinates that supports leave free."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy import linalg as la
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, TermState
from spacemap_vtk.mechanics.linalg.factors import (
    Solve,
    SquarePattern,
    factorise,
    factorise_square,
)
from spacemap_vtk.mechanics.linalg.fronts import Analysis, Work
from spacemap_vtk.ndarrays import Floats, Ints, Progress

#: Share of its diagonal that is added to a stiffness matrix, so that it is regular even if some
#: motions need no energy.
SHIFT = 1e-13
#: Largest such share that is tried if rounding makes a definite matrix indefinite.
MOST_SHIFT = 1e-8

#: Matrices of at most this size are solved densely for their lowest eigenvalue.
_DENSE = 60

#: Function of nodal vectors and of a move from them, both (V, 3), that returns another move.
Turn = Callable[[Floats, Floats], Floats]


class ReducedSystem:
    """Sum of energy terms in free coordinates q; the nodal positions are z = ``start + T q``."""

    def __init__(
        self,
        terms: Sequence[EnergyTerm],
        basis: sp.csr_matrix,
        start: Floats,
        progress: Progress = lambda _: None,
    ) -> None:
        self.terms, self.basis, self.start = terms, basis.tocsr(), start
        #: Factor of each term.
        self.factors = np.ones(len(terms))
        self._transposed = self.basis.T
        #: Stiffness that is added to each coordinate in steps, but not to the forces, so that
        #: motions which nothing resists have finite steps.
        self.inertia = np.zeros(basis.shape[1])
        self.inertia_scale = 1.0
        #: Function that replaces a straight step from nodal vectors (V, 3) by one that turns cells
        #: instead of stretching them; None if steps are straight.
        self.turn: Turn | None = None
        #: Number of linear systems solved so far.
        self.steps = 0
        self._progress, self._shift = progress, SHIFT
        self._entries = [reduction_entries(term.nodes, self.basis) for term in terms]
        self._work = Work()
        self._set_pattern()

    def _set_pattern(self) -> None:
        """Set the sparsity pattern of all tangents from the nodes of the terms."""
        size = self.basis.shape[1]
        diagonal = np.arange(size) * (size + 1)
        parts = [each[2] for each in self._entries]
        keys, slots = np.unique(np.concatenate([diagonal, *parts]), return_inverse=True)
        ends = np.cumsum([size, *(len(part) for part in parts)])
        # SciPy's own index type: with another one, each matrix would convert these arrays.
        kind = np.int32 if len(keys) < 2**31 else np.int64
        #: Position of each diagonal entry in a matrix.
        self._diagonal, *places = np.split(slots.ravel().astype(kind), ends[:-1])
        #: Matrices that sum the entries of each term's element matrices.
        self._sums = []
        for term, place, (entries, weights, _) in zip(
            self.terms, places, self._entries, strict=True
        ):
            count = term.nodes.size * 9 * term.nodes.shape[1]
            self._sums.append(sp.coo_matrix((weights, (place, entries)), (len(keys), count)))
        self._columns = (keys % size).astype(kind)
        self._starts = np.searchsorted(keys, np.arange(size + 1) * size).astype(kind)
        for name in ("analysis", "_square_pattern"):
            self.__dict__.pop(name, None)

    @cached_property
    def analysis(self) -> Analysis:
        """Order of elimination of every tangent."""
        # Rows with the same pattern, those of one vertex or pair, are eliminated together.
        pattern = self._csr(np.ones(len(self._columns), dtype=np.int64))
        names = pattern @ np.random.default_rng(0).integers(1 << 62, size=self.basis.shape[1])
        return Analysis(pattern, names, self._work)

    @cached_property
    def _square_pattern(self) -> SquarePattern:
        return SquarePattern(self._csr(np.arange(len(self._columns))), self.analysis)

    def follow(self, z: Floats) -> bool:
        """Let the pattern follow positions z, if nodes affect others there; whether it changed."""
        changed = [number for number, term in enumerate(self.terms) if term.follow(z)]
        for number in changed:
            self._entries[number] = reduction_entries(self.terms[number].nodes, self.basis)
        if changed:
            self._set_pattern()
        return bool(changed)

    def _csr(self, values: NDArray[Any]) -> sp.csr_matrix:
        size = self.basis.shape[1]
        made = sp.csr_matrix((values, self._columns, self._starts), shape=(size, size))
        made.has_canonical_format = True
        return made

    def pattern(self) -> sp.csr_matrix:
        """Make a matrix of ones with the sparsity pattern of every tangent."""
        return self._csr(np.ones(len(self._columns)))

    def assemble(self, blocks: Sequence[Floats]) -> sp.csr_matrix:
        """Assemble Tᵀ M T from matrices (E, 3 n, 3 n) of each term."""
        total = np.zeros(len(self._columns))
        for block, sums in zip(blocks, self._sums, strict=True):
            if sums.nnz:
                total += sums @ block.ravel()
        return self._csr(total)

    def evaluate(self, z: Floats) -> list[TermState]:
        """Evaluate all terms at positions z."""
        return [term.evaluate(z) for term in self.terms]

    def energies(self, states: list[TermState]) -> Floats:
        """Compute the energy of each term."""
        return self.factors * np.array([state.energy for state in states])

    def tangent(
        self, states: list[TermState], predicted: Sequence[Any] | None = None, removed: float = 0.0
    ) -> sp.csr_matrix:
        """Assemble the tangent K, see `TermState.tangent`."""
        predicted = [None] * len(states) if predicted is None else predicted
        blocks = [
            state.tangent(removed, each) for state, each in zip(states, predicted, strict=True)
        ]
        for number in np.flatnonzero(self.factors != 1.0):
            blocks[number] = self.factors[number] * blocks[number]
        return self.assemble(blocks)

    def forces(self, states: list[TermState]) -> Floats:
        """Compute ∂W/∂q, (N,)."""
        total = np.zeros_like(self.start)
        for factor, state in zip(self.factors, states, strict=True):
            total += factor * state.forces
        return self.reduce_forces(total)

    def reduce_forces(self, nodal: Floats) -> Floats:
        """Compute Tᵀ f of nodal forces (V, 3)."""
        return self._transposed @ nodal.ravel()

    def node_moves(self, q: Floats) -> Floats:
        """Compute the move T q of the nodes, (V, 3)."""
        return (self.basis @ q).reshape(-1, 3)

    def largest_step(self, z: Floats, move: Floats) -> float:
        """Compute the largest multiple of a move (V, 3) that may be made at once."""
        return min(term.largest_step(z, move) for term in self.terms)

    def admits(self, z: Floats) -> bool:
        """Check whether all terms admit the positions z."""
        return all(term.admits(self.start, z) for term in self.terms)

    def factorise(self, matrix: sp.csr_matrix) -> Solve:
        """Factorise a positive definite matrix; return its solver."""
        self.report()
        self.steps += 1
        solve = factorise(self.add_shift(matrix), lambda: self.analysis, self.report).solve
        return lambda right: solve(right.reshape(len(right), -1)).reshape(right.shape)

    def factorise_definite(self, matrix: sp.csr_matrix) -> Solve:
        """Factorise a matrix that is positive definite up to rounding; return its solver."""
        while True:
            try:
                return self.factorise(matrix)
            except SolverError:
                if self._shift >= MOST_SHIFT:
                    raise
                self._shift *= 100

    def factorise_unsymmetric(self, matrix: sp.csr_matrix) -> Solve:
        """Factorise a possibly unsymmetric matrix of the tangent's pattern; return its solver."""
        pattern = self._square_pattern
        if matrix.nnz < len(self._columns):  # a part of the tangent's pattern, as a mass has
            places = sp.csr_matrix((np.arange(matrix.nnz), matrix.indices, matrix.indptr))
            pattern = SquarePattern(places, self.analysis)
        solve = factorise_square(matrix.data, pattern)
        if solve is None:
            raise SolverError("the tangent of this step is singular")
        return solve

    def lowest_eigenpair(
        self, matrix: sp.csr_matrix, definite: sp.csr_matrix
    ) -> tuple[float, Floats, Solve]:
        """Find the lowest eigenvalue of a pencil, its vector, and the solver of `definite`."""
        solve, size = self.factorise_definite(definite), matrix.shape[0]
        definite = self.add_shift(definite)
        if size <= _DENSE:
            values, vectors = la.eigh(matrix.toarray(), definite.toarray(), subset_by_index=[0, 0])
            return float(values[0]), vectors[:, 0], solve

        def divided(right: Floats) -> Floats:
            self.report()
            return solve(right)

        # Shifted by 1, as ARPACK's tolerance is relative to the eigenvalue, which may be near zero.
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
                f"the lowest eigenvalue of the tangent was not found: {error}",
                cure="Look for badly shaped tetrahedra in the cage",
            ) from error
        return float(values[0]) + 1.0, vectors[:, 0], solve

    def unresisted_share(self, load: Floats) -> float:
        """Compute the share of a load (N,) that no term resists, however the body is deformed."""
        # A load that only turns the body leads to a new equilibrium; a load that no term resists
        # moves the body without end.
        blocks = [term.resistance_matrices() for term in self.terms]
        matrix = self.assemble([block / abs(block).max(initial=1e-300) for block in blocks])
        moved = self.factorise(matrix)(load)
        work = float(moved @ load)
        return 1.0 - float(moved @ (matrix @ moved)) / work if work else 0.0

    def report(self, _: float = 0.0) -> None:
        """Report the progress; the callback may raise an exception to stop."""
        self._progress(1.0 - float(np.exp(-self.steps / 40)))

    def add_shift(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """Add the shift and the inertia to a tangent, so that it is regular."""
        values, diagonal = matrix.data.copy(), self._diagonal
        values[diagonal] *= 1.0 + self._shift
        values[diagonal] += self.inertia_scale * self.inertia
        return self._csr(values)


def reduction_entries(nodes: Ints, basis: sp.csr_matrix) -> tuple[Ints, Floats, Ints]:
    """Return entries of element matrices, their weights, and their keys in the matrix Tᵀ K T."""
    elements, wide = len(nodes), 3 * nodes.shape[1]
    part = basis[(3 * nodes[:, :, None] + np.arange(3)).ravel()]
    filled = np.diff(part.indptr)
    row = np.repeat(np.arange(elements * wide), filled)
    count = filled.reshape(elements, wide).sum(axis=1)
    each = np.repeat(count, count)  # each entry of an element is multiplied with all of them
    left = np.repeat(np.arange(len(row)), each)
    first = np.repeat(np.cumsum(count) - count, count)
    right = np.arange(len(left)) - np.repeat(np.cumsum(each) - each - first, each)
    column = part.indices.astype(np.int64)
    entry = row[left] * wide + row[right] % wide
    return (
        entry.astype(np.int32) if elements * wide**2 < 2**31 else entry,
        part.data[left] * part.data[right],
        column[left] * basis.shape[1] + column[right],
    )
