"""What a user may ask of a fabric, and which of it cannot be asked together."""

from __future__ import annotations

from dataclasses import dataclass

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.yarn import COTTON, PACKING

#: One value for a family, or several that are repeated over its yarns.
Lengths = float | tuple[float, ...]
Rgb = tuple[int, int, int]

#: Wishes that say the same thing in different ways.
_EITHER_OR = (
    ("warp_diameter", "warp_count"),
    ("weft_diameter", "weft_count"),
    ("warp_spacing", "warp_sett"),
    ("weft_spacing", "weft_sett"),
    ("warp_crimp_height", "warp_crimp", "weft_crimp"),
)


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """A user's wishes for a fabric; None leaves it to the draft, or to a default.

    Parameters
    ----------
    ends, picks : int, optional
        Size of the cloth in yarns, the draft repeated or cut; by default the draft's own.
    warp_diameter, weft_diameter : float or tuple of float, optional
        Height of the yarns' sections, in m. By default what the count gives, else the draft's
        thickness, else `spacemap_vtk.fabric.settle.FILLING` of the spacing.
    warp_count, weft_count : float or tuple of float, optional
        Linear density of the yarns, in kg/m.
    fibre_density : float
        In kg/m3.
    packing : float
        Share of fibre in a yarn's section.
    warp_spacing, weft_spacing : float or tuple of float, optional
        In m; several: one gap after the other. By default what the sett gives, else the draft's,
        else `spacemap_vtk.fabric.settle.SPACING`.
    warp_sett, weft_sett : float, optional
        Yarns in a metre.
    warp_crimp_height : float, optional
        In m. By default what a crimp gives, else the middle of the feasible interval.
    warp_crimp, weft_crimp : float, optional
        Crimp c = l / p - 1 of a family, where its yarns change side.
    warp_section, weft_section : {"circular", "racetrack", "elliptic"}
        Section of the yarns.
    warp_aspect, weft_aspect : float, optional
        Width over height of the section. By default 1 for round yarns, else
        `spacemap_vtk.fabric.settle.ASPECT`.
    thick_yarns : {"scale", "flatten", "refuse"}
        What is done with a draft's yarns that are too thick to interlace.
    overhang : float, optional
        In m; how far yarns reach past their last crossing. By default half the spacing crossed.
    caps : bool
        Whether cut ends are closed.
    exact : bool
        Whether round yarns and arcs are exact to rounding.
    axis : {"arcs", "spline"}
        Shape of a yarn's axis.
    warp_color, weft_color : tuple, optional
        Red, green, blue from 0 to 255, or several of these, repeated over the yarns. By default
        the draft's, else a colour for each family.

    Raises
    ------
    InputError
        Wishes that exclude each other.
    """

    ends: int | None = None
    picks: int | None = None
    warp_diameter: Lengths | None = None
    weft_diameter: Lengths | None = None
    warp_count: Lengths | None = None
    weft_count: Lengths | None = None
    fibre_density: float = COTTON
    packing: float = PACKING
    warp_spacing: Lengths | None = None
    weft_spacing: Lengths | None = None
    warp_sett: float | None = None
    weft_sett: float | None = None
    warp_crimp_height: float | None = None
    warp_crimp: float | None = None
    weft_crimp: float | None = None
    warp_section: str = "circular"
    weft_section: str = "circular"
    warp_aspect: float | None = None
    weft_aspect: float | None = None
    thick_yarns: str = "scale"
    overhang: float | None = None
    caps: bool = True
    exact: bool = False
    axis: str = "arcs"
    warp_color: Rgb | tuple[Rgb, ...] | None = None
    weft_color: Rgb | tuple[Rgb, ...] | None = None

    def __post_init__(self) -> None:
        for keys in _EITHER_OR:
            given = [key for key in keys if getattr(self, key) is not None]
            if given[1:]:
                raise InputError(
                    f"{' and '.join(given)} are given, and each follows from the others",
                    key=given[1],
                    value=getattr(self, given[1]),
                    allowed=f"one of {', '.join(keys)}",
                    cure="Leave out " + " or ".join(given),
                )
