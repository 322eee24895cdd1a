"""Polygons as the files of other programs have them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals, vtkTriangleFilter

from spacemap_vtk.datasets.arrays import points_of, take_arrays, to_points, to_ragged
from spacemap_vtk.memory import require
from spacemap_vtk.ndarrays import Bools


def corners_of(data: vtkPolyData) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return how many corners each polygon has, and the corners of all."""
    cells = data.GetPolys()
    if cells.GetNumberOfCells() == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    offsets, corners = cells.GetOffsetsArray(), cells.GetConnectivityArray()
    return np.diff(vtk_to_numpy(offsets)), vtk_to_numpy(corners)


def part_of(data: vtkPolyData, chosen: Bools) -> vtkPolyData:
    """Return some polygons, with their points alone."""
    sizes, numbers = corners_of(data)
    used, local = np.unique(numbers[np.repeat(chosen, sizes)], return_inverse=True)
    offsets = np.concatenate(([0], np.cumsum(sizes[chosen])))
    result = vtkPolyData()
    result.SetPoints(to_points(points_of(data)[used]))
    result.SetPolys(to_ragged(offsets, local.ravel()))
    take_arrays(data.GetPointData(), result.GetPointData(), used)
    take_arrays(data.GetCellData(), result.GetCellData(), np.flatnonzero(chosen))
    return result


def triangles_of(data: vtkPolyData) -> vtkPolyData:
    """Return polygons as triangles, with nothing but their corners."""
    bare, cutter = vtkPolyData(), vtkTriangleFilter()
    bare.SetPoints(data.GetPoints())
    bare.SetPolys(data.GetPolys())
    cutter.SetInputData(bare)
    cutter.Update()
    return cutter.GetOutput()


def facing(data: vtkPolyData) -> vtkPolyData:
    """Return polygons of which neighbours face the same side, as readers of such files ask for."""
    if data.GetNumberOfPolys() + data.GetNumberOfStrips() == 0:
        return data
    normals = vtkPolyDataNormals()
    normals.SplittingOff()
    normals.SetInputData(data)
    normals.Update()
    return normals.GetOutput()


def triangle_count(data: vtkPolyData) -> int:
    """Return into how many triangles polygons and strips can be cut."""
    parts = data.GetPolys(), data.GetStrips()
    return sum(each.GetNumberOfConnectivityIds() - 2 * each.GetNumberOfCells() for each in parts)


def require_work(data: vtkPolyData, size: int, ending: str) -> None:
    """Refuse polygons that there is not so much memory to work on."""
    require(
        size,
        f"to write {data.GetNumberOfCells()} polygons as {ending}",
        cure="Lower surface.subdivisions, or write a .vtp, which needs least.",
    )
