"""Between VTK data objects and numpy arrays, without copies where VTK allows it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray, vtkPoints, vtkVersion
from vtkmodules.vtkCommonDataModel import (
    VTK_QUADRATIC_TETRA,
    VTK_TETRA,
    vtkCellArray,
    vtkFieldData,
    vtkPointSet,
    vtkUnstructuredGrid,
)

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.parameters import suggestion

#: Up to 9.5 VTK takes over the buffers given to vtkCellArray.SetData, but not the numpy arrays that
#: own them: it would read freed memory.
_CELLS_NEED_COPIES = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) < (9, 6)


def points_of(dataset: vtkPointSet) -> NDArray[Any]:
    """Return a view of a data set's points.

    Parameters
    ----------
    dataset : vtkPointSet
        Any point set.

    Returns
    -------
    ndarray, shape (n_points, 3)
        float32 or float64, as stored.

    Raises
    ------
    GeometryError
        If there are no points.
    """
    points = dataset.GetPoints()
    if points is None or points.GetNumberOfPoints() == 0:
        raise GeometryError(f"the input {dataset.GetClassName()} has no points")
    return vtk_to_numpy(points.GetData())


def to_points(coordinates: NDArray[Any]) -> vtkPoints:
    """Return vtkPoints that share memory with an array.

    Parameters
    ----------
    coordinates : ndarray, shape (n_points, 3)
        float32 or float64.

    Returns
    -------
    vtkPoints
        Of the same precision.
    """
    points = vtkPoints()
    points.SetData(to_array(coordinates))
    return points


def to_array(values: NDArray[Any], name: str = "") -> vtkDataArray:
    """Return a VTK array that shares memory with a numpy array.

    Parameters
    ----------
    values : ndarray, shape (n,) or (n, k)
        Copied only if it is not C-contiguous.
    name : str, optional
        Name of the VTK array.

    Returns
    -------
    vtkDataArray
        Keeps the numpy array alive.
    """
    array = numpy_to_vtk(np.ascontiguousarray(values))
    if name:
        array.SetName(name)
    return array


def add_array(data: vtkFieldData, name: str, values: NDArray[Any]) -> None:
    """Add an array to point, cell or field data, in place of one of the same name.

    Parameters
    ----------
    data : vtkFieldData
        For example ``grid.GetPointData()``.
    name : str
        Name of the array.
    values : ndarray
        Shared, not copied, where it is C-contiguous.
    """
    data.AddArray(to_array(values, name))


#: Names of arrays that a message lists.
_LISTED = 8


def array_of(data: vtkFieldData, name: str, owner: str) -> NDArray[Any]:
    """Return a view of a named array.

    Parameters
    ----------
    data : vtkFieldData
        Point, cell or field data.
    name : str
        Name of the array.
    owner : str
        Who wants it, for the message.

    Returns
    -------
    ndarray
        The values.

    Raises
    ------
    InputError
        If there is none of that name; the message lists those that are.
    """
    array = data.GetArray(name)
    if array is None:
        names = [str(data.GetArrayName(i)) for i in range(data.GetNumberOfArrays())]
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        raise InputError(
            f'{owner} needs an array "{name}", and the input has '
            + ((", ".join(f'"{n}"' for n in names[:_LISTED]) + more) or "none"),
            cure=suggestion(name, names),
        )
    return vtk_to_numpy(array)


def vectors_of(data: vtkFieldData, name: str, count: int, owner: str) -> NDArray[np.float64]:
    """Return the vectors of a named array.

    Parameters
    ----------
    data : vtkFieldData
        Point or cell data.
    name : str
        Name of the array.
    count : int
        How many there must be.
    owner : str
        Who wants them, for the message.

    Returns
    -------
    ndarray of float64, shape (count, 3)
        The vectors.

    Raises
    ------
    InputError
        If there is none of that name, or it holds something else or what is no finite number.
    """
    values = array_of(data, name, owner).astype(np.float64)
    if values.shape != (count, 3):
        raise InputError(
            f'the point array "{name}" has shape {values.shape}', allowed=f"{(count, 3)}"
        )
    wrong = int((~np.isfinite(values).all(axis=1)).sum())
    if wrong:
        raise InputError(
            f'{wrong} of the {count} vectors of the point array "{name}" are no finite numbers'
        )
    return values


def cells_of(grid: vtkUnstructuredGrid, cell_type: int, name: str) -> NDArray[np.int64]:
    """Return the connectivity of a grid whose cells are all of one type and size.

    Parameters
    ----------
    grid : vtkUnstructuredGrid
        The grid.
    cell_type : int
        VTK's number of the type wanted.
    name : str
        Its name, for the message.

    Returns
    -------
    ndarray of int64, shape (n_cells, points_per_cell)
        Point numbers.

    Raises
    ------
    GeometryError
        If there are no cells, or some of another type or of different sizes.
    """
    if grid.GetNumberOfCells() == 0:
        raise GeometryError(f"the input has no cells; {name} are needed")
    others = [t for t in cell_types(grid) if t != cell_type]
    if others:
        raise GeometryError(
            f"the input has cells of VTK's types {others}",
            allowed=f"{name} (type {cell_type}) only",
        )
    cells = grid.GetCells()
    size = cells.GetMaxCellSize()
    connectivity = vtk_to_numpy(cells.GetConnectivityArray())
    if connectivity.size != size * grid.GetNumberOfCells():
        raise GeometryError(f"{name} of different degrees in one grid")
    return connectivity.reshape(-1, size).astype(np.int64, copy=False)


def tetrahedra_of(grid: vtkUnstructuredGrid) -> NDArray[np.int64]:
    """Return the corners of each tetrahedron of a grid of linear or quadratic ones.

    Parameters
    ----------
    grid : vtkUnstructuredGrid
        A cage.

    Returns
    -------
    ndarray of int64, shape (n_tetrahedra, 4)
        Vertex numbers.

    Raises
    ------
    GeometryError
        As `elements_of` does.
    """
    return np.ascontiguousarray(elements_of(grid)[:, :4])


def elements_of(grid: vtkUnstructuredGrid) -> NDArray[np.int64]:
    """Return all nodes of each tetrahedron of a grid of linear or of quadratic ones.

    Parameters
    ----------
    grid : vtkUnstructuredGrid
        A cage.

    Returns
    -------
    ndarray of int64, shape (n_tetrahedra, 4) or (n_tetrahedra, 10)
        Vertex numbers, corners first, then the midpoints in VTK's order.

    Raises
    ------
    GeometryError
        If there is no cell, one is no tetrahedron, or there are both kinds.
    """
    if cell_types(grid) == [VTK_QUADRATIC_TETRA]:
        return cells_of(grid, VTK_QUADRATIC_TETRA, "quadratic tetrahedra")
    return cells_of(grid, VTK_TETRA, "linear tetrahedra")


def to_cells(connectivity: NDArray[np.integer[Any]]) -> vtkCellArray:
    """Return cells of one size, which share memory with the array where VTK can.

    Parameters
    ----------
    connectivity : ndarray of int64, shape (n_cells, points_per_cell)
        Point numbers.

    Returns
    -------
    vtkCellArray
        The cells.
    """
    count, size = connectivity.shape
    offsets = np.arange(0, (count + 1) * size, size, dtype=np.int64)
    numbers = np.ascontiguousarray(connectivity, dtype=np.int64).ravel()
    cells = vtkCellArray()
    cells.SetData(
        numpy_to_vtkIdTypeArray(offsets, deep=_CELLS_NEED_COPIES),
        numpy_to_vtkIdTypeArray(numbers, deep=_CELLS_NEED_COPIES),
    )
    return cells


def cell_types(grid: vtkUnstructuredGrid) -> list[int]:
    """Return the types of cells in a grid.

    Parameters
    ----------
    grid : vtkUnstructuredGrid
        Any grid.

    Returns
    -------
    list of int
        VTK's numbers, each once, ascending.
    """
    return sorted(vtk_to_numpy(grid.GetDistinctCellTypesArray()).tolist())
