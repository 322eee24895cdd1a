"""From a draft and what a user asks of it to a cloth with every measure resolved.

The user's word comes first, then the draft's, then a default.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spacemap_vtk.errors import InputError, Remark
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.drawdown import tile
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.double_weave import LEAST, Layers, find_layers, one_layer
from spacemap_vtk.textile.weave.naming import Naming, in_words
from spacemap_vtk.textile.weave.thick_yarns import flattened, scaled
from spacemap_vtk.textile.weave.threads import Lengths, Threads, alike, along
from spacemap_vtk.textile.weave.yarn import section_area, yarn_height

#: Distance between yarns where neither the user nor the draft gives one, in m.
SPACING = 0.5e-3
#: Diameter over spacing where neither the user nor the draft gives a thickness.
FILLING = 0.5
#: The same of a double weave, whose cloths need more room to change places.
LAYERED_FILLING = 0.45
#: What is said of a draft of two cloths.
_FOUND = "it is a double weave, and is drawn as two cloths, one above the other"
#: Width over height of yarns that are not round, where the user gives none.
ASPECT = 1.5
#: Colours of warp and weft where neither the user nor the draft gives any.
WARP_COLOR, WEFT_COLOR = (0x2D, 0x6A, 0x8E), (0xE8, 0xC7, 0x8F)

#: One value for a family, or several that are repeated over its yarns.
Wanted = float | tuple[float, ...]
Rgb = tuple[int, int, int]


@dataclass(frozen=True, kw_only=True)
class ThreadsAsked:
    """What a user asks of the warp or the weft; None leaves it to the draft, or to a default.

    What each means, and the defaults, stand with `spacemap_vtk.filters.weave_source.WeaveSource`.
    """

    diameter: Wanted | None
    count: Wanted | None
    spacing: Wanted | None
    sett: float | None
    crimp: float | None
    section: str
    aspect: float | None
    layer: int | tuple[int, ...] | None
    color: Rgb | tuple[Rgb, ...] | None
    twist: Wanted | None = None
    plies: int | tuple[int, ...] | None = None

    @property
    def thick(self) -> bool:
        """Whether it says how thick the yarns are."""
        return self.diameter is not None or self.count is not None


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a user asks of a cloth, in SI; None leaves it to the draft, or to a default.

    What each means, and the defaults, stand with `spacemap_vtk.filters.weave_source.WeaveSource`.
    Of those that follow from one another at most one is given.
    """

    ends: int | None
    picks: int | None
    warp: ThreadsAsked
    weft: ThreadsAsked
    fibre_density: float
    packing: float
    crimp_height: float | None
    thick_yarns: str
    layer_gap: float | None
    overhang: float | None
    caps: bool
    exact: bool
    axis: str


def resolve(draft: Draft, asked: Asked, names: Naming = in_words) -> Cloth:
    """Resolve every measure of a cloth.

    Parameters
    ----------
    draft : Draft
        Weave, and whatever sizes and colours it has.
    asked : Asked
        What the user asks for.
    names : callable
        How messages name the quantities of warp and weft.

    Returns
    -------
    Cloth
        Its size, yarns and colours, whether or not there is room for them: see `Cloth.check`.
    """
    ends, picks = asked.ends or draft.size[0], asked.picks or draft.size[1]
    if asked.thick_yarns == "flatten" and draft.loom is not None:  # of a file, not a pattern
        warp, weft = draft.warp.side_by_side(SPACING), draft.weft.side_by_side(SPACING)
        draft = replace(draft, warp=warp, weft=weft)
    layers, told = _layers(draft, (ends, picks), (asked.warp.layer, asked.weft.layer), names)
    filling = _filling(layers)
    cloth = Cloth(
        drawdown=tile(draft.drawdown, ends, picks),
        warp=_threads(draft.warp, asked.warp, asked, ends, WARP_COLOR, filling),
        weft=_threads(draft.weft, asked.weft, asked, picks, WEFT_COLOR, filling),
        crimp_height=asked.crimp_height,
        overhang=asked.overhang,
        caps=asked.caps,
        exact=asked.exact,
        axis=asked.axis,
        density=asked.packing * asked.fibre_density,
        warnings=(*draft.warnings, *told),
        layers=layers,
        layer_gap=asked.layer_gap,
        names=names,
    )
    drawn = draft.warp.thickness is not None, draft.weft.thickness is not None
    if asked.thick_yarns == "refuse" and any(drawn):
        return replace(cloth, cure='Let thick_yarns "scale" or "flatten" the draft\'s yarns.')
    thick = drawn[0] and not asked.warp.thick, drawn[1] and not asked.weft.thick
    if not any(thick):
        return cloth
    mend = flattened if asked.thick_yarns == "flatten" else scaled
    cloth, note = mend(cloth, thick)
    return replace(cloth, warnings=(*cloth.warnings, Remark(note))) if note else cloth


