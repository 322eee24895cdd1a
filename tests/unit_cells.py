"""Voxels of a unit cell as the decks of other solvers have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spacemap_vtk.unit_cell.phases import Phases, UnitCellModel, assign_materials


def phases_without_mixing(model: UnitCellModel) -> Phases:
    """Give each voxel the material of the larger share."""
    pure = np.where(model.voxels.fraction >= 0.5, 1.0, 0.0)
    voxels = replace(model.voxels, fraction=pure)
    return assign_materials(
        voxels, model.spacing, model.yarn, model.matrix, np.float64, model.gradient
    )
