"""Measure scale and orientation of a view, and draw the key of a page: axes and scales."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.draw.actors.color_values import round_ticks, scale_unit
from spacemap_vtk.draw.actors.surface_actor import Span, ramp_table
from spacemap_vtk.draw.camera import pixels_per_metre_at_focus
from spacemap_vtk.draw.figure.page import SMALL, TEXT, PageStyle
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.units import format_quantity, typeset_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Leading digits of a round length.
_ROUND = (1.0, 2.0, 5.0, 10.0)
#: Colours of the axes x, y and z, on a light and on a dark background.
AXES = (("#c8372d", "#3f8f3f", "#2c5f9e"), ("#ff7b6b", "#79c879", "#6fb0f0"))


class ViewScale(NamedTuple):
    """Scale and orientation of a view."""

    unit_length: float
    """Length of a unit of the picture, in the focal plane, in m."""
    axes: Floats
    """(3, 3) The axes x, y and z in the camera's frame: right, up, towards the eye."""
    is_parallel: bool
    """Whether the projection is parallel."""


def view_scale(camera: vtkCamera, height: float) -> ViewScale:
    """Return scale and orientation of a camera's view, for a picture of some height in units."""
    is_parallel = bool(camera.GetParallelProjection())
    return ViewScale(
        1.0 / pixels_per_metre_at_focus(camera, height), view_axes(camera), is_parallel
    )


def round_length(largest: float) -> float:
    """Return the largest round number that is at most `largest`."""
    size = 10.0 ** np.floor(np.log10(largest))
    return float(max(n * size for n in _ROUND if n * size <= largest * (1 + 1e-9)))


def view_axes(camera: vtkCamera) -> Floats:
    """Return the axes x, y and z in the camera's frame: right, up, towards the eye, (3, 3)."""
    matrix = camera.GetModelViewTransformMatrix()
    axes = np.array([[matrix.GetElement(row, k) for row in range(3)] for k in range(3)])
    return np.where(np.abs(axes) < 1e-12, 0.0, axes)


def draw_key(
    axes: Axes, page_style: PageStyle, scale: ViewScale, color: str, span: Span | None
) -> None:
    """Draw axes, a scale bar and the colour scale side by side, for a page."""
    _draw_triad(axes, page_style, scale.axes)
    _draw_scale(axes, page_style, scale)
    if span is not None:
        _draw_colors(axes, page_style, color, span)


def _draw_triad(axes: Axes, page_style: PageStyle, view_directions: Floats) -> None:
    size = 7.0
    middle = size * (0.3 - 0.8 * np.minimum(view_directions[:, :2], 0.0).min(axis=0))
    for k in np.argsort(view_directions[:, 2]):
        tip, color = 0.8 * size * view_directions[k, :2], AXES[page_style.dark][k]
        if np.hypot(*tip) > 0.08 * size:
            look = {"arrowstyle": "-|>,head_length=0.35,head_width=0.14", "color": color}
            more = {"shrinkA": 0, "shrinkB": 0, "linewidth": 1.0, "mutation_scale": 10}
            axes.annotate("", middle + tip, middle, arrowprops={**look, **more})
            tip *= 1.0 + 1.4 / np.hypot(*tip)
        else:
            axes.plot(*middle, marker="o", markersize=3.5, color=color)
            tip = np.array([-1.6, -1.2])
        style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": TEXT, "color": color}
        x, y = middle + tip
        axes.text(x, y, "xyz"[k], **style)


def _draw_scale(axes: Axes, page_style: PageStyle, scale: ViewScale) -> None:
    from matplotlib.patches import Rectangle

    length = round_length(30.0 * scale.unit_length)
    left, wide = 20.0, length / scale.unit_length
    axes.add_patch(
        Rectangle((left, 4.4), wide, 0.8, facecolor=page_style.ink, linewidth=0, gid="scale")
    )
    text = format_quantity(length, "m")
    axes.text(left, 5.8, text, fontsize=TEXT, color=page_style.ink, va="bottom")
    projection = "without perspective" if scale.is_parallel else "in the focal plane"
    axes.text(left, 3.8, projection, fontsize=SMALL, color=page_style.faint, va="top")


def _draw_colors(axes: Axes, page_style: PageStyle, color: str, span: tuple[float, float]) -> None:
    from matplotlib.colors import ListedColormap

    unit, size = scale_unit(color, max(map(abs, span)))
    low, high = (end / size for end in span)
    right = axes.get_xlim()[1] - 4.0
    wide = min(75.0, right - 62.0)
    left = right - wide
    colors = np.linspace(0.0, 1.0, 256)[None]
    limits = axes.get_xlim(), axes.get_ylim()
    axes.imshow(
        colors,
        ListedColormap(ramp_table() / 255),
        extent=(left, right, 4.4, 6.6),
        aspect="auto",
        interpolation="nearest",
    )
    axes.set(xlim=limits[0], ylim=limits[1])
    style: dict[str, Any] = {"fontsize": TEXT, "color": page_style.ink}
    for number in round_ticks(low, high):
        x = left + (number - low) / (high - low) * wide
        axes.plot([x, x], [4.4, 3.7], color=page_style.ink, linewidth=0.5)
        axes.text(x, 3.3, f"{number:g}".replace("-", "−"), ha="center", va="top", **style)
    label = COLORINGS[color].label + (f" [{typeset_units(unit)}]" if unit else "")
    axes.text(left, 7.3, label, va="bottom", **style)
