"""Equilibrium along a path: obstacles and grips move slowly, and the body follows them.

With friction a state at rest depends on how it was reached. Each state on the path is found from
the one before; samples that stick keep their anchors, which move with their obstacles.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.boundary.grips import Grip, prescribed_displacement
from spacemap_vtk.mechanics.contact.layer_friction import LayerFriction
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.resting import (
    Resting,
    find_resting_state,
    obstacles_of,
    place_contacts,
    rested_terms,
    settle_model,
)
from spacemap_vtk.mechanics.equilibrium.energy_terms import DeadLoad, EnergyTerm
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress

# This module is read before results from disk, which need none of scipy's solvers.
if TYPE_CHECKING:
    from spacemap_vtk.mechanics.equilibrium.newton import GripFollower

#: Largest number of linear systems that are solved for one step of grips; a step that needs more is
#: halved …
MOST_STEPS = 60
#: … down to this share of it.
LEAST_SHARE = 1 / 64


def divide_path(corners: Sequence[Sequence[ArrayLike]], steps: int) -> Floats:
    """Divide the straight lines on which obstacles move.

    Parameters
    ----------
    corners : sequence of sequence of array_like of float, shape (3,)
        For each obstacle, the m displacements from its first place between which it moves along
        straight lines [m]. Obstacles move along their lines of the same number at the same time;
        one with fewer lines then stays.
    steps : int
        Number of steps along each line.

    Returns
    -------
    ndarray of float64, shape (1 + steps max(m), n, 3)
        Displacements of the n obstacles from their *last* places, from the start on [m].

    Examples
    --------
    >>> divide_path([[(0, 0, 2)], [(0, 0, 1), (0, 0, 5)]], 2)[:, :, 2].tolist()
    [[-2.0, -5.0], [-1.0, -4.5], [0.0, -4.0], [0.0, -2.0], [0.0, 0.0]]
    """
    lines = max((len(each) for each in corners), default=0)
    places = np.zeros((lines + 1, len(corners), 3))
    for number, given in enumerate(corners):
        for line in range(lines):
            places[line + 1, number] = given[line] if line < len(given) else places[line, number]
    shares = np.arange(1, steps + 1)[:, None, None] / steps
    between = [begin + shares * (end - begin) for begin, end in itertools.pairwise(places)]
    return np.concatenate([places[:1], *between]) - places[-1]


class PathState(NamedTuple):
    """Equilibrium at one place of a path."""

    displacement: Floats
    """(V, 3), displacement of the vertices [m]."""
    anchors: Floats
    """Anchors of friction, see `Resting`."""
    holding: Floats
    """(V, 3), forces that supports and grips exert on the vertices [N]; 0 where they hold nothing.
    `spacemap_vtk.mechanics.boundary.reactions` sums them."""


def follow_path(
    model: Model,
    forces: Floats,
    path: Floats,
    progress: Progress | None = None,
    start: Resting | None = None,
    grips: Sequence[Grip] = (),
) -> Resting:
    """Find the equilibrium at the end of a path, see `states_on_path`."""
    *_, last = states_on_path(model, forces, path, progress, start, grips)
    return Resting(last.displacement, last.anchors)


def states_on_path(
    model: Model,
    forces: Floats | None = None,
    path: Floats | None = None,
    progress: Progress | None = None,
    start: Resting | None = None,
    grips: Sequence[Grip] = (),
) -> Iterator[PathState]:
    """Find the equilibria of a body under dead loads while obstacles and grips move slowly.

    Each state is found from the one before: what is held moves, everything else moves with it by
    the tangent, and Newton's method with all terms of the model finds the balance. A step that
    fails is halved.

    Parameters
    ----------
    model : Model
        The body, with the terms of its obstacles in their last places. Its `held` components
        include those of all grips.
    forces : ndarray of float64, shape (3V,), optional
        Forces on the vertices [N] of constant direction; by default none.
    path : ndarray of float64, shape (S, n, 3), optional
        Displacements of the n obstacles from their last places [m], from `divide_path`; a state is
        found at each of the S places. By default the obstacles stay.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.
    start : Resting, optional
        State from which the search at the first places begins; by default the undeformed one.
        Grips then move from where they are in that state.
    grips : sequence of Grip, optional
        Grips with moves and turns at the S places, the first of them 0. If several grips hold a
        component, the last of them moves it.

    Yields
    ------
    PathState
        The equilibrium at each of the S places.

    Raises
    ------
    InputError
        If nothing holds the body against the load, it falls past its obstacles, or layers of a
        sheet overlap at the start; if it has rigid places; or if path and grips differ in their
        number of places.
    SolverError
        If no stable state was found somewhere on the path.

    Examples
    --------
    A bar of 1 m, clamped at its end at x = 0, is pulled by 1 mm in two steps:

    >>> from spacemap_vtk.cage.lattice import build_lattice
    >>> from spacemap_vtk.mechanics.boundary.grips import held_by, make_grip
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> points, cells = build_lattice([0, 1, 0, 0.1, 0, 0.1], [4, 1, 1])
    >>> grips = [make_grip(points, "+x", moves=[[0, 0, 0], [5e-4, 0, 0], [1e-3, 0, 0]])]
    >>> held = held_by(grips, points.shape) | (points[:, :1] == 0.0)
    >>> model = Model(points, cells, isotropic(1e9, 0.0), 1000.0, held)
    >>> for state in states_on_path(model, grips=grips):
    ...     print(round(state.holding[grips[0].held].sum()))
    0
    5004
    10015
    """
    model.require_no_rigid_places()
    grips = list(grips)
    load = np.zeros(model.points.size) if forces is None else forces
    count = max([1, *(len(grip.moves) for grip in grips)])
    obstacles = obstacles_of(model)
    shifts = np.zeros((count, len(obstacles), 3)) if path is None else path
    if any(len(grip.moves) != len(shifts) for grip in grips):
        raise InputError(
            "grips and obstacles must move through the same number of places",
            value=[len(grip.moves) for grip in grips],
            allowed=str(len(shifts)),
        )

    def report(number: float, width: float) -> Progress | None:
        done = number / len(shifts), width / len(shifts)
        return progress and (lambda share: progress(done[0] + share * done[1]))

    contacts = place_contacts(model, shifts[0])
    if load.any() or contacts or start is not None:
        found = find_resting_state(model, load, report(0, 1), start, shifts[0])
    else:
        found = Resting(np.zeros_like(model.points), np.empty((0, 3)))
    contacts = rested_terms(contacts, model.points + found.displacement, found.anchors)
    others = [t for t in model.terms if not isinstance(t, ObstacleTerm | LayerFriction)]
    origin = model.points if start is None else model.points + start.displacement
    follower = None if contacts else _make_follower(model, load, found.displacement, progress)
    holding = model.holding_forces(found.displacement, load, [*others, *contacts])
    yield PathState(*found, holding)
    for number in range(1, len(shifts)):
        at, width = number - 1.0, 1.0
        while at < number:
            width = min(width, number - at)
            ends = at, at + width
            before, after = (prescribed_displacement(origin, grips, end) for end in ends)
            moved = after - before
            if follower is not None:
                new = _follow(model, follower, moved)
            else:
                shift = width * (shifts[number] - shifts[number - 1])
                new = _settle_moved(model, load, contacts, found, shift, moved, report(at, width))
            if new is None:
                width /= 2
                if width < LEAST_SHARE:
                    raise SolverError(
                        f"no stable equilibrium was found after step {at:.4g} of "
                        f"{len(shifts) - 1} on the path",
                        key="path",
                        cure="Divide the path into more steps, or shorten it",
                    )
                continue
            found, contacts = new
            at, width = at + width, 2 * width
        if progress is not None:
            progress((number + 1) / len(shifts))
        holding = model.holding_forces(found.displacement, load, [*others, *contacts])
        yield PathState(*found, holding)


def _make_follower(
    model: Model, load: Floats, displacement: Floats, progress: Progress | None
) -> GripFollower:
    """Make the follower of the grips of a model without contact."""
    from spacemap_vtk.mechanics.equilibrium.newton import GripFollower
    from spacemap_vtk.mechanics.equilibrium.reduced_system import ReducedSystem

    pencil, surface = model.pencil, model.pencil.surface
    undeformed = pencil.nodes.positions
    push, moved = load.reshape(-1, 3) / model.modulus, displacement
    if surface is not None:
        push, moved = 2 * surface.to_nodes(push), surface.to_nodes(moved)
    terms = [DeadLoad(push, undeformed), *pencil.terms]
    report = progress and (lambda _: progress(0.0))
    system = ReducedSystem(terms, pencil.basis.tocsr(), undeformed, report or (lambda _: None))
    return GripFollower(system, 1, undeformed + moved)


def _follow(
    model: Model, follower: GripFollower, moved: Floats
) -> tuple[Resting, list[EnergyTerm]] | None:
    """Find the state after grips have moved by (V, 3), without contact; None if that fails."""
    from spacemap_vtk.mechanics.linalg import blas_threads

    pencil, surface = model.pencil, model.pencil.surface
    with blas_threads.use_one_thread():
        nodal = moved if surface is None else surface.to_nodes(moved)
        if not follower.move(nodal, MOST_STEPS):
            return None
    change = follower.z - pencil.nodes.positions
    displacement = change if surface is None else surface.to_vertices(change)
    return Resting(displacement, np.empty((0, 3))), []


def _settle_moved(
    model: Model,
    load: Floats,
    contacts: Sequence[EnergyTerm],
    found: Resting,
    shift: Floats,
    moved: Floats,
    progress: Progress | None,
) -> tuple[Resting, list[EnergyTerm]] | None:
    """Find the state after obstacles and grips have moved; None if that fails."""
    obstacles = [term for term in contacts if isinstance(term, ObstacleTerm)]
    shifted = [_move(term, way) for term, way in zip(obstacles, shift, strict=True)]
    rubbing = [*shifted, *contacts[len(obstacles) :]]
    gripped = moved if moved.any() else None
    try:
        given = model, load, rubbing, found.displacement
        new = settle_model(*given, near=True, gripped=gripped, progress=progress)
    except SolverError:
        return None
    return new, rested_terms(rubbing, model.points + new.displacement, new.anchors)


def _move(term: ObstacleTerm, shift: Floats) -> ObstacleTerm:
    """Return the term of an obstacle that has moved, with what sticks to it."""
    friction = term.friction
    if friction is not None:
        friction = friction._replace(anchors=friction.anchors + shift)
    return term.replace(obstacle=term.obstacle.moved(shift), friction=friction)
