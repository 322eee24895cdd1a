"""Editors of a number, a line that knows units and a slider, and of a vector of them."""

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

from spacemap_vtk.app.fields.editor import Editor, LineEditor, leave_wheel
from spacemap_vtk.app.fields.known import STEPS, SliderSpan, span_of, with_shown_unit
from spacemap_vtk.app.widgets import painter_on, row
from spacemap_vtk.parameters import AUTOMATIC, Parameter, Real, Vector
from spacemap_vtk.scenes.assignments import value_of
from spacemap_vtk.units import pretty

_Role = QPalette.ColorRole
_bursts = itertools.count(1)
#: Pixels of a line beside its slider; Qt's word for no limit.
_LINE, _WIDEST = 80, 16_777_215
#: What `pretty` writes, as files have it.
_PLAIN = str.maketrans({"²": "2", "³": "3", "·": "."})


def next_burst() -> int:
    """Return a number that no drag has had."""
    return next(_bursts)


class Slider(QSlider):
    """A slider whose groove is filled from zero to its handle."""

    def __init__(self) -> None:
        super().__init__(Qt.Orientation.Horizontal, minimumWidth=20)
        #: The step that stands for zero, or for the end nearest to it.
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
        whole = groove.left() + 2, groove.right() - 1
        for ends, color in ((whole, colors.color(_Role.Mid)), ((zero, at), paint)):
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
    """A number with its unit; the slider sets it while it is dragged."""

    wide = False

    # Also for a series of numbers, whose slider rests while there are several.

    def __init__(self, parameter: Parameter[Any], bare: bool = False) -> None:
        super().__init__(parameter)
        self._bare = bare
        component: Any = getattr(parameter, "component", parameter)
        self.real: Real = component
        self.slider = Slider()
        leave_wheel(self.slider)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 20)
        self._layout = row(self, self.line, (self.slider, 1), spacing=4)
        self.line.setFixedWidth(_LINE)
        self._value: float | None = None
        #: What it is where it is automatic.
        self._in_use: float | None = None
        self._feasible: tuple[float, float] | None = None
        self._span: SliderSpan | None = None
        self._stacked = False
        self._burst = 0
        self.slider.valueChanged.connect(self._slid)
        self.slider.sliderPressed.connect(self._pressed)
        self.slider.sliderReleased.connect(self._released)

    def stack(self) -> None:
        """Let the slider stand below the line."""
        self._layout.setDirection(QBoxLayout.Direction.TopToBottom)
        self._layout.setSpacing(1)
        self._stacked = True
        self.line.setMinimumWidth(34)
        self.line.setMaximumWidth(_WIDEST)

    def show_in_use(self, value: Any) -> None:
        """Show it in grey, on the slider, too."""
        super().show_in_use(value)
        if self._bare and value is not None:
            self.line.setPlaceholderText(self._text(value))
        self._in_use = value if isinstance(value, (int, float)) else None
        if self._value is None:
            self._place_slider()

    def show_value(self, value: Any) -> None:
        """Show it in the line, and on the slider unless that is being dragged."""
        self._value = value if isinstance(value, (int, float)) else None
        self.shown = "" if value is None else self._text(value)
        if not (self.line.hasFocus() and self.line.isModified()):
            self.line.setText(self.shown)
            self.line.setCursorPosition(0)
        self.slider.setEnabled(self._value is not None)
        if not self._stacked:  # what is in use has the room of a slider that cannot be dragged
            self.slider.setVisible(value is not None)
            self.line.setMaximumWidth(_WIDEST if value is None else _LINE)
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
        return f"{value:.6g}" if self._bare else pretty(self.parameter.show(value))

    def _place_slider(self) -> None:
        # The span stays while the value is inside: a slider that jumps is no ruler.
        value = self._in_use if self._value is None else self._value
        inside = (
            self._span is not None
            and value is not None
            and self._span.low <= value <= self._span.high
        )
        if not inside:
            self._span = span_of(self.real, value, self._feasible)
        assert self._span is not None
        with QSignalBlocker(self.slider):
            self.slider.origin = self._span.step(min(max(0.0, self._span.low), self._span.high))
            self.slider.setValue(0 if value is None else self._span.step(value))

    def written(self, text: str) -> Any:
        """Return a number, or a text with a unit; None where a value can be left out."""
        self.line.setModified(False)  # it is taken: the line shows what comes of it
        if text.strip() == "" and self.parameter.optional:
            return None
        if not self._bare:  # the unit that is shown, in grey where the value is automatic
            shown = (self.shown or self.line.placeholderText()).translate(_PLAIN)
            text = with_shown_unit(text, shown, self.parameter.unit)
        return value_of(text.translate(_PLAIN))

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
        bare = self._bare and self.real.kind != "integer"
        number = self._span.number(step) if bare else self._span.written(self.real, step)
        self.edited.emit(number, self._burst)


class VectorEditor(Editor):
    """A line and a slider for each component; the unit stands once, and others can be typed."""

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
            editor.edited.connect(self._edited)
            editor.held.connect(self.held)
            editor.restored.connect(self._restored)
            editor.line.setMinimumWidth(34)
            editor.slider.setMinimumWidth(34)
            head = f"{label}  [{pretty(parameter.unit)}]" if parameter.unit else label
            editor.stack()
            name = QLabel(head if place == 0 else label, objectName="about")
            name.setBuddy(editor)
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

    def show_in_use(self, value: Any) -> None:
        """Show the components in grey."""
        self._in_use = value
        for number, editor in enumerate(self.components):
            editor.show_in_use(None if value is None else value[number])

    def _restored(self) -> None:
        if all(editor.line.text() == editor.shown for editor in self.components):
            self.restored.emit()

    def _edited(self, written: object, burst: int) -> None:
        if self.parameter.is_automatic(written):
            self.edited.emit(AUTOMATIC, burst)  # all components or none
            return
        moved = self.components.index(self.sender())
        # Of a vector that was automatic, the other components begin as they are in use.
        values = list(self._value or self._in_use or [0.0] * len(self.components))
        values[moved] = 0.0 if written is None else written
        self.edited.emit(values, burst)
