"""A plane that cuts the view open; the mouse moves and turns it."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkInteractionWidgets import vtkImplicitPlaneRepresentation, vtkImplicitPlaneWidget2
from vtkmodules.vtkRenderingCore import vtkActor, vtkRenderWindowInteractor

from spacemap_vtk.scenes.glyphs import Cut


class ClipPlane:
    """Hides what lies on one side of a plane, in any number of actors.

    Parameters
    ----------
    interactor : vtkRenderWindowInteractor
        Of the view.
    actors : sequence of vtkActor
        What is cut.
    told : SignalInstance
        Emitted with normal and origin when the mouse has moved the plane.
    """

    def __init__(
        self, interactor: vtkRenderWindowInteractor, actors: Sequence[vtkActor], told: Any
    ) -> None:
        self.plane = vtkPlane()
        #: Normal and origin of the plane that was shown last, if it was one of this scene's.
        self.last: Cut | None = None
        self._actors, self._told = list(actors), told
        self._shape = vtkImplicitPlaneRepresentation()
        self._shape.SetPlaceFactor(1.15)
        self._shape.DrawOutlineOff()
        self._shape.OutlineTranslationOff()
        self._shape.ScaleEnabledOff()
        self._shape.SetDrawPlane(True)
        self._shape.GetPlaneProperty().SetOpacity(0.10)
        self._shape.GetPlaneProperty().SetColor(0.30, 0.61, 0.78)
        self._shape.SetEdgeColor(0.30, 0.61, 0.78)
        self._shape.GetEdgesProperty().SetLineWidth(2.0)
        self._shape.GetNormalProperty().SetColor(0.85, 0.39, 0.17)
        self._shape.GetSelectedNormalProperty().SetColor(0.95, 0.55, 0.2)
        self._widget = vtkImplicitPlaneWidget2()
        # No key of its own: I would bring up the plane of a cut that is none.
        self._widget.KeyPressActivationOff()
        self._widget.SetInteractor(interactor)
        self._widget.SetRepresentation(self._shape)
        me = weakref.ref(self)

        def moved(_caller: Any, event: str) -> None:
            here = me()
            if here is None:
                return
            here._shape.GetPlane(here.plane)
            if event == "EndInteractionEvent":
                here._tell()

        self._observers = [
            self._widget.AddObserver(event, moved)
            for event in ("InteractionEvent", "EndInteractionEvent")
        ]
        self.on = False

    def show(self, cut: Cut | None, points: NDArray[np.float64] | None) -> None:
        """Cut, or show the whole.

        Parameters
        ----------
        cut : tuple or None
            Normal, which points to what stays in sight, and origin [m]; None: the whole.
        points : ndarray, shape (n, 3), or None
            What is seen: the mouse can take hold of the plane there.
        """
        if cut is not None and points is not None:
            self.last = cut
            low, high = points.min(axis=0), points.max(axis=0)
            # A flat cloth too gets a box that the mouse can take hold of.
            slack = 0.15 * float(np.linalg.norm(high - low))
            bounds = np.stack([low - slack, high + slack], axis=1).ravel()
            self._shape.PlaceWidget(bounds.tolist())
            self._shape.SetNormal(*cut[0])
            self._shape.SetOrigin(*cut[1])
            self._shape.GetPlane(self.plane)
        on = cut is not None
        if on != self.on:
            self.on = on
            for actor in self._actors:
                if on:
                    actor.GetMapper().AddClippingPlane(self.plane)
                else:
                    actor.GetMapper().RemoveAllClippingPlanes()
            self._widget.SetEnabled(on)

    def _tell(self) -> None:
        """Tell where the plane is, to six digits, if it is not where it was."""
        normal, origin = (
            tuple(float(f"{part:.6g}") for part in vector)
            for vector in (self.plane.GetNormal(), self.plane.GetOrigin())
        )
        if self.last is None or not np.allclose((normal, origin), self.last, 1e-5, 1e-9):
            self._told.emit(normal, origin)

    def close(self) -> None:
        """Let go of the interactor, before it is freed."""
        self._widget.SetEnabled(False)
        for observer in self._observers:
            self._widget.RemoveObserver(observer)
        self._widget.SetInteractor(None)
