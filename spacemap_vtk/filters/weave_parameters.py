"""Kinds of parameters that only a weave has."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, pattern_names
from spacemap_vtk.fabric.resolve import WARP_COLOR, WEFT_COLOR
from spacemap_vtk.fabric.yarn import linear_density
from spacemap_vtk.parameters import Parameter, Real, Series

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


class PerYarn(Series):
    """One value for all yarns of a family, or a list of values that is repeated over them."""

    each = "repeated over the yarns"


def repeat_of(pattern: Any) -> NDArray[np.bool_]:
    """Return one repeat of a pattern."""
    return pattern_names.named(pattern) if isinstance(pattern, str) else draft.from_matrix(pattern)
