"""Test whether points and cells have changed since something was computed from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkUnstructuredGrid


class GeometrySnapshot:
    """The points and cells of a data set at the time when something was computed from them."""

    # Identical, unmodified VTK objects are the common case: only the time has changed. Otherwise
    # the numbers are compared, because a reader may read the same mesh again at every time step.

    def __init__(self, dataset: vtkPointSet) -> None:
        self._objects = self._parts(dataset)
        self._times = [part.GetMTime() for part in self._objects]
        self._arrays = [_array(part) for part in self._objects]

    def matches(self, dataset: vtkPointSet) -> bool:
        """Test whether a data set still has this geometry."""
        parts = self._parts(dataset)
        if len(parts) != len(self._objects):
            return False
        times = [part.GetMTime() for part in parts]
        if all(a is b for a, b in zip(parts, self._objects, strict=True)):
            return times == self._times
        arrays = [_array(part) for part in parts]
        if not all(np.array_equal(a, b) for a, b in zip(arrays, self._arrays, strict=True)):
            return False
        self._objects, self._times, self._arrays = parts, times, arrays
        return True

    def _parts(self, dataset: vtkPointSet) -> list[vtkObject]:
        points = [dataset.GetPoints().GetData()] if dataset.GetPoints() else []
        return points + _cell_parts(dataset)


class ConnectivitySnapshot(GeometrySnapshot):
    """The cells of a data set without its points, which may move."""

    def _parts(self, dataset: vtkPointSet) -> list[vtkObject]:
        return _cell_parts(dataset)


def _cell_parts(dataset: vtkPointSet) -> list[vtkObject]:
    parts: list[vtkObject] = []
    if isinstance(dataset, vtkUnstructuredGrid):
        parts.append(dataset.GetCells().GetConnectivityArray())
    return parts


def _array(part: Any) -> NDArray[Any]:
    return vtk_to_numpy(part)
