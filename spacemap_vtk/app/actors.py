"""The actors of the view, each fed with copies of the pipeline's results."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersSources import vtkArrowSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkPolyDataMapper

from spacemap_vtk.app.pipeline import displacement_of
from spacemap_vtk.filters.arrays import points_of, tetrahedra_of, to_array, to_cells, to_points
from spacemap_vtk.scenes.load_arrows import KINDS, Arrows
from spacemap_vtk.scenes.surface_actor import rgb


class GhostActor(vtkActor):
    """The fabric at rest, pale: its moved points less their displacement."""

    def __init__(self) -> None:
        super().__init__()
        self._mapper = vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        self.SetMapper(self._mapper)
        self.GetProperty().SetColor(*rgb("#8a94a3"))
        self.GetProperty().SetOpacity(0.18)
        self.SetPickable(False)

    def show(self, surface: vtkPolyData) -> None:
        """Draw where a surface comes from.

        Parameters
        ----------
        surface : vtkPolyData
            With ``displacement``; without, nothing is drawn.
        """
        rest = vtkPolyData()
        moved = surface.GetPointData().GetArray("displacement")
        if moved is not None:
            rest.ShallowCopy(surface)
            rest.SetPoints(to_points(points_of(surface) - vtk_to_numpy(moved)))
        self._mapper.SetInputData(rest)


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
        line.SetLineWidth(1.4)
        self.SetPickable(False)
        self._kept: tuple[NDArray[np.int64], vtkCellArray] | None = None

    def show(self, cage: vtkUnstructuredGrid | None) -> None:
        """Draw a cage.

        Parameters
        ----------
        cage : vtkUnstructuredGrid or None
            With ``displacement``.
        """
        lines = vtkPolyData()
        if cage is not None:
            tetrahedra = tetrahedra_of(cage)
            # By content: a box of another size is divided as before, and its edges are the same.
            if self._kept is None or not np.array_equal(self._kept[0], tetrahedra):
                self._kept = tetrahedra, to_cells(_edges(tetrahedra))
            lines.SetPoints(to_points(moved_points(cage)))
            lines.SetLines(self._kept[1])
        self._mapper.SetInputData(lines)


class SupportActor(vtkActor):
    """The cage's fixed vertices."""

    def __init__(self) -> None:
        super().__init__()
        self._mapper = vtkPolyDataMapper()
        self.SetMapper(self._mapper)
        look = self.GetProperty()
        look.SetPointSize(9.0)
        look.SetRenderPointsAsSpheres(True)
        self.SetPickable(False)
        self._shown: tuple[Any, Any] = None, None

    def show(self, cage: vtkUnstructuredGrid | None) -> None:
        """Draw a cage's supports.

        Parameters
        ----------
        cage : vtkUnstructuredGrid or None
            With ``fixed``.
        """
        fixed = None if cage is None else cage.GetPointData().GetArray("fixed")
        rest = None if cage is None else cage.GetPoints()
        if (rest, fixed) == self._shown and fixed is not None:
            return
        self._shown = rest, fixed
        dots = vtkPolyData()
        if cage is not None and fixed is not None:
            held = points_of(cage)[vtk_to_numpy(fixed) != 0]
            if len(held):
                dots.SetPoints(to_points(held))
                dots.SetVerts(to_cells(np.arange(len(held)).reshape(-1, 1)))
        self._mapper.SetInputData(dots)


class LoadActor(vtkActor):
    """Arrows for what acts on the cage."""

    def __init__(self) -> None:
        super().__init__()
        shape = vtkArrowSource()
        shape.SetTipResolution(24)
        shape.SetShaftResolution(24)
        shape.SetTipRadius(0.09)
        shape.SetTipLength(0.3)
        shape.SetShaftRadius(0.032)
        mapper = self._mapper = vtkGlyph3DMapper()
        mapper.SetSourceConnection(shape.GetOutputPort())
        mapper.SetOrientationArray("vector")
        mapper.SetScaleArray("vector")
        mapper.SetScaleModeToScaleByMagnitude()
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("color")
        mapper.SetColorModeToDirectScalars()
        self.SetMapper(mapper)
        self.GetProperty().SetAmbient(0.35)
        self.SetPickable(False)

    def show(self, arrows: Arrows | None) -> None:
        """Draw arrows.

        Parameters
        ----------
        arrows : Arrows or None
            What acts.
        """
        places = vtkPolyData()
        if arrows is not None and len(arrows.starts):
            colors = np.array([list(bytes.fromhex(KINDS[k][1:])) for k in arrows.kinds], np.uint8)
            places.SetPoints(to_points(arrows.starts))
            places.GetPointData().AddArray(to_array(arrows.vectors, "vector"))
            places.GetPointData().AddArray(to_array(colors, "color"))
        self._mapper.SetInputData(places)


def moved_points(cage: vtkUnstructuredGrid) -> NDArray[np.float64]:
    """Return a cage's vertices where they are now.

    Parameters
    ----------
    cage : vtkUnstructuredGrid
        With ``displacement``.

    Returns
    -------
    ndarray, shape (n_vertices, 3)
        A new array.
    """
    return points_of(cage) + displacement_of(cage)


def _edges(tetrahedra: NDArray[np.int64]) -> NDArray[np.int64]:
    pairs = tetrahedra[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)
