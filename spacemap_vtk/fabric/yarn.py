"""Yarn counts: from the ways in which yarns are sold to linear density and diameter.

Direct systems say how heavy a length of yarn is (tex: g in 1000 m, denier: g in 9000 m), indirect
ones how long a weight of it is (Nm: 1000 m in a kg, Ne: hanks of 840 yards in a pound).

Source: W. E. Morton, J. W. S. Hearle, "Physical Properties of Textile Fibres", 4th ed. (2008),
appendix of units, and table 5.1 for the density of cotton.
"""

from __future__ import annotations

import re
from math import pi
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.units import parse_quantity

OneOrMany = TypeVar("OneOrMany", float, NDArray[np.float64])

#: Density of cotton fibres at 65 % relative humidity, in kg/m3 (Morton and Hearle, table 5.1).
COTTON = 1520.0
#: Share of fibre in a yarn's section, for common spun yarns.
PACKING = 0.6
#: kg/m of a yarn with 840 yards (0.9144 m each) to the pound, and with 1000 m to the kg.
_INDIRECT = {"ne": 0.45359237 / (840 * 0.9144), "nec": 0.45359237 / (840 * 0.9144), "nm": 1e-3}

_NUMBER = r"(\d+(?:\.\d+)?)(?:\s*/\s*(\d+))?"
_WORD = "|".join(_INDIRECT)
_COUNT = re.compile(rf"\s*(?:({_WORD})\s*{_NUMBER}|{_NUMBER}\s*({_WORD}))\s*", re.IGNORECASE)


def linear_density(text: str) -> float:
    """Read a yarn count.

    Parameters
    ----------
    text : str
        ``"30 tex"``, ``"150 den"`` or ``"300 dtex"``; ``"40 Ne"`` or ``"20 Nm"``, also before the
        number. Of two numbers, as in ``"Ne 30/2"`` and ``"2/60 Nm"``, the larger is the count of
        the single yarn and the smaller how many are twisted together. A bare number is kg/m.

    Returns
    -------
    float
        Mass of a length of yarn, in kg/m: 1 tex is 1e-6.

    Raises
    ------
    InputError
        If the text is no count.

    Examples
    --------
    >>> round(linear_density("20 Ne") * 1e6, 2)
    29.53
    >>> linear_density("Nm 60/2") == linear_density("Nm 30")
    True
    """
    match = _COUNT.fullmatch(text)
    if match is None:
        return parse_quantity(text, "kg/m")
    before, *found, after = match.groups()
    numbers = [float(number) for number in found if number]
    if min(numbers) <= 0.0:
        raise InputError("a yarn count of 0")
    size = _INDIRECT[(before or after).lower()]
    return size / max(numbers) * (min(numbers) if numbers[1:] else 1.0)


def section_area(count: OneOrMany, density: float = COTTON, packing: float = PACKING) -> OneOrMany:
    """Return the area of a yarn's section, the air between its fibres included."""
    return count / (packing * density)


def yarn_height(area: OneOrMany, aspect: float = 1.0, section: str = "circular") -> OneOrMany:
    """Return how high a yarn is whose section has a given area: the diameter of a round one."""
    return (area / section_factor(aspect, section)) ** 0.5


def section_factor(aspect: float, section: str) -> float:
    """Return the area of a section over the square of its height.

    Parameters
    ----------
    aspect : float
        Width over height.
    section : {"circular", "racetrack", "elliptic"}
        Its shape.

    Returns
    -------
    float
        pi/4 for a circle.

    Examples
    --------
    >>> section_factor(1.0, "racetrack") == section_factor(1.0, "circular")
    True
    """
    return pi / 4 * aspect if section == "elliptic" else pi / 4 + (aspect - 1.0)
