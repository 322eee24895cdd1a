"""Equilibrium of a cage that obstacles hold, with friction.

The springs of contact reach their stiffness by decades, each state being the start of the next
one. A cage that nothing else holds first falls, without deforming, until the softest springs carry
its weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.contact.layer_friction import LayerFriction
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm, stiffen
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, TermState
from spacemap_vtk.mechanics.equilibrium.newton import (
    MAX_RESIDUAL,
    MAX_UNRESISTED,
    guess_moves,
    load_in_shares,
)
from spacemap_vtk.mechanics.equilibrium.reduced_system import ReducedSystem
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.ndarrays import Bools, Floats, Progress

#: The softest springs have at least this share of their stiffness. The load presses them in by at
#: most the second share of the obstacle's depth, and by the third of the cage's size.
SOFTEST, MAX_DEPTH, MAX_SINKING = 1e-3, 0.02, 0.002

#: Length of a step under the whole load where nothing resists it, over the size of the cage.
_FREE_STEP = 0.05

#: Largest number of searches for a state with given limits of friction, and of Newton steps after
#: each in which the limits follow; these end if more than the third number of steps in a row do not
#: come nearer to balance.
_MAX_REPEATS, _MAX_BALANCING, _PATIENCE = 20, 40, 4

#: Largest number of steps of all searches after the first: they start near to their states, and a
#: body that slides away never finds one.
_MAX_RENEWING = 200

#: Share of the usual inertia with which a search from a guess begins. With all of it, the strip in
#: `tests/test_contact.py` that is pulled over a cylinder takes 149 s instead of 1 s.
_NEAR_INERTIA = 0.1
#: Share of it for a body that supports hold: its motions are resisted, and inertia makes its steps
#: short. With all of it a cloth that is pinned to a table takes up to ten times as many steps.
_HELD_INERTIA = 0.01

#: A step is halved, at most so many times, while it multiplies the unbalanced forces by more than
#: the second number.
_MAX_HALVINGS, _MAX_RISE = 6, 1.5

#: Unbalanced forces of at most this share of the load that no step makes smaller are rounding.
_ROUNDED_RESIDUAL = 1e-6

#: A cage falls past its obstacles if it does not meet them within this multiple of all sizes.
_FAR = 3.0


#: Term with friction, which `advance_friction` and `follow_friction` change.
Rubbing = ObstacleTerm | LayerFriction


class Settled(NamedTuple):
    """Stable equilibrium of a cage on obstacles."""

    positions: Floats
    """Nodal vectors (V, 3)."""
    contacts: list[ObstacleTerm]
    """The obstacles' terms, with their friction."""
    layers: list[LayerFriction]
    """Friction between layers."""
    steps: int
    """Number of linear systems that were solved."""


