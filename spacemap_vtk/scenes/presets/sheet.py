"""The sheet of cloth from which a preset takes its lengths.

All lengths follow from the bending length c of the cloth (Peirce), the cube root of its bending
rigidity over its weight per area: it decides how wide folds are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.units import GRAVITY, format_quantity

#: Width of a cell over the bending length: sufficient for pictures, within seconds.
CELL = 0.7
#: Most cells; more take minutes.
MOST_CELLS = 1300
#: Fewest cells along the longer side, unless these are narrower than the cloth is thick.
_FEWEST_CELLS = 12
#: Density of air [kg/m3] times the drag coefficient of a square plate across the wind.
_AIR = 1.2 * 1.17
#: Damping ratio of a vibration at the rate (g/c)^½, assumed: yarns rub on each other as they bend.
_FRICTION_OF_YARNS = 0.15


class Sheet(NamedTuple):
    """The cloth for which a preset chooses lengths."""

    low: Floats
    """Least coordinates [m], (3,)."""
    high: Floats
    """Largest coordinates [m], (3,)."""
    bending_length: float
    """Mean of both directions [m]."""
    weight: float
    """Weight per area [N/m2]."""

    @property
    def sides(self) -> Floats:
        """Sides along x and y [m]."""
        return (self.high - self.low)[:2]

    @property
    def thickness(self) -> float:
        """Thickness [m]."""
        return float(self.high[2] - self.low[2])

    @property
    def drag(self) -> float:
        """Rate α of a drag at which the level cloth falls as fast in the end as in air [1/s]."""
        # It balances the weight w at the speed (2 w/(ρ c_D))^½.
        return GRAVITY * math.sqrt(_AIR / (2.0 * self.weight))

    @property
    def damping(self) -> float:
        """Time β by which strain rates are resisted [s]."""
        return 2.0 * _FRICTION_OF_YARNS * math.sqrt(self.bending_length / GRAVITY)

    def cells(self, most: int = MOST_CELLS, share: float = CELL, multiple: int = 1) -> list[int]:
        """Return numbers of cells along x, y and z; those along x and y are a multiple."""
        width = min(share * self.bending_length, float(self.sides.max()) / _FEWEST_CELLS)
        finest = math.sqrt(float(self.sides.prod()) / most)
        thickest = 1.05 * self.thickness
        width, least = max(width, thickest, finest), max(2, multiple)
        counts = np.rint(self.sides / (multiple * width)), self.sides // (multiple * thickest)
        return [max(least, multiple * int(n)) for n in np.minimum(*counts)] + [1]


def rounded(value: float, unit: str) -> str:
    """Format a value with three digits and its unit."""
    return format_quantity(value, unit, 3)
