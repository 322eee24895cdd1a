"""From values of tetrahedra to values at their vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


def vertex_averages(vertices: ArrayLike, elements: ArrayLike) -> csr_matrix:
    """Return the matrix that averages values of tetrahedra at the vertices, weighted by volume.

    The stress of linear tetrahedra jumps from one to the next; averaged at the vertices it is what
    finite element programs show.

    Parameters
    ----------
    vertices : (V, 3) array_like of float
        In m.
    elements : (T, 4) or (T, 10) array_like of int
        Linear or quadratic tetrahedra, corners first.

    Returns
    -------
    (V, T) scipy.sparse.csr_matrix of float64
        Rows sum to 1; those of vertices without a tetrahedron are zero.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -2]]
    >>> average = vertex_averages(corners, [[0, 1, 2, 3], [0, 2, 1, 4]])
    >>> (average @ [3.0, 6.0]).tolist()
    [5.0, 5.0, 5.0, 3.0, 6.0]
    """
    from scipy.sparse import csr_matrix, diags  # with all it brings: a tenth of a second

    points, cells = np.asarray(vertices, np.float64), np.asarray(elements)
    edges = points[cells[:, 1:4]] - points[cells[:, :1]]
    volumes = np.abs(np.linalg.det(edges))
    count, nodes = cells.shape
    shape = len(points), count
    columns = np.repeat(np.arange(count), nodes)
    weights = csr_matrix((np.repeat(volumes, nodes), (cells.ravel(), columns)), shape=shape)
    totals: NDArray[Any] = np.asarray(weights.sum(axis=1)).ravel()
    scale = np.divide(1.0, totals, out=np.zeros_like(totals), where=totals > 0.0)
    return csr_matrix(diags(scale) @ weights)
