"""The session of a scene in a browser: user input, runs, and the state of the page."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import io
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from PIL import Image

from spacemap_vtk.app.web.history import History, Opened, Version
from spacemap_vtk.app.web.parameter_rows import ParameterRows
from spacemap_vtk.app.web.screen import Screen
from spacemap_vtk.app.web.uploads import Uploads
from spacemap_vtk.app.work.frame_request import CANCEL_AFTER, FrameRequest
from spacemap_vtk.app.work.pipeline import Pipeline
from spacemap_vtk.cancel import Cancelled, CancelToken
from spacemap_vtk.datasets.modal_model import solver_results
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.errors import InputError, SpacemapError, format_error
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import parse_value, split_assignment
from spacemap_vtk.scenes.cameras import CAMERAS
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.pattern_choices import (
    PATTERNS,
    draft_names,
    picture_of_draft,
    picture_of_pattern,
    title_of_pattern,
)
from spacemap_vtk.scenes.pipeline import section_classes, stage_title
from spacemap_vtk.scenes.presets import PRESETS, Plan, make_plan, split_title
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

T = TypeVar("T")


class _Task(NamedTuple):
    """Work that makes the next scene: opening a file, or a preset."""

    name: str
    """What it does, in words."""
    make: Callable[[], Version]
    """Make the scene, in the pipeline's thread."""
    folder: Path | None = None
    """Folder of a file that was sent; messages do not name it."""


