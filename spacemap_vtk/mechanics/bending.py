"""How far off a thin cage of tetrahedra is where it bends and where it twists."""

from __future__ import annotations

import itertools
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from spacemap_vtk.mechanics import blas_threads
from spacemap_vtk.mechanics.elasticity import VOIGT
from spacemap_vtk.mechanics.elements import volumes
from spacemap_vtk.mechanics.kinematics import MeanGradient, strains
from spacemap_vtk.mechanics.materials import volume_ratio
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: A mesh is thin along an axis where its extent is below this share of that along another one.
_THIN = 1 / 3

#: Poisson's ratio that the fits were made for, and its G/C₃₃.
_RATIO, _SWELLING = 0.3, 0.2 / 0.7


#: Of the polynomials that a plate's modes are made of, and how many modes are judged.
_DEGREE, _MODES = 7, 5

#: Edges of a tetrahedron, and how many that are held are looked at.
_EDGES = list(itertools.combinations(range(4), 2))
_MOST_EDGES = 500

#: Of the factors that the modes are judged by.
_STIFFEST = 1e11


class Locking(NamedTuple):
    """How many times too stiff a cage is; frequencies are off by the roots of these."""

    bending: float
    """Of its five lowest modes, that which suffers least: it bends about one axis."""
    twist: float
    """That which suffers most: it twists, as all does that bends about both axes at once."""


class Proportions(NamedTuple):
    """The shape of a thin mesh, and of its tetrahedra."""

    normal: int
    """The axis of its thickness."""
    long: list[int]
    """The axes along which it is not thin: two of a sheet, one of a bar, none of a block."""
    thickness: float
    """Extent of the bounding box along the normal [m]."""
    width: float
    """Mean extent of a tetrahedron along the long axes [m]."""
    height: float
    """Mean extent of a tetrahedron along the normal [m]."""

    @property
    def layers(self) -> float:
        """How many tetrahedra lie on top of each other; infinite of a block."""
        return self.thickness / self.height if self.long else float("inf")


def proportions_of(vertices: Floats, tetrahedra: Ints) -> Proportions:
    """Return the shape of a mesh, as its bounding box tells it.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    tetrahedra : ndarray of int64, shape (T, 4) or (T, 10)
        Vertex numbers, those of the corners first.

    Returns
    -------
    Proportions
        Its thickness and the size of its tetrahedra.
    """
    extent = np.ptp(vertices, axis=0)
    size = np.ptp(vertices[tetrahedra[:, :4]], axis=1).mean(axis=0)
    normal = int(np.argmin(extent))
    long = [axis for axis in range(3) if extent[normal] <= _THIN * extent[axis]]
    width = size[long or range(3)].mean()
    return Proportions(normal, long, float(extent[normal]), float(width), float(size[normal]))


