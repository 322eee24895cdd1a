"""The actors of the view, each fed with copies of the pipeline's results."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLookupTable
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.app.look import COLORINGS
from spacemap_vtk.app.pipeline import displacement_of
from spacemap_vtk.filters.arrays import points_of, tetrahedra_of, to_array, to_cells, to_points

#: Colours of warp and weft where families are told apart; of yarns, of displacement from low on.
_FAMILIES = ("#2f7fb0", "#e2a03f")
_YARNS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb")
_HEAT = ("#2c1e5c", "#3b528b", "#21908d", "#5dc963", "#fde725")


class FabricActor(vtkActor):
    """The fabric's surface, in one of the colourings, with its scalar bar."""

    def __init__(self) -> None:
        super().__init__()
        self._mapper = vtkPolyDataMapper()
        self.SetMapper(self._mapper)
        look = self.GetProperty()
        look.SetAmbient(0.22)
        look.SetDiffuse(0.9)
        look.SetSpecular(0.12)
        look.SetSpecularPower(18.0)
        self.bar = vtkScalarBarActor()
        self.bar.SetTitle("Moved [mm]")
        self.bar.SetNumberOfLabels(5)
        self.bar.SetLabelFormat("{:.3g}")
        self.bar.SetUnconstrainedFontSize(True)
        self.bar.GetTitleTextProperty().SetFontSize(14)
        self.bar.GetLabelTextProperty().SetFontSize(13)
        for text in (self.bar.GetTitleTextProperty(), self.bar.GetLabelTextProperty()):
            text.SetItalic(False)
            text.SetBold(False)
            text.SetShadow(False)
        self.bar.SetMaximumWidthInPixels(90)
        self.bar.SetPosition(0.86, 0.25)
        self.bar.SetWidth(0.1)
        self.bar.SetHeight(0.5)
        self.bar.SetVisibility(False)
        self._table = vtkLookupTable()
        self.coloring = "Yarn colours"

    def show(self, surface: vtkPolyData, coloring: str) -> None:
        """Draw a surface.

        Parameters
        ----------
        surface : vtkPolyData
            With cell arrays ``color``, ``family`` and ``yarn``.
        coloring : str
            A key of `COLORINGS`.
        """
        mapper, name = self._mapper, COLORINGS[coloring]
        moved = surface.GetPointData().GetArray("displacement")
        known = surface.GetCellData().GetArray(name) or (moved if name == "displacement" else None)
        mapper.SetScalarVisibility(known is not None)
        self.bar.SetVisibility(name == "displacement" and known is not None)
        if name == "color":
            mapper.SetScalarModeToUseCellFieldData()
            mapper.SetColorModeToDirectScalars()
            mapper.SelectColorArray(name)
        elif name in ("family", "yarn"):
            colors = _FAMILIES if name == "family" else _YARNS
            count = int(known.GetRange()[1]) + 1 if known is not None else 1
            self._color_by(name, [colors[i % len(colors)] for i in range(count)], (0, count - 1))
            mapper.SetScalarModeToUseCellFieldData()
        elif moved is not None:
            size = np.linalg.norm(vtk_to_numpy(moved), axis=1).astype(np.float32) * 1e3
            surface.GetPointData().AddArray(to_array(size, "displacement_mm"))
            top = float(size.max()) or 1e-6
            self._color_by("displacement_mm", _ramp(_HEAT, 128), (0.0, top))
            mapper.SetScalarModeToUsePointFieldData()
            self.bar.SetLookupTable(self._table)
        mapper.SetInputData(surface)

    def _color_by(self, name: str, colors: list[str], span: tuple[float, float]) -> None:
        table = self._table
        table.SetNumberOfTableValues(len(colors))
        table.SetTableRange(*span)
        for number, color in enumerate(colors):
            table.SetTableValue(number, *_rgb(color), 1.0)
        self._mapper.SetColorModeToMapScalars()
        self._mapper.SetLookupTable(table)
        self._mapper.UseLookupTableScalarRangeOn()
        self._mapper.SelectColorArray(name)


class GhostActor(vtkActor):
    """The fabric at rest, pale: its moved points less their displacement."""

    def __init__(self) -> None:
        super().__init__()
        self._mapper = vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        self.SetMapper(self._mapper)
        self.GetProperty().SetColor(*_rgb("#8a94a3"))
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
        line.SetLineWidth(1.4)
        line.SetOpacity(0.75)
        self.SetPickable(False)
        self._kept: tuple[Any, vtkCellArray] | None = None

    def show(self, cage: vtkUnstructuredGrid | None) -> None:
        """Draw a cage.

        Parameters
        ----------
        cage : vtkUnstructuredGrid or None
            With ``displacement``.
        """
        lines = vtkPolyData()
        if cage is not None:
            connectivity = cage.GetCells().GetConnectivityArray()
            if self._kept is None or self._kept[0] is not connectivity:
                self._kept = connectivity, to_cells(_edges(tetrahedra_of(cage)))
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

    def show(self, cage: vtkUnstructuredGrid | None) -> None:
        """Draw a cage's supports.

        Parameters
        ----------
        cage : vtkUnstructuredGrid or None
            With ``fixed``.
        """
        dots = vtkPolyData()
        fixed = None if cage is None else cage.GetPointData().GetArray("fixed")
        if cage is not None and fixed is not None:
            held = points_of(cage)[vtk_to_numpy(fixed) != 0]
            if len(held):
                dots.SetPoints(to_points(held))
                dots.SetVerts(to_cells(np.arange(len(held)).reshape(-1, 1)))
        self._mapper.SetInputData(dots)


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


def _rgb(color: str) -> tuple[float, float, float]:
    red, green, blue = bytes.fromhex(color[1:])
    return red / 255, green / 255, blue / 255


def _ramp(colors: tuple[str, ...], count: int) -> list[str]:
    stops = np.array([list(bytes.fromhex(color[1:])) for color in colors], dtype=float)
    at = np.linspace(0, len(stops) - 1, count)
    rgb = [np.interp(at, np.arange(len(stops)), stops[:, c]) for c in range(3)]
    return ["#{:02x}{:02x}{:02x}".format(*(int(c[i]) for c in rgb)) for i in range(count)]
