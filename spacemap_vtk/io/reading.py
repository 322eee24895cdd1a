"""Meshes out of files, with errors in words in place of VTK's print."""

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

from spacemap_vtk.datasets.arrays import add_array, copied, to_cells
from spacemap_vtk.datasets.quiet import quiet_vtk
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.texture_atlas import Material, Painted, apply, read_picture
from spacemap_vtk.io.trial import try_in_child
from spacemap_vtk.memory import require

#: Bytes of a point that is made of a picture's, and of the cell beside it.
_MADE = 12 + 8 * 8 + 9
#: What is further away than this, in m, has no square in single precision.
_LARGEST = 1e18


@dataclass
class ReadObject:
    """An object as it stands in its file."""

    #: The mesh.
    data: vtkPointSet
    #: What it is painted with, by its texture coordinates.
    picture: vtkImageData | None = None
    #: What was not found.
    notes: list[str] = field(default_factory=list)


def read_object(path: Path, texture: Path | None = None) -> ReadObject:
    """Read a mesh, and the pictures and colours of its materials."""
    found = registry.read(registry.existing(path), "mesh")
    data = found.data if isinstance(found, Painted) else found
    notes: list[str] = []
    picture = None
    if isinstance(found, Painted) and texture is None:
        blocks, paint = found.materials()
        picture = apply(blocks, paint.materials)
        notes = paint.notes
        data = vtkMultiBlockDataSet()
        for number, block in enumerate(blocks):
            data.SetBlock(number, block)
    made = merged(data, path)
    if texture is not None:
        pixels = read_picture(texture)
        coordinates = made.GetPointData().GetTCoords()
        if coordinates is None:
            raise InputError(
                f"{path} has no texture coordinates",
                key="texture",
                value=str(texture),
                cure="Leave texture out, or give the mesh coordinates in the program it is from.",
            )
        picture = apply([made], [Material(pixels, coordinates=coordinates.GetName())])
    return ReadObject(made, picture, notes)


def read_blocks(path: Path) -> Any:
    """Read a file of a mesh as it is."""
    found = registry.read(registry.existing(path), "mesh")
    return found.data if isinstance(found, Painted) else found


def read_with_vtk(path: Path, module: str, name: str) -> Any:
    """Read a file with a reader of VTK's."""
    made = vtk_reader(path, module, name).GetOutputDataObject(0)
    check_numbers(made, path)
    return made


def vtk_reader(path: Path, module: str, name: str) -> Any:
    """Return a reader of VTK's that has read a file."""
    try_in_child(path, f"{__name__}:read_with_vtk", module, name)
    # Without pyvista, which ParaView's Python has not, and which would refuse a file for a
    # harmless message.
    with quiet_vtk(path):
        reader = getattr(importlib.import_module(f"vtkmodules.{module}"), name)()
        reader.SetFileName(str(path))
        reader.Update()
        made = reader.GetOutputDataObject(0)
    if made is None:
        raise InputError(f"{path}: VTK found nothing in it", key="file")
    return reader


def merged(data: Any, path: Path | str) -> vtkPointSet:
    """Return one point set out of whatever a file holds."""
    # Blocks are appended. An array that some blocks lack is filled up with NaN or 0 there, a colour
    # with white, so that none is lost, and the cell array ``block`` numbers the blocks. Points
    # without any cell get one each, so that they can be seen.
    blocks = [block for block in leaves(data) if block.GetNumberOfPoints()]
    if not blocks:
        raise GeometryError(f"{path}: there are no points in it")
    for block in blocks:
        if block.IsA("vtkUnstructuredGrid") and block.GetCells() is None:
            block.AllocateExact(0, 0)  # of a file that ends before them; what appends would crash
        _check_numbers(block, path)
        if not block.IsA("vtkPointSet"):  # a picture in three dimensions says where each point is
            require(_MADE * block.GetNumberOfPoints(), f"{path}: its points and cells")
    surfaces = all(block.IsA("vtkPolyData") for block in blocks)
    if len(blocks) > 1:
        blocks = [copied(block) for block in blocks]
        for number, block in enumerate(blocks):
            values = np.full(block.GetNumberOfCells(), number, dtype=np.int32)
            add_array(block.GetCellData(), "block", values)
        _fill_up([(block.GetPointData(), block.GetNumberOfPoints()) for block in blocks])
        _fill_up([(block.GetCellData(), block.GetNumberOfCells()) for block in blocks])
    if surfaces and len(blocks) == 1:
        result = blocks[0]
    else:
        append: Any = vtkAppendPolyData() if surfaces else vtkAppendFilter()
        for block in blocks:
            append.AddInputData(block)
        append.Update()
        result = append.GetOutput()
        result.GetFieldData().ShallowCopy(blocks[0].GetFieldData())
    if result.GetPoints() is None:  # of a lattice that ends before it begins
        raise GeometryError(f"{path}: there are no points in it")
    _name_roles(result)
    if result.GetNumberOfCells() == 0:
        result = _dotted(result)
    largest = np.abs(vtk_to_numpy(result.GetPoints().GetData())).max(axis=1)
    good = largest < _LARGEST  # not so for NaN
    if not good.all():
        raise GeometryError(
            f"{path}: {np.count_nonzero(~good)} of {len(good)} points are not finite, or further "
            f"away than {_LARGEST:g}; the first is number {np.argmin(good)}",
            cure="Remove or repair them; a mesh program's cleaning does that.",
        )
    return result


