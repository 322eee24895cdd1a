"""The session of a scene in a browser: user input, runs, and the state of the page."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from spacemap_vtk.app.web.parameter_rows import ParameterRows
from spacemap_vtk.app.web.screen import Screen
from spacemap_vtk.app.work.frame_request import CANCEL_AFTER, FrameRequest
from spacemap_vtk.app.work.pipeline import Pipeline
from spacemap_vtk.cancel import Cancelled, CancelToken
from spacemap_vtk.datasets.modal_model import solver_results
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.errors import InputError, SpacemapError, format_error
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import parse_value, split_assignment
from spacemap_vtk.scenes.cameras import CAMERAS
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.pipeline import section_classes, stage_title
from spacemap_vtk.scenes.presets import PRESETS, Plan, make_plan
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import describe_outside_files
from spacemap_vtk.units import format_quantity

#: Time after which a run is shown as running, in s.
_NOTICE_DELAY = 0.15
#: Time after which the camera counts as at rest, in s.
_REST_TIME = 0.25
#: Most frames per second while playing.
_MAX_RATE = 30.0
#: Longest time that playing waits until a browser fetches a picture, in s.
_FETCH_TIME = 1.0
#: Number of steps of the time slider.
TIME_STEPS = 2000


class Session:
    """One scene, shared by all open pages."""

    # Everything belongs to the thread of the server's event loop, except the running pipeline and
    # the progress that it reports.

    def __init__(
        self,
        name: str,
        assignments: Sequence[str],
        state: Any,
        preset: Callable[[Scene], Plan] | None = None,
    ) -> None:
        scene = Scene.read(name)
        self._values = library.values_of(library.find(name), str(library.find(name).name))
        for assignment in assignments:
            scene.set(assignment)  # gives the error messages of the command line
            section, key, text = split_assignment(assignment)
            self._values = _with_value(self._values, section, key, parse_value(text))
        if preset is not None:
            self._values = preset(scene).values
            for assignment in assignments:  # explicit values replace those of the preset
                section, key, text = split_assignment(assignment)
                self._values = _with_value(self._values, section, key, parse_value(text))
        self.base: Path | None = scene.file
        self._origin_warnings = list(describe_outside_files(scene))
        self.scene = Scene(self._values, self.base)
        self.state, self.screen, self.rows = state, Screen(), ParameterRows()
        self.pipeline = Pipeline(lambda *_: None, self._record_progress)
        self._thread = ThreadPoolExecutor(1, "pipeline")
        self._running: tuple[str, float, str] = "", 0.0, ""
        self._request: FrameRequest | None = None
        self._begun: tuple[float, FrameRequest] | None = None
        self._requested, self.fetched = asyncio.Event(), asyncio.Event()
        self._time, self._clock = self.scene.view.time, 0.0
        #: Where the camera goes once the next frame is shown; None: it stays.
        self._aim_at: str | None = None
        self._rest: asyncio.TimerHandle | None = None
        #: Whether the run only follows a camera move, and whether the user has cancelled the run.
        self._follows_camera = self._is_cancelled = False
        state.title, state.playing, state.picture = self.scene.title, False, 0
        state.work, state.failure, state.warnings = None, "", []
        state.presets = [
            {"name": n, "label": each.label, "help": each.help} for n, each in PRESETS.items()
        ]
        state.cameras = [{"name": n, "label": n.capitalize()} for n in CAMERAS if n != "side"]
        state.cameras += [{"name": c.name, "label": c.name} for c in self.scene.view.cameras]
        self._send_state()
        self.request_frame()

    # Requests of the page.

    def set(self, key: str, text: str) -> None:
        """Set a value that was typed or chosen."""
        if key in self.rows:
            self._set_value(key, self.rows.parse_text(key, text), text)

    def switch(self, key: str, on: bool) -> None:
        """Set a flag."""
        if key in self.rows:
            self._set_value(key, bool(on))

    def slide(self, key: str, step: int, dragging: bool) -> None:
        """Set the value of a slider, during a drag or at its end."""
        if key in self.rows:
            self._set_value(key, self.rows.value_at_step(key, int(step)), coarse=dragging)

    def reset(self, key: str) -> None:
        """Reset a value to its default."""
        if key in self.rows:
            self._set_value(key, None)

    def preset(self, name: str) -> None:
        """Let the cloth hang, drape, drop or swing."""
        if name not in PRESETS:
            return
        try:
            plan = make_plan(self.scene, name)
            self.scene, self._values = Scene(plan.values, self.base), plan.values
        except SpacemapError as error:
            self.state.failure = str(error)
            return
        self.state.failure, self.state.title = "", self.scene.title
        self._time = self.scene.view.time
        self._aim_at = self.scene.view.camera
        self.request_frame()
        self._send_state()

    def color(self, name: str) -> None:
        """Set the colouring."""
        self._set_value("view.color", name)

    def seek(self, step: int, dragging: bool) -> None:
        """Show the time at a step of the time slider."""
        span = self.scene.animation
        self._show_time(span.start + step / TIME_STEPS * (span.stop - span.start), dragging)

    def go(self, text: str) -> None:
        """Show a typed time."""
        try:
            at = self.scene.view.parameter("time").check(text)
        except InputError as error:
            self.state.failure = str(error)
        else:
            self._show_time(at, False)

    def play(self) -> None:
        """Start or pause playing."""
        self.state.playing = not self.state.playing
        self._clock = time.perf_counter()
        if self.state.playing and self._time >= self.scene.animation.stop:
            self._time = self.scene.animation.start
        self.request_frame(coarse=self.state.playing)

    def cancel(self) -> None:
        """Cancel the run and keep the last picture."""
        self._request, self.state.playing = None, False
        self._is_cancelled = self._begun is not None
        self.pipeline.token.cancel()

    def resize(self, width: float, height: float, ratio: float, dark: bool) -> None:
        """Set the size of the picture in the page."""
        self.screen.resize(width, height, ratio, dark)
        self._follow_camera()

    def aim(self, name: str | None = None) -> None:
        """Aim at the whole scene, or from a saved camera; None keeps the direction."""
        saved = {c.name: Viewpoint.from_saved(c) for c in self.scene.view.cameras}
        if name is None or name in CAMERAS or name in saved:
            self.screen.aim(saved.get(name or "", name))
            self._follow_camera()

    def steer(self, moves: Sequence[tuple[str, float, float]]) -> None:
        """Move the camera."""
        for kind, x, y in moves:
            self.screen.steer(kind, float(x), float(y))
        self._follow_camera()

    # Work for these requests.

    def request_frame(self, coarse: bool = False) -> None:
        """Request a frame of the present scene; this replaces a waiting request."""
        values = self._values
        self._request = FrameRequest(
            values=values,
            base=self.base or Path("scene.toml"),
            settings=self.scene.settings,
            generation=0,
            time=self._time,
            coarse=coarse,
            camera_view=self.screen.camera_view,
        )
        if self._begun is not None:
            begun, request = self._begun
            # A run for another time of the same scene continues: the new request needs its results.
            late = time.perf_counter() - begun > CANCEL_AFTER and request.values != values
            if late or self._follows_camera:
                self.pipeline.token.cancel()
        self._follows_camera = False
        self._requested.set()

    async def run(self) -> None:
        """Process requests one after another, always the latest."""
        while True:
            await self._requested.wait()
            self._requested.clear()
            request, self._request = self._request, None
            if request is None:
                continue
            await self._run_request(request)
            if self.state.playing and self._request is None:
                await self._advance_time()

    def close(self) -> None:
        """Cancel the run and free all resources."""
        self._request = None
        self.pipeline.token.cancel()
        self._thread.shutdown()
        self.screen.close()

    async def _run_request(self, request: FrameRequest) -> None:
        # The token is made here, not when the run starts, so that no cancellation is lost.
        self.pipeline.token = CancelToken()
        self._begun, self._running = (time.perf_counter(), request), ("", 0.0, "")
        self._is_cancelled = False
        loop = asyncio.get_running_loop()
        run = loop.run_in_executor(self._thread, self.pipeline.run, request)
        while not (await asyncio.wait([run], timeout=_NOTICE_DELAY))[0]:
            section, share, step = self._running
            if section:
                stage = stage_title(section_classes()[section].__name__)
                with self.state:
                    self.state.work = {"stage": stage, "share": share, "step": step}
        self._begun, self._follows_camera = None, False
        with self.state:
            self.state.work = None
            try:
                frame = run.result()
                self.screen.show_frame(frame, self.scene.view)
                if self._aim_at is not None:
                    self.screen.aim(self._aim_at)
                    self._aim_at = None
            except Cancelled:
                if self._is_cancelled:
                    old = "" if self.screen.frame is None else "; the picture shows former values"
                    self.state.failure = f"The run was cancelled{old}. Any change starts a new run."
            except Exception as error:
                self.state.playing = False
                self._show_error(error)
            else:
                self.state.failure = ""
                self.rows.clear_refused()
                self.rows.found = {"modal": solver_results(frame.cage)}
                self.state.warnings = [*self._origin_warnings, *frame.warnings]
                self._send_picture()
            if request.coarse and not self.state.failure:
                self._send_time()
            else:
                self._send_state()
        if not (request.coarse or self.state.playing or self.state.failure):
            self._end_camera_move()

    async def _advance_time(self) -> None:
        """Advance to the present time of playing, after the last picture has been fetched."""
        with contextlib.suppress(TimeoutError):  # no page is open
            await asyncio.wait_for(self.fetched.wait(), _FETCH_TIME)
        await asyncio.sleep(max(0.0, self._clock + 1 / _MAX_RATE - time.perf_counter()))
        if not self.state.playing or self._request is not None:
            return
        now, span = time.perf_counter(), self.scene.animation
        at, self._clock = self._time + (now - self._clock) * span.speed, now
        if at > span.stop:
            start, stop = span.span
            at = start + (at - start) % (stop - start)
        self._time = at
        self.request_frame(coarse=True)

    def _show_time(self, at: float, dragging: bool) -> None:
        self._time = at
        self.state.failure = ""
        self.request_frame(coarse=dragging)
        self._send_time()

    def _set_value(
        self, key: str, written: Any, text: str | None = None, coarse: bool = False
    ) -> None:
        section, _, name = key.partition(".")
        values = _with_value(self._values, section, name, written)
        try:
            scene = Scene(values, self.base)
            if scene.view.color not in scene.colorings:
                # The quantity shown by colour has just gone; a run would fail until it is reset.
                values = _with_value(values, "view", "color", None)
                scene = Scene(values, self.base)
        except InputError as error:
            self.rows.mark_refused(error, key, text)
        else:
            self._values, self.scene = values, scene
            self.rows.clear_refused(key)
            self.state.failure = ""
            self.request_frame(coarse=coarse)
        self._send_state(coarse)

    def _show_error(self, error: Exception) -> None:
        text = format_error(error)
        if isinstance(error, SpacemapError):
            error.file = None
            self.rows.mark_refused(error)
            text = str(error)
        self.state.failure = text

    def _follow_camera(self) -> None:
        """Show the picture from the new viewpoint, and refine it when the camera rests."""
        self._send_picture()
        if self._follows_camera:  # the run is for a former viewpoint
            self._follows_camera = False
            self.pipeline.token.cancel()
        if self._rest is not None:
            self._rest.cancel()
        self._rest = asyncio.get_running_loop().call_later(_REST_TIME, self._end_camera_move)

    def _end_camera_move(self) -> None:
        frame = self.screen.frame
        with self.state:
            self.screen.set_steering(False)
            self._send_picture()
        if frame is None or self.state.playing or self._request is not None or self._begun:
            return
        if frame.cloth is not None and frame.camera_view != self.screen.camera_view:
            self.request_frame()
            self._follows_camera = True

    def _send_picture(self) -> None:
        if self.screen.frame is not None and self.state.picture != self.screen.version:
            self.fetched.clear()
            self.state.picture = self.screen.version

    def _send_state(self, dragging: bool = False) -> None:
        """Send the state of the scene to the page."""
        scene = self.scene
        self.state.sections = self.rows.make_sections(scene, self._values, dragging)
        self.state.color = scene.view.color
        self.state.colorings = [
            {"name": name, "label": COLORINGS[name].label} for name in scene.colorings
        ]
        self.state.moves = scene.moves
        self._send_time()

    def _send_time(self) -> None:
        span = self.scene.animation
        start, stop = span.span
        share = (self._time - start) / (stop - start)
        self.state.step = round(min(max(share, 0.0), 1.0) * TIME_STEPS)
        self.state.time = _seconds(self._time)
        self.state.stop = _seconds(span.stop)

    def _record_progress(self, section: str, share: float, step: str) -> None:
        self._running = section, share, step


def _with_value(values: dict[str, Any], section: str, key: str, written: Any) -> dict[str, Any]:
    """Return a scene's values with one value replaced, or removed by None."""
    table = {k: v for k, v in values.get(section, {}).items() if k != key}
    if written is not None:
        table[key] = written
    return {**values, section: table}


def _seconds(at: float) -> str:
    return format_quantity(at, "s", 3) if at else "0 s"
