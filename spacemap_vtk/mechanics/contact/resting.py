"""Equilibrium of a model on its obstacles, found on coarse cells first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.contact.layer_friction import LayerFriction
from spacemap_vtk.mechanics.contact.obstacle_term import Contact, Friction, ObstacleTerm
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.equilibrium.energy_terms import DeadLoad, EnergyTerm
from spacemap_vtk.mechanics.modal.coarsening import coarsen, coarsen_loads, refine, restrict
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress

#: A body lies on an obstacle if its distance from it is at most this share of its size.
_LYING = 1e-6
#: Largest number of steps of a search; and for a body that neither supports nor friction hold,
#: which rests where it falls, or slides away for ever.
_STEPS, _LOOSE_STEPS = 2400, 300
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


def find_resting_state(
    model: Model,
    forces: Floats,
    progress: Progress | None = None,
    start: Resting | None = None,
    shifts: Floats | None = None,
) -> Resting:
    """Find the equilibrium of a body under dead loads, on its obstacles.

    From the undeformed body a sheet is solved in cells twice as wide first, as long as there are
    enough of them. With friction the result depends on the path: a sample is anchored where it
    touches in the first state that is found, so that friction follows only from what moves later
    (see `spacemap_vtk.mechanics.contact.path`).

    Parameters
    ----------
    model : Model
        The body, with the terms of its obstacles.
    forces : ndarray of float64, shape (3V,)
        Forces on the vertices [N] of constant direction.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.
    start : Resting, optional
        State from which the search begins, with its friction if there are anchors; by default the
        undeformed one. A body that touches no obstacle there, and that nothing holds, falls.
    shifts : ndarray of float64, shape (n, 3), optional
        Displacement of each of the n obstacles from its place in the model [m]; by default none.

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
    model.require_no_rigid_places()
    contacts = place_contacts(model, shifts)
    guess, released = None, None
    if start is not None:
        place = model.points + start.displacement
        for term in model.terms:
            if isinstance(term, SelfContact):
                term.check_start(place)
        if _lies(contacts, place, _LYING * float(np.ptp(model.points, axis=0).max())):
            if len(start.anchors):
                contacts = rested_terms(contacts, place, start.anchors)
            given = model, forces, contacts, start.displacement
            return settle_model(*given, near=True, progress=progress)
        released = start.displacement
    coarse = coarsen(model)
    if coarse is not None and coarse.pencil.size >= _FEWEST:
        load, begun = coarsen_loads(coarse, model, forces), None
        if released is not None:
            begun = Resting(restrict(coarse, model, released), np.empty((0, 3)))
        found = find_resting_state(coarse, load, progress, begun, shifts)
        guess = refine(coarse, model, found.displacement)
        before = rested_terms(
            place_contacts(coarse, shifts), coarse.points + found.displacement, found.anchors
        )
        moved = coarse.points + found.displacement, model.points + guess
        contacts = _refine_friction(coarse.points, before, model.points, contacts, *moved)
    return settle_model(model, forces, contacts, guess, released=released, progress=progress)


def settle_model(
    model: Model,
    forces: Floats,
    contacts: Sequence[EnergyTerm],
    guess: Floats | None = None,
    *,
    near: bool = False,
    released: Floats | None = None,
    gripped: Floats | None = None,
    progress: Progress | None = None,
) -> Resting:
    """Find the equilibrium of a body under dead loads on obstacles with friction of their own."""
    # `contacts` replaces the model's own terms of obstacles and of friction between layers. The
    # search begins from the displacement `guess` (V, 3); `near` tells that it is a balance under
    # loads, or on obstacles, that differ little. Without a guess the body falls from the
    # displacement `released`, by default from the undeformed state. From a guess, the vertices that
    # grips hold are first moved by `gripped` (V, 3).
    # This imports scipy's solvers, which results from disk do not need.
    from spacemap_vtk.mechanics.contact.settle import settle

    factor, surface = 1 / model.modulus, model.pencil.surface
    obstacles = [term for term in contacts if isinstance(term, ObstacleTerm)]
    layers = [term for term in contacts if isinstance(term, LayerFriction)]
    pencil = model.pencil
    load = factor * forces.reshape(-1, 3)
    load = load if surface is None else 2 * surface.to_nodes(load)
    undeformed = pencil.nodes.positions

    def to_positions(moved: Floats) -> Floats:
        return undeformed + (moved if surface is None else surface.to_nodes(moved))

    rubs = any(term.coefficient for term in obstacles) or any(term.coefficient for term in layers)
    is_loose = not rubs and pencil.basis.shape[0] == pencil.basis.shape[1]
    try:
        result = settle(
            [term for term in pencil.terms if not isinstance(term, ObstacleTerm | LayerFriction)],
            [term.in_model_nodes(surface, factor) for term in obstacles],
            pencil.basis.tocsr(),
            undeformed,
            [DeadLoad(load, undeformed)],
            pencil.mass.diagonal(),
            pencil.nodes.translate,
            layers=[term.in_model_nodes(surface, factor) for term in layers],
            guess=None if guess is None else to_positions(guess),
            near=near,
            released=None if released is None else to_positions(released),
            gripped=gripped if gripped is None or surface is None else surface.to_nodes(gripped),
            progress=progress,
            steps=_LOOSE_STEPS if is_loose else _STEPS,
        )
    except SolverError as error:
        if not is_loose:
            raise
        raise SolverError(
            "no equilibrium was found: nothing holds the cage, and without friction it slides off "
            "its obstacles",
            key="obstacles",
            cure="Give the obstacles friction, fix a part of the cage, or let it fall in time "
            "steps ([transient])",
        ) from error
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


