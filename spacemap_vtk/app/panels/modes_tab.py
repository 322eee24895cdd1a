"""The modes tab: a table of the modes, and an animation of the chosen one."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QBrush, QPalette, QShowEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QPushButton,
    QSlider,
    QTableWidgetItem,
    QWidget,
)
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.panels.add_stage import AddStageButton
from spacemap_vtk.app.panels.mode_errors import ModeErrors, compute_errors
from spacemap_vtk.app.panels.response_plot import ResponsePlot
from spacemap_vtk.app.plots.curves import Spectrum
from spacemap_vtk.app.widgets import RIGHT, column, note, row, table
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.app.work.frame_request import Swing
from spacemap_vtk.datasets.modal_model import rounding_of, solver_results
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.mechanics.modal.damping import Damping, HasDamping
from spacemap_vtk.mechanics.modal.resolution import UNRESOLVED, describe_unresolved_modes
from spacemap_vtk.mechanics.response.oscillator import classify_regimes, damping_ratio
from spacemap_vtk.units import align_decimals, format_errors, typeset_units

_HEADINGS = ("Mode", "f [Hz]", "Damping", "Mass")
_FREQUENCY = _HEADINGS.index("f [Hz]")
_MASS = _HEADINGS.index("Mass")
#: Prefix of a frequency whose mode the cells of the cage are too large to resolve.
_APPROXIMATE = "≈ "
_TIPS = (
    "",
    "Natural frequency without damping",
    "Damping ratio of a mode that oscillates; a mode with 1 or more is overdamped",
    "Effective mass along the axis where it is largest, as a fraction of the movable mass",
)
#: An effective mass below this fraction is shown as a dash.
_MIN_MASS = 0.005
#: How often it is checked that the estimate of errors has not been replaced, in ms.
_RETRY = 500
#: Period of the animation on the screen in s, whatever the mode's frequency.
_PERIOD = 1.2
_TICK = 15
#: Largest and first value of the amplitude slider, and its tooltip.
_SHARES = (
    50,
    15,
    (
        "Largest displacement in % of the cage's longest side. With the stage Rotation strain, "
        "modes can be shown up to 90°."
    ),
)
_ANGLES = (
    90,
    45,
    "Largest rotation of the cloth; less if the cloth would be stretched by half",
)

#: Hints of the tab: with modes; without a cage; with a motion that is read from a file.
_HINTS = (
    "Click a mode to animate it, slowed to about one swing per second.",
    "This scene does not move. Modal response adds a cage around the fabric, and lets it swing.",
    "The motion is read from a file, which has no modes.",
)
_COMPUTING = "The modes are being computed."
_NONE_YET = "The modes have not been computed."


class ModesTab(QWidget):
    """Show frequency, damping and effective mass of each mode; a click animates the mode."""

    #: A `Swing` to show, or None for the motion.
    swing_changed = Signal(object)

    def __init__(self, document: Document, engine: Engine) -> None:
        super().__init__()
        self.table = table("modes", _HEADINGS)
        for place, tip in enumerate(_TIPS):
            self.table.horizontalHeaderItem(place).setTextAlignment(RIGHT)
            self.table.horizontalHeaderItem(place).setToolTip(tip)
        header = self.table.horizontalHeader()
        # Not ResizeToContents, which would measure all rows again after each cell.
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(len(_HEADINGS) - 1, QHeaderView.ResizeMode.Stretch)
        self.table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.amplitude = QSlider(Qt.Orientation.Horizontal)
        self.amplitude.valueChanged.connect(self._show_amplitude)
        #: The amplitude in words.
        self.amplitude_text = QLabel()
        self._uses_angles: bool | None = None
        self.set_angles(False)
        self.back_button = QPushButton("Return to motion", enabled=False)
        self.back_button.clicked.connect(self.stop)
        self.hint = note(_HINTS[0])
        self.add_button = AddStageButton("response")
        #: Plot of the frequency response, which also provides the effective masses.
        self.response = ResponsePlot(document, engine)
        self.response.chosen.connect(self._animate_mode)
        self.response.found.connect(self._show_spectrum)
        #: Kind of the cage: a sheet with areal mass and bending length, or other elements.
        self.sheet = note(name="note")
        #: Warning about modes that the cells are too large to resolve.
        self.unresolved = note(name="note")
        self.unresolved.hide()
        self.errors_button = QPushButton("Estimate errors")
        self.errors_button.setToolTip(
            "Solve the cage again in wider cells, and show how far each frequency depends on the "
            "cells"
        )
        self.errors_button.clicked.connect(self._request_or_cancel_errors)
        # Other background work may take the place of the estimate, which is then requested again.
        self._retry = QTimer(self, interval=_RETRY)
        self._retry.timeout.connect(self._retry_errors)
        self._document, self._engine = document, engine
        engine.background_ready.connect(self._receive_errors)
        #: Controls of the animation; hidden without modes.
        self.controls = QWidget()
        amplitude = row(None, QLabel("Amplitude"), (self.amplitude, 1), self.amplitude_text)
        column(self.controls, amplitude, row(None, self.back_button, self.errors_button))
        layout = column(
            self,
            self.hint,
            self.add_button,
            self.sheet,
            self.unresolved,
            (self.table, 1),
            self.response,
            self.controls,
            margins=(6, 6, 6, 6),
        )
        layout.addStretch(0)  # without a table, the rest stays at the top
        self._modes_key: Any = None
        #: Modes and damping to which the shown masses and the response belong.
        self._masses_key: Any = None
        #: Index of the animated mode, or None.
        self.mode: int | None = None
        self._started_at = 0.0
        self._timer = QTimer(self, interval=_TICK)
        self._timer.timeout.connect(self._tick)
        self.table.cellClicked.connect(self._start_animation)
        self.table.currentCellChanged.connect(self._follow_selection)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.response.request_again()

    def clear(self) -> None:
        """Clear the tab until the first frame of a new scene."""
        self._modes_key = None
        self.table.setRowCount(0)
        self.hint.clear()
        self.add_button.hide()
        self.sheet.hide()
        self.unresolved.hide()
        self.response.clear()

    def expect_modes(self) -> None:
        """Without modes, say that they are being computed if the scene has some."""
        if not self.table.rowCount() and self._document.scene.stage("solver") is not None:
            self.hint.setText(_COMPUTING)
            self.add_button.hide()

    def show_ended(self) -> None:
        """Say that there are no modes: the run has failed or was cancelled."""
        if self.hint.text() == _COMPUTING:
            self.hint.setText(_NONE_YET)

    def show_modes(self, cage: vtkUnstructuredGrid | None, mover: Stage | None) -> None:
        """Fill the table if the modes or the damping have changed."""
        array = None if cage is None else cage.GetFieldData().GetArray("eigenvalues")
        values = np.zeros(0) if array is None else vtk_to_numpy(array)
        try:
            damping = mover.damping if isinstance(mover, HasDamping) else Damping()
        except InputError:
            return  # contradictory parameters of damping; the run reports the error
        self.hint.setText(_HINTS[0 if len(values) else 1 if cage is None else 2])
        self.add_button.setVisible(cage is None)
        for widget in (self.table, self.controls):
            widget.setVisible(bool(len(values)))
        figures = solver_results(cage)
        self.sheet.setText(_describe_cage(figures))
        self.sheet.setVisible(bool(figures))
        key = (values.tobytes(), damping)
        if key == self._modes_key:
            return
        self._modes_key = key
        self.unresolved.hide()
        self._set_estimating(False)
        self.errors_button.setVisible(bool(len(values)))
        if cage is None:
            self.response.clear()
        self.table.setRowCount(len(values))
        rates = damping.mass_damping(values), damping.beta
        rounding = 0.0 if cage is None or array is None else rounding_of(cage)
        ratios, kinds = damping_ratio(values, *rates), classify_regimes(values, *rates, rounding)
        frequencies = np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)
        self.response.frequencies = frequencies
        spectrum = self.response.spectrum
        swinging = [number for number, kind in enumerate(kinds) if kind == "underdamped"]
        ratio_texts = dict(zip(swinging, align_decimals(ratios[swinging], 2), strict=True))
        columns = (
            range(1, len(values) + 1),
            align_decimals(frequencies),
            [ratio_texts.get(number, kind) for number, kind in enumerate(kinds)],
            [""] * len(values),
        )
        for number, cells in enumerate(zip(*columns, strict=True)):
            for place, cell in enumerate(cells):
                item = QTableWidgetItem(str(cell))
                item.setTextAlignment(RIGHT)
                self.table.setItem(number, place, item)
        if spectrum is not None:
            self._show_masses(spectrum)
        self._fit_columns()
        if self.mode is not None and self.mode >= len(values):
            self.stop()

    def _fit_columns(self) -> None:
        # All but the last column, which takes the remaining width.
        for place in range(self.table.columnCount() - 1):
            self.table.resizeColumnToContents(place)

    def _show_spectrum(self, spectrum: Spectrum) -> None:
        self._masses_key = self._modes_key if self.response.is_current else None
        self._show_masses(spectrum)

    def _show_masses(self, spectrum: Spectrum) -> None:
        """Write the effective masses; those of former modes are grey until the new ones follow."""
        old = self._masses_key != self._modes_key
        self.response.fade(old)
        if len(spectrum.shares) != self.table.rowCount():
            return  # the masses belong to other modes; the new ones will follow
        sums = spectrum.shares.cumsum(axis=0)
        for number, (share, total) in enumerate(zip(spectrum.shares, sums, strict=True)):
            axis = int(np.argmax(share))
            item = self.table.item(number, _MASS)
            item.setText(f"{share[axis]:.0%} {'xyz'[axis]}" if share[axis] >= _MIN_MASS else "–")
            lines = (
                f"{x}: {a:.1%}; up to this mode: {b:.1%}"
                for x, a, b in zip("xyz", share, total, strict=True)
            )
            base = "of the former modes" if old else "as a fraction of the movable mass"
            item.setToolTip(f"Effective mass, {base}\n" + "\n".join(lines))
            faint = self.palette().brush(QPalette.ColorRole.PlaceholderText)
            item.setForeground(faint if old else QBrush())
        if not old:
            self._mark_unresolved(spectrum.errors.tolist())
        self._fit_columns()

    def _mark_unresolved(self, errors: Sequence[float]) -> None:
        """Mark the frequencies of the modes that the cells of the cage are too large to resolve."""
        for number, error in enumerate(errors):
            if error > UNRESOLVED:
                item = self.table.item(number, _FREQUENCY)
                item.setText(_APPROXIMATE + item.text().removeprefix(_APPROXIMATE))
                item.setToolTip(f"The cage is too coarse for this mode: about {error:.0%} too high")
        clause = describe_unresolved_modes(errors)
        self.unresolved.setText(f"{clause.capitalize()}; use finer divisions of the cage.")
        self.unresolved.setVisible(bool(clause))

    def _request_or_cancel_errors(self) -> None:
        if self._retry.isActive():
            self._engine.start_background(None)
            self._set_estimating(False)
        else:
            self._set_estimating(True)
            self._request_errors()

    def _request_errors(self) -> None:
        values, base = self._document.values, self._document.base
        self._engine.start_background(partial(compute_errors, values=values, base=base))

    def _retry_errors(self) -> None:
        if self._engine.background is None and not self._engine.busy:
            self._request_errors()

    def _set_estimating(self, is_running: bool) -> None:
        if is_running:
            self._retry.start()
        else:
            self._retry.stop()
        self.errors_button.setText("Cancel the estimate" if is_running else "Estimate errors")

    def _receive_errors(self, result: Any) -> None:
        """Write the errors beside the frequencies, if the modes are still the same."""
        if not isinstance(result, ModeErrors):
            return  # the result was requested by another tab
        if not self._retry.isActive():
            return  # the estimate was cancelled, or is of other modes
        self._set_estimating(False)
        if result.frequencies and (
            len(result.frequencies) != len(self.response.frequencies)
            # Two solutions of the same equations differ by their rounding.
            or not np.allclose(result.frequencies, self.response.frequencies, rtol=1e-6)
        ):
            return
        texts = format_errors(align_decimals(result.frequencies), result.errors)
        for number, text in enumerate(texts):
            # The font is proportional: spaces align nothing.
            self.table.item(number, _FREQUENCY).setText(" ".join(text.split()))
        self.unresolved.setText(result.note)
        self.unresolved.setVisible(bool(result.note))
        self._fit_columns()

    def set_angles(self, turns: bool) -> None:
        """Set whether amplitudes are angles; large ones need reconstructed rotations."""
        if turns == self._uses_angles:
            return
        self._uses_angles = turns
        maximum, value, tip = _ANGLES if turns else _SHARES
        self.amplitude.setRange(1, maximum)
        self.amplitude.setValue(value)
        self.amplitude.setToolTip(tip)
        self._show_amplitude()

    def stop(self) -> None:
        """End the animation and show the motion again."""
        if self.mode is not None:
            self.release()
            self.swing_changed.emit(None)

    def release(self) -> None:
        """End the animation because something else will be shown."""
        self._set_mode(None)
        self._timer.stop()
        self.table.clearSelection()
        self.back_button.setEnabled(False)

    def _set_mode(self, mode: int | None) -> None:
        self.mode = self.response.mode = mode
        self.response.update()

    def _animate_mode(self, mode: int) -> None:
        """Animate the mode that was clicked in the plot."""
        self.table.setCurrentCell(mode, 0)
        self.table.cellClicked.emit(mode, 0)

    def _start_animation(self, row: int, _column: int) -> None:
        self._set_mode(row)
        self._started_at = time.perf_counter()
        self.back_button.setEnabled(True)
        self._timer.start()

    def _follow_selection(self, row: int, *_: int) -> None:
        """During an animation, change to the mode that the arrow keys select."""
        if self.mode is not None and row >= 0:
            self._set_mode(row)

    def _tick(self) -> None:
        if self.mode is not None:
            phase = (time.perf_counter() - self._started_at) / _PERIOD
            value = self.amplitude.value()
            angle = math.radians(value) if self._uses_angles else None
            self.swing_changed.emit(Swing(self.mode, value / 100, phase, angle))

    def _show_amplitude(self) -> None:
        value = self.amplitude.value()
        self.amplitude_text.setText(f"{value}°" if self._uses_angles else f"{value} %")


def _describe_cage(figures: dict[str, Any]) -> str:
    """Return a sentence about the kind of the cage."""
    if "bending_length" not in figures:
        return f"The cage consists of {figures['elements']}." if figures else ""
    mass, length = (
        typeset_units(ModalSolver.parameter(name).format_figure(figures[name]))
        for name in ("areal_mass", "bending_length")
    )
    return f"The cage is a sheet: areal mass {mass}; bending length {length}."
