"""The plots tab: requests curves, shows them and saves them."""

from __future__ import annotations

import csv
import io
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PySide6.QtCore import QEvent, Signal
from PySide6.QtGui import QHideEvent, QShowEvent, QStandardItemModel
from PySide6.QtWidgets import (
    QMenu,
    QProgressBar,
    QPushButton,
    QWidget,
)

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.documents.file_dialogs import ask_output_file
from spacemap_vtk.app.panels.add_stage import AddStageButton
from spacemap_vtk.app.plots.curves import (
    CurveRequest,
    Curves,
    FloatArray,
    compute_curves,
    motion_key,
)
from spacemap_vtk.app.view.pick import Pick
from spacemap_vtk.app.widgets import NarrowComboBox, column, is_dark, note, row, single_shot
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.draw.figure.plots import ENERGY_NAMES, QUANTITIES
from spacemap_vtk.draw.figure.reaction_plot import ReactionCurves, reaction_table
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import atomic_file, check_output, write_parts
from spacemap_vtk.io.registry import name_filter, writer, writer_endings

if TYPE_CHECKING:
    from spacemap_vtk.app.plots.chart import PlotCanvas

#: Time without changes until curves are computed, in ms.
_REST_TIME = 250
#: Place of the canvas in the tab.
_CANVAS = 5
_HINT = "Click the fabric to plot a point, Shift+click to add one. Click a plot to go to that time."
_OLD_CURVES = "These curves show the motion before the last change."
_FIRST_HINT = (
    "The plotted point moves most. Click the fabric to plot another point, Shift+click to add one."
)
#: Quantities of what holds the cloth: keys of `ReactionCurves.tables`.
REACTIONS = ("force", "moment")
_NO_REACTIONS = (
    "Forces and moments are plotted over time with the stage Transient response, and over the "
    "stroke of a grip or obstacle with a path."
)
_REACTION_HINT = (
    "What holds the cloth acts on it with these forces and moments. Moments are about the middle "
    "of a support, or about the centre of a grip or obstacle where it is then."
)
#: Quantities saved for a point over time, with their units.
_QUANTITIES = (("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s2"))


