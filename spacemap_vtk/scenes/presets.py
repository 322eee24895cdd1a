"""Presets of motion: from any scene of a textile to cloth that hangs, lies, falls or swings.

A preset adds to a draft, weave or other textile what a motion needs: the stiffness of its yarns, a
size at which cloth bends under its own weight, a cage, gravity, and what the cloth meets. The
result is an ordinary scene, which `write_scene` saves.

All lengths follow from the bending length c of the cloth (Peirce), the cube root of its bending
rigidity over its weight per area: it decides how wide folds are.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk.errors import InfoMessage, InputError, add_key_to_errors
from spacemap_vtk.filters.textile_sheet import textile_of
from spacemap_vtk.filters.textile_source import TextileSource
from spacemap_vtk.filters.weave_parameters import parameter_name
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.filters.yarn_parameters import WarpAndWeft, YarnParameters
from spacemap_vtk.io.formats.toml import format_scene
from spacemap_vtk.io.output import atomic_file, check_output, write_parts
from spacemap_vtk.mechanics.elements.plates import data_sheet
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values
from spacemap_vtk.textile.geometry.partition import cloth_bounds
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.yarn_library import MATERIALS, parse_yarn
from spacemap_vtk.units import GRAVITY, format_quantity

#: Material of yarns of which none is known.
_MATERIAL = "cotton"
#: Shear rigidity of a double weave, whose yarns are not known to the law of yarns.
_SHEAR = "60 N/m"
#: Stiffness of a crossing against flattening over EA of its yarns, assumed. Hard crossings would
#: make cloth whose yarns are jammed, as thick ones in a tartan, as good as incompressible.
_CONTACT = 0.15
#: Young's modulus of steel [Pa], of which wire meshes are made.
_STEEL = 200e9
#: Side of the cloth over its bending length, unless its size is given.
_SIDE = {"hang": 14.0, "drape": 14.0, "drop": 9.0, "swing": 10.0}
#: A cloth with this share of a draft's repeat is given the whole repeat.
_NEARLY = 0.8
#: Width of a cell over the bending length: sufficient for pictures, within seconds.
_CELL = 0.7
#: The same on a table, at whose rim the cloth bends most.
_CELL_ON_TABLE = 0.5
#: Most cells; more take minutes.
_MOST_CELLS = 1300
#: The same for a curtain.
_MOST_OF_CURTAIN = 4096
#: Fewest cells along the longer side, unless these are narrower than the cloth is thick.
_FEWEST_CELLS = 12
#: The same where cloth falls onto a ball, in time steps, with sharper folds: width and most cells.
_STEPPED_CELL, _STEPPED_CELLS = 0.5, 324
#: Most cells of each motion, and the widest over the bending length; in wider ones sharp folds turn
#: inside out. Then words for an error.
_LARGEST = {
    "hang": (_MOST_OF_CURTAIN, 1.5, "hang", ""),
    "drape": (_MOST_CELLS, 0.8, "drape", "; a larger cloth can hang"),
    "drop": (_STEPPED_CELLS, 0.978, "move in time steps", "; a larger cloth can hang or drape"),
    "swing": (_STEPPED_CELLS, 0.978, "move in time steps", "; a larger cloth can hang or drape"),
}
#: Width of a cell over the bending length from which a note mentions it.
_WIDE_CELL = 1.1
#: Density of air [kg/m3] times the drag coefficient of a square plate across the wind.
_AIR = 1.2 * 1.17
#: Damping ratio of a vibration at the rate (g/c)^½, assumed: yarns rub on each other as they bend.
_FRICTION_OF_YARNS = 0.15
#: Gap between cloth that falls and the ball over the width of a cell: where it is drawn taut, the
#: springs of contact let it sink in by that much.
_FALLING_GAP = 0.05
#: Most Bézier patches of a knit or another textile, whose yarns are all drawn.
_MOST_PATCHES = 250_000
#: Distance of the rings of a curtain over the bending length, if it is flat.
_RING = 2.8
#: Fewest cells across a pleat.
_CELLS_OF_PLEAT = 6
#: Share by which a curtain is drawn together.
_CLOSER = 0.22
#: Force that pushes each pleat to its side, over the weight of the cloth.
_PUSH = 0.01
#: Stiffness of the springs that hold its rings, over the weight of a unit width [1/m].
_PULL = 14.0
#: Radius of its rail over the longer side of the cloth.
_RAIL = 0.012
#: Pressure of the draught that moves it, over its weight per area.
_DRAUGHT = 0.08
#: Radius of the pinned middle of a cloth on a table, in cells.
_PINNED = 2.1
#: Distance of cloth from the table, in cells: springs of contact let it in by up to that much.
_GAP = 0.035
#: A textile that is longer than this multiple of its width is a strip.
_STRIP = 2.2
#: Numbers of repeats of textiles along x and y.
_COUNTS = (("wales", "repeats_across"), ("courses", "repeats_along"))
#: Sections that describe a motion, and are replaced.
_MOTION = ("cage", "contact", "modal", "response", "transient", "motion", "rotation", "warp")


class Preset(NamedTuple):
    """A motion that a textile can be given."""

    label: str
    """Its name in menus."""
    help: str
    """One sentence on what it shows."""


#: How the command line chooses other yarns.
YARN_CURE = '; choose others with --yarn "8/2 cotton" (see "spacemap yarns")'

#: The presets by name.
PRESETS = {
    "hang": Preset("Hang as curtain", "Hang the cloth as a curtain, drawn together on a rail."),
    "drape": Preset(
        "Drape over table", "Lay the cloth on a round table, over which it hangs in folds."
    ),
    "drop": Preset("Drop onto ball", "Let the cloth fall onto a ball; a film shows how it lands."),
    "swing": Preset("Swing from edge", "Let level cloth fall that is held by one edge."),
}


@dataclass
class Plan:
    """What a preset makes of a scene."""

    values: dict[str, Any]
    """The scene's values, as in a scene file in the scene's folder."""
    notes: list[str] = field(default_factory=list)
    """Sentences on what was assumed."""


class _Sheet(NamedTuple):
    """The cloth for which a preset chooses lengths."""

    low: Floats
    """Least coordinates [m], (3,)."""
    high: Floats
    """Largest coordinates [m], (3,)."""
    bending_length: float
    """Mean of both directions [m]."""
    weight: float
    """Weight per area [N/m2]."""

    @property
    def sides(self) -> Floats:
        """Sides along x and y [m]."""
        return (self.high - self.low)[:2]

    @property
    def thickness(self) -> float:
        """Thickness [m]."""
        return float(self.high[2] - self.low[2])

    @property
    def drag(self) -> float:
        """Rate α of a drag at which the level cloth falls as fast in the end as in air [1/s]."""
        # It balances the weight w at the speed (2 w/(ρ c_D))^½.
        return GRAVITY * math.sqrt(_AIR / (2.0 * self.weight))

    @property
    def damping(self) -> float:
        """Time β by which strain rates are resisted [s]."""
        return 2.0 * _FRICTION_OF_YARNS * math.sqrt(self.bending_length / GRAVITY)

    def cells(self, most: int = _MOST_CELLS, share: float = _CELL, multiple: int = 1) -> list[int]:
        """Return numbers of cells along x, y and z; those along x and y are a multiple."""
        width = min(share * self.bending_length, float(self.sides.max()) / _FEWEST_CELLS)
        finest = math.sqrt(float(self.sides.prod()) / most)
        thickest = 1.05 * self.thickness
        width, least = max(width, thickest, finest), max(2, multiple)
        counts = np.rint(self.sides / (multiple * width)), self.sides // (multiple * thickest)
        return [max(least, multiple * int(n)) for n in np.minimum(*counts)] + [1]


def apply(
    scene: Scene | str | Path,
    preset: str,
    *,
    yarn: str | None = None,
    size: Sequence[float] | None = None,
    crossings: int | None = None,
) -> Scene:
    """Make a scene in which a textile moves.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene with a weave or another textile, a draft's file, or the name of a scene that comes
        with the program. It is not changed.
    preset : {"hang", "drape", "drop", "swing"}
        How the textile moves.
    yarn : str, optional
        Name of the yarn of warp and weft, such as ``"8/2 cotton"``. By default that of the scene;
        otherwise yarns of cotton as thick as the scene's.
    size : float or two floats, optional
        Sides of the cloth along x and y [m]. By default about fourteen bending lengths, in
        whole repeats.
    crossings : int, optional
        Most crossings of a weave whose size is not given, for files that contain every yarn.

    Returns
    -------
    Scene
        Its warnings begin with what was assumed.

    Raises
    ------
    InputError
        If the scene has no textile, the yarn is not known, or the textile is no sheet.
    """
    given = scene if isinstance(scene, Scene) else Scene.read(scene)
    plan = make_plan(given, preset, yarn=yarn, size=size, crossings=crossings)
    made = Scene(plan.values, given.file)
    made.plain_warnings = _PLAIN_WARNINGS
    for note in plan.notes:
        made.warn(InfoMessage(note))
    return made


def make_plan(
    scene: Scene,
    preset: str,
    *,
    yarn: str | None = None,
    size: Sequence[float] | None = None,
    crossings: int | None = None,
) -> Plan:
    """Decide the values of the scene that `apply` makes.

    Parameters
    ----------
    scene : Scene
        A scene with a weave or another textile.
    preset : str
        As for `apply`.
    yarn : str, optional
        As for `apply`.
    size : float or two floats, optional
        As for `apply` [m].
    crossings : int, optional
        As for `apply`.

    Returns
    -------
    Plan
        The values and what was assumed.
    """
    if preset not in PRESETS:
        raise InputError("unknown preset", key="preset", value=preset, allowed=", ".join(PRESETS))
    source = scene.source
    if not isinstance(source, (WeaveSource, TextileSource)):
        raise InputError(
            "only a textile can hang, drape, drop or swing",
            key=f"--{preset}",
            cure="Open a draft, or a scene with a section [weave] or [textile].",
        )
    if yarn is not None:
        with add_key_to_errors("yarn"):
            parse_yarn(yarn)
    values = scene_values(scene)
    for section in (*_MOTION, "animation"):
        values.pop(section, None)
    values.get("surface", {}).pop("subdivisions", None)  # chosen for another size of cloth
    view = values.setdefault("view", {})
    for key in ("camera", "show", "time", "color", "zoom", "position", "focal_point", "supports"):
        view.pop(key, None)
    plan = Plan(values)
    prepare = _prepare_weave if isinstance(source, WeaveSource) else _prepare_textile
    sides = _sides(size) if size is not None else None
    sheet = prepare(plan, scene, _SIDE[preset], yarn, sides, crossings)
    if sides is not None:
        _check_size(preset, sheet)
    title = split_title(scene.title)[0] or "Cloth"
    values["title"] = f"{title}: {PRESETS[preset].label.lower()}"
    _MAKERS[preset](values, sheet)
    if sides is not None:
        _note_cells(plan, sheet)
    values["warp"] = {"smooth": True}
    values["view"] = {"camera": "lying", "supports": False, **view, **values["view"]}
    return plan


def _check_size(preset: str, sheet: _Sheet) -> None:
    """Refuse cloth whose cells would be too wide for its folds, which then turn inside out."""
    most, widest, motion, cure = _LARGEST[preset]
    largest = widest * sheet.bending_length * math.sqrt(most)
    area = float(sheet.sides.prod())
    if area > largest**2:
        raise InputError(
            f"cloth of {_length(math.sqrt(area))} is too large to {motion}, as its bending length "
            f"is {_length(sheet.bending_length)}",
            key="size",
            allowed=f"a side of at most {_length(largest)}, if it is square",
            cure=f"Choose a smaller size or a stiffer yarn{cure}.",
        )


def _note_cells(plan: Plan, sheet: _Sheet) -> None:
    """Note that cells are wide."""
    cell = float((sheet.sides / plan.values["cage"]["divisions"][:2]).max())
    if cell > _WIDE_CELL * sheet.bending_length:
        plan.notes.append(
            f"cloth this large has cells of {_length(cell)}, at a bending length of "
            f"{_length(sheet.bending_length)}: its sharpest folds are rounder in reality"
        )


def split_title(title: str) -> tuple[str, str]:
    """Split the motion that a preset has added off a title.

    Parameters
    ----------
    title : str
        Title of a scene.

    Returns
    -------
    tuple of str
        The title of the textile, and what the preset has added; empty without a preset.
    """
    for preset in PRESETS.values():
        motion = f": {preset.label.lower()}"
        if title.endswith(motion):
            return title.removesuffix(motion), motion
    return title, ""


def write_scene(scene: Scene, file: Path) -> None:
    """Save a scene as a file that gives the same picture.

    Parameters
    ----------
    scene : Scene
        Any scene.
    file : Path
        A ``.toml`` file; paths of other files are relative to its folder.
    """
    check_output(file, {".toml": "scene"})
    text = format_preset(scene_values(scene, file.resolve().parent))
    with atomic_file(file) as path:
        write_parts(path, [text.encode()])


def format_preset(values: Mapping[str, Any]) -> str:
    """Return the text of a scene file with comments on the keys that presets set.

    Parameters
    ----------
    values : mapping
        Values as in a scene file.

    Returns
    -------
    str
        TOML.
    """
    return format_scene(
        values, "All lengths follow from the bending length of the cloth.", _REMARKS
    )


def _sides(size: Any) -> tuple[float, ...]:
    """Return the two sides of a cloth [m], of one or two numbers."""
    try:
        sides = np.broadcast_to(np.asarray(size, np.float64), 2)
    except (TypeError, ValueError):
        sides = np.zeros(2)
    if not (np.isfinite(sides) & (sides > 0.0)).all():
        raise InputError(
            "must be a size of cloth",
            key="size",
            value=size,
            allowed="one or two numbers greater than 0, in m",
        )
    return tuple(sides.tolist())


def _prepare_weave(
    plan: Plan,
    scene: Scene,
    share: float,
    yarn: str | None,
    size: tuple[float, ...] | None,
    most: int | None,
) -> _Sheet:
    """Choose yarns and size of a weave; return the sheet that it forms."""
    values, weave = plan.values, plan.values.setdefault("weave", {})
    if yarn is not None:
        _use_yarn(plan, weave, yarn)
    small = Scene({"weave": weave}, scene.file)
    source = small.part(WeaveSource)
    yarns = dict(values.get("yarns", {}))
    known = {"tension", "modulus"} & yarns.keys() and "bending" in yarns
    if not known:
        yarns |= _yarns_of_weave(plan, source)
    if not {"contact", "van_wyk", "contact_curve", "flattest"} & yarns.keys():
        tension = math.sqrt(math.prod(_tensions(source, yarns)))
        yarns["contact"] = _rounded(_CONTACT * tension, "N")
    values["yarns"] = yarns
    values["modal"] = {"elements": "sheet"}
    cloth = source.cloth
    cloth.check()
    if cloth.layers is None:
        values["modal"] |= {"material": "yarns", "law": "linear"}
    else:
        values["modal"] |= _layered_figures(source, yarns)
        values.pop("yarns")
        plan.notes.append(f"both cloths of the double weave together are sheared with {_SHEAR}")
    own = YarnParameters(**{k: v for k, v in yarns.items() if k in YarnParameters.parameters})
    solver = Scene({"modal": values["modal"]}).modal
    mass = float(fabric_figures(cloth)["areal_mass"])
    plate, mass = solver.sheet_stiffness(
        1e-3, 2, mass, cloth, None if cloth.layers is not None else own
    )
    length = math.sqrt(math.prod(data_sheet(plate, mass).bending_length))
    assigned = scene.assigned
    target = size or (share * length,) * 2
    counts, drafted = [], source.source.size
    for axis, (key, threads) in enumerate(zip(("ends", "picks"), cloth.threads, strict=True)):
        repeat, wanted = drafted[axis], target[axis] / threads.mean_spacing(1e-3)
        if size is None and wanted > _NEARLY * repeat:
            wanted = repeat * max(1, round(wanted / repeat))
        counts.append(int(weave[key]) if ("weave", key) in assigned else max(2, round(wanted)))
    if size is None and most is not None and math.prod(counts) > most:
        share = math.sqrt(most / math.prod(counts))
        counts = [max(2, round(share * count)) for count in counts]
        plan.notes.append(
            f"the file contains every yarn, so that the cloth has only {counts[0]} ends and "
            f"{counts[1]} picks; --cloth-size makes it larger"
        )
    for axis, key in enumerate(("ends", "picks")):
        weave[key] = counts[axis]
    if source.draft is not None and any(c < d for c, d in zip(counts, drafted, strict=True)):
        plan.notes.append(
            f"the cloth shows {counts[0]} of {drafted[0]} ends and {counts[1]} of {drafted[1]} "
            "picks of the draft; --cloth-size shows more of it"
        )
    box = cloth_bounds(Scene({"weave": weave}, scene.file).part(WeaveSource).cloth).reshape(3, 2)
    return _Sheet(box[:, 0], box[:, 1], length, mass * GRAVITY)


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
    plan.notes.append(f"{yarn.name} is woven with {usual / 100:.3g} yarns per cm, {how}")


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
        bending.append(_rounded(fibre.bending(mean), "N.m2"))
        size = "" if named else " (thickness assumed)" * (cloth.threads[family].size == "assumed")
        words.append(name or f"{_MATERIAL} of {_rounded(mean, 'kg/m')}{size}")
    both = f"of {words[0]}" if words[0] == words[1] else f"of {words[0]} and {words[1]}"
    chosen = any(getattr(source, parameter_name("yarn", family)) for family in (0, 1))
    cure = "" if chosen else YARN_CURE
    plan.notes.append(f"the yarns are taken to be {both}{cure}")
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
        "tensile_rigidity": [_rounded(t * n, "N/m") for t, n in zip(tension, setts, strict=True)],
        "bending_rigidity": [_rounded(b * n, "N.m") for b, n in zip(bending, setts, strict=True)],
        "shear_rigidity": _SHEAR,
        "poissons_ratio_in_plane": 0.0,
    }


def _prepare_textile(
    plan: Plan,
    scene: Scene,
    share: float,
    yarn: str | None,
    size: tuple[float, ...] | None,
    _most: int | None,
) -> _Sheet:
    """Choose yarns and size of a textile; return the sheet that it forms."""
    values, textile = plan.values, plan.values.setdefault("textile", {})
    if yarn is not None:
        named = parse_yarn(yarn)
        width = 2.0 * math.sqrt(named.linear_density / named.bulk_density / math.pi)
        textile["diameter"] = _rounded(width, "m")
        textile["fibre_density"] = named.material.density
        textile["packing"] = named.material.packing
        plan.notes.append(f"the yarns are {named.name}, {textile['diameter']} thick")
    source = Scene({"textile": textile}, scene.file).part(TextileSource)
    if not {"tension", "bending"} <= textile.keys():
        textile |= _yarns_of_textile(plan, source, yarn)
    if source.kind == "knit" and "set_share" not in textile:
        textile["set_share"] = 1.0
        plan.notes.append("the knit is blocked (its set share is 1), so that it does not curl")
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
        values["modal"]["areal_mass"] = _rounded(mass, "kg/m2")
    else:
        mass = float(woven.GetValue(0))
    length = math.sqrt(math.prod(data_sheet(plate, mass).bending_length))
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
    return _Sheet(box[:, 0], box[:, 1], length, mass * GRAVITY)


def _output(scene: Scene) -> Any:
    """Return the yarns that the source of a scene makes."""
    scene.update_stage(scene.source)
    return scene.source.output


def _yarns_of_textile(plan: Plan, source: TextileSource, yarn: str | None) -> dict[str, Any]:
    """Return tension and bending of the yarns of a textile."""
    width = float(np.max(source.yarn_diameters))
    mass = float(np.max(source.linear_densities))
    if source.kind == "mesh":
        plan.notes.append(f"the wires are taken to be of steel, {_rounded(width, 'm')} thick")
        tension, bending = _STEEL * math.pi * width**2 / 4, _STEEL * math.pi * width**4 / 64
    else:
        material = MATERIALS[parse_yarn(yarn).word if yarn else _MATERIAL]
        tension, bending = material.fibre.yarn_modulus * mass, material.fibre.bending(mass)
        if yarn is None:
            plan.notes.append(
                f"the yarns are taken to be {_MATERIAL} of {_rounded(mass, 'kg/m')}{YARN_CURE}"
            )
    return {"tension": _rounded(tension, "N"), "bending": _rounded(bending, "N.m2")}


def _rounded(value: float, unit: str) -> str:
    """Format a value with three digits and its unit."""
    return format_quantity(value, unit, 3)


def _lengths(*values: float, digits: int = 6) -> list[Any]:
    """Format lengths [m] as in a scene file."""
    # With more digits than sizes, as supports must meet vertices of the cage; the middle of a cloth
    # is zero up to rounding.
    return [format_quantity(value, "m", digits) if abs(value) > 1e-12 else 0.0 for value in values]


def _length(value: float) -> str:
    return _rounded(value, "m")


def _hang(values: dict[str, Any], sheet: _Sheet) -> None:
    """Hang cloth from rings that slide along a rail and are drawn together; strips from a line."""
    # Each ring is drawn towards the middle by a spring and a force, which together move it by a
    # share of its distance. Only one face is held along z, so that pleats turn about the rings.
    width, height = map(float, sheet.sides)
    modal = values["modal"] | {"gravity": [0.0, "-1 g", 0.0], "modes": 50}
    cells = sheet.cells()
    most = math.sqrt(_MOST_OF_CURTAIN / 0.6 * width / height) / _CELLS_OF_PLEAT
    pleats = 2 * round(0.5 * min(width / (_RING * sheet.bending_length), most))
    if pleats < 2:
        modal["fixed"] = "+y"
    else:
        across = pleats * max(_CELLS_OF_PLEAT, round(cells[0] / pleats))
        cells = [across, max(3, round(across * height / width * 0.6)), 1]
        spring, push = (
            share * sheet.weight * height * length
            for share, length in ((_PULL, 1.0), (_PUSH, width))
        )
        top, faces = float(sheet.high[1]), (float(sheet.low[2]), float(sheet.high[2]))
        places = np.linspace(sheet.low[0], sheet.high[0], pleats + 1).tolist()
        between = [0.5 * sum(pair) for pair in itertools.pairwise(places)]
        others = [x for x in places if x != places[pleats // 2]]

        # Finer than the cloth is thick, so that each ring still holds its vertices.
        fine = 10.0 ** math.floor(math.log10(0.1 * sheet.thickness))

        def place(value: float) -> str:
            return format_quantity(float(f"{round(value / fine) * fine:.12g}"), "m")

        def ring(x: float, z: float, radius: float) -> str:
            return f"sphere({', '.join(map(place, (x, top, z, radius)))})"

        both = {x: ring(x, 0.5 * sum(faces), 0.6 * sheet.thickness) for x in places}
        one = {x: ring(x, faces[0], 0.5 * sheet.thickness) for x in places}
        modal["fixed"] = [f"{both[x]}:y {one[x]}:{'z' if x in others else 'xz'}" for x in places]
        modal["springs"] = [f"{both[x]}:x {_rounded(spring, 'N/m')}" for x in others]
        drawn = spring * _CLOSER
        loads = [(x, (drawn * (places[pleats // 2] - x), 0.0, 0.0)) for x in others]
        # Pleats go to the front and to the back in turn.
        loads += [(x, (0.0, 0.0, (-1) ** n * push)) for n, x in enumerate(between)]
        # In the middle between both faces, which share a force: at one of them it would turn it.
        modal["dead_loads"] = [
            {
                "force": [_rounded(each, "N") if each else 0.0 for each in force],
                "at": [place(x), place(top), 0.0],
            }
            for x, force in loads
        ]
    # The rail shows what holds the cloth, which hangs just below and does not touch it.
    radius, gap = _RAIL * max(width, height), 0.7 * sheet.thickness
    middle = 0.5 * (sheet.low + sheet.high)
    modal["obstacles"] = [
        {
            "shape": "cylinder",
            "radius": _length(radius),
            "height": _length(width + 8.0 * radius),
            "axis": [1.0, 0.0, 0.0],
            "center": _lengths(middle[0], sheet.high[1] + gap + radius, middle[2], digits=4),
        }
    ]
    values["modal"] = modal
    values["cage"] = {"divisions": cells}
    values["response"] = {
        "damping_ratio": 0.08,
        "loads": [
            {
                "pressure": _rounded(_DRAUGHT * sheet.weight, "Pa"),
                "on": "-z",
                "time": "table",
                "times": ["0 s", "0.2 s", "0.5 s"],
                "values": [0.0, 1.0, 0.0],
            }
        ],
    }
    values["rotation"] = {}
    values["view"] |= {"camera": "three-quarter"}
    values["animation"] = {"stop": "3 s"}


def _drape(values: dict[str, Any], sheet: _Sheet) -> None:
    """Lay cloth on a round table, or a strip over a rod."""
    width, height = sheet.sides
    side = float(min(width, height))
    x, y, z = 0.5 * (sheet.low + sheet.high)
    z = float(sheet.low[2])
    if max(width, height) > _STRIP * side:
        # A row of pins along the top of the rod, which needs vertices in the middle.
        cells, long = sheet.cells(_MOST_CELLS, _CELL_ON_TABLE), int(height > width)
        cells[long] += cells[long] % 2
        near = 0.3 * float(max(width, height)) / cells[long]
        span = f"{_length(-near)}, {_length(near)}"
        fixed = (
            f"box(-inf, inf, {span}, -inf, inf)" if long else f"box({span}, -inf, inf, -inf, inf)"
        )
        radius = 0.08 * float(max(width, height))
        along = [1.0, 0.0, 0.0] if height > width else [0.0, 1.0, 0.0]
        obstacles: list[dict[str, Any]] = [
            {
                "shape": "cylinder",
                "radius": _length(radius),
                "height": _length(1.5 * side),
                "axis": along,
                "center": _lengths(x, y, z - radius),
            }
        ]
    else:
        # Pins around the middle hold the cloth, as its symmetry would: with friction alone the
        # search stops where a corner happens to stick. There are pins in cells twice as wide, too,
        # in which the search begins.
        cells = sheet.cells(_MOST_CELLS, _CELL_ON_TABLE, multiple=4)
        cell = float(max(sheet.sides / cells[:2]))
        middle = _lengths(x, y, z, _PINNED * cell + sheet.thickness)
        fixed = f"sphere({', '.join(map(str, middle))})"
        # A sharper rim would turn the cloth by too much within a cell.
        thick, gap = max(0.08 * side, 2.8 * cell), _GAP * cell
        z -= gap
        # A corner hangs lower than the table's top by half a diagonal less the radius, at most.
        leg = 0.5 * float(math.hypot(width, height)) - 0.2 * side
        obstacles = [
            {
                "shape": "disc",
                "radius": _length(0.3 * side),
                "height": _length(thick),
                "rounding": _length(0.43 * thick),
                "center": _lengths(x, y, z),
                "gap": _length(gap),
            },
            {
                "shape": "cylinder",
                "radius": _length(0.043 * side),
                "height": _length(leg + 0.06 * side),  # its round ends are inside the others
                "center": _lengths(x, y, z - thick - 0.5 * leg),
            },
            {
                "shape": "disc",
                "radius": _length(0.2 * side),
                "height": _length(0.045 * side),
                "center": _lengths(x, y, z - thick - leg),
            },
            {"shape": "plane", "center": _lengths(0.0, 0.0, z - thick - leg - 0.045 * side)},
        ]
    values["modal"] |= {
        "gravity": [0.0, 0.0, "-1 g"],
        "fixed": fixed,
        "modes": 12,
        "obstacles": obstacles,
    }
    values["cage"] = {"divisions": cells}
    values["response"] = {"damping_ratio": 0.08}
    values["animation"] = {"stop": "8 s", "orbit": 360.0}  # it lies still


def _drop(values: dict[str, Any], sheet: _Sheet) -> None:
    """Let cloth fall onto a ball on a stand, in time steps."""
    side = float(min(sheet.sides))
    x, y, z = 0.5 * (sheet.low + sheet.high)
    radius, cells = 0.27 * side, sheet.cells(_STEPPED_CELLS, _STEPPED_CELL)
    # Off the middle by a fiftieth, as nothing falls exactly onto the middle.
    x, y, z = x + 0.02 * side, y - 0.013 * side, float(sheet.low[2]) - 0.1 * side - radius
    values["modal"] |= {
        "fixed": "",
        "hang": False,
        "modes": 6,
        "obstacles": [
            {
                "shape": "sphere",
                "radius": _length(radius),
                "center": _lengths(x, y, z),
                "friction": 0.3,
                "gap": _length(_FALLING_GAP * side / min(cells[:2])),
            },
            {
                "shape": "cylinder",
                "radius": _length(0.07 * side),
                "height": _length(0.5 * side),
                "center": _lengths(x, y, z - radius - 0.23 * side),
            },
        ],
    }
    values["cage"] = {"divisions": cells}
    # The cloth embraces the ball after 1.1 of these units, rises a little and comes to rest.
    span = _tidy(3.9 * math.sqrt(side / GRAVITY))
    values["transient"] = {
        "gravity": [0.0, 0.0, "-1 g"],
        "alpha": float(f"{sheet.drag:.2g}"),
        "beta": f"{_tidy(1e3 * sheet.damping)} ms",
        "tolerance": 1.0,
        "duration": f"{span} s",
    }
    values["view"] |= {"time": f"{_tidy(0.45 * span)} s"}
    values["animation"] = {"stop": f"{span} s", "speed": 0.2}


def _swing(values: dict[str, Any], sheet: _Sheet) -> None:
    """Let level cloth fall that is held by one edge, in time steps."""
    period = 2.0 * math.pi * math.sqrt(2.0 * float(sheet.sides[1]) / (3.0 * GRAVITY))
    # One face of the edge is held: a hinge.
    top = float(sheet.high[1]) - 0.01 * float(sheet.sides[1])
    middle = float(sheet.low[2] + sheet.high[2]) / 2
    fixed = f"box(-inf, inf, {_length(top)}, inf, {_length(middle)}, inf)"
    values["modal"] |= {"fixed": fixed, "modes": 6}
    # No fold is sharp: cells of 0.55 bending lengths turn by 22° at most.
    values["cage"] = {"divisions": sheet.cells(_STEPPED_CELLS)}
    span = _tidy(2.0 * period)
    values["transient"] = {
        "gravity": [0.0, 0.0, "-1 g"],
        "alpha": 1.5,
        "beta": "3 ms",
        "tolerance": 1.0,
        "duration": f"{span} s",
    }
    values["view"] |= {"time": f"{_tidy(0.2 * period)} s"}
    values["animation"] = {"stop": f"{span} s", "speed": 0.5}


def _tidy(value: float) -> float:
    """Round to two digits."""
    return float(f"{value:.2g}")


_MAKERS: dict[str, Callable[[dict[str, Any], _Sheet], None]] = {
    "hang": _hang,
    "drape": _drape,
    "drop": _drop,
    "swing": _swing,
}

_SHARP_FOLDS = (
    "some folds are sharper than the cells of the cloth show them; a smaller or stiffer cloth "
    "(--cloth-size, --yarn) has wider ones, and --set cage.divisions=auto makes finer cells, which "
    "take longer"
)
_STRETCHED = (
    "the yarns straighten or flatten where the cloth is stretched or compressed most; real cloth "
    "is stiffer there"
)
#: Warnings about limits without keys that the user never wrote.
_PLAIN_WARNINGS = {
    "fold": _SHARP_FOLDS,
    "lean": _SHARP_FOLDS,
    "thick_fold": "in the sharpest folds yarns overlap; thinner or stiffer ones (--yarn) do not",
    "law": _STRETCHED,
    "strain": _STRETCHED,
    "locked": "neighbouring yarns overlap where the cloth is sheared most; a looser sett has room",
}

#: Comments on keys of scenes that presets make.
_REMARKS = {
    ("cage", "divisions"): "cells as wide as half a bending length or more; finer ones take longer",
    ("modal", "material"): "stiffness from [yarns]",
    ("modal", "law"): "stress is the stiffness of the yarns times the strain",
    ("modal", "gravity"): "the motion starts from the equilibrium under it",
    ("modal", "obstacles"): "what the cloth meets",
    ("modal", "springs"): "each draws a ring towards the middle, with a force of dead_loads",
    ("modal", "hang"): "the cloth starts where it is",
    ("yarns", "bending"): "twice that of fibres that slide freely",
    ("yarns", "contact"): "crossings flatten; assumed",
    ("warp", "smooth"): "no kinks between the cage's cells",
    ("rotation", ""): "no artificial stretch at large rotations",
    ("transient", "alpha"): "drag of the air",
    ("transient", "beta"): "yarns rub on each other as the cloth bends; assumed",
    ("transient", "tolerance"): "sufficient for pictures",
}
