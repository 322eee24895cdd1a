"""From a draft and a user's wishes to a fabric with every measure settled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric import peirce
from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.weave import Cloth
from spacemap_vtk.units import format_quantity

#: Distance between yarns where neither the user nor the draft gives one, in m.
DEFAULT_SPACING = 0.5e-3
#: Diameter over spacing where neither the user nor the draft gives a thickness.
DEFAULT_FILLING = 0.5
#: A draft's yarns too thick for Peirce's geometry are drawn at this share of the jam limit.
THICKNESS_SHARE = 0.85


@dataclass(frozen=True, eq=False)
class Fabric:
    """A weave with its measures and colours, feasible and ready to be built.

    Parameters
    ----------
    drawdown : ndarray of bool, shape (picks, ends)
        True where the end lies over the pick.
    cloth : Cloth
        Diameters, spacings, crimp height and overhang.
    warp_colors : ndarray of uint8, shape (ends, 3)
        Red, green and blue of each end.
    weft_colors : ndarray of uint8, shape (picks, 3)
        Red, green and blue of each pick.
    warnings : tuple of str
        What was assumed or changed.
    """

    drawdown: NDArray[np.bool_]
    cloth: Cloth
    warp_colors: NDArray[np.uint8]
    weft_colors: NDArray[np.uint8]
    warnings: tuple[str, ...] = ()


def settle(
    draft: Draft,
    *,
    ends: int | None = None,
    picks: int | None = None,
    warp_diameter: float | None = None,
    weft_diameter: float | None = None,
    warp_spacing: float | None = None,
    weft_spacing: float | None = None,
    warp_crimp_height: float | None = None,
    overhang: float | None = None,
    warp_color: tuple[int, int, int],
    weft_color: tuple[int, int, int],
) -> Fabric:
    """Settle every measure of a fabric: the user's word first, then the draft's, then a default.

    Parameters
    ----------
    draft : Draft
        Weave, and whatever sizes and colours it has.
    ends, picks : int, optional
        Size of the cloth in yarns, the draft repeated or cut; by default the draft's own.
    warp_diameter, weft_diameter : float, optional
        In m. By default the draft's thickness, else `DEFAULT_FILLING` of the spacing.
    warp_spacing, weft_spacing : float, optional
        In m. By default the draft's, else `DEFAULT_SPACING`.
    warp_crimp_height : float, optional
        In m. By default the middle of the feasible interval.
    overhang : float, optional
        In m; how far yarns reach past their last crossing. By default half the spacing crossed.
    warp_color, weft_color : tuple of 3 int
        For drafts without colours.

    Returns
    -------
    Fabric
        Feasible.

    Raises
    ------
    GeometryError
        If the cloth is jammed or impossible.
    """
    warnings = list(draft.warnings)
    p1 = warp_spacing or draft.warp_spacing or DEFAULT_SPACING
    p2 = weft_spacing or draft.weft_spacing or DEFAULT_SPACING
    d1 = warp_diameter or draft.warp_thickness or DEFAULT_FILLING * p1
    d2 = weft_diameter or draft.weft_thickness or DEFAULT_FILLING * p2
    limit = peirce.largest_diameter_sum(p1, p2)
    loose = (
        warp_diameter is None and draft.warp_thickness is not None,
        weft_diameter is None and draft.weft_thickness is not None,
    )
    if any(loose) and (d1 + d2 > limit or d1 > p1 or d2 > p2):
        d1, d2, note = _thinned(d1, d2, p1, p2, limit, loose)
        warnings.append(note)
    cloth = Cloth(
        warp_diameter=d1,
        weft_diameter=d2,
        warp_spacing=p1,
        weft_spacing=p2,
        warp_crimp_height=warp_crimp_height,
        overhang=overhang,
    )
    own_picks, own_ends = draft.drawdown.shape
    rows = np.arange(picks or own_picks) % own_picks
    columns = np.arange(ends or own_ends) % own_ends
    warp = draft.warp_colors if draft.warp_colors is not None else _filled(own_ends, warp_color)
    weft = draft.weft_colors if draft.weft_colors is not None else _filled(own_picks, weft_color)
    return Fabric(
        draft.drawdown[np.ix_(rows, columns)],
        cloth,
        warp[columns],
        weft[rows],
        tuple(warnings),
    )


def _thinned(
    d1: float, d2: float, p1: float, p2: float, limit: float, loose: tuple[bool, bool]
) -> tuple[float, float, str]:
    """Scale the diameters that come from the draft until the yarns can interlace.

    Weaving programs write a thickness equal to the spacing, which is right for yarns that flatten
    and impossible for round ones. What the user gave stays as it is.
    """
    kept = sum(d for d, scale in zip((d1, d2), loose, strict=True) if not scale)
    factor = min(
        [(THICKNESS_SHARE * limit - kept) / (d1 + d2 - kept)]
        + [THICKNESS_SHARE * p / d for d, p, s in ((d1, p1, loose[0]), (d2, p2, loose[1])) if s]
    )
    if factor <= 0.0:
        return d1, d2, "the diameter given leaves no room for the other yarns"
    new1, new2 = (factor * d if s else d for d, s in zip((d1, d2), loose, strict=True))
    return (
        new1,
        new2,
        f"the draft's yarns, {_mm(d1)} (warp) and {_mm(d2)} (weft) thick at spacings of {_mm(p1)} "
        f"and {_mm(p2)}, are too thick to interlace: round yarns jam where the two diameters add "
        f"up to {_mm(limit)}; drawn {_mm(new1)} and {_mm(new2)} thick, {THICKNESS_SHARE:.0%} of "
        "that",
    )


def _mm(value: float) -> str:
    return format_quantity(float(f"{value:.4g}"), "m")


def _filled(count: int, color: tuple[int, int, int]) -> NDArray[np.uint8]:
    return np.tile(np.array(color, dtype=np.uint8), (count, 1))
