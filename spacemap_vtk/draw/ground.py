"""The soft shadow on level ground: what stands over each place, blurred the more, the higher."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkTexture

from spacemap_vtk.datasets.arrays import to_array, to_cells, to_image, to_points
from spacemap_vtk.draw.glyphs import PlainActor
from spacemap_vtk.draw.shading import blurred

#: Share of the shadow that is left free on each side of what casts it, and most cells of the rest:
#: so many, as points leave no holes in.
_MARGIN, _CELLS, _POINTS = 0.21, 92, 1.5
#: Most points that cast it, and slices that are each blurred: by such shares of it on the ground,
#: and where they are as high as it is long.
_MOST, _SLICES, _SHARP, _SOFT = 150_000, 4, 0.01, 0.1


class GroundActor(PlainActor):
    """A shadow on a plane across one of the axes."""

    def __init__(self) -> None:
        super().__init__()
        texture = vtkTexture()
        texture.SetColorModeToDirectScalars()
        texture.InterpolateOn()
        texture.EdgeClampOn()
        self.SetTexture(texture)
        self.GetProperty().LightingOff()
        self.ForceTranslucentOn()

    def show(
        self, points: NDArray[np.floating[Any]], up: int, floor: float, strength: float
    ) -> None:
        """Draw the shadow of some points, (n, 3), on a floor so high along an axis."""
        points = points[:: 1 + len(points) // _MOST]
        sides = [(up + 1) % 3, (up + 2) % 3]
        low, high = points[:, sides].min(axis=0), points[:, sides].max(axis=0)
        length = float((high - low).max()) / (1.0 - 2.0 * _MARGIN) or 1.0
        cells = int(min(_CELLS, np.sqrt(len(points)) / _POINTS + 8) / (1.0 - 2.0 * _MARGIN))
        corner = 0.5 * (low + high) - 0.5 * length
        places = ((points[:, sides] - corner) * (cells / length)).astype(np.int64) @ (1, cells)
        heights = (points[:, up] - floor) / length
        slices = np.minimum(heights * _SLICES, _SLICES - 1).astype(np.int64)
        light = np.ones((cells, cells), np.float32)
        for number in range(_SLICES):
            found = np.bincount(places[slices == number], minlength=cells**2) > 0
            if found.any():
                spread = cells * (_SHARP + _SOFT * (number + 0.5) / _SLICES)
                cast = blurred(found.reshape(cells, cells).astype(np.float32), spread)
                light *= 1.0 - cast
        black = np.zeros((cells, cells, 4), np.uint8)
        black[..., 3] = np.rint(255.0 * strength * (1.0 - light))
        self.GetTexture().SetInputData(to_image(black))
        square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        corners = np.full((4, 3), floor)
        corners[:, sides] = corner + length * square
        ground = vtkPolyData()
        ground.SetPoints(to_points(corners))
        ground.SetPolys(to_cells(np.arange(4).reshape(1, 4)))
        ground.GetPointData().SetTCoords(to_array(square.astype(np.float32), "texels"))
        self.GetMapper().SetInputData(ground)
