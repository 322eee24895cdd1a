"""A unit cell in three dimensions: its voxels, a slice, and the directions of fibres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkLookupTable
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkThreshold
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter
from vtkmodules.vtkFiltersSources import vtkLineSource, vtkOutlineSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkPolyDataMapper, vtkProp

from spacemap_vtk.datasets.arrays import add_array, to_array, to_points
from spacemap_vtk.draw.actors.color_values import round_ticks
from spacemap_vtk.draw.actors.surface_actor import make_color_bar, ramp_table
from spacemap_vtk.draw.unit_cell_values import (
    CONTENTS,
    INSIDE,
    needs_load,
    value_span,
    voxel_colors,
    voxel_values,
)
from spacemap_vtk.ndarrays import Bools, Floats

if TYPE_CHECKING:
    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: Directions of fibres along the longer side of a cell.
_GLYPHS = 24
#: Length of a glyph over the distance to the next one.
_GLYPH_LENGTH = 0.85
#: Opacity of voxels around the directions of their fibres.
_PALE = 0.3
#: Distance of a slice from the voxels behind it, in voxels.
_AHEAD = 0.1


@dataclass(frozen=True)
class CellLook:
    """Selects what of a unit cell is shown."""

    #: A key of `CONTENTS`, shown as colours.
    content: str = "yarns"
    #: Mean strain, one of `COMPONENTS`.
    load: str = "xx"
    #: Which voxels are drawn: "share" from a share of yarn, "yarn" those of one yarn, "value" from
    #: a number of the content, "none".
    voxels: str = "share"
    #: Least share of yarn, or least number of the content in its unit.
    threshold: float = INSIDE
    #: Number of the yarn.
    yarn: int = 0
    #: Whether a slice is drawn, in front of which there are no voxels.
    slice: bool = True
    #: Axis across the slice, and its number.
    across: str = "z"
    index: int = 0
    #: Whether the directions of fibres are drawn.
    directions: bool = False


def shown_voxels(model: UnitCellModel, look: CellLook) -> Bools:
    """Return the voxels that a look selects, (nz, ny, nx), without those in front of its slice."""
    share = model.voxels.fraction
    if look.voxels == "share":
        chosen = share >= look.threshold
    elif look.voxels == "yarn":
        chosen = (model.voxels.yarn == look.yarn) & (share >= INSIDE)
    elif look.voxels == "value":
        chosen = voxel_values(model, look.content, look.load)[0] >= look.threshold
    else:
        chosen = np.zeros(share.shape, bool)
    return chosen & _behind_slice(model, look)


def _behind_slice(model: UnitCellModel, look: CellLook) -> Bools:
    shape = model.voxels.fraction.shape
    if not look.slice:
        return np.ones(shape, bool)
    axis = 2 - "xyz".index(look.across)
    place = np.arange(shape[axis]).reshape([-1 if k == axis else 1 for k in range(3)])
    return np.broadcast_to(place < look.index, shape)


class UnitCellActors:
    """Actors of a unit cell, which are made once and updated for each look."""

    def __init__(self, model: UnitCellModel) -> None:
        self.model = model
        self.voxels, self.slice, self.glyphs, self.box = (vtkActor() for _ in range(4))
        for actor in (self.voxels, self.slice, self.box):
            actor.SetMapper(vtkPolyDataMapper())
        for actor in (self.voxels, self.slice):
            mapper = actor.GetMapper()
            mapper.SetScalarModeToUseCellFieldData()
            mapper.SelectColorArray("color")
            mapper.SetColorModeToDirectScalars()
        self.voxels.GetProperty().SetInterpolationToFlat()
        self.voxels.GetProperty().SetAmbient(0.3)
        self.slice.GetProperty().LightingOff()
        self.glyphs.SetMapper(self._make_glyph_mapper())
        line = self.glyphs.GetProperty()
        line.LightingOff()
        line.SetColor(0.11, 0.13, 0.17)
        outline = vtkOutlineSource()
        outline.SetBounds(*np.column_stack([np.zeros(3), self._size]).ravel())
        self.box.GetMapper().SetInputConnection(outline.GetOutputPort())
        self.box.GetProperty().LightingOff()
        turn = vtkMatrix4x4()
        for row, column in np.ndindex(3, 3):
            turn.SetElement(row, column, float(self._gradient[row, column]))
        for actor in self.actors:
            actor.SetUserMatrix(turn)
            actor.SetPickable(False)
        self._table = vtkLookupTable()
        colors = ramp_table()
        self._table.SetNumberOfTableValues(len(colors))
        for number, color in enumerate((colors / 255).tolist()):
            self._table.SetTableValue(number, *color, 1.0)
        self.color_bar = make_color_bar()
        self.color_bar.SetLookupTable(self._table)

    @property
    def actors(self) -> list[vtkActor]:
        """Actors of all parts."""
        return [self.voxels, self.slice, self.glyphs, self.box]

    @property
    def props(self) -> list[vtkProp]:
        """All actors, and the scale of the colours."""
        return [*self.actors, self.color_bar]

    @property
    def corners(self) -> Floats:
        """Corners of the cell [m], (8, 3)."""
        ends = np.array(list(np.ndindex(2, 2, 2)), np.float64)
        corners: Floats = ends * self._size @ self._gradient.T
        return corners

    @property
    def _size(self) -> Floats:
        size: Floats = self.model.spacing * self.model.voxels.fraction.shape[::-1]
        return size

    @property
    def _gradient(self) -> Floats:
        return np.eye(3) if self.model.gradient is None else self.model.gradient

    def show(self, look: CellLook, pixels_per_point: float = 1.0) -> None:
        """Draw a look; points are the unit of line widths."""
        colors = voxel_colors(self.model, look.content, look.load)
        self._show_voxels(shown_voxels(self.model, look), colors)
        self.voxels.GetProperty().SetOpacity(_PALE if look.directions else 1.0)
        self._show_slice(look, colors)
        self._show_glyphs(look)
        self.box.GetProperty().SetLineWidth(1.2 * pixels_per_point)
        self.box.GetProperty().SetColor(0.45, 0.48, 0.52)
        self.glyphs.GetProperty().SetLineWidth(1.8 * pixels_per_point)
        self._show_scale(look)

    def _show_voxels(self, chosen: Bools, colors: NDArray[np.uint8]) -> None:
        """Draw the outer faces of voxels."""
        self.voxels.SetVisibility(bool(chosen.any()))
        if not chosen.any():
            return
        image = vtkImageData()
        image.SetDimensions(*(count + 1 for count in reversed(chosen.shape)))
        image.SetSpacing(*self.model.spacing)
        add_array(image.GetCellData(), "chosen", chosen.ravel().astype(np.uint8))
        add_array(image.GetCellData(), "color", colors.reshape(-1, 3))
        threshold, surface = vtkThreshold(), vtkGeometryFilter()
        threshold.SetInputData(image)
        cells = vtkDataObject.FIELD_ASSOCIATION_CELLS
        threshold.SetInputArrayToProcess(0, 0, 0, cells, "chosen")
        threshold.SetUpperThreshold(0.5)
        threshold.SetThresholdFunction(vtkThreshold.THRESHOLD_UPPER)
        surface.SetInputConnection(threshold.GetOutputPort())
        surface.Update()
        self.voxels.GetMapper().SetInputData(surface.GetOutput())

    def _show_slice(self, look: CellLook, colors: NDArray[np.uint8]) -> None:
        """Draw a layer of voxels as a plane."""
        self.slice.SetVisibility(look.slice)
        if not look.slice:
            return
        axis = "xyz".index(look.across)
        counts = list(reversed(colors.shape[:3]))
        counts[axis] = 0
        image = vtkImageData()
        image.SetDimensions(*(count + 1 for count in counts))
        image.SetSpacing(*self.model.spacing)
        origin = np.zeros(3)
        # The plane closes the voxels behind it, a little in front of their faces.
        origin[axis] = (look.index + _AHEAD) * self.model.spacing[axis]
        image.SetOrigin(*origin)
        layer = np.take(colors, look.index, axis=2 - axis)
        add_array(image.GetCellData(), "color", np.ascontiguousarray(layer).reshape(-1, 3))
        surface = vtkGeometryFilter()
        surface.SetInputData(image)
        surface.Update()
        self.slice.GetMapper().SetInputData(surface.GetOutput())

    def _show_glyphs(self, look: CellLook) -> None:
        """Draw the directions of fibres in yarns, each for a block of voxels."""
        self.glyphs.SetVisibility(look.directions)
        if not look.directions:
            return
        voxels, spacing = self.model.voxels, self.model.spacing
        inside = voxels.fraction >= INSIDE
        if look.voxels == "yarn":
            inside &= voxels.yarn == look.yarn
        inside = inside & _behind_slice(self.model, look)
        distance = self._size.max() / _GLYPHS
        steps = np.maximum(1, np.rint(distance / spacing)).astype(int)
        x, y, z = (
            np.arange(step // 2, count, step)
            for step, count in zip(steps, reversed(inside.shape), strict=True)
        )
        at = np.meshgrid(z, y, x, indexing="ij")
        chosen = np.stack(at, axis=-1)[inside[tuple(at)]]
        data = vtkPolyData()
        data.SetPoints(to_points((chosen[:, ::-1] + 0.5) * spacing))
        along = voxels.direction[tuple(chosen.T)] * (_GLYPH_LENGTH * distance)
        data.GetPointData().AddArray(to_array(along, "direction"))
        self.glyphs.GetMapper().SetInputData(data)

    def _make_glyph_mapper(self) -> vtkGlyph3DMapper:
        line, mapper = vtkLineSource(), vtkGlyph3DMapper()
        line.SetPoint1(-0.5, 0.0, 0.0)
        line.SetPoint2(0.5, 0.0, 0.0)
        mapper.SetSourceConnection(line.GetOutputPort())
        mapper.SetOrientationArray("direction")
        mapper.SetScaleArray("direction")
        mapper.SetScaleModeToScaleByMagnitude()
        mapper.ScalarVisibilityOff()
        return mapper

    def _show_scale(self, look: CellLook) -> None:
        self.color_bar.SetVisibility(look.content != "yarns")
        low, high = value_span(self.model, look.content, look.load)
        self._table.SetTableRange(low, high)
        self.color_bar.SetCustomLabels(to_array(np.array(round_ticks(low, high))))
        lines = [
            CONTENTS[look.content].replace(" of ", " of\n").replace("Equivalent ", "Equivalent\n")
        ]
        if needs_load(look.content):
            unit = voxel_values(self.model, look.content, look.load)[1]
            lines += [*([f"[{unit}]"] if unit else []), "mean strain", f"{look.load} = 1"]
        self.color_bar.SetTitle("\n".join(lines))
