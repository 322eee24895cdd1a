"""A cubic spline on each tetrahedron, split into twelve pieces, that is smooth across faces.

A. J. Worsey, G. Farin, "An n-dimensional Clough-Tocher interpolant", Constructive Approximation 3
(1987); notation as in M.-J. Lai, L. L. Schumaker, "Spline Functions on Triangulations", section
18.4. A tetrahedron is split at its incentre, and each face at the point where the line to the
neighbour's incentre meets it. On these twelve pieces a cubic is defined by values and gradients at
the vertices, and the gradient across the middle of each edge. The latter is the mean of the
gradients at both ends, so that quadratic functions are reproduced.

Everything is linear in twenty numbers of each tetrahedron: the values f_j, and g_jk, the derivative
at vertex j towards vertex k (g_jj is 0). In the names of coefficients, j and k are vertices, s is
the point that splits a face, and c is the incentre.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.embedding.triangles import FACES
from spacemap_vtk.ndarrays import AnyInts, Floats

#: Number of values per tetrahedron: f_0 ... f_3, g_00, g_01 ... g_33.
NUMBERS = 20
#: Mean number of points in a piece from which they are evaluated together.
_FEW = 8
_PAIRS = [(j, k) for j in range(4) for k in range(4) if j < k]


def split_points(vertices: Floats, tetrahedra: AnyInts) -> tuple[Floats, Floats]:
    """Compute the points at which tetrahedra and their faces are split."""
    corners = vertices[tetrahedra]
    sides = corners[:, FACES]  # tetrahedron, face, corner, axis
    normals = np.cross(sides[:, :, 1] - sides[:, :, 0], sides[:, :, 2] - sides[:, :, 0])
    areas = np.linalg.norm(normals, axis=2)
    centres = areas / areas.sum(axis=1, keepdims=True)
    middle = np.einsum("tj,tja->ta", centres, corners)
    normals /= areas[:, :, None]
    reach = np.einsum("tfa,tfa->tf", normals, sides[:, :, 0] - middle[:, None])
    place = middle[:, None] + reach[:, :, None] * normals  # feet
    # Faces that two tetrahedra share.
    numbers = np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(numbers.T)
    same = (numbers[order[1:]] == numbers[order[:-1]]).all(axis=1)
    one, two = order[:-1][same], order[1:][same]
    size = np.abs(reach).ravel()
    share = (size[one] / (size[one] + size[two]))[:, None]
    on_line = (1.0 - share) * middle[one // 4] + share * middle[two // 4]
    place.reshape(-1, 3)[one] = place.reshape(-1, 3)[two] = on_line
    # Barycentric coordinates in the face: areas of the three parts.
    faces = np.zeros((len(tetrahedra), 4, 4))
    for i in range(4):
        for a in range(3):
            b, c = sides[:, i, (a + 1) % 3], sides[:, i, (a + 2) % 3]
            part = np.cross(b - place[:, i], c - place[:, i])
            ratio = np.einsum("ta,ta->t", part, normals[:, i]) / areas[:, i]
            faces[:, i, FACES[i, a]] = ratio
    return centres, faces


class CoefficientIndex:
    """Positions of the coefficients in the table of a tetrahedron."""

    def __init__(self) -> None:
        self.positions: dict[tuple[Any, ...], int] = {}

    def __call__(self, *key: Any) -> int:
        """Return the position of a coefficient; a new name gets the next one."""
        return self.positions.setdefault(key, len(self.positions))


def _coefficient_name(i: int, parts: list[Any]) -> tuple[Any, ...]:
    """Name a coefficient of a piece of face i by its three parts, sorted."""
    parts = sorted(parts, key=str)
    # Coefficients without the split point of the face belong to several pieces.
    return (*parts, i) if "s" in parts else tuple(parts)


_EXPONENTS = [
    (a, b, j, 3 - a - b - j) for a in range(4) for b in range(4 - a) for j in range(4 - a - b)
]
_FACTORS = np.array([6.0 / np.prod([(1, 1, 2, 6)[e] for e in powers]) for powers in _EXPONENTS])


def _number_coefficients() -> tuple[CoefficientIndex, NDArray[np.intp]]:
    """Build names, and the twenty positions of each piece: that of face i without corner l."""
    names, table = CoefficientIndex(), np.zeros((4, 4, 20), dtype=np.intp)
    for i in range(4):
        for corner in range(4):
            if i == corner:
                continue
            j, k = (v for v in range(4) if v not in (i, corner))
            for at, (a, b, m, n) in enumerate(_EXPONENTS):
                parts = ["c"] * a + ["s"] * b + [j] * m + [k] * n
                table[i, corner, at] = names(*_coefficient_name(i, parts))
    return names, table


_INDEX, _TABLE = _number_coefficients()


def control_factors(corners: Floats, centres: Floats, faces: Floats) -> Floats:
    """Compute the control points of all pieces, as factors of the twenty numbers."""
    count = len(corners)
    result = np.zeros((count, len(_INDEX.positions), NUMBERS))

    def put(i: int, parts: list[Any], value: Floats) -> None:
        result[:, _INDEX.positions[_coefficient_name(i, parts)]] = value

    def get(i: int, parts: list[Any]) -> Floats:
        return result[:, _INDEX.positions[_coefficient_name(i, parts)]]

    unit = np.eye(NUMBERS)

    def slope(j: int, k: int) -> Floats:
        return unit[4 + 4 * j + k] if j != k else np.zeros(NUMBERS)

    def toward(j: int, at: Floats) -> Floats:
        """Compute the derivative at vertex j towards a point in barycentric coordinates."""
        total = np.zeros((count, NUMBERS))
        total[:, 4 + 4 * j : 8 + 4 * j] = at
        total[:, 4 + 5 * j] = 0.0
        return total

    def average(parts: dict[int, Floats], at: Floats) -> Floats:
        """Average coefficients with barycentric weights."""
        total = np.zeros((count, NUMBERS))
        for vertex, value in parts.items():
            total += at[:, [vertex]] * value
        return total

    for j in range(4):
        put(0, [j, j, j], unit[j])
        for k in range(4):
            if j != k:
                put(0, [j, j, k], unit[j] + slope(j, k) / 3.0)
    across = {}  # for each edge: the derivative at its middle, as a function of direction
    for j, k in _PAIRS:
        edge = corners[:, k] - corners[:, j]
        per = edge / np.einsum("ta,ta->t", edge, edge)[:, None]
        along = 1.5 * (unit[k] - unit[j]) - 0.25 * (slope(j, k) - slope(k, j))
        across[j, k] = per, along - 0.5 * (slope(j, k) - slope(k, j))

    def edge_derivative(j: int, k: int, begin: Floats, end: Floats) -> Floats:
        """Compute the derivative at the middle of edge jk in the direction between two points."""
        j, k = min(j, k), max(j, k)
        mean = 0.5 * (toward(j, end) - toward(j, begin) + toward(k, end) - toward(k, begin))
        per, surplus = across[j, k]
        way = np.einsum("tv,tva->ta", end - begin, corners)
        return mean + np.einsum("ta,ta->t", way, per)[:, None] * surplus

    for i in range(4):
        on_face = [v for v in range(4) if v != i]
        split = faces[:, i]
        for j in on_face:
            put(i, ["s", j, j], unit[j] + toward(j, split) / 3.0)
        across_face = {}
        for a in range(3):
            j, k = on_face[a], on_face[(a + 1) % 3]
            middle = np.zeros((count, 4))
            middle[:, [j, k]] = 0.5
            edge = get(0, [j, j, j]) + get(0, [k, k, k])
            edge = edge + 3.0 * (get(0, [j, j, k]) + get(0, [j, k, k]))
            inward = edge_derivative(j, k, middle, split)
            both = get(i, ["s", j, j]) + get(i, ["s", k, k])
            put(i, ["s", j, k], 2.0 / 3.0 * inward + 0.25 * edge - 0.5 * both)
            across_face[j, k] = across_face[k, j] = edge_derivative(j, k, split, centres)
        for j in on_face:
            put(i, ["s", "s", j], average({m: get(i, ["s", j, m]) for m in on_face}, split))
        put(i, ["s"] * 3, average({m: get(i, ["s", "s", m]) for m in on_face}, split))
        # The derivative towards the incentre is one quadratic on the whole face.
        quadratic = {(j, j): toward(j, centres) - toward(j, split) for j in on_face}
        for (j, k), there in across_face.items():
            quadratic[j, k] = 2.0 * there - 0.5 * (quadratic[j, j] + quadratic[k, k])
        once = {j: average({m: quadratic[j, m] for m in on_face}, split) for j in on_face}
        twice = average(once, split)
        for a, j in enumerate(on_face):
            for k in on_face[a:]:
                put(i, ["c", j, k], get(i, ["s", j, k]) + quadratic[j, k] / 3.0)
            put(i, ["c", "s", j], get(i, ["s", "s", j]) + once[j] / 3.0)
        put(i, ["c", "s", "s"], get(i, ["s", "s", "s"]) + twice / 3.0)
    for j in range(4):
        # Smoothness across the plane of the incentre and edge jk, between faces i and m.
        k, i, m = (v for v in range(4) if v != j)
        to_c = faces[:, m, i] / centres[:, i]
        to_s = -to_c * centres[:, m] / faces[:, i, m]
        to_j = faces[:, m, j] - to_c * centres[:, j] - to_s * faces[:, i, j]
        to_k = faces[:, m, k] - to_c * centres[:, k] - to_s * faces[:, i, k]
        value = get(m, ["c", "s", j]) - to_s[:, None] * get(i, ["c", "s", j])
        value = value - to_j[:, None] * get(0, ["c", j, j]) - to_k[:, None] * get(0, ["c", j, k])
        put(0, ["c", "c", j], value / to_c[:, None])
    affine = {j: get(0, ["c", "c", j]) for j in range(4)}
    for i in range(4):
        put(i, ["c", "c", "s"], average(affine, faces[:, i]))
    put(0, ["c"] * 3, average(affine, centres))
    return result


def point_factors(
    weights: Floats,
    which: AnyInts,
    table: Floats,
    centres: Floats,
    faces: Floats,
    ways: Floats | None = None,
) -> Floats:
    """Compute the factors of the twenty numbers at points, and for derivatives there."""
    everyone = np.arange(len(weights))
    centre = centres[which]
    ratio = weights / centre
    face = ratio.argmin(axis=1)
    split = faces[which, face]
    rest = weights - ratio[everyone, face][:, None] * centre
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = rest / split
    ratio[everyone, face] = np.inf
    corner = ratio.argmin(axis=1)
    others = _OTHERS[face, corner]

    def to_local(coordinates: Floats) -> Floats:
        """Convert to coordinates in the piece: of the incentre, split point and two corners."""
        inner = coordinates[everyone, face] / centre[everyone, face]
        left = coordinates - inner[:, None] * centre
        side = left[everyone, corner] / split[everyone, corner]
        left -= side[:, None] * split
        return np.stack((inner, side, left[everyone, others[:, 0]], left[everyone, others[:, 1]]))

    place = to_local(weights)
    powers = np.stack((np.ones_like(place), place, place**2, place**3))  # exponent, part, point
    along = [to_local(way) for way in (() if ways is None else ways)]
    terms = np.zeros((len(weights), 1 + len(along), 20))
    for at, (factor, exponents) in enumerate(zip(_FACTORS, _EXPONENTS, strict=True)):
        parts = [powers[e, part] for part, e in enumerate(exponents)]
        terms[:, 0, at] = factor * parts[0] * parts[1] * parts[2] * parts[3]
        for part, e in enumerate(exponents if along else ()):
            if e:
                slope = factor * e * powers[e - 1, part]
                for other in range(4):
                    if other != part:
                        slope = slope * parts[other]
                for number, way in enumerate(along, 1):
                    terms[:, number, at] += slope * way[part]
    piece = (which * 4 + face) * 4 + corner
    order = np.argsort(piece, kind="stable")
    first = np.flatnonzero(np.diff(piece[order], prepend=-1))
    if len(first) > len(weights) / _FEW:
        chosen = table[which[:, None], _TABLE[face, corner]]  # (n, 20, 20)
        return np.matmul(terms, chosen).transpose(1, 0, 2)
    # With many points in each piece, evaluate piece by piece: a lookup per point would be slowest.
    result = np.empty((1 + len(along), len(weights), NUMBERS))
    for begin, end in pairwise([*first.tolist(), len(order)]):
        rows = order[begin:end]
        one = rows[0]
        points = table[which[one], _TABLE[face[one], corner[one]]]
        result[:, rows] = (terms[rows] @ points).transpose(1, 0, 2)
    return result


_OTHERS = np.array(
    [[([v for v in range(4) if v not in (i, m)] * 2)[:2] for m in range(4)] for i in range(4)]
)
