"""The 3D view."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtWidgets import QVBoxLayout, QWidget
from pyvistaqt import QtInteractor
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkCellPicker

from spacemap_vtk.app.actors import CageActor, FabricActor, GhostActor, SupportActor, moved_points
from spacemap_vtk.app.frame import Frame
from spacemap_vtk.app.look import Look
from spacemap_vtk.app.pick import Pick
from spacemap_vtk.filters.arrays import points_of
from spacemap_vtk.scenes.picture import add_lights, aim
from spacemap_vtk.scenes.settings import View

#: Half the pixels a mouse may move in a click.
_STEADY = 3.0


class View3D(QWidget):
    """Draws frames; the mouse turns, moves and zooms as in every VTK program.

    Parameters
    ----------
    look : Look
        What is shown; `refresh` after a change.
    """

    picked = Signal(object)

    def __init__(self, look: Look) -> None:
        super().__init__()
        self.look = look
        self.frame: Frame | None = None
        # Nothing is drawn but on demand: pyvistaqt's timer would draw on for nothing.
        self.plotter = QtInteractor(self, auto_update=False, lighting="none", multi_samples=0)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.plotter)
        add_lights(self.plotter)
        self._fabric, self._ghost = FabricActor(), GhostActor()
        self._cage, self._supports = CageActor(), SupportActor()
        for actor in self._actors:
            self.plotter.renderer.AddActor(actor)
        self.plotter.renderer.AddViewProp(self._fabric.bar)
        self.plotter.setAcceptDrops(False)
        self.plotter.installEventFilter(self)
        self._pressed: QPointF | None = None
        self._closed = False

    @property
    def _actors(self) -> list[Any]:
        return [self._fabric, self._ghost, self._cage, self._supports]

    def show_frame(self, frame: Frame, view: View) -> None:
        """Draw a frame.

        Parameters
        ----------
        frame : Frame
            What the engine made.
        view : View
            The scene's colours.
        """
        # Smooth edges cost as much as all the rest in software, so moving pictures go without.
        self.plotter.renderer.SetUseFXAA(not frame.coarse)
        first = self.frame is None or self.frame.generation != frame.generation
        self.frame = frame
        self._color(view)
        self.refresh(render=False)
        if first:
            self.reset_camera(view.camera)
        self.render()

    def refresh(self, render: bool = True) -> None:
        """Show the present frame as `look` says.

        Parameters
        ----------
        render : bool, optional
            Whether to draw at once.
        """
        frame, look = self.frame, self.look
        if frame is None:
            return
        self._fabric.show(frame.surface, look.coloring)
        self._fabric.SetVisibility(look.fabric)
        self._fabric.bar.SetVisibility(self._fabric.bar.GetVisibility() and look.fabric)
        self._ghost.SetVisibility(look.ghost)
        if look.ghost:
            self._ghost.show(frame.surface)
        for actor, wanted in ((self._cage, look.cage), (self._supports, look.supports)):
            actor.SetVisibility(wanted)
            if wanted:
                actor.show(frame.cage)
        if render:
            self.render()

    def render(self) -> None:
        """Draw as soon as Qt comes to it."""
        if not self._closed:
            self.plotter.renderer.ResetCameraClippingRange()
            # Not plotter.render(): the widget would draw a second time when Qt paints it.
            self.plotter.update()

    def reset_camera(self, name: str = "three-quarter") -> None:
        """Look at the whole from one of the camera presets.

        Parameters
        ----------
        name : str
            A key of `spacemap_vtk.scenes.picture.CAMERAS`.
        """
        points = self._extent()
        if points is None:
            return
        width, height = max(1, self.plotter.width()), max(1, self.plotter.height())
        camera = self.plotter.camera
        aim(camera, points, width / height, name, 1.0)
        # The scale of a parallel projection that shows as much as the perspective does.
        opening = np.radians(camera.view_angle / 2)
        camera.parallel_scale = camera.distance * float(np.tan(opening))
        self.render()

    def set_orthographic(self, on: bool) -> None:
        """Switch between parallel and perspective projection.

        Parameters
        ----------
        on : bool
            Parallel.
        """
        camera = self.plotter.camera
        opening = np.radians(camera.view_angle / 2)
        if on:
            camera.parallel_scale = camera.distance * float(np.tan(opening))
        camera.SetParallelProjection(on)
        self.render()

    def mark_points(self, positions: list[tuple[float, float, float]]) -> None:
        """Show where picked points are.

        Parameters
        ----------
        positions : list of tuple of float
            In m.
        """
        self.plotter.remove_actor("picked points", render=False)
        if positions:
            self.plotter.add_points(
                np.array(positions),
                color="#d9642c",
                point_size=14,
                render_points_as_spheres=True,
                name="picked points",
                reset_camera=False,
                render=False,
                pickable=False,
            )
        self.render()

    def pick(self, x: float, y: float) -> Pick | None:
        """Return what lies under a point of the widget.

        Parameters
        ----------
        x, y : float
            In Qt's pixels, from the upper left.

        Returns
        -------
        Pick or None
            None where there is no fabric.
        """
        if self.frame is None:
            return None
        ratio = self.plotter.devicePixelRatioF()
        picker = vtkCellPicker()
        picker.SetTolerance(0.0005)
        picker.PickFromListOn()
        picker.AddPickList(self._fabric)
        height = self.plotter.height()
        if not picker.Pick(x * ratio, (height - 1 - y) * ratio, 0, self.plotter.renderer):
            return None
        surface, cell, point = self.frame.surface, picker.GetCellId(), picker.GetPointId()
        if cell < 0 or surface.GetCellData().GetArray("yarn") is None:
            return None
        position = points_of(surface)[point].astype(float)
        moved = surface.GetPointData().GetArray("displacement")
        displacement = np.zeros(3) if moved is None else vtk_to_numpy(moved)[point].astype(float)
        return Pick(
            yarn=int(surface.GetCellData().GetArray("yarn").GetTuple1(cell)),
            family=int(surface.GetCellData().GetArray("family").GetTuple1(cell)),
            position=_three(position),
            rest=_three(position - displacement),
            displacement=_three(displacement),
        )

    def image(self) -> NDArray[np.uint8]:
        """Return what is seen.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green and blue.
        """
        self.plotter.render()
        return self.plotter.screenshot(None, return_img=True)

    def shut(self) -> None:
        """Free the window of OpenGL; nothing can be drawn afterwards."""
        if not self._closed:
            self._closed = True
            self.plotter.removeEventFilter(self)
            self.plotter.close()
            self.frame = None

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Tell a click from a drag; VTK sees both."""
        if event.type() == QEvent.Type.MouseButtonPress:
            if event.button() == Qt.MouseButton.LeftButton:
                self._pressed = event.position()
        elif event.type() == QEvent.Type.MouseButtonRelease and self._pressed is not None:
            at, start = event.position(), self._pressed
            self._pressed = None
            if (at - start).manhattanLength() <= _STEADY:
                found = self.pick(at.x(), at.y())
                if found is not None:
                    self.picked.emit(found)
        return False

    def _color(self, view: View) -> None:
        self.plotter.set_background(view.background, top=view.background_top)
        self._cage.GetProperty().SetColor(*(c / 255 for c in view.cage_color))
        self._supports.GetProperty().SetColor(*(c / 255 for c in view.support_color))
        dark = sum(view.background) < 384
        ink = (0.92, 0.94, 0.97) if dark else (0.16, 0.18, 0.21)
        self._fabric.bar.GetTitleTextProperty().SetColor(*ink)
        self._fabric.bar.GetLabelTextProperty().SetColor(*ink)

    def _extent(self) -> NDArray[np.float64] | None:
        if self.frame is None:
            return None
        clouds = [points_of(self.frame.surface)[::7].astype(np.float64)]
        if self.frame.cage is not None:
            # At rest and moved: a swing should not leave the picture at once.
            clouds += [points_of(self.frame.cage), moved_points(self.frame.cage)]
        return np.concatenate(clouds)


def _three(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
