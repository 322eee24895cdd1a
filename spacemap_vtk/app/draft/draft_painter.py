"""Paint a draft: one image per grid, with a pixel or a small square for each cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QImage, QPainter, QPen

from spacemap_vtk.app.draft.draft_layout import GAP, DraftLayout, GridCell, PanelSpan
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.scenes.draft_edits import Selection
from spacemap_vtk.scenes.editable_draft import EditableDraft

#: Smallest size of a cell to draw lines between cells, in pixels.
_MIN_CELL_FOR_LINES = 5
#: Smallest size of a cell to draw round yarns, in pixels.
_MIN_CELL_FOR_YARNS = 6
#: Number of cells between heavier lines.
GROUP = 4

#: Share of a float's colour where it is marked.
_FLOAT_SHARE = 0.75

#: Colours of `DraftColors` in the light and in the dark theme.
_THEME_COLORS = (
    (
        *("#ffffff", "#f4f6f8", "#26323e", "#2d6a8e", "#e3e8ee", "#b4bec9", "#66717e", "#d9642c"),
        *("#1f77d0", "#e0592a", "#a0329b"),
    ),
    (
        *("#161b22", "#1d232b", "#dfe6ee", "#79bde6", "#2b3440", "#4a5766", "#93a0ae", "#ffb454"),
        *("#6db8ff", "#ff8a5c", "#dd7bd8"),
    ),
)


class DraftColors(NamedTuple):
    """Colours of a draft."""

    paper: QColor
    back: QColor
    mark: QColor
    tie: QColor
    line: QColor
    group: QColor
    text: QColor
    highlight: QColor
    selection: QColor
    #: Marked floats of the warp and of the weft.
    warp_float: QColor
    weft_float: QColor

    @classmethod
    def for_theme(cls, dark: bool) -> DraftColors:
        """Return the colours of the light or the dark theme."""
        return cls(*(QColor(word) for word in _THEME_COLORS[dark]))


class DraftPainter:
    """Paint one draft in one layout."""

    def __init__(
        self,
        shown: EditableDraft,
        layout: DraftLayout,
        inks: DraftColors,
        colored: bool,
        from_reverse: bool = False,
        floats: Bools | None = None,
    ) -> None:
        self._shown, self._layout, self._colors = shown, layout, inks
        self._colored, self._from_reverse = colored, from_reverse
        #: (picks, ends), crossings of floats to mark.
        self._floats = floats

    def paint(self, painter: QPainter, ratio: float) -> None:
        """Paint all grids, strips and numbers, without the highlight under the mouse."""
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, False)
        self._paint_drawdown(painter, ratio)
        for name in ("threading", "treadling", "tieup"):
            if name in self._layout.panels:
                self._paint_marks(painter, name)
        self._paint_strip(painter, "warp", self._shown.warp)
        self._paint_strip(painter, "weft", self._shown.weft)
        self._draw_numbers(painter)

    def highlight(self, painter: QPainter, place: GridCell) -> None:
        """Highlight a cell with its end, pick, shaft and treadle."""
        across, down = self._layout.panels[place.panel]
        color = QColor(self._colors.highlight)
        color.setAlpha(46)
        for x, y in self._layout.panels.values():
            if x is across and place.x:
                painter.fillRect(_clip_to_panel(_cell_rect(x, y, place.x, None), x, y), color)
            if y is down and place.y:
                painter.fillRect(_clip_to_panel(_cell_rect(x, y, None, place.y), x, y), color)
        color.setAlpha(255)
        painter.setPen(QPen(color, 1.5))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(QRectF(_cell_rect(across, down, place.x or None, place.y or None)))

    def outline(self, painter: QPainter, selection: Selection) -> None:
        """Outline the selected cells."""
        x, y = self._layout.panels[selection.panel]
        corners = [
            _cell_rect(x, y, *corner) for corner in zip(selection.x, selection.y, strict=True)
        ]
        rect = _clip_to_panel(corners[0].united(corners[1]), x, y)
        color = QColor(self._colors.selection)
        color.setAlpha(50)
        painter.fillRect(rect, color)
        color.setAlpha(255)
        painter.setPen(QPen(color, 2))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(rect)

    def _paint_drawdown(self, painter: QPainter, ratio: float) -> None:
        """Paint the drawdown, in large cells as round yarns."""
        x, y = self._layout.panels["drawdown"]
        columns, rows = _visible_indices(x), _visible_indices(y)
        visible = np.ix_(rows, columns)
        over = self._shown.drawdown[visible] != self._from_reverse
        if self._colored:
            warp, weft = self._shown.warp[columns], self._shown.weft[rows]
            cells = np.where(over[..., None], warp[None], weft[:, None])
        else:
            ink, paper = (_rgb(c) for c in (self._colors.mark, self._colors.paper))
            cells = np.where(over[..., None], ink, paper).astype(np.uint8)
        if self._floats is not None:
            inks = self._colors.warp_float, self._colors.weft_float
            marked = np.where(over[..., None], _rgb(inks[0]), _rgb(inks[1]))
            mixed = _FLOAT_SHARE * marked + (1.0 - _FLOAT_SHARE) * cells
            cells = np.where(self._floats[visible][..., None], mixed, cells).astype(np.uint8)
        size = round(self._layout.cell * ratio)
        if self._colored and self._layout.cell >= _MIN_CELL_FOR_YARNS:
            cells = _shade_yarns(cells, over, size)
        self._draw_image(painter, "drawdown", cells)
        self._draw_lines(painter, "drawdown", faint=self._colored)

    def _paint_marks(self, painter: QPainter, panel: str) -> None:
        x, y = self._layout.panels[panel]
        if not x.cells or not y.cells:
            return
        marks = self._shown.marks(panel)[np.ix_(_visible_indices(y), _visible_indices(x))]
        ink = self._colors.tie if panel == "tieup" else self._colors.mark
        cells = np.where(marks[..., None], _rgb(ink), _rgb(self._colors.paper))
        self._draw_image(painter, panel, cells.astype(np.uint8))
        self._draw_lines(painter, panel)

    def _paint_strip(self, painter: QPainter, panel: str, colors: NDArray[np.uint8]) -> None:
        x, y = self._layout.panels[panel]
        cells = (
            colors[_visible_indices(x)][None] if x.cells else colors[_visible_indices(y)][:, None]
        )
        self._draw_image(painter, panel, cells)
        self._draw_lines(painter, panel, faint=True)

    def _draw_image(self, painter: QPainter, panel: str, cells: NDArray[np.uint8]) -> None:
        """Draw an image over the visible cells of a panel."""
        x, y = self._layout.panels[panel]
        target = QRect(
            x.begin + x.visible_cells.start * x.size,
            y.begin + y.visible_cells.start * y.size,
            len(x.visible_cells) * x.size,
            len(y.visible_cells) * y.size,
        )
        if target.isEmpty():
            return
        cells = np.ascontiguousarray(cells)
        height, width = cells.shape[:2]
        image = QImage(cells.data, width, height, 3 * width, QImage.Format.Format_RGB888)
        painter.save()
        painter.setClipRect(_panel_rect(x, y))
        painter.drawImage(target, image)
        painter.restore()

    def _draw_lines(self, painter: QPainter, panel: str, faint: bool = False) -> None:
        x, y = self._layout.panels[panel]
        area = _panel_rect(x, y)
        painter.save()
        painter.setClipRect(area.adjusted(0, 0, 1, 1))
        for span, upright in ((x, True), (y, False)):
            for index in range(span.visible_cells.start, span.visible_cells.stop + 1):
                # Heavier lines are counted from cell 1, which can be at either end.
                number = span.cells - index if span.reversed else index
                heavy = bool(span.cells) and number % GROUP == 0
                edge = index in (0, max(span.cells, 1))
                if not edge and ((faint and not heavy) or span.size < _MIN_CELL_FOR_LINES):
                    continue
                color = QColor(self._colors.group if heavy or edge else self._colors.line)
                if faint and not edge:
                    color.setAlpha(70)
                painter.setPen(QPen(color, 1))
                at = span.begin + index * span.size
                if upright:
                    painter.drawLine(at, area.top(), at, area.bottom() + 1)
                else:
                    painter.drawLine(area.left(), at, area.right() + 1, at)
        painter.restore()

    def _draw_numbers(self, painter: QPainter) -> None:
        """Write the numbers of ends, picks, shafts and treadles between the grids."""
        font = QFont(painter.font())
        font.setPixelSize(10)
        painter.setFont(font)
        painter.setPen(self._colors.text)
        panels = self._layout.panels
        (ends, picks), shafts = panels["drawdown"], panels["threading"][1]
        treadles = panels["treadling"][0]
        above, left = picks.low - GAP, ends.high
        if not self._layout.y.is_frozen:
            above = picks.begin - GAP
        if not self._layout.x.is_frozen:
            left = ends.begin + ends.cells * ends.size
        middle = Qt.AlignmentFlag.AlignCenter
        for span in (ends, treadles):
            for number, at in _choose_numbers(span, 24):
                painter.drawText(QRect(at - 20, above, 40 + span.size, GAP), middle, str(number))
        for span in (shafts, picks):
            for number, at in _choose_numbers(span, 14):
                painter.drawText(QRect(left, at - 10, GAP, 20 + span.size), middle, str(number))


def _choose_numbers(span: PanelSpan, distance: int) -> list[tuple[int, int]]:
    """Choose numbers at least `room` pixels apart; return them with the pixels of their cells."""
    step = 1
    while step * span.size < distance:
        step *= 2 if step > 1 else GROUP
    numbers = (1, *range(step, span.cells + 1, step)) if step > 1 else range(1, span.cells + 1)
    numbered = [(n, span.pixel_of(n)) for n in numbers if span.cells]
    # Drop the first number if it is too close to the second.
    if len(numbered) > 1 and abs(numbered[1][1] - numbered[0][1]) < distance:
        numbered = numbered[1:]
    return [(n, at) for n, at in numbered if span.low <= at + span.size / 2 <= span.high]


def _visible_indices(span: PanelSpan) -> NDArray[np.intp]:
    """Return the indices of the visible cells in the order of the screen."""
    visible = np.arange(span.visible_cells.start, span.visible_cells.stop)
    return span.cells - 1 - visible if span.reversed else visible


def _cell_rect(x: PanelSpan, y: PanelSpan, column: int | None, row: int | None) -> QRect:
    """Return the rectangle of a cell; None means all cells in that direction."""
    left, width = (x.begin, max(x.cells, 1) * x.size) if column is None else (x.pixel_of(column), 0)
    top, height = (y.begin, max(y.cells, 1) * y.size) if row is None else (y.pixel_of(row), 0)
    return QRect(left, top, width or x.size, height or y.size)


def _panel_rect(x: PanelSpan, y: PanelSpan) -> QRect:
    """Return the visible rectangle of a panel."""
    left, right = max(x.low, x.begin), min(x.high, x.begin + max(x.cells, 1) * x.size)
    top, bottom = max(y.low, y.begin), min(y.high, y.begin + max(y.cells, 1) * y.size)
    return QRect(left, top, max(0, right - left), max(0, bottom - top))


def _clip_to_panel(rect: QRect, x: PanelSpan, y: PanelSpan) -> QRect:
    return rect.intersected(_panel_rect(x, y))


def _rgb(color: QColor) -> NDArray[np.uint8]:
    return np.array([color.red(), color.green(), color.blue()], dtype=np.uint8)


def _shade_yarns(cells: NDArray[np.uint8], over: NDArray[np.bool_], size: int) -> NDArray[np.uint8]:
    """Return cells of `size` pixels that show the upper yarn, darker at its edges."""
    across = np.abs(2 * (np.arange(size) + 0.5) / size - 1)
    shade = (1.0 - 0.42 * across**4).astype(np.float32)
    upright = np.broadcast_to(shade[None, :], (size, size))
    shades = np.stack([upright.T, upright])[over.astype(np.intp)]
    pixels = cells[:, :, None, None, :] * shades[..., None]
    rows, columns = over.shape
    return pixels.transpose(0, 2, 1, 3, 4).reshape(rows * size, columns * size, 3).astype(np.uint8)
