"""The weaver's plan of a scene.

The take-up comes from the geometry of the cloth with the plan's yarns and setts. What the user does
not give is assumed, and the plan says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import lcm
from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.filters.weave_parameters import WeaveParameters, parameter_name
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import Parameterised, Series
from spacemap_vtk.scenes.plan_settings import PlanSettings
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.drafts.drawdown import mean_floats
from spacemap_vtk.textile.plan.losses import Losses, usual_losses
from spacemap_vtk.textile.plan.project import PlannedDraft, Project, ProjectRequest, plan_project
from spacemap_vtk.textile.plan.reed import (
    IMPERIAL_REEDS,
    METRIC_REEDS,
    Sleying,
    choose_sleying,
)
from spacemap_vtk.textile.plan.sett import USUAL_SHARE, largest_sett, suggest_sett
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.families import FAMILIES
from spacemap_vtk.textile.weave.figures import yarn_crimps
from spacemap_vtk.textile.weave.yarn import COTTON, PACKING, section_factor
from spacemap_vtk.textile.weave.yarn_library import Yarn, parse_yarns
from spacemap_vtk.units import UNITS

#: Named yarns of the warp, and of the weft.
FamilyYarns = tuple[tuple[Yarn, ...], tuple[Yarn, ...]]
#: Longest repeat of a draft and its lists of colours together.
_LONGEST_REPEAT = 4096
#: Take-up of yarns that do not fit as they are drawn.
_UNKNOWN_TAKE_UP = 0.1


@dataclass(frozen=True, kw_only=True)
class ScenePlan:
    """The plan of a scene."""

    title: str
    settings: PlanSettings
    project: Project
    #: Named yarns of warp and weft, repeated over the threads; empty where only a thickness or a
    #: count is known.
    yarns: FamilyYarns
    #: Largest setts of warp and weft by Ashenhurst's rule, in 1/m; None without named yarns.
    largest_setts: tuple[float, float] | None
    #: Wanted sett of the warp, in 1/m, from which that of the sleying differs.
    wanted_sett: float
    #: The best reeds, that of the project first.
    reeds: list[Sleying]
    #: Sentences about what was not given.
    assumed: list[str] = field(default_factory=list)


def plan_scene(scene: Scene, settings: PlanSettings) -> ScenePlan:
    """Plan the project of a scene; how many ends and picks it draws does not matter."""
    woven = scene.woven
    if woven is None:
        raise InputError(
            f"{scene.file or scene.title}: the scene is not woven, so nothing can be planned"
        )
    assumed: list[str] = []
    with scene.add_file_to_errors():
        yarns = _named_yarns(woven, settings)
        unit = _repeat_once(woven, yarns)
        largest = _largest_setts(unit.cloth, unit.size, yarns)
        warp_sett, weft_sett = _choose_setts(unit, settings, yarns, largest, assumed)
        unit = _repeat_once(woven, yarns, (warp_sett, weft_sett))
        draft = _planned_draft(unit, settings, yarns, assumed)
    sleyings = choose_sleying(warp_sett, _reeds(settings))
    losses = [usual_losses(named) for named in yarns]
    assumed += _assumed_losses(settings, losses)
    picks, ends = draft.drawdown.shape
    request = ProjectRequest(
        width=settings.width or 1.0,
        length=settings.length or 1.0,
        pieces=settings.pieces,
        hem=settings.hem,
        fringe=settings.fringe,
        ends=settings.ends or (ends if settings.width is None else None),
        picks=settings.picks or (picks if settings.length is None else None),
        sleying=sleyings[0],
        weft_sett=weft_sett,
        draw_in=_or_usual(settings.draw_in, losses[1].draw_in),
        warp_shrinkage=_or_usual(settings.shrinkage, losses[0].shrinkage),
        weft_shrinkage=_or_usual(settings.width_shrinkage, losses[1].shrinkage),
        waste=settings.waste,
        sample=settings.sample,
        floating=settings.floating,
        allowance=settings.allowance,
    )
    return ScenePlan(
        title=scene.title,
        settings=settings,
        project=plan_project(draft, request),
        yarns=yarns,
        largest_setts=largest,
        wanted_sett=warp_sett,
        reeds=sleyings,
        assumed=assumed,
    )


class _Unit(NamedTuple):
    """A draft once, as a cloth with one more end and pick, so that all its gaps are there."""

    woven: Woven
    cloth: Cloth
    #: Numbers of ends and picks of the draft.
    size: tuple[int, int]


def _repeat_once(
    woven: Woven,
    yarns: FamilyYarns,
    setts: tuple[float, float] | None = None,
) -> _Unit:
    """Make the draft once, with the yarns and setts of the plan."""
    if not isinstance(woven, WeaveParameters):
        return _Unit(woven, woven.cloth, woven.cloth.size)
    size, changes = [], dict[str, Any]()
    for family, count in enumerate(woven.source.size):
        # Lists of values are repeated over the yarns, so the repeat may be longer than the weave's.
        lists = [
            parameter.items(getattr(woven, name))
            for name, parameter in woven.parameters.items()
            if name.startswith(f"{FAMILIES[family]}_") and isinstance(parameter, Series)
        ]
        named, key = yarns[family], parameter_name("yarn", family)
        whole = lcm(count, *(len(each) for each in (*lists, named) if each))
        size.append(whole if whole <= _LONGEST_REPEAT else count)
        if named and named != parse_yarns(getattr(woven, key)):
            # Sections and crimp of the scene are those of the yarns that it draws.
            replaced = "count", "diameter", "section", "aspect", "crimp"
            changes |= dict.fromkeys((parameter_name(each, family) for each in replaced), None)
            changes |= {"warp_crimp_height": None, key: [yarn.name for yarn in named]}
        if setts is not None:
            changes[parameter_name("spacing", family)] = None
            changes[parameter_name("sett", family)] = setts[family]
    made = type(woven)(**{**woven.settings, **changes, "ends": size[0] + 1, "picks": size[1] + 1})
    woven.lend(made)  # what it has read of the draft
    return _Unit(made, made.cloth, (size[0], size[1]))


def _named_yarns(woven: Woven, settings: PlanSettings) -> FamilyYarns:
    """Return the named yarns: those of the plan, or those of the scene."""
    own = [parse_yarns(getattr(woven, parameter_name("yarn", family), None)) for family in (0, 1)]
    warp = parse_yarns(settings.warp_yarn) or own[0]
    weft = parse_yarns(settings.weft_yarn) or own[1]
    return warp, weft or (warp[:1] if settings.warp_yarn else ())


def _largest_setts(
    cloth: Cloth, size: tuple[int, int], yarns: FamilyYarns
) -> tuple[float, float] | None:
    """Return the largest setts by Ashenhurst's rule; of two cloths, the sum of both."""
    if not all(yarns):
        return None
    # Of several yarns, as many as their mean diameter lets lie side by side.
    warp, weft = (
        len(named) / sum(1.0 / yarn.diameters_per_metre for yarn in named) for named in yarns
    )
    drawdowns = [cloth.drawdown[: size[1], : size[0]]]
    layers = cloth.layers
    if layers is not None and layers.ends is not None and layers.picks is not None:
        ends, picks = layers.ends[: size[0]], layers.picks[: size[1]]
        drawdowns = [drawdowns[0][np.ix_(picks == one, ends == one)] for one in (False, True)]
    found = [0.0, 0.0]
    for drawdown in drawdowns:
        of_warp, of_weft = mean_floats(drawdown)
        found[0] += largest_sett(warp, weft, of_weft)
        found[1] += largest_sett(weft, warp, of_warp)
    return found[0], found[1]


