"""A smooth map in place of the piecewise affine one: no kinks at the borders of tetrahedra.

The displacement is a cubic spline with continuous first derivatives everywhere inside the cage
(`spacemap_vtk.embedding.worsey_farin`). Its values at the vertices are the cage's; its gradients
there are those of a quadratic fitted to the values around. It is linear in the displacement of the
vertices; affine motions are reproduced, and quadratic ones where there are enough vertices to tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix

from spacemap_vtk.embedding.interpolation import Interpolation, displacement_table
from spacemap_vtk.embedding.locate import Location, locate
from spacemap_vtk.embedding.worsey_farin import coefficients, evaluated, split_points
from spacemap_vtk.parallel import for_each

#: Weight of second derivatives against the data, where these are of order 1.
_DAMPING = 1e-2
_BLOCK = 2**12  # points that are prepared together; bounds the scratch memory
_FITS = 2**9  # vertices that are fitted together; bounds the scratch memory


class SmoothInterpolation:
    """Smooth interpolation of a displacement to fixed points.

    Parameters
    ----------
    points : (N, 3) float64
        The points that were located, in m.
    location : Location
        Where they lie.
    vertices : (V, 3) float64
        At rest, in m.
    tetrahedra : (T, 4) int
        Vertex numbers.
    clamp : bool
        Points outside move as the nearest point of the cage does; otherwise they follow the affine
        map that touches the smooth one there.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> cage = np.array([[0, 1, 2, 3]])
    >>> points = np.array([[0.2, 0.3, 0.4]])
    >>> ride = SmoothInterpolation(points, locate(points, corners, cage), corners, cage)
    >>> ride.displace(points, 2 * corners)[1].round(12).tolist()
    [[0.4, 0.6, 0.8]]
    """

    def __init__(
        self,
        points: NDArray[np.float64],
        location: Location,
        vertices: NDArray[np.float64],
        tetrahedra: NDArray[np.integer[Any]],
        clamp: bool = False,
    ) -> None:
        count = len(vertices)
        weights, foot = location.weights, location.weights
        beyond = np.flatnonzero(location.is_outside)
        if len(beyond):
            # A cubic must not be asked for its value outside: it runs away.
            foot = weights.copy()
            foot[beyond] = locate(points[beyond], vertices, tetrahedra, "clamp").weights
        if clamp:
            weights = foot
        rows = np.empty((len(points), 16))
        used, local = np.unique(location.tetrahedron, return_inverse=True)
        cells = np.asarray(tetrahedra)
        good = np.flatnonzero(has_volume(vertices, cells))
        centres, faces = split_points(vertices, cells[good])
        table = np.searchsorted(good, used)
        # by tetrahedron, so that a block of points needs few of them
        order = np.argsort(local, kind="stable")

        def fill() -> Callable[[int], None]:
            def do(begin: int) -> None:
                block = order[begin : begin + _BLOCK]
                here, which = np.unique(local[block], return_inverse=True)
                middle, split = centres[table[here]], faces[table[here]]
                corners = vertices[cells[used[here]]]
                points_of = coefficients(corners, middle, split)
                onward = weights[block] - foot[block] if len(beyond) else None
                found = evaluated(foot[block], which, points_of, middle, split, onward)
                edges = corners[:, None] - corners[:, :, None]  # tetrahedron, from, to, axis
                slopes = found[:, 4:].reshape(-1, 4, 4)
                rows[block, :4] = found[:, :4]
                rows[block, 4:] = np.matmul(slopes[:, :, None], edges[which]).reshape(-1, 12)

            return do

        for_each(range(0, len(points), _BLOCK), fill)
        self._slopes = vertex_gradients(vertices, tetrahedra)
        columns = count + 3 * np.asarray(tetrahedra)[:, :, None] + np.arange(3)
        wide = np.concatenate((tetrahedra, columns.reshape(-1, 12)), axis=1)
        self._rows = Interpolation(replace(location, weights=rows), wide, 4 * count)
        self._blend = Interpolation(replace(location, weights=foot), tetrahedra, count)

    def displace(
        self, points: NDArray[Any], displacement: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Move the points with the mesh.

        Parameters
        ----------
        points : (N, 3) float32 or float64
            The points that were located, in m.
        displacement : (V, 3) array_like
            Displacement of the vertices in m.

        Returns
        -------
        moved : (N, 3) of the points' type
            Points plus displacement, in m.
        displacement : (N, 3) of the points' type
            In m.

        Raises
        ------
        InputError
            The displacement is not (V, 3), or the points are not those that were located.
        """
        table = displacement_table(displacement, self._slopes.shape[1])
        return self._rows.displace(points, np.concatenate((table, self._slopes @ table)))

    def gradients(self, displacement: ArrayLike) -> NDArray[np.float64]:
        """Return the gradient of the map at each point, blended from those of the vertices.

        Parameters
        ----------
        displacement : (V, 3) array_like
            In m.

        Returns
        -------
        (N, 3, 3) float64
            Row i is the gradient of coordinate i.
        """
        table = displacement_table(displacement, self._slopes.shape[1])
        slopes = (self._slopes @ table).reshape(-1, 9)  # vertex; direction, coordinate
        blended = self._blend.apply(slopes).reshape(-1, 3, 3)
        return np.eye(3) + blended.transpose(0, 2, 1)


