"""Fields for the parameters of the selected stage."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QFrame, QLineEdit, QPushButton, QScrollArea, QSlider, QWidget
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.fields.basic_editors import FileEditor
from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.grips_editor import GripsEditor
from spacemap_vtk.app.fields.loads_editor import LoadsEditor
from spacemap_vtk.app.fields.obstacles_editor import ObstaclesEditor
from spacemap_vtk.app.fields.parameter_info import automatic_values, feasible_intervals, idle_reason
from spacemap_vtk.app.fields.parameter_row import ParameterRow, RowGroup, RowPair, make_editor
from spacemap_vtk.app.fields.places_editor import PLACES, PlacesEditor
from spacemap_vtk.app.fields.view_editors import CameraEditor, CamerasEditor, InsetsEditor
from spacemap_vtk.app.widgets import column, note, single_shot
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.grip import Grips
from spacemap_vtk.filters.load import Loads
from spacemap_vtk.filters.obstacle import Obstacles
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.parameters import Parameter, Parameterised
from spacemap_vtk.scenes.flat_picture import picture_size
from spacemap_vtk.scenes.insets import Insets
from spacemap_vtk.scenes.pipeline import section_classes
from spacemap_vtk.scenes.saved_cameras import CameraName, SavedCameras
from spacemap_vtk.scenes.settings import View

#: Shortest time between two computations of feasible intervals, in s. During a drag, one
#: computation costs as much as a few frames.
_LIMIT_SECONDS = 0.25
#: Largest fraction of the time that these computations may take.
_LIMIT_SHARE = 0.02
#: Number of settings for which feasible intervals are kept: some steps of undo, and other pages.
_KEPT_INTERVALS = 8
#: Sections with more parameters get a search field.
_SEARCH_FROM = 8


class Page(QWidget):
    """The form of one section; `Properties` makes it when it is first shown, and keeps it."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: dict[str, ParameterRow] = {}
        #: Groups of rows below a heading, and pairs of rows for warp and weft.
        self.groups: dict[str, RowGroup] = {}
        self.pairs: list[RowPair] = []
        self.search = QLineEdit(placeholderText="Search parameters", clearButtonEnabled=True)
        self.switch_on_button = QPushButton("Switch on")

    def leave(self) -> None:
        """End a drag and forget a text that has not been submitted, as the page is hidden."""
        for slider in self.findChildren(QSlider):
            slider.setSliderDown(False)  # it will never be told of the release
        focused = self.focusWidget()
        if focused is not None and focused.hasFocus():
            with QSignalBlocker(focused):
                focused.clearFocus()
        self.search.clear()
        self.hide()


