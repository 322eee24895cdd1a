"""Extract the surface of a grid; the topology is kept while only the points move."""

from __future__ import annotations

from math import ceil, log2
from typing import Any

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

from spacemap_vtk.datasets.arrays import cell_types, copy_rows, points_of, to_points
from spacemap_vtk.datasets.geometry_snapshot import ConnectivitySnapshot
from spacemap_vtk.errors import GeometryError

#: VTK types of cells with straight edges. VTK's function for this test was renamed in 9.6.
_STRAIGHT = {*range(17), 41, 42}
#: VTK's names of the arrays with the original numbers of points and cells.
_POINTS = "vtkOriginalPointIds"
_CELLS = "vtkOriginalCellIds"


class SurfaceExtractor:
    """Outer faces, lines and points of a grid with cells of any type."""

    _kept: tuple[ConnectivitySnapshot, vtkPolyData, Any] | None = None

    def extract(self, grid: vtkPointSet, subdivisions: int, output: vtkPolyData) -> None:
        """Write the surface at the current points into the output."""
        if grid.GetNumberOfCells() == 0:
            raise GeometryError(
                f"the input has {grid.GetNumberOfPoints()} points and no cells to draw"
            )
        if not isinstance(grid, vtkUnstructuredGrid):
            output.ShallowCopy(extract_surface(grid, 0))
            return
        if any(kind not in _STRAIGHT for kind in cell_types(grid)):
            output.ShallowCopy(extract_surface(grid, ceil(log2(subdivisions))))
            return
        if self._kept is None or not self._kept[0].matches(grid):
            # Arrays may change between calls, so they are left out here and copied at each call.
            bare = grid.NewInstance()
            bare.CopyStructure(grid)
            skin = extract_surface(bare, 0)
            points = vtk_to_numpy(skin.GetPointData().GetArray(_POINTS)).copy()
            cells = vtk_to_numpy(skin.GetCellData().GetArray(_CELLS)).copy()
            skin.GetPointData().Initialize()
            skin.GetCellData().Initialize()
            self._kept = ConnectivitySnapshot(grid), skin, (points, cells)
        _, skin, (points, cells) = self._kept
        output.CopyStructure(skin)
        output.SetPoints(to_points(points_of(grid)[points]))
        for source, target, rows in (
            (grid.GetPointData(), output.GetPointData(), points),
            (grid.GetCellData(), output.GetCellData(), cells),
        ):
            copy_rows(source, target, rows)
        output.GetFieldData().ShallowCopy(grid.GetFieldData())


def extract_surface(grid: vtkPointSet, level: int) -> vtkPolyData:
    maker = vtkDataSetSurfaceFilter()
    maker.SetInputData(grid)
    maker.SetNonlinearSubdivisionLevel(level)
    maker.SetPassThroughPointIds(level == 0)
    maker.SetPassThroughCellIds(level == 0)
    maker.SetOriginalPointIdsName(_POINTS)
    maker.SetOriginalCellIdsName(_CELLS)
    maker.Update()
    return maker.GetOutput()
