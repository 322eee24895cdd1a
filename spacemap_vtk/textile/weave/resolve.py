"""Resolve every measure of a cloth from a draft and a user's request.

The user's values come first, then the draft's, then defaults.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spacemap_vtk.errors import InfoMessage, InputError
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.drafts.pattern_weft import find_pattern_weft
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.double_weave import LEAST_YARNS, Layers, find_layers, one_layer_cure
from spacemap_vtk.textile.weave.families import QuantityNames, quantity_name
from spacemap_vtk.textile.weave.lens import (
    DraftFamily,
    LensShape,
    face_radius,
    fit_lenses,
    neighbour_means,
)
from spacemap_vtk.textile.weave.pattern_sections import (
    USUAL_RATIO,
    PatternSections,
    close_over_tabby,
)
from spacemap_vtk.textile.weave.thick_yarns import (
    WIDTH_SHARE,
    flatten_yarns,
    is_feasible,
    scale_yarns,
)
from spacemap_vtk.textile.weave.threads import Lengths, Threads, collapse_equal, repeat_values
from spacemap_vtk.textile.weave.yarn import yarn_height
from spacemap_vtk.textile.weave.yarn_library import parse_yarns

#: Default distance between yarns, in m.
SPACING = 0.5e-3
#: Default diameter over spacing.
FILLING = 0.5
#: The same for a double weave, whose cloths need more room to change places.
LAYERED_FILLING = 0.45
#: Message about a draft of two cloths.
_DOUBLE_WEAVE = "a double weave is drawn as two cloths, one above the other"
#: Default width over height of yarns that are not round.
ASPECT = 1.5
#: Least share of a draft's thickness that is drawn; below it, the thickness is not believed.
_LEAST_SHARE = 0.05
#: Thickness of pattern picks over that of tabby below which a draft does not tell them apart.
_EQUAL_PICKS = 1.05
#: Default colour of the warp.
WARP_COLOR = (0x2D, 0x6A, 0x8E)
#: Default colour of the weft.
WEFT_COLOR = (0xE8, 0xC7, 0x8F)

#: One value for a family, or several that are repeated over its yarns.
Wanted = float | tuple[float, ...]
Rgb = tuple[int, int, int]


@dataclass(frozen=True, kw_only=True)
class ThreadsRequest:
    """A user's request for the warp or the weft; None leaves a value to the draft or a default.

    `spacemap_vtk.filters.weave_source.WeaveSource` documents the values and the defaults.
    """

    diameter: Wanted | None
    count: Wanted | None
    yarn: str | tuple[str, ...] | None
    spacing: Wanted | None
    sett: float | None
    crimp: float | None
    section: str | None
    aspect: float | None
    layer: int | tuple[int, ...] | None
    color: Rgb | tuple[Rgb, ...] | None
    twist: Wanted | None = None
    plies: int | tuple[int, ...] | None = None

    @property
    def has_thickness(self) -> bool:
        """Whether the thickness of the yarns is given."""
        return self.diameter is not None or self.linear_density is not None

    @property
    def linear_density(self) -> Wanted | None:
        """Mass per length of the yarns, in kg/m: their count, or that of the named yarns."""
        named = parse_yarns(self.yarn)
        return tuple(yarn.linear_density for yarn in named) if named else self.count

    @property
    def can_fit_lens(self) -> bool:
        """Whether the sizes of lenticular sections may be chosen."""
        free = self.diameter is None and self.aspect is None
        return free and self.section in (None, "lenticular")


@dataclass(frozen=True, kw_only=True)
class ClothRequest:
    """A user's request for a cloth, in SI units; None leaves a value to the draft or a default.

    `spacemap_vtk.filters.weave_source.WeaveSource` documents the values and the defaults. Of values
    that follow from one another at most one is given.
    """

    ends: int | None
    picks: int | None
    warp: ThreadsRequest
    weft: ThreadsRequest
    fibre_density: float
    packing: float
    crimp_height: float | None
    thick_yarns: str
    layer_gap: float | None
    overhang: float | None
    caps: bool
    exact: bool
    axis: str
    from_file: bool = False

    @property
    def closes_cloth(self) -> bool:
        """Whether yarns get lenticular sections that close the cloth, unless layers prevent it."""
        families = self.warp, self.weft
        if not all(family.can_fit_lens for family in families) or self.axis != "arcs":
            return False
        if all(family.section == "lenticular" for family in families):
            return True
        counted = any(family.linear_density is not None for family in families)
        return self.thick_yarns == "lens" and (self.from_file or counted)


def resolve(draft: Draft, request: ClothRequest, names: QuantityNames = quantity_name) -> Cloth:
    """Resolve every measure of a cloth.

    Parameters
    ----------
    draft : Draft
        Drawdown, with the sizes and colours that the draft stores.
    request : ClothRequest
        The user's request.
    names : callable
        Names of the quantities of warp and weft in messages.

    Returns
    -------
    Cloth
        Its yarns may have no room: see `Cloth.check`.
    """
    ends, picks = request.ends or draft.size[0], request.picks or draft.size[1]
    layers, messages = _find_layers(
        draft, (ends, picks), (request.warp.layer, request.weft.layer), names
    )
    # The yarns of two cloths change places where lenses as wide as their spacing have no room.
    closes = request.closes_cloth and layers is None
    flattens = request.thick_yarns == "flatten" or (request.thick_yarns == "lens" and not closes)
    if flattens and draft.loom is not None:
        warp_threads, weft_threads = (
            own.fill_spaces(_requested_spacing(wanted))
            for own, wanted in ((draft.warp, request.warp), (draft.weft, request.weft))
        )
        draft = replace(draft, warp=warp_threads, weft=weft_threads)
    filling = _default_filling(layers)
    warp = _resolve_threads(draft.warp, request.warp, request, ends, WARP_COLOR, filling)
    weft = _resolve_threads(draft.weft, request.weft, request, picks, WEFT_COLOR, filling)
    densities = _bulk_density(request.warp, request), _bulk_density(request.weft, request)
    cloth = Cloth(
        drawdown=tile_drawdown(draft.drawdown, ends, picks),
        warp=warp,
        weft=weft,
        crimp_height=request.crimp_height,
        overhang=request.overhang,
        caps=request.caps,
        exact=request.exact,
        axis=request.axis,
        density=densities[0] if densities[0] == densities[1] else densities,
        warnings=(*draft.warnings, *messages),
        layers=layers,
        layer_gap=request.layer_gap,
        names=names,
    )
    given = draft.warp.thickness is not None, draft.weft.thickness is not None
    if closes:
        sized = all(given) and not any(one.has_thickness for one in (request.warp, request.weft))
        # Round yarns of the draft's thickness are kept if they fit.
        if sized and request.warp.section is request.weft.section is None and is_feasible(cloth):
            return cloth
        warp, weft = _close_cloth(draft, request, warp, weft, cloth.drawdown)
        return replace(cloth, warp=warp, weft=weft)
    if request.thick_yarns == "refuse" and any(given):
        return replace(cloth, cure='Set thick_yarns to "scale" or "flatten".')
    thick = given[0] and not request.warp.has_thickness, given[1] and not request.weft.has_thickness
    if not any(thick):
        return cloth
    change = flatten_yarns if flattens else scale_yarns
    cloth, message = change(cloth, thick)
    if message:
        warp, weft = (
            replace(threads, size="assumed") if mine else threads
            for threads, mine in zip(cloth.threads, thick, strict=True)
        )
        cloth = replace(cloth, warp=warp, weft=weft)
    return replace(cloth, warnings=(*cloth.warnings, InfoMessage(message))) if message else cloth


def _requested_spacing(request: ThreadsRequest) -> float:
    """Return the spacing for threads to which a draft gives none."""
    if request.spacing is not None:
        return float(np.min(request.spacing))
    return SPACING if request.sett is None else 1.0 / request.sett


def _find_layers(
    draft: Draft,
    size: tuple[int, int],
    requested: tuple[int | tuple[int, ...] | None, ...],
    names: QuantityNames,
) -> tuple[Layers | None, tuple[str, ...]]:
    """Return the two cloths that are requested or found, and messages about those found."""
    # A small piece of a weave is judged by more repeats of it.
    counts = [count if count >= LEAST_YARNS else 3 * LEAST_YARNS for count in size]
    ends, picks = (
        None if layer is None else np.resize(layer, count) == 2
        for layer, count in zip(requested, counts, strict=True)
    )
    known = [one for one in (ends, picks) if one is not None]
    if any(one.all() or not one.any() for one in known):
        return None, ()
    found = find_layers(tile_drawdown(draft.drawdown, counts[0], counts[1]), ends, picks)
    if found is None and known:
        lacking, given = (names("layer", family) for family in ((0, 1) if ends is None else (1, 0)))
        raise InputError(
            f"no two separate cloths are found with this {given}",
            key=lacking,
            allowed="a list of 1 and 2, repeated over the yarns",
            cure=f"Write, for example, {lacking} = [1, 2]",
        )
    if found is None:
        return None, ()
    remark = InfoMessage(f"{_DOUBLE_WEAVE}; {one_layer_cure(names)}")
    return found.crop(slice(size[0]), slice(size[1])), () if known else (remark,)


def _default_filling(layers: Layers | None) -> float:
    """Return the default diameter over the spacing."""
    if layers is None:
        return FILLING
    # In two cloths of every other thread that are nowhere joined, spacings are twice as wide.
    families = layers.ends, layers.picks
    apart = all(one is not None and bool(np.diff(one).all()) for one in families)
    return LAYERED_FILLING * (2.0 if apart and not any(layers.has_changes) else 1.0)


def _bulk_density(request: ThreadsRequest, fibres: ClothRequest) -> float:
    """Return the mass per volume of a family's yarn; of several named yarns, that of all."""
    named = parse_yarns(request.yarn)
    if not named:
        return fibres.packing * fibres.fibre_density
    area = sum(yarn.linear_density / yarn.bulk_density for yarn in named)
    return sum(yarn.linear_density for yarn in named) / area


