"""The composite tab: constants of the textile in a matrix, and slices through its unit cell."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QMenu,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QSlider,
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
from spacemap_vtk.filters.unit_cell import UnitCell
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.ndarrays import Progress
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.unit_cell.materials import FIBRES, MATRICES

if TYPE_CHECKING:
    from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg

    from spacemap_vtk.draw.actors.unit_cell_actors import CellLook
    from spacemap_vtk.scenes.composite import Composite
    from spacemap_vtk.unit_cell.phases import UnitCellModel

_SECTION = "unit_cell"
_HINT = (
    "One repeat of the textile in a matrix, as voxels. Compute gives its elastic constants, with "
    "the error of the voxels. Layers, shear and own materials: section Unit cell of the form."
)
_OLD = "The scene has changed since these constants were computed."
_HEADINGS = ("Constant", "Value", "±", "Unit")
#: A view that is no slice.
_MODULI = "moduli"
#: Which voxels the view draws, by keys of `CellLook.voxels`.
_VOXELS = {
    "share": "Voxels: share of yarn",
    "yarn": "Voxels: one yarn",
    "value": "Voxels: value",
    "none": "No voxels",
}
#: Steps of the threshold.
_STEPS = 100


class _Result(NamedTuple):
    """Result of background work."""

    #: Values of the scene.
    key: Any
    outcome: tuple[Composite, UnitCellModel] | SpacemapError
    warnings: tuple[str, ...] = ()


def _compute(
    _drawn: Scene, key: Any, values: Mapping[str, Any], base: Path
) -> Generator[float | None, None, _Result]:
    """Compute constants and stresses with a scene of its own, so that the drawn one stays."""

    def compute(progress: Progress) -> _Result:
        from spacemap_vtk.scenes.composite import compute_constants, unit_cell_model

        try:
            scene = Scene(values, base)
            constants = compute_constants(scene, progress=lambda share: progress(0.5 * share))
            model = unit_cell_model(scene, True, lambda share: progress(0.5 + 0.5 * share))
            return _Result(key, (constants, model), tuple(scene.warnings))
        except Cancelled:
            raise
        except SpacemapError as error:
            return _Result(key, error)

    return in_slices(compute)


class CompositeTab(QWidget):
    """Materials, slices through the unit cell, and the constants."""

    #: Section of the scene with which the tab is shown.
    section = _SECTION
    #: Ending of a file to write, and the kind of its job.
    export_requested = Signal(str, str)
    #: Unit cell to show in the view, and its look; None to show the scene.
    cell_changed = Signal(object, object)

    def __init__(self, document: Document, engine: Engine) -> None:
        from spacemap_vtk.draw.unit_cell_values import CONTENTS, PLANES
        from spacemap_vtk.unit_cell.mixtures import COMPONENTS

        super().__init__()
        self._document, self._engine = document, engine
        self.fibre = self._choice("fibre", {key: one.title for key, one in FIBRES.items()})
        self.matrix = self._choice("matrix", {key: one.title for key, one in MATRICES.items()})
        self.packing = QDoubleSpinBox(minimum=0.05, maximum=0.9, singleStep=0.05, decimals=2)
        self.packing.setPrefix("Packing ")
        self.packing.setToolTip(UnitCell.parameter("packing").help)
        self.packing.editingFinished.connect(self._set_packing)
        self.run_button = QPushButton("Compute")
        self.run_button.clicked.connect(self._start_or_cancel)
        # By itself the box is too low for the descenders of its text.
        self.packing.setMinimumHeight(self.run_button.sizeHint().height())
        self.save_button = QPushButton("Save")
        menu = QMenu(self)
        saved = {".png": "Moduli", **writer_endings("unit_cell")}
        for ending, label in saved.items():
            kind = "unit_cell" if ending in writer_endings("unit_cell") else "constants"
            menu.addAction(f"{label}…", partial(self.export_requested.emit, ending, kind))
        self.save_button.setMenu(menu)
        self.save_button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.content = NarrowComboBox(8, toolTip="What is shown")
        for key, label in {**CONTENTS, _MODULI: "Modulus over the direction"}.items():
            self.content.addItem(label, key)
        self.load = NarrowComboBox(3, toolTip="Mean strain")
        self.load.addItems(COMPONENTS)
        self.plane = NarrowComboBox(4, toolTip="Plane of the slice")
        for key, label in PLANES.items():
            self.plane.addItem(label, key)
        self.slider = QSlider(Qt.Orientation.Horizontal, toolTip="Position of the slice")
        self.slider.valueChanged.connect(self._draw)
        self.plane.currentIndexChanged.connect(self._choose_plane)
        for box in (self.content, self.load):
            box.currentIndexChanged.connect(self._draw)
        self.in_view = QCheckBox("In the view", toolTip="Show the unit cell in place of the scene")
        self.has_slice = QCheckBox("Slice", checked=True)
        self.has_slice.setToolTip("Draw the slice, and no voxels in front of it")
        self.has_directions = QCheckBox("Directions")
        self.has_directions.setToolTip("Draw the directions of the fibres")
        self.voxels = NarrowComboBox(8, toolTip="Which voxels the view draws")
        for key, label in _VOXELS.items():
            self.voxels.addItem(label, key)
        self.threshold = QSlider(Qt.Orientation.Horizontal, maximum=_STEPS)
        self.threshold_text = QLabel()
        self.voxels.currentIndexChanged.connect(self._reset_threshold)
        self.threshold.valueChanged.connect(self._show_cell)
        for switch in (self.in_view, self.has_slice, self.has_directions):
            switch.toggled.connect(self._show_cell)
        self.progress_bar = QProgressBar()
        self.notes = note(_HINT)
        self.table = results_table(_HEADINGS)
        #: Created with the first result, because importing matplotlib takes time.
        self.canvas: FigureCanvasQTAgg | None = None
        self.result: tuple[Composite, UnitCellModel] | None = None
        self._requested: Any = None
        self._parts = QSplitter(childrenCollapsible=False)
        self._parts.setOrientation(Qt.Orientation.Vertical)
        self._parts.addWidget(self.table)
        column(
            self,
            row(None, (self.fibre, 1), (self.matrix, 1)),
            row(None, self.packing, (self.run_button, 1)),
            self.notes,
            self.progress_bar,
            row(None, (self.content, 1), self.load),
            row(None, (self.plane, 1), (self.slider, 1), self.save_button),
            row(None, self.in_view, self.has_slice, self.has_directions, None),
            row(None, (self.voxels, 1), (self.threshold, 1), self.threshold_text),
            (self._parts, 1),
            margins=(6, 6, 6, 6),
            spacing=6,
        )
        engine.background_ready.connect(self._receive)
        engine.background_progressed.connect(self._show_progress)
        document.changed.connect(self._follow_document)
        document.replaced.connect(self._clear)
        self._clear()

    def changeEvent(self, event: QEvent) -> None:
        """Draw again in the colours of another theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._draw()

    def _choice(self, name: str, titles: Mapping[str, str]) -> QComboBox:
        box = NarrowComboBox(8, toolTip=UnitCell.parameter(name).help)
        for key, title in titles.items():
            box.addItem(title, key)
        box.activated.connect(lambda _: self._document.set(_SECTION, name, box.currentData()))
        return box

    def _set_packing(self) -> None:
        if abs(self.packing.value() - self._value("packing")) > 1e-9:
            self._document.set(_SECTION, "packing", round(self.packing.value(), 4))

    def _value(self, name: str) -> Any:
        part = self._document.scene.parts[_SECTION]
        return getattr(part, name)

    def _follow_document(self) -> None:
        """Show the values of the scene, and mark constants of other values."""
        for box, name in ((self.fibre, "fibre"), (self.matrix, "matrix")):
            box.setCurrentIndex(box.findData(self._value(name)))
        self.packing.setValue(self._value("packing"))
        if self.result is not None:
            self.notes.setText(_OLD)

    def _start_or_cancel(self) -> None:
        if self._requested is not None:
            self._engine.start_background(None)
            self._finish("Cancelled.")
            return
        self._requested = self._document.values
        self.run_button.setText("Cancel")
        show_share(self.progress_bar, 0.0)
        self.progress_bar.show()
        work = partial(
            _compute, key=self._requested, values=self._requested, base=self._document.base
        )
        self._engine.start_background(work)

    def _show_progress(self, share: float) -> None:
        if self._requested is not None:
            show_share(self.progress_bar, share)

    def _finish(self, text: str) -> None:
        self._requested = None
        self.run_button.setText("Compute")
        self.progress_bar.hide()
        self.notes.setText(text)

    def _receive(self, result: Any) -> None:
        if not isinstance(result, _Result) or result.key is not self._requested:
            return  # the result belongs to another tab, or was cancelled
        if isinstance(result.outcome, SpacemapError):
            self._finish(self._document.describe_error(result.outcome))
            return
        from spacemap_vtk.scenes.composite import constant_rows

        self.result = result.outcome
        found = self.result[0]
        self._finish(
            f"{' × '.join(map(str, found.voxels))} voxels; yarns {found.yarn_share:.0%}, fibres "
            f"{found.fibre_share:.0%} of the volume."
            + "".join(f"\n⚠ {text}." for text in result.warnings)
        )
        lines = constant_rows(found)
        self.table.setRowCount(len(lines))
        for place, cells in enumerate(lines):
            for across, text in enumerate(cells):
                self.table.setItem(place, across, QTableWidgetItem(text))
        self._set_parts_enabled(True)
        self._choose_plane()
        self._reset_threshold()

    def _set_parts_enabled(self, enabled: bool) -> None:
        for widget in (self.content, self.load, self.plane, self.slider, self.in_view):
            widget.setEnabled(enabled)

    def _choose_plane(self, _index: int = 0) -> None:
        """Show the middle slice of another plane."""
        from spacemap_vtk.draw.figure.unit_cell_plot import slice_count

        if self.result is None:
            return
        count = slice_count(self.result[1], self.plane.currentData())
        self.slider.blockSignals(True)
        self.slider.setRange(0, count - 1)
        self.slider.setValue(count // 2)
        self.slider.blockSignals(False)
        self._draw()

    def stop(self) -> None:
        """Show the scene in the view again."""
        self.in_view.setChecked(False)

    @property
    def look(self) -> CellLook:
        """What the view shows of the unit cell."""
        from spacemap_vtk.draw.actors.unit_cell_actors import CellLook
        from spacemap_vtk.draw.unit_cell_values import value_span, yarn_numbers

        assert self.result is not None
        model = self.result[1]
        content = self.content.currentData()
        content = "yarns" if content == _MODULI else content
        load, share = self.load.currentText(), self.threshold.value() / _STEPS
        voxels, yarn = self.voxels.currentData(), 0
        if voxels == "value":
            low, high = value_span(model, content, load)
            share = low + share * (high - low)
        elif voxels == "yarn":
            numbers = yarn_numbers(model)
            yarn = numbers[min(self.threshold.value(), len(numbers) - 1)]
        return CellLook(
            content,
            load,
            voxels,
            share,
            yarn,
            self.has_slice.isChecked(),
            self.plane.currentData(),
            self.slider.value(),
            self.has_directions.isChecked(),
        )

    def _reset_threshold(self, _index: int = 0) -> None:
        """Fit the range of the threshold to what it selects."""
        from spacemap_vtk.draw.unit_cell_values import yarn_numbers

        chosen = self.voxels.currentData()
        count = _STEPS
        if chosen == "yarn" and self.result is not None:
            count = len(yarn_numbers(self.result[1])) - 1
        self.threshold.blockSignals(True)
        self.threshold.setRange(0, max(1, count))
        self.threshold.setValue(0 if chosen == "yarn" else count // 2)
        self.threshold.blockSignals(False)
        self._show_cell()

    def _show_cell(self, _value: int = 0) -> None:
        """Show the unit cell in the view, or the scene."""
        on = self.in_view.isChecked() and self.result is not None
        chosen = self.voxels.currentData()
        for widget in (self.has_slice, self.has_directions, self.voxels):
            widget.setEnabled(on)
        self.threshold.setEnabled(on and chosen != "none")
        self.threshold_text.setText("")
        if not on or self.result is None:
            self.cell_changed.emit(None, None)
            return
        from spacemap_vtk.draw.unit_cell_values import voxel_values

        look, model = self.look, self.result[1]
        if chosen == "share":
            self.threshold_text.setText(f"{look.threshold:.0%}")
        elif chosen == "yarn":
            self.threshold_text.setText(f"yarn {look.yarn}")
        elif chosen == "value":
            unit = voxel_values(model, look.content, look.load)[1]
            self.threshold_text.setText(f"{look.threshold:.3g} {unit}".rstrip())
        self.cell_changed.emit(model, look)

    def _draw(self, _value: int = 0) -> None:
        """Draw the slice, or the moduli, and the unit cell in the view."""
        if self.result is None:
            return
        self._show_cell()
        from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg

        from spacemap_vtk.draw.figure.measurement_plot import DARK, LIGHT
        from spacemap_vtk.draw.figure.page import new_figure
        from spacemap_vtk.draw.figure.polar_plot import draw_moduli
        from spacemap_vtk.draw.figure.unit_cell_plot import draw_slice
        from spacemap_vtk.draw.unit_cell_values import needs_load

        if self.canvas is None:
            self.canvas = FigureCanvasQTAgg(new_figure(dpi=100))
            self.canvas.setMinimumHeight(200)
            self._parts.insertWidget(0, self.canvas)
            self._parts.setSizes([420, 220])
        self.canvas.show()
        figure = self.canvas.figure
        figure.clear()
        ink = DARK if is_dark(self) else LIGHT
        figure.set_facecolor(ink.paper)
        content = self.content.currentData()
        is_slice = content != _MODULI
        self.load.setVisible(is_slice and needs_load(content))
        self.plane.setVisible(is_slice)
        self.slider.setVisible(is_slice)
        figure.subplots_adjust(left=0.2, right=0.94, bottom=0.14, top=0.95 if is_slice else 0.84)
        if is_slice:
            where = self.plane.currentData(), self.slider.value(), content, self.load.currentText()
            draw_slice(figure.subplots(), self.result[1], *where, ink=ink)
        else:
            draw_moduli(
                figure.subplots(subplot_kw={"projection": "polar"}), self.result[0], ink=ink
            )
        self.canvas.draw_idle()

    def _clear(self) -> None:
        """Forget the constants of another scene."""
        self.result = None
        self.stop()
        self._show_cell()
        self.table.setRowCount(0)
        self.load.hide()
        self._set_parts_enabled(False)
        if self.canvas is not None:
            self.canvas.hide()
        if self._requested is not None:
            self._engine.start_background(None)
        self._follow_document()
        self._finish(_HINT)
