"""The modes: a table, and a swing of the chosen one."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QPushButton,
    QSlider,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.app.job import Swing
from spacemap_vtk.app.widgets import column, note, row
from spacemap_vtk.datasets.modal_model import measures_in, rounding_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.mechanics.damping import Damped, Damping
from spacemap_vtk.mechanics.oscillator import damping_ratio, regime

_HEADINGS = ("Mode", "Frequency", "Damping", "Regime")
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_SIDES = (_RIGHT, _RIGHT, _RIGHT, _LEFT)
#: Seconds that a swing takes on the screen, whatever its frequency.
_PERIOD = 1.2
_TICK = 15
#: Of an amplitude: the most, what it is at first, and what it means.
_SHARES = (
    50,
    15,
    (
        "Largest displacement, in percent of the cage's longest side; with a section [rotation] "
        "a mode is shown up to 90°"
    ),
)
_ANGLES = (
    90,
    45,
    "The angle by which the mode turns the cloth at most; less where it would stretch it by half",
)

#: What the tab says: with modes, without a cage, and where the motion is read from a file.
_HINTS = (
    "Click a mode to see it swing, slowed to a swing in a second.",
    "Nothing moves in this scene: change a value of the modal solver, and it gets a cage that "
    "swings.",
    "The motion is read from a file, and has no modes.",
)


class ModesTab(QWidget):
    """Frequency and damping of each mode; a click lets it swing."""

    #: A `Swing` to show; None for the motion.
    swung = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.table = QTableWidget(0, len(_HEADINGS))
        self.table.setObjectName("modes")
        self.table.setHorizontalHeaderLabels(_HEADINGS)
        for place, side in enumerate(_SIDES):
            self.table.horizontalHeaderItem(place).setTextAlignment(side)
        self.table.verticalHeader().hide()
        header = self.table.horizontalHeader()
        # Not ResizeToContents, which would measure all rows anew at every single cell.
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(len(_HEADINGS) - 1, QHeaderView.ResizeMode.Stretch)
        self.table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setShowGrid(False)
        self.table.setAlternatingRowColors(True)
        self.amplitude = QSlider(Qt.Orientation.Horizontal)
        #: The amplitude in words, and how to go further.
        self.told = QLabel()
        self.amplitude.valueChanged.connect(self._tell_amplitude)
        self._turns: bool | None = None
        self.show_turns(False)
        self.back = QPushButton("Back to the motion")
        self.back.setEnabled(False)
        self.hint = note(_HINTS[0])
        #: What swings: a sheet, with its mass and bending length, or tetrahedra.
        self.sheet = note(name="note")
        below = row(None, QLabel("Amplitude"), (self.amplitude, 1), self.told)
        column(self, self.hint, self.sheet, (self.table, 1), below, self.back, margins=(6, 6, 6, 6))
        self._known: Any = None
        self._mode: int | None = None
        self._begun = 0.0
        self._timer = QTimer(self)
        self._timer.setInterval(_TICK)
        self._timer.timeout.connect(self._tick)
        self.table.cellClicked.connect(self._clicked)
        self.table.currentCellChanged.connect(self._moved)
        self.back.clicked.connect(self.stop)

    @property
    def mode(self) -> int | None:
        """The mode that swings, if one does."""
        return self._mode

    def show_modes(self, cage: vtkUnstructuredGrid | None, mover: Stage | None) -> None:
        """Fill the table, if modes or damping are others."""
        array = None if cage is None else cage.GetFieldData().GetArray("eigenvalues")
        values = np.zeros(0) if array is None else vtk_to_numpy(array)
        try:
            damping = mover.damping if isinstance(mover, Damped) else Damping()
        except InputError:
            return  # two ways that contradict each other: the run says so
        self.hint.setText(_HINTS[0 if len(values) else 1 if cage is None else 2])
        found = measures_in(cage)
        self.sheet.setText(_told(found))
        self.sheet.setVisible(bool(found))
        known = (values.tobytes(), damping)
        if known == self._known:
            return
        self._known = known
        self.table.setRowCount(len(values))
        rates = damping.alphas(values), damping.beta
        lost = 0.0 if cage is None or array is None else rounding_of(cage)
        ratios, kinds = damping_ratio(values, *rates), regime(values, *rates, lost)
        for number, (value, ratio, kind) in enumerate(zip(values, ratios, kinds, strict=True)):
            texts = (
                str(number),
                f"{math.sqrt(max(value, 0.0)) / (2 * math.pi):.4g} Hz",
                f"{ratio:.3g}" if math.isfinite(ratio) else "–",
                str(kind),
            )
            for place, text in enumerate(texts):
                item = QTableWidgetItem(text)
                item.setTextAlignment(_SIDES[place])
                self.table.setItem(number, place, item)
            # In a narrow window its end is cut off.
            item.setToolTip(text)
        # Not the last one, which takes the room that is left.
        for place in range(self.table.columnCount() - 1):
            self.table.resizeColumnToContents(place)
        if self._mode is not None and self._mode >= len(values):
            self.stop()

    def show_turns(self, turns: bool) -> None:
        """Let amplitudes be angles, or not: where turning stretches, there is no large one."""
        if turns == self._turns:
            return
        self._turns = turns
        most, value, tip = _ANGLES if turns else _SHARES
        self.amplitude.setRange(1, most)
        self.amplitude.setValue(value)
        self.amplitude.setToolTip(tip)
        self._tell_amplitude()

    def stop(self) -> None:
        """Show the motion again."""
        if self._mode is not None:
            self.release()
            self.swung.emit(None)

    def release(self) -> None:
        """Let nothing swing any more; something else is shown."""
        self._mode = None
        self._timer.stop()
        self.table.clearSelection()
        self.back.setEnabled(False)

    def _clicked(self, row: int, _column: int) -> None:
        self._mode = row
        self._begun = time.perf_counter()
        self.back.setEnabled(True)
        self._timer.start()

    def _moved(self, row: int, *_: int) -> None:
        """Let the arrow keys go from one swinging mode to the next."""
        if self._mode is not None and row >= 0:
            self._mode = row

    def _tick(self) -> None:
        if self._mode is not None:
            phase = (time.perf_counter() - self._begun) / _PERIOD
            value = self.amplitude.value()
            angle = math.radians(value) if self._turns else None
            self.swung.emit(Swing(self._mode, value / 100, phase, angle))

    def _tell_amplitude(self) -> None:
        value = self.amplitude.value()
        self.told.setText(f"{value}°" if self._turns else f"{value} %")


def _told(found: dict[str, Any]) -> str:
    """Return what a cage was found to be in a sentence."""
    if "bending_length" not in found:
        return f"The cage is of {found['elements']}." if found else ""
    mass, length = (
        ModalSolver.parameter(name).tell(found[name]) for name in ("areal_mass", "bending_length")
    )
    return f"The cage is a sheet: areal mass {mass}; bending length {length}."