def _section_area(request: ThreadsRequest, fibres: ClothRequest, count: int) -> Floats:
    """Return the area of the yarns' sections, if their mass per length is given."""
    named = parse_yarns(request.yarn)
    if named:
        areas = np.array([yarn.linear_density / yarn.bulk_density for yarn in named])
    else:
        areas = np.asarray(request.count, dtype=np.float64) / _bulk_density(request, fibres)
    return np.asarray(repeat_values(areas, count))


def _resolve_threads(
    own: DraftThreads,
    request: ThreadsRequest,
    fibres: ClothRequest,
    count: int,
    color: Rgb,
    filling: float,
) -> Threads:
    section = request.section or "circular"
    spacing = _resolve_spacing(own, request, count)
    aspect = request.aspect or _default_aspect(request, section, spacing)
    diameter: Lengths
    size = "given"
    if request.linear_density is not None:
        area = _section_area(request, fibres, count)
        diameter = repeat_values(yarn_height(area, aspect, section), count)
    elif request.diameter is not None:
        diameter = repeat_values(request.diameter, count)
    elif own.thickness is not None:
        # Weaving programs draw what they call thickness: the width of the yarn.
        diameter = repeat_values(repeat_values(own.thickness, count) / aspect, count)
        size = "draft"
    else:
        # The narrowest gap decides, so that the default is feasible.
        share = WIDTH_SHARE if section == "lenticular" else filling
        diameter = share / aspect * float(np.min(spacing))
        size = "assumed"
    chosen = (
        request.color if request.color is not None else color if own.colors is None else own.colors
    )
    return Threads(
        diameter=diameter,
        spacing=spacing,
        section=section,
        aspect=aspect,
        size=size,
        crimp=request.crimp,
        colors=np.resize(np.asarray(chosen, dtype=np.uint8), (count, 3)),
        twist=None if request.twist is None else repeat_values(request.twist, count),
        plies=repeat_values(request.plies or _usual_plies(request), count),
    )


