"""Choose the stages of a scene and connect them, from what their classes declare."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING

import spacemap_vtk
from spacemap_vtk import extensions
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import ROLES, Stage, connect
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.filters.textile import Textile
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.parameters import Parameterised
from spacemap_vtk.scenes.settings import Animation, View

if TYPE_CHECKING:
    from spacemap_vtk.textile.crimp.interchange import YarnMechanics


def section_classes() -> dict[str, type[Parameterised]]:
    """Return the class of each section of a scene file, in the order of the pipeline."""
    own: list[type[Stage]] = [getattr(spacemap_vtk, name) for name in spacemap_vtk.FILTERS]
    stages = [*own, *extensions.load_all("stages")]
    roles = order_roles(stages)
    stages.sort(key=lambda stage: roles.index(stage.role))
    classes: list[type[Parameterised]] = [*stages, View, Animation]
    return {cls.section: cls for cls in classes}


def order_roles(stages: Collection[type[Stage]]) -> list[str]:
    """Return all roles in the order of the pipeline; a stage's role follows its `after`."""
    roles = list(ROLES)
    own = {stage.role: stage.after for stage in stages if stage.after and stage.role not in ROLES}
    while found := [role for role in own if own[role] in roles]:
        for role in found:
            roles.insert(roles.index(own.pop(role)) + 1, role)
    for stage in stages:
        if stage.role not in roles:
            raise InputError(
                f"{stage.__name__} cannot be placed in the pipeline: its role is "
                f'"{stage.role}", after "{stage.after}"',
                allowed=f"one of {', '.join(roles)}, or a new role after one of these",
                cure='Declare both, for example role, after = "smoothing", "mover".',
            )
    return roles


def stage_title(name: str) -> str:
    """Return a stage's name in words, for lists."""
    spaced = "".join(f" {c.lower()}" if c.isupper() else c for c in name).strip()
    return spaced.capitalize()


def choose_stages(parts: Mapping[str, Parameterised], given: Collection[str]) -> list[Stage]:
    """Return the stages of a scene with the given sections, in the order of the pipeline."""
    stages = [part for part in parts.values() if isinstance(part, Stage)]
    # A section of one stage that concerns the cage is enough to make the scene move.
    moves = any(stage.section in given for stage in stages if _uses_cage(stage))
    required = ROLES if moves else (ROLES[0], ROLES[-1])
    chosen: dict[str, Stage] = {}
    for stage in stages:
        missing = stage.role in required and stage.role not in chosen
        if stage.section in given or missing:
            chosen[stage.role] = stage
    found: list[Stage] = []
    for stage in chosen.values():
        # A stage that makes a cage without needing one replaces all stages before that make one.
        if stage.makes not in stage.takes:
            found = [other for other in found if other.makes != stage.makes]
        found.append(stage)
    return found


def _uses_cage(stage: Stage) -> bool:
    return stage.makes == "cage" or "cage" in stage.takes


def refuse_replaced(parts: Mapping[str, Parameterised], given: Collection[str]) -> None:
    """Refuse sections that would have no effect because of another section."""
    if (found := find_replaced(parts, given)) is not None:
        replaced, section = found
        raise InputError(
            f"cannot be combined with [{section}]",
            key=replaced,
            cure=f"Remove one of the two: [{section}] replaces [{replaced}].",
        )


def find_replaced(
    parts: Mapping[str, Parameterised], given: Collection[str]
) -> tuple[str, str] | None:
    """Return a section without effect, and the one that replaces it; None if all have effect."""
    found = choose_stages(parts, given)
    for stage in parts.values():
        if isinstance(stage, Stage) and stage.section in given and stage not in found:
            rivals = [other for other in found if other.role == stage.role]
            rivals += [other for other in found if other.makes == stage.makes]
            return stage.section, rivals[0].section
    return None


def switch_section(
    parts: Mapping[str, Parameterised], given: Collection[str], section: str, on: bool
) -> set[str]:
    """Return a scene's sections after the stage of one section is switched on or off."""
    if on:
        return {section} | {other for other in given if is_compatible(parts, section, [other])}
    middle = {stage.section for stage in choose_stages(parts, given) if _uses_cage(stage)} - {
        section
    }
    rest = set(given) - {section}
    part = parts[section]
    if not isinstance(part, Stage) or part.role in ROLES:
        return rest - middle  # without such a stage there is no motion
    # If no other stage of the cage was given, the missing ones were there for this stage only.
    return rest if rest & middle else rest | middle


def is_compatible(parts: Mapping[str, Parameterised], section: str, others: Iterable[str]) -> bool:
    """Return whether a section's stage can be in a scene with each of the other stages."""
    one = parts[section]
    assert isinstance(one, Stage)
    stages = (parts.get(other) for other in others)
    return all(
        {one, other} <= set(choose_stages(parts, (section, other.section)))
        and not (one.role in other.excludes or other.role in one.excludes)
        for other in stages
        if isinstance(other, Stage)
    )


def connect_stages(stages: Iterable[Stage]) -> None:
    """Connect each input port to the last stage before that makes the data it accepts."""
    stages = list(stages)
    # The solver uses the stiffness of yarns that the stage for crimp interchange declares, or else
    # that of the textile itself.
    yarns: YarnParameters | YarnMechanics | None
    yarns = next((stage for stage in stages if isinstance(stage, YarnParameters)), None)
    if yarns is None and isinstance(stages[0], Textile):
        yarns = stages[0].mechanics
    # The cage asks the solver how many cells a sheet needs.
    solver = next((stage for stage in stages if isinstance(stage, ModalSolver)), None)
    made: dict[str, Stage] = {}
    for stage in stages:
        if isinstance(stage, ModalSolver):
            stage.yarns = yarns
        if isinstance(stage, TetraCage):
            stage.solver = solver
        if stage.takes:
            connect(tuple(made[kind] for kind in stage.takes), stage)
        made[stage.makes] = stage
