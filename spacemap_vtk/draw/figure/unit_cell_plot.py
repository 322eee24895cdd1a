"""Slices through the voxels of a unit cell: its yarns and their directions, and its stress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.draw.actors.surface_actor import ramp_table
from spacemap_vtk.draw.figure.measurement_plot import LIGHT, Ink
from spacemap_vtk.draw.unit_cell_values import (
    CONTENTS,
    INSIDE,
    needs_load,
    value_span,
    voxel_colors,
    voxel_values,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: Arrows along the longer side of a slice.
_ARROWS = 20


def slice_count(model: UnitCellModel, across: str) -> int:
    """Return the number of slices across an axis."""
    return int(model.voxels.fraction.shape[2 - "xyz".index(across)])


def draw_slice(
    panel: Axes,
    model: UnitCellModel,
    across: str,
    index: int,
    content: str,
    load: str,
    ink: Ink = LIGHT,
) -> None:
    """Draw one layer of voxels into a panel."""
    axis = "xyz".index(across)
    first, second = (other for other in range(3) if other != axis)
    shape = model.voxels.fraction.shape
    size = 1e3 * model.spacing * shape[::-1]
    extent = (0.0, size[first], 0.0, size[second])

    def cut(values: Any) -> Any:
        return np.take(values, index, axis=2 - axis)

    options: dict[str, Any] = {"origin": "lower", "extent": extent, "interpolation": "nearest"}
    if content == "yarns":
        panel.imshow(cut(voxel_colors(model, content, load)), **options)
        share, direction = cut(model.voxels.fraction), cut(model.voxels.direction)
        _draw_arrows(panel, model, direction, share, (first, second))
    else:
        from matplotlib.colors import ListedColormap

        values, unit = voxel_values(model, content, load)
        low, high = value_span(model, content, load)
        ramp = ListedColormap(ramp_table() / 255)
        shown = panel.imshow(cut(values), cmap=ramp, vmin=low, vmax=high, **options)
        label = CONTENTS[content]
        if needs_load(content):
            label += f"{unit and f' [{unit}]'} for a strain {load} of 1"
        bar = panel.figure.colorbar(shown, ax=panel, shrink=0.8)
        bar.set_label(label, fontsize=8, color=ink.text)
        bar.ax.tick_params(labelsize=8, colors=ink.text)
    panel.set(facecolor=ink.paper, aspect="equal")
    panel.set_xlabel(f"{'xyz'[first]} [mm]", fontsize=8, color=ink.text)
    panel.set_ylabel(f"{'xyz'[second]} [mm]", fontsize=8, color=ink.text)
    panel.tick_params(colors=ink.text, labelsize=8)


def _draw_arrows(
    panel: Axes,
    model: UnitCellModel,
    direction: Any,
    share: Any,
    plane: tuple[int, int],
) -> None:
    """Draw the directions of the fibres, as long as they lie in the plane."""
    step = max(1, max(share.shape) // _ARROWS)
    rows, columns = np.meshgrid(
        np.arange(step // 2, share.shape[0], step),
        np.arange(step // 2, share.shape[1], step),
        indexing="ij",
    )
    inside = share[rows, columns] > INSIDE
    rows, columns = rows[inside], columns[inside]
    axis = direction[rows, columns]
    place = 1e3 * (np.stack([columns, rows]) + 0.5) * model.spacing[list(plane), None]
    length = 1e3 * step * model.spacing[plane[0]]
    panel.quiver(
        *place,
        *(axis[:, plane].T * length),
        angles="xy",
        scale_units="xy",
        scale=1.2,
        pivot="mid",
        headwidth=0,
        headlength=0,
        headaxislength=0,
        width=0.004,
        color="#1b222b",
    )
