"""The engine: runs the pipeline in its own thread, always for the latest wish."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Generator
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from spacemap_vtk.app.job import PATIENCE, Job
from spacemap_vtk.app.pipeline import Pipeline
from spacemap_vtk.cancel import Cancelled, CancelToken
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.scenes.scene import Scene

#: A run that has taken no longer is one of a drag's.
_SHORT = 0.1
#: Seconds between two reports of how far the work beside is.
_REPORT_INTERVAL = 0.1


class Engine(QThread):
    """A thread that turns jobs into frames. Of several waiting jobs it does the last."""

    #: A frame is there: `take` it.
    ready = Signal()
    #: Section, seconds, executions.
    stage_ran = Signal(str, float, int)
    #: Section, share done, and the step of it that is being done, if it has some; at first 0, "".
    progressed = Signal(str, float, str)
    #: The exception, whose `section` names the stage, and the job.
    failed = Signal(object, object)
    cancelled = Signal()
    #: Nothing is left to do.
    idle = Signal()
    #: The share of the work asked for with `ask_beside` that is done, 0 to 1, now and then.
    beside_progressed = Signal(float)
    #: What the work that was asked for with `ask_beside` has come to, or its exception.
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
        # The pipeline must not keep the thread object alive that owns it.
        me = weakref.proxy(self)
        self.pipeline = Pipeline(
            lambda section, seconds, runs: me.stage_ran.emit(section, seconds, runs),
            lambda section, share, step: me.progressed.emit(section, share, step),
        )

    def ask(self, job: Job) -> None:
        """Ask for a frame; replaces a job that has not begun."""
        with self._condition:
            self._job = job
            # For another time of the same scene the run goes on: all it prepares is needed.
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
        """Ask for work on the scene that is done while no frame is asked for; None gives it up."""
        # It yields the share that is done, or None where it does not know that.
        with self._condition:
            scene = self.pipeline.scene
            self.beside = None if work is None or scene is None else work(scene)
            self._condition.notify()

    def take(self) -> Frame | None:
        """Return the latest frame once; None if it was taken."""
        with self._condition:
            frame, self.waiting_frame = self.waiting_frame, None
        return frame

    @property
    def busy(self) -> bool:
        """Whether a job waits or runs."""
        return self._job is not None or self._begun is not None

    @property
    def crowded(self) -> bool:
        """Whether a job waits for a run that will end soon: newer wishes can wait, too."""
        with self._condition:
            begun = self._begun
            return (
                self._job is not None and begun is not None and time.perf_counter() - begun < _SHORT
            )

    def cancel(self) -> None:
        """Give up what is asked for and what runs."""
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
        """Do one job after the other; the thread's own function."""
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
                    # Here, not where the run begins: a cancel holds for the job that is taken, from
                    # this moment until the next one is. Whoever cancels holds the condition, too.
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
            # Without its traceback, which would keep the frames of the run and all that is in them.
            self.failed.emit(error.with_traceback(None), job)
        else:
            with self._condition:
                self.waiting_frame = frame
            self.ready.emit()

    def _go_on(self, beside: Generator[float | None, None, Any] | None) -> None:
        """Do a little of the work beside."""
        if beside is None:
            return
        try:
            share = next(beside)
        except StopIteration as end:
            self.beside_ready.emit(end.value)
        except Exception as error:
            # No stage has failed: who asked is told.
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
