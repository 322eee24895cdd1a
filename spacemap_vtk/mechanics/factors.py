"""Factors of a sparse, symmetric, positive definite matrix, by the best library that is there.

In this order: CHOLMOD (scikit-sparse), Pardiso (pypardiso), and our own, which needs nothing but
scipy. The first two are not installed by default: CHOLMOD's supernodal part is GPL and has no
wheel, Pardiso brings MKL.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.errors import SizeError, SolverError
from spacemap_vtk.mechanics.multifrontal import Analysis, Cholesky
from spacemap_vtk.ndarrays import Floats, Progress

Solve = Callable[[Floats], Floats]

#: CHOLMOD's errors when memory is short, which are no MemoryError before scikit-sparse 0.5.
_TOO_LARGE = ("CholmodOutOfMemoryError", "CholmodTooLargeError", "CholmodOverflowError")


class Factors(NamedTuple):
    """A factorised matrix."""

    #: Maps right-hand sides (N, m) to solutions (N, m).
    solve: Solve
    #: Who made the factors.
    library: str


def factorise(
    matrix: sp.csr_matrix, analysis: Callable[[], Analysis], progress: Progress | None = None
) -> Factors:
    """Factorise a matrix."""
    for library in (cholmod, pardiso):
        try:
            return Factors(library(matrix), library.__name__.strip("_"))
        except ImportError:
            continue
        except Exception as error:  # each library has errors of its own
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


def cholmod(matrix: sp.csr_matrix) -> Solve:
    """Factorise by SuiteSparse's CHOLMOD."""
    from sksparse import cholmod as library

    if hasattr(library, "cho_factor"):  # from scikit-sparse 0.5 on
        return library.cho_factor(matrix.tocsc(), lower=True, order="metis").solve
    # Of a small matrix it would otherwise take an LDLᵀ, which indefinite ones have as well.
    factor = library.cholesky(matrix.tocsc(), ordering_method="metis", mode="supernodal")
    return lambda right: factor(right)


def pardiso(matrix: sp.csr_matrix) -> Solve:
    """Factorise by MKL's PARDISO."""
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=2)
    upper = sp.triu(matrix, format="csr")
    solver.factorize(upper)

    def solve(right: Floats) -> Floats:
        return np.asarray(solver.solve(upper, np.asfortranarray(right)))

    # MKL holds the factors, and Python's garbage collector knows nothing of them.
    weakref.finalize(solve, solver.free_memory, everything=True)
    return solve
