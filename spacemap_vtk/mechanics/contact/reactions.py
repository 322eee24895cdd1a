"""Reactions of all that holds a body at rest: supports, grips, springs and obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spacemap_vtk.mechanics.boundary.reactions import Bearing, Reaction
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats


def list_reactions(
    model: Model,
    displacement: Floats,
    holding: Floats,
    bearings: Sequence[Bearing],
    moves: Sequence[Floats] = (),
    terms: Sequence[EnergyTerm] = (),
) -> list[Reaction]:
    """List the forces and moments by which a body at rest is held.

    Parameters
    ----------
    model : Model
        The body.
    displacement : ndarray of float64, shape (V, 3)
        Displacement of the vertices at rest [m].
    holding : ndarray of float64, shape (V, 3)
        Forces that supports and grips exert [N], from `PathState` or `Model.holding_forces`.
    bearings : sequence of Bearing
        Supports and grips, from `find_bearings`.
    moves : sequence of ndarray of float64, shape (3,), optional
        Moves of the grips, in their order [m]; by default they have not moved.
    terms : sequence of EnergyTerm, optional
        Terms of the obstacles, with their friction.

    Returns
    -------
    list of Reaction
        For each bearing, for all springs to the base together, and for each obstacle. Moments of
        springs are about the mean of their vertices, those of obstacles about their centres.
    """
    positions, left = model.points + displacement, list(moves)
    found = []
    for bearing in bearings:
        moved = left.pop(0) if left and bearing.kind == "grip" else np.zeros(3)
        found.append(bearing.reaction(holding, positions, moved))
    if (springs := model.fittings.springs) is not None:
        pull = -np.einsum("vij,vj->vi", springs, displacement)
        about = model.points[springs.any(axis=(1, 2))].mean(axis=0)
        found.append(_sum_about("springs", pull, positions, about))
    for term in terms:
        if isinstance(term, ObstacleTerm):
            push = -term.forces(positions)
            found.append(_sum_about("obstacle", push, positions, term.obstacle.center))
    return found


def _sum_about(kind: str, forces: Floats, positions: Floats, about: Floats) -> Reaction:
    moment = np.cross(positions - about, forces).sum(axis=0)
    return Reaction(kind, "", forces.sum(axis=0), moment, np.array(about))
