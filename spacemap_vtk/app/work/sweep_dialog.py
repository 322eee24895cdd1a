"""Dialog for a sweep: the parameters that vary, their values, and the folder."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QCompleter,
    QFileDialog,
    QLineEdit,
    QPushButton,
    QWidget,
)

from spacemap_vtk.app.form_dialog import FormDialog
from spacemap_vtk.app.widgets import row
from spacemap_vtk.errors import InputError
from spacemap_vtk.jobs import SweepJob
from spacemap_vtk.jobs.data import format_count
from spacemap_vtk.scenes.pipeline import stage_title
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values
from spacemap_vtk.scenes.sweep import make_sweep

#: Number of rows of the dialog; each varies one parameter.
_ROWS = 3
#: Kinds of parameters that are not varied in lists.
_LONG_KINDS = ("loads", "obstacles", "grips", "cameras", "insets", "file")


class SweepDialog(FormDialog):
    """Ask for up to three parameters with lists of values, and for a folder."""

    def __init__(self, parent: QWidget | None, scene: Scene, proposal: Path) -> None:
        super().__init__(parent, "Run a sweep", "Run", 520)
        self._scene, form = scene, self.form
        #: Editors of each key and of its values.
        self.keys: list[QComboBox] = []
        self.lists: list[QLineEdit] = []
        #: Key of each parameter, by its title.
        self._parameters = _parameters_of(scene)
        for number in range(_ROWS):
            key, values = QComboBox(editable=True), QLineEdit()
            key.addItems(["", *self._parameters])
            completer = QCompleter([*self._parameters], key)
            completer.setFilterMode(Qt.MatchFlag.MatchContains)
            completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
            key.setCompleter(completer)
            key.setToolTip("Search by a word of its name; scene files call it section.key")
            values.setToolTip("0.4 mm, 0.5 mm, 0.6 mm or linspace(0.4 mm, 0.6 mm, 5)")
            if number == 0:
                key.lineEdit().setPlaceholderText("Parameter")
                values.setPlaceholderText("Values, such as 0.4 mm, 0.5 mm")
            key.currentTextChanged.connect(self.update_summary)
            values.textChanged.connect(self.update_summary)
            key.setMinimumWidth(230)
            values.setMinimumWidth(290)
            form.addRow("Vary" if number == 0 else "and", row(None, (key, 1), (values, 1)))
            self.keys.append(key)
            self.lists.append(values)
        self.paired = QCheckBox("Pair the lists: first values together, then second ones")
        self.paired.toggled.connect(self.update_summary)
        self.folder_line = QLineEdit(str(proposal))
        self.folder_line.textChanged.connect(self.update_summary)
        browse = QPushButton("Browse…")
        browse.clicked.connect(self._browse)
        form.addRow("", self.paired)
        form.addRow("New folder", row(None, (self.folder_line, 1), browse))
        self.finish()

    @property
    def assignments(self) -> list[str]:
        """The keys with their lists, ``section.key=value,value``."""
        pairs = zip(self.keys, self.lists, strict=True)
        rows = [(key.currentText().strip(), values.text().strip()) for key, values in pairs]
        return [f"{self._key_of(title)}={values}" for title, values in rows if title and values]

    @property
    def folder(self) -> Path:
        """The folder to write."""
        return Path(self.folder_line.text())

    def _key_of(self, title: str) -> str:
        key = self._parameters.get(title, title)
        if "." not in key:
            raise InputError(
                f'"{title}" is no parameter of this scene', cure="Choose one of the list."
            )
        return key

    def _browse(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Where to create the folder")
        if name:
            self.folder_line.setText(str(Path(name) / self.folder.name))

    def describe(self) -> str:
        """Count the runs."""
        scene, lists = self._scene, self.assignments
        file = (scene.file or Path("scene")).absolute()
        sweep = make_sweep(
            scene, scene_values(scene), lists, file=file, paired=self.paired.isChecked()
        )
        SweepJob(self.folder, lists)
        if not lists:
            return "Choose a parameter, and type several values for it."
        return (
            f"{format_count(len(sweep.runs), 'run')}: for each a picture, a scene and its figures; "
            "together a table and a contact sheet."
        )

    def update_summary(self, *_: object) -> None:
        """Count the runs, and allow to start them if there are any."""
        super().update_summary()
        self.accept_button.setEnabled(self.accept_button.isEnabled() and bool(self.assignments))


def _parameters_of(scene: Scene) -> dict[str, str]:
    """Return the keys of a scene's connected stages and of its view, by their titles."""
    parts = [*(stage.section for stage in scene.stages), scene.view.section]
    keys = {}
    for section in parts:
        stage = stage_title(type(scene.parts[section]).__name__)
        for name, parameter in scene.parts[section].parameters.items():
            if parameter.kind not in _LONG_KINDS:
                keys[f"{stage}: {parameter.label}"] = f"{section}.{name}"
    return keys
