"""A smooth map that replaces the piecewise affine one: no kinks at faces of tetrahedra.

The displacement is a cubic spline with continuous first derivatives everywhere inside the cage
(`spacemap_vtk.embedding.worsey_farin`). Its values at the vertices are those of the cage. Its
gradients there are those of a quadratic that is fitted to the surrounding values. The map is linear
in the displacement of the vertices. It reproduces affine motions, and quadratic ones where enough
vertices determine them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.embedding.gradients import has_volume, vertex_gradients
from spacemap_vtk.embedding.interpolation import (
    EmbeddedPoints,
    Interpolation,
    Points,
    check_displacement,
)
from spacemap_vtk.embedding.locate import Location, locate
from spacemap_vtk.embedding.worsey_farin import control_factors, point_factors, split_points
from spacemap_vtk.ndarrays import AnyInts, Floats
from spacemap_vtk.parallel import blocks, for_each

_BLOCK = 2**12  # points that are prepared in one block; it limits the temporary memory


class SmoothInterpolation(EmbeddedPoints):
    """Smooth interpolation of a displacement to fixed points.

    Parameters
    ----------
    points : (N, 3) float64
        Located points, in m.
    location : Location
        Result of `locate` for the points.
    vertices : (V, 3) float64
        Vertices at rest, in m.
    tetrahedra : (T, 4) int
        Vertex numbers.
    clamp : bool
        Whether points outside move like the nearest point of the cage; otherwise they follow the
        affine map that is tangent to the smooth one there.

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
        points: Floats,
        location: Location,
        vertices: Floats,
        tetrahedra: AnyInts,
        clamp: bool = False,
    ) -> None:
        count = len(vertices)
        super().__init__(len(points), count)
        weights, foot = location.weights, location.weights
        beyond = np.flatnonzero(location.is_outside)
        if len(beyond):
            # A cubic is not evaluated outside, because it grows without bound there.
            foot = weights.copy()
            foot[beyond] = locate(points[beyond], vertices, tetrahedra, "clamp").weights
        if clamp:
            weights = foot
        cells = np.asarray(tetrahedra)
        self._location, self._foot, self._cells = location, foot, cells
        self._vertices = vertices
        onward = (weights - foot)[None] if len(beyond) and not clamp else None
        rows = self._prepare(lambda block, _: None if onward is None else onward[:, block])
        self._slopes = vertex_gradients(vertices, tetrahedra)
        columns = count + 3 * cells[:, :, None] + np.arange(3)
        self._wide = np.concatenate((cells, columns.reshape(-1, 12)), axis=1)
        self._rows = self._interpolation(rows[0] if len(rows) == 1 else rows.sum(axis=0))
        self._along: list[Interpolation] = []

    def _interpolation(self, rows: Floats) -> Interpolation:
        located = replace(self._location, weights=rows)
        return Interpolation(located, self._wide, 4 * len(self._vertices))

    def _prepare(self, ways: Callable[[NDArray[np.intp], Floats], Floats | None]) -> Floats:
        """Compute the factors of the corners' values and gradients, (1 + m, N, 16)."""
        # The first factors give the value at the point or, if it is outside, at the nearest point
        # of the mesh. The others give derivatives along m directions. `ways` returns these for the
        # numbers of some points and the corners (n, 4, 3) of their tetrahedra.
        vertices, cells, tetrahedron = self._vertices, self._cells, self._location.tetrahedron
        good = np.flatnonzero(has_volume(vertices, cells))
        centres, faces = split_points(vertices, cells[good])
        # Sorted by tetrahedron, so that a block of points needs few of them.
        order = np.argsort(tetrahedron, kind="stable")
        some = ways(order[:1], vertices[cells[tetrahedron[order[:1]]]])
        result = np.empty((1 if some is None else 1 + len(some), len(order), 16))

        def fill_block(some: slice) -> None:
            block = order[some]
            here, which = np.unique(tetrahedron[block], return_inverse=True)
            row = np.searchsorted(good, here)
            corners = vertices[cells[here]]
            table = control_factors(corners, centres[row], faces[row])
            directions = ways(block, corners[which])
            found = point_factors(
                self._foot[block], which, table, centres[row], faces[row], directions
            )
            edges = (corners[:, None] - corners[:, :, None])[which]  # from, to, axis
            slopes = found[:, :, 4:].reshape(len(found), -1, 4, 4)
            result[:, block, :4] = found[:, :, :4]
            products = np.matmul(slopes[:, :, :, None], edges)
            result[:, block, 4:] = products.reshape(len(found), -1, 12)

        for_each(blocks(len(order), _BLOCK), lambda: fill_block)
        return result

    def displace(self, points: Points, displacement: ArrayLike) -> tuple[Points, Points]:
        table = check_displacement(displacement, self.vertex_count)
        return self._rows.displace(points, np.concatenate((table, self._slopes @ table)))

    def apply(self, values: ArrayLike) -> Floats:
        table = np.asarray(values, dtype=np.float64)
        return self._rows.apply(np.concatenate((table, self._slopes @ table)))

    def gradients(self, displacement: ArrayLike) -> Floats:
        """Compute the gradient of the map at each point.

        Parameters
        ----------
        displacement : (V, 3) array_like
            Displacement of the vertices, in m.

        Returns
        -------
        (N, 3, 3) float64
            Row i is the gradient of coordinate i; for points outside, at the nearest point of the
            mesh.
        """
        table = check_displacement(displacement, self._slopes.shape[1])
        if not self._along:
            rows = self._prepare(lambda _, corners: _axes(corners))[1:]
            self._along = [self._interpolation(row) for row in rows]
        values = np.concatenate((table, self._slopes @ table))
        columns = [ride.apply(values) for ride in self._along]
        return np.eye(3) + np.stack(columns, axis=2)


def _axes(corners: Floats) -> Floats:
    """Convert the directions x, y and z to barycentric coordinates, (3, n, 4)."""
    turned = np.linalg.inv(corners[:, 1:] - corners[:, :1]).transpose(1, 0, 2)
    return np.concatenate((-turned.sum(axis=2, keepdims=True), turned), axis=2)
