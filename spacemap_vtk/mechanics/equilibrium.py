"""The stable equilibrium of a body under loads, however far it moves and turns.

It is where the energy of all terms is least. Newton's method alone hardly gets there: its linear
solution stretches whatever it turns, and a thin sheet bears so little stretch that a search for
less energy allows short steps only. Three things make the way short:

- The tangent has the stress C (ε + G Δz) that the last step's linear solution balances, not that of
  its spurious stretch (mixed integration points: Magisano, Leonetti and Garcea, Comput. Methods
  Appl. Mech. Eng. 313 (2017) 986). Only the rotation of a step is limited; energy may rise in
  between. Where this leads nowhere, steps take over of which each lowers the energy.
- Far from the end the tangent has only stresses that pull, and so is positive definite; nearer to
  it, as little less than all as keeps it so.
- A state that is not stable is left along its lowest eigenvector, and along what bends with it.

How the energy depends on the positions is not assumed: the length of a step is found from the slope
of the energy along it, and no step is longer than a term admits (`EnergyTerm.largest_step`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics import blas_threads
from spacemap_vtk.mechanics.body import Body
from spacemap_vtk.mechanics.energy_terms import EnergyTerm, TermState
from spacemap_vtk.ndarrays import Floats, Progress

#: Unbalanced share of the load up to which a state is one of equilibrium; or the share of the
#: energy that a further step would win, where forces have no more digits.
RESIDUAL, DECREMENT = 1e-8, 1e-18

#: Or that below which steps win no less than one before them, as often as this: only rounding is
#: left, as of tetrahedra that are far thinner than wide.
LOST, OFTEN = 1e-6, 3

#: Share of the largest step that is admissible below which the tangent comes nearer to the exact
#: one.
NEAR = 0.3

#: Share of the steepest slope that may be left at the end of a step along which energy falls, the
#: share of all energies that rounding leaves of their sum, and how many lengths are tried.
LEVEL, NOISE, TRIALS = 0.1, 1e-13, 40

#: Share of the stresses that do not pull which may be missing from a tangent before it is made
#: exact, and how much is left out first where the exact one is indefinite.
EXACT, SOFT = 0.02, 0.1

#: Steps without less energy than ever before, after which each has to lower it.
PATIENCE = 25

#: Share of the energy that a step would win below which a state that is not stable is left,
#: although it is not found to the last digit.
EARLY = 1e-6

#: Share of |v| · |K| |v| that rounding may leave of an eigenvalue.
ROUNDING = 1e-14

#: Share of the largest admissible step up to which a tangent changes in proportion to the load.
STRAIGHT = 0.2

#: Steps after which a smaller share of the load is tried, and the least such share.
ATTEMPT, LEAST = 400, 1 / 64

#: Share of the load that may be left to motions that nothing resists: rounding of a balanced one.
FREE = 0.01


class Equilibrium(NamedTuple):
    """A stable state."""

    positions: Floats
    """Nodal vectors (V, 3)."""
    steps: int
    """Linear systems that were solved."""
    residual: float
    """Norm of the unbalanced forces, as a share of that of the load."""
    critical: float | None
    """Share of the load at which the body buckled, on its way straight to an unstable state."""


def equilibrium(
    terms: Sequence[EnergyTerm],
    basis: sp.csr_matrix,
    start: Floats,
    loads: Sequence[EnergyTerm],
    *,
    progress: Progress | None = None,
    steps: int = 1200,
) -> Equilibrium:
    """Return a stable equilibrium of a body under loads, which are applied in shares if need be."""
    # Nodal vectors are start (V, 3) + (basis @ q).reshape(V, 3), with the basis (3V, N) of what the
    # supports leave free; `steps` bounds the linear systems that are solved. At each of them
    # `progress` is called with the share of the work done; it may raise, to cancel. InputError: of
    # a body that nothing holds against the load. SolverError: where the steps do not suffice.
    with blas_threads.one():
        body = Body([*loads, *terms], basis, start, progress or (lambda _: None))
        acting = -body.along_free(np.sum([load.forces(start) for load in loads], axis=0))
        if body.free_share(acting) > FREE:
            raise InputError(
                "nothing holds the cage, or a part of it, against the load",
                cure="Hold a side or a corner of it, or take the load away",
            )
        z, residual, reached, step = start, 0.0, 0.0, 1.0
        critical: float | None = None
        while reached < 1.0:
            share = min(1.0, reached + step)
            search = _Search(body, len(loads), z, reached, share)
            found = search.run(min(steps, body.steps + ATTEMPT))
            critical = search.critical if critical is None else critical
            if found is not None:
                z, residual, reached, step = *found, share, 2 * step
                continue
            step /= 2
            if step < LEAST or body.steps >= steps:
                raise _unsolved(body.steps, reached, critical)
    if progress is not None:
        progress(1.0)
    return Equilibrium(z, body.steps, residual, critical)


def _unsolved(steps: int, reached: float, critical: float | None) -> SolverError:
    buckled = "" if critical is None else f", and it buckles at {critical:.3g} of it"
    return SolverError(
        f"no stable equilibrium was found in {steps} steps: {reached:.3g} of the load is borne"
        f"{buckled}",
        cure="Lower the load, hold more of the cage, or make it stiffer",
    )


class _Search:
    """The search for a stable state under a share of the load, from one under a smaller share."""

    def __init__(self, body: Body, loads: int, start: Floats, before: float, share: float) -> None:
        self._body, self._start, self._before, self._share = body, start, before, share
        #: The first terms of the body are the loads.
        self._loads = loads
        body.factors[:loads] = share
        self._z, self._best, self._least, self._since = start, start, np.inf, 0
        #: What the last step would have won, the least of these lately, and how often not less.
        self._won, self._lowest, self._often = np.inf, np.inf, 0
        #: How much of the negative curvature the tangent is without.
        self._firm = 1.0
        #: Whether each step has to lower the energy; if not, what the last step has predicted.
        self._careful = False
        self._carried: list[Any] | None = None
        #: The positions that were asked for last, and the terms there.
        self._known: tuple[Floats, list[TermState]] | None = None
        #: Share of the load at which the straight way stops being stable.
        self.critical: float | None = None

    def run(self, limit: int) -> tuple[Floats, float] | None:
        """Return the state and its residual, or None where it takes more steps."""
        body, full = self._body, 0.0
        while body.steps < limit:
            states = self._at(self._z)
            force, energies = body.forces(states), body.energies(states)
            energy, size = float(energies.sum()), float(abs(energies).sum())
            left = float(np.linalg.norm(force))
            full = full or self._applied(states) or left or 1.0
            settled = (
                left <= RESIDUAL * full or self._won <= DECREMENT * size or self._often >= OFTEN
            )
            if self._astray(energy, size, settled):
                continue
            if settled or self._firm < EXACT or self._won <= EARLY * size:
                self._firm = 0.0
            own = settled or self._careful
            matrix = body.tangent(states, None if own else self._carried, self._firm)
            try:
                solve = (body.definite if self._firm == 1.0 else body.solution)(matrix)
            except SolverError:
                if self._firm > 0.0:
                    self._firm = min(1.0, 3.0 * self._firm)
                    continue
                self._firm = SOFT
                found = settled or self._won <= EARLY * size
                if not (found and not self._left(states, matrix) and settled):
                    continue
            if settled and body.admits(self._z):
                return self._z, left / full
            if settled and self._careful:
                return None
            if settled:  # a long step has turned over what no small one can
                self._go_back(self._start)
                continue
            q = -solve(force)
            self._won = -float(q @ force)
            self._often = self._often + 1 if self._won < LOST * size and self._firm == 0.0 else 0
            if self._won < self._lowest / 2 or self._often == 0:
                self._lowest, self._often = self._won, 0
            self._step(states, q)
        return None

    def _at(self, z: Floats) -> list[TermState]:
        if self._known is None or self._known[0] is not z:
            self._known = z, self._body.at(z)
        return self._known[1]

    def _applied(self, states: list[TermState]) -> float:
        """Return the norm of the loads."""
        forces = np.sum([state.forces for state in states[: self._loads]], axis=0)
        return self._share * float(np.linalg.norm(self._body.along_free(forces)))

    def _astray(self, energy: float, size: float, settled: bool) -> bool:
        """Go back to the state of least energy where the way leads away from it."""
        self._since = 0 if energy < self._least - 1e-9 * abs(self._least) else self._since + 1
        if energy < self._least:
            self._least, self._best = energy, self._z
        worse = settled and energy > self._least + 1e-9 * size
        if self._careful or not (worse or self._since > PATIENCE):
            return False
        self._go_back(self._best)
        return True

    def _go_back(self, z: Floats) -> None:
        """Begin anew at some positions, with steps that lower the energy."""
        self._z, self._best, self._least, self._since = z, z, np.inf, 0
        self._careful, self._often, self._firm, self._won = True, 0, 1.0, np.inf

    def _step(self, states: list[TermState], q: Floats) -> None:
        """Make a step, and choose the next tangent."""
        move = self._body.moved(q)
        most = self._body.largest_step(self._z, move)
        if self._careful:
            length = self._fall(q, np.zeros_like(q), min(2.0, most))[0]
            near = length > 0.5
        else:
            length, near = min(1.0, most), NEAR * most > 1.0
        self._firm = self._firm / 3 if near else 1.0
        move = length * move
        self._carried = [state.predicted(move) for state in states]
        self._z = self._moved_to(self._z + move)

    def _moved_to(self, z: Floats) -> Floats:
        """Return positions: the very ones that were tried last, where they are the same."""
        return z if self._known is None or (self._known[0] != z).any() else self._known[0]

    def _left(self, states: list[TermState], matrix: sp.csr_matrix) -> bool:
        """Leave a state whose tangent is not definite; tell whether it is so beyond rounding."""
        body = self._body
        value, q, solve = body.lowest(matrix, body.tangent(states, firm=1.0))
        self._won = np.inf
        if value > -ROUNDING * float(abs(q) @ (abs(matrix) @ abs(q))):
            return False
        straight = self._z - self._start
        if self.critical is None and body.largest_step(self._start, straight) * STRAIGHT > 1.0:
            stable = body.tangent(body.at(self._start))
            way = -1.0 / body.lowest(matrix - stable, stable)[0]
            self.critical = self._before + (self._share - self._before) * way
        # The first of the largest components is positive, so that rounding does not choose a side.
        q = q * np.sign(q[(abs(q) > 0.999 * abs(q).max()).argmax()])
        move = body.moved(q)
        q = q * min(body.largest_step(self._z, side * move) for side in (1.0, -1.0))
        move = body.moved(q)
        # What bends must not stretch, and so the way curves: z + a Δz + a² w (Koiter 1945).
        there, back = (body.forces(body.at(self._z + side * move)) for side in (1.0, -1.0))
        bend = -solve((there + back) / 2 - body.forces(states))
        length, energy = self._fall(q, bend, 1.0)
        other, lower = self._fall(-q, bend, 1.0)
        length = -other if lower < energy else length
        move, curve = length * move, length**2 * body.moved(bend)
        self._carried = [state.predicted(move, curve) for state in states]
        self._z = self._z + move + curve
        return True

    def _fall(self, q: Floats, bend: Floats, most: float) -> tuple[float, float]:
        """Return how far, up to `most`, the energy falls along a q + a² bend, and its value."""
        # Nothing is assumed about the energy but that its slope along the way is continuous.
        body, z = self._body, self._z
        move, curve = body.moved(q), body.moved(bend)

        def trial(length: float) -> tuple[float, float, float]:
            states = self._at(z + length * move + length**2 * curve if length else z)
            energies = body.energies(states)
            slope = float(body.forces(states) @ (q + 2 * length * bend))
            return float(energies.sum()), float(abs(energies).sum()), slope

        return fall(trial, most)


def fall(trial: Callable[[float], tuple[float, float, float]], most: float) -> tuple[float, float]:
    """Return a length, up to `most`, at which a function stops falling, and its value there."""
    # `trial` returns for a length the value, the size of what it is a sum of, and the slope. The
    # slope at zero is negative, or zero at a maximum. The first trial is taken that leaves no more
    # than a share LEVEL of the steepest slope.
    first, _, slope = trial(0.0)
    low, high = (0.0, slope), (0.0, 0.0)
    steepest, length = -slope, min(1.0, most)
    for _ in range(TRIALS):
        value, size, slope = trial(length)
        falls = value <= first + NOISE * size
        steepest = max(steepest, -slope)
        if falls and (abs(slope) < LEVEL * steepest or (slope <= 0.0 and length == most)):
            return length, value
        if falls and slope <= 0.0:
            low = length, slope
        else:
            high = length, slope
        if high[0] == 0.0:
            length = min(2.0 * length, most)
            continue
        # By secants, not too near to either end; where these say nothing, by halves.
        width, share = high[0] - low[0], 0.5
        if low[1] < 0.0 < high[1]:
            share = float(np.clip(low[1] / (low[1] - high[1]), 0.1, 0.9))
        length = low[0] + share * width
    return low[0] or length, value
