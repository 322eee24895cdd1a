"""Move the vertices of a cage outwards until it contains all points of an object.

fTetWild deviates from the surface by a tolerance, and its faces are chords, so most points of a
round surface lie just outside. The vertices of the nearest faces are moved outwards by the least
amount that encloses the points. The cage is then too large, like a polyhedron around a ball. Its
material is spread over the whole cage, and it has the mass of the object.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.cage.split import tetrahedron_volumes
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.ndarrays import AnyInts, Floats

#: Shares of the required move in each step. The first are small, because a vertex that moves for
#: one point helps others too; the last ones go slightly too far.
_STEPS = (0.6,) * 6 + (1.02,) * 10
#: Largest move of a vertex, as a multiple of the distance of the point that requires it.
_MOST = 10.0
#: Least share of its volume that each tetrahedron keeps. With 0.2, flat tetrahedra by fTetWild kept
#: twice as many points of a forged lever outside.
_LEAST = 0.1


def enclose_points(points: Floats, vertices: Floats, tetrahedra: AnyInts, reach: float) -> Floats:
    """Move vertices of a cage outwards so that it contains points.

    Parameters
    ----------
    points : (N, 3) float64
        Points to enclose, in m.
    vertices : (V, 3) float64
        Vertices of the cage, in m.
    tetrahedra : (T, 4) int
        Tetrahedra; their volumes are positive and stay positive.
    reach : float
        Points further away than this, in m, stay outside.

    Returns
    -------
    (V, 3) float64
        Vertices in m. Those that no outside point needs to move stay in place, and none leaves the
        box of the points.

    Notes
    -----
    A point at :math:`g` from the nearest point :math:`\\sum_i w_i v_i` of the cage lies on it if
    :math:`\\sum_i w_i d_i = g`. The least such moves are :math:`d_i = w_i g / \\sum_j w_j^2`. Each
    vertex follows the point that requires its largest move.
    """
    volumes = tetrahedron_volumes(vertices, tetrahedra)
    # Vertices stay in the points' box, so that flat sides, at which cages are supported, stay flat.
    low = np.minimum(points.min(axis=0), vertices)
    high = np.maximum(points.max(axis=0), vertices)
    for share in _STEPS:
        where = locate(points, vertices, tetrahedra, "clamp")
        out = np.flatnonzero(where.is_outside)
        corners, weights = tetrahedra[where.tetrahedron[out]], where.weights[out]
        gaps = points[out] - np.einsum("ni,nij->nj", weights, vertices[corners])
        near = np.linalg.norm(gaps, axis=1) <= reach
        if not near.any():
            break
        corners, weights, gaps = corners[near], weights[near], gaps[near, None]
        # A vertex at a side of the box cannot move further, so the others must move instead.
        reachable = (
            np.clip(vertices[corners] + gaps, low[corners], high[corners]) - vertices[corners]
        )
        weights = weights * (reachable * gaps).sum(axis=2) / (gaps**2).sum(axis=2)
        most = np.maximum((weights**2).sum(axis=1), weights.max(axis=1) / _MOST)
        most[most == 0.0] = 1.0
        required = (weights / most[:, None])[:, :, None] * gaps
        order = np.argsort((required**2).sum(axis=2).ravel())  # the largest move is written last
        moves = np.zeros_like(vertices)
        moves[corners.ravel()[order]] = share * required.reshape(-1, 3)[order]
        moves = np.clip(vertices + moves, low, high) - vertices
        while (bad := tetrahedron_volumes(vertices + moves, tetrahedra) < _LEAST * volumes).any():
            moves[np.unique(tetrahedra[bad])] *= 0.5
        vertices = vertices + moves
    return vertices


def enclosed_share(
    points: Floats, triangles: AnyInts, inside: float, volume: float, tolerance: float
) -> float:
    """Compute the share of a cage that the object's surface encloses.

    Parameters
    ----------
    points : (N, 3) float64
        Points of the surface, in m.
    triangles : (F, 3) int
        Triangles of a closed surface; empty for an open one.
    inside : float
        Volume of the tetrahedra that were made inside the surface, in m³.
    volume : float
        Volume of the cage, in m³.
    tolerance : float
        Largest distance of these tetrahedra from the surface, in m.

    Returns
    -------
    float
        1 if both volumes are equal.

    Notes
    -----
    The divergence theorem gives the enclosed volume, but counts twice where a surface crosses
    itself. Then it differs from the volume of the tetrahedra by more than their tolerance explains,
    and the volume of the tetrahedra is used.
    """
    if len(triangles):
        a, b, c = (points - points[triangles[0, 0]])[triangles].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        enclosed = abs(float(np.einsum("ij,ij->", a, normals))) / 6.0
        area = float(np.linalg.norm(normals, axis=1).sum()) / 2.0
        if abs(enclosed - inside) <= tolerance * area:
            inside = enclosed
    return inside / volume
