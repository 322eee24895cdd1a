"""Read meshes from files, and raise clear errors in place of VTK's printed messages."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import (
    vtkCompositeDataSet,
    vtkDataSet,
    vtkFieldData,
    vtkImageData,
    vtkMultiBlockDataSet,
    vtkPointSet,
    vtkPolyData,
)
from vtkmodules.vtkFiltersCore import vtkAppendFilter, vtkAppendPolyData

from spacemap_vtk.datasets.arrays import add_array, shallow_copy, to_cells
from spacemap_vtk.datasets.vtk_messages import raise_vtk_errors
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.crash_check import check_in_child
from spacemap_vtk.io.texture_atlas import Material, TexturedMesh, apply_materials, read_picture
from spacemap_vtk.memory import require_memory

#: Bytes of one point made from an image or lattice, with one cell.
_MADE = 12 + 8 * 8 + 9
#: Largest coordinate in m; the square of a larger one overflows single precision.
_LARGEST = 1e18


@dataclass
class ReadObject:
    """An object as read from its file."""

    #: The mesh.
    data: vtkPointSet
    #: Picture that is drawn on it by its texture coordinates.
    picture: vtkImageData | None = None
    #: Messages about what was not found.
    notes: list[str] = field(default_factory=list)


def read_object(path: Path, texture: Path | None = None) -> ReadObject:
    """Read a mesh with the pictures and colours of its materials."""
    found = registry.read(registry.require_file(path), "mesh")
    data = found.data if isinstance(found, TexturedMesh) else found
    notes: list[str] = []
    picture = None
    if isinstance(found, TexturedMesh) and texture is None:
        blocks, paint = found.materials()
        picture = apply_materials(blocks, paint.materials)
        notes = paint.notes
        data = vtkMultiBlockDataSet()
        for number, block in enumerate(blocks):
            data.SetBlock(number, block)
    made = merge_blocks(data, path)
    if texture is not None:
        pixels = read_picture(texture)
        coordinates = made.GetPointData().GetTCoords()
        if coordinates is None:
            raise InputError(
                f"{path} has no texture coordinates",
                key="texture",
                value=str(texture),
                cure="Remove texture, or add texture coordinates in a mesh program.",
            )
        picture = apply_materials([made], [Material(pixels, coordinates=coordinates.GetName())])
    return ReadObject(made, picture, notes)


def read_blocks(path: Path) -> Any:
    """Read a mesh file without merging its blocks."""
    found = registry.read(registry.require_file(path), "mesh")
    return found.data if isinstance(found, TexturedMesh) else found


def read_with_vtk(path: Path, module: str, name: str) -> Any:
    """Read a file with one of VTK's readers, and check its cells."""
    made = vtk_reader(path, module, name).GetOutputDataObject(0)
    check_point_ids(made, path)
    return made


def vtk_reader(path: Path, module: str, name: str) -> Any:
    """Return one of VTK's readers after it has read a file."""
    check_in_child(path, f"{__name__}:read_with_vtk", module, name)
    # pyvista is not used: ParaView's Python does not have it, and it would refuse a file because of
    # a harmless message.
    with raise_vtk_errors(path):
        reader = getattr(importlib.import_module(f"vtkmodules.{module}"), name)()
        reader.SetFileName(str(path))
        reader.Update()
        made = reader.GetOutputDataObject(0)
    if made is None:
        raise InputError(f"{path}: VTK found no data in the file", key="file")
    return reader


def merge_blocks(data: Any, path: Path | str) -> vtkPointSet:
    """Merge all blocks of a file into one point set."""
    # An array that some blocks lack is filled with NaN or 0 there, a colour with white, so that no
    # array is lost. The cell array ``block`` numbers the blocks. If there are no cells at all, each
    # point gets one; otherwise it would be invisible.
    blocks = [block for block in leaf_blocks(data) if block.GetNumberOfPoints()]
    if not blocks:
        raise GeometryError(f"{path}: the file has no points")
    for block in blocks:
        if block.IsA("vtkUnstructuredGrid") and block.GetCells() is None:
            block.AllocateExact(0, 0)  # no cells in a truncated file: appending it would crash
        _check_block(block, path)
        if not block.IsA("vtkPointSet"):  # an image or lattice, whose points are yet to be made
            require_memory(_MADE * block.GetNumberOfPoints(), f"{path}: its points and cells")
    surfaces = all(block.IsA("vtkPolyData") for block in blocks)
    if len(blocks) > 1:
        blocks = [shallow_copy(block) for block in blocks]
        for number, block in enumerate(blocks):
            values = np.full(block.GetNumberOfCells(), number, dtype=np.int32)
            add_array(block.GetCellData(), "block", values)
        _fill_missing_arrays(
            [(block.GetPointData(), block.GetNumberOfPoints()) for block in blocks]
        )
        _fill_missing_arrays([(block.GetCellData(), block.GetNumberOfCells()) for block in blocks])
    if surfaces and len(blocks) == 1:
        result = blocks[0]
    else:
        append: Any = vtkAppendPolyData() if surfaces else vtkAppendFilter()
        for block in blocks:
            append.AddInputData(block)
        append.Update()
        result = append.GetOutput()
        result.GetFieldData().ShallowCopy(blocks[0].GetFieldData())
    if result.GetPoints() is None:  # a lattice whose extent is negative
        raise GeometryError(f"{path}: the file has no points")
    _set_active_arrays(result)
    if result.GetNumberOfCells() == 0:
        result = _add_vertex_cells(result)
    largest = np.abs(vtk_to_numpy(result.GetPoints().GetData())).max(axis=1)
    good = largest < _LARGEST  # False for NaN
    if not good.all():
        raise GeometryError(
            f"{path}: {np.count_nonzero(~good)} of {len(good)} points are not finite, or further "
            f"away than {_LARGEST:g}; the first is number {np.argmin(good)}",
            cure="Remove or repair them, for example with the cleaning tool of a mesh program.",
        )
    return result


