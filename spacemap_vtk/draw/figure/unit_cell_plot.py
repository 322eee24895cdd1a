"""Slices through the voxels of a unit cell: its yarns and their directions, and its stress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.draw.figure.measurement_plot import LIGHT, Ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: What a slice can show, with its label.
CONTENTS = {
    "yarns": "Yarns and directions of fibres",
    "fraction": "Share of yarn",
    "stress": "Equivalent stress",
}
#: Planes of slices: label, and the axis across them.
PLANES = {"z": "xy, seen from above", "y": "xz, across the warp", "x": "yz, across the weft"}
#: Arrows along the longer side of a slice.
_ARROWS = 20
#: Share of yarn from which a voxel belongs to it.
_INSIDE = 0.5


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
    share = cut(model.voxels.fraction)
    if content == "stress":
        stress = cut(model.fields[f"von_mises_{load}"].reshape(shape)) / 1e9
        shown = panel.imshow(stress, cmap="inferno", **options)
        label = f"Equivalent stress in GPa for a strain {load} of 1"
    elif content == "fraction":
        shown = panel.imshow(share, cmap="Greys", vmin=0, vmax=1, **options)
        label = "Share of yarn"
    else:
        number = cut(model.voxels.yarn)
        colours = np.array(_colours(int(model.voxels.yarn.max()) + 1))
        picture = np.ones((*share.shape, 4))
        picture[..., :3] = colours[np.maximum(number, 0)]
        picture[..., 3] = np.where(number >= 0, share, 0.0)
        panel.imshow(picture, **options)
        shown, label = None, ""
        _draw_arrows(panel, model, cut(model.voxels.direction), share, (first, second))
    if shown is not None:
        bar = panel.figure.colorbar(shown, ax=panel, shrink=0.8)
        bar.set_label(label, fontsize=8, color=ink.text)
        bar.ax.tick_params(labelsize=8, colors=ink.text)
    panel.set(
        xlabel=f"{'xyz'[first]} in mm",
        ylabel=f"{'xyz'[second]} in mm",
        facecolor=ink.paper,
        aspect="equal",
    )
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
    inside = share[rows, columns] > _INSIDE
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


def _colours(count: int) -> list[tuple[float, float, float]]:
    """Return a colour for each yarn: warm and cool ones in turn."""
    from matplotlib import colormaps

    wheel = colormaps["tab20"].colors  # type: ignore[attr-defined]
    return [wheel[number % len(wheel)] for number in range(max(1, count))]
