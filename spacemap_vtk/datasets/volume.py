"""Convert volume meshes with cells of any type to linear tetrahedra."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkPointSet, vtkUnstructuredGrid

from spacemap_vtk.cage import split
from spacemap_vtk.cage.split_quadratic import (
    EIGHT,
    HEXAHEDRON,
    PYRAMID,
    TETRAHEDRON,
    WEDGE,
    split_quadratic,
)
from spacemap_vtk.datasets.arrays import add_array, points_of, to_array, to_cells, to_points
from spacemap_vtk.datasets.extent import FILLED
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import AnyInts, Ints


def _keep_cells(cells: AnyInts) -> AnyInts:
    return cells


def _split_voxels(cells: AnyInts) -> AnyInts:
    return split.SPLITS[8](cells[:, [0, 1, 3, 2, 4, 5, 7, 6]])


def _split_triquadratic(cells: AnyInts) -> AnyInts:
    return split.SPLITS[8](cells[:, EIGHT].reshape(-1, 8))


_TETRAHEDRA = (10, 24, 71, 78)
# For each VTK cell type: the number of corners, and the function that splits the cells.
_KINDS: dict[int, tuple[int, Callable[[AnyInts], AnyInts]]] = {
    **dict.fromkeys(_TETRAHEDRA, (4, _keep_cells)),
    **dict.fromkeys((12, 25, 29, 33, 72, 79), (8, split.SPLITS[8])),
    **dict.fromkeys((13, 26, 31, 32, 73, 80), (6, split.SPLITS[6])),
    **dict.fromkeys((14, 27, 37, 74, 81), (5, split.SPLITS[5])),
    11: (8, _split_voxels),
}
# The same for quadratic cells: the number of nodes, without nodes on faces and in the interior.
_QUADRATIC: dict[int, tuple[int, Callable[[AnyInts], AnyInts]]] = {
    24: (10, partial(split_quadratic, kind=TETRAHEDRON)),
    **dict.fromkeys((25, 29, 33), (20, partial(split_quadratic, kind=HEXAHEDRON))),
    **dict.fromkeys((26, 32), (15, partial(split_quadratic, kind=WEDGE))),
    **dict.fromkeys((27, 37), (13, partial(split_quadratic, kind=PYRAMID))),
}
# All 27 nodes of triquadratic hexahedra are used only if the mesh has no other solid cells: the
# cells would not conform otherwise.
_TRIQUADRATIC = {29: (27, _split_triquadratic)}
# Points, lines and polygons, linear and curved, have no volume.
_NO_VOLUME = {*range(10), 21, 22, 23, 28, 30, 34, 35, 36, 68, 69, 70, 75, 76, 77}


@dataclass
class Volume:
    """Linear tetrahedra made from a mesh."""

    #: The tetrahedra, with the point arrays of the mesh.
    grid: vtkUnstructuredGrid
    #: (n,) Index in the mesh of each point of the grid.
    points: Ints
    #: Messages about changes, for the user.
    notes: list[str] = field(default_factory=list)


def split_into_tetrahedra(data: vtkPointSet, what: str) -> Volume:
    """Split the cells of a mesh into linear tetrahedra."""
    if not isinstance(data, vtkUnstructuredGrid) or data.GetNumberOfCells() == 0:
        raise GeometryError(
            f"{what} is not a volume mesh, but a {data.GetClassName()} of "
            f"{data.GetNumberOfCells()} cells",
            allowed="tetrahedra, hexahedra, wedges, pyramids",
            cure='Fill a surface with method = "tetwild".',
        )
    types = np.array([data.GetCellType(i) for i in range(data.GetNumberOfCells())])
    others = sorted(set(types.tolist()) - _KINDS.keys() - _NO_VOLUME)
    if others:
        raise GeometryError(
            f"{what} has cells of VTK's types {others}",
            allowed="tetrahedra, hexahedra, wedges, pyramids, linear or of higher order",
        )
    vertices = points_of(data).astype(np.float64)
    if not np.isfinite(vertices).all():
        bad = int(np.argmin(np.isfinite(vertices).all(axis=1)))
        raise GeometryError(f"{what}: point {bad} is not finite", cure="Repair the mesh.")
    parts, notes = [], []
    flat_cells = int(np.isin(types, list(_NO_VOLUME)).sum())
    if flat_cells:
        notes.append(f"{what}: {flat_cells} cells without a volume were left out")
    cells = data.GetCells()
    starts, numbers = map(vtk_to_numpy, (cells.GetOffsetsArray(), cells.GetConnectivityArray()))
    solid = {kind for kind in set(types.tolist()) if kind in _KINDS}
    table: dict[int, Any] = _KINDS
    whole = []
    if solid <= _QUADRATIC.keys():  # quadratic cells would not conform with linear neighbours
        table = _TRIQUADRATIC if solid == _TRIQUADRATIC.keys() else _QUADRATIC
    for kind in sorted(solid):
        corners, cut = table[kind]
        rows = starts[:-1][types == kind].astype(np.int64)
        if kind in _TETRAHEDRA:
            whole.append(numbers[rows[:, None] + np.arange(4)].astype(np.int64))
        parts.append(cut(numbers[rows[:, None] + np.arange(corners)].astype(np.int64)))
    if not parts:
        raise GeometryError(f"{what} has no cells with a volume")
    tetrahedra, _, flat = split.repair_tetrahedra(vertices, np.concatenate(parts))
    # Tetrahedra from other cells have any orientation, so only the original ones are counted.
    inverted = split.repair_tetrahedra(vertices, np.concatenate(whole))[1] if whole else 0
    if not len(tetrahedra):
        raise GeometryError(
            f"{what}: all {flat} tetrahedra are flat", allowed="at least one with a volume"
        )
    if inverted:
        notes.append(f"{what}: {inverted} inverted tetrahedra were corrected")
    if flat:
        notes.append(f"{what}: {flat} flat tetrahedra were left out")
    used = np.unique(tetrahedra)
    grid = vtkUnstructuredGrid()
    kept: Ints = np.arange(len(vertices))
    if len(used) < len(vertices):
        kept = used.astype(np.int64)
        tetrahedra = np.searchsorted(used, tetrahedra)
        notes.append(
            f"{what}: {len(vertices) - len(used)} points without a tetrahedron were left out"
        )
    grid.SetPoints(to_points(vertices[kept]))
    grid.SetCells(VTK_TETRA, to_cells(tetrahedra))
    for i in range(data.GetPointData().GetNumberOfArrays()):
        array = data.GetPointData().GetArray(i)
        if array is not None and array.GetName():
            values = vtk_to_numpy(array)
            grid.GetPointData().AddArray(to_array(values[kept], array.GetName()))
    if (share := data.GetFieldData().GetArray(FILLED)) is not None:
        grid.GetFieldData().AddArray(share)
    if len(kept) < len(vertices):
        add_array(grid.GetPointData(), "original_point", kept)
    return Volume(grid, kept, notes)
