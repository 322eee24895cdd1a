"""Constants of a composite over deformed cloth, cell by cell of its sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import (
    add_array,
    array_of,
    elements_of,
    points_of,
    to_cells,
    to_points,
)
from spacemap_vtk.embedding.plane_slopes import PlaneSlopes
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.unit_cell import UnitCell, make_unit_cell
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.scenes.composite import fibre_share, find_unit_cell
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.unit_cell.homogenise import homogenise
from spacemap_vtk.unit_cell.mixtures import UPPER
from spacemap_vtk.unit_cell.phases import stretch_factors
from spacemap_vtk.unit_cell.voxel_elasticity import symmetric

#: Largest step of the shear angle in the table [degrees].
_STEP = 10.0
#: Range of the stretch of area from which on the table has two of them.
_AREA_RANGE = 0.01
#: Largest shear angle of a unit cell [degrees].
_MOST = 75.0


@dataclass(frozen=True)
class CompositeMap:
    """Constants of each cell of a sheet, in axes along its weft."""

    corners: Floats
    """Deformed vertices of the mid-surface [m], (V, 3)."""
    quads: Ints
    """(cells, 4)."""
    weft: Floats
    """Unit vector along the weft: the axis x of the constants, (cells, 3)."""
    across: Floats
    """Unit vector across it in the cloth: their axis y, (cells, 3)."""
    stretch: Floats
    """Stretch along weft and warp, (cells, 2)."""
    shear: Floats
    """Angle by which the warp leans towards the weft [degrees], (cells,)."""
    stiffness: Floats
    """(cells, 6, 6) [Pa]."""
    thickness: Floats
    """Thickness of the composite [m], (cells,)."""
    fibre_share: Floats
    """Volume of fibres over that of the composite, (cells,)."""
    angles: Floats
    """Shear angles of the table [degrees]."""
    areas: Floats
    """Stretches of area of the table, one or two."""


def map_constants(
    scene: Scene, time: float | None = None, progress: Progress | None = None
) -> CompositeMap:
    """Compute the constants of each cell of a scene's sheet in its deformed state."""
    stage, patches = find_unit_cell(scene)
    scene.update(time=time)
    if scene.cage_stage is None:
        raise InputError(
            "constants over deformed cloth need a cage that moves the cloth",
            cure="Choose a scene with [modal], such as drape.",
        )
    cage = scene.deformed_cage
    rest, elements = points_of(cage).astype(np.float64), elements_of(cage)
    moved = array_of(cage.GetPointData(), "displacement", "the cage")
    surface = find_mid_surface(rest, elements)
    if surface is None or surface.normal != 2:
        raise InputError(
            "constants over deformed cloth need a sheet: a cage of one layer of cells",
            cure='Set modal.elements = "sheet" and cage.divisions of one cell through the cloth.',
        )
    count = len(surface.pairs)
    centres = surface.to_nodes(rest)[:count][surface.quads].mean(axis=1)
    weft, warp = PlaneSlopes(centres, rest, elements).compute(moved)
    stretch = np.stack([np.linalg.norm(one, axis=1) for one in (weft, warp)], axis=1)
    weft, warp = weft / stretch[:, :1], warp / stretch[:, 1:]
    sine = np.einsum("nc,nc->n", weft, warp)
    across = warp - sine[:, None] * weft
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    shear = np.degrees(np.arcsin(np.clip(sine, -1, 1)))
    if abs(shear).max() > _MOST:
        raise InputError(
            f"the cloth is sheared by {abs(shear).max():.0f}°, where yarns have no room",
            allowed=f"at most {_MOST:g}°",
        )
    found = tabulate_constants(stage, patches, shear, stretch.prod(axis=1), progress)
    return CompositeMap(
        surface.to_nodes(rest + moved)[:count],
        surface.quads,
        weft,
        across,
        stretch,
        shear,
        found.stiffness,
        found.thickness,
        found.fibre_share,
        found.angles,
        found.areas,
    )


class Tabulated(NamedTuple):
    """Constants interpolated in a table of shear angles and stretches of area."""

    stiffness: Floats
    """(n, 6, 6) [Pa]."""
    thickness: Floats
    """(n,) [m]."""
    fibre_share: Floats
    """Volume of fibres over that of the composite, (n,)."""
    angles: Floats
    """Shear angles of the table [degrees]."""
    areas: Floats
    """Stretches of area of the table, one or two."""