class Session:
    """One scene at a time, shared by all open pages."""

    # Everything belongs to the thread of the server's event loop, except the running pipeline and
    # the progress that it reports.

    def __init__(
        self,
        name: str,
        assignments: Sequence[str],
        state: Any,
        preset: Callable[[Scene], Plan] | None = None,
    ) -> None:
        #: Number of the scene that was opened or made last.
        self._number = 0
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
        self.scene = Scene(self._values, scene.file)
        opened = _describe_opened(scene, self._values, 0)
        #: The scene that was opened or made last.
        self._opened = opened._replace(title=self.scene.title)
        self.history = History(Version(self._values, self._opened))
        self.state, self.screen, self.rows = state, Screen(), ParameterRows()
        self.pipeline = Pipeline(lambda *_: None, self._record_progress)
        self._thread = ThreadPoolExecutor(1, "pipeline")
        self.uploads = Uploads()
        self._running: tuple[str, float, str] = "", 0.0, ""
        self._request: FrameRequest | None = None
        self._begun: tuple[float, FrameRequest] | None = None
        #: Work for the next scene, waiting and running.
        self._task: _Task | None = None
        self._current_task: _Task | None = None
        #: Whether that work has interrupted a run, and a message that the next picture leaves.
        self._has_interrupted, self._message = False, ""
        #: Whether the pipeline's thread works.
        self._is_busy = False
        #: Pictures to save: the size, and the file as soon as it exists.
        self._saves: list[tuple[tuple[int, int] | None, asyncio.Future[bytes]]] = []
        self._requested, self.fetched = asyncio.Event(), asyncio.Event()
        self._time, self._clock = self.scene.view.time, 0.0
        #: Whether the next frame is of another scene, at which the camera is aimed, and whether
        #: cancelling its run leads back to the scene before.
        self._is_new = self._can_go_back = False
        self._rest: asyncio.TimerHandle | None = None
        #: Whether the run only follows a camera move, and whether the user has cancelled the run.
        self._follows_camera = self._is_cancelled = False
        state.playing, state.picture = False, 0
        state.work, state.failure, state.warnings = None, "", []
        state.presets = [
            {"name": n, "label": each.label, "help": each.help} for n, each in PRESETS.items()
        ]
        state.scenes, state.patterns = _list_scenes(), _list_patterns()
        self._send_scene()
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

    def pattern(self, name: str) -> None:
        """Weave a pattern, or one of the drafts that come with the program."""
        if name in PATTERNS:
            self._set_value("weave.pattern", name)
        elif name in draft_names() and "weave.pattern" in self.rows:
            self._set_values("weave", {"draft": str(library.find(name))})

    def undo(self) -> None:
        """Undo the last change."""
        self._restore(self.history.undo, self.history.redo)

    def redo(self) -> None:
        """Do again what was undone last."""
        self._restore(self.history.redo, self.history.undo)

    def open(self, name: str) -> None:
        """Open one of the scenes that come with the program."""
        if name in library.names():
            self._start_task(f"Open {name}", lambda: self._read(library.find(name), name))

    def open_file(self, file: Path) -> None:
        """Open a draft or a machine knitting file that the user has sent."""
        self._start_task(f"Open {file.name}", lambda: self._read(file, file.name), file.parent)

    def preset(self, name: str) -> None:
        """Let the cloth hang, drape, drop or swing."""
        if name not in PRESETS:
            return
        values, opened = self._values, self._opened

        def make() -> Version:
            # A scene of its own, because the page uses `self.scene` meanwhile.
            plan = make_plan(Scene(values, opened.base), name)
            made = Scene(plan.values, opened.base)
            # The same number as before: what is known of the textile need not be computed again.
            described = _describe_opened(made, plan.values, opened.number)
            warnings = *described.warnings, *(note.for_window for note in plan.notes)
            return Version(plan.values, described._replace(warnings=warnings))

        self._start_task(PRESETS[name].label, make)

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
            self.state.failure = error.text_for_window
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
        self._request, self._task, self.state.playing = None, None, False
        self._is_cancelled = self._is_busy
        if self.state.work is not None:
            self.state.work = {**self.state.work, "step": "cancelling…"}
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
            base=self._opened.base or Path("scene.toml"),
            settings=self.scene.settings,
            generation=self._opened.number,
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

    async def save_picture(self, size: tuple[int, int] | None = None) -> bytes:
        """Draw the present view as PNG, by default in the size of the picture on the page."""
        done: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._saves.append((size, done))
        self._requested.set()
        return await done

    async def run(self) -> None:
        """Process requests one after another, always the latest."""
        while True:
            await self._requested.wait()
            self._requested.clear()
            if self._task is not None:
                await self._run_task()
            request, self._request = self._request, None
            if request is not None:
                await self._run_request(request)
            while self._saves and self._request is None and self._task is None:
                await self._draw_file(*self._saves.pop(0))
            if request is None:
                continue
            if self.state.playing and self._request is None:
                await self._advance_time()

    def close(self) -> None:
        """Cancel the run and free all resources."""
        self._request = None
        self.pipeline.token.cancel()
        self._thread.shutdown()
        self.screen.close()
        self.uploads.close()

    async def _run_request(self, request: FrameRequest) -> None:
        self._begun = time.perf_counter(), request
        work = await self._compute("", lambda: self.pipeline.run(request))
        self._begun, self._follows_camera = None, False
        with self.state:
            self.state.work = None
            try:
                frame = work.result()
                self.screen.show_frame(frame, self.scene.view, self._is_new)
                self._is_new = self._can_go_back = False
            except Cancelled:
                self._show_cancellation()
            except Exception as error:
                self.state.playing = False
                self._show_error(error)
                if self._is_new and self.screen.frame is not None:
                    self.state.failure = (
                        f"{self.state.failure.rstrip('.')}. The picture shows the former scene."
                    )
                    self.state.warnings = [*self._opened.warnings]
            else:
                self.state.failure, self._message = self._message, ""
                self.rows.clear_refused()
                self.rows.found = {"modal": solver_results(frame.cage)}
                self.state.warnings = [*self._opened.warnings, *frame.warnings]
                self._send_picture()
            if request.coarse and not self.state.failure:
                self._send_time()
            else:
                self._send_state()
        if not (request.coarse or self.state.playing or self.state.failure):
            self._end_camera_move()

    async def _run_task(self) -> None:
        """Make the next scene, and show it unless it was cancelled or something else changed."""
        task, self._task = self._task, None
        assert task is not None
        self._current_task = task
        work = await self._compute(task.name, task.make)
        with self.state:
            self.state.work, was_replaced = None, self._current_task is None
            self._current_task = None
            try:
                version = work.result()
                if self._is_cancelled:  # too late for the work to notice
                    raise Cancelled("the run was cancelled")
                if not was_replaced:
                    self.history.add(version, task.name)
                    self._show_version(version)
                    self._can_go_back = True
                return
            except Cancelled:
                self._show_cancellation()
            except Exception as error:
                text = format_error(error)
                if isinstance(error, SpacemapError):
                    text = error.text_for_window
                if task.folder is not None:
                    text = text.replace(f"{task.folder}{os.sep}", "")
                self.state.failure = text
            if self._has_interrupted and self._request is None:
                self._message = self.state.failure
                self.request_frame()

    async def _draw_file(self, size: tuple[int, int] | None, done: asyncio.Future[bytes]) -> None:
        """Compute the frame for a picture of another size, and draw it."""
        shown = self.screen.camera_view
        if shown is None:
            done.set_exception(InputError("there is no picture yet"))
            return
        request = FrameRequest(
            values=self._values,
            base=self._opened.base or Path("scene.toml"),
            settings=self.scene.settings,
            generation=self._opened.number,
            time=self._time,
            camera_view=shown._replace(size=size or shown.size),
        )
        view = self.scene.view
        work = await self._compute("", lambda: self.pipeline.run(request))
        with self.state:
            self.state.work = {"stage": "Save picture", "share": 0.0, "step": ""}
        await asyncio.sleep(0)  # the page shows this while the picture is drawn
        with self.state:
            self.state.work = None
            try:
                file = self.screen.draw_file(work.result(), view, size)
            except Exception as error:
                self._show_error(error)
                if not done.done():
                    done.set_exception(error)
            else:
                if not done.done():
                    done.set_result(file)
        self._end_camera_move()

    async def _compute(self, name: str, work: Callable[[], T]) -> asyncio.Future[T]:
        """Run work in the pipeline's thread, and return its future when it is done.

        If it takes long, the page shows what runs, and how far.
        """
        # The token is made here, not when the run starts, so that no cancellation is lost.
        token = CancelToken()
        self.pipeline.token = token
        self._running, self._is_cancelled, self._is_busy = ("", 0.0, ""), False, True

        def run_with_token() -> T:
            with token.active():
                return work()

        run = asyncio.get_running_loop().run_in_executor(self._thread, run_with_token)
        while not (await asyncio.wait([run], timeout=_NOTICE_DELAY))[0]:
            section, share, step = self._running
            stage = stage_title(section_classes()[section].__name__) if section else name
            if stage:
                step = "cancelling…" if token.cancelled else step
                with self.state:
                    self.state.work = {"stage": stage, "share": share, "step": step}
        self._is_busy = False
        return run

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
        # A draft would replace the pattern.
        others = {"draft": None} if key == "weave.pattern" else {}
        self._set_values(section, {name: written, **others}, text, coarse)

    def _set_values(
        self,
        section: str,
        written: Mapping[str, Any],
        text: str | None = None,
        coarse: bool = False,
    ) -> None:
        values, name = self._values, next(iter(written))
        for key, value in written.items():
            values = _with_value(values, section, key, value)
        key = f"{section}.{name}"
        try:
            values = {**values, "title": _title_of(values, self._opened)}
            scene = Scene(values, self._opened.base)
            if scene.view.color not in scene.colorings:
                # The quantity shown by colour has just gone; a run would fail until it is reset.
                values = _with_value(values, "view", "color", None)
                scene = Scene(values, self._opened.base)
        except InputError as error:
            self.rows.mark_refused(error, key, text)
        else:
            self._drop_task()
            label = scene.parts[section].parameter(name).label
            stage = stage_title(type(scene.parts[section]).__name__)
            self.history.add(Version(values, self._opened), f"{stage}: {label}", coarse)
            self._values, self.scene = values, scene
            self.rows.clear_refused(key)
            self.state.failure = ""
            self.request_frame(coarse=coarse)
            self._send_title()
        self._send_state(coarse)

    def _restore(self, go: Callable[[], None], back: Callable[[], None]) -> None:
        """Show another version of the history, or go back if it cannot be shown."""
        before = self.history.version
        go()
        if self.history.version is before:
            return
        self._drop_task()
        try:
            self._show_version(self.history.version)
        except SpacemapError as error:  # a file that it names does not exist any more
            back()
            self._show_error(error)

    def _show_version(self, version: Version) -> None:
        """Show a version of this scene, or another scene."""
        scene = Scene(version.values, version.opened.base)
        is_other = version.opened != self._opened
        self._values, self._opened, self.scene = version.values, version.opened, scene
        self.state.failure, self._can_go_back = "", False
        self.rows.clear_all()
        if is_other:
            self.state.playing, self.rows = False, ParameterRows()
            self._time = scene.view.time
            self._is_new = True
            self._send_scene()
        self._send_title()
        self.request_frame()
        self._send_state()

    def _start_task(
        self, name: str, make: Callable[[], Version], folder: Path | None = None
    ) -> None:
        """Let the pipeline's thread make the next scene; this replaces waiting work and runs."""
        self._drop_task()
        self._has_interrupted = self._begun is not None or self._request is not None
        self._task, self._request = _Task(name, make, folder), None
        self.state.playing, self.state.failure = False, ""
        self.pipeline.token.cancel()
        self._requested.set()

    def _drop_task(self) -> None:
        """Stop making another scene, because a newer change replaces it."""
        self._task = None
        if self._current_task is not None:
            self._current_task = None
            self.pipeline.token.cancel()

    def _read(self, file: Path, name: str) -> Version:
        """Read a scene; called in the pipeline's thread."""
        scene, values = Scene.read(file), library.values_of(file, name)
        return Version(values, _describe_opened(scene, values, self._next_number()))

    def _next_number(self) -> int:
        self._number += 1
        return self._number

    def _show_cancellation(self) -> None:
        if self._is_cancelled and self._can_go_back:
            self._restore(self.history.undo, self.history.redo)
            self._message = self.state.failure = "The run was cancelled."
        elif self._is_cancelled:
            old = "" if self.screen.frame is None else "; the picture shows former values"
            self.state.failure = f"The run was cancelled{old}. Any change starts a new run."

    def _show_error(self, error: Exception) -> None:
        text = format_error(error)
        if isinstance(error, SpacemapError):
            error.file = None
            self.rows.mark_refused(error)
            text = error.text_for_window
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
        if frame is None or self.state.playing or self._request is not None or self._is_busy:
            return
        if frame.cloth is not None and frame.camera_view != self.screen.camera_view:
            self.request_frame()
            self._follows_camera = True

    def _send_picture(self) -> None:
        if self.screen.frame is not None and self.state.picture != self.screen.version:
            self.fetched.clear()
            self.state.picture = self.screen.version

    def _send_title(self) -> None:
        self.state.title = self.scene.title
        self.state.trame__title = f"{self.scene.title} – spacemap"

    def _send_scene(self) -> None:
        """Send to the page what changes only with the scene itself."""
        names = [n for n in CAMERAS if n != "side"]
        self.state.cameras = [{"name": n, "label": n.capitalize()} for n in names]
        self.state.cameras += [{"name": c.name, "label": c.name} for c in self.scene.view.cameras]
        self._send_title()

    def _send_state(self, dragging: bool = False) -> None:
        """Send the state of the scene to the page."""
        scene = self.scene
        self.state.sections = self.rows.make_sections(scene, self._values, dragging)
        self.state.color = scene.view.color
        self.state.colorings = [
            {"name": name, "label": COLORINGS[name].label} for name in scene.colorings
        ]
        self.state.moves = scene.is_animated
        self.state.undo, self.state.redo = self.history.undo_name, self.history.redo_name
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


