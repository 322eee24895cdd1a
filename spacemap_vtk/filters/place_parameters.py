"""Parameters that name places of a cage: supports, rigid pieces, springs, masses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.fittings import MASSES, SPRINGS
from spacemap_vtk.mechanics.places import ALLOWED, SIDES, Region, parse
from spacemap_vtk.mechanics.supports import BODY
from spacemap_vtk.parameters import Parameter

_SEVERAL = '; as one string or a list; or "" for none'
_HELD = (
    'each with ":" and the components {} where not all are, as in "-x:yz", or a direction, as in '
    '"-x:(0, 1, 1)"'
)


class Places(Parameter[tuple[str, ...]]):
    """Places, as `spacemap_vtk.mechanics.places` reads them."""

    kind = "places"
    annotation = "str or sequence of str"

    #: What each place is, the units of its quantity, and whether it has all components.
    what: str = "support"
    units: Sequence[str] = ()
    whole = False

    def read(self, text: str) -> list[Region]:
        """Return the places in a text."""
        return parse(text, self.units, what=self.what, whole=self.whole)

    def convert(self, value: Any) -> tuple[str, ...]:
        """Return the places, each once and in canonical form, sides first."""
        texts = [value] if isinstance(value, str) else value
        if not isinstance(texts, Iterable) or not all(isinstance(t, str) for t in texts):
            raise InputError("neither a string nor a list of strings")
        found = dict.fromkeys(str(place) for text in texts for place in self.read(text))
        rank = {side: number for number, side in enumerate(SIDES)}
        return tuple(sorted(found, key=lambda text: (rank.get(text[:2], len(rank)), text)))

    def text(self, value: tuple[str, ...]) -> str:
        """Return the places as one string."""
        return f'"{" ".join(value)}"'


class Supports(Places):
    """Places that are held."""

    kind = "supports"
    form = f"{ALLOWED}, {_HELD.format('held')}{_SEVERAL}"


class RigidPlaces(Places):
    """Places that move as one rigid piece each."""

    what, whole = BODY, True
    form = ALLOWED + _SEVERAL


class Springs(Places):
    """Places with a stiffness."""

    what, units = "spring", SPRINGS
    form = (
        f"{ALLOWED}, {_HELD.format('that it acts along')}, and a stiffness in N/m or, of a side, "
        f'N/m3, as in "-z:z 1e5 N/m3"{_SEVERAL}'
    )


class Masses(Places):
    """Places with a mass."""

    what, units, whole = "mass", MASSES, True
    form = f'{ALLOWED}, each with a mass, as in "sphere(0, 0, 0, 1 mm) 5 g"{_SEVERAL}'
