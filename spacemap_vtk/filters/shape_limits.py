"""Whether a cage's shape is within the range of its elements, its material and its cloth.

Vertices are (V, 3), undeformed and deformed [m]. Strains (T, 6) are Green's, as
`spacemap_vtk.mechanics.modal.model.Model.strain_and_stress` returns them. A cage that is a sheet
has a mid-surface.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPointSet, vtkUnstructuredGrid

from spacemap_vtk.datasets.cloth_data import cloth_of, cloth_stamp
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.mechanics.contact.crossing import count_crossed_cells
from spacemap_vtk.mechanics.elements.deformation import (
    find_tightest_fold,
    largest_stretch,
    shear_angles,
    stretch_of,
)
from spacemap_vtk.mechanics.elements.inversion import count_inverted
from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Ints

#: Field array of a cage: least crimp of the yarns of which its stiffness is made.
LAW_CRIMP = "least_crimp"


def check_folds(
    stage: Stage,
    grid: vtkUnstructuredGrid,
    rest: Floats,
    moved: Floats,
    surface: MidSurface | None,
) -> None:
    """Check the folds of a sheet against its cells, and against the thickness of its cloth."""
    if surface is None:
        return
    turn, curvature, lean = find_tightest_fold(rest, moved, surface)
    stage.check_limit("fold", turn)
    stage.check_limit("lean", lean)
    cloth = _room_of(grid)
    if cloth is not None:
        stage.check_limit("thick_fold", cloth.half_thickness * curvature)


def check_crossing(stage: Stage, moved: Floats, surface: MidSurface | None) -> None:
    """Check that a sheet does not pass through itself."""
    if surface is None:
        return
    count, total = count_crossed_cells(moved, surface), len(surface.quads)
    found = f"{count} of {total} cells of the sheet pass through others"
    stage.check_limit("crossing", count / total, found=found)


def check_inversion(
    stage: Stage, rest: Floats, moved: Floats, cells: Ints, surface: MidSurface | None
) -> None:
    """Check that no element is turned inside out."""
    count = count_inverted(rest, moved - rest, cells, surface)
    total, kind = (
        (len(cells), "tetrahedra")
        if surface is None
        else (len(surface.quads), "cells of the sheet")
    )
    found = f"{count} of {total} {kind} are turned inside out"
    stage.check_limit("inversion", count / total, found=found)


def check_strains(
    stage: Stage, grid: vtkUnstructuredGrid, strain: Floats, model: Model, linear: bool = False
) -> None:
    """Check strains against the range of linear laws of material, if the cage has one."""
    nonlinear = model.plate is not None and model.plate.law is not None
    if not nonlinear:
        stage.check_limit("strain", largest_stretch(strain, model.pencil.surface is not None))
    crimp = grid.GetFieldData().GetArray(LAW_CRIMP)
    # A linear motion has the tangent of a nonlinear law. About a state that is strained already,
    # its range is not measured.
    if crimp is not None and (not nonlinear or (linear and model.displacement is None)):
        stage.check_limit("law", float(abs(strain[:, :2]).max()) / crimp.GetValue(0))


def check_yarns(stage: Stage, weave: vtkPointSet, strain: Floats, keeps_length: bool) -> None:
    """Check what the yarns of a weave do in a cage that is strained."""
    cloth = _room_of(weave)
    if cloth is None:
        return
    if not keeps_length:
        stage.check_limit("embedded", float(abs(stretch_of(strain[:, :2])).max(initial=0.0)))
    if cloth.locking_angle > 0.0:
        sheared = float(abs(shear_angles(strain)).max(initial=0.0))
        stage.check_limit("locked", sheared / cloth.locking_angle)


class _Room(NamedTuple):
    """How far the yarns of a cloth are from each other and from its middle."""

    half_thickness: float
    """[m]"""
    locking_angle: float
    """Angle of shear at which neighbours of a family touch [rad]."""


#: By the stamp of the cloth: a film asks for each frame.
_rooms: dict[int, _Room] = {}


def _room_of(data: vtkDataObject) -> _Room | None:
    stamp = cloth_stamp(data)
    if stamp is None:
        return None
    found = _rooms.get(stamp)
    if found is None:
        cloth = cloth_of(data)
        assert cloth is not None
        widths = [float((yarns.aspect * yarns.diameter).max()) for yarns in cloth.yarns]
        shares = [w / f.spacing for w, f in zip(widths, cloth.families, strict=True)]
        half = cloth.level + cloth.sheet_thickness / 2
        found = _Room(half, math.acos(min(max(shares), 1.0)))
        _rooms.clear()
        _rooms[stamp] = found
    return found
