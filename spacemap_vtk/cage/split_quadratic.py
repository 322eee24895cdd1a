"""Split quadratic cells into linear tetrahedra at the nodes on their edges.

Each corner is cut off at the midpoints of its edges. The remaining body, whose corners are the
midpoints, is filled from the midpoint with the lowest index. So each triangular face is cut into
four triangles, and each quadrilateral into four and a middle quadrilateral that is cut from its
lowest index: both cells that share a face cut it in the same way. No point is added, and
displacements of midpoints are used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spacemap_vtk.cage.split import cut_quadrilaterals, join_apexes
from spacemap_vtk.ndarrays import AnyInts


@dataclass(frozen=True)
class CellKind:
    """A kind of quadratic cell, in VTK's order of nodes."""

    #: Number of corners and edge midpoints; further nodes are not used.
    nodes: int
    #: Corners of each edge; the midpoint of the first edge follows the last corner.
    edges: tuple[tuple[int, int], ...]
    #: Corners of each face, in circular order.
    faces: tuple[tuple[int, ...], ...]


TETRAHEDRON = CellKind(
    10,
    ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    ((0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
)
PYRAMID = CellKind(
    13,
    ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
)
WEDGE = CellKind(
    15,
    ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
)
HEXAHEDRON = CellKind(
    20,
    (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
    ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
)
# VTK's index of node x + 3y + 9z of a triquadratic hexahedron.
_NODES = [0, 8, 1, 11, 24, 9, 3, 10, 2, 16, 22, 17, 20, 26, 21, 19, 23, 18]
_NODES += [4, 12, 5, 15, 25, 13, 7, 14, 6]
#: The eight linear hexahedra of a triquadratic one.
EIGHT = np.array(
    [
        [_NODES[corner + x + 3 * y + 9 * z] for corner in (0, 1, 4, 3, 9, 10, 13, 12)]
        for z in (0, 1)
        for y in (0, 1)
        for x in (0, 1)
    ]
)


def split_quadratic(cells: AnyInts, kind: CellKind) -> AnyInts:
    """Split quadratic cells into linear tetrahedra.

    Parameters
    ----------
    cells : (n, at least kind.nodes) int
        In VTK's order.
    kind : CellKind
        Their kind.

    Returns
    -------
    (m, 4) int
        In any orientation.
    """
    corners = kind.nodes - len(kind.edges)
    middle = {frozenset(edge): corners + i for i, edge in enumerate(kind.edges)}
    # Faces of the body without corners: one for each face and one for each corner of the cell.
    left = [
        [middle[frozenset(pair)] for pair in zip(face, (*face[1:], face[0]), strict=True)]
        for face in kind.faces
    ]
    parts = []
    for corner in range(corners):
        cut = _midpoint_ring(corner, kind, middle)
        left.append(cut)
        if len(cut) == 3:
            parts.append(cells[:, [corner, *cut]])
        else:
            parts.append(join_apexes(cells[:, [corner]], cut_quadrilaterals(cells[:, cut])))
    lowest = cells[:, corners : kind.nodes].argmin(axis=1) + corners
    for apex in np.unique(lowest):
        chosen = cells[lowest == apex]
        for face in left:
            if apex in face:
                continue
            if len(face) == 3:
                parts.append(chosen[:, [apex, *face]])
            else:
                parts.append(join_apexes(chosen[:, [apex]], cut_quadrilaterals(chosen[:, face])))
    return np.concatenate(parts)


def _midpoint_ring(corner: int, kind: CellKind, middle: dict[Any, int]) -> list[int]:
    """Return the midpoints of the edges at a corner, in circular order."""
    ring: list[int] = []
    pairs = []
    for face in kind.faces:
        if corner in face:
            at = face.index(corner)
            beside = face[at - 1], face[(at + 1) % len(face)]
            pairs.append({middle[frozenset((corner, other))] for other in beside})
    ring = [min(pairs[0])]
    while pairs:
        pair = next(pair for pair in pairs if ring[-1] in pair)
        pairs.remove(pair)
        ring.append((pair - {ring[-1]}).pop())
    return ring[:-1]
