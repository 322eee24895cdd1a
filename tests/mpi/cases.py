"""Pipelines, in one process or in several, and their surfaces as arrays."""

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk import (
    BarycentricWarp,
    CrimpInterchange,
    ModalResponse,
    ModalSolver,
    MotionReader,
    ObjectSource,
    PatchTessellator,
    TetraCage,
    WeaveSource,
)
from spacemap_vtk.filters.base import Stage


def connected(
    source: dict[str, Any],
    cage: dict[str, Any] | None = None,
    motion: dict[str, Any] | None = None,
    yarns: dict[str, Any] | None = None,
) -> list[Stage]:
    """Return the stages from source to surface; a source with a file is an object."""
    first = ObjectSource(**source) if "file" in source else WeaveSource(**source)
    stages: list[Stage] = [first]
    if motion is None:
        box = TetraCage(**{"divisions": (4, 4, 2), **(cage or {})})
        modal = ModalSolver(modes=10, youngs_modulus=2e3)
        response = ModalResponse(gravity=(0, -3.0, -9.0))
        stages += [box, modal, response]
    else:
        stages.append(MotionReader(**motion))
    for stage, producer in zip(stages[2:], stages[1:-1], strict=True):
        stage.SetInputConnection(producer.GetOutputPort())
    if motion is None:
        box.SetInputConnection(first.GetOutputPort())
    warp, skin = BarycentricWarp(), PatchTessellator(subdivisions=2)
    warp.SetInputConnection(0, first.GetOutputPort())
    warp.SetInputConnection(1, stages[-1].GetOutputPort())
    if yarns is not None:
        crimp = CrimpInterchange(**yarns)
        crimp.SetInputConnection(0, first.GetOutputPort())
        crimp.SetInputConnection(1, stages[-1].GetOutputPort())
        warp.SetInputConnection(0, crimp.GetOutputPort())
        stages.insert(1, crimp)
    skin.SetInputConnection(warp.GetOutputPort())
    return [*stages, warp, skin]


def surface(data: vtkPolyData) -> dict[str, np.ndarray]:
    """Return corners and arrays of the cells, in an order that does not depend on the pieces."""
    if data.GetNumberOfCells() == 0:
        return {}
    assert not data.GetPointData().HasArray("vtkGhostType")
    cells = vtk_to_numpy(data.GetPolys().GetConnectivityArray())
    size = data.GetPolys().GetMaxCellSize()
    points = vtk_to_numpy(data.GetPoints().GetData())
    moved = vtk_to_numpy(data.GetPointData().GetArray("displacement"))
    corners = cells.reshape(-1, size)
    result = {"corners": points[corners], "moved": moved[corners]}
    for name in ("yarn", "family", "color", "part", "crimp"):
        array = data.GetCellData().GetArray(name)
        if array is not None:
            result[name] = vtk_to_numpy(array)
    return result
