"""A unit cell: voxels of yarns and matrix, and its effective constants.

Stresses have the order xx, yy, zz, yz, xz, xy; shear strains are the engineering ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.unit_cell.mixtures import (
    Constituent,
    mix_layers,
    turn_stiffness,
    turn_stress,
)
from spacemap_vtk.unit_cell.rasterise import Voxels
from spacemap_vtk.unit_cell.voxel_elasticity import UPPER, Response, VoxelElasticity

#: Shares of yarn nearer than this to 0 or 1 count as 0 or 1.
_PURE = 1e-6
#: Step in which areas of sections are told apart, as a share of their mean.
_AREA_STEP = 0.02
#: Empty layers of voxels above a plate: more change nothing.
_EMPTY_LAYERS = 2
#: Components of a strain in the plane.
_PLANE = (0, 1, 5)


@dataclass(frozen=True)
class Phases:
    """Material of each voxel."""

    stiffness: NDArray[Any]
    """(nz, ny, 21, nx) [Pa]."""
    thermal_stress: NDArray[Any]
    """Stress that keeps it from expanding by one kelvin, (6, nz, ny, nx) [Pa/K]."""
    density: float
    """Mean density [kg/m³]."""


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
        return np.linalg.inv(self.stiffness)

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


def assign_materials(
    voxels: Voxels,
    spacing: Floats,
    yarn: Callable[[int, float], Constituent],
    matrix: Constituent,
    dtype: type = np.float32,
) -> Phases:
    """Give each voxel its material; voxels that a surface cuts are mixed in layers.

    Parameters
    ----------
    voxels : Voxels
        Share, number and direction of yarns.
    spacing : ndarray, shape (3,)
        Size of a voxel [m].
    yarn : callable
        Returns the material of a yarn where the area of its section has a share of its mean.
    matrix : Constituent
        Material between the yarns.
    dtype : type
        Precision.
    """
    share = voxels.fraction
    flat = share.ravel()
    base = np.concatenate([matrix.stiffness[UPPER], matrix.stiffness @ matrix.expansion])
    made = np.repeat(base.astype(dtype)[:, None], flat.size, axis=1)
    density = np.full(flat.shape, float(matrix.density))
    where = np.flatnonzero((flat > _PURE) & (voxels.yarn.ravel() >= 0))
    cut = np.flatnonzero(flat[where] < 1 - _PURE)
    axes = voxels.direction.reshape(-1, 3)[where].astype(dtype)
    normal = _normals(share, spacing)[where[cut]].astype(dtype)
    # Voxels of one yarn with areas alike have one material.
    steps = np.rint(voxels.area.ravel()[where] / _AREA_STEP).astype(np.int64)
    kinds, kind = np.unique(
        np.stack([voxels.yarn.ravel()[where], steps]), axis=1, return_inverse=True
    )
    made_of = [yarn(int(number), step * _AREA_STEP) for number, step in kinds.T.tolist()]
    turned = np.empty((27, len(where)), dtype)
    for material in dict.fromkeys(made_of):
        own = np.array([one == material for one in made_of])[kind.ravel()]
        turned[:21, own] = turn_stiffness(material, axes[own])
        turned[21:, own] = turn_stress(material, axes[own])
        density[where[own]] += flat[where[own]] * (material.density - matrix.density)
    mixed = where[cut]
    turned[:, cut] = mix_layers(turned[:, cut], made[:, mixed], flat[mixed].astype(dtype), normal)
    made[:, where] = turned
    depth, rows, width = share.shape
    stiffness = made[:21].reshape(21, depth, rows, width).transpose(1, 2, 0, 3)
    return Phases(
        np.ascontiguousarray(stiffness),
        made[21:].reshape(6, depth, rows, width),
        float(density.mean()),
    )


def homogenise(
    phases: Phases,
    spacing: Floats,
    points: int = 1,
    tolerance: float = 3e-3,
    report_progress: Callable[[float], None] | None = None,
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
    return (
        Constants(stiffness, np.linalg.solve(stiffness, stress), phases.density),
        response,
    )


def homogenise_plate(
    phases: Phases,
    spacing: Floats,
    points: int = 1,
    tolerance: float = 3e-3,
    report_progress: Callable[[float], None] | None = None,
) -> PlateStiffness:
    """Compute the stiffness of a cell as a plate; parameters are those of `homogenise`.

    Notes
    -----
    The strain E + z κ is imposed on the cell, above which there is an empty layer: displacements
    are periodic in the plane, and the faces are free (D. Caillerie, "Thin elastic and periodic
    plates", Math. Methods Appl. Sci. 6 (1984) 159).
    """
    depth, rows, _, width = phases.stiffness.shape
    layers = scipy.fft.next_fast_len(depth + _EMPTY_LAYERS, real=True)
    stiffness = np.zeros((layers, rows, 21, width), phases.stiffness.dtype)
    stiffness[:depth] = phases.stiffness
    height = (np.arange(layers) + 0.5 - depth / 2) * spacing[2]
    height[depth:] = 0.0
    loads = np.zeros((6, layers, 6))
    for number, component in enumerate(_PLANE):
        loads[number, :, component] = 1.0
        loads[3 + number, :, component] = height
    # Lengths differ from strains by orders of magnitude; the loads are solved one by one.
    elasticity = VoxelElasticity(stiffness, spacing, points)
    response = elasticity.solve(loads, tolerance, report_progress)
    total = response.energies * layers * spacing[2]
    # Within a layer of voxels the strain z κ varies by h κ, which one point does not see.
    flexural = total[3:, 3:] + total[:3, :3] * spacing[2] ** 2 / 12
    return PlateStiffness(total[:3, :3], total[:3, 3:], flexural)


def constituent_stresses(
    stress: NDArray[Any], voxels: Voxels
) -> dict[str, tuple[float, NDArray[Any]]]:
    """Find the largest von Mises stress in yarns and in the matrix, and its place.

    Parameters
    ----------
    stress : ndarray, shape (6, nz, ny, nx)
        Stress [Pa].
    voxels : Voxels
        Voxels that are pure in one of both count for it.

    Returns
    -------
    dict
        ``yarn`` and ``matrix``: the stress [Pa] and the voxel (z, y, x).
    """
    size = von_mises(stress)
    made = {}
    for name, inside in (
        ("yarn", voxels.fraction > 1 - _PURE),
        ("matrix", voxels.fraction < _PURE),
    ):
        if inside.any():
            place = np.unravel_index(np.argmax(np.where(inside, size, -1)), size.shape)
            made[name] = float(size[place]), np.array(place)
    return made


def von_mises(stress: NDArray[Any]) -> NDArray[Any]:
    """Compute the equivalent stress by von Mises [Pa] of stresses (6, …)."""
    x, y, z, yz, xz, xy = stress
    shear: NDArray[Any] = np.sqrt(
        0.5 * ((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) + 3 * (yz**2 + xz**2 + xy**2)
    )
    return shear


def _normals(share: Floats, spacing: Floats) -> Floats:
    """Unit gradient of the share of yarn, (voxels, 3); along z where there is none."""
    padded = np.pad(np.pad(share, ((0, 0), (1, 1), (1, 1)), mode="wrap"), ((1, 1), (0, 0), (0, 0)))
    slopes = []
    for axis in (2, 1, 0):
        # Sobel's operator: differences along one axis, smoothed along the others.
        field = padded
        for other in range(3):
            low, middle, high = (
                np.take(field, range(k, field.shape[other] - 2 + k), axis=other) for k in range(3)
            )
            field = high - low if other == axis else low + 2 * middle + high
        slopes.append(field.ravel() / spacing[2 - axis])
    made = np.stack(slopes, axis=1)
    length = np.linalg.norm(made, axis=1, keepdims=True)
    made = np.divide(made, length, out=np.zeros_like(made), where=length > 0)
    made[length[:, 0] == 0, 2] = 1.0
    return made
