"""Where a picture or film goes, how large it is, and from where it is seen."""

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


def _beside(*widgets: QWidget) -> QWidget:
    row = QWidget()
    layout = QHBoxLayout(row)
    layout.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        layout.addWidget(widget)
    if not isinstance(widgets[0], QLineEdit):
        layout.addStretch(1)
    return row
