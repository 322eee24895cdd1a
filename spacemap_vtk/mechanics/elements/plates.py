"""Plates: what a sheet resists stretching, bending and shearing with, per width.

A fabric stretches as its yarns do and bends as almost nothing: its membrane and its bending
stiffness are two measures, not one modulus and a thickness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.elasticity import VOIGT
from spacemap_vtk.mechanics.elements.materials import check_sizes
from spacemap_vtk.ndarrays import AnyFloats, Floats
from spacemap_vtk.units import GRAVITY

#: Of the transverse shear of a homogeneous plate, which is not uniform over its thickness.
SHEAR_CORRECTION = 5 / 6

#: Transverse shear stiffness of a sheet whose normals stay upright, times cell²/D. Measured on the
#: hung canvas of the scene "catenary", whose first twist has 1.452 Hz in fine cells: its own cells
#: put that 1.0 % too low with 1e3, 0.3 % too high with 1e4, and 3 % too high with 1e5, as curved
#: quadrilaterals lock. More would also cost digits of bending.
UPRIGHT = 1e4


@dataclass(frozen=True, eq=False)
class Plate:
    """Stiffness of a sheet per width, symmetric and positive definite.

    Strains and curvatures are in the order 11, 22, 2·12 along the axes in the plane: of a fabric
    whose normal is z, 1 is x, the weft, and 2 is y, the warp. See `homogeneous` for other normals.
    """

    #: (3, 3) Force per width from strain [N/m].
    membrane: Floats
    #: (3, 3) Moment per width from curvature [N m].
    bending: Floats
    #: (2, 2) Transverse force per width from the shears γ13, γ23 [N/m]; None where normals stay
    #: upright, see `upright`.
    shear: Floats | None = None
    #: Force per width from a strain of the thickness [N/m]; None where that stays as it is.
    thickness: float | None = None
    #: Whether it is a solid's, which resists by the thickness that the sheet has at each place;
    #: what was measured of a sheet holds everywhere.
    local: bool = False


class DataSheet(NamedTuple):
    """The measures of a sheet, named as the parameters of `spacemap_vtk.ModalSolver`."""

    tensile_rigidity: tuple[float, float]
    """Of the warp and of the weft [N/m]."""
    shear_rigidity: float
    """In N/m."""
    poissons_ratio_in_plane: float
    """Contraction along the weft for a stretch along the warp."""
    bending_rigidity: tuple[float, float]
    """Of the warp and of the weft [N m]."""
    bending_length: tuple[float, float]
    """Peirce's, of the warp and of the weft [m]."""
    twisting_rigidity: float
    """D66 [N m]."""
    areal_mass: float
    """In kg/m²."""


def homogeneous(elasticity: Floats, thickness: float, normal: int = 2) -> Plate:
    """Return the plate that is a solid of some thickness.

    Parameters
    ----------
    elasticity : ndarray of float64, shape (6, 6)
        Elasticity matrix along x, y, z [Pa], in the order of
        `spacemap_vtk.mechanics.elements.materials.isotropic`.
    thickness : float
        Above 0 [m].
    normal : int
        Axis of the thickness. Axes 1 and 2 of the plate are the two that follow it in a circle:
        x and y where it is z (2), y and z where it is x (0), z and x where it is y (1).

    Returns
    -------
    Plate
        With h the thickness, S the compliance and Q the inverse of its block in the plane (plane
        stress): membrane Q h, bending Q h³/12, shear 5/6 h times the inverse of S's block of 13
        and 23, thickness h/S33. Of a cage that is not equally thick everywhere h is its mean, and
        each place resists by its own thickness.

    Raises
    ------
    InputError
        If the thickness is not above 0.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> plate = homogeneous(isotropic(1e6, 0.0), 1e-3)
    >>> round(float(plate.membrane[0, 0])), round(float(plate.bending[0, 0] * 1e6), 6)
    (1000, 83.333333)
    """
    if not (np.isfinite(thickness) and thickness > 0):
        raise InputError(
            "no plate is as thick", key="thickness", value=thickness, allowed="above 0 m"
        )
    first, second = (normal + 1) % 3, (normal + 2) % 3
    compliance = np.linalg.inv(elasticity)
    plane = _inverse(compliance, [first, second, VOIGT[first, second]])
    across = _inverse(compliance, [VOIGT[first, normal], VOIGT[second, normal]])
    return Plate(
        plane * thickness,
        plane * thickness**3 / 12,
        SHEAR_CORRECTION * thickness * across,
        thickness / float(compliance[normal, normal]),
        local=True,
    )


