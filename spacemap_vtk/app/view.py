"""The 3D view."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import VTK_SURFACE, VTK_WIREFRAME, vtkCamera, vtkCellPicker

from spacemap_vtk.app.actors import PICKED, CageActor, PickActor, moved_points
from spacemap_vtk.app.canvas import Canvas
from spacemap_vtk.app.clip import ClipPlane
from spacemap_vtk.app.frame import Frame
from spacemap_vtk.app.look import Look
from spacemap_vtk.app.pick import Pick, read_point
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.camera import aim
from spacemap_vtk.draw.coloring import SHOWN
from spacemap_vtk.draw.cut_face import CutFaceActor
from spacemap_vtk.draw.glyphs import DOT, LINE, GhostActor, LoadActor, SupportActor, cut_of
from spacemap_vtk.draw.surface_actor import (
    Span,
    SurfaceActor,
    fit_scale,
    natural_span,
    scale_share,
)
from spacemap_vtk.scenes.settings import View

#: Most picked points; the oldest goes.
MOST_PICKS = 6
#: Half the pixels a mouse may move in a click.
_STEADY = 3.0


class View3D(QWidget):
    """Draws frames; the mouse turns, moves and zooms as in every VTK program."""

    #: A point that was clicked at: a `Pick`.
    picked = Signal(object)
    #: All picked points, a list of `Pick`; Shift adds to them, a click begins anew.
    picks_changed = Signal(list)
    #: The mouse has moved the plane that cuts: its normal and origin.
    clipped = Signal(object, object)
    #: The mouse is moving that plane.
    clipping = Signal()

    def __init__(self, look: Look) -> None:
        super().__init__()
        self.look = look
        self.frame: Frame | None = None
        self.plotter = Canvas(self)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.plotter)
        self._fabric, self._ghost = SurfaceActor(), GhostActor()
        self._face = CutFaceActor()
        self._cage, self._supports, self._loads = CageActor(), SupportActor(), LoadActor()
        #: Where the user has picked.
        self.marks = PickActor()
        for actor in (*self._actors, self._face, self.marks):
            self.plotter.renderer.AddActor(actor)
        self.plotter.front.AddActor(self._loads.through)
        self._loads.VisibilityOff()
        self.plotter.renderer.AddViewProp(self._fabric.bar)
        self.plotter.setAcceptDrops(False)
        self.plotter.installEventFilter(self)
        # Loads are never cut, see `LoadActor`.
        self.clip = ClipPlane(
            self.plotter.interactor, self._actors[:-1], self.clipped, self.clipping
        )
        self.clipping.connect(self._fill)
        self._view: View | None = None
        self._cut: object = None
        #: Points that the user has picked, the last one last; see `picks_changed`.
        self.picks: list[Pick] = []
        self._span: tuple[object, Span] | None = None
        self._plain: tuple[int, ...] = (185, 196, 207)
        self._colored: tuple[dict[str, Any], tuple[int, int], float] | None = None
        self._pressed: QPointF | None = None
        self._closed = False
        #: The preset that the camera was last brought to, and where it stood then.
        self._aimed: tuple[str | None, dict[str, Any]] | None = None
        #: Share of the width that the scale takes.
        self._room = 0.0

    @property
    def _actors(self) -> list[Any]:
        return [self._fabric, self._ghost, self._cage, self._supports, self._loads]

    def show_frame(self, frame: Frame, view: View) -> None:
        """Draw a frame."""
        self._fit_to_screen(view)
        # Smooth edges cost as much as all the rest in software, so moving pictures go without.
        self.plotter.renderer.SetUseFXAA(not frame.coarse)
        first = self.frame is None or self.frame.generation != frame.generation
        self.frame = frame
        self._color(view)
        self._view = view
        if first:
            self.clip.last = None
            self.forget_picks()
        self.refresh(render=False)
        self._mark()
        if first:
            self.reset_camera(view.camera)
        self.render()

    def adopt(self, view: View) -> None:
        """Show the present frame as a scene's section ``[view]`` says."""
        if self._view is None:
            self._color(view)  # behind what may never come
        elif view.settings != self._view.settings:
            self._view = view
            self._fit_to_screen(view)
            self._color(view)
            self.refresh()

    def refresh(self, render: bool = True) -> None:
        """Show the present frame as `look` and the scene say."""
        frame, look, view = self.frame, self.look, self._view
        if frame is None or view is None:
            return
        self._fabric.show(
            frame.surface, frame.color, self._plain, self._span_of(frame), frame.painting
        )
        self._fabric.SetVisibility(look.fabric)
        drawn = VTK_WIREFRAME if look.wireframe else VTK_SURFACE
        self._fabric.GetProperty().SetRepresentation(drawn)
        self._fabric.bar.SetVisibility(self._fabric.bar.GetVisibility() and look.fabric)
        room = scale_share(self._size) if self._fabric.bar.GetVisibility() else 0.0
        self.plotter.camera.SetWindowCenter(room, 0.0)
        if room != self._room:
            self._room = room
            self._keep_whole()
        ghost = view.ghost and look.fabric
        self._ghost.SetVisibility(ghost)
        if ghost:
            self._ghost.show(frame.surface)
        supports = view.supports and look.cage
        for actor, wanted in ((self._cage, look.cage), (self._supports, supports)):
            actor.SetVisibility(wanted)
            if wanted:
                actor.show(frame.cage)
        if view.loads != self._loads.GetVisibility():
            self._loads.SetVisibility(view.loads)
            self.plotter.front.SetDraw(view.loads)
            self._keep_whole()
        cut = frame.generation, view.clip_normal, view.clip_origin
        if cut != self._cut:
            self._cut = cut
            self.clip.show(cut_of(view, frame.surface), self._extent())
        self._fill()
        # Nobody sees the far sides of closed yarns, and they would cost as much as the near ones.
        self._fabric.GetProperty().SetBackfaceCulling(frame.closed)
        if render:
            self.render()

    def _fill(self) -> None:
        """Draw the face of the cut, and the loads on what is left."""
        frame, shown = self.frame, self.look.fabric and not self.look.wireframe
        if frame is not None:
            cut = self.clip.cut if shown else None
            span = self._span and self._span[1]
            self._face.fill(frame.surface, cut, frame.color, self._plain, span)
            if self._loads.GetVisibility():
                self._loads.show(frame.arrows, self.clip.cut)

    def render(self) -> None:
        """Draw as soon as Qt comes to it."""
        if not self._closed:
            self.plotter.renderer.ResetCameraClippingRange()
            # Not plotter.render(): the widget would draw a second time when Qt paints it.
            self.plotter.update()

    def reset_camera(self, name: str | None = "three-quarter") -> None:
        """Look at the whole."""
        points = self._extent()
        if points is None:
            return
        width, height = max(1, self.plotter.width()), max(1, self.plotter.height())
        camera = self.plotter.camera
        aim(camera, points, (1.0 - self._room) * width / height, name, 1.0)
        self._aimed = name, self.place
        # The scale of a parallel projection that shows as much as the perspective does.
        camera.SetParallelScale(_half_height(camera))
        self.render()

    def zoom(self, factor: float) -> None:
        """Look from nearer."""
        camera = self.plotter.camera
        if camera.GetParallelProjection():
            camera.SetParallelScale(camera.GetParallelScale() / factor)
        else:
            camera.Dolly(factor)
        self.render()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the whole in sight."""
        super().resizeEvent(event)
        self._keep_whole()

    def _keep_whole(self) -> None:
        """Fit the view to another form of its picture, unless the user has moved the camera."""
        if self._aimed is None or self.frame is None:
            return
        (name, before), now = self._aimed, self.place
        if all(before[key] == now[key] for key in ("position", "focus", "up")):
            self.reset_camera(name)

    def set_orthographic(self, on: bool) -> None:
        """Switch between parallel and perspective projection."""
        camera = self.plotter.camera
        if on:
            camera.SetParallelScale(_half_height(camera))
        camera.SetParallelProjection(on)
        self.render()

    @property
    def place(self) -> dict[str, Any]:
        """Where the camera stands, as `spacemap_vtk.draw.picture.Place` has it."""
        camera = self.plotter.camera
        return {
            "position": camera.GetPosition(),
            "focus": camera.GetFocalPoint(),
            "up": camera.GetViewUp(),
            "parallel_scale": camera.GetParallelScale() if camera.GetParallelProjection() else 0.0,
        }

    def add_pick(self, pick: Pick, alone: bool = True) -> None:
        """Keep a picked point, and mark it."""
        self.picks = [pick] if alone else [*self.picks, pick][-MOST_PICKS:]
        self._mark()
        self.render()
        self.picks_changed.emit(list(self.picks))

    def forget_picks(self) -> None:
        """Forget the picked points."""
        if self.picks:
            self.picks = []
            self._mark()
            self.render()
            self.picks_changed.emit([])

    def _mark(self) -> None:
        """Show picked points where they are now."""
        if not self.picks or self.frame is None:
            self.marks.show(np.zeros((0, 3)))
            return
        surface = self.frame.surface
        rest = points_of(surface)
        moved = surface.GetPointData().GetArray("displacement")
        if moved is not None:
            rest = rest - vtk_to_numpy(moved)
        nearest = [int(((rest - p.rest) ** 2).sum(axis=1).argmin()) for p in self.picks]
        self.marks.show(points_of(surface)[nearest].astype(np.float64))

    def pick(self, x: float, y: float) -> Pick | None:
        """Return what lies under a point of the widget."""
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
        cell, point = picker.GetCellId(), picker.GetPointId()
        return None if cell < 0 or point < 0 else read_point(self.frame.surface, cell, point)

    def click(self, at: QPointF, adding: bool = False) -> None:
        """Pick what lies under a point of the widget, if anything does."""
        found = self.pick(at.x(), at.y())
        if found is not None:
            self.add_pick(found, alone=not adding)
            self.picked.emit(found)

    def image(self) -> NDArray[np.uint8]:
        """Return what is seen."""
        return self.plotter.image()

    def shut(self) -> None:
        """Free the window of OpenGL; nothing can be drawn afterwards."""
        if not self._closed:
            self._closed = True
            self.plotter.removeEventFilter(self)
            self.clip.close()
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
                self.click(at, bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier))
        return False

    def _fit_to_screen(self, view: View) -> None:
        """Keep dots and lines as wide as they are on other screens, and as the scene wants them."""
        self.clip.pixels = self.plotter.devicePixelRatioF()
        pixels = self.clip.pixels * view.line_scale
        self.marks.GetProperty().SetPointSize(PICKED * pixels)
        self._supports.GetProperty().SetPointSize(DOT * pixels)
        self._cage.GetProperty().SetLineWidth(LINE * pixels)
        # Of objects of lines or points alone.
        self._fabric.GetProperty().SetLineWidth(pixels)
        self._fabric.GetProperty().SetPointSize(3.0 * pixels)

    def _color(self, view: View) -> None:
        pixels = self.plotter.devicePixelRatioF()
        if self._colored == (view.settings, self._size, pixels):
            return
        self._colored = view.settings, self._size, pixels
        renderer, top = self.plotter.renderer, view.background_top
        renderer.SetBackground(*(c / 255 for c in view.background))
        renderer.SetGradientBackground(top is not None)
        if top is not None:
            renderer.SetBackground2(*(c / 255 for c in top))
        self._cage.GetProperty().SetColor(*(c / 255 for c in view.line_color))
        self._supports.GetProperty().SetColor(*(c / 255 for c in view.support_color))
        self._plain = view.object_color
        fit_scale(self._fabric.bar, self._size, view.background, pixels)

    @property
    def _size(self) -> tuple[int, int]:
        return self.plotter.width(), max(540, self.plotter.height() * 3 // 4)

    def _span_of(self, frame: Frame) -> Span | None:
        """Return the ends of the scale; while only time passes, they never come nearer."""
        numbers = frame.surface.GetPointData().GetArray(SHOWN)
        if numbers is None:
            return None
        low, high = natural_span(vtk_to_numpy(numbers))
        if self._span is not None and self._span[0] == (frame.values, frame.swing):
            low, high = min(low, self._span[1][0]), max(high, self._span[1][1])
        self._span = (frame.values, frame.swing), (low, high)
        return low, high

    def _extent(self) -> NDArray[np.float64] | None:
        if self.frame is None:
            return None
        points = points_of(self.frame.surface)
        # Of many, some thousand are enough.
        clouds = [points[:: 1 + len(points) // 5000].astype(np.float64)]
        if self.frame.cage is not None:
            # At rest and moved: a swing should not leave the picture at once.
            clouds += [points_of(self.frame.cage), moved_points(self.frame.cage)]
        if self._loads.GetVisibility() and self.frame.arrows is not None:
            clouds.append(self.frame.arrows.reach)
        return np.concatenate(clouds)


def _half_height(camera: vtkCamera) -> float:
    """Return half the height of what a camera shows in perspective, at its focus."""
    return camera.GetDistance() * float(np.tan(np.radians(camera.GetViewAngle() / 2)))
