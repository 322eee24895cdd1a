"""Give a scene's exported data the irregular yarns that its pictures show, if they are asked for.

Figures and measurements are always those of regular yarns, and so are data by default.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.irregularity import Irregularity

#: Keys of `spacemap_vtk.io.registry.DATA` that contain yarns.
YARN_DATA = ("patches", "surface", "painted", "yarns", "moving", "modes")


@contextmanager
def yarns_of_data(scene: Scene, kind: str, irregular: bool) -> Iterator[None]:
    """Let `Scene.data` and the scene's surface have yarns as in its pictures, or regular ones."""
    # The scene may have drawn pictures before, which leave irregular yarns in its surface.
    look = require_irregular(scene, kind) if irregular else None
    detail = scene.surface.detail
    scene.surface.set_detail(*detail[:3], look)
    scene.irregularity_of_data = look
    try:
        yield
    finally:
        scene.irregularity_of_data = None
        scene.surface.set_detail(*detail)


def require_irregular(scene: Scene, kind: str) -> Irregularity:
    """Return the irregularity that data of this kind can have; refuse them if they have none."""
    reason = cure = ""
    if kind not in YARN_DATA:
        reason, cure = "these data contain no yarns", f"Choose one of {', '.join(YARN_DATA)}."
    elif scene.woven is None:
        reason, cure = "only woven yarns can be irregular", "Leave the option out."
    elif COLORINGS[scene.view.color].shows_numbers:
        reason = "yarns with a colour scale are regular, because their colours are measured"
        cure = "Choose another colour, such as own, or leave the option out."
    elif scene.view.yarn_look.amount == 0.0:
        reason, cure = "the scene's yarns are drawn regular", "Set view.irregularity to 1."
    if reason:
        raise InputError(reason, key="irregular", cure=cure)
    return scene.view.yarn_look
