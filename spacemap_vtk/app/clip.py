"""A plane that cuts the view open; the mouse moves and turns it."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkRenderingCore import vtkActor, vtkRenderWindowInteractor


class ClipPlane:
    """Hides what lies on one side of a plane, in any number of actors.

    Parameters
    ----------
    interactor : vtkRenderWindowInteractor
        Of the view.
    actors : sequence of vtkActor
        What is cut.
    """

    def __init__(self, interactor: vtkRenderWindowInteractor, actors: Sequence[vtkActor]) -> None:
        self.plane = vtkPlane()
        self._interactor, self._actors = interactor, list(actors)
        self._widget: Any = None
        self.on = False
        self._placed = False

    def _make(self) -> None:
        """Make the plane that is seen: at its first use, for its library takes a while to load."""
        from vtkmodules.vtkInteractionWidgets import (
            vtkImplicitPlaneRepresentation,
            vtkImplicitPlaneWidget2,
        )

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
        self._widget.SetInteractor(self._interactor)
        self._widget.SetRepresentation(self._shape)
        me = weakref.ref(self)

        def moved(_caller: Any, _event: str) -> None:
            here = me()
            if here is not None:
                here._shape.GetPlane(here.plane)

        self._observer = self._widget.AddObserver("InteractionEvent", moved)

    def set_on(self, on: bool, points: NDArray[np.float64] | None) -> None:
        """Cut or show the whole again.

        Parameters
        ----------
        on : bool
            Cut.
        points : ndarray, shape (n, 3), or None
            What is seen, for the plane's first place.
        """
        if on == self.on or (on and points is None):
            return
        self.on = on
        if on and not self._placed and points is not None:
            self.reset(points)
        for actor in self._actors:
            if on:
                actor.GetMapper().AddClippingPlane(self.plane)
            else:
                actor.GetMapper().RemoveAllClippingPlanes()
        self._widget.SetEnabled(on)

    def reset(
        self, points: NDArray[np.float64], normal: tuple[float, float, float] = (-1.0, 0.0, 0.0)
    ) -> None:
        """Put the plane through the middle.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
            What is seen.
        normal : tuple of float, optional
            Points to what stays in sight.
        """
        if self._widget is None:
            self._make()
        low, high = points.min(axis=0), points.max(axis=0)
        # A flat cloth too gets a box that the mouse can take hold of.
        slack = 0.15 * float(np.linalg.norm(high - low))
        bounds = np.stack([low - slack, high + slack], axis=1).ravel()
        self._shape.PlaceWidget(bounds.tolist())
        self._shape.SetOrigin(*((low + high) / 2).tolist())
        self._shape.SetNormal(*normal)
        self._shape.GetPlane(self.plane)
        self._placed = True

    def forget(self) -> None:
        """Find a new place at the next use: another scene is here."""
        self._placed = False

    def close(self) -> None:
        """Let go of the interactor, before it is freed."""
        if self._widget is not None:
            self._widget.SetEnabled(False)
            self._widget.RemoveObserver(self._observer)
            self._widget.SetInteractor(None)
        self._interactor = None
