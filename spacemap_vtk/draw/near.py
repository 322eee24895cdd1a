"""Of a cloth of many yarns those that are seen near: they are made as far as they are in sight."""

from __future__ import annotations

from math import ceil, isqrt

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.camera import Seen
from spacemap_vtk.draw.detail import facets_seen
from spacemap_vtk.draw.form import SMALLEST_YARN, Sheet, pixels_per_metre
from spacemap_vtk.draw.pieces import cells_in_sight, run_of, yarns_in
from spacemap_vtk.draw.yarn_tiles import OwnStages, yarn_settings
from spacemap_vtk.fabric.partition import cropped
from spacemap_vtk.fabric.weave import estimate_counts
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.patch_tessellator import MOST_SIDES, PatchTessellator
from spacemap_vtk.scenes.scene import Scene

#: Most patches and quadrilaterals of what is in sight: made in two seconds, drawn in one.
MOST_PATCHES, _MOST_QUADS = 1_500_000, 2_000_000
#: So many may be drawn while the camera moves, each in one quadrilateral.
_MOVING_PATCHES = 120_000
#: Yarns that are drawn, in pixels: a view takes one sample of each pixel, where pictures take more,
#: and makes moiré of finer ones.
_SMALLEST = 1.5 * SMALLEST_YARN
#: What is made beyond the edges of the view, as a share of what is in sight.
_MARGIN = 0.08
#: What is told where no yarns are made.
AFAR = "from so far a yarn is {:.2g} pixels wide: a sheet in the colours of the yarns is shown"
CROWD = "so many yarns are in sight that the window shows a sheet in their colours: come nearer"


class NearYarns:
    """The yarns of a scene in a part of the cloth that follows the view, in stages of their own."""

    def __init__(self, scene: Scene, sheet: Sheet) -> None:
        self._scene, self._sheet = scene, sheet
        self._settings = yarn_settings(scene)
        self._own = OwnStages(scene)
        self.stages = self._own.all
        self._own.weave.configure(precision="single")  # nothing but eyes sees it
        self._light = PatchTessellator(subdivisions=1)
        self._light.SetInputConnection(self.stages[-2].GetOutputPort())
        #: The columns and rows of the sheet's cells in whose place yarns are made.
        self.part: tuple[slice, slice] | None = None
        self._patches = 0
        self._cage: tuple[vtkUnstructuredGrid, int] | None = None

    def serves(self, scene: Scene, sheet: Sheet) -> bool:
        """Return whether its stages are still as the scene's."""
        return sheet is self._sheet and yarn_settings(scene) == self._settings

    def follow(self, seen: Seen, cage: vtkUnstructuredGrid | None, swings: bool = False) -> str:
        """Choose what will be made; return why nothing is, or nothing."""
        sheet, camera, (width, height) = self._sheet, seen.camera, seen.size
        columns, rows = (run_of(cells) for cells in cells_in_sight(sheet, camera, width / height))
        if columns.stop * rows.stop == 0:
            return "none of the cloth is in sight"
        points = points_of(sheet.moved).reshape(sheet.cells[1] + 1, sheet.cells[0] + 1, 3)
        near = points[rows.start : rows.stop + 1, columns.start : columns.stop + 1]
        scale = pixels_per_metre(camera, near.reshape(-1, 3).astype(np.float64), height)
        threads = sheet.cloth.threads
        pixels = scale * max(family.mean_spacing(0.0) for family in threads)
        if pixels < _SMALLEST:
            return AFAR.format(pixels)
        wanted = columns, rows
        if not _covers(self.part, wanted):
            wider = _wider(columns, sheet.cells[0]), _wider(rows, sheet.cells[1])
            part = next((p for p in (wider, wanted) if self._takes(p)), None)
            if part is None:
                return CROWD
            self.part = part
            self._own.choose(yarns_in(sheet, *part))
        if self.part is not None:
            self._own.borrow(yarns_in(sheet, *self.part), sheet.crimp)
        most = max(1, isqrt(_MOST_QUADS // self._patches))
        sides, strands, detail = facets_seen(sheet.cloth, scale, seen, most)
        if detail is not None and self._scene.view.color == "clearance":
            sides, detail = MOST_SIDES, None
        self._own.surface.choose(min(sides, most), strands, detail)
        if cage is not None and self._cage != (cage, cage.GetMTime()):
            self._cage = cage, cage.GetMTime()
            self._own.ride(cage)
            for stage in self.stages:
                if isinstance(stage, BarycentricWarp):
                    # a mode's cage has no velocity that could ride along
                    stage.carried = "" if swings else self._scene.warp.carried
        return ""

    @property
    def yarns(self) -> vtkPolyData:
        """Their surface, as of the last update of the stages."""
        return self._own.surface.output

    def light(self, time: float) -> vtkPolyData | None:
        """Return a surface of fewer facets; None where they would still be too many."""
        if self._patches > _MOVING_PATCHES:
            return None
        return self._light.update(time).output

    def _takes(self, part: tuple[slice, slice]) -> bool:
        """Return whether the yarns of a part are few enough."""
        patches = estimate_counts(cropped(self._sheet.cloth, yarns_in(self._sheet, *part))).patches
        if patches <= MOST_PATCHES:
            self._patches = patches
        return patches <= MOST_PATCHES


def _wider(cells: slice, count: int) -> slice:
    more = 1 + ceil(_MARGIN * (cells.stop - cells.start))
    return slice(max(cells.start - more, 0), min(cells.stop + more, count))


def _covers(part: tuple[slice, slice] | None, wanted: tuple[slice, slice]) -> bool:
    """Return whether a part shows what is wanted, and is not far larger."""
    if part is None:
        return False
    inside = all(p.start <= w.start and w.stop <= p.stop for p, w in zip(part, wanted, strict=True))
    sizes = [(p.stop - p.start) / (w.stop - w.start) for p, w in zip(part, wanted, strict=True)]
    return inside and sizes[0] * sizes[1] < 3.0
