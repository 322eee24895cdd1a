"""List of the pipeline's stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import (
    QAction,
    QBrush,
    QColor,
    QIcon,
    QPainter,
    QPainterPath,
    QPen,
    QPixmap,
)
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem

from spacemap_vtk.app.widgets import RIGHT, painter_on, single_shot
from spacemap_vtk.filters.base import ROLES, Stage
from spacemap_vtk.scenes.pipeline import section_classes, stage_title
from spacemap_vtk.scenes.scene import Scene

#: Colour of the dot and description of each state.
STATES = {
    "fresh": ("#3fa45b", "up to date"),
    "stale": ("#9aa3ae", "waiting to run"),
    "running": ("#e0a526", "running"),
    "failed": ("#d1495b", "failed"),
    "off": ("#609aa3ae", "off; tick the box or set a value to switch it on"),
    "settings": ("#6b8fb3", "settings, not a stage"),
}
_KEY = Qt.ItemDataRole.UserRole
_CHECKED = Qt.CheckState.Checked
#: Columns: name with the dot of the state, time of the last run, number of runs, box to switch the
#: stage on (shown first), eye to show its result.
_NAME, _TIME, _RUNS, _BOX, _EYE = range(5)
#: Width of the columns with box and eye, in pixels.
_ICON_WIDTH = 24


class StageList(QTreeWidget):
    """One line per section: on or off, state, time of the last run, number of runs, visibility."""

    #: The selected section.
    chosen = Signal(str)
    #: A section, and whether its stage shall be on.
    switched = Signal(str, bool)

    def __init__(self) -> None:
        super().__init__(objectName="stages", rootIsDecorated=False, uniformRowHeights=True)
        self.setHeaderLabels(["Pipeline", "Time", "Runs", "", ""])
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        header = self.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(_NAME, QHeaderView.ResizeMode.Stretch)
        header.setMinimumSectionSize(_ICON_WIDTH)
        for column in (_TIME, _RUNS):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        for column in (_BOX, _EYE):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(column, _ICON_WIDTH)
        header.moveSection(_BOX, 0)
        self.items: dict[str, QTreeWidgetItem] = {}
        self.states: dict[str, str] = {}
        # Runs that `write_runs` will write. Each new text causes a new layout of the list, which
        # would take longer than a frame if it happened at every frame.
        self._runs: dict[str, tuple[float, int]] = {}
        #: State of the box of each stage that has one.
        self._boxes: dict[str, bool] = {}
        self._dot_icons = {
            state: _dot_icon(color, state == "off") for state, (color, _) in STATES.items()
        }
        #: Action behind the eye of each section whose stage has one.
        self._eye_actions: dict[str, QAction] = {}
        self._eye_icons = {on: _eye_icon(on) for on in (False, True)}
        self._write_timer = single_shot(self, self.write_runs, 250)
        for section, cls in section_classes().items():
            item = QTreeWidgetItem([stage_title(cls.__name__), "", ""])
            item.setData(_NAME, _KEY, section)
            item.setToolTip(_NAME, (cls.__doc__ or "").strip().splitlines()[0])
            for column in (_TIME, _RUNS):
                item.setTextAlignment(column, RIGHT)
            self.addTopLevelItem(item)
            self.items[section] = item
        self.currentItemChanged.connect(self._emit_chosen)
        self.itemChanged.connect(self._emit_switched)
        self.itemClicked.connect(self._toggle_eye)

    def set_eye_actions(self, eyes: Mapping[str, QAction]) -> None:
        """Give the stages of certain roles an eye that triggers an action."""
        roles = {section: getattr(cls, "role", "") for section, cls in section_classes().items()}
        self._eye_actions = {section: eyes[role] for section, role in roles.items() if role in eyes}
        for action in eyes.values():
            action.toggled.connect(self._show_eyes)

    def show_scene(self, scene: Scene, reset: bool = True) -> None:
        """Show the stages of a scene; without `reset`, only those that were switched change."""
        # The height shows all rows without scrolling.
        row = max(self.sizeHintForRow(0), self.fontMetrics().height() + 4)
        self.setFixedHeight(row * len(self.items) + self.header().sizeHint().height() + 6)
        connected = {stage.section for stage in scene.stages}
        for section, item in self.items.items():
            part = scene.parts[section]
            on, before = section in connected, self.states.get(section, "off")
            if reset or not on:
                item.setText(_TIME, "")
                item.setText(_RUNS, "")
            if reset or on != (before not in ("off", "settings")):
                stage = isinstance(part, Stage)
                self.set_state(section, "settings" if not stage else "stale" if on else "off")
        self.show_boxes(scene)

    def show_boxes(self, scene: Scene) -> None:
        """Show the boxes of the stages that can be switched, checked if the stage is on."""
        # Source and surface cannot be switched off, and crimp interchange needs a woven cloth.
        self._boxes.clear()
        for section, item in self.items.items():
            part, on = scene.parts[section], self.states[section] != "off"
            role = part.role if isinstance(part, Stage) else ROLES[0]
            possible = on or scene.woven is not None or role != "crimp"
            if role not in (ROLES[0], ROLES[-1]) and possible:
                state = _CHECKED if on else Qt.CheckState.Unchecked
                item.setCheckState(_BOX, state)
                self._boxes[section] = on
            else:
                item.setData(_BOX, Qt.ItemDataRole.CheckStateRole, None)
        self._show_eyes()

    def can_switch(self, section: str) -> bool:
        """Return whether the stage of a section can be switched on or off."""
        return section in self._boxes

    def _show_eyes(self) -> None:
        for section, eye in self._eye_actions.items():
            item, is_on = self.items[section], self.states.get(section, "off") != "off"
            item.setIcon(_EYE, self._eye_icons[eye.isChecked()] if is_on else QIcon())
            item.setToolTip(_EYE, eye.toolTip() if is_on else "")

    def _toggle_eye(self, item: QTreeWidgetItem, column: int) -> None:
        if column == _EYE and not item.icon(_EYE).isNull():
            self._eye_actions[item.data(_NAME, _KEY)].trigger()

    def set_state(self, section: str, state: str) -> None:
        if section not in self.items or self.states.get(section) == state:
            return
        self.states[section] = state
        _, description = STATES[state]
        item = self.items[section]
        item.setIcon(_NAME, self._dot_icons[state])
        item.setToolTip(_TIME, description)
        item.setToolTip(_RUNS, description)
        item.setForeground(_NAME, QBrush(QColor("#808b98")) if state == "off" else QBrush())

    def show_run(self, section: str, seconds: float, executions: int) -> None:
        """Show the time of the last run of a stage and its number of runs, after a delay."""
        self._runs[section] = seconds, executions
        if not self._write_timer.isActive():
            self._write_timer.start()

    def write_runs(self) -> None:
        """Write the runs since the last call."""
        for section, (seconds, executions) in self._runs.items():
            took = f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:.3g} s"
            self.items[section].setText(_TIME, took)
            self.items[section].setText(_RUNS, str(executions))
        self._runs.clear()
        # When a column gets narrower, Qt leaves pixels of the former text.
        self.viewport().update()

    def select(self, section: str) -> None:
        self.setCurrentItem(self.items[section])

    def _emit_switched(self, item: QTreeWidgetItem, column: int) -> None:
        section, on = item.data(_NAME, _KEY), item.checkState(_BOX) == _CHECKED
        # This is also called for changes of dots and texts.
        if self._boxes.get(section, on) != on:
            self._boxes[section] = on
            self.switched.emit(section, on)

    def _emit_chosen(self, item: QTreeWidgetItem | None, _before: QTreeWidgetItem | None) -> None:
        if item is not None:
            self.chosen.emit(item.data(_NAME, _KEY))


def _dot_icon(color: str, hollow: bool) -> QIcon:
    icon = QIcon(_pixmap(_draw_dot, color, hollow, False))
    # Otherwise Qt would tint the dot of the selected row, which would hide its state.
    icon.addPixmap(_pixmap(_draw_dot, color, hollow, True), QIcon.Mode.Selected)
    return icon


def _eye_icon(opened: bool) -> QIcon:
    icon = QIcon(_pixmap(_draw_eye, opened, "#6f8fa8" if opened else "#a09aa3ae"))
    icon.addPixmap(_pixmap(_draw_eye, opened, "white"), QIcon.Mode.Selected)
    return icon


def _pixmap(draw: Callable[..., None], *arguments: Any) -> QPixmap:
    pixmap = QPixmap(96, 96)  # sharp on screens of high resolution, too
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = painter_on(pixmap)
    draw(painter, *arguments)
    painter.end()
    return pixmap


def _draw_dot(painter: QPainter, color: str, hollow: bool, ring: bool) -> None:
    if hollow:
        painter.setPen(QPen(QColor(color), 8))
        painter.drawEllipse(28, 28, 40, 40)
    else:
        painter.setBrush(QColor(color))
        painter.setPen(QPen(QColor("white"), 6) if ring else Qt.PenStyle.NoPen)
        painter.drawEllipse(24, 24, 48, 48)


def _draw_eye(painter: QPainter, opened: bool, name: str) -> None:
    color = QColor(name)
    lids = QPainterPath(QPointF(8, 48))
    lids.quadTo(48, 4, 88, 48)
    lids.quadTo(48, 92, 8, 48)
    painter.setPen(QPen(color, 7))
    painter.drawPath(lids)
    if opened:
        painter.setBrush(color)
        painter.drawEllipse(34, 34, 28, 28)
    else:
        painter.drawLine(16, 84, 80, 12)
