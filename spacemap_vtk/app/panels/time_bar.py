"""The time bar: play, pause, step, scrub, loop and speed."""

from __future__ import annotations

import time
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QComboBox, QLabel, QLineEdit, QSlider, QWidget

from spacemap_vtk.app.widgets import mark_bad, row, tool_button
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.settings import Animation, View
from spacemap_vtk.units import format_quantity

_STEPS = 2000
#: Interval of the timer while playing, in ms. Playing shows as many frames as can be computed.
_TICK = 15
#: Below this width, the first and last buttons and the end time are hidden, in pixels.
_WIDTH_FOR_ENDS = 560
#: Below this width, the buttons for one frame are hidden too, in pixels.
_WIDTH_FOR_STEPS = 500
#: Smallest width of the bar, in pixels.
_MIN_WIDTH = 380
#: Longest time in s by which playing goes on after a frame: a motion whose time steps are still to
#: be computed is shown slowly instead of in leaps.
_LONGEST_STEP = 0.1
_NO_MOTION = "This scene does not move. Switch on a stage of motion, such as Modal response."
SPEEDS = ("0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5")


class TimeBar(QWidget):
    """Controls for the shown time."""

    #: The time in s, and whether more changes will follow at once.
    time_changed = Signal(float, bool)
    #: The error about a typed text that is not a time.
    refused = Signal(object)
    #: The user has chosen a time, so an earlier error is obsolete.
    time_chosen = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.time = 0.0
        #: Whether playing waits for the frame of the last time.
        self.waiting = False
        self._start, self._stop, self._step = 0.0, 1.0, 0.04
        self._clock = 0.0
        self._animation_settings: dict[str, Any] | None = None
        self.play = tool_button("▶", "Play (Space)", checkable=True)
        self.play.toggled.connect(self._toggle_playing)
        self.first = tool_button("|◀", "Go to start (Home)")
        self.first.clicked.connect(self.go_to_start)
        self.back = tool_button("◁", "Previous frame (,)")
        self.back.clicked.connect(self.step_back)
        self.forward = tool_button("▷", "Next frame (.)")
        self.forward.clicked.connect(self.step_forward)
        self.last = tool_button("▶|", "Go to end (End)")
        self.last.clicked.connect(self.go_to_end)
        self.loop = tool_button("⟳", "Loop", checkable=True, checked=True)
        self.slider = QSlider(Qt.Orientation.Horizontal, maximum=_STEPS, minimumWidth=30)
        self.line = QLineEdit(toolTip="Time to show, e.g. 0.4 or 40 ms")
        self.line.setFixedWidth(80)
        self.end_label = QLabel()
        self.speed = QComboBox(toolTip="Speed: seconds of motion per second")
        self.speed.addItems([f"{s} ×" for s in SPEEDS])
        buttons = (self.first, self.back, self.play, self.forward, self.last, self.loop)
        others = ((self.slider, 1), self.line, self.end_label, self.speed)
        row(self, *buttons, *others, margins=(8, 4, 8, 4), spacing=3)
        self.setMinimumWidth(_MIN_WIDTH)
        #: Tooltips while the scene moves; otherwise `_NO_MOTION` replaces them.
        self._tips = {w: w.toolTip() for w in (self, *buttons, self.slider, self.line, self.speed)}
        self._timer = QTimer(self, interval=_TICK)
        self._timer.timeout.connect(self._tick)
        self.slider.valueChanged.connect(self._scrub)
        self.slider.sliderReleased.connect(self._request_fine_frame)
        self.line.editingFinished.connect(self._submit)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """In a narrow window, hide controls that also have keys."""
        super().resizeEvent(event)
        for least, widgets in (
            (_WIDTH_FOR_ENDS, (self.first, self.last, self.end_label)),
            (_WIDTH_FOR_STEPS, (self.back, self.forward)),
        ):
            for widget in widgets:
                widget.setVisible(self.width() >= least)

    @property
    def playing(self) -> bool:
        return self.play.isChecked()

    def set_moves(self, moves: bool) -> None:
        """Enable the bar if the scene moves."""
        if not moves:
            self.pause()
        self.setEnabled(moves)
        for widget, tip in self._tips.items():
            widget.setToolTip(tip if moves else _NO_MOTION)

    def set_animation(self, animation: Animation, at: float | None = None) -> None:
        """Set range, step and speed from a scene's animation settings."""
        speed = f"{animation.speed:g} ×"
        span = animation.span
        if at is not None or span != (self._start, self._stop):
            self._start, self._stop = span
            if self.speed.findText(speed) < 0:
                self.speed.addItem(speed)
            self.speed.setCurrentText(speed)
        elif self._animation_settings == animation.settings:
            return
        self._animation_settings = animation.settings
        self._step = animation.speed / animation.frames_per_second
        end = format_quantity(self._stop, "s", 6)
        self.end_label.setText(f"of {end}")
        self._tips[self.slider] = f"Time, up to {end}"
        self._show(self.time if at is None else at)

    def go_to(self, at: float, continues: bool = False) -> None:
        self.time_chosen.emit()
        self._set_time(at, continues)

    def go_to_start(self) -> None:
        self.go_to(self._start)

    def go_to_end(self) -> None:
        self.go_to(self._stop)

    def step_back(self) -> None:
        self.go_to(max(self._start, self.time - self._step))

    def step_forward(self) -> None:
        self.go_to(min(self._stop, self.time + self._step))

    def pause(self) -> None:
        self.play.setChecked(False)

    def _set_time(self, at: float, continues: bool) -> None:
        self._show(at)
        self.time_changed.emit(self.time, continues)

    def _show(self, at: float) -> None:
        self.time = at
        share = (at - self._start) / (self._stop - self._start)
        with QSignalBlocker(self.slider):
            self.slider.setValue(round(min(max(share, 0.0), 1.0) * _STEPS))
        # Do not overwrite a time that is being typed.
        if not (self.line.hasFocus() and self.line.isModified()):
            self.line.setText(format_quantity(at, "s", 4) if at else "0 s")
            mark_bad(self.line, bad=False)

    def _toggle_playing(self, on: bool) -> None:
        self.play.setText("❚❚" if on else "▶")
        if on:
            self.line.setModified(False)
            if self.time >= self._stop:
                self._show(self._start)
            self._clock = time.perf_counter()
            self._timer.start()
        else:
            self._timer.stop()
            self._request_fine_frame()

    def _tick(self) -> None:
        # Every change of the bar makes Qt draw the window again, which costs as much as a frame.
        if self.waiting:
            return
        now = time.perf_counter()
        speed = float(self.speed.currentText().split()[0])
        elapsed, self._clock = min(now - self._clock, _LONGEST_STEP), now
        at = self.time + elapsed * speed
        if at > self._stop:
            if not self.loop.isChecked():
                self._show(self._stop)
                self.pause()
                return
            at = self._start + (at - self._start) % (self._stop - self._start)
        self._set_time(at, continues=True)

    def _scrub(self, step: int) -> None:
        at = self._start + step / _STEPS * (self._stop - self._start)
        self.go_to(at, self.slider.isSliderDown())

    def _request_fine_frame(self) -> None:
        self.time_changed.emit(self.time, False)

    def _submit(self) -> None:
        if not self.line.isModified():
            return  # not edited; the shown text is rounded and must not change the time
        self.line.setModified(False)
        try:
            at = View.parameter("time").check(self.line.text())
        except InputError as error:
            mark_bad(self.line, bad=True)
            self.refused.emit(error)
        else:
            self.go_to(at)
