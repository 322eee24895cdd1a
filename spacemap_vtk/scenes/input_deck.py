"""A scene's cage for other solvers; refused if they would compute something else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.datasets.modal_model import InputDeck, ModesReader, gravity_of
from spacemap_vtk.errors import InputError, add_section_to_errors
from spacemap_vtk.filters.load_parameters import LoadParameters
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.mechanics.modal.model import Model

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene

#: Time functions that end at a constant value.
_LASTING = ("step", "ramp", "table")
#: Time when all of them have reached this value, in s.
_LATE = 1e9
#: Fields of `Fittings` that are not written, and the parameters that they come from.
_NOT_WRITTEN = {"normals": "fixed", "bodies": "rigid", "springs": "springs", "masses": "masses"}


def make_input_deck(scene: Scene) -> InputDeck:
    """Run a scene's solver, and return the model and its loads."""
    solver = scene.stage("solver")
    if solver is not None:
        scene.update_stage(solver)
    with scene.add_file_to_errors():
        return _make_deck(scene.title, solver, scene.stage("mover"))


def _make_deck(title: str, solver: Any, mover: Any) -> InputDeck:
    if not isinstance(solver, ModalSolver):
        raise InputError(
            "the scene has no cage with computed modes",
            key="modal",
            cure="Add the sections [cage] and [modal].",
        )
    modes = ModesReader().read(solver.output)
    with add_section_to_errors("modal"):
        _refuse_unsupported(modes.model)
    forces, left_out = np.zeros(modes.model.points.size), []
    gravity = np.zeros(3)
    if isinstance(mover, LoadParameters):
        gravity = mover.gravity_for(solver.output) - gravity_of(solver.output)
        vectors = mover.load_vectors(solver.output, modes)
        for number, load in enumerate(mover.loads):
            vector = vectors[len(vectors) - len(mover.loads) + number]
            if load.action == "base_displacement" or load.time not in _LASTING:
                kind = load.action.replace("_", " ")
                left_out.append(
                    f"the static step leaves out loads[{number}], a {kind} ({load.time})"
                )
            else:
                forces += load.function.value(_LATE) * modes.vertex_forces(vector)
        left_out += mover.warnings_of_far_loads(modes)
    if modes.model.rigid_modes.shape[1]:
        left_out.append("the static step is left out: the supports do not hold the cage")
        gravity, forces = np.zeros(3), np.zeros_like(forces)
    count = len(modes.eigenvalues)
    return InputDeck(title, modes.model, count, gravity, forces.reshape(-1, 3), left_out)


def _refuse_unsupported(model: Model) -> None:
    """Refuse models with anything but tetrahedra of a material, held along x, y and z."""
    if model.plate is not None:
        raise InputError(
            "sheet elements cannot be exported to other solvers",
            key="elements",
            cure='Use solid elements: "--set modal.elements=tetrahedra", preferably with "--set '
            'cage.order=2".',
        )
    if model.displacement is not None:
        raise InputError(
            "modes about a hanging equilibrium cannot be exported",
            key="gravity",
            cure='Start from the undeformed cage: "--set modal.hang=false".',
        )
    if model.terms:
        raise InputError("the energy terms of ModalSolver.terms cannot be exported", key="terms")
    for name, key in _NOT_WRITTEN.items():
        if name in model.fittings.given:
            raise InputError(
                "springs, point masses, rigid bodies and inclined supports cannot be exported",
                key=key,
                cure=f'Remove them: "--set modal.{key}=".'
                if key != "fixed"
                else "Hold places along x, y or z only.",
            )
