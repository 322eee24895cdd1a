"""Yarns as rows of points (.csv), and as lines of VTK (.vtp)."""

from __future__ import annotations

import csv
import io
import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import damaged_error
from spacemap_vtk.io.yarns.file_bytes import (
    check_curves,
    check_numbers,
    join_ends,
    no_cell,
    read_yarn_bytes,
    text_of,
)
from spacemap_vtk.textile.rods.curves import Curve, CurveSet

#: Metres in the units that a column's name may have.
_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
#: Names of the columns, and of arrays, with the diameter.
_WIDTHS = ("diameter", "width")
_COLORS = ("red", "green", "blue")


def read_csv(path: Path) -> CurveSet:
    """Read a table with a row for each point: yarn, x, y, z, and perhaps diameter and colour."""
    text = text_of(path, read_yarn_bytes(path))
    rows = [row for row in csv.reader(io.StringIO(text)) if row and not row[0].startswith("#")]
    names = [re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", each) for each in rows[0]] if rows else []
    columns = {found.group(1).lower(): number for number, found in enumerate(names) if found}
    missing = [name for name in ("yarn", "x", "y", "z") if name not in columns]
    if missing:
        raise InputError(
            f"{path}: the table has no column {', '.join(missing)}",
            key="file",
            allowed="yarn, x, y, z, and perhaps diameter, red, green, blue",
            cure="Name the columns in the first row, with a unit as in x [mm].",
        )
    try:
        values = np.array(
            [[float(row[columns[name]]) for name in columns] for row in rows[1:]]
        ).reshape(-1, len(columns))
    except (ValueError, IndexError):
        number = next(k for k, row in enumerate(rows[1:], 2) if not _is_numbers(row, len(columns)))
        raise damaged_error(path, f"row {number} of the table is not numbers") from None
    place = {name: number for number, name in enumerate(columns)}
    check_numbers(path, values, "a number")
    units = {found.group(2) for found in names if found and found.group(2)}
    if len(units) > 1 or not units <= _UNITS.keys():
        raise InputError(
            f"{path}: the units of its columns are not understood",
            key="file",
            value=", ".join(sorted(units)),
            allowed=f"one of {', '.join(_UNITS)}",
        )
    width = next((place[name] for name in _WIDTHS if name in place), None)
    # This program's own tables hold Bézier curves: every third point is on the yarn.
    is_bezier = "width" in place and "point" in place
    curves = []
    yarn = values[:, place["yarn"]]
    for name in dict.fromkeys(yarn.tolist()):
        own = values[yarn == name]
        points = own[:, [place["x"], place["y"], place["z"]]][:: 3 if is_bezier else 1]
        nodes, periods = join_ends(points)
        color = None
        if all(each in place for each in _COLORS):
            red, green, blue = (int(np.clip(own[0, place[each]], 0, 255)) for each in _COLORS)
            color = red, green, blue
        curves.append(
            Curve(nodes, periods, 0.0 if width is None else float(own[0, width]), color=color)
        )
    unit = _UNITS[units.pop()] if units else None
    return CurveSet(check_curves(path, curves), no_cell(), is_bezier, unit)


def _is_numbers(row: list[str], count: int) -> bool:
    try:
        return len([float(word) for word in row]) >= count
    except ValueError:
        return False


def read_vtp(path: Path) -> CurveSet:
    """Read the lines of VTK's poly data, with their arrays diameter and color."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.datasets.arrays import points_of
    from spacemap_vtk.io.formats.vtk_xml import read_xml

    data = read_xml(path)
    lines = data.GetLines()
    points = points_of(data).astype(np.float64) if data.GetNumberOfPoints() else np.zeros((0, 3))
    first = data.GetNumberOfVerts()
    tables = ((data.GetPointData(), True), (data.GetCellData(), False))

    def value(names: tuple[str, ...], line: int, point: int) -> list[float]:
        for table, at_points in tables:
            for name in names:
                if (array := table.GetArray(name)) is not None:
                    row = vtk_to_numpy(array)[point if at_points else first + line]
                    return [float(each) for each in np.ravel(row)]
        return []

    curves = []
    ends = vtk_to_numpy(lines.GetOffsetsArray()) if lines is not None else np.zeros(1, np.int64)
    index = vtk_to_numpy(lines.GetConnectivityArray()) if len(ends) > 1 else ends[:0]
    for number, (begin, end) in enumerate(pairwise(ends.tolist())):
        own = index[begin:end]
        if len(own) < 2:
            continue
        width = value(_WIDTHS, number, int(own[0])) or [
            2.0 * each for each in value(("radius",), number, int(own[0]))
        ]
        shade = value(("color",), number, int(own[0]))
        color = None
        if len(shade) >= 3:
            red, green, blue = (int(np.clip(each, 0, 255)) for each in shade[:3])
            color = red, green, blue
        nodes, periods = join_ends(points[own])
        curves.append(Curve(nodes, periods, width[0] if width else 0.0, color=color))
    return CurveSet(check_curves(path, curves), no_cell(), False, None)
