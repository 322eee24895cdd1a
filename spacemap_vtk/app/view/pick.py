"""Points of the fabric that the user has picked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.color_values import COLOR_VALUES, scale_unit
from spacemap_vtk.draw.actors.glyphs import rest_points
from spacemap_vtk.draw.actors.surface_actor import Span
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.units import format_quantity, typeset_units

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Pick:
    """A picked point: yarn, crossing and positions."""

    #: Index of the yarn, ends first, then picks; None on an object without yarns.
    yarn: int | None
    #: 0 for warp, 1 for weft.
    family: int | None
    #: Number of the yarn in its family, counted from 1 as weavers and drafts do.
    number: int | None
    #: Number of the nearest yarn of the other family, also from 1; None if there is none.
    crossed: int | None
    #: Position, position at rest, and their difference, in m.
    position: Point
    rest: Point
    displacement: Point
    #: Cache: for each number of points of a surface, the index of the nearest point and its
    #: distance at rest in m.
    _nearest: dict[int, tuple[int, float]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    @property
    def name(self) -> str:
        """Yarn and crossing in words; empty on an object."""
        if self.number is None or self.family is None:
            return ""
        names = "end", "pick"
        crossed = "" if self.crossed is None else f" × {names[1 - self.family]} {self.crossed}"
        return f"{names[self.family]} {self.number}{crossed}"

    @property
    def text(self) -> str:
        """A line that describes the point for the user."""
        where = ", ".join(format_quantity(c, "m", 4) for c in self.position)
        of = f"{self.name}   " if self.name else ""
        return f"{of}at ({where})   {_format_displacement(self.displacement)}"

    def label(self, frame: Frame, span: Span | None) -> tuple[NDArray[np.float64], str]:
        """Return the position in a frame, and a label with name, shown value and position."""
        surfaces = [frame.surface] if frame.yarns is None else [frame.yarns, frame.surface]
        # The yarns drawn near the camera may belong to another part of the cloth.
        nearest_points = [
            (surface, *self._find_nearest(surface, frame.relief)) for surface in surfaces
        ]
        surface, nearest, _ = min(nearest_points, key=lambda entry: entry[2])
        position = points_of(surface)[nearest].astype(np.float64)
        numbers, value = surface.GetPointData().GetArray(COLOR_VALUES), None
        if numbers is not None:
            value = numbers.GetTuple1(nearest)
        elif frame.crossings is not None and COLORINGS[frame.color].has_scale and self.crossed:
            assert self.family is not None
            assert self.number is not None
            end, pick = (self.number, self.crossed)[:: 1 - 2 * self.family]
            of_yarns = frame.crossings[self.family - len(frame.crossings)]
            value = float(of_yarns[pick - 1, end - 1])
        value_text = ""
        if value is None and surface.GetPointData().HasArray("displacement"):
            value_text = _format_displacement(position - self.rest)
        elif value is not None:
            unit, size = scale_unit(frame.color, max(map(abs, span or (value,))))
            value_text = f"{COLORINGS[frame.color].label} {value / size:.3g} {typeset_units(unit)}"
        unit, size = scale_unit("displacement", float(np.abs(position).max()))
        coordinates = ", ".join(f"{c / size:.4g}" for c in position + 0.0)
        lines = self.name, value_text.strip(), f"({coordinates}) {unit}"
        return position, "\n".join(filter(None, lines)).replace("-", "−")

    def _find_nearest(self, surface: vtkPolyData, tolerance: float) -> tuple[int, float]:
        """Find the nearest point of a surface and its distance; `tolerance` allows a cached one."""
        points, moved = points_of(surface), surface.GetPointData().GetArray("displacement")
        number, distance = self._nearest.get(len(points), (0, -np.inf))
        rest = points[number] - (0.0 if moved is None else moved.GetTuple3(number))
        present_distance = float(np.linalg.norm(rest - self.rest))
        if present_distance <= distance + tolerance:
            return number, present_distance
        squares = ((rest_points(surface) - self.rest) ** 2).sum(axis=1)
        number = int(squares.argmin())
        self._nearest[len(points)] = number, float(squares[number] ** 0.5)
        return self._nearest[len(points)]


def _format_displacement(displacement: NDArray[np.float64] | Point) -> str:
    size = sum(c * c for c in displacement) ** 0.5
    return f"moved by {format_quantity(float(f'{size:.4g}'), 'm')}"


def read_point(surface: vtkPolyData, cell: int, point: int, cloth: Cloth | None = None) -> Pick:
    """Read yarn, crossing and positions at a point of a surface of yarns or of an object."""
    position = points_of(surface)[point].astype(float)
    moved = surface.GetPointData().GetArray("displacement")
    displacement = np.zeros(3) if moved is None else vtk_to_numpy(moved)[point].astype(float)
    yarn, family, number, crossed = None, None, None, None
    cells, rest = surface.GetCellData(), position - displacement
    if cells.HasArray("yarn") and cells.HasArray("family"):
        yarns, families = (vtk_to_numpy(cells.GetArray(name)) for name in ("yarn", "family"))
        yarn, family = int(yarns[cell]), int(families[cell])
        # Ends are arranged along x, picks along y.
        if cloth is None:
            firsts = [int(yarns[families == k].min(initial=len(yarns))) for k in (0, 1)]
        else:
            firsts = [0, cloth.size[0]]
        others = np.flatnonzero(families != family)
        number = yarn - firsts[family] + 1
        if len(others):
            starts = vtk_to_numpy(surface.GetPolys().GetConnectivityArray())
            corner = starts.reshape(len(yarns), -1)[others, 0]
            place, count = rest_points(surface)[corner, family ^ 1], np.bincount(yarns[others])
            with np.errstate(invalid="ignore"):
                middles = np.bincount(yarns[others], place) / count
            crossed = int(np.nanargmin(np.abs(middles - rest[family ^ 1]))) - firsts[1 - family] + 1
    return Pick(yarn, family, number, crossed, *map(_as_point, (position, rest, displacement)))


def read_sheet(sheet: vtkPolyData, cell: int, part: Point, behind: bool, cloth: Cloth) -> Pick:
    """Read the yarn on top, or on the back, at a position in a cell of a cloth's sheet."""
    corners = vtk_to_numpy(sheet.GetPolys().GetConnectivityArray()).reshape(-1, 4)[cell]
    r, s = part[:2]
    shares = np.array([(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s])
    data = sheet.GetPointData()
    texel, position, rest = (
        shares @ values[corners].astype(float)
        for values in (vtk_to_numpy(data.GetTCoords()), points_of(sheet), rest_points(sheet))
    )
    end, pick = np.clip((texel * cloth.size).astype(int), 0, np.array(cloth.size) - 1).tolist()
    over = bool(cloth.drawdown[pick, end]) != behind
    family, numbers = int(not over), (end + 1, pick + 1)
    yarn = end if over else cloth.size[0] + pick
    places = map(_as_point, (position, rest, position - rest))
    return Pick(yarn, family, numbers[family], numbers[1 - family], *places)


def _as_point(values: NDArray[np.float64]) -> Point:
    x, y, z = (float(v) for v in values)
    return x, y, z
