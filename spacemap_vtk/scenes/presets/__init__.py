"""Presets of motion: from any scene of a textile to cloth that hangs, lies, falls or swings.

A preset adds to a draft, weave or other textile what a motion needs: the stiffness of its yarns, a
size at which cloth bends under its own weight, a cage, gravity, and what the cloth meets. The
result is an ordinary scene, which `write_scene` saves.
"""

from spacemap_vtk.scenes.presets.apply_preset import apply, make_plan, plain_warnings
from spacemap_vtk.scenes.presets.plan import PRESETS, Note, Plan, split_title
from spacemap_vtk.scenes.presets.scene_file import format_preset, write_scene

__all__ = [
    "PRESETS",
    "Note",
    "Plan",
    "apply",
    "format_preset",
    "make_plan",
    "plain_warnings",
    "split_title",
    "write_scene",
]
