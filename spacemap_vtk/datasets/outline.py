"""Extract points and triangles of any object, for cages that follow its shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataSet, vtkImageData, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkTriangleFilter

from spacemap_vtk.cage.carve import grow_cells
from spacemap_vtk.datasets.arrays import to_array
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: Points (N, 3) in m, and triangles (F, 3); a segment repeats its second end.
Outline = tuple[Floats, Ints]
#: Function of the origin, spacing and divisions of a lattice. It returns the hexahedra that an
#: object touches, see `spacemap_vtk.cage.carve.find_touched_cells`.
Touch = Callable[[Floats, Floats, Sequence[int]], Bools]

#: Largest number of voxels along the longest side of the object that an envelope encloses.
_MOST_VOXELS = 160


def extract_outline(data: vtkDataSet, surface: vtkPolyData) -> Outline:
    """Return all points of an object, and the triangles and segments of its surface."""
    cutter = vtkTriangleFilter()
    cutter.SetInputData(surface)
    cutter.Update()
    flat = cutter.GetOutput()
    segments = _cells(flat.GetLines(), 2)[:, [0, 1, 1]]
    triangles = np.concatenate([_cells(flat.GetPolys(), 3), segments])
    is_grid = data.IsA("vtkPointSet") and not isinstance(data, vtkPolyData)
    own = _points(data) if is_grid else np.empty((0, 3))  # the surface has the points of polygons
    points, triangles = np.concatenate((own, _points(flat))), triangles + len(own)
    if not np.isfinite(points).all():
        bad = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise GeometryError(f"point {bad} of the object is not finite", cure="Repair the object.")
    return points, triangles


def make_envelope(low: Floats, high: Floats, touch: Touch, distance: float) -> Outline:
    """Return a closed surface at a distance [m] around an object with the given bounds."""
    # The object is converted to voxels, and enclosed voxels are added. The envelope is an
    # isosurface of the distance to these voxels, so it also exists for open, self-intersecting and
    # non-manifold objects.
    voxel = max(distance / 1.5, float((high - low).max()) / _MOST_VOXELS)
    padding = distance + 3 * voxel
    counts = np.ceil((high - low + 2 * padding) / voxel).astype(np.int64)
    origin = low - padding
    solid = grow_cells(touch(origin, np.full(3, voxel), counts.tolist()), 0, True)
    # A point in a voxel is at most half a diagonal, 0.87 voxels, from the voxel's centre.
    reach = distance + 0.9 * voxel
    from scipy import ndimage  # imported here: it takes a tenth of a second

    distances = ndimage.distance_transform_edt(~solid) * voxel
    image = vtkImageData()
    image.SetDimensions(*counts.tolist())
    image.SetSpacing(voxel, voxel, voxel)
    image.SetOrigin(*(origin + voxel / 2).tolist())
    image.GetPointData().SetScalars(to_array(distances.ravel(), "distance"))
    maker = vtkFlyingEdges3D()
    maker.SetInputData(image)
    maker.SetValue(0, reach)
    maker.ComputeNormalsOff()
    maker.Update()
    made = maker.GetOutput()
    return _points(made), _cells(made.GetPolys(), 3)


def count_edge_faults(triangles: Ints, points: Floats) -> tuple[int, int]:
    """Count the open edges, and the edges that join more than two triangles."""
    _, same = np.unique(points, axis=0, return_inverse=True)
    faces = same.ravel()[triangles]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1] if len(edges) else np.empty(0)
    return int((counts == 1).sum()), int((counts > 2).sum())


def _points(data: Any) -> Floats:
    if not data.GetNumberOfPoints():
        return np.empty((0, 3))
    return vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64)


def _cells(cells: Any, size: int) -> Ints:
    """Return the cells of a given size (n, size); size 2 cuts polylines into segments."""
    if cells is None or cells.GetNumberOfCells() == 0:
        return np.empty((0, size), dtype=np.int64)
    starts = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    numbers = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    if size == 2:
        first = np.delete(np.arange(len(numbers)), starts[1:] - 1)
        return np.stack((numbers[first], numbers[first + 1]), axis=1)
    begin = starts[:-1][np.diff(starts) == size]
    return numbers[begin[:, None] + np.arange(size)]
