"""A dark layer inside a closed cloth, in place of the background behind the holes between yarns.

Light that enters a small hole is reflected from yarn to yarn and hardly comes back, so a hole of a
closed cloth looks like its shaded inside. The layer consists of two sheets near the faces of the
cloth, both dark on the inside and invisible from outside. So each is seen through the holes of the
other face, and hides no yarn. It moves with the cage, and is neither measured nor exported.

A cloth is closed if holes are at most `CLOSED` of its area, projected on it. Open cloth, such as
gauze, stays transparent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import points_of, to_cells, to_points
from spacemap_vtk.draw.actors.sheet_actor import quadrilaterals
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.cloth_texture import grid_lines
from spacemap_vtk.textile.weave.cloth import Cloth

#: Largest share of open area of a closed cloth.
CLOSED = 0.05
#: Distance of the sheets from the middle of the cloth, as a share of half its thickness.
_DEPTH = 0.75
#: Brightness of the layer relative to the mean colour of the yarns, as displayed.
_DARKNESS = 0.25

Rgb = tuple[float, float, float]


class Underlay(NamedTuple):
    """The dark layer at one time."""

    surface: vtkPolyData
    color: Rgb


class ClothUnderlay:
    """Makes the dark layer of a scene's cloth."""

    def __init__(self, scene: Scene, sheet: ClothSheet | None = None) -> None:
        self._own = sheet is None
        self._sheet = ClothSheet(scene) if sheet is None else sheet
        self._color = _shaded_color(self._sheet.cloth)

    @classmethod
    def make_if_needed(cls, scene: Scene, sheet: ClothSheet | None = None) -> ClothUnderlay | None:
        """Return the underlay of a closed cloth in its own colours; None for anything else."""
        view, style = scene.view, scene.view.resolved_style
        if scene.woven is None or not view.shadows or not style.occlusion or style.shines_through:
            return None
        if COLORINGS[view.color].shows_numbers or open_share(scene.woven.cloth) > CLOSED:
            return None
        return cls(scene, sheet)

    def is_current(self, scene: Scene) -> bool:
        """Test whether this is still the underlay of a scene that may have changed."""
        return scene.woven is not None and scene.woven.cloth is self._sheet.cloth

    def in_cage(self, cage: vtkUnstructuredGrid | None) -> Underlay:
        """Return the underlay in a deformed cage; without a cage it is flat."""
        if self._own:
            self._sheet.deform(cage)
        return Underlay(_make_sheets(self._sheet), self._color)


def hole_color(cloth: Cloth) -> Rgb | None:
    """Return the colour of the holes between a cloth's yarns; None for open cloth."""
    return _shaded_color(cloth) if open_share(cloth) <= CLOSED else None


def open_share(cloth: Cloth) -> float:
    """Compute the share of a cloth's area that no yarn covers, from mean widths and spacings."""
    warp, weft = (max(0.0, 1.0 - family.width / family.spacing) for family in cloth.families)
    return warp * weft


def _shaded_color(cloth: Cloth) -> Rgb:
    """Return the colour of the inside: a dark mean of the yarns' colours."""
    light = [np.square(threads.colors / 255.0).mean(axis=0) for threads in cloth.threads]
    red, green, blue = _DARKNESS * np.sqrt(np.mean(light, axis=0))
    return float(red), float(green), float(blue)


def _make_sheets(sheet: ClothSheet) -> vtkPolyData:
    """Return both sheets, between the axes of the outermost yarns."""
    (columns, rows), cloth = sheet.cells, sheet.cloth
    middle = points_of(sheet.moved).astype(np.float64).reshape(rows + 1, columns + 1, 3)
    for number, axis in ((0, 1), (1, 0)):
        lines = grid_lines(cloth, number, sheet.cells[number])
        middle = _trim(middle, lines, cloth.yarns[number].position, axis)
    normal = np.cross(np.gradient(middle, axis=1), np.gradient(middle, axis=0))
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-30)
    depth = _DEPTH * (0.5 * cloth.sheet_thickness + cloth.level)
    points = [(middle + side * depth * normal).reshape(-1, 3) for side in (-1.0, 1.0)]
    quads = quadrilaterals(columns, rows)
    made = vtkPolyData()
    made.SetPoints(to_points(np.concatenate(points)))
    # The lower sheet faces up, the upper one down.
    made.SetPolys(to_cells(np.concatenate([quads, quads[:, ::-1] + len(points[0])])))
    return made


def _trim(points: Floats, lines: Floats, position: Floats, axis: int) -> Floats:
    """Move the borders of a sheet, with these lines at rest, to the outermost yarns."""
    grid = np.moveaxis(points, axis, 0).copy()
    for border, inner, place in ((0, 1, position[0]), (-1, -2, position[-1])):
        share = (place - lines[border]) / (lines[inner] - lines[border])
        grid[border] += min(share, 0.999) * (grid[inner] - grid[border])
    return np.moveaxis(grid, 0, axis)
