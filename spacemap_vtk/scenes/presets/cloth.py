"""Yarns, stiffness and size of a textile that a preset moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile_sheet import textile_of
from spacemap_vtk.filters.textile_source import TextileSource
from spacemap_vtk.filters.weave_parameters import parameter_name
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.filters.yarn_parameters import WarpAndWeft, YarnParameters
from spacemap_vtk.mechanics.elements.plates import data_sheet
from spacemap_vtk.scenes.presets.plan import Plan
from spacemap_vtk.scenes.presets.sheet import Sheet, rounded
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.partition import cloth_bounds
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.yarn_library import MATERIALS, parse_yarn
from spacemap_vtk.units import GRAVITY

#: Material of yarns of which none is known.
_MATERIAL = "cotton"
#: Shear rigidity of a double weave, whose yarns are not known to the law of yarns.
_SHEAR = "60 N/m"
#: Stiffness of a crossing against flattening over EA of its yarns, assumed. Hard crossings would
#: make cloth whose yarns are jammed, as thick ones in a tartan, as good as incompressible.
_CONTACT = 0.15
#: Young's modulus of steel [Pa], of which wire meshes are made.
_STEEL = 200e9
#: A cloth with this share of a draft's repeat is given the whole repeat.
_NEARLY = 0.8
#: Most Bézier patches of a knit or another textile, whose yarns are all drawn.
_MOST_PATCHES = 250_000
#: Numbers of repeats of textiles along x and y.
_COUNTS = (("wales", "repeats_across"), ("courses", "repeats_along"))
#: How other yarns are chosen: on the command line, and in the window.
_OTHER_YARNS = (
    'choose others with --yarn "8/2 cotton" (see "spacemap yarns")',
    "to choose others, undo this and set Warp yarn and Weft yarn",
)

#: Refuses the wanted size of cloth with this bending length [m], before it is made.
CheckSize = Callable[[float], None]


def prepare_weave(
    plan: Plan,
    scene: Scene,
    share: float,
    yarn: str | None,
    size: tuple[float, ...] | None,
    most: int | None,
    check_size: CheckSize,
) -> Sheet:
    """Choose yarns and size of a weave; return the sheet that it forms."""
    values, weave = plan.values, plan.values.setdefault("weave", {})
    if yarn is not None:
        _use_yarn(plan, weave, yarn)
    source = Scene({"weave": weave}, scene.file).part(WeaveSource)
    cloth = source.cloth
    yarns = _choose_stiffness(plan, source)
    solver = Scene({"modal": values["modal"]}).modal
    mass = float(fabric_figures(cloth)["areal_mass"])
    plate, mass = solver.sheet_stiffness(1e-3, 2, mass, cloth, yarns)
    length = math.sqrt(math.prod(data_sheet(plate, mass).bending_length))
    check_size(length)
    _choose_threads(plan, scene, source, size, share * length, most)
    box = cloth_bounds(Scene({"weave": weave}, scene.file).part(WeaveSource).cloth).reshape(3, 2)
    return Sheet(box[:, 0], box[:, 1], length, mass * GRAVITY)


def _choose_stiffness(plan: Plan, source: WeaveSource) -> YarnParameters | None:
    """Fill in [modal], and [yarns] of a single weave; return the parameters of these yarns."""
    values, cloth = plan.values, source.cloth
    yarns = dict(values.get("yarns", {}))
    known = {"tension", "modulus"} & yarns.keys() and "bending" in yarns
    if not known:
        yarns |= _yarns_of_weave(plan, source)
    if not {"contact", "van_wyk", "contact_curve", "flattest"} & yarns.keys():
        tension = math.sqrt(math.prod(_tensions(source, yarns)))
        yarns["contact"] = rounded(_CONTACT * tension, "N")
    cloth.check()
    if cloth.layers is not None:
        values.pop("yarns", None)
        values["modal"] = {"elements": "sheet", **_layered_figures(source, yarns)}
        plan.note(f"both cloths of the double weave together are sheared with {_SHEAR}")
        return None
    values["yarns"] = yarns
    values["modal"] = {"elements": "sheet", "material": "yarns", "law": "linear"}
    return YarnParameters(**{k: v for k, v in yarns.items() if k in YarnParameters.parameters})


def _choose_threads(
    plan: Plan,
    scene: Scene,
    source: WeaveSource,
    size: tuple[float, ...] | None,
    side: float,
    most: int | None,
) -> None:
    """Choose numbers of ends and picks: for a size, or for about a side in whole repeats."""
    weave, threads, drafted = plan.values["weave"], source.cloth.threads, source.source.size
    counts = []
    for axis, key in enumerate(("ends", "picks")):
        target = size[axis] if size is not None else side
        repeat, wanted = drafted[axis], target / threads[axis].mean_spacing(1e-3)
        if size is None and wanted > _NEARLY * repeat:
            wanted = repeat * max(1, round(wanted / repeat))
        is_given = ("weave", key) in scene.assigned
        counts.append(int(weave[key]) if is_given else max(2, round(wanted)))
    if size is None and most is not None and math.prod(counts) > most:
        share = math.sqrt(most / math.prod(counts))
        counts = [max(2, round(share * count)) for count in counts]
        plan.note(
            f"the file contains every yarn, so that the cloth has only {counts[0]} ends and "
            f"{counts[1]} picks",
            "--cloth-size makes it larger",
            "more Ends and Picks make it larger",
        )
    weave["ends"], weave["picks"] = counts
    if source.draft is not None and any(c < d for c, d in zip(counts, drafted, strict=True)):
        plan.note(
            f"the cloth shows {counts[0]} of {drafted[0]} ends and {counts[1]} of {drafted[1]} "
            "picks of the draft",
            "--cloth-size shows more of it",
            "more Ends and Picks show more of it",
        )


def _use_yarn(plan: Plan, weave: dict[str, Any], name: str) -> None:
    """Weave with a yarn of the library, at its usual sett."""
    yarn = parse_yarn(name)
    sett = yarn.published.plain_sett if yarn.published else None
    # Ashenhurst: in plain weave each yarn leaves room for another one beside it.
    usual = sett or 0.5 * yarn.diameters_per_metre
    for family in (0, 1):
        for quantity in ("diameter", "count", "spacing", "crimp"):
            weave.pop(parameter_name(quantity, family), None)
        weave[parameter_name("yarn", family)] = yarn.name
        weave[parameter_name("sett", family)] = f"{usual / 100:.3g} /cm"
    weave.pop("warp_crimp_height", None)
    how = "its usual sett" if sett else "half of Ashenhurst's diameters"
    plan.note(f"{yarn.name} is woven with {usual / 100:.3g} yarns per cm, {how}")


def _yarns_of_weave(plan: Plan, source: WeaveSource) -> dict[str, Any]:
    """Return the section [yarns] for the yarns of a weave."""
    cloth, densities = source.cloth, source.linear_densities
    if densities is None:
        raise InputError("the yarns of this cloth have no mass", key="weave", value="densities")
    ends, moduli, bending, words = cloth.size[0], [], [], []
    for family, own in enumerate((densities[:ends], densities[ends:])):
        named = getattr(source, parameter_name("yarn", family))
        name = named[0] if isinstance(named, tuple) else named
        material = MATERIALS[parse_yarn(name).word if name else _MATERIAL]
        fibre, mean = material.fibre, float(np.mean(own))
        moduli.append(f"{fibre.yarn_modulus / 1e4:.3g} cN/tex")
        bending.append(rounded(fibre.bending(mean), "N.m2"))
        size = "" if named else " (thickness assumed)" * (cloth.threads[family].size == "assumed")
        words.append(name or f"{_MATERIAL} of {rounded(mean, 'kg/m')}{size}")
    both = f"of {words[0]}" if words[0] == words[1] else f"of {words[0]} and {words[1]}"
    chosen = any(getattr(source, parameter_name("yarn", family)) for family in (0, 1))
    cures = () if chosen else _OTHER_YARNS
    plan.note(f"the yarns are taken to be {both}", *cures)
    return {
        "inextensible": False,
        "modulus": moduli[0] if moduli[0] == moduli[1] else moduli,
        "bending": bending[0] if bending[0] == bending[1] else bending,
    }


def _tensions(source: WeaveSource, yarns: Mapping[str, Any]) -> tuple[float, float]:
    """Return EA of a warp yarn and of a weft yarn [N]."""
    known = YarnParameters(**yarns)
    tension = WarpAndWeft.pair(known.tension)
    if tension is not None:
        return tension[0], tension[1]
    modulus, densities = WarpAndWeft.pair(known.modulus), source.linear_densities
    assert modulus is not None
    assert densities is not None
    ends = source.cloth.size[0]
    return modulus[0] * float(np.mean(densities[:ends])), modulus[1] * float(
        np.mean(densities[ends:])
    )


def _layered_figures(source: WeaveSource, yarns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a double weave, whose two cloths slide on each other."""
    tension = _tensions(source, yarns)
    bending = WarpAndWeft.pair(YarnParameters(**yarns).bending)
    assert bending is not None
    setts = [1.0 / threads.mean_spacing(1e-3) for threads in source.cloth.threads]
    return {
        "tensile_rigidity": [rounded(t * n, "N/m") for t, n in zip(tension, setts, strict=True)],
        "bending_rigidity": [rounded(b * n, "N.m") for b, n in zip(bending, setts, strict=True)],
        "shear_rigidity": _SHEAR,
        "poissons_ratio_in_plane": 0.0,
    }


