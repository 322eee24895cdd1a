"""Stiffness and mass of linear tetrahedra: K and M of ``M ü + C u̇ + K u = f``.

On a linear tetrahedron the gradients g_a of the four shape functions are constant, so both
matrices are sums over the tetrahedra of a product for each pair (a, b) of vertices:

    K[a i, b j] = Σ_kl c_ikjl Σ_T V g_a,k g_b,l        M[a i, b j] = δ_ij ρ Σ_T V (1 + δ_ab) / 20

The inner sums hold geometry alone. `assemble` makes them once; a new material is then one product
with its 81 elasticities, however many tetrahedra share a vertex.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.modal.tetrahedra import (
    FloatArray,
    IntArray,
    checked_mesh,
    edges_and_volumes,
    volumes,
)

__all__ = [
    "Assembly",
    "assemble",
    "isotropic",
    "mass",
    "nodal_mass",
    "stiffness",
    "stiffness_and_mass",
    "volumes",
]

#: Row of the elasticity matrix that holds the strain component (i, k).
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


class Assembly(NamedTuple):
    """What a mesh of linear tetrahedra contributes to K and M, whatever its material.

    Parameters
    ----------
    indptr, indices : ndarray of int64, shapes (V + 1,) and (P,)
        The P pairs of vertices that share a tetrahedron, as the rows of a CSR matrix.
    gradients : ndarray of float64, shape (P, 9)
        Σ V g_a,k g_b,l of each pair, column 3 k + l [m].
    products : ndarray of float64, shape (P,)
        Σ V (1 + δ_ab) / 20 of each pair, the integral of N_a N_b [m³].
    """

    indptr: IntArray
    indices: IntArray
    gradients: FloatArray
    products: FloatArray


def isotropic(youngs_modulus: float, poissons_ratio: float) -> FloatArray:
    """Return the elasticity matrix of an isotropic solid (Hooke's law).

    Parameters
    ----------
    youngs_modulus : float
        E > 0 [Pa].
    poissons_ratio : float
        ν, above -1 and below 0.5.

    Returns
    -------
    ndarray of float64, shape (6, 6)
        Stress (xx, yy, zz, yz, zx, xy) [Pa] from strain in the same order, shears in engineering
        measure (γ = 2ε): σ = λ tr(ε) I + 2μ ε, with Lamé's λ = Eν / ((1 + ν)(1 - 2ν)) and
        μ = E / (2 (1 + ν)).

    Raises
    ------
    InputError
        If the solid would not be stable.
    """
    if not (np.isfinite(youngs_modulus) and youngs_modulus > 0):
        raise InputError(
            "the material has no positive stiffness",
            key="youngs_modulus",
            value=youngs_modulus,
            allowed="above 0 Pa",
        )
    if not -1 < poissons_ratio < 0.5:
        raise InputError(
            "no stable, compressible solid has this ratio",
            key="poissons_ratio",
            value=poissons_ratio,
            allowed="above -1 and below 0.5",
            cure="Use 0.49 for a nearly incompressible material",
        )
    shear = youngs_modulus / (2 * (1 + poissons_ratio))
    lame = 2 * shear * poissons_ratio / (1 - 2 * poissons_ratio)
    matrix = np.diag([2.0 * shear] * 3 + [shear] * 3)
    matrix[:3, :3] += lame
    return matrix


def nodal_mass(points: ArrayLike, tetrahedra: ArrayLike, density: float) -> FloatArray:
    """Return the share of the mass that belongs to each vertex.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Vertices [m].
    tetrahedra : array_like of int, shape (T, 4)
        Vertices of each tetrahedron.
    density : float
        ρ > 0 [kg/m³].

    Returns
    -------
    ndarray of float64, shape (V,)
        Row sums of the consistent mass matrix [kg], a quarter of each tetrahedron that meets the
        vertex; they sum to ρV.

    Raises
    ------
    GeometryError
        As `volumes` does.
    InputError
        If the density is not positive.
    """
    _check_density(density)
    volume = np.repeat(volumes(points, tetrahedra), 4)
    return np.bincount(np.ravel(tetrahedra), volume, len(np.asarray(points))) / 4 * density


def assemble(points: ArrayLike, tetrahedra: ArrayLike) -> Assembly:
    """Sum the geometric part of K and M over the tetrahedra.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Vertices [m].
    tetrahedra : array_like of int, shape (T, 4)
        Vertices of each tetrahedron.

    Returns
    -------
    Assembly
        What `stiffness` and `mass` need of the mesh.

    Raises
    ------
    GeometryError
        As `volumes` does.
    """
    points, tetrahedra = checked_mesh(points, tetrahedra)
    edges, volume = edges_and_volumes(points, tetrahedra)
    # ∇N_1..3 are the rows of the inverse of [x1-x0, x2-x0, x3-x0]: cross products over the signed
    # determinant, so orientation cancels. The shape functions sum to 1, hence the fourth gradient.
    cross = np.cross(edges[:, [1, 2, 0]], edges[:, [2, 0, 1]])
    rest = cross / np.einsum("tk,tk->t", edges[:, 0], cross[:, 0])[:, None, None]
    gradient = np.concatenate([-rest.sum(axis=1, keepdims=True), rest], axis=1)

    count = len(points)
    key = (tetrahedra[:, :, None] * count + tetrahedra[:, None, :]).ravel()
    pair, slot = np.unique(key, return_inverse=True)
    indptr = np.searchsorted(pair, np.arange(count + 1) * count)

    gradients = np.empty((len(pair), 9))
    for k in range(3):
        for m in range(3):
            # One component at a time: all nine at once would take nine times the memory.
            term = gradient[:, :, None, k] * gradient[:, None, :, m] * volume[:, None, None]
            gradients[:, 3 * k + m] = np.bincount(slot, term.ravel())
    products = np.bincount(slot, (volume[:, None, None] * (1 + np.eye(4))).ravel()) / 20
    return Assembly(indptr, pair % count, gradients, products)


def stiffness(assembly: Assembly, elasticity: ArrayLike) -> sp.csr_matrix:
    """Return the stiffness matrix of one material.

    Parameters
    ----------
    assembly : Assembly
        The mesh, from `assemble`.
    elasticity : array_like of float, shape (6, 6)
        Elasticity matrix [Pa] in the order of `isotropic`, of any symmetric material.

    Returns
    -------
    scipy.sparse.csr_matrix of float64, shape (3V, 3V)
        K = Σ ∫ Bᵀ D B [N/m]; component c of vertex v is row 3 v + c.

    Raises
    ------
    InputError
        If `elasticity` is not a symmetric matrix of six rows.
    """
    matrix = np.asarray(elasticity, dtype=np.float64)
    square = matrix.shape == (6, 6) and bool(np.isfinite(matrix).all())
    if not square or not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
        raise InputError(
            "this is not an elasticity matrix",
            key="elasticity",
            value=f"array of shape {matrix.shape}",
            allowed="a finite, symmetric matrix of shape (6, 6)",
            cure="Make one with isotropic(youngs_modulus, poissons_ratio)",
        )
    # c_ikjl, its axes put in the order (k l, i j).
    tensor = matrix[VOIGT[:, :, None, None], VOIGT].transpose(1, 3, 0, 2).reshape(9, 9)
    blocks = (assembly.gradients @ tensor).reshape(-1, 3, 3)
    size = 3 * (len(assembly.indptr) - 1)
    return sp.bsr_matrix((blocks, assembly.indices, assembly.indptr), shape=(size, size)).tocsr()


def mass(assembly: Assembly, density: float) -> sp.csr_matrix:
    """Return the consistent mass matrix.

    Parameters
    ----------
    assembly : Assembly
        The mesh, from `assemble`.
    density : float
        ρ > 0 [kg/m³].

    Returns
    -------
    scipy.sparse.csr_matrix of float64, shape (3V, 3V)
        M = Σ ∫ ρ Nᵀ N [kg], rows as in `stiffness`.

    Raises
    ------
    InputError
        If the density is not positive.
    """
    _check_density(density)
    count = len(assembly.indptr) - 1
    parts = (density * assembly.products, assembly.indices, assembly.indptr)
    return sp.kron(sp.csr_matrix(parts, shape=(count, count)), sp.identity(3), format="csr")


def stiffness_and_mass(
    points: ArrayLike, tetrahedra: ArrayLike, elasticity: ArrayLike, density: float
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Return K and M of a mesh of linear tetrahedra.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Vertices [m].
    tetrahedra : array_like of int, shape (T, 4)
        Vertices of each tetrahedron, of either orientation.
    elasticity : array_like of float, shape (6, 6)
        Elasticity matrix [Pa], see `isotropic`.
    density : float
        ρ > 0 [kg/m³].

    Returns
    -------
    stiffness, mass : scipy.sparse.csr_matrix of float64, shape (3V, 3V)
        K [N/m] and consistent M [kg]; component c of vertex v is row 3 v + c.

    Raises
    ------
    GeometryError
        As `volumes` does.
    InputError
        If the elasticity matrix or the density is refused.
    """
    assembly = assemble(points, tetrahedra)
    return stiffness(assembly, elasticity), mass(assembly, density)


def _check_density(density: float) -> None:
    if not (np.isfinite(density) and density > 0):
        raise InputError(
            "the material has no mass", key="density", value=density, allowed="above 0 kg/m³"
        )
