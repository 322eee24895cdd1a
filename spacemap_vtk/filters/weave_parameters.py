"""Kinds of parameters that only a weave has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, pattern_names
from spacemap_vtk.parameters import Parameter


class Pattern(Parameter[Any]):
    """A weave: its name, or a 0/1 matrix."""

    kind = "pattern"
    annotation = "str or sequence of rows"
    allowed = (
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

    def show(self, value: Any) -> str:
        """Return the name or the rows."""
        return f'"{value}"' if isinstance(value, str) else str(list(value))


def repeat_of(pattern: Any) -> NDArray[np.bool_]:
    """Return one repeat of a pattern.

    Parameters
    ----------
    pattern : str or tuple of str
        A value that `Pattern` has checked.

    Returns
    -------
    (picks, ends) bool
        Its drawdown.
    """
    return pattern_names.named(pattern) if isinstance(pattern, str) else draft.from_matrix(pattern)