class PlotsTab(QWidget):
    """Plots of the motion, computed once after each change; playing only moves a cursor."""

    #: A time in s to go to, and whether more will follow at once.
    time_clicked = Signal(float, bool)
    #: Error of the computation; `shown` is emitted when new curves replace it.
    failed = Signal(object)
    shown = Signal()
    #: Error of writing a file; `written` is emitted when a file is written.
    write_failed = Signal(object)
    written = Signal()

    def __init__(self, document: Document, engine: Engine) -> None:
        super().__init__()
        self._document, self._engine = document, engine
        self.points: list[Pick] = []
        self.curves: Curves | None = None
        self._key = ""
        self._time = 0.0
        self._has_curves = False
        #: Values of the scene that was drawn last.
        self._drawn: dict[str, Any] = {}
        #: Created when the tab is first shown, because importing matplotlib takes time.
        self.canvas: PlotCanvas | None = None
        # In a narrow window, shorten the words rather than the view.
        self.quantity = NarrowComboBox(4)
        self.quantity.addItems([name.capitalize() for name in (*QUANTITIES, *REACTIONS)])
        self._quantity_is_chosen = False
        self.component = NarrowComboBox(4, toolTip="Component of the motion, force or moment")
        self.component.addItems(["along x", "along y", "along z", "magnitude"])
        self._component_is_chosen = False
        #: For forces and moments: the body on which they act, and the abscissa of the plot.
        self.body = NarrowComboBox(4, toolTip="Support, grip or obstacle that holds the cloth")
        self.abscissa = NarrowComboBox(4, toolTip="Abscissa of forces and moments")
        self.clear_button = QPushButton("Clear points")
        self.save_button = QPushButton("Save")
        menu = QMenu(self)
        self.save_actions = {
            "picture": menu.addAction("Picture…", self.save_picture),
            "times": menu.addAction("Curves over time…", self.save_times),
            "frequencies": menu.addAction("Frequency response…", self.save_frequencies),
            "reactions": menu.addAction("Forces and moments…", self.save_reactions),
        }
        self.save_button.setMenu(menu)
        self.hint = note(_HINT)
        self.add_button = AddStageButton("response")
        first = row(None, (self.quantity, 1), (self.component, 1))
        choices = row(None, (self.body, 1), (self.abscissa, 1))
        second = row(None, (self.clear_button, 1), (self.save_button, 1))
        #: Progress of the curves, with a button that cancels or starts the computation.
        self.progress_bar, self.run_button = QProgressBar(), QPushButton("Cancel")
        self.run_button.clicked.connect(self._cancel_or_compute)
        third = row(None, (self.progress_bar, 1), self.run_button)
        parts = self.hint, self.add_button, first, choices, second, None, third
        self._layout = column(self, *parts, margins=(6, 6, 6, 6))
        self._layout.addStretch(0)  # without a canvas, the rest stays at the top
        self._show_progress("")
        self.rest_timer = single_shot(self, self._request, _REST_TIME)
        self.quantity.activated.connect(self._choose_quantity)
        self.body.activated.connect(self._draw)
        self.abscissa.activated.connect(self._draw)
        self.component.activated.connect(self._choose_component)
        document.changed.connect(self._update_hint)
        document.replaced.connect(self._clear_curves)
        engine.background_ready.connect(self._receive)
        engine.background_progressed.connect(
            lambda share: self.progress_bar.setValue(int(100 * share))
        )
        self._enable_tools()

    def show_points(self, points: list[Pick]) -> None:
        self.points = points
        self._request_later()

    def follow(self, frame: Frame) -> None:
        """Move the cursor to a frame's time; request new curves if the motion has changed."""
        if frame.mode is not None:
            return
        self._time = frame.time
        self._has_curves = (
            frame.cage is not None or self._document.scene.stage("solver") is not None
        )
        self._drawn = frame.values
        if self.canvas is not None and self.isVisible():
            self.canvas.set_time(frame.time)
        if (
            self.isVisible()
            and not self.rest_timer.isActive()
            and self.make_request().key != self._key
        ):
            self._request_later()

    def stop(self) -> None:
        self.rest_timer.stop()
        self._engine.start_background(None)

    def save_picture(self) -> None:
        """Ask for a file name and save a picture of the plots."""
        assert self.canvas is not None
        figure = self.canvas.figure

        def save(path: Path) -> None:
            with atomic_file(path) as file:
                write = writer(path, "plot").write
                write(file, figure, dpi=200, facecolor=figure.get_facecolor())

        self._ask_and_write("plots.png", writer_endings("plot"), save)

    def save_times(self) -> None:
        """Ask for a file name and save the curves over time."""
        assert self.curves is not None
        self._ask_and_write(
            "motion.csv", {".csv": "table"}, partial(_write_csv, _time_columns(self.curves))
        )

    def save_frequencies(self) -> None:
        """Ask for a file name and save the frequency response."""
        assert self.curves is not None
        self._ask_and_write(
            "response.csv", {".csv": "table"}, partial(_write_csv, _response_columns(self.curves))
        )

    def save_reactions(self) -> None:
        """Ask for a file name and save the forces and moments over the chosen abscissa."""
        assert self.curves is not None
        table = reaction_table(self.curves.reactions[max(self.abscissa.currentIndex(), 0)])

        def save(path: Path) -> None:
            with atomic_file(path) as file:
                write_parts(file, [table.encode()])

        self._ask_and_write("reactions.csv", {".csv": "table"}, save)

    def showEvent(self, event: QShowEvent) -> None:
        """Create the canvas if there is none, and update the curves."""
        super().showEvent(event)
        if self.canvas is None:
            from spacemap_vtk.app.plots.chart import PlotCanvas

            self.canvas = PlotCanvas()
            self.canvas.time_clicked.connect(self.time_clicked)
            item = self._layout.takeAt(_CANVAS)
            del item
            self._layout.insertWidget(_CANVAS, self.canvas, 1)
            self.canvas.setVisible(self.curves is not None)
        self._request_later()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        if self.curves is None or self.curves.key != self._key:
            self._key = ""  # another tab's work may replace the computation of these curves

    def changeEvent(self, event: QEvent) -> None:
        """Draw the plots again in another theme."""
        if event.type() == QEvent.Type.PaletteChange:
            self._draw()
        super().changeEvent(event)

    def _request_later(self) -> None:
        if self.isVisible():
            self.rest_timer.start()

    def make_request(self) -> CurveRequest:
        animation = self._document.scene.animation
        start, stop = animation.span
        points = tuple(pick.rest for pick in self.points)
        key = repr((motion_key(self._document), points, start, stop))
        return CurveRequest(key, points, start, stop)

    def _request(self) -> None:
        request = self.make_request()
        if not self.isVisible() or request.key == self._key:
            return
        if self._engine.busy:
            self.rest_timer.start()
            return
        if self._drawn != self._document.values:
            return  # the last run failed or was cancelled, so the engine has older values
        self._key = request.key
        if self._has_curves:
            self.hint.setText("Computing…")
            self._show_progress("Cancel")
            self._engine.start_background(partial(compute_curves, request=request))
        else:
            self._receive(None)

    def _show_progress(self, button: str) -> None:
        """Show the button, with the progress bar if it is "Cancel"; an empty text hides both."""
        self.progress_bar.setValue(0)
        self.progress_bar.setVisible(button == "Cancel")
        self.run_button.setText(button)
        self.run_button.setVisible(bool(button))

    def _cancel_or_compute(self) -> None:
        if self.run_button.text() == "Cancel":
            self._engine.start_background(None)
            self._show_progress("Compute")
            self.hint.setText("Cancelled. Click Compute, or change the scene.")
        else:
            self._key = ""
            self._request()

    def _receive(self, result: Any) -> None:
        if not (isinstance(result, Curves | BaseException | None) and self.isVisible()):
            return  # the result was requested by another tab
        if isinstance(result, Curves) and self.run_button.text() == "Compute":
            return  # the computation ended at the moment when it was cancelled
        self._show_progress("")
        if isinstance(result, BaseException):
            self.failed.emit(result)
            self.hint.setText(_HINT)
            return
        if result is not None and result.key != self._key:
            return
        self.shown.emit()
        self.curves = result
        if result is None:
            self.hint.setText("This scene does not move. Modal response lets it swing.")
        else:
            self._offer_quantities(result)
            self._show_largest_component()
        self._enable_tools()
        self.add_button.setVisible(result is None)
        for widget in (self.quantity, self.component, self.clear_button, self.save_button):
            widget.setVisible(result is not None)
        if self.canvas is not None:
            self.canvas.setVisible(result is not None)
        self._draw()

    def _offer_quantities(self, curves: Curves) -> None:
        """Let the combo boxes offer what the curves contain."""
        model = self.quantity.model()
        assert isinstance(model, QStandardItemModel)
        first = len(QUANTITIES)
        for number in range(model.rowCount()):
            is_reaction = number >= first
            model.item(number).setEnabled(bool(curves.reactions) if is_reaction else curves.moves)
            model.item(number).setToolTip(
                _NO_REACTIONS if is_reaction and not curves.reactions else ""
            )
        if not model.item(self.quantity.currentIndex()).isEnabled():
            self._quantity_is_chosen = False
        if not self._quantity_is_chosen:
            # Show a motion if there is one.
            moves = len(curves.points) == 0 or np.ptp(curves.motion[0], axis=1).any()
            forces = curves.reactions and not (curves.moves and moves)
            self.quantity.setCurrentIndex(first if forces else 0)
        over = [_abscissa(each) for each in curves.reactions]
        names = curves.reactions[0].names if curves.reactions else []
        for box, texts in ((self.body, ["all bodies", *names]), (self.abscissa, over)):
            chosen = box.currentText()
            box.clear()
            box.addItems(texts)
            box.setCurrentIndex(max(box.findText(chosen), 0))

    @property
    def _shown_reactions(self) -> ReactionCurves | None:
        """The reactions that are chosen; None if the motion of points is."""
        if self.quantity.currentIndex() < len(QUANTITIES):
            return None
        if self.curves is None or not self.curves.reactions:
            return None
        return self.curves.reactions[max(self.abscissa.currentIndex(), 0)]

    def _show_largest_component(self) -> None:
        """Show the component with the largest values, until one is chosen."""
        if self._component_is_chosen or self.curves is None:
            return
        table = self.curves.motion[0]
        if (reactions := self._shown_reactions) is not None:
            table, _ = reactions.tables[self._chosen_quantity]
        sizes = abs(table).max(axis=(0, 1), initial=0.0)
        self.component.setCurrentIndex(int(np.argmax(sizes)))

    @property
    def _chosen_quantity(self) -> str:
        return [*QUANTITIES, *REACTIONS][self.quantity.currentIndex()]

    def _choose_quantity(self) -> None:
        self._quantity_is_chosen = True
        self._show_largest_component()
        self._draw()

    def _update_hint(self) -> None:
        """Show a hint for use, or that the curves are older than the scene."""
        if self.curves is not None and self.isVisible():
            hint = f"{_HINT if self.points else _FIRST_HINT} {self.curves.note}"
            if (reactions := self._shown_reactions) is not None:
                means = " They are means over each time step." if reactions.is_over_time else ""
                hint = _REACTION_HINT + means
            self.hint.setText(hint if self.curves.key == self.make_request().key else _OLD_CURVES)

    def _draw(self) -> None:
        if self.canvas is None or self.curves is None:
            return
        from spacemap_vtk.app.plots.chart import COMPONENTS, CurveOptions

        reactions = self._shown_reactions
        for box in (self.body, self.abscissa):
            box.setVisible(reactions is not None)
        along = "about" if self._chosen_quantity == "moment" else "along"
        for number, axis in enumerate("xyz"):
            self.component.setItemText(number, f"{along} {axis}")
        component = COMPONENTS[self.component.currentIndex()]
        body = self.body.currentIndex() - 1
        options = CurveOptions(
            self._chosen_quantity,
            component,
            is_dark(self),
            reactions,
            body if reactions is not None and body >= 0 else None,
        )
        self._update_hint()
        self.canvas.draw_curves(self.curves, options)
        self.canvas.set_time(self._time)

    def _choose_component(self) -> None:
        self._component_is_chosen = True
        self._draw()

    def _clear_curves(self) -> None:
        self.points = []
        self._component_is_chosen = self._quantity_is_chosen = False
        self._key = ""
        self._engine.start_background(None)
        self._show_progress("")
        self.curves = None  # do not show curves of another scene
        self.hint.setText(_HINT)
        self.add_button.hide()
        self._enable_tools()
        if self.canvas is not None:
            self.canvas.hide()

    def _enable_tools(self) -> None:
        has_curves = self.curves is not None
        for widget in (self.quantity, self.component, self.save_button):
            widget.setEnabled(has_curves)
        self.save_actions["frequencies"].setEnabled(
            self.curves is not None and len(self.curves.frequencies) > 0
        )
        self.save_actions["times"].setEnabled(self.curves is not None and self.curves.moves)
        self.save_actions["reactions"].setEnabled(
            self.curves is not None and bool(self.curves.reactions)
        )
        for box in (self.body, self.abscissa):
            box.setVisible(self._shown_reactions is not None)

    def _ask_and_write(self, name: str, kinds: dict[str, str], write: Any) -> None:
        path = ask_output_file(self, "Save", name, name_filter("Files", kinds), next(iter(kinds)))
        if path is None:
            return
        try:
            check_output(path, kinds)
            write(path)
        except (SpacemapError, OSError) as error:
            self.write_failed.emit(error)
        else:
            self.written.emit()


