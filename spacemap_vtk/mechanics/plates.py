"""Plates: what a sheet resists stretching, bending and shearing with, per width.

A fabric stretches as its yarns do and bends as almost nothing: its membrane and its bending
stiffness are two measures, not one modulus and a thickness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elasticity import VOIGT

FloatArray = NDArray[np.float64]

#: Of the transverse shear of a homogeneous plate, which is not uniform over its thickness.
SHEAR_CORRECTION = 5 / 6


@dataclass(frozen=True, eq=False)
class Plate:
    """Stiffness of a sheet per width, symmetric and positive definite."""

    # Strains and curvatures are in the order 11, 22, 2·12 along the axes in the plane: of a fabric
    # whose normal is z, 1 is x, the weft, and 2 is y, the warp. See `homogeneous` for others.

    #: (3, 3) Force per width from strain [N/m].
    membrane: FloatArray
    #: (3, 3) Moment per width from curvature [N m].
    bending: FloatArray
    #: (2, 2) Transverse force per width from the shears γ13, γ23 [N/m].
    shear: FloatArray
    #: Force per width from a strain of the thickness [N/m].
    thickness: float


def homogeneous(elasticity: FloatArray, thickness: float, normal: int = 2) -> Plate:
    """Return the plate that is a solid of some thickness."""
    # Axes 1 and 2 of the plate are the two that follow its normal in a circle: x and y where that
    # is z (2), y and z where it is x (0), z and x where it is y (1). With h the thickness, S the
    # compliance and Q the inverse of its block in the plane (plane stress): membrane Q h, bending
    # Q h³/12, shear 5/6 h times the inverse of S's block of 13 and 23, thickness h/S33.
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
    )


def _inverse(matrix: NDArray[np.floating[Any]], rows: list[int]) -> FloatArray:
    """Return the inverse of a symmetric block, symmetric to the last digit."""
    found = np.linalg.inv(matrix[np.ix_(rows, rows)])
    symmetric: FloatArray = (found + found.T) / 2
    return symmetric
