"""Editors of numbers and vectors: lines with units, and sliders."""

from __future__ import annotations

import itertools
from typing import Any

from PySide6.QtCore import QPointF, QSignalBlocker, Qt
from PySide6.QtGui import QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import (
    QBoxLayout,
    QGridLayout,
    QLabel,
    QSlider,
    QStyle,
    QStyleOptionSlider,
)

from spacemap_vtk.app.fields.editor import Editor, LineEditor, ignore_wheel
from spacemap_vtk.app.fields.parameter_info import STEPS, SliderSpan, add_shown_unit, slider_span
from spacemap_vtk.app.widgets import painter_on, row
from spacemap_vtk.parameters import AUTOMATIC, Parameter, Real, Vector
from spacemap_vtk.scenes.assignments import parse_value
from spacemap_vtk.units import typeset_units

_Role = QPalette.ColorRole
_bursts = itertools.count(1)
#: Width of a line beside its slider, in pixels.
_LINE_WIDTH = 80
#: Qt's value for a width without limit (QWIDGETSIZE_MAX).
_NO_MAX_WIDTH = 16_777_215
#: Replaces the characters of `typeset_units` by those of files.
_PLAIN = str.maketrans({"²": "2", "³": "3", "·": "."})


def next_burst() -> int:
    """Return a new number for a drag."""
    return next(_bursts)