def settle(
    terms: Sequence[EnergyTerm],
    contacts: Sequence[ObstacleTerm],
    basis: sp.csr_matrix,
    start: Floats,
    loads: Sequence[EnergyTerm],
    mass: Floats,
    translate: Bools,
    *,
    layers: Sequence[LayerFriction] = (),
    guess: Floats | None = None,
    near: bool = False,
    released: Floats | None = None,
    gripped: Floats | None = None,
    progress: Progress | None = None,
    steps: int = 2400,
) -> Settled:
    """Find a stable equilibrium of a body on obstacles under loads."""
    # `mass` (N,) is that of each free coordinate, `translate` (V,) tells which nodes are positions.
    # From a guess of the positions, (V, 3), the springs have their full stiffness at once; `near`
    # tells that it is a balance under loads that differ little. Without a guess, the body falls
    # from the positions `released`, by default the undeformed ones. From a guess, held nodes are
    # first moved by `gripped` (V, 3). For the other arguments see `find_equilibrium`.
    given = list(contacts)
    every = [*loads, *terms, *given, *layers]
    with blas_threads.use_one_thread():
        system = ReducedSystem(every, basis, start, progress or (lambda _: None))
        forces = -np.sum([term.forces(start) for term in loads], axis=0)
        load = system.reduce_forces(forces)
        if system.unresisted_share(load) > MAX_UNRESISTED:
            raise InputError(
                "the cage, or a part of it, is not held against the load",
                cure="Fix a side or a corner of it, or remove the load",
            )
        size = float(np.ptp(start[translate], axis=0).max())
        total = float(np.linalg.norm(forces[translate].sum(axis=0)))
        is_held = basis.shape[0] > basis.shape[1]
        system.inertia = mass * (total / (mass.sum() / 3 * _FREE_STEP * size))
        system.inertia *= _HELD_INERTIA if is_held else 1.0
        if guess is not None:
            z, decades = guess, np.ones(1)
            system.inertia_scale = _NEAR_INERTIA
        else:
            z = start if released is None else released
            decades = _decades(given, total, size)
        current = _soften(given, decades[0])
        if given and guess is None and not is_held and total > 0.0:
            z = fall(current, z, forces[translate].sum(axis=0), translate, size)
        current = [t.advance_friction(z) if t.friction is None else t for t in current]
        held = [t.advance_friction(z) if t.hold is None else t for t in layers]
        if gripped is not None:
            system.terms = [*loads, *terms, *current, *held]
            z = _move_held(system, z, gripped)
        for share in decades:
            current = [
                stiffen(term, share * whole.stiffness, z)
                for term, whole in zip(current, given, strict=True)
            ]
            rubbing: list[Rubbing] = [*current, *held]
            z, rubbing = _find_balance(system, len(loads), z, rubbing, load, steps, near)
            current = [term for term in rubbing if isinstance(term, ObstacleTerm)]
            held = [term for term in rubbing if isinstance(term, LayerFriction)]
    if progress is not None:
        progress(1.0)
    return Settled(z, current, held, system.steps)


def _move_held(system: ReducedSystem, z: Floats, gripped: Floats) -> Floats:
    """Move held nodes, and the others with them as the tangent says if that is possible."""
    system.follow(z)
    for move in guess_moves(system, system.evaluate(z), gripped):
        if system.largest_step(z, move) >= 1.0:
            return z + move
    raise SolverError("the grips move too far at once", cure="Divide their path into more steps")


def fall(
    contacts: Sequence[ObstacleTerm],
    start: Floats,
    force: Floats,
    translate: Bools,
    size: float,
) -> Floats:
    """Move a body along a force, without deforming it, until its obstacles carry the force."""
    way = force / np.linalg.norm(force)
    move = np.where(translate[:, None], way, 0.0)

    def gap(length: float) -> float:
        return min(float(term.gaps(start + length * move).min()) for term in contacts)

    def surplus(length: float) -> float:
        z = start + length * move
        held = np.sum([term.forces(z)[translate].sum(axis=0) for term in contacts], axis=0)
        return float((held - force) @ way)

    centers = np.array([term.obstacle.center for term in contacts])
    reach = size + float(np.linalg.norm(centers - start[translate].mean(axis=0), axis=1).max())
    length = 0.0
    while (left := gap(length)) > 1e-9 * size:
        length += left  # no obstacle is nearer than its distance
        if length > _FAR * reach:
            raise InputError(
                "the cage falls past its obstacles",
                key="obstacles",
                cure="Put an obstacle below the cage, or fix a part of the cage",
            )
    # Deeper, or back if it starts too deep, until the springs carry the force.
    side = -1.0 if surplus(length) > 0.0 else 1.0
    step = 1e-6 * size
    while side * surplus(length + side * step) < 0.0 and step < size:
        step *= 2.0
    if surplus(length) * surplus(length + side * step) < 0.0:
        step = float(brentq(lambda x: surplus(length + side * x), 0.0, step))
    return start + (length + side * step) * move


