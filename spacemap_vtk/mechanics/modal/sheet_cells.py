"""How many cells a sheet needs, so that its modes, folds and supports hardly depend on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
#: Cells across a support that ends within the sheet: frequencies of plates on a round support of
#: 30 to 120 mm in the middle of 300 mm are then wrong by 2 to 7 %.
ACROSS = 8
#: A support with fewer cells across than this in the narrowest cells acts as a point.
_POINT = 2
#: Width of a cell over the radius to which an obstacle bends the sheet. Legs of a strip that hangs
#: over a rod are then wrong by 1 to 5 % of their distance.
BEND_CELL = 0.25
#: Largest number of cells: six unknowns each, a few seconds for an equilibrium.
MOST_CELLS = 2500
#: Rounding of a number of cells.
_ROUNDING = 1e-5
#: Least number of cells along the longer side.
FEWEST = 5


class SheetCells(NamedTuple):
    """Numbers of cells along both sides of a sheet."""

    chosen: tuple[int, int]
    """At most `MOST_CELLS` in all."""
    wanted: tuple[int, int]
    """As many as modes, folds, supports and obstacles need."""


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
    supports: Sequence[Sequence[tuple[float, float]]] = ((), ()),
    radii: Sequence[float] = (),
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
    supports : sequence of 2 sequences of tuple of float, optional
        Begin and end of each support along both sides, as shares of the side.
    radii : sequence of float, optional
        Radii of curvature of obstacles [m].

    Returns
    -------
    SheetCells
        Numbers of cells along both sides.

    Notes
    -----
    Over an obstacle of radius R a sheet bends to that radius, but not to a smaller one than that to
    which its weight pulls it, √(D/T) = c √(c/ℓ) under the tension T = w ℓ of its half length.

    Examples
    --------
    >>> choose_sheet_cells((0.3, 0.3), modes=12).chosen
    (18, 18)
    >>> choose_sheet_cells((0.3, 0.3), modes=12, bending_length=0.02).chosen
    (30, 30)
    >>> choose_sheet_cells((2.0, 1.0), modes=12, bending_length=0.02)
    SheetCells(chosen=(70, 35), wanted=(200, 100))
    >>> choose_sheet_cells((0.3, 0.3), modes=12, supports=([(0.4, 0.6)], [])).chosen
    (40, 40)
    """
    width = min(WAVE_CELL / highest_wave_number(sides, modes), max(sides) / FEWEST)
    if bending_length is not None:
        width = min(width, FOLD_CELL * bending_length)
        sharpest = bending_length * math.sqrt(2 * bending_length / max(sides))
        radii = [max(radius, sharpest) for radius in radii]
    limit = max(math.sqrt(sides[0] * sides[1] / MOST_CELLS), narrowest)
    sizes = [
        (last - first) * side
        for side, spans in zip(sides, supports, strict=True)
        for first, last in spans
        if first > 0.0 or last < 1.0
    ]
    needed = [size / ACROSS for size in sizes if size > _POINT * limit]
    needed += [BEND_CELL * radius for radius in radii]
    width = min([width, *needed])
    width = max(width, narrowest)
    first, second = (math.ceil(side / width - _ROUNDING) for side in sides)
    wanted = first, second
    if math.prod(wanted) <= MOST_CELLS:
        found = _hold_supports(wanted, supports)
        return SheetCells(found, found)
    width = max(limit, max(sides) / MOST_CELLS)
    first, second = (max(math.floor(side / width + _ROUNDING), 1) for side in sides)
    return SheetCells(_hold_supports((first, second), supports), wanted)


def _hold_supports(
    counts: tuple[int, int], supports: Sequence[Sequence[tuple[float, float]]]
) -> tuple[int, int]:
    """Change numbers of cells a little, so that each support has a vertex in it."""
    found = list(counts)
    for axis, spans in enumerate(supports):
        count, other = counts[axis], found[1 - axis]
        nearest = sorted(range(1, 2 * count + 1), key=lambda n: (abs(n - count), -n))
        fitting = (
            n
            for n in nearest
            if n * other <= MOST_CELLS
            and all(math.ceil(a * n - _ROUNDING) <= b * n + _ROUNDING for a, b in spans)
        )
        found[axis] = next(fitting, count)
    return found[0], found[1]
