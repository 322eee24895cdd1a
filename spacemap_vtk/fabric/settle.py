"""From a draft and a user's wishes to a fabric with every measure settled.

The user's word comes first, then the draft's, then a default.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.crimp_height import height_for_crimp
from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.loom import Loom
from spacemap_vtk.fabric.thick_yarns import flattened, scaled
from spacemap_vtk.fabric.wishes import Wishes
from spacemap_vtk.fabric.yarn import section_area, yarn_height
from spacemap_vtk.io.wif import WifDraft

#: Distance between yarns where neither the user nor the draft gives one, in m.
SPACING = 0.5e-3
#: Diameter over spacing where neither the user nor the draft gives a thickness.
FILLING = 0.5
#: Width over height of yarns that are not round, where the user gives none.
ASPECT = 1.5
#: Colours of warp and weft where neither the user nor the draft gives any.
COLORS = {"warp": (0x2D, 0x6A, 0x8E), "weft": (0xE8, 0xC7, 0x8F)}

FAMILIES = ("warp", "weft")


@dataclass(frozen=True, eq=False)
class Dressed:
    """A weave with its colours, whether or not there is room for its yarns.

    Parameters
    ----------
    drawdown : ndarray of bool, shape (picks, ends)
        True where the end lies over the pick.
    warp_colors : ndarray of uint8, shape (ends, 3)
        Red, green and blue of each end.
    weft_colors : ndarray of uint8, shape (picks, 3)
        Red, green and blue of each pick.
    """

    drawdown: NDArray[np.bool_]
    warp_colors: NDArray[np.uint8]
    weft_colors: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Fabric(Dressed):
    """A weave with its measures and colours, feasible and ready to be built.

    Parameters
    ----------
    drawdown, warp_colors, weft_colors : ndarray
        As for `Dressed`.
    cloth : Cloth
        Diameters, spacings, sections, crimp height and overhang.
    yarn_density : float
        Mass of a volume of yarn, the air between its fibres included, in kg/m3.
    warnings : tuple of str
        What was assumed or changed.
    """

    cloth: Cloth
    yarn_density: float
    warnings: tuple[str, ...] = ()


def settle(source: Draft | WifDraft, wishes: Wishes) -> Fabric:
    """Settle every measure of a fabric.

    Parameters
    ----------
    source : Draft or WifDraft
        Weave, and whatever sizes and colours it has.
    wishes : Wishes
        What the user asks for.

    Returns
    -------
    Fabric
        Feasible.

    Raises
    ------
    GeometryError
        If the cloth is jammed or impossible.
    InputError
        If a wish does not fit another.
    """
    wif = _with_threads(source)
    measures, warnings = settled_measures(wif, wishes)
    try:
        cloth = _cloth(measures, wishes)
    except GeometryError as error:
        if wishes.thick_yarns == "refuse" and any(_thickness(wif, f, 1) for f in FAMILIES):
            error.cure = f'Let thick_yarns "scale" or "flatten" the draft\'s yarns. {error.cure}'
        raise
    return Fabric(
        **vars(dressed(wif, wishes)),
        cloth=cloth,
        yarn_density=wishes.packing * wishes.fibre_density,
        warnings=(*wif.draft.warnings, *warnings),
    )


def dressed(source: Draft | WifDraft, wishes: Wishes) -> Dressed:
    """Settle size and colours of a fabric, which need no room for the yarns.

    Parameters
    ----------
    source : Draft or WifDraft
        As for `settle`.
    wishes : Wishes
        As for `settle`.

    Returns
    -------
    Dressed
        The draft repeated or cut to the size wished for.
    """
    draft = _with_threads(source).draft
    own_picks, own_ends = draft.drawdown.shape
    ends, picks = wishes.ends or own_ends, wishes.picks or own_picks
    rows, columns = np.arange(picks) % own_picks, np.arange(ends) % own_ends
    return Dressed(
        draft.drawdown[np.ix_(rows, columns)],
        colors_of("warp", ends, draft.warp_colors, wishes),
        colors_of("weft", picks, draft.weft_colors, wishes),
    )


def settled_measures(
    source: Draft | WifDraft, wishes: Wishes
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Settle yarns and spacings, whether or not they can be woven.

    Parameters
    ----------
    source : Draft or WifDraft
        As for `settle`.
    wishes : Wishes
        As for `settle`.

    Returns
    -------
    measures : dict
        Arguments of `Cloth`, all but the crimp height.
    warnings : tuple of str
        What was changed.
    """
    wif = _with_threads(source)
    picks, ends = wif.draft.drawdown.shape
    sizes = {"warp": wishes.ends or ends, "weft": wishes.picks or picks}
    measures: dict[str, Any] = {
        "overhang": wishes.overhang,
        "caps": wishes.caps,
        "exact": wishes.exact,
        "axis": wishes.axis,
    }
    thick = []
    for family, size in sizes.items():
        section = getattr(wishes, f"{family}_section")
        aspect = getattr(wishes, f"{family}_aspect") or (1.0 if section == "circular" else ASPECT)
        spacing = _spacing(family, wif, wishes, size)
        diameter = _asked_diameter(family, wishes, aspect, section)
        if diameter is None and (drawn := _thickness(wif, family, size)) is not None:
            # a weaving program draws what it calls thickness: the width
            diameter = drawn / aspect
            thick.append(family)
        if diameter is None:
            # the narrowest gap decides, so that a default is feasible
            diameter = FILLING / aspect * float(np.min(spacing))
        measures |= {
            f"{family}_spacing": spacing,
            f"{family}_diameter": _along(diameter, size),
            f"{family}_section": section,
            f"{family}_aspect": aspect,
        }
    if not thick or wishes.thick_yarns == "refuse":
        return measures, ()
    mend = flattened if wishes.thick_yarns == "flatten" else scaled
    changes, note = mend(measures, thick)
    return measures | changes, (note,) if note else ()