def _choose_setts(
    unit: _Unit,
    settings: PlanSettings,
    yarns: FamilyYarns,
    largest: tuple[float, float] | None,
    assumed: list[str],
) -> tuple[float, float]:
    """Choose the setts of warp and weft, and say why where they are not given."""
    warp, weft = (
        _choose_sett(unit, settings, yarns, family, None if largest is None else largest[family])
        for family in (0, 1)
    )
    if warp[1] and warp[1] == weft[1]:
        assumed.append(f"sett of warp and weft: {warp[1]}")
    else:
        pairs = zip(FAMILIES, (warp[1], weft[1]), strict=True)
        assumed += [f"sett of the {family}: {why}" for family, why in pairs if why]
    return warp[0], weft[0]


def _choose_sett(
    unit: _Unit, settings: PlanSettings, yarns: FamilyYarns, family: int, largest: float | None
) -> tuple[float, str]:
    """Return the plan's sett, the scene's, the yarn's or the draft's, and why if not given."""
    given = settings.weft_sett if family else settings.sett
    if given is not None:
        return given, ""
    if family and settings.sett is not None:
        return settings.sett, "as many picks as ends"
    woven, threads = unit.woven, unit.cloth.threads[family]
    drawn = 1.0 / threads.mean_spacing(threads.aspect * threads.mean_diameter)
    in_scene = woven.given_values if isinstance(woven, Parameterised) else {}
    own_names = [parameter_name(each, family) for each in ("sett", "spacing")]
    if not settings.warp_yarn and any(name in in_scene for name in own_names):
        return drawn, ""
    if largest is not None:
        # Setts of two cloths together are published nowhere.
        firmness = settings.firmness
        if firmness is None and unit.cloth.layers is not None:
            firmness = USUAL_SHARE
        wanted, why = suggest_sett(yarns[family], largest, firmness)
        return _round_sett(wanted, settings.units), why
    source = woven.source
    if (source.weft if family else source.warp).spacing is not None:
        return drawn, "as in the draft, which may be only for the screen"
    return drawn, "as drawn; give a yarn or a sett"


def _round_sett(sett: float, units: str) -> float:
    """Round a suggested sett to whole threads in an inch, or to half threads in a centimetre."""
    step = UNITS["1/m"]["/in"] if units == "imperial" else 0.5 * UNITS["1/m"]["/cm"]
    return max(round(sett / step), 1) * step


