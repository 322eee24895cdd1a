"""Sample points of a cage's surface, at which it can touch obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.boundary.loads import FACES
from spacemap_vtk.mechanics.elements.shell import MidSurface, shape_functions, shape_slopes
from spacemap_vtk.ndarrays import Floats, Ints

#: Samples along each side of a quadrilateral of a sheet.
PER_SIDE = 4
#: Samples along each side of a triangle on a solid.
PER_EDGE = 2


class Samples(NamedTuple):
    """Points on elements of one kind: positions are weighted sums of the elements' nodes."""

    nodes: Ints
    """(E, n), nodes of each element."""
    weights: Floats
    """(m, n), weights of the nodes in each of m points."""
    areas: Floats
    """(E, m), area that belongs to each point [m²]."""

    def positions(self, nodal: Floats) -> Floats:
        """Compute the positions (or moves) of the samples from those of the nodes, (E, m, 3)."""
        return self.weights @ nodal[self.nodes]


def sample_sheet(points: Floats, surface: MidSurface, per_side: int = PER_SIDE) -> Samples:
    """Sample the mid-surface of a sheet evenly; nodes are its pairs.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    surface : MidSurface
        Mid-surface of the sheet.
    per_side : int, optional
        Samples along each side.

    Returns
    -------
    Samples
        Nodes, weights and areas.
    """
    line = (2 * np.arange(per_side) + 1) / per_side - 1
    places = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    corners = surface.to_nodes(points)[surface.quads]
    tangents = np.stack([shape_slopes(at) for at in places]) @ corners[:, None]
    areas = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2)
    weights = np.stack([shape_functions(at) for at in places])
    return Samples(surface.quads, weights, areas * (2 / per_side) ** 2)


def sample_faces(points: Floats, cells: Ints, per_edge: int = PER_EDGE) -> Samples:
    """Sample the boundary of linear or quadratic tetrahedra; nodes are the vertices.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.
    per_edge : int, optional
        Samples along each side.

    Returns
    -------
    Samples
        Nodes, weights and areas.
    """
    faces = cells[:, FACES].reshape(-1, 6) if cells.shape[1] == 10 else cells[:, FACES[:, :3]]
    faces = faces.reshape(-1, faces.shape[-1])
    _, first, count = np.unique(
        np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True
    )
    faces = faces[first[count == 1]]  # a face of two tetrahedra lies inside
    # Centroids of the parts of a triangle: upright ones, and those that stand on their tips.
    steps = np.stack(np.meshgrid(*2 * [np.arange(per_edge)], indexing="ij"), axis=-1).reshape(-1, 2)
    total = steps.sum(axis=1)
    places = np.concatenate([steps[total < per_edge] + 1 / 3, steps[total < per_edge - 1] + 2 / 3])
    places = places / per_edge
    weights = np.column_stack([1 - places.sum(axis=1), places])
    corners = points[faces[:, :3]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(cross, axis=1)[:, None] / (2 * len(weights))
    if faces.shape[1] == 6:
        a, b, c = weights.T
        middle = 4 * np.column_stack([a * b, b * c, c * a])
        weights = np.column_stack([weights * (2 * weights - 1), middle])
    return Samples(faces, weights, np.repeat(areas, len(weights), axis=1))
