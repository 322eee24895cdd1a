"""The numbers that a surface's colours show, and their units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of, to_array
from spacemap_vtk.fabric.point_clearance import gaps
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.units import UNITS

#: Name of the array of numbers that are shown as colours.
SHOWN = "shown"


#: The units of scales, the smallest first.
_SCALES = {
    "m": ("µm", "mm", "m"),
    "m/s": ("mm/s", "m/s"),
    "Pa": ("Pa", "kPa", "MPa", "GPa"),
    "": ("", "%"),
}


def measure(surface: vtkPolyData, color: str) -> NDArray[np.float32] | None:
    """Return the number at each point of a surface that its colour shows."""
    if color == "clearance":
        return _clearance(surface)
    array = surface.GetPointData().GetArray(COLORINGS[color].array)
    if array is None or not COLORINGS[color].scaled:
        return None
    values = vtk_to_numpy(array)
    if color == "strain":
        return largest_principal(values).astype(np.float32)
    if color == "stress":
        values = np.maximum(values, 0.0)  # of what lies outside the cage it is extrapolated
    if values.ndim == 2 and values.shape[1] == 3:
        return np.sqrt(np.einsum("nk,nk->n", values, values)).astype(np.float32)
    return values.reshape(len(values)).astype(np.float32, copy=False)


def add_measure(surface: vtkPolyData, color: str) -> None:
    """Put on a surface what its colour shows, for `SurfaceActor`."""
    values = measure(surface, color)
    surface.GetPointData().RemoveArray(SHOWN)
    if values is not None:
        surface.GetPointData().AddArray(to_array(values, SHOWN))


def largest_principal(tensors: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the largest eigenvalue of symmetric tensors."""
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


def unit_of(color: str, largest: float) -> tuple[str, float]:
    """Return the unit in which a scale is easy to read."""
    unit = COLORINGS[color].unit
    sizes = {"": 1.0, **UNITS.get(unit, {unit: 1.0})}
    names = _SCALES.get(unit, (unit,))
    if unit == "":
        return ("%", 0.01) if largest < 0.5 else ("", 1.0)
    best = names[0]
    for name in names:
        if largest >= sizes[name] * 0.2:
            best = name
    return best, sizes[best]


def _clearance(surface: vtkPolyData) -> NDArray[np.float32] | None:
    yarns, normals = surface.GetCellData().GetArray("yarn"), surface.GetPointData().GetNormals()
    polygons = surface.GetPolys()
    count = surface.GetNumberOfCells()
    if yarns is None or normals is None or not count:
        return None
    corners = vtk_to_numpy(polygons.GetConnectivityArray()).reshape(count, -1)
    points = points_of(surface).astype(np.float64)
    # No point belongs to two yarns.
    yarn = np.zeros(len(points), np.int64)
    yarn[corners] = vtk_to_numpy(yarns)[:, None]
    diagonals = np.linalg.norm(points[corners[:, 0]] - points[corners[:, 2]], axis=1)
    found = gaps(points, vtk_to_numpy(normals), yarn, reach=float(diagonals.mean()) / 2)
    return found.astype(np.float32) if np.isfinite(found).all() else None
