"""Editors of texts, choices, flags, colours, files and supports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QMouseEvent, QPaintEvent, QPixmap
from PySide6.QtWidgets import (
    QCheckBox,
    QColorDialog,
    QCompleter,
    QFileDialog,
    QGridLayout,
    QLineEdit,
    QPushButton,
    QWidget,
)

from spacemap_vtk.app.fields.editor import Editor, LineEditor, ignore_wheel
from spacemap_vtk.app.widgets import NarrowComboBox, column, painter_on, row
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.places import SIDES, parse_places
from spacemap_vtk.parameters import Choice, Integer, Parameter, Series, Text
from spacemap_vtk.scenes.assignments import parse_value
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.styles import LIGHTS, STYLES

#: A whole number with at most so many allowed values has a combo box instead of a slider.
_MAX_CHOICES = 5
#: What has a name of its own, by parameter and choice.
_NAMED_CHOICES: dict[str, Mapping[str, Any]] = {
    "color": COLORINGS,
    "style": STYLES,
    "light": LIGHTS,
}


class TextEditor(LineEditor):
    """A line with the text of a scene file, for any kind of parameter."""

    wide = False

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        row(self, self.line)
        single = parameter.component if isinstance(parameter, Series) else parameter
        if isinstance(single, Text) and single.offered:
            self._offer(single.offered)

    def _offer(self, texts: Sequence[str]) -> None:
        """Offer texts while one is typed, and all of them at a click on an arrow."""
        completer = QCompleter(texts, self.line)
        completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        completer.setFilterMode(Qt.MatchFlag.MatchContains)
        completer.setMaxVisibleItems(len(texts))
        completer.activated.connect(self._choose)
        self.line.setCompleter(completer)
        self.offer = self.line.addAction(_arrow_icon(), QLineEdit.ActionPosition.TrailingPosition)
        self.offer.setToolTip("Choose one of the library")
        self.offer.triggered.connect(self._show_offered)

    def _show_offered(self) -> None:
        completer = self.line.completer()
        completer.setCompletionPrefix("")
        completer.complete()

    def _choose(self, text: str) -> None:
        self.line.setText(text)
        self._submit()

    def show_value(self, value: Any) -> None:
        """Show the value with its unit."""
        self.show_text("" if value is None else _strip_quotes(self.parameter.format(value)))

    def parse_text(self, text: str) -> Any:
        """Convert a text to a number, list or string; an empty one to None if it is optional."""
        return None if text == "" and self.parameter.optional else parse_value(text)


class ChoiceEditor(Editor):
    """A combo box with the declared choices, or with a few whole numbers."""

    wide = False

    def __init__(self, parameter: Choice | Integer) -> None:
        super().__init__(parameter)
        self.box = NarrowComboBox(4)
        self.box.activated.connect(self._submit_choice)
        ignore_wheel(self.box)
        for choice in (
            few_choices(parameter) if isinstance(parameter, Integer) else parameter.choices
        ):
            self.box.addItem(_choice_label(parameter.name, choice), choice)
        row(self, self.box)
        self.setFocusProxy(self.box)

    def show_value(self, value: Any) -> None:
        self.box.setCurrentIndex(self.box.findData(value))

    def show_in_use(self, value: Any) -> None:
        """Show the value in use while nothing is chosen."""
        self.box.setPlaceholderText(
            "" if value is None else _choice_label(self.parameter.name, value)
        )

    def _submit_choice(self) -> None:
        self.edited.emit(self.box.currentData(), 0)


def _choice_label(name: str, choice: Any) -> str:
    """Return a choice in the words of other parts of the window."""
    if choice in SIDES:
        return side_label(choice)
    named = _NAMED_CHOICES.get(name, {})
    return named[choice].label if choice in named else str(choice)


def side_label(side: str) -> str:
    """Return a side of the cage in words."""
    return f"{SIDE_NAMES[side].capitalize()} side ({side})"


def few_choices(parameter: Integer) -> range:
    """Return the allowed numbers if they are few; otherwise an empty range."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.optional or low is None or high is None or high - low >= _MAX_CHOICES:
        return range(0)
    return range(round(low), round(high) + 1)


