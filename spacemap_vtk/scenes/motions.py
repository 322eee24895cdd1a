"""Move one scene in several ways: with the same loads, damping and start, by modes or by steps."""

from __future__ import annotations

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.load_parameters import LoadParameters
from spacemap_vtk.filters.modal_response import ModalResponse
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.scenes.scene import Scene

#: Ways to move a cage: the sections, that of the mover first, and a label.
MOTIONS = {
    "response": (("response",), "modes"),
    "rotation": (("response", "rotation"), "modes,\nrotation corrected"),
    "transient": (("transient",), "steps"),
}


def require_loads(scene: Scene) -> LoadParameters:
    """Return the stage that moves a scene's cage by loads; refuse a scene without one."""
    mover = scene.stage("mover")
    if isinstance(mover, LoadParameters):
        return mover
    raise InputError(
        "the scene has no loads, so that its motions cannot be compared",
        allowed="a scene with [response] or [transient]",
    )


def set_motion(scene: Scene, name: str, given: LoadParameters) -> None:
    """Move a scene in one of `MOTIONS`, with the loads, damping and start of `given`."""
    sections, _ = MOTIONS[name]
    values = {key: getattr(given, key) for key in LoadParameters.parameters}
    if name != "transient" and isinstance(given, TransientResponse) and given.held:
        scene.warn(
            "modes cannot hold the cage until t = 0, as [transient] does: they start from the "
            "equilibrium, or undeformed"
        )
    kept = {stage.section for stage in scene.stages if stage.role not in ("mover", "rotation")}
    scene.apply_settings({sections[0]: values}, kept | set(sections))
    if isinstance(mover := scene.stage("mover"), ModalResponse):
        mover.compared = True
