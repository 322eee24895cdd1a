"""Export pictures, films and data: dialogs, progress and cancelling."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QSettings, QTemporaryDir, QTimer, QUrl, Signal
from PySide6.QtGui import QDesktopServices, QGuiApplication, QImage
from PySide6.QtWidgets import (
    QFileDialog,
    QLabel,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QWidget,
)
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.documents.file_dialogs import add_ending, choose, last_folder
from spacemap_vtk.app.draft.print_dialog import PrintDialog
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.widgets import row
from spacemap_vtk.app.work.export_dialog import SIZES, ExportDialog, PictureOptions, stored_size
from spacemap_vtk.app.work.job_process import JobProcess
from spacemap_vtk.draw.actors.surface_actor import color_bar_share
from spacemap_vtk.draw.camera import (
    CameraView,
    Viewpoint,
    aim_camera,
    aim_of,
    camera_up_axis,
    pixels_per_metre,
)
from spacemap_vtk.draw.scene_view import extent_of
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.io.registry import (
    DATA,
    available_writer_endings,
    export_dialog_filters,
    name_filter,
    writer_endings,
)
from spacemap_vtk.jobs import make_data_job, make_job
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.flat_picture import picture_size
from spacemap_vtk.scenes.irregular_data import YARN_DATA
from spacemap_vtk.scenes.level_of_detail import DrawnCloth, choose_level, shows_fibres
from spacemap_vtk.scenes.memory_estimates import PictureRequest
from spacemap_vtk.scenes.settings import Animation

#: Most letters of a file name in the status line.
_MAX_NAME = 16
#: Parameters of a scene's view that the window can override: it has a dark mode, and its own
#: switches for axes and scale bar.
_WINDOW_KEYS = ("background", "background_top", "triad", "scale_bar")
#: Values of a film of a still scene: the camera goes round it once.
_TURN = {"orbit": 360.0, "start": 0.0, "stop": 8.0, "speed": 1.0}
#: Time for which written files can be opened in the status bar, in ms.
_OPEN_TIME = 120_000
#: Settings key for the folder of the last export.
_FOLDER_KEY = "export/folder"


class Exports(QObject):
    """Export commands of the menu "File". Each job runs in a child process, one at a time."""

    #: Name of the written file, and a sentence about it.
    written = Signal(str)
    failed = Signal(object)
    #: A sentence about a picture that is now in the clipboard.
    copied = Signal(str)
    #: Sentences about data that the written file could not store.
    lost = Signal(str)

    def __init__(self, window: QWidget, document: Document, times: TimeBar, view: View3D) -> None:
        super().__init__(window)
        self._window, self._document, self._times, self._view = window, document, times, view
        #: Progress bar with a button to cancel; hidden while nothing is written.
        self.progress, self.bar, self._label = QWidget(), QProgressBar(), QLabel()
        self.bar.setFixedWidth(90)
        tip = "Cancel the export and delete its output"
        self.cancel_button = QPushButton("Cancel", toolTip=tip)
        self.cancel_button.clicked.connect(self.cancel)
        row(self.progress, self._label, self.bar, self.cancel_button, spacing=6)
        self.progress.hide()
        #: Buttons that open what was written last, each with the name of its file.
        self.results = QWidget()
        self.open_buttons = [QPushButton() for _ in range(2)]
        for button in self.open_buttons:
            button.clicked.connect(self._open_file)
        row(self.results, *self.open_buttons, spacing=6)
        self.results.hide()
        for widget in (self.progress, self.results):
            # Otherwise they would take the room of a message in the status bar.
            widget.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
        self._results_timer = QTimer(self, singleShot=True, interval=_OPEN_TIME)
        self._results_timer.timeout.connect(self.results.hide)
        self._process: JobProcess | None = None
        #: What is written, or was last.
        self._target = Path()
        #: Folder of a picture that goes to the clipboard; None for a file.
        self._copied: QTemporaryDir | None = None
        self._irregular = False
        #: Sentences about data that the file cannot store.
        self._losses: list[str] = []

    def picture(self) -> None:
        """Ask for the file and size of a picture, and write it."""
        self._export_picture("picture", name_filter("Pictures", writer_endings("picture")), ".png")

    def film(self) -> None:
        """Ask for the file and size of a film, and write it."""
        endings = available_writer_endings("film")
        frames = name_filter("Numbered frames", writer_endings("frames"))
        filters = f"{name_filter('Films', endings)};;{frames}"
        self._export_picture("film", filters, endings[0])

    def set_irregular(self, irregular: bool) -> None:
        """Set whether data get irregular yarns, as pictures have, if the scene has such yarns."""
        self._irregular = irregular

    def data(self) -> None:
        """Ask for a data file, and write what its format stores."""
        if not self._require_idle():
            return
        filters = export_dialog_filters()
        if not self._document.scene.has_draft:
            filters = {text: kind for text, kind in filters.items() if kind != "draft"}
        name, chosen = QFileDialog.getSaveFileName(
            self._window,
            "Export data (with %04d in the name: one file for each time)",
            str(self._propose_path("")),
            ";;".join(filters),
        )
        if not name:
            return
        kind = filters.get(chosen, "patches")
        ending = re.search(r"\*(\.\w+)", chosen)
        path = add_ending(
            self._window, Path(name), ending[1] if ending else next(iter(writer_endings(kind)))
        )
        if path is None:
            return
        QSettings().setValue(_FOLDER_KEY, str(path.parent))
        if path.suffix.lower() not in writer_endings(kind):
            kind = next(
                (other for other in DATA if path.suffix.lower() in writer_endings(other)), kind
            )
        scene = self._document.scene
        try:
            asks_times = scene.is_animated and make_data_job(path, kind).is_series
        except SpacemapError as error:
            self.failed.emit(error)
            return
        times = [self._times.time]
        if asks_times:
            dialog = ExportDialog(self._window, f"Times of {path.name}", scene.animation)
            if not dialog.exec():
                return
            times = dialog.times
        fields: dict[str, Any] = {"times": times}
        if self._irregular and kind in YARN_DATA:
            fields["irregular"] = True
        self.start(kind, path, **fields)

    def plan(self, ending: str, settings: Mapping[str, Any]) -> None:
        """Ask for a file, and write the weaver's plan."""
        if not self._require_idle():
            return
        label = {".pdf": "Document", ".csv": "Table"}[ending]
        name, _ = QFileDialog.getSaveFileName(
            self._window,
            "Save plan",
            str(self._propose_path(ending)),
            name_filter(label, [ending]),
        )
        path = add_ending(self._window, Path(name), ending) if name else None
        if path is not None:
            QSettings().setValue(_FOLDER_KEY, str(path.parent))
            self.start("plan", path, settings=settings)

    def measurement(self, ending: str, test: str) -> None:
        """Ask for a file, and write the plot, the curve or the film of a test."""
        if not self._require_idle():
            return
        label = {".png": "Plot", ".csv": "Table", ".gif": "Film"}[ending]
        name, _ = QFileDialog.getSaveFileName(
            self._window,
            "Save measurement",
            str(self._propose_path(ending)),
            name_filter(label, [ending]),
        )
        path = add_ending(self._window, Path(name), ending) if name else None
        if path is not None:
            QSettings().setValue(_FOLDER_KEY, str(path.parent))
            self.start("measurement", path, test=test)

    def composite(self, ending: str, kind: str) -> None:
        """Ask for a file, and write moduli, voxels or a deck of the unit cell."""
        if not self._require_idle():
            return
        label = writer_endings("unit_cell").get(ending, "Plot")
        name, _ = QFileDialog.getSaveFileName(
            self._window,
            "Save composite",
            str(self._propose_path(ending)),
            name_filter(label, [ending]),
        )
        path = add_ending(self._window, Path(name), ending) if name else None
        if path is not None:
            QSettings().setValue(_FOLDER_KEY, str(path.parent))
            self.start(kind, path)

    def draft(self) -> None:
        """Ask how the draft is printed, and write it as a PDF."""
        if not self._require_idle():
            return
        woven = self._document.scene.woven
        try:
            draft = None if woven is None else woven.make_draft()
        except SpacemapError as error:
            self.failed.emit(error)
            return
        if draft is None:
            self.failed.emit(InputError("This scene is not woven, so it has no draft"))
            return
        dialog = PrintDialog(self._window, draft)
        if not dialog.exec():
            return
        name, _ = QFileDialog.getSaveFileName(
            self._window,
            "Print draft",
            str(self._propose_path(".pdf")),
            name_filter("Documents", writer_endings("pages")),
        )
        path = add_ending(self._window, Path(name), ".pdf") if name else None
        if path is not None:
            QSettings().setValue(_FOLDER_KEY, str(path.parent))
            self.start("print", path, settings=dialog.settings.given_values)

    def start(
        self,
        kind: str,
        path: Path,
        more: Mapping[str, Mapping[str, Any]] | None = None,
        **fields: Any,
    ) -> None:
        """Start a job; `more` replaces values of the scene."""
        if not self._require_idle():
            return
        path = _add_frame_number(kind, path)
        try:
            process = JobProcess(self, make_job(kind, path, **fields))
        except SpacemapError as error:
            self.failed.emit(error)
            return
        self._process, self._losses, self._copied = process, [], None
        self._target = process.target
        process.progress.connect(self._show_progress)
        process.lost.connect(self._losses.append)
        process.ended.connect(self._end)
        process.succeeded.connect(self._succeed)
        process.failed.connect(self.failed)
        self._label.setText(f"Writing {_shorten(path.name)}")
        self.progress.setToolTip(f"Writing {DATA.get(kind, kind).lower()}: {path}")
        self.bar.setRange(0, 0)
        self.results.hide()
        self.progress.show()
        values = dict(self._document.values)
        for section, changed in (more or {}).items():
            values[section] = {**values.get(section, {}), **changed}
        process.start(values, self._document.base.resolve())

    @property
    def busy(self) -> bool:
        """Whether a file is being written."""
        return self._process is not None

    def cancel(self) -> None:
        """Cancel the job and delete its output."""
        if self._process is not None:
            self._process.cancel()

    def stop(self) -> None:
        """Cancel, and wait until the process has ended."""
        if self._process is not None:
            self._process.stop()

    def confirm_close(self) -> bool:
        """Ask whether a running export may be cancelled; return whether the window may close."""
        if self._process is None:
            return True
        text = f"{self._process.target.name} is being written."
        answers = "Cancel it and close", "Keep writing"
        return choose(self._window, "Export in progress", text, *answers)

    def _require_idle(self) -> bool:
        if self._process is None:
            return True
        name = self._process.target.name
        cure = "Wait until it is complete, or cancel it in the status bar."
        self.failed.emit(InputError(f"{name} is being written", cure=cure))
        return False

    def _propose_path(self, ending: str) -> Path:
        proposal = last_folder() / self._document.propose_name(ending)
        folder = QSettings().value(_FOLDER_KEY)
        return Path(folder) / proposal.name if folder and Path(folder).is_dir() else proposal

    def _export_picture(self, kind: str, filters: str, ending: str) -> None:
        if not self._require_idle():
            return
        scene, view = self._document.scene, self._view
        ratio = view.devicePixelRatioF()
        view_size = round(view.width() * ratio), round(view.height() * ratio)

        def check(path: Path, size: tuple[int, int], frames: int) -> None:
            make_job(kind, _add_frame_number(kind, path))
            choose_level(scene, PictureRequest(size, frames))

        sizes = {"Window": view_size, "Scene": picture_size(scene), **SIZES}
        proposal, transparent = self._propose_path(ending), scene.view.transparent
        notes = []
        if view.frame is not None and view.frame.mode is not None:
            notes.append(
                "The file shows the scene's motion, not the mode or stretch in the window."
            )

        def describe(size: tuple[int, int]) -> str:
            return " ".join(filter(None, [*notes, self._describe_fibres(size)]))

        picked = view.picks[-1].position if view.picks else None
        options = PictureOptions(
            kind,
            proposal,
            filters,
            sizes,
            transparent,
            scene.view,
            picked,
            scene.is_animated,
            describe,
            check,
        )
        animation = scene.animation if kind == "film" else None
        if animation is not None and not (scene.is_animated or animation.orbit):
            animation = Animation(**{**animation.settings, **_TURN})
        dialog = ExportDialog(self._window, f"Export {kind}", animation, options)
        if not dialog.exec():
            return
        QSettings().setValue(_FOLDER_KEY, str(dialog.file.parent))
        size = dialog.picture_size
        more: dict[str, dict[str, Any]] = {"view": {"transparent": dialog.is_transparent}}
        if dialog.animation is not None:
            more["animation"] = dialog.animation.settings
        fields: dict[str, Any] = {"size": size}
        if kind == "picture":
            fields["time"] = self._times.time
        if dialog.uses_window_view:
            shown = view.settings  # includes the background of a dark window
            more["view"] |= {key: shown[key] for key in _WINDOW_KEYS}
            fields["panels"] = view.panels(scene)
            fields["place"] = view.viewpoint_for(size)
            fields["wireframe"] = view.options.wireframe
        more["view"] |= dialog.composition.values(self._camera_view(size, fields.get("place")))
        self.start(kind, dialog.file, more, **fields)

    def _camera_view(self, size: tuple[int, int], place: Viewpoint | None) -> CameraView:
        """Return the view of a picture from a viewpoint, or from the scene's camera."""
        shown = self._view.camera_view
        offset = color_bar_share(size) if shown is not None and shown.offset else 0.0
        if place is not None:
            return CameraView(place, offset, size)
        camera, scene, frame = vtkCamera(), self._document.scene, self._view.frame
        if frame is not None:
            aspect = (1.0 - offset) * size[0] / size[1]
            aim = aim_of(scene.view) or frame.camera
            points = extent_of(frame, scene.view.loads)
            aim_camera(camera, points, aspect, aim, scene.view.zoom, camera_up_axis(aim))
        return CameraView(Viewpoint.from_camera(camera), offset, size)

    def _describe_fibres(self, size: tuple[int, int]) -> str:
        """Return a sentence if a file of a size shows fibres and the window does not."""
        scene, frame, shown = self._document.scene, self._view.frame, self._view.camera_view
        cloth = DrawnCloth.from_scene(scene)
        if cloth is None or frame is None or shown is None:
            return ""
        if COLORINGS[scene.view.color].shows_numbers or not scene.view.resolved_style.sheen:
            return ""
        points = extent_of(frame, loads=False)
        place = self._view.viewpoint_for(size)
        here = pixels_per_metre(shown.camera, points, shown.size[1])
        there = pixels_per_metre(CameraView(place, 0.0, size).camera, points, size[1])
        if shows_fibres(cloth, here) or not shows_fibres(cloth, there):
            return ""
        return (
            f"The file will show fibres, which are too fine for the window: its yarns are up to "
            f"{cloth.width * there:.0f} pixels wide."
        )

    def copy_picture(self) -> None:
        """Draw the picture of the view as for a file, and copy it."""
        if not self._require_idle():
            return
        view, scene = self._view, self._document.scene
        ratio = view.devicePixelRatioF()
        size = stored_size() or (round(view.width() * ratio), round(view.height() * ratio))
        folder = QTemporaryDir()
        shown = view.settings
        self.start(
            "picture",
            Path(folder.filePath("copy.png")),
            {"view": {key: shown[key] for key in _WINDOW_KEYS}},
            size=size,
            time=self._times.time,
            panels=view.panels(scene),
            place=view.viewpoint_for(size),
            wireframe=view.options.wireframe,
        )
        self._copied = folder if self._process is not None else None

    def figure(self) -> None:
        """Ask for the parts of a page, and write it."""
        if not self._require_idle():
            return
        # Imported only here, because it loads what draws pages.
        from spacemap_vtk.app.work.figure_dialog import FigureDialog

        dialog = FigureDialog(self._window, self._document.scene)
        if not dialog.exec():
            return
        page, scene = dialog.page, self._document.scene
        name, _ = QFileDialog.getSaveFileName(
            self._window,
            "Export figure page",
            str(self._propose_path(".pdf")),
            name_filter("Pages", writer_endings("plot")),
        )
        path = add_ending(self._window, Path(name), ".pdf") if name else None
        if path is None:
            return
        QSettings().setValue(_FOLDER_KEY, str(path.parent))
        shows_motion = not page.panels and scene.moves and scene.view.color == "own"
        more = {"view": {"color": "displacement"}} if shows_motion else {}
        self.start("figure", path, more, page=page)

    def sweep(self) -> None:
        """Ask for keys with lists of values, and run the scene for all of them."""
        if not self._require_idle():
            return
        proposal = self._propose_path("")
        proposal = proposal.with_name(f"{proposal.name}_sweep")
        number = 2
        while proposal.exists():
            proposal = proposal.with_name(f"{proposal.name.rstrip('0123456789_')}_{number}")
            number += 1
        from spacemap_vtk.app.work.sweep_dialog import SweepDialog

        dialog = SweepDialog(self._window, self._document.scene, proposal)
        if not dialog.exec():
            return
        QSettings().setValue(_FOLDER_KEY, str(dialog.folder.parent))
        paired = dialog.paired.isChecked()
        self.start("sweep", dialog.folder, lists=dialog.assignments, paired=paired)

    def _show_progress(self, done: int, of: int) -> None:
        self.bar.setRange(0, of if done else 0)  # busy until a share is known
        self.bar.setValue(done)

    def _succeed(self, text: str) -> None:
        if self._copied is not None:
            image = QImage(self._copied.filePath("copy.png"))
            QGuiApplication.clipboard().setImage(image)
            text = f"the picture is in the clipboard, {image.width()} × {image.height()} pixels"
            self.copied.emit(text.capitalize())
            return
        self._offer_files(self._target)
        self.written.emit(text)
        if self._losses:
            self.lost.emit(". ".join(self._losses))

    def _offer_files(self, target: Path) -> None:
        """Show buttons that open the written file, or the table and the sheet of a sweep."""
        files = {"Open": target}
        if target.is_dir():
            from spacemap_vtk.jobs.sweep import SHEET, TABLE

            files = {"Open table": target / TABLE, "Open contact sheet": target / SHEET}
        there = [(words, file) for words, file in files.items() if file.is_file()]
        for button in self.open_buttons[len(there) :]:
            button.hide()
        for button, (words, file) in zip(self.open_buttons, there, strict=False):
            button.setText(words)
            button.setToolTip(str(file))
            button.show()
        self.results.setVisible(bool(there))
        self._results_timer.start()

    def _open_file(self) -> None:
        """Open the file of the clicked button by the program that the desktop has for it."""
        file = self.sender().toolTip()
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(file)):
            cure = f"Open {file} yourself."
            self.failed.emit(InputError("no program of this desktop opens this file", cure=cure))

    def _end(self) -> None:
        self._process = None
        self.progress.hide()


def _shorten(name: str) -> str:
    return name if len(name) <= _MAX_NAME else f"{name[: _MAX_NAME // 2]}…{name[-_MAX_NAME // 2 :]}"


def _add_frame_number(kind: str, path: Path) -> Path:
    """Return the path of the output; for a film of single files, with ``%04d`` in the name."""
    frames = kind == "film" and path.suffix.lower() in writer_endings("frames")
    return path.with_name(f"{path.stem}-%04d.png") if frames and "%" not in path.name else path
