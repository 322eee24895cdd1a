"""How far off a thin cage of tetrahedra is where it bends and where it twists."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.mechanics.elasticity import VOIGT
from spacemap_vtk.mechanics.kinematics import MeanGradient, strains
from spacemap_vtk.mechanics.materials import volume_ratio
from spacemap_vtk.mechanics.tetrahedra import volumes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: A mesh is thin along an axis where its extent is below this share of that along another one.
_THIN = 1 / 3

#: Poisson's ratio that the fits were made for, and its G/C₃₃.
_RATIO, _SWELLING = 0.3, 0.2 / 0.7


class Locking(NamedTuple):
    """How many times too stiff a cage is; frequencies are off by the roots of these."""

    bending: float
    """Where it bends about one axis of its plane."""
    twist: float
    """Where it twists, as all does that bends about both axes at once."""


class Sheet(NamedTuple):
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


def sheet_of(vertices: FloatArray, tetrahedra: IntArray) -> Sheet:
    """Return the shape of a mesh, as its bounding box tells it.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    tetrahedra : ndarray of int64, shape (T, 4) or (T, 10)
        Vertex numbers, those of the corners first.

    Returns
    -------
    Sheet
        Its thickness and the size of its tetrahedra.
    """
    extent = np.ptp(vertices, axis=0)
    size = np.ptp(vertices[tetrahedra[:, :4]], axis=1).mean(axis=0)
    normal = int(np.argmin(extent))
    long = [axis for axis in range(3) if extent[normal] <= _THIN * extent[axis]]
    width = size[long or range(3)].mean()
    return Sheet(normal, long, float(extent[normal]), float(width), float(size[normal]))


def layers_through_thickness(vertices: FloatArray, tetrahedra: IntArray) -> float:
    """Return how many tetrahedra lie on top of each other where the mesh is thinnest.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    tetrahedra : ndarray of int64, shape (T, 4) or (T, 10)
        Vertex numbers, those of the corners first.

    Returns
    -------
    float
        Extent of the bounding box along its thinnest axis over the mean extent of a tetrahedron
        along it; infinite for a mesh that is no sheet or bar (thinnest extent above a third of
        the largest one).
    """
    sheet = sheet_of(vertices, tetrahedra)
    return sheet.thickness / sheet.height if sheet.long else float("inf")


def locking(
    vertices: FloatArray,
    tetrahedra: IntArray,
    elasticity: FloatArray,
    held: NDArray[np.bool_],
) -> Locking:
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
        At least 1. It is 1 for a mesh that is no sheet or bar along the axes, for the twist of a
        bar, and where quadratic tetrahedra bend about one axis: five along a side are 7 % too
        stiff there, however thin they are.

    Notes
    -----
    Linear tetrahedra: every vertex is put where Kirchhoff's plate of uniform curvature has it, and
    the strain energy of the tetrahedra is divided by the plate's. Of hexahedra h wide and t/n high,
    cut in five, and of an isotropic material the leading terms are

        bending  1 + 2 G (1 - ν²)/E (h/t)²      shear that a uniform strain cannot be without
        twist    1 + n² C₃₃/(4 G) (h/t)⁴        crossing diagonals strain the thickness

    Quadratic tetrahedra hold a uniform curvature as it is; they lock where the twist varies, as it
    must near a support. A sheet of area A that reaches as far as b from what holds it, A/b = a
    wide, twists

        1 + (h/t)² / (20 (b/a)^1.5 G₁₂/G₁₃ + 28 A/t² G₁₂/(0.29 C₃₃ X))

    times too stiffly, where X, 12/t² times the mean square of the thickness strain that linear
    tetrahedra have in a unit twist, is n² (h/t)⁴ for crossing diagonals, and zero where those on
    top lie over those below, which do not lock.

    How accurate, against the first frequencies of clamped squares (Leissa, NASA SP-160, 1969) with
    cells 1 to 70 thicknesses wide and one to six layers: linear tetrahedra, 0.97 to 1.3 times what
    was found in bending, about the worse axis where the material has two, and 1.1 to 2.2 times in
    twist; quadratic ones, 0.8 to 1.2 times. The second formula is a fit to these, and for clamped
    rectangles of 1:2 and 2:1, held by one side or two, what it adds to 1 is 0.3 to 1.4 times what
    was found. Where a material keeps its volume as one of ν above 0.3 it is taken for one of 0.3,
    as vertices move aside; bending is then 0.7 to 1.7 times what was found. For measured fabrics
    both overestimate the twist: that of quadratic ones up to eight times.
    """
    sheet = sheet_of(vertices, tetrahedra)
    linear = tetrahedra.shape[1] == 4
    if not sheet.long or not (linear or len(sheet.long) == 2):
        return Locking(1.0, 1.0)
    elasticity = _compressible(elasticity)
    plate = _Plate(vertices, tetrahedra[:, :4], sheet.normal)
    if not linear:
        return Locking(1.0, 1.0 + _varying_twist(vertices, held, sheet, plate, elasticity))
    bending = max(plate.times(elasticity, axis, axis) for axis in sheet.long)
    twist = plate.times(elasticity, *sheet.long) if len(sheet.long) == 2 else 1.0
    return Locking(max(bending, 1.0), max(twist, 1.0))


