"""Measure clearances between yarns on tiles of a cloth that is too large to be made whole.

The clearance at a point depends only on the yarns close to it. So a tile is made together with some
yarns on each side, and only the tile itself is measured.
"""

from __future__ import annotations

from math import isqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import copy_rows, points_of, shallow_copy, to_array, to_cells
from spacemap_vtk.draw.actors.color_values import COLOR_VALUES, compute_clearances
from spacemap_vtk.draw.actors.glyphs import moved_points
from spacemap_vtk.draw.detail.part_stages import PartStages
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.ndarrays import Bools, Floats, Ints, Singles
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.partition import representative_parts
from spacemap_vtk.textile.geometry.point_clearance import average_at_crossings, extrapolate_values
from spacemap_vtk.textile.weave.cloth import Cloth

#: Number of yarns made on each side of a tile. Yarns whose axes are splines need more, because a
#: cut changes a spline over a longer distance.
_BESIDE, _BESIDE_SPLINES = 4, 16
#: Place between two yarns where a tile ends, as a share of their distance. No patch has its centre
#: there, so each patch is clearly inside or outside.
_CUT = 0.3137
#: _MOST: largest number of crossings in the tiles that contain all local weaves. _SIDE: crossings
#: along each side of a tile at a sampled place.
_MOST, _SIDE = 2500, 5
#: Number of sampled places along each side of a cloth. The most strained cells are sampled too.
_PLACES = 3


class ClothTile(NamedTuple):
    """The surface of some crossings of a cloth, and of the crossings around them."""

    surface: vtkPolyData
    """Surface of the tile and of the yarns around it."""
    clearance: Singles
    """Distance of each point to the next yarn, in m; infinite outside the tile."""
    quads: NDArray[Any]
    """(patches, facets, 4) Point indices of each patch's facets."""
    inside: Bools
    """(patches,) Whether each patch belongs to the tile."""
    corners: Floats
    """(patches, 4, 3) Corners of the patches at rest, in m."""
    yarn: NDArray[Any]
    """(patches,) Yarn of each patch."""

    @property
    def trimmed_surface(self) -> vtkPolyData:
        """The surface of the tile without the yarns around it."""
        made = shallow_copy(self.surface)
        made.SetPolys(to_cells(self.inner_quads))
        kept = np.flatnonzero(np.repeat(self.inside, self.quads.shape[1]))
        made.GetCellData().Initialize()
        copy_rows(self.surface.GetCellData(), made.GetCellData(), kept)
        return made

    @property
    def facets(self) -> tuple[NDArray[Any], Floats, Floats]:
        """Yarns, centres and areas of the facets inside the tile, for `crossing_means`."""
        corners, quads, (_, each, _) = self.corners[self.inside], self.inner_quads, self.quads.shape
        # At rest, facets are evenly spaced in their patch, like their parameters.
        step = (np.arange(isqrt(each)) + 0.5) / isqrt(each)
        u, v = (way.ravel() for way in np.meshgrid(step, step))
        share = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
        middle = np.einsum("fc,pck->pfk", share, corners[..., :2]).reshape(-1, 2)
        points = points_of(self.surface)
        area = np.cross(*(points[quads[:, k + 2]] - points[quads[:, k]] for k in (0, 1)))
        one, two = (corners[:, k + 2] - corners[:, k] for k in (0, 1))
        on_top = np.repeat(one[:, 0] * two[:, 1] > one[:, 1] * two[:, 0], each)
        above = area[on_top].sum(axis=0)
        covered = area @ (above / np.linalg.norm(above))
        return np.repeat(self.yarn[self.inside], each), middle, covered.astype(np.float64)

    @property
    def inner_quads(self) -> NDArray[Any]:
        """Point indices of the facets inside the tile, (n, 4)."""
        return self.quads[self.inside].reshape(-1, 4)


def margin_yarns(cloth: Cloth) -> int:
    """Return the number of yarns made on each side of a tile."""
    return _BESIDE_SPLINES if cloth.axis == "spline" else _BESIDE


def measure_tile(
    stages: PartStages, ends: slice, picks: slice, time: float, crimp: CrimpInterchange | None
) -> ClothTile | None:
    """Measure the tile where the given ends and picks cross; None if it cannot be measured."""
    cloth, beside = stages.cloth, margin_yarns(stages.cloth)
    part = YarnSelection(
        *(
            slice(max(core.start - beside, 0), min(core.stop + beside, size))
            for core, size in zip((ends, picks), cloth.size, strict=True)
        )
    )
    stages.choose_part(part)
    stages.use_crossings(crimp, part)
    surface, grid = stages.update(time), stages.source.output
    yarn = vtk_to_numpy(grid.GetCellData().GetArray("yarn"))
    table = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 16)
    corners = points_of(grid)[table[:, :4]].astype(np.float64)
    middle, inside = corners.mean(axis=1), np.ones(len(yarn), bool)
    first = np.array([0, cloth.size[0]])
    for number, core in enumerate((ends, picks)):
        own = (yarn >= first[1]) == bool(number)
        low, high = _tile_limits(cloth.yarns[number].position, core)
        across = (middle[:, number] >= low) & (middle[:, number] < high)
        place = yarn - first[number]
        inside &= np.where(own, (place >= core.start) & (place < core.stop), across)
    each = stages.surface.sides**2
    found = compute_clearances(surface, np.repeat(inside, each))
    if found is None:
        return None
    quads = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(len(yarn), each, 4)
    surface.GetPointData().AddArray(to_array(found, COLOR_VALUES))
    return ClothTile(surface, found, quads, inside, corners, yarn)


