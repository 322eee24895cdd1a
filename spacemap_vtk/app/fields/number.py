"""Editors of a number, a line that knows units and a slider, and of a vector of them."""

from __future__ import annotations

import itertools
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QSlider

from spacemap_vtk.app.fields.editor import Editor, LineEditor, leave_wheel, written_from
from spacemap_vtk.app.fields.span import STEPS, SliderSpan, span_of
from spacemap_vtk.app.widgets import column
from spacemap_vtk.parameters import AUTOMATIC, Parameter, Real, Vector

_bursts = itertools.count(1)


def next_burst() -> int:
    """Return a number that no drag has had."""
    return next(_bursts)


class NumberEditor(LineEditor):
    """A number with its unit; the slider sets it while it is dragged."""

    # Also for a series of numbers, whose slider rests while there are several.

    def __init__(self, parameter: Parameter[Any], bare: bool = False) -> None:
        super().__init__(parameter)
        self._bare = bare
        component: Any = getattr(parameter, "component", parameter)
        self.real: Real = component
        self.slider = QSlider(Qt.Orientation.Horizontal)
        leave_wheel(self.slider)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 20)
        column(self, self.line, self.slider, spacing=2)
        self._value: float | None = None
        self._feasible: tuple[float, float] | None = None
        self._span: SliderSpan | None = None
        self._burst = 0
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

    def written(self, text: str) -> Any:
        """Return a number, or a text with a unit; None where a value can be left out."""
        self.line.setModified(False)  # it is taken: the line shows what comes of it
        return None if text.strip() == "" and self.parameter.optional else written_from(text)

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


class VectorEditor(Editor):
    """A line and a slider for each component; the unit stands once, and others can be typed."""

    def __init__(self, parameter: Vector) -> None:
        super().__init__(parameter)
        self.components: list[NumberEditor] = []
        self._value: tuple[Any, ...] | None = None
        layout = QGridLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setHorizontalSpacing(6)
        for place, label in enumerate(parameter.labels):
            editor = NumberEditor(parameter.component, bare=True)
            editor.setObjectName(label)
            editor.edited.connect(self._edited)
            editor.held.connect(self.held)
            editor.restored.connect(self._restored)
            editor.line.setMinimumWidth(34)
            editor.slider.setMinimumWidth(34)
            head = f"{label}  [{parameter.unit}]" if parameter.unit else label
            name = QLabel(head if place == 0 else label)
            name.setObjectName("about")
            layout.addWidget(name, 0, place)
            layout.addWidget(editor, 1, place)
            layout.setColumnStretch(place, 1)
            self.components.append(editor)
        self.setFocusProxy(self.components[0])

    def show_value(self, value: Any) -> None:
        """Show the components in SI."""
        self._value = value
        for number, editor in enumerate(self.components):
            editor.show_value(None if value is None else value[number])

    def _restored(self) -> None:
        if all(editor.line.text() == editor.shown for editor in self.components):
            self.restored.emit()

    def _edited(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            self.edited.emit(AUTOMATIC, burst)  # all components or none
            return
        moved = self.components.index(self.sender())
        # Of a vector that was automatic, the other components begin at zero.
        values = list(self._value or [0.0] * len(self.components))
        values[moved] = 0.0 if written is None else written
        self.edited.emit(values, burst)
