"""Deformation gradients of a mesh in its tetrahedra and at its vertices, and turned normals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk import cancel
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import Location
from spacemap_vtk.mechanics.elements.tetrahedra import shape_slopes
from spacemap_vtk.ndarrays import AnyInts, Bools, Floats
from spacemap_vtk.parallel import blocks

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Weight of second derivatives relative to the data, where these are of order 1.
_DAMPING = 1e-2
#: Number of vertices that are fitted in one block; it limits the temporary memory.
_FITS = 2**9


class QuadraticGradients:
    """Deformation gradients at points in quadratic tetrahedra, where they vary in space.

    Parameters
    ----------
    location : Location
        Result of `locate` for the points.
    vertices : (V, 3) float64
        Vertices at rest, in m.
    elements : (T, 10) int
        Corners, joined by straight edges, and midpoints.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
    >>> from spacemap_vtk.embedding.locate import locate
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> nodes, cells = add_midpoints(corners, np.array([[0, 1, 2, 3]]))
    >>> where = locate([[0.25, 0.5, 0.125]], corners, cells[:, :4])
    >>> QuadraticGradients(where, nodes, cells).compute(nodes**2)[0].round(9).tolist()
    [[1.5, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.25]]
    """

    def __init__(self, location: Location, vertices: Floats, elements: AnyInts) -> None:
        corners = vertices[elements[location.tetrahedron, :4]]
        # Outside, the map continues along its tangent.
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

    def compute(self, displacement: NDArray[Any]) -> Floats:
        """Compute the deformation gradient F at each point.

        Parameters
        ----------
        displacement : (V, 3)
            Displacement of the vertices, in m.

        Returns
        -------
        (N, 3, 3) float64
            dx'/dx.
        """
        columns = [ride.apply(displacement) for ride in self._along]
        return np.eye(3) + np.stack(columns, axis=2)


def cofactors(gradients: Floats) -> Floats:
    """Compute the cofactor matrices det(F) F^-T, which transform surface normals.

    Parameters
    ----------
    gradients : (n, 3, 3) float64
        Deformation gradients F.

    Returns
    -------
    (n, 3, 3) float64
        Defined for singular F too.
    """
    a, b, c = gradients[:, 0], gradients[:, 1], gradients[:, 2]
    return np.stack((np.cross(b, c), np.cross(c, a), np.cross(a, b)), axis=1)


def deform_normals(normals: NDArray[Any], cofactor: Floats, which: AnyInts) -> NDArray[np.float32]:
    """Compute unit normals of a deformed surface.

    Parameters
    ----------
    normals : (n, 3)
        Normals at rest.
    cofactor : (T, 3, 3) float64
        `cofactors` of each tetrahedron.
    which : (n,) int
        Tetrahedron of each point.

    Returns
    -------
    (n, 3) float32
        Of length 1; a normal that loses its direction keeps its value at rest.
    """
    turned = np.einsum("nij,nj->ni", cofactor[which], normals)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    good = length > 1e-30
    return np.where(good, turned / np.where(good, length, 1.0), normals).astype(np.float32)


def vertex_averages(vertices: ArrayLike, elements: ArrayLike) -> csr_matrix:
    """Build the matrix that averages values of tetrahedra at vertices, weighted by volume.

    The stress of linear tetrahedra jumps from one to the next. Finite element programs show its
    average at the vertices.

    Parameters
    ----------
    vertices : (V, 3) array_like of float
        Vertices, in m.
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
    from scipy.sparse import csr_matrix, diags  # imported here: it takes a tenth of a second

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


def has_volume(vertices: Floats, tetrahedra: AnyInts) -> Bools:
    """Check which tetrahedra are not flat."""
    corners = vertices[tetrahedra]
    edges = corners[:, 1:] - corners[:, :1]
    return np.abs(np.linalg.det(edges)) > 1e-12 * np.abs(edges).max(axis=(1, 2)) ** 3


def vertex_gradients(vertices: Floats, tetrahedra: AnyInts) -> csr_matrix:
    """Build the operator that computes the gradient at each vertex."""
    # A quadratic is fitted to the neighbours and their neighbours. A mean over tetrahedra would be
    # one-sided at the boundary, where a coarse cage has most of its vertices.
    from scipy.sparse import csr_matrix  # imported here: it takes a tenth of a second

    count = len(vertices)
    cells = np.asarray(tetrahedra)[has_volume(vertices, tetrahedra)]
    member = csr_matrix(
        (np.ones(cells.size), (np.repeat(np.arange(len(cells)), 4), cells.ravel())),
        shape=(len(cells), count),
    )
    near = (member.T @ member).tocsr()
    around = (near @ near).tocsr()
    around.sort_indices()
    sizes = np.diff(around.indptr)
    rows, columns, data = [], [], []
    for size in np.unique(sizes[sizes > 1]):
        of_size = np.flatnonzero(sizes == size)
        for some in blocks(len(of_size), _FITS):
            cancel.check()
            which = of_size[some]
            others = around.indices[around.indptr[which][:, None] + np.arange(size)]
            others = others[others != which[:, None]].reshape(len(which), -1)
            factors = _fit_quadratics(vertices[others] - vertices[which][:, None])  # (n, 3, m)
            own = -factors.sum(axis=2, keepdims=True)
            shape = (len(which), 3, size)
            data.append(np.concatenate((factors, own), axis=2).ravel())
            giving = np.concatenate((others, which[:, None]), axis=1)[:, None]
            columns.append(np.broadcast_to(giving, shape).ravel())
            receiving = (3 * which[:, None] + np.arange(3))[:, :, None]
            rows.append(np.broadcast_to(receiving, shape).ravel())
    return csr_matrix(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))),
        shape=(3 * count, count),
    )


def _fit_quadratics(offsets: Floats) -> Floats:
    """Compute factors (n, 3, m) that turn differences to m neighbours into the gradient."""
    length = np.linalg.norm(offsets, axis=2)
    size = length.mean(axis=1)
    x, y, z = (offsets / size[:, None, None]).transpose(2, 0, 1)
    weight = (size[:, None] / length) ** 2
    terms = [x, y, z, x * x / 2, y * y / 2, z * z / 2, x * y, y * z, z * x]
    matrix = weight[:, :, None] * np.stack(terms, axis=2)
    # Where the neighbours do not determine them, as through a single layer, second derivatives are
    # zero. First derivatives are not damped, so that affine functions stay exact.
    damping = np.zeros((len(offsets), 6, 9))
    damping[:, range(6), range(3, 9)] = _DAMPING
    inverse = np.linalg.pinv(np.concatenate((matrix, damping), axis=1))
    count = offsets.shape[1]
    return inverse[:, :3, :count] * (weight / size[:, None])[:, None]
