"""Opening, saving, and the question about unsaved changes."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QObject, QSettings, Signal
from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget

from spacemap_vtk.app.ask_file import ask_file
from spacemap_vtk.app.document import Document
from spacemap_vtk.app.error_bar import ErrorBar
from spacemap_vtk.app.view import View3D
from spacemap_vtk.draw.order import Order
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import check_output, whole_file
from spacemap_vtk.io.provenance import Record, recorded
from spacemap_vtk.io.registry import name_filter, opened_filters, writer, written
from spacemap_vtk.scenes.origin import record_of

_RECENT = 8


class Files(QObject):
    """What the menu "File" does."""

    #: The files used lately are others.
    remembered = Signal()

    def __init__(self, window: QWidget, document: Document, errors: ErrorBar) -> None:
        super().__init__(window)
        self._window, self._document, self._errors = window, document, errors

    @property
    def recent(self) -> list[str]:
        """Files opened or saved lately, the last one first, that still exist."""
        kept = QSettings().value("recent") or []
        kept = [kept] if isinstance(kept, str) else list(kept)
        return [name for name in kept if Path(name).is_file()]

    def new(self) -> None:
        if self.may_leave():
            self._document.new()

    def open(self) -> None:
        """Ask for a file, and open it."""
        if self.may_leave():
            name, _ = QFileDialog.getOpenFileName(self._window, "Open", "", opened_filters())
            if name:
                self.load(name)

    def load(self, name: str) -> bool:
        """Open a scene or a draft."""
        try:
            self._document.open(name)
        except (SpacemapError, OSError) as error:
            self._errors.say(error, "file")
            return False
        if self._document.source is not None:
            self._remember(self._document.source)
        return True

    def leave_for(self, name: str) -> None:
        """Open another scene, if the present one can be left."""
        if self.may_leave():
            self.load(name)

    def save(self) -> bool:
        """Save, asking for a name where there is none."""
        return self.save_as() if self._document.file is None else self._write(None)

    def save_as(self) -> bool:
        path = ask_file(self._window, "Save as", "", "Scenes (*.toml)", ".toml")
        return path is not None and self._write(path)

    def save_picture(self, view: View3D) -> None:
        """Ask for a name, and save what the view shows."""
        endings = written("picture")
        filters, first = name_filter("Pictures", endings), next(iter(endings))
        path = ask_file(self._window, "Save picture", f"picture{first}", filters, first)
        if path is None:
            return
        try:
            check_output(path, endings)
            with whole_file(path) as file, recorded(self._record(path, view)):
                writer(path, "picture").write(file, view.image())
        except (SpacemapError, OSError) as error:
            self._errors.say(error, "picture")
        else:
            self._errors.clear("picture")

    def _record(self, path: Path, view: View3D) -> Record | None:
        """Return how a picture of that size, seen so, is made again; of an edited draft nothing."""
        scene = self._document.scene
        if view.frame is None or self._document.drafts.holds(scene.weave.draft):
            return None
        height, width, _ = view.image().shape
        times = [view.frame.time]
        order = Order("picture", path, times, (width, height), view.panels(scene), view.place)
        return record_of(scene, order.told, times)

    def may_leave(self) -> bool:
        """Ask what becomes of unsaved changes."""
        if self._document.undo.isClean():
            return True
        box = QMessageBox.StandardButton
        answer = QMessageBox.question(
            self._window,
            "Unsaved changes",
            f"{self._document.name} has changes that are not saved.",
            box.Save | box.Discard | box.Cancel,
            box.Save,
        )
        return answer == box.Discard or (answer == box.Save and self.save())

    def _write(self, path: Path | None) -> bool:
        try:
            self._document.save(path)
        except (SpacemapError, OSError) as error:
            self._errors.say(error, "file")
            return False
        self._errors.clear("file")
        if self._document.file is not None:
            self._remember(self._document.file)
        return True

    def _remember(self, path: Path) -> None:
        names = [str(path), *(name for name in self.recent if name != str(path))]
        QSettings().setValue("recent", names[:_RECENT])
        self.remembered.emit()
