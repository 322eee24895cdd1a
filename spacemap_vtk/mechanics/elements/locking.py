"""How much too stiff a thin cage of tetrahedra is in bending and in twist (locking)."""

from __future__ import annotations

import itertools
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from spacemap_vtk.mechanics.elements.elasticity import VOIGT
from spacemap_vtk.mechanics.elements.kinematics import MeanGradient, strains
from spacemap_vtk.mechanics.elements.materials import equivalent_poissons_ratio
from spacemap_vtk.mechanics.elements.tetrahedra import volumes
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: A mesh is thin along an axis if its extent is below this share of that along another axis.
_THIN = 1 / 3

#: Poisson's ratio for which the fits were made.
_RATIO = 0.3
#: G/C₃₃ at this ratio.
_SWELLING = 0.2 / 0.7

#: Degree of the polynomials for a plate's modes.
_DEGREE = 7
#: Number of the plate's lowest modes that are considered.
_MODES = 5

#: Edges of a tetrahedron.
_EDGES = list(itertools.combinations(range(4), 2))
#: Largest number of held edges that are examined.
_MAX_EDGES = 500

#: Limit of the factors; above it float64 would no longer resolve the softer motions.
_MAX_FACTOR = 1e11


class Locking(NamedTuple):
    """Factors by which a cage is too stiff; its frequencies are too high by their square roots."""

    bending: float
    """Smallest factor among the five lowest modes: that of a mode that bends about one axis."""
    twist: float
    """Largest factor among them: that of a mode that twists, or bends about both axes."""


class Proportions(NamedTuple):
    """Proportions of a thin mesh and of its tetrahedra."""

    normal: int
    """Axis of the thickness."""
    long: list[int]
    """Axes along which the mesh is not thin: two for a sheet, one for a bar, none for a block."""
    thickness: float
    """Extent of the bounding box along the normal [m]."""
    width: float
    """Mean extent of a tetrahedron along the long axes [m]."""
    height: float
    """Mean extent of a tetrahedron along the normal [m]."""

    @property
    def layers(self) -> float:
        """Number of tetrahedra across the thickness; infinite for a block."""
        return self.thickness / self.height if self.long else float("inf")


def proportions_of(vertices: Floats, tetrahedra: Ints) -> Proportions:
    """Determine the proportions of a mesh from its bounding box.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    tetrahedra : ndarray of int64, shape (T, 4) or (T, 10)
        Vertex numbers, those of the corners first.

    Returns
    -------
    Proportions
        Thickness of the mesh and size of its tetrahedra.
    """
    extent = np.ptp(vertices, axis=0)
    size = np.ptp(vertices[tetrahedra[:, :4]], axis=1).mean(axis=0)
    normal = int(np.argmin(extent))
    long = [axis for axis in range(3) if extent[normal] <= _THIN * extent[axis]]
    width = size[long or range(3)].mean()
    return Proportions(normal, long, float(extent[normal]), float(width), float(size[normal]))


