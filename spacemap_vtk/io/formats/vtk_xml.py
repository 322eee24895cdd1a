"""Read and write VTK's XML files, which store everything that a data set has."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import check_folder, write_parts
from spacemap_vtk.io.provenance import (
    NAME,
    attach_record,
    find_record_in_comments,
    finds_record,
    record_comments,
    record_text,
)
from spacemap_vtk.io.registry import lazy_function, reads, writes

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkDataSet, vtkPolyData

#: Bytes that VTK compresses together.
_BLOCK = 2**15
#: Number of these blocks of an array that are sampled to estimate its compressed length.
_SAMPLES = 5
_READERS = {
    ".vtu": "vtkXMLUnstructuredGridReader",
    ".vtp": "vtkXMLPolyDataReader",
    ".vts": "vtkXMLStructuredGridReader",
    ".vtr": "vtkXMLRectilinearGridReader",
    ".vti": "vtkXMLImageDataReader",
    ".vtm": "vtkXMLMultiBlockDataReader",
    ".vtmb": "vtkXMLMultiBlockDataReader",
    ".pvtu": "vtkXMLPUnstructuredGridReader",
    ".pvtp": "vtkXMLPPolyDataReader",
    ".pvts": "vtkXMLPStructuredGridReader",
    ".pvtr": "vtkXMLPRectilinearGridReader",
    ".pvti": "vtkXMLPImageDataReader",
    ".vtpd": "vtkXMLPartitionedDataSetReader",
}


#: Formats whose files name further files, which VTK reads with them.
_MULTI_FILE = (".vtm", ".vtmb", ".pvtu", ".pvtp", ".pvts", ".pvtr", ".pvti", ".vtpd")


@reads(
    *_MULTI_FILE,
    label="VTK XML in several files",
    holds="mesh",
    common=False,
    names=lazy_function("file_references", "names_in_xml"),
)
@reads(".vts", ".vtr", ".vti", label="Other VTK XML", holds="mesh", common=False)
@reads(".vtu", ".vtp", label="VTK XML", holds="mesh")
def read_xml(path: Path) -> Any:
    from spacemap_vtk.io.reading import read_with_vtk

    return read_with_vtk(path, "vtkIOXML", _READERS[path.suffix.lower()])


@writes(".vtu", label="VTK XML", holds=("patches", "cage"))
def write_vtu(file: Path, data: vtkDataSet) -> None:
    """Write any data set as an unstructured grid."""
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    if data.IsA("vtkPolyData"):
        append = vtkAppendFilter()
        append.AddInputData(data)
        append.Update()
        data = append.GetOutput()
    write_xml(file, vtkXMLUnstructuredGridWriter(), data)


@writes(".vtp", label="VTK XML", holds=("surface", "obstacles"))
def write_vtp(file: Path, data: vtkPolyData) -> None:
    """Write a surface."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    write_xml(file, vtkXMLPolyDataWriter(), data)


@writes(".pvtp", label="VTK XML in pieces", holds=("surface",), pieces=True, require=check_folder)
@writes(".pvtu", label="VTK XML in pieces", holds=("patches",), pieces=True, require=check_folder)
def write_pieces(file: Path, pieces: Iterable[vtkDataSet]) -> None:
    """Write a file that names the pieces, and a file for each piece into a folder next to it."""
    from xml.sax.saxutils import quoteattr

    folder, ending = file.with_suffix(""), f".{file.suffix[2:].lower()}"
    folder.mkdir()
    lines: list[str] = []
    names: list[str] = []
    with attach_record(None):  # a single piece cannot be made again from a record
        for number, piece in enumerate(pieces):
            if not piece.GetNumberOfCells():
                continue  # more pieces than yarns; an empty one lacks the others' arrays
            piece_file = folder / f"{folder.name}_{number:04d}{ending}"
            (write_vtp if ending == ".vtp" else write_vtu)(piece_file, piece)
            names.append(quoteattr(f"{folder.name}/{piece_file.name}"))
            lines = lines or list(_array_descriptions(piece))
    kind = "PPolyData" if ending == ".vtp" else "PUnstructuredGrid"
    record = record_comments("  ")
    text = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt32">',
        *(["<!--", *record, "-->"] if record else []),
        f'  <{kind} GhostLevel="0">',
        *lines,
        *(f"    <Piece Source={name}/>" for name in names),
        f"  </{kind}>",
        "</VTKFile>\n",
    ]
    write_parts(file, ["\n".join(text).encode()])


