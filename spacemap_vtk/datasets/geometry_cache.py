"""Kept results: preparation that is redone only when the arrays it was made from change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkUnstructuredGrid


class Geometry:
    """The points and cells of a data set, as they were when something was prepared from them."""

    # Two questions are asked in turn: are they the same VTK objects, unmodified (the common case,
    # when only time moves); and if not, do they hold the same numbers (a reader that reads the same
    # mesh again at every time step)?

    def __init__(self, dataset: vtkPointSet) -> None:
        self._objects = self._parts(dataset)
        self._times = [part.GetMTime() for part in self._objects]
        self._arrays = [_array(part) for part in self._objects]

    def matches(self, dataset: vtkPointSet) -> bool:
        """Return whether a data set has this geometry still."""
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


class Connectivity(Geometry):
    """Only the cells of a data set: its points may move."""

    def _parts(self, dataset: vtkPointSet) -> list[vtkObject]:
        return _cell_parts(dataset)


def _cell_parts(dataset: vtkPointSet) -> list[vtkObject]:
    parts: list[vtkObject] = []
    if isinstance(dataset, vtkUnstructuredGrid):
        parts.append(dataset.GetCells().GetConnectivityArray())
    return parts


def _array(part: Any) -> NDArray[Any]:
    return vtk_to_numpy(part)