def _planned_draft(
    unit: _Unit,
    settings: PlanSettings,
    yarns: FamilyYarns,
    assumed: list[str],
) -> PlannedDraft:
    """Return the draft with its colours, masses per length and take-ups."""
    cloth, (ends, picks) = unit.cloth, unit.size
    drawdown = cloth.drawdown[:picks, :ends]
    densities, kinds, take_ups = [], [], []
    for family, count in enumerate(unit.size):
        densities.append(_densities(cloth, family, count, yarns[family]))
        kinds.append(np.arange(count) % max(len(yarns[family]), 1))
        if not yarns[family] and not _has_count(unit.woven, family):
            assumed.append(
                f"yarn of the {FAMILIES[family]}: {1e6 * densities[-1].mean():.3g} tex, from the "
                "thickness that is drawn"
            )
    found = _take_ups(unit, assumed) if None in (settings.take_up, settings.weft_take_up) else ()
    for family, wanted in enumerate((settings.take_up, settings.weft_take_up)):
        given = np.full(unit.size[family], wanted or 0.0)
        take_ups.append(found[family] if wanted is None else given)
    return PlannedDraft(
        drawdown=drawdown,
        loom=unit.woven.source.find_loom(drawdown),
        colors=(
            np.resize(cloth.warp.colors, (ends, 3)),
            np.resize(cloth.weft.colors, (picks, 3)),
        ),
        densities=(densities[0], densities[1]),
        kinds=(kinds[0], kinds[1]),
        take_ups=(take_ups[0], take_ups[1]),
    )


def _has_count(woven: Woven, family: int) -> bool:
    return getattr(woven, parameter_name("count", family), None) is not None


def _densities(cloth: Cloth, family: int, count: int, named: Sequence[Yarn]) -> Floats:
    """Return the mass per length of each yarn of the draft, in kg/m."""
    if named:
        return np.resize([yarn.linear_density for yarn in named], count)
    yarns, bulk = cloth.yarns[family], (cloth.densities or 2 * (COTTON * PACKING,))[family]
    area = section_factor(yarns.aspect, yarns.section) * yarns.diameter**2
    return np.asarray(bulk * area)[:count]


def _take_ups(unit: _Unit, assumed: list[str]) -> tuple[Floats, ...]:
    """Return the take-up of each yarn of the draft: its crimp, floats included."""
    drawn = _crimps(unit.cloth, unit.size)
    found, text = drawn, "take-up: crimp of the cloth as it is drawn"
    if any(threads.aspect > 1.0 for threads in unit.cloth.threads):
        # On the loom yarns are rounder than in the finished cloth, and too short a warp is the
        # costlier mistake.
        round_ones = _crimps(_with_round_yarns(unit), unit.size)
        if not isinstance(round_ones, GeometryError):
            found, text = round_ones, "take-up: crimp of round yarns of the same size"
            if not isinstance(drawn, GeometryError):
                warp, weft = (f"{100 * each.mean():.1f} %" for each in drawn)
                text += f"; flattened as drawn they would take up {warp} (warp), {weft} (weft)"
    if isinstance(found, GeometryError):
        assumed.append(
            f"take-up {100 * _UNKNOWN_TAKE_UP:g} %, because the yarns do not fit: {found.message}"
        )
        return tuple(np.full(count, _UNKNOWN_TAKE_UP) for count in unit.size)
    assumed.append(f"{text}. A sample tells more")
    return found


def _crimps(cloth: Cloth, size: tuple[int, int]) -> tuple[Floats, ...] | GeometryError:
    """Return the crimp of each yarn of a draft, or why its yarns do not fit."""
    try:
        cloth.check()
    except GeometryError as error:
        return error
    return tuple(yarn_crimps(cloth, family)[:count] for family, count in enumerate(size))


def _with_round_yarns(unit: _Unit) -> Cloth:
    """Return the cloth with round yarns of the same section areas."""
    warp, weft = (
        replace(
            threads,
            diameter=np.sqrt(
                section_factor(threads.aspect, threads.shape) / section_factor(1.0, "circular")
            )
            * threads.diameter,
            section="circular",
            aspect=1.0,
        )
        for threads in unit.cloth.threads
    )
    return replace(unit.cloth, warp=warp, weft=weft, crimp_height=None)


def _reeds(settings: PlanSettings) -> tuple[float, ...]:
    if settings.reed is None:
        return IMPERIAL_REEDS if settings.units == "imperial" else METRIC_REEDS
    return settings.reed if isinstance(settings.reed, tuple) else (settings.reed,)


def _or_usual(given: float | None, usual: float) -> float:
    return usual if given is None else given


def _assumed_losses(settings: PlanSettings, losses: Sequence[Losses]) -> list[str]:
    """Return a sentence for each source of draw-in and shrinkages that are not given."""
    warp, weft = losses
    by_source: dict[str, list[str]] = {}
    for name, label, usual, source in (
        ("draw_in", "draw-in", weft.draw_in, weft.source),
        ("shrinkage", "shrinkage in length", warp.shrinkage, warp.source),
        ("width_shrinkage", "shrinkage in width", weft.shrinkage, weft.source),
    ):
        if getattr(settings, name) is None:
            by_source.setdefault(source, []).append(f"{label} {100 * usual:g} %")
    return [f"{', '.join(texts)} ({source})" for source, texts in by_source.items()]
