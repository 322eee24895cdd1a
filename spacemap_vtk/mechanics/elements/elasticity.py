"""Stiffness and mass of tetrahedra: K and M of ``M ü + C u̇ + K u = f``.

On a straight-sided tetrahedron the gradients g_i of the barycentric coordinates are constant, so
both matrices are sums over the tetrahedra of a product for each pair (a, b) of vertices:

    K[a k', b l'] = Σ_kl c_k'kl'l Σ_T V Σ_ij s_ijab g_i,k g_j,l      M[a i, b j] = δ_ij ρ Σ_T V p_ab

with the integrals s and p of `spacemap_vtk.mechanics.elements.tetrahedra`. They are exact for
linear and quadratic elements. The inner sums contain only geometry and are computed once, by
`assemble`. A new material then needs one product with its 81 elasticities, however many tetrahedra
share a vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.mechanics.elements.tetrahedra import (
    ELEMENTS,
    check_mesh,
    edges_and_volumes,
    volumes,
)
from spacemap_vtk.ndarrays import Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Row of the elasticity matrix that holds the strain component (i, k).
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


@dataclass(frozen=True, eq=False)
class Assembly:
    """Geometric part of K and M of a mesh of tetrahedra, for any material."""

    #: Pairs of vertices that share a tetrahedron, P in all, as the rows of a CSR matrix.
    indptr: Ints
    indices: Ints
    #: (P, 9) ∫ N_a,k N_b,l of each pair, in column 3 k + l [m]. Here and below the integrand is
    #: multiplied by the factor of each tetrahedron, if there are factors.
    gradients: Floats
    #: (P,) ∫ N_a N_b of each pair [m³].
    products: Floats
    #: (V,) Share of each vertex in the volume, for a lumped mass [m³].
    lumps: Floats


def barycentric_gradients(points: Floats, tetrahedra: Ints) -> tuple[Floats, Floats]:
    """Compute the gradients of the barycentric coordinates, and the volumes."""
    edges, volume = edges_and_volumes(points, tetrahedra)
    # ∇L_1..3 are the rows of the inverse of [x1-x0, x2-x0, x3-x0]: cross products over the signed
    # determinant, so orientation cancels. The coordinates sum to 1, hence the fourth gradient.
    cross = np.cross(edges[:, [1, 2, 0]], edges[:, [2, 0, 1]])
    rest = cross / np.einsum("tk,tk->t", edges[:, 0], cross[:, 0])[:, None, None]
    gradients: Floats = np.concatenate([-rest.sum(axis=1, keepdims=True), rest], axis=1)
    return gradients, volume


def nodal_mass(
    points: ArrayLike,
    tetrahedra: ArrayLike,
    density: float,
    lumped: bool = False,
    factors: Floats | None = None,
) -> Floats:
    """Compute the share of the mass that belongs to each vertex."""
    volume, nodes = volumes(points, tetrahedra), np.asarray(tetrahedra)
    if factors is not None:
        volume = volume * factors
    shape = ELEMENTS[nodes.shape[1]]
    share = shape.lumps if lumped else shape.products.sum(axis=1)
    return density * _sum_by_index(nodes, np.outer(volume, share), len(np.asarray(points)))


def assemble(
    points: ArrayLike,
    tetrahedra: ArrayLike,
    stiffness_factors: Floats | None = None,
    mass_factors: Floats | None = None,
) -> Assembly:
    """Sum the geometric part of K and M over the tetrahedra, each multiplied by its factor."""
    points, tetrahedra = check_mesh(points, tetrahedra)
    gradient, volume = barycentric_gradients(points, tetrahedra)
    nodes, count = tetrahedra.shape[1], len(points)
    shape = ELEMENTS[nodes]

    key = (tetrahedra[:, :, None] * count + tetrahedra[:, None, :]).ravel()
    pair, slot = np.unique(key, return_inverse=True)
    slot = slot.ravel()
    indptr = np.searchsorted(pair, np.arange(count + 1) * count)

    gradients = np.empty((len(pair), 9))
    slopes = shape.slopes.reshape(16, -1)
    stiff, heavy = (
        volume if factors is None else volume * factors
        for factors in (stiffness_factors, mass_factors)
    )
    for k in range(3):
        for m in range(3):
            # One component at a time, as all nine together would need nine times the memory.
            outer = gradient[:, :, None, k] * gradient[:, None, :, m] * stiff[:, None, None]
            term = outer.reshape(len(volume), 16)
            gradients[:, 3 * k + m] = np.bincount(
                slot, (term if nodes == 4 else term @ slopes).ravel()
            )
    products = _sum_by_index(slot, np.outer(heavy, shape.products), len(pair))
    lumps = _sum_by_index(tetrahedra, np.outer(heavy, shape.lumps), count)
    return Assembly(indptr, pair % count, gradients, products, lumps)


def stiffness_matrix(assembly: Assembly, elasticity: ArrayLike) -> csr_matrix:
    """Assemble the stiffness matrix of one material."""
    from scipy.sparse import bsr_matrix  # this import costs a tenth of a second

    # c_ikjl, with its axes in the order (k l, i j).
    tensor = np.asarray(elasticity)[VOIGT[:, :, None, None], VOIGT].transpose(1, 3, 0, 2)
    blocks = (assembly.gradients @ tensor.reshape(9, 9)).reshape(-1, 3, 3)
    size = 3 * (len(assembly.indptr) - 1)
    return bsr_matrix((blocks, assembly.indices, assembly.indptr), shape=(size, size)).tocsr()


def mass_matrix(assembly: Assembly, density: float, lumped: bool = False) -> csr_matrix:
    """Assemble the mass matrix."""
    import scipy.sparse as sp  # this import costs a tenth of a second

    if lumped:
        return sp.diags(np.repeat(density * assembly.lumps, 3), format="csr")
    count = len(assembly.indptr) - 1
    parts = (density * assembly.products, assembly.indices, assembly.indptr)
    return sp.kron(sp.csr_matrix(parts, shape=(count, count)), sp.identity(3), format="csr")


def _sum_by_index(places: Ints, values: Floats, count: int) -> Floats:
    """Sum the values at each of the given numbers."""
    return np.bincount(places.ravel(), values.ravel(), count).astype(np.float64, copy=False)
