"""Quadratic tetrahedra from linear ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.mechanics.elements import EDGES


def with_midpoints(
    vertices: NDArray[np.float64], tetrahedra: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return a mesh with a vertex in the middle of each edge, shared by those that meet there.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    tetrahedra : ndarray of int64, shape (T, 4)
        Vertex numbers of linear tetrahedra.

    Returns
    -------
    vertices : ndarray of float64, shape (V + E, 3)
        The given ones, and the middle of each of the E edges.
    tetrahedra : ndarray of int64, shape (T, 10)
        Corners, then midpoints in the order of VTK_QUADRATIC_TETRA.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> points, cells = with_midpoints(corners, np.array([[0, 1, 2, 3]]))
    >>> points[cells[0, 5]].tolist()
    [0.5, 0.5, 0.0]
    """
    ends = np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1)
    count = len(vertices)
    edge, which = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    middles = (vertices[edge // count] + vertices[edge % count]) / 2
    cells = np.concatenate([tetrahedra, count + which.reshape(-1, len(EDGES))], axis=1)
    return np.concatenate([vertices, middles]), cells
