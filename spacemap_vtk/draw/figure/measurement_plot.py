"""Plots of the laboratory: the curves of a test in the units of its instrument, and in SI."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.laboratory.records import Curve, Measurement, Unit
from spacemap_vtk.scenes.laboratory import TestResult
from spacemap_vtk.units import typeset_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours of curves.
COLORS = ("#c8502a", "#2c5f9e", "#2f7d5b", "#8e5ea2")


class Ink(NamedTuple):
    """Colours of a plot."""

    text: str
    faint: str
    grid: str
    paper: str


LIGHT = Ink("#26323e", "#7a8591", "#e6e9ed", "#ffffff")
DARK = Ink("#dfe6ee", "#8794a3", "#2b3440", "#1d232b")
#: Size of one panel [in].
_WIDTH, _HEIGHT = 5.6, 4.2
#: Dashes of a curve that lies on an earlier one.
_DASHES = (0, (5, 3))
#: Letters in a line of the legend.
_LINE = 72
#: Largest difference of curves that coincide, over their largest value.
_SAME = 2e-3


def measurement_plot(title: str, results: Sequence[TestResult]) -> Figure:
    """Draw a panel for each test that was made, with its curves and figures."""
    made = [result for result in results if result.measurement and result.measurement.curves]
    columns = 1 if len(made) == 1 else 2
    lines = -(-len(made) // columns)
    size = (9.0, 5.4) if len(made) == 1 else (2 * _WIDTH * 1.15, lines * _HEIGHT)
    figure = new_figure(figsize=size, dpi=150, layout="constrained")
    figure.suptitle(title, fontsize=12)
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for panel, (test, measurement, _) in zip(panels, made, strict=False):
        assert measurement is not None
        panel.set_title(f"{test.title} ({test.instrument})", fontsize=10, loc="left")
        draw_curves(panel, measurement, len(made) == 1)
    for panel in panels[len(made) :]:
        panel.set_axis_off()
    return figure


def draw_curves(
    panel: Axes,
    measurement: Measurement,
    with_si: bool = True,
    ink: Ink = LIGHT,
    with_figures: bool = True,
) -> None:
    """Draw the curves of a test into a panel, with the figures below them."""
    x, y = measurement.x_axis, measurement.y_axis
    for number, curve in enumerate(measurement.curves):
        hidden = any(_coincide(curve, other) for other in measurement.curves[:number])
        panel.plot(
            curve.x / x.unit.size,
            curve.y / y.unit.size,
            color=COLORS[number % len(COLORS)],
            linewidth=1.6,
            linestyle=_DASHES if hidden else "-",
            label=_describe_curve(measurement, curve.name) if with_figures else curve.name,
        )
    panel.set(xlabel=x.label, ylabel=y.label, facecolor=ink.paper)
    panel.grid(color=ink.grid, linewidth=0.6)
    panel.tick_params(colors=ink.text)
    for label in (panel.xaxis.label, panel.yaxis.label):
        label.set_color(ink.text)
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(ink.faint)
    if min(curve.x.min() for curve in measurement.curves) < 0.0:
        panel.axhline(0.0, color=ink.faint, linewidth=0.8, zorder=1)
        panel.axvline(0.0, color=ink.faint, linewidth=0.8, zorder=1)
    else:
        panel.set_xlim(left=0.0)
        panel.set_ylim(bottom=0.0)
    panel.legend(
        frameon=False,
        fontsize=8 if with_si else 7,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.15 if with_figures else -0.22),
        ncols=1 if with_figures else 2,
        labelcolor=ink.text,
    )
    if with_si and y.unit.si and y.unit.size != 1.0:
        _add_si_axis(panel, y.unit)


def _coincide(curve: Curve, other: Curve) -> bool:
    """Return whether two curves cannot be told apart in a plot."""
    if len(curve.x) != len(other.x):
        return False
    pairs = (curve.x, other.x), (curve.y, other.y)
    return all(np.abs(a - b).max() <= _SAME * np.abs(a).max() for a, b in pairs)


def _add_si_axis(panel: Axes, unit: Unit) -> None:
    """Add a scale in SI on the right."""

    def to_si(value: Any) -> Any:
        return value * unit.size

    def from_si(value: Any) -> Any:
        return value / unit.size

    axis = panel.secondary_yaxis("right", functions=(to_si, from_si))
    axis.set_ylabel(f"[{typeset_units(unit.si)}]", color=LIGHT.faint)
    axis.tick_params(colors=LIGHT.faint, labelsize=8)
    axis.spines["right"].set_visible(False)


def _describe_curve(measurement: Measurement, name: str) -> str:
    """Return the name of a curve with the figures of its direction."""
    figures = [
        f"{reading.symbol} {reading.text}"
        for reading in measurement.readings
        if reading.direction == name and reading.value is not None
    ]
    text = f"{name}: {', '.join(figures)}" if figures else name
    # Figures are not separated from their units.
    return textwrap.fill(
        text.replace(" ", "\N{NO-BREAK SPACE}").replace(",\N{NO-BREAK SPACE}", ", "), _LINE
    )
