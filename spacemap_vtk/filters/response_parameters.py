"""Parameters that only ModalResponse has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Parameter, Real

_FREQUENCY = Real(1.0, "", unit="1/s", above=0.0)
_RATIO = Real(0.0, "", minimum=0.0)


class DampingPairs(Parameter[Any]):
    """Two pairs of frequency and damping ratio."""

    kind = "pairs"
    annotation = "sequence of 2 pairs of float"
    form = 'two pairs of frequency and ratio, as in [["10 Hz", 0.02], ["80 Hz", 0.03]]'

    def convert(self, value: Any) -> tuple[tuple[float, float], ...]:
        """Return two pairs of floats, the lower frequency first."""
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise InputError("not a list of pairs")
        pairs = []
        for pair in value:
            numbers = tuple(pair) if isinstance(pair, Iterable) else ()
            if isinstance(pair, str) or len(numbers) != 2:
                raise InputError("not a list of pairs")
            frequency, ratio = numbers
            pairs.append((_FREQUENCY.convert(frequency), _RATIO.convert(ratio)))
        if len(pairs) != 2:
            raise InputError(f"{len(pairs)} pairs in place of 2")
        return tuple(sorted(pairs))

    def text(self, value: Any) -> str:
        """Return TOML's spelling."""
        return str([list(pair) for pair in value])
