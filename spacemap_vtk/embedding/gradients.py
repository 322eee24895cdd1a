"""How a deformed mesh turns and stretches, in its tetrahedra and averaged at its vertices."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import Location
from spacemap_vtk.mechanics.elements import shape_slopes
from spacemap_vtk.ndarrays import AnyInts, Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


class QuadraticGradients:
    """The gradient of the map at each point in quadratic tetrahedra, where it varies.

    Parameters
    ----------
    location : Location
        Where the points lie.
    vertices : (V, 3) float64
        At rest, in m.
    elements : (T, 10) int
        Corners, which are joined by straight edges, and midpoints.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements import with_midpoints
    >>> from spacemap_vtk.embedding.locate import locate
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> nodes, cells = with_midpoints(corners, np.array([[0, 1, 2, 3]]))
    >>> where = locate([[0.25, 0.5, 0.125]], corners, cells[:, :4])
    >>> QuadraticGradients(where, nodes, cells).at(nodes**2)[0].round(9).tolist()
    [[1.5, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.25]]
    """

    def __init__(self, location: Location, vertices: Floats, elements: AnyInts) -> None:
        corners = vertices[elements[location.tetrahedron, :4]]
        # outside, the map goes on as its tangent does
        inside = np.maximum(location.weights, 0.0)
        inside /= inside.sum(axis=1, keepdims=True)
        slopes = shape_slopes(inside)
        turned = np.linalg.inv(corners[:, 1:] - corners[:, :1])  # axis, weight
        per_axis = np.concatenate((-turned.sum(axis=2, keepdims=True), turned), axis=2)
        self._along = [
            Interpolation(
                replace(location, weights=np.einsum("nai,ni->na", slopes, per_axis[:, axis])),
                elements,
                len(vertices),
            )
            for axis in range(3)
        ]

    def at(self, displacement: NDArray[Any]) -> Floats:
        """Return the gradient F at each point.

        Parameters
        ----------
        displacement : (V, 3)
            In m.

        Returns
        -------
        (N, 3, 3) float64
            dx'/dx.
        """
        columns = [ride.apply(displacement) for ride in self._along]
        return np.eye(3) + np.stack(columns, axis=2)


def cofactors(gradients: Floats) -> Floats:
    """Return the cofactor matrix, det(F) F^-T, by which the normals of surfaces change.

    Parameters
    ----------
    gradients : (n, 3, 3) float64
        F.

    Returns
    -------
    (n, 3, 3) float64
        Exists for singular F too.
    """
    a, b, c = gradients[:, 0], gradients[:, 1], gradients[:, 2]
    return np.stack((np.cross(b, c), np.cross(c, a), np.cross(a, b)), axis=1)


def turned_normals(normals: NDArray[Any], cofactor: Floats, which: AnyInts) -> NDArray[np.float32]:
    """Return unit normals of a deformed surface.

    Parameters
    ----------
    normals : (n, 3)
        At rest.
    cofactor : (T, 3, 3) float64
        `cofactors` of each tetrahedron.
    which : (n,) int
        The tetrahedron of each point.

    Returns
    -------
    (n, 3) float32
        Of length 1; a normal that has no direction any more stays as it was.
    """
    turned = np.einsum("nij,nj->ni", cofactor[which], normals)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    good = length > 1e-30
    return np.where(good, turned / np.where(good, length, 1.0), normals).astype(np.float32)


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
