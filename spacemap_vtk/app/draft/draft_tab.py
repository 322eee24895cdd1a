"""The draft tab: grids, tools, and the transfer of edits to the scene."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QShowEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QCheckBox,
    QComboBox,
    QGridLayout,
    QLabel,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from spacemap_vtk.app.documents.document import DRAFT_KEYS, Document
from spacemap_vtk.app.documents.file_dialogs import ask_input_file
from spacemap_vtk.app.draft.chart_tab import is_knit
from spacemap_vtk.app.draft.counts import DraftCounts
from spacemap_vtk.app.draft.draft_actions import DraftActions
from spacemap_vtk.app.draft.draft_view import DraftGrid
from spacemap_vtk.app.draft.palette import Palette
from spacemap_vtk.app.widgets import CountBox, action, column, note, row, single_shot, tool_button
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.registry import draft_dialog_filters, kind_of
from spacemap_vtk.scenes.draft_edits import Selection
from spacemap_vtk.scenes.editable_draft import (
    Changes,
    EditableDraft,
    color_values,
    make_editable_draft,
    scene_changes,
)
from spacemap_vtk.textile.drafts.loom import Loom

#: Section that edits change.
_SECTION = "weave"
#: Largest fraction of the time that changes of the scene take during a stroke.
_MAX_LOAD = 0.3
_MAX_COUNT = 4096
_HINT = "Drag: mark · Shift+drag: select · Ctrl: second mark · Right click: menu"


class DraftTab(QWidget):
    """Show and edit the weave of a document; every edit can be undone."""

    #: The error of an edit.
    failed = Signal(object)
    #: An edit was accepted, so earlier errors are obsolete.
    accepted = Signal()
    #: Path of a draft to open instead of the draft that is open.
    open_requested = Signal(str)
    #: Whether a stroke is in progress.
    dragging = Signal(bool)

    def __init__(self, document: Document) -> None:
        super().__init__()
        self._document = document
        self._key: object = None
        self._bursts = itertools.count(1)
        self._burst = 0
        self._commit_time, self._committed_at = 0.0, 0.0
        self._waiting: tuple[EditableDraft, str] | None = None
        #: The loom before the change to a liftplan.
        self._treadle_loom: Loom | None = None
        self._commit_timer = single_shot(self, self._commit)
        #: The draft that the scene has.
        self._committed: EditableDraft | None = None
        self.grid = DraftGrid()
        self.palette_row = Palette()
        self.hint = note(_HINT, alignment=Qt.AlignmentFlag.AlignTop)
        # Fixed height: otherwise the grid would move under the mouse when the hint changes.
        self.hint.setFixedHeight(2 * self.hint.fontMetrics().height() + 2)
        self.placeholder = note(alignment=Qt.AlignmentFlag.AlignCenter)
        self.placeholder.hide()
        self.counts_view = DraftCounts()
        self.counts_view.hide()
        self.counts_view.float_chosen.connect(self._show_float)
        self.tools = QWidget()
        files = self._make_tools()
        below = (
            self.palette_row,
            (self.placeholder, 1),
            (self.grid, 3),
            (self.counts_view, 1),
            self.hint,
        )
        column(self, files, self.tools, *below, margins=(6, 6, 6, 6), spacing=6)
        self.grid.edited.connect(self._receive_edit)
        self.grid.hovered.connect(self._show_hint)
        self.grid.selected.connect(self._show_hint)
        self.grid.refused.connect(self.hint.setText)
        self.commands.message.connect(self.hint.setText)
        self.grid.color_picked.connect(self.palette_row.choose)
        self.palette_row.chosen.connect(self._set_color)
        self.palette_row.changed.connect(self._replace_color)
        document.changed.connect(self.refresh)
        document.replaced.connect(self.palette_row.clear)
        document.replaced.connect(self.refresh)

    def refresh(self) -> None:
        """Show the draft of the document if the tab is visible."""
        # During a stroke the grid is newer than the document.
        if not self.isVisible() or self.grid.is_stroking:
            return
        scene = self._document.scene
        woven = scene.woven
        if woven is None:
            chart = " Its stitches are in the tab Chart." * is_knit(scene)
            self._show_draft(None, f"This scene is not woven, so it has no draft.{chart}")
            return
        if scene.source.section != _SECTION:
            self._show_draft(None, "The draft of this source cannot be edited here.")
            return
        file, settings = scene.draft_file, scene.source.settings
        stamp = file.stat().st_mtime_ns if file and file.is_file() else 0
        names = ("draft", "trim", "pattern", "ends", "picks", "warp_color", "weft_color")
        key = (stamp, *(settings.get(name) for name in names))
        if key == self._key:
            return
        self._key = key
        try:
            shown = make_editable_draft(woven)
        except SpacemapError as error:
            self._show_draft(None, f"{error.message}. {error.cure or ''}".strip())
        else:
            self._show_draft(shown)

    def open(self) -> None:
        """Ask for a draft file and use it in this scene."""
        name = ask_input_file(self, "Open draft", draft_dialog_filters())
        if name and self._document.opened_draft and kind_of(Path(name)) == "draft":
            self.open_requested.emit(name)
        elif name:
            path = str(Path(name).resolve())
            self._set_values({**dict.fromkeys(DRAFT_KEYS), "draft": path}, "draft")

    def showEvent(self, event: QShowEvent) -> None:
        """Show changes that were made while the tab was hidden."""
        super().showEvent(event)
        self.refresh()

    def _make_tools(self) -> QBoxLayout:
        """Create the tools; return the row above them, which is also shown without a draft."""
        tip = "Use a draft file in this scene (.wif, .dtx, .wpo, text rows, picture)"
        self.open_button = tool_button("Open…", tip)
        self.open_button.clicked.connect(self.open)
        self.save_button = tool_button("Save…", "Save the draft as a WIF file for weaving programs")
        draft = self.grid
        self.print_button = tool_button("Print…", "Print the draft for the loom, as a PDF")
        self.zoom_out_button = tool_button("−", "Zoom out (Ctrl+wheel)")
        self.zoom_out_button.clicked.connect(lambda: draft.zoom(False))
        self.zoom_in_button = tool_button("+", "Zoom in (Ctrl+wheel)")
        self.zoom_in_button.clicked.connect(lambda: draft.zoom(True))
        self.fit_button = tool_button("Fit", "Fit the whole draft")
        self.fit_button.clicked.connect(draft.fit)
        tip = "Show the colours of the yarns; off: black where the end is on top"
        self.colors_button = tool_button("Colours", tip, checkable=True, checked=draft.colored)
        tip = "Count ends from the left and picks from the bottom; off: from the right and top"
        self.cloth_button = tool_button("As cloth", tip, checkable=True, checked=draft.as_cloth)
        tip = (
            "Show the reverse of the cloth, turned over around the warp: its ends run the other way"
        )
        self.reverse_button = tool_button("Reverse", tip, checkable=True)
        for button in (self.colors_button, self.cloth_button, self.reverse_button):
            button.toggled.connect(self._update_view)
        tip = "Drag to select cells instead of marking them (or Shift+drag)"
        self.select_button = tool_button("Select", tip, checkable=True)
        self.select_button.toggled.connect(self._set_selects)
        self._make_float_tools()
        reverse = action(self, "Show the reverse", self.reverse_button.toggle, checkable=True)
        self.reverse_button.toggled.connect(reverse.setChecked)
        self.commands = DraftActions(draft, [reverse])
        self.edit_button = tool_button("Edit ▾", "What can be done with the selection, or all")
        self.edit_button.setMenu(self.commands.menu)
        self.edit_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.counts: dict[str, CountBox] = {}
        grid = QGridLayout(self.tools, horizontalSpacing=6)
        grid.setContentsMargins(0, 0, 0, 0)
        for number, (name, tip) in enumerate(
            (
                ("ends", "Number of warp yarns; a larger number repeats the draft"),
                ("picks", "Number of weft yarns; a larger number repeats the draft"),
                ("shafts", "Number of shafts; those in use cannot be removed"),
                ("treadles", "Number of treadles; those in use cannot be removed"),
            )
        ):
            spin = CountBox(minimum=1, maximum=_MAX_COUNT, keyboardTracking=False, toolTip=tip)
            spin.range_error_changed.connect(lambda reason: self.hint.setText(reason or _HINT))
            spin.valueChanged.connect(self._set_count)
            spin.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            grid.addWidget(QLabel(name.capitalize()), number // 2, number % 2 * 2)
            grid.addWidget(spin, number // 2, number % 2 * 2 + 1)
            self.counts[name] = spin
        tip = "Tie-up and treadling, or a liftplan (dobby and table looms)"
        self.loom_kind = QComboBox(toolTip=tip)
        self.loom_kind.activated.connect(self._set_loom_kind)
        self.loom_kind.addItems(["Treadles", "Liftplan"])
        tip = "Marked shafts rise (jack loom); off: they sink (counterbalance loom)"
        self.rising = QCheckBox("Rising shed", toolTip=tip)
        self.rising.clicked.connect(self._set_rising)
        grid.addWidget(self.loom_kind, 2, 0, 1, 2)
        grid.addWidget(self.rising, 2, 2, 1, 2)
        # In rows of their own: beside the files they would widen all tabs of a narrow window.
        views = self.colors_button, self.cloth_button, self.reverse_button
        grid.addLayout(row(None, *views, None, spacing=2), 3, 0, 1, 4)
        sizes = self.zoom_out_button, self.zoom_in_button, self.fit_button
        editing = self.select_button, self.edit_button
        grid.addLayout(row(None, *sizes, None, *editing, spacing=2), 4, 0, 1, 4)
        floats = self.float_box, self.float_limit, self.counts_button
        grid.addLayout(row(None, *floats[:2], None, floats[2], spacing=4), 5, 0, 1, 4)
        files = self.open_button, self.save_button, self.print_button
        return row(None, *files, None, spacing=2)

    def _make_float_tools(self) -> None:
        tip = (
            "Mark floats that pass more crossings than this: of the warp orange, of the weft violet"
        )
        self.float_box = QCheckBox("Floats over", toolTip=tip)
        self.float_limit = CountBox(minimum=1, maximum=999, value=3, toolTip=tip)
        self.float_limit.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.counts_button = tool_button(
            "Counts",
            "Heddles on each shaft, use of treadles, and a list of long floats",
            checkable=True,
        )
        self.float_box.toggled.connect(self._update_view)
        self.float_limit.valueChanged.connect(self._update_view)
        self.counts_button.toggled.connect(self._show_counts_view)

    def _show_draft(self, shown: EditableDraft | None, reason: str = "") -> None:
        if shown is None:
            self._key = None
        for widget in (self.grid, self.tools, self.palette_row, self.hint):
            widget.setVisible(shown is not None)
        self._committed = shown
        self.placeholder.setText(reason)
        self.placeholder.setVisible(shown is None)
        for button in (self.save_button, self.print_button):
            button.setEnabled(shown is not None)
        self.grid.show_draft(shown)
        self._show_counts_view()
        if shown is not None:
            self.palette_row.show_colors(np.concatenate([shown.warp, shown.weft]))
            self._show_counts(shown)

    def _show_counts(self, shown: EditableDraft) -> None:
        loom = shown.loom
        lifted = loom.liftplan is not None
        least = loom.highest_used
        for name, value, low in (
            ("ends", shown.size[0], 1),
            ("picks", shown.size[1], 1),
            ("shafts", loom.shafts, least[0]),
            ("treadles", loom.treadles, least[1]),
        ):
            spin = self.counts[name]
            with QSignalBlocker(spin):
                spin.setRange(min(max(low, 1), value), max(_MAX_COUNT, value))
                spin.setValue(value)
        self.counts["treadles"].setEnabled(not lifted)
        self.loom_kind.setCurrentIndex(int(lifted))
        self.rising.setChecked(loom.rising)

    def _receive_edit(self, shown: EditableDraft, name: str, continues: bool) -> None:
        if not self._burst:
            self._burst = next(self._bursts)
            self.dragging.emit(True)
        self._waiting = shown, name
        wait = self._committed_at + self._commit_time * (1 / _MAX_LOAD - 1) - time.perf_counter()
        if not continues or wait <= 0.0:
            self._commit()
        elif not self._commit_timer.isActive():
            self._commit_timer.start(round(wait * 1e3) + 1)
        if not continues:
            self._burst = 0
            self.dragging.emit(False)
            self.refresh()

    def _commit(self) -> None:
        """Transfer the last state of a stroke to the scene."""
        self._commit_timer.stop()
        if self._waiting is None:
            return
        (shown, name), self._waiting = self._waiting, None
        begin = time.perf_counter()
        self._store(shown, name)
        self._committed_at = time.perf_counter()
        self._commit_time = self._committed_at - begin

    def _store(self, shown: EditableDraft, name: str) -> None:
        """Write the changes of a draft into the scene."""
        before = self._committed
        assert before is not None
        settings = self._document.scene.source.settings
        given = {key for key in DRAFT_KEYS if settings.get(key) is not None}
        former = self._document.scene.draft_file
        try:
            changes = scene_changes(
                before, shown, given, lambda draft: str(self._document.drafts.add(draft, former))
            )
        except SpacemapError as error:
            self.failed.emit(error)
            return
        self._committed = shown
        if changes:
            self._set_values(changes, name)

    def _set_values(self, changes: Changes, name: str) -> None:
        try:
            self._document.set_many(_SECTION, changes, self._burst, name)
        except SpacemapError as error:
            self._key = None
            self.refresh()
            self.failed.emit(error)
        else:
            self._show_hint()  # what was refused before is obsolete
            self.accepted.emit()

    def _set_count(self, value: int) -> None:
        shown = self.grid.shown
        name = next(n for n, spin in self.counts.items() if spin is self.sender())
        if shown is None:
            return
        if name in ("ends", "picks"):
            self._set_values({name: value}, name)
        else:
            loom = shown.loom
            sizes = {"shafts": loom.shafts, "treadles": loom.treadles, name: value}
            self._set_loom(loom.resize(**sizes), name)

    def _set_loom_kind(self, index: int) -> None:
        shown = self.grid.shown
        if shown is not None and index != (shown.loom.liftplan is not None):
            if index:
                self._treadle_loom, loom = shown.loom, shown.loom.with_liftplan
            elif self._treadle_loom is not None and self._treadle_loom.with_liftplan == shown.loom:
                loom = (
                    self._treadle_loom
                )  # the liftplan was not edited: restore the former treadles
            else:
                loom = shown.loom.with_treadles
            self._set_loom(loom, "liftplan" if index else "treadles")

    def _set_rising(self, rising: bool) -> None:
        if self.grid.shown is not None:
            self._set_loom(replace(self.grid.shown.loom, rising=rising), "shed")

    def _set_loom(self, loom: Loom, name: str) -> None:
        assert self.grid.shown is not None
        self._store(self.grid.shown.with_loom(loom), name)

    def _replace_color(self, old: QColor, new: QColor) -> None:
        shown = self.grid.shown
        if shown is None:
            return
        rgb = [old.red(), old.green(), old.blue()]
        changes: Changes = {}
        for family in ("warp", "weft"):
            colors = shown.yarn_colors(family).copy()
            same = (colors == np.array(rgb, dtype=np.uint8)).all(axis=1)
            if same.any():
                colors[same] = new.red(), new.green(), new.blue()
                changes |= color_values(family, colors)
        self._set_values(changes, "colour")

    def _set_color(self, color: QColor) -> None:
        self.grid.color = color

    def _update_view(self) -> None:
        limit = self.float_limit.value()
        self.grid.set_view(
            self.cloth_button.isChecked(),
            self.colors_button.isChecked(),
            self.reverse_button.isChecked(),
            (limit, limit) if self.float_box.isChecked() else None,
        )
        self._show_counts_view()

    def _set_selects(self, on: bool) -> None:
        self.grid.selects = on

    def _show_hint(self, text: str = "") -> None:
        """Show a text, or what is selected, or how to edit."""
        if not text and self.grid.selection is not None:
            text = f"Selected: {self.commands.describe()}."
            text += " Drag it to move it, with Ctrl to copy it." * self.grid.is_movable
        self.hint.setText(text or _HINT)

    def _show_counts_view(self) -> None:
        shown = self.grid.shown
        visible = self.counts_button.isChecked() and shown is not None
        self.counts_view.setVisible(visible)
        if visible and shown is not None:
            limit = self.float_limit.value()
            self.counts_view.show_draft(shown, (limit, limit))

    def _show_float(self, place: Selection, face: bool) -> None:
        """Select a float in the drawdown, on its face."""
        self.reverse_button.setChecked(not face)
        self.grid.select(place)
        self.grid.scroll_to_selection()
