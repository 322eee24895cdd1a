"""Equilibrium at the end of a path: obstacles move slowly, and the body follows them.

With friction a state at rest depends on how it was reached. Each state on the path is found from
the one before; samples that stick keep their anchors, which move with their obstacles.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.resting import (
    Resting,
    find_resting_state,
    place_contacts,
    rested_terms,
    settle_model,
)
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress


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


def follow_path(
    model: Model,
    forces: Floats,
    path: Floats,
    progress: Progress | None = None,
    start: Resting | None = None,
) -> Resting:
    """Find the equilibrium of a body under dead loads after its obstacles have moved slowly.

    Parameters
    ----------
    model : Model
        The body, with the terms of its obstacles in their last places.
    forces : ndarray of float64, shape (3V,)
        Forces on the vertices [N] of constant direction.
    path : ndarray of float64, shape (S, n, 3)
        Displacements of the n obstacles from their last places [m], from `divide_path`; a state is
        found at each of the S places.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.
    start : Resting, optional
        State from which the search at the first places begins; by default the undeformed one.

    Returns
    -------
    Resting
        Displacement and the anchors of friction at the last places.

    Raises
    ------
    InputError
        If nothing holds the body against the load, it falls past its obstacles, or layers of a
        sheet overlap at the start.
    SolverError
        If no stable state was found somewhere on the path.
    """

    def report(number: int) -> Progress | None:
        return progress and (lambda share: progress((number + share) / len(path)))

    found = find_resting_state(model, forces, report(0), start, path[0])
    for number, (before, now) in enumerate(itertools.pairwise(path), 1):
        rested = rested_terms(
            place_contacts(model, before), model.points + found.displacement, found.anchors
        )
        obstacles = [term for term in rested if isinstance(term, ObstacleTerm)]
        moved = [_move(term, shift) for term, shift in zip(obstacles, now - before, strict=True)]
        contacts = [*moved, *rested[len(moved) :]]
        given = model, forces, contacts, found.displacement
        found = settle_model(*given, near=True, progress=report(number))
    return found


def _move(term: ObstacleTerm, shift: Floats) -> ObstacleTerm:
    """Return the term of an obstacle that has moved, with what sticks to it."""
    friction = term.friction
    if friction is not None:
        friction = friction._replace(anchors=friction.anchors + shift)
    return term.replace(obstacle=term.obstacle.moved(shift), friction=friction)
