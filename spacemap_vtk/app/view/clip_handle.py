"""Handle by which the mouse moves and turns the clip plane."""

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
    """The visible clip plane: its border, and an arrow along its normal."""

    def __init__(
        self, interactor: vtkRenderWindowInteractor, moved: Callable[[bool], object]
    ) -> None:
        self.shape = vtkImplicitPlaneRepresentation()
        self.shape.SetPlaceFactor(1.15)
        self.shape.DrawOutlineOff()
        self.shape.OutlineTranslationOff()
        self.shape.ScaleEnabledOff()
        self.shape.SetDrawPlane(True)
        plane, selected_plane = self.shape.GetPlaneProperty(), self.shape.GetSelectedPlaneProperty()
        plane.SetOpacity(0.10)
        plane.SetColor(*_PLANE)
        # VTK's default is a green that would tint the cloth while the mouse holds the plane.
        selected_plane.SetOpacity(0.16)
        selected_plane.SetColor(*_PLANE)
        self.shape.SetEdgeColor(*_PLANE)
        self.shape.GetNormalProperty().SetColor(0.85, 0.39, 0.17)
        self.shape.GetSelectedNormalProperty().SetColor(0.95, 0.55, 0.2)
        self.widget = vtkImplicitPlaneWidget2()
        # Without VTK's key: "I" would show the plane when nothing is cut.
        self.widget.KeyPressActivationOff()
        self.widget.SetInteractor(interactor)
        self.widget.SetRepresentation(self.shape)

        def on_event(_caller: Any, event: str) -> None:
            moved(event == "EndInteractionEvent")

        self._observers = [
            self.widget.AddObserver(event, on_event)
            for event in ("InteractionEvent", "EndInteractionEvent")
        ]

    def place(self, cut: Cut, points: NDArray[np.float64], pixels: float) -> None:
        """Put the handle at a cut through the visible points; `pixels` scales the line widths."""
        self.shape.GetEdgesProperty().SetLineWidth(2.0 * pixels)
        self.shape.GetNormalProperty().SetLineWidth(2.0 * pixels)
        low, high = points.min(axis=0), points.max(axis=0)
        # Enlarge the box, so that the mouse can also hold it for a flat cloth.
        slack = 0.15 * float(np.linalg.norm(high - low))
        bounds = np.stack([low - slack, high + slack], axis=1).ravel()
        self.shape.PlaceWidget(bounds.tolist())
        self.shape.SetNormal(*cut[0])
        self.shape.SetOrigin(*cut[1])

    @property
    def cut(self) -> Cut:
        """Normal and origin of the plane at present."""
        plane = vtkPlane()
        self.shape.GetPlane(plane)
        return plane.GetNormal(), plane.GetOrigin()

    def show(self, on: bool) -> None:
        """Show or hide the handle."""
        self.widget.SetEnabled(on)

    def close(self) -> None:
        """Detach from the interactor, before the interactor is freed."""
        self.widget.SetEnabled(False)
        for observer in self._observers:
            self.widget.RemoveObserver(observer)
        self.widget.SetInteractor(None)
