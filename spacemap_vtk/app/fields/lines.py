"""Editors of one line: text, a choice, true and false, a colour, a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtGui import QColor
from PySide6.QtWidgets import QCheckBox, QColorDialog, QComboBox, QFileDialog, QPushButton

from spacemap_vtk.app.fields.editor import Editor, LineEditor, leave_wheel
from spacemap_vtk.app.widgets import row
from spacemap_vtk.parameters import Choice, Integer, Parameter
from spacemap_vtk.scenes.assignments import value_of

#: So many numbers are chosen from, not slid over.
_FEW = 5


class TextEditor(LineEditor):
    """A line of text, as a scene file would have it: for any kind of parameter."""

    wide = False

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        row(self, self.line)

    def show_value(self, value: Any) -> None:
        """Show it with its unit."""
        self.show_text("" if value is None else _bare(self.parameter.show(value)))

    def written(self, text: str) -> Any:
        """Return a number, a list or a string; None where a value can be left out."""
        return None if text == "" and self.parameter.optional else value_of(text)


class ChoiceEditor(Editor):
    """A combo box with the declared words, or with the few whole numbers that are allowed."""

    wide = False

    def __init__(self, parameter: Choice | Integer) -> None:
        super().__init__(parameter)
        self.box = QComboBox()
        leave_wheel(self.box)
        self.box.setMinimumContentsLength(4)
        self.box.setSizeAdjustPolicy(
            self.box.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        for choice in few(parameter) if isinstance(parameter, Integer) else parameter.choices:
            self.box.addItem(str(choice), choice)
        row(self, self.box)
        self.setFocusProxy(self.box)
        self.box.activated.connect(self._chosen)

    def show_value(self, value: Any) -> None:
        self.box.setCurrentIndex(self.box.findData(value))

    def show_in_use(self, value: Any) -> None:
        """Show it in place of a choice."""
        self.box.setPlaceholderText("" if value is None else str(value))

    def _chosen(self) -> None:
        self.edited.emit(self.box.currentData(), 0)


def few(parameter: Integer) -> range:
    """Return the numbers that are allowed, if they are few; else none."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.optional or low is None or high is None or high - low >= _FEW:
        return range(0)
    return range(round(low), round(high) + 1)


class FlagEditor(Editor):
    """A check box."""

    wide = False

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.box = QCheckBox("On")
        row(self, self.box)
        self.setFocusProxy(self.box)
        self.box.clicked.connect(self._clicked)

    def show_value(self, value: Any) -> None:
        self.box.setChecked(bool(value))

    def _clicked(self, checked: bool) -> None:
        self.edited.emit(checked, 0)


class ColorEditor(LineEditor):
    """A patch of the colour, which opens a dialog, and its digits."""

    wide = False

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.button = QPushButton()
        self.button.setFixedWidth(40)
        self.button.setToolTip("Choose a colour")
        row(self, self.button, (self.line, 1))
        self.button.clicked.connect(self._choose)

    def show_value(self, value: Any) -> None:
        self.show_text("" if value is None else self.parameter.show(value))
        fill = self.shown or "transparent"
        self.button.setStyleSheet(
            f"background-color: {fill}; border: 1px solid #8a94a3; border-radius: 4px;"
        )

    def _choose(self) -> None:
        color = QColorDialog.getColor(QColor(self.shown), self, self.parameter.label)
        if color.isValid():
            self.edited.emit(color.name(), 0)


class FileEditor(LineEditor):
    """A path, and a button that opens a dialog."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.button = QPushButton("Browse…")
        #: What to call a file.
        self.told: Callable[[Path], str] = str
        row(self, (self.line, 1), self.button)
        self.button.clicked.connect(self._browse)

    def show_value(self, value: Any) -> None:
        self.show_text("" if value is None else self.told(value))
        #: Where a dialog begins: nobody knows of a file that is called otherwise.
        self._file = str(value) if str(value).endswith(self.shown) else ""

    def _browse(self) -> None:
        file, _ = QFileDialog.getOpenFileName(self, self.parameter.label, self._file)
        if file:
            self.edited.emit(file, 0)


def _bare(text: str) -> str:
    """Leave out quotes round the whole: people do not type them."""
    quoted = len(text) >= 2 and text[0] == text[-1] == '"' and '"' not in text[1:-1]
    return text[1:-1] if quoted else text