def _decades(contacts: Sequence[ObstacleTerm], total: float, size: float) -> Floats:
    """Choose the shares of the springs' stiffness, each at most ten times the one before."""
    first = SOFTEST if contacts else 1.0
    for term in contacts:
        allowed = min(MAX_DEPTH * term.obstacle.depth, MAX_SINKING * size)
        sinking = total / float(term.samples.areas.sum()) / term.stiffness
        first = max(first, sinking / allowed)
    count = 1 + int(np.ceil(-np.log10(min(first, 1.0)) - 1e-9))
    return np.geomspace(min(first, 1.0), 1.0, count)


def _soften(contacts: Sequence[ObstacleTerm], share: float) -> list[ObstacleTerm]:
    return [term.replace(stiffness=share * term.stiffness) for term in contacts]


def _find_balance(
    system: ReducedSystem,
    loads: int,
    z: Floats,
    contacts: list[Rubbing],
    load: Floats,
    steps: int,
    near: bool,
) -> tuple[Floats, list[Rubbing]]:
    """Find a state of balance with Coulomb friction, and end the step in it."""
    # Near a balance, Newton's method with limits that follow the normal forces needs few steps. If
    # it fails, it starts again from the least energy with given limits, and these are renewed.
    others = system.terms[: len(system.terms) - len(contacts)]
    if all(term.coefficient == 0.0 for term in contacts):
        system.terms = [*others, *contacts]
        # Without a load, balance is relative to what is unbalanced at the start: start twice.
        for _ in range(1 if load.any() else 2):
            z = load_in_shares(system, loads, z, steps, rests=False).positions
        return z, contacts
    for attempt in range(_MAX_REPEATS):
        found = _follow_limits(system, others, z, contacts, load) if attempt or near else None
        if found is not None:
            return found, [term.advance_friction(found) for term in contacts]
        system.terms = [*others, *contacts]
        try:
            z = load_in_shares(system, loads, z, steps, rests=False).positions
            steps = min(steps, system.steps + _MAX_RENEWING)
        except SolverError as error:
            raise SolverError(
                "no equilibrium with friction was found: the cage may slide off its obstacles",
                key="obstacles",
                cure="Raise friction, fix a part of the cage, or lower the load",
            ) from error
        contacts = [term.follow_friction(z, follows=False) for term in contacts]
    raise SolverError(
        "no balance with friction was found: samples keep changing between sticking and sliding",
        key="obstacles",
        cure="Lower friction, or use other cells",
    )


def _follow_limits(
    system: ReducedSystem,
    others: Sequence[EnergyTerm],
    z: Floats,
    contacts: list[Rubbing],
    load: Floats,
) -> Floats | None:
    """Balance forces with limits of friction that follow the normal forces; None if that fails."""
    pressed = np.sum([term.forces(z) for term in contacts], axis=0)
    size = float(np.linalg.norm(load) or np.linalg.norm(system.reduce_forces(pressed)) or 1.0)

    def balance(z: Floats) -> tuple[list[TermState], Floats, float]:
        system.terms = [*others, *(term.follow_friction(z) for term in contacts)]
        states = system.evaluate(z)
        force = system.forces(states)
        return states, force, float(np.linalg.norm(force)) / size

    states, force, left = balance(z)
    best, since = (z, left), 0
    for _ in range(_MAX_BALANCING):
        if left <= MAX_RESIDUAL:
            return z
        system.report()  # may raise, to cancel
        system.follow(z)
        try:
            solve = system.factorise_unsymmetric(system.add_shift(system.tangent(states)))
        except SolverError:
            break
        move, last = system.node_moves(-solve(force)), left
        length = min(1.0, system.largest_step(z, move))
        states, force, left = balance(z + length * move)
        for _ in range(_MAX_HALVINGS):
            if left < _MAX_RISE * last:
                break
            length /= 2
            states, force, left = balance(z + length * move)
        z = z + length * move
        best, since = ((z, left), 0) if left < best[1] else (best, since + 1)
        if since > _PATIENCE or not np.isfinite(left):
            break
    return best[0] if best[1] <= _ROUNDED_RESIDUAL else None