class FlagEditor(Editor):
    """A check box."""

    wide = False

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.box = QCheckBox("On")
        self.box.clicked.connect(self._submit_checked)
        row(self, self.box)
        self.setFocusProxy(self.box)

    def show_value(self, value: Any) -> None:
        self.box.setChecked(bool(value))

    def _submit_checked(self, checked: bool) -> None:
        self.edited.emit(checked, 0)


class ColorEditor(LineEditor):
    """A button in the colour, which opens a dialog, and a line with the colour's code."""

    wide = False

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.button = QPushButton(toolTip="Choose a colour")
        self.button.clicked.connect(self._choose_color)
        self.button.setFixedWidth(40)
        row(self, self.button, (self.line, 1))

    def show_value(self, value: Any) -> None:
        self.show_text("" if value is None else self.parameter.format(value))
        fill = self.shown or "transparent"
        self.button.setStyleSheet(
            f"background-color: {fill}; border: 1px solid #8a94a3; border-radius: 4px;"
        )

    def _choose_color(self) -> None:
        color = QColorDialog.getColor(QColor(self.shown), self, self.parameter.label)
        if color.isValid():
            self.edited.emit(color.name(), 0)


class FileEditor(LineEditor):
    """A path, and a button that opens a dialog."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.button = QPushButton("Browse…")
        self.button.clicked.connect(self._browse)
        #: Returns the name to show for a file.
        self.display_name: Callable[[Path], str] = str
        row(self, (self.line, 1), self.button)

    def show_value(self, value: Any) -> None:
        self.show_text("" if value is None else self.display_name(value))
        self.line.setCursorPosition(0)  # the name's beginning, if the field is too narrow for it
        #: Start of the file dialog; empty for a temporary file, which has another name here.
        self._file = str(value) if str(value).endswith(self.shown) else ""

    def _browse(self) -> None:
        file, _ = QFileDialog.getOpenFileName(self, self.parameter.label, self._file)
        if file:
            self.edited.emit(file, 0)


def _arrow_icon() -> QIcon:
    """Draw a small arrow that is visible in both themes, unlike that of the style."""
    pixmap = QPixmap(32, 32)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = painter_on(pixmap)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor("#7d8998"))
    painter.drawPolygon([QPointF(9, 12), QPointF(23, 12), QPointF(16, 20)])
    painter.end()
    return QIcon(pixmap)


def _strip_quotes(text: str) -> str:
    """Remove quotes around the whole text, which users do not type."""
    quoted = len(text) >= 2 and text[0] == text[-1] == '"' and '"' not in text[1:-1]
    return text[1:-1] if quoted else text


#: Names of the sides as seen from the front, in the order of the buttons.
SIDE_NAMES = {
    "+y": "top",
    "+x": "right",
    "+z": "front",
    "-y": "bottom",
    "-x": "left",
    "-z": "back",
}
assert set(SIDE_NAMES) == set(SIDES)


class SupportsEditor(LineEditor):
    """A button for each side of the cage's box, and a line for any supports."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.sides: dict[str, QPushButton] = {}
        grid = QGridLayout(spacing=4)
        for number, (side, word) in enumerate(SIDE_NAMES.items()):
            tip = f"Fix the {word} side of the cage ({side})"
            button = QPushButton(objectName="side", checkable=True, toolTip=tip)
            button.clicked.connect(self._submit_checked)
            grid.addWidget(button, number // 3, number % 3)
            self.sides[side] = button
        column(self, grid, self.line, spacing=4)
        self.show_value(())

    def show_value(self, value: Any) -> None:
        """Show the supports, and check the buttons of the held sides."""
        self.show_text(" ".join(value or ()))
        supports = {support.shape: support for support in parse_places(self.shown)}
        for side, button in self.sides.items():
            button.setChecked(side in supports)
            partly = (
                str(supports[side]).removeprefix(side)[1:].strip("()") if side in supports else ""
            )
            button.setText(f"{side} {SIDE_NAMES[side]}" + (f" ({partly})" if partly else ""))

    def show_in_use(self, value: Any) -> None:
        """Show in grey what is held automatically, or that nothing is held."""
        self.line.setPlaceholderText(" ".join(value or ()) or "nothing is fixed")

    def _submit_checked(self) -> None:
        side = next(s for s, button in self.sides.items() if button is self.sender())
        supports = [str(support) for support in parse_places(self.shown) if support.shape != side]
        if self.sides[side].isChecked():
            supports.append(side)
        self.edited.emit(" ".join(supports), 0)

    def parse_text(self, text: str) -> str:
        """Return the text; if it is valid, the buttons change it from now on."""
        with suppress(InputError):  # the document reports the error
            parse_places(text)
            self.shown = text
        return text


#: Side of a swatch, and gap between swatches, in pixels.
_SIDE = 20
_GAP = 3
#: Most swatches in a row of full width, and of half the width.
_PER_ROW = 11
_PER_NARROW_ROW = 5


class ColorsEditor(LineEditor):
    """A swatch for each colour of a series, which opens a dialog, and a line with their codes."""

    def __init__(self, parameter: Any) -> None:
        super().__init__(parameter)
        self.swatches = Swatches()
        self.line.setToolTip("Colours as #rrggbb, separated by commas; they repeat over the yarns")
        self._colors: list[str] = []
        column(self, row(None, self.swatches, None), self.line, spacing=4)
        self.swatches.chosen.connect(self._choose_color)

    def set_half_width(self) -> None:
        self.swatches.per_row = _PER_NARROW_ROW

    def show_value(self, value: Any) -> None:
        """Show the colours as swatches and as codes."""
        self.show_text("" if value is None else self.parameter.format(value))
        self._colors = self.shown.split(", ") if self.shown else []
        self.swatches.show_colors(self._colors)
        self.line.setCursorPosition(0)

    def show_in_use(self, value: Any) -> None:
        """Show the value in use also as a swatch."""
        super().show_in_use(value)
        if not self._colors:
            self.swatches.show_colors([] if value is None else [self.parameter.format(value)])

    def _choose_color(self, number: int) -> None:
        before = QColor(self.swatches.colors[number] if self.swatches.colors else "#2d6a8e")
        color = QColorDialog.getColor(before, self, self.parameter.label)
        if color.isValid():
            colors = self._colors or [""]
            changed = [*colors[:number], color.name(), *colors[number + 1 :]]
            self.edited.emit(changed if len(changed) > 1 else changed[0], 0)


class Swatches(QWidget):
    """Colours side by side; a click selects one."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__(toolTip="Click to change the colour")
        self.colors: list[str] = []
        self.per_row = _PER_ROW
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def show_colors(self, colors: list[str]) -> None:
        self.colors = colors
        count = max(1, len(colors))
        columns, rows = min(count, self.per_row), -(-count // self.per_row)
        self.setFixedSize(QSize(columns * (_SIDE + _GAP), rows * (_SIDE + _GAP)))
        self.update()

    def swatch_rect(self, number: int) -> QRectF:
        row, column = divmod(number, self.per_row)
        step = _SIDE + _GAP
        return QRectF(column * step + 0.5, row * step + 0.5, _SIDE, _SIDE)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = painter_on(self)
        painter.setPen(QColor("#8a94a3"))
        for number, color in enumerate(self.colors or [""]):
            painter.setBrush(QColor(color) if color else Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(self.swatch_rect(number), 4, 4)
        painter.end()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        for number in range(max(1, len(self.colors))):
            if self.swatch_rect(number).contains(event.position()):
                self.chosen.emit(number)
                return
