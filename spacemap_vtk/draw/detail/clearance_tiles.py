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

#: Number of yarns made on each side of a tile.
_MARGIN_YARNS = 4
#: The same for yarns whose axes are splines: a cut changes a spline over a longer distance.
_MARGIN_YARNS_SPLINE = 16
#: Place between two yarns where a tile ends, as a share of their distance. No patch has its centre
#: there, so each patch is clearly inside or outside.
_TILE_END = 0.3137
#: Largest number of crossings in the tiles that contain all local weaves.
_MAX_CROSSINGS = 2500
#: Number of crossings along each side of a tile at a sampled place.
_SAMPLE_SIDE = 5
#: Number of sampled places along each side of a cloth. The most strained cells are sampled too.
_SAMPLES_PER_SIDE = 3


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
        trimmed = shallow_copy(self.surface)
        trimmed.SetPolys(to_cells(self.inner_quads))
        inside = np.flatnonzero(np.repeat(self.inside, self.quads.shape[1]))
        trimmed.GetCellData().Initialize()
        copy_rows(self.surface.GetCellData(), trimmed.GetCellData(), inside)
        return trimmed

    @property
    def facets(self) -> tuple[NDArray[Any], Floats, Floats]:
        """Yarns, centres and areas of the facets inside the tile, for `average_at_crossings`."""
        corners, quads, (_, facets_per_patch, _) = (
            self.corners[self.inside],
            self.inner_quads,
            self.quads.shape,
        )
        # At rest, facets are evenly spaced in their patch, like their parameters.
        step = (np.arange(isqrt(facets_per_patch)) + 0.5) / isqrt(facets_per_patch)
        u, v = (way.ravel() for way in np.meshgrid(step, step))
        share = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
        middle = np.einsum("fc,pck->pfk", share, corners[..., :2]).reshape(-1, 2)
        points = points_of(self.surface)
        area = np.cross(*(points[quads[:, k + 2]] - points[quads[:, k]] for k in (0, 1)))
        edge_1, edge_2 = (corners[:, k + 2] - corners[:, k] for k in (0, 1))
        on_top = np.repeat(
            edge_1[:, 0] * edge_2[:, 1] > edge_1[:, 1] * edge_2[:, 0], facets_per_patch
        )
        total = area[on_top].sum(axis=0)
        covered_area = area @ (total / np.linalg.norm(total))
        return (
            np.repeat(self.yarn[self.inside], facets_per_patch),
            middle,
            covered_area.astype(np.float64),
        )

    @property
    def inner_quads(self) -> NDArray[Any]:
        """Point indices of the facets inside the tile, (n, 4)."""
        return self.quads[self.inside].reshape(-1, 4)


def margin_yarns(cloth: Cloth) -> int:
    """Return the number of yarns made on each side of a tile."""
    return _MARGIN_YARNS_SPLINE if cloth.axis == "spline" else _MARGIN_YARNS


