"""The plan tab: what a weaver decides about a project, and the plan that follows."""

from __future__ import annotations

import html
import re
from collections.abc import Generator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from PySide6.QtCore import QEvent, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QGuiApplication, QPalette, QResizeEvent, QShowEvent, QTextOption
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QGridLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QSplitter,
    QTextBrowser,
    QWidget,
)

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.fields.parameter_row import RowGroup
from spacemap_vtk.app.widgets import column, mark_bad, note, row, single_shot
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.parameters import AUTOMATIC, Parameter, bare_number
from spacemap_vtk.scenes.plan import ScenePlan, plan_scene
from spacemap_vtk.scenes.plan_settings import PlanSettings
from spacemap_vtk.scenes.plan_tables import PlanTable, plan_as_csv, plan_tables
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.yarn_library import YARNS
from spacemap_vtk.units import UNITS

#: Time without changes until the plan is computed, in ms.
_REST_TIME = 250
#: Units of numbers that are typed without one, by the unit of the parameter.
_USUAL_UNITS = {
    "metric": {"m": "cm", "1/m": "/cm", "": "%"},
    "imperial": {"m": "in", "1/m": "epi", "": "%"},
}
#: Names of units that would be read as other words.
_NAMES = {"in": "inches"}
#: The unit of a reed typed without one.
_REED_UNITS = {"metric": "/10cm", "imperial": "dpi"}
#: Groups of fields that are folded at first.
_FOLDED = ("Loom", "Finishing")
_HINT = "A number without a unit is in {}; empty fields are automatic."
#: Least width of the tab for two columns of fields, in pixels.
_TWO_COLUMNS = 390
#: Tables with more columns are written small, with samples of colours in place of their codes.
_FEW_COLUMNS = 4
_COLOR = re.compile("#[0-9a-f]{6}")


class _Result(NamedTuple):
    #: Values of the scene, and of the plan's settings.
    key: Any
    plan: ScenePlan | SpacemapError


def _compute_plan(
    _drawn: Scene, key: Any, values: Mapping[str, Any], base: Path, settings: PlanSettings
) -> Generator[None, None, _Result]:
    """Plan the project of a scene of its own, so that the drawn one stays as it is."""
    yield
    try:
        return _Result(key, plan_scene(Scene(values, base), settings))
    except SpacemapError as error:
        return _Result(key, error)


