"""Arrays of Bézier patches, put where VTK can cut them: on the points.

To cut a curved quadrilateral VTK splits it into flat ones, and copies the row of its cell arrays
once for each of these. Then it reads that copy at the number of the cell, not of the flat one: of
all but the first few cells, past its end (`vtkHigherOrderQuadrilateral::Contour` and `Clip`, so in
VTK 9.2 and still in 9.7). ParaView's *Slice*, *Clip* and *Contour* show nonsense, or crash where
that memory is no one's; with more patches that is more likely, with 200,000 it is certain. Arrays
of points are copied whole, and read right.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import VTK_BEZIER_QUADRILATERAL, vtkDataSetAttributes

from spacemap_vtk.datasets.arrays import add_array, cell_types, cells_of


def arrays_to_points(data: Any) -> None:
    """Move the cell arrays of Bézier patches to the points, where patches that share one agree."""
    # Those of yarns do; `PatchTessellator` hands them to its polygons. An array in which neighbours
    # differ stays where it is.
    if not data.IsA("vtkUnstructuredGrid") or cell_types(data) != [VTK_BEZIER_QUADRILATERAL]:
        return
    cells, points = data.GetCellData(), data.GetPointData()
    patches = None
    for name in [cells.GetArrayName(i) for i in range(cells.GetNumberOfArrays())]:
        array = cells.GetArray(name) if name else None
        if array is None or points.HasArray(name) or name == vtkDataSetAttributes.GhostArrayName():
            continue
        if patches is None:
            patches = cells_of(data, VTK_BEZIER_QUADRILATERAL, "Bézier quadrilaterals")
        values = vtk_to_numpy(array)
        moved = np.zeros((data.GetNumberOfPoints(), *values.shape[1:]), values.dtype)
        moved[patches] = values[:, np.newaxis]
        if (moved[patches] == values[:, np.newaxis]).all():
            add_array(points, name, moved)
            cells.RemoveArray(name)
