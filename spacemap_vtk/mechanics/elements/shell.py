"""Shell elements on a cage's vertices: in a one-layer lattice the vertices form pairs.

A pair has a mid-point p = (x⁺ + x⁻)/2 and half a thickness δ = (x⁺ - x⁻)/2; its director is
d = 2 δ/h. All strains on the quadrilaterals of pairs are quadratic in p and δ. No rotation is a
variable, therefore, and nothing is linearised:

    membrane         e_ij = ½ (p,i · p,j - P,i · P,j)
    bending          k_ij = sym(p,i · d,j) - its reference
    transverse shear g_i = p,i · d - its reference, from the middles of the edges
    thickness        t = ½ (d · d - 1), at the vertices, so that curvature does not lock it

The shear is interpolated as in MITC4: Dvorkin and Bathe, Eng. Comput. 1 (1984) 77; Bathe and
Dvorkin, Int. J. Numer. Meth. Eng. 21 (1985) 367.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import SPLIT, TETRAHEDRA_PER_CELL
from spacemap_vtk.mechanics.boundary.supports import free_motions
from spacemap_vtk.mechanics.elements.elasticity import VOIGT, Assembly
from spacemap_vtk.mechanics.elements.law_strains import LawStrains
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.strains import Strains, product_form, share_forms
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix, csr_matrix


#: Cells more than this many times wider than thick are treated as those of a sheet; even quadratic
#: tetrahedra twist too stiffly there (see `spacemap_vtk.mechanics.elements.locking`).
SHEET_ASPECT = 4.0

#: Corners of a quadrilateral, and its quadrature points.
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_GAUSS = _CORNERS / 3**0.5

#: Middles of the edges along ξ (at η = -1 and 1), and along η (at ξ = -1 and 1).
_MIDDLES = np.array([[0.0, -1.0], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0]])


class MidSurface(NamedTuple):
    """Pairs of vertices of a one-layer lattice, and its quadrilaterals of pairs."""

    pairs: Ints
    """(P, 2), vertices at the upper and the lower end of each pair."""
    quads: Ints
    """(E, 4), pairs of each hexahedron, counter-clockwise seen from above."""
    normal: int
    """Axis nearest to the direction across the layer."""

    def to_nodes(self, vertices: Floats) -> Floats:
        """Convert values of the vertices to those of all p, followed by all δ.

        Parameters
        ----------
        vertices : ndarray of float64, shape (V, …)
            Values of the vertices.

        Returns
        -------
        ndarray of float64, shape (V, …)
            Values of p and of δ, in the same unit.
        """
        upper, lower = vertices[self.pairs.T]
        return np.concatenate([(upper + lower) / 2, (upper - lower) / 2])

    def to_vertices(self, nodal: Floats) -> Floats:
        """Convert values of p and δ to those of the vertices.

        Parameters
        ----------
        nodal : ndarray of float64, shape (V, …)
            Values of all p, followed by all δ.

        Returns
        -------
        ndarray of float64, shape (V, …)
            Values of the vertices, in the same unit.
        """
        middle, half = nodal.reshape(2, len(self.pairs), *nodal.shape[1:])
        result = np.empty_like(nodal)
        result[self.pairs[:, 0]], result[self.pairs[:, 1]] = middle + half, middle - half
        return result

    def node_matrix(self) -> csr_matrix:
        """Build the matrix of `to_nodes`.

        Returns
        -------
        csr_matrix, shape (3V, 3V)
            For vectors component by component.
        """
        from scipy.sparse import bmat, csr_matrix, eye, kron

        count = len(self.pairs)
        ends = [
            csr_matrix((np.ones(count), end, np.arange(count + 1)), shape=(count, 2 * count))
            for end in self.pairs.T
        ]
        return kron(bmat([[ends[0] + ends[1]], [ends[0] - ends[1]]]) / 2, eye(3), format="csr")

    def vertex_nodes(self) -> tuple[Ints, Floats]:
        """List the nodal vectors p and δ of each vertex, and their signs in it.

        Returns
        -------
        nodes : ndarray of int64, shape (V, 2)
            Numbers of p and δ.
        signs : ndarray of float64, shape (V, 2)
            1 or -1.
        """
        count = len(self.pairs)
        nodes, signs = np.empty((2 * count, 2), dtype=np.int64), np.ones((2 * count, 2))
        nodes[self.pairs] = (np.arange(count)[:, None] + [0, count])[:, None]
        signs[self.pairs[:, 1], 1] = -1.0
        return nodes, signs

    def thickness(self, points: Floats) -> Floats:
        """Compute the length of each pair.

        Parameters
        ----------
        points : ndarray of float64, shape (V, 3)
            Vertices [m].

        Returns
        -------
        ndarray of float64, shape (P,)
            Lengths [m].
        """
        upper, lower = points[self.pairs.T]
        return np.linalg.norm(upper - lower, axis=1)

    def relative_thickness(self, points: Floats, plate: Plate) -> Floats:
        """Compute the relative thickness that determines a plate's stiffness at each pair.

        Parameters
        ----------
        points : ndarray of float64, shape (V, 3)
            Vertices [m].
        plate : Plate
            The sheet.

        Returns
        -------
        ndarray of float64, shape (P,)
            Thickness over its mean; 1 where the stiffness does not follow it.
        """
        own = self.thickness(points)
        return own / own.mean() if plate.follows_thickness else np.ones(len(own))


class Layer(NamedTuple):
    """Dimensions of a one-layer lattice."""

    thickness: float
    """Mean length of the pairs [m]."""
    normal: int
    """Axis nearest to the direction across the layer: 0, 1 or 2."""
    aspect: float
    """Ratio of the width of the cells to their thickness."""
    cell: float
    """Mean of the cells' shorter sides [m]."""


