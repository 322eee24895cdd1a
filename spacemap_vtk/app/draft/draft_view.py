"""Widget with the grids of a draft: painting, scrolling, zooming and editing."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QPointF, QSize, Qt, Signal
from PySide6.QtGui import (
    QAction,
    QColor,
    QContextMenuEvent,
    QHideEvent,
    QImage,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QShowEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QAbstractScrollArea, QFrame, QScrollBar

from spacemap_vtk.app.draft.draft_layout import GAP, STRIP, DraftLayout, GridCell, fit_cell_size
from spacemap_vtk.app.draft.draft_painter import DraftColors, DraftPainter
from spacemap_vtk.app.draft.strokes import Move, Stroke
from spacemap_vtk.app.widgets import is_dark
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.scenes.draft_edits import STRIPS, Selection, is_inside, select_all
from spacemap_vtk.scenes.editable_draft import EditableDraft
from spacemap_vtk.textile.drafts.floats import FloatLimits, mark_floats

#: Steps of the arrow keys, across and down.
_ARROW_STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, -1),
    Qt.Key.Key_Down: (0, 1),
}
#: Possible sizes of a cell in pixels.
SIZES = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 18, 20, 24, 28, 32, 40)


class DraftGrid(QAbstractScrollArea):
    """Show a draft and report strokes of the mouse; the owner decides what they change."""

    #: The edited draft, the name of the edit, and whether the stroke continues.
    edited = Signal(object, str, bool)
    #: Description of the cell under the mouse.
    hovered = Signal(str)
    #: Reason why a click has no effect.
    refused = Signal(str)
    #: A colour picked from a strip.
    color_picked = Signal(object)
    #: The selection has changed.
    selected = Signal()
    #: Another draft or none is shown, or the grid is shown or hidden.
    shown_changed = Signal()
    #: A key of an action is pressed: the actions must know what they can be applied to.
    about_to_act = Signal()
    #: A menu is requested at a point of the screen.
    menu_requested = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.shown: EditableDraft | None = None
        self.cell = 10
        self.as_cloth = True
        self.colored = True
        self.from_reverse = False
        #: Whether a drag selects cells instead of marking them.
        self.selects = False
        #: Most crossings of floats that are not marked; None: no floats are marked.
        self.float_limits: FloatLimits | None = None
        self.selection: Selection | None = None
        #: Actions whose keys the grid handles while it has the focus.
        self.keys: list[QAction] = []
        self._floats: Bools | None = None
        #: Cell where a selection begins, and whether a drag extends it.
        self._anchor: GridCell | None = None
        self._is_selecting = False
        #: Colour for painting the strips.
        self.color = QColor("#2d6a8e")
        self._fits_view = True
        #: Cell that was used last, for menus: the mouse leaves the grid on its way to them.
        self._last_place: GridCell | None = None
        self._stroke: Stroke | Move | None = None
        self._last_cell: GridCell | None = None
        self._highlighted: GridCell | None = None
        self._picture: QImage | None = None
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.viewport().setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        for bar in self._scroll_bars:
            bar.valueChanged.connect(self.repaint_all)

    @property
    def is_stroking(self) -> bool:
        """Whether a stroke is in progress."""
        return self._stroke is not None

    def current_layout(self) -> DraftLayout | None:
        """Compute the present layout; None without a draft."""
        if self.shown is None:
            return None
        across, down = (bar.value() for bar in self._scroll_bars)
        return DraftLayout(
            self.shown,
            self.cell,
            self._viewport_size(),
            (across, down),
            self.as_cloth,
            self.from_reverse,
        )

    def show_draft(self, shown: EditableDraft | None) -> None:
        """Show a draft."""
        before = self.shown
        self.shown = shown
        if shown is None:
            self._stroke = self._highlighted = None
        if before is None or shown is None or _grid_sizes(before) != _grid_sizes(shown):
            self._highlighted = None
            if self._fits_view:
                self.fit()
        if self.selection is not None and (shown is None or not is_inside(shown, self.selection)):
            self.select(None)
        self._floats = None
        self._update_scroll_range()
        self.repaint_all()
        self.shown_changed.emit()

    def select(self, selection: Selection | None) -> None:
        """Select cells; None: none."""
        if selection != self.selection:
            self.selection = selection
            self.selected.emit()
            self.viewport().update()

    @property
    def place(self) -> Selection:
        """The selection; if there is none, the cell under the mouse or the last used one."""
        if self.selection is not None:
            return self.selection
        for cell in (self._highlighted, self._last_place):
            if cell is not None and self.shown is not None:
                found = Selection.between(cell.panel, cell[1:], cell[1:])
                if is_inside(self.shown, found):
                    return found
        return Selection("threading", (1, 1), (1, 1))

    @property
    def target(self) -> Selection:
        """The selection; if there is none, the whole panel of the place."""
        assert self.shown is not None
        return self.selection or select_all(self.shown, self.place.panel)

    def change(self, shown: EditableDraft, name: str) -> None:
        """Show an edited draft, and report the edit."""
        self.show_draft(shown)
        self.edited.emit(shown, name, False)

    def fit(self) -> None:
        """Choose the size of cells so that the whole draft is visible."""
        self._fits_view = True
        if self.shown is not None:
            self.cell = fit_cell_size(self.shown, self._viewport_size(), SIZES[0], 24)
            self._update_scroll_range()
            self.repaint_all()

    def zoom(self, larger: bool, anchor: QPointF | None = None) -> None:
        """Change the size of cells; keep the point `anchor` in place."""
        layout = self.current_layout()
        if layout is None:
            return
        self._fits_view = False
        sizes = [size for size in SIZES if (size > self.cell if larger else size < self.cell)]
        if not sizes:
            return
        anchor = anchor or QPointF(self.viewport().rect().center())
        before, self.cell = self.cell, min(sizes) if larger else max(sizes)
        self._update_scroll_range()
        new_layout = self.current_layout()
        assert new_layout is not None
        axes = (layout.x, new_layout.x, anchor.x()), (layout.y, new_layout.y, anchor.y())
        for bar, (old, new, position) in zip(self._scroll_bars, axes, strict=True):
            bar.setValue(
                round((position - old.drawdown_begin) * self.cell / before + new.before - position)
            )
        self.repaint_all()

    def set_view(
        self,
        as_cloth: bool,
        colored: bool,
        from_reverse: bool = False,
        float_limits: FloatLimits | None = None,
    ) -> None:
        """Set the orientation, whether yarns are coloured, the face, and the marked floats."""
        self.as_cloth, self.colored = as_cloth, colored
        self.from_reverse, self.float_limits = from_reverse, float_limits
        self._floats = None
        self.repaint_all()

    @property
    def floats(self) -> Bools | None:
        """Crossings of floats to mark on the visible face, (picks, ends)."""
        if self._floats is None and self.float_limits is not None and self.shown is not None:
            face = not self.from_reverse
            self._floats = mark_floats(self.shown.drawdown, self.float_limits, face)
        return self._floats

    def repaint_all(self) -> None:
        """Discard the cached picture and paint again."""
        self._picture = None
        self.viewport().update()

    def describe(self, cell: GridCell) -> str:
        """Describe a cell."""
        shown = self.shown
        assert shown is not None
        loom, panel = shown.loom, cell.panel
        lifted = loom.liftplan is not None
        if panel in ("threading", "warp"):
            shafts = _join_numbers(loom.threading[cell.x - 1], "no shaft")
            shaft = f"shaft {cell.y} · " if panel == "threading" else ""
            return f"{shaft}end {cell.x}, threaded on {shafts}"
        if panel == "tieup":
            return f"shaft {cell.y} · treadle {cell.x}"
        pressed = _join_numbers(shown.treadling[cell.y - 1], "nothing")
        verb = "lifts" if lifted else "presses"
        if panel in ("treadling", "weft"):
            column = ("shaft" if lifted else "treadle") + f" {cell.x} · "
            return f"{column if panel == 'treadling' else ''}pick {cell.y} {verb} {pressed}"
        end, pick = cell.x, cell.y
        over = shown.drawdown[pick - 1, end - 1] != self.from_reverse
        side = ("over" if over else "under") + (" (reverse)" if self.from_reverse else "")
        shafts = _join_numbers(loom.threading[end - 1], "–")
        marks = _join_numbers(shown.treadling[pick - 1], "–")
        return (
            f"end {end} {side} pick {pick} · shaft {shafts} · "
            f"{'lifts' if lifted else 'treadle'} {marks}"
        )

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Paint the cached picture, and the highlight under the mouse."""
        painter = QPainter(self.viewport())
        inks = DraftColors.for_theme(is_dark(self))
        layout = self.current_layout()
        if layout is None or self.shown is None:
            painter.fillRect(self.viewport().rect(), inks.back)
            painter.end()
            return
        look = self.colored, self.from_reverse, self.floats
        painting = DraftPainter(self.shown, layout, inks, *look)
        if self._picture is None:
            ratio = self.devicePixelRatioF()
            size = self.viewport().size() * ratio
            self._picture = QImage(size, QImage.Format.Format_RGB32)
            self._picture.setDevicePixelRatio(ratio)
            self._picture.fill(inks.back)
            inside = QPainter(self._picture)
            inside.setFont(self.font())
            painting.paint(inside, ratio)
            inside.end()
        painter.drawImage(0, 0, self._picture)
        if self.selection is not None:
            painting.outline(painter, self.selection)
        if self._highlighted is not None and not self.is_stroking:
            painting.highlight(painter, self._highlighted)
        painter.end()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Start a stroke, a selection or a move of it; with Ctrl, pick the colour of a strip."""
        cell = self._cell_at(event.position())
        if event.button() != Qt.MouseButton.LeftButton or self.shown is None:
            return
        keys = event.modifiers()
        if cell is None:
            self.select(None)
            return
        self._last_place = cell
        extends = bool(keys & Qt.KeyboardModifier.ShiftModifier)
        copies = bool(keys & Qt.KeyboardModifier.ControlModifier)
        if not extends and self._can_move(cell):
            assert self.selection is not None
            self._stroke, self._last_cell = Move(self.shown, self.selection, cell, copies), cell
        else:
            self._press(cell, keys)

    @property
    def is_movable(self) -> bool:
        """Whether the selected block can be dragged: not in the drawdown of a loom."""
        if self.selection is None or self.shown is None:
            return False
        return self.selection.panel != "drawdown" or self.shown.is_pattern

    def _can_move(self, cell: GridCell | None) -> bool:
        """Return whether a drag from a cell moves the selected block."""
        if cell is None or self.selection is None or not self.is_movable:
            return False
        return self.selection.contains(Selection.between(cell.panel, cell[1:], cell[1:]))

    def _press(self, cell: GridCell, keys: Qt.KeyboardModifier) -> None:
        """Start a stroke or a selection at a cell."""
        assert self.shown is not None
        extends = bool(keys & Qt.KeyboardModifier.ShiftModifier)
        if extends or self.selects:
            self._begin_selection(cell, extends)
        elif cell.panel in STRIPS and keys & Qt.KeyboardModifier.ControlModifier:
            colors = self.shown.yarn_colors(cell.panel)
            self.color_picked.emit(QColor(*colors[(cell.x or cell.y) - 1].tolist()))
        else:
            self.select(None)
            # Where a click cannot mark cells, a drag selects them.
            self._anchor = cell
            self._is_selecting = cell.panel == "drawdown" and not self.shown.is_pattern
            self._start_stroke(cell, keys)

    def _begin_selection(self, cell: GridCell, extends: bool) -> None:
        """Select a cell, or extend the selection to it."""
        anchor = self._anchor
        if not extends or self.selection is None or anchor is None or anchor.panel != cell.panel:
            self._anchor = cell
        self._is_selecting = True
        self._extend_selection(cell)

    def _extend_selection(self, cell: GridCell) -> None:
        assert self._anchor is not None
        self.select(Selection.between(cell.panel, self._anchor[1:], cell[1:]))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Request the menu of the cell under the mouse, or of the selection by the keyboard."""
        is_mouse = event.reason() == QContextMenuEvent.Reason.Mouse
        cell = self._cell_at(QPointF(event.pos())) if is_mouse else self._highlighted
        if self.shown is None or self.is_stroking:
            return
        if cell is not None:
            self._last_place = cell
            clicked = Selection.between(cell.panel, cell[1:], cell[1:])
            if self.selection is not None and not self.selection.contains(clicked):
                self.select(None)
        self.menu_requested.emit(event.globalPos())

    def _start_stroke(self, cell: GridCell, keys: Qt.KeyboardModifier) -> None:
        assert self.shown is not None
        if cell.panel == "drawdown" and not self.shown.is_pattern:
            self.refused.emit(
                "The loom determines the drawdown: edit the threading, tie-up or "
                f"{'treadling' if self.shown.loom.liftplan is None else 'liftplan'}."
            )
            return
        second = bool(keys & Qt.KeyboardModifier.ControlModifier)
        self._stroke = Stroke(self.shown, cell, second, self.color)
        self._last_cell = cell
        self._apply_stroke(cell)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Continue a stroke, or describe the cell under the mouse."""
        if self._is_selecting and self._anchor is not None:
            layout = self.current_layout()
            assert layout is not None
            at = event.position()
            # Beyond the edge of the widget, the draft scrolls.
            for bar, place, size in zip(
                self._scroll_bars, (at.x(), at.y()), self._viewport_size(), strict=True
            ):
                bar.setValue(bar.value() + self.cell * (int(place >= size) - int(place < 0)))
            layout = self.current_layout() or layout
            nearest = layout.nearest_cell(at.x(), at.y(), self._anchor.panel)
            if nearest != self._anchor or self.selection is not None:
                self._extend_selection(nearest)
            return
        if self._stroke is None:
            under = self._cell_at(event.position())
            self._highlight(under)
            moves = self._can_move(under)
            shape = Qt.CursorShape.SizeAllCursor if moves else Qt.CursorShape.ArrowCursor
            self.viewport().setCursor(shape)
            return
        cell = self._cell_at(event.position(), self._stroke.panel)
        if cell is None or self._last_cell is None:
            return
        # Fill in the cells that a fast mouse has skipped.
        steps = max(abs(cell.x - self._last_cell.x), abs(cell.y - self._last_cell.y))
        for step in range(1, steps + 1):
            x = round(self._last_cell.x + (cell.x - self._last_cell.x) * step / steps)
            y = round(self._last_cell.y + (cell.y - self._last_cell.y) * step / steps)
            self._apply_stroke(GridCell(cell.panel, x, y))
        self._last_cell = cell

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """End a stroke."""
        if event.button() != Qt.MouseButton.LeftButton:
            return
        if isinstance(self._stroke, Move) and not self._stroke.has_moved:
            # A click, which begins anew.
            self._stroke = None
            if self._last_cell is not None:
                self._press(self._last_cell, event.modifiers())
        self._is_selecting = False
        if self._stroke is not None:
            self._end_stroke()
            self._highlight(self._cell_at(event.position()))

    def _end_stroke(self) -> None:
        if self._stroke is not None:
            name, self._stroke = self._stroke.name, None
            self.edited.emit(self.shown, name, False)

    def event(self, event: QEvent) -> bool:
        """Claim the keys of the grid's own actions before the shortcuts of the window."""
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.ShortcutOverride:
            is_escape = event.key() == Qt.Key.Key_Escape and self.selection is not None
            if is_escape or self._action_of(event) is not None:
                event.accept()
                return True
        return super().event(event)

    def _action_of(self, event: QKeyEvent) -> QAction | None:
        """Return the action whose key is pressed."""
        pressed = QKeySequence(event.keyCombination())
        action = next((each for each in self.keys if pressed in each.shortcuts()), None)
        if action is None or self.is_stroking:
            return None
        self.about_to_act.emit()
        return action if action.isEnabled() else None

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move between cells with the arrow keys, with Shift select, edit with Enter, zoom."""
        key, cell = event.key(), self._highlighted
        if (action := self._action_of(event)) is not None:
            action.trigger()
        elif key == Qt.Key.Key_Escape and self.selection is not None:
            self.select(None)
        elif key in _ARROW_STEPS and self.shown is not None and not self.is_stroking:
            extends = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            self._move_highlight(*_ARROW_STEPS[key], extends)
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and cell is not None:
            self._start_stroke(cell, event.modifiers())
            self._end_stroke()
            self.hovered.emit(self.describe(cell))
        elif event.text() in ("+", "-"):
            self.zoom(event.text() == "+")
        else:
            super().keyPressEvent(event)

    def number_steps(self, panel: str, across: int, down: int) -> tuple[int, int]:
        """Convert steps on the screen, to the right and down, to steps of numbers."""
        layout = self.current_layout()
        assert layout is not None
        x, y = layout.panels[panel]
        return -across if x.reversed else across, -down if y.reversed else down

    def _move_highlight(self, across: int, down: int, extends: bool) -> None:
        """Move to the next cell; at the edge of a grid, to the next grid; or extend a selection."""
        start = self._scroll_to(self._highlighted or GridCell("threading", 1, 1))
        self._last_place = start
        if extends and (self.selection is None or self.selection.panel != start.panel):
            self._anchor = start
        layout = self.current_layout()
        assert layout is not None
        spans = layout.panels[start.panel]
        steps = self.number_steps(start.panel, across, down)
        x, y = (number + step for number, step in zip(start[1:], steps, strict=True))
        if all(
            min(span.cells, 1) <= n <= span.cells for n, span in zip((x, y), spans, strict=True)
        ):
            self._highlight(self._scroll_to(GridCell(start.panel, x, y)))
            if extends:
                self._extend_selection(GridCell(start.panel, x, y))
            return
        if extends:
            return
        middle = layout.center(start)
        for distance in range(self.cell + GAP + STRIP):
            neighbour = layout.cell_at(middle[0] + across * distance, middle[1] + down * distance)
            if neighbour not in (None, start):
                self._highlight(neighbour)
                return

    def _scroll_to(self, cell: GridCell) -> GridCell:
        """Scroll until a cell is visible."""
        layout = self.current_layout()
        assert layout is not None
        for bar, span, number, space in zip(
            self._scroll_bars,
            layout.panels[cell.panel],
            cell[1:],
            self._viewport_size(),
            strict=True,
        ):
            begin = span.pixel_of(number)
            low, high = max(span.low, 0), min(span.high, space)
            bar.setValue(bar.value() + min(0, begin - low) + max(0, begin + span.size - high))
        return cell

    def scroll_to_selection(self) -> None:
        """Scroll until the first selected cell is visible."""
        if self.selection is not None:
            first = self.selection.x[0], self.selection.y[0]
            self._scroll_to(GridCell(self.selection.panel, *first))

    def leaveEvent(self, _event: QEvent) -> None:
        """Remove the highlight."""
        self._highlight(None)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom with Ctrl, otherwise scroll."""
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            if event.angleDelta().y():
                self.zoom(event.angleDelta().y() > 0, event.position())
            event.accept()
        else:
            super().wheelEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit the draft again if the whole draft was shown."""
        super().resizeEvent(event)
        if self._fits_view:
            self.fit()
        self._update_scroll_range()
        self.repaint_all()

    def changeEvent(self, event: QEvent) -> None:
        """Paint again in another theme."""
        if event.type() in (QEvent.Type.PaletteChange, QEvent.Type.StyleChange):
            self.repaint_all()
        super().changeEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        """Let commands know that they can be applied."""
        super().showEvent(event)
        self.shown_changed.emit()

    def hideEvent(self, event: QHideEvent) -> None:
        """Let commands know that they cannot be applied."""
        super().hideEvent(event)
        self.shown_changed.emit()

    def sizeHint(self) -> QSize:
        """Return a size that is enough for a small draft."""
        return QSize(360, 420)

    def _apply_stroke(self, cell: GridCell) -> None:
        assert self._stroke is not None
        assert self.shown is not None
        shown = self._stroke.apply(self.shown, cell)
        if shown is not self.shown:
            self.shown, self._floats = shown, None
            self._update_scroll_range()
            self.repaint_all()
            if self._stroke.place is not None:
                self.select(self._stroke.place)
            self.edited.emit(shown, self._stroke.name, True)

    def _highlight(self, cell: GridCell | None) -> None:
        if cell != self._highlighted:
            self._highlighted = cell
            self.hovered.emit("" if cell is None else self.describe(cell))
            self.viewport().update()

    def _cell_at(self, at: QPointF, panel: str | None = None) -> GridCell | None:
        layout = self.current_layout()
        return None if layout is None else layout.cell_at(at.x(), at.y(), panel)

    def _viewport_size(self) -> tuple[int, int]:
        return self.viewport().width(), self.viewport().height()

    @property
    def _scroll_bars(self) -> tuple[QScrollBar, QScrollBar]:
        return self.horizontalScrollBar(), self.verticalScrollBar()

    def _update_scroll_range(self) -> None:
        layout = self.current_layout()
        max_offset = (0, 0) if layout is None else layout.max_offset
        for bar, end, space in zip(
            self._scroll_bars, max_offset, self._viewport_size(), strict=True
        ):
            bar.setRange(0, end)
            bar.setPageStep(space)
            bar.setSingleStep(4 * self.cell)


def _grid_sizes(shown: EditableDraft) -> tuple[object, ...]:
    """Return the numbers of cells of all grids, for comparison."""
    return shown.size, shown.loom.shafts, shown.columns, shown.loom.liftplan is None


def _join_numbers(numbers: tuple[int, ...], nothing: str) -> str:
    return ", ".join(map(str, numbers)) or nothing
