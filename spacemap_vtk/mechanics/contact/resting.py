"""Equilibrium of a model on its obstacles, found on coarse cells first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.contact.layer_friction import LayerFriction
from spacemap_vtk.mechanics.contact.obstacle_term import Contact, Friction, ObstacleTerm
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.equilibrium.energy_terms import DeadLoad, EnergyTerm
from spacemap_vtk.mechanics.modal.coarsening import coarsen, coarsen_loads, refine, restrict
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress

#: The coarsest sheet has at least this number of unknowns.
_FEWEST = 500


class Resting(NamedTuple):
    """Equilibrium of a body on its obstacles."""

    displacement: Floats
    """(V, 3), displacement of the vertices [m]."""
    anchors: Floats
    """(S, 3), anchors of friction at the samples of all obstacles [m], NaN where none, and then
    `LayerFriction.anchors`; (0, 3) without friction."""


def obstacles_of(model: Model) -> list[ObstacleTerm]:
    """Return the terms of a model's obstacles.

    Parameters
    ----------
    model : Model
        A body.

    Returns
    -------
    list of ObstacleTerm
        In the order of the obstacles.
    """
    return [term for term in model.terms if isinstance(term, ObstacleTerm)]


def layers_of(model: Model) -> list[LayerFriction]:
    """Return the terms of friction between layers of a model.

    Parameters
    ----------
    model : Model
        A body.

    Returns
    -------
    list of LayerFriction
        One or none.
    """
    return [term for term in model.terms if isinstance(term, LayerFriction)]


def can_touch(model: Model) -> bool:
    """Return whether a model can touch obstacles or itself.

    Parameters
    ----------
    model : Model
        A body.

    Returns
    -------
    bool
        Whether it has terms of contact.
    """
    return any(isinstance(term, ObstacleTerm | SelfContact) for term in model.terms)


def find_resting_state(
    model: Model,
    forces: Floats,
    progress: Progress | None = None,
    start: Resting | None = None,
    released: Floats | None = None,
) -> Resting:
    """Find the equilibrium of an undeformed body under dead loads, on its obstacles.

    A sheet is solved in cells twice as wide first, as long as there are enough of them. With
    friction the result depends on the path: a sample is anchored where it touches in the first
    state that is found, so that friction follows only from what moves later.

    Parameters
    ----------
    model : Model
        The body, with the terms of its obstacles.
    forces : ndarray of float64, shape (3V,)
        Forces on the vertices [N] of constant direction.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.
    start : Resting, optional
        State from which the loads change, with its friction; by default the undeformed one.
    released : ndarray of float64, shape (V, 3), optional
        Without a start, displacement [m] from which the body falls; by default it is undeformed.

    Returns
    -------
    Resting
        Displacement and the anchors of friction.

    Raises
    ------
    InputError
        If nothing holds the body against the load, it falls past its obstacles, or layers overlap
        in the given state.
    SolverError
        If no stable state was found.
    """
    # This imports scipy's solvers, which results from disk do not need.
    from spacemap_vtk.mechanics.contact.settle import settle

    guess, frictions = None, [term.friction for term in obstacles_of(model)]
    layers = layers_of(model)
    coarse = coarsen(model) if start is None else None
    if start is not None:
        guess = start.displacement
        rested = rested_terms(model.terms, model.points + guess, start.anchors)
        frictions = [term.friction for term in rested if isinstance(term, ObstacleTerm)]
        layers = [term for term in rested if isinstance(term, LayerFriction)]
    elif coarse is not None and coarse.pencil.size >= _FEWEST:
        before = None if released is None else restrict(coarse, model, released)
        shared = coarsen_loads(coarse, model, forces)
        found = find_resting_state(coarse, shared, progress, released=before)
        guess = refine(coarse, model, found.displacement)
        frictions = _refine_friction(coarse, model, found, guess)
    pencil, surface = model.pencil, model.pencil.surface
    load = forces.reshape(-1, 3) / model.modulus
    load = load if surface is None else 2 * surface.to_nodes(load)
    undeformed = pencil.nodes.positions

    def to_positions(moved: Floats) -> Floats:
        return undeformed + (moved if surface is None else surface.to_nodes(moved))

    begin = start.displacement if start is not None else released
    for term in pencil.terms:
        if isinstance(term, SelfContact) and begin is not None:
            term.check_start(to_positions(begin))
    contacts = [
        term.replace(friction=friction).in_model_nodes(surface, 1 / model.modulus)
        for term, friction in zip(obstacles_of(model), frictions, strict=True)
    ]
    result = settle(
        [term for term in pencil.terms if not isinstance(term, ObstacleTerm | LayerFriction)],
        contacts,
        pencil.basis.tocsr(),
        undeformed,
        [DeadLoad(load, undeformed)],
        pencil.mass.diagonal(),
        pencil.nodes.translate,
        layers=[term.in_model_nodes(surface, 1 / model.modulus) for term in layers],
        guess=None if guess is None else to_positions(guess),
        near=start is not None,
        released=None if released is None else to_positions(released),
        progress=progress,
    )
    moved = result.positions - undeformed
    moved = moved if surface is None else surface.to_vertices(moved)
    if all(term.friction is None for term in result.contacts) and not layers:
        return Resting(moved, np.empty((0, 3)))
    anchors = [
        np.full((term.samples.areas.size, 3), np.nan)
        if term.friction is None
        else term.friction.anchors.reshape(-1, 3)
        for term in result.contacts
    ]
    return Resting(moved, np.concatenate([*anchors, *(term.anchors for term in result.layers)]))


def rested_terms(
    terms: Sequence[EnergyTerm], positions: Floats, anchors: Floats
) -> list[EnergyTerm]:
    """Give the terms of obstacles, and of layers, the friction of a state at rest.

    Parameters
    ----------
    terms : sequence of EnergyTerm
        Terms of the vertices, those of layers after those of obstacles; both are replaced.
    positions : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    anchors : ndarray of float64, shape (S, 3)
        Anchors of friction, from `Resting`.

    Returns
    -------
    list of EnergyTerm
        All terms, in their order.
    """
    found: list[EnergyTerm] = []
    first = 0
    for term in terms:
        if isinstance(term, ObstacleTerm):
            last = first + term.samples.areas.size
            found.append(term.at_rest(positions, anchors[first:last]))
            first = last
        elif isinstance(term, LayerFriction):
            found.append(term.at_rest(positions, anchors[first : first + 3 * len(term.springs)]))
        else:
            found.append(term)
    return found


def report_contact(model: Model) -> list[Contact]:
    """Report on the contact of a model at rest with each of its obstacles.

    Parameters
    ----------
    model : Model
        The body with its displacement, see `rested_terms`.

    Returns
    -------
    list of Contact
        One for each obstacle.
    """
    moved = 0.0 if model.displacement is None else model.displacement
    return [term.evaluate(model.points + moved).report() for term in obstacles_of(model)]


def _refine_friction(
    coarse: Model, fine: Model, resting: Resting, guess: Floats
) -> list[Friction | None]:
    """Let fine samples begin with the friction per area of the nearest coarse sample."""
    from scipy.spatial import cKDTree

    result: list[Friction | None] = []
    rested = rested_terms(
        obstacles_of(coarse), coarse.points + resting.displacement, resting.anchors
    )
    for before, term in zip(rested, obstacles_of(fine), strict=True):
        if not isinstance(before, ObstacleTerm) or before.friction is None:
            result.append(None)
            continue
        state = before.evaluate(coarse.points + resting.displacement)
        traction, limits = np.zeros((*before.samples.areas.shape, 3)), before.friction.limits
        traction[state.elements] = state.friction / before.samples.areas[state.elements][..., None]
        tree = cKDTree(before.samples.positions(coarse.points).reshape(-1, 3))
        nearest = tree.query(term.samples.positions(fine.points).reshape(-1, 3))[1]
        where = term.samples.positions(fine.points + guess)
        moved = (traction.reshape(-1, 3)[nearest] / term.stiffness).reshape(where.shape)
        normals = term.obstacle.distance(where.reshape(-1, 3)).gradient
        normals = (normals / np.linalg.norm(normals, axis=1)[:, None]).reshape(where.shape)
        shares = (limits / before.samples.areas).ravel()[nearest].reshape(where.shape[:2])
        anchors = np.where(shares[..., None] > 0, where - moved, np.nan)
        result.append(Friction(anchors, normals, shares * term.samples.areas))
    return result
