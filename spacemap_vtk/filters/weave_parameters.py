"""Kinds of parameters that only a weave has."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError, shown
from spacemap_vtk.fabric import draft, pattern_names
from spacemap_vtk.fabric.resolve import WARP_COLOR, WEFT_COLOR
from spacemap_vtk.fabric.yarn import linear_density
from spacemap_vtk.parameters import Color, Parameter, Real

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


class PerYarn(Parameter[Any]):
    """One value for all yarns of a family, or a list of values that is repeated over them."""

    # Surfaces that show text may show and take a list with commas: ``"0.3 mm, 0.2 mm"``.

    kind = "series"

    def __init__(self, component: Parameter[Any], *, automatic: str) -> None:
        super().__init__(None, component.help, unit=component.unit, automatic=automatic)
        self.component = component
        self.annotation = f"{component.annotation}, or a list of such"

    def __set_name__(self, owner: type, name: str) -> None:
        self.component.__set_name__(owner, name)
        super().__set_name__(owner, name)

    def convert(self, value: Any) -> Any:
        """Return a checked value, or a tuple of several."""
        if isinstance(value, str) and "," in value:
            value = [item.strip() for item in value.split(",")]
        try:
            return self.component.convert(value)
        except InputError:
            # a list of one value is none; three numbers are one colour
            if isinstance(value, str) or not isinstance(value, Iterable):
                raise
        items = []
        for number, item in enumerate(value, start=1):
            try:
                items.append(self.component.convert(item))
            except InputError as error:
                what = f"value {number}, {shown(item)}: {error.message}"
                raise InputError(what, cure=error.cure) from None
        if not items:
            raise InputError("an empty list")
        return items[0] if len(set(items)) == 1 else tuple(items)

    @property
    def form(self) -> str:
        """What each value may be."""
        return f"{self.component.form}; or a list of such, repeated over the yarns"

    def text(self, value: Any) -> str:
        """Return the value, or the list with commas."""
        several = self.several(value)
        return ", ".join(self.component.show(item) for item in several or (value,))

    def several(self, value: Any) -> tuple[Any, ...] | None:
        """Tell a list from a single value."""
        # a colour is a tuple itself
        is_list = isinstance(value, tuple) and not (
            isinstance(self.component, Color) and isinstance(value[0], int)
        )
        return value if is_list else None


def repeat_of(pattern: Any) -> NDArray[np.bool_]:
    """Return one repeat of a pattern."""
    return pattern_names.named(pattern) if isinstance(pattern, str) else draft.from_matrix(pattern)