def _array_descriptions(data: vtkDataSet) -> Iterator[str]:
    """Yield descriptions of the arrays, which a reader needs before it opens a piece."""
    from xml.sax.saxutils import quoteattr

    from vtkmodules.util.numpy_support import vtk_to_numpy

    names = {"f": "Float", "i": "Int", "u": "UInt"}

    def line(array: Any, name: str) -> str:
        kind = vtk_to_numpy(array).dtype
        return (
            f'      <PDataArray type="{names[kind.kind]}{8 * kind.itemsize}" '
            f'Name={quoteattr(name)} NumberOfComponents="{array.GetNumberOfComponents()}"/>'
        )

    for kind, table in (("Point", data.GetPointData()), ("Cell", data.GetCellData())):
        normals = table.GetNormals()
        active = "" if normals is None else f" Normals={quoteattr(normals.GetName())}"
        yield f"    <P{kind}Data{active}>"
        for number in range(table.GetNumberOfArrays()):
            yield line(table.GetArray(number), table.GetArrayName(number))
        yield f"    </P{kind}Data>"
    yield "    <PPoints>"
    yield line(data.GetPoints().GetData(), "Points")
    yield "    </PPoints>"


finds_record(".pvtp", ".pvtu")(find_record_in_comments)


def write_xml(file: Path, writer: Any, data: vtkDataSet) -> None:
    """Write a data set with one of VTK's writers, which makes a text in memory."""
    from spacemap_vtk.memory import require_memory

    require_memory(
        2 * _estimate_text_bytes(data),  # VTK's copy and Python's
        f"to write {data.GetNumberOfCells()} cells as {file.suffix.lower()}",
        cure="Lower surface.subdivisions, or use fewer ends and picks.",
    )
    writer.SetDataModeToBinary()
    writer.SetCompressorTypeToZLib()  # of level 5; the writer's first compressor has level 6
    writer.SetInputData(_add_record(data))
    writer.WriteToOutputStringOn()
    done = writer.Write()
    text = writer.GetOutputString()
    fault = writer.GetErrorCode()
    del writer  # frees another copy
    # VTK returns bytes if a name in the data is not UTF-8.
    made = text if isinstance(text, bytes) else text.encode()
    del text
    if not done or fault or not made.endswith(b"</VTKFile>\n"):
        from vtkmodules.vtkCommonMisc import vtkErrorCode

        why = vtkErrorCode.GetStringFromErrorCode(fault)
        raise SpacemapError(f"VTK could not write the {file.suffix.lower()} file: {why}")
    write_parts(file, [made])


def _estimate_text_bytes(data: vtkDataSet) -> int:
    """Estimate the length of data as text, by compressing some blocks of each array."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    arrays = []
    if not data.IsA("vtkImageData"):
        cells = data.GetPolys() if data.IsA("vtkPolyData") else data.GetCells()
        arrays = [data.GetPoints().GetData(), cells.GetConnectivityArray(), cells.GetOffsetsArray()]
    for table in (data.GetPointData(), data.GetCellData()):
        arrays += [table.GetArray(number) for number in range(table.GetNumberOfArrays())]
    size = 0.0
    for array in arrays:
        if array is not None:  # None: an array of texts
            content = np.ascontiguousarray(vtk_to_numpy(array)).reshape(-1).view(np.uint8).data
            begins = range(0, len(content), max(_BLOCK, len(content) // _SAMPLES))
            samples = [content[begin : begin + _BLOCK] for begin in begins]
            packed = sum(len(zlib.compress(block, 5)) for block in samples)
            size += len(content) * packed / max(1, sum(map(len, samples)))
    return int(4 / 3 * size)  # base64 writes three bytes as four letters


def _add_record(data: vtkDataSet) -> vtkDataSet:
    """Add the record to the field data, as bytes because meshio reads no text there."""
    import numpy as np

    from spacemap_vtk.datasets.arrays import add_array, shallow_copy

    if not (data.GetFieldData().HasArray(NAME) or record_text()):
        return data
    copy = shallow_copy(data)
    copy.GetFieldData().RemoveArray(NAME)  # of the file from which an object was read
    if record_text():
        add_array(copy.GetFieldData(), NAME, np.frombuffer(record_text().encode(), np.uint8))
    return copy


@finds_record(".vtu", ".vtp", ".vti")
def find_record_in_xml(path: Path) -> str | None:
    """Find the record in the field data."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    array = read_xml(path).GetFieldData().GetArray(NAME)
    return None if array is None else bytes(vtk_to_numpy(array)).decode("latin-1")