def place_contacts(model: Model, shifts: Floats | None) -> list[EnergyTerm]:
    """Return a model's terms of obstacles, displaced, and of layers.

    Parameters
    ----------
    model : Model
        A body.
    shifts : ndarray of float64, shape (n, 3), optional
        Displacement of each of the n obstacles [m].

    Returns
    -------
    list of EnergyTerm
        Terms of obstacles, then of layers.
    """
    obstacles = obstacles_of(model)
    if shifts is not None:
        obstacles = [
            term.replace(obstacle=term.obstacle.moved(shift))
            for term, shift in zip(obstacles, shifts, strict=True)
        ]
    return [*obstacles, *layers_of(model)]


def _lies(contacts: Sequence[EnergyTerm], positions: Floats, distance: float) -> bool:
    """Check whether a body lies on one of its obstacles, unless it has none."""
    obstacles = [term for term in contacts if isinstance(term, ObstacleTerm)]
    return not obstacles or any(term.gaps(positions).min() < distance for term in obstacles)


def count_anchors(model: Model) -> int:
    """Return the number of anchors of friction in a state of a model, see `Resting`.

    Parameters
    ----------
    model : Model
        A body.

    Returns
    -------
    int
        Number of rows of `Resting.anchors` with friction.
    """
    samples = sum(term.samples.areas.size for term in obstacles_of(model))
    return samples + sum(3 * len(term.springs) for term in layers_of(model))


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
    coarse: Floats,
    before: Sequence[EnergyTerm],
    fine: Floats,
    terms: Sequence[EnergyTerm],
    rested: Floats,
    guess: Floats,
) -> list[EnergyTerm]:
    """Let fine samples begin with the friction per area of the nearest coarse sample."""
    # Vertices of both cages are given undeformed, and at rest or as guessed.
    from scipy.spatial import cKDTree

    result: list[EnergyTerm] = []
    for old, term in zip(before, terms, strict=True):
        if (
            not isinstance(old, ObstacleTerm)
            or not isinstance(term, ObstacleTerm)
            or old.friction is None
        ):
            result.append(term)
            continue
        state = old.evaluate(rested)
        traction, limits = np.zeros((*old.samples.areas.shape, 3)), old.friction.limits
        traction[state.elements] = state.friction / old.samples.areas[state.elements][..., None]
        tree = cKDTree(old.samples.positions(coarse).reshape(-1, 3))
        nearest = tree.query(term.samples.positions(fine).reshape(-1, 3))[1]
        where = term.samples.positions(guess)
        slip = (traction.reshape(-1, 3)[nearest] / term.stiffness).reshape(where.shape)
        normals = term.obstacle.distance(where.reshape(-1, 3)).gradient
        normals = (normals / np.linalg.norm(normals, axis=1)[:, None]).reshape(where.shape)
        shares = (limits / old.samples.areas).ravel()[nearest].reshape(where.shape[:2])
        anchors = np.where(shares[..., None] > 0, where - slip, np.nan)
        friction = Friction(anchors, normals, shares * term.samples.areas)
        result.append(term.replace(friction=friction))
    return result
