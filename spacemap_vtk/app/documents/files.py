"""Open and save files, and ask about unsaved changes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, QSettings, Signal
from PySide6.QtWidgets import QMessageBox, QWidget

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.documents.file_dialogs import ask_input_file, ask_output_file
from spacemap_vtk.app.panels.error_bar import ErrorBar
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import atomic_file, check_output
from spacemap_vtk.io.provenance import Record, attach_record
from spacemap_vtk.io.registry import (
    kind_of,
    name_filter,
    scene_dialog_filters,
    writer,
    writer_endings,
)
from spacemap_vtk.jobs import PictureJob
from spacemap_vtk.scenes.scene_record import make_record

_MAX_RECENT = 8


class FileCommands(QObject):
    """Commands of the menu "File"."""

    #: The list of recent files has changed; this is the new list.
    recent_changed = Signal(list)

    def __init__(
        self, window: QWidget, document: Document, errors: ErrorBar, times: TimeBar
    ) -> None:
        super().__init__(window)
        self._window, self._document, self._errors = window, document, errors
        self._times = times

    @property
    def recent(self) -> list[str]:
        """Files opened or saved recently that still exist, the latest first."""
        names = QSettings().value("recent") or []
        names = [names] if isinstance(names, str) else list(names)
        return [name for name in names if Path(name).is_file()]

    def new(self) -> None:
        if self.confirm_close():
            self._document.new()

    def open(self) -> None:
        """Ask for a file and open it."""
        if self.confirm_close():
            name = ask_input_file(self._window, "Open", scene_dialog_filters())
            if name:
                self.load(name)

    def load(self, name: str) -> bool:
        """Open a scene or a draft."""
        try:
            self._document.open(name)
        except (SpacemapError, OSError) as error:
            self._errors.show_error(error, "open")
            return False
        if self._document.source is not None:
            self._add_recent(self._document.source)
        return True

    def switch_to(self, name: str) -> None:
        """Open another scene, unless the user decides to stay with the present one."""
        if self.confirm_close():
            self.load(name)

    def save(self) -> bool:
        """Save; ask for a file name if there is none or if its format cannot be written."""
        file = self._document.file
        draft = self._document.opened_draft
        if file is None or (draft is not None and draft.suffix.lower() not in _draft_endings()):
            return self.save_as()
        return self._save(None)

    def save_as(self) -> bool:
        """Ask for a file name and save the scene; an opened draft is saved as a draft."""
        title, ending, filters = "Save as", ".toml", "Scenes (*.toml)"
        draft = self._document.opened_draft
        if draft is not None:
            suffix = draft.suffix.lower()
            ending = suffix if suffix in _draft_endings() else ".wif"
            filters = f"{name_filter('Drafts', _draft_endings())};;{filters}"
            if suffix != ending:
                title = f"Save as ({suffix} cannot be written; the draft is saved as {ending})"
        proposal = self._document.propose_name(ending)
        path = ask_output_file(self._window, title, proposal, filters, ending)
        return path is not None and self._save(path)

    def save_draft(self) -> None:
        """Ask for a file name and write the draft of the cloth."""
        if self._document.opened_draft is not None:
            self.save_as()
            return
        proposal = self._document.propose_name(".wif")
        path = ask_output_file(self._window, "Save draft", proposal, "Drafts (*.wif)", ".wif")
        if path is not None:
            self._write(partial(self._document.save_draft, path))

    def save_picture(self, view: View3D) -> None:
        """Ask for a file name and save a picture of the view."""
        endings = writer_endings("picture")
        filters, first = name_filter("Pictures", endings), next(iter(endings))
        path = ask_output_file(
            self._window, "Save picture", self._document.propose_name(first), filters, first
        )
        if path is None:
            return

        def save() -> list[str]:
            check_output(path, endings)
            with atomic_file(path) as file, attach_record(self._provenance(path, view)):
                writer(path, "picture").write(file, view.image())
            return []

        self._write(save, "picture")

    def _provenance(self, path: Path, view: View3D) -> Record | None:
        """Return the provenance of a picture of the view; None if a part of it is not saved."""
        scene = self._document.scene
        if view.frame is None or self._document.unsaved_file:
            return None
        height, width, _ = view.image().shape
        time = view.frame.time
        job = PictureJob(
            path,
            time,
            (width, height),
            view.panels(scene),
            view.viewpoint,
            wireframe=view.options.wireframe,
        )
        before = scene.view.settings
        try:
            scene.apply_settings({"view": view.settings})
            return make_record(scene, job.as_json(), [time])
        finally:
            scene.apply_settings({"view": before})

    def confirm_close(self) -> bool:
        """Ask whether to save unsaved changes; return whether the document may be closed."""
        if self._document.history.isClean():
            return True
        box = QMessageBox.StandardButton
        answer = QMessageBox.question(
            self._window,
            "Unsaved changes",
            f"Save the changes to {self._document.name}?",
            box.Save | box.Discard | box.Cancel,
            box.Save,
        )
        return answer == box.Discard or (answer == box.Save and self.save())

    def _save(self, path: Path | None) -> bool:
        saved = self._write(partial(self._document.save, path, self._times.time))
        if saved and self._document.file is not None:
            self._add_recent(self._document.file)
        return saved and self._document.history.isClean()

    def _write(self, write: Callable[[], list[str]], kind: str = "file") -> bool:
        try:
            lost = write()
        except (SpacemapError, OSError) as error:
            self._errors.show_error(error, kind)
            return False
        self._errors.clear(kind)
        if lost:
            self._errors.show_warning(f"Saved, but {'; '.join(lost)}.", kind)
        return True

    def _add_recent(self, path: Path) -> None:
        names = [str(path), *(name for name in self.recent if name != str(path))]
        QSettings().setValue("recent", names[:_MAX_RECENT])
        self.recent_changed.emit(self.recent)


def _draft_endings() -> list[str]:
    """Return the file endings of draft formats that can be both read and written."""
    return [ending for ending in writer_endings("draft") if kind_of(Path(f"a{ending}")) == "draft"]
