"""Where a picture or film goes, how large it is, from where it is seen; a series' times."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QSpinBox,
    QWidget,
)

from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.settings import Animation
from spacemap_vtk.units import format_quantity


class ExportDialog(QDialog):
    """Asks for file, size and camera."""

    def __init__(
        self, parent: QWidget, kind: str, proposal: str, filters: str, size: tuple[int, int]
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Export {kind}")
        self.filters = filters
        self.line = QLineEdit(str(Path.cwd() / proposal))
        self.line.setMinimumWidth(340)
        browse = QPushButton("Browse…")
        browse.clicked.connect(self._browse)
        self.width_box, self.height_box = QSpinBox(), QSpinBox()
        for box, side in zip((self.width_box, self.height_box), size, strict=True):
            box.setRange(16, 8192)
            box.setValue(side)
            box.setSuffix(" px")
        self.camera = QComboBox()
        self.camera.addItems(["As in the window", "As the scene says"])
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Save | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        form = QFormLayout(self)
        form.setContentsMargins(16, 16, 16, 12)
        form.addRow("File", _beside(self.line, browse))
        form.addRow("Size", _beside(self.width_box, QLabel("×"), self.height_box))
        form.addRow("Seen", self.camera)
        form.addRow(buttons)

    @property
    def file(self) -> Path:
        """The file that is to be written."""
        return Path(self.line.text())

    @property
    def size_chosen(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width_box.value(), self.height_box.value()

    @property
    def as_window(self) -> bool:
        """Whether camera and parts are those of the window."""
        return self.camera.currentIndex() == 0

    def _browse(self) -> None:
        name, _ = QFileDialog.getSaveFileName(self, "Export", self.line.text(), self.filters)
        if name:
            self.line.setText(name)


class TimesDialog(QDialog):
    """Asks for the times of a series, as a film has them."""

    def __init__(self, parent: QWidget, file: Path, animation: Animation) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Times of {file.name}")
        self._animation = Animation(**animation.settings)
        #: The times that are chosen, in s; empty: there are none.
        self.times: list[float] = []
        self.lines: dict[str, QLineEdit] = {}
        form = QFormLayout(self)
        form.setContentsMargins(16, 16, 16, 12)
        labels = {"start": "From", "stop": "To", "frames_per_second": "Frames per second"}
        for name, label in labels.items():
            parameter = self._animation.parameter(name)
            self.lines[name] = line = QLineEdit(parameter.show(getattr(animation, name)))
            line.setToolTip(parameter.help)
            line.textChanged.connect(self._change)
            form.addRow(label, line)
        self.told = QLabel()
        self.told.setWordWrap(True)
        self.told.setMinimumSize(340, 3 * self.told.fontMetrics().lineSpacing())
        form.addRow(self.told)
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Save | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        self.save = buttons.button(QDialogButtonBox.StandardButton.Save)
        form.addRow(buttons)
        self._change()

    def _change(self) -> None:
        """Tell how many times these are, or why they are none."""
        try:
            self._animation.configure(**{name: line.text() for name, line in self.lines.items()})
            self.times = self._animation.frame_times()
            apart = self._animation.speed / self._animation.frames_per_second
            many = len(self.times) > 1
            words = f"{len(self.times)} times, {1000 * apart:.4g} ms apart" if many else "1 time"
            if self._animation.speed != 1.0:
                words += f"; a second of film is {format_quantity(self._animation.speed, 's')}"
        except InputError as error:
            self.times, words = [], str(error)
        self.told.setText(words)
        self.save.setEnabled(bool(self.times))


def _beside(*widgets: QWidget) -> QWidget:
    row = QWidget()
    layout = QHBoxLayout(row)
    layout.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        layout.addWidget(widget)
    if not isinstance(widgets[0], QLineEdit):
        layout.addStretch(1)
    return row