def estimate_locking(
    vertices: Floats, tetrahedra: Ints, elasticity: Floats, held: Bools
) -> Locking:
    """Estimate the factors by which a sheet or bar of tetrahedra is too stiff in bending and twist.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    tetrahedra : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    elasticity : ndarray of float64, shape (6, 6)
        Elasticity matrix [Pa], in the order of
        `spacemap_vtk.mechanics.elements.materials.isotropic`.
    held : ndarray of bool, shape (V, 3)
        Components that cannot move.

    Returns
    -------
    Locking
        Factors of at least 1. They are 1 for a mesh that is not a sheet or bar along the axes, and
        for a bar of quadratic tetrahedra; the factor of twist is 1 for any bar.

    Notes
    -----
    Linear tetrahedra: every vertex is moved as in Kirchhoff's plate of uniform curvature, and the
    strain energy of the tetrahedra is divided by that of the plate, for each axis and for twist.
    For hexahedra of width h and height t/n, each cut in five, and an isotropic material the leading
    terms are

        bending  1 + 2 G (1 - ν²)/E (h/t)²      shear, which uniform strain cannot avoid
        twist    1 + n² C₃₃/(4 G) (h/t)⁴        thickness strain, due to crossing diagonals

    Quadratic tetrahedra represent a uniform curvature exactly. They lock where the twist varies, as
    it must near a support. A sheet of area A whose points are at most b away from a support is too
    stiff in twist by the factor

        1 + (h/t)² / (12 (b²/A)^1.5 G₁₂/G₁₃ + 12 A/t² G₁₂/(0.29 C₃₃ X))

    X is 12/t² times the mean square of the thickness strain of linear tetrahedra in a unit twist.
    It is n² (h/t)⁴ for crossing diagonals. It is zero if the diagonals of the top lie over those of
    the bottom; these meshes do not lock.

    The shares of bending and twist in a mode come from a plate with the sheet's rectangle, supports
    and material (Ritz's method, polynomials of degree 7). For each of its lowest modes, the result
    is how much less the plate yields to the mode's inertia with these factors than without.

    Accuracy: the estimated factor divided by the factor found in the first bending mode and the
    first twisting mode. It was measured with plates of 1:1, 1:2, 2:1 and 1:5, of ν = 0 to 0.45 and
    three measured fabrics, with cells 2.5 to 70 thicknesses wide and one to six layers.

    - Linear tetrahedra, clamped at one side: 1.0 to 1.3 in bending; 1.0 to 1.2 in twist, for a
      fabric up to 2.5.
    - Linear tetrahedra, clamped at two opposite sides: 0.9 to 1.35 in bending, and up to 4 for a
      fabric with cells below five thicknesses, which yields in shear as well; 1.0 to 1.4 in twist,
      but the value may be that of another of the five modes, up to ten times worse.
    - Quadratic tetrahedra, whose formula is a fit: 0.7 to 2.2 if clamped at one side, 0.4 to 2.1 at
      two sides, for a fabric up to 6.7. The estimate ignores that few quadratic cells bend too
      stiffly: five along a side are 7 % too stiff, five between two sides 27 % (three: 90 %), and
      more for ν above 0.3.

    In bending, a material of ν above 0.3 is treated as one of 0.3, because vertices move aside. A
    sheet that is not aligned with the axes is treated as a block, and its factors are 1.
    """
    sheet = proportions_of(vertices, tetrahedra)
    corners, linear = tetrahedra[:, :4], tetrahedra.shape[1] == 4
    if not sheet.long or not (linear or len(sheet.long) == 2):
        return Locking(1.0, 1.0)
    plate = _CurvedSheet(vertices, corners, sheet.normal)
    kept = _limit_poissons_ratio(elasticity)
    factors = [plate.stiffness_factor(kept, axis, axis) if linear else 1.0 for axis in sheet.long]
    if len(sheet.long) == 1:
        return Locking(max(*factors, 1.0), 1.0)
    if linear:
        factors.append(plate.stiffness_factor(elasticity, *sheet.long))
    else:
        factors.append(1.0 + _twist_excess(vertices, held, sheet, plate, kept))
    with blas_threads.use_one_thread():
        ritz = _Ritz(vertices, corners, held, sheet)
        mode_factors = ritz.mode_factors(
            _plane_stress(elasticity, sheet.long), np.maximum(factors, 1.0)
        )
    return Locking(max(float(mode_factors.min()), 1.0), max(float(mode_factors.max()), 1.0))


def _limit_poissons_ratio(elasticity: Floats) -> Floats:
    """Lower the Poisson's ratios of a material to those for which the estimate is valid."""
    ratio = equivalent_poissons_ratio(elasticity)
    if ratio <= _RATIO:
        return elasticity
    compliance = np.linalg.inv(elasticity)
    compliance[:3, :3] *= np.where(np.eye(3) > 0, 1.0, _RATIO / ratio)
    return np.linalg.inv(compliance)