class PlanTab(QWidget):
    """Fields for the project, and the plan as tables; a change in either updates the plan."""

    #: Ending of a file to write, and the settings of the plan.
    export_requested = Signal(str, object)

    def __init__(self, document: Document, engine: Engine) -> None:
        super().__init__()
        self._document, self._engine = document, engine
        self.settings = PlanSettings()
        #: Field of each setting.
        self.fields: dict[str, QLineEdit] = {}
        self.hint = note()
        self.units = QComboBox(toolTip=PlanSettings.parameter("units").help)
        self.units.addItems(["metric", "imperial"])
        self.units.activated.connect(self._set_units)
        self.result = QTextBrowser(openLinks=False)
        self.result.setFrameShape(QFrame.Shape.NoFrame)
        self.result.setWordWrapMode(QTextOption.WrapMode.WordWrap)  # never within a word
        fields = QScrollArea(widgetResizable=True)
        fields.setFrameShape(QFrame.Shape.NoFrame)
        fields.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        fields.setWidget(self._make_fields())
        parts = QSplitter(Qt.Orientation.Vertical, childrenCollapsible=False)
        parts.addWidget(fields)
        parts.addWidget(self.result)
        parts.setSizes([280, 500])
        self.copy_button = QPushButton("Copy", toolTip="Copy the plan for a spreadsheet")
        self.copy_button.clicked.connect(self._copy)
        self.buttons = {".pdf": QPushButton("PDF…"), ".csv": QPushButton("Table…")}
        for ending, tip in ((".pdf", "Save the plan as a page"), (".csv", "Save it as a table")):
            self.buttons[ending].setToolTip(tip)
            self.buttons[ending].clicked.connect(partial(self._export, ending))
        head = row(None, QLabel("Units"), self.units, None, spacing=6)
        below = row(None, self.copy_button, *self.buttons.values(), spacing=6)
        column(self, head, self.hint, (parts, 1), below, margins=(6, 6, 6, 6), spacing=6)
        self._plan: ScenePlan | None = None
        #: Key of the plan that was requested, and whether it has come.
        self._requested: Any = None
        self._is_complete = False
        self._rest_timer = single_shot(self, self._request, _REST_TIME)
        engine.background_ready.connect(self._receive)
        for signal in (document.changed, document.replaced):
            signal.connect(self._rest_timer.start)
        self._show_plan(None)
        self._show_defaults()
        self._show_hint()

    def showEvent(self, event: QShowEvent) -> None:
        """Request a plan that is missing or out of date."""
        super().showEvent(event)
        self._rest_timer.start()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Put the fields in two columns if there is room, otherwise in one."""
        super().resizeEvent(event)
        self._arrange(2 if event.size().width() >= _TWO_COLUMNS else 1)

    def _arrange(self, columns: int) -> None:
        for grid, pairs in self._grids:
            grid.setColumnStretch(3, columns - 1)
            for number, (label, field) in enumerate(pairs):
                line, place = divmod(number, columns)
                grid.addWidget(label, line, 2 * place)
                grid.addWidget(field, line, 2 * place + 1)

    def changeEvent(self, event: QEvent) -> None:
        """Show the plan again in the colours of another theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._show_plan(self._plan)

    def follow(self, _frame: Frame) -> None:
        """Request the plan again if the engine was not ready for it."""
        if self.isVisible() and not self._is_complete:
            self._rest_timer.start()

    def _make_fields(self) -> QWidget:
        groups: dict[str, list[Parameter[Any]]] = {}
        for parameter in PlanSettings.parameters.values():
            if parameter.name != "units":
                groups.setdefault(parameter.group, []).append(parameter)
        page, parts = QWidget(), []
        #: Labels and fields of each group, and their layout.
        self._grids: list[tuple[QGridLayout, list[tuple[QLabel, QWidget]]]] = []
        for title, parameters in groups.items():
            body = QWidget()
            grid = QGridLayout(body, horizontalSpacing=6, verticalSpacing=3)
            grid.setContentsMargins(0, 0, 0, 4)
            grid.setColumnStretch(1, 1)
            pairs = []
            for parameter in parameters:
                label = QLabel(parameter.label)
                field = self._make_field(parameter)
                label.setBuddy(field)
                label.setToolTip(field.toolTip())
                pairs.append((label, field))
            self._grids.append((grid, pairs))
            group = RowGroup(title)
            group.rows.append(body)
            group.lay_out(title in _FOLDED)
            parts.append(group)
        self._arrange(2)
        column(page, *parts, None, margins=(0, 0, 8, 0), spacing=2)
        return page

    def _make_field(self, parameter: Parameter[Any]) -> QWidget:
        default = parameter.automatic or parameter.default_text
        tip = f"{parameter.help}\n\nEmpty: {default}.\n\nAllowed: {parameter.allowed}."
        field: QWidget
        if parameter.name.endswith("_yarn"):
            box = QComboBox(editable=True, toolTip=tip)
            box.addItems(["", *YARNS])
            box.setMinimumContentsLength(8)
            box.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
            box.activated.connect(partial(self._submit, parameter.name))
            field, line = box, box.lineEdit()
        else:
            field = line = QLineEdit(toolTip=tip)
            line.setMinimumWidth(50)
        line.editingFinished.connect(partial(self._submit, parameter.name))
        self.fields[parameter.name] = line
        return field

    def _submit(self, name: str, *_: object) -> None:
        """Set the value of a field; mark a field whose text is refused."""
        line, parameter = self.fields[name], PlanSettings.parameter(name)
        text = line.text().strip()
        written = _add_unit(parameter, text, self.settings.units)
        try:
            if text and not parameter.is_automatic(text):
                self.settings.set_from_scene(name, written)
            else:
                self.settings.configure(**{name: parameter.default})
        except InputError as error:
            mark_bad(line, True)
            allowed = str(error.allowed)
            if unit := _USUAL_UNITS[self.settings.units].get(parameter.unit):
                # Unlike in a scene, a number without a unit is in that of the trade.
                name = _NAMES.get(unit, unit)
                allowed = allowed.replace(f", in {parameter.unit} or", f", in {name} or")
            self.hint.setText(f"{parameter.label}: {error.message}. Allowed: {allowed}.")
            return
        if mark_bad(line, False) or written != text:
            line.setText("" if text == AUTOMATIC else written)
        if not any(each.property("bad") for each in self.fields.values()):
            self._show_hint()
        self._rest_timer.start()

    def _set_units(self, _index: int) -> None:
        self.settings.configure(units=self.units.currentText())
        self._show_defaults()
        self._show_hint()
        self._rest_timer.start()

    def _show_defaults(self) -> None:
        """Show what empty fields mean, in the units of the plan."""
        for name, line in self.fields.items():
            parameter = PlanSettings.parameter(name)
            unit = _USUAL_UNITS[self.settings.units].get(parameter.unit, "")
            if parameter.automatic:
                text = AUTOMATIC
            elif parameter.kind == "real" and unit:
                text = f"{parameter.default / UNITS[parameter.unit][unit]:.3g} {unit}"
            else:
                text = parameter.default_text
            line.setPlaceholderText(text)

    def _show_hint(self) -> None:
        units = _USUAL_UNITS[self.settings.units]
        self.hint.setText(_HINT.format(f"{units['m']}, {units['1/m']} or %"))

    def _request(self) -> None:
        if not self.isVisible():
            return
        values, woven = self._document.values, self._document.scene.woven
        file = self._document.scene.draft_file
        stamp = file.stat().st_mtime_ns if file and file.is_file() else 0
        key = values, stamp, self.settings.settings
        if woven is None or (key == self._requested and self._is_complete):
            return
        self._requested, self._is_complete = key, False
        settings = PlanSettings(**self.settings.given_values)
        work = partial(
            _compute_plan, key=key, values=values, base=self._document.base, settings=settings
        )
        self._engine.start_background(work)

    def _receive(self, result: Any) -> None:
        if not isinstance(result, _Result) or result.key != self._requested:
            return  # the result belongs to another tab, or to former values
        self._is_complete = True
        if isinstance(result.plan, SpacemapError):
            error = result.plan
            line = self.fields.get(error.key or "")
            if line is not None:
                mark_bad(line, True)
            self.hint.setText(self._document.drafts.replace_paths(str(error)))
            return
        self._show_plan(result.plan)

    def _show_plan(self, plan: ScenePlan | None) -> None:
        self._plan = plan
        for button in (self.copy_button, *self.buttons.values()):
            button.setEnabled(plan is not None)
        position = self.result.verticalScrollBar().value()
        with QSignalBlocker(self.result):
            self.result.setHtml("" if plan is None else _plan_html(plan, self.palette()))
        self.result.verticalScrollBar().setValue(position)

    def _copy(self) -> None:
        if self._plan is not None:
            text = plan_as_csv(self._plan, "\t")
            QGuiApplication.clipboard().setText(text)

    def _export(self, ending: str) -> None:
        self.export_requested.emit(ending, self.settings.given_values)


