"""Forces on the vertices of a cage from loads on a side, at a vertex, or on the mass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.cage.lattice import TETRAHEDRA_PER_CELL
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.places import SIDES
from spacemap_vtk.ndarrays import Floats, Ints

#: Faces of a tetrahedron: three corners and, for a quadratic one, the midpoints of their edges.
FACES = np.array(
    [[0, 1, 2, 4, 5, 6], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 2, 3, 6, 9, 7]], dtype=np.int64
)


class SideFaces(NamedTuple):
    """Faces of a mesh that lie in one side of its bounding box."""

    nodes: Ints
    """(f, k), vertices that share the load of each face equally: the corners for linear tetrahedra,
    the midpoints of the edges for quadratic ones, and the corners of a hexahedron's face for a
    sheet."""
    areas: Floats
    """(f,), areas of the faces [m²]."""
    normal: Floats
    """(3,), outward unit normal."""
    faces: Ints
    """(f, k), corners of the faces, counter-clockwise seen from outside: triangles, for quadratic
    tetrahedra followed by the midpoints of their edges, or quadrilaterals."""


def find_side_faces(points: Floats, cells: Ints, side: str, sheet: bool = False) -> SideFaces:
    """Find the faces in one side of the bounding box.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra with straight edges.
    side : str
        Key of `spacemap_vtk.mechanics.boundary.places.SIDES`.
    sheet : bool, optional
        Whether the tetrahedra belong to a sheet, five to each hexahedron.

    Returns
    -------
    Wall
        Faces, areas and normal of the side.

    Raises
    ------
    InputError
        If the mesh has no face in this side.
    """
    axis, end = SIDES[side]
    low, high = points.min(axis=0), points.max(axis=0)
    tolerance = 1e-6 * float(np.linalg.norm(high - low))
    is_on_side = abs(points[:, axis] - (high if end > 0 else low)[axis]) <= tolerance
    triangles = cells[:, FACES[:, :3]].reshape(-1, 3)
    on_side = np.flatnonzero(is_on_side[triangles].all(axis=1))
    # A face that two tetrahedra share lies inside the mesh.
    _, first, count = np.unique(
        np.sort(triangles[on_side], axis=1), axis=0, return_index=True, return_counts=True
    )
    outer = on_side[first[count == 1]]
    if len(outer) == 0:
        raise InputError(
            f"the cage has no flat face on its side {side}",
            key="on",
            value=side,
            cure="Choose a side where the cage is flat",
        )
    corners = points[triangles[outer]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(cross, axis=1)
    is_quadratic = cells.shape[1] == 10
    faces = cells[:, FACES if is_quadratic else FACES[:, :3]].reshape(4 * len(cells), -1)[outer]
    nodes = faces[:, -3:]
    normal = np.zeros(3)
    normal[axis] = end
    reversed_order = [0, 2, 1, 5, 4, 3][: faces.shape[1]]
    faces = np.where((cross @ normal > 0)[:, None], faces, faces[:, reversed_order])
    if sheet:
        # By triangles, vertices with many of them would carry more load than those with few, which
        # causes waves in a sheet of low bending stiffness.
        nodes, areas = _join_triangles(nodes, areas, outer // (4 * TETRAHEDRA_PER_CELL))
        radius = points[nodes] - points[nodes].mean(axis=1, keepdims=True)
        around = np.arctan2(radius[..., (axis + 2) % 3], radius[..., (axis + 1) % 3])
        faces = np.take_along_axis(nodes, np.argsort(end * around, axis=1), axis=1)
    return SideFaces(nodes, areas, normal, faces)


def _join_triangles(nodes: Ints, areas: Floats, owner: Ints) -> tuple[Ints, Floats]:
    """Join pairs of triangles to the faces of hexahedra, (f, 4), and add their areas."""
    order = np.argsort(owner, kind="stable")
    both = np.sort(nodes[order].reshape(-1, 6), axis=1)
    first = np.diff(both, axis=1, prepend=-1) > 0
    return both[first].reshape(-1, 4), areas[order].reshape(-1, 2).sum(axis=1)


def traction_forces(count: int, where: SideFaces, stress: ArrayLike) -> Floats:
    """Compute the forces of a constant traction on a wall."""
    share = np.zeros(count)
    corners = where.nodes.shape[1]
    np.add.at(share, where.nodes.ravel(), np.repeat(where.areas / corners, corners))
    return share[:, None] * np.asarray(stress, dtype=np.float64)


def nearest_vertices(points: Floats, place: ArrayLike) -> Ints:
    """Find the vertices nearest to a point, such as both vertices of a sheet above each other.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    place : array_like of float, shape (3,)
        Position of the point [m].

    Returns
    -------
    ndarray of int64, shape (n,)
        Numbers of the vertices that are equally near, up to rounding.
    """
    distance = np.linalg.norm(points - np.asarray(place), axis=1)
    rounding = 1e-6 * float(np.linalg.norm(np.ptp(points, axis=0)))
    return np.flatnonzero(distance <= distance.min() + rounding)


def acceleration_forces(nodal_mass: Floats, acceleration: ArrayLike) -> Floats:
    """Compute the forces of a constant acceleration, such as gravity."""
    return nodal_mass[:, None] * np.asarray(acceleration, dtype=np.float64)
