"""States of a cage in files: its displacement at one moment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, points_of, tetrahedra_of, vectors_of
from spacemap_vtk.datasets.volume import split_into_tetrahedra
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.io.reading import read_object
from spacemap_vtk.ndarrays import Floats


def copy_state(cage: vtkUnstructuredGrid, array: str = "displacement") -> vtkUnstructuredGrid:
    """Copy a cage with one displacement and no other arrays, as `read_state` needs it."""
    state, moved = vtkUnstructuredGrid(), vtk_to_numpy(cage.GetPointData().GetArray(array))
    state.CopyStructure(cage)
    add_array(state.GetPointData(), "displacement", moved)
    return state


def read_state(file: Path, vertices: Floats) -> Floats:
    """Read the displacement (V, 3) of a body from a file, at the vertices of its present cage."""
    # The file is a volume mesh at rest with a point array, as `copy_state` makes it. Its cells may
    # differ from the cage's: the displacement is interpolated, outside it is that of the nearest
    # point.
    mesh = split_into_tetrahedra(read_object(file).data, str(file)).grid
    points, cells = points_of(mesh).astype(np.float64), tetrahedra_of(mesh)
    moved = vectors_of(mesh.GetPointData(), "displacement", len(points), str(file))
    return Interpolation(locate(vertices, points, cells, "clamp"), cells, len(points)).apply(moved)
