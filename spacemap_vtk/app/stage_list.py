"""The pipeline as a list."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QBrush, QColor, QIcon, QPainter, QPen, QPixmap
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem

from spacemap_vtk.app.widgets import later
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.scenes.chain import sections, words_of
from spacemap_vtk.scenes.scene import Scene

#: Colour of the dot for each state, and the words for it.
STATES = {
    "fresh": ("#3fa45b", "up to date"),
    "stale": ("#9aa3ae", "waits to be run"),
    "running": ("#e0a526", "running"),
    "failed": ("#d1495b", "failed"),
    "off": ("#609aa3ae", "not part of this scene: set a value, or add it"),
    "settings": ("#6b8fb3", "settings, no stage"),
}
_KEY = Qt.ItemDataRole.UserRole


class StageList(QTreeWidget):
    """A line for each section: state, last run time, executions."""

    #: The section that is chosen.
    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("stages")
        self.setColumnCount(3)
        self.setHeaderLabels(["Pipeline", "Time", "Runs"])
        self.setRootIsDecorated(False)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        header = self.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        for column in (1, 2):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        self.items: dict[str, QTreeWidgetItem] = {}
        self.states: dict[str, str] = {}
        # Each new text lays the list out again: at every frame that would cost more than the frame.
        self._runs: dict[str, tuple[float, int]] = {}
        self._dots: dict[str, QIcon] = {}
        self._flush = later(self, self.flush, 250)
        for section, cls in sections().items():
            item = QTreeWidgetItem([words_of(cls.__name__), "", ""])
            item.setData(0, _KEY, section)
            item.setToolTip(0, (cls.__doc__ or "").strip().splitlines()[0])
            for column in (1, 2):
                item.setTextAlignment(
                    column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
                )
            self.addTopLevelItem(item)
            self.items[section] = item
        self.setUniformRowHeights(True)
        self.currentItemChanged.connect(self._chosen)

    def restart(self, scene: Scene) -> None:
        """Show another scene's stages, none of which has run."""
        # All rows are in sight: the list is the picture of the pipeline.
        row = max(self.sizeHintForRow(0), self.fontMetrics().height() + 4)
        self.setFixedHeight(row * len(self.items) + self.header().sizeHint().height() + 6)
        connected = {stage.section for stage in scene.stages}
        for section, item in self.items.items():
            stage = isinstance(scene.parts[section], Stage)
            item.setText(1, "")
            item.setText(2, "")
            self.set_state(
                section,
                "settings" if not stage else "stale" if section in connected else "off",
            )

    def set_state(self, section: str, state: str) -> None:
        if section not in self.items or self.states.get(section) == state:
            return
        self.states[section] = state
        color, words = STATES[state]
        item = self.items[section]
        if state not in self._dots:
            self._dots[state] = _dot(color, hollow=state == "off")
        item.setIcon(0, self._dots[state])
        item.setToolTip(1, words)
        item.setToolTip(2, words)
        faint = state in ("off",)
        item.setForeground(0, QBrush(QColor("#9aa3ae")) if faint else QBrush())

    def show_run(self, section: str, seconds: float, executions: int) -> None:
        """Show how long a stage ran last, and how often it has run."""
        self._runs[section] = seconds, executions
        if not self._flush.isActive():
            self._flush.start()

    def flush(self) -> None:
        """Write what has been told since the last time."""
        for section, (seconds, executions) in self._runs.items():
            self._write(section, seconds, executions)
        self._runs.clear()

    def _write(self, section: str, seconds: float, executions: int) -> None:
        item = self.items[section]
        item.setText(1, f"{seconds * 1e3:.0f} ms" if seconds < 10 else f"{seconds:.1f} s")
        item.setText(2, str(executions))

    def choose(self, section: str) -> None:
        self.setCurrentItem(self.items[section])

    def _chosen(self, item: QTreeWidgetItem | None, _before: QTreeWidgetItem | None) -> None:
        if item is not None:
            self.chosen.emit(item.data(0, _KEY))


def _dot(color: str, hollow: bool = False) -> QIcon:
    icon = QIcon(_drawn_dot(color, hollow, ring=False))
    # Qt would tint it with the line's own colour, and the chosen stage's state would be lost.
    icon.addPixmap(_drawn_dot(color, hollow, ring=True), QIcon.Mode.Selected)
    return icon


def _drawn_dot(color: str, hollow: bool, ring: bool) -> QPixmap:
    size = 96  # sharp on screens of many pixels, too
    pixmap = QPixmap(size, size)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    if hollow:
        painter.setPen(QPen(QColor(color), 8))
        painter.drawEllipse(28, 28, 40, 40)
    else:
        painter.setBrush(QColor(color))
        painter.setPen(QPen(QColor("white"), 6) if ring else Qt.PenStyle.NoPen)
        painter.drawEllipse(24, 24, 48, 48)
    painter.end()
    return pixmap
