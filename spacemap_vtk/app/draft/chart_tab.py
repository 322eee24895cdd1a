"""The chart tab: stitches and colours of a knit, and the transfer of edits to the scene."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QShowEvent
from PySide6.QtWidgets import QButtonGroup, QLabel, QWidget

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.draft.knit_chart import KEYS, SYMBOLS, KnitChart
from spacemap_vtk.app.draft.palette import Palette
from spacemap_vtk.app.widgets import CountBox, NarrowComboBox, column, note, row, tool_button
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.scenes.editable_knit import (
    STITCHES,
    EditableKnit,
    make_editable_knit,
    require_knittable,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.rods.stitches import STRUCTURES

#: Section that edits change, and its keys.
_SECTION = "textile"
_KEYS = ("rows", "chart", "color")
_HINT = (
    "Drag to set stitches or to paint · Strip: colour of a row · Right button: pick a colour · "
    "Keys: letters, arrows, Enter, space"
)
#: The key of each stitch.
_KEY_OF = {word: key for key, word in KEYS.items()}
#: What stitches do.
_TIPS = {
    "k": "a loop that is pulled to the face",
    "p": "a loop that is pulled to the back",
    "t": "an open loop beside the loop below, which is held",
    "m": "the loop below is held, and the yarn floats behind it",
    "f": "the loop below is held, and the yarn floats before it",
    "yo": "an open loop drawn through nothing, which leaves a hole; needs a decrease in its row",
    "k2tog": "two stitches together, the left one in front; needs a yarn over in its row",
    "ssk": "two stitches together, the right one in front; needs a yarn over in its row",
    "sk2p": "three stitches together, the right one in front; needs two yarn overs in its row",
    "s2kp": "three stitches together, the middle one in front; needs two yarn overs in its row",
    "c4f": "four stitches cross, those that move to the left in front",
    "c4b": "four stitches cross, those that move to the right in front",
}
#: Buttons in a row.
_ACROSS = 7


def is_knit(scene: Scene) -> bool:
    """Return whether a scene has a knit."""
    return scene.source.section == _SECTION and scene.source.kind == "knit"


class ChartTab(QWidget):
    """Show and edit the chart of a knit; every edit can be undone."""

    #: The error of an edit.
    failed = Signal(object)
    #: An edit was accepted, so earlier errors are obsolete.
    accepted = Signal()

    def __init__(self, document: Document) -> None:
        super().__init__()
        self._document = document
        self._key: object = None
        #: Stitches and rows that are shown, one repeat or several.
        self._size = (1, 1)
        self.chart = KnitChart()
        self.palette_row = Palette()
        self.hint = note(_HINT, alignment=Qt.AlignmentFlag.AlignTop)
        # Fixed height: otherwise the chart would move under the mouse when the hint changes.
        self.hint.setFixedHeight(3 * self.hint.fontMetrics().height() + 2)
        self.placeholder = note(alignment=Qt.AlignmentFlag.AlignCenter)
        self.tools = QWidget()
        self._make_tools()
        below = (self.palette_row, (self.placeholder, 1), (self.chart, 1), self.hint)
        column(self, self.tools, *below, margins=(6, 6, 6, 6), spacing=6)
        self.chart.edited.connect(self._store)
        self.chart.cancelled.connect(self._discard)
        self.chart.hovered.connect(lambda text: self.hint.setText(text or _HINT))
        self.chart.color_picked.connect(self.palette_row.choose)
        self.palette_row.chosen.connect(self._set_color)
        self.palette_row.changed.connect(self._replace_color)
        document.changed.connect(self.refresh)
        document.replaced.connect(self._clear)
        document.replaced.connect(self.refresh)

    def refresh(self) -> None:
        """Show the chart of the document if the tab is visible."""
        if not self.isVisible() or self.chart.is_stroking:
            return
        source = self._document.scene.source
        if not is_knit(self._document.scene):
            self._show_knit(None, "This scene has no knit.")
            return
        key = tuple(getattr(source, name) for name in _KEYS)
        if key == self._key:
            return
        self._key = key
        try:
            shown = make_editable_knit(*key)
        except SpacemapError as error:
            self._show_knit(None, error.message)
        else:
            if all(wanted % own == 0 for wanted, own in zip(self._size, shown.size, strict=True)):
                shown = shown.resize(*self._size)
            self._show_knit(shown)

    def showEvent(self, event: QShowEvent) -> None:
        """Show changes that were made while the tab was hidden."""
        super().showEvent(event)
        self.refresh()

    def _discard(self) -> None:
        """Show the chart of the document instead of one that cannot be knitted yet."""
        self._key = None
        self.hint.setText(_HINT)
        self.refresh()

    def _clear(self) -> None:
        """Forget what belongs to the former scene."""
        self.palette_row.clear()
        self._key, self._size = None, (1, 1)

    def _make_tools(self) -> None:
        self.buttons = {}
        group = QButtonGroup(self)
        for letter, name in STITCHES.items():
            tip = f"{name.capitalize()}: {_TIPS[letter]}. Key {_KEY_OF[letter]}"
            self.buttons[letter] = tool_button(SYMBOLS[letter] or "□", tip, checkable=True)
        tip = "Paint the colours of stitches; the strip paints rows"
        self.buttons[""] = tool_button("Colour", tip, checkable=True)
        for letter, button in self.buttons.items():
            group.addButton(button)
            button.clicked.connect(partial(self._choose, letter))
        self.buttons[self.chart.letter].setChecked(True)
        self.structure = NarrowComboBox(12, toolTip="Stitches of a known structure")
        self.structure.addItems(["Structure…", *STRUCTURES])
        self.structure.activated.connect(self._set_structure)
        self.counts: dict[str, CountBox] = {}
        fields: list[QWidget] = []
        for name in ("stitches", "rows"):
            tip = f"Number of {name} in a repeat; a larger number repeats the chart"
            spin = CountBox(minimum=1, maximum=400, keyboardTracking=False, toolTip=tip)
            spin.range_error_changed.connect(lambda reason: self.hint.setText(reason or _HINT))
            spin.valueChanged.connect(self._resize)
            self.counts[name] = spin
            fields += [QLabel(name.capitalize()), spin]
        legend = note(
            " · ".join(
                f"{SYMBOLS[letter] or '□'} {name} ({_KEY_OF[letter]})".replace(" ", "\u00a0")
                for letter, name in STITCHES.items()
            )
        )
        buttons = list(self.buttons.values())
        column(
            self.tools,
            row(None, *buttons[:_ACROSS], None, spacing=2),
            row(None, *buttons[_ACROSS:], None, spacing=2),
            legend,
            row(None, *fields, None, spacing=6),
            row(None, self.structure, None),
            spacing=4,
        )

    def _show_knit(self, shown: EditableKnit | None, reason: str = "") -> None:
        if shown is None:
            self._key = None
        for widget in (self.chart, self.tools, self.palette_row, self.hint):
            widget.setVisible(shown is not None)
        self.placeholder.setText(reason)
        self.placeholder.setVisible(shown is None)
        self.chart.show_knit(shown)
        if shown is not None:
            self.palette_row.show_colors(shown.colors.reshape(-1, 3))
            for spin, value in zip(self.counts.values(), shown.size, strict=True):
                with QSignalBlocker(spin):
                    spin.setValue(value)

    def _store(self, shown: EditableKnit, name: str) -> None:
        """Transfer a chart to the scene; show the former one again if it is refused."""
        if reason := _reason_to_wait(shown):
            # Lace is entered stitch by stitch; it is stored as soon as its rows can be knitted.
            self.hint.setText(reason)
            return
        source = self._document.scene.source
        try:
            values = shown.values()
            require_knittable(values)
            parameters = source.parameters
            changed = {
                key: value
                for key, value in values.items()
                if (None if value is None else parameters[key].convert(value))
                != getattr(source, key)
            }
            self._document.set_many(_SECTION, changed, name=name)
        except SpacemapError as error:
            self._key = None
            self.refresh()
            self.failed.emit(error)
        else:
            self.accepted.emit()

    def _choose(self, letter: str) -> None:
        self.chart.letter = letter

    def _set_color(self, color: QColor) -> None:
        self.chart.color = color
        self.chart.letter = ""
        self.buttons[""].setChecked(True)

    def _replace_color(self, old: QColor, new: QColor) -> None:
        if self.chart.shown is not None:
            rgb = [(color.red(), color.green(), color.blue()) for color in (old, new)]
            self._store(self.chart.shown.with_replaced_color(*rgb), "colour")

    def _set_structure(self, index: int) -> None:
        if self.chart.shown is not None and index:
            rows = STRUCTURES[self.structure.itemText(index)]
            self.structure.setCurrentIndex(0)
            self._store(self.chart.shown.with_rows(rows), "structure")

    def _resize(self) -> None:
        if self.chart.shown is None:
            return
        try:
            shown = self.chart.shown.resize(*(spin.value() for spin in self.counts.values()))
        except SpacemapError as error:
            self._key = None
            self.refresh()
            self.failed.emit(error)
            return
        self._size = shown.size
        self._show_knit(shown)
        self._store(shown, "repeat")


def _reason_to_wait(shown: EditableKnit) -> str:
    """Return why a chart cannot be knitted yet; nothing if all rows make what they use."""
    for y in range(shown.size[1]):
        if surplus := shown.surplus(y):
            missing = "decrease" if surplus > 0 else "yarn over"
            return (
                f"Row {y + 1} makes {abs(surplus)} stitch{'es' if abs(surplus) > 1 else ''} too "
                f"{'many' if surplus > 0 else 'few'}: add a {missing}, or discard it with Esc"
            )
    return ""
