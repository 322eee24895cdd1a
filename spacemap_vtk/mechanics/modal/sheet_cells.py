"""How many cells a sheet needs, so that its modes and folds hardly depend on them."""

from __future__ import annotations

import math
from typing import NamedTuple

#: Error of a mode's frequency divided by (k c)², for wave number k and cell width c, for modes that
#: bend the sheet. Fitted to simply supported plates (π/12 to π/4 per cell: 0.11 to 0.12).
BENDING = 0.117
#: Relative error of the highest mode's frequency for which cells are chosen.
_ERROR = 0.04
#: Width of a cell times wave number of the highest mode: 0.58.
WAVE_CELL = math.sqrt(_ERROR / BENDING)
#: Width of a cell over the bending length: folds then hardly depend on the cells.
FOLD_CELL = 0.5
#: Largest number of cells: six unknowns each, a few seconds for an equilibrium.
MOST_CELLS = 2500
#: Least number of cells along the longer side.
FEWEST = 5


class SheetCells(NamedTuple):
    """Numbers of cells along both sides of a sheet."""

    chosen: tuple[int, int]
    """At most `MOST_CELLS` in all."""
    wanted: tuple[int, int]
    """As many as modes and folds need."""


def highest_wave_number(sides: tuple[float, float], modes: int) -> float:
    """Estimate the wave number [1/m] of the highest of the lowest modes of a sheet."""
    # Weyl's law for a sheet with free edges, area A and perimeter P: n = A k²/4π + P k/4π. H. Weyl,
    # "Das asymptotische Verteilungsgesetz der Eigenwerte", Math. Ann. 71 (1912) 441.
    area, perimeter = sides[0] * sides[1], 2 * (sides[0] + sides[1])
    return (math.sqrt(perimeter**2 + 16 * math.pi * modes * area) - perimeter) / (2 * area)


def choose_sheet_cells(
    sides: tuple[float, float],
    modes: int,
    bending_length: float | None = None,
    narrowest: float = 0.0,
) -> SheetCells:
    """Choose nearly square cells in which a sheet's figures hardly depend on the cells.

    Parameters
    ----------
    sides : tuple of float
        Sides of the rectangle [m].
    modes : int
        Number of modes that are wanted.
    bending_length : float, optional
        Smaller bending length of a sheet that hangs and may fold [m].
    narrowest : float, optional
        Least width of a cell [m].

    Returns
    -------
    SheetCells
        Numbers of cells along both sides.

    Examples
    --------
    >>> choose_sheet_cells((0.3, 0.3), modes=12).chosen
    (18, 18)
    >>> choose_sheet_cells((0.3, 0.3), modes=12, bending_length=0.02).chosen
    (30, 30)
    >>> choose_sheet_cells((2.0, 1.0), modes=12, bending_length=0.02)
    SheetCells(chosen=(70, 35), wanted=(200, 100))
    """
    width = min(WAVE_CELL / highest_wave_number(sides, modes), max(sides) / FEWEST)
    if bending_length is not None:
        width = min(width, FOLD_CELL * bending_length)
    width = max(width, narrowest)
    wanted = math.ceil(sides[0] / width - 1e-9), math.ceil(sides[1] / width - 1e-9)
    if math.prod(wanted) <= MOST_CELLS:
        return SheetCells(wanted, wanted)
    width = max(math.sqrt(sides[0] * sides[1] / MOST_CELLS), max(sides) / MOST_CELLS)
    first, second = (max(math.floor(side / width + 1e-9), 1) for side in sides)
    return SheetCells((first, second), wanted)
