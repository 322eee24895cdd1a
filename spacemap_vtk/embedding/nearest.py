"""Find the tetrahedron nearest to a point outside a mesh, by exact distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk import cancel
from spacemap_vtk.embedding.frames import Frames
from spacemap_vtk.embedding.triangles import FACES, boundary_faces, nearest_on_triangles
from spacemap_vtk.ndarrays import AnyInts, Floats
from spacemap_vtk.parallel import blocks

_TIE = 1e-12  # distances with a smaller relative difference are equal: the lowest tetrahedron wins
_BLOCK = 2**13  # points in one block
_PAIRS = 2**18  # pairs of a point and a box in one block; it limits the temporary memory
_MORTON_BITS = 16

Boxes = tuple[Floats, Floats]  # lower and upper corners, (3, n)


class NearestTetrahedron:
    """Search for the nearest tetrahedra by exact distance to the boundary of a mesh."""

    # The nearest tetrahedron has the nearest face, which need not be the face with the nearest
    # centre. So a tree of centres gives only a first bound. With it a binary tree of boxes around
    # the faces is descended, all points at once, level by level. Faces whose box is further away
    # than the bound are dropped, and the distance to the remaining ones is computed.

    def __init__(self, vertices: Floats, tetrahedra: AnyInts, frames: Frames) -> None:
        from scipy.spatial import cKDTree  # imported here: it takes a tenth of a second

        usable = np.flatnonzero(frames.usable)
        owner, self._face = boundary_faces(tetrahedra[usable], frames.positive[usable])
        self._owner = usable[owner]
        corners = vertices[tetrahedra[self._owner[:, None], FACES[self._face]]]  # (B, 3, 3)
        self._corners = np.ascontiguousarray(corners.transpose(1, 2, 0))
        middles = corners.mean(axis=1)
        self._middles = cKDTree(middles)
        self._order = _morton_order(middles)
        self._levels = _build_box_tree(self._corners[:, :, self._order])
        self._distance = frames.distance

    def find(self, points: Floats) -> tuple[NDArray[np.int32], Floats, Floats]:
        """Find the nearest tetrahedron, the weights of its nearest point, and the distance."""
        triangle = np.empty(len(points), dtype=np.intp)
        for block in blocks(len(points), _BLOCK):
            cancel.check()
            triangle[block] = self._search(np.ascontiguousarray(points[block].T))
        squared, on_face = nearest_on_triangles(points.T, *self._corners[:, :, triangle])
        weights = np.zeros((len(points), 4))
        np.put_along_axis(weights, FACES[self._face[triangle]], on_face.T, axis=1)
        return self._owner[triangle].astype(np.int32), weights, np.sqrt(squared)

    def _search(self, points: Floats) -> NDArray[np.intp]:
        """Find the nearest triangle of each of (3, n) points."""
        everyone = np.arange(points.shape[1])
        bound = self._measure(points, self._middles.query(points.T)[1])
        worth = bound * (1 + _TIE) + self._distance
        row, node = everyone, np.zeros_like(everyone)
        for low, high in self._levels:
            row, node = np.repeat(row, 2), np.repeat(2 * node, 2)
            node[1::2] += 1
            here = points[:, row]
            gap = np.maximum(np.maximum(low[:, node] - here, here - high[:, node]), 0.0)
            away = np.sqrt(gap[0] ** 2 + gap[1] ** 2 + gap[2] ** 2)
            near = away * (1 - _TIE) <= worth[row]
            row, node = row[near], node[near]
            if len(row) > _PAIRS and len(everyone) > 1:
                half = len(everyone) // 2
                return np.concatenate(
                    (self._search(points[:, :half]), self._search(points[:, half:]))
                )
        triangle = self._order[node]
        distance = self._measure(points[:, row], triangle)
        # Every point still has the triangle that gave its bound, and rows are ascending.
        start = np.searchsorted(row, everyone)
        least = np.minimum.reduceat(distance, start) * (1 + _TIE) + self._distance
        # Triangles are in the order of their tetrahedra.
        equal = np.where(distance <= least[row], triangle, len(self._owner))
        return np.minimum.reduceat(equal, start)

    def _measure(self, points: Floats, triangle: NDArray[np.intp]) -> Floats:
        return np.sqrt(nearest_on_triangles(points, *self._corners[:, :, triangle])[0])


def _morton_order(middles: Floats) -> NDArray[np.intp]:
    """Compute an order in which triangles that are close in space are close in the list."""
    away = middles - middles.min(axis=0)
    size = float(away.max())
    steps = (away * ((2**_MORTON_BITS - 1) / size if size else 0.0)).astype(np.int64)
    code = np.zeros(len(middles), dtype=np.int64)
    for bit in range(_MORTON_BITS):
        for axis in range(3):
            code |= (steps[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _build_box_tree(corners: Floats) -> list[Boxes]:
    """Build the boxes of a binary tree over triangles, without the root, leaves last."""
    # Node i of a level has the nodes 2 i and 2 i + 1 of the next. The last level has one leaf for
    # each triangle, and empty boxes up to a power of two, which are infinitely far away.
    count = corners.shape[2]
    depth = max(1, (count - 1).bit_length())
    low, high = np.full((3, 2**depth), np.inf), np.full((3, 2**depth), -np.inf)
    low[:, :count], high[:, :count] = corners.min(axis=0), corners.max(axis=0)
    levels = [(low, high)]
    for _ in range(depth - 1):
        low, high = levels[-1]
        levels.append(
            (np.minimum(low[:, ::2], low[:, 1::2]), np.maximum(high[:, ::2], high[:, 1::2]))
        )
    return levels[::-1]
