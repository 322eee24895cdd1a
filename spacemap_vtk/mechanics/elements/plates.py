"""Stiffness of a sheet in stretching, bending and shear, per width.

A fabric resists stretching as its yarns do, and hardly resists bending: its membrane stiffness and
its bending stiffness are two separate measurements, not one modulus and a thickness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.elasticity import VOIGT
from spacemap_vtk.mechanics.elements.materials import check_limits
from spacemap_vtk.mechanics.elements.membrane_law import MembraneLaw
from spacemap_vtk.ndarrays import AnyFloats, Floats
from spacemap_vtk.units import GRAVITY

#: Shear correction factor of a homogeneous plate, whose transverse shear is not uniform over its
#: thickness.
SHEAR_CORRECTION = 5 / 6

#: Transverse shear stiffness of a sheet whose normals stay upright, times cell²/D. It was chosen
#: with the hung canvas of the scene "catenary", whose first twisting mode has 1.452 Hz in fine
#: cells. In the scene's cells this frequency is 1.0 % too low with 1e3, 0.3 % too high with 1e4,
#: and 3 % too high with 1e5, as curved quadrilaterals lock. A larger value would also cost digits
#: of bending.
UPRIGHT = 1e4


@dataclass(frozen=True, eq=False)
class Plate:
    """Stiffness of a sheet per width, symmetric and positive definite.

    Strains and curvatures are in the order 11, 22, 2·12 along the axes in the plane. For a fabric
    with normal z, axis 1 is x, the weft, and axis 2 is y, the warp. See `homogeneous_plate` for
    other normals.
    """

    #: (3, 3) Force per width from strain [N/m].
    membrane: Floats
    #: (3, 3) Moment per width from curvature [N m].
    bending: Floats
    #: (2, 2) Transverse force per width from the shears γ13, γ23 [N/m]; None if normals stay
    #: upright, see `keep_normals_upright`.
    shear: Floats | None = None
    #: Force per width from a strain of the thickness [N/m]; None if the thickness is constant.
    thickness: float | None = None
    #: Whether the stiffness depends on the thickness at each vertex, as that of a solid does; the
    #: measured stiffness of a sheet is the same everywhere.
    follows_thickness: bool = False
    #: Law of the membrane for finite strains; None if the stress is `membrane` times Green's
    #: strain. The undeformed sheet vibrates with `membrane` in any case.
    law: MembraneLaw | None = None
    #: (3,) Curvatures 11, 22, 2·12 of the sheet where nothing holds it flat, positive towards its
    #: normal [1/m]; None if it is flat.
    curvature: Floats | None = None


class DataSheet(NamedTuple):
    """Measured data of a sheet, named as the parameters of `spacemap_vtk.ModalSolver`."""

    tensile_rigidity: tuple[float, float]
    """Tensile rigidity along the warp and along the weft [N/m]."""
    shear_rigidity: float
    """Shear rigidity [N/m]."""
    poissons_ratio_in_plane: float
    """Contraction along the weft for a stretch along the warp."""
    bending_rigidity: tuple[float, float]
    """Bending rigidity along the warp and along the weft [N m]."""
    bending_length: tuple[float, float]
    """Peirce's bending length along the warp and along the weft [m]."""
    twisting_rigidity: float
    """Twisting rigidity D66 [N m]."""
    areal_mass: float
    """Mass per area [kg/m²]."""