def measure_tile(
    stages: PartStages, ends: slice, picks: slice, time: float, crimp: CrimpInterchange | None
) -> ClothTile | None:
    """Measure the tile where the given ends and picks cross; None if it cannot be measured."""
    cloth, margin = stages.cloth, margin_yarns(stages.cloth)
    part = YarnSelection(
        *(
            slice(max(core.start - margin, 0), min(core.stop + margin, size))
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
        is_own_family = (yarn >= first[1]) == bool(number)
        low, high = _tile_limits(cloth.yarns[number].position, core)
        across = (middle[:, number] >= low) & (middle[:, number] < high)
        place = yarn - first[number]
        inside &= np.where(is_own_family, (place >= core.start) & (place < core.stop), across)
    facets_per_patch = stages.surface.sides**2
    clearance = compute_clearances(surface, np.repeat(inside, facets_per_patch))
    if clearance is None:
        return None
    quads = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(
        len(yarn), facets_per_patch, 4
    )
    surface.GetPointData().AddArray(to_array(clearance, COLOR_VALUES))
    return ClothTile(surface, clearance, quads, inside, corners, yarn)


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
        self._parts, self._weaves = representative_parts(self._stages.cloth, _MAX_CROSSINGS)
        #: Vertices of the last cage (strains without a cage), and the clearances found for them.
        self._last: tuple[NDArray[Any], Clearances | None] | None = None

    def clearances_in(
        self, cage: vtkUnstructuredGrid | None, strains: Floats, crimp: CrimpInterchange | None
    ) -> Clearances | None:
        """Return the clearances of a cloth in a deformed cage; `strains` are those of its sheet."""
        state = strains if cage is None else moved_points(cage)
        if self._last is None or not np.array_equal(self._last[0], state):
            self._last = state, self._measure(cage, strains, crimp)
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
        crossings, values, spans = [], [], []
        for ends_part, picks_part in parts:
            tile = measure_tile(self._stages, ends_part, picks_part, 0.0, crimp)
            if tile is None:
                return None
            mean = tile.clearance[tile.inner_quads].mean(axis=1)
            means = average_at_crossings(cloth, (ends_part, picks_part), tile.facets, mean)
            number = np.arange(picks)[picks_part, None] * ends + np.arange(ends)[ends_part]
            crossings.append(number.ravel())
            values.append(means.reshape(2, -1))
            finite = tile.clearance[np.isfinite(tile.clearance)]
            spans += [finite.min(), finite.max()]
        cells = _cells_of_yarns(picks, rows)[:, None] * columns + _cells_of_yarns(ends, columns)
        clearances = extrapolate_values(
            self._weaves,
            cloth.drawdown,
            strains.reshape(rows * columns, -1),
            cells,
            np.concatenate(crossings),
            np.concatenate(values, axis=1),
        )
        return Clearances(clearances, np.array([min(spans), max(spans)], np.float32))


def sheet_strains(sheet: Floats, rest: Floats) -> Floats:
    """Compute strains of a sheet's cells along weft and warp, and shear, (rows, columns, 3)."""
    # `sheet` and `rest` have the shape (rows + 1, columns + 1, 3).
    along = []
    for axis in (1, 0):
        deformed, at_rest = (np.diff(points, axis=axis) for points in (sheet, rest))
        mean = [
            0.5 * (v[1:] + v[:-1] if axis else v[:, 1:] + v[:, :-1]) for v in (deformed, at_rest)
        ]
        along.append(mean[0] / np.linalg.norm(mean[1], axis=-1, keepdims=True))
    stretch = [np.linalg.norm(vectors, axis=-1) for vectors in along]
    shear = np.einsum("...k,...k->...", *along) / (stretch[0] * stretch[1])
    return np.stack([stretch[0] - 1.0, stretch[1] - 1.0, shear], axis=-1)


def _sample_tiles(strains: Floats, size: tuple[int, int]) -> list[tuple[slice, slice]]:
    """Return tiles at the cells with the largest and least strains, and on a coarse grid."""
    rows, columns, count = strains.shape
    flat = strains.reshape(-1, count)
    chosen = {int(k) for k in (*flat.argmin(axis=0), *flat.argmax(axis=0))}
    grid = [np.linspace(0, n - 1, _SAMPLES_PER_SIDE).astype(int) for n in (rows, columns)]
    chosen |= {int(row * columns + column) for row in grid[0] for column in grid[1]}

    def run(cell_index: int, cells: int, yarns: int) -> slice:
        first = min(
            int((cell_index + 0.5) * yarns / cells) - _SAMPLE_SIDE // 2, yarns - _SAMPLE_SIDE
        )
        return slice(max(first, 0), min(max(first, 0) + _SAMPLE_SIDE, yarns))

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
        low = place[core.start - 1] + _TILE_END * (place[core.start] - place[core.start - 1])
    if core.stop < len(place):
        high = place[core.stop - 1] + _TILE_END * (place[core.stop] - place[core.stop - 1])
    return float(low), float(high)
