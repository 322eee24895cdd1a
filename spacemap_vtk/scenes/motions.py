"""One scene moved in several ways: the same loads, damping and start by modes and by steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.datasets.modal_model import ModesReader
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.loaded_cage import LoadedCage
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.mechanics.oscillator import damping_ratio
from spacemap_vtk.scenes.scene import Scene

#: What a cage can be moved by: the sections that do it, the mover's first, and what to call it.
MOTIONS = {
    "response": (("response",), "modes"),
    "rotation": (("response", "rotation"), "modes,\nturning rebuilt"),
    "transient": (("transient",), "steps"),
}


def loaded_cage(scene: Scene) -> LoadedCage:
    """Return what moves a scene's cage by loads; refuses a scene without."""
    mover = scene.stage("mover")
    if isinstance(mover, LoadedCage):
        return mover
    raise InputError(
        "this scene has no loads that could move it in several ways",
        allowed="a scene with [response] or [transient]",
    )


def take_motion(scene: Scene, name: str, given: LoadedCage) -> None:
    """Let a scene move in one of `MOTIONS`, by the loads, damping and start of what moved it."""
    sections, _ = MOTIONS[name]
    values = {key: getattr(given, key) for key in LoadedCage.parameters}
    if name == "transient" and given.damping_ratio is not None:
        values |= _two_ratios(scene, given)
    if name != "transient" and isinstance(given, TransientResponse) and given.held:
        scene.warn(
            "what [transient] holds up to t = 0 does not carry over to modes: by these the cage "
            "starts where it hangs, or undeformed"
        )
    kept = {stage.section for stage in scene.stages if stage.role not in ("mover", "rotation")}
    scene.take({sections[0]: values}, kept | set(sections))


def _two_ratios(scene: Scene, given: LoadedCage) -> dict[str, Any]:
    """Return what damps the first and the last mode as their ratios do: steps know no modes."""
    solver = scene.stage("solver")
    assert solver is not None
    scene.update_stage(solver)
    modes = ModesReader().read(solver.output)
    values, damping = modes.eigenvalues, given.damping
    ratios = damping_ratio(values, damping.alphas(values), damping.beta)
    ends = np.flatnonzero(values > 0.0)[[0, -1]]
    scene.warn(
        "damping_ratio does not carry over to steps: alpha and beta damp the first and the last "
        "mode alike, and those in between less"
    )
    frequencies = np.sqrt(values[ends]) / (2 * np.pi)
    return {
        "damping_ratio": None,
        "damping_pairs": np.stack([frequencies, ratios[ends]], axis=1).tolist(),
    }