def find_layer(points: Floats, cells: Ints) -> Layer | None:
    """Compute the dimensions of a cage that is a sheet.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.

    Returns
    -------
    Layer or None
        None if the cage is not a one-layer lattice, whole or carved, of linear tetrahedra.
    """
    surface = find_mid_surface(points, cells)
    if surface is None:
        return None
    corners = surface.to_nodes(points)[surface.quads]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    thickness = float(surface.thickness(points).mean())
    shorter = float(sides.min(axis=1).mean())
    return Layer(thickness, surface.normal, float(sides.mean()) / thickness, shorter)


def find_mid_surface(points: Floats, cells: Ints) -> MidSurface | None:
    """Find the mid-surface of a one-layer lattice, whole or carved.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.

    Returns
    -------
    MidSurface or None
        One quadrilateral for each hexahedron, in their order; None for any other mesh.
    """
    # The mid-surface lies across the thinnest axis along which no two hexahedra are neighbours.
    corners = find_hexahedra(cells)
    if corners is None or 2 * len(corners) >= len(points):  # a sheet of P pairs has E < P
        return None
    best, thin = None, np.inf
    for axis in range(3):
        bit = 1 << axis
        other, last = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        lower = np.array([0, other, other | last, last])
        upper, lower = corners[:, lower | bit].ravel(), corners[:, lower].ravel()
        key, quads = np.unique(upper * len(points) + lower, return_inverse=True)
        pairs = np.stack(np.divmod(key, len(points)), axis=1)
        # Each vertex is at one end of one pair: no two hexahedra lie on top of each other.
        if len(pairs) * 2 == len(points) == len(np.unique(pairs)):
            across = points[pairs[:, 0]] - points[pairs[:, 1]]
            normal = int(abs(across.mean(axis=0)).argmax())
            found = MidSurface(pairs, quads.reshape(-1, 4), normal)
            if (thickness := float(found.thickness(points).mean())) < thin:
                best, thin = found, thickness
    return best


def average_over_quads(factors: Floats | None) -> Floats | None:
    """Average a factor of the tetrahedra over each quadrilateral, (T,) to (E,)."""
    # The first of the five tetrahedra has a third of the hexahedron's volume, each other a sixth.
    shares = np.array([2.0, 1.0, 1.0, 1.0, 1.0]) / 6
    return None if factors is None else factors.reshape(-1, TETRAHEDRA_PER_CELL) @ shares


def find_hexahedra(cells: Ints) -> Ints | None:
    """Find the corners x + 2y + 4z of each hexahedron of a lattice, (E, 8); None if it is none."""
    if cells.shape[1] != 4 or len(cells) % TETRAHEDRA_PER_CELL:
        return None
    groups = cells.reshape(-1, 4 * TETRAHEDRA_PER_CELL)
    result = np.empty((len(groups), 8), dtype=np.int64)
    left = np.ones(len(groups), dtype=bool)
    for split in SPLIT.reshape(2, -1):
        corners = groups[:, np.unique(split, return_index=True)[1]]
        fits = (corners[:, split] == groups).all(axis=1)
        result[fits] = corners[fits]
        left &= ~fits
    return None if left.any() else result


