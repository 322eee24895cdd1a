"""Editor of a number: a line that knows units, and a slider."""

from __future__ import annotations

import itertools
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit, QSlider, QVBoxLayout

from spacemap_vtk.app.fields.editor import Editor, written_from
from spacemap_vtk.app.fields.span import STEPS, Span, span_of
from spacemap_vtk.app.fields.wheel import leave_wheel
from spacemap_vtk.parameters import Parameter, Real

_bursts = itertools.count(1)


def next_burst() -> int:
    """Return a number that no drag has had."""
    return next(_bursts)


class NumberEditor(Editor):
    """A number with its unit; the slider sets it while it is dragged."""

    # Also for a series of numbers, whose slider rests while there are several.

    def __init__(self, parameter: Parameter[Any], bare: bool = False) -> None:
        super().__init__(parameter)
        self._bare = bare
        component: Any = getattr(parameter, "component", parameter)
        self.real: Real = component
        self.line = QLineEdit()
        self.line.setPlaceholderText(parameter.automatic)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        leave_wheel(self.slider)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 20)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(2)
        layout.addWidget(self.line)
        layout.addWidget(self.slider)
        self.setFocusProxy(self.line)
        self._value: float | None = None
        self._feasible: tuple[float, float] | None = None
        self._span: Span | None = None
        self._burst = 0
        self.line.textEdited.connect(self.is_new)
        self.line.editingFinished.connect(self._typed)
        self.slider.valueChanged.connect(self._slid)
        self.slider.sliderPressed.connect(self._pressed)
        self.slider.sliderReleased.connect(self._released)

    def show_value(self, value: Any) -> None:
        """Show it in the line, and on the slider unless that is being dragged."""
        self._value = value if isinstance(value, (int, float)) else None
        self.shown = "" if value is None else self._text(value)
        if not (self.line.hasFocus() and self.line.isModified()):
            self.line.setText(self.shown)
        self.slider.setEnabled(self._value is not None)
        if not self.slider.isSliderDown():
            self._place_slider()

    def limit(self, low: float, high: float) -> None:
        """Let the slider run over the feasible interval."""
        if self._feasible != (low, high):
            self._feasible = low, high
            if not self.slider.isSliderDown():
                self._span = None
                self._place_slider()

    def _text(self, value: Any) -> str:
        return f"{value:.6g}" if self._bare else self.parameter.show(value)

    def _place_slider(self) -> None:
        # The span stays while the value is inside: a slider that jumps is no ruler.
        value = self._value
        inside = (
            self._span is not None
            and value is not None
            and self._span.low <= value <= self._span.high
        )
        if not inside:
            self._span = span_of(self.real, value, self._feasible)
        self.slider.blockSignals(True)
        assert self._span is not None
        self.slider.setValue(0 if value is None else self._span.step(value))
        self.slider.blockSignals(False)

    def _typed(self) -> None:
        text = self.line.text()
        if self.is_new(text):
            self.line.setModified(False)
            written = None if text.strip() == "" and self.parameter.optional else written_from(text)
            self.edited.emit(written, 0)

    def _pressed(self) -> None:
        self._burst = next_burst()
        self.held.emit(True)

    def _released(self) -> None:
        self._burst = 0
        if self._feasible is None and self.slider.value() in (0, STEPS):
            self._span = None  # at an end of an open range: make room beyond it
        self._place_slider()
        self.held.emit(False)

    def _slid(self, step: int) -> None:
        if self._span is None:
            return
        number = self._span.number(step)
        if self.real.kind == "integer":
            written: Any = round(number)
        else:
            written = self.real.show(number) if self.real.unit and not self._bare else number
        self.edited.emit(written, self._burst)
