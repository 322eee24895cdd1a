"""A plane that cuts the view open; the mouse moves and turns it."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkRenderingCore import vtkActor, vtkRenderWindowInteractor

from spacemap_vtk.draw.glyphs import Cut

if TYPE_CHECKING:
    from spacemap_vtk.app.clip_handle import ClipHandle


class ClipPlane:
    """Hides what lies on one side of a plane, in any number of actors."""

    def __init__(
        self,
        interactor: vtkRenderWindowInteractor,
        actors: Sequence[vtkActor],
        told: Any,
        moving: Any,
    ) -> None:
        self.plane = vtkPlane()
        #: Normal and origin of the plane that was shown last, if it was one of this scene's.
        self.last: Cut | None = None
        self.on = False
        #: Of the screen, in width, for one that a person sees.
        self.pixels = 1.0
        self._interactor, self._actors, self._told = interactor, list(actors), told
        self._moving = moving
        self._handle: ClipHandle | None = None

    def show(self, cut: Cut | None, points: NDArray[np.float64] | None) -> None:
        """Cut, or show the whole."""
        if cut is not None and points is not None:
            self.last = cut
            self._handle = self._handle or self._made()
            self._handle.place(cut, points, self.pixels)
            self._handle.read(self.plane)
        on = cut is not None
        if on != self.on:
            self.on = on
            for actor in self._actors:
                if on:
                    actor.GetMapper().AddClippingPlane(self.plane)
                else:
                    actor.GetMapper().RemoveAllClippingPlanes()
            if self._handle is not None:
                self._handle.show(on)

    @property
    def cut(self) -> Cut | None:
        """Normal and origin of the plane where it is now; None: the whole is shown."""
        return (self.plane.GetNormal(), self.plane.GetOrigin()) if self.on else None

    def _made(self) -> ClipHandle:
        # With VTK's widgets: most windows never cut anything.
        from spacemap_vtk.app.clip_handle import ClipHandle

        me = weakref.ref(self)

        def moved(done: bool) -> None:
            here = me()
            if here is None or here._handle is None:
                return
            here._handle.read(here.plane)
            here._moving.emit()
            if done:
                here._tell()

        return ClipHandle(self._interactor, moved)

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
        if self._handle is not None:
            self._handle.close()
