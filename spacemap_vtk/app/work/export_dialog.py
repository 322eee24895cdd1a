"""Dialog for file, size and camera of a picture or film, and for the times of a series."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QFormLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from spacemap_vtk.app.documents.file_dialogs import confirm_overwrite
from spacemap_vtk.app.form_dialog import FormDialog
from spacemap_vtk.app.widgets import CountBox, row
from spacemap_vtk.app.work.composition_rows import CompositionRows
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import endings_with_alpha
from spacemap_vtk.scenes.settings import Animation, View
from spacemap_vtk.units import format_quantity, parse_quantity

#: Sizes in pixels, by name. The list starts with the sizes of the window and of the scene.
SIZES = {"1080p": (1920, 1080), "4K": (3840, 2160)}
#: Name of a size that is not in the list.
_OTHER = "Other"
#: Settings key for the last size.
_SIZE_KEY = "export/size"
#: Choices of the camera, each with an explanation.
_CAMERAS = {
    "As in the window": "The same content and background as in the window, fitted to this size.",
    "As in the scene": "Camera, parts and background are those of the scene.",
}


@dataclass
class PictureOptions:
    """Data that the dialog needs for a picture or a film."""

    #: A key of `spacemap_vtk.io.registry.DRAWN`.
    kind: str
    proposal: Path
    filters: str
    #: Width and height in pixels, by name.
    sizes: dict[str, tuple[int, int]]
    transparent: bool
    #: Settings of the view, and a point that the user has picked, or None.
    view: View
    picked: tuple[float, float, float] | None
    #: Whether the scene moves; if not, a film needs an orbit.
    moves: bool
    #: Returns a message for the user about a picture of a size.
    describe: Callable[[tuple[int, int]], str]
    #: Raises an error if file, size and number of frames cannot be written.
    check: Callable[[Path, tuple[int, int], int], None]


def _written_size() -> tuple[int, int] | None:
    """Return the size of the last export, if it was not one with a name."""
    width, _, height = str(QSettings().value(_SIZE_KEY, "")).partition(" x ")
    return (int(width), int(height)) if width.isdigit() and height.isdigit() else None


def stored_size() -> tuple[int, int] | None:
    """Return the size of the last export; None if it was that of the window or of the scene."""
    return _written_size() or SIZES.get(str(QSettings().value(_SIZE_KEY, "")))


class ExportDialog(FormDialog):
    """Ask for file, size and camera, or for the times of a film, or for both."""

    def __init__(
        self,
        parent: QWidget,
        title: str,
        animation: Animation | None = None,
        options: PictureOptions | None = None,
    ) -> None:
        super().__init__(parent, title, "Save", 400)
        self._picture = options
        self._confirmed_name = ""
        #: Chosen times in s; empty if the dialog asks for none.
        self.times: list[float] = []
        self.time_lines: dict[str, QLineEdit] = {}
        if options is not None:
            self._add_picture_rows(self.form, options)
        #: Times of the film as typed; None if the dialog does not ask for them.
        self.animation = None if animation is None else Animation(**animation.settings)
        if animation is not None:
            self._add_time_rows(self.form, animation)
        self.finish()

    @property
    def file(self) -> Path:
        """The file to write."""
        return Path(self.file_line.text())

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width_box.value(), self.height_box.value()

    @property
    def uses_window_view(self) -> bool:
        """Whether to use the camera and the parts of the window."""
        return self.camera.currentIndex() == 0

    @property
    def is_transparent(self) -> bool:
        """Whether the background is transparent."""
        return self.transparent.isEnabled() and self.transparent.isChecked()

    def accept(self) -> None:
        """Accept the dialog, after asking about an existing file."""
        if self._picture is not None:
            # For a name from the file dialog, that dialog has already asked.
            if self.file_line.text() != self._confirmed_name and not confirm_overwrite(
                self, self.file
            ):
                return
            preset = self.preset.currentText()
            size_text = "{} x {}".format(*self.picture_size)
            QSettings().setValue(_SIZE_KEY, size_text if preset == _OTHER else preset)
        super().accept()

    def _add_picture_rows(self, form: QFormLayout, options: PictureOptions) -> None:
        self.file_line = QLineEdit(str(options.proposal), minimumWidth=340)
        self.file_line.textChanged.connect(self.update_summary)
        browse = QPushButton("Browse…")
        browse.clicked.connect(self._browse)
        self.width_box, self.height_box = (
            CountBox(minimum=16, maximum=8192, suffix=" px", toolTip=tip)
            for tip in ("Width", "Height")
        )
        self.preset = QComboBox()
        self.preset.textActivated.connect(self._choose_size)
        self.preset.addItems([*options.sizes, _OTHER])
        stored, size = str(QSettings().value(_SIZE_KEY, "Scene")), _written_size()
        self._show_size(size or options.sizes.get(stored, options.sizes["Scene"]))
        self.preset.setCurrentText(_OTHER if size else stored)
        self.camera = QComboBox()
        self.camera.addItems(list(_CAMERAS))
        self.camera.currentIndexChanged.connect(self.update_summary)
        self.transparent = QCheckBox("Transparent", checked=options.transparent)
        form.addRow("File", row(None, (self.file_line, 1), browse))
        sizes = self.width_box, QLabel("×"), self.height_box
        form.addRow("Size", row(None, self.preset, *sizes, None))
        form.addRow("View", self.camera)
        form.addRow("Background", self.transparent)
        #: Depth of field and close-up.
        self.composition = CompositionRows(form, options.view, options.picked)
        for box in (self.width_box, self.height_box):
            box.valueChanged.connect(self.update_summary)
            box.range_error_changed.connect(self.update_summary)

    def _add_time_rows(self, form: QFormLayout, animation: Animation) -> None:
        labels = {
            "start": "Start time",
            "stop": "End time",
            "frames_per_second": "Frames per second",
            **({} if self._picture is None else {"orbit": "Camera goes round by"}),
        }
        for name, label in labels.items():
            parameter = animation.parameter(name)
            shown = parameter.format(getattr(animation, name))
            line = QLineEdit(shown, toolTip=parameter.help)
            line.textChanged.connect(self.update_summary)
            form.addRow(label, line)
            self.time_lines[name] = line
        if self._picture is not None:
            tip = "Length of the film; if longer than the motion, it plays in slow motion"
            self.time_lines["duration"] = line = QLineEdit(toolTip=tip)
            line.textEdited.connect(self.update_summary)
            form.insertRow(form.rowCount() - 1, "Duration", line)

    def _browse(self) -> None:
        assert self._picture is not None
        text, filters = self.file_line.text(), self._picture.filters
        self._confirmed_name, _ = QFileDialog.getSaveFileName(self, "Export", text, filters)
        if self._confirmed_name:
            self.file_line.setText(self._confirmed_name)

    def _choose_size(self, name: str) -> None:
        assert self._picture is not None
        if name in self._picture.sizes:
            self._show_size(self._picture.sizes[name])
            self.preset.setCurrentText(name)

    def _show_size(self, size: tuple[int, int]) -> None:
        for box, side in zip((self.width_box, self.height_box), size, strict=True):
            box.setValue(side)

    def describe(self) -> str:
        """Describe file, size and times, and remember the times."""
        text = "" if self.animation is None else self._read_times(self.animation)
        if self._picture is None:
            return text
        self._update_picture_rows(self._picture)
        for key, box in (("width", self.width_box), ("height", self.height_box)):
            if box.range_error:
                raise InputError(box.range_error, key=key)
        self._picture.check(self.file, self.picture_size, len(self.times) or 1)
        self._require_motion(self._picture)
        about = self._picture.describe(self.picture_size)
        return " ".join(filter(None, (text, about, _CAMERAS[self.camera.currentText()])))

    def _require_motion(self, options: PictureOptions) -> None:
        """Refuse a film of which all frames are the same."""
        if self.animation is not None and not (options.moves or self.animation.orbit):
            raise InputError(
                "nothing in this scene moves, so all frames would be the same",
                key="orbit",
                cure="Let the camera go round it, for example by 360 deg.",
            )

    def _update_picture_rows(self, options: PictureOptions) -> None:
        if self.sender() in (self.width_box, self.height_box):
            self.preset.setCurrentText(_OTHER)
        ending, endings = self.file.suffix.lower(), endings_with_alpha(options.kind)
        self.transparent.setEnabled(ending in endings)
        reason = f" (only for {', '.join(endings)})"
        self.transparent.setText("Transparent" + ("" if ending in endings else reason))

    def _read_times(self, animation: Animation) -> str:
        """Read the typed times, and return a sentence that describes them."""
        self.times = []
        texts = {name: line.text() for name, line in self.time_lines.items()}
        duration = texts.pop("duration", None)
        animation.configure(**texts)
        span = animation.stop - animation.start
        if duration is not None and self.sender() is self.time_lines["duration"]:
            seconds = parse_quantity(duration, "s")
            if not 0.0 < seconds < float("inf"):
                raise InputError("the duration must be more than 0 s", key="duration")
            animation.speed = span / seconds
        elif duration is not None and span > 0.0:
            self.time_lines["duration"].setText(format_quantity(span / animation.speed, "s"))
        self.times = animation.frame_times()
        interval, count = animation.speed / animation.frames_per_second, len(self.times)
        unit = "frame" if self._picture is not None else "time"
        text = f"{count} {unit}s, {1000 * interval:.4g} ms apart" if count > 1 else f"1 {unit}"
        if animation.speed != 1.0:
            text += f"; 1 s of film shows {format_quantity(animation.speed, 's')}"
        return text if self._picture is None else f"{text}."
