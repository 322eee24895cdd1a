"""Split hexahedra, wedges and pyramids into conforming tetrahedra.

Every quadrilateral face is cut from its corner with the lowest index, so that both cells that share
it cut it in the same way (J. Dompierre, P. Labbé, M.-G. Vallet, R. Camarero, "How to
Subdivide Pyramids, Prisms, and Hexahedra into Tetrahedra", 8th International Meshing Roundtable,
1999). No point is added.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.ndarrays import AnyInts, Floats

#: A tetrahedron is flat if its volume is less than this share of its longest edge cubed.
FLAT = 1e-12

# Permutations of a wedge that bring each corner to the first position.
_WEDGES = np.array(
    [
        *([0, 1, 2, 3, 4, 5], [1, 2, 0, 4, 5, 3], [2, 0, 1, 5, 3, 4]),
        *([3, 5, 4, 0, 2, 1], [4, 3, 5, 1, 0, 2], [5, 4, 3, 2, 1, 0]),
    ]
)
# VTK's index of corner x + 2y + 4z of a hexahedron. The permutation is its own inverse.
_CORNERS = np.array([0, 1, 3, 2, 4, 5, 7, 6])


def _split_pyramids(cells: AnyInts) -> AnyInts:
    """Split each pyramid into two tetrahedra."""
    return join_apexes(cells[:, 4:5], cut_quadrilaterals(cells[:, :4]))


def _split_wedges(cells: AnyInts) -> AnyInts:
    """Split each wedge into three tetrahedra."""
    turned = np.take_along_axis(cells, _WEDGES[cells.argmin(axis=1)], axis=1)
    # A pyramid on the face opposite the lowest corner, and the remaining tetrahedron.
    base = np.concatenate((turned[:, [1, 2, 5, 4]], turned[:, :1]), axis=1)
    rest = turned[:, [0, 4, 5, 3]]
    both = np.concatenate((_split_pyramids(base).reshape(-1, 2, 4), rest[:, None]), axis=1)
    return both.reshape(-1, 4)


def _split_hexahedra(cells: AnyInts) -> AnyInts:
    """Split each hexahedron into six tetrahedra."""
    first = _CORNERS[cells.argmin(axis=1)]
    # Mirror the cell so that the lowest corner comes first.
    order = _CORNERS[np.arange(8) ^ first[:, None]]  # position x + 2y + 4z -> VTK's
    turned = np.take_along_axis(cells, order, axis=1)  # at position x + 2y + 4z
    faces = turned[:, [[1, 3, 7, 5], [2, 3, 7, 6], [4, 5, 7, 6]]]
    triangles = cut_quadrilaterals(faces.reshape(-1, 4)).reshape(-1, 6, 3)
    return join_apexes(turned[:, :1], triangles)


#: Function for each number of corners: it splits cells, (n, corners) in VTK's order (the apex of a
#: pyramid last), into tetrahedra, (m, 4), of any orientation.
SPLITS = {5: _split_pyramids, 6: _split_wedges, 8: _split_hexahedra}


def join_apexes(apex: AnyInts, triangles: AnyInts) -> AnyInts:
    """Join apex points (n, 1) with triangles (n, m, 3) to tetrahedra."""
    apexes = np.broadcast_to(apex[:, None], (*triangles.shape[:2], 1))
    return np.concatenate((triangles, apexes), axis=2).reshape(-1, 4)


def cut_quadrilaterals(quads: AnyInts) -> AnyInts:
    """Cut each quadrilateral into two triangles, from its lowest index."""
    even = quads.argmin(axis=1) % 2 == 0
    one = quads[:, [[0, 1, 2], [0, 2, 3]]]
    two = quads[:, [[1, 2, 3], [1, 3, 0]]]
    return np.where(even[:, None, None], one, two)


def tetrahedron_volumes(vertices: Floats, tetrahedra: AnyInts) -> Floats:
    """Compute the signed volumes of tetrahedra.

    Parameters
    ----------
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        Vertex indices.

    Returns
    -------
    (T,) float64
        Volumes in m³, negative for inverted tetrahedra.
    """
    a, b, c = (vertices[tetrahedra[:, i]] - vertices[tetrahedra[:, 0]] for i in (1, 2, 3))
    return np.einsum("ij,ij->i", np.cross(a, b), c) / 6.0


def repair_tetrahedra(vertices: Floats, tetrahedra: AnyInts) -> tuple[AnyInts, int, int]:
    """Reverse inverted tetrahedra and drop flat ones.

    Parameters
    ----------
    vertices : (V, 3) float64
        In m.
    tetrahedra : (T, 4) int
        In any orientation.

    Returns
    -------
    tetrahedra : (T', 4) int
        Tetrahedra of positive volume.
    inverted, flat : int
        Number of reversed and of dropped tetrahedra.
    """
    corners = vertices[tetrahedra]
    a, b, c = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
    volume = 6.0 * tetrahedron_volumes(vertices, tetrahedra)
    longest = np.max([np.einsum("ij,ij->i", d, d) for d in (a, b, c, b - a, c - b, a - c)], axis=0)
    good = np.abs(volume) > FLAT * longest**1.5
    result = tetrahedra[good]
    inverted = volume[good] < 0
    result[inverted] = result[inverted][:, [0, 2, 1, 3]]
    return result, int(inverted.sum()), int(np.count_nonzero(~good))


def count_parts(tetrahedra: AnyInts) -> tuple[list[int], int]:
    """Count the connected parts of a mesh, by faces and by any contact.

    Parameters
    ----------
    tetrahedra : (T, 4) int
        Vertex indices.

    Returns
    -------
    sizes : list of int
        Number of tetrahedra in each face-connected part, the largest first.
    loose : int
        Number of parts that are connected by faces, edges or vertices. If it is less than
        ``len(sizes)``, some parts are connected only by an edge or a vertex, like a hinge.
    """
    from scipy import sparse  # imported here: it takes a tenth of a second

    faces = np.sort(tetrahedra[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]], axis=2)
    shared = np.unique(faces.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 4)
    labels = []
    for corners in (shared, tetrahedra):
        rows = np.repeat(np.arange(len(corners)), 4)
        has = sparse.csr_matrix((np.ones(4 * len(corners)), (rows, corners.ravel())))
        labels.append(sparse.csgraph.connected_components(has @ has.T, directed=False)[1])
    by_faces, by_vertices = labels
    return np.sort(np.bincount(by_faces))[::-1].tolist(), int(by_vertices.max()) + 1


def count_bodies(points: Floats, triangles: AnyInts) -> int:
    """Count the bodies that a closed surface encloses.

    Parameters
    ----------
    points : (N, 3) float64
        In m.
    triangles : (F, 3) int
        Consistently oriented. Surfaces of inner cavities do not count.

    Returns
    -------
    int
        Number of bodies.
    """
    from scipy import sparse

    edges = triangles.ravel(), np.roll(triangles, 1, axis=1).ravel()
    graph = sparse.csr_matrix((np.ones(triangles.size), edges), shape=(len(points),) * 2)
    count, body = sparse.csgraph.connected_components(graph, directed=False)
    a, b, c = (points - points.mean(axis=0))[triangles].transpose(1, 0, 2)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    whole = np.bincount(body[triangles[:, 0]], volumes, count)
    return int(np.count_nonzero(whole * volumes.sum() > 0.0))
