"""Save scenes that presets make, with comments."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spacemap_vtk.io.formats.toml import format_scene
from spacemap_vtk.io.output import atomic_file, check_output, write_parts
from spacemap_vtk.scenes.presets.motions import (
    CELL_OF_HEAVY,
    CELL_ON_BALL,
    CELL_ON_TABLE,
    CELLS_OF_PLEAT,
)
from spacemap_vtk.scenes.presets.plan import preset_of
from spacemap_vtk.scenes.presets.sheet import CELL
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values

#: Comments on keys of scenes that presets make.
_REMARKS = {
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
    remarks = _REMARKS | {("cage", "divisions"): _remark_on_cells(values)}
    return format_scene(values, "All lengths follow from the bending length of the cloth.", remarks)


def _remark_on_cells(values: Mapping[str, Any]) -> str:
    """Return a comment on the number of cells that a preset chooses."""
    preset = preset_of(str(values.get("title", "")))
    if preset == "drop":
        widths = f"{CELL_ON_BALL} bending lengths wide, {CELL_OF_HEAVY} in heavy cloth"
        return f"cells are {widths}, wider in large cloth"
    finer = "finer cells take longer"
    if preset and "springs" in values.get("modal", {}):
        return f"at least {CELLS_OF_PLEAT} cells across a pleat; {finer}"
    if preset:
        share = CELL_ON_TABLE if preset == "drape" else CELL
        return f"cells are {share} bending lengths wide, wider in large cloth; {finer}"
    return finer