def _usual_plies(request: ThreadsRequest) -> Wanted:
    return tuple(float(yarn.plies) for yarn in parse_yarns(request.yarn)) or 1.0


def _default_aspect(request: ThreadsRequest, section: str, spacing: Lengths) -> float:
    """Return the default width over height."""
    if section == "circular":
        return 1.0
    if section == "lenticular" and request.diameter is not None:
        # As wide as closes the cloth.
        return max(1.0, WIDTH_SHARE * float(np.min(spacing)) / float(np.max(request.diameter)))
    return ASPECT


def _close_cloth(
    draft: Draft, request: ClothRequest, warp: Threads, weft: Threads, drawdown: Bools
) -> tuple[Threads, Threads]:
    """Give warp and weft lenticular sections that close the cloth, or those of their counts."""
    families = []
    for own, wanted, threads in (
        (draft.warp, request.warp, warp),
        (draft.weft, request.weft, weft),
    ):
        count, spacing = len(threads.colors), np.asarray(threads.spacing)
        area = None
        if wanted.linear_density is not None:
            area = _section_area(wanted, request, count)
            width = np.sqrt(area)
        elif own.thickness is not None:
            width = np.asarray(repeat_values(own.thickness, count))
        else:
            width = np.asarray(np.min(spacing))
        fill = _filling_share(width, spacing)
        if area is None and own.thickness is not None:
            if fill < _LEAST_SHARE:  # a slip of units
                width = np.asarray(np.min(spacing))
                fill = _filling_share(width, spacing)
            # A draft's yarns may be thinner than their spaces.
            fill = min(1.0, fill)
        families.append(DraftFamily(fill * width, spacing, area))
    laid = None
    if request.from_file and request.weft.spacing is request.weft.sett is families[1].area is None:
        thickness = repeat_values(families[1].width, len(weft.colors))
        laid = _lay_pattern_weft(drawdown, thickness, families[1].spacing)
    if laid is not None:
        weft = replace(weft, spacing=np.diff(laid.position))
        families[1] = DraftFamily(laid.width, np.asarray(weft.spacing), None)
    shapes = fit_lenses(*families)
    if laid is not None:
        weft = replace(weft, float_width=_covering_widths(laid, shapes[1]))
    closed = [
        replace(
            threads,
            diameter=shape.height if np.ndim(shape.height) else float(shape.height),
            section="lenticular",
            aspect=shape.aspect,
            size="given" if family.area is not None else "assumed",
        )
        for threads, shape, family in zip((warp, weft), shapes, families, strict=True)
    ]
    return closed[0], closed[1]


