"""A cloth's yarns, some after others: made, moved, drawn and let go, so that few are in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, isqrt

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.datasets.arrays import copied, points_of
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.draw.camera import projected
from spacemap_vtk.draw.coloring import add_measure
from spacemap_vtk.draw.form import Sheet
from spacemap_vtk.draw.yarn_tiles import OwnStages
from spacemap_vtk.fabric.axes import Share
from spacemap_vtk.fabric.partition import cropped, share_of
from spacemap_vtk.fabric.threads import Some
from spacemap_vtk.fabric.weave import estimate_counts
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.scenes.scene import Scene

#: Patches and quadrilaterals of a piece, at most: some hundred megabytes. Each costs as much as a
#: picture of nothing, 0.2 s for 1920 x 1080.
_PATCHES, _QUADS = 300_000, 800_000
#: Cells of the sheet that are made beside those in sight: what is cut there bends otherwise.
_BESIDE = 4
#: Crossings along each side of a tile, at least.
_LEAST_TILE = 8


class DrawnPieces:
    """The yarns of a scene, piece by piece, in stages of their own."""

    def __init__(self, scene: Scene) -> None:
        assert scene.woven is not None
        self._scene, self._cloth, sides = scene, scene.woven.cloth, scene.surface.sides
        patches = estimate_counts(self._cloth).patches
        wanted = max(patches / _PATCHES, patches * sides**2 / _QUADS)
        self.count = min(ceil(wanted), sum(self._cloth.size))
        self._stages = OwnStages(scene)
        self._stages.surface.choose(*scene.surface.chosen)

    def in_sight(
        self, time: float, sheet: Sheet, camera: vtkCamera, aspect: float
    ) -> Iterator[vtkPolyData]:
        """Yield the surfaces of those pieces of which something is in a picture, with colours."""
        if self._scene.moves:
            self._stages.ride(self._scene.deformed_cage)
        sight = cells_in_sight(sheet, camera, aspect)
        runs = [run_of(seen, _BESIDE) for seen in sight]
        if any(run.start == run.stop for run in runs):
            return
        # Yarns are no longer than what is seen of them.
        part = yarns_in(sheet, runs[0], runs[1])
        if self._scene.view.color == "clearance":
            yield from self._tiles(time, sheet, part, sight)
            return
        cloth = cropped(self._cloth, part)
        self._stages.take(part, sheet.crimp)
        patches = estimate_counts(cloth).patches
        count = ceil(self.count * patches / estimate_counts(self._cloth).patches)
        columns, rows = (seen[run] for seen, run in zip(sight, runs, strict=True))
        for number in range(count):
            share = share_of(cloth, number, count)
            if _any(columns, share.ends, cloth.size[0]) or _any(rows, share.picks, cloth.size[1]):
                with self._scene.naming_file():
                    surface = copied(self._stages.surface.update(time, Piece(number, count)).output)
                add_measure(surface, self._scene.view.color)
                yield surface

    def _tiles(
        self, time: float, sheet: Sheet, part: Share, sight: Sequence[Bools]
    ) -> Iterator[vtkPolyData]:
        """Yield pieces in which yarns have their neighbours."""
        whole = isqrt(self._cloth.drawdown.size // self.count)
        side = max(whole - 2 * self._stages.beside, _LEAST_TILE)
        ends, picks = (
            [slice(at, min(at + side, some.stop)) for at in range(some.start, some.stop, side)]
            for some in part
            if isinstance(some, slice)
        )
        for columns in ends:
            for rows in picks:
                seen = zip(sight, (columns, rows), self._cloth.size, strict=True)
                if all(_any(cells, some, count) for cells, some, count in seen):
                    tile = self._stages.tile(columns, rows, time, sheet.crimp)
                    if tile is not None:
                        yield tile.cut


def cells_in_sight(sheet: Sheet, camera: vtkCamera, aspect: float) -> tuple[Bools, Bools]:
    """Return which columns and rows of a sheet's cells are in a picture."""
    places = projected(camera, points_of(sheet.moved), aspect)
    columns, rows = sheet.cells
    x, y, _, w = places.reshape(rows + 1, columns + 1, 4).transpose(2, 0, 1)
    seen = np.ones((rows, columns), bool)
    for beyond in (x < -w, x > w, y < -w, y > w):
        # A cell with all corners on one side is not in sight.
        seen &= ~(beyond[1:, 1:] & beyond[1:, :-1] & beyond[:-1, 1:] & beyond[:-1, :-1])
    return np.asarray(seen.any(axis=0)), np.asarray(seen.any(axis=1))


def run_of(seen: Bools, beside: int = 0) -> slice:
    """Return the run of cells that holds all that are seen, and some beside it."""
    found = np.flatnonzero(seen)
    if not len(found):
        return slice(0, 0)
    return slice(max(int(found[0]) - beside, 0), min(int(found[-1]) + 1 + beside, len(seen)))


def yarns_in(sheet: Sheet, columns: slice, rows: slice) -> Share:
    """Return the yarns that cross in some cells of a sheet."""
    ends, picks = (
        slice(cells.start * count // of, -(-cells.stop * count // of))
        for cells, count, of in zip((columns, rows), sheet.cloth.size, sheet.cells, strict=True)
    )
    return Share(ends, picks)


def _any(seen: Bools, some: Some, count: int) -> bool:
    """Return whether any of some yarns is in cells that are seen, or beside one."""
    assert isinstance(some, slice)
    if some.start >= some.stop:
        return False
    first = int(some.start * len(seen) / count) - 1
    last = ceil(some.stop * len(seen) / count) + 1
    return bool(seen[max(first, 0) : last].any())
