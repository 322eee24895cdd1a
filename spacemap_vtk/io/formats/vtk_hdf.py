"""VTK's files in HDF5, with one time or many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import reads, writes

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkDataSet

    from spacemap_vtk.io.series import MeshSeries

#: The cells of polygonal data, in the order in which the format counts them.
_CELLS = {"Vertices": "Verts", "Lines": "Lines", "Polygons": "Polys", "Strips": "Strips"}
#: What may be another at another time; cells may not.
_MOVING = ("Points", "PointData/", "CellData/")


@reads(".vtkhdf", label="VTK HDF5", holds="mesh")
def read_hdf(path: Path) -> Any:
    """Read the first step."""
    from spacemap_vtk.io.reading import read_with_vtk

    return read_with_vtk(path, "vtkIOHDF", "vtkHDFReader")


@reads(".vtkhdf", label="VTK HDF5", holds="motion")
def open_hdf(path: Path) -> MeshSeries:
    """Open all steps."""
    from vtkmodules.vtkIOHDF import vtkHDFReader

    from spacemap_vtk.io.series import ReaderSeries

    return ReaderSeries(path, vtkHDFReader())


@writes(".vtkhdf", label="VTK HDF5", holds=("surface", "cage"), times=True)
def write_hdf(file: Path, steps: Iterable[tuple[float, vtkDataSet]]) -> None:
    """Write points, cells and their arrays at some times; what stays the same is there once."""
    import numpy as np

    from spacemap_vtk.io.hdf5 import Hdf5Writer

    times: list[float] = []
    begin: dict[str, list[int]] = {}
    with file.open("wb") as stream:
        made = Hdf5Writer(stream)
        for time, data in steps:
            times.append(time)
            for name, rows in _tables(data, made if len(times) == 1 else None):
                begin.setdefault(name, []).append(made.add(f"VTKHDF/{name}", rows))
            stream.flush()  # whoever counts what it takes finds it
        count = len(times)
        for name, starts in begin.items():
            if len(starts) < count or (max(starts) and not name.startswith(_MOVING)):
                raise InputError(
                    f"{file.name}: {name} is another at another time",
                    cure="Write a .pvd: its files need not be alike.",
                )
        kinds = [f"{kind}/" for kind in _CELLS] if data.IsA("vtkPolyData") else [""]
        steps_of = {
            "Values": np.array(times),
            "NumberOfParts": np.ones(count, np.int64),
            "PartOffsets": np.zeros(count, np.int64),
            "PointOffsets": np.array(begin["Points"]),
            "CellOffsets": np.zeros((count, len(kinds)), np.int64),
            "ConnectivityIdOffsets": np.zeros((count, len(kinds)), np.int64),
        }
        for name, starts in begin.items():
            table, _, array = name.partition("/")
            if table in ("PointData", "CellData"):
                steps_of[f"{table}Offsets/{array}"] = np.array(starts)
        for name, rows in steps_of.items():
            made.add(f"VTKHDF/Steps/{name}", rows)
        made.tell("VTKHDF/Steps", NSteps=count)
        made.close()


def _tables(data: vtkDataSet, first: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield what there is at a time, by its place in the file."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.datasets.arrays import cell_types, points_of

    points, surface = points_of(data), data.IsA("vtkPolyData")
    yield "Points", points
    yield "NumberOfPoints", np.array([len(points)])
    if surface:
        for kind, name in _CELLS.items():
            yield from _cells(f"{kind}/", getattr(data, f"Get{name}")())
    else:
        yield from _cells("", data.GetCells())
        (type_,) = cell_types(data)  # a cage's are all of one
        yield "Types", np.full(data.GetNumberOfCells(), type_, np.uint8)
    for kind in ("PointData", "CellData"):
        table = getattr(data, f"Get{kind}")()
        for number in range(table.GetNumberOfArrays()):
            array = table.GetArray(number)
            if array is not None:  # of numbers
                name = f"{kind}/{array.GetName().replace('/', '_')}"
                yield name, vtk_to_numpy(array)
                if first is not None and array is table.GetNormals():
                    first.tell(f"VTKHDF/{name}", Attribute="Normals")
    if first is not None:
        what = "PolyData" if surface else "UnstructuredGrid"
        first.tell("VTKHDF", Version=np.array([2, 0]), Type=what)


def _cells(place: str, cells: vtkCellArray) -> Iterator[tuple[str, NDArray[Any]]]:
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    offsets = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    corners = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    offsets = offsets if len(offsets) else np.zeros(1, np.int64)
    yield f"{place}NumberOfCells", np.array([len(offsets) - 1])
    yield f"{place}NumberOfConnectivityIds", np.array([len(corners)])
    yield f"{place}Offsets", offsets
    yield f"{place}Connectivity", corners
