"""Convert between VTK data objects and numpy arrays, without copies where VTK allows it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import (
    vtkDataArray,
    vtkDoubleArray,
    vtkFloatArray,
    vtkPoints,
    vtkVersion,
)
from vtkmodules.vtkCommonDataModel import (
    VTK_QUADRATIC_TETRA,
    VTK_TETRA,
    vtkCellArray,
    vtkFieldData,
    vtkImageData,
    vtkPointSet,
    vtkUnstructuredGrid,
)

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints
from spacemap_vtk.parameters import suggestion

#: Up to version 9.5, vtkCellArray.SetData keeps the buffers but not the numpy arrays that own them.
#: Without copies VTK would read freed memory.
_CELLS_NEED_COPIES = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) < (9, 6)

_HAVE_BUFFERS = hasattr(vtkFloatArray, "GetBuffer")
_FLOATS = {np.dtype(np.float32): vtkFloatArray, np.dtype(np.float64): vtkDoubleArray}


def points_of(dataset: vtkPointSet) -> NDArray[Any]:
    """Return a view of a data set's points."""
    points = dataset.GetPoints()
    if points is None or points.GetNumberOfPoints() == 0:
        raise GeometryError(f"the input {dataset.GetClassName()} has no points")
    return vtk_to_numpy(points.GetData())


def to_points(coordinates: NDArray[Any]) -> vtkPoints:
    """Return vtkPoints that share memory with an array."""
    points = vtkPoints()
    points.SetData(to_array(coordinates))
    return points


def to_array(values: NDArray[Any], name: str = "") -> vtkDataArray:
    """Return a VTK array that shares memory with a numpy array."""
    values = np.ascontiguousarray(values)
    made = _FLOATS.get(values.dtype)
    if made is None or values.ndim not in (1, 2) or not values.size:
        array = numpy_to_vtk(values)
    else:  # the same as numpy_to_vtk in a third of the time: each time step makes twelve arrays
        array = made()
        if values.ndim == 2:
            array.SetNumberOfComponents(values.shape[1])
        array.SetVoidArray(values, values.size, 1)
        # The numpy array must live as long as VTK reads its memory: a buffer outlives its array.
        owner = array.GetBuffer() if _HAVE_BUFFERS else array
        owner._numpy_reference = values
    if name:
        array.SetName(name)
    return array


def add_array(data: vtkFieldData, name: str, values: NDArray[Any]) -> None:
    """Add an array to point, cell or field data; it replaces one of the same name."""
    data.AddArray(to_array(values, name))


def shallow_copy(data: Any) -> Any:
    """Return a shallow copy of a data object; the arrays are shared."""
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy


def add_number(data: vtkFieldData, name: str, value: float) -> None:
    """Add an array of one number."""
    array = vtkDoubleArray()
    array.SetName(name)
    array.InsertNextValue(value)
    data.AddArray(array)


def add_text(data: vtkFieldData, name: str, text: str) -> None:
    """Add a text as an array of bytes: other programs cannot read arrays of strings."""
    add_array(data, name, np.frombuffer(text.encode(), dtype=np.uint8).copy())


def text_of(data: vtkFieldData, name: str) -> str | None:
    """Return a text that `add_text` has written; None without one."""
    array = data.GetArray(name)
    return None if array is None else vtk_to_numpy(array).astype(np.uint8).tobytes().decode()


def color_array_name(data: vtkFieldData) -> str | None:
    """Return the name of the first array of RGB or RGBA bytes, or None."""
    for i in range(data.GetNumberOfArrays()):
        array = data.GetArray(i)
        bytes_ = array is not None and array.GetDataTypeAsString() == "unsigned char"
        if bytes_ and array.GetNumberOfComponents() in (3, 4):
            return array.GetName()
    return None


def copy_rows(source: Any, target: Any, rows: AnyInts) -> None:
    """Copy the given rows of all numeric arrays to another table, with their attribute types."""
    for i in range(source.GetNumberOfArrays()):
        array = source.GetArray(i)
        if array is None or not array.GetName():
            continue
        add_array(target, array.GetName(), np.take(vtk_to_numpy(array), rows, axis=0))
        # By index, because VTK arrays compare element by element like numpy's, not by identity.
        role = source.IsArrayAnAttribute(i)
        if role >= 0:
            target.SetActiveAttribute(array.GetName(), role)


def to_image(pixels: NDArray[np.uint8]) -> vtkImageData:
    """Return a vtkImageData of pixels (height, width, n), the lowest row first."""
    height, width, depth = pixels.shape
    image = vtkImageData()
    image.SetDimensions(width, height, 1)
    image.GetPointData().SetScalars(to_array(pixels.reshape(-1, depth), "pixels"))
    return image


