"""Voxels of a unit cell as VTK's image."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkImageData

from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.unit_cell.rasterise import Voxels


def fill_image(
    image: vtkImageData,
    voxels: Voxels,
    spacing: Floats,
    packing: float,
    gradient: Floats | None = None,
) -> None:
    """Fill an image with the arrays fraction, yarn, direction and packing of its cells."""
    depth, rows, width = voxels.fraction.shape
    image.SetDimensions(width + 1, rows + 1, depth + 1)
    image.SetSpacing(*spacing)
    direction, area = voxels.direction.reshape(-1, 3), voxels.area
    if gradient is not None:  # of a deformed cell, which is no box
        image.SetDirectionMatrix(*gradient.ravel().tolist())
        direction = direction @ gradient.T
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        direction = direction / np.where(length > 0, length, 1.0)
        area = area * np.linalg.det(gradient)
    data = image.GetCellData()
    add_array(data, "fraction", voxels.fraction.ravel().astype(np.float32))
    add_array(data, "yarn", voxels.yarn.ravel())
    add_array(data, "direction", direction.astype(np.float32))
    local = np.where(voxels.yarn >= 0, packing / area, 0.0)
    add_array(data, "packing", local.ravel().astype(np.float32))
