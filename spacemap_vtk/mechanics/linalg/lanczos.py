"""Shift-invert block Lanczos: the lowest modes of a large sparse pencil K s = λ M s.

Why not `scipy.sparse.linalg.eigsh`: ARPACK iterates on one vector. It can miss copies of a multiple
eigenvalue and yet report convergence (as it did for 40 modes of two equal 4 x 4 x 4 cubes). A block
of eight finds up to eight copies by construction, is as fast, and can report its progress.

The accuracy depends on this:

- The shift is negative, so K + σM is positive definite even if nothing is fixed, and SuperLU may
  keep the symmetric order and the diagonal as pivots. If the shift is too close to zero (-1e-5 of
  the first elastic eigenvalue), rigid modes swamp the elastic ones; a shift too far away, even -1e3
  times that eigenvalue, costs only time.
- Basis vectors are M-orthogonalised against all others, twice; there is no restart.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy import linalg as la
from scipy.sparse import csgraph

from spacemap_vtk.errors import SolverError
from spacemap_vtk.ndarrays import Floats

Solve = Callable[[Floats], Floats]

#: Vectors in a block: at least the multiplicity of an eigenvalue, which is six for rigid modes.
BLOCK = 8

#: Residual of a Ritz pair of the inverted pencil, relative to its value. The last inverse iteration
#: squares the remaining error of the eigenvalues and improves the modes.
TOLERANCE = 1e-10


def lowest_modes(
    solve: Solve,
    stiffness: sp.csr_matrix,
    mass: sp.csr_matrix,
    count: int,
    progress: Callable[[float], object],
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Compute the lowest modes of a connected mesh by iterating with a sparse factorisation."""
    vectors = _block_lanczos(solve, mass, count, progress, seed)
    # One more inverse iteration: a Lanczos vector is a sum of many vectors and contains the
    # rounding of all, which K would magnify in its high modes; (K + σM)⁻¹ M damps exactly these.
    vectors = solve(mass @ vectors)
    reduced = [vectors.T @ (matrix @ vectors) for matrix in (stiffness, mass)]
    eigenvalues, turn = la.eigh(*reduced)
    return eigenvalues, vectors @ turn


def choose_shift(stiffness: sp.csr_matrix, mass: sp.csr_matrix) -> float:
    """Compute σ > 0 for K + σM: about a hundredth of the lowest axial eigenvalue."""
    ratio = stiffness.diagonal() / mass.diagonal()
    ratio = np.maximum(ratio, 1e-24 * ratio.max())  # a rigid part may be free along an axis
    delay = np.sqrt(5 / ratio)
    pairs = stiffness.tocoo()
    graph = sp.csr_matrix(
        ((delay[pairs.row] + delay[pairs.col]) / 2, (pairs.row, pairs.col)), shape=stiffness.shape
    )
    crossing = csgraph.dijkstra(graph, indices=np.array([0])).max() or delay[0]
    # If σ were smaller than rounding in K, K + σM would no longer be positive definite.
    return float(max(0.01 * (np.pi / (2 * crossing)) ** 2, 1e-12 * ratio.max()))


def _block_lanczos(
    solve: Solve, mass: sp.csr_matrix, count: int, progress: Callable[[float], object], seed: int
) -> Floats:
    """Compute Ritz vectors (N, count) of (K + σM)⁻¹ M for its largest eigenvalues."""
    size = mass.shape[0]
    # Pages of an empty array take memory only when they are first written, so a generous limit
    # costs nothing; the iteration uses 2 to 6 times `count`.
    limit = min(size, 10 * count + 40 * BLOCK)
    basis = np.empty((size, limit), order="F")
    projected = np.zeros((limit, limit))
    start = np.random.default_rng(seed).standard_normal((size, BLOCK))
    block = _orthonormalise(start, basis[:, :0], mass)[0]
    used, check = 0, count + BLOCK
    while used + BLOCK <= limit:
        basis[:, used : used + BLOCK] = block
        used += BLOCK
        # inverse(block) = basis @ inside + next block @ beyond
        block, inside, beyond = _orthonormalise(solve(mass @ block), basis[:, :used], mass)
        projected[:used, used - BLOCK : used] = inside
        projected[used - BLOCK : used, :used] = inside.T
        progress(1 - np.exp(-used / (3 * count + 10 * BLOCK)))
        if used < check:
            continue
        check = used + used // 10
        ritz, turn = la.eigh(projected[:used, :used], subset_by_index=[used - count, used - 1])
        residual = np.linalg.norm(beyond @ turn[-BLOCK:], axis=0)
        if (residual <= TOLERANCE * ritz).all():
            return basis[:, :used] @ turn
    raise SolverError(
        f"{count} modes of {size} degrees of freedom did not converge in {used} vectors",
        cure="Look for badly shaped tetrahedra in the cage, or request fewer modes",
    )


def _orthonormalise(
    block: Floats, basis: Floats, mass: sp.csr_matrix
) -> tuple[Floats, Floats, Floats]:
    """Split ``block = basis @ inside + result @ beyond``, with [basis, result] M-orthonormal."""
    # Twice, because once leaves rounding if little of the block is new. If nothing is new, QR adds
    # arbitrary vectors, which the second round makes orthogonal, too.
    inside = np.zeros((basis.shape[1], block.shape[1]))
    beyond = np.eye(block.shape[1])
    for _ in range(2):
        share = basis.T @ (mass @ block)
        inside += share @ beyond
        # Householder's QR accepts a block of dependent vectors; the Cholesky factorisation of M,
        # projected on the orthonormal vectors that QR returns, is then safe.
        vectors, triangle = la.qr(block - basis @ share, mode="economic")
        factor = np.linalg.cholesky(vectors.T @ (mass @ vectors))
        block = la.solve_triangular(factor, vectors.T, lower=True).T
        beyond = factor.T @ triangle @ beyond
    return block, inside, beyond
