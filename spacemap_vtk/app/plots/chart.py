"""Plots drawn once by matplotlib, with a time cursor painted over the picture by Qt."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg
from matplotlib.legend import Legend
from matplotlib.ticker import LogLocator, MaxNLocator
from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QSizePolicy

from spacemap_vtk.app.plots.curves import Curves
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.draw.figure.plots import QUANTITIES, energy_curves, prefixed_unit
from spacemap_vtk.draw.figure.reaction_plot import ReactionCurves

#: Colours of points.
POINTS = ("#d9642c", "#2c7fb8", "#2f8f5b", "#8e5ea2", "#b58900", "#d1495b")
COMPONENTS = ("x", "y", "z", "size")
#: Margins of the plots, in pixels.
_LEFT = 58
_RIGHT = 14
_TOP = 24
_BETWEEN = 58
_BOTTOM = 40
#: Height of a line of the legend, in pixels.
_LINE = 14
#: Gap between a title and the legend beside it, in pixels.
_GAP = 10
#: Forces below this share of the largest, in N, and moments, in N m, are rounding.
_ROUNDING = 1e-9
#: Most letters of a body's name in a legend.
_LETTERS = 26
#: Distance of a title from its plot, in points.
_PAD = 6.0


class CurveOptions(NamedTuple):
    """Options for showing curves."""

    quantity: str
    """A key of `spacemap_vtk.draw.figure.plots.QUANTITIES` or of `REACTIONS`."""
    component: str
    """One of `COMPONENTS`."""
    dark: bool
    reactions: ReactionCurves | None = None
    """Reactions that are shown instead of the motion of points."""
    body: int | None = None
    """Number of the body whose reaction is shown; None for all."""


class PlotCanvas(FigureCanvasQTAgg):
    """Canvas with plots of motion and energies over time and of the frequency response."""

    #: A clicked time in s, and whether the mouse button is still pressed.
    time_clicked = Signal(float, bool)

    def __init__(self) -> None:
        super().__init__(new_figure(dpi=100))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(240)
        self.axes: list[Axes] = []
        #: Those of them with time along x.
        self.time_axes: list[Axes] = []
        self._time = 0.0
        self._pressed: Axes | None = None
        self._ink, self._text = QColor("#26323e"), "#26323e"

    def draw_curves(self, curves: Curves, shown: CurveOptions) -> None:
        figure = self.figure
        figure.clear()
        ink, back = ("#dfe6ee", "#1d232b") if shown.dark else ("#26323e", "#f4f6f8")
        paper, grid = ("#161b22", "#2b3440") if shown.dark else ("#ffffff", "#e6e9ed")
        self._ink, self._text = QColor("#ffb454" if shown.dark else "#111a24"), ink
        figure.set_facecolor(back)
        reactions = shown.reactions
        over_time = reactions is None or reactions.is_over_time
        has_energy = over_time and curves.balance is not None
        has_response = reactions is None and len(curves.frequencies) > 0
        count = 1 + has_energy + has_response
        self.axes = list(np.atleast_1d(figure.subplots(count, 1)))
        self.time_axes = self.axes[: 1 + has_energy] if over_time else []
        if reactions is not None:
            _plot_reactions(self.axes[0], reactions, shown)
        else:
            unit = self._plot_motion(self.axes[0], curves, shown)
        if has_energy:
            _plot_energy(self.axes[1], curves, ink)
        if has_response:
            self._plot_response(self.axes[-1], curves, shown, unit, grid)
        for axes in self.axes:
            axes.set_facecolor(paper)
            axes.grid(color=grid, linewidth=0.7)
            axes.set_axisbelow(True)
            axes.spines[["top", "right"]].set_visible(False)
            axes.spines[["left", "bottom"]].set_color(grid)
            axes.tick_params(colors=ink, labelsize=7.5, length=0, which="both")
            axes.xaxis.label.set(color=ink, fontsize=8)
        self._adjust_margins()
        # When Qt is idle, so that a change together with a resize is drawn once.
        self.draw_idle()

    def set_time(self, time: float) -> None:
        """Move the time cursor; only its line is painted again."""
        before = self.cursor_columns()
        self._time = time
        for column in {*before, *self.cursor_columns()}:
            self.update(QRect(column - 2, 0, 5, self.height()))

    def time_at(self, axes: Axes, x: float) -> float:
        box = axes.get_position()
        low, high = axes.get_xlim()
        share = (x / self.width() - box.x0) / box.width
        return float(low + (high - low) * min(max(share, 0.0), 1.0))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the picture and the cursor over it."""
        super().paintEvent(event)
        painter = QPainter(self)
        painter.setPen(QPen(self._ink, 1.2))
        for axes, column in zip(self.time_axes, self.cursor_columns(), strict=True):
            box = axes.get_position()
            top, bottom = (round(self.height() * (1 - y)) for y in (box.y1, box.y0))
            painter.drawLine(column, top, column, bottom)
        painter.end()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the margins at constant size, as they contain text."""
        super().resizeEvent(event)
        self._adjust_margins()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Go to the clicked time."""
        if event.button() == Qt.MouseButton.LeftButton:
            at = event.position()
            for axes in self.time_axes:
                box = axes.get_position()
                if box.y0 <= 1 - at.y() / self.height() <= box.y1:
                    self._pressed = axes
                    self.time_clicked.emit(self.time_at(axes, at.x()), True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Scrub while the mouse button is pressed."""
        if self._pressed is not None:
            self.time_clicked.emit(self.time_at(self._pressed, event.position().x()), True)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None and event.button() == Qt.MouseButton.LeftButton:
            axes, self._pressed = self._pressed, None
            self.time_clicked.emit(self.time_at(axes, event.position().x()), False)

    def cursor_columns(self) -> list[int]:
        """Return the x position of the cursor in each plot over time; negative if not visible."""
        columns = []
        for axes in self.time_axes:
            box, (low, high) = axes.get_position(), axes.get_xlim()
            share = (self._time - low) / (high - low)
            x = (box.x0 + box.width * share) * self.width()
            columns.append(round(x) if -1e-9 <= share <= 1 + 1e-9 else -10)
        return columns

    def _adjust_margins(self) -> None:
        width, height, count = max(self.width(), 1), max(self.height(), 1), len(self.axes)
        if not count or width <= _LEFT + _RIGHT:
            return
        lines = [self._place_legend(axes, width - _LEFT - _RIGHT) for axes in self.axes]
        top, between = _TOP + _LINE * lines[0], _BETWEEN + _LINE * max(lines[1:], default=0)
        plot_height = (height - top - _BOTTOM - (count - 1) * between) / count
        if plot_height <= 0:
            return
        self.figure.subplots_adjust(
            left=_LEFT / width,
            right=1 - _RIGHT / width,
            top=1 - top / height,
            bottom=_BOTTOM / height,
            hspace=between / plot_height,
        )

    def _place_legend(self, axes: Axes, space: int) -> int:
        """Place title and legend side by side or in lines; return the lines below the title."""
        text, ratio = axes.get_title(loc="left"), self.device_pixel_ratio
        renderer = self.get_renderer()
        title = axes.set_title(text, loc="left", color=self._text, fontsize=8.5, pad=_PAD)
        count = len(axes.get_legend_handles_labels()[1])
        if count < 2:
            return 0
        title_width = title.get_window_extent(renderer).width / ratio + _GAP
        lines, legend_width = (
            0,
            _add_legend(axes, count, self._text).get_window_extent(renderer).width / ratio,
        )
        while title_width + legend_width > space and lines < count:
            lines, title_width = lines + 1, 0.0
            legend = _add_legend(axes, -(-count // lines), self._text)
            legend_width = legend.get_window_extent(renderer).width / ratio
        pad = _PAD + lines * _LINE * 72 / 100
        axes.set_title(text, loc="left", color=self._text, fontsize=8.5, pad=pad)
        return lines

    def _plot_motion(self, axes: Axes, curves: Curves, shown: CurveOptions) -> tuple[str, float]:
        unit, row = QUANTITIES[shown.quantity]
        values = component_of(curves.motion[row], shown.component)
        word, size = prefixed_unit(unit, float(abs(values).max(initial=0.0)))
        for number, curve in enumerate(values):
            color = POINTS[number % len(POINTS)]
            axes.plot(curves.times, curve / size, color=color, linewidth=1.2, label=f"{number + 1}")
        part = "" if shown.component == "size" else f" along {shown.component}"
        axes.set_title(f"{shown.quantity.capitalize()}{part} [{word}]", loc="left")
        _format_time_axis(axes, curves)
        return unit, row

    def _plot_response(
        self, axes: Axes, curves: Curves, shown: CurveOptions, unit: tuple[str, float], grid: str
    ) -> None:
        for mode in curves.modes:
            if curves.frequencies[0] < mode < curves.frequencies[-1]:
                axes.axvline(mode, color=grid, linewidth=0.7, zorder=0)
        answer = curves.response * (2 * np.pi * curves.frequencies[:, None]) ** unit[1]
        values = component_of(answer, shown.component)
        word, size = prefixed_unit(unit[0], float(values.max(initial=0.0)))
        for number, curve in enumerate(values):
            if curve.max(initial=0.0) > 0.0:
                color = POINTS[number % len(POINTS)]
                axes.loglog(curves.frequencies, curve / size, color=color, linewidth=1.1)
        axes.set_title(f"Amplitude, harmonic loads [{word}]", loc="left")
        axes.set(xscale="log", yscale="log", xlabel="frequency [Hz]")
        axes.set_xlim(curves.frequencies[0], curves.frequencies[-1])
        axes.yaxis.set_major_locator(LogLocator(numticks=6))
        axes.minorticks_off()


def _plot_reactions(axes: Axes, reactions: ReactionCurves, shown: CurveOptions) -> None:
    table, unit = reactions.tables[shown.quantity]
    # Moments have a lever of at least 1 nm, or are rounding.
    rounding = _ROUNDING * float(max(abs(table).max(), abs(reactions.forces).max()))
    values = component_of(np.where(abs(table) > rounding, table, 0.0), shown.component)
    word, size = prefixed_unit(unit, float(abs(table).max(initial=0.0)))
    bodies = range(len(reactions.names)) if shown.body is None else [shown.body]
    names = [_shorten(reactions.names[body]) for body in bodies]
    for body, name in zip(bodies, names, strict=True):
        color = POINTS[body % len(POINTS)]
        axes.plot(reactions.x, values[:, body] / size, color=color, linewidth=1.2, label=name)
    of = f" of {names[0]}" if len(names) == 1 else ""
    part = "" if shown.component == "size" else f" along {shown.component}"
    if shown.quantity == "moment" and part:
        part = f" about {shown.component}"
    axes.set_title(f"{shown.quantity.capitalize()}{of}{part} [{word}]", loc="left")
    axes.set_xlim(reactions.x.min(), reactions.x.max())
    axes.set_xlabel(reactions.heading)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(5))


def _shorten(name: str) -> str:
    return name if len(name) <= _LETTERS else f"{name[: _LETTERS - 1]}…"


def component_of(vectors: np.ndarray, component: str) -> np.ndarray:
    """Return one component of vectors, or their magnitude for "size"."""
    if component == "size":
        return np.asarray(np.linalg.norm(vectors, axis=-1))
    return np.asarray(vectors[..., COMPONENTS.index(component)])


def _plot_energy(axes: Axes, curves: Curves, ink: str) -> None:
    assert curves.balance is not None
    unit, size = prefixed_unit("J", float(np.nanmax(np.abs(curves.balance), initial=0.0)))
    *parts, total = energy_curves(curves.balance)
    for label, values, color in [*parts, (*total[:2], ink)]:
        axes.plot(curves.times, values / size, color=color, linewidth=1.2, label=label)
    axes.set_title(f"Energy [{unit}]", loc="left")
    _format_time_axis(axes, curves)


def _format_time_axis(axes: Axes, curves: Curves) -> None:
    axes.set_xlim(curves.times[0], curves.times[-1])
    axes.set_xlabel("time [s]")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(5))


def _add_legend(axes: Axes, columns: int, color: str) -> Legend:
    # Above the plot on the right, where no curve can be.
    return axes.legend(
        frameon=False,
        ncols=columns,
        fontsize=7.5,
        labelcolor=color,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.3,
        labelspacing=0.25,
        borderpad=0,
        handlelength=1.1,
        handletextpad=0.4,
        columnspacing=0.9,
    )