def _lay_pattern_weft(
    drawdown: Bools, thickness: Lengths, spacing: Floats
) -> PatternSections | None:
    """Lay picks as they close on the loom, if a pattern weft covers a tabby; otherwise None."""
    found = find_pattern_weft(drawdown, thickness)
    if found is None:
        return None
    picks = len(drawdown)
    width = np.broadcast_to(thickness, picks)
    ratio = float(width[found.pattern].mean() / width[~found.pattern].mean())
    # Most drafts give all picks one thickness.
    ratio = ratio if ratio > _EQUAL_PICKS else USUAL_RATIO
    between = np.broadcast_to(spacing, picks - 1)
    length = float(between.sum() + between.mean())
    return close_over_tabby(found.pattern, length, ratio, WIDTH_SHARE)


def _covering_widths(laid: PatternSections, shape: LensShape) -> Floats:
    """Return widths to which floats may swell: those that cover the tabby, if there is room."""
    heights, gap = np.asarray(shape.height), np.diff(laid.position)
    radius = face_radius(shape.aspect) * heights
    # A float and the upper arc of the tabby beside it, both lying on ends, as in (2) of
    # `spacemap_vtk.textile.weave.pattern_sections`, with axes at one height.
    both, low = radius[1:] + radius[:-1], 0.5 * (heights[1:] + heights[:-1])
    free = gap * gap + np.square(both - low) >= both * both
    covers = np.append(True, free) & np.append(free, True)
    return np.where(covers, laid.float_width, laid.width)


def _filling_share(width: Floats, spacing: Floats) -> float:
    """Compute the share of their widths at which neighbours fill nine tenths of their spacing."""
    share = WIDTH_SHARE * float(np.min(spacing / neighbour_means(width), initial=np.inf))
    return share if np.isfinite(share) else 1.0


def _resolve_spacing(own: DraftThreads, request: ThreadsRequest, count: int) -> Lengths:
    """Return the distance between the yarns of a family: one value, or (count - 1,)."""
    if request.spacing is not None:
        return repeat_values(request.spacing, max(count - 1, 1))
    if request.sett is not None:
        return 1.0 / request.sett
    # Drafts without a spacing are drawn with the yarns touching each other.
    found = own.thickness if own.spacing is None else own.spacing
    if found is None:
        return SPACING
    spaces = repeat_values(found, count)
    # A thread lies in the middle of the space that its spacing defines.
    return (
        collapse_equal(0.5 * (spaces[1:] + spaces[:-1]))
        if isinstance(spaces, np.ndarray)
        else spaces
    )
