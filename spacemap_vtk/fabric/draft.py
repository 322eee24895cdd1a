"""Drafts: a weave to be made, with what a draft file says of its yarns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.drawdown import as_drawdown, floats, from_matrix, repeat, rows, tile
from spacemap_vtk.fabric.patterns import basket, plain, rib, satin, twill

# What a caller needs to make a draft, in one place.
__all__ = [
    "Draft",
    "basket",
    "floats",
    "from_matrix",
    "plain",
    "repeat",
    "rib",
    "rows",
    "satin",
    "tile",
    "twill",
]


@dataclass(frozen=True, eq=False)
class Draft:
    """A weave to be made: its drawdown and what else a draft file may say.

    Parameters
    ----------
    drawdown : (picks, ends) bool
        True: the end lies over the pick.
    warp_colors : (ends, 3) uint8, optional
        RGB colour of each end.
    weft_colors : (picks, 3) uint8, optional
        RGB colour of each pick.
    warp_spacing, weft_spacing : float, optional
        Distance between ends and between picks, in metres.
    warp_thickness, weft_thickness : float, optional
        Diameter of the warp and weft yarns, in metres.
    title : str, optional
        Name of the draft.
    warnings : tuple of str, optional
        What was odd about the source of the draft.

    Raises
    ------
    InputError
        The drawdown is not a matrix with at least one pick and one end, or the number of colours
        is not the number of yarns.

    Examples
    --------
    >>> Draft(plain(3, 2)).drawdown.shape
    (2, 3)
    """

    drawdown: NDArray[np.bool_]
    warp_colors: NDArray[np.uint8] | None = None
    weft_colors: NDArray[np.uint8] | None = None
    warp_spacing: float | None = None
    weft_spacing: float | None = None
    warp_thickness: float | None = None
    weft_thickness: float | None = None
    title: str = ""
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        drawdown = as_drawdown(self.drawdown)
        object.__setattr__(self, "drawdown", drawdown)
        object.__setattr__(self, "warnings", tuple(self.warnings))
        yarns = {"warp_colors": (drawdown.shape[1], "end"), "weft_colors": (len(drawdown), "pick")}
        for name, (count, yarn) in yarns.items():
            colors = getattr(self, name)
            if colors is None:
                continue
            colors = np.ascontiguousarray(colors, dtype=np.uint8)
            if colors.shape != (count, 3):
                raise InputError(
                    f"one RGB colour for each {yarn} is needed, not an array of {colors.shape}",
                    key=name,
                    allowed=f"({count}, 3)",
                )
            object.__setattr__(self, name, colors)
