"""Cages round an object's surface that hold its points, and how much of them it fills.

fTetWild leaves the surface by a tolerance, and its faces are chords: of what is round, most points
lie just outside. So the vertices of the faces before them go outward, by the least that takes them
in. Such a cage is as much too large as a polyhedron round a ball is: its material is spread over
all of it, and it weighs as much as the object.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.cage.split import volumes_of
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.ndarrays import AnyInts, Floats

#: Steps that go some share of the way: what a vertex does for one point, it does for others. The
#: last ones go all of it, and a little more.
_STEPS = (0.6,) * 6 + (1.02,) * 10
#: As many times as far as a point is away a vertex may go for it.
_MOST = 10.0
#: No tetrahedron keeps less of its volume.
_LEAST = 0.2


def holding(points: Floats, vertices: Floats, tetrahedra: AnyInts, reach: float) -> Floats:
    """Return the vertices of a cage, some of them moved outward so that it holds points.

    Parameters
    ----------
    points : (N, 3) float64
        What it is to hold, in m.
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        Of positive volume, and so they stay.
    reach : float
        Points further away than this, in m, are left outside.

    Returns
    -------
    (V, 3) float64
        In m. Those that no point outside asks to move stay where they are, and none leaves the box
        of the points.

    Notes
    -----
    A point at :math:`g` from the nearest place :math:`\\sum_i w_i v_i` of the cage lies on it when
    :math:`\\sum_i w_i d_i = g`, of which :math:`d_i = w_i g / \\sum_j w_j^2` is the least. Each
    vertex follows the point that asks most of it.
    """
    volumes = volumes_of(vertices, tetrahedra)
    # No further than the points' box, so that flat sides stay flat, by which cages are held.
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
        # Who stands at a side of the box leaves it to the others.
        gone = np.clip(vertices[corners] + gaps, low[corners], high[corners]) - vertices[corners]
        weights = weights * (gone * gaps).sum(axis=2) / (gaps**2).sum(axis=2)
        most = np.maximum((weights**2).sum(axis=1), weights.max(axis=1) / _MOST)
        most[most == 0.0] = 1.0
        asked = (weights / most[:, None])[:, :, None] * gaps
        order = np.argsort((asked**2).sum(axis=2).ravel())  # the last one is kept
        moves = np.zeros_like(vertices)
        moves[corners.ravel()[order]] = share * asked.reshape(-1, 3)[order]
        moves = np.clip(vertices + moves, low, high) - vertices
        while (bad := volumes_of(vertices + moves, tetrahedra) < _LEAST * volumes).any():
            moves[np.unique(tetrahedra[bad])] *= 0.5
        vertices = vertices + moves
    return vertices


def share_filled(
    points: Floats, triangles: AnyInts, inside: float, volume: float, tolerance: float
) -> float:
    """Return how much of a cage is what the object's surface encloses.

    Parameters
    ----------
    points : (N, 3) float64
        In m.
    triangles : (F, 3) int
        A closed surface's; none of an open one.
    inside : float
        Volume of the tetrahedra that were made inside the surface, in m³.
    volume : float
        Of the cage, in m³.
    tolerance : float
        How far those may be from the surface, in m.

    Returns
    -------
    float
        1 where both are as large.

    Notes
    -----
    The divergence theorem knows the volume, but counts twice where a surface crosses itself:
    there it is further from the tetrahedra's than their tolerance explains, and theirs is taken.
    """
    if len(triangles):
        a, b, c = (points - points[triangles[0, 0]])[triangles].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        enclosed = abs(float(np.einsum("ij,ij->", a, normals))) / 6.0
        area = float(np.linalg.norm(normals, axis=1).sum()) / 2.0
        if abs(enclosed - inside) <= tolerance * area:
            inside = enclosed
    return inside / volume
