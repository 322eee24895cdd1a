"""How far a displacement field is from what a linear model can describe."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

#: Rotations beyond this angle (rad) are reported: at 20 degrees a line is stretched by 6 %.
LARGE_ROTATION = np.radians(20.0)


def rotation_operator(
    vertices: NDArray[np.float64], tetrahedra: NDArray[np.int64]
) -> sp.csr_matrix:
    """Return the matrix that turns displacements into the rotation vector of each tetrahedron.

    The rotation of a linear displacement field is half its curl, constant in a tetrahedron.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    tetrahedra : ndarray of int, shape (T, 4)
        Vertex numbers, of tetrahedra with a volume.

    Returns
    -------
    scipy.sparse.csr_matrix, shape (3 T, 3 V)
        For displacements (x, y and z of vertex 0, of vertex 1, …) in m; gives radians.
    """
    count = len(tetrahedra)
    edges = vertices[tetrahedra[:, 1:]] - vertices[tetrahedra[:, :1]]
    # Rows of the inverse's transpose are the gradients of the barycentric coordinates 1, 2, 3.
    inner = np.linalg.inv(edges).transpose(0, 2, 1)
    gradients = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
    rows, columns, values = [], [], []
    for axis in range(3):
        # (curl u)_axis = d_next u_last - d_last u_next
        following, last = (axis + 1) % 3, (axis + 2) % 3
        for component, direction, sign in ((last, following, 0.5), (following, last, -0.5)):
            rows.append(np.repeat(3 * np.arange(count) + axis, 4))
            columns.append((3 * tetrahedra + component).ravel())
            values.append(sign * gradients[:, :, direction].ravel())
    return sp.csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        shape=(3 * count, 3 * len(vertices)),
    )


def largest_rotation(operator: sp.csr_matrix, displacement: NDArray[np.float64]) -> float:
    """Return the largest rotation of any tetrahedron.

    Parameters
    ----------
    operator : scipy.sparse.csr_matrix, shape (3 T, 3 V)
        From `rotation_operator`.
    displacement : ndarray of float64, shape (V, 3)
        In m.

    Returns
    -------
    float
        In rad.
    """
    vectors = (operator @ displacement.ravel()).reshape(-1, 3)
    return float(np.sqrt((vectors**2).sum(axis=1).max()))
