"""Table of what a draft needs and of its longest floats."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QEvent, QObject, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractItemView, QLabel, QSizePolicy, QTableWidgetItem, QWidget

from spacemap_vtk.app.widgets import RIGHT, column, results_table, row, tool_button
from spacemap_vtk.scenes.draft_edits import Selection
from spacemap_vtk.scenes.editable_draft import FAMILIES, EditableDraft
from spacemap_vtk.textile.drafts.floats import FloatLimits, YarnFloats, find_floats
from spacemap_vtk.textile.drafts.loom import count_marks

#: Most floats of the warp or the weft on one face that are listed.
_MAX_FLOATS = 200
_FAMILIES = ("Warp float", "Weft float")
_FACES = ("reverse", "face")


class DraftCounts(QWidget):
    """Count heddles and treadles, and list floats; rows can be copied."""

    #: The place of a clicked float in the drawdown, and whether it is on the face.
    float_chosen = Signal(object, bool)

    def __init__(self) -> None:
        super().__init__()
        self.table = results_table(("Number", "What", "Where"))
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.horizontalHeader().setStretchLastSection(True)
        self.table.setMinimumHeight(80)
        self.table.setMaximumHeight(150)
        self.table.installEventFilter(self)
        self.summary = QLabel()
        # Its words must not widen a narrow tab.
        self.summary.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.copy_button = tool_button("Copy", "Copy the table, or its selected rows (Ctrl+C)")
        self.copy_button.clicked.connect(self.copy)
        top = row(None, (self.summary, 1), self.copy_button)
        column(self, top, (self.table, 1), margins=(0, 0, 0, 0), spacing=2)
        self.table.itemSelectionChanged.connect(self._choose)
        self._key: object = None
        self._places: dict[int, tuple[Selection, bool]] = {}

    def show_draft(self, shown: EditableDraft, limits: FloatLimits) -> None:
        """Fill the table; floats are listed that pass more crossings than the limits."""
        if (shown, limits) == self._key:
            return  # keep the selected rows
        self._key = shown, limits
        loom = shown.loom
        heddles = count_marks(loom.threading, loom.shafts)
        rows = [(str(n), "Heddles", f"shaft {k}") for k, n in enumerate(heddles, start=1)]
        rows.append((str(sum(heddles)), "Heddles", "all shafts"))
        what, where = ("Lifts", "shaft") if loom.liftplan is not None else ("Picks", "treadle")
        uses = count_marks(shown.treadling, shown.columns)
        rows += [(str(n), what, f"{where} {k}") for k, n in enumerate(uses, start=1)]
        self._places = {}
        sentences = []
        for family, most in enumerate(limits):
            both = [find_floats(shown.drawdown, family, face) for face in (False, True)]
            for face in (True, False):
                rows += self._float_rows(both[face].longer_than(most), family, face, len(rows))
            reverse, front = (len(floats.longer_than(most).length) for floats in both)
            longest = max(floats.longest for floats in both)
            name = FAMILIES[family].capitalize()
            sentences.append(
                f"{name} floats over {most}: {front} on the face, {reverse} on the reverse; "
                f"longest {longest}"
            )
        self.table.blockSignals(True)
        self.table.clearSelection()
        self.table.setRowCount(len(rows))
        for number, words in enumerate(rows):
            for place, word in enumerate(words):
                item = QTableWidgetItem(word)
                if place == 0:
                    item.setTextAlignment(RIGHT)
                self.table.setItem(number, place, item)
        self.table.blockSignals(False)
        self.summary.setText("\n".join(sentences))
        over = " and ".join(map(str, dict.fromkeys(limits)))
        self.summary.setToolTip(f"Number of floats over {over} crossings, and the longest float")

    def _float_rows(
        self, floats: YarnFloats, family: int, face: bool, first: int
    ) -> list[tuple[str, str, str]]:
        """Return rows of the longest floats, and keep where they are."""
        name, where = f"{_FAMILIES[family]}, {_FACES[face]}", ("end", "pick")[family]
        passed = ("picks", "ends")[family]
        rows = []
        for index in np.argsort(-floats.length, kind="stable")[:_MAX_FLOATS].tolist():
            yarn, begin, length = (int(each[index]) for each in floats)
            along = begin + 1, begin + length
            place = f"{where} {yarn + 1}, {passed} {along[0]}–{along[1]}"
            rows.append((str(length), name, place))
            across = yarn + 1, yarn + 1
            x, y = (across, along) if family == 0 else (along, across)
            self._places[first + len(rows) - 1] = Selection("drawdown", x, y), face
        if len(floats.length) > _MAX_FLOATS:
            rows.append(("…", name, f"{len(floats.length) - _MAX_FLOATS} more"))
        return rows

    def as_text(self) -> str:
        """Return the selected rows, or all, with tabs between the columns."""
        chosen = sorted({item.row() for item in self.table.selectedItems()})
        numbers = chosen or range(self.table.rowCount())
        return "\n".join(
            "\t".join(self.table.item(number, place).text() for place in range(3))
            for number in numbers
        )

    def copy(self) -> None:
        """Copy the rows to the clipboard."""
        QGuiApplication.clipboard().setText(self.as_text())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Copy rows by key, before a shortcut of the window or the table copies something else."""
        if not (isinstance(event, QKeyEvent) and event.matches(QKeySequence.StandardKey.Copy)):
            return False
        event.accept()
        if event.type() == QEvent.Type.KeyPress:
            self.copy()
        return True

    def _choose(self) -> None:
        chosen = {item.row() for item in self.table.selectedItems()}
        if len(chosen) == 1 and (number := chosen.pop()) in self._places:
            self.float_chosen.emit(*self._places[number])
