"""A point of the fabric that the user has picked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.units import format_quantity

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Pick:
    """What is known of a picked point."""

    #: Its yarn: ends from 0 on, then picks; None on an object.
    yarn: int | None
    #: 0 warp, 1 weft.
    family: int | None
    #: The yarn's number among its family's, from 1 on, as weavers count and the draft does.
    number: int | None
    #: Where it is, where it is at rest, and the difference, in m.
    position: Point
    rest: Point
    displacement: Point

    @property
    def text(self) -> str:
        """One line for people."""
        size = sum(c * c for c in self.displacement) ** 0.5
        where = ", ".join(format_quantity(c, "m", 4) for c in self.position)
        of = ""
        if self.number is not None and self.family is not None:
            of = f"{('end', 'pick')[self.family]} {self.number}   "
        return f"{of}at ({where})   moved by {format_quantity(float(f'{size:.4g}'), 'm')}"


def read_point(surface: vtkPolyData, cell: int, point: int, cloth: Cloth | None = None) -> Pick:
    """Read what a surface, or that of a part of a cloth, says of one of its points."""
    position = points_of(surface)[point].astype(float)
    moved = surface.GetPointData().GetArray("displacement")
    displacement = np.zeros(3) if moved is None else vtk_to_numpy(moved)[point].astype(float)
    yarn, family, number = None, None, None
    cells = surface.GetCellData()
    if cells.HasArray("yarn") and cells.HasArray("family"):
        yarns, families = (vtk_to_numpy(cells.GetArray(name)) for name in ("yarn", "family"))
        yarn, family = int(yarns[cell]), int(families[cell])
        first = int(yarns[families == family].min())
        number = yarn - (first if cloth is None else family * cloth.size[0]) + 1
    return Pick(
        yarn,
        family,
        number,
        _three(position),
        _three(position - displacement),
        _three(displacement),
    )


def _three(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
