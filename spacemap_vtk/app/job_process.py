"""A job that runs in a process of its own, and how far it is."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QProcess, QProcessEnvironment, QTimer, Signal

from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import whole_folder
from spacemap_vtk.jobs.job import Job
from spacemap_vtk.jobs.worker import error_from_json, request

#: Milliseconds that a process which is ended has for ending its own.
_PATIENCE = 500


class JobProcess(QObject):
    """Runs a job in a child process, which cancelling ends."""

    # The child writes into a hidden folder. Its files appear when it has ended well; otherwise they
    # are removed.

    #: Steps done, and all steps.
    progress = Signal(int, int)
    #: What the file cannot hold, in a sentence.
    lost = Signal(str)
    #: The file, and the sentence that the job returns.
    succeeded = Signal(str)
    failed = Signal(object)
    #: The process has ended, by itself or cancelled.
    ended = Signal()

    def __init__(self, parent: QObject, job: Job) -> None:
        """Make a hidden folder for the output of a job; refuse one that is not possible."""
        super().__init__(parent)
        #: The file that appears.
        self.target = job.output.absolute()
        self._files = ExitStack()
        folder = self._files.enter_context(whole_folder(job.output))
        self._job = replace(job, output=folder / job.output.name)  # type: ignore[type-var]
        self._error: SpacemapError | None = None
        self._result = ""
        self._has_ended = False
        self._process = QProcess(self)
        environment = QProcessEnvironment.systemEnvironment()
        environment.insert("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
        environment.insert("PYTHONSAFEPATH", "1")  # as for `workers.start`
        self._process.setProcessEnvironment(environment)
        self._process.readyReadStandardOutput.connect(self._read)
        self._process.finished.connect(self._finish)
        self._process.errorOccurred.connect(self._fail_to_start)

    def start(self, values: Mapping[str, Any], base: Path) -> None:
        """Start the process with the values of a scene, whose relative paths count from `base`."""
        process = self._process
        process.start(sys.executable, ["-m", "spacemap_vtk.jobs.worker"])
        if process.state() != QProcess.ProcessState.NotRunning:
            process.write(request(self._job, values, base).encode())
            process.closeWriteChannel()

    def cancel(self) -> None:
        """End the process; nothing of the output stays."""
        self._error = Cancelled("the export was stopped")
        # Asked first: processes of its own, which draw and encode, it ends itself.
        self._process.terminate()
        QTimer.singleShot(_PATIENCE, self._process, self._process.kill)

    def stop(self) -> None:
        """Cancel, and wait until the process has ended."""
        self.cancel()
        if not self._process.waitForFinished(_PATIENCE):
            self._process.kill()
            self._process.waitForFinished(_PATIENCE)

    def _read(self) -> None:
        while self._process.canReadLine():
            text = bytes(self._process.readLine().data()).decode()
            try:
                message = json.loads(text)
            except json.JSONDecodeError:
                continue  # something that a library prints
            if "error" in message:
                self._error = error_from_json(message["error"])
            elif "lost" in message:
                self.lost.emit(message["lost"])
            elif "result" in message:
                self._result = message["result"]
            else:
                self.progress.emit(message["done"], message["of"])

    def _fail_to_start(self, failure: QProcess.ProcessError) -> None:
        # Qt reports the end of a process that has begun by `finished`, too.
        if failure == QProcess.ProcessError.FailedToStart:
            error = SpacemapError(
                f"{self.target.name} could not be written: {self._process.program()} "
                f"did not start ({self._process.errorString()})",
                cure="See that this program is there, and that there is memory for it.",
            )
            self._end(self._error or error)

    def _finish(self, code: int, _status: object) -> None:
        self._read()
        error = self._error
        if error is None and code != 0:
            printed = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
            last = printed.strip().splitlines()[-1:] or [f"it ended with code {code}"]
            error = SpacemapError(f"{self.target.name} could not be written: {last[0]}")
        self._end(error)

    def _end(self, error: BaseException | None) -> None:
        """Let the files appear, or remove them after an error."""
        if self._has_ended:
            return
        self._has_ended = True
        try:
            if error is None:
                self._files.close()
            else:
                self._files.__exit__(type(error), error, None)
        except SpacemapError as failure:
            error = failure
        self.deleteLater()
        self.ended.emit()
        if error is None:
            parts = str(self.target), self._result
            self.succeeded.emit(": ".join(filter(None, parts)))
        elif not isinstance(error, Cancelled):
            self.failed.emit(error)
