"""The 3D view: draws frames, moves the camera and picks points."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from vtkmodules.vtkRenderingCore import vtkCellPicker, vtkInteractorStyle

from spacemap_vtk.app.view.canvas import Canvas
from spacemap_vtk.app.view.obstacle_tool import ObstacleTool
from spacemap_vtk.app.view.pick import Pick, read_point, read_sheet
from spacemap_vtk.app.view.preview import Preview
from spacemap_vtk.app.view.ruler import Ruler
from spacemap_vtk.app.widgets import single_shot
from spacemap_vtk.draw.actors.glyphs import PICKED, Cut, DotsActor, cut_of
from spacemap_vtk.draw.actors.lighting import FINE_SAMPLES
from spacemap_vtk.draw.actors.surface_actor import color_bar_share, rgb
from spacemap_vtk.draw.annotate.annotations import MOST_LABELS
from spacemap_vtk.draw.camera import (
    Aim,
    CameraView,
    Viewpoint,
    aim_camera,
    aim_of,
    camera_directions,
    camera_up_axis,
    half_height,
    keep_upright,
    pixels_per_metre,
    project_points,
    refit_viewpoint,
    zoom_in,
)
from spacemap_vtk.draw.frame import PULLED, Frame
from spacemap_vtk.draw.scene_view import SceneView, ViewOptions, extent_of, visible_cells
from spacemap_vtk.scenes.cameras import FLAT, SIDES
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import View

if TYPE_CHECKING:
    from spacemap_vtk.app.view.clip_handle import ClipHandle
    from spacemap_vtk.draw.actors.unit_cell_actors import CellLook, UnitCellActors
    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: Time after the last camera move until the camera counts as at rest, in ms.
_REST_TIME = 220
#: Most pixels that the mouse may move during a click.
_MAX_CLICK_MOVE = 3.0
#: While something moves, the next picture has smooth edges (FXAA) if the last one, with smooth
#: edges, took less than this time, in s.
_MAX_SMOOTH_TIME = 0.2
#: The same if the last picture had no smooth edges.
_MAX_ROUGH_TIME = 0.1
#: The camera is aimed again if the scene is larger or smaller by these factors; at the larger one
#: it reaches the edge of the picture.
_LEAST_GROWTH, _MOST_GROWTH = 0.7, 1.12
#: VTK's interactor state while the mouse turns the camera (VTKIS_ROTATE).
_TURNING = 1


class View3D(QWidget):
    """Draw frames; the mouse turns, moves and zooms as in other VTK programs."""

    #: A `Pick`, the point that was clicked.
    picked = Signal(object)
    #: All picked points, a list of `Pick`. A click starts a new list, Shift+click adds to it.
    picks_changed = Signal(list)
    #: What the ruler measures, in words; empty if it measures nothing.
    measured = Signal(str)
    #: Normal and origin of the clip plane after the mouse has moved it.
    clipped = Signal(object, object)
    #: Whether a camera preset has switched to parallel projection.
    orthographic_changed = Signal(bool)
    #: Whether the camera has started to move; False when it has come to rest.
    camera_moving = Signal(bool)

    def __init__(self, options: ViewOptions) -> None:
        super().__init__()
        self.options = options
        self.frame: Frame | None = None
        self.canvas = Canvas(self)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.canvas)
        #: Thumbnail that is shown until the scene is drawn.
        self.preview = Preview(self)
        #: All that is drawn except the clip plane's handle and the marks of picked points.
        self.scene_view = SceneView(self.canvas.renderer, has_shadows=False, samples=FINE_SAMPLES)
        self.canvas.front.AddActor(self.scene_view.loads.pale_copy)
        #: The selected obstacle and its handle.
        self.obstacles = ObstacleTool(self.canvas, self.scene_view)
        self.obstacles.held.connect(self.steer)
        self.obstacles.changed.connect(self._show_handle)
        self._place_signs = self.scene_view.annotations.detach_from_camera()
        self.canvas.shade.unshaded_areas = self.scene_view.annotations.boxes
        #: Marks of the picked points.
        self.marks = DotsActor()
        self.marks.GetProperty().SetColor(*rgb("#d9642c"))
        self.canvas.renderer.AddActor(self.marks)
        self.ruler = Ruler()
        self.canvas.renderer.AddViewProp(self.ruler.line)
        self.canvas.setAcceptDrops(False)
        self.canvas.installEventFilter(self)
        #: The last clip plane of this scene, or None.
        self.last_cut: Cut | None = None
        #: Handle that moves the clip plane; created with the first cut.
        self.handle: ClipHandle | None = None
        #: Unit cell that is shown in place of the scene, and its look.
        self.cell: UnitCellActors | None = None
        self._cell_look: CellLook | None = None
        #: View settings of the scene, and the same with the background of the window's theme.
        self._scene_settings: View | None = None
        self._view: View | None = None
        self._dark = False
        #: Whether the frame belongs to a scene that has been closed.
        self._is_scene_closed = False
        self._cut: tuple[object, Cut | None] = None, None
        #: Picked points in the order of picking; see `picks_changed`.
        self.picks: list[Pick] = []
        self._press_position: QPointF | None = None
        self._closed = False
        #: The last camera preset, and the viewpoint it gave.
        self._preset: tuple[Aim | None, Viewpoint] | None = None
        self._rest_timer = single_shot(self, self._end_camera_move, _REST_TIME)
        self._shadow_timer = single_shot(self, self._draw_shadows, _REST_TIME)
        #: Camera and size of the last drawing.
        self._last_drawn: CameraView | None = None
        #: Whether the camera moves or has moved a moment ago; whether the mouse holds it.
        self.steering = self._held = False
        #: Whether the up axis stays up while the mouse turns the view, and the viewpoint before the
        #: last move.
        self.turntable = False
        self._last_viewpoint: Viewpoint | None = None
        #: Whether the last picture showed something moving, and whether such pictures are quick.
        self._was_moving, self._is_quick = False, True
        self.canvas.painting.connect(self._prepare_drawing)
        self._observe_camera()
        #: Points that were in view when the camera was aimed.
        self._aimed_points: NDArray[np.float64] | None = None
        #: Whether the whole scene is to be in view after the next change of its values.
        self.fits_change = False
        #: Whether the camera is then where the scene has it, and nothing else changes until then.
        self.aims_change = False
        #: Whether the last frame showed a pull.
        self._was_pulled = False
        #: Values of the last drawn scene.
        self._drawn_values: dict[str, Any] | None = None
        #: State for which the camera was aimed: fraction of the width for the colour scale, whether
        #: load arrows are shown, whether there is a cage.
        self._aimed_for = 0.0, False, False

    def show_frame(self, frame: Frame, view: View) -> None:
        """Draw a frame."""
        first = self.frame is None or self.frame.generation != frame.generation
        if self.aims_change and not first and frame.values == self._drawn_values:
            return  # a former frame has no place in the view of the new scene
        self.frame, self._is_scene_closed = frame, False
        self._set_view_settings(view)
        if first:
            self._drawn_values = frame.values  # the camera is aimed below
            self.last_cut = None
            self.clear_picks()
        self.refresh(render=False)
        self._update_marks()
        if first:
            self.reset_camera(aim_of(view) or frame.camera)
        self.render()

    def expect_change(self, aims: bool) -> None:
        """Keep picture and camera until the changed scene is drawn, which then fits to the view."""
        # `aims`: the camera and the other settings of the view change with the scene.
        self.fits_change, self.aims_change = True, aims
        self.preview.announce(self.frame is not None and not self._is_scene_closed)

    def forget_change(self) -> None:
        """End the preview: the scene is drawn."""
        self.preview.end()
        self.fits_change = self.aims_change = False

    def clear_scene(self) -> None:
        """Show nothing until the first frame of a new scene."""
        self._is_scene_closed, self.steering = True, False
        self._rest_timer.stop()
        self.clear_picks()
        if self.handle is not None:
            self.handle.show(False)
        self._cut = None, None
        self.obstacles.select(None, None)
        self.scene_view.hide()
        self.render()

    def show_cell(self, model: UnitCellModel | None, look: CellLook | None = None) -> None:
        """Show a unit cell in place of the scene; None shows the scene again."""
        before = self.cell
        if before is not None and before.model is not model:
            for prop in before.props:
                self.canvas.renderer.RemoveViewProp(prop)
            self.cell = None
        if model is not None and self.cell is None:
            from spacemap_vtk.draw.actors.unit_cell_actors import UnitCellActors

            self.cell = UnitCellActors(model)
            for prop in self.cell.props:
                self.canvas.renderer.AddViewProp(prop)
        self._cell_look = look
        self.refresh(render=False)
        if (before is None) != (self.cell is None):
            self.clear_picks()
            self.reset_camera()
        self.render()

    @property
    def camera_view(self) -> CameraView | None:
        """Camera and size of the view; None before the first frame."""
        if self._preset is None:
            return None
        ratio = self.canvas.devicePixelRatioF()
        width, height = self.canvas.width(), self.canvas.height()
        pixels = max(1, round(ratio * width)), max(1, round(ratio * height))
        return CameraView(self.viewpoint, self.scene_view.scale_width, pixels)

    def _observe_camera(self) -> None:
        reference, style = weakref.ref(self), self.canvas.interactor.GetInteractorStyle()

        def on_event(style: vtkInteractorStyle, event: str) -> None:
            view = reference()
            if view is None:
                return
            if view.turntable and style.GetState() == _TURNING and event[0] != "E":
                keep_upright(view.canvas.camera, view.up_axis, view._last_viewpoint)
                view._last_viewpoint = view.viewpoint
            if event != "InteractionEvent":
                view._last_viewpoint = None
                view.steer(event == "StartInteractionEvent")

        for name in ("StartInteractionEvent", "InteractionEvent", "EndInteractionEvent"):
            style.AddObserver(name, on_event)

    @property
    def up_axis(self) -> int:
        """Index of the up axis in the scene."""
        frame, view = self.frame, self._view
        return 1 if frame is None or view is None else camera_up_axis(aim_of(view) or frame.camera)

    def steer(self, held: bool) -> None:
        """Draw quickly while the mouse holds the camera, and for a moment afterwards."""
        self._held = held
        self._suspend_shadows()
        if self.frame is None or (
            self.frame.preview is None and not self.needs_new_frame(self.frame)
        ):
            return
        if self.cell is not None:
            return
        if not self.steering:
            self.steering = True
            self.scene_view.set_moving(True)
            self.camera_moving.emit(True)
        if held:
            self._rest_timer.stop()
        else:
            self._rest_timer.start()

    def needs_new_frame(self, frame: Frame) -> bool:
        """Return whether the present camera may need a new frame."""
        if frame.cloth is not None:
            return True
        camera_view = self.camera_view
        if frame.coarse_scale == 0.0 or camera_view is None:
            return False
        # The number of facets was chosen for another view and may be too small or too large.
        scale = pixels_per_metre(
            camera_view.camera, extent_of(frame, loads=False), camera_view.size[1]
        )
        return scale > frame.coarse_scale or frame.has_finer_yarns

    def _end_camera_move(self) -> None:
        self.steering, frame = False, self.frame
        if frame is not None and (frame.cloth is None or frame.camera_view == self.camera_view):
            self.scene_view.set_moving(False)
            self._draw_shadows()
        # Otherwise a new frame for this camera will be requested.
        self.camera_moving.emit(False)

    def _suspend_shadows(self) -> None:
        """Leave out contact shadows, which take time, until nothing has moved for a moment."""
        if self.canvas.shade.is_on:
            self.canvas.shade.set_shadows(0.0, 0.0)
            self.scene_view.include_shadows(False)
        self._shadow_timer.start()

    def _draw_shadows(self) -> None:
        """Draw contact shadows, as in exported pictures."""
        if self.camera_view != self._last_drawn or self._was_moving:
            self.render()  # reports a camera that has been moved since
        self._shadow_timer.stop()
        frame, strength = self.frame, self.scene_view.occlusion
        if frame is None or self._held or self.steering or strength == 0.0:
            return
        had_shadows, was_shaded = self.scene_view.has_shadows, self.canvas.shade.is_on
        self.scene_view.include_shadows(True)
        # Cloth has the shadows in its colours.
        folds = frame.cloth is None and not self.scene_view.has_exposure
        self.canvas.shade.set_shadows(frame.relief, strength if folds else 0.0)
        # Yarns look the same as before, and are not drawn again: it would take as long.
        if self.canvas.shade.is_on != was_shaded or (frame.cloth is not None and not had_shadows):
            self.render()

    def _prepare_drawing(self) -> None:
        self._place_signs()
        self.obstacles.fit()
        # With software rendering, smooth edges (FXAA) take a third of a frame's time, whatever is
        # drawn; MSAA would take as long as everything else. While something moves, they are drawn
        # only if pictures are quick, and with fewer search steps.
        renderer, took = self.canvas.renderer, self.canvas.draw_time
        moving = self.steering or (self.frame is not None and self.frame.coarse)
        if moving and self._was_moving:
            self._is_quick = took < (_MAX_SMOOTH_TIME if renderer.GetUseFXAA() else _MAX_ROUGH_TIME)
        self._was_moving = moving
        self.scene_view.surface.set_samples(1 if moving else FINE_SAMPLES)
        renderer.SetUseFXAA(self._is_quick or not moving)
        renderer.GetFXAAOptions().SetEndpointSearchIterations(4 if moving else 12)

    def set_view(self, view: View) -> None:
        """Show the present frame with the settings of a scene's section ``[view]``."""
        if self._scene_settings is None:
            self._fit_sizes(
                view.for_window(self._dark)
            )  # for the background, as there may never be a frame
        elif view.settings != self._scene_settings.settings and not self.aims_change:
            is_aimed = view.camera != self._scene_settings.camera
            self._set_view_settings(view)
            self.refresh()
            if is_aimed and self.frame is not None:
                self.reset_camera(aim_of(view) or self.frame.camera)

    def set_dark(self, dark: bool) -> None:
        """Set a dark or light background, used if neither the scene nor its style has one."""
        self._dark = dark
        self._set_view_settings(self._scene_settings)
        self.refresh()

    def _set_view_settings(self, view: View | None) -> None:
        self._scene_settings, self._view = view, (view or View()).for_window(self._dark)
        self._fit_sizes(self._view)

    def refresh(self, render: bool = True) -> None:
        """Show the present frame with the settings of `options` and of the scene."""
        frame, view = self.frame, self._view
        if frame is None or view is None or self._is_scene_closed:
            return
        is_cell, clip = self.cell is not None, (view.clip_normal, view.clip_origin)
        key = frame.generation, *clip, is_cell
        if key != self._cut[0]:
            self._cut = key, self._place_handle(None if is_cell else cut_of(view, frame.surface))
        self.obstacles.show_frame(frame, view.obstacles and not is_cell)
        self.canvas.front.SetDraw((view.loads and not is_cell) or self.obstacles.has_handle)
        self._suspend_shadows()
        self.options.fabric = view.show != "cage" or frame.cage is None
        self.options.cage = view.show != "fabric"
        self.scene_view.show(
            frame, view, self.options, self.scene_view.span_of(frame), self._cut[1]
        )
        if self.cell is not None and self._cell_look is not None:
            self.cell.show(self._cell_look, self.canvas.devicePixelRatioF())
            self.scene_view.show_alone(self.cell.color_bar)
        self.scene_view.set_moving(self.steering)
        aimed_for = self.scene_view.scale_width, view.loads, frame.cage is not None
        if aimed_for != self._aimed_for:
            self._aimed_for = aimed_for
            self._aim_again()
        self._follow_size(frame, view)
        if render:
            self.render()

    def _follow_size(self, frame: Frame, view: View) -> None:
        """Aim the camera again if a change or a pull has made the scene much larger or smaller."""
        is_pulled, was_pulled = frame.mode == PULLED, self._was_pulled
        self._was_pulled = is_pulled
        is_changed, self._drawn_values = frame.values != self._drawn_values, frame.values
        if is_changed and (self.fits_change or self._is_out_of_view):
            # A change of the scene may have moved everything out of the view.
            self.reset_camera(aim_of(view) if self.aims_change else None)
            self.forget_change()
        elif (is_pulled or (is_changed and frame.mode is None)) and not self._held:
            if not _LEAST_GROWTH < self._growth < _MOST_GROWTH:
                self._fit_again()
        elif was_pulled and frame.mode is None:
            self._fit_again()

    def _place_handle(self, cut: Cut | None) -> Cut | None:
        """Put the handle on the clip plane; return the plane where the handle is."""
        if cut is not None and self._extent is not None:
            self.last_cut = cut
            self.handle = self.handle or self._make_handle()
            self.handle.place(cut, self._extent, self.canvas.devicePixelRatioF())
            cut = self.handle.cut
        if self.handle is not None:
            self.handle.show(cut is not None)
        return cut

    def _make_handle(self) -> ClipHandle:
        # Imported only here, because it loads VTK's widgets and most users never clip.
        from spacemap_vtk.app.view.clip_handle import ClipHandle

        reference = weakref.ref(self)

        def moved(done: bool) -> None:
            view = reference()
            if view is not None and view.handle is not None:
                view._move_cut(view.handle.cut, done)

        return ClipHandle(self.canvas.interactor, moved)

    def _move_cut(self, cut: Cut, done: bool) -> None:
        self._cut = self._cut[0], cut
        self.steer(not done)
        self.scene_view.apply_cut(cut)
        # Rounded to six digits, and only if the plane has moved.
        normal, origin = (tuple(float(f"{part:.6g}") for part in vector) for vector in cut)
        before, distance = self.last_cut or np.inf, self.canvas.camera.distance
        if done and abs(np.subtract((normal, origin), before) / [[1.0], [distance]]).max() > 1e-5:
            self.clipped.emit(normal, origin)

    def _show_handle(self) -> None:
        """Draw the handle of an obstacle, which has changed."""
        loads = self._view is not None and self._view.loads
        self.canvas.front.SetDraw(loads or self.obstacles.has_handle)
        self.render()

    def render(self) -> None:
        """Ask Qt to draw the view soon."""
        if not self._closed:
            if self.camera_view != self._last_drawn and not self._held:
                self._last_drawn = self.camera_view
                self.steer(False)
            self.canvas.renderer.ResetCameraClippingRange()
            # Not canvas.render(): the widget would be drawn again when Qt paints it.
            self.canvas.update()

    def reset_camera(self, name: Aim | None = "three-quarter") -> None:
        """Aim the camera at the whole scene or from a viewpoint; None keeps the direction."""
        points = self._extent
        if points is None:
            return
        self._aimed_points = points
        if isinstance(name, Viewpoint):
            self._go_to(name)
            return
        width, height = max(1, self.canvas.width()), max(1, self.canvas.height())
        camera = self.canvas.camera
        flat, before = name == FLAT, None if self._preset is None else self._preset[0]
        was_flat = before == FLAT or (isinstance(before, Viewpoint) and before.parallel_scale > 0.0)
        aim_camera(
            camera,
            points,
            (1.0 - self.scene_view.scale_width) * width / height,
            name,
            1.0,
            self.up_axis,
        )
        if flat or (was_flat and name is not None):
            camera.SetParallelProjection(flat)
            self.orthographic_changed.emit(flat)
        if not flat:
            # A parallel projection with this scale shows as much as the perspective.
            camera.SetParallelScale(half_height(camera))
        self._preset = name, self.viewpoint
        self.render()

    def _go_to(self, viewpoint: Viewpoint) -> None:
        """Move the camera to a viewpoint."""
        camera = self.canvas.camera
        viewpoint.apply_to(camera)
        self.orthographic_changed.emit(bool(viewpoint.parallel_scale))
        if not viewpoint.parallel_scale:
            camera.SetParallelScale(half_height(camera))
        self._preset = viewpoint, self.viewpoint
        self.render()

    def zoom(self, factor: float) -> None:
        """Move the camera nearer by a factor."""
        zoom_in(self.canvas.camera, factor)
        self.render()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the whole scene in view."""
        super().resizeEvent(event)
        self.preview.setGeometry(self.rect())
        self._aim_again()

    def _aim_again(self) -> None:
        """Aim the camera again for the present size, unless the user has moved it."""
        if self._preset is None or self.frame is None:
            return
        (name, before), now = self._preset, self.viewpoint
        if before[:3] == now[:3]:
            self.reset_camera(name)

    def _fit_again(self) -> None:
        """Fit the scene to the view again, unless the user has moved or zoomed the camera."""
        if self._preset is None or isinstance(self._preset[0], Viewpoint):
            return
        (name, before), now = self._preset, self.viewpoint
        ago, here = (np.linalg.norm(np.subtract(v.position, v.focus)) for v in (before, now))
        is_near = np.allclose(now.focus, before.focus, rtol=0.0, atol=1e-6 * ago)
        if before[:3] == now[:3]:
            self.reset_camera(name)
        elif is_near and np.isclose(ago, here, rtol=1e-6):  # the user has turned it
            self.reset_camera(None)

    @property
    def _growth(self) -> float:
        """How much larger the scene is in the view than when the camera was aimed."""
        points, before = self._extent, self._aimed_points
        if points is None or before is None:
            return 1.0
        now, then = self._project(points), self._project(before)
        if min(now[:, 3].min(), then[:, 3].min()) <= 0.0:  # something is behind the camera
            return np.inf
        sizes = [np.abs(clip[:, :2] / clip[:, 3:]).max() for clip in (now, then)]
        return float(sizes[0] / sizes[1])

    @property
    def _is_out_of_view(self) -> bool:
        """Whether the whole scene lies outside one side of the picture."""
        points = self._extent
        if self._preset is None or points is None:
            return False
        x, y, _, w = self._project(points).T
        return any(bool(side.all()) for side in (x < -w, x > w, y < -w, y > w))

    def _project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the clip coordinates of points in the view, (n, 4)."""
        aspect = max(1, self.canvas.width()) / max(1, self.canvas.height())
        return project_points(self.canvas.camera, points, aspect)

    def set_orthographic(self, on: bool) -> None:
        """Switch between parallel and perspective projection."""
        camera = self.canvas.camera
        if on:
            camera.SetParallelScale(half_height(camera))
        camera.SetParallelProjection(on)
        self.render()

    @property
    def viewpoint(self) -> Viewpoint:
        """The viewpoint of the camera."""
        return Viewpoint.from_camera(self.canvas.camera)

    def viewpoint_for(self, size: tuple[int, int]) -> Viewpoint:
        """Compute the viewpoint from which a picture of another size shows the same, enlarged."""
        frame, camera_view = self.frame, self.camera_view
        if frame is None or camera_view is None:
            return self.viewpoint
        # The colour scale is drawn beside the scene, not over it.
        bar_share = color_bar_share(size) if camera_view.offset else 0.0
        aspect, other = (
            (1.0 - share) * width / height
            for share, (width, height) in (
                (camera_view.offset, camera_view.size),
                (bar_share, size),
            )
        )
        shown = visible_cells(frame, self._view or View(), self.options)
        return refit_viewpoint(self.viewpoint, shown, aspect, other)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of a scene's section ``[view]`` that give the look of this view."""
        view, options = self._view or View(), self.options
        triad, bar = options.triad or view.triad, options.scale_bar or view.scale_bar
        return {**view.settings, "triad": triad, "scale_bar": bar}

    def panels(self, scene: Scene) -> list[str]:
        """Return the panels of a picture that shows the same parts as this view."""
        fabric = self.options.fabric or not scene.moves
        return ["both" if fabric and self.options.cage else "fabric" if fabric else "cage"]

    def add_pick(self, pick: Pick, alone: bool = True) -> None:
        """Add a picked point and mark it; `alone` removes the others."""
        self._set_picks([pick] if alone else [*self.picks, pick][-MOST_LABELS:])

    def clear_picks(self) -> None:
        """Remove all picked points, and those of the ruler."""
        if self.ruler.picks:
            self.ruler.clear()
            self._update_marks()
            self.render()
            self.measured.emit(self.ruler.text if self.ruler.is_on else "")
        if self.picks:
            self._set_picks([])

    def set_ruler(self, on: bool) -> None:
        """Let clicks measure distances, or pick points again."""
        self.ruler.is_on = on
        self.canvas.setCursor(Qt.CursorShape.CrossCursor if on else Qt.CursorShape.ArrowCursor)
        if on or not self.ruler.picks:
            self.measured.emit(self.ruler.text if on else "")
        else:
            self.clear_picks()

    def _set_picks(self, picks: list[Pick]) -> None:
        self.picks = picks
        self._update_marks()
        self.render()
        self.picks_changed.emit(list(picks))

    def _update_marks(self) -> None:
        """Draw the marks and labels of the picked points at their present positions."""
        frame, span = self.frame, self.scene_view.span
        labels = [] if frame is None else [p.label(frame, span and span[1]) for p in self.picks]
        self.ruler.follow(frame, self.canvas.devicePixelRatioF())
        self.scene_view.annotations.labels = [*self.ruler.labels, *labels][:MOST_LABELS]
        points = np.array([*self.ruler.points, *(at for at, _ in labels)]).reshape(-1, 3)
        self.marks.SetVisibility(len(points) > 0)
        self.marks.set_points(points)

    def pick(self, x: float, y: float) -> Pick | None:
        """Pick the point of the fabric at a position in the widget."""
        if self.frame is None:
            return None
        ratio = self.canvas.devicePixelRatioF()
        picker = vtkCellPicker()
        picker.SetTolerance(0.0005)
        picker.PickFromListOn()
        cloth, surface = self.frame.cloth, self.frame.surface
        if cloth is not None and self.frame.yarns is not None:
            surface = self.frame.yarns
        actors = self.scene_view.surface, self.scene_view.sheet
        actor = actors[surface is self.frame.surface and cloth is not None]
        picker.AddPickList(actor)
        height, is_shown = self.canvas.height(), actor.GetVisibility()
        # Nothing hidden is picked; while the camera moves, the preview is shown in its place.
        actor.SetVisibility(is_shown or self.scene_view.preview.GetVisibility())
        found = picker.Pick(x * ratio, (height - 1 - y) * ratio, 0, self.canvas.renderer)
        actor.SetVisibility(is_shown)
        if not found:
            return None
        cell, point = picker.GetCellId(), picker.GetPointId()
        if cell < 0 or point < 0:
            return None
        if cloth is None or surface is not self.frame.surface:
            return read_point(surface, cell, point, cloth)
        surface = self.scene_view.sheet.GetMapper().GetInput()  # coarser than the frame's in motion
        behind = np.dot(picker.GetMapperNormal(), self.canvas.camera.GetDirectionOfProjection())
        return read_sheet(surface, cell, picker.GetPCoords(), behind > 0.0, cloth)

    def click(self, at: QPointF, adding: bool = False) -> None:
        """Pick a point at a position in the widget, or look along an axis if its sign is there."""
        side = self._side_at(at)
        if side is not None:
            self.reset_camera(side)
            return
        obstacle = self.obstacles.number_at(at)
        if obstacle is not None:
            self.obstacles.chosen.emit(obstacle)
            return
        point = self.pick(at.x(), at.y())
        if point is not None and self.ruler.is_on:
            self.ruler.add(point)
            self._update_marks()
            self.render()
            self.measured.emit(self.ruler.text)
        elif point is not None:
            self.add_pick(point, alone=not adding)
            self.picked.emit(point)

    def _side_at(self, at: QPointF) -> str | None:
        """Return the side to look from after a click on an axis at a position in the widget."""
        ratio, height = self.canvas.devicePixelRatioF(), self.canvas.height()
        direction = self.scene_view.annotations.axis_at(at.x() * ratio, (height - at.y()) * ratio)
        if direction is None:
            return None
        if np.dot(direction, self.canvas.camera.GetDirectionOfProjection()) < -0.999:
            direction = -direction  # the camera already looks from this side
        return next(
            s for s in SIDES if np.array_equal(camera_directions(s, self.up_axis)[0], direction)
        )

    def image(self) -> NDArray[np.uint8]:
        """Draw the view with contact shadows, and return its pixels."""
        self._draw_shadows()
        return self.canvas.image()

    def release_resources(self) -> None:
        """Free the OpenGL resources; nothing can be drawn afterwards."""
        if not self._closed:
            self._closed = True
            self.canvas.removeEventFilter(self)
            if self.handle is not None:
                self.handle.close()
            self.obstacles.show_frame(None, False)
            self.canvas.close()
            self.frame = None

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Distinguish clicks from drags; VTK receives both, but not those of a handle."""
        if self.obstacles.use_event(event, escapes=not self.picks):
            return True
        if event.type() == QEvent.Type.MouseButtonPress:
            if event.button() == Qt.MouseButton.LeftButton:
                self._press_position = event.position()
        elif event.type() == QEvent.Type.MouseButtonRelease and self._press_position is not None:
            at, start = event.position(), self._press_position
            self._press_position = None
            if (at - start).manhattanLength() <= _MAX_CLICK_MOVE:
                self.click(at, bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier))
        elif event.type() == QEvent.Type.MouseMove and self._press_position is None:
            tip = f"Look from the {side}" if (side := self._side_at(event.position())) else ""
            if tip != self.canvas.toolTip():
                self.canvas.setToolTip(tip)
        return False

    def _fit_sizes(self, view: View) -> None:
        """Set the widths of dots and lines for this screen and for the scene's settings."""
        pixels = self.canvas.devicePixelRatioF()
        point = pixels * view.line_scale
        self.marks.GetProperty().SetPointSize(PICKED * point)
        self.scene_view.fit(view, self.view_size, pixels, point)

    @property
    def view_size(self) -> tuple[int, int]:
        return self.canvas.width(), max(540, self.canvas.height() * 3 // 4)

    @property
    def _extent(self) -> NDArray[np.float64] | None:
        if self.cell is not None:
            return self.cell.corners
        frame, view = self.frame, self._view
        return None if frame is None else extent_of(frame, view is not None and view.loads)