def homogeneous_plate(elasticity: Floats, thickness: float, normal: int = 2) -> Plate:
    """Compute the plate of a homogeneous solid of a given thickness.

    Parameters
    ----------
    elasticity : ndarray of float64, shape (6, 6)
        Elasticity matrix along x, y, z [Pa], in the order of
        `spacemap_vtk.mechanics.elements.materials.isotropic`.
    thickness : float
        Thickness h above 0 [m].
    normal : int
        Axis of the thickness. Axes 1 and 2 of the plate follow it cyclically: x and y for normal z
        (2), y and z for normal x (0), z and x for normal y (1).

    Returns
    -------
    Plate
        Membrane Q h, bending Q h³/12, shear 5/6 h times the inverse of S's block of 13 and 23, and
        thickness h/S33. S is the compliance, and Q the inverse of its block in the plane (plane
        stress). If the cage does not have the same thickness everywhere, h is the mean, and the
        stiffness at each vertex follows the thickness there.

    Raises
    ------
    InputError
        If the thickness is not above 0.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> plate = homogeneous_plate(isotropic(1e6, 0.0), 1e-3)
    >>> round(float(plate.membrane[0, 0])), round(float(plate.bending[0, 0] * 1e6), 6)
    (1000, 83.333333)
    """
    if not (np.isfinite(thickness) and thickness > 0):
        raise InputError("the thickness must be above 0 m", key="thickness", value=thickness)
    first, second = (normal + 1) % 3, (normal + 2) % 3
    compliance = np.linalg.inv(elasticity)
    plane = _invert_block(compliance, [first, second, VOIGT[first, second]])
    across = _invert_block(compliance, [VOIGT[first, normal], VOIGT[second, normal]])
    return Plate(
        plane * thickness,
        plane * thickness**3 / 12,
        SHEAR_CORRECTION * thickness * across,
        thickness / float(compliance[normal, normal]),
        follows_thickness=True,
    )


def apply_measurements(
    plate: Plate,
    *,
    tensile: Sequence[float] | None = None,
    shear: float | None = None,
    ratio: float | None = None,
    bending: Sequence[float] | None = None,
    twisting: float | None = None,
) -> Plate:
    """Replace stiffnesses of a plate by those measured on a fabric.

    Parameters
    ----------
    plate : Plate
        Plate whose values are kept where nothing was measured.
    tensile : sequence of 2 float, optional
        T1 and T2: force per width over strain of strips with free sides, along the warp and along
        the weft [N/m].
    shear : float, optional
        Shear rigidity G: shear force per width over the angle γ [N/m].
    ratio : float, optional
        Poisson's ratio ν12: contraction along the weft for a stretch along the warp.
    bending : sequence of 2 float, optional
        B1 and B2: moment per width over curvature of these strips [N m].
    twisting : float, optional
        Twisting rigidity D66: twisting moment per width over 2 κ12 [N m].

    Returns
    -------
    Plate
        Plate with ν = sqrt(ν12 ν21), ν12/T1 = ν21/T2, and along weft and warp

            membrane  1/(1 - ν²) (T2, T1 on the diagonal, ν sqrt(T1 T2) off it), and G
            bending   1/(1 - ν²) (B2, B1 on the diagonal, ν sqrt(B1 B2) off it), and D66

        For an isotropic solid, E h and E h³/12 thus give its plate. Without a ratio, membrane and
        bending each keep their ν. New B1 and B2 without D66 give D66 = sqrt(B1 B2) / (2 (1 + ν)),
        after Huber, which is that of a homogeneous plate; new T1 and T2 without G likewise. With
        measured T1 and T2, or B1 and B2, normals are assumed to stay upright, as in cloth (see
        `keep_normals_upright`).

    Raises
    ------
    InputError
        If a measurement is not above 0, or the plate would not be positive definite. The key of the
        error is the parameter of `spacemap_vtk.ModalSolver` that causes it.
    """
    for key, given, unit in (
        ("tensile_rigidity", tensile, "N/m"),
        ("shear_rigidity", shear, "N/m"),
        ("bending_rigidity", bending, "N.m"),
        ("twisting_rigidity", twisting, "N.m"),
    ):
        if given is not None:
            check_limits(key, np.ravel(given).tolist(), unit)
    mean = (
        None if ratio is None else _mean_ratio(ratio, *(tensile or strip_stiffness(plate.membrane)))
    )
    stretched = _replace_stiffness(plate.membrane, tensile, shear, mean)
    bent = _replace_stiffness(plate.bending, bending, twisting, mean)
    if tensile is None and bending is None:
        return replace(plate, membrane=stretched, bending=bent)
    return Plate(stretched, bent, curvature=plate.curvature)


def bending_length(rigidity: float, areal_mass: float) -> float:
    """Compute Peirce's bending length c of a fabric.

    Parameters
    ----------
    rigidity : float
        Bending rigidity B of a strip: moment per width over curvature [N m].
    areal_mass : float
        Mass per area [kg/m²].

    Returns
    -------
    float
        c = (B/w)^(1/3) [m], where w is the weight of a unit area on Earth. It is half the length of
        a strip that hangs over an edge with its chord at 41.5 degrees. F. T. Peirce, "The handle of
        cloth as a measurable quantity", J. Textile Inst. 21 (1930) T377.
    """
    return float(np.cbrt(rigidity / (areal_mass * GRAVITY)))


