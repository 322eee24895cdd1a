"""Bounds of a whole data set, ownership of duplicated cells, up axis and filled share."""

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
#: Name of the field array of an object and of its cage that holds the unit vector pointing up.
UP = "up"
#: Name of the field array of a cage that holds the share of its volume filled by the object.
FILLED = "filled"
#: Height of an object's foot and of its top, as a share of the object's height.
_FOOT = 0.05
#: The foot must be larger than the top by this share of the area of the bounding box.
_MIN_EXCESS = 0.03
#: z counts as the longer axis if it is at least this many times as long as y.
_LONGER_RATIO = 1.2


def store_bounds(data: vtkDataSet, whole: ArrayLike) -> None:
    """Write the bounds of the whole data set into a field array of a piece."""
    add_array(data.GetFieldData(), _NAME, np.array([data.GetBounds(), whole]))


def bounds_of_whole(data: vtkDataSet, piece: Piece, processes: Processes | None) -> Sequence[float]:
    """Return the bounds of the whole data set that a piece belongs to."""
    own = data.GetBounds()
    if piece.total == 1:
        return own
    stored = data.GetFieldData().GetArray(_NAME)
    rows = None if stored is None else vtk_to_numpy(stored).reshape(2, 6)
    trusted = rows is not None and bool(np.array_equal(rows[0], own))
    if processes is not None:
        sign = np.tile([-1.0, 1.0], 3)
        mine = sign * own if data.GetNumberOfPoints() else np.full(6, -np.inf)
        doubt, *largest = processes.maximum([not trusted, *mine])
        if doubt:
            if not np.isfinite(largest).all():
                raise GeometryError("the input has no points to enclose")
            return (sign * largest).tolist()
    elif not trusted:
        raise GeometryError(
            f"only piece {piece.number} of {piece.total} of the input is available, and the bounds "
            "of the whole are unknown",
            cure="Request the whole input, or run one process for each piece.",
        )
    assert rows is not None
    return rows[1].tolist()


def mark_owner(data: vtkDataSet, piece: Piece) -> None:
    """Mark cells and points that all pieces contain as duplicates, except in the first piece."""
    value = 0 if piece.number == 0 else vtkDataSetAttributes.DUPLICATECELL
    name = vtkDataSetAttributes.GhostArrayName()
    for array, count in (
        (data.GetCellData(), data.GetNumberOfCells()),
        (data.GetPointData(), data.GetNumberOfPoints()),
    ):
        add_array(array, name, np.full(count, value, dtype=np.uint8))


def up_axis(data: vtkDataSet) -> int | None:
    """Return the index of the up axis of an object or its cage; None for a cloth."""
    array = data.GetFieldData().GetArray(UP)
    return None if array is None else max(range(3), key=array.GetValue)


def filled_share(cage: vtkDataSet) -> float:
    """Return the share of a cage's volume that the material fills; 1 if it is not stored."""
    share = cage.GetFieldData().GetArray(FILLED)
    return 1.0 if share is None else float(share.GetValue(0))


def guess_up_axis(points: NDArray[Any]) -> int:
    """Guess the up axis, 1 or 2: the foot is broader than the top, or else z is longer than y."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0).astype(np.float64)
    # A flat axis has neither foot nor top: 0.5 keeps all points out of both.
    shares = np.where(extent > 0.0, (points - low) / np.maximum(extent, 1e-300), 0.5)

    def broader(axis: int) -> float:
        """Return the area of the foot minus that of the top, as shares of the bounding box."""
        others = np.delete(shares, axis, axis=1)
        ends = shares[:, axis] <= _FOOT, shares[:, axis] >= 1.0 - _FOOT
        foot, top = (np.ptp(others[end], axis=0).prod() if end.any() else 0.0 for end in ends)
        return float(foot - top)

    lead = broader(2) - broader(1)
    longer = extent[2] > _LONGER_RATIO * extent[1]
    return 2 if lead > _MIN_EXCESS or (abs(lead) <= _MIN_EXCESS and longer) else 1
