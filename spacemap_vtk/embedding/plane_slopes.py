"""Stretch and turn of a plane embedded in a deformed mesh: two columns of F.

In a sheet of one layer they are the slopes of its mid-surface. The tetrahedra of a hexahedron lie
on its upper or lower side, and where the sheet bends each of them has the strain of its side. In
other meshes they are the slopes of quadratics that are fitted around each vertex.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import TETRAHEDRA_PER_CELL
from spacemap_vtk.cage.split import repair_tetrahedra
from spacemap_vtk.cage.split_quadratic import TETRAHEDRON, split_quadratic
from spacemap_vtk.embedding.affine import AffineInterpolation
from spacemap_vtk.embedding.gradients import vertex_gradients
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import Location, locate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.ndarrays import Floats, Ints

#: Largest number of Newton steps to a point in a quadrilateral; a parallelogram needs one.
_STEPS = 8


class PlaneSlopes:
    """Deformed unit vectors along x and y at points in a mesh.

    Parameters
    ----------
    places : (N, 3) float64
        Points, in m.
    vertices : (V, 3) float64
        Vertices of the mesh at rest, in m.
    elements : (T, 4) or (T, 10) int
        Linear or quadratic tetrahedra.

    Examples
    --------
    >>> from spacemap_vtk.cage.lattice import build_lattice
    >>> vertices, cells = build_lattice([0, 2, 0, 2, 0, 1], [2, 2, 1])
    >>> bent = vertices[:, [0]] ** 2 * [0, 0, 1.0]
    >>> PlaneSlopes(np.array([[0.5, 0.7, 0.5]]), vertices, cells).compute(bent).tolist()
    [[[1.0, 0.0, 1.0]], [[0.0, 1.0, 0.0]]]
    """

    def __init__(self, places: Floats, vertices: Floats, elements: NDArray[Any]) -> None:
        cells = np.asarray(elements, np.int64)
        self._surface = find_mid_surface(vertices, cells)
        if self._surface is not None and self._surface.normal != 2:
            self._surface = None
        if cells.shape[1] > 4:
            cells = repair_tetrahedra(vertices, split_quadratic(cells, TETRAHEDRON))[0].astype(
                np.int64
            )
        if self._surface is None:
            where = locate(places, vertices, cells, weighted=False)
            gradients = vertex_gradients(vertices, cells)
            self._at_vertices = [gradients[axis::3] for axis in range(2)]
            self._ride = AffineInterpolation(places, where, vertices, cells)
        else:
            where = locate(places, vertices, cells)
            self._along = _sheet_slopes(places, where, vertices, *self._surface[:2])

    def compute(self, displacement: NDArray[Any]) -> Floats:
        """Compute both vectors at each point.

        Parameters
        ----------
        displacement : (V, 3)
            Displacement of the vertices, in m.

        Returns
        -------
        (2, N, 3) float64
            Deformed unit vectors along x, then along y.
        """
        field = np.asarray(displacement, np.float64)
        if self._surface is None:
            columns = np.concatenate([slope @ field for slope in self._at_vertices], axis=1)
            grown = self._ride.apply(columns).reshape(-1, 2, 3).swapaxes(0, 1)
        else:
            upper, lower = field[self._surface.pairs.T]
            middle = 0.5 * (upper + lower)
            grown = np.stack([ride.apply(middle) for ride in self._along])
        return np.eye(3)[:2, None] + grown


def _sheet_slopes(
    places: Floats, where: Location, vertices: Floats, pairs: Ints, quads: Ints
) -> list[Interpolation]:
    """Prepare slopes along x and y from the midpoints of a sheet's vertex pairs."""
    quad = (where.tetrahedron // TETRAHEDRA_PER_CELL).astype(np.int32)
    upper, lower = vertices[pairs.T]
    corners = (0.5 * (upper + lower))[quads][quad, :, :2]
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    at = np.zeros((len(places), 2))
    for _ in range(_STEPS):
        one = 1.0 + at[:, None] * signs
        slopes = 0.25 * signs * one[:, :, ::-1]  # (N, 4, 2) by ξ and η
        jacobian = np.einsum("nac,nai->nci", corners, slopes)
        found = 0.25 * np.einsum("nac,na->nc", corners, one.prod(axis=2))
        away = np.linalg.solve(jacobian, (places[:, :2] - found)[:, :, None])[:, :, 0]
        if abs(away).max(initial=0.0) < 1e-12:
            break
        at += away
    along = np.einsum("nai,nic->cna", slopes, np.linalg.inv(jacobian))
    return [
        Interpolation(
            replace(where, tetrahedron=quad, weights=np.ascontiguousarray(weights)),
            quads,
            len(pairs),
        )
        for weights in along
    ]
