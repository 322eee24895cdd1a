"""Connect document, engine, time bar and view."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QObject, Signal

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.panels.stage_list import StageList
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.widgets import single_shot
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.app.work.frame_request import FrameRequest, Pull, Swing
from spacemap_vtk.scenes.scene import Scene

#: Time after the last coarse frame until a fine one is requested, in ms.
_REST_TIME = 100
#: Time after which a run is shown as running, in ms.
_NOTICE_DELAY = 150
#: Shown as the step of a cancelled run until the run has ended.
_STOPPING = "stopping…"


class Director(QObject):
    """Request frames from the engine for the present document and time, and show them."""

    #: The frame that was drawn.
    drawn = Signal(object)
    failed = Signal(object)
    #: Section, progress (0 to 1) and step of a long run; ("", 0, "") when it has ended.
    progress = Signal(str, float, str)
    #: The user has cancelled a run; a clause that says how the picture differs from the scene.
    run_cancelled = Signal(str)
    #: A shown mode or pull has failed and is shown no longer.
    swing_ended = Signal()

    def __init__(
        self,
        document: Document,
        engine: Engine,
        view: View3D,
        times: TimeBar,
        stages: StageList,
    ) -> None:
        super().__init__()
        self._document, self._engine, self._view = document, engine, view
        self._times, self._stages = times, stages
        self.generation = 0
        self._last_request: FrameRequest | None = None
        self.swing: Swing | Pull | None = None
        self._running = self._step = ""
        self._progress = 0.0
        #: Whether a drag is in progress; whether the user has cancelled the run.
        self.is_dragging = self._is_cancelling = False
        #: Whether the last request only follows a camera move; whether such a request was cancelled
        #: because the camera has moved on.
        self._follows_camera = self._was_superseded = False
        #: Whether the user has cancelled the run of the last request.
        self._was_cancelled = False
        self._settings: dict[str, dict[str, Any]] = {}
        self.rest_timer = single_shot(self, self._request_fine_frame, _REST_TIME)
        self._notice_timer = single_shot(self, self._show_running, _NOTICE_DELAY)
        document.congested = lambda: engine.congested
        document.changed.connect(self._update_after_change)
        document.replaced.connect(self._start_scene)
        times.time_changed.connect(self._request_time)
        engine.ready.connect(self._show_ready_frame)
        engine.stage_ran.connect(self._show_stage_run)
        engine.progressed.connect(self._record_progress)
        engine.failed.connect(self._show_failure)
        engine.cancelled.connect(self._show_cancelled)
        # When the end of a run is reported, the engine still counts as busy; therefore the state is
        # checked again when it is idle.
        engine.idle.connect(self._report_cancellation)
        view.camera_moving.connect(self._follow_camera)

    def request_frame(self, coarse: bool = False) -> None:
        """Request a frame for the present document and time."""
        document, scene, frame = self._document, self._document.scene, self._view.frame
        # Before the first frame of a scene or preset, the camera is still the former scene's.
        is_aimed = frame is not None and frame.generation == self.generation
        is_aimed = is_aimed and not self._view.aims_change
        self._last_request = FrameRequest(
            values=document.values,
            base=document.base,
            settings=scene.settings,
            generation=self.generation,
            time=self._times.time,
            coarse=coarse,
            swing=self.swing,
            camera_view=self._view.camera_view if is_aimed else None,
        )
        self._follows_camera = False
        self._is_cancelling = self._was_cancelled = False
        self._engine.request(self._last_request)
        if not self._notice_timer.isActive():
            self._notice_timer.start()
        if coarse:
            self.rest_timer.start()
        else:
            self.rest_timer.stop()

    def show_mode(self, swing: Swing | None) -> None:
        """Show a mode instead of the motion; None returns to the motion."""
        if swing is None:
            self.swing = None
            self.request_frame()
        elif self.swing is None or not self._engine.busy:
            self._times.pause()
            self.swing = swing
            self.request_frame(coarse=True)

    def show_pull(self, pull: Pull | None) -> None:
        """Show a stretch of the cloth instead of the motion; None returns to the motion."""
        self._times.pause()
        self.swing = pull
        # Unlike a mode, each stretch is requested, also while the engine is busy: the last one of a
        # drag must be shown.
        self.request_frame(coarse=pull is not None)

    def set_dragging(self, dragging: bool) -> None:
        """Delay the fine frame during a drag."""
        self.is_dragging = dragging

    def cancel(self) -> None:
        """Cancel the run and keep the last picture."""
        self._times.pause()
        self.rest_timer.stop()
        self._is_cancelling, self._was_superseded = True, False
        self._engine.cancel()
        if self._running:
            # The run ends only after its present block of work or library call.
            self._step = _STOPPING
            self.progress.emit(self._running, self._progress, self._step)

    def stop(self) -> None:
        """Stop the engine for good."""
        self.rest_timer.stop()
        self._notice_timer.stop()
        self._times.pause()
        self._engine.finish()

    def _update_after_change(self) -> None:
        self._times.set_animation(self._document.scene.animation)
        connected = {stage.section for stage in self._document.scene.stages}
        listed = {s for s, state in self._stages.states.items() if state not in ("off", "settings")}
        if connected != listed:
            self._stages.show_scene(self._document.scene, reset=False)
        # A change may be the first of a drag, so request a coarse frame now and a fine one soon. A
        # change of the view alone runs no stage and gets a fine frame now.
        before, self._settings = self._settings, _stage_settings(self._document.scene)
        self.request_frame(coarse=self.is_dragging or before != self._settings)

    def _start_scene(self) -> None:
        self.generation += 1
        self.swing = None
        self._view.clear_scene()
        self._times.pause()
        scene = self._document.scene
        self._stages.show_scene(scene)
        self._times.set_animation(scene.animation, scene.view.time)
        self._settings = _stage_settings(scene)
        self.request_frame()

    def _request_time(self, _time: float, continues: bool) -> None:
        self._times.waiting = self._times.playing
        self.request_frame(coarse=continues)

    def _request_fine_frame(self) -> None:
        if self._engine.busy or self.is_dragging:
            self.rest_timer.start()
        elif not self._times.playing and not isinstance(self.swing, Swing):
            self.request_frame(coarse=False)

    def _follow_camera(self, moving: bool) -> None:
        """Request a frame for the view when the camera rests; cancel it if the camera moves on."""
        frame = self._view.frame
        if moving and self._follows_camera and self._engine.busy:
            self._follows_camera, self._was_superseded = False, True
            self._engine.cancel()
        elif self._was_cancelled:
            pass  # the message about it has changed the size of the view: do not run again
        elif not moving and frame is not None and self._view.needs_new_frame(frame):
            is_animating = self.is_dragging or self._times.playing or self.swing is not None
            requested_view = (
                self._last_request.camera_view
                if self._follows_camera and self._last_request
                else frame.camera_view
            )
            if not is_animating and self._view.camera_view not in (
                requested_view,
                frame.camera_view,
            ):
                self.request_frame()
                self._follows_camera = True

    def _show_ready_frame(self) -> None:
        self._times.waiting = self._was_superseded = False
        # Before drawing the frame, so that the engine computes the next one meanwhile.
        self._document.apply_waiting_change()
        frame = self._engine.take_frame()
        if frame is None or frame.generation != self.generation:
            return
        scene = self._document.scene
        # Stages of motion have not run for a frame of a mode or pull.
        skipped = scene.motion_stages if frame.mode is not None else []
        for stage in scene.stages:
            if stage in skipped:
                continue
            waits = stage.section == "surface" and (frame.coarse or frame.mode is not None)
            self._stages.set_state(stage.section, "stale" if waits else "fresh")
        self._end_notice_timer()
        if not frame.coarse:
            self._stages.write_runs()
        before = self._view.frame
        self._view.show_frame(frame, scene.view)
        if before is None or before.generation != frame.generation:
            self._follow_camera(moving=False)  # the first frame has just aimed the camera
        self.drawn.emit(frame)

    def _show_stage_run(self, section: str, seconds: float, executions: int) -> None:
        self._stages.show_run(section, seconds, executions)
        self._stages.set_state(section, "fresh")

    def _record_progress(self, section: str, share: float, step: str) -> None:
        self._running, self._progress = section, share
        self._step = _STOPPING if self._is_cancelling else step

    def _show_running(self) -> None:
        if self._engine.busy and self._running:
            self._stages.set_state(self._running, "running")
            self.progress.emit(self._running, self._progress, self._step)
            self._notice_timer.start()
        else:
            self._end_notice_timer()

    def _end_notice_timer(self) -> None:
        self._running = ""
        self.progress.emit("", 0.0, "")
        if self._engine.busy:
            # The next run has started. In a drag, the delay is counted for each run, not for all.
            self._notice_timer.start()
        else:
            self._notice_timer.stop()

    def _show_failure(self, error: BaseException, request: FrameRequest) -> None:
        self._times.waiting = False
        if request.generation != self.generation:
            return  # the request belongs to a closed scene
        if request is self._last_request:
            # Only for the latest request: a newer one still needs its fine frame.
            self.rest_timer.stop()
        self._times.pause()
        self._show_ended(getattr(error, "section", None) or self._running, "failed")
        self._end_notice_timer()
        self.failed.emit(error)
        if request.swing is not None:
            # The failure of an older run must not end a mode that has just been clicked.
            self.swing_ended.emit()

    def _show_cancelled(self) -> None:
        self._times.waiting = False
        if self._was_superseded:  # only the view had changed, so the stages are still up to date
            self._was_superseded = False
            self._stages.set_state("surface", "fresh")
            self._end_notice_timer()
            return
        self._show_ended(self._running or self._document.scene.stages[0].section, "stale")
        self._end_notice_timer()

    def _show_ended(self, section: str, state: str) -> None:
        """Show the state of a stage whose run ended early; the stages after it become stale."""
        below = False
        for stage in self._document.scene.stages:
            if stage.section == section or below:
                self._stages.set_state(stage.section, "stale" if below else state)
                below = True

    def _report_cancellation(self) -> None:
        self._end_notice_timer()
        frame, request = self._view.frame, self._last_request
        if not self._is_cancelling or request is None:
            return
        self._is_cancelling, self._was_cancelled = False, True
        if frame is None or frame.generation != request.generation:
            self.run_cancelled.emit("there is no picture of this scene yet")
        elif (frame.values, frame.time) != (request.values, request.time):
            self.run_cancelled.emit("the picture is older than the values")
        elif frame.coarse:
            self.run_cancelled.emit("the picture is coarser than the values say")


def _stage_settings(scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the settings of all connected stages."""
    return {stage.section: stage.settings for stage in scene.stages}