class Properties(QScrollArea):
    """A form with a row for each declared parameter of one section."""

    #: The error by which a value was refused.
    refused = Signal(object)
    #: The burst of an accepted value.
    accepted = Signal(int)
    #: Whether a drag is in progress.
    dragging = Signal(bool)
    #: The shown section, which shall be switched on.
    switched_on = Signal(str)
    #: Number and `Obstacle` of the selected card, see `ObstaclesEditor.selected`.
    obstacle_selected = Signal(object, object)

    def __init__(self, document: Document) -> None:
        super().__init__(widgetResizable=True)
        self._document = document
        self.section = ""
        self._shown: tuple[str, Mapping[str, Any], dict[str, Any]] | None = None
        self._page = Page()
        #: The page of each section that has been shown.
        self._pages: dict[str, Page] = {}
        #: Results of the last run about the parameters, by section and name; see `show_results`.
        self._results: dict[str, dict[str, Any]] = {}
        #: Values that the last run used for automatic parameters, by section and name.
        self._in_use: dict[str, Mapping[str, Any]] = {}
        #: Bounds of the object [m] and gravity, see `set_object`.
        self._bounds: tuple[Sequence[float], Sequence[float]] = (-0.05, 0.05) * 3, (0.0, 0.0, -1.0)
        #: Editor of the obstacles; made with its page.
        self._obstacles: ObstaclesEditor | None = None
        #: Editors of springs, masses and rigid bodies, and of loads; made with their pages.
        self._places: list[PlacesEditor] = []
        self._loads: list[LoadsEditor] = []
        #: The shown cage; None without one.
        self._cage: vtkUnstructuredGrid | None = None
        self._next_limits = 0.0
        #: The last settings of which feasible intervals were computed, and these intervals.
        self._feasible: deque[tuple[dict[str, Any], dict[str, tuple[float, float]]]] = deque(
            maxlen=_KEPT_INTERVALS
        )
        #: Name of the row that was edited last, or "" after another change.
        self._last_edited = ""
        self._limits_timer = single_shot(self, self._show_limits)
        self._wanted: ParameterRow | None = None
        self._reach_timer = single_shot(self, self._reach_row, 50)
        self._scroll_timer = single_shot(self, self._scroll_to_selected, 50)
        body = QWidget()
        column(body, self._page)
        self.setWidget(body)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        document.changed.connect(self.refresh)
        document.replaced.connect(self._clear_results)
        document.replaced.connect(self.refresh)

    def show_section(self, section: str) -> None:
        """Show the page of a section."""
        self.dragging.emit(False)
        self._page.leave()
        self.section = section
        self._shown = None
        self._next_limits = 0.0
        if section not in self._pages:
            # To make a page takes some twenty times as long as to show it again.
            self._pages[section] = self._make_page(section)
            self.widget().layout().addWidget(self._pages[section])
        self._page = self._pages[section]
        self._page.show()
        self.verticalScrollBar().setValue(0)
        self.refresh()

    def _make_page(self, section: str) -> Page:
        page = Page()
        cls = section_classes()[section]
        about = note((cls.__doc__ or "").strip().splitlines()[0])
        page.search.textChanged.connect(self._filter_rows)
        page.switch_on_button.clicked.connect(lambda: self.switched_on.emit(section))
        parts: list[QWidget] = [about, page.switch_on_button]
        if len(cls.parameters) > _SEARCH_FROM:
            parts.insert(1, page.search)
        for name, parameter in cls.parameters.items():
            if name in page.rows:
                continue  # the weft's row, which is already beside the warp's
            if parameter.group and parameter.group not in page.groups:
                page.groups[parameter.group] = group_widget = RowGroup(parameter.group)
                parts.append(group_widget)
            group = page.groups[parameter.group].rows if parameter.group else parts
            partner = name.replace("warp_", "weft_", 1)
            if partner != name and partner in cls.parameters:
                warp, weft = (
                    self._make_row(page, parameter, "Warp"),
                    self._make_row(page, cls.parameters[partner], "Weft"),
                )
                page.pairs.append(RowPair(warp, weft))
                group.append(page.pairs[-1])
            else:
                group.append(self._make_row(page, parameter))
        for group_widget in page.groups.values():
            group_widget.lay_out(folded=False)
        column(page, *parts, None, margins=(10, 6, 10, 10), spacing=4)
        return page

    @property
    def rows(self) -> dict[str, ParameterRow]:
        """The rows of the shown page, by the names of their parameters."""
        return self._page.rows

    @property
    def groups(self) -> dict[str, RowGroup]:
        """The groups of rows of the shown page, by their titles."""
        return self._page.groups

    @property
    def search(self) -> QLineEdit:
        """The search field of the shown page."""
        return self._page.search

    @property
    def switch_on_button(self) -> QPushButton:
        """The button that switches the stage of the shown page on."""
        return self._page.switch_on_button

    @property
    def _part(self) -> Parameterised:
        return self._document.scene.parts[self.section]

    @property
    def _scene_values(self) -> Mapping[str, Any]:
        """The values of the section that are written in the scene file."""
        return self._document.values.get(self.section, {})

    def set_object(
        self,
        bounds: Sequence[float],
        gravity: Sequence[float],
        cage: vtkUnstructuredGrid | None,
    ) -> None:
        """Set bounds [m], gravity and cage, from which new cards choose their first values."""
        self._bounds, self._cage = (bounds, gravity), cage
        for loads in (*self._loads, *self._places):
            loads.cage = cage
        if self._obstacles is not None:
            self._obstacles.set_bounds(bounds, gravity)
        for editor in self._places:
            editor.set_bounds(bounds)

    def select_obstacle(self, number: int | None = None) -> None:
        """Select the card of an obstacle, if its page has been shown, or none."""
        if self._obstacles is not None:
            self._obstacles.select(number)
            self._scroll_timer.start()

    def _scroll_to_selected(self) -> None:
        """Scroll to the selected card, once its page is laid out."""
        cards = [] if self._obstacles is None else self._obstacles.cards
        for card in cards:
            if card.property("selected"):
                self.ensureWidgetVisible(card)

    def move_obstacle(self, number: int, changes: dict[str, Any]) -> None:
        """Change values of an obstacle whose handle the mouse has moved."""
        if self._obstacles is not None:
            self._obstacles.change(number, changes)

    def _show_value(self, row: ParameterRow) -> None:
        name = row.parameter.name
        if isinstance(row.editor, CameraEditor) and isinstance(self._part, View):
            row.editor.offer(camera.name for camera in self._part.cameras)
        row.show_value(getattr(self._part, name), name not in self._scene_values)

    def _make_row(
        self, page: Page, parameter: Parameter[Any], half_label: str = ""
    ) -> ParameterRow:
        # Editors of records are made here, not by `make_editor`, because they contain rows.
        editor: Editor
        if isinstance(parameter, Loads):
            editor = LoadsEditor(parameter)
            editor.cage = self._cage
            self._loads.append(editor)
        elif isinstance(parameter, Obstacles):
            editor = self._obstacles = ObstaclesEditor(parameter)
            editor.set_bounds(*self._bounds)
            editor.selected.connect(self.obstacle_selected)
        elif isinstance(parameter, Grips):
            editor = GripsEditor(parameter)
        elif isinstance(parameter, PLACES):
            editor = PlacesEditor(parameter)
            editor.set_bounds(self._bounds[0])
            editor.cage = self._cage
            self._places.append(editor)
        elif isinstance(parameter, Insets):
            editor = InsetsEditor(parameter)
        elif isinstance(parameter, SavedCameras):
            editor = CamerasEditor(parameter)
        elif isinstance(parameter, CameraName):
            editor = CameraEditor(parameter)
        else:
            editor = make_editor(parameter)
        if isinstance(editor, FileEditor):
            editor.display_name = self._document.display_name
        row = ParameterRow(parameter, editor, half_label)
        row.edited.connect(self._set_value)
        row.dragging.connect(self.dragging)
        row.restored.connect(self._clear_refusal)
        editor.refused.connect(partial(self._refuse, parameter.name))
        page.rows[parameter.name] = row
        return row

    def _filter_rows(self, text: str) -> None:
        """Show only the rows that match the search."""
        for row in self.rows.values():
            row.match_search(text.lower().split())
        self._hide_empty_groups()

    def _hide_empty_groups(self) -> None:
        """Hide pairs and groups without visible rows."""
        for pair in self._page.pairs:
            pair.setVisible(not all(row.isHidden() for row in pair.rows))
        for group in self.groups.values():
            group.setVisible(not all(row.isHidden() for row in group.rows))
            group.unfold(bool(self.search.text()))

    def refresh(self) -> None:
        """Show the values of the document."""
        self._last_edited = ""
        if not self.section:
            return
        part, written = self._part, self._scene_values
        # Setting a value switches a stage on. A stage that needs no value, such as RotationStrain,
        # needs this button.
        self.switch_on_button.setVisible(
            isinstance(part, Stage) and part not in self._document.scene.stages
        )
        # A drag elsewhere changes nothing in this section.
        state = self.section, written, part.settings
        if state == self._shown and not any(r.property("bad") for r in self.rows.values()):
            return
        before, self._shown = self._shown, state
        for name, row in self.rows.items():
            shown = before and (before[2][name], name in before[1])
            if shown != (getattr(part, name), name in written) or row.property("bad"):
                self._show_value(row)
        self._show_relevant_rows()

    def _show_relevant_rows(self) -> None:
        part, written = self._part, self._scene_values
        for name, row in self.rows.items():
            if row.parameter.when:
                reason = idle_reason(part, name, self._results.get(self.section, {}))
                row.show_idle(self._document.drafts.replace_paths(reason), name in written)
        self._hide_empty_groups()
        wait = self._next_limits - time.perf_counter()
        if wait <= 0.0:
            self._show_limits()
        elif not self._limits_timer.isActive():
            self._limits_timer.start(round(wait * 1e3) + 1)

    def show_results(
        self, section: str, figures: dict[str, Any], in_use: dict[str, Mapping[str, Any]]
    ) -> None:
        """Show results of a run about a section's parameters, and all automatic values it used."""
        if figures == self._results.get(section, {}) and in_use == self._in_use:
            return
        self._results[section], self._in_use = figures, in_use
        if self.section:
            self._show_relevant_rows()

    def _clear_results(self) -> None:
        self.select_obstacle(None)
        self.set_object(*self._bounds, None)
        self._results, self._in_use = {}, {}
        self._next_limits = 0.0  # show the new scene's intervals without delay
        for row in self.rows.values():
            row.show_automatic_value(None)  # remove the former scene's automatic values

    def _show_limits(self) -> None:
        begin, part = time.thread_time(), self._part
        feasible, results = self._feasible_of(part), self._results.get(self.section, {})
        values = {**automatic_values(part), **self._in_use.get(self.section, {}), **results}
        if part is self._document.scene.view:
            values |= {"size": picture_size(self._document.scene)}
        if isinstance(part, Woven) and "pattern" in self.rows and part.draft_file is None:
            with suppress(SpacemapError):  # the run of the stage reports the error
                threads = part.cloth.threads
                self.rows["pattern"].editor.grid.show_colors(*(each.colors for each in threads))
        for name, row in self.rows.items():
            row.show_automatic_value(values.get(name))
            row.show_feasible(feasible.get(name))
            # A choice that already shows this value needs no note.
            same = row.parameter.kind == "choice" and results.get(name) == getattr(part, name)
            row.show_used(
                row.parameter.format_figure(results[name]) if name in results and not same else ""
            )
        duration = time.thread_time() - begin
        self._next_limits = time.perf_counter() + max(_LIMIT_SECONDS, duration / _LIMIT_SHARE)

    def _feasible_of(self, part: Parameterised) -> dict[str, tuple[float, float]]:
        # They depend only on the settings, except that a draft file may have changed.
        if getattr(part, "draft", None) is not None:
            return feasible_intervals(part)
        settings = part.settings
        for known, intervals in self._feasible:
            if known == settings:
                return intervals
        self._feasible.append((settings, feasible_intervals(part)))
        return self._feasible[-1][1]

    def show_parameter(self, name: str) -> None:
        """Scroll to the row of a parameter of the shown page, and put the keyboard in it."""
        row = self.rows[name]
        if row.parameter.group:
            self.groups[row.parameter.group].head.setChecked(True)
        self._wanted = row
        self._reach_timer.start()

    def _reach_row(self) -> None:
        """Scroll to the wanted row, once its page is laid out."""
        if self._wanted is not None and self._wanted.isVisible():
            self.ensureWidgetVisible(self._wanted)
            self._wanted.editor.setFocus()

    def mark_error(self, error: SpacemapError, kind: str = "value") -> None:
        """Mark the field that an error names, if it is on this page."""
        row = self.rows.get(error.key or "")
        if row is not None and row.automatic is not None and row.automatic.isChecked():
            row = self.rows.get(
                self._last_edited, row
            )  # the automatic value follows from the edited one
        if row is not None and error.section in (None, self.section):
            cure = f": {error.window_cure}" if error.window_cure else ""
            row.mark_error(f"{error.message}{cure}", kind)
            if row.parameter.group:
                self.groups[row.parameter.group].head.setChecked(True)
            self.ensureWidgetVisible(row)

    def restore_refused(self) -> bool:
        """Replace refused values by the document's; return whether there were any."""
        refused = [row for row in self.rows.values() if row.error_kind == "value"]
        for row in refused:
            self._show_value(row)
        if refused:
            self.accepted.emit(0)
        return bool(refused)

    def clear_errors(self, kind: str) -> None:
        """Remove the marks of one kind of error."""
        for row in self.rows.values():
            if row.error_kind == kind:
                row.mark_error(None)

    def _set_value(self, name: str, written: object, burst: int) -> None:
        # A value replaces the others from which it would follow, as a yarn its diameter.
        replaced = [
            other
            for group in getattr(self._part, "alternatives", ())
            for other in group
            if name in group and other != name and written is not None
            if other in self._scene_values
        ]
        try:
            changes = {name: written, **dict.fromkeys(replaced)}
            self._document.set_many(self.section, changes, burst)
        except InputError as error:
            self._refuse(name, error)
        else:
            # If the former value is chosen again after a refused one, the document does not change
            # and `refresh` does not run.
            self.rows[name].mark_error(None)
            self._last_edited = name
            self.accepted.emit(burst)

    def _refuse(self, name: str, error: InputError) -> None:
        """Mark the row of a refused value, and report the error."""
        error.section = error.section or self.section
        self.mark_error(error)
        # The error may name a part of the value, for which there is no row; `restore_refused`
        # must find this row.
        self.rows[name].error_kind = "value"
        self.refused.emit(error)

    def _clear_refusal(self) -> None:
        row = self.sender()
        if row.error_kind == "value":  # an error of a run remains: the run would fail again
            row.mark_error(None)
            self.accepted.emit(0)