def _layers(
    draft: Draft,
    size: tuple[int, int],
    asked: tuple[int | tuple[int, ...] | None, ...],
    names: Naming,
) -> tuple[Layers | None, tuple[str, ...]]:
    """Return the two cloths that are asked for or found, and what is said of those found."""
    # a small piece of a weave is what more of it is
    whole = [count if count >= LEAST else 3 * LEAST for count in size]
    ends, picks = (
        None if layer is None else np.resize(layer, count) == 2
        for layer, count in zip(asked, whole, strict=True)
    )
    known = [one for one in (ends, picks) if one is not None]
    if any(one.all() or not one.any() for one in known):
        return None, ()
    found = find_layers(tile(draft.drawdown, whole[0], whole[1]), ends, picks)
    if found is None and known:
        lacking, given = (names("layer", family) for family in ((0, 1) if ends is None else (1, 0)))
        raise InputError(
            f"with this {given} no cloths are found that lie apart",
            key=lacking,
            allowed="a list of 1 and 2, repeated over the yarns",
            cure=f"Write, for example, {lacking} = [1, 2]",
        )
    if found is None:
        return None, ()
    remark = Remark(f"{_FOUND}; {one_layer(names)}")
    return found.cropped(slice(size[0]), slice(size[1])), () if known else (remark,)


def _filling(layers: Layers | None) -> float:
    """Return the diameter over the spacing where nobody gives a thickness."""
    if layers is None:
        return FILLING
    # two cloths of every other thread, nowhere joined, have each twice the spacing
    families = layers.ends, layers.picks
    apart = all(one is not None and bool(np.diff(one).all()) for one in families)
    return LAYERED_FILLING * (2.0 if apart and not any(layers.joined) else 1.0)


def _threads(
    own: DraftThreads, asked: ThreadsAsked, fibres: Asked, count: int, color: Rgb, filling: float
) -> Threads:
    aspect = asked.aspect or (1.0 if asked.section == "circular" else ASPECT)
    spacing = _spacing(own, asked, count)
    diameter: Lengths
    if asked.count is not None:
        linear = np.asarray(asked.count, dtype=np.float64)
        area = section_area(linear, fibres.fibre_density, fibres.packing)
        diameter = along(yarn_height(area, aspect, asked.section), count)
    elif asked.diameter is not None:
        diameter = along(asked.diameter, count)
    elif own.thickness is not None:
        # a weaving program draws what it calls thickness: the width
        diameter = along(along(own.thickness, count) / aspect, count)
    else:
        # the narrowest gap decides, so that a default is feasible
        diameter = filling / aspect * float(np.min(spacing))
    chosen = asked.color if asked.color is not None else color if own.colors is None else own.colors
    return Threads(
        diameter=diameter,
        spacing=spacing,
        section=asked.section,
        aspect=aspect,
        crimp=asked.crimp,
        colors=np.resize(np.asarray(chosen, dtype=np.uint8), (count, 3)),
        twist=None if asked.twist is None else along(asked.twist, count),
        plies=along(asked.plies or 1.0, count),
    )


def _spacing(own: DraftThreads, asked: ThreadsAsked, count: int) -> Lengths:
    """Return the distance between the yarns of a family: one, or (count - 1,)."""
    if asked.spacing is not None:
        return along(asked.spacing, max(count - 1, 1))
    if asked.sett is not None:
        return 1.0 / asked.sett
    # drafts without a spacing are drawn with the yarns side by side
    found = own.thickness if own.spacing is None else own.spacing
    if found is None:
        return SPACING
    spaces = along(found, count)
    # a thread stands in the middle of the space that its spacing gives it
    return alike(0.5 * (spaces[1:] + spaces[:-1])) if isinstance(spaces, np.ndarray) else spaces
