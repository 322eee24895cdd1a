"""Prepare polygons for the files of other programs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals, vtkTriangleFilter

from spacemap_vtk.datasets.arrays import copy_rows, points_of, to_points, to_ragged
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Bools


def corners_of(data: vtkPolyData) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the number of corners of each polygon, and the corners of all in one array."""
    cells = data.GetPolys()
    if cells.GetNumberOfCells() == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    offsets, corners = cells.GetOffsetsArray(), cells.GetConnectivityArray()
    return np.diff(vtk_to_numpy(offsets)), vtk_to_numpy(corners)


def extract_polygons(data: vtkPolyData, chosen: Bools) -> vtkPolyData:
    """Return the chosen polygons, with only the points that they use."""
    sizes, numbers = corners_of(data)
    used, local = np.unique(numbers[np.repeat(chosen, sizes)], return_inverse=True)
    offsets = np.concatenate(([0], np.cumsum(sizes[chosen])))
    result = vtkPolyData()
    result.SetPoints(to_points(points_of(data)[used]))
    result.SetPolys(to_ragged(offsets, local.ravel()))
    copy_rows(data.GetPointData(), result.GetPointData(), used)
    copy_rows(data.GetCellData(), result.GetCellData(), np.flatnonzero(chosen))
    return result


def triangulate(data: vtkPolyData) -> vtkPolyData:
    """Return polygons cut into triangles, without their data arrays."""
    bare, cutter = vtkPolyData(), vtkTriangleFilter()
    bare.SetPoints(data.GetPoints())
    bare.SetPolys(data.GetPolys())
    cutter.SetInputData(bare)
    cutter.Update()
    return cutter.GetOutput()


def orient_polygons(data: vtkPolyData) -> vtkPolyData:
    """Orient neighbouring polygons to the same side, as the readers of these files require."""
    if data.GetNumberOfPolys() + data.GetNumberOfStrips() == 0:
        return data
    normals = vtkPolyDataNormals()
    normals.SplittingOff()
    normals.SetInputData(data)
    normals.Update()
    return normals.GetOutput()


def triangle_count(data: vtkPolyData) -> int:
    """Return the number of triangles into which polygons and strips can be cut."""
    parts = data.GetPolys(), data.GetStrips()
    return sum(each.GetNumberOfConnectivityIds() - 2 * each.GetNumberOfCells() for each in parts)


def require_writer_memory(data: vtkPolyData, size: int, ending: str) -> None:
    """Refuse polygons if writing them needs more memory than is free."""
    require_memory(
        size,
        f"to write {data.GetNumberOfCells()} polygons as {ending}",
        cure="Lower surface.subdivisions, or write a .vtp, which needs the least memory.",
    )