def measured(
    plate: Plate,
    *,
    tensile: Sequence[float] | None = None,
    shear: float | None = None,
    ratio: float | None = None,
    bending: Sequence[float] | None = None,
    twisting: float | None = None,
) -> Plate:
    """Return a plate with what was measured of a fabric in place of its own.

    Parameters
    ----------
    plate : Plate
        What holds where nothing was measured.
    tensile : sequence of 2 float, optional
        T1 and T2: force per width over strain of a strip along the warp and of one along the weft,
        whose sides are free [N/m].
    shear : float, optional
        G: shear force per width over the angle γ [N/m].
    ratio : float, optional
        ν12: contraction along the weft for a stretch along the warp.
    bending : sequence of 2 float, optional
        B1 and B2: moment per width over curvature of such strips [N m].
    twisting : float, optional
        D66: twisting moment per width over 2 κ12 [N m].

    Returns
    -------
    Plate
        With ν = sqrt(ν12 ν21) and ν12/T1 = ν21/T2, along weft and warp

            membrane  1/(1 - ν²) (T2, T1 on the diagonal, ν sqrt(T1 T2) off it), and G
            bending   1/(1 - ν²) (B2, B1 on the diagonal, ν sqrt(B1 B2) off it), and D66

        so that an isotropic solid's E h and E h³/12 make its plate. Without a ratio each keeps the
        ν of its own. New B1 and B2 without D66 make that sqrt(B1 B2) / (2 (1 + ν)), after Huber,
        which is a homogeneous plate's; new T1 and T2 without G likewise. With measured T1 and T2,
        or B1 and B2, the normals stay upright (see `upright`), as those of cloth are taken to.

    Raises
    ------
    InputError
        If what was measured is not above 0, or the plate would not be positive definite; with the
        key of the parameter of `spacemap_vtk.ModalSolver` that says so.
    """
    for key, given, unit in (
        ("tensile_rigidity", tensile, "N/m"),
        ("shear_rigidity", shear, "N/m"),
        ("bending_rigidity", bending, "N.m"),
        ("twisting_rigidity", twisting, "N.m"),
    ):
        if given is not None:
            check_sizes(key, np.ravel(given).tolist(), unit)
    mean = None if ratio is None else _mean_ratio(ratio, *(tensile or strips(plate.membrane)))
    stretched = _along_fabric(plate.membrane, tensile, shear, mean)
    bent = _along_fabric(plate.bending, bending, twisting, mean)
    if tensile is None and bending is None:
        return replace(plate, membrane=stretched, bending=bent)
    return Plate(stretched, bent)


def bending_length(rigidity: float, areal_mass: float) -> float:
    """Return Peirce's bending length c of a fabric.

    Parameters
    ----------
    rigidity : float
        What a strip resists bending with: moment per width over curvature [N m].
    areal_mass : float
        Mass per area [kg/m²].

    Returns
    -------
    float
        c = (B/w)^(1/3) [m], w the weight of a unit area on Earth: half the length of a strip that
        hangs over an edge with its chord at 41.5 degrees. F. T. Peirce, "The handle of cloth as a
        measurable quantity", J. Textile Inst. 21 (1930) T377.
    """
    return float(np.cbrt(rigidity / (areal_mass * GRAVITY)))


def data_sheet(plate: Plate, areal_mass: float) -> DataSheet:
    """Return the measures of a sheet as its data sheet has them.

    Parameters
    ----------
    plate : Plate
        What it resists.
    areal_mass : float
        Mass per area [kg/m²].

    Returns
    -------
    DataSheet
        `measured` makes the same plate of it, but for what resists across.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> found = data_sheet(homogeneous(isotropic(1e6, 0.3), 1e-3), 0.3)
    >>> round(found.shear_rigidity, 3), round(found.poissons_ratio_in_plane, 3)
    (384.615, 0.3)
    """
    warp, weft = bending = strips(plate.bending)
    return DataSheet(
        tensile_rigidity=strips(plate.membrane),
        shear_rigidity=float(plate.membrane[2, 2]),
        poissons_ratio_in_plane=float(plate.membrane[0, 1] / plate.membrane[0, 0]),
        bending_rigidity=bending,
        bending_length=(bending_length(warp, areal_mass), bending_length(weft, areal_mass)),
        twisting_rigidity=float(plate.bending[2, 2]),
        areal_mass=areal_mass,
    )


def upright(plate: Plate, cell: float) -> Plate:
    """Return a plate whose normals stay upright in cells of some width [m]."""
    # UPRIGHT D/cell² is enough for every wave that the cells resolve, and no more: so a sheet keeps
    # its digits of bending in float64, however much more or less it resists stretching.
    across = UPRIGHT * float(np.diag(plate.bending).max()) / cell**2
    return replace(
        plate,
        shear=across * np.eye(2) if plate.shear is None else plate.shear,
        thickness=across if plate.thickness is None else plate.thickness,
    )


def strips(stiffness: Floats) -> tuple[float, float]:
    """Return what strips along warp and weft resist whose sides are free, of a (3, 3) matrix."""
    weft, warp = 1 / np.diag(np.linalg.inv(stiffness))[:2]
    return float(warp), float(weft)


def _along_fabric(
    own: Floats, along: Sequence[float] | None, sheared: float | None, ratio: float | None
) -> Floats:
    """Return a (3, 3) matrix with what is given in place of its own."""
    if along is None and sheared is None and ratio is None:
        return own
    warp, weft = strips(own) if along is None else along
    if ratio is None:
        ratio = float(own[0, 1] / np.sqrt(own[0, 0] * own[1, 1]))
    if sheared is None:
        # what a homogeneous sheet does that resists as much along both
        sheared = own[2, 2] if along is None else np.sqrt(warp * weft) / (2 * (1 + ratio))
    mixed = ratio * np.sqrt(warp * weft)
    result = np.array([[weft, mixed, 0], [mixed, warp, 0], [0, 0, 0]]) / (1 - ratio**2)
    result[2, 2] = sheared
    return result


def _mean_ratio(ratio: float, warp: float, weft: float) -> float:
    """Return sqrt(ν12 ν21) from ν12, or refuse what is not positive definite."""
    bound = float(np.sqrt(warp / weft))
    if not 1 - (ratio / bound) ** 2 > 1e-9:
        raise InputError(
            f"no stable sheet has it with {warp:.6g} N/m along the warp and {weft:.6g} N/m along "
            "the weft",
            key="poissons_ratio_in_plane",
            value=ratio,
            allowed=f"between -{bound:.4g} and {bound:.4g}, the root of warp over weft",
            cure="It is the contraction along the weft for a stretch along the warp: was that "
            "along the warp given?",
        )
    return ratio / bound


def _inverse(matrix: AnyFloats, rows: list[int]) -> Floats:
    """Return the inverse of a symmetric block, symmetric to the last digit."""
    found = np.linalg.inv(matrix[np.ix_(rows, rows)])
    return (found + found.T) / 2
