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
    QWidget,
)

from spacemap_vtk.app.documents.ask_file import ask_opened
from spacemap_vtk.app.documents.document import DRAFTED, Document
from spacemap_vtk.app.draft.draft_view import DraftGrid
from spacemap_vtk.app.draft.palette import Palette
from spacemap_vtk.app.draft.strokes import NAMES
from spacemap_vtk.app.widgets import CountBox, column, later, note, row, tool_button
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.registry import draft_dialog_filters, kind_of
from spacemap_vtk.scenes.shown import Changes, Shown, as_colors, as_draft, as_pattern, shown_of
from spacemap_vtk.textile.drafts.loom import Loom

#: Section that edits change.
_SECTION = "weave"
#: Largest fraction of the time that changes of the scene take during a stroke.
_SHARE = 0.3
_MOST = 4096
_HINT = "Drag, or arrows and Enter, to edit · Ctrl: a second mark · Ctrl+wheel: zoom"


class DraftTab(QWidget):
    """Show and edit the weave of a document; every edit can be undone."""

    #: The error of an edit.
    failed = Signal(object)
    #: An edit was accepted, so earlier errors are obsolete.
    accepted = Signal()
    #: Path of a draft to open instead of the draft that is open.
    left = Signal(str)
    #: Whether a stroke is in progress.
    held = Signal(bool)

    def __init__(self, document: Document) -> None:
        super().__init__()
        self._document = document
        self._key: object = None
        self._bursts = itertools.count(1)
        self._burst = 0
        self._cost, self._done = 0.0, 0.0
        self._waiting: tuple[Shown, str] | None = None
        #: The loom before the change to a liftplan.
        self._tied: Loom | None = None
        self._later = later(self, self._commit)
        self.grid = DraftGrid()
        self.palette_row = Palette()
        self.hint = note(_HINT, alignment=Qt.AlignmentFlag.AlignTop)
        # Fixed height: otherwise the grid would move under the mouse when the hint changes.
        self.hint.setFixedHeight(2 * self.hint.fontMetrics().height() + 2)
        self.empty = note(alignment=Qt.AlignmentFlag.AlignCenter)
        self.empty.hide()
        self.tools = QWidget()
        files = self._make_tools()
        below = (self.palette_row, (self.empty, 1), (self.grid, 1), self.hint)
        column(self, files, self.tools, *below, margins=(6, 6, 6, 6), spacing=6)
        self.grid.edited.connect(self._edited)
        self.grid.hovered.connect(lambda words: self.hint.setText(words or _HINT))
        self.grid.refused.connect(self.hint.setText)
        self.grid.took.connect(self.palette_row.choose)
        self.palette_row.chosen.connect(self._chose)
        self.palette_row.changed.connect(self._recolored)
        document.changed.connect(self.refresh)
        document.replaced.connect(self.palette_row.begin)
        document.replaced.connect(self.refresh)

    def refresh(self) -> None:
        """Show the draft of the document if the tab is visible."""
        # During a stroke the grid is newer than the document.
        if not self.isVisible() or self.grid.stroking:
            return
        scene = self._document.scene
        woven = scene.woven
        if woven is None:
            self._show(None, "This scene is not woven, and has no draft.")
            return
        if scene.source.section != _SECTION:
            self._show(None, f"The draft of [{scene.source.section}] cannot be edited here.")
            return
        file, settings = scene.draft_file, scene.source.settings
        stamp = file.stat().st_mtime_ns if file and file.is_file() else 0
        names = ("draft", "trim", "pattern", "ends", "picks", "warp_color", "weft_color")
        key = (stamp, *(settings.get(name) for name in names))
        if key == self._key:
            return
        self._key = key
        try:
            shown = shown_of(woven)
        except SpacemapError as error:
            self._show(None, f"{error.message}. {error.cure or ''}".strip())
        else:
            self._show(shown)

    def open(self) -> None:
        """Ask for a draft file and use it in this scene."""
        name = ask_opened(self, "Open draft", draft_dialog_filters())
        if name and self._document.opened_draft and kind_of(Path(name)) == "draft":
            self.left.emit(name)
        elif name:
            path = str(Path(name).resolve())
            self._change({**dict.fromkeys(DRAFTED), "draft": path}, "draft")

    def showEvent(self, event: QShowEvent) -> None:
        """Show changes that were made while the tab was hidden."""
        super().showEvent(event)
        self.refresh()

    def _make_tools(self) -> QBoxLayout:
        """Create the tools; return the row above them, which is also shown without a draft."""
        tip = "Weave a draft from a file (.wif, .dtx, .wpo, rows, picture)"
        self.opened = tool_button("Open…", tip)
        self.opened.clicked.connect(self.open)
        self.saved = tool_button("Save…", "Write the draft as WIF, for weaving programs")
        draft = self.grid
        self.smaller = tool_button("−", "Smaller (Ctrl+wheel)")
        self.smaller.clicked.connect(lambda: draft.zoom(False))
        self.larger = tool_button("+", "Larger (Ctrl+wheel)")
        self.larger.clicked.connect(lambda: draft.zoom(True))
        self.fit = tool_button("Fit", "Show the whole draft")
        self.fit.clicked.connect(draft.fit)
        tip = "The yarns' colours; else black where the end is up"
        self.colors = tool_button("Colours", tip, checkable=True, checked=draft.colored)
        tip = "End 1 left and pick 1 below, as the cloth lies; else as on paper, right and above"
        self.cloth = tool_button("As cloth", tip, checkable=True, checked=draft.as_cloth)
        for button in (self.colors, self.cloth):
            button.toggled.connect(self._view_chosen)
        self.counts: dict[str, CountBox] = {}
        grid = QGridLayout(self.tools, horizontalSpacing=6)
        grid.setContentsMargins(0, 0, 0, 0)
        for number, (name, tip) in enumerate(
            (
                ("ends", "Warp yarns; more repeat the draft"),
                ("picks", "Weft yarns; more repeat the draft"),
                ("shafts", "Of the loom; those in use cannot be taken away"),
                ("treadles", "Of the loom; those in use cannot be taken away"),
            )
        ):
            spin = CountBox(minimum=1, maximum=_MOST, keyboardTracking=False, toolTip=tip)
            spin.strayed.connect(lambda why: self.hint.setText(why or _HINT))
            spin.valueChanged.connect(self._counted)
            spin.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            grid.addWidget(QLabel(name.capitalize()), number // 2, number % 2 * 2)
            grid.addWidget(spin, number // 2, number % 2 * 2 + 1)
            self.counts[name] = spin
        tip = "Tie-up and treadling, or the shafts of each pick (dobby, table loom)"
        self.kind = QComboBox(toolTip=tip)
        self.kind.activated.connect(self._kind_chosen)
        self.kind.addItems(["Treadles", "Liftplan"])
        tip = "Marked shafts rise (jack loom); else they sink (counterbalance)"
        self.rising = QCheckBox("Rising shed", toolTip=tip)
        self.rising.clicked.connect(self._rising_chosen)
        grid.addWidget(self.kind, 2, 0, 1, 2)
        grid.addWidget(self.rising, 2, 2, 1, 2)
        grid.addWidget(self.colors, 3, 0, 1, 2)
        grid.addWidget(self.cloth, 3, 2, 1, 2)
        sizes = (self.smaller, self.larger, self.fit)
        return row(None, self.opened, self.saved, None, *sizes, spacing=2)

    def _show(self, shown: Shown | None, why: str = "") -> None:
        if shown is None:
            self._key = None
        for widget in (self.grid, self.tools, self.palette_row, self.hint):
            widget.setVisible(shown is not None)
        self.empty.setText(why)
        self.empty.setVisible(shown is None)
        self.saved.setEnabled(shown is not None)
        self.grid.show_draft(shown)
        if shown is not None:
            self.palette_row.show_colors(shown)
            self._show_counts(shown)

    def _show_counts(self, shown: Shown) -> None:
        loom = shown.loom
        lifted = loom.liftplan is not None
        least = loom.used
        for name, value, low in (
            ("ends", shown.size[0], 1),
            ("picks", shown.size[1], 1),
            ("shafts", loom.shafts, least[0]),
            ("treadles", loom.treadles, least[1]),
        ):
            spin = self.counts[name]
            with QSignalBlocker(spin):
                spin.setRange(min(max(low, 1), value), max(_MOST, value))
                spin.setValue(value)
        self.counts["treadles"].setEnabled(not lifted)
        self.kind.setCurrentIndex(int(lifted))
        self.rising.setChecked(loom.rising)

    def _edited(self, shown: Shown, name: str, going_on: bool) -> None:
        if not self._burst:
            self._burst = next(self._bursts)
            self.held.emit(True)
        self._waiting = shown, name
        rest = self._done + self._cost * (1 / _SHARE - 1) - time.perf_counter()
        if not going_on or rest <= 0.0:
            self._commit()
        elif not self._later.isActive():
            self._later.start(round(rest * 1e3) + 1)
        if not going_on:
            self._burst = 0
            self.held.emit(False)
            self.refresh()

    def _commit(self) -> None:
        """Transfer the last state of a stroke to the scene."""
        self._later.stop()
        if self._waiting is None:
            return
        (shown, name), self._waiting = self._waiting, None
        begun = time.perf_counter()
        if name in (NAMES["warp"], NAMES["weft"]):
            family = "warp" if name == NAMES["warp"] else "weft"
            self._change(as_colors(family, shown.strip(family)), name)
        elif name == NAMES["drawdown"]:
            self._change(as_pattern(shown), name)
        else:
            self._weave(shown, name)
        self._done = time.perf_counter()
        self._cost = self._done - begun

    def _weave(self, shown: Shown, name: str) -> None:
        try:
            former = self._document.scene.draft_file
            path = self._document.drafts.keep(as_draft(shown), former)
        except SpacemapError as error:
            self.failed.emit(error)
            return
        self._change({"draft": str(path), "pattern": None}, name)

    def _change(self, changes: Changes, name: str) -> None:
        try:
            self._document.set_many(_SECTION, changes, self._burst, name)
        except SpacemapError as error:
            self._key = None
            self.refresh()
            self.failed.emit(error)
        else:
            self.accepted.emit()

    def _counted(self, value: int) -> None:
        shown = self.grid.shown
        name = next(n for n, spin in self.counts.items() if spin is self.sender())
        if shown is None:
            return
        if name in ("ends", "picks"):
            self._change({name: value}, name)
        else:
            loom = shown.loom
            sizes = {"shafts": loom.shafts, "treadles": loom.treadles, name: value}
            self._reloom(loom.sized(**sizes), name)

    def _kind_chosen(self, index: int) -> None:
        shown = self.grid.shown
        if shown is not None and index != (shown.loom.liftplan is not None):
            if index:
                self._tied, loom = shown.loom, shown.loom.with_liftplan
            elif self._tied is not None and self._tied.with_liftplan == shown.loom:
                loom = self._tied  # the liftplan was not edited: restore the former treadles
            else:
                loom = shown.loom.with_treadles
            self._reloom(loom, "liftplan" if index else "treadles")

    def _rising_chosen(self, rising: bool) -> None:
        if self.grid.shown is not None:
            self._reloom(replace(self.grid.shown.loom, rising=rising), "shed")

    def _reloom(self, loom: Loom, name: str) -> None:
        assert self.grid.shown is not None
        self._weave(self.grid.shown.with_loom(loom), name)

    def _recolored(self, old: QColor, new: QColor) -> None:
        shown = self.grid.shown
        if shown is None:
            return
        rgb = [old.red(), old.green(), old.blue()]
        changes: Changes = {}
        for family in ("warp", "weft"):
            colors = shown.strip(family).copy()
            same = (colors == np.array(rgb, dtype=np.uint8)).all(axis=1)
            if same.any():
                colors[same] = new.red(), new.green(), new.blue()
                changes |= as_colors(family, colors)
        self._change(changes, "colour")

    def _chose(self, color: QColor) -> None:
        self.grid.color = color

    def _view_chosen(self) -> None:
        self.grid.set_view(self.cloth.isChecked(), self.colors.isChecked())