def locking(vertices: Floats, tetrahedra: Ints, elasticity: Floats, held: Bools) -> Locking:
    """Estimate how many times too stiffly a sheet or bar of tetrahedra bends and twists.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    tetrahedra : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    elasticity : ndarray of float64, shape (6, 6)
        Elasticity matrix [Pa], in the order of `spacemap_vtk.mechanics.materials.isotropic`.
    held : ndarray of bool, shape (V, 3)
        Which components cannot move.

    Returns
    -------
    Locking
        At least 1. It is 1 for a mesh that is no sheet or bar along the axes, for a bar of
        quadratic tetrahedra, and for the twist of any bar.

    Notes
    -----
    Linear tetrahedra: every vertex is put where Kirchhoff's plate of uniform curvature has it, and
    the strain energy of the tetrahedra is divided by the plate's, for either axis and for twist. Of
    hexahedra h wide and t/n high, cut in five, and of an isotropic material the leading terms are

        bending  1 + 2 G (1 - ν²)/E (h/t)²      shear that a uniform strain cannot be without
        twist    1 + n² C₃₃/(4 G) (h/t)⁴        crossing diagonals strain the thickness

    Quadratic tetrahedra hold a uniform curvature as it is; they lock where the twist varies, as it
    must near a support. A sheet of area A that reaches as far as b from what holds it twists

        1 + (h/t)² / (12 (b²/A)^1.5 G₁₂/G₁₃ + 12 A/t² G₁₂/(0.29 C₃₃ X))

    times too stiffly, where X, 12/t² times the mean square of the thickness strain that linear
    tetrahedra have in a unit twist, is n² (h/t)⁴ for crossing diagonals, and zero where those on
    top lie over those below, which do not lock.

    How much of either is in a mode tells a plate of the sheet's rectangle, supports and material
    (Ritz's method, polynomials of degree 7), with these factors and without: of each of its lowest
    modes, how much less it yields to that mode's inertia.

    How accurate, against plates of 1:1, 1:2, 2:1 and 1:5, of ν = 0 to 0.45 and three measured
    fabrics, with cells 2.5 to 70 thicknesses wide and one to six layers, as said over found in the
    first mode that bends and the first that twists. Linear tetrahedra, clamped by one side: 1.0 to
    1.3 in bending; in twist 1.0 to 1.2, of a fabric up to 2.5. By two opposite sides: 0.9 to 1.35
    in bending, of a fabric in cells below five thicknesses, which yields in shear as well, up to 4;
    in twist 1.0 to 1.4, but another of the five may be said that is up to ten times worse.
    Quadratic ones: the second formula is a fit; by one side 0.7 to 2.2, by two 0.4 to 2.1, of a
    fabric up to 6.7. That their cells are too few to bend is not said: five along a side are 7 %
    too stiff, between two sides 27 % (three: 90 %), and more for ν above 0.3. In bending, a
    material of ν above 0.3 is taken for one of 0.3, as vertices move aside. A sheet that is not
    level with the axes is taken for a block, and judged in nothing.
    """
    sheet = proportions_of(vertices, tetrahedra)
    corners, linear = tetrahedra[:, :4], tetrahedra.shape[1] == 4
    if not sheet.long or not (linear or len(sheet.long) == 2):
        return Locking(1.0, 1.0)
    plate = _Plate(vertices, corners, sheet.normal)
    kept = _compressible(elasticity)
    factors = [plate.times(kept, axis, axis) if linear else 1.0 for axis in sheet.long]
    if len(sheet.long) == 1:
        return Locking(max(*factors, 1.0), 1.0)
    if linear:
        factors.append(plate.times(elasticity, *sheet.long))
    else:
        factors.append(1.0 + _varying_twist(vertices, held, sheet, plate, kept))
    with blas_threads.one():
        ritz = _Ritz(vertices, corners, held, sheet)
        stiffer = ritz.stiffer(_plane(elasticity, sheet.long), np.maximum(factors, 1.0))
    return Locking(max(float(stiffer.min()), 1.0), max(float(stiffer.max()), 1.0))


def _compressible(elasticity: Floats) -> Floats:
    """Return the material with Poisson's ratios lowered to those that the estimate holds for."""
    ratio = volume_ratio(elasticity)
    if ratio <= _RATIO:
        return elasticity
    compliance = np.linalg.inv(elasticity)
    compliance[:3, :3] *= np.where(np.eye(3) > 0, 1.0, _RATIO / ratio)
    return np.linalg.inv(compliance)


class _Plate:
    """A sheet of linear tetrahedra, whose vertices go where those of a curved plate do."""

    def __init__(self, vertices: Floats, corners: Ints, normal: int) -> None:
        self.volume = volumes(vertices, corners)
        self._vertices, self._normal = vertices, normal
        self._gradient = MeanGradient(vertices, corners)
        z = vertices[:, normal]
        self._z = z - self.volume @ z[corners].mean(axis=1) / self.volume.sum()
        z = self._z[corners]
        self._second_moment = float(self.volume @ ((z**2).sum(axis=1) + z.sum(axis=1) ** 2)) / 20

    def strains(self, first: int, other: int) -> Floats:
        """Return the strains in a unit curvature along an axis, or in a unit twist along two."""
        x, y = self._vertices[:, first], self._vertices[:, other]
        field = np.zeros_like(self._vertices)
        field[:, first], field[:, other] = self._z * y, self._z * x
        field[:, self._normal] = -x * y / (2 if first == other else 1)
        return strains(self._gradient.of(field))

    def times(self, elasticity: Floats, first: int, other: int) -> float:
        """Return the energy of these strains over that of the plate."""
        field = np.zeros_like(self._vertices)
        field[:, self._normal] = self._z**2
        bent, swollen = self.strains(first, other), strains(self._gradient.of(field))

        def work(a: Floats, b: Floats) -> float:
            return float(self.volume @ ((a @ elasticity) * b).sum(axis=1))

        # The thickness swells where that frees energy: plane stress, as far as there are layers.
        energy, own = work(bent, bent), work(swollen, swollen)
        if own > 0:
            energy -= work(bent, swollen) ** 2 / own
        axes = [axis for axis in range(3) if axis != self._normal]
        place = axes.index(first) if first == other else 2
        size = 1 if first == other else 4  # γ² = 4 ε²
        plate = float(_plane(elasticity, axes)[place, place])
        return energy / (size * plate * self._second_moment)


