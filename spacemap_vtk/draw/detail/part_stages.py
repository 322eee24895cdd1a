"""Copy the stages that make yarns, for a part of a cloth that is too large to be made whole.

The scene's stages keep the results for the cage, which all parts need.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import shallow_copy
from spacemap_vtk.datasets.processes import WHOLE, Piece
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection


def yarn_settings(scene: Scene) -> list[tuple[str, dict[str, Any]]]:
    """Return the settings of the stages that make yarns."""
    return [(stage.section, stage.settings) for stage in scene.stages if stage.makes == "object"]


class PartStages:
    """Copies of a scene's stages that make yarns, connected only to one another."""

    def __init__(self, scene: Scene) -> None:
        assert scene.woven is not None
        self.scene, self._woven, self.cloth = scene, scene.woven, scene.woven.cloth
        self.all: list[Stage] = [
            type(stage)(**stage.settings) for stage in scene.stages if stage.makes == "object"
        ]
        first, last = self.all[0], self.all[-1]
        assert isinstance(first, Woven)
        assert isinstance(last, PatchTessellator)
        self.source, self.surface = self.all[0], last
        scene.woven.lend(first)
        self.use_color_array()
        for before, stage in pairwise(self.all):
            stage.SetInputConnection(0, before.GetOutputPort())

    def set_cage(self, cage: vtkUnstructuredGrid) -> None:
        """Set the cage that moves the yarns."""
        for stage in self.all[1:]:
            if len(stage.takes) > 1:
                stage.SetInputDataObject(1, shallow_copy(cage))

    def use_color_array(self) -> None:
        """Interpolate the array that the scene's colours show."""
        for stage in self.all:
            if isinstance(stage, BarycentricWarp):
                stage.color_array = self.scene.warp.color_array

    def choose_part(self, part: YarnSelection) -> None:
        """Make only the given yarns, cut to the part where they cross one another."""
        source = self.source
        assert isinstance(source, Woven)
        self._woven.lend(source, part)

    def use_crossings(self, crimp: CrimpInterchange | None, part: YarnSelection) -> None:
        """Use the crossings of the whole cloth for a part; None: solve the part's crossings."""
        for stage in self.all:
            if isinstance(stage, CrimpInterchange):
                stage.use_crossings_of(crimp, part)

    def update(self, time: float, piece: Piece = WHOLE) -> vtkPolyData:
        """Return a copy of the surface at a time [s]."""
        with self.scene.add_file_to_errors():
            return shallow_copy(self.surface.update(time, piece).output)
