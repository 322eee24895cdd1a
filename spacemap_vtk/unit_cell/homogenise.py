"""Effective constants of a unit cell of yarns and matrix.

Stresses have the order xx, yy, zz, yz, xz, xy; shear strains are the engineering ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.unit_cell.phases import Phases, strain_map
from spacemap_vtk.unit_cell.voxel_elasticity import Response, VoxelElasticity

#: Empty layers of voxels above a plate: more change nothing.
_EMPTY_LAYERS = 2
#: Components of a strain in the plane.
_PLANE = (0, 1, 5)


@dataclass(frozen=True)
class Constants:
    """Effective constants of a unit cell."""

    stiffness: Floats
    """(6, 6) [Pa]."""
    expansion: Floats
    """(6,) [1/K]."""
    density: float
    """[kg/m³]."""

    @property
    def compliance(self) -> Floats:
        """(6, 6) [1/Pa]."""
        compliance = np.asarray(np.linalg.inv(self.stiffness), np.float64)
        return compliance

    @property
    def engineering(self) -> dict[str, float]:
        """Moduli [Pa] and Poisson's ratios; the shear moduli are those of an orthotropic body."""
        s = self.compliance
        e = 1 / np.diagonal(s)
        return {
            "Ex": e[0],
            "Ey": e[1],
            "Ez": e[2],
            "Gyz": e[3],
            "Gxz": e[4],
            "Gxy": e[5],
            "nuxy": -s[1, 0] * e[0],
            "nuxz": -s[2, 0] * e[0],
            "nuyz": -s[2, 1] * e[1],
        }


@dataclass(frozen=True)
class PlateStiffness:
    """Stiffness of a cell as a plate that is free above and below."""

    membrane: Floats
    """A, (3, 3) [N/m]: order xx, yy, xy."""
    coupling: Floats
    """B, (3, 3) [N], about the middle plane."""
    bending: Floats
    """D, (3, 3) [N·m]."""


def homogenise(
    phases: Phases,
    spacing: Floats,
    points: int = 1,
    tolerance: float = 3e-3,
    report_progress: Callable[[float], object] | None = None,
) -> tuple[Constants, Response]:
    """Compute the effective constants of a periodic cell.

    Parameters
    ----------
    phases : Phases
        Materials of the voxels.
    spacing : ndarray, shape (3,)
        Size of a voxel [m].
    points : {1, 8}
        Integration points of a voxel.
    tolerance : float
        See `VoxelElasticity.solve`.
    report_progress : callable, optional
        Called with the share of loads that are solved.

    Returns
    -------
    Constants, Response
        The constants, and the displacements under six unit strains.

    Raises
    ------
    SolverError
        If a load does not converge.
    """
    elasticity = VoxelElasticity(phases.stiffness, spacing, points)
    loads = np.eye(6)
    response = elasticity.solve(loads, tolerance, report_progress)
    stiffness = response.energies
    stress = elasticity.mean_power(response.displacements, loads, phases.thermal_stress)
    expansion = np.asarray(np.linalg.solve(stiffness, stress), np.float64)
    if phases.gradient is not None:
        back = np.linalg.inv(turn := strain_map(phases.gradient))
        stiffness, expansion = back.T @ stiffness @ back, turn @ expansion
    return Constants(stiffness, expansion, phases.density), response


def homogenise_plate(
    phases: Phases,
    spacing: Floats,
    points: int = 1,
    tolerance: float = 3e-3,
    report_progress: Callable[[float], object] | None = None,
) -> PlateStiffness:
    """Compute the stiffness of a cell as a plate.

    Parameters
    ----------
    phases : Phases
        Materials of the voxels.
    spacing : ndarray, shape (3,)
        Size of a voxel [m].
    points : {1, 8}
        Integration points of a voxel.
    tolerance : float
        See `VoxelElasticity.solve`.
    report_progress : callable, optional
        Called with the share of loads that are solved.

    Returns
    -------
    PlateStiffness
        A, B and D.

    Raises
    ------
    InputError
        If the deformation of the cell turns the plane.
    SolverError
        If a load does not converge.

    Notes
    -----
    The strain E + z κ is imposed on the cell, above which there is an empty layer: displacements
    are periodic in the plane, and the faces are free (D. Caillerie, "Thin elastic and periodic
    plates", Math. Methods Appl. Sci. 6 (1984) 159).
    """
    gradient = np.eye(3) if phases.gradient is None else phases.gradient
    if abs(gradient[[0, 1, 2, 2], [2, 2, 0, 1]]).max() > 1e-12:
        raise InputError("a plate must keep its plane")
    # Voxels are loaded by FᵀεF.
    to_box = np.linalg.inv(strain_map(gradient)).T
    pitch = spacing[2] * gradient[2, 2]
    depth, rows, _, width = phases.stiffness.shape
    layers = scipy.fft.next_fast_len(depth + _EMPTY_LAYERS, real=True)
    stiffness = np.zeros((layers, rows, 21, width), phases.stiffness.dtype)
    stiffness[:depth] = phases.stiffness
    height = (np.arange(layers) + 0.5 - depth / 2) * pitch
    height[depth:] = 0.0
    loads = np.zeros((6, layers, 6))
    for number, component in enumerate(_PLANE):
        loads[number] = to_box[component]
        loads[3 + number] = height[:, None] * to_box[component]
    # Lengths differ from strains by orders of magnitude; the loads are solved one by one.
    elasticity = VoxelElasticity(stiffness, spacing, points)
    response = elasticity.solve(loads, tolerance, report_progress)
    total = response.energies * layers * pitch
    # Within a layer of voxels the strain z κ varies by h κ, which one point does not see.
    flexural = total[3:, 3:] + total[:3, :3] * pitch**2 / 12
    return PlateStiffness(total[:3, :3], total[:3, 3:], flexural)


def von_mises(stress: NDArray[Any]) -> NDArray[Any]:
    """Compute the equivalent stress by von Mises.

    Parameters
    ----------
    stress : ndarray, shape (6, ...)
        Stress [Pa].

    Returns
    -------
    ndarray, shape (...)
        Equivalent stress [Pa].
    """
    x, y, z, yz, xz, xy = stress
    shear: NDArray[Any] = np.sqrt(
        0.5 * ((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) + 3 * (yz**2 + xz**2 + xy**2)
    )
    return shear
