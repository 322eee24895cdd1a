"""What a piece says of the whole: the bounds of that, and who owns what is in several pieces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataSet, vtkDataSetAttributes

from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.datasets.processes import Piece, Processes
from spacemap_vtk.errors import GeometryError

_NAME = "bounds_of_piece_and_whole"
#: Of the field array of an object, and of its cage: the unit vector that points up.
UP = "up"
#: Of the field array of a cage: how much of it the material of the object fills.
FILLED = "filled"
#: Share of its height in which an object stands, and by how much its foot must be the broader.
_FOOT, _BROADER = 0.05, 0.03
#: An axis is the longer one where it is so many times as long.
_LONGER = 1.2


def tell_bounds(data: vtkDataSet, whole: ArrayLike) -> None:
    """Write into a piece what the bounds of the whole are."""
    add_array(data.GetFieldData(), _NAME, np.array([data.GetBounds(), whole]))


def bounds_of_whole(data: vtkDataSet, piece: Piece, processes: Processes | None) -> Sequence[float]:
    """Return the bounds of a data set of which this is a piece."""
    own = data.GetBounds()
    if piece.of == 1:
        return own
    told = data.GetFieldData().GetArray(_NAME)
    rows = None if told is None else vtk_to_numpy(told).reshape(2, 6)
    trusted = rows is not None and bool(np.array_equal(rows[0], own))
    if processes is not None:
        sign = np.tile([-1.0, 1.0], 3)
        mine = sign * own if data.GetNumberOfPoints() else np.full(6, -np.inf)
        doubt, *largest = processes.largest([not trusted, *mine])
        if doubt:
            if not np.isfinite(largest).all():
                raise GeometryError("there is nothing to enclose: the input has no points")
            return (sign * largest).tolist()
    elif not trusted:
        raise GeometryError(
            f"of the input only piece {piece.number} of {piece.of} is here, and how far the rest "
            "reaches is not known",
            cure="Ask for all of it, or run as many processes as there are pieces.",
        )
    assert rows is not None
    return rows[1].tolist()


def mark_owner(data: vtkDataSet, piece: Piece) -> None:
    """Mark the cells and points of what is whole in each piece: they belong to the first."""
    value = 0 if piece.number == 0 else vtkDataSetAttributes.DUPLICATECELL
    name = vtkDataSetAttributes.GhostArrayName()
    for array, count in (
        (data.GetCellData(), data.GetNumberOfCells()),
        (data.GetPointData(), data.GetNumberOfPoints()),
    ):
        add_array(array, name, np.full(count, value, dtype=np.uint8))


def up_axis(data: vtkDataSet) -> int | None:
    """Return which axis is up in an object, or in its cage; None of a cloth."""
    array = data.GetFieldData().GetArray(UP)
    return None if array is None else max(range(3), key=array.GetValue)


def filled_share(cage: vtkDataSet) -> float:
    """Return how much of a cage is filled by its material, which is spread over all of it."""
    share = cage.GetFieldData().GetArray(FILLED)
    return 1.0 if share is None else float(share.GetValue(0))


def upright(points: NDArray[Any]) -> int:
    """Return which axis is up, y or z: along it a foot is broader than the top, or it is long."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0).astype(np.float64)
    # What is flat has no ends.
    shares = np.where(extent > 0.0, (points - low) / np.maximum(extent, 1e-300), 0.5)

    def broader(axis: int) -> float:
        """Return how much of its shadow the foot takes, less that of the top."""
        others = np.delete(shares, axis, axis=1)
        ends = shares[:, axis] <= _FOOT, shares[:, axis] >= 1.0 - _FOOT
        foot, top = (np.ptp(others[end], axis=0).prod() if end.any() else 0.0 for end in ends)
        return float(foot - top)

    lead = broader(2) - broader(1)
    longer = extent[2] > _LONGER * extent[1]
    return 2 if lead > _BROADER or (abs(lead) <= _BROADER and longer) else 1
