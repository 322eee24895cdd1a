"""Signed distance from a closed surface, sampled on a grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersCore import (
    vtkCleanPolyData,
    vtkFeatureEdges,
    vtkImplicitPolyDataDistance,
    vtkPolyDataNormals,
    vtkTriangleFilter,
)
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from spacemap_vtk.datasets.arrays import to_array
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats

#: Nodes of the grid along the longest side of the surface, and beyond it at each end.
_NODES, _MARGIN = 48, 3


def sample_distance(mesh: Any) -> tuple[Floats, Floats, float]:
    """Sample the signed distance from a closed surface: values, first node [m] and spacing [m]."""
    outer, clean, triangles = vtkGeometryFilter(), vtkCleanPolyData(), vtkTriangleFilter()
    outer.SetInputData(mesh)
    clean.SetInputConnection(outer.GetOutputPort())
    triangles.SetInputConnection(clean.GetOutputPort())
    triangles.PassLinesOff()
    triangles.PassVertsOff()
    edges = vtkFeatureEdges()
    edges.SetInputConnection(triangles.GetOutputPort())
    edges.FeatureEdgesOff()
    edges.ManifoldEdgesOff()
    edges.BoundaryEdgesOn()
    edges.NonManifoldEdgesOn()
    edges.Update()
    surface, open_edges = triangles.GetOutput(), edges.GetOutput().GetNumberOfCells()
    if not surface.GetNumberOfPolys():
        raise GeometryError("the obstacle's mesh has no surface", key="file")
    if open_edges:
        raise GeometryError(
            f"the obstacle's mesh is not closed: {open_edges} edges do not belong to two triangles",
            key="file",
            cure="Close its holes in a mesh program, or thicken an open surface to a solid.",
        )
    outward = vtkPolyDataNormals()
    outward.SetInputData(surface)
    outward.SplittingOff()
    outward.ConsistencyOn()
    outward.AutoOrientNormalsOn()
    outward.Update()
    distance = vtkImplicitPolyDataDistance()
    distance.SetInput(outward.GetOutput())
    low, high = np.reshape(surface.GetBounds(), (3, 2)).T
    spacing = float((high - low).max()) / (_NODES - 1)
    origin = low - _MARGIN * spacing
    counts = np.ceil((high - low) / spacing).astype(int) + 1 + 2 * _MARGIN
    axes = [start + spacing * np.arange(n) for start, n in zip(origin, counts, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = to_array(np.zeros(len(nodes.reshape(-1, 3))))
    distance.FunctionValue(to_array(np.ascontiguousarray(nodes.reshape(-1, 3))), values)
    return vtk_to_numpy(values).reshape(counts).copy(), origin, spacing
