"""Carve a lattice: find the hexahedra that an object touches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spacemap_vtk import cancel
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: Pairs of a triangle and a hexahedron that are tested in one block.
_PAIRS = 2**17
#: Tolerance as a share of an edge: a point on a face belongs to both hexahedra.
_SLACK = 1e-9


def find_touched_cells(
    points: Floats, triangles: Ints, origin: Floats, spacing: Floats, divisions: Sequence[int]
) -> Bools:
    """Find the hexahedra that contain a point or are crossed by a triangle.

    Parameters
    ----------
    points : (N, 3) float64
        In m, inside the box.
    triangles : (F, 3) int64
        Point indices; a segment is given as a triangle that repeats its second end.
    origin, spacing : (3,) float64
        Lowest corner of the box, and edge lengths of a hexahedron, in m.
    divisions : sequence of 3 int
        Number of hexahedra along x, y and z.

    Returns
    -------
    (nz, ny, nx) bool
        True where a hexahedron is touched.

    Notes
    -----
    Triangle and box are tested by separating axes (T. Akenine-Möller, "Fast 3D Triangle-Box
    Overlap Testing", J. Graphics Tools 6, 2001). The test is exact for triangles of any size.
    """
    counts = np.asarray(divisions, dtype=np.int64)
    result = np.zeros(counts[::-1], dtype=np.bool_)
    places = (points - origin) / spacing
    for offset in (-_SLACK, _SLACK):
        x, y, z = np.clip(np.floor(places + offset).astype(np.int64), 0, counts - 1).T
        result[z, y, x] = True
    corners = places[triangles]  # (F, 3, 3)
    low = np.clip(np.floor(corners.min(axis=1) - _SLACK).astype(np.int64), 0, counts - 1)
    high = np.clip(np.floor(corners.max(axis=1) + _SLACK).astype(np.int64), 0, counts - 1)
    extent = high - low + 1
    sizes = extent.prod(axis=1)
    # Triangles inside one hexahedron are covered by their corner points.
    large = np.flatnonzero(sizes > 1)
    ends = np.cumsum(sizes[large])
    begin = 0
    while begin < len(large):
        cancel.check()
        done = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, done + _PAIRS, side="right")))
        which = large[begin:end]
        triangle = np.repeat(which, sizes[which])
        within = np.arange(len(triangle)) - np.repeat(
            np.cumsum(sizes[which]) - sizes[which], sizes[which]
        )
        within, x = np.divmod(within, extent[triangle, 0])
        z, y = np.divmod(within, extent[triangle, 1])
        cell = low[triangle] + np.stack((x, y, z), axis=1)
        open_ = ~result[cell[:, 2], cell[:, 1], cell[:, 0]]
        cell, triangle = cell[open_], triangle[open_]
        cell = cell[_overlaps_unit_box(corners[triangle] - (cell + 0.5)[:, None])]
        result[cell[:, 2], cell[:, 1], cell[:, 0]] = True
        begin = end
    return result


def _overlaps_unit_box(corners: Floats) -> Bools:
    """Test whether triangles (n, 3, 3) overlap the unit box centred at the origin."""
    # The axes of the box need no test: the bounding boxes overlap already.
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    axes = [normal]
    for edge in edges.transpose(1, 0, 2):
        axes += [np.cross(unit, edge) for unit in np.eye(3)]
    result = np.ones(len(corners), dtype=np.bool_)
    for axis in axes:
        along = np.einsum("nij,nj->ni", corners, axis)
        reach = (0.5 + _SLACK) * np.abs(axis).sum(axis=1)
        result &= (along.min(axis=1) <= reach) & (along.max(axis=1) >= -reach)
    return result


def grow_cells(cells: Bools, margin: int, fill: bool) -> Bools:
    """Add margin layers and enclosed hexahedra to a carved cage.

    Parameters
    ----------
    cells : (nz, ny, nx) bool
        Hexahedra that the object touches.
    margin : int
        Layers to add around them, also across edges and corners.
    fill : bool
        Also add hexahedra that are completely enclosed.

    Returns
    -------
    (nz, ny, nx) bool
        Hexahedra of the cage, in the shape of `cells`.
    """
    from scipy import ndimage  # imported here: it takes a tenth of a second

    if margin:
        cells = ndimage.binary_dilation(cells, np.ones((3, 3, 3)), iterations=margin)
    return ndimage.binary_fill_holes(cells) if fill else cells


def count_pieces(cells: Bools) -> tuple[list[int], int]:
    """Count the connected pieces of a cage, by faces and by any contact.

    Parameters
    ----------
    cells : (nz, ny, nx) bool
        The cage.

    Returns
    -------
    sizes : list of int
        Number of hexahedra in each face-connected piece, the largest first.
    loose : int
        Number of pieces that are connected by faces, edges or corners. If it is less than
        ``len(sizes)``, some pieces are connected only by an edge or a corner, like a hinge.
    """
    from scipy import ndimage  # imported here: it takes a tenth of a second

    labels, _ = ndimage.label(cells)
    sizes = np.sort(np.bincount(labels.ravel())[1:])[::-1]
    _, loose = ndimage.label(cells, np.ones((3, 3, 3)))
    return sizes.tolist(), int(loose)