class _CurvedSheet:
    """Sheet of linear tetrahedra whose vertices move as those of a curved plate."""

    def __init__(self, vertices: Floats, corners: Ints, normal: int) -> None:
        self.volume = volumes(vertices, corners)
        self._vertices, self._normal = vertices, normal
        self._gradient = MeanGradient(vertices, corners)
        z = vertices[:, normal]
        self._z = z - self.volume @ z[corners].mean(axis=1) / self.volume.sum()
        z = self._z[corners]
        self._second_moment = float(self.volume @ ((z**2).sum(axis=1) + z.sum(axis=1) ** 2)) / 20

    def strains(self, first: int, other: int) -> Floats:
        """Compute the strains in a unit curvature along an axis, or a unit twist along two axes."""
        x, y = self._vertices[:, first], self._vertices[:, other]
        field = np.zeros_like(self._vertices)
        field[:, first], field[:, other] = self._z * y, self._z * x
        field[:, self._normal] = -x * y / (2 if first == other else 1)
        return strains(self._gradient.evaluate(field))

    def stiffness_factor(self, elasticity: Floats, first: int, other: int) -> float:
        """Compute the energy of these strains divided by that of the plate."""
        field = np.zeros_like(self._vertices)
        field[:, self._normal] = self._z**2
        bent, swollen = self.strains(first, other), strains(self._gradient.evaluate(field))

        def work(a: Floats, b: Floats) -> float:
            return float(self.volume @ ((a @ elasticity) * b).sum(axis=1))

        # The thickness expands if that lowers the energy: plane stress, as far as layers allow.
        energy, own = work(bent, bent), work(swollen, swollen)
        if own > 0:
            energy -= work(bent, swollen) ** 2 / own
        axes = [axis for axis in range(3) if axis != self._normal]
        place = axes.index(first) if first == other else 2
        size = 1 if first == other else 4  # γ² = 4 ε²
        plate = float(_plane_stress(elasticity, axes)[place, place])
        return energy / (size * plate * self._second_moment)


def _plane_stress(elasticity: Floats, axes: list[int]) -> Floats:
    """Compute the elasticity in plane stress, (3, 3): along two axes, and in shear."""
    rows = [*axes, VOIGT[axes[0], axes[1]]]
    return np.linalg.inv(np.linalg.inv(elasticity)[np.ix_(rows, rows)])


