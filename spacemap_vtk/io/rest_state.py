"""Read the state of a cage from a file, to begin an equilibrium there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import array_of, points_of, tetrahedra_of
from spacemap_vtk.datasets.modal_model import ANCHORS
from spacemap_vtk.datasets.volume import split_into_tetrahedra
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.series import open_series
from spacemap_vtk.mechanics.contact.resting import Resting
from spacemap_vtk.ndarrays import Floats

#: Vertices at most this share of the cage's diagonal apart are the same.
_SAME = 1e-6
#: Largest distance of a vertex from the cage in the file, as a share of the diagonal.
_OUTSIDE = 0.02
#: Arrays with the displacement; the first that exists is read.
_DISPLACEMENTS = ("displacement", "equilibrium")


def read_rest_state(file: Path, points: Floats, anchors: int) -> Resting:
    """Read the displacement of a cage, and its friction, in the last step of a file."""
    # The file has undeformed vertices, and an array `displacement` or `equilibrium`, as `spacemap
    # export --what cage` writes it. Between the vertices of another mesh the displacement is
    # interpolated to `points` (V, 3). A file of the same mesh may have anchors of friction, too;
    # they are ignored if their number is another one.
    series = open_series(file)
    data = series.read(len(series.times) - 1)
    table = data.GetPointData()
    name = next((name for name in _DISPLACEMENTS if table.HasArray(name)), None)
    if name is None or not isinstance(data, vtkUnstructuredGrid):
        raise InputError(
            f"{file} has no displacement of a cage",
            allowed="a volume mesh with a point array " + " or ".join(_DISPLACEMENTS),
            cure="Write one with: spacemap export SCENE -o state.vtu --what cage",
        )
    own = points_of(data).astype(np.float64, copy=False)
    moved = array_of(table, name, str(file)).astype(np.float64, copy=False)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if own.shape == points.shape and abs(own - points).max() <= _SAME * diagonal:
        friction = np.empty((0, 3))
        if data.GetFieldData().HasArray(ANCHORS):
            friction = array_of(data.GetFieldData(), ANCHORS, str(file))
        return Resting(moved, friction if len(friction) == anchors else friction[:0])
    volume = split_into_tetrahedra(data, str(file))
    cells = tetrahedra_of(volume.grid)
    where = locate(points, points_of(volume.grid), cells)
    if where.largest_distance > _OUTSIDE * diagonal:
        raise InputError(
            f"the cage in {file} does not fill the same space",
            value=f"a vertex {where.largest_distance:.3g} m outside",
            allowed=f"at most {_OUTSIDE * diagonal:.3g} m",
            cure="Write a state of this scene: the file needs the undeformed vertices",
        )
    corners = moved[volume.points[cells[where.tetrahedron]]]
    return Resting(np.einsum("ni,nij->nj", where.weights, corners), np.empty((0, 3)))
