"""The boundary of a tetrahedral mesh, and the nearest point on a triangle.

As in `spacemap_vtk.embedding.frames`, only element-wise arithmetic is used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import AnyInts, Bools, Floats

Coordinates = Floats  # (3, n): one row an axis

# Face i is opposite corner i; faces of a positive tetrahedron point outwards.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


def boundary_faces(
    tetrahedra: AnyInts, positive: Bools
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the faces that can contain the nearest point of a mesh to a point outside.

    Parameters
    ----------
    tetrahedra : ndarray of int, shape (n, 4)
        Numbers of the corners.
    positive : ndarray of bool, shape (n,)
        Whether the last corner lies on the side from which the first three run anticlockwise.

    Returns
    -------
    tetrahedra, corners : ndarray of int, shape (m,)
        Tetrahedron of each face, and the number of the opposite corner.
    """
    # A face is omitted only if exactly two tetrahedra share it from opposite sides. So a mesh that
    # does not conform, or overlaps itself, gives more faces than necessary, but never too few.
    faces = tetrahedra[:, FACES].reshape(-1, 3)
    a, b, c = faces.T
    # The parity of the order of the three numbers shows to which side the face points.
    side = np.sign(b - a) * np.sign(c - b) * np.sign(c - a)
    side *= np.repeat(np.where(positive, 1, -1), 4)
    a, b, c = np.sort(faces, axis=1).T
    order = np.lexsort((c, b, a))
    key = np.stack((a, b, c), axis=1)[order]
    begins = np.concatenate(([True], (key[1:] != key[:-1]).any(axis=1)))
    group = np.cumsum(begins) - 1
    count = np.bincount(group)
    balance = np.bincount(group, weights=side[order])
    inner = (count == 2) & (balance == 0)
    kept = np.sort(order[~inner[group]])
    return kept // 4, kept % 4


def nearest_on_triangles(
    points: Coordinates, a: Coordinates, b: Coordinates, c: Coordinates
) -> tuple[Floats, Coordinates]:
    """Compute the squared distance to triangles, and barycentric weights of the nearest points."""
    ab, ac, bc = b - a, c - a, c - b
    ap, bp = points - a, points - b
    along_ab, to_ab = _nearest_on_edge(ap, ab)
    along_ac, to_ac = _nearest_on_edge(ap, ac)
    along_bc, to_bc = _nearest_on_edge(bp, bc)
    squared = np.minimum(np.minimum(to_ab, to_ac), to_bc)
    on_ab, on_ac = to_ab == squared, to_ac == squared
    # Cross products are used, because the Gram matrix loses all digits in a needle.
    normal = cross(ab, ac)
    area = dot(normal, normal)
    area = np.where(area > 0, area, 1.0)
    v = dot(cross(ap, ac), normal) / area
    w = dot(cross(ab, ap), normal) / area
    height = dot(ap, normal)
    above = (v > 0) & (w > 0) & (v + w < 1)
    squared = np.where(above, np.minimum(height * height / area, squared), squared)
    v = np.where(above, v, np.where(on_ab, along_ab, np.where(on_ac, 0.0, 1.0 - along_bc)))
    w = np.where(above, w, np.where(on_ab, 0.0, np.where(on_ac, along_ac, along_bc)))
    return squared, np.stack((np.maximum(1.0 - v - w, 0.0), v, w))


def _nearest_on_edge(p: Coordinates, edge: Coordinates) -> tuple[Floats, Floats]:
    """Compute the parameter of the nearest point of an edge, and its squared distance."""
    length = dot(edge, edge)
    t = np.clip(dot(p, edge) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    rest = p - t * edge
    return t, dot(rest, rest)


def cross(a: Coordinates, b: Coordinates) -> Coordinates:
    """Compute the vector product."""
    return np.stack(
        (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


def dot(a: Coordinates, b: Coordinates) -> Floats:
    """Compute the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
