"""Run the stages in ParaView: setters for its properties, messages in its output window.

ParaView does not call `update`, which would raise errors. A hosted stage shows an error in the
output window and returns its last good output, so that a wrong value leaves the picture unchanged.
If there are several processes, each of them knows of an error in any of them, and only the first
shows it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkInformation, vtkInformationVector, vtkOutputWindow
from vtkmodules.vtkCommonDataModel import (
    VTK_BEZIER_QUADRILATERAL,
    vtkDataObject,
    vtkDataSetAttributes,
)
from vtkmodules.vtkCommonExecutionModel import vtkDemandDrivenPipeline

import spacemap_vtk
from spacemap_vtk import extensions
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.datasets.arrays import add_array, cell_types, cells_of, shallow_copy
from spacemap_vtk.datasets.processes import is_first
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters import obstacle_surfaces
from spacemap_vtk.filters.algorithm import Inputs
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.io.reading import leaf_blocks
from spacemap_vtk.parameters import Parameter
from spacemap_vtk.paraview import scene_reader
from spacemap_vtk.paraview.property_xml import property_of, setter_name
from spacemap_vtk.paraview.proxies import FileParameter, proxy_xml

_REQUEST_DATA = vtkDemandDrivenPipeline.REQUEST_DATA()
_NOT_GENERATED = vtkDemandDrivenPipeline.DATA_NOT_GENERATED()


class ParaViewStage(Stage if TYPE_CHECKING else object):  # type: ignore[misc]
    """Behaviour of every stage in ParaView; this base class precedes the stage's class."""

    #: XML in which ParaView reads how to show the stage.
    _pvsm_proxy_xml: ClassVar[str]

    _error: BaseException | None
    _last: vtkDataObject | None = None
    _observed: bool = False

    def ProcessRequest(
        self, request: vtkInformation, in_info: Inputs, out_info: vtkInformationVector
    ) -> int:
        """Answer a request; after an error, show it and keep the last good output."""
        if not self._observed:
            # ParaView has replaced the executive that Stage observes.
            self._observed = True
            messages = self._vtk_messages
            self.GetExecutive().AddObserver("ErrorEvent", lambda *event: messages.clear())
        if any(vector.GetNumberOfInformationObjects() == 0 for vector in in_info):
            return 0  # ParaView asks before all inputs are chosen
        done = super().ProcessRequest(request, in_info, out_info)
        if not done:
            return self._fail(request, out_info)
        if request.Has(_REQUEST_DATA):
            output = out_info.GetInformationObject(0).Get(vtkDataObject.DATA_OBJECT())
            for block in leaf_blocks(output):
                arrays_to_points(block)
                # ParaView colours by the active scalars if nobody has chosen an array.
                for kind in (vtkDataObject.POINT, vtkDataObject.CELL):
                    if block.GetAttributes(kind).HasArray("color"):
                        block.GetAttributes(kind).SetActiveScalars("color")
            self._last = shallow_copy(output)
        return done

    def _issue_warning(self, text: str) -> None:
        """Show a warning in the output window instead of issuing a Python warning."""
        vtkOutputWindow.GetInstance().DisplayWarningText(f"{type(self).__name__}: {text}.\n")

    def _fail(self, request: vtkInformation, out_info: vtkInformationVector) -> int:
        error, self._error = self._error, None
        if not isinstance(error, Cancelled) and (is_first() or self._processes is None):
            show_error(self, error)
        if not request.Has(_REQUEST_DATA) or self._last is None:
            return 0
        info = out_info.GetInformationObject(0)
        info.Get(vtkDataObject.DATA_OBJECT()).ShallowCopy(self._last)
        info.Remove(_NOT_GENERATED)
        return 1


