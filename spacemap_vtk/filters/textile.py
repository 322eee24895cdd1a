"""What a source of yarns says of itself, so that no other part has to guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.geometry.axes import Share
from spacemap_vtk.textile.geometry.partition import whole_bounds
from spacemap_vtk.textile.geometry.weave import Counts
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.yarn import section_factor


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
    # Nothing here may build the patches.

    @property
    def yarn_diameters(self) -> Floats:
        """Diameter of each yarn, of a flattened one its height [m], (yarns,)."""
        raise NotImplementedError(f"{type(self).__name__} does not state its yarns' diameters")

    @property
    def families(self) -> Mapping[str, int]:
        """Number of yarns in each family by the family's name, in the order of the yarns."""
        return {"yarns": len(self.yarn_diameters)}

    @property
    def extent(self) -> Floats | None:
        """Length of the textile along x, y and z [m], (3,)."""
        return None

    @property
    def linear_densities(self) -> Floats | None:
        """Mass of each yarn per length [kg/m], (yarns,)."""
        return None

    @property
    def measures(self) -> Sequence[Measure]:
        """Other figures."""
        return ()

    @property
    def closed(self) -> bool:
        """Whether the surface of every yarn is closed, so that nobody sees its inside."""
        return False

    @property
    def draft_file(self) -> Path | None:
        """File of the draft that the source reads."""
        return None

    def make_draft(self) -> Draft | None:
        """Return the draft by which a loom makes the textile; None where no loom does."""
        return None


class Woven(Textile):
    """A textile of warp and weft: it has a cloth with Peirce's figures, and a draft."""

    # What is drawn of a large cloth is counted before it is built, and built in parts.

    @property
    def cloth(self) -> Cloth:
        """Weave and measures of all yarns; reads the draft, builds nothing.

        There may be no room for its yarns: `Cloth.check` refuses that.

        Raises
        ------
        InputError
            If the draft cannot be read, or parameters exclude each other.
        SizeError
            If not even the crossings would fit into memory; `counts` looks after the patches.
        """
        raise NotImplementedError(f"{type(self).__name__} does not state its cloth")

    @property
    def counts(self) -> Counts:
        """Number of control points and patches, at most; builds nothing.

        Raises
        ------
        GeometryError
            If the cloth is jammed or impossible.
        SpacemapError
            As for `cloth`.
        SizeError
            If the patches would not fit into memory.
        """
        raise NotImplementedError(f"{type(self).__name__} does not count its patches")

    @property
    def source(self) -> Draft:
        """Draft that it weaves, before any parameter changes it; of a pattern one repeat.

        Raises
        ------
        InputError
            If the draft cannot be read.
        """
        raise NotImplementedError(f"{type(self).__name__} does not state what it weaves")

    @property
    def fibre_share(self) -> float:
        """Share of fibre in a yarn's section; the rest is air."""
        raise NotImplementedError(f"{type(self).__name__} does not state its share of fibre")

    @property
    def feasible(self) -> Mapping[str, tuple[float, float]]:
        """Interval in which each parameter may lie, all the others as they are.

        Low and high, infinite where there is no bound; a parameter that has no feasible value is
        left out. Reads the draft, builds nothing, and does not need the present values to be
        feasible.

        Raises
        ------
        SpacemapError
            As for `cloth`.
        """
        return {}

    @property
    def found(self) -> Mapping[str, float]:
        """What automatic parameters are resolved to, by name, where it is one value for all yarns.

        Raises
        ------
        GeometryError
            If the cloth is jammed or impossible.
        SpacemapError
            As for `cloth`.
        """
        return {}

    @property
    def single(self) -> bool:
        """Whether control points are in single precision."""
        return False

    def lend(self, other: Woven, part: Share | None = None) -> None:
        """Let another source of the same class and settings make a part of the cloth, or all.

        Parameters
        ----------
        other : Woven
            Need not read and measure the cloth anew.
        part : Share, optional
            Slices: the yarns to make, where they cross; by default all.
        """
        raise NotImplementedError(f"{type(self).__name__} does not make parts of its cloth")

    @property
    def yarn_diameters(self) -> Floats:
        """Diameter of each yarn, of a flattened one its height [m], (yarns,)."""
        return np.concatenate([yarns.diameter for yarns in self.cloth.yarns])

    @property
    def families(self) -> dict[str, int]:
        """Number of ends, and of picks."""
        return dict(zip(FAMILIES, self.cloth.size, strict=True))

    @property
    def extent(self) -> Floats:
        """Length of the cloth along x, y and z [m], (3,)."""
        return np.ptp(whole_bounds(self.cloth).reshape(3, 2), axis=1)

    @property
    def linear_densities(self) -> Floats | None:
        """Mass of each yarn per length [kg/m], (yarns,)."""
        cloth = self.cloth
        if cloth.density is None:
            return None
        areas = [section_factor(y.aspect, y.section) * y.diameter**2 for y in cloth.yarns]
        return cloth.density * np.concatenate(areas)
