"""SceneReader: a scene file as a source in ParaView."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vtkmodules.vtkCommonCore import vtkInformation, vtkInformationVector
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from spacemap_vtk.errors import InputError, SpacemapWarning
from spacemap_vtk.filters.algorithm import Inputs
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.parameters import Choice, FilePath

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene

_TIME_STEPS = vtkStreamingDemandDrivenPipeline.TIME_STEPS()


class SceneReader(Stage):
    """Read a scene file and run its pipeline; the time steps are the frames of its film."""

    section = "scene"
    #: VTK would replace the output of `_request_data_object` if it were not of this type.
    output_type = "vtkPointSet"

    file = FilePath(None, "Scene file (.toml).", automatic="no scene")
    show = Choice(
        "surface",
        "Output: the surface, the Bézier patches, or the cage at rest with its displacement, which "
        "can move other data with BarycentricWarp.",
        ["surface", "patches", "cage"],
    )

    _cached: tuple[Path, int, Scene] | None = None

    @property
    def scene(self) -> Scene:
        """The scene; it is read again if the file has changed."""
        # Imported here, because there is no tomllib where ParaView brings Python 3.10; everything
        # except scenes works there.
        from spacemap_vtk.scenes.scene import Scene
        from spacemap_vtk.scenes.scene_record import describe_outside_files

        if self.file is None:
            raise InputError("no scene file is given", key="file", cure="Choose a .toml file.")
        changed = self.file.stat().st_mtime_ns if self.file.is_file() else 0
        if self._cached is None or self._cached[:2] != (self.file, changed):
            self._cached = self.file, changed, (scene := Scene.read(self.file))
            for text in describe_outside_files(scene):
                scene.warn(text)
        return self._cached[2]

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float] | None:
        """Return the times of the first and the last frame of the scene's film."""
        times = self._times()
        return (times[0], times[-1]) if times else None

    def run(self, inputs: list[Any], output: vtkDataObject, time: float) -> None:
        """Run the scene's pipeline to `time`."""
        scene = self.scene
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SpacemapWarning)  # this stage repeats them below
            scene.update(time, self.piece)
        for text in scene.warnings:
            self.warn(text)
        output.ShallowCopy(scene.data(self.show))

    @property
    def replicated(self) -> bool:
        """Whether each piece is the whole output, as it is for a cage."""
        return bool(self.show == "cage")

    def _times(self) -> list[float]:
        if self.file is None:  # ParaView asks before it has set the file
            return []
        return self.scene.animation.frame_times() if self.scene.moves else []

    def _request_data_object(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        kind = vtkPolyData if self.show == "surface" else vtkUnstructuredGrid
        info = out_info.GetInformationObject(0)
        made = info.Get(vtkDataObject.DATA_OBJECT())
        if made is None or made.GetClassName() != kind.__name__:
            info.Set(vtkDataObject.DATA_OBJECT(), kind())

    def _request_information(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        super()._request_information(in_info, out_info)
        times = self._times()
        if times:
            out_info.GetInformationObject(0).Set(_TIME_STEPS, times, len(times))