def arrays_to_points(data: Any) -> None:
    """Move cell arrays of Bézier patches to the points, if patches agree there or have a mean."""
    # To cut a curved quadrilateral, VTK splits it into flat ones and copies the row of its cell
    # arrays for each of these. It then reads the copy at the index of the curved cell instead of
    # the flat one: for all but the first few cells, this is past the end of the copy
    # (vtkHigherOrderQuadrilateral::Contour and Clip, in VTK 9.2 and still in 9.7). ParaView's
    # *Slice*, *Clip* and *Contour* then show nonsense, or crash if the memory belongs to nobody.
    # This is more likely with more patches, and certain with 200,000. Point arrays are copied whole
    # and read correctly.
    # The arrays of yarns agree at shared points; `PatchTessellator` passes them to its polygons. A
    # quantity or flag that differs between neighbours, such as one that varies along a yarn from
    # crossing to crossing, becomes its mean at shared points. Names and colours have no mean, so
    # they stay in the cells.
    if not data.IsA("vtkUnstructuredGrid") or cell_types(data) != [VTK_BEZIER_QUADRILATERAL]:
        return
    cells, points = data.GetCellData(), data.GetPointData()
    patches = None
    for name in [cells.GetArrayName(i) for i in range(cells.GetNumberOfArrays())]:
        array = cells.GetArray(name) if name else None
        if array is None or points.HasArray(name) or name == vtkDataSetAttributes.GhostArrayName():
            continue
        if patches is None:
            patches = cells_of(data, VTK_BEZIER_QUADRILATERAL, "Bézier quadrilaterals")
        values = vtk_to_numpy(array)
        moved = np.zeros((data.GetNumberOfPoints(), *values.shape[1:]), values.dtype)
        moved[patches] = values[:, np.newaxis]
        if (moved[patches] != values[:, np.newaxis]).any():
            if values.ndim > 1 or values.dtype not in (np.float32, np.float64, np.uint8):
                continue
            corners, size = patches.ravel(), data.GetNumberOfPoints()
            sums = np.bincount(corners, np.repeat(values, patches.shape[1]), size)
            moved = (sums / np.maximum(np.bincount(corners, minlength=size), 1)).astype(np.float32)
        add_array(points, name, moved)
        cells.RemoveArray(name)


def show_error(stage: Stage, error: BaseException | None) -> None:
    """Show an error in the output window; pvpython prints it."""
    text = str(error) or type(error).__name__
    if not isinstance(error, SpacemapError):
        text = f"{type(error).__name__}: {text}"
    vtkOutputWindow.GetInstance().DisplayErrorText(f"{type(stage).__name__}: {text}\n")


def paraview_stage(
    stage: type[Stage], name: str | None = None, file: FileParameter | None = None
) -> type[ParaViewStage]:
    """Return the class that runs a stage in ParaView."""
    name = name or stage.__name__
    setters = {setter_name(p): _make_setter(p) for p in stage.parameters.values()}
    made = cast(
        type[ParaViewStage],
        type(name, (ParaViewStage, stage), {**setters, "__module__": stage.__module__}),
    )
    label = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    made._pvsm_proxy_xml = proxy_xml(stage, label, f"{__name__}.{name}", file)
    return made


def _make_setter(parameter: Parameter[Any]) -> Callable[..., None]:
    name, read = parameter.name, property_of(parameter).read

    def set_parameter(self: ParaViewStage, *values: Any) -> None:
        try:
            value = read(*values)
            parameter.require_plausible(value)
            setattr(self, name, value)
        except Exception as error:  # VTK would print it with a traceback
            if is_first():  # every process gets the same value
                show_error(self, error)

    return set_parameter


def make_proxies() -> dict[str, type[ParaViewStage]]:
    """Return all proxies of the plugin by name."""
    draft, scene = FileParameter("draft", "draft"), FileParameter("file", "scene")
    return {
        **{name: paraview_stage(getattr(spacemap_vtk, name)) for name in spacemap_vtk.FILTERS},
        **{stage.__name__: paraview_stage(stage) for stage in extensions.load_all("stages")},
        "ObstacleSurfaces": paraview_stage(obstacle_surfaces.ObstacleSurfaces),
        "WIFReader": paraview_stage(spacemap_vtk.WeaveSource, "WIFReader", draft),
        "SceneReader": paraview_stage(scene_reader.SceneReader, file=scene),
    }


PROXIES = make_proxies()
# ParaView looks up a class by module and name.
globals().update(PROXIES)
