"""Stable equilibrium of a body under loads, for any displacements and rotations.

The equilibrium is the state of least energy. Newton's method alone hardly reaches it: its linear
solution stretches everything that it turns, and a thin sheet tolerates so little stretch that a
line search for less energy allows only short steps. Three measures keep the number of steps small:

- The tangent uses the stress C (ε + G Δz) that balances the linear solution of the last step,
  without its spurious stretch (mixed integration points: Magisano, Leonetti and Garcea, Comput.
  Methods Appl. Mech. Eng. 313 (2017) 986). Only the rotation of a step is limited; the energy may
  rise on the way. If this does not converge, the search continues with steps that each lower the
  energy.
- Far from the solution the tangent contains only tensile stresses and is therefore positive
  definite. Closer to it, the smallest share of the other stresses is left out that keeps it so.
- From an unstable state the search moves along the lowest eigenvector, with a second-order
  correction.

Near a guess, the steps of a sheet turn its cells instead of stretching them
(`ReducedSystem.turn`). The next step then has little stretch to undo, and may leave out less of the
compressive stresses than the one before, as long as the sheet turns by a moderate angle. From far
away such steps are no gain: the longest ones, which stretch most, lead to the folds soonest.

Nothing is assumed about how the energy depends on the positions: the length of a step follows from
the slope of the energy along it, and no step is longer than a term admits
(`EnergyTerm.largest_step`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, TermState, sum_at_nodes
from spacemap_vtk.mechanics.equilibrium.reduced_system import ReducedSystem, Turn
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.mechanics.linalg.factors import Solve
from spacemap_vtk.ndarrays import Floats, Progress

#: A state is in equilibrium if the unbalanced forces are at most this share of the load …
MAX_RESIDUAL = 1e-8
#: … or if a further step would lower the energy by at most this share, because forces have no more
#: correct digits then …
MAX_DECREASE = 1e-18
#: … or if MAX_STALLED steps in a row would each lower the energy by less than the share STALLED,
#: and by no less than half of the smallest decrease before. Only rounding is left then, as with
#: tetrahedra that are much thinner than wide. On obstacles such steps may be real: where many
#: samples touch and hardly press, each step changes which of them do.
STALLED = 1e-6
MAX_STALLED = 3

#: Share of the largest admissible step below which the next tangent is made closer to the exact
#: one.
NEAR = 0.3

#: This share for steps that turn a sheet.
NEAR_TURNED = 1.0
#: If such a step is this many times the largest admissible one, the next tangent leaves out
#: MORE_REMOVED times as much of the compressive stresses, counted from FEW_REMOVED or more.
FAR_TURNED = 2.0
MORE_REMOVED = 9.0
FEW_REMOVED = 0.06
#: A step that is this many times smaller than the largest admissible one is made straight: turning
#: would change it by less than rounding does.
STRAIGHT = 1e4

#: Line search: share of the steepest slope that may be left at the end of a step.
MAX_SLOPE = 0.1
#: Line search: rounding error of the total energy, as a share of the sum of absolute energies.
ENERGY_ROUNDING = 1e-13
#: Line search: largest number of lengths that are tried.
MAX_TRIALS = 40

#: A tangent that lacks less than this share of the compressive stresses is made exact.
EXACT = 0.02
#: Share of these stresses that is removed first if the exact tangent is indefinite.
FIRST_REMOVED = 0.1
#: Both shares where steps turn a sheet, which leaves the tangent closer to the exact one.
EXACT_TURNED = 0.006
FIRST_TURNED = 0.02

#: Number of steps without a new least energy, after which every step has to lower the energy.
PATIENCE = 25

#: An unstable state is left as soon as a step would lower the energy by less than this share, even
#: if the state has not been found to the last digit.
EARLY = 1e-6

#: Rounding error of an eigenvalue, as a share of |v| · |K| |v|.
ROUNDING = 1e-14

#: Up to this share of the largest admissible step, the tangent is assumed to change in proportion
#: to the load.
PROPORTIONAL = 0.2

#: Number of steps after which a smaller share of the load is tried.
MAX_STEPS = 400
#: Smallest share of the load that is tried.
MIN_SHARE = 1 / 64

#: Largest share of a load in directions that nothing resists; in a balanced load it is rounding.
MAX_UNRESISTED = 0.01


#: A body that only its contact holds has motions that nothing resists, in which Newton's steps have
#: no end; inertia bounds them. It falls while the energy falls, so that it costs few steps.
#: Factors of the inertia after a step that raises the energy, and after one that lowers it …
MORE_INERTIA = 4.0
LESS_INERTIA = 0.5
#: … and its least and largest multiple of the inertia at the start.
LEAST_INERTIA = 1e-4
MOST_INERTIA = 1e2


class Equilibrium(NamedTuple):
    """Stable equilibrium of a body."""

    positions: Floats
    """Nodal vectors (V, 3)."""
    steps: int
    """Number of linear systems that were solved."""
    residual: float
    """Norm of the unbalanced forces, as a share of that of the load."""
    critical: float | None
    """Share of the load at which the body buckled, if its direct path became unstable."""


def find_equilibrium(
    terms: Sequence[EnergyTerm],
    basis: sp.csr_matrix,
    start: Floats,
    loads: Sequence[EnergyTerm],
    *,
    progress: Progress | None = None,
    steps: int = 1200,
    turn: Turn | None = None,
    guess: Floats | None = None,
) -> Equilibrium:
    """Find a stable equilibrium of a body under loads, which are applied in shares if necessary."""
    # Nodal vectors are start (V, 3) + (basis @ q).reshape(V, 3), with the basis (3V, N) of what the
    # supports leave free; `steps` limits the number of linear systems. Before each of them
    # `progress` is called with the share of the work that is done; it may raise, to cancel.
    # The search begins near `guess` (V, 3), whose strains are errors, with steps that `turn` makes,
    # see `ReducedSystem.turn`. If it fails there, it begins at the start, with straight steps.
    # Raises InputError if nothing holds the body against the load, and SolverError if the steps do
    # not suffice.
    with blas_threads.use_one_thread():
        system = ReducedSystem([*loads, *terms], basis, start, progress or (lambda _: None))
        load = -system.reduce_forces(np.sum([term.forces(start) for term in loads], axis=0))
        if system.unresisted_share(load) > MAX_UNRESISTED:
            raise InputError(
                "the cage, or a part of it, is not held against the load",
                cure="Fix a side or a corner of it, or remove the load",
            )
        found = None
        if guess is not None:
            system.turn = turn
            found = _refine_guess(system, len(loads), guess)
            system.turn = None
        found = found or load_in_shares(system, len(loads), start, steps)
    if progress is not None:
        progress(1.0)
    return found


def _refine_guess(system: ReducedSystem, loads: int, guess: Floats) -> Equilibrium | None:
    """Find the equilibrium near a guess; None if the search fails."""
    search = _Search(system, loads, guess, 0.0, 1.0, rests=False)
    search.expect_no_stress()
    try:
        found = search.run(system.steps + MAX_STEPS)
    except SolverError:
        return None
    return None if found is None else Equilibrium(found[0], system.steps, found[1], None)


def load_in_shares(
    system: ReducedSystem, loads: int, start: Floats, steps: int, rests: bool = True
) -> Equilibrium:
    """Apply the first terms of a system, its loads, in as few shares as succeed."""
    # Where a body buckles is known only if it rests without the loads at the start.
    z, residual, solved_share, step = start, 0.0, 0.0, 1.0
    critical: float | None = None
    while solved_share < 1.0:
        share = min(1.0, solved_share + step)
        search = _Search(system, loads, z, solved_share, share, rests)
        found = search.run(min(steps, system.steps + MAX_STEPS))
        critical = search.critical if critical is None else critical
        if found is not None:
            z, residual, solved_share, step = *found, share, 2 * step
            continue
        step /= 2
        if step < MIN_SHARE or system.steps >= steps:
            raise _no_equilibrium(system.steps, solved_share, critical)
    return Equilibrium(z, system.steps, residual, critical)


def _no_equilibrium(steps: int, solved_share: float, critical: float | None) -> SolverError:
    buckled = "" if critical is None else f", and the cage buckles at {critical:.1%} of it"
    return SolverError(
        f"no stable equilibrium was found in {steps} steps: the search reached {solved_share:.1%} "
        f"of the load{buckled}",
        cure="Lower the load, fix more of the cage, or make it stiffer",
    )


class GripFollower:
    """Equilibria of a body whose held nodes are moved, each found from the one before."""

    def __init__(self, system: ReducedSystem, loads: int, z: Floats) -> None:
        #: Nodal vectors (V, 3) of the last equilibrium.
        self.z = z
        # The first terms of the system are its loads, of constant size.
        self._system, self._loads = system, loads
        self._solve: Solve | None = None
        #: Largest norm of the forces that held a state so far. A body that is released is in
        #: balance to the digits of the forces that held it before.
        self._largest = 0.0

    def move(self, held: Floats, steps: int) -> bool:
        """Move the held nodes by `held` (V, 3); False if no state is found in so many steps."""
        system = self._system
        states = system.evaluate(self.z)
        for move in guess_moves(system, states, held, self._solve):
            if system.largest_step(self.z, move) < 1.0:
                continue
            predictions = [state.predict(move) for state in states]
            start = self.z + move
            search = _Search(system, self._loads, start, 0.0, 1.0, True, predictions)
            search.least_norm = self._largest
            try:
                found = search.run(system.steps + steps)
            except SolverError:
                found = None
            if found is not None:
                self.z, self._solve = found[0], search.solve
                self._largest = search.load_norm
                return True
        return False


def guess_moves(
    system: ReducedSystem, states: list[TermState], held: Floats, solve: Solve | None = None
) -> Iterator[Floats]:
    """Guess how all nodes move with held ones, (V, 3): by the tangent, then held nodes alone."""
    total = np.zeros_like(held)
    for factor, state in zip(system.factors, states, strict=True):
        nodes, blocks = state.term.nodes, state.tangent()
        moved = held[nodes].reshape(len(nodes), 3 * nodes.shape[1], 1)
        pulled = (blocks @ moved).reshape(*nodes.shape, 3)
        total += factor * sum_at_nodes(nodes, pulled, len(total))
    try:
        if solve is None:
            solve = system.factorise(system.tangent(states))
        yield held - system.node_moves(solve(system.reduce_forces(total)))
    except SolverError:
        pass  # the state is about to buckle
    yield held


class _Search:
    """Search for a stable state under a share of the load, from one under a smaller share."""

    def __init__(
        self,
        system: ReducedSystem,
        loads: int,
        start: Floats,
        before: float,
        share: float,
        rests: bool = True,
        predictions: list[Any] | None = None,
    ) -> None:
        self._system, self._start, self._before, self._share = system, start, before, share
        #: Whether grips have moved, so that the forces that hold them are loads, too.
        self._is_gripped = predictions is not None
        #: Norm of the loads, to which unbalanced forces are compared, and least value of it.
        self.load_norm = self.least_norm = 0.0
        #: Whether the start is in equilibrium before this share; it need not be on obstacles.
        self._rests = rests
        #: Number of loads; they are the first terms of the system.
        self._loads = loads
        system.factors[:loads] = share
        self._z, self._best, self._least_energy, self._steps_since_least = start, start, np.inf, 0
        #: Whether the last tangent was not definite until more of the stresses were left out.
        self._was_indefinite = False
        #: Expected decrease of energy in the last step; the smallest such decrease recently; and
        #: the number of steps in a row that did not clearly go below it.
        self._expected_decrease, self._smallest_decrease, self._stalled_steps = np.inf, np.inf, 0
        self._last_energy = np.inf
        #: Share of the compressive stresses (negative curvature) that the tangent leaves out.
        self._removed_share = 0.0 if self._is_gripped else 1.0
        #: Whether each step has to lower the energy. If not, `_predictions` holds the prediction of
        #: the last step.
        self._must_descend = False
        self._predictions: list[Any] | None = predictions
        #: Solver with the exact tangent of the state that was found.
        self.solve: Solve | None = None
        #: Positions that were evaluated last, and the terms there.
        self._last_evaluation: tuple[Floats, list[TermState]] | None = None
        #: Share of the load at which the direct path becomes unstable.
        self.critical: float | None = None

    def run(self, limit: int) -> tuple[Floats, float] | None:
        """Find the state and its residual; None if it needs more steps than the limit."""
        system = self._system
        exact, first = EXACT, FIRST_REMOVED
        if system.turn is not None:
            exact, first = EXACT_TURNED, FIRST_TURNED
        while system.steps < limit:
            states = self._evaluate(self._z)
            force, energies = system.forces(states), system.energies(states)
            energy, size = float(energies.sum()), float(abs(energies).sum())
            unbalanced = float(np.linalg.norm(force))
            if system.inertia.any():
                rises = energy > self._last_energy
                scale = system.inertia_scale * (MORE_INERTIA if rises else LESS_INERTIA)
                system.inertia_scale = float(np.clip(scale, LEAST_INERTIA, MOST_INERTIA))
                self._last_energy = energy
            if self._is_gripped:
                held = self._held_norm(states, unbalanced)
                self.load_norm = max(self.least_norm, self._load_norm(states), held)
            self.load_norm = self.load_norm or self._load_norm(states) or unbalanced or 1.0
            settled = (
                unbalanced <= MAX_RESIDUAL * self.load_norm
                or self._expected_decrease <= MAX_DECREASE * size
                or (self._rests and self._stalled_steps >= MAX_STALLED)
            )
            if self._return_if_astray(energy, size, settled):
                continue
            if settled or self._removed_share < exact or self._expected_decrease <= EARLY * size:
                self._removed_share = 0.0
            own = settled or self._must_descend
            system.follow(self._z)
            matrix = system.tangent(states, None if own else self._predictions, self._removed_share)
            is_definite = self._removed_share == 1.0
            try:
                solve = (
                    system.factorise_definite(matrix) if is_definite else system.factorise(matrix)
                )
            except SolverError:
                self._was_indefinite = True
                if self._removed_share > 0.0:
                    self._removed_share = min(1.0, 3.0 * self._removed_share)
                    continue
                self._removed_share = first
                found = settled or self._expected_decrease <= EARLY * size
                if not (found and not self._leave_unstable_state(states, matrix) and settled):
                    continue
            if settled and system.admits(self._z):
                self.solve = solve
                return self._z, unbalanced / self.load_norm
            if settled and self._must_descend:
                return None
            if settled:  # long steps have turned something over that short steps cannot turn back
                self._restart(self._start)
                continue
            q = -solve(force)
            self._expected_decrease = -float(q @ force)
            self._count_stalled_steps(size)
            self._make_step(states, q)
        return None

    def expect_no_stress(self) -> None:
        """Make the first tangent one without stresses: those at the start are errors of a guess."""
        self._predictions = [state.predict_unstressed() for state in self._evaluate(self._z)]

    def _count_stalled_steps(self, size: float) -> None:
        """Count the steps in a row that lower the energy by rounding only."""
        stalled = self._expected_decrease < STALLED * size and self._removed_share == 0.0
        if stalled and self._expected_decrease >= self._smallest_decrease / 2:
            self._stalled_steps += 1
        else:
            self._smallest_decrease, self._stalled_steps = self._expected_decrease, 0

    def _evaluate(self, z: Floats) -> list[TermState]:
        if self._last_evaluation is None or self._last_evaluation[0] is not z:
            self._last_evaluation = z, self._system.evaluate(z)
        return self._last_evaluation[1]

    def _load_norm(self, states: list[TermState]) -> float:
        """Compute the norm of the loads."""
        forces = np.sum([state.forces for state in states[: self._loads]], axis=0)
        return self._share * float(np.linalg.norm(self._system.reduce_forces(forces)))

    def _held_norm(self, states: list[TermState], unbalanced: float) -> float:
        """Compute the norm of the forces that hold supports and grips."""
        total = np.zeros_like(self._start)
        for factor, state in zip(self._system.factors, states, strict=True):
            total += factor * state.forces
        return math.sqrt(max(float(np.vdot(total, total)) - unbalanced**2, 0.0))

    def _return_if_astray(self, energy: float, size: float, settled: bool) -> bool:
        """Go back to the state of least energy if the search leads away from it."""
        self._steps_since_least += 1
        if energy < self._least_energy - 1e-9 * abs(self._least_energy):
            self._steps_since_least = 0
        if energy < self._least_energy:
            self._least_energy, self._best = energy, self._z
        worse = settled and energy > self._least_energy + 1e-9 * size
        if self._must_descend or not (worse or self._steps_since_least > PATIENCE):
            return False
        self._restart(self._best)
        return True

    def _restart(self, z: Floats) -> None:
        """Start again at the given positions, with steps that lower the energy."""
        self._z, self._best, self._least_energy, self._steps_since_least = z, z, np.inf, 0
        self._must_descend, self._stalled_steps = True, 0
        self._removed_share, self._expected_decrease = 1.0, np.inf

    def _make_step(self, states: list[TermState], q: Floats) -> None:
        """Make a step, and choose the next tangent."""
        move = self._system.node_moves(q)
        most = self._system.largest_step(self._z, move)
        if self._must_descend:
            length = self._search_line(q, np.zeros_like(q), min(2.0, most))[0]
            near = length > 0.5
        else:
            length, near = min(1.0, most), NEAR * most > 1.0
        turns = self._system.turn if not self._must_descend else None
        if turns is None:
            self._removed_share = self._removed_share / 3 if near else 1.0
        elif most * FAR_TURNED < 1.0:
            self._removed_share = min(1.0, MORE_REMOVED * max(self._removed_share, FEW_REMOVED))
        elif NEAR_TURNED * most > 1.0 and not self._was_indefinite:
            self._removed_share /= 3
        self._was_indefinite = False
        move = length * move
        self._predictions = [state.predict(move) for state in states]
        if turns is not None and most < STRAIGHT:
            move = turns(self._z, move)
        self._z = self._reuse_if_equal(self._z + move)

    def _reuse_if_equal(self, z: Floats) -> Floats:
        """Return the positions; the array that was evaluated last if they are equal to it."""
        if self._last_evaluation is None or (self._last_evaluation[0] != z).any():
            return z
        return self._last_evaluation[0]

    def _leave_unstable_state(self, states: list[TermState], matrix: sp.csr_matrix) -> bool:
        """Leave a state of indefinite tangent; return whether it is indefinite beyond rounding."""
        system = self._system
        value, q, solve = system.lowest_eigenpair(matrix, system.tangent(states, removed=1.0))
        self._expected_decrease = np.inf
        if value > -ROUNDING * float(abs(q) @ (abs(matrix) @ abs(q))):
            return False
        straight = self._z - self._start
        if (
            self._rests
            and not self._is_gripped
            and self.critical is None
            and system.largest_step(self._start, straight) * PROPORTIONAL > 1.0
        ):
            stable = system.tangent(system.evaluate(self._start))
            way = -1.0 / system.lowest_eigenpair(matrix - stable, stable)[0]
            self.critical = self._before + (self._share - self._before) * way
        # The first of the largest components is made positive, or rounding would choose the side.
        q = q * np.sign(q[(abs(q) > 0.999 * abs(q).max()).argmax()])
        move = system.node_moves(q)
        q = q * min(system.largest_step(self._z, side * move) for side in (1.0, -1.0))
        move = system.node_moves(q)
        # Bending must not stretch the sheet, so the path is curved: z + a Δz + a² w (Koiter 1945).
        there, back = (
            system.forces(system.evaluate(self._z + side * move)) for side in (1.0, -1.0)
        )
        bend = -solve((there + back) / 2 - system.forces(states))
        length, energy = self._search_line(q, bend, 1.0)
        other, lower = self._search_line(-q, bend, 1.0)
        length = -other if lower < energy else length
        move, curve = length * move, length**2 * system.node_moves(bend)
        self._predictions = [state.predict(move, curve) for state in states]
        self._z = self._z + move + curve
        return True

    def _search_line(self, q: Floats, bend: Floats, most: float) -> tuple[float, float]:
        """Find how far, up to `most`, the energy falls along a q + a² bend, and its value there."""
        # The only assumption about the energy is that its slope along the path is continuous.
        system, z = self._system, self._z
        move, curve = system.node_moves(q), system.node_moves(bend)

        def trial(length: float) -> tuple[float, float, float]:
            states = self._evaluate(z + length * move + length**2 * curve if length else z)
            energies = system.energies(states)
            slope = float(system.forces(states) @ (q + 2 * length * bend))
            return float(energies.sum()), float(abs(energies).sum()), slope

        return search_line(trial, most)


def search_line(
    trial: Callable[[float], tuple[float, float, float]], most: float
) -> tuple[float, float]:
    """Find a length, up to `most`, at which a function stops falling, and its value there."""
    # For a length, `trial` returns the value, the sum of the absolute terms of the value, and the
    # slope. The slope at zero is negative, or zero at a maximum. The search ends at the first
    # length where at most the share MAX_SLOPE of the steepest slope is left.
    first, _, slope = trial(0.0)
    low, high = (0.0, slope), (0.0, 0.0)
    steepest, length = -slope, min(1.0, most)
    for _ in range(MAX_TRIALS):
        value, size, slope = trial(length)
        falls = value <= first + ENERGY_ROUNDING * size
        steepest = max(steepest, -slope)
        if falls and (abs(slope) < MAX_SLOPE * steepest or (slope <= 0.0 and length == most)):
            return length, value
        if falls and slope <= 0.0:
            low = length, slope
        else:
            high = length, slope
        if high[0] == 0.0:
            length = min(2.0 * length, most)
            continue
        # By the secant method, not too close to either end; without a sign change, by bisection.
        width, share = high[0] - low[0], 0.5
        if low[1] < 0.0 < high[1]:
            share = float(np.clip(low[1] / (low[1] - high[1]), 0.1, 0.9))
        length = low[0] + share * width
    return low[0] or length, value