def tabulate_constants(
    stage: UnitCell,
    patches: vtkUnstructuredGrid,
    shear: Floats,
    area: Floats,
    progress: Progress | None = None,
) -> Tabulated:
    """Interpolate constants for shear angles [degrees] and stretches of area, (n,) each."""
    voxels, spacing = make_unit_cell(stage, patches, stage.voxels)
    low, high = float(shear.min()), float(shear.max())
    angles = np.linspace(low, high, max(2, 1 + int(np.ceil((high - low) / _STEP))))
    if high - low < 1e-6:
        angles = np.array([low, low + 1.0])
    areas = np.array([area.min(), area.max()])
    if np.ptp(areas) < _AREA_RANGE:
        areas = area.mean(keepdims=True)
    table = np.empty((len(areas), len(angles), len(UPPER[0])))
    # A mould keeps the height; without one, the volume is kept.
    height = None if stage.thickness is None else 1.0
    for number, (row, column) in enumerate(np.ndindex(*table.shape[:2])):

        def report(share: float, number: int = number) -> None:
            if progress is not None:
                progress((number + share) / (len(areas) * len(angles)))

        gradient = np.diag(stretch_factors(float(areas[row]), height))
        sheared = stage.gradient(voxels, spacing, float(angles[column]))
        gradient = gradient if sheared is None else sheared @ gradient
        phases = stage.assign(voxels, spacing, gradient)
        found = homogenise(phases, spacing, report_progress=report)[0]
        table[row, column] = found.stiffness[UPPER]
    upper = CubicSpline(angles, table, axis=1)(shear)
    share = (area - areas[0]) / (areas[-1] - areas[0]) if len(areas) > 1 else np.zeros_like(area)
    stiffness = symmetric(upper[0] + share[:, None] * (upper[-1] - upper[0]))
    grown = area * np.cos(np.radians(shear))
    depth = spacing[2] * len(voxels.fraction)
    thickness = depth / grown if stage.thickness is None else np.full_like(area, stage.thickness)
    fibres = fibre_share(voxels, stage.packing) * depth / (thickness * grown)
    return Tabulated(stiffness, thickness, fibres, angles, areas)


def map_as_rows(found: CompositeMap) -> list[list[object]]:
    """Return a table with one row for each cell, headings first."""
    centres = found.corners[found.quads].mean(axis=1)
    names = [f"C{i + 1}{j + 1}_Pa" for i, j in zip(*UPPER, strict=True)]
    heading = ["x_m", "y_m", "z_m", "weft_x", "weft_y", "weft_z", "across_x", "across_y"]
    heading += ["across_z", "stretch_weft", "stretch_warp", "shear_deg", "thickness_m"]
    heading += ["fibre_share", *names]
    columns = np.column_stack(
        [
            *(centres, found.weft, found.across, found.stretch, found.shear, found.thickness),
            found.fibre_share,
            found.stiffness[:, UPPER[0], UPPER[1]],
        ]
    )
    return [heading, *columns.tolist()]


def map_as_surface(found: CompositeMap) -> Any:
    """Return the mid-surface with the constants as arrays of its cells."""
    surface = vtkPolyData()
    surface.SetPoints(to_points(found.corners))
    surface.SetPolys(to_cells(found.quads))
    data = surface.GetCellData()
    add_array(data, "shear", found.shear)
    add_array(data, "stretch", found.stretch)
    add_array(data, "thickness", found.thickness)
    add_array(data, "fibre_share", found.fibre_share)
    add_array(data, "weft", found.weft)
    add_array(data, "across", found.across)
    add_array(data, "stiffness", found.stiffness[:, UPPER[0], UPPER[1]])
    compliance = np.linalg.inv(found.stiffness)
    add_array(data, "youngs_modulus_weft", 1 / compliance[:, 0, 0])
    add_array(data, "youngs_modulus_across", 1 / compliance[:, 1, 1])
    add_array(data, "shear_modulus", 1 / compliance[:, 5, 5])
    return surface