def _plane(elasticity: Floats, axes: list[int]) -> Floats:
    """Return the elasticity in plane stress, (3, 3): along two axes, and in shear."""
    rows = [*axes, VOIGT[axes[0], axes[1]]]
    return np.linalg.inv(np.linalg.inv(elasticity)[np.ix_(rows, rows)])


class _Ritz:
    """A thin plate on a sheet's rectangle, held where the sheet is, in products of polynomials."""

    def __init__(self, vertices: Floats, corners: Ints, held: Bools, sheet: Proportions) -> None:
        low, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
        weights, polynomials = _quadrature()
        sides = extent[sheet.long] / extent.max()
        bases = [[each / side**k for k, each in enumerate(polynomials)] for side in sides]

        def integral(x: tuple[int, int], y: tuple[int, int]) -> Floats:
            """Of a derivative of each function times one of each other."""
            parts = [
                base[first].T @ (weights[:, None] * base[other])
                for base, (first, other) in zip(bases, (x, y), strict=True)
            ]
            return np.kron(*parts)

        # What holds an edge's ends holds it; its slopes too, where it is not level.
        any_held = np.asarray(held.any(axis=1))
        pairs = np.concatenate([corners[:, pair] for pair in _EDGES])
        # Each once, without np.unique, which brings numpy.ma, 20 ms at the window's start.
        pairs = np.sort(pairs[any_held[pairs].all(axis=1)], axis=1)
        pairs = pairs[np.lexsort(pairs.T[::-1])]
        pairs = pairs[np.diff(pairs, axis=0, prepend=-1).any(axis=1)]
        pairs = np.concatenate([pairs, np.repeat(np.flatnonzero(any_held)[:, None], 2, axis=1)])
        pairs = pairs[:: 1 + len(pairs) // _MOST_EDGES]
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
        #: Of the curvatures along x, along y, of their product, and of the twist.
        self._squares = np.array([free.T @ square @ free for square in curvatures])

    def stiffer(self, plate: Floats, factors: Floats) -> Floats:
        """Return of each of the lowest modes how much less it yields with factors, (n,)."""
        if not self._squares.size:
            return factors
        moduli = np.array([plate[0, 0], plate[1, 1], plate[0, 1], plate[2, 2]]) / plate.max()
        eigenvalues, modes = np.linalg.eigh(np.einsum("k,kij->ij", moduli, self._squares))
        elastic = eigenvalues > 1e-9 * eigenvalues[-1]  # a free sheet moves rigidly, too
        modes = modes[:, elastic] / np.sqrt(eigenvalues[elastic])
        # A float64 tells softer motions beside such stiff ones still.
        factors = np.minimum(factors, _STIFFEST)
        moduli *= [factors[0], factors[1], 1.0, factors[2]]
        stiffness = modes.T @ np.einsum("k,kij->ij", moduli, self._squares) @ modes
        return 1 / np.diag(np.linalg.inv(stiffness))[:_MODES]


@cache
def _quadrature() -> tuple[Floats, list[Floats]]:
    """Return Gauss's weights, and the polynomials and their derivatives at his places."""
    gauss, weights = legendre.leggauss(_DEGREE + 1)
    return weights, [_polynomials(gauss, k) for k in range(3)]


def _polynomials(places: Floats, derivative: int) -> Floats:
    """Return orthonormal polynomials from -1 to 1, or a derivative, (n, _DEGREE + 1)."""
    each = np.diag(np.sqrt(np.arange(_DEGREE + 1) + 0.5))
    values = legendre.legval(places, legendre.legder(each, derivative))
    return np.array(values.T, dtype=np.float64)


def _varying_twist(
    vertices: Floats, held: Bools, sheet: Proportions, plate: _Plate, elasticity: Floats
) -> float:
    """Return by how much quadratic tetrahedra are above 1 in twist, see `locking`."""
    from scipy.spatial import cKDTree  # with all it brings: a tenth of a second

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
