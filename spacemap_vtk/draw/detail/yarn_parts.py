"""Make the yarns of a part of a cloth: pieces of a picture, or the yarns in the window's view."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, isqrt

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.draw.actors.color_values import add_color_values
from spacemap_vtk.draw.camera import CameraView, pixels_per_metre, project_points
from spacemap_vtk.draw.detail.clearance_tiles import margin_yarns, measure_tile
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.draw.detail.facets import choose_facets
from spacemap_vtk.draw.detail.part_stages import PartStages, yarn_settings
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.scenes.level_of_detail import (
    DrawingMethod,
    DrawnCloth,
    LevelOfDetail,
    choose_near,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.partition import crop_cloth, select_piece
from spacemap_vtk.textile.geometry.weave import estimate_counts
from spacemap_vtk.textile.weave.threads import YarnIndices

#: Number of the sheet's cells made on each side of those in sight, because yarns bend differently
#: near a cut.
_BESIDE = 4
#: Least number of crossings along each side of a tile.
_LEAST_TILE = 8
#: Largest number of patches that are drawn while the camera moves, as one quadrilateral each.
_MOVING_PATCHES = 120_000
#: Margin that is made around the view, as a share of the part in view.
_MARGIN = 0.08
#: Messages if the window shows only the sheet.
TOO_FAR = (
    "the cloth is drawn as a sheet in the colours of its yarns, {:.1f} pixels wide; zoom in to see "
    "the yarns"
)
TOO_MANY = (
    "the cloth is drawn as a sheet in the colours of its yarns, as too many are in view; zoom in "
    "to see the yarns"
)


class YarnPieces:
    """Makes the yarns of a scene piece by piece, with copies of the scene's stages."""

    def __init__(self, scene: Scene, level: LevelOfDetail) -> None:
        self._scene, self._level = scene, level
        self._stages = PartStages(scene)
        self._cloth = self._stages.cloth
        self._stages.surface.set_detail(*scene.surface.detail)

    def visible_pieces(
        self, time: float, sheet: ClothSheet, camera: vtkCamera, aspect: float
    ) -> Iterator[vtkPolyData]:
        """Yield the surfaces of the pieces that are visible in a picture, with their numbers."""
        if self._scene.moves:
            self._stages.set_cage(self._scene.deformed_cage)
        visible = visible_sheet_cells(sheet, camera, aspect)
        ranges = [cell_range(mask, _BESIDE) for mask in visible]
        if any(cells.start == cells.stop for cells in ranges):
            return
        # Yarns are cut to the part in sight.
        part = yarns_of_cells(sheet, ranges[0], ranges[1])
        if self._level.method is DrawingMethod.TILES:
            yield from self._visible_tiles(time, sheet, part, visible)
            return
        cloth = crop_cloth(self._cloth, part)
        self._stages.choose_part(part)
        self._stages.use_crossings(sheet.crimp_stage, part)
        share_in_sight = estimate_counts(cloth).patches / estimate_counts(self._cloth).patches
        count = ceil(self._level.pieces * share_in_sight)
        columns, rows = (mask[cells] for mask, cells in zip(visible, ranges, strict=True))
        for number in range(count):
            share = select_piece(cloth, number, count)
            if _has_visible_cell(columns, share.ends, cloth.size[0]) or _has_visible_cell(
                rows, share.picks, cloth.size[1]
            ):
                surface = self._stages.update(time, Piece(number, count))
                add_color_values(surface, self._scene.view.color)
                yield surface

    def _visible_tiles(
        self, time: float, sheet: ClothSheet, part: YarnSelection, visible: Sequence[Bools]
    ) -> Iterator[vtkPolyData]:
        """Yield tiles whose clearances were measured together with the neighbouring yarns."""
        side_in_memory = isqrt(self._cloth.drawdown.size // self._level.pieces)
        side = max(side_in_memory - 2 * margin_yarns(self._cloth), _LEAST_TILE)
        ends, picks = (
            [
                slice(start, min(start + side, yarns.stop))
                for start in range(yarns.start, yarns.stop, side)
            ]
            for yarns in part
            if isinstance(yarns, slice)
        )
        for columns in ends:
            for rows in picks:
                parts = zip(visible, (columns, rows), self._cloth.size, strict=True)
                if all(_has_visible_cell(cells, yarns, count) for cells, yarns, count in parts):
                    tile = measure_tile(self._stages, columns, rows, time, sheet.crimp_stage)
                    if tile is not None:
                        yield tile.trimmed_surface


class NearYarns:
    """Makes the yarns in a part of the cloth that follows the view, with copies of the stages."""

    def __init__(self, scene: Scene, sheet: ClothSheet) -> None:
        self._scene, self._sheet = scene, sheet
        self._settings = yarn_settings(scene)
        self._parts = PartStages(scene)
        self.stages = self._parts.all
        self._parts.source.configure(precision="single")  # enough, because it is only looked at
        self._preview = PatchTessellator(subdivisions=1)
        self._preview.SetInputConnection(self.stages[-2].GetOutputPort())
        #: Columns and rows of the sheet's cells that are replaced by yarns.
        self.part: tuple[slice, slice] | None = None
        self._patches = 0
        self._cage: tuple[vtkUnstructuredGrid, int] | None = None

    def is_current(self, scene: Scene, sheet: ClothSheet) -> bool:
        """Test whether the settings are still those of the scene and its sheet."""
        return sheet is self._sheet and yarn_settings(scene) == self._settings

    def follow_view(
        self, view: CameraView, cage: vtkUnstructuredGrid | None, is_mode: bool = False
    ) -> str:
        """Choose the part to be made; return the reason if there is none, else an empty text."""
        sheet, camera, (width, height) = self._sheet, view.camera, view.size
        columns, rows = (
            cell_range(cells) for cells in visible_sheet_cells(sheet, camera, width / height)
        )
        if columns.stop * rows.stop == 0:
            return "no part of the cloth is visible"
        cloth = DrawnCloth.from_scene(self._scene)
        assert cloth is not None
        points = points_of(sheet.moved).reshape(sheet.cells[1] + 1, sheet.cells[0] + 1, 3)
        near = points[rows.start : rows.stop + 1, columns.start : columns.stop + 1]
        scale = pixels_per_metre(camera, near.reshape(-1, 3).astype(np.float64), height)
        if choose_near(cloth, scale, 0, view.size).method is DrawingMethod.SHEET:
            return TOO_FAR.format(scale * cloth.spacing)
        wanted = columns, rows
        if not _covers(self.part, wanted):
            widened = _widen(columns, sheet.cells[0]), _widen(rows, sheet.cells[1])
            for part in (widened, wanted):
                patches = self._patch_count(part)
                if choose_near(cloth, scale, patches, view.size).method is DrawingMethod.NEAR:
                    break
            else:
                return TOO_MANY
            self.part, self._patches = part, patches
            self._parts.choose_part(yarns_of_cells(sheet, *part))
        if self.part is not None:
            self._parts.use_crossings(sheet.crimp_stage, yarns_of_cells(sheet, *self.part))
        self._parts.use_color_array()
        look = self._scene.view.yarn_look
        level = choose_near(cloth, scale, self._patches, view.size)
        choose_facets(self._parts.surface, level, view, look)
        self._preview.set_detail(1, look=look)
        if cage is not None and self._cage != (cage, cage.GetMTime()):
            self._cage = cage, cage.GetMTime()
            self._parts.set_cage(cage)
            for stage in self.stages:
                if isinstance(stage, BarycentricWarp):
                    # The cage of a mode has no velocity to interpolate.
                    stage.carried = "" if is_mode else self._scene.warp.carried
        return ""

    @property
    def yarns(self) -> vtkPolyData:
        """Surface of the yarns from the last update of the stages."""
        return self._parts.surface.output

    def preview(self, time: float) -> vtkPolyData | None:
        """Return a surface with one facet per patch; None if there are still too many."""
        if self._patches > _MOVING_PATCHES:
            return None
        return self._preview.update(time).output

    def _patch_count(self, part: tuple[slice, slice]) -> int:
        cloth = crop_cloth(self._sheet.cloth, yarns_of_cells(self._sheet, *part))
        return estimate_counts(cloth).patches


def visible_sheet_cells(sheet: ClothSheet, camera: vtkCamera, aspect: float) -> tuple[Bools, Bools]:
    """Return which columns and which rows of a sheet's cells are in a picture."""
    clip = project_points(camera, points_of(sheet.moved), aspect)
    columns, rows = sheet.cells
    x, y, _, w = clip.reshape(rows + 1, columns + 1, 4).transpose(2, 0, 1)
    visible = np.ones((rows, columns), bool)
    for beyond in (x < -w, x > w, y < -w, y > w):
        # A cell is out of sight if all its corners are beyond the same edge of the picture.
        visible &= ~(beyond[1:, 1:] & beyond[1:, :-1] & beyond[:-1, 1:] & beyond[:-1, :-1])
    return np.asarray(visible.any(axis=0)), np.asarray(visible.any(axis=1))


def cell_range(visible: Bools, margin: int = 0) -> slice:
    """Return the range of cells from the first seen one to the last, with `beside` more."""
    indices = np.flatnonzero(visible)
    if not len(indices):
        return slice(0, 0)
    return slice(max(int(indices[0]) - margin, 0), min(int(indices[-1]) + 1 + margin, len(visible)))


def yarns_of_cells(sheet: ClothSheet, columns: slice, rows: slice) -> YarnSelection:
    """Return the yarns that cross in the given cells of a sheet."""
    ends, picks = (
        slice(cells.start * count // cell_count, -(-cells.stop * count // cell_count))
        for cells, count, cell_count in zip(
            (columns, rows), sheet.cloth.size, sheet.cells, strict=True
        )
    )
    return YarnSelection(ends, picks)


def _has_visible_cell(visible: Bools, yarns: YarnIndices, count: int) -> bool:
    """Test whether any of the yarns is in a seen cell or next to one."""
    assert isinstance(yarns, slice)
    if yarns.start >= yarns.stop:
        return False
    first = int(yarns.start * len(visible) / count) - 1
    last = ceil(yarns.stop * len(visible) / count) + 1
    return bool(visible[max(first, 0) : last].any())


def _widen(cells: slice, count: int) -> slice:
    more = 1 + ceil(_MARGIN * (cells.stop - cells.start))
    return slice(max(cells.start - more, 0), min(cells.stop + more, count))


def _covers(part: tuple[slice, slice] | None, wanted: tuple[slice, slice]) -> bool:
    """Test whether a part contains the wanted part, and is less than three times as large."""
    if part is None:
        return False
    inside = all(p.start <= w.start and w.stop <= p.stop for p, w in zip(part, wanted, strict=True))
    sizes = [(p.stop - p.start) / (w.stop - w.start) for p, w in zip(part, wanted, strict=True)]
    return inside and sizes[0] * sizes[1] < 3.0
