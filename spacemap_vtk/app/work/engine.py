"""The engine: a thread that runs the pipeline, always for the latest job."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Generator
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from spacemap_vtk.app.work.job import PATIENCE, Job
from spacemap_vtk.app.work.pipeline import Pipeline
from spacemap_vtk.cancel import Cancelled, CancelToken
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.scenes.scene import Scene

#: A run shorter than this, in s, is assumed to belong to a drag.
_SHORT = 0.1
#: Time between two progress reports of background work, in s.
_REPORT_INTERVAL = 0.1


class Engine(QThread):
    """A thread that turns jobs into frames. A new job replaces one that is still waiting."""

    #: A frame is ready; `take` returns it.
    ready = Signal()
    #: Section, seconds, executions.
    stage_ran = Signal(str, float, int)
    #: Section, progress from 0 to 1, and name of the current step or ""; first (section, 0, "").
    progressed = Signal(str, float, str)
    #: The exception, whose `section` names the stage, and the job.
    failed = Signal(object, object)
    cancelled = Signal()
    #: No job is left.
    idle = Signal()
    #: Progress of the background work from `ask_beside`, 0 to 1; emitted at intervals.
    beside_progressed = Signal(float)
    #: Result of the background work from `ask_beside`, or its exception.
    beside_ready = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._condition = threading.Condition()
        self._job: Job | None = None
        self.waiting_frame: Frame | None = None
        self.ending = False
        self._begun: float | None = None
        self._running_values: dict[str, Any] = {}
        self.beside: Generator[float | None, None, Any] | None = None
        self._reported = 0.0
        # A weak reference: the pipeline must not keep the engine alive, which owns it.
        me = weakref.proxy(self)
        self.pipeline = Pipeline(
            lambda section, seconds, runs: me.stage_ran.emit(section, seconds, runs),
            lambda section, share, step: me.progressed.emit(section, share, step),
        )

    def ask(self, job: Job) -> None:
        """Request a frame; this replaces a job that has not started."""
        with self._condition:
            self._job = job
            # A run for another time of the same scene continues: the new job needs its results.
            late = (
                self._begun is not None
                and time.perf_counter() - self._begun > PATIENCE
                and self._running_values != job.values
            )
            self._condition.notify()
            if late:
                self.pipeline.token.cancel()

    def ask_beside(
        self, work: Callable[[Scene], Generator[float | None, None, Any]] | None
    ) -> None:
        """Request background work, done while no job waits; None cancels the present work."""
        # The work yields its progress from 0 to 1, or None if its progress is unknown.
        with self._condition:
            scene = self.pipeline.scene
            self.beside = None if work is None or scene is None else work(scene)
            self._condition.notify()

    def take(self) -> Frame | None:
        """Return the latest frame, or None if it was already taken."""
        with self._condition:
            frame, self.waiting_frame = self.waiting_frame, None
        return frame

    @property
    def busy(self) -> bool:
        """Whether a job is waiting or running."""
        return self._job is not None or self._begun is not None

    @property
    def crowded(self) -> bool:
        """Whether a job waits for a run that will end soon, so that newer changes can wait too."""
        with self._condition:
            begun = self._begun
            return (
                self._job is not None and begun is not None and time.perf_counter() - begun < _SHORT
            )

    def cancel(self) -> None:
        """Cancel the waiting and the running job."""
        with self._condition:
            self._job = None
            self.pipeline.token.cancel()

    def finish(self) -> None:
        """Stop, and wait until the thread has ended."""
        with self._condition:
            self.ending = True
            self._job = self.beside = None
            self._condition.notify()
            self.pipeline.token.cancel()
        self.wait()
        self.waiting_frame = None

    def run(self) -> None:
        """Process jobs one after another; this is the thread's main function."""
        while True:
            with self._condition:
                while self._job is None and self.beside is None and not self.ending:
                    self._condition.wait()
                if self.ending:
                    return
                job, self._job = self._job, None
                beside = self.beside
                if job is not None:
                    self._begun = time.perf_counter()
                    self._running_values = job.values
                    # The token is made here, under the condition that `cancel` also holds, and not
                    # when the run starts: a cancellation between the two would be lost.
                    self.pipeline.token = CancelToken()
            if job is None:
                self._go_on(beside)
                continue
            self.perform(job)
            with self._condition:
                self._begun = None
                idle = self._job is None
            if idle:
                self.idle.emit()

    def perform(self, job: Job) -> None:
        try:
            frame = self.pipeline.run(job)
        except Cancelled:
            self.cancelled.emit()
        except Exception as error:
            # The traceback would keep the stack frames of the run and all their data alive.
            self.failed.emit(error.with_traceback(None), job)
        else:
            with self._condition:
                self.waiting_frame = frame
            self.ready.emit()

    def _go_on(self, beside: Generator[float | None, None, Any] | None) -> None:
        """Do one step of the background work."""
        if beside is None:
            return
        try:
            share = next(beside)
        except StopIteration as end:
            self.beside_ready.emit(end.value)
        except Exception as error:
            # No stage has failed, so the exception goes to the object that requested the work.
            self.beside_ready.emit(error.with_traceback(None))
        else:
            now = time.perf_counter()
            if share is not None and now - self._reported > _REPORT_INTERVAL:
                self._reported = now
                self.beside_progressed.emit(share)
            return
        with self._condition:
            if self.beside is beside:
                self.beside = None