def prepare_textile(
    plan: Plan,
    scene: Scene,
    share: float,
    yarn: str | None,
    size: tuple[float, ...] | None,
    _most: int | None,
    check_size: CheckSize,
) -> Sheet:
    """Choose yarns and size of a textile; return the sheet that it forms."""
    values, textile = plan.values, plan.values.setdefault("textile", {})
    if yarn is not None:
        named = parse_yarn(yarn)
        width = 2.0 * math.sqrt(named.linear_density / named.bulk_density / math.pi)
        textile["diameter"] = rounded(width, "m")
        textile["fibre_density"] = named.material.density
        textile["packing"] = named.material.packing
        plan.note(f"the yarns are {named.name}, {textile['diameter']} thick")
    source = Scene({"textile": textile}, scene.file).part(TextileSource)
    if not {"tension", "bending"} <= textile.keys():
        textile |= _yarns_of_textile(plan, source, yarn)
    if source.kind == "knit" and "set_share" not in textile:
        textile["set_share"] = 1.0
        plan.note("the knit is blocked (its set share is 1), so that it does not curl")
    values["modal"] = {"elements": "sheet", "material": "yarns", "law": "linear"}
    small = Scene({"textile": textile}, scene.file)
    data = _output(small)
    solver = Scene({"modal": values["modal"]}).modal
    plate, _ = solver.sheet_stiffness(1e-3, cloth=textile_of(data))
    sides = np.ptp(np.reshape(data.GetBounds(), (3, 2)), axis=1)[:2]
    woven = data.GetFieldData().GetArray("areal_mass")
    if woven is None:  # of a strip, whose yarns repeat themselves along one axis only
        figures = {figure.key: figure.value for figure in source.figures}
        mass = float(figures["linear_mass"] or 0.0) / float(sides[0])
        values["modal"]["areal_mass"] = rounded(mass, "kg/m2")
    else:
        mass = float(woven.GetValue(0))
    length = math.sqrt(math.prod(data_sheet(plate, mass).bending_length))
    check_size(length)
    target = np.array(size or (share * length,) * 2)
    counts: list[str | None] = [
        next((key for key in keys if not source.disabled_by(key)), None) for keys in _COUNTS
    ]
    free = [key is not None and ("textile", key) not in scene.assigned for key in counts]
    factors = np.where(free, target / sides, 1.0)
    patches = data.GetNumberOfCells() * float(factors.prod())
    if size is None and patches > _MOST_PATCHES:
        factors[free] *= (_MOST_PATCHES / patches) ** (1.0 / sum(free))
    for key, factor, wanted in zip(counts, factors, free, strict=True):
        if key is not None and wanted:
            textile[key] = max(2, round(getattr(small.part(TextileSource), key) * float(factor)))
    box = np.reshape(_output(Scene({"textile": textile}, scene.file)).GetBounds(), (3, 2))
    return Sheet(box[:, 0], box[:, 1], length, mass * GRAVITY)


def _output(scene: Scene) -> Any:
    """Return the yarns that the source of a scene makes."""
    scene.update_stage(scene.source)
    return scene.source.output


def _yarns_of_textile(plan: Plan, source: TextileSource, yarn: str | None) -> dict[str, Any]:
    """Return tension and bending of the yarns of a textile."""
    width = float(np.max(source.yarn_diameters))
    mass = float(np.max(source.linear_densities))
    if source.kind == "mesh":
        plan.note(f"the wires are taken to be of steel, {rounded(width, 'm')} thick")
        tension, bending = _STEEL * math.pi * width**2 / 4, _STEEL * math.pi * width**4 / 64
    else:
        material = MATERIALS[parse_yarn(yarn).word if yarn else _MATERIAL]
        tension, bending = material.fibre.yarn_modulus * mass, material.fibre.bending(mass)
        if yarn is None:
            plan.note(
                f"the yarns are taken to be {_MATERIAL} of {rounded(mass, 'kg/m')}",
                _OTHER_YARNS[0],
                "set others by Tension and Bending of the textile",
            )
    return {"tension": rounded(tension, "N"), "bending": rounded(bending, "N.m2")}