class Slider(QSlider):
    """A slider whose groove is filled from zero to the handle."""

    def __init__(self) -> None:
        super().__init__(Qt.Orientation.Horizontal, minimumWidth=20)
        #: Step of zero, or of the end nearest to zero.
        self.origin = 0

    def paintEvent(self, _: QPaintEvent) -> None:
        option, control = QStyleOptionSlider(), QStyle.ComplexControl.CC_Slider
        self.initStyleOption(option)
        parts = (QStyle.SubControl.SC_SliderGroove, QStyle.SubControl.SC_SliderHandle)
        groove, handle = (self.style().subControlRect(control, option, p, self) for p in parts)
        colors = self.palette()
        paint = colors.color(_Role.Highlight if self.isEnabled() else _Role.Mid)
        half = handle.width() / 2
        share = self.origin / max(self.maximum(), 1)
        zero = groove.left() + half + share * (groove.width() - 2 * half)
        at, y = handle.center().x() + 0.5, groove.center().y() + 0.5
        painter = painter_on(self)
        groove_ends = groove.left() + 2, groove.right() - 1
        for ends, color in ((groove_ends, colors.color(_Role.Mid)), ((zero, at), paint)):
            painter.setPen(QPen(color, 3.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
            painter.drawLine(*(QPointF(x, y) for x in ends))
        if 0 < self.origin < self.maximum():
            painter.setPen(QPen(colors.color(_Role.PlaceholderText), 1.0))
            painter.drawLine(QPointF(zero, y - 5), QPointF(zero, y + 5))
        painter.setPen(QPen(paint, 2.0 if self.hasFocus() else 1.2))
        painter.setBrush(colors.color(_Role.Base))
        painter.drawEllipse(QPointF(at, y), 5.5, 5.5)
        painter.end()


class NumberEditor(LineEditor):
    """A line with number and unit, and a slider."""

    wide = False

    # Also for a series of numbers; with several numbers the slider is disabled.

    def __init__(self, parameter: Parameter[Any], bare: bool = False) -> None:
        super().__init__(parameter)
        self._bare = bare
        component: Any = getattr(parameter, "component", parameter)
        self.real: Real = component
        self.slider = Slider()
        ignore_wheel(self.slider)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 20)
        self._layout = row(self, self.line, (self.slider, 1), spacing=4)
        self.line.setFixedWidth(_LINE_WIDTH)
        self._value: float | None = None
        #: Value in use while the parameter is automatic.
        self._in_use: float | None = None
        self._feasible: tuple[float, float] | None = None
        self._span: SliderSpan | None = None
        self._stacked = False
        self._burst = 0
        self.slider.valueChanged.connect(self._submit_slider)
        self.slider.sliderPressed.connect(self._begin_drag)
        self.slider.sliderReleased.connect(self._end_drag)

    def set_half_width(self) -> None:
        """Put the slider below the line."""
        self._layout.setDirection(QBoxLayout.Direction.TopToBottom)
        self._layout.setSpacing(1)
        self._stacked = True
        self.line.setMinimumWidth(34)
        self.line.setMaximumWidth(_NO_MAX_WIDTH)

    def show_in_use(self, value: Any) -> None:
        """Show the value in use in grey and on the slider."""
        super().show_in_use(value)
        if self._bare and value is not None:
            self.line.setPlaceholderText(self._format(value))
        self._in_use = value if isinstance(value, (int, float)) else None
        if self._value is None:
            self._place_slider()

    def show_value(self, value: Any) -> None:
        """Show the value in the line and, except during a drag, on the slider."""
        self._value = value if isinstance(value, (int, float)) else None
        self.shown = "" if value is None else self._format(value)
        if not (self.line.hasFocus() and self.line.isModified()):
            self.line.setText(self.shown)
            self.line.setCursorPosition(0)
        self.slider.setEnabled(self._value is not None)
        if not self._stacked:  # without a value, the line also takes the place of the slider
            self.slider.setVisible(value is not None)
            self.line.setMaximumWidth(_NO_MAX_WIDTH if value is None else _LINE_WIDTH)
        if not self.slider.isSliderDown():
            self._place_slider()

    def set_feasible(self, low: float, high: float) -> None:
        """Set the range of the slider to the feasible interval."""
        if self._feasible != (low, high):
            self._feasible = low, high
            if not self.slider.isSliderDown():
                self._span = None
                self._place_slider()

    def _format(self, value: Any) -> str:
        return f"{value:.6g}" if self._bare else typeset_units(self.parameter.format(value))

    def _place_slider(self) -> None:
        # Keep the span while the value is inside, so that the slider does not jump.
        value = self._in_use if self._value is None else self._value
        inside = (
            self._span is not None
            and value is not None
            and self._span.low <= value <= self._span.high
        )
        if not inside:
            self._span = slider_span(self.real, value, self._feasible)
        assert self._span is not None
        with QSignalBlocker(self.slider):
            self.slider.origin = self._span.step_at(min(max(0.0, self._span.low), self._span.high))
            self.slider.setValue(0 if value is None else self._span.step_at(value))

    def parse_text(self, text: str) -> Any:
        """Convert a text to a number or a text with a unit; an empty one to None if optional."""
        self.line.setModified(False)  # let `show_value` overwrite the text
        if text.strip() == "" and self.parameter.optional:
            return None
        if not self._bare:  # use the shown unit; that of an automatic value is in the placeholder
            shown = (self.shown or self.line.placeholderText()).translate(_PLAIN)
            text = add_shown_unit(text, shown, self.parameter.unit)
        return parse_value(text.translate(_PLAIN))

    def _begin_drag(self) -> None:
        self._burst = next_burst()
        self.dragging.emit(True)

    def _end_drag(self) -> None:
        self._burst = 0
        if self._feasible is None and self.slider.value() in (0, STEPS):
            self._span = None  # the slider is at an end of an open range: extend the range
        self._place_slider()
        self.dragging.emit(False)

    def _submit_slider(self, step: int) -> None:
        if self._span is None:
            return
        bare = self._bare and self.real.kind != "integer"
        number = self._span.number_at(step) if bare else self._span.value_at(self.real, step)
        self.edited.emit(number, self._burst)


class VectorEditor(Editor):
    """A line and a slider for each component; the unit is shown once, others can be typed."""

    def __init__(self, parameter: Vector) -> None:
        super().__init__(parameter)
        self.components: list[NumberEditor] = []
        self._value: tuple[Any, ...] | None = None
        self._in_use: tuple[Any, ...] | None = None
        layout = QGridLayout(self, horizontalSpacing=6)
        layout.setContentsMargins(0, 0, 0, 0)
        for place, label in enumerate(parameter.labels):
            editor = NumberEditor(parameter.component, bare=True)
            editor.setObjectName(label)
            editor.edited.connect(self._submit_component)
            editor.dragging.connect(self.dragging)
            editor.restored.connect(self._emit_restored)
            editor.line.setMinimumWidth(34)
            editor.slider.setMinimumWidth(34)
            head = f"{label}  [{typeset_units(parameter.unit)}]" if parameter.unit else label
            editor.set_half_width()
            name = QLabel(head if place == 0 else label, objectName="about")
            name.setBuddy(editor)
            layout.addWidget(name, 0, place)
            layout.addWidget(editor, 1, place)
            layout.setColumnStretch(place, 1)
            self.components.append(editor)
        self.setFocusProxy(self.components[0])

    def show_value(self, value: Any) -> None:
        """Show the components in SI units."""
        self._value = value
        for number, editor in enumerate(self.components):
            editor.show_value(None if value is None else value[number])

    def show_in_use(self, value: Any) -> None:
        """Show the components of the value in use in grey."""
        self._in_use = value
        for number, editor in enumerate(self.components):
            editor.show_in_use(None if value is None else value[number])

    def _emit_restored(self) -> None:
        if all(editor.line.text() == editor.shown for editor in self.components):
            self.restored.emit()

    def _submit_component(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            self.edited.emit(AUTOMATIC, burst)  # all components or none
            return
        moved = self.components.index(self.sender())
        # If the vector was automatic, the other components start with the values in use.
        values = list(self._value or self._in_use or [0.0] * len(self.components))
        values[moved] = 0.0 if written is None else written
        self.edited.emit(values, burst)
