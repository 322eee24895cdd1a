"""What a source of yarns says of itself, so that no other part has to guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.ndarrays import Floats


class Measure(NamedTuple):
    """A figure of a textile."""

    key: str
    """Its name in JSON and in tables."""
    label: str
    """Its label in tables and in the window."""
    value: float | None
    """In SI; None where it is not known."""
    unit: str = ""
    """A key of `spacemap_vtk.units.UNITS`."""


class Textile:
    """A source stage that makes yarns: its patches have the cell array ``yarn``."""

    # A source inherits from `spacemap_vtk.filters.base.Stage` and from this class. It has to state
    # the diameters of its yarns, and overrides what else it knows. What it does not know stays None
    # or empty: tabs, figures and exports that need it are then absent, or refused in one sentence.

    @property
    def yarn_diameters(self) -> Floats:
        """The diameter of each yarn, of a flattened one its height [m], (yarns,)."""
        raise NotImplementedError(f"{type(self).__name__} does not state its yarns' diameters")

    @property
    def families(self) -> Mapping[str, int]:
        """The number of yarns in each family, by its name, in the order of their numbers."""
        return {"yarns": len(self.yarn_diameters)}

    @property
    def measures(self) -> Sequence[Measure]:
        """Its own figures."""
        return ()

    @property
    def closed(self) -> bool:
        """Whether the surface of every yarn is closed, so that nobody sees its inside."""
        return False

    @property
    def wif(self) -> Draft | None:
        """The draft by which it is woven; None where no loom makes it."""
        return None
