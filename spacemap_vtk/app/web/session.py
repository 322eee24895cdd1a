"""A scene that is shown in a browser: what is wished for, what runs for it, and what is told."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from spacemap_vtk.app.web.rows import ParameterRows
from spacemap_vtk.app.web.screen import Screen
from spacemap_vtk.app.work.job import PATIENCE, Job
from spacemap_vtk.app.work.pipeline import Pipeline
from spacemap_vtk.cancel import Cancelled, CancelToken
from spacemap_vtk.datasets.modal_model import measures_in
from spacemap_vtk.errors import InputError, SpacemapError, one_line
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import parsed, value_of
from spacemap_vtk.scenes.chain import sections, words_of
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.origin import elsewhere
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import CAMERAS
from spacemap_vtk.units import format_quantity

#: Seconds after which a run is shown as one, and after which a camera is at rest.
_NOTICE, _REST = 0.15, 0.25
#: Frames a second at most, and seconds that playing waits for a browser to fetch a picture.
_RATE, _FETCH = 30.0, 1.0
#: Steps of the time's slider.
TIME_STEPS = 2000


class Session:
    """One scene, as all the pages that are open see it."""

    # Everything here belongs to the thread of the server's loop, but for the pipeline while it
    # runs, and the two things that it tells meanwhile.

    def __init__(self, name: str, assignments: Sequence[str], state: Any) -> None:
        scene = Scene.read(name)
        self._values = library.values_of(library.find(name), str(library.find(name).name))
        for assignment in assignments:
            scene.set(assignment)  # its messages are those of the command line
            section, key, text = parsed(assignment)
            self._values = _put(self._values, section, key, value_of(text))
        self.base: Path | None = scene.file
        self._elsewhere = list(elsewhere(scene))
        self.scene = Scene(self._values, self.base)
        self.state, self.screen, self.rows = state, Screen(), ParameterRows()
        self.pipeline = Pipeline(lambda *_: None, self._progressed)
        self._thread = ThreadPoolExecutor(1, "pipeline")
        self._running: tuple[str, float, str] = "", 0.0, ""
        self._job: Job | None = None
        self._begun: tuple[float, Job] | None = None
        self._wished, self.fetched = asyncio.Event(), asyncio.Event()
        self._time, self._clock = self.scene.view.time, 0.0
        self._rest: asyncio.TimerHandle | None = None
        #: Whether what runs is but what is in view, and whether the user has ended it.
        self._looking = self._given_up = False
        state.title, state.playing, state.picture = self.scene.title, False, 0
        state.work, state.failure, state.warnings = None, "", []
        state.cameras = [{"name": n, "label": n.capitalize()} for n in CAMERAS if n != "side"]
        self._tell()
        self.ask()

    # What the page asks for.

    def set(self, key: str, text: str) -> None:
        """Take what was typed or chosen."""
        if key in self.rows:
            self._change(key, self.rows.written(key, text), text)

    def switch(self, key: str, on: bool) -> None:
        """Take what was ticked."""
        if key in self.rows:
            self._change(key, bool(on))

    def slide(self, key: str, step: int, held: bool) -> None:
        """Take a slider's place, while it is dragged or at the end of that."""
        if key in self.rows:
            self._change(key, self.rows.slid(key, int(step)), coarse=held)

    def reset(self, key: str) -> None:
        """Take the default again."""
        if key in self.rows:
            self._change(key, None)

    def color(self, name: str) -> None:
        """Let the colours mean something else."""
        self._change("view.color", name)

    def seek(self, step: int, held: bool) -> None:
        """Show another time, of the slider's."""
        span = self.scene.animation
        self._go(span.start + step / TIME_STEPS * (span.stop - span.start), held)

    def go(self, text: str) -> None:
        """Show another time, as it was typed."""
        try:
            at = self.scene.view.parameter("time").check(text)
        except InputError as error:
            self.state.failure = str(error)
        else:
            self._go(at, False)

    def play(self) -> None:
        """Let time go on, or stand still."""
        self.state.playing = not self.state.playing
        self._clock = time.perf_counter()
        if self.state.playing and self._time >= self.scene.animation.stop:
            self._time = self.scene.animation.start
        self.ask(coarse=self.state.playing)

    def cancel(self) -> None:
        """Give up what runs; the last picture stays."""
        self._job, self.state.playing = None, False
        self._given_up = self._begun is not None
        self.pipeline.token.cancel()

    def resize(self, width: float, height: float, ratio: float, dark: bool) -> None:
        """Draw in the size that a page has for the picture."""
        self.screen.resize(width, height, ratio, dark)
        self._look()

    def aim(self, name: str | None = None) -> None:
        """Look at the whole, from one of `CAMERAS` or from where it is seen now."""
        if name is None or name in CAMERAS:
            self.screen.aim(name)
            self._look()

    def steer(self, moves: Sequence[tuple[str, float, float]]) -> None:
        """Move the camera."""
        for kind, x, y in moves:
            self.screen.steer(kind, float(x), float(y))
        self._look()

    # What becomes of it.

    def ask(self, coarse: bool = False) -> None:
        """Ask for a frame of the scene as it is now; what waits is replaced."""
        values = self._values
        self._job = Job(
            values=values,
            base=self.base or Path("scene.toml"),
            settings=self.scene.settings,
            generation=0,
            time=self._time,
            coarse=coarse,
            seen=self.screen.seen,
        )
        if self._begun is not None:
            begun, job = self._begun
            # For another time of the same scene the run goes on: all it prepares is needed.
            late = time.perf_counter() - begun > PATIENCE and job.values != values
            if late or self._looking:
                self.pipeline.token.cancel()
        self._looking = False
        self._wished.set()

    async def run(self) -> None:
        """Do one job after the other, always the last that was asked for."""
        while True:
            await self._wished.wait()
            self._wished.clear()
            job, self._job = self._job, None
            if job is None:
                continue
            await self._perform(job)
            if self.state.playing and self._job is None:
                await self._step()

    def close(self) -> None:
        """End what runs, and free what was taken."""
        self._job = None
        self.pipeline.token.cancel()
        self._thread.shutdown()
        self.screen.close()

    async def _perform(self, job: Job) -> None:
        # Cancelled in this thread, too: a cancel holds for the job that is taken, from here on.
        self.pipeline.token = CancelToken()
        self._begun, self._running = (time.perf_counter(), job), ("", 0.0, "")
        self._given_up = False
        loop = asyncio.get_running_loop()
        run = loop.run_in_executor(self._thread, self.pipeline.run, job)
        while not (await asyncio.wait([run], timeout=_NOTICE))[0]:
            section, share, step = self._running
            if section:
                stage = words_of(sections()[section].__name__)
                with self.state:
                    self.state.work = {"stage": stage, "share": share, "step": step}
        self._begun, self._looking = None, False
        with self.state:
            self.state.work = None
            try:
                frame = run.result()
                self.screen.show(frame, self.scene.view)
            except Cancelled:
                if self._given_up:
                    before = "" if self.screen.frame is None else "the picture is from before. "
                    self.state.failure = f"Stopped: {before}Any change begins anew."
            except Exception as error:
                self.state.playing = False
                self._refuse(error)
            else:
                self.state.failure = ""
                self.rows.accept()
                self.rows.found = {"modal": measures_in(frame.cage)}
                self.state.warnings = [*self._elsewhere, *frame.warnings]
                self._push()
            if job.coarse and not self.state.failure:
                self._tell_time()
            else:
                self._tell()
        if not (job.coarse or self.state.playing or self.state.failure):
            self._come_to_rest()

    async def _step(self) -> None:
        """Go on to the time that it is now, once the last picture has been fetched."""
        with contextlib.suppress(TimeoutError):  # nobody looks
            await asyncio.wait_for(self.fetched.wait(), _FETCH)
        await asyncio.sleep(max(0.0, self._clock + 1 / _RATE - time.perf_counter()))
        if not self.state.playing or self._job is not None:
            return
        now, span = time.perf_counter(), self.scene.animation
        at, self._clock = self._time + (now - self._clock) * span.speed, now
        if at > span.stop:
            start, stop = span.span
            at = start + (at - start) % (stop - start)
        self._time = at
        self.ask(coarse=True)

    def _go(self, at: float, held: bool) -> None:
        self._time = at
        self.state.failure = ""
        self.ask(coarse=held)
        self._tell_time()

    def _change(
        self, key: str, written: Any, text: str | None = None, coarse: bool = False
    ) -> None:
        section, _, name = key.partition(".")
        values = _put(self._values, section, name, written)
        try:
            scene = Scene(values, self.base)
            if scene.view.color not in scene.colorings:
                # What it showed has just gone: a run would be refused until it is reset.
                values = _put(values, "view", "color", None)
                scene = Scene(values, self.base)
        except InputError as error:
            self.rows.refuse(error, key, text)
        else:
            self._values, self.scene = values, scene
            self.rows.accept(key)
            self.state.failure = ""
            self.ask(coarse=coarse)
        self._tell(coarse)

    def _refuse(self, error: Exception) -> None:
        told = one_line(error)
        if isinstance(error, SpacemapError):
            error.file = None
            self.rows.refuse(error)
            told = str(error)
        self.state.failure = told

    def _look(self) -> None:
        """Show what is looked at now, and all of it once the camera rests."""
        self._push()
        if self._looking:  # at what is in view no more
            self._looking = False
            self.pipeline.token.cancel()
        if self._rest is not None:
            self._rest.cancel()
        self._rest = asyncio.get_running_loop().call_later(_REST, self._come_to_rest)

    def _come_to_rest(self) -> None:
        frame = self.screen.frame
        with self.state:
            self.screen.hold(False)
            self._push()
        if frame is None or self.state.playing or self._job is not None or self._begun:
            return
        if frame.cloth is not None and frame.seen != self.screen.seen:
            self.ask()
            self._looking = True

    def _push(self) -> None:
        if self.screen.frame is not None and self.state.picture != self.screen.version:
            self.fetched.clear()
            self.state.picture = self.screen.version

    def _tell(self, held: bool = False) -> None:
        """Tell the page what the scene is now."""
        scene = self.scene
        self.state.sections = self.rows.of(scene, self._values, held)
        self.state.color = scene.view.color
        self.state.colorings = [
            {"name": name, "label": COLORINGS[name].label} for name in scene.colorings
        ]
        self.state.moves = scene.moves
        self._tell_time()

    def _tell_time(self) -> None:
        span = self.scene.animation
        start, stop = span.span
        share = (self._time - start) / (stop - start)
        self.state.step = round(min(max(share, 0.0), 1.0) * TIME_STEPS)
        self.state.time = _seconds(self._time)
        self.state.stop = _seconds(span.stop)

    def _progressed(self, section: str, share: float, step: str) -> None:
        self._running = section, share, step


def _put(values: dict[str, Any], section: str, key: str, written: Any) -> dict[str, Any]:
    """Return a scene's values with another one; None: without it."""
    table = {k: v for k, v in values.get(section, {}).items() if k != key}
    if written is not None:
        table[key] = written
    return {**values, section: table}


def _seconds(at: float) -> str:
    return format_quantity(at, "s", 3) if at else "0 s"
