"""Materials of the voxels of a unit cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.unit_cell.mixtures import (
    UPPER,
    Constituent,
    mix_layers,
    turn_stiffness,
    turn_stress,
)
from spacemap_vtk.unit_cell.rasterise import Voxels

#: Shares of yarn nearer than this to 0 or 1 count as 0 or 1.
_PURE = 1e-6
#: Voxels whose stiffness is turned at a time.
_BLOCK = 50_000
#: Step in which areas of sections are told apart, as a share of their mean.
_AREA_STEP = 0.02
#: Step in which directions of fibres are told apart in a list of materials [degrees].
DIRECTION_STEP = 1


@dataclass(frozen=True)
class UnitCellModel:
    """Voxels of a unit cell and their materials, for files."""

    title: str
    voxels: Voxels
    spacing: Floats
    """Size of a voxel [m], (3,)."""
    yarn: Callable[[float], Constituent]
    """Returns the material of yarns where the area of their section has a share of its mean."""
    matrix: Constituent
    packing: float
    """Share of fibre in the yarns."""
    solver: str = "calculix"
    """Solver for which a deck is written: calculix or abaqus."""
    fields: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """Further arrays of the voxels, x fastest, (voxels,) or (voxels, components)."""
    gradient: Floats | None = None
    """Deformation gradient of the cell, (3, 3)."""


@dataclass(frozen=True)
class Phases:
    """Material of each voxel."""

    stiffness: NDArray[Any]
    """(nz, ny, 21, nx) [Pa]."""
    thermal_stress: NDArray[Any]
    """Stress that keeps it from expanding by one kelvin, (6, nz, ny, nx) [Pa/K]."""
    density: float
    """Mean density [kg/m³]."""
    gradient: Floats | None = None
    """Deformation gradient of the cell, (3, 3). If there is one, stiffness and thermal stress refer
    to the strain FᵀεF, so that the voxels are those of the undeformed cell."""


def assign_materials(
    voxels: Voxels,
    spacing: Floats,
    yarn: Callable[[float], Constituent],
    matrix: Constituent,
    dtype: type = np.float32,
    gradient: Floats | None = None,
) -> Phases:
    """Give each voxel its material; voxels that a surface cuts are mixed in layers.

    Parameters
    ----------
    voxels : Voxels
        Share, number and direction of yarns.
    spacing : ndarray, shape (3,)
        Size of a voxel [m].
    yarn : callable
        Returns the material of yarns where the area of their section has a share of its mean.
    matrix : Constituent
        Material between the yarns.
    dtype : type
        Precision.
    gradient : ndarray, shape (3, 3), optional
        Deformation gradient F by which the cell is deformed: it becomes a parallelepiped.

    Returns
    -------
    Phases
        Materials of the voxels.
    """
    share = voxels.fraction
    flat = share.ravel()
    base = np.concatenate([matrix.stiffness[UPPER], matrix.stiffness @ matrix.expansion])
    made: NDArray[Any] = np.repeat(base.astype(dtype)[:, None], flat.size, axis=1)
    density = np.full(flat.shape, float(matrix.density))
    where = np.flatnonzero((flat > _PURE) & (voxels.yarn.ravel() >= 0))
    cut = np.flatnonzero(flat[where] < 1 - _PURE)
    axes: NDArray[Any] = voxels.direction.reshape(-1, 3)[where]
    normal: NDArray[Any] = _normals(share, spacing)[where[cut]]
    area = voxels.area.ravel()[where]
    if gradient is not None:
        axes = _unit(axes @ gradient.T)
        normal = _unit(normal @ np.linalg.inv(gradient))
    axes, normal = axes.astype(dtype), normal.astype(dtype)
    sections = deformed_areas(area, voxels.base, gradient)
    turned: NDArray[Any] = np.empty((27, len(where)), dtype)
    for section in np.unique(sections):
        material, own = yarn(float(section)), sections == section
        turned[:21, own] = turn_stiffness(material, axes[own])
        turned[21:, own] = turn_stress(material, axes[own])
        density[where[own]] += flat[where[own]] * (material.density - matrix.density)
    mixed = where[cut]
    turned[:, cut] = mix_layers(turned[:, cut], made[:, mixed], flat[mixed].astype(dtype), normal)
    made[:, where] = turned
    if gradient is not None:
        made = _pull_back(made, gradient)
    depth, rows, width = share.shape
    stiffness = made[:21].reshape(21, depth, rows, width).transpose(1, 2, 0, 3)
    return Phases(
        np.ascontiguousarray(stiffness),
        made[21:].reshape(6, depth, rows, width),
        float(density.mean()),
        gradient,
    )


def deformed_areas(area: Floats, base: Floats | None, gradient: Floats | None) -> Floats:
    """Compute areas of sections in the deformed cell, rounded so that yarns have few materials.

    Parameters
    ----------
    area : ndarray
        Areas in the box, over their mean.
    base, gradient : ndarray, shape (3, 3), optional
        Gradients of the maps from the box to the repeat, and to the deformed cell.

    Returns
    -------
    ndarray
        Areas over the mean of the repeat. Fibres keep their volume: where the deformation squeezes
        yarns, matrix leaves them.
    """
    skew = 1.0 if base is None else float(np.linalg.det(base))
    whole = 1.0 if gradient is None else float(np.linalg.det(gradient))
    rounded: Floats = np.rint(area * skew / _AREA_STEP) * _AREA_STEP
    return rounded * (whole / skew)


def pure_voxels(voxels: Voxels) -> dict[str, NDArray[np.bool_]]:
    """Find the voxels that lie wholly in yarns, and those wholly in the matrix.

    Parameters
    ----------
    voxels : Voxels
        Share of yarn.

    Returns
    -------
    dict
        ``yarns`` and ``matrix``: bool, (nz, ny, nx).
    """
    return {"yarns": voxels.fraction > 1 - _PURE, "matrix": voxels.fraction < _PURE}


def list_materials(model: UnitCellModel) -> tuple[NDArray[np.int32], Floats, Floats]:
    """Number the materials of the voxels, each of the larger share, in classes of direction.

    Parameters
    ----------
    model : UnitCellModel
        Voxels of a cell that is not sheared.

    Returns
    -------
    numbers : ndarray, shape (nz, ny, nx)
        Material of each voxel; 0 is the matrix.
    areas : ndarray, shape (materials - 1,)
        Area of the section over its mean, of the materials of yarns.
    axes : ndarray, shape (materials - 1, 3)
        Mean direction of the fibres of a class, whose azimuths and elevations round to the same
        multiple of `DIRECTION_STEP`; z is not negative.
    """
    yarn = model.voxels.fraction >= 0.5
    axes = model.voxels.direction[yarn].astype(np.float64)
    axes *= np.where(axes[:, 2:] < 0, -1.0, 1.0)  # a direction and its opposite are the same
    level = np.hypot(axes[:, 0], axes[:, 1])
    azimuth, elevation = (
        np.rint(np.degrees(np.arctan2(up, along)) / DIRECTION_STEP).astype(np.int32)
        for up, along in ((axes[:, 1], axes[:, 0]), (axes[:, 2], level))
    )
    half = 180 // DIRECTION_STEP
    azimuth = np.where(elevation == 0, azimuth % half, azimuth % (2 * half))
    azimuth[2 * elevation == half] = 0
    section = np.rint(model.voxels.area[yarn] / _AREA_STEP).astype(np.int32)
    keys = np.stack([section, azimuth, elevation], axis=1)
    found, place = np.unique(keys, axis=0, return_inverse=True)
    numbers: NDArray[np.int32] = np.zeros(yarn.shape, np.int32)
    numbers[yarn] = 1 + place.ravel()
    a, e = np.radians(DIRECTION_STEP * found[:, 1:]).T
    centre = np.stack([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)], axis=1)
    axes *= np.sign(np.einsum("nc,nc->n", axes, centre[place.ravel()]))[:, None]
    mean: Floats = np.stack([np.bincount(place.ravel(), column) for column in axes.T], axis=1)
    mean = _unit(mean * np.where(mean[:, 2:] < 0, -1.0, 1.0))
    return numbers, found[:, 0] * _AREA_STEP, mean


def stretch_factors(area: float, height: float | None = None) -> Floats:
    """Compute by what a cell grows along x, y and z.

    Parameters
    ----------
    area : float
        Stretch of its area, which is equal in all directions.
    height : float, optional
        Stretch of its height; by default the volume is kept.

    Returns
    -------
    ndarray, shape (3,)
        Factors.
    """
    return np.array([area**0.5, area**0.5, 1 / area if height is None else height])


def strain_map(gradient: Floats) -> Floats:
    """Compute the matrix T of ε = T (FᵀεF).

    Parameters
    ----------
    gradient : ndarray, shape (3, 3)
        Deformation gradient F.

    Returns
    -------
    ndarray, shape (6, 6)
        T, for engineering shear strains in the order xx, yy, zz, yz, xz, xy.
    """
    inverse = np.linalg.inv(gradient)
    pairs = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
    made = np.empty((6, 6))
    for column, (i, j) in enumerate(pairs):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0 if i == j else 0.5
        strain = inverse.T @ unit @ inverse
        made[:, column] = [strain[k, m] * (1.0 if k == m else 2.0) for k, m in pairs]
    return made


def _pull_back(values: NDArray[Any], gradient: Floats) -> NDArray[Any]:
    """Refer stiffnesses and thermal stresses (27, n) to the strain FᵀεF."""
    turn = strain_map(gradient).astype(values.dtype)
    made = np.empty_like(values)
    for start in range(0, values.shape[1], _BLOCK):
        part = slice(start, start + _BLOCK)
        full = np.empty((6, 6, *values[0, part].shape), values.dtype)
        full[UPPER] = full[UPPER[1], UPPER[0]] = values[:21, part]
        full = np.einsum("ai,abn,bj->ijn", turn, full, turn, optimize=True)
        made[:21, part] = full[UPPER]
        made[21:, part] = turn.T @ values[21:, part]
    return made


def _unit(vectors: NDArray[Any]) -> NDArray[Any]:
    """Return unit vectors."""
    made: NDArray[Any] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return made


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
