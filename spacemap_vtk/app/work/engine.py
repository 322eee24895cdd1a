"""The engine: a thread that runs the pipeline, always for the latest request."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Generator
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from spacemap_vtk.app.work.frame_request import CANCEL_AFTER, FrameRequest
from spacemap_vtk.app.work.pipeline import Pipeline
from spacemap_vtk.cancel import Cancelled, CancelToken
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.scenes.scene import Scene

#: A run shorter than this, in s, is assumed to belong to a drag.
_SHORT_RUN = 0.1
#: Time between two progress reports of background work, in s.
_REPORT_INTERVAL = 0.1


class Engine(QThread):
    """A thread that turns requests into frames; a new request replaces one that waits."""

    #: A frame is ready; `take_frame` returns it.
    ready = Signal()
    #: Section, seconds, executions.
    stage_ran = Signal(str, float, int)
    #: Section, progress from 0 to 1, and name of the current step or ""; first (section, 0, "").
    progressed = Signal(str, float, str)
    #: The exception, whose `section` names the stage, and the request.
    failed = Signal(object, object)
    cancelled = Signal()
    #: No request is left.
    idle = Signal()
    #: Progress of the background work from `start_background`, 0 to 1; emitted at intervals.
    background_progressed = Signal(float)
    #: Result of the background work from `start_background`, or its exception.
    background_ready = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._condition = threading.Condition()
        self._request: FrameRequest | None = None
        self.waiting_frame: Frame | None = None
        self.ending = False
        self._started_at: float | None = None
        self._running_values: dict[str, Any] = {}
        self.background: Generator[float | None, None, Any] | None = None
        #: Background work that was cancelled or replaced, and has to be closed in this thread.
        self._dropped: list[Generator[float | None, None, Any]] = []
        self._reported = 0.0
        # A weak reference: the pipeline must not keep the engine alive, which owns it.
        me = weakref.proxy(self)
        self.pipeline = Pipeline(
            lambda section, seconds, runs: me.stage_ran.emit(section, seconds, runs),
            lambda section, share, step: me.progressed.emit(section, share, step),
        )

    def request(self, request: FrameRequest) -> None:
        """Request a frame; this replaces a request that has not started."""
        with self._condition:
            self._request = request
            # A run for another time of the same scene continues: the new request needs its results.
            late = (
                self._started_at is not None
                and time.perf_counter() - self._started_at > CANCEL_AFTER
                and self._running_values != request.values
            )
            self._condition.notify()
            if late:
                self.pipeline.token.cancel()

    def start_background(
        self, work: Callable[[Scene], Generator[float | None, None, Any]] | None
    ) -> None:
        """Request background work, done while no request waits; None cancels the present work."""
        # The work yields its progress from 0 to 1, or None if its progress is unknown.
        with self._condition:
            scene = self.pipeline.scene
            self._drop_background()
            self.background = None if work is None or scene is None else work(scene)
            self._condition.notify()

    def take_frame(self) -> Frame | None:
        """Return the latest frame, or None if it was already taken."""
        with self._condition:
            frame, self.waiting_frame = self.waiting_frame, None
        return frame

    @property
    def busy(self) -> bool:
        """Whether a request is waiting or running."""
        return self._request is not None or self._started_at is not None

    @property
    def congested(self) -> bool:
        """Whether a request waits for a run that will end soon; newer changes can then wait too."""
        with self._condition:
            begun = self._started_at
            return (
                self._request is not None
                and begun is not None
                and time.perf_counter() - begun < _SHORT_RUN
            )

    def cancel(self) -> None:
        """Cancel the waiting and the running request."""
        with self._condition:
            self._request = None
            self.pipeline.token.cancel()

    def finish(self) -> None:
        """Stop, and wait until the thread has ended."""
        with self._condition:
            self.ending = True
            self._request = None
            self._drop_background()
            self._condition.notify()
            self.pipeline.token.cancel()
        self.wait()
        self.waiting_frame = None

    def run(self) -> None:
        """Process requests one after another; this is the thread's main function."""
        while True:
            with self._condition:
                while not (self._request or self.background or self._dropped or self.ending):
                    self._condition.wait()
                dropped, self._dropped = self._dropped, []
            for work in dropped:
                work.close()
            with self._condition:
                if self.ending and not self._dropped:
                    return
                request, self._request = self._request, None
                background = self.background
                if request is not None:
                    self._started_at = time.perf_counter()
                    self._running_values = request.values
                    # The token is made here, under the condition that `cancel` also holds, and not
                    # when the run starts: a cancellation between the two would be lost.
                    self.pipeline.token = CancelToken()
            if request is None:
                self._do_background_step(background)
                continue
            self.run_request(request)
            with self._condition:
                self._started_at = None
                idle = self._request is None
            if idle:
                self.idle.emit()

    def _drop_background(self) -> None:
        """Cancel the background work. Closing it may take time, which the engine's thread has."""
        if self.background is not None:
            self._dropped.append(self.background)
            self.background = None

    def run_request(self, request: FrameRequest) -> None:
        try:
            frame = self.pipeline.run(request)
        except Cancelled:
            self.cancelled.emit()
        except Exception as error:
            # The traceback would keep the stack frames of the run and all their data alive.
            self.failed.emit(error.with_traceback(None), request)
        else:
            with self._condition:
                self.waiting_frame = frame
            self.ready.emit()

    def _do_background_step(self, background: Generator[float | None, None, Any] | None) -> None:
        """Do one step of the background work."""
        if background is None:
            return
        try:
            share = next(background)
        except StopIteration as end:
            self.background_ready.emit(end.value)
        except Exception as error:
            # No stage has failed, so the exception goes to the object that requested the work.
            self.background_ready.emit(error.with_traceback(None))
        else:
            now = time.perf_counter()
            if share is not None and now - self._reported > _REPORT_INTERVAL:
                self._reported = now
                self.background_progressed.emit(share)
            return
        with self._condition:
            if self.background is background:
                self.background = None
