"""The measure tab: tests of a textile laboratory, their curves and their figures."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from PySide6.QtCore import QEvent, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import (
    QMenu,
    QProgressBar,
    QPushButton,
    QSplitter,
    QTableWidgetItem,
    QWidget,
)

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.widgets import (
    NarrowComboBox,
    column,
    is_dark,
    note,
    results_table,
    row,
    show_share,
)
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.app.work.slices import in_slices
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.laboratory.catalogue import TESTS, find_test
from spacemap_vtk.ndarrays import Progress
from spacemap_vtk.scenes.laboratory import GIVE_STIFFNESS, TestResult, measure_scene
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg

_HINT = "Choose a test and click Measure. {}"
_NO_STIFFNESS = (
    "The test needs the stiffness of the yarns, which this scene does not give. Spun cotton is a "
    "first choice; its values are then in Crimp interchange."
)
_OLD = "The scene has changed since this measurement."
_HEADINGS = ("", "Figure", "", "Value", "SI")
#: Kinds of files that the tab writes, with their endings.
SAVED = {"Plot…": ".png", "Curve…": ".csv", "Film…": ".gif"}


class _Result(NamedTuple):
    """Result of background work."""

    #: Test and values of the scene.
    key: Any
    outcome: TestResult | SpacemapError


def _measure(
    _drawn: Scene, key: Any, values: Mapping[str, Any], base: Path, name: str
) -> Generator[float | None, None, _Result]:
    """Run a test with a scene of its own, so that the drawn one stays as it is."""

    def measure(progress: Progress) -> _Result:
        try:
            return _Result(key, measure_scene(Scene(values, base), name, progress)[0])
        except Cancelled:
            raise
        except SpacemapError as error:
            return _Result(key, error)

    return in_slices(measure)


class MeasureTab(QWidget):
    """A choice of tests, the curve of the last one, and its figures."""

    #: Ending of a file to write, and the name of the test.
    export_requested = Signal(str, str)

    #: The yarns shall get the stiffness of cotton.
    cotton_requested = Signal()

    def __init__(self, document: Document, engine: Engine) -> None:
        super().__init__()
        self._document, self._engine = document, engine
        self.tests = NarrowComboBox(8, toolTip="Standard test")
        for test in TESTS:
            self.tests.addItem(test.title, test.name)
        self.tests.currentIndexChanged.connect(self._describe_test)
        self.run_button = QPushButton("Measure")
        self.run_button.clicked.connect(self._start_or_cancel)
        self.save_button = QPushButton("Save")
        menu = QMenu(self)
        self.save_actions = {
            ending: menu.addAction(text, partial(self._save, ending))
            for text, ending in SAVED.items()
        }
        self.save_button.setMenu(menu)
        self.progress_bar = QProgressBar()
        self.hint, self.notes = note(), note()
        #: Gives the yarns a stiffness; shown if a measurement lacks it.
        self.cotton_button = QPushButton("Use yarns of spun cotton")
        self.cotton_button.clicked.connect(self.cotton_requested)
        self.table = results_table(_HEADINGS)
        #: Created with the first measurement, because importing matplotlib takes time.
        self.canvas: FigureCanvasQTAgg | None = None
        self.result: TestResult | None = None
        self._requested: Any = None
        self._parts = QSplitter(childrenCollapsible=False)
        self._parts.setOrientation(self._parts.orientation().Vertical)
        self._parts.addWidget(self.table)
        buttons = row(None, (self.run_button, 1), (self.save_button, 1), spacing=6)
        column(
            self,
            self.tests,
            buttons,
            self.hint,
            self.progress_bar,
            self.notes,
            self.cotton_button,
            (self._parts, 1),
            margins=(6, 6, 6, 6),
            spacing=6,
        )
        engine.background_ready.connect(self._receive)
        engine.background_progressed.connect(self._show_progress)
        document.changed.connect(self._mark_old)
        document.replaced.connect(self._clear)
        self._clear()

    def showEvent(self, event: QShowEvent) -> None:
        """Describe the chosen test."""
        super().showEvent(event)
        self._describe_test()

    def changeEvent(self, event: QEvent) -> None:
        """Draw the curve again in the colours of another theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._draw()

    def _describe_test(self, _index: int = 0) -> None:
        test = find_test(self.tests.currentData())
        self.hint.setText(f"{test.instrument}: {test.specimen}")

    def _start_or_cancel(self) -> None:
        if self._requested is not None:
            self._engine.start_background(None)
            self._finish("Cancelled.")
            return
        name = self.tests.currentData()
        values = self._document.values
        self._requested = name, values
        self.run_button.setText("Cancel")
        show_share(self.progress_bar, 0.0)
        self.progress_bar.show()
        work = partial(
            _measure, key=self._requested, values=values, base=self._document.base, name=name
        )
        self._engine.start_background(work)

    def _show_progress(self, share: float) -> None:
        if self._requested is not None:
            show_share(self.progress_bar, share)

    def _finish(self, text: str) -> None:
        self._requested = None
        self.run_button.setText("Measure")
        self.progress_bar.hide()
        self.cotton_button.hide()
        self.notes.setText(text)

    def _receive(self, result: Any) -> None:
        if isinstance(result, Exception) and self._requested is not None:
            self._finish(f"The measurement failed: {result}")
        if not isinstance(result, _Result) or result.key is not self._requested:
            return  # the result belongs to another tab, or was cancelled
        if isinstance(result.outcome, SpacemapError):
            if result.outcome.cure == GIVE_STIFFNESS and self._document.scene.woven is not None:
                self._finish(_NO_STIFFNESS)
                self.cotton_button.show()
                return
            self._finish(self._document.describe_error(result.outcome))
            return
        self.result = result.outcome
        measurement = self.result.measurement
        assert measurement is not None
        self._finish("\n".join(f"{text[0].upper()}{text[1:]}." for text in measurement.notes))
        self.table.setRowCount(len(measurement.readings))
        for line, reading in enumerate(measurement.readings):
            cells = reading.symbol, reading.name, reading.direction, reading.text, reading.si_text
            for place, text in enumerate(cells):
                item = QTableWidgetItem(text)
                item.setToolTip(reading.note)
                self.table.setItem(line, place, item)
        self.save_button.setEnabled(True)
        self.save_actions[".gif"].setEnabled(measurement.has_film)
        self._draw()

    def _draw(self) -> None:
        """Draw the curves of the last measurement."""
        if self.result is None or self.result.measurement is None:
            return
        from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg

        from spacemap_vtk.draw.figure.measurement_plot import DARK, LIGHT, draw_curves
        from spacemap_vtk.draw.figure.page import new_figure

        if self.canvas is None:
            self.canvas = FigureCanvasQTAgg(new_figure(dpi=100, layout="constrained"))
            self.canvas.setMinimumHeight(200)
            self._parts.insertWidget(0, self.canvas)
            self._parts.setSizes([400, 240])
        figure = self.canvas.figure
        figure.clear()
        ink = DARK if is_dark(self) else LIGHT
        figure.set_facecolor(ink.paper)
        self.canvas.setVisible(bool(self.result.measurement.curves))
        panel = figure.subplots()
        draw_curves(panel, self.result.measurement, with_si=False, ink=ink, with_figures=False)
        panel.tick_params(labelsize=8)
        for label in (panel.xaxis.label, panel.yaxis.label):
            label.set_fontsize(8.5)
        self.canvas.draw_idle()

    def _mark_old(self) -> None:
        if self.result is not None:
            self.notes.setText(_OLD)

    def _clear(self) -> None:
        """Forget the measurement of another scene."""
        self.result = None
        self.table.setRowCount(0)
        self.save_button.setEnabled(False)
        if self.canvas is not None:
            self.canvas.hide()
        if self._requested is not None:
            self._engine.start_background(None)
        self._finish("")

    def _save(self, ending: str) -> None:
        if self.result is not None:
            self.export_requested.emit(ending, self.result.test.name)