def _abscissa(curves: ReactionCurves) -> str:
    """Return over what reactions are plotted, without its unit."""
    name = curves.heading.partition(" [")[0]
    return "over time" if curves.is_over_time else f"over the {name}"


def _time_columns(curves: Curves) -> dict[str, FloatArray]:
    """Return the columns of the table over time by heading, in SI units."""
    columns = {"time [s]": curves.times}
    for number in range(len(curves.points)):
        for (name, unit), motion in zip(_QUANTITIES, curves.motion, strict=True):
            columns |= _axis_columns(name, number, unit, motion[number])
    if curves.balance is not None:
        names = (f"{name} [J]" for name in ENERGY_NAMES)
        columns |= zip(names, curves.balance, strict=True)
    return columns


def _response_columns(curves: Curves) -> dict[str, FloatArray]:
    """Return the columns of the frequency response by heading, in SI units."""
    columns = {"frequency [Hz]": curves.frequencies}
    for number, answer in enumerate(curves.response):
        columns |= _axis_columns("amplitude", number, "m", answer)
    return columns


def _axis_columns(name: str, number: int, unit: str, values: FloatArray) -> dict[str, FloatArray]:
    headings = (f"{name} {axis} of point {number + 1} [{unit}]" for axis in "xyz")
    return dict(zip(headings, values.T, strict=True))


def _write_csv(columns: dict[str, FloatArray], path: Path) -> None:
    stream = io.StringIO(newline="")
    csv.writer(stream).writerows([columns, *np.column_stack([*columns.values()]).tolist()])
    with atomic_file(path) as file:
        write_parts(file, [stream.getvalue().encode()])