class Clearances(NamedTuple):
    """Clearances between the yarns of a cloth."""

    crossings: Singles
    """(2, picks, ends) Mean clearance of the visible half of end and pick, in m."""
    ends: Singles
    """(2,) Smallest and largest clearance of all points, in m."""


class SampledClearances:
    """Clearances of a cloth, extrapolated from tiles that contain all its local weaves."""

    def __init__(self, scene: Scene, sides: int) -> None:
        self._stages = PartStages(scene)
        self._stages.surface.set_detail(sides)
        self._parts, self._weaves = representative_parts(self._stages.cloth, _MOST)
        #: Vertices of the last cage (strains without a cage), and the clearances found for them.
        self._last: tuple[NDArray[Any], Clearances | None] | None = None

    def clearances_in(
        self, cage: vtkUnstructuredGrid | None, strains: Floats, crimp: CrimpInterchange | None
    ) -> Clearances | None:
        """Return the clearances of a cloth in a deformed cage; `strains` are those of its sheet."""
        asked = strains if cage is None else moved_points(cage)
        if self._last is None or not np.array_equal(self._last[0], asked):
            self._last = asked, self._measure(cage, strains, crimp)
        return self._last[1]

    def _measure(
        self, cage: vtkUnstructuredGrid | None, strains: Floats, crimp: CrimpInterchange | None
    ) -> Clearances | None:
        cloth, (rows, columns, _) = self._stages.cloth, strains.shape
        ends, picks = cloth.size
        parts = self._parts
        if cage is not None:
            self._stages.set_cage(cage)
            parts = parts + _sample_tiles(strains, (ends, picks))
        known, values, spans = [], [], []
        for of_ends, of_picks in parts:
            tile = measure_tile(self._stages, of_ends, of_picks, 0.0, crimp)
            if tile is None:
                return None
            mean = tile.clearance[tile.inner_quads].mean(axis=1)
            means = average_at_crossings(cloth, (of_ends, of_picks), tile.facets, mean)
            number = np.arange(picks)[of_picks, None] * ends + np.arange(ends)[of_ends]
            known.append(number.ravel())
            values.append(means.reshape(2, -1))
            there = tile.clearance[np.isfinite(tile.clearance)]
            spans += [there.min(), there.max()]
        cells = _cells_of_yarns(picks, rows)[:, None] * columns + _cells_of_yarns(ends, columns)
        found = extrapolate_values(
            self._weaves,
            cloth.drawdown,
            strains.reshape(rows * columns, -1),
            cells,
            np.concatenate(known),
            np.concatenate(values, axis=1),
        )
        return Clearances(found, np.array([min(spans), max(spans)], np.float32))


def sheet_strains(sheet: Floats, rest: Floats) -> Floats:
    """Compute strains of a sheet's cells along weft and warp, and shear, (rows, columns, 3)."""
    # `sheet` and `rest` have the shape (rows + 1, columns + 1, 3).
    along = []
    for axis in (1, 0):
        now, before = (np.diff(points, axis=axis) for points in (sheet, rest))
        mean = [0.5 * (v[1:] + v[:-1] if axis else v[:, 1:] + v[:, :-1]) for v in (now, before)]
        along.append(mean[0] / np.linalg.norm(mean[1], axis=-1, keepdims=True))
    stretch = [np.linalg.norm(vectors, axis=-1) for vectors in along]
    shear = np.einsum("...k,...k->...", *along) / (stretch[0] * stretch[1])
    return np.stack([stretch[0] - 1.0, stretch[1] - 1.0, shear], axis=-1)


def _sample_tiles(strains: Floats, size: tuple[int, int]) -> list[tuple[slice, slice]]:
    """Return tiles at the cells with the largest and least strains, and on a coarse grid."""
    rows, columns, count = strains.shape
    flat = strains.reshape(-1, count)
    chosen = {int(k) for k in (*flat.argmin(axis=0), *flat.argmax(axis=0))}
    grid = [np.linspace(0, n - 1, _PLACES).astype(int) for n in (rows, columns)]
    chosen |= {int(row * columns + column) for row in grid[0] for column in grid[1]}

    def run(at: int, cells: int, yarns: int) -> slice:
        first = min(int((at + 0.5) * yarns / cells) - _SIDE // 2, yarns - _SIDE)
        return slice(max(first, 0), min(max(first, 0) + _SIDE, yarns))

    return [
        (run(cell % columns, columns, size[0]), run(cell // columns, rows, size[1]))
        for cell in sorted(chosen)
    ]


def _cells_of_yarns(yarns: int, cells: int) -> Ints:
    """Return the index of the sheet's cell that contains each yarn of a family."""
    return ((np.arange(yarns) + 0.5) * cells / yarns).astype(np.int64)


def _tile_limits(place: Floats, core: slice) -> tuple[float, float]:
    """Return the lowest and highest place that belongs to the given yarns of a family."""
    low, high = -np.inf, np.inf
    if core.start > 0:
        low = place[core.start - 1] + _CUT * (place[core.start] - place[core.start - 1])
    if core.stop < len(place):
        high = place[core.stop - 1] + _CUT * (place[core.stop] - place[core.stop - 1])
    return float(low), float(high)
