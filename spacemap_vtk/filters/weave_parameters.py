"""Kinds of parameters that only a weave has."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, pattern_names
from spacemap_vtk.fabric.resolve import WARP_COLOR, WEFT_COLOR
from spacemap_vtk.fabric.threads import SECTIONS
from spacemap_vtk.fabric.yarn import linear_density, twist
from spacemap_vtk.parameters import Choice, Color, Integer, Parameter, Real, Series

_P = TypeVar("_P", bound=Parameter[Any])


class FamilyWords(NamedTuple):
    """Warp or weft, in the words of its parameters."""

    name: str
    yarns: str
    number: int
    crossed: int
    """Number of the other family."""
    color: tuple[int, int, int]


_WARP, _WEFT = (
    FamilyWords("warp", "ends", 1, 2, WARP_COLOR),
    FamilyWords("weft", "picks", 2, 1, WEFT_COLOR),
)


def both(declare: Callable[[FamilyWords], _P], group: str) -> tuple[_P, _P]:
    """Declare a parameter once for the warp and the weft."""
    made = declare(_WARP), declare(_WEFT)
    for each in made:
        each.group = group
    return made


class Pattern(Parameter[Any]):
    """A weave: its name, or a 0/1 matrix."""

    kind = "pattern"
    annotation = "str or sequence of rows"
    form = (
        pattern_names.GRAMMAR
        + ', or a row of 0 and 1 for each pick, as in ["110", "011", "101"] (1: end over pick)'
    )

    def convert(self, value: Any) -> Any:
        """Return a name in its usual spelling, or a tuple of strings of 0 and 1."""
        if isinstance(value, str):
            return pattern_names.canonical(value)
        if not isinstance(value, Iterable):
            raise InputError("not a weave")
        return tuple(draft.rows(draft.from_matrix(list(value))))

    def text(self, value: Any) -> str:
        """Return the name or the rows."""
        return f'"{value}"' if isinstance(value, str) else str(list(value))


class YarnCount(Real):
    """The linear density of a yarn, in any system of yarn counts."""

    def convert(self, value: Any) -> float:
        """Return kg/m."""
        return float(super().convert(linear_density(value) if isinstance(value, str) else value))

    @property
    def form(self) -> str:
        """The systems, with examples."""
        return (
            'a yarn count as "30 tex", "150 den", "40 Ne" or "20 Nm" (also "Ne 30/2"), or in kg/m, '
            + self.range
        )


class Twist(Real):
    """The twist of a yarn, in turns per metre."""

    def convert(self, value: Any) -> float:
        """Return turns per metre, above 0 for Z."""
        return float(super().convert(twist(value) if isinstance(value, str) else value))

    @property
    def form(self) -> str:
        """The ways to write it, with examples."""
        return (
            'turns in a length and their direction, as "600 Z" (per metre) or "15 /in S", at most '
            f"{self.maximum:g} per metre"
        )

    def text(self, value: Any) -> str:
        """Return turns per metre and their direction."""
        return f"{abs(value):.6g} {'S' if value < 0 else 'Z'}"


class PerYarn(Series):
    """One value for all yarns of a family, or a list of values that is repeated over them."""

    each = "repeated over the yarns"


def diameter_of(family: FamilyWords) -> PerYarn:
    """Declare how thick a family's yarns are."""
    return PerYarn(
        Real(
            "0.25 mm",
            f"Diameter d{family.number} of the {family.name} yarns; of flattened yarns, their "
            "height.",
            unit="m",
            above=0.0,
        ),
        automatic="from the yarn count, the draft's thickness, or half the spacing",
    )


def count_of(family: FamilyWords) -> PerYarn:
    """Declare how heavy a family's yarns are."""
    return PerYarn(
        YarnCount(
            "30 tex",
            f"Yarn count of the {family.name}, in place of its diameter.",
            unit="kg/m",
            above=0.0,
            maximum=1.0,
        ),
        automatic="from the diameter",
    )


def spacing_of(family: FamilyWords) -> PerYarn:
    """Declare how far a family's yarns are apart."""
    return PerYarn(
        Real(
            "0.5 mm",
            f"Distance p{family.number} between neighbouring {family.yarns}.",
            unit="m",
            above=0.0,
        ),
        automatic="from the sett, the draft's spacing, or 0.5 mm",
    )


def sett_of(family: FamilyWords) -> Real:
    """Declare how many of a family's yarns are in a length."""
    return Real(
        None,
        f"{family.yarns.capitalize()} in a length, in place of their spacing: "
        '"20 /cm" or "50 /in".',
        unit="1/m",
        above=0.0,
        automatic="from the spacing",
    )


def crimp_of(family: FamilyWords) -> Real:
    """Declare how much longer a family's yarns are than the cloth."""
    return Real(
        None,
        f"Crimp c{family.number} = l{family.number} / p{family.crossed} - 1 of the "
        f'{family.name} where it changes side, as 0.09 or "9 %".',
        minimum=0.0,
        automatic="from the crimp height",
    )


def section_of(family: FamilyWords) -> Choice:
    """Declare what section a family's yarns have."""
    return Choice(
        "circular",
        f"Section of the {family.name} yarns; a racetrack is a rectangle between two half circles.",
        SECTIONS,
    )


def aspect_of(family: FamilyWords) -> Real:
    """Declare how wide a family's yarns are for their height."""
    return Real(
        None,
        f"Width over height of the {family.name}'s section.",
        minimum=1.0,
        automatic="1 for circular yarns, 1.5 for others",
    )


def twist_of(family: FamilyWords) -> PerYarn:
    """Declare how a family's yarns are twisted."""
    return PerYarn(
        Twist(
            None,
            f"Twist of the {family.name}, of plied yarns that of their plies: turns in a length, Z "
            "above 0 and S below. It is seen, and enters no mechanics.",
            unit="1/m",
            minimum=-20_000,
            maximum=20_000,
        ),
        automatic="Z, so that outer fibres lean by 24 degrees; S of plied yarns",
    )


def plies_of(family: FamilyWords) -> PerYarn:
    """Declare how many singles are a family's yarns."""
    return PerYarn(
        Integer(
            None,
            f"Plies of the {family.name}: singles that are twisted together, in the section that "
            "the yarn has. They are seen, and enter no mechanics.",
            minimum=1,
            maximum=12,
        ),
        automatic="1: singles",
    )


def layer_of(family: FamilyWords) -> PerYarn:
    """Declare to which cloth of a double weave a family's yarns belong."""
    return PerYarn(
        Integer(
            None,
            f"Of a double weave, the cloth to which each of the {family.yarns} belongs: 1 and "
            "2 are repeated over them; 1 alone draws one layer.",
            minimum=1,
            maximum=2,
        ),
        automatic="found in the weave",
    )


def color_of(family: FamilyWords) -> PerYarn:
    """Declare what colours a family's yarns have."""
    return PerYarn(
        Color(family.color, f"Colour of the {family.name}."),
        automatic="the draft's, or #{:02x}{:02x}{:02x}".format(*family.color),
    )


def repeat_of(pattern: Any) -> NDArray[np.bool_]:
    """Return one repeat of a pattern."""
    return pattern_names.named(pattern) if isinstance(pattern, str) else draft.from_matrix(pattern)
