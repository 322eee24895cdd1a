"""Compute the numbers that a surface's colours show, and choose their units."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of, to_array
from spacemap_vtk.ndarrays import AnyFloats, Bools, Floats, Ints, Singles
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.textile.geometry.point_clearance import point_clearances
from spacemap_vtk.units import UNITS

#: Name of the array of numbers that are shown as colours.
COLOR_VALUES = "shown"


#: Units that a scale may use for each SI unit, the smallest first.
_SCALES = {
    "m": ("nm", "µm", "mm", "m", "km"),
    "m/s": ("mm/s", "m/s"),
    "m/s2": ("mm/s2", "m/s2"),
    "Pa": ("Pa", "kPa", "MPa", "GPa", "TPa"),
    "N": ("µN", "mN", "N"),
}


def color_values(surface: vtkPolyData, color: str) -> Singles | None:
    """Return the number that the colour shows at each point; None if it shows no numbers."""
    if color == "clearance":
        return _cached_clearances(surface)
    name, cell_data = COLORINGS[color].array, surface.GetCellData()
    array = surface.GetPointData().GetArray(name)
    if not COLORINGS[color].has_scale or (array is None and not cell_data.HasArray(name)):
        return None
    values = (
        _cell_values_at_points(surface, cell_data.GetArray(name))
        if array is None
        else vtk_to_numpy(array)
    )
    if color in ("strain", "principal_stress"):
        return largest_principal(values).astype(np.float32)
    if color == "stress":
        values = np.maximum(values, 0.0)  # extrapolation outside the cage can make it negative
    if values.ndim == 2 and values.shape[1] == 3:
        return np.sqrt(np.einsum("nk,nk->n", values, values)).astype(np.float32)
    return values.reshape(len(values)).astype(np.float32, copy=False)


def add_color_values(surface: vtkPolyData, color: str) -> None:
    """Add the numbers that a surface's colour shows as an array, for `SurfaceActor`."""
    values = color_values(surface, color)
    surface.GetPointData().RemoveArray(COLOR_VALUES)
    if values is not None:
        surface.GetPointData().AddArray(to_array(values, COLOR_VALUES))


def largest_principal(tensors: AnyFloats) -> Floats:
    """Compute the largest eigenvalue of symmetric tensors, (n, 6) or (n, 9)."""
    columns = np.asarray(tensors, np.float64).T
    if len(columns) == 9:
        columns = columns[[0, 4, 8, 1, 5, 2]]
    xx, yy, zz, xy, yz, xz = columns
    mean = (xx + yy + zz) / 3
    a, b, c = xx - mean, yy - mean, zz - mean
    size = np.sqrt((a * a + b * b + c * c + 2 * (xy * xy + yz * yz + xz * xz)) / 6)
    safe = np.where(size > 0.0, size, 1.0)
    a, b, c, d, e, f = (part / safe for part in (a, b, c, xy, yz, xz))
    half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2
    return mean + 2 * size * np.cos(np.arccos(np.clip(half, -1.0, 1.0)) / 3)


def scale_unit(color: str, largest: float) -> tuple[str, float]:
    """Return a unit in which a scale is easy to read, and its size in SI units."""
    unit = COLORINGS[color].unit
    if not unit:
        return ("%", 0.01) if largest < 0.5 else ("", 1.0)
    sizes = UNITS.get(unit, {unit: 1.0})
    best, *larger = _SCALES.get(unit, (unit,))
    for name in larger:
        # 0.2 m is still shown as 200 mm: scales of slightly more than 100 mm end there.
        if largest > sizes[name] * (0.2 + 1e-6):
            best = name
    return best, sizes[best]


def round_ticks(low: float, high: float, max_count: int = 6) -> list[float]:
    """Return evenly spaced round numbers within a scale, including zero if it is in the scale."""
    span = high - low
    if not span > 0.0:
        return [low]
    size = 10.0 ** np.floor(np.log10(span / max_count))
    steps = (n * size for n in (1.0, 2.0, 2.5, 5.0, 10.0))
    step = next(s for s in steps if np.floor(span / s * (1 + 1e-9)) + 1 <= max_count)
    first, last = np.ceil(low / step - 1e-6), np.floor(high / step + 1e-6)
    return [float(f"{k * step:.12g}") for k in range(int(first), int(last) + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Return 1, 2 and 5 times powers of ten within a range; none if it begins at or below 0."""
    if not low > 0.0:
        return []
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [f * 10.0**p for p in powers for f in (1, 2, 5) if low <= f * 10.0**p <= high]


def _corners(surface: vtkPolyData) -> Ints:
    corners: Ints = vtk_to_numpy(surface.GetPolys().GetConnectivityArray())
    return corners.reshape(surface.GetNumberOfCells(), -1)


def _cell_values_at_points(surface: vtkPolyData, array: vtkDataArray) -> NDArray[Any]:
    """Return the value of its cell for each point; no point belongs to two cells."""
    cell_values = vtk_to_numpy(array)
    values = np.zeros((surface.GetNumberOfPoints(), *cell_values.shape[1:]), cell_values.dtype)
    values[_corners(surface)] = cell_values[:, None]
    return values


#: Modification times of the surface that was measured last, and its clearances.
_last: tuple[tuple[int, ...], Singles | None] = (), None


def _cached_clearances(surface: vtkPolyData) -> Singles | None:
    """Return the clearances of a surface; the last ones are kept for the scale and the picture."""
    global _last
    # VTK's modification times are unique, so they identify points, normals and polygons.
    parts = surface.GetPoints(), surface.GetPointData().GetNormals(), surface.GetPolys()
    times = tuple(0 if part is None else part.GetMTime() for part in parts)
    cached = _last  # read once: another thread may replace it
    if cached[0] != times:
        cached = _last = times, compute_clearances(surface)
    return cached[1]


def compute_clearances(surface: vtkPolyData, cells: Bools | None = None) -> Singles | None:
    """Return the distance of each point to the next yarn; infinite outside the given cells."""
    yarns, normals = surface.GetCellData().GetArray("yarn"), surface.GetPointData().GetNormals()
    if yarns is None or normals is None or not surface.GetNumberOfCells():
        return None
    corners, families = _corners(surface), surface.GetCellData().GetArray("family")
    points, measured = points_of(surface).astype(np.float64), None
    yarn_and_family = 2 * vtk_to_numpy(yarns).astype(np.int64)
    if families is not None:
        yarn_and_family += vtk_to_numpy(
            families
        )  # lowest bit: `point_clearances` compares the families first
    yarn, reach = np.zeros(len(points), np.int64), np.zeros(len(points))
    yarn[corners] = yarn_and_family[:, None]
    # Neighbouring patches have coincident points. Only one of these needs a reach, and a point that
    # is the first corner of a facet gets one.
    reach[corners[:, 0]] = 0.5 * np.linalg.norm(
        points[corners[:, 0]] - points[corners[:, 2]], axis=1
    )
    if cells is not None:
        measured = np.zeros(len(points), bool)
        measured[corners[cells]] = True
    clearances = point_clearances(points, vtk_to_numpy(normals), yarn, reach, measured, reach > 0.0)
    finite = clearances if measured is None else clearances[measured]
    return clearances.astype(np.float32) if np.isfinite(finite).all() else None
