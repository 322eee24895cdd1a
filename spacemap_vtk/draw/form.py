"""In which form a cloth is drawn: yarns in as many facets as can be seen, or a sheet from afar."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.datasets.arrays import copied, points_of
from spacemap_vtk.datasets.processes import WHOLE, Piece
from spacemap_vtk.draw.camera import pixels_of
from spacemap_vtk.draw.graphics import draws_without_opengl
from spacemap_vtk.draw.sheet_actor import LONGEST_ROW, add_directions, sheet_of
from spacemap_vtk.draw.yarn_tiles import Clearances, SampledClearances, strains_of, yarn_settings
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.weave import estimate_counts
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES, sides_seen
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.face import face_pixels
from spacemap_vtk.scenes.footprint import PictureAsked, fits_picture, require_picture, require_sheet
from spacemap_vtk.scenes.scene import Scene

#: Below so many pixels a yarn is not seen as one.
SMALLEST_YARN = 2.0
#: Below so many pixels a yarn of a face shows no more than its place, its light and its colour.
RESOLVED_YARN = 8.0
#: Share by which the yarns of a family may differ there.
_EQUAL = 0.1
#: To draw so many patches takes 5 s and more.
_LONG = 1_500_000
#: A cloth of fewer patches is drawn yarn by yarn, however small it is seen: that takes no time.
_MANY_PATCHES = 300_000
#: More quadrilaterals are a mistake in their number: they take minutes.
_MOST_QUADS = 500_000_000
#: Diameters in pixels from which on plies are made, and fibres are shaded.
_PLIED, _STRANDS = 16.0, 10.0
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

    def __init__(self, scene: Scene, patches: int) -> None:
        self._scene = scene
        #: How many its yarns would have.
        self.patches = patches
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
    def of(cls, scene: Scene, fits: bool = True, few: int | None = None) -> Sheet | None:
        """Return a scene's sheet; None where yarns are few, and fit into memory, or all must."""
        if scene.woven is None:
            return None
        try:
            patches = estimate_counts(scene.woven.cloth).patches
        except SpacemapError:
            return None  # the stage says why
        sides = scene.surface.subdivisions
        few = _MANY_PATCHES if few is None else few
        if sides is not None and patches * sides**2 >= _MOST_QUADS:
            return None
        return cls(scene, patches) if not fits or (sides is None and patches > few) else None

    @classmethod
    def required(cls, scene: Scene, asked: PictureAsked) -> Sheet | None:
        """Return the sheet for pictures, as `of` does; refuse too large ones."""
        # Only a sheet has the exact mean colour of all that a pixel shows: the face of a still
        # cloth becomes one however few its yarns are, where they are too thin to be seen.
        # Without OpenGL there are no sheets: few yarns are drawn, if less exactly.
        thin = not draws_without_opengl() and face_pixels(scene, asked.size) < SMALLEST_YARN
        sheet = cls.of(scene, fits_picture(scene, asked), few=0 if thin else None)
        if sheet is None:
            require_picture(scene, asked)
        else:
            require_sheet(scene, asked)
        return sheet

    def resolves(self, size: tuple[int, int]) -> bool:
        """Return whether a picture shows yarns so small and so many that a shader draws them."""
        # The shader compares the heights of end and pick at each place. So nothing may hide behind
        # anything else: only a still cloth of one layer is drawn so, and only from its face.
        scene, cloth = self._scene, self.cloth
        few = self.patches < _LONG or scene.surface.subdivisions is not None
        if few or cloth.layers is not None or cloth.axis == "spline":
            return False
        if max(cloth.size) > LONGEST_ROW:
            return False  # a texel is no crossing then
        if COLORINGS[scene.view.color].numbers or scene.view.look.outline:
            return False
        # The shader knows one diameter and one spacing of each family.
        for yarns in cloth.yarns:
            for measure in (yarns.diameter, np.diff(yarns.position)):
                if np.ptp(measure) > _EQUAL * np.mean(measure):
                    return False
        return SMALLEST_YARN <= face_pixels(scene, size) < RESOLVED_YARN

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


def pixels_per_metre(camera: vtkCamera, points: Floats, height: int) -> float:
    """Return how large a picture of some height shows what is nearest of some points."""
    if camera.GetParallelProjection():
        return pixels_of(camera, height)
    away = (points - camera.GetPosition()) @ np.array(camera.GetDirectionOfProjection())
    near = max(float(away.min()), 1e-3 * camera.GetDistance())
    return pixels_of(camera, height) * camera.GetDistance() / near


def plies_seen(cloth: Cloth, scale: float) -> int:
    """Return how many plies the outlines of yarns are made of, where a metre is so many pixels."""
    plies = max(int(np.max(threads.plies)) for threads in cloth.threads)
    return plies if _widest(cloth) * scale > _PLIED else 1


def _widest(cloth: Cloth) -> float:
    # A flattened yarn's diameter is its height: seen is its width.
    return max(float(np.max(threads.diameter)) * threads.aspect for threads in cloth.threads)


def form_seen(cloth: Cloth, scale: float) -> tuple[int, bool]:
    """Return what `PatchTessellator.choose` takes: facets, and whether fibres are seen."""
    thickest = max(float(np.max(threads.diameter)) for threads in cloth.threads)
    sides = sides_seen(thickest * scale, plies_seen(cloth, scale))
    return sides, _widest(cloth) * scale > _STRANDS
