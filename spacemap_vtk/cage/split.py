"""Cells of any common kind, split into tetrahedra that conform.

Every quadrilateral face is cut from its corner with the lowest number, so that both neighbours cut
it the same way, whatever they are (J. Dompierre, P. Labbé, M.-G. Vallet, R. Camarero, "How to
Subdivide Pyramids, Prisms, and Hexahedra into Tetrahedra", 8th International Meshing Roundtable,
1999). No point is added.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.ndarrays import AnyInts, Floats

#: A tetrahedron of less volume than this part of its longest edge cubed is flat.
FLAT = 1e-12

# Positions of a wedge that bring each corner to the first place.
_WEDGES = np.array(
    [
        *([0, 1, 2, 3, 4, 5], [1, 2, 0, 4, 5, 3], [2, 0, 1, 5, 3, 4]),
        *([3, 5, 4, 0, 2, 1], [4, 3, 5, 1, 0, 2], [5, 4, 3, 2, 1, 0]),
    ]
)
# VTK's numbers of the corners x + 2y + 4z of a hexahedron; this is its own inverse.
_CORNERS = np.array([0, 1, 3, 2, 4, 5, 7, 6])


def _pyramids(cells: AnyInts) -> AnyInts:
    """Return two tetrahedra for each pyramid."""
    return joined(cells[:, 4:5], cut_quadrilaterals(cells[:, :4]))


def _wedges(cells: AnyInts) -> AnyInts:
    """Return three tetrahedra for each wedge."""
    turned = np.take_along_axis(cells, _WEDGES[cells.argmin(axis=1)], axis=1)
    # a pyramid on the face opposite of the lowest corner, and the rest
    base = np.concatenate((turned[:, [1, 2, 5, 4]], turned[:, :1]), axis=1)
    rest = turned[:, [0, 4, 5, 3]]
    both = np.concatenate((_pyramids(base).reshape(-1, 2, 4), rest[:, None]), axis=1)
    return both.reshape(-1, 4)


def _hexahedra(cells: AnyInts) -> AnyInts:
    """Return six tetrahedra for each hexahedron."""
    first = _CORNERS[cells.argmin(axis=1)]
    # mirrored so that the lowest corner comes first
    order = _CORNERS[np.arange(8) ^ first[:, None]]  # binary place -> VTK's place
    turned = np.take_along_axis(cells, order, axis=1)  # in binary order
    faces = turned[:, [[1, 3, 7, 5], [2, 3, 7, 6], [4, 5, 7, 6]]]
    triangles = cut_quadrilaterals(faces.reshape(-1, 4)).reshape(-1, 6, 3)
    return joined(turned[:, :1], triangles)


#: What splits cells of so many corners, (n, corners) in VTK's order (a pyramid's apex last), into
#: tetrahedra, (m, 4) in any orientation.
SPLITS = {5: _pyramids, 6: _wedges, 8: _hexahedra}


def joined(apex: AnyInts, triangles: AnyInts) -> AnyInts:
    """Return the tetrahedra of (n, 1) points and (n, m, 3) triangles."""
    apexes = np.broadcast_to(apex[:, None], (*triangles.shape[:2], 1))
    return np.concatenate((triangles, apexes), axis=2).reshape(-1, 4)


def cut_quadrilaterals(quads: AnyInts) -> AnyInts:
    """Return two triangles for each quadrilateral, cut from its lowest number."""
    even = quads.argmin(axis=1) % 2 == 0
    one = quads[:, [[0, 1, 2], [0, 2, 3]]]
    two = quads[:, [[1, 2, 3], [1, 3, 0]]]
    return np.where(even[:, None, None], one, two)


def volumes_of(vertices: Floats, tetrahedra: AnyInts) -> Floats:
    """Return the volumes of tetrahedra.

    Parameters
    ----------
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        Vertex numbers.

    Returns
    -------
    (T,) float64
        In m³; negative of inverted ones.
    """
    a, b, c = (vertices[tetrahedra[:, i]] - vertices[tetrahedra[:, 0]] for i in (1, 2, 3))
    return np.einsum("ij,ij->i", np.cross(a, b), c) / 6.0


def mended(vertices: Floats, tetrahedra: AnyInts) -> tuple[AnyInts, int, int]:
    """Return tetrahedra that all have a positive volume.

    Parameters
    ----------
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        In any orientation.

    Returns
    -------
    tetrahedra : (T', 4) int
        Inverted ones turned, flat ones left out.
    inverted, flat : int
        How many those were.
    """
    corners = vertices[tetrahedra]
    a, b, c = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
    volume = 6.0 * volumes_of(vertices, tetrahedra)
    longest = np.max([np.einsum("ij,ij->i", d, d) for d in (a, b, c, b - a, c - b, a - c)], axis=0)
    good = np.abs(volume) > FLAT * longest**1.5
    result = tetrahedra[good]
    inverted = volume[good] < 0
    result[inverted] = result[inverted][:, [0, 2, 1, 3]]
    return result, int(inverted.sum()), int(np.count_nonzero(~good))


def parts(tetrahedra: AnyInts) -> tuple[list[int], int]:
    """Return how many tetrahedra each part of a mesh has, and how many parts hang together at all.

    Parameters
    ----------
    tetrahedra : (T, 4) int
        Vertex numbers.

    Returns
    -------
    sizes : list of int
        Tetrahedra of the parts that hang together by faces, the largest first.
    loose : int
        Parts where edges and vertices count too. If there are fewer than sizes, some of those
        hang on hinges.
    """
    from scipy import sparse  # with all it brings: a tenth of a second

    faces = np.sort(tetrahedra[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]], axis=2)
    shared = np.unique(faces.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 4)
    labels = []
    for corners in (shared, tetrahedra):
        rows = np.repeat(np.arange(len(corners)), 4)
        has = sparse.csr_matrix((np.ones(4 * len(corners)), (rows, corners.ravel())))
        labels.append(sparse.csgraph.connected_components(has @ has.T, directed=False)[1])
    by_faces, by_vertices = labels
    return np.sort(np.bincount(by_faces))[::-1].tolist(), int(by_vertices.max()) + 1


def bodies(points: Floats, triangles: AnyInts) -> int:
    """Return how many bodies a closed surface bounds from outside.

    Parameters
    ----------
    points : (N, 3) float64
        In m.
    triangles : (F, 3) int
        All turned the same way. Those round cavities do not count.

    Returns
    -------
    int
        Pieces of the surface that enclose something.
    """
    from scipy import sparse

    edges = triangles.ravel(), np.roll(triangles, 1, axis=1).ravel()
    graph = sparse.csr_matrix((np.ones(triangles.size), edges), shape=(len(points),) * 2)
    count, body = sparse.csgraph.connected_components(graph, directed=False)
    a, b, c = (points - points.mean(axis=0))[triangles].transpose(1, 0, 2)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    whole = np.bincount(body[triangles[:, 0]], volumes, count)
    return int(np.count_nonzero(whole * volumes.sum() > 0.0))