def check_point_ids(data: Any, path: Path | str) -> None:
    """Refuse a file in which any cell names a point that does not exist."""
    # The process that reads the file first makes this check too. Otherwise a reader might make a
    # mesh of wild memory there without a crash, and then crash this process.
    for block in leaf_blocks(data):
        if block.GetNumberOfPoints():
            _check_block(block, path)


def _check_block(block: vtkDataSet, path: Path | str) -> None:
    """Refuse cells of points that do not exist; VTK does not check, and would read wild memory."""
    if block.IsA("vtkUnstructuredGrid"):
        parts = [block.GetCells()]
    elif block.IsA("vtkPolyData"):
        parts = [block.GetVerts(), block.GetLines(), block.GetPolys(), block.GetStrips()]
    else:
        _check_grid_size(block, path)
        return
    count = block.GetNumberOfPoints()
    for part in (part for part in parts if part is not None):
        numbers = vtk_to_numpy(part.GetConnectivityArray())
        offsets = vtk_to_numpy(part.GetOffsetsArray())
        if len(offsets) and (
            offsets[-1] != len(numbers) or (np.diff(offsets, prepend=0) < 0).any()
        ):
            raise GeometryError(
                f"{path}: the cells do not have the numbers of corners that the file declares"
            )
        if len(numbers) and (numbers.min() < 0 or numbers.max() >= count):
            wrong = numbers.min() if numbers.min() < 0 else numbers.max()
            raise GeometryError(
                f"{path}: a cell refers to point {wrong}", allowed=f"0 to {count - 1}"
            )


def _check_grid_size(block: Any, path: Path | str) -> None:
    """Refuse points that do not fill the lattice whose size the file states."""
    if not hasattr(block, "GetExtent"):
        return
    ends = block.GetExtent()
    size = [max(last - first + 1, 0) for first, last in zip(ends[::2], ends[1::2], strict=True)]
    count, dimensions, actual = math.prod(size), " x ".join(map(str, size)), size
    if block.IsA("vtkRectilinearGrid"):
        axes = (getattr(block, f"Get{axis}Coordinates")() for axis in "XYZ")
        actual = [axis.GetNumberOfTuples() if axis is not None else 0 for axis in axes]
    filled = not block.IsA("vtkStructuredGrid") or block.GetPoints().GetNumberOfPoints() == count
    if actual != size or not filled:
        raise GeometryError(
            f"{path}: the points do not fill the grid of {dimensions} that the file declares"
        )


def _set_active_arrays(data: vtkPointSet) -> None:
    """Mark normals and texture coordinates of glTF, which VTK's reader leaves as plain arrays."""
    table = data.GetPointData()
    if table.GetNormals() is None and table.HasArray("NORMAL"):
        table.SetActiveNormals("NORMAL")
    if table.GetTCoords() is None and table.HasArray("TEXCOORD_0"):
        table.SetActiveTCoords("TEXCOORD_0")


def _add_vertex_cells(data: vtkPointSet) -> vtkPointSet:
    """Return the points of a mesh, each with a cell of one point."""
    result = vtkPolyData()
    result.SetPoints(data.GetPoints())
    result.SetVerts(to_cells(np.arange(data.GetNumberOfPoints())[:, None]))
    result.GetPointData().ShallowCopy(data.GetPointData())
    result.GetFieldData().ShallowCopy(data.GetFieldData())
    return result


def leaf_blocks(data: Any) -> Iterator[vtkDataSet]:
    """Yield the data sets of a composite data set, or a data set itself."""
    if isinstance(data, vtkCompositeDataSet):
        place = data.NewIterator()
        place.InitTraversal()
        while not place.IsDoneWithTraversal():
            yield from leaf_blocks(place.GetCurrentDataObject())
            place.GoToNextItem()
    elif isinstance(data, vtkDataSet):
        yield data


def _fill_missing_arrays(tables: list[tuple[vtkFieldData, int]]) -> None:
    """Give every table every array; same-named arrays of different sizes are left unchanged."""
    patterns: dict[str, Any] = {}
    for table, _ in tables:
        for i in range(table.GetNumberOfArrays()):
            array = table.GetArray(i)
            if array is not None and array.GetName():
                patterns.setdefault(array.GetName(), array)
    for name, pattern in patterns.items():
        kind = vtk_to_numpy(pattern).dtype if pattern.GetNumberOfTuples() else np.dtype(float)
        components = pattern.GetNumberOfComponents()
        for table, count in tables:
            if not table.HasArray(name):
                shape = (count, components) if components > 1 else (count,)
                white = kind == np.uint8 and components in (3, 4)
                fill = np.nan if kind.kind == "f" else 255 if white else 0
                add_array(table, name, np.full(shape, fill, kind))
