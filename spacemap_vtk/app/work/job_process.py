"""Run a job in a child process, and report its progress."""

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
from spacemap_vtk.io.output import atomic_files
from spacemap_vtk.jobs.job import Job
from spacemap_vtk.jobs.worker import error_from_json, make_request

#: Time that a terminated process has to end its child processes, in ms.
_PATIENCE = 500


class JobProcess(QObject):
    """Run a job in a child process that can be cancelled."""

    # The child process writes into a hidden folder. If it succeeds, the files move to their final
    # place; otherwise they are deleted.

    #: Number of finished steps, and of all steps.
    progress = Signal(int, int)
    #: A sentence about data that the file format cannot hold.
    lost = Signal(str)
    #: Name of the file, and the sentence that the job returns.
    succeeded = Signal(str)
    failed = Signal(object)
    #: Emitted when the process has ended or was cancelled.
    ended = Signal()

    def __init__(self, parent: QObject, job: Job) -> None:
        """Create a hidden folder for the job's output; raise an error if it cannot be created."""
        super().__init__(parent)
        #: Final path of the output file.
        self.target = job.output.absolute()
        self._files = ExitStack()
        folder = self._files.enter_context(atomic_files(job.output))
        self._job = replace(job, output=folder / job.output.name)  # type: ignore[type-var]
        self._error: SpacemapError | None = None
        self._result = ""
        self._has_ended = False
        self._process = QProcess(self)
        environment = QProcessEnvironment.systemEnvironment()
        environment.insert("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
        # As in `workers.start`.
        environment.insert("PYTHONSAFEPATH", "1")
        self._process.setProcessEnvironment(environment)
        self._process.readyReadStandardOutput.connect(self._read_messages)
        self._process.finished.connect(self._finish)
        self._process.errorOccurred.connect(self._report_start_failure)

    def start(self, values: Mapping[str, Any], base: Path) -> None:
        """Start the process with a scene's values; relative paths are resolved from file `base`."""
        process = self._process
        process.start(sys.executable, ["-m", "spacemap_vtk.jobs.worker"])
        if process.state() != QProcess.ProcessState.NotRunning:
            process.write(make_request(self._job, values, base).encode())
            process.closeWriteChannel()

    def cancel(self) -> None:
        """End the process and delete its output."""
        self._error = Cancelled("the export was cancelled")
        # Terminate before killing: the process ends its child processes, which draw and encode.
        self._process.terminate()
        QTimer.singleShot(_PATIENCE, self._process, self._process.kill)

    def stop(self) -> None:
        """Cancel, and wait until the process has ended."""
        self.cancel()
        if not self._process.waitForFinished(_PATIENCE):
            self._process.kill()
            self._process.waitForFinished(_PATIENCE)

    def _read_messages(self) -> None:
        while self._process.canReadLine():
            text = bytes(self._process.readLine().data()).decode()
            try:
                message = json.loads(text)
            except json.JSONDecodeError:
                continue  # a line that a library printed
            if "error" in message:
                self._error = error_from_json(message["error"])
            elif "lost" in message:
                self.lost.emit(message["lost"])
            elif "result" in message:
                self._result = message["result"]
            else:
                self.progress.emit(message["done"], message["of"])

    def _report_start_failure(self, failure: QProcess.ProcessError) -> None:
        # All other failures also emit `finished`.
        if failure == QProcess.ProcessError.FailedToStart:
            error = SpacemapError(
                f"{self.target.name} could not be written: {self._process.program()} "
                f"did not start ({self._process.errorString()})",
                cure="Check that this program exists, and that enough memory is free.",
            )
            self._end(self._error or error)

    def _finish(self, code: int, _status: object) -> None:
        self._read_messages()
        error = self._error
        if error is None and code != 0:
            printed = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
            last = printed.strip().splitlines()[-1:] or [f"the process ended with code {code}"]
            error = SpacemapError(f"{self.target.name} could not be written: {last[0]}")
        self._end(error)

    def _end(self, error: BaseException | None) -> None:
        """Move the files to their final place, or delete them after an error."""
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
