"""Give a textile a motion: what is asked of a preset, and what is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.textile_source import TextileSource
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.scenes.presets.cloth import prepare_textile, prepare_weave
from spacemap_vtk.scenes.presets.motions import MOTION_OF_PRESET, Motion
from spacemap_vtk.scenes.presets.plan import PRESETS, Plan, preset_of, split_title, title_end
from spacemap_vtk.scenes.presets.sheet import Sheet, rounded
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values
from spacemap_vtk.textile.weave.yarn_library import parse_yarn

#: Width of a cell over the bending length from which a note mentions it.
_WIDE_CELL = 1.1
#: Sections that describe a motion, and are replaced.
_REPLACED = (
    "cage",
    "contact",
    "modal",
    "response",
    "transient",
    "motion",
    "rotation",
    "warp",
    "animation",
)

#: An option in a warning, which neither the window nor the browser has.
_OPTION = re.compile(r" \(--[^)]*\)")
_SHARP_FOLDS = (
    "the sharpest folds of real cloth would be a little rounder; finer cells "
    "(--set cage.divisions=auto) show that, but take minutes"
)
_STRETCHED = (
    "the yarns straighten or flatten where the cloth is stretched or compressed most; real cloth "
    "is stiffer there"
)
#: What warnings about limits say in a scene of a preset: no keys, as its user wrote none.
_PLAIN_WARNINGS = {
    "fold": _SHARP_FOLDS,
    "lean": _SHARP_FOLDS,
    "thick_fold": "in the sharpest folds yarns overlap; thinner or stiffer ones (--yarn) do not",
    "law": _STRETCHED,
    "strain": _STRETCHED,
    "locked": "neighbouring yarns overlap where the cloth is sheared most; a looser sett has room",
}


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
        made.warn(note)
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
    for section in _REPLACED:
        values.pop(section, None)
    values.get("surface", {}).pop("subdivisions", None)  # chosen for another size of cloth
    view = values.setdefault("view", {})
    for key in ("camera", "show", "time", "color", "zoom", "position", "focal_point", "supports"):
        view.pop(key, None)
    plan = Plan(values)
    prepare = prepare_weave if isinstance(source, WeaveSource) else prepare_textile
    sides = _sides(size) if size is not None else None
    motion = MOTION_OF_PRESET[preset]

    def check_size(bending_length: float) -> None:
        if sides is not None:
            _check_size(motion, sides, bending_length)

    sheet = prepare(plan, scene, motion.side, yarn, sides, crossings, check_size)
    title = split_title(scene.title)[0] or "Cloth"
    values["title"] = title + title_end(preset)
    motion.prepare(values, sheet)
    if sides is not None:
        _note_cells(plan, sheet)
    values["warp"] = {"smooth": True}
    values["view"] = {"camera": "lying", "supports": False, **view, **values["view"]}
    return plan


def plain_warnings(title: str) -> dict[str, str]:
    """Return what warnings about limits say in a scene of a preset, without names of options.

    Parameters
    ----------
    title : str
        Title of a scene.

    Returns
    -------
    dict of str to str
        As `Scene.plain_warnings`; empty if no preset has made the scene.
    """
    if not preset_of(title):
        return {}
    return {key: _OPTION.sub("", text) for key, text in _PLAIN_WARNINGS.items()}


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


def _check_size(motion: Motion, sides: Sequence[float], bending_length: float) -> None:
    """Refuse cloth whose cells would be too wide for its folds, which then turn inside out."""
    largest = motion.widest_cell * bending_length * math.sqrt(motion.most_cells)
    area = math.prod(sides)
    if area > largest**2:
        side, length = rounded(math.sqrt(area), "m"), rounded(bending_length, "m")
        other = f"; a larger cloth can {motion.alternative}" if motion.alternative else ""
        raise InputError(
            f"cloth of {side} is too large to {motion.verb}, as its bending length is {length}",
            key="size",
            allowed=f"a side of at most {rounded(largest, 'm')}, if it is square",
            cure=f"Choose a smaller size or a stiffer yarn{other}.",
        )


def _note_cells(plan: Plan, sheet: Sheet) -> None:
    """Note that cells are wide."""
    cell = float((sheet.sides / plan.values["cage"]["divisions"][:2]).max())
    if cell > _WIDE_CELL * sheet.bending_length:
        plan.note(
            f"cloth this large has cells of {rounded(cell, 'm')}, at a bending length of "
            f"{rounded(sheet.bending_length, 'm')}: its sharpest folds are rounder in reality"
        )
