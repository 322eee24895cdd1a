"""Cells of a sheet that pass through each other."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.ndarrays import Floats

#: Rounding error of the volume between a triangle and a point, over a cube as large as cells.
_ROUNDING = 1e-10


def count_crossed_cells(points: Floats, surface: MidSurface) -> int:
    """Count the cells of a sheet through which an edge of another cell passes.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    surface : MidSurface
        Mid-surface of the sheet; each quadrilateral is taken as two triangles.

    Returns
    -------
    int
        Number of quadrilaterals.
    """
    from scipy.spatial import cKDTree  # imported here: it takes a tenth of a second

    middle, quads = surface.to_nodes(points)[: len(surface.pairs)], surface.quads
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    corners, ends = middle[faces], middle[edges]
    centers, halves = corners.mean(axis=1), ends.mean(axis=1)
    # What meets is no farther apart than the largest triangle and the longest edge reach.
    reach = np.linalg.norm(corners - centers[:, None], axis=2).max()
    reach += np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max() / 2
    near = cKDTree(halves).query_ball_tree(cKDTree(centers), reach)
    edge = np.repeat(np.arange(len(edges)), [len(each) for each in near])
    face = np.concatenate([np.asarray(each, dtype=np.int64) for each in near])
    apart = (edges[edge][:, :, None] != faces[face][:, None]).all(axis=(1, 2))
    edge, face = edge[apart], face[apart]
    (a, b), (p, q, r) = ends[edge].swapaxes(0, 1), corners[face].swapaxes(0, 1)

    def volume(first: Floats, second: Floats, third: Floats) -> Floats:
        return np.asarray(np.einsum("ni,ni->n", np.cross(first, second), third))

    # Both ends lie on different sides of the triangle, and the edge goes the same way round all
    # three of its sides.
    above, below = (volume(q - p, r - p, end - p) for end in (a, b))
    along = b - a
    turns = np.stack([volume(x - a, y - a, along) for x, y in ((p, q), (q, r), (r, p))])
    within = (turns > 0).all(axis=0) | (turns < 0).all(axis=0)
    # In a level sheet only rounding decides on which side of a triangle an end lies.
    clear = np.minimum(abs(above), abs(below)) > _ROUNDING * reach**3
    crossed = face[(above * below < 0) & within & clear]
    return len(np.unique(crossed % len(quads)))
