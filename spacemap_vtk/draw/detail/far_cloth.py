"""Record the cloth of a scene as a sheet with its motion, and how pictures shade cloth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.moving_surface import FarCloth, MovingSurface, Shading
from spacemap_vtk.draw.actors.lighting import OUTLINE, lighting_code
from spacemap_vtk.draw.actors.sheet_actor import (
    fewest_cells,
    sparse_lines,
)
from spacemap_vtk.draw.actors.sheet_shaders import (
    CODES,
    FRAGMENT_FUNCTIONS,
    LEVELS,
    TILE_LEVELS,
    VERTEX_FUNCTIONS,
    sheet_constants,
)
from spacemap_vtk.draw.actors.sheet_textures import make_sheet_textures
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.filters.patch_tessellator import LOOK
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats, Singles
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import SMALLEST_IN_WINDOW, DrawnCloth
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.styles import Style
from spacemap_vtk.textile.geometry.irregularity import Irregularity

#: Largest number of cells along each side of the sheet.
_MOST_CELLS = 64
#: Largest error of the sheet between its vertices, in spacings of the yarns.
_ERROR = 0.5
#: Number of shapes of the sheet that are compared to choose its vertices.
_COMPARED = 24
#: Largest number of texels that a pixel sums. Browsers without a graphics card are slow.
_MOST_TEXELS = 36


def style_of(scene: Scene) -> Style:
    """Return the style in which pictures draw the colours of a scene."""
    style = scene.view.resolved_style
    if COLORINGS[scene.view.color].shows_numbers:
        return style.for_numbers
    return style if scene.view.shadows else replace(style, occlusion=0.0)


def measure_exposures(scene: Scene) -> None:
    """Let a scene's surface contain exposures, if pictures show them."""
    if scene.woven is not None and style_of(scene).occlusion > 0.0:
        sides, strands, detail, look = scene.surface.detail
        scene.surface.set_detail(sides, strands, detail, look or Irregularity(0.0))


class FarClothRecorder:
    """A woven cloth as a sheet at several times."""

    def __init__(self, scene: Scene, times: int) -> None:
        self._scene = scene
        self._sheet = ClothSheet(scene, _MOST_CELLS)
        columns, rows = self._sheet.cells
        self._points: Singles = np.empty((times, rows + 1, columns + 1, 3), np.float32)

    def record(self, number: int, cage: vtkUnstructuredGrid | None) -> None:
        """Record the sheet in a deformed cage as that of time `number`."""
        moved = points_of(self._sheet.deform(cage))
        self._points[number] = moved.reshape(self._points.shape[1:])

    def record_at(self, number: int, time: float) -> None:
        """Record the sheet at a time [s] as that of time `number`, without making all yarns."""
        self._points[number] = points_of(self._sheet.deform_at(time)).reshape(
            self._points.shape[1:]
        )

    @property
    def displacements(self) -> Singles:
        """Displacements of all points since the first time, (T, n, 3)."""
        return (self._points - self._points[0]).reshape(len(self._points), -1, 3)

    def make(self, weights: AnyFloats, surface: MovingSurface | None = None) -> FarCloth:
        """Return the sheet beside a surface, with a target for each of the weights, (T, K)."""
        # Without a surface, the sheet shows the cloth from any distance.
        scene, cloth, cells = self._scene, self._sheet.cloth, self._sheet.cells
        drawn = DrawnCloth.from_scene(scene)
        assert drawn is not None
        # Least squares over time; it is this simple because the weights are orthogonal.
        fit = weights / np.maximum(np.square(weights).sum(axis=0), 1e-30)
        some = np.unique(np.linspace(0, len(self._points) - 1, _COMPARED).astype(int))
        shapes = self._points[some].transpose(1, 2, 0, 3).reshape(*self._points.shape[1:3], -1)
        count = fewest_cells(shapes / (_ERROR * drawn.spacing)) or max(cells)
        columns, rows = (sparse_lines(n, count) for n in cells)
        kept = self._points[:, rows[:, None], columns].reshape(len(self._points), -1, 3)
        values, changes = _numbers_at(kept[0], surface)
        style, color = style_of(scene), scene.view.color
        textures = make_sheet_textures(cloth, color, None, style, None, style.occlusion)
        constants = sheet_constants(_MOST_TEXELS)
        return FarCloth(
            0 if surface is None else len(surface.triangles),
            columns / cells[0],
            rows / cells[1],
            kept[0],
            np.tensordot(fit, kept - kept[0], (0, 0)),
            values,
            changes,
            drawn.spacing,
            None if surface is None else max(SMALLEST_IN_WINDOW, drawn.least_pixels),
            textures.layers,
            LEVELS,
            {"tileNumbers": textures.tile_numbers, "tiles": textures.tables.tiles},
            TILE_LEVELS,
            textures.tables.views,
            {
                "crossings": textures.crossings,
                "averaged": int(textures.averaged),
                "mixing": textures.mixing,
                "shaded": style.occlusion,
            },
            constants + VERTEX_FUNCTIONS,
            constants + FRAGMENT_FUNCTIONS,
        )


def make_shading(
    scene: Scene,
    far: FarCloth | None,
    surface: vtkPolyData | None = None,
    rows: AnyInts | slice = slice(None),
) -> Shading:
    """Return how pictures shade a scene's cloth as a sheet, and points `rows` of its surface."""
    style = style_of(scene)
    look = None if surface is None else surface.GetPointData().GetArray(LOOK)
    exposures = None
    if look is not None:
        shares = np.clip(vtk_to_numpy(look)[rows, 0], 0.0, 1.0)
        exposures = np.rint(255.0 * shares).astype(np.uint8)
    return Shading(CODES + lighting_code(style), OUTLINE, exposures, far)


def _numbers_at(
    points: Singles, surface: MovingSurface | None
) -> tuple[Floats | None, Floats | None]:
    """Return the mean numbers of a surface, and of their changes, around points of a sheet."""
    if surface is None or surface.numbers is None:
        return None, None
    nearest = cKDTree(points).query(surface.points)[1]
    amounts = np.bincount(nearest, minlength=len(points))
    # A point without any near point of the surface has the numbers of the nearest one.
    alone = np.flatnonzero(amounts == 0)
    instead = cKDTree(surface.points).query(points[alone])[1]

    def mean(values: AnyFloats) -> Floats:
        sums = np.bincount(nearest, values, len(points)) / np.maximum(amounts, 1)
        sums[alone] = values[instead]
        return sums

    changes: Iterable[Floats] = map(mean, surface.numbers.changes)
    return mean(surface.numbers.values), np.array([*changes]).reshape(-1, len(points))