def has_volume(
    vertices: NDArray[np.float64], tetrahedra: NDArray[np.integer[Any]]
) -> NDArray[np.bool_]:
    """Return which tetrahedra are not flat.

    Parameters
    ----------
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        Vertex numbers.

    Returns
    -------
    (T,) bool
        True where there is a volume.
    """
    corners = vertices[tetrahedra]
    edges = corners[:, 1:] - corners[:, :1]
    result: NDArray[np.bool_] = (
        np.abs(np.linalg.det(edges)) > 1e-12 * np.abs(edges).max(axis=(1, 2)) ** 3
    )
    return result


def vertex_gradients(
    vertices: NDArray[np.float64], tetrahedra: NDArray[np.integer[Any]]
) -> csr_matrix:
    """Return the operator that gives the gradient at each vertex.

    A quadratic is fitted to the vertices around, neighbours of neighbours too: a mean over the
    tetrahedra would be one-sided at the border, where a coarse cage has most of its vertices.

    Parameters
    ----------
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        Vertex numbers; flat ones connect nothing.

    Returns
    -------
    (3 V, V) sparse matrix
        Row 3 v + i: the derivative along axis i at vertex v. Exact for affine functions, and nearly
        so for quadratic ones where there are enough vertices to tell.
    """
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
        for begin in range(0, len(of_size), _FITS):
            which = of_size[begin : begin + _FITS]
            others = around.indices[around.indptr[which][:, None] + np.arange(size)]
            others = others[others != which[:, None]].reshape(len(which), -1)
            factors = _fit(vertices[others] - vertices[which][:, None])  # (n, 3, m)
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


def _fit(offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return factors (n, 3, m) of the differences to m neighbours, which give the gradient."""
    length = np.linalg.norm(offsets, axis=2)
    size = length.mean(axis=1)
    x, y, z = (offsets / size[:, None, None]).transpose(2, 0, 1)
    weight = (size[:, None] / length) ** 2
    terms = [x, y, z, x * x / 2, y * y / 2, z * z / 2, x * y, y * z, z * x]
    matrix = weight[:, :, None] * np.stack(terms, axis=2)
    # Where the neighbours do not tell, as through a single layer, second derivatives are zero.
    # First ones are free, so that affine functions stay exact.
    damping = np.zeros((len(offsets), 6, 9))
    damping[:, range(6), range(3, 9)] = _DAMPING
    inverse = np.linalg.pinv(np.concatenate((matrix, damping), axis=1))
    count = offsets.shape[1]
    result: NDArray[np.float64] = inverse[:, :3, :count] * (weight / size[:, None])[:, None]
    return result
