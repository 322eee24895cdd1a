"""Parameters of a kind that only ModalSolver has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.supports import ALLOWED, SIDES, parse
from spacemap_vtk.parameters import Parameter


class Supports(Parameter[tuple[str, ...]]):
    """Places that are held, as `spacemap_vtk.mechanics.supports` reads them."""

    kind = "supports"
    annotation = "str or sequence of str"
    form = ALLOWED

    def convert(self, value: Any) -> tuple[str, ...]:
        """Return the supports, each once and in canonical form, sides first."""
        texts = [value] if isinstance(value, str) else value
        if not isinstance(texts, Iterable) or not all(isinstance(t, str) for t in texts):
            raise InputError("neither a string nor a list of strings")
        found = dict.fromkeys(str(support) for text in texts for support in parse(text))
        rank = {side: number for number, side in enumerate(SIDES)}
        return tuple(sorted(found, key=lambda text: (rank.get(text[:2], len(rank)), text)))

    def text(self, value: tuple[str, ...]) -> str:
        """Return the supports as one string."""
        return f'"{" ".join(value)}"'
