"""Versions of edited drafts, and states from which cloth is dropped, in temporary files."""

from __future__ import annotations

import hashlib
import re
import shutil
import tempfile
import weakref
from contextlib import ExitStack
from pathlib import Path

from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.temporary_files import hidden_path, lock_folder, remove_abandoned
from spacemap_vtk.textile.drafts.draft import Draft


class DraftVersions:
    """A temporary folder of files named by their content; deleted with this object."""

    # A scene refers to a draft or a state by its file. Because each version has a separate file,
    # undo and redo of the scene's text also undo and redo edits of the draft, and for the pipeline
    # an edited draft is just another file.

    def __init__(self) -> None:
        self._folder: Path | None = None
        #: Name shown to the user for each file.
        self._names: dict[str, str] = {}

    def add(self, draft: Draft, former: Path | None = None) -> Path:
        """Write a draft that was edited from the draft in a former file."""
        name = "new draft" if former is None else f"{former.name} (edited)"
        if former is not None and self.contains(former):
            name = self._names[former.name]
        return self._store(format_wif(draft), ".wif", name)

    def add_file(self, file: Path) -> Path:
        """Copy a draft file into the folder."""
        return self._store(file.read_bytes(), file.suffix, f"{file.name} (earlier version)")

    def add_state(self, cage: vtkUnstructuredGrid) -> Path:
        """Write a cage with its displacement, from which it will be dropped."""
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(cage)
        writer.WriteToOutputStringOn()
        writer.SetDataModeToAscii()
        writer.Write()
        ending = f".{writer.GetDefaultFileExtension()}"
        return self._store(writer.GetOutputString().encode(), ending, "the state before the drop")

    def _store(self, data: bytes, suffix: str, name: str) -> Path:
        try:
            if self._folder is None:
                parent = Path(tempfile.gettempdir()).resolve()
                remove_abandoned(parent)
                self._folder, resources = hidden_path(parent), ExitStack()
                weakref.finalize(self, resources.close)
                resources.callback(shutil.rmtree, self._folder, ignore_errors=True)
                lock_folder(self._folder, resources)
            path = self._folder / f"{hashlib.sha256(data).hexdigest()[:16]}{suffix}"
            if not path.exists():
                try:
                    write_parts(path, [data])
                except OSError:
                    # An incomplete file would later be used as a complete one.
                    path.unlink(missing_ok=True)
                    raise
            self._names.setdefault(path.name, name)
        except OSError as error:
            raise InputError(
                f"a temporary file could not be written ({error.strerror})",
                cure=f"Free space in {tempfile.gettempdir()}.",
            ) from None
        return path

    def contains(self, path: Path | None) -> bool:
        """Return whether a file lies in this folder."""
        return path is not None and self._folder is not None and path.parent == self._folder

    def replace_paths(self, text: object) -> str:
        """Replace the paths of kept drafts in a text by the names that users see."""
        if self._folder is None:
            return str(text)
        pattern = rf"{re.escape(str(self._folder))}[/\\](\w+\.\w+)"
        return re.sub(pattern, lambda match: self._names.get(match[1], "a draft"), str(text))
