"""What views of a unit cell show: numbers and colours of its voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.draw.actors.surface_actor import (
    YARNS,
    Span,
    natural_span,
    ramp_colors,
    rgb_table,
)
from spacemap_vtk.ndarrays import Bytes
from spacemap_vtk.unit_cell.mixtures import COMPONENTS

if TYPE_CHECKING:
    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: What a view can show, with its label.
CONTENTS = {
    "yarns": "Yarns and directions of fibres",
    "fraction": "Share of yarn",
    "stress": "Equivalent stress",
    **{f"stress_{name}": f"Stress {name}" for name in COMPONENTS},
    **{f"strain_{name}": f"Strain {name}" for name in COMPONENTS},
}
#: Planes of slices: label, and the axis across them.
PLANES = {"z": "xy, from above", "y": "xz, across warp", "x": "yz, across weft"}
#: Share of yarn from which a voxel belongs to it.
INSIDE = 0.5
#: Colour of the matrix.
_MATRIX = (232, 229, 222)


def needs_load(content: str) -> bool:
    """Return whether a content depends on the mean strain."""
    return content not in ("yarns", "fraction")


def voxel_values(model: UnitCellModel, content: str, load: str) -> tuple[NDArray[Any], str]:
    """Return the numbers of a content, (nz, ny, nx), and their unit; for yarns their share."""
    if not needs_load(content):
        return model.voxels.fraction, ""
    quantity, _, component = content.partition("_")
    if content == "stress":
        values, is_stress = model.fields[f"von_mises_{load}"], True
    else:
        values = model.fields[f"{quantity}_{load}"][:, COMPONENTS.index(component)]
        is_stress = quantity == "stress"
    values = values.reshape(model.voxels.fraction.shape)
    return (values / 1e9, "GPa") if is_stress else (values, "")


def value_span(model: UnitCellModel, content: str, load: str) -> Span:
    """Return the ends of the scale of a content."""
    if not needs_load(content):
        return 0.0, 1.0
    return natural_span(voxel_values(model, content, load)[0])


def yarn_numbers(model: UnitCellModel) -> list[int]:
    """Return the numbers of the yarns in a cell."""
    numbers = np.unique(model.voxels.yarn)
    return [int(number) for number in numbers if number >= 0]


def voxel_colors(model: UnitCellModel, content: str, load: str) -> Bytes:
    """Return the colours of the voxels, (nz, ny, nx, 3)."""
    if content != "yarns":
        values, _ = voxel_values(model, content, load)
        colors: Bytes = ramp_colors(values, value_span(model, content, load))
        return colors
    numbers = yarn_numbers(model)
    wheel = np.resize(rgb_table(YARNS), (max(1, len(numbers)), 3)).astype(np.float64)
    own = wheel[np.clip(np.searchsorted(numbers, model.voxels.yarn), 0, len(wheel) - 1)]
    share = np.where(model.voxels.yarn >= 0, model.voxels.fraction, 0.0)[..., None]
    mixed: Bytes = np.rint(share * own + (1 - share) * _MATRIX).astype(np.uint8)
    return mixed
