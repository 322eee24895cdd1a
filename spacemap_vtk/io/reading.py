"""Meshes out of files, with errors in words in place of VTK's print."""

from __future__ import annotations

import importlib
import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import (
    vtkCompositeDataSet,
    vtkDataSet,
    vtkImageData,
    vtkMultiBlockDataSet,
    vtkPointSet,
    vtkPolyData,
)
from vtkmodules.vtkFiltersCore import vtkAppendFilter, vtkAppendPolyData

from spacemap_vtk.datasets.arrays import add_array, to_cells
from spacemap_vtk.datasets.quiet import quiet_vtk
from spacemap_vtk.errors import GeometryError, InputError, MissingLibraryError
from spacemap_vtk.io import material_files
from spacemap_vtk.io.texture_atlas import Material, apply, read_picture
from spacemap_vtk.io.truncation import CHECKS, truncated

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkFieldData

#: Endings of files that hold an object, read by VTK or, with pyvista, by meshio.
OBJECT_ENDINGS = (
    *(".stl", ".ply", ".obj", ".vtp", ".vtu", ".vtk", ".gltf", ".glb", ".vtm", ".vtmb", ".vtkhdf"),
    *(".vts", ".vtr", ".vti", ".pvtu", ".pvtp", ".pvti", ".pvts", ".pvtr", ".pvtk", ".vtpd"),
    *(".e", ".ex2", ".exo", ".exii", ".case", ".cas", ".cgns", ".neu", ".g", ".tri", ".facet"),
    *(".3ds", ".wrl", ".vrml", ".pts", ".p3d", ".foam", ".xdmf", ".xmf", ".dem", ".nrrd", ".mha"),
    *(".msh", ".inp", ".avs", ".med", ".mesh", ".meshb", ".bdf", ".fem", ".nas", ".vol", ".off"),
    *(".post", ".su2", ".tec", ".ele", ".node", ".ugrid", ".mdpa", ".f3grid", ".h5m", ".hmf"),
)


#: What is further away than this, in m, has no square in single precision.
_LARGEST = 1e18
_OWN_READERS = {
    ".vtu": ("vtkIOXML", "vtkXMLUnstructuredGridReader"),
    ".vtp": ("vtkIOXML", "vtkXMLPolyDataReader"),
    ".vts": ("vtkIOXML", "vtkXMLStructuredGridReader"),
    ".vtr": ("vtkIOXML", "vtkXMLRectilinearGridReader"),
    ".vti": ("vtkIOXML", "vtkXMLImageDataReader"),
    ".vtk": ("vtkIOLegacy", "vtkGenericDataObjectReader"),
    ".stl": ("vtkIOGeometry", "vtkSTLReader"),
    ".obj": ("vtkIOGeometry", "vtkOBJReader"),
    ".ply": ("vtkIOPLY", "vtkPLYReader"),
    ".vtm": ("vtkIOXML", "vtkXMLMultiBlockDataReader"),
    ".vtmb": ("vtkIOXML", "vtkXMLMultiBlockDataReader"),
    ".pvtu": ("vtkIOXML", "vtkXMLPUnstructuredGridReader"),
    ".pvtp": ("vtkIOXML", "vtkXMLPPolyDataReader"),
    ".vtkhdf": ("vtkIOHDF", "vtkHDFReader"),
    ".gltf": ("vtkIOGeometry", "vtkGLTFReader"),
    ".glb": ("vtkIOGeometry", "vtkGLTFReader"),
}


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
    data, reader = _read(path)
    notes: list[str] = []
    ending, picture = path.suffix.lower(), None
    if texture is None and ending in (".obj", ".gltf", ".glb"):
        if ending == ".obj":
            blocks, paint = material_files.of_obj(data, path)
        else:
            blocks = [block for block in _leaves(data) if block.GetNumberOfPoints()]
            paint = material_files.of_gltf(blocks, reader)
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
    """Read a file, with VTK for its commonest formats and pyvista for the rest."""
    return _read(path)[0]


