"""Draw contact shadows over a window's view, computed on request from its depths."""

from __future__ import annotations

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkRenderingCore import (
    vtkCoordinate,
    vtkPolyDataMapper2D,
    vtkRenderer,
    vtkRenderWindow,
    vtkTexture,
    vtkTexturedActor2D,
)

from spacemap_vtk.datasets.arrays import to_image
from spacemap_vtk.draw.actors.contact_shadows import contact_shadows, soften
from spacemap_vtk.draw.camera import depths_to_metres, pixels_per_metre_at_focus


class ShadowLayer:
    """A layer that adds contact shadows to a renderer's view, as in pictures."""

    def __init__(self, window: vtkRenderWindow, layer: int) -> None:
        self.renderer = vtkRenderer()
        self.renderer.SetLayer(layer)
        self.renderer.InteractiveOff()
        self.renderer.AutomaticLightCreationOff()
        self.renderer.DrawOff()
        window.AddRenderer(self.renderer)
        self._depth, self._texture = vtkFloatArray(), vtkTexture()
        self._texture.SetColorModeToDirectScalars()
        self._relief, self._strength = 0.0, 0.0
        plane, mapper, coordinates = vtkPlaneSource(), vtkPolyDataMapper2D(), vtkCoordinate()
        plane.SetOrigin(0.0, 0.0, 0.0)
        plane.SetPoint1(1.0, 0.0, 0.0)
        plane.SetPoint2(0.0, 1.0, 0.0)
        coordinates.SetCoordinateSystemToNormalizedViewport()
        mapper.SetInputConnection(plane.GetOutputPort())
        mapper.SetTransformCoordinate(coordinates)
        actor = vtkTexturedActor2D()
        actor.SetMapper(mapper)
        actor.SetTexture(self._texture)
        self.renderer.AddViewProp(actor)
        #: Whether the layer is to be drawn.
        self.is_on = False
        #: Left, bottom, right and top of areas without shadows, in pixels.
        self.unshaded_areas: list[tuple[float, float, float, float]] = []

    def set_shadows(self, relief: float, strength: float) -> None:
        """Set the depth of folds [m] and the strength of shadows; 0 switches the layer off."""
        self._relief, self._strength, self.is_on = relief, strength, strength > 0.0

    def update(self, renderer: vtkRenderer) -> None:
        """Compute the shadows for the view that a renderer has drawn."""
        window, camera = renderer.GetRenderWindow(), renderer.GetActiveCamera()
        width, height = window.GetSize()
        window.GetZbufferData(0, 0, width - 1, height - 1, self._depth)
        depths = vtk_to_numpy(self._depth).reshape(height, width)
        plates = [
            (slice(round(b), round(t)), slice(round(a), round(r)))
            for a, b, r, t in self.unshaded_areas
        ]
        for plate in plates:  # plates are in front of everything and would cast shadows on it
            depths[plate] = 1.0
        depth = depths_to_metres(camera, depths)
        pixels = self._relief * pixels_per_metre_at_focus(camera, height)
        factors = soften(contact_shadows(depth, self._relief, pixels, self._strength, line_width=2))
        for plate in plates:
            factors[plate] = 1.0
        black = np.zeros((height, width, 4), np.uint8)
        black[..., 3] = 255.5 - 255.0 * factors
        self._texture.SetInputData(to_image(black))
