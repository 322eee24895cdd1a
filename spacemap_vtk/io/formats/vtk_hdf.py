"""Read and write VTK's HDF5 files, with one time or many.

VTK's own writer repeats constant data at each time, stores times in single precision only, and must
not write to a disk (`spacemap_vtk.io.output`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from hashlib import blake2b
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import lazy_function, reads, require_package, writes

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from vtkmodules.vtkCommonCore import vtkDataArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkDataSet

    from spacemap_vtk.io.series import MeshSeries

#: The cells of polygonal data, in the order in which the format counts them.
_CELLS = {"Vertices": "Verts", "Lines": "Lines", "Polygons": "Polys", "Strips": "Strips"}
#: Data that may change with time; cells may not.
_MAY_CHANGE = ("Points", "PointData/", "CellData/")
_require = require_package(
    "h5py", "h5py", "Run: pip install 'spacemap_vtk[hdf5]', or write a .pvd."
)


reads(
    ".vtkhdf",
    label="VTK HDF5",
    holds="mesh",
    names=lazy_function("file_references", "names_in_hdf"),
)(lazy_function("reading", "read_with_vtk", "vtkIOHDF", "vtkHDFReader"))


@reads(
    ".vtkhdf",
    label="VTK HDF5",
    holds="motion",
    names=lazy_function("file_references", "names_in_hdf"),
)
def open_hdf(path: Path) -> MeshSeries:
    """Open a file with all its steps."""
    from vtkmodules.vtkIOHDF import vtkHDFReader

    from spacemap_vtk.io.series import ReaderSeries

    return ReaderSeries(path, vtkHDFReader())


@writes(".vtkhdf", label="VTK HDF5", holds=("surface", "cage"), times=True, require=_require)
def write_hdf(file: Path, steps: Iterable[tuple[float, vtkDataSet]]) -> None:
    """Write points, cells and their arrays at some times; constant data are stored once."""
    import h5py
    import numpy as np

    with ErrorKeepingFile(file, "w+") as sink:
        try:
            with h5py.File(sink, "w") as made:
                if record_text():  # not in the field data: a text there crashes VTK's reader
                    made[NAME] = np.bytes_(record_text())
                _write_steps(made, file.name, steps, sink)
        finally:
            sink.check()  # the first error is the cause of all later ones


class ErrorKeepingFile(FileIO):
    """A file that stores a write error until `check`; HDF5 would end Python if a write failed."""

    error: OSError | None = None

    def write(self, data: Any, /) -> int:
        left = memoryview(data).cast("B")
        try:
            while left and self.error is None:
                left = left[super().write(left) :]
        except OSError as error:
            self.error = error
        return len(data)

    def truncate(self, size: int | None = None, /) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = error
            return size or 0

    def check(self) -> None:
        if self.error is not None:
            raise self.error


def _write_steps(
    made: Any, name: str, steps: Iterable[tuple[float, vtkDataSet]], sink: ErrorKeepingFile
) -> None:
    import numpy as np

    from spacemap_vtk.memory import require_memory

    times: list[float] = []
    begin: dict[str, list[int]] = {}
    digests: dict[str, bytes] = {}
    root = made.create_group("VTKHDF")
    for time, data in steps:
        if not times:
            require_memory(
                _largest_table_bytes(data), f"to write {data.GetNumberOfCells()} cells as .vtkhdf"
            )
        times.append(time)
        for place, rows in _step_arrays(data):
            begin.setdefault(place, []).append(_append_rows(root, digests, place, rows))
        made.flush()  # the size on the disk is then right for whoever measures it
        sink.check()
    surface, normals = data.IsA("vtkPolyData"), data.GetPointData().GetNormals()
    # VTK's reader requires these attributes.
    root.attrs["Version"] = np.array([2, 0])
    root.attrs["Type"] = np.bytes_("PolyData" if surface else "UnstructuredGrid")
    if normals is not None:
        root[_dataset_path("PointData", normals)].attrs["Attribute"] = np.bytes_("Normals")
    count = len(times)
    for place, starts in begin.items():
        if len(starts) < count or (max(starts) and not place.startswith(_MAY_CHANGE)):
            raise InputError(
                f"{name}: {place} changes with time, which .vtkhdf cannot store",
                cure="Write a .pvd, in which each time may differ.",
            )
    kinds = len(_CELLS) if surface else 1
    group = root.create_group("Steps")
    group.attrs["NSteps"] = count
    group["Values"] = np.array(times)
    group["NumberOfParts"] = np.ones(count, np.int64)
    group["PartOffsets"] = np.zeros(count, np.int64)
    group["PointOffsets"] = np.array(begin["Points"])
    group["CellOffsets"] = np.zeros((count, kinds), np.int64)
    group["ConnectivityIdOffsets"] = np.zeros((count, kinds), np.int64)
    for place, starts in begin.items():
        table, _, array = place.partition("/")
        if table in ("PointData", "CellData"):
            group[f"{table}Offsets/{array}"] = np.array(starts)


def _append_rows(root: Any, digests: dict[str, bytes], name: str, rows: NDArray[Any]) -> int:
    """Add rows to a table unless they equal its last rows; return the index of the first."""
    import numpy as np

    digest = blake2b(np.ascontiguousarray(rows).data).digest()
    if name not in root:
        # A reader reads one time at once, so a chunk of the table holds one time.
        shape = len(rows) or 1, *rows.shape[1:]
        root.create_dataset(name, data=rows, maxshape=(None, *rows.shape[1:]), chunks=shape)
    elif digest != digests[name]:
        table = root[name]
        if rows.shape[1:] != table.shape[1:] or len(rows) != table.chunks[0]:
            raise InputError(
                f"{name} has {len(rows)} rows instead of {table.chunks[0]}",
                cure="Write a .pvd, in which each time may differ.",
            )
        table.resize(len(table) + len(rows), axis=0)
        table[-len(rows) :] = rows
    digests[name] = digest
    return max(0, len(root[name]) - len(rows))


def _dataset_path(table: str, array: vtkDataArray) -> str:
    return f"{table}/{array.GetName().replace('/', '_')}"


def _largest_table_bytes(data: vtkDataSet) -> int:
    """Return the bytes of the largest table as HDF5 copies it; cells need numbers of 8 bytes."""
    cells = data.GetPolys() if data.IsA("vtkPolyData") else data.GetCells()
    numbers, table = cells.GetNumberOfConnectivityIds(), data.GetPointData()
    arrays = data.GetPoints().GetData(), *map(table.GetArray, range(table.GetNumberOfArrays()))
    largest = max(array.GetActualMemorySize() for array in arrays if array is not None)
    return max(16 * numbers + 8 * cells.GetNumberOfCells(), 1024 * largest)


def _step_arrays(data: vtkDataSet) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the arrays of one time, each with its place in the file."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.datasets.arrays import cell_types, points_of

    points, surface = points_of(data), data.IsA("vtkPolyData")
    yield "Points", points
    yield "NumberOfPoints", np.array([len(points)])
    if surface:
        for kind, name in _CELLS.items():
            yield from _cell_arrays(f"{kind}/", getattr(data, f"Get{name}")())
    else:
        yield from _cell_arrays("", data.GetCells())
        (type_,) = cell_types(data)  # all cells of a cage have the same type
        yield "Types", np.full(data.GetNumberOfCells(), type_, np.uint8)
    for kind in ("PointData", "CellData"):
        table = getattr(data, f"Get{kind}")()
        for number in range(table.GetNumberOfArrays()):
            array = table.GetArray(number)
            if array is not None:  # None: an array of texts
                yield _dataset_path(kind, array), vtk_to_numpy(array)


def _cell_arrays(place: str, cells: vtkCellArray) -> Iterator[tuple[str, NDArray[Any]]]:
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    offsets = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    corners = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    offsets = offsets if len(offsets) else np.zeros(1, np.int64)
    yield f"{place}NumberOfCells", np.array([len(offsets) - 1])
    yield f"{place}NumberOfConnectivityIds", np.array([len(corners)])
    yield f"{place}Offsets", offsets
    yield f"{place}Connectivity", corners


@finds_record(".vtkhdf")
def find_record_in_hdf(path: Path) -> str | None:
    """Find the record next to the data."""
    _require(path)
    import h5py

    with h5py.File(path) as made:
        found = made[NAME][()]
    return found.decode("ascii", "replace") if isinstance(found, bytes) else None