#: Largest number of array names that an error message lists.
_MAX_LISTED = 8


def array_of(data: vtkFieldData, name: str, owner: str) -> NDArray[Any]:
    """Return a view of a named array."""
    array = data.GetArray(name)
    if array is None:
        names = [str(data.GetArrayName(i)) for i in range(data.GetNumberOfArrays())]
        more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
        raise InputError(
            f'{owner} needs an array "{name}"; the input has '
            + ((", ".join(f'"{n}"' for n in names[:_MAX_LISTED]) + more) or "none"),
            cure=suggestion(name, names),
        )
    return vtk_to_numpy(array)


def mask_reader(grid: vtkUnstructuredGrid) -> Callable[[str], NDArray[Any]]:
    """Return a function that returns the point array named in a place expression."""
    return lambda name: array_of(grid.GetPointData(), name, f"the place mask({name})")


def vectors_of(data: vtkFieldData, name: str, count: int, owner: str) -> Floats:
    """Return a named array as vectors (count, 3), float64; raise InputError if not finite."""
    values = array_of(data, name, owner).astype(np.float64)
    if values.shape != (count, 3):
        raise InputError(
            f'the point array "{name}" has shape {values.shape}', allowed=f"{(count, 3)}"
        )
    wrong = int((~np.isfinite(values).all(axis=1)).sum())
    if wrong:
        raise InputError(
            f'{wrong} of the {count} vectors of the point array "{name}" are not finite'
        )
    return values


def cells_of(
    grid: vtkUnstructuredGrid, cell_type: int, name: str, cure: str | None = None
) -> AnyInts:
    """Return a view of the connectivity of a grid whose cells are all of one type and size."""
    if grid.GetNumberOfCells() == 0:
        raise GeometryError(f"the input has no cells, but must have {name}")
    others = [t for t in cell_types(grid) if t != cell_type]
    if others:
        raise GeometryError(
            f"the input has cells of VTK's types {others}",
            allowed=f"{name} (type {cell_type}) only",
            cure=cure,
        )
    cells = grid.GetCells()
    size = cells.GetMaxCellSize()
    connectivity = vtk_to_numpy(cells.GetConnectivityArray())
    if connectivity.size != size * grid.GetNumberOfCells():
        raise GeometryError(f"the grid has {name} with different numbers of nodes")
    return connectivity.reshape(-1, size)


def tetrahedra_of(grid: vtkUnstructuredGrid) -> Ints:
    """Return the corners of each tetrahedron, linear or quadratic: (T, 4)."""
    return np.ascontiguousarray(elements_of(grid)[:, :4])


def elements_of(grid: vtkUnstructuredGrid) -> Ints:
    """Return all nodes of each tetrahedron: (T, 4) for linear ones, (T, 10) for quadratic ones."""
    if cell_types(grid) == [VTK_QUADRATIC_TETRA]:
        cells = cells_of(grid, VTK_QUADRATIC_TETRA, "quadratic tetrahedra")
    else:
        cells = cells_of(
            grid, VTK_TETRA, "linear tetrahedra", "A TetraCage makes them around any object."
        )
    return cells.astype(np.int64, copy=False)


def to_cells(connectivity: AnyInts) -> vtkCellArray:
    """Return cells of equal size; they share memory with the array where VTK allows it."""
    count, size = connectivity.shape
    narrow = connectivity.dtype == np.int32 and connectivity.size < 2**31
    kind: type[np.integer[Any]] = np.int32 if narrow else np.int64
    offsets = np.arange(0, (count + 1) * size, size, dtype=kind)
    return to_ragged(offsets, np.ascontiguousarray(connectivity, dtype=kind).ravel())


def to_ragged(offsets: AnyInts, numbers: AnyInts) -> vtkCellArray:
    """Return cells of any sizes from offsets and point indices, both int32 or both int64."""
    cells = vtkCellArray()
    cells.SetData(
        *(
            numpy_to_vtk(array, deep=_CELLS_NEED_COPIES)
            if array.dtype == np.int32
            else numpy_to_vtkIdTypeArray(array, deep=_CELLS_NEED_COPIES)
            for array in (offsets, numbers)
        )
    )
    return cells


def to_rings(rings: Sequence[NDArray[np.int64]]) -> vtkCellArray:
    """Return one cell for each sequence of point indices."""
    offsets = np.cumsum([0, *map(len, rings)], dtype=np.int64)
    return to_ragged(offsets, np.concatenate([*rings, np.empty(0, np.int64)]))


def cell_types(grid: vtkUnstructuredGrid) -> list[int]:
    """Return the distinct VTK cell types of a grid, ascending."""
    return sorted(vtk_to_numpy(grid.GetDistinctCellTypesArray()).tolist())
