"""Yarn counts and twist: parse how yarns are sold, and compute linear density and diameter.

Direct systems give the mass of a length of yarn (tex: g in 1000 m, denier: g in 9000 m). Indirect
systems give the length of a mass (Nm: 1000 m in a kg, Ne: hanks of 840 yards in a pound; a hank of
worsted has 560 yards, a lea of linen 300, a run of woollen yarn 1600).

Sources: W. E. Morton, J. W. S. Hearle, "Physical Properties of Textile Fibres", 4th ed. (2008),
appendix of units, and table 5.1 for the density of cotton; T. Woodhouse, "Yarn Counts and
Calculations" (1921), for the counts of worsted, linen and woollen yarns.
"""

from __future__ import annotations

import re
from math import pi, radians, tan
from typing import TypeVar

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.weave.lens import lens_area
from spacemap_vtk.units import parse_quantity

OneOrMany = TypeVar("OneOrMany", float, Floats)

#: Density of cotton fibres at 65 % relative humidity, in kg/m3 (Morton and Hearle, table 5.1).
COTTON = 1520.0
#: Share of fibre in the section of common spun yarns.
PACKING = 0.6
#: Mass of a pound over the length of a yard, in kg/m.
_POUND_PER_YARD = 0.45359237 / 0.9144
#: Linear density in kg/m of count 1 of the indirect systems.
_INDIRECT = {
    "ne": _POUND_PER_YARD / 840,
    "nec": _POUND_PER_YARD / 840,
    "nek": _POUND_PER_YARD / 560,
    "nel": _POUND_PER_YARD / 300,
    "run": _POUND_PER_YARD / 1600,
    "nm": 1e-3,
}
#: Angle between the outer fibres of a spun yarn and its axis: 30 tex cotton has it at a usual twist
#: factor of 3800 turns/m sqrt(tex).
_USUAL_ANGLE = radians(24.0)

_NUMBER = r"(\d+(?:\.\d+)?)(?:\s*/\s*(\d+))?"
_WORD = "|".join(_INDIRECT)
_TWIST = re.compile(r"\s*([SZsz](?=[\s\d.]))?\s*(.*?\d.*?)\s*(?<![A-Za-z])([SZsz])?\s*")
_COUNT = re.compile(rf"\s*(?:({_WORD})\s*{_NUMBER}|{_NUMBER}\s*({_WORD}))\s*", re.IGNORECASE)
#: A count and its plies, without a system.
_PLIED = re.compile(r"\s*(\d+(?:\.\d+)?)\s*/\s*(\d+)\s*")


def parse_yarn_count(text: str) -> float:
    """Parse a yarn count.

    Parameters
    ----------
    text : str
        ``"30 tex"``, ``"150 den"`` or ``"300 dtex"``; ``"40 Ne"`` (cotton), ``"20 Nm"``,
        ``"18 NeK"`` (worsted), ``"16 NeL"`` (linen) or ``"5 run"`` (woollen), also with the system
        first. Of two numbers, as in ``"Ne 30/2"`` and ``"2/60 Nm"``, the larger is the count of the
        single yarn and the smaller the number of plies. ``"20/2"`` without a system is a cotton
        count, ``"Ne 20/2"``, as handweavers write it. A single number is in kg/m.

    Returns
    -------
    float
        Mass per length, in kg/m: 1 tex is 1e-6.

    Raises
    ------
    InputError
        The text is not a yarn count.

    Examples
    --------
    >>> round(parse_yarn_count("20 Ne") * 1e6, 2)
    29.53
    >>> parse_yarn_count("Nm 60/2") == parse_yarn_count("Nm 30")
    True
    >>> parse_yarn_count("20/2") == parse_yarn_count("Ne 10")
    True
    """
    if (plied := _PLIED.fullmatch(text)) and float(plied[1]) < float(plied[2]):
        # Worsted spinners write the plies first, and count other hanks.
        raise InputError(
            "in a cotton count the plies come after the count",
            cure=f'Name the system: "Nm {plied[2]}/{plied[1]}" or "Ne {plied[2]}/{plied[1]}".',
        )
    match = _COUNT.fullmatch(f"Ne {text}" if plied else text)
    if match is None:
        return parse_quantity(text, "kg/m")
    before, *found, after = match.groups()
    numbers = [float(number) for number in found if number]
    if min(numbers) <= 0.0:
        raise InputError("the yarn count must be more than 0")
    size = _INDIRECT[(before or after).lower()]
    return size / max(numbers) * (min(numbers) if numbers[1:] else 1.0)


def yarn_height(area: OneOrMany, aspect: float = 1.0, section: str = "circular") -> OneOrMany:
    """Compute the height of a yarn from the area of its section: the diameter of a round one."""
    return (area / section_factor(aspect, section)) ** 0.5


def section_factor(aspect: float, section: str) -> float:
    """Compute the area of a section over the square of its height.

    Parameters
    ----------
    aspect : float
        Width over height.
    section : {"circular", "racetrack", "elliptic", "lenticular"}
        Shape of the section.

    Returns
    -------
    float
        pi/4 for a circle.

    Examples
    --------
    >>> section_factor(1.0, "racetrack") == section_factor(1.0, "circular")
    True
    """
    if section == "lenticular":
        return lens_area(aspect)
    return pi / 4 * aspect if section == "elliptic" else pi / 4 + (aspect - 1.0)


def parse_twist(text: str) -> float:
    """Parse a twist.

    Parameters
    ----------
    text : str
        ``"600 Z"``, ``"S 450"`` or ``"15 /in Z"``; without a unit in turns per metre. A number
        without a letter is positive for Z and negative for S. (ISO 2:1973: in an upright yarn,
        the fibres in front lean like the middle stroke of the letter; Z is a right-handed screw.)

    Returns
    -------
    float
        Turns per metre.

    Raises
    ------
    InputError
        The text is not a twist.

    Examples
    --------
    >>> parse_twist("S 600"), parse_twist("-600"), round(parse_twist("20 /in Z"))
    (-600.0, -600.0, 787)
    """
    match = _TWIST.fullmatch(text)
    if match is None:
        return parse_quantity(text, "1/m")
    before, number, after = match.groups()
    turns, letter = parse_quantity(number, "1/m"), (before or after or "").upper()
    if (before and after) or (letter and turns < 0.0):
        raise InputError("the direction of the twist is given twice")
    return -turns if letter == "S" else turns


def usual_twist(diameter: Floats, plies: Floats) -> Floats:
    """Return the default turns per metre: Z for singles, S (against them) for plied yarns."""
    # J. W. S. Hearle, P. Grosberg and S. Backer (1969): fibres at the surface of a yarn are
    # inclined by tan(angle) = pi d T.
    return np.where(plies > 1, -1.0, 1.0) * tan(_USUAL_ANGLE) / (pi * diameter)
