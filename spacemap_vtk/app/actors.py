"""The cage in the view, fed with copies of the pipeline's results."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.app.pipeline import displacement_of
from spacemap_vtk.datasets.arrays import points_of, tetrahedra_of, to_cells, to_points
from spacemap_vtk.draw.glyphs import LINE
from spacemap_vtk.draw.surface_actor import rgb

#: Width of a picked point's dot, in points.
PICKED = 14.0


class CageActor(vtkActor):
    """The cage's edges, moved."""

    def __init__(self) -> None:
        super().__init__()
        self._mapper = vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        self.SetMapper(self._mapper)
        line = self.GetProperty()
        line.SetLighting(False)
        # Opaque: one thing that light passes through costs a quarter of a frame in software.
        line.SetLineWidth(LINE)
        self.SetPickable(False)
        self._kept: tuple[NDArray[np.int64], vtkCellArray] | None = None

    def show(self, cage: vtkUnstructuredGrid | None) -> None:
        """Draw a cage."""
        lines = vtkPolyData()
        if cage is not None:
            tetrahedra = tetrahedra_of(cage)
            # By content: a box of another size is divided as before, and its edges are the same.
            if self._kept is None or not np.array_equal(self._kept[0], tetrahedra):
                self._kept = tetrahedra, to_cells(_edges(tetrahedra))
            lines.SetPoints(to_points(moved_points(cage)))
            lines.SetLines(self._kept[1])
        self._mapper.SetInputData(lines)


class PickActor(vtkActor):
    """Dots where the user has picked."""

    def __init__(self) -> None:
        super().__init__()
        self._mapper = vtkPolyDataMapper()
        self.SetMapper(self._mapper)
        look = self.GetProperty()
        look.SetColor(*rgb("#d9642c"))
        look.SetPointSize(PICKED)
        look.SetRenderPointsAsSpheres(True)
        self.SetPickable(False)
        self.show(np.zeros((0, 3)))

    def show(self, points: NDArray[np.float64]) -> None:
        """Draw dots."""
        self._mapper.SetInputData(_dots(points))
        self.SetVisibility(len(points) > 0)


def moved_points(cage: vtkUnstructuredGrid) -> NDArray[np.float64]:
    """Return a cage's vertices where they are now."""
    return points_of(cage) + displacement_of(cage)


def _dots(points: NDArray[np.float64]) -> vtkPolyData:
    dots = vtkPolyData()
    if len(points):
        dots.SetPoints(to_points(points))
        dots.SetVerts(to_cells(np.arange(len(points)).reshape(-1, 1)))
    return dots


def _edges(tetrahedra: NDArray[np.int64]) -> NDArray[np.int64]:
    pairs = tetrahedra[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
    pairs = np.sort(pairs, axis=1)
    pairs = pairs[np.lexsort(pairs.T)]
    return pairs[np.diff(pairs, axis=0, prepend=-1).any(axis=1)]
