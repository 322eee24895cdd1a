"""The figures tab: the figures of the drawn cloth, as printed by `spacemap info`."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QGuiApplication, QImage, QPixmap, QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QFrame,
    QHeaderView,
    QLabel,
    QPushButton,
    QScrollArea,
    QSplitter,
    QTableWidgetItem,
    QWidget,
)

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.widgets import RIGHT, column, is_dark, note, single_shot, table
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.draw.figure.page import PageStyle, lay_out_page
from spacemap_vtk.draw.figure.section_drawing import Colors, section_tile
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.figure_list import (
    Figure,
    cloth_figures,
    heading_with_unit,
    textile_figures,
    yarn_figures,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.cross_section import CrossSection, cut_cloth
from spacemap_vtk.units import UNITS

#: Time without changes until the figures are computed, in ms.
_REST_TIME = 250
#: Resolution of the drawing, in dots per inch.
_DPI = 100.0
#: Smallest width of the drawing, which its labels need, in pixels.
_MIN_WIDTH = 240
#: A value that a column must have room for, and the margins of its cell, in pixels.
_WIDEST_VALUE = "0.88888 mm"
_CELL_MARGIN = 10
#: Figures of the model, not of the cloth.
_LEFT_OUT = ("radial_error", "patches", "control_points", "memory_bytes")
_HINTS = (
    "Figures of the yarns and of the cloth by Peirce's geometry. Hover over a name for its "
    "definition.",
    "This scene is not woven. These are the figures of its textile.",
    "This scene has no yarns.",
)
_TIPS = {
    "diameter": "Height of the yarn's section; of a round yarn, its diameter",
    "width": "Width of the yarn's section in the plane of the cloth",
    "tex": "Mass of 1000 m of yarn in g",
    "sett": "Ends or picks per length of the cloth",
    "spacing": "Distance between the axes of neighbouring yarns: 1 / sett",
    "theta_deg": "Steepest slope of the yarn's axis where the yarn changes side",
    "length": "Length of the yarn's axis between two crossings where the yarn changes side",
    "crimp": "c = l / p - 1 where the yarn changes side",
    "mean_crimp": "Length of the yarns over length of the cloth, minus 1; floats included",
    "height": "Rise or fall of the yarn's axis where the yarn changes side",
    "cover": "Fraction of the plane covered by yarns: K = width / p; together K1 + K2 - K1 K2",
    "mean_float": "Mean number of crossings that a yarn passes before it changes side",
    "longest_float": "Largest number of consecutive crossings on the same side",
    "yarn_length": "Total length of all yarns as built, including the ends beyond the edges",
    "thickness": "From the lowest to the highest point of the yarns",
    "fibre_volume_fraction": "Volume of fibres over the volume between the two faces of the cloth",
    "areal_mass": "Mass per area of the cloth as built, crimp included",
    "repeat": "Ends by picks",
    "feasible_height": "Crimp heights of the warp that leave the yarns enough room",
    "least_clearance": "Smallest distance between two yarns; 0: they touch, negative: they overlap",
}


class _Result(NamedTuple):
    key: Any
    figures: dict[str, Any]
    whole: bool
    cuts: Sequence[CrossSection] = ()
    colors: Colors = ()


def _compute_figures(
    scene: Scene, key: Any, figures: dict[str, Any] | None = None
) -> Generator[None, None, _Result]:
    """Compute all figures but the least clearance; with `figures`, the least clearance."""
    yield
    if figures is None:
        assert scene.woven is not None
        figures, cloth = report.report_cloth(scene), scene.woven.cloth
        yield
        families = range(2 if figures["thickness"] is not None else 0)
        cuts, colors = (
            [cut_cloth(cloth, n) for n in families],
            [t.colors for t in cloth.threads],
        )
        return _Result(key, figures, False, cuts, colors)
    yield from report.add_clearance(scene, figures)
    return _Result(key, figures, True)


class _SectionDrawings(QScrollArea):
    """Drawings of the cloth cut along an end and along a pick (Peirce), as wide as possible."""

    def __init__(self) -> None:
        super().__init__(widgetResizable=True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        self.picture = QLabel(alignment=Qt.AlignmentFlag.AlignTop)
        self.setWidget(self.picture)
        self._cuts: Sequence[CrossSection] = ()
        self._colors: Colors = ()
        self._draw_timer = single_shot(self, self._draw, 60)

    def show_cuts(self, cuts: Sequence[CrossSection] = (), colors: Colors = ()) -> None:
        self._cuts, self._colors = cuts, colors
        self.setVisible(bool(cuts))
        self._draw_timer.start()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if event.size().width() != event.oldSize().width():
            self._draw_timer.start()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._draw_timer.start()

    def _draw(self) -> None:
        if not self._cuts or not self.isVisible():
            return
        ratio = self.devicePixelRatioF()
        style = PageStyle(
            width=max(self.viewport().width(), _MIN_WIDTH) * 25.4 / _DPI,
            dpi=_DPI * ratio,
            dark=is_dark(self),
            transparent=True,
        )
        tiles = [replace(section_tile(c, self._colors), has_letter=False) for c in self._cuts]
        canvas: Any = lay_out_page([[tile] for tile in tiles], style).canvas
        canvas.draw()
        width, height = canvas.get_width_height()
        image = QImage(bytes(canvas.buffer_rgba()), width, height, QImage.Format.Format_RGBA8888)
        pixmap = QPixmap.fromImage(image)
        pixmap.setDevicePixelRatio(ratio)
        self.picture.setPixmap(pixmap)


class FiguresTab(QWidget):
    """Table of figures: warp and weft side by side, then the cloth; least clearance comes last."""

    def __init__(self, document: Document, engine: Engine) -> None:
        super().__init__()
        self._document, self._engine = document, engine
        self.hint = note()
        self.table = table("figures", ["", "Warp", "Weft"])
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Fixed)
        tip = "Copy the table for a spreadsheet"
        self.copy_button = QPushButton("Copy table", toolTip=tip)
        self.copy_button.clicked.connect(self._copy)
        self.sections = _SectionDrawings()
        parts = QSplitter(Qt.Orientation.Vertical, childrenCollapsible=False)
        parts.addWidget(self.table)
        parts.addWidget(self.sections)
        parts.setSizes([420, 350])
        column(self, self.hint, (parts, 1), self.copy_button, margins=(6, 6, 6, 6))
        self._rows: list[tuple[Figure, ...]] = []
        #: Key of the cloth whose figures were requested, and whether all of them are complete.
        self._requested: Any = None
        self._is_complete = False
        #: Values of the drawn scene.
        self._drawn: Any = None
        self._rest_timer = single_shot(self, self._request, _REST_TIME)
        engine.background_ready.connect(self._receive)
        self.clear()

    def showEvent(self, event: QShowEvent) -> None:
        """Request missing figures, as another tab may have replaced the work."""
        super().showEvent(event)
        self._requested = self._requested if self._is_complete else None
        self._rest_timer.start()

    def clear(self) -> None:
        """Clear the tab for a new scene."""
        self._requested, self._is_complete, self._drawn = None, False, None
        self._show_rows([])
        self.sections.show_cuts()

    def follow(self, frame: Frame) -> None:
        """Request the figures if another cloth is drawn."""
        if frame.mode is None:
            # Frames are coarse while playing and during a drag, but only a drag changes the cloth.
            at_rest = not frame.coarse or frame.values is self._drawn
            self._drawn = frame.values
            at_rest = at_rest and self.isVisible() and not self._rest_timer.isActive()
            if at_rest and self._cloth_key() != self._requested:
                self._rest_timer.start()

    def _cloth_key(self) -> Any:
        scene = self._document.scene
        return scene.woven is not None, scene.source.settings

    def _request(self) -> None:
        key = self._cloth_key()
        if not self.isVisible() or key == self._requested or self._drawn != self._document.values:
            return  # if the cloth cannot be woven, view and tab keep showing the last good one
        self._requested, self._is_complete = key, not key[0]
        textile = self._document.scene.textile
        if key[0]:
            self.hint.setText(_HINTS[0])
            self.table.setHorizontalHeaderLabels(["", "Warp", "Weft"])
            self._engine.start_background(partial(_compute_figures, key=key))
        else:
            self.hint.setText(_HINTS[1 if textile is not None else 2])
            self.table.setHorizontalHeaderLabels(["", "", ""])
            self._show_rows([(f,) for f in textile_figures(textile)] if textile is not None else [])

    def _receive(self, result: Any) -> None:
        if isinstance(result, Exception) and self.isVisible() and not self._is_complete:
            self.hint.setText(str(result))
        if not isinstance(result, _Result) or result.key != self._requested:
            return  # the result belongs to another tab, or to a former cloth
        self._is_complete = result.whole
        cloth = [f for f in cloth_figures(result.figures) if f.key not in _LEFT_OUT]
        if not result.whole:
            self.sections.show_cuts(result.cuts, result.colors)
            cloth = [f._replace(text="…") if f.key == "least_clearance" else f for f in cloth]
        self._show_rows([*yarn_figures(result.figures), *((f,) for f in cloth)])
        if not result.whole and self.isVisible():  # hidden, it would replace another tab's work
            self._engine.start_background(
                partial(_compute_figures, key=result.key, figures=result.figures)
            )

    def _show_rows(self, rows: list[tuple[Figure, ...]]) -> None:
        self._rows = rows
        self.copy_button.setEnabled(bool(rows))
        self.table.clearSpans()
        self.table.setRowCount(len(rows))
        for number, figures in enumerate(rows):
            if len(figures) == 1:
                self.table.setSpan(number, 1, 1, 2)
            tip = _tooltip(figures[0])
            for place, text in enumerate([figures[0].label, *(f.text for f in figures)]):
                item = QTableWidgetItem(text)
                item.setToolTip(tip if len(text) < 30 else f"{text}\n{tip}")
                if place:
                    item.setTextAlignment(RIGHT)
                self.table.setItem(number, place, item)
        self._fit_columns()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Wrap the names of figures where a narrow tab has no room for both columns of values."""
        super().resizeEvent(event)
        self._fit_columns()

    def _fit_columns(self) -> None:
        self.table.resizeColumnToContents(0)
        value = self.fontMetrics().horizontalAdvance(_WIDEST_VALUE) + _CELL_MARGIN
        room = max(self.table.viewport().width() - 2 * value, value)
        self.table.setColumnWidth(0, min(self.table.columnWidth(0), room))
        self.table.resizeRowsToContents()

    def _copy(self) -> None:
        lines = ["\tWarp\tWeft"]
        for figures in self._rows:
            cells = [f.entry if f.unit else f.text for f in figures]
            lines.append("\t".join([heading_with_unit(figures[0].label, figures[0].unit), *cells]))
        QGuiApplication.clipboard().setText("\n".join(lines) + "\n")


def _tooltip(figure: Figure) -> str:
    tip = _TIPS.get(figure.key.removeprefix("warp_"), "")
    if figure.key == "areal_mass" and figure.value is not None:
        tip = f"{figure.value / UNITS['kg/m2']['oz/yd2']:.3g} oz/yd². {tip}"
    return tip
