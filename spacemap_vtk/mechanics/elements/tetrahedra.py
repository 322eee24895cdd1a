"""Tetrahedra: checked meshes, and integrals of shape functions in closed form.

Every shape function is a form in the barycentric coordinates L: linear, N_a = L_a, or quadratic,
N_a = Lᵀ Q_a L (made homogeneous by Σ L = 1, which changes no gradient because Σ ∇L = 0). In a
straight-sided tetrahedron ∇L is constant and products of L integrate in closed form,

    ∫ Π L_i^m_i dV = 6 V Π m_i! / (3 + Σ m_i)!        (Zienkiewicz and Taylor, volume 1)

so both matrices of an element are sums over constants.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Ints

#: A tetrahedron is flat if six times its volume is below this share of its longest edge cubed;
#: below it, rounding of the edges alone would decide the volume.
FLAT = 1e-12

#: Largest distance of a midpoint from the middle of its edge, as a share of the edge.
STRAIGHT = 1e-6


def volumes(points: ArrayLike, tetrahedra: ArrayLike) -> Floats:
    """Compute the volume of each tetrahedron, of either orientation."""
    points, tetrahedra = check_mesh(points, tetrahedra)
    return edges_and_volumes(points, tetrahedra)[1]


def check_mesh(points: ArrayLike, tetrahedra: ArrayLike) -> tuple[Floats, Ints]:
    """Check a mesh, and convert it to float64 and int64 arrays."""
    vertices = np.asarray(points, dtype=np.float64)
    cells = np.asarray(tetrahedra)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise GeometryError(f"points have shape {vertices.shape}", allowed="shape (V, 3)")
    if cells.ndim != 2 or cells.shape[1] not in (4, 10) or len(cells) == 0:
        raise GeometryError(
            f"tetrahedra have shape {cells.shape}",
            allowed="shape (T, 4) or (T, 10), at least one tetrahedron",
            cure="Give a mesh of linear or quadratic tetrahedra",
        )
    if not np.issubdtype(cells.dtype, np.integer):
        raise GeometryError(f"tetrahedra are of type {cells.dtype}", allowed="integers")
    _raise_if_any(
        ~np.isfinite(vertices).all(axis=1), "points", "have a coordinate that is not finite"
    )
    outside = ((cells < 0) | (cells >= len(vertices))).any(axis=1)
    _raise_if_any(
        outside, "tetrahedra", f"refer to a vertex that does not exist (there are {len(vertices)})"
    )
    cells = cells.astype(np.int64, copy=False)
    if cells.shape[1] == 10:
        ends = vertices[cells[:, EDGES]]
        off = vertices[cells[:, 4:]] - ends.mean(axis=2)
        length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        _raise_if_any(
            (np.linalg.norm(off, axis=2) > STRAIGHT * length).any(axis=1),
            "tetrahedra",
            "are curved",
            "Move each midpoint to the middle of its edge",
        )
    return vertices, cells


def edges_and_volumes(points: Floats, tetrahedra: Ints) -> tuple[Floats, Floats]:
    """Compute three edges and the volume of each tetrahedron; raise if one is flat."""
    corners = points[tetrahedra[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    six_volumes = np.abs(np.einsum("tk,tk->t", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])))
    six_edges = np.concatenate([edges, edges - edges[:, [1, 2, 0]]], axis=1)
    longest = np.sqrt((six_edges**2).sum(axis=2).max(axis=1))
    # Not "volume <= …", which is false for NaN: edges that overflow or vanish must not pass.
    _raise_if_any(
        ~(six_volumes > FLAT * longest**3),
        "tetrahedra",
        "are flat",
        "Remove them or remesh the cage",
    )
    return edges, six_volumes / 6


def _raise_if_any(
    bad: ArrayLike, things: str, what: str, cure: str = "Repair the mesh of the cage"
) -> None:
    which = np.flatnonzero(bad)
    if len(which):
        raise GeometryError(
            f"{len(which)} of {np.size(bad)} {things} {what}, the first is index {which[0]}",
            cure=cure,
        )


#: Corners next to each midpoint of a quadratic tetrahedron, in the order of VTK, Abaqus and
#: CalculiX.
EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])


class Element(NamedTuple):
    """Reference tetrahedron of n nodes and unit volume."""

    #: (n, n) Integrals ∫ N_a N_b / V.
    products: Floats
    #: (4, 4, n, n) Integrals ∫ ∂N_a/∂L_i ∂N_b/∂L_j / V, axes i, j, a, b.
    slopes: Floats
    #: (n,) Each node's share of a lumped mass: the diagonal of the consistent one, scaled to the
    #: mass. Source: Hinton, Rock and Zienkiewicz, Earthquake Eng. Struct. Dyn. 4 (1976) 245.
    lumps: Floats


def shape_functions(weights: Floats) -> Floats:
    """Evaluate the ten shape functions of quadratic tetrahedra.

    Parameters
    ----------
    weights : ndarray of float64, shape (n, 4)
        Barycentric coordinates; negative ones extrapolate.

    Returns
    -------
    ndarray of float64, shape (n, 10)
        N_a = L_a (2 L_a - 1) at corners, 4 L_a L_b at midpoints; they sum to 1.
    """
    corners = weights * (2 * weights - 1)
    middles = 4 * weights[:, EDGES[:, 0]] * weights[:, EDGES[:, 1]]
    return np.concatenate([corners, middles], axis=1)


def shape_slopes(weights: Floats) -> Floats:
    """Evaluate the derivatives of the ten shape functions by the barycentric coordinates.

    Parameters
    ----------
    weights : ndarray of float64, shape (n, 4)
        Barycentric coordinates.

    Returns
    -------
    ndarray of float64, shape (n, 10, 4)
        ∂N_a/∂L_i; multiplied by the gradients of L they are the gradients of N.
    """
    slopes = np.zeros((len(weights), 10, 4))
    slopes[:, range(4), range(4)] = 4 * weights - 1
    for middle, (a, b) in enumerate(EDGES, start=4):
        slopes[:, middle, a] = 4 * weights[:, b]
        slopes[:, middle, b] = 4 * weights[:, a]
    return slopes


def _integral(*factors: int) -> float:
    """Compute ∫ L_i L_j … / V for the given indices."""
    powers = [factors.count(i) for i in range(4)]
    return 6 * math.prod(map(math.factorial, powers)) / math.factorial(3 + len(factors))


def _linear_element() -> Element:
    products = np.array([[_integral(a, b) for b in range(4)] for a in range(4)])
    eye = np.eye(4)
    return Element(products, np.einsum("ai,bj->ijab", eye, eye), np.full(4, 0.25))


def _quadratic_element() -> Element:
    forms = np.zeros((10, 4, 4))
    for a in range(4):  # 2 L_a² - L_a Σ L
        forms[a, a, a] = 2.0
        forms[a, a, :] -= 0.5
        forms[a, :, a] -= 0.5
    for middle, (a, b) in enumerate(EDGES, start=4):
        forms[middle, a, b] = forms[middle, b, a] = 2.0
    fourth = np.zeros((4,) * 4)
    for index in itertools.product(range(4), repeat=4):
        fourth[index] = _integral(*index)
    products = np.einsum("aij,bkl,ijkl->ab", forms, forms, fourth)
    second = np.array([[_integral(i, j) for j in range(4)] for i in range(4)])
    slopes = 4 * np.einsum("aip,bjq,pq->ijab", forms, forms, second)
    lumps = np.diag(products) / np.trace(products)
    return Element(products, slopes, lumps)


#: Reference tetrahedra by their number of nodes.
ELEMENTS = {4: _linear_element(), 10: _quadratic_element()}


def add_midpoints(vertices: Floats, tetrahedra: Ints) -> tuple[Floats, Ints]:
    """Add a vertex in the middle of each edge, shared by all tetrahedra at that edge.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    tetrahedra : ndarray of int64, shape (T, 4)
        Vertex numbers of linear tetrahedra.

    Returns
    -------
    vertices : ndarray of float64, shape (V + E, 3)
        Given vertices, and the middle of each of the E edges.
    tetrahedra : ndarray of int64, shape (T, 10)
        Corners, then midpoints in the order of VTK_QUADRATIC_TETRA.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> points, cells = add_midpoints(corners, np.array([[0, 1, 2, 3]]))
    >>> points[cells[0, 5]].tolist()
    [0.5, 0.5, 0.0]
    """
    ends = np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1)
    count = len(vertices)
    edge, which = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    middles = (vertices[edge // count] + vertices[edge % count]) / 2
    cells = np.concatenate([tetrahedra, count + which.reshape(-1, len(EDGES))], axis=1)
    return np.concatenate([vertices, middles]), cells
