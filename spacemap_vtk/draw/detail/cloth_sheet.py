"""A cloth as a sheet that moves with its cage, in place of yarns too many to be in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import copied, points_of
from spacemap_vtk.datasets.processes import WHOLE, Piece
from spacemap_vtk.draw.actors.sheet_actor import add_directions, sheet_of
from spacemap_vtk.draw.detail.clearance_tiles import Clearances, SampledClearances, strains_of
from spacemap_vtk.draw.detail.part_stages import yarn_settings
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import choose_level
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.cloth import Cloth

#: Most quadrilaterals along each side of a sheet: some pixels each, and so fine as cages bend.
_CELLS = 240
#: More crossings take longer to be solved than a picture of the window that moves may take.
_MANY_CROSSINGS = 50_000


class _SheetWarp(BarycentricWarp):
    """Moves a sheet, of which some may lie outside though no yarn does."""

    follows: bool = False

    def _tell(self, text: str) -> None:
        if not self.follows:
            super()._tell(text)


class Sheet:
    """A scene's cloth as a sheet that moves with its cage: none of its patches is made."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        assert scene.woven is not None
        with scene.naming_file():
            self.cloth: Cloth = scene.woven.cloth
        self.cells = min(self.cloth.size[0], _CELLS), min(self.cloth.size[1], _CELLS)
        self._flat = self.moved = sheet_of(self.cloth, self.cells)
        #: Facets of a patch that is measured: those of the yarns that are drawn, if any are.
        self.sides = AUTOMATIC_SIDES
        #: What the colours show at each crossing, (2 or 1, picks, ends); None: nothing of them.
        self.crossings: NDArray[Any] | None = None
        #: Numbers that have the ends of the scale; None: those of the crossings.
        self.ends: NDArray[Any] | None = None
        #: The array that they are of; what finds clearances, and of which yarns.
        self._array: str | None = None
        self._sampled: SampledClearances | None = None
        self._asked: object = None
        self._warp = _SheetWarp()

    @classmethod
    def if_many(cls, scene: Scene) -> Sheet | None:
        """Return a scene's sheet if its yarns are too many to be drawn together; else None."""
        return cls(scene) if choose_level(scene).has_sheet else None

    def serves(self, scene: Scene) -> bool:
        """Return whether it is still that of a scene, which may have changed."""
        same = scene is self._scene and scene.surface.subdivisions is None
        return same and scene.woven is not None and scene.woven.cloth is self.cloth

    @property
    def one(self) -> Piece:
        """A piece of one yarn, of which the stages above know what they ask of all."""
        # but for a cage that fills the surface of all yarns
        cage = self._scene.cage
        filled = self._follows and cage.method == "tetwild" and cage.inflate == 0.0
        return WHOLE if filled else Piece(0, sum(self.cloth.size))

    @property
    def _follows(self) -> bool:
        """Whether the cage follows the yarns, so that what lies between them may be outside."""
        cage = self._scene.cage
        return cage.method in ("carved", "tetwild") and any(cage is s for s in self._scene.stages)

    def place(self, time: float) -> vtkPolyData:
        """Return where the sheet is at a time [s]."""
        scene = self._scene
        scene.update_stage(scene.deforming if scene.moves else scene.source, time, self.one)
        self._move(scene.deformed_cage if scene.moves else None)
        return self.moved

    def update(self, time: float) -> vtkPolyData:
        """Return the sheet at a time [s], with what its crossings do."""
        self.place(time)
        self._cross(self._scene.deformed_cage if self._scene.moves else None, coarse=False)
        return self.moved

    def ride(self, cage: vtkUnstructuredGrid | None, coarse: bool = False) -> vtkPolyData:
        """Return the sheet where a cage takes it; without a cage it lies flat."""
        self._move(cage)
        self._cross(cage, coarse)
        return self.moved

    def _move(self, cage: vtkUnstructuredGrid | None) -> None:
        if cage is None:
            # Not where it was last: the scene may have moved until just now.
            self.moved = self._flat
            return
        settings = dict(self._scene.warp.settings)
        # A mode's cage has no velocity that could ride along.
        there = (cage.GetPointData(), cage.GetCellData())
        names = settings["carried"].replace(",", " ").split()
        settings["carried"] = " ".join(n for n in names if any(d.HasArray(n) for d in there))
        self._warp.follows = self._follows
        if self._follows and settings["outside"] == "error":
            settings["outside"] = "extrapolate"
        self._warp.configure(**settings)
        self._warp.color_array = self._scene.warp.color_array
        self.moved = copied(self._warp(self._flat, cage))
        add_directions(self.moved, self.cells)

    def _cross(self, cage: vtkUnstructuredGrid | None, coarse: bool) -> None:
        """Find what crossings do, where that is shown; while many move, it may be of before."""
        scene, crimp = self._scene, self.crimp
        name = COLORINGS[scene.view.color].array
        if coarse and self.solves_long and name == self._array:
            return
        self._array, self.crossings, self.ends = name, None, None
        if crimp is not None and cage is not None:
            with scene.naming_file():
                shown = "crimp" if self._gaps else name
                self.crossings = crimp.at_crossings(shown, scene.source.output, cage)
            for text in crimp.warnings:
                scene.warn(text)
        if self._gaps and (found := self._measured(cage)) is not None:
            self.crossings, self.ends = found

    def _measured(self, cage: vtkUnstructuredGrid | None) -> Clearances | None:
        """Return how far yarns are from one another."""
        rows = self.cells[1] + 1, self.cells[0] + 1, 3
        points = points_of(self.moved).astype(np.float64).reshape(rows)
        asked = self.sides, yarn_settings(self._scene)
        if self._sampled is None or asked != self._asked:
            self._sampled, self._asked = SampledClearances(self._scene, self.sides), asked
        rest = points_of(self._flat).astype(np.float64).reshape(rows)
        return self._sampled.at(cage, strains_of(points, rest), self.crimp)

    @property
    def solves_long(self) -> bool:
        """Whether what crossings do is shown, and takes longer than a picture that moves may."""
        return self._gaps or (self.crimp is not None and self.cloth.drawdown.size > _MANY_CROSSINGS)

    @property
    def crimp(self) -> CrimpInterchange | None:
        """What knows the crossings that colours show, or by which yarns are as far apart."""
        crimp, name = self._scene.stage("crimp"), COLORINGS[self._scene.view.color].array
        shown = self._gaps or name in CrimpInterchange.provides
        return crimp if shown and isinstance(crimp, CrimpInterchange) else None

    @property
    def _gaps(self) -> bool:
        return self._scene.view.color == "clearance"