def data_sheet(plate: Plate, areal_mass: float) -> DataSheet:
    """Compute the data sheet of a plate.

    Parameters
    ----------
    plate : Plate
        Stiffness of the sheet.
    areal_mass : float
        Mass per area [kg/m²].

    Returns
    -------
    DataSheet
        Data from which `apply_measurements` makes the same plate, except for its stiffness across.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> found = data_sheet(homogeneous_plate(isotropic(1e6, 0.3), 1e-3), 0.3)
    >>> round(found.shear_rigidity, 3), round(found.poissons_ratio_in_plane, 3)
    (384.615, 0.3)
    """
    warp, weft = bending = strip_stiffness(plate.bending)
    return DataSheet(
        tensile_rigidity=strip_stiffness(plate.membrane),
        shear_rigidity=float(plate.membrane[2, 2]),
        poissons_ratio_in_plane=float(plate.membrane[0, 1] / plate.membrane[0, 0]),
        bending_rigidity=bending,
        bending_length=(bending_length(warp, areal_mass), bending_length(weft, areal_mass)),
        twisting_rigidity=float(plate.bending[2, 2]),
        areal_mass=areal_mass,
    )


def keep_normals_upright(plate: Plate, cell: float) -> Plate:
    """Add the stiffness that keeps normals upright in cells of a given width [m]."""
    # UPRIGHT D/cell² is just enough for every wave that the cells resolve. A sheet therefore keeps
    # its digits of bending in float64, whatever its membrane stiffness.
    across = UPRIGHT * float(np.diag(plate.bending).max()) / cell**2
    return replace(
        plate,
        shear=across * np.eye(2) if plate.shear is None else plate.shear,
        thickness=across if plate.thickness is None else plate.thickness,
    )


def strip_stiffness(stiffness: Floats) -> tuple[float, float]:
    """Compute the stiffness of strips with free sides along warp and weft.

    Parameters
    ----------
    stiffness : ndarray of float64, shape (3, 3)
        Membrane or bending stiffness of a `Plate`.

    Returns
    -------
    tuple of 2 float
        Force per width over strain [N/m], or moment per width over curvature [N m], of a strip
        along the warp and one along the weft.
    """
    weft, warp = 1 / np.diag(np.linalg.inv(stiffness))[:2]
    return float(warp), float(weft)


def _replace_stiffness(
    own: Floats, along: Sequence[float] | None, sheared: float | None, ratio: float | None
) -> Floats:
    """Replace those values of a (3, 3) stiffness that are given."""
    if along is None and sheared is None and ratio is None:
        return own
    warp, weft = strip_stiffness(own) if along is None else along
    if ratio is None:
        ratio = float(own[0, 1] / np.sqrt(own[0, 0] * own[1, 1]))
    if sheared is None:
        # that of a homogeneous sheet which is equally stiff along both directions
        sheared = own[2, 2] if along is None else np.sqrt(warp * weft) / (2 * (1 + ratio))
    mixed = ratio * np.sqrt(warp * weft)
    result = np.array([[weft, mixed, 0], [mixed, warp, 0], [0, 0, 0]]) / (1 - ratio**2)
    result[2, 2] = sheared
    return result


def _mean_ratio(ratio: float, warp: float, weft: float) -> float:
    """Compute sqrt(ν12 ν21) from ν12; raise if the plate would not be positive definite."""
    bound = float(np.sqrt(warp / weft))
    if not 1 - (ratio / bound) ** 2 > 1e-9:
        raise InputError(
            f"this ratio is not possible with {warp:.6g} N/m along the warp and {weft:.6g} N/m "
            "along the weft",
            key="poissons_ratio_in_plane",
            value=ratio,
            allowed=f"between -{bound:.4g} and {bound:.4g}, the square root of warp over weft",
            cure="Give the contraction along the weft for a stretch along the warp, not the "
            "reverse.",
        )
    return ratio / bound


def _invert_block(matrix: AnyFloats, rows: list[int]) -> Floats:
    """Invert a symmetric block of a matrix; the result is symmetric to the last digit."""
    found = np.linalg.inv(matrix[np.ix_(rows, rows)])
    return (found + found.T) / 2