def sheet_strains(
    points: Floats,
    surface: MidSurface,
    plate: Plate,
    factors: Floats | None = None,
    modulus: float = 1.0,
) -> list[Strains]:
    """Make the strains of a sheet: those of its quadrilaterals, and of its pairs' thickness."""
    # The stiffnesses of the plate, but not its law, are divided by `modulus` already.
    # They depend on the nodal vectors p and δ of `MidSurface.to_nodes`: membrane 11, 22, 2·12,
    # bending 11, 22, 2·12 and shear 1, 2 at four points of each quadrilateral. Axis 1 lies in the
    # sheet and follows the normal cyclically: it is x for a sheet across z.
    nodal, count = surface.to_nodes(points), len(surface.pairs)
    z = nodal[surface.quads]
    # Factor from δ to the director d = 2 δ/h.
    scale = 2.0 / surface.thickness(points)
    director = scale[surface.quads]
    along, area = _local_axes(z, _GAUSS, surface.normal)
    stiff = 1.0 if factors is None else factors[:, None]
    mid_shear = [
        product_form(
            _extend_to_nodes(np.broadcast_to(slope, z.shape[:2]), 0),
            _extend_to_nodes(value * director, 4),
        )
        for value, slope in (
            (shape_functions(at), shape_slopes(at)[0 if number < 2 else 1])
            for number, at in enumerate(_MIDDLES)
        )
    ]
    forms = np.zeros((len(z), 4, 8, 8, 8))
    for q, (xi, eta) in enumerate(_GAUSS):
        slope = along[:, q] @ shape_slopes(_GAUSS[q])  # (E, 2, 4): derivatives along the axes
        p = [_extend_to_nodes(slope[:, i], 0) for i in range(2)]
        d = [_extend_to_nodes(slope[:, i] * director, 4) for i in range(2)]
        for i in range(2):
            forms[:, q, i] = product_form(p[i], p[i]) / 2
            forms[:, q, 3 + i] = product_form(p[i], d[i])
        forms[:, q, 2] = product_form(p[0], p[1])
        forms[:, q, 5] = product_form(p[0], d[1]) + product_form(p[1], d[0])
        natural = (
            ((1 - eta) * mid_shear[0] + (1 + eta) * mid_shear[1]) / 2,
            ((1 - xi) * mid_shear[2] + (1 + xi) * mid_shear[3]) / 2,
        )
        for i in range(2):
            turn = along[:, q, i, :, None, None]
            forms[:, q, 6 + i] = turn[:, 0] * natural[0] + turn[:, 1] * natural[1]
    assert plate.shear is not None
    assert plate.thickness is not None
    stiffness = np.zeros((8, 8))
    stiffness[:3, :3], stiffness[3:6, 3:6] = plate.membrane, plate.bending
    stiffness[6:, 6:] = plate.shear
    nodes = np.concatenate([surface.quads, surface.quads + count], axis=1)
    rows = np.arange(count, 2 * count)[:, None]
    # Membrane and shear stiffness grow with the thickness, bending stiffness with its cube.
    taper = surface.relative_thickness(points, plate)[surface.quads]
    there = taper @ np.stack([shape_functions(at) for at in _GAUSS]).T
    weights = there[..., None] ** np.array([1, 1, 1, 3, 3, 3, 1, 1])
    weights *= (area * stiff)[..., None]
    corners = _local_axes(z, _CORNERS, surface.normal)[1] * stiff * taper
    share = np.bincount(surface.quads.ravel(), corners.ravel(), count)
    thick = (scale**2).reshape(-1, 1, 1, 1, 1)
    quads = _strains_from(nodes, forms, weights[..., None] * stiffness, nodal)
    if plate.curvature is not None:
        # A sheet that curves towards its normal has negative bending strains.
        quads.reference[..., 3:6] -= plate.curvature
    if plate.law is not None:
        parts = quads.nodes, quads.forms, quads.reference, quads.stiffness
        quads = LawStrains(*parts, law=plate.law, weights=weights[..., 0] / modulus)
    return [
        quads,
        _strains_from(rows, thick, plate.thickness * share.reshape(-1, 1, 1, 1), nodal),
    ]