def _compressible(elasticity: FloatArray) -> FloatArray:
    """Return the material with Poisson's ratios lowered to those that the estimate holds for."""
    ratio = volume_ratio(elasticity)
    if ratio <= _RATIO:
        return elasticity
    compliance = np.linalg.inv(elasticity)
    compliance[:3, :3] *= np.where(np.eye(3) > 0, 1.0, _RATIO / ratio)
    return np.linalg.inv(compliance)


class _Plate:
    """A sheet of linear tetrahedra, whose vertices go where those of a curved plate do."""

    def __init__(self, vertices: FloatArray, corners: IntArray, normal: int) -> None:
        self.volume = volumes(vertices, corners)
        self._vertices, self._normal = vertices, normal
        self._gradient = MeanGradient(vertices, corners)
        z = vertices[:, normal]
        self._z = z - self.volume @ z[corners].mean(axis=1) / self.volume.sum()
        z = self._z[corners]
        self._second_moment = float(self.volume @ ((z**2).sum(axis=1) + z.sum(axis=1) ** 2)) / 20

    def strains(self, first: int, other: int) -> FloatArray:
        """Return the strains in a unit curvature along an axis, or in a unit twist along two."""
        x, y = self._vertices[:, first], self._vertices[:, other]
        field = np.zeros_like(self._vertices)
        field[:, first], field[:, other] = self._z * y, self._z * x
        field[:, self._normal] = -x * y / (2 if first == other else 1)
        return strains(self._gradient.of(field))

    def times(self, elasticity: FloatArray, first: int, other: int) -> float:
        """Return the energy of these strains over that of the plate."""
        field = np.zeros_like(self._vertices)
        field[:, self._normal] = self._z**2
        bent, swollen = self.strains(first, other), strains(self._gradient.of(field))

        def work(a: FloatArray, b: FloatArray) -> float:
            return float(self.volume @ ((a @ elasticity) * b).sum(axis=1))

        # The thickness swells where that frees energy: plane stress, as far as there are layers.
        energy, own = work(bent, bent), work(swollen, swollen)
        if own > 0:
            energy -= work(bent, swollen) ** 2 / own
        axes = [axis for axis in range(3) if axis != self._normal]
        plane = [*axes, VOIGT[axes[0], axes[1]]]
        plate = np.linalg.inv(np.linalg.inv(elasticity)[np.ix_(plane, plane)])
        place = plane.index(VOIGT[first, other])
        size = 1 if first == other else 4  # γ² = 4 ε²
        return energy / (size * float(plate[place, place]) * self._second_moment)


def _varying_twist(
    vertices: FloatArray,
    held: NDArray[np.bool_],
    sheet: Sheet,
    plate: _Plate,
    elasticity: FloatArray,
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
    folds = 20 * (reach**2 * thickness / whole) ** 1.5 * twisting / sheared
    swells = 28 * whole / thickness**3 / crossing * twisting / swollen
    return float((sheet.width / thickness) ** 2 / (folds + swells))
