"""Move a cloth with its cage as a sheet, if its yarns are too many for the memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import points_of, shallow_copy
from spacemap_vtk.datasets.processes import WHOLE, Piece
from spacemap_vtk.draw.actors.sheet_actor import add_directions, make_sheet
from spacemap_vtk.draw.detail.clearance_tiles import Clearances, SampledClearances, sheet_strains
from spacemap_vtk.draw.detail.part_stages import yarn_settings
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import choose_level
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.cloth import Cloth

#: Largest number of cells along each side of a sheet: each covers a few pixels, and is fine enough
#: for the bending of cages.
_CELLS = 240
#: With more crossings than this, solving them takes too long for a moving picture in the window.
_MANY_CROSSINGS = 50_000


class _SheetWarp(BarycentricWarp):
    """Moves a sheet; it may warn of points outside the cage although no yarn is outside."""

    follows: bool = False

    def _issue_warning(self, text: str) -> None:
        if not self.follows:
            super()._issue_warning(text)


class ClothSheet:
    """The cloth of a scene as a sheet that moves with its cage, without making patches."""

    def __init__(self, scene: Scene, most_cells: int = _CELLS) -> None:
        self._scene = scene
        assert scene.woven is not None
        with scene.add_file_to_errors():
            self.cloth: Cloth = scene.woven.cloth
        self.cells = min(self.cloth.size[0], most_cells), min(self.cloth.size[1], most_cells)
        self._flat = self.moved = make_sheet(self.cloth, self.cells)
        #: Subdivisions of a patch whose clearance is measured: those of drawn yarns, if any.
        self.sides = AUTOMATIC_SIDES
        #: Values that the colours show at each crossing, (2 or 1, picks, ends), or None.
        self.crossings: NDArray[Any] | None = None
        #: Numbers with the extremes of the scale; None: use those of the crossings.
        self.extremes: NDArray[Any] | None = None
        #: Name of the array that `crossings` shows. Below: the clearances that are sampled, and the
        #: settings of the yarns for which they were set up.
        self._array: str | None = None
        self._sampled: SampledClearances | None = None
        self._sampled_for: object = None
        self._warp = _SheetWarp()

    @classmethod
    def make_if_needed(cls, scene: Scene) -> ClothSheet | None:
        """Return a scene's sheet if its yarns are too many to draw together; else None."""
        return cls(scene) if choose_level(scene).has_sheet else None

    def is_current(self, scene: Scene) -> bool:
        """Test whether this is still the sheet of a scene that may have changed."""
        same = scene is self._scene and scene.surface.subdivisions is None
        return same and scene.woven is not None and scene.woven.cloth is self.cloth

    @property
    def one_yarn(self) -> Piece:
        """A piece with a single yarn, which is enough for the stages above the yarns."""
        # A cage that fills the surface of the yarns needs all yarns.
        cage = self._scene.cage
        needs_all = self._cage_follows_yarns and cage.method == "tetwild" and cage.inflate == 0.0
        return WHOLE if needs_all else Piece(0, sum(self.cloth.size))

    @property
    def _cage_follows_yarns(self) -> bool:
        """Whether the cage follows the yarns, so that the sheet between them may be outside."""
        cage = self._scene.cage
        return cage.method in ("carved", "tetwild") and any(cage is s for s in self._scene.stages)

    def deform_at(self, time: float) -> vtkPolyData:
        """Return the deformed sheet at a time [s]."""
        scene = self._scene
        scene.update_stage(scene.cage_stage if scene.moves else scene.source, time, self.one_yarn)
        return self.deform(scene.deformed_cage if scene.moves else None)

    def update(self, time: float) -> vtkPolyData:
        """Return the deformed sheet at a time [s], and update the values at crossings."""
        self.deform_at(time)
        self._update_crossings(
            self._scene.deformed_cage if self._scene.moves else None, coarse=False
        )
        return self.moved

    def update_with(self, cage: vtkUnstructuredGrid | None, coarse: bool = False) -> vtkPolyData:
        """Return the sheet deformed by a cage, and update the values at crossings."""
        self.deform(cage)
        self._update_crossings(cage, coarse)
        return self.moved

    def deform(self, cage: vtkUnstructuredGrid | None) -> vtkPolyData:
        """Return the sheet deformed by a cage; without a cage it is flat."""
        if cage is None:
            # The last deformed sheet would be wrong: the scene may have moved until now.
            self.moved = self._flat
            return self.moved
        settings = dict(self._scene.warp.settings)
        # The cage of a mode has no velocity to interpolate, so missing arrays are left out.
        attributes = (cage.GetPointData(), cage.GetCellData())
        names = settings["carried"].replace(",", " ").split()
        settings["carried"] = " ".join(n for n in names if any(d.HasArray(n) for d in attributes))
        self._warp.follows = self._cage_follows_yarns
        if self._cage_follows_yarns and settings["outside"] == "error":
            settings["outside"] = "extrapolate"
        self._warp.configure(**settings)
        self._warp.color_array = self._scene.warp.color_array
        self.moved = shallow_copy(self._warp(self._flat, cage))
        add_directions(self.moved, self.cells)
        return self.moved

    def _update_crossings(self, cage: vtkUnstructuredGrid | None, coarse: bool) -> None:
        """Update the values at crossings, if shown; a coarse update keeps values that take long."""
        scene, crimp = self._scene, self.crimp_stage
        name = COLORINGS[scene.view.color].array
        if coarse and self.is_slow and name == self._array:
            return
        self._array, self.crossings, self.extremes = name, None, None
        if crimp is not None and cage is not None:
            with scene.add_file_to_errors():
                shown = "crimp" if self._shows_clearance else name
                self.crossings = crimp.crossing_values(shown, scene.source.output, cage)
            for text in crimp.warnings:
                scene.warn(text)
        if self._shows_clearance and (clearances := self._measure_clearances(cage)) is not None:
            self.crossings, self.extremes = clearances

    def _measure_clearances(self, cage: vtkUnstructuredGrid | None) -> Clearances | None:
        """Return the clearances between yarns, or None if they cannot be measured."""
        rows = self.cells[1] + 1, self.cells[0] + 1, 3
        points = points_of(self.moved).astype(np.float64).reshape(rows)
        settings = self.sides, yarn_settings(self._scene)
        if self._sampled is None or settings != self._sampled_for:
            self._sampled, self._sampled_for = SampledClearances(self._scene, self.sides), settings
        rest = points_of(self._flat).astype(np.float64).reshape(rows)
        return self._sampled.clearances_in(cage, sheet_strains(points, rest), self.crimp_stage)

    @property
    def is_slow(self) -> bool:
        """Whether values at crossings are shown that take too long for a moving picture."""
        return self._shows_clearance or (
            self.crimp_stage is not None and self.cloth.drawdown.size > _MANY_CROSSINGS
        )

    @property
    def crimp_stage(self) -> CrimpInterchange | None:
        """The crimp interchange that colours or clearances depend on; None if there is none."""
        crimp, name = self._scene.stage("crimp"), COLORINGS[self._scene.view.color].array
        shown = self._shows_clearance or name in CrimpInterchange.provides
        return crimp if shown and isinstance(crimp, CrimpInterchange) else None

    @property
    def _shows_clearance(self) -> bool:
        return self._scene.view.color == "clearance"