def check_numbers(data: Any, path: Path | str) -> None:
    """Refuse cells of points that are not there, in all that a file holds."""
    # Asked for where another process reads first, too: of wild memory a reader may make a mesh
    # there, and its end in this one.
    for block in leaves(data):
        if block.GetNumberOfPoints():
            _check_numbers(block, path)


def _check_numbers(block: vtkDataSet, path: Path | str) -> None:
    """Refuse cells of points that are not there: VTK does not look, and reads wild memory."""
    if block.IsA("vtkUnstructuredGrid"):
        parts = [block.GetCells()]
    elif block.IsA("vtkPolyData"):
        parts = [block.GetVerts(), block.GetLines(), block.GetPolys(), block.GetStrips()]
    else:
        _check_lattice(block, path)
        return
    count = block.GetNumberOfPoints()
    for part in (part for part in parts if part is not None):
        numbers = vtk_to_numpy(part.GetConnectivityArray())
        offsets = vtk_to_numpy(part.GetOffsetsArray())
        if len(offsets) and (
            offsets[-1] != len(numbers) or (np.diff(offsets, prepend=0) < 0).any()
        ):
            raise GeometryError(f"{path}: its cells do not have the corners that it says")
        if len(numbers) and (numbers.min() < 0 or numbers.max() >= count):
            wrong = numbers.min() if numbers.min() < 0 else numbers.max()
            raise GeometryError(
                f"{path}: a cell names point {wrong}", allowed=f"0 to {count - 1}: its points"
            )


def _check_lattice(block: Any, path: Path | str) -> None:
    """Refuse points that do not fill the lattice that a file tells."""
    if not hasattr(block, "GetExtent"):
        return
    ends = block.GetExtent()
    size = [max(last - first + 1, 0) for first, last in zip(ends[::2], ends[1::2], strict=True)]
    count, told, there = math.prod(size), " x ".join(map(str, size)), size
    if block.IsA("vtkRectilinearGrid"):
        axes = (getattr(block, f"Get{axis}Coordinates")() for axis in "XYZ")
        there = [axis.GetNumberOfTuples() if axis is not None else 0 for axis in axes]
    filled = not block.IsA("vtkStructuredGrid") or block.GetPoints().GetNumberOfPoints() == count
    if there != size or not filled:
        raise GeometryError(f"{path}: its points do not fill the lattice of {told} that it tells")


def _name_roles(data: vtkPointSet) -> None:
    """Mark glTF's normals and texture coordinates, which its reader leaves as plain arrays."""
    table = data.GetPointData()
    if table.GetNormals() is None and table.HasArray("NORMAL"):
        table.SetActiveNormals("NORMAL")
    if table.GetTCoords() is None and table.HasArray("TEXCOORD_0"):
        table.SetActiveTCoords("TEXCOORD_0")


def _dotted(data: vtkPointSet) -> vtkPointSet:
    """Return points that each have a cell."""
    result = vtkPolyData()
    result.SetPoints(data.GetPoints())
    result.SetVerts(to_cells(np.arange(data.GetNumberOfPoints())[:, None]))
    result.GetPointData().ShallowCopy(data.GetPointData())
    result.GetFieldData().ShallowCopy(data.GetFieldData())
    return result


def leaves(data: Any) -> Iterator[vtkDataSet]:
    if isinstance(data, vtkCompositeDataSet):
        place = data.NewIterator()
        place.InitTraversal()
        while not place.IsDoneWithTraversal():
            yield from leaves(place.GetCurrentDataObject())
            place.GoToNextItem()
    elif isinstance(data, vtkDataSet):
        yield data


def _fill_up(tables: list[tuple[vtkFieldData, int]]) -> None:
    """Give every table every array; those of different sizes under one name stay as they are."""
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
