"""Writing pictures, films and data: asks where and how, shows how far it is, and can be stopped."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QProcess, QProcessEnvironment, QSettings, QTimer, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QLabel,
    QProgressBar,
    QPushButton,
    QWidget,
)

from spacemap_vtk.app.ask_file import agreed, ended, last_folder
from spacemap_vtk.app.document import Document
from spacemap_vtk.app.export_dialog import SIZES, Drawn, ExportDialog
from spacemap_vtk.app.time_bar import TimeBar
from spacemap_vtk.app.view import View3D
from spacemap_vtk.app.widgets import row
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.order import Order, as_text
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.algorithm import Cancelled
from spacemap_vtk.io.output import whole_folder
from spacemap_vtk.io.registry import DATA, name_filter, writable, written, written_filters
from spacemap_vtk.scenes.face import picture_size
from spacemap_vtk.scenes.footprint import PictureRequest
from spacemap_vtk.scenes.level_of_detail import choose_level

#: Milliseconds that a process which is ended has for ending its own.
_PATIENCE = 500
#: Letters of a name at the foot of the window, at most.
_LONGEST = 16
#: Parameters of a scene's view that a window may have otherwise: it can be dark, and has axes and a
#: scale bar of its own.
_WINDOW = ("background", "background_top", "triad", "scale_bar")
#: What keeps the folder of the last export.
_FOLDER = "export/folder"


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
        #: How far it is, and what ends it; hidden while nothing is written.
        self.progress, self.bar, self._words = QWidget(), QProgressBar(), QLabel()
        self.bar.setFixedWidth(90)
        tip = "Stop writing; nothing of it stays"
        self.stopping = QPushButton("Cancel", toolTip=tip)
        self.stopping.clicked.connect(self.cancel)
        row(self.progress, self._words, self.bar, self.stopping, spacing=6)
        self.progress.hide()
        self._files: ExitStack | None = None
        self._target = Path()
        self._error: SpacemapError | None = None
        self._lost: list[str] = []
        self._told = ""

    def picture(self) -> None:
        """Ask for a picture's file and size, and write it."""
        self._drawn("picture", name_filter("Pictures", written("picture")), ".png")

    def film(self) -> None:
        """Ask for a film's file and size, and write it."""
        endings = writable("film")
        frames = name_filter("Numbered frames", written("frames"))
        filters = f"{name_filter('Films', endings)};;{frames}"
        self._drawn("film", filters, endings[0])

    def data(self) -> None:
        """Ask for a file, and write what its format holds."""
        if not self._free():
            return
        filters = written_filters()
        if not self._document.scene.has_draft:
            filters = {text: kind for text, kind in filters.items() if kind != "draft"}
        name, chosen = QFileDialog.getSaveFileName(
            self._window,
            "Export data (a name with %04d in it: a file for each time)",
            str(self._proposal("")),
            ";;".join(filters),
        )
        if not name:
            return
        kind = filters.get(chosen, "patches")
        ending = re.search(r"\*(\.\w+)", chosen)
        path = ended(self._window, Path(name), ending[1] if ending else next(iter(written(kind))))
        if path is None:
            return
        QSettings().setValue(_FOLDER, str(path.parent))
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
        dialog = ExportDialog(self._window, f"Times of {path.name}", scene.animation)
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
        more: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> None:
        """Begin to write, with other values of the scene's, if need be."""
        document = self._document
        path = _numbered(kind, path)
        if not self._free():
            return
        try:
            order = Order(kind, path, (), size, panels, place)
            order.wireframe = place is not None and self._view.look.wireframe
            order.times = times if order.lasts else [self._times.time]
            self._files = ExitStack()
            folder = self._files.enter_context(whole_folder(path))
        except SpacemapError as error:
            self.failed.emit(error)
            return
        self._target, self._error, self._told, self._lost = path.absolute(), None, "", []
        order.output = folder / path.name
        self._words.setText(f"Writing {_shortened(path.name)}")
        self.progress.setToolTip(f"Writing {DATA.get(kind, kind).lower()}: {path}")
        self.bar.setRange(0, 0)
        self.progress.show()
        self._process = process = QProcess(self)
        environment = QProcessEnvironment.systemEnvironment()
        environment.insert("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
        environment.insert("PYTHONSAFEPATH", "1")  # as for `workers.start`
        process.setProcessEnvironment(environment)
        process.readyReadStandardOutput.connect(self._read)
        process.finished.connect(self._finished)
        process.errorOccurred.connect(self._failed)
        process.start(sys.executable, ["-m", "spacemap_vtk.draw.order"])
        if process.state() != QProcess.ProcessState.NotRunning:
            values = dict(document.values)
            for section, written_ in (more or {}).items():
                values[section] = {**values.get(section, {}), **written_}
            process.write(as_text(order, values, document.base.resolve()).encode())
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

    def may_leave(self) -> bool:
        """Ask whether what is being written may be lost."""
        text = f"{self._target.name} is being written. Close, and give it up?"
        return not self.busy or agreed(self._window, "Still writing", text)

    def _free(self) -> bool:
        if self.busy:
            cure = "Wait until it is there, or cancel it at the foot of the window."
            self.failed.emit(InputError(f"{self._target.name} is being written", cure=cure))
        return not self.busy

    def _proposal(self, ending: str) -> Path:
        proposed = last_folder() / self._document.proposed(ending)
        kept = QSettings().value(_FOLDER)
        return Path(kept) / proposed.name if kept and Path(kept).is_dir() else proposed

    def _drawn(self, kind: str, filters: str, ending: str) -> None:
        if not self._free():
            return
        scene, view = self._document.scene, self._view
        ratio = view.devicePixelRatioF()
        seen = round(view.width() * ratio), round(view.height() * ratio)

        def check(path: Path, size: tuple[int, int], frames: int) -> None:
            Order(kind, _numbered(kind, path))
            choose_level(scene, PictureRequest(size, frames))

        sizes = {"Window": seen, "Scene": picture_size(scene), **SIZES}
        proposal, transparent = self._proposal(ending), scene.view.transparent
        notes = []
        if kind == "film" and not scene.moves:
            notes.append("Nothing moves in this scene: all frames are the same.")
        if view.frame is not None and view.frame.swing is not None:
            notes.append("The scene's own motion is written, not the mode or pull in the view.")
        drawn = Drawn(kind, proposal, filters, sizes, transparent, " ".join(notes), check)
        animation = scene.animation if kind == "film" else None
        dialog = ExportDialog(self._window, f"Export {kind}", animation, drawn)
        if not dialog.exec():
            return
        QSettings().setValue(_FOLDER, str(dialog.file.parent))
        size = dialog.size_chosen
        more: dict[str, dict[str, Any]] = {"view": {"transparent": dialog.clear}}
        if dialog.animation is not None:
            more["animation"] = dialog.animation.settings
        if not dialog.as_window:
            self.start(kind, dialog.file, size, more=more)
            return
        shown = view.settings  # with the background of a dark window
        more["view"] |= {key: shown[key] for key in _WINDOW}
        panels, place = view.panels(scene), view.place_for(size)
        self.start(kind, dialog.file, size, panels, place, more=more)

    def _read(self) -> None:
        process = self._process
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
            else:
                self.bar.setRange(0, line["of"])
                self.bar.setValue(line["done"])

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
        """Let the files appear, or go with the error, and tell."""
        process, files = self._process, self._files
        if process is None or files is None:
            return
        try:
            if error is None:
                files.close()
            else:
                files.__exit__(type(error), error, None)
        except SpacemapError as failure:
            error = failure
        self._process = self._files = None
        process.deleteLater()
        self.progress.hide()
        if error is None:
            self.written.emit(": ".join(filter(None, (str(self._target), self._told))))
            if self._lost:
                self.lost.emit(". ".join(self._lost))
        elif not isinstance(error, Cancelled):
            self.failed.emit(error)


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST // 2]}…{name[-_LONGEST // 2 :]}"


def _numbered(kind: str, path: Path) -> Path:
    """Return the path of a film; where its frames are files, with a number in their names."""
    frames = kind == "film" and path.suffix.lower() in written("frames")
    return path.with_name(f"{path.stem}-%04d.png") if frames and "%" not in path.name else path
