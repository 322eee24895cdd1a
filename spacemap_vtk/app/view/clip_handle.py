"""What the mouse takes hold of to move and turn the plane that cuts the view open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkInteractionWidgets import vtkImplicitPlaneRepresentation, vtkImplicitPlaneWidget2
from vtkmodules.vtkRenderingCore import vtkRenderWindowInteractor

from spacemap_vtk.draw.actors.glyphs import Cut

_PLANE = (0.30, 0.61, 0.78)


class ClipHandle:
    """The plane as one sees it: its border, and an arrow along its normal."""

    def __init__(
        self, interactor: vtkRenderWindowInteractor, moved: Callable[[bool], object]
    ) -> None:
        self.shape = vtkImplicitPlaneRepresentation()
        self.shape.SetPlaceFactor(1.15)
        self.shape.DrawOutlineOff()
        self.shape.OutlineTranslationOff()
        self.shape.ScaleEnabledOff()
        self.shape.SetDrawPlane(True)
        plane, held = self.shape.GetPlaneProperty(), self.shape.GetSelectedPlaneProperty()
        plane.SetOpacity(0.10)
        plane.SetColor(*_PLANE)
        # VTK's own is a green that would tint the cloth while the mouse holds the plane.
        held.SetOpacity(0.16)
        held.SetColor(*_PLANE)
        self.shape.SetEdgeColor(*_PLANE)
        self.shape.GetNormalProperty().SetColor(0.85, 0.39, 0.17)
        self.shape.GetSelectedNormalProperty().SetColor(0.95, 0.55, 0.2)
        self.widget = vtkImplicitPlaneWidget2()
        # No key of its own: I would bring up the plane of a cut that is none.
        self.widget.KeyPressActivationOff()
        self.widget.SetInteractor(interactor)
        self.widget.SetRepresentation(self.shape)

        def tell(_caller: Any, event: str) -> None:
            moved(event == "EndInteractionEvent")

        self._observers = [
            self.widget.AddObserver(event, tell)
            for event in ("InteractionEvent", "EndInteractionEvent")
        ]

    def place(self, cut: Cut, points: NDArray[np.float64], pixels: float) -> None:
        """Stand where a plane cuts what is seen; lines are so many pixels times as wide."""
        self.shape.GetEdgesProperty().SetLineWidth(2.0 * pixels)
        self.shape.GetNormalProperty().SetLineWidth(2.0 * pixels)
        low, high = points.min(axis=0), points.max(axis=0)
        # A flat cloth too gets a box that the mouse can take hold of.
        slack = 0.15 * float(np.linalg.norm(high - low))
        bounds = np.stack([low - slack, high + slack], axis=1).ravel()
        self.shape.PlaceWidget(bounds.tolist())
        self.shape.SetNormal(*cut[0])
        self.shape.SetOrigin(*cut[1])

    @property
    def cut(self) -> Cut:
        """Normal and origin of the plane where it is now."""
        plane = vtkPlane()
        self.shape.GetPlane(plane)
        return plane.GetNormal(), plane.GetOrigin()

    def show(self, on: bool) -> None:
        """Be seen, or not."""
        self.widget.SetEnabled(on)

    def close(self) -> None:
        """Let go of the interactor, before it is freed."""
        self.widget.SetEnabled(False)
        for observer in self._observers:
            self.widget.RemoveObserver(observer)
        self.widget.SetInteractor(None)
