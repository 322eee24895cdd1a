"""Obstacles in the 3D view: which one is selected, clicked or dragged."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from vtkmodules.vtkRenderingCore import vtkCellPicker

from spacemap_vtk.app.view.canvas import Canvas
from spacemap_vtk.datasets.modal_model import bodies_of
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.draw.scene_view import SceneView
from spacemap_vtk.filters.obstacle import Obstacle
from spacemap_vtk.filters.obstacle_surfaces import ENDLESS

if TYPE_CHECKING:
    from spacemap_vtk.app.view.obstacle_handle import ObstacleHandle


class ObstacleTool(QObject):
    """Show the handle of the selected obstacle, and let the mouse drag it."""

    #: Number of an obstacle, and its values that the mouse has changed.
    moved = Signal(int, object)
    #: Number of the obstacle that was clicked; None for Esc, which puts the handle away.
    chosen = Signal(object)
    #: Whether the mouse holds the handle, when this changes.
    held = Signal(bool)
    #: The view must be drawn again.
    changed = Signal()

    def __init__(self, canvas: Canvas, scene_view: SceneView) -> None:
        super().__init__(canvas)
        self._canvas, self._scene_view = canvas, scene_view
        #: The shown frame, and whether it shows obstacles.
        self._frame: Frame | None = None
        self._are_shown = False
        #: Created with the first selected obstacle.
        self.handle: ObstacleHandle | None = None
        self._selected: tuple[int, Obstacle] | None = None

    def select(self, number: int | None, obstacle: Obstacle | None) -> None:
        """Show the handle of an obstacle of the scene, or none."""
        self._selected = None if number is None or obstacle is None else (number, obstacle)
        self._place_handle()
        self.changed.emit()

    def show_frame(self, frame: Frame | None, shown: bool) -> None:
        """Follow a frame of the view, which shows obstacles or does not."""
        self._frame, self._are_shown = frame, shown
        self._place_handle()

    def _place_handle(self) -> None:
        """Put the handle on the selected obstacle, unless the mouse holds it."""
        cage = self._frame.cage if self._frame is not None and self._are_shown else None
        if self._is_held:
            return
        if self._selected is not None and cage is not None:
            if self.handle is None:
                # Imported only here, as it loads VTK's filters; most scenes have no obstacles.
                from spacemap_vtk.app.view.obstacle_handle import ObstacleHandle

                self.handle = ObstacleHandle(self._canvas.renderer, self._canvas.front)
            self.handle.place(self._selected[1], cage)
        elif self.handle is not None:
            self.handle.show(False)

    def fit(self) -> None:
        """Give the handle its size on the screen, before each drawing."""
        if self.handle is not None:
            pixels = self._canvas.devicePixelRatioF()
            self.handle.fit(round(pixels * self._canvas.height()), pixels)

    @property
    def has_handle(self) -> bool:
        """Whether a handle is shown."""
        return self.handle is not None and self.handle.obstacle is not None

    @property
    def _is_held(self) -> bool:
        return self.handle is not None and self.handle.held is not None

    def number_at(self, at: QPointF) -> int | None:
        """Return the number of the obstacle that is seen at a position in the widget."""
        shown, frame = self._scene_view, self._frame
        if frame is None or frame.cage is None or frame.obstacles is None:
            return None
        picker = vtkCellPicker()
        picker.SetTolerance(0.0005)
        picker.PickFromListOn()
        for actor in (shown.bodies, shown.planes, shown.surface, shown.sheet):
            if actor.GetVisibility():
                picker.AddPickList(actor)
        # Elsewhere obstacles are not picked, as if they were transparent.
        for actor in (shown.bodies, shown.planes):
            actor.SetPickable(True)
        found = picker.Pick(*self._device_position(at), 0.0, self._canvas.renderer)
        for actor in (shown.bodies, shown.planes):
            actor.SetPickable(False)
        if not found:
            return None
        endless = picker.GetActor() is shown.planes
        if not endless and picker.GetActor() is not shown.bodies:
            return None  # the fabric is in front
        data = frame.obstacles.planes if endless else frame.obstacles.bodies
        part = int(data.GetCellData().GetArray("obstacle").GetValue(picker.GetCellId()))
        # Bodies and planes are numbered separately.
        shapes = [body["shape"] for body in bodies_of(frame.cage)]
        return [k for k, shape in enumerate(shapes) if (shape == ENDLESS) == endless][part]

    def use_event(self, event: QEvent, escapes: bool) -> bool:
        """Let a mouse or key event change the handle; return whether it is used up."""
        # Esc always ends a drag; it puts the handle away only if it `escapes`.
        if not self.has_handle:
            return False
        if isinstance(event, QKeyEvent):
            is_escape = event.key() == Qt.Key.Key_Escape and (escapes or self._is_held)
            return is_escape and self._use_escape(event)
        if isinstance(event, QMouseEvent):
            return self._use_mouse(event, *self._device_position(event.position()))
        return False

    def _use_mouse(self, event: QMouseEvent, x: float, y: float) -> bool:
        handle, kind = self.handle, event.type()
        assert handle is not None
        is_left = event.button() == Qt.MouseButton.LeftButton
        if kind == QEvent.Type.MouseMove and handle.held is not None:
            handle.drag(x, y)
            self.changed.emit()
        elif kind == QEvent.Type.MouseMove:
            part = None if event.buttons() else self._part_at(x, y)
            if part is not None:
                self._canvas.setCursor(Qt.CursorShape.PointingHandCursor)
            else:
                self._canvas.unsetCursor()
            return False
        elif kind == QEvent.Type.MouseButtonPress and is_left and handle.held is None:
            part = self._part_at(x, y)
            if part is None:
                return False
            self._canvas.setFocus()  # for Esc
            handle.hold(part, x, y)
            self.held.emit(True)
        elif kind == QEvent.Type.MouseButtonRelease and is_left and handle.held is not None:
            changes = handle.release()
            self.held.emit(False)
            if changes and self._selected is not None:
                self.moved.emit(self._selected[0], changes)
        else:
            return handle.held is not None
        return True

    def _use_escape(self, event: QKeyEvent) -> bool:
        """End the drag with the old value; without a drag, put the handle away."""
        handle = self.handle
        assert handle is not None
        if event.type() == QEvent.Type.ShortcutOverride:
            event.accept()  # so that the key comes here and triggers no action
        elif event.type() == QEvent.Type.KeyPress and handle.held is not None:
            handle.cancel()
            self.held.emit(False)
            self.changed.emit()
        elif event.type() == QEvent.Type.KeyPress:
            self.chosen.emit(None)
        return True

    def _part_at(self, x: float, y: float) -> str | int | None:
        assert self.handle is not None
        return self.handle.part_at(x, y, self._canvas.devicePixelRatioF())

    def _device_position(self, at: QPointF) -> tuple[float, float]:
        """Return a position in the widget in device pixels from the bottom, as VTK counts."""
        ratio, height = self._canvas.devicePixelRatioF(), self._canvas.height()
        return at.x() * ratio, (height - 1 - at.y()) * ratio
