"""Polygons as .stl and .ply files, made in memory.

VTK's writers of these write nowhere but to a disk, and not all of them tell when it is full.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of

#: Triangles that are worked on together: more would take memory, not less time.
_AT_ONCE = 2**16
_SIZES = {"u1": "uchar", "<i4": "int"}
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def stl(triangles: vtkPolyData) -> list[bytes | NDArray[Any]]:
    """Return a binary .stl file."""
    _, numbers = _polygons(triangles)
    records = np.zeros(len(numbers) // 3, _TRIANGLE)
    for begin in range(0, len(records), _AT_ONCE):
        part = records[begin : begin + _AT_ONCE]
        corners = points_of(triangles)[numbers[3 * begin :][: 3 * len(part)]].reshape(-1, 3, 3)
        part["corners"] = corners
        first, second, third = np.moveaxis(corners.astype(np.float64), 1, 0)
        normals = np.cross(second - first, third - first)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        part["normal"] = np.divide(normals, lengths, out=normals, where=lengths > 0)
    head = b"Binary STL by spacemap_vtk".ljust(80, b"\0")  # "solid" would stand for a text file
    return [head, np.array(len(records), "<u4"), records]


def ply(polygons: vtkPolyData) -> list[bytes | NDArray[Any]]:
    """Return a binary .ply file."""
    counts, corners = _polygons(polygons)
    data, given = polygons.GetPointData(), []
    for names, array in (
        (("x", "y", "z"), polygons.GetPoints().GetData() if polygons.GetPoints() else None),
        (("nx", "ny", "nz"), data.GetNormals()),
        (("u", "v"), data.GetTCoords()),
    ):
        if array is not None:
            given.append((names, vtk_to_numpy(array)))
    columns = [name for names, _ in given for name in names]
    vertices = np.empty((polygons.GetNumberOfPoints(), len(columns)), "<f4")
    for names, values in given:
        at = columns.index(names[0])
        vertices[:, at : at + len(names)] = values[:, : len(names)]
    # A polygon is the number of its corners, in one byte if that can hold it, then which they are.
    size = "u1" if counts.max(initial=0) < 256 else "<i4"
    head = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            "comment by spacemap_vtk",
            f"element vertex {len(vertices)}",
            *(f"property float {name}" for name in columns),
            f"element face {len(counts)}",
            f"property list {_SIZES[size]} int vertex_indices",
            "end_header\n",
        ]
    )
    return [head.encode(), vertices, _faces(counts, corners, size)]


def _faces(counts: NDArray[Any], corners: NDArray[Any], size: str) -> NDArray[Any]:
    """Return polygons as .ply files have them: how many corners, and which, one after another."""
    kinds = np.unique(counts)
    if len(kinds) == 1:
        return _alike(corners.reshape(len(counts), -1), size)
    first = np.cumsum(counts) - counts
    lengths = np.dtype(size).itemsize + 4 * counts
    begin = np.cumsum(lengths) - lengths
    faces = np.empty(lengths.sum(), np.uint8)
    for count in kinds:
        rows = np.flatnonzero(counts == count)[:, None]
        made = _alike(corners[first[rows] + np.arange(count)], size)
        faces[begin[rows] + np.arange(made.itemsize)] = made.view(np.uint8).reshape(len(rows), -1)
    return faces


def _alike(corners: NDArray[Any], size: str) -> NDArray[Any]:
    faces = np.empty(len(corners), [("count", size), ("corners", "<i4", corners.shape[1:])])
    faces["count"] = corners.shape[1]
    faces["corners"] = corners
    return faces


def _polygons(data: vtkPolyData) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return how many corners each polygon has, and the corners of all."""
    cells = data.GetPolys()
    if cells.GetNumberOfCells() == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    return np.diff(vtk_to_numpy(cells.GetOffsetsArray())), vtk_to_numpy(
        cells.GetConnectivityArray()
    )