class _Ritz:
    """Thin plate on a sheet's rectangle with its supports, in products of polynomials."""

    def __init__(self, vertices: Floats, corners: Ints, held: Bools, sheet: Proportions) -> None:
        low, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
        weights, polynomials = _quadrature()
        sides = extent[sheet.long] / extent.max()
        bases = [[each / side**k for k, each in enumerate(polynomials)] for side in sides]

        def integral(x: tuple[int, int], y: tuple[int, int]) -> Floats:
            """Integrate products of derivatives of all pairs of functions."""
            parts = [
                base[first].T @ (weights[:, None] * base[other])
                for base, (first, other) in zip(bases, (x, y), strict=True)
            ]
            return np.kron(*parts)

        # If both ends of an edge are held, the edge is held; if it is not level, its slopes, too.
        any_held = np.asarray(held.any(axis=1))
        pairs = np.concatenate([corners[:, pair] for pair in _EDGES])
        # Each edge once, without np.unique: it imports numpy.ma, 20 ms at the window's start.
        pairs = np.sort(pairs[any_held[pairs].all(axis=1)], axis=1)
        pairs = pairs[np.lexsort(pairs.T[::-1])]
        pairs = pairs[np.diff(pairs, axis=0, prepend=-1).any(axis=1)]
        pairs = np.concatenate([pairs, np.repeat(np.flatnonzero(any_held)[:, None], 2, axis=1)])
        pairs = pairs[:: 1 + len(pairs) // _MAX_EDGES]
        share = np.linspace(0, 1, 5)[:, None, None]
        places = (1 - share) * vertices[pairs[:, 0]] + share * vertices[pairs[:, 1]]
        places = 2 * (places.reshape(-1, 3) - low) / extent - 1
        level = np.ptp(vertices[pairs, sheet.normal], axis=1) < 0.1 * sheet.height
        both = held[pairs].all(axis=1)
        moved = np.zeros(((_DEGREE + 1) ** 2,) * 2)
        for axis in (sheet.normal, *sheet.long):
            fixed = np.tile(both[:, axis] & (~level | (axis == sheet.normal)), 5)
            x, y = (_polynomials(places[fixed, along], int(along == axis)) for along in sheet.long)
            rows = (x[:, :, None] * y[:, None, :]).reshape(-1, len(moved))
            moved += rows.T @ rows
        size, functions = np.linalg.eigh(moved)
        free = functions[:, size <= 1e-12 * size[-1]]
        both_ways = integral((2, 0), (0, 2))
        curvatures = (
            integral((2, 2), (0, 0)),
            integral((0, 0), (2, 2)),
            both_ways + both_ways.T,
            4 * integral((1, 1), (1, 1)),
        )
        #: Squares of the curvature along x and along y, their product, and the twist squared.
        self._squares = np.array([free.T @ square @ free for square in curvatures])

    def mode_factors(self, plate: Floats, factors: Floats) -> Floats:
        """Compute how much less each of the lowest modes yields with factors, (n,)."""
        if not self._squares.size:
            return factors
        moduli = np.array([plate[0, 0], plate[1, 1], plate[0, 1], plate[2, 2]]) / plate.max()
        eigenvalues, modes = np.linalg.eigh(np.einsum("k,kij->ij", moduli, self._squares))
        elastic = eigenvalues > 1e-9 * eigenvalues[-1]  # a free sheet also has rigid motions
        modes = modes[:, elastic] / np.sqrt(eigenvalues[elastic])
        # With the limited factors float64 still resolves the softer motions.
        factors = np.minimum(factors, _MAX_FACTOR)
        moduli *= [factors[0], factors[1], 1.0, factors[2]]
        stiffness = modes.T @ np.einsum("k,kij->ij", moduli, self._squares) @ modes
        return 1 / np.diag(np.linalg.inv(stiffness))[:_MODES]


@cache
def _quadrature() -> tuple[Floats, list[Floats]]:
    """Return Gauss weights, and the polynomials and their derivatives at the Gauss points."""
    gauss, weights = legendre.leggauss(_DEGREE + 1)
    return weights, [_polynomials(gauss, k) for k in range(3)]


def _polynomials(places: Floats, derivative: int) -> Floats:
    """Evaluate orthonormal polynomials on [-1, 1], or a derivative, (n, _DEGREE + 1)."""
    each = np.diag(np.sqrt(np.arange(_DEGREE + 1) + 0.5))
    values = legendre.legval(places, legendre.legder(each, derivative))
    return np.array(values.T, dtype=np.float64)


def _twist_excess(
    vertices: Floats, held: Bools, sheet: Proportions, plate: _CurvedSheet, elasticity: Floats
) -> float:
    """Estimate by how much the factor of quadratic tetrahedra in twist exceeds 1."""
    # See the notes of `estimate_locking`.
    from scipy.spatial import cKDTree  # this import costs a tenth of a second

    whole, thickness = float(plate.volume.sum()), sheet.thickness
    reach = float(np.ptp(vertices, axis=0).max()) / 2
    if held.any():
        reach = float(cKDTree(vertices[held.any(axis=1)]).query(vertices)[0].max())
    swelling = plate.strains(*sheet.long)[:, sheet.normal]
    crossing = 12 * float(plate.volume @ swelling**2) / whole / thickness**2
    if crossing < 1e-9:
        return 0.0
    twisting = elasticity[VOIGT[sheet.long[0], sheet.long[1]], VOIGT[sheet.long[0], sheet.long[1]]]
    across = [VOIGT[axis, sheet.normal] for axis in sheet.long]
    sheared = min(elasticity[row, row] for row in across)
    swollen = _SWELLING * elasticity[sheet.normal, sheet.normal]
    folds = 12 * (reach**2 * thickness / whole) ** 1.5 * twisting / sheared
    swells = 12 * whole / thickness**3 / crossing * twisting / swollen
    return float((sheet.width / thickness) ** 2 / (folds + swells))