def _read(path: Path) -> tuple[Any, Any]:
    """Return what `read_blocks` does, and VTK's reader if it was one of the common formats."""
    if not path.is_file():
        raise InputError(f"{path}: {'a folder' if path.is_dir() else 'no such file'}", key="file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty", key="file")
    if path.suffix.lower() in CHECKS:
        CHECKS[path.suffix.lower()](path)
    if path.suffix.lower() in _OWN_READERS:
        # Without pyvista, which ParaView's Python has not, and which would refuse a file for a
        # harmless message.
        module, name = _OWN_READERS[path.suffix.lower()]
        with quiet_vtk(path):
            reader = getattr(importlib.import_module(f"vtkmodules.{module}"), name)()
            reader.SetFileName(str(path))
            reader.Update()
            made = reader.GetOutputDataObject(0)
        if made is None:
            raise InputError(f"{path}: VTK found nothing in it", key="file")
        return made, reader
    try:
        import pyvista as pv
    except ImportError:
        raise MissingLibraryError(
            f"{path}: reading {path.suffix} needs pyvista", cure='Run "pip install pyvista".'
        ) from None
    said = io.StringIO()
    try:
        # meshio prints, and ends the program where it cannot read
        with quiet_vtk(path), redirect_stdout(said), redirect_stderr(said), _quiet_logging():
            made = pv.read(path, **_other_format(path))
    except InputError:
        raise
    except ImportError as error:
        raise MissingLibraryError(
            f"{path}: {error}", cure=f'Run "pip install {error.name}".' if error.name else None
        ) from None
    except (Exception, SystemExit) as error:
        # pyvista's and meshio's own: unknown endings, broken headers, missing parts
        why = said.getvalue() if isinstance(error, SystemExit) else str(error)
        known = path.suffix.lower() in OBJECT_ENDINGS
        raise InputError(
            f"{path}: cannot be read: {' '.join(why.split())[:200]}"
            if known
            else f"{path}: no mesh, by its ending",
            key="file",
            allowed="a whole file of a format that pyvista reads: " + ", ".join(OBJECT_ENDINGS),
        ) from None
    if "not closed" in said.getvalue():  # meshio goes on with what there is
        raise truncated(path)
    return made, None


@contextmanager
def _quiet_logging() -> Iterator[None]:
    """Keep what pyvista logs of VTK's errors, which come as exceptions, off the screen."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


def _other_format(path: Path) -> dict[str, str]:
    """Return pyvista's option for a format that has the ending of another one."""
    with path.open("rb") as file:
        begin = file.read(256).lstrip()
    ending = path.suffix.lower()
    if ending == ".msh":
        # Not meshio's reader of ANSYS, which comes first there and takes Gmsh's for its own.
        gmsh = begin.startswith(b"$MeshFormat")
        return {"file_format": "gmsh"} if gmsh else {"force_ext": ".cas"}
    if ending == ".inp" and begin.startswith(b"*"):
        return {"file_format": "abaqus"}  # and not VTK's AVS
    if ending in (".xdmf", ".xmf") and b'Version="3' in begin:
        return {"file_format": "xdmf"}  # VTK's reader knows the second version
    return {}


def merged(data: Any, path: Path) -> vtkPointSet:
    """Return one point set out of whatever a file holds."""
    # Blocks are appended. An array that some blocks lack is filled up with NaN or 0 there, a colour
    # with white, so that none is lost, and the cell array ``block`` numbers the blocks. Points
    # without any cell get one each, so that they can be seen.
    blocks = [block for block in _leaves(data) if block.GetNumberOfPoints()]
    if not blocks:
        raise GeometryError(f"{path}: there are no points in it")
    for block in blocks:
        _check_numbers(block, path)
    surfaces = all(block.IsA("vtkPolyData") for block in blocks)
    if len(blocks) > 1:
        copies = [block.NewInstance() for block in blocks]
        for number, (copy, block) in enumerate(zip(copies, blocks, strict=True)):
            copy.ShallowCopy(block)
            values = np.full(block.GetNumberOfCells(), number, dtype=np.int32)
            add_array(copy.GetCellData(), "block", values)
        _fill_up([(copy.GetPointData(), copy.GetNumberOfPoints()) for copy in copies])
        _fill_up([(copy.GetCellData(), copy.GetNumberOfCells()) for copy in copies])
        blocks = copies
    if surfaces and len(blocks) == 1:
        result = blocks[0]
    else:
        append: Any = vtkAppendPolyData() if surfaces else vtkAppendFilter()
        for block in blocks:
            append.AddInputData(block)
        append.Update()
        result = append.GetOutput()
        result.GetFieldData().ShallowCopy(blocks[0].GetFieldData())
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


def _check_numbers(block: vtkDataSet, path: Path) -> None:
    """Refuse cells of points that are not there: VTK does not look, and reads wild memory."""
    if block.IsA("vtkUnstructuredGrid"):
        parts = [block.GetCells()]
    elif block.IsA("vtkPolyData"):
        parts = [block.GetVerts(), block.GetLines(), block.GetPolys(), block.GetStrips()]
    else:
        return
    count = block.GetNumberOfPoints()
    for part in parts:
        numbers = vtk_to_numpy(part.GetConnectivityArray())
        if len(numbers) and (numbers.min() < 0 or numbers.max() >= count):
            wrong = numbers.min() if numbers.min() < 0 else numbers.max()
            raise GeometryError(
                f"{path}: a cell names point {wrong}", allowed=f"0 to {count - 1}: its points"
            )


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


def _leaves(data: Any) -> Iterator[vtkDataSet]:
    if isinstance(data, vtkCompositeDataSet):
        for index in range(data.GetNumberOfBlocks()):
            yield from _leaves(data.GetBlock(index))
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
