"""What a source of yarns declares about its textile, so that no other part has to guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.partition import cloth_bounds
from spacemap_vtk.textile.geometry.weave import PatchCounts, estimate_bytes, estimate_counts
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.yarn import section_factor

if TYPE_CHECKING:
    from spacemap_vtk.textile.crimp.interchange import YarnMechanics


class FabricFigure(NamedTuple):
    """A figure of a textile, with its unit."""

    key: str
    """Its name in JSON and in tables."""
    label: str
    """Its label in tables and in the window."""
    value: float | None
    """In SI; None where it is not known."""
    unit: str = ""
    """A key of `spacemap_vtk.units.UNITS`, or "%" for a share."""


class StatedYarns:
    """Yarns whose stiffness is stated in their data (`spacemap_vtk.filters.textile_sheet`)."""


class Textile:
    """Base of source stages that make yarns: their patches have the cell array ``yarn``."""

    # A source inherits from `spacemap_vtk.filters.base.Stage` and from this class. It must declare
    # the diameters of its yarns, and overrides whatever else it knows. The rest stays None or
    # empty: tabs, figures and exports that need it are absent or refused with a message. Nothing
    # here may build the patches.

    @property
    def yarn_diameters(self) -> Floats:
        """Diameter of each yarn [m], (yarns,); of a flattened yarn, its height."""
        raise NotImplementedError(f"{type(self).__name__} must define yarn_diameters")

    @property
    def families(self) -> Mapping[str, int]:
        """Number of yarns in each family, by the family's name, in the order of the yarns."""
        return {"yarns": len(self.yarn_diameters)}

    @property
    def extent(self) -> Floats | None:
        """Size of the textile along x, y and z [m], (3,)."""
        return None

    @property
    def cell(self) -> Floats | None:
        """Two vectors after which the yarns repeat themselves [m], (2, 3)."""
        return None

    @property
    def linear_densities(self) -> Floats | None:
        """Mass per length of each yarn [kg/m], (yarns,)."""
        return None

    @property
    def mechanics(self) -> YarnMechanics | StatedYarns | None:
        """Stiffness of the yarns, unless a section [yarns] gives another one."""
        return None

    @property
    def figures(self) -> Sequence[FabricFigure]:
        """Other figures."""
        return ()

    @property
    def closed(self) -> bool:
        """Whether the surface of every yarn is closed, so that its inside is never seen."""
        return False

    @property
    def draft_file(self) -> Path | None:
        """File of the draft that the source reads."""
        return None

    def make_draft(self) -> Draft | None:
        """Return the draft for weaving the textile on a loom; None if it cannot be woven."""
        return None

    def estimate_patches(self) -> tuple[PatchCounts, int] | None:
        """Return upper limits of the patches, and the memory for them [bytes]; None if unknown."""
        return None

    def around_repeat(self) -> Any:
        """Return a stage that makes one repeat and its neighbours, for a unit cell.

        Raises
        ------
        InputError
            If the textile does not repeat itself along both axes.
        """
        raise InputError(
            "a unit cell needs a textile that repeats itself along both axes",
            cure="Choose a weave, a flat knit, leno, wire mesh or layers. Braids and tubes repeat "
            "themselves along one axis only.",
        )


class Woven(Textile):
    """A textile of warp and weft: it has a cloth with Peirce's figures and a draft."""

    # The patches of a large cloth are counted before they are built, and are built in parts.

    @property
    def cloth(self) -> Cloth:
        """Weave and dimensions of all yarns; reads the draft, builds nothing.

        Its yarns may not fit: `Cloth.check` refuses them.

        Raises
        ------
        InputError
            If the draft cannot be read, or parameters exclude each other.
        SizeError
            If the crossings alone do not fit into memory; `counts` checks the patches.
        """
        raise NotImplementedError(f"{type(self).__name__} must define cloth")

    @property
    def counts(self) -> PatchCounts:
        """Upper limits for the numbers of control points and patches; builds nothing.

        Raises
        ------
        GeometryError
            If the cloth is jammed or impossible.
        SpacemapError
            As for `cloth`.
        SizeError
            If the patches would not fit into memory.
        """
        raise NotImplementedError(f"{type(self).__name__} must define counts")

    @property
    def source(self) -> Draft:
        """Draft before any parameter changes it; of a pattern, one repeat.

        Raises
        ------
        InputError
            If the draft cannot be read.
        """
        raise NotImplementedError(f"{type(self).__name__} must define source")

    @property
    def fibre_share(self) -> float:
        """Share of fibre in a yarn's section; the rest is air."""
        raise NotImplementedError(f"{type(self).__name__} must define fibre_share")

    @property
    def feasible(self) -> Mapping[str, tuple[float, float]]:
        """Interval of feasible values for each parameter, while the others stay as they are.

        Low and high; infinite if there is no limit. A parameter that has no feasible value is left
        out. Reads the draft, builds nothing, and does not need the present values to be feasible.

        Raises
        ------
        SpacemapError
            As for `cloth`.
        """
        return {}

    @property
    def automatic_values(self) -> Mapping[str, float]:
        """Values of automatic parameters, by name, where one value holds for all yarns.

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
        """Whether control points are stored in single precision."""
        return False

    def estimate_patches(self) -> tuple[PatchCounts, int]:
        """Return upper limits of the patches, and the memory for them [bytes]."""
        return estimate_counts(self.cloth), estimate_bytes(self.cloth, self.single)

    def lend(self, other: Woven, part: YarnSelection | None = None) -> None:
        """Let another source of the same class and settings make all or part of this cloth.

        Parameters
        ----------
        other : Woven
            The source that then need not read and compute the cloth again.
        part : YarnSelection, optional
            Slices of the yarns whose crossings it makes; by default all.
        """
        raise NotImplementedError(f"{type(self).__name__} must define lend")

    @property
    def yarn_diameters(self) -> Floats:
        """Diameter of each yarn [m], (yarns,); of a flattened yarn, its height."""
        return np.concatenate([yarns.diameter for yarns in self.cloth.yarns])

    @property
    def families(self) -> dict[str, int]:
        """Number of ends and of picks."""
        return dict(zip(FAMILIES, self.cloth.size, strict=True))

    @property
    def extent(self) -> Floats:
        """Size of the cloth along x, y and z [m], (3,)."""
        return np.ptp(cloth_bounds(self.cloth).reshape(3, 2), axis=1)

    @property
    def linear_densities(self) -> Floats | None:
        """Mass per length of each yarn [kg/m], (yarns,)."""
        cloth = self.cloth
        if cloth.densities is None:
            return None
        masses = [
            density * section_factor(yarns.aspect, yarns.section) * yarns.diameter**2
            for density, yarns in zip(cloth.densities, cloth.yarns, strict=True)
        ]
        return np.concatenate(masses)