def _describe_opened(scene: Scene, values: Mapping[str, Any], number: int) -> Opened:
    """Describe a scene that was opened or made."""
    warnings = *describe_outside_files(scene), *scene.warnings
    return Opened(number, scene.file, scene.title, _pattern_of(values), warnings)


def _pattern_of(values: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return pattern and draft of a scene's weave."""
    weave = values.get("weave", {})
    return weave.get("pattern", "plain"), weave.get("draft")


def _title_of(values: Mapping[str, Any], opened: Opened) -> str:
    """Return the title of a changed scene, which follows the pattern."""
    pattern = _pattern_of(values)
    if pattern == opened.pattern:
        return opened.title
    return title_of_pattern(*pattern) + split_title(opened.title)[1]


def _list_scenes() -> list[dict[str, Any]]:
    """List the groups of the gallery for the page."""
    return [
        {
            "group": group,
            "scenes": [
                {"name": entry.name, "title": entry.title, "words": entry.words}
                for entry in entries
            ],
        }
        for group, entries in groupby(thumbnails.entries(), lambda entry: entry.group)
    ]


def _list_patterns() -> list[dict[str, str]]:
    """List the patterns and drafts that the page offers, with their pictures."""
    pictures = {name: picture_of_pattern(name) for name in PATTERNS}
    pictures |= {name: picture_of_draft(name) for name in draft_names()}
    found = []
    for name, pixels in pictures.items():
        file = io.BytesIO()
        Image.fromarray(pixels).save(file, "PNG")
        picture = f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"
        title = title_of_pattern(name, None if name in PATTERNS else name)
        found.append({"name": name, "title": title, "picture": picture})
    return found


def _seconds(at: float) -> str:
    return format_quantity(at, "s", 3) if at else "0 s"