def _with_threads(source: Draft | WifDraft) -> WifDraft:
    return source if isinstance(source, WifDraft) else WifDraft(source, Loom(()))


def _asked_diameter(family: str, wishes: Wishes, aspect: float, section: str) -> Any:
    """Return the diameters that the user gave, by themselves or as yarn counts."""
    count = getattr(wishes, f"{family}_count")
    if count is None:
        return getattr(wishes, f"{family}_diameter")
    area = section_area(np.asarray(count, dtype=np.float64), wishes.fibre_density, wishes.packing)
    return yarn_height(area, aspect, section)


def _cloth(measures: dict[str, Any], wishes: Wishes) -> Cloth:
    """Make the cloth, with the crimp that is wished for."""
    asked = asked_crimp(wishes)
    if asked is None:
        return Cloth(**measures, warp_crimp_height=wishes.warp_crimp_height)
    height = height_for_crimp(Cloth(**measures), *asked)
    return Cloth(**measures, warp_crimp_height=height)


def asked_crimp(wishes: Wishes) -> tuple[str, float] | None:
    """Return the crimp that a user gave in place of the crimp height.

    Parameters
    ----------
    wishes : Wishes
        The wishes.

    Returns
    -------
    tuple of str and float, or None
        ``"warp"`` or ``"weft"``, and its crimp.
    """
    for family in FAMILIES:
        crimp = getattr(wishes, f"{family}_crimp")
        if crimp is not None:
            return family, crimp
    return None


def _spacing(family: str, wif: WifDraft, wishes: Wishes, count: int) -> Any:
    """Return the distance between the yarns of a family: one, or (count - 1,)."""
    asked = getattr(wishes, f"{family}_spacing")
    sett = getattr(wishes, f"{family}_sett")
    if asked is not None:
        return _along(asked, max(count - 1, 1))
    if sett is not None:
        return 1.0 / sett
    each = getattr(wif, f"{family}_spacings")
    spaces = _along(getattr(wif.draft, f"{family}_spacing") if each is None else each, count)
    if spaces is None:
        # drafts without a spacing are drawn with the yarns side by side
        spaces = _thickness(wif, family, count)
    if spaces is None:
        return SPACING
    # a thread stands in the middle of the space that its spacing gives it
    return spaces if np.ndim(spaces) == 0 else _single(0.5 * (spaces[1:] + spaces[:-1]))


def _thickness(wif: WifDraft, family: str, count: int) -> Any:
    """Return a draft's thickness of `count` threads; None where it has none."""
    each = getattr(wif, f"{family}_thicknesses")
    return _along(getattr(wif.draft, f"{family}_thickness") if each is None else each, count)


def _along(values: Any, count: int) -> Any:
    """Repeat values over so many yarns; equal ones are one value."""
    if values is None or np.ndim(values) == 0:
        return values
    return _single(np.resize(np.asarray(values, dtype=np.float64), count))


def _single(values: NDArray[np.float64]) -> Any:
    return float(values[0]) if (values == values[0]).all() else values


def colors_of(
    family: str, count: int, own: NDArray[np.uint8] | None, wishes: Wishes
) -> NDArray[np.uint8]:
    """Return the colour of each yarn of a family.

    Parameters
    ----------
    family : str
        ``"warp"`` or ``"weft"``.
    count : int
        How many yarns.
    own : ndarray of uint8, shape (n, 3), or None
        The draft's colours.
    wishes : Wishes
        The user's, which come first.

    Returns
    -------
    ndarray of uint8, shape (count, 3)
        Red, green and blue.
    """
    asked = getattr(wishes, f"{family}_color")
    chosen = asked if asked is not None else COLORS[family] if own is None else own
    return np.resize(np.asarray(chosen, dtype=np.uint8), (count, 3))
