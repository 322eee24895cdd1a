"""Factors of a sparse matrix, from the best library available.

Unsymmetric matrices, which time steps and friction have, are factorised by compiled loops or by
SciPy's SuperLU, see `factorise_square`. All others here are symmetric and positive definite.

Libraries are tried in this order: CHOLMOD (scikit-sparse), Pardiso (pypardiso), and this project's
`spacemap_vtk.mechanics.linalg.multifrontal`, which needs only scipy. The first two are not
installed by default: CHOLMOD's supernodal part is GPL and has no wheel, Pardiso brings MKL.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from spacemap_vtk.errors import SizeError, SolverError
from spacemap_vtk.mechanics.linalg.fronts import Analysis
from spacemap_vtk.mechanics.linalg.multifrontal import Cholesky, SquareFactors
from spacemap_vtk.ndarrays import Floats, Ints, Progress

Solve = Callable[[Floats], Floats]

#: CHOLMOD's memory errors, which are not a MemoryError before scikit-sparse 0.5.
_TOO_LARGE = ("CholmodOutOfMemoryError", "CholmodTooLargeError", "CholmodOverflowError")


class Factors(NamedTuple):
    """Solver of a factorised matrix."""

    #: Function from right-hand sides (N, m) to solutions (N, m).
    solve: Solve
    #: Name of the library that computed the factors.
    library: str


def factorise(
    matrix: sp.csr_matrix, analysis: Callable[[], Analysis], progress: Progress | None = None
) -> Factors:
    """Factorise a matrix with the first library that is installed."""
    for library in (cholmod, pardiso):
        try:
            return Factors(library(matrix), library.__name__.strip("_"))
        except ImportError:
            continue
        except Exception as error:  # each library has its own exception classes
            if isinstance(error, MemoryError) or type(error).__name__ in _TOO_LARGE:
                raise SizeError(
                    f"the factors of {matrix.shape[0]} degrees of freedom do not fit into memory",
                    cure="Use a coarser cage",
                ) from error
            raise SolverError(
                f"the stiffness matrix cannot be factorised: {error}",
                cure="Look for badly shaped tetrahedra in the cage",
            ) from error
    return Factors(Cholesky(matrix, analysis(), progress).solve, "multifrontal")


class SquarePattern:
    """Unsymmetric matrices of a symmetric pattern, whose entries are taken from an array."""

    def __init__(self, places: sp.csr_matrix, analysis: Analysis) -> None:
        # `places` contains where each entry of a matrix is in the array.
        self._places, self.analysis = places, analysis

    @cached_property
    def whole(self) -> sp.csc_matrix:
        """Places of all entries, in the order of elimination."""
        return self.analysis.reorder(self._places)

    @cached_property
    def lower(self) -> sp.csc_matrix:
        """Places of the lower triangle, in the order of elimination."""
        return self.analysis.reorder(self._places, lower=True)

    @cached_property
    def upper(self) -> Ints:
        """Places of the mirror images of the lower triangle's entries."""
        return self.analysis.reorder(self._places.T.tocsr(), lower=True).data


def factorise_square(values: Floats, pattern: SquarePattern) -> Solve | None:
    """Factorise an unsymmetric matrix, whose entries are among the values; None if singular."""
    analysis = pattern.analysis
    # Instead of SuperLU, loops save about eight times as much as for a symmetric matrix.
    loops = analysis.past_work.count(8 * analysis.entries)
    try:
        if loops is None:
            return _superlu(_reorder_values(values, pattern.whole), analysis)
        lower = _reorder_values(values, pattern.lower)
        return SquareFactors(lower, values[pattern.upper], analysis, loops).solve
    except (RuntimeError, SolverError):
        return None


def _reorder_values(values: Floats, places: sp.csc_matrix) -> sp.csc_matrix:
    """Make the matrix whose entries are the values at the given places."""
    parts = values[places.data], places.indices, places.indptr
    return sp.csc_matrix(parts, shape=places.shape)


def _superlu(ordered: sp.csc_matrix, analysis: Analysis) -> Solve:
    options = {"SymmetricMode": True}
    factors = splu(ordered, permc_spec="NATURAL", diag_pivot_thresh=0.01, options=options)

    def solve(right: Floats) -> Floats:
        solution = np.empty_like(right)
        solution[analysis.order] = factors.solve(right[analysis.order])
        return solution

    return solve


def cholmod(matrix: sp.csr_matrix) -> Solve:
    """Factorise with SuiteSparse's CHOLMOD."""
    from sksparse import cholmod as library

    if hasattr(library, "cho_factor"):  # scikit-sparse 0.5 or newer
        return library.cho_factor(matrix.tocsc(), lower=True, order="metis").solve
    # By default CHOLMOD factorises a small matrix as LDLᵀ, which would accept an indefinite one.
    factor = library.cholesky(matrix.tocsc(), ordering_method="metis", mode="supernodal")
    return lambda right: factor(right)


def pardiso(matrix: sp.csr_matrix) -> Solve:
    """Factorise with MKL's PARDISO."""
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=2)
    upper = sp.triu(matrix, format="csr")
    solver.factorize(upper)

    def solve(right: Floats) -> Floats:
        return np.asarray(solver.solve(upper, np.asfortranarray(right)))

    # MKL owns the factors; Python's garbage collector does not know of them.
    weakref.finalize(solve, solver.free_memory, everything=True)
    return solve
