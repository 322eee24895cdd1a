"""Editor of supports."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from PySide6.QtWidgets import QGridLayout, QPushButton

from spacemap_vtk.app.fields.editor import LineEditor
from spacemap_vtk.app.widgets import column
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.places import SIDES, parse
from spacemap_vtk.parameters import Parameter

#: The sides as one sees them from the front, in the order in which they stand.
_WORDS = {
    "+y": "top",
    "+x": "right",
    "+z": "front",
    "-y": "bottom",
    "-x": "left",
    "-z": "back",
}
assert set(_WORDS) == set(SIDES)


class SupportsEditor(LineEditor):
    """A button for each side of the box, and a line for all that can be held."""

    def __init__(self, parameter: Parameter[Any]) -> None:
        super().__init__(parameter)
        self.sides: dict[str, QPushButton] = {}
        grid = QGridLayout()
        grid.setSpacing(4)
        for number, (side, word) in enumerate(_WORDS.items()):
            button = QPushButton()
            button.setObjectName("side")
            button.setCheckable(True)
            button.setToolTip(f"Hold the {word} side of the cage's box, {side}")
            button.clicked.connect(self._clicked)
            grid.addWidget(button, number // 3, number % 3)
            self.sides[side] = button
        column(self, grid, self.line, spacing=4)
        self.show_value(())

    def show_value(self, value: Any) -> None:
        """Press the buttons of the sides that are held."""
        self.show_text(" ".join(value or ()))
        held = {support.shape: support for support in parse(self.shown)}
        for side, button in self.sides.items():
            button.setChecked(side in held)
            partly = str(held[side]).removeprefix(side)[1:].strip("()") if side in held else ""
            button.setText(f"{side} {_WORDS[side]}" + (f" ({partly})" if partly else ""))

    def show_in_use(self, value: Any) -> None:
        """Show in grey what is held of itself, or that nothing is."""
        self.line.setPlaceholderText(" ".join(value or ()) or "nothing is held")

    def _clicked(self) -> None:
        side = next(s for s, button in self.sides.items() if button is self.sender())
        kept = [str(support) for support in parse(self.shown) if support.shape != side]
        if self.sides[side].isChecked():
            kept.append(side)
        self.edited.emit(" ".join(kept), 0)

    def written(self, text: str) -> str:
        """Return the text; one that can be read is what the buttons change from now on."""
        with suppress(InputError):  # whoever takes it says what is wrong
            parse(text)
            self.shown = text
        return text
