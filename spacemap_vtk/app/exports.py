"""Writing pictures, films and data: asks where and how, shows how far it is, and can be stopped."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from PySide6.QtCore import QObject, QProcess, QProcessEnvironment, Qt, QTimer, Signal
from PySide6.QtWidgets import QFileDialog, QProgressDialog, QWidget

from spacemap_vtk.app.ask_file import ended
from spacemap_vtk.app.document import Document
from spacemap_vtk.app.export_dialog import ExportDialog, TimesDialog
from spacemap_vtk.app.time_bar import TimeBar
from spacemap_vtk.app.view import View3D
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.order import Order, as_text
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.algorithm import Cancelled
from spacemap_vtk.io.output import whole_folder
from spacemap_vtk.io.registry import DATA, name_filter, writable, written, written_filters
from spacemap_vtk.scenes.face import picture_size

#: Milliseconds that a process which is ended has for ending its own.
_PATIENCE = 500


class Exports(QObject):
    """What the menu "Export" does. The work is a child process, which cancelling ends."""

    #: The file that was written, with what there is to tell of it.
    written = Signal(str)
    failed = Signal(object)
    #: What the file that was written could not hold, in words.
    lost = Signal(str)

    def __init__(self, window: QWidget, document: Document, times: TimeBar, view: View3D) -> None:
        super().__init__(window)
        self._window, self._document, self._times, self._view = window, document, times, view
        self._process: QProcess | None = None
        self._progress: QProgressDialog | None = None
        self._files: ExitStack | None = None
        self._target = Path()
        self._error: SpacemapError | None = None
        self._lost: list[str] = []
        self._told = ""

    def picture(self) -> None:
        """Ask for a picture's file and size, and write it."""
        self._drawn("picture", name_filter("Pictures", written("picture")), "picture.png")

    def film(self) -> None:
        """Ask for a film's file and size, and write it."""
        endings = writable("film")
        frames = name_filter("Numbered frames", written("frames"))
        filters = f"{name_filter('Films', endings)};;{frames}"
        self._drawn("film", filters, f"film{endings[0]}")

    def data(self) -> None:
        """Ask for a file, and write what its format holds."""
        filters = written_filters()
        name, chosen = QFileDialog.getSaveFileName(
            self._window,
            "Export data (a name with %04d in it: a file for each time)",
            "",
            ";;".join(filters),
        )
        if not name:
            return
        kind = filters.get(chosen, "patches")
        ending = re.search(r"\*(\.\w+)", chosen)
        path = ended(self._window, Path(name), ending[1] if ending else next(iter(written(kind))))
        if path is None:
            return
        if path.suffix.lower() not in written(kind):
            kind = next((other for other in DATA if path.suffix.lower() in written(other)), kind)
        scene = self._document.scene
        try:
            lasts = scene.moves and Order(kind, path).lasts
        except SpacemapError as error:
            self.failed.emit(error)
            return
        if not lasts:
            self.start(kind, path)
            return
        dialog = TimesDialog(self._window, path, scene.animation)
        if dialog.exec():
            self.start(kind, path, times=dialog.times)

    def start(
        self,
        kind: str,
        path: Path,
        size: tuple[int, int] = (1280, 960),
        panels: Sequence[str] = (),
        place: Viewpoint | None = None,
        times: Sequence[float] = (),
    ) -> None:
        """Begin to write."""
        document = self._document
        numbered = kind == "film" and path.suffix.lower() in written("frames")
        if numbered and "%" not in path.name:
            path = path.with_name(f"{path.stem}-%04d.png")
        try:
            if self._process is not None:
                raise InputError("something is being written already")
            order = Order(kind, path, (), size, panels, place)
            order.times = times if order.lasts else [self._times.time]
            self._files = ExitStack()
            folder = self._files.enter_context(whole_folder(path))
        except SpacemapError as error:
            self.failed.emit(error)
            return
        self._target, self._error, self._told, self._lost = path, None, "", []
        order.output = folder / path.name
        self._show_progress(kind)
        self._process = process = QProcess(self)
        environment = QProcessEnvironment.systemEnvironment()
        environment.insert("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
        process.setProcessEnvironment(environment)
        process.readyReadStandardOutput.connect(self._read)
        process.finished.connect(self._finished)
        process.errorOccurred.connect(self._failed)
        process.start(sys.executable, ["-m", "spacemap_vtk.draw.order"])
        if process.state() != QProcess.ProcessState.NotRunning:
            process.write(as_text(order, document.values, document.base.resolve()).encode())
            process.closeWriteChannel()

    @property
    def busy(self) -> bool:
        """Whether something is being written."""
        return self._process is not None

    def cancel(self) -> None:
        """End the work; nothing of it stays."""
        process = self._process
        if process is not None:
            self._error = Cancelled("the export was stopped")
            # Asked first: processes of its own, which draw and encode, it ends itself.
            process.terminate()
            QTimer.singleShot(_PATIENCE, process, process.kill)

    def stop(self) -> None:
        """Cancel, and wait until the process has ended."""
        process = self._process
        if process is not None:
            self.cancel()
            if not process.waitForFinished(_PATIENCE):
                process.kill()
                process.waitForFinished(_PATIENCE)

    def _drawn(self, kind: str, filters: str, proposal: str) -> None:
        scene, view = self._document.scene, self._view
        size = picture_size(scene)
        dialog = ExportDialog(self._window, kind, proposal, filters, size)
        if dialog.exec():
            panels, place = [], None
            if dialog.as_window:
                panels, place = view.panels(scene), view.place
            self.start(kind, dialog.file, dialog.size_chosen, panels, place)

    def _show_progress(self, kind: str) -> None:
        words = DATA.get(kind, kind)
        progress = QProgressDialog(
            f"Writing {words.lower()}: {self._target.name}", "Cancel", 0, 0, self._window
        )
        progress.setWindowTitle("Export")
        progress.setWindowModality(Qt.WindowModality.WindowModal)
        progress.setMinimumDuration(0)
        progress.setAutoClose(False)
        progress.setAutoReset(False)
        progress.setMinimumWidth(360)
        progress.canceled.connect(self.cancel)
        progress.show()
        self._progress = progress

    def _read(self) -> None:
        process, progress = self._process, self._progress
        while process is not None and process.canReadLine():
            text = bytes(process.readLine().data()).decode()
            try:
                line = json.loads(text)
            except json.JSONDecodeError:
                continue  # something that a library prints
            if "error" in line:
                told = line["error"]
                section = told.pop("section", None)
                self._error = SpacemapError(**told)
                self._error.section = section
            elif "lost" in line:
                self._lost.append(line["lost"])
            elif "told" in line:
                self._told = line["told"]
            elif progress is not None:
                progress.setMaximum(line["of"])
                progress.setValue(line["done"])

    def _failed(self, failure: QProcess.ProcessError) -> None:
        # Of a process that has begun Qt tells the end, too, whatever else is wrong with it.
        process = self._process
        if process is not None and failure == QProcess.ProcessError.FailedToStart:
            error = SpacemapError(
                f"{self._target.name} could not be written: {process.program()} "
                f"did not start ({process.errorString()})",
                cure="See that this program is there, and that there is memory for it.",
            )
            self._end(self._error or error)

    def _finished(self, code: int, _status: object) -> None:
        process = self._process
        if process is None:
            return
        self._read()
        error = self._error
        if error is None and code != 0:
            said = bytes(process.readAllStandardError().data()).decode(errors="replace")
            last = said.strip().splitlines()[-1:] or [f"it ended with code {code}"]
            error = SpacemapError(f"{self._target.name} could not be written: {last[0]}")
        self._end(error)

    def _end(self, error: BaseException | None) -> None:
        """Let the files appear, or go with the error; close the dialog, and tell."""
        process, files, progress = self._process, self._files, self._progress
        if process is None or files is None:
            return
        try:
            if error is None:
                files.close()
            else:
                files.__exit__(type(error), error, None)
        except SpacemapError as failure:
            error = failure
        self._process = self._files = self._progress = None
        process.deleteLater()
        if progress is not None:
            progress.canceled.disconnect(self.cancel)
            progress.close()
            progress.deleteLater()
        if error is None:
            self.written.emit(": ".join(filter(None, (str(self._target), self._told))))
            if self._lost:
                self.lost.emit(". ".join(self._lost))
        elif not isinstance(error, Cancelled):
            self.failed.emit(error)
