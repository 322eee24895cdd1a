"""Factors of sparse symmetric matrices, by the best library that is there.

In this order: CHOLMOD (scikit-sparse), Pardiso (pypardiso), and SuperLU, which scipy brings, with
METIS' nested dissection (pymetis) or else minimum degree. Only SuperLU knows how many eigenvalues
of an indefinite matrix are negative: K - σM is factorised with it whatever else is installed.

SuperLU is told to keep the diagonal as pivots, in the symmetric order. Then P A Pᵀ = L U with
U = D Lᵀ, and by Sylvester's law the signs of U's diagonal are those of the eigenvalues.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from spacemap_vtk.errors import SizeError, SolverError

FloatArray = NDArray[np.float64]
Solve = Callable[[FloatArray], FloatArray]


class Factors(NamedTuple):
    """A factorised symmetric, positive definite matrix.

    Parameters
    ----------
    solve : callable
        Maps right-hand sides (N, m) to solutions (N, m).
    library : str
        Who made them.
    """

    solve: Solve
    library: str


def factorise(matrix: sp.csr_matrix, vertices: NDArray[np.int64]) -> Factors:
    """Factorise a sparse, symmetric, positive definite matrix.

    Parameters
    ----------
    matrix : scipy.sparse.csr_matrix of float64, shape (N, N)
        The matrix.
    vertices : ndarray of int64, shape (N,)
        The vertex of each row: rows of a vertex are kept together.

    Returns
    -------
    Factors
        What solves with it.

    Raises
    ------
    SizeError
        If the factors do not fit into memory.
    SolverError
        If the matrix is singular.
    """
    for library in (_cholmod, _pardiso):
        try:
            return Factors(library(matrix), library.__name__.strip("_"))
        except ImportError:
            continue
        except MemoryError as error:
            raise _too_large(matrix) from error
        except Exception as error:  # each library has errors of its own
            raise _singular(error) from error
    order = dissection(matrix, vertices)
    factors = _superlu(matrix, order)

    def solve(right: FloatArray) -> FloatArray:
        solution = np.empty_like(right)
        solution[order] = factors.solve(np.asfortranarray(right[order]))
        return solution

    return Factors(solve, "superlu")


def negative_eigenvalues(matrix: sp.csr_matrix, vertices: NDArray[np.int64]) -> int | None:
    """Count the negative eigenvalues of a sparse symmetric matrix (its inertia).

    Parameters
    ----------
    matrix : scipy.sparse.csr_matrix of float64, shape (N, N)
        Of any definiteness.
    vertices : ndarray of int64, shape (N,)
        As for `factorise`.

    Returns
    -------
    int or None
        The count; None where a pivot was so small that it cannot be trusted.

    Raises
    ------
    SizeError
        If the factors do not fit into memory.
    SolverError
        If the matrix is singular.
    """
    factors = _superlu(matrix, dissection(matrix, vertices))
    pivots = factors.U.diagonal()
    if not (factors.perm_r == factors.perm_c).all() or not np.isfinite(pivots).all():
        return None
    return int((pivots < 0).sum())


def dissection(matrix: sp.csr_matrix, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return an order of rows in which the factors of a matrix stay sparse.

    Parameters
    ----------
    matrix : scipy.sparse.csr_matrix of float64, shape (N, N)
        Of symmetric pattern.
    vertices : ndarray of int64, shape (N,)
        As for `factorise`: their graph is nine times smaller than that of the rows.

    Returns
    -------
    ndarray of int64, shape (N,)
        Rows in their new order, by METIS where pymetis is installed, otherwise at random, for
        minimum degree to start from.
    """
    try:
        import pymetis
    except ImportError:
        # Minimum degree breaks its many ties by the order it is given. A regular lattice's own
        # is a bad one: shuffled, 100,000 rows of a slab factorise in 5 s instead of 34.
        return np.random.default_rng(0).permutation(matrix.shape[0])
    node = np.unique(vertices, return_inverse=True)[1].ravel()
    pairs = matrix.tocoo()
    count = int(node.max()) + 1
    apart = node[pairs.row] != node[pairs.col]
    graph = sp.csr_matrix(
        (np.ones(apart.sum(), np.int8), (node[pairs.row[apart]], node[pairs.col[apart]])),
        shape=(count, count),
    )
    if graph.nnz == 0:
        return np.arange(matrix.shape[0])
    starts, neighbours = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
    if hasattr(pymetis, "CSRAdjacency"):
        found = pymetis.nested_dissection(pymetis.CSRAdjacency(starts, neighbours))
    else:
        found = pymetis.nested_dissection(xadj=starts, adjncy=neighbours)
    place = np.empty(count, np.int64)
    place[np.asarray(found[0])] = np.arange(count)
    return np.argsort(place[node], kind="stable")


def _superlu(matrix: sp.csr_matrix, order: NDArray[np.int64]) -> Any:
    try:
        import pymetis  # noqa: F401

        ordered = "NATURAL"
    except ImportError:
        ordered = "MMD_AT_PLUS_A"
    try:
        return splu(
            matrix[order][:, order].tocsc(),
            permc_spec=ordered,
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except MemoryError as error:
        raise _too_large(matrix) from error
    except RuntimeError as error:
        raise _singular(error) from error


def _cholmod(matrix: sp.csr_matrix) -> Solve:
    from sksparse.cholmod import cholesky

    factor = cholesky(matrix.tocsc(), ordering_method="metis")
    return lambda right: factor(right)


def _pardiso(matrix: sp.csr_matrix) -> Solve:
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=2)
    upper = sp.triu(matrix, format="csr")
    solver.factorize(upper)
    return lambda right: solver.solve(upper, right)


def _too_large(matrix: sp.csr_matrix) -> SizeError:
    return SizeError(
        f"the factors of {matrix.shape[0]} degrees of freedom do not fit into memory",
        cure="Use a coarser cage",
    )


def _singular(error: Exception) -> SolverError:
    return SolverError(
        f"the stiffness matrix cannot be factorised: {error}",
        cure="Look for badly shaped tetrahedra in the cage",
    )