def assemble_sheet_mass(
    points: Floats, surface: MidSurface, factors: Floats | None = None
) -> Assembly:
    """Assemble the mass matrix of a sheet: ∫ N_a N_b h of the mid-points, and that of δ."""
    # The mass of δ is a third of that of p, because x = p + ζ δ with ζ from -1 to 1.
    count = len(surface.pairs)
    area = _local_axes(surface.to_nodes(points)[surface.quads], _GAUSS, surface.normal)[1]
    shapes = np.stack([shape_functions(at) for at in _GAUSS])
    volume = area * (surface.thickness(points)[surface.quads] @ shapes.T)
    if factors is not None:
        volume = volume * factors[:, None]
    products = np.einsum("eq,qa,qb->eab", volume, shapes, shapes)
    key = surface.quads[:, :, None] * count + surface.quads[:, None, :]
    pair, slot = np.unique(key, return_inverse=True)
    middle = np.bincount(slot.ravel(), products.ravel(), len(pair))
    starts = np.searchsorted(pair, np.arange(count + 1) * count)
    lumps = np.bincount(surface.quads.ravel(), products.sum(axis=2).ravel(), count)
    return Assembly(
        np.concatenate([starts, starts[1:] + len(pair)]),
        np.concatenate([pair % count, pair % count + count]),
        np.empty((0, 9)),
        np.concatenate([middle, middle / 3]),
        np.concatenate([lumps, lumps / 3]),
    )


def free_sheet_motions(
    points: Floats,
    surface: MidSurface,
    held: Bools,
    normals: Floats | None = None,
    bodies: Ints | None = None,
) -> csc_matrix:
    """Compute the basis (3V, N) of p and δ of each pair that supports and rigid bodies allow."""
    from scipy.sparse import hstack

    # If both ends are held alike, so are p and δ. Their separate bases keep all digits, however
    # thin the sheet. For other pairs the basis is that of the ends: p ± δ = 0 where one is held.
    upper, lower = surface.pairs.T
    both = np.concatenate([upper, upper])
    alike = (held[upper] == held[lower]).all(axis=1)
    if normals is not None:
        alike &= (normals[upper] == normals[lower]).all(axis=(1, 2))
    if bodies is not None:
        alike &= (bodies[upper] == 0) & (bodies[lower] == 0)
    turned = None if normals is None else normals[both]
    nodal = free_motions(surface.to_nodes(points), held[both], turned)
    nodal = nodal[:, alike[_first_nodes(nodal) % len(alike)]]
    if alike.all():
        return nodal
    pair = np.empty(len(points), dtype=np.int64)
    pair[upper] = pair[lower] = np.arange(len(alike))
    ends = free_motions(points, held, normals, bodies)
    ends = ends[:, ~alike[pair[_first_nodes(ends)]]]
    found = hstack([nodal, 2**0.5 * surface.node_matrix() @ ends], format="csc")
    found.sort_indices()
    return found[:, np.argsort(_first_nodes(found), kind="stable")]