def _add_unit(parameter: Parameter[Any], text: str, units: str) -> str:
    """Add the usual unit to numbers without one; a share up to 1 stays as it is."""
    if parameter.kind == "integer" or parameter.kind == "text":
        return text
    unit = _REED_UNITS[units] if parameter.name == "reed" else _USUAL_UNITS[units][parameter.unit]

    def complete(word: str) -> str:
        number = bare_number(word)
        if number is None or (unit == "%" and number <= 1.0) or parameter.name == "firmness":
            return word
        return f"{word} {unit}"

    return ", ".join(complete(word.strip()) for word in text.split(","))


def _plan_html(plan: ScenePlan, palette: QPalette) -> str:
    """Return the tables of a plan as a page; texts from files are escaped."""
    faint = palette.color(QPalette.ColorRole.PlaceholderText).name()
    units = plan.settings.units
    parts = [_table_html(table, units, faint) for table in plan_tables(plan)]
    return "".join(parts)


def _table_html(table: PlanTable, units: str, faint: str) -> str:
    title = f"<h4>{html.escape(table.title)}</h4>"
    texts = table.texts(units)
    if not table.headings and len(texts[0]) == 1:
        items = "".join(f"<li>{html.escape(text)}</li>" for (text,) in texts)
        return f"{title}<ul>{items}</ul>"
    is_wide = len(table.headings) > _FEW_COLUMNS
    rows = []
    if table.headings:
        rows.append([_cell_html(heading, faint) for heading in table.headings])
    for raw, row_texts in zip(table.rows, texts, strict=True):
        cells = []
        for number, (cell, text) in enumerate(zip(raw, row_texts, strict=True)):
            if not table.headings:
                cells.append(_cell_html(text, faint if number == 0 else "", wraps=number > 0))
            else:
                right = not isinstance(cell, str)
                wraps = is_wide and not right
                cells.append(_cell_html(text, right=right, wraps=wraps, short=is_wide))
        rows.append(cells)
    lines = "".join(f"<tr>{''.join(cells)}</tr>" for cells in rows)
    size = "small" if is_wide else "medium"
    return f'{title}<table cellspacing="0" cellpadding="1" style="font-size:{size}">{lines}</table>'


def _cell_html(
    text: str, color: str = "", right: bool = False, wraps: bool = False, short: bool = False
) -> str:
    """Return a cell; a colour is a sample, with its code unless `short`."""
    shown = html.escape(text)
    if not wraps:
        shown = shown.replace(" ", "&nbsp;")
    if _COLOR.fullmatch(text):
        sample = f'<span style="background-color:{text}">{"&nbsp;" * 5}</span>'
        shown = sample if short else f"{sample}&nbsp;{shown}"
    style = f"color:{color}; " if color else ""
    align = "right" if right else "left"
    return f'<td align="{align}" style="{style}padding-right:6px">{shown}</td>'
