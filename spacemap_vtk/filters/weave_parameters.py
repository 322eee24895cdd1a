"""Kinds of parameters that only a weave has."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, pattern_names
from spacemap_vtk.fabric.resolve import WARP_COLOR, WEFT_COLOR
from spacemap_vtk.fabric.yarn import linear_density, twist
from spacemap_vtk.parameters import Color, Integer, Parameter, Real, Series

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


def both(declare: Callable[[FamilyWords], _P]) -> tuple[_P, _P]:
    """Declare a parameter once for the warp and the weft."""
    return declare(_WARP), declare(_WEFT)


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
        return 'turns in a length and their direction, as "600 Z" (per metre) or "15 /in S"'


class PerYarn(Series):
    """One value for all yarns of a family, or a list of values that is repeated over them."""

    each = "repeated over the yarns"


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