def _first_nodes(basis: csc_matrix) -> Ints:
    """Return the first node of each column."""
    return np.asarray(basis.indices[basis.indptr[:-1]] // 3, dtype=np.int64)


def mid_surface_strains(
    strains: list[Strains], positions: Floats, moved: Floats, surface: MidSurface, plate: Plate
) -> tuple[Floats, Floats]:
    """Compute strain and force per width [N/m] in the middle of each quadrilateral, (E, 6) both."""
    # Both are linear in the move of p and δ, unless the sheet has a law. Components are xx, yy, zz,
    # yz, zx, xy of the cage.
    found = []
    for part in strains:
        strain, gradients = part.strains_and_gradients(positions)
        found.append(strain + part.strain_changes(gradients, moved))
    mean, thick = found[0].mean(axis=1), found[1].reshape(-1)[surface.quads].mean(axis=1)
    assert plate.shear is not None
    assert plate.thickness is not None
    normal = surface.normal
    one, two = (normal + 1) % 3, (normal + 2) % 3
    plane = [one, two, VOIGT[one, two]]
    across = [VOIGT[one, normal], VOIGT[two, normal]]
    strain, force = np.empty((2, len(mean), 6))
    strain[:, plane], strain[:, across], strain[:, normal] = mean[:, :3], mean[:, 6:], thick
    linear = mean[:, :3] @ plate.membrane
    force[:, plane] = linear if plate.law is None else plate.law.stress(mean[:, :3])
    force[:, across] = mean[:, 6:] @ plate.shear
    force[:, normal] = plate.thickness * thick
    return strain, force


def frame_matrix(points: Floats, surface: MidSurface) -> tuple[csr_matrix, Floats]:
    """Build the legs of a sheet as a matrix, (3 n, V), and the area that belongs to each row."""
    # At four points of each quadrilateral, from p and δ: ∂p along two axes in its plane, and d.
    from scipy.sparse import csr_matrix

    z, count = surface.to_nodes(points)[surface.quads], len(surface.pairs)
    along, area = _local_axes(z, _GAUSS, surface.normal)
    slopes = np.stack([shape_slopes(at) for at in _GAUSS])
    shapes = np.stack([shape_functions(at) for at in _GAUSS])
    director = shapes * (2.0 / surface.thickness(points))[surface.quads][:, None]
    values = np.concatenate([along @ slopes, director[:, :, None]], axis=2)
    columns = np.stack([surface.quads, surface.quads, surface.quads + count], axis=1)
    columns = np.repeat(columns[:, None], len(_GAUSS), axis=1)
    size = values.size // 4
    parts = values.ravel(), columns.ravel(), 4 * np.arange(size + 1)
    return csr_matrix(parts, shape=(size, 2 * count)), np.repeat(area.ravel(), 3)


class SheetGradient:
    """Gradient of displacements of a sheet in equilibrium, at four points per quadrilateral."""

    # Folds in equilibrium can be tighter than the thickness, and as sharp as a cell: tetrahedra are
    # inside out there, and the legs lie in a plane. Cloth hardly stretches, so the legs used here
    # are those of the flat sheet, rotated.
    def __init__(
        self, points: Floats, surface: MidSurface, displacement: Floats | float = 0.0
    ) -> None:
        self._frames, self._surface = frame_matrix(points, surface)[0], surface
        left, _, right = np.linalg.svd(self._frames_of(points + displacement))
        self._inverse = (left @ right).swapaxes(1, 2)

    def evaluate(self, displacement: Floats) -> Floats:
        """Compute the gradients of a displacement, (3, 3, points)."""
        return (self._frames_of(displacement) @ self._inverse).transpose(1, 2, 0)

    def _frames_of(self, vertices: Floats) -> Floats:
        legs: Floats = (self._frames @ self._surface.to_nodes(vertices)).reshape(-1, 3, 3)
        return legs.swapaxes(1, 2)


def _strains_from(nodes: Ints, forms: Floats, stiffness: NDArray[Any], nodal: Floats) -> Strains:
    """Make strains that are zero in the given shape."""
    zero = np.zeros(forms.shape[:3])
    forms = share_forms(forms)
    bare = Strains(nodes, forms, zero, stiffness)
    return Strains(nodes, forms, bare.strains_and_gradients(nodal)[0], stiffness)


def shape_functions(at: Floats) -> Floats:
    """Evaluate the four bilinear shape functions at a point (ξ, η)."""
    return (1 + _CORNERS * at).prod(axis=1) / 4


def shape_slopes(at: Floats) -> Floats:
    """Evaluate the derivatives of the shape functions.

    Parameters
    ----------
    at : ndarray of float64, shape (2,)
        Coordinates ξ and η, from -1 to 1.

    Returns
    -------
    ndarray of float64, shape (2, 4)
        Derivatives along ξ and η.
    """
    return np.stack([_CORNERS[:, i] * (1 + _CORNERS[:, 1 - i] * at[1 - i]) / 4 for i in range(2)])


def _local_axes(z: Floats, places: Floats, normal: int) -> tuple[Floats, Floats]:
    """Compute ∂(ξ, η)/∂(axes 1 and 2), (E, q, 2, 2), and the area that belongs to each point."""
    tangents = np.stack([shape_slopes(at) for at in places]) @ z[:, None]  # (E, q, 2, 3)
    upward = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    area: Floats = np.linalg.norm(upward, axis=2)
    upward /= area[..., None]
    one, two = ((normal + k) % 3 for k in (1, 2))
    first = np.eye(3)[one] - upward * upward[..., one, None]
    # If a sheet is turned until axis 1 is nearly normal to it, axis 2 is used instead.
    second = np.eye(3)[two] - upward * upward[..., two, None]
    steep = abs(upward[..., one, None]) > abs(upward[..., two, None])
    first = np.where(steep, np.cross(second, upward), first)
    first /= np.linalg.norm(first, axis=2)[..., None]
    frame = np.stack([first, np.cross(upward, first)], axis=2)
    turn: Floats = np.linalg.inv(
        (frame @ tangents.swapaxes(2, 3)).astype(np.float64, copy=False)
    ).swapaxes(2, 3)
    return turn, area


def _extend_to_nodes(values: Floats, start: int) -> Floats:
    """Extend values of four mid-points (start 0) or directors (4) to all eight nodes."""
    result = np.zeros((len(values), 8))
    result[:, start : start + 4] = values
    return result
