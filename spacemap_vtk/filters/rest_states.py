"""States at rest under loads, on obstacles and in grips: from disk, or solved."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk import cache
from spacemap_vtk.mechanics.boundary.grips import Grip
from spacemap_vtk.mechanics.boundary.reactions import Bearing, Reaction
from spacemap_vtk.mechanics.contact.path import PathState, states_on_path
from spacemap_vtk.mechanics.contact.reactions import list_reactions
from spacemap_vtk.mechanics.contact.resting import (
    Resting,
    find_resting_state,
    layers_of,
    obstacles_of,
    place_contacts,
    rested_terms,
)
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.mechanics.modal.hanging import find_hung_state
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress


class RestTask(NamedTuple):
    """All that a state at rest depends on."""

    model: Model
    """The body, undeformed."""
    load: Floats
    """(3V,), dead loads on the vertices [N]."""
    start: Resting | None = None
    """State from which the search begins; by default the undeformed one."""
    path: Floats | None = None
    """(S, n, 3), displacements of the n obstacles from their last places [m]."""
    grips: Sequence[Grip] = ()
    """Grips with S places, or with one place if there is no path."""
    bearings: Sequence[Bearing] = ()
    """Supports and grips whose reactions are wanted."""

    @property
    def digest(self) -> str:
        """Digest of all these."""
        parts: list[Any] = [] if self.start is None else [*self.start]
        parts += [] if self.path is None else [self.path]
        for grip in self.grips:
            parts += [grip.held, grip.center, grip.moves, grip.turns]
        # Without a path, reactions follow from the state.
        for bearing in () if self.path is None else self.bearings:
            parts += [bearing.shares.any(axis=(1, 2)), bearing.about]
        # Displacements depend on the ratio of load and modulus only, but forces on both.
        return digest_of(self.model.digest, self.model.modulus, self.load, *parts)


class RestState(NamedTuple):
    """State at rest, and what holds it."""

    displacement: Floats
    """(V, 3), displacement [m]."""
    critical: Floats
    """(1,), share of the load at which the body buckles, or NaN."""
    anchors: Floats
    """(S, 3), anchors of friction [m]."""
    holding: Floats
    """(V, 3), forces that supports and grips exert on the vertices [N]."""
    reactions: Floats
    """(S, n, 9), force [N], moment [N m] and its point [m] of each bearing, of all springs together
    if there are any, and of each obstacle, at each of the S places of the path, if there is one."""

    def last_reactions(self, task: RestTask) -> list[Reaction]:
        """List the reactions in this state."""
        terms = rested_terms(task.model.terms, task.model.points + self.displacement, self.anchors)
        given = self.displacement, self.holding, task.bearings
        return list_reactions(task.model, *given, [grip.moves[-1] for grip in task.grips], terms)


def load_or_solve_rest(
    task: RestTask, progress: Progress, allow: Callable[[], object] = lambda: None
) -> RestState:
    """Return a state at rest under dead loads, from disk or solved."""
    # `allow` is called before solving, and may raise to prevent it.
    key, model = f"rest-{task.digest}", task.model
    shapes = {
        "displacement": model.points.shape,
        "critical": (1,),
        "anchors": (-1, 3),
        "holding": model.points.shape,
        "reactions": (-1, -1, 9),
    }
    entry = cache.load(key, **shapes)
    if entry is not None and np.isfinite(entry["displacement"]).all():
        found = RestState(**entry)
    else:
        allow()
        found = _solve(task, progress)
        cache.store(key, **found._asdict())
    return found


def _solve(task: RestTask, progress: Progress) -> RestState:
    model, load, start = task.model, task.load, task.start
    table: list[list[Reaction]] = []
    share = None

    def add(displacement: Floats, anchors: Floats, holding: Floats) -> None:
        assert task.path is not None
        contacts = place_contacts(model, task.path[len(table)])
        terms = rested_terms(contacts, model.points + displacement, anchors)
        moves = [grip.moves[len(table)] for grip in task.grips]
        table.append(list_reactions(model, displacement, holding, task.bearings, moves, terms))

    if task.path is not None:
        state: PathState | None = None
        for state in states_on_path(model, load, task.path, progress, start, task.grips):
            add(*state)
        assert state is not None
        displacement, anchors, holding = state
    else:
        anchors = np.empty((0, 3))
        if obstacles_of(model) or layers_of(model) or start is not None:
            displacement, anchors = find_resting_state(model, load, progress, start)
        else:
            displacement, share = find_hung_state(model, load, progress)
        terms = rested_terms(model.terms, model.points + displacement, anchors)
        holding = model.holding_forces(displacement, load, terms)
    critical = np.array([math.nan if share is None else share])
    rows = [[np.concatenate([r.force, r.moment, r.about]) for r in row] for row in table]
    reactions = np.array(rows, dtype=np.float64).reshape(len(rows), len(rows and rows[0]), 9)
    return RestState(displacement, critical, anchors, holding, reactions)
