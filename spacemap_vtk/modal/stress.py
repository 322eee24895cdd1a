"""Strain and stress of tetrahedra, in the axes of the fabric (x weft, y warp, z normal)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.modal.elasticity import barycentric_gradients

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Pairs of axes of the six components, in the order of `spacemap_vtk.modal.materials`.
COMPONENTS = ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))
#: The edges whose middles are the nodes 4 to 9 of a quadratic tetrahedron.
_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))


def strain_operator(points: ArrayLike, cells: ArrayLike) -> sp.csr_matrix:
    """Return the matrix that turns displacements into the mean strain of each tetrahedron.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Vertices [m].
    cells : array_like of int, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra with straight edges.

    Returns
    -------
    scipy.sparse.csr_matrix of float64, shape (6T, 3V)
        For displacements (x, y and z of vertex 0, of vertex 1, …) in m; gives xx, yy, zz, yz, zx
        and xy of each tetrahedron, shears in engineering measure (γ = 2ε). Strain is constant in
        a linear tetrahedron and linear in a quadratic one, whose mean is that at its centroid.

    Raises
    ------
    GeometryError
        If the mesh is none, or a tetrahedron flat.
    """
    nodes = np.asarray(cells, dtype=np.int64)
    gradient = barycentric_gradients(np.asarray(points, dtype=np.float64), nodes)[0]
    if nodes.shape[1] == 10:
        # N = L (2L - 1) at a corner, 4 Lᵢ Lⱼ on an edge; where all L are 1/4 the gradients of the
        # corners vanish, and those of an edge are the sum of its corners'.
        edges = np.stack([gradient[:, a] + gradient[:, b] for a, b in _EDGES], axis=1)
        gradient = np.concatenate([np.zeros_like(gradient), edges], axis=1)
    count, size = nodes.shape
    rows, columns, values = [], [], []
    for row, (i, j) in enumerate(COMPONENTS):
        pairs = [(i, i)] if i == j else [(i, j), (j, i)]
        for component, direction in pairs:
            rows.append(np.repeat(6 * np.arange(count) + row, size))
            columns.append((3 * nodes + component).ravel())
            values.append(gradient[:, :, direction].ravel())
    parts = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_matrix(parts, shape=(6 * count, 3 * len(np.asarray(points))))


def von_mises(stress: FloatArray) -> FloatArray:
    """Return the von Mises stress.

    Parameters
    ----------
    stress : ndarray of float64, shape (T, 6)
        Components xx, yy, zz, yz, zx, xy [Pa].

    Returns
    -------
    ndarray of float64, shape (T,)
        In Pa.
    """
    x, y, z, yz, zx, xy = stress.T
    normal = (x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2
    return np.asarray(np.sqrt(0.5 * normal + 3.0 * (yz**2 + zx**2 + xy**2)))


def symmetric_tensors(components: FloatArray, *, engineering: bool) -> FloatArray:
    """Return strains or stresses in VTK's order of a symmetric tensor.

    Parameters
    ----------
    components : ndarray of float64, shape (T, 6)
        As xx, yy, zz, yz, zx, xy.
    engineering : bool
        Whether shears are in engineering measure, and to be halved.

    Returns
    -------
    ndarray of float64, shape (T, 6)
        As xx, yy, zz, xy, yz, xz, of a tensor.
    """
    result = components[:, [0, 1, 2, 5, 3, 4]]
    if engineering:
        result[:, 3:] *= 0.5
    return result
