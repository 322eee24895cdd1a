"""State of a cage at one moment, as `spacemap_vtk.io.rest_state` reads it."""

from __future__ import annotations

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array


def copy_state(cage: vtkUnstructuredGrid, array: str = "displacement") -> vtkUnstructuredGrid:
    """Copy a cage with one displacement and no other arrays, from which it can start again."""
    state, moved = vtkUnstructuredGrid(), vtk_to_numpy(cage.GetPointData().GetArray(array))
    state.CopyStructure(cage)
    add_array(state.GetPointData(), "displacement", moved)
    return state
