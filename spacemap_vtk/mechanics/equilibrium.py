"""The stable equilibrium of a body under dead loads, however far it moves and turns.

It is where the energy W(z) - f · z is least. Newton's method alone hardly gets there: its linear
solution stretches whatever it turns, and a thin sheet bears so little stretch that a search for
less energy allows short steps only. Three things make the way short:

- The tangent has the stress C (ε + G Δz) that the last step's linear solution balances, not that of
  its spurious stretch (mixed integration points: Magisano, Leonetti and Garcea, Comput. Methods
  Appl. Mech. Eng. 313 (2017) 986). Only the rotation of a step is limited; energy may rise in
  between. Where this leads nowhere, steps take over of which each lowers the energy.
- Far from the end the tangent has only stresses that pull, and so is positive definite; nearer to
  it, as little less than all as keeps it so.
- Strains are quadratic in z: energy is, along a line, a polynomial of degree four, whose least
  value is known. A state that is not stable is left along its lowest eigenvector, and along what
  bends with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics import blas_threads
from spacemap_vtk.mechanics.body import Body, Part
from spacemap_vtk.mechanics.strains import Strains
from spacemap_vtk.ndarrays import Floats, Progress

#: Unbalanced share of the load up to which a state is one of equilibrium; or the share of the
#: energy that a further step would win, where forces have no more digits.
RESIDUAL, DECREMENT = 1e-8, 1e-18

#: Or that below which steps win no less than one before them, as often as this: only rounding is
#: left, as of tetrahedra that are far thinner than wide.
LOST, OFTEN = 1e-6, 3

#: Largest rotation of a step [rad].
TURN = 0.5

#: Rotation of a step below which the tangent comes nearer to the exact one.
NEAR = 0.15

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

#: Rotation on the way to a state up to which its tangent has changed in proportion to the load.
STRAIGHT = 0.1

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
    strains: Sequence[Strains],
    basis: sp.csr_matrix,
    start: Floats,
    load: Floats,
    *,
    progress: Progress | None = None,
    steps: int = 1200,
) -> Equilibrium:
    """Return a stable equilibrium of a body under a dead load (V, 3) [N]."""
    # Nodal vectors are start (V, 3) + (basis @ q).reshape(V, 3), with the basis (3V, N) of what the
    # supports leave free; `steps` bounds the linear systems that are solved. At each of them
    # `progress` is called with the share of the work done; it may raise, to cancel. InputError: of
    # a body that nothing holds against the load. SolverError: where the steps do not suffice.
    with blas_threads.one():
        body = Body(strains, basis, start, load, progress or (lambda _: None))
        if body.free_share() > FREE:
            raise InputError(
                "nothing holds the cage, or a part of it, against the load",
                cure="Hold a side or a corner of it, or take the load away",
            )
        z, residual, reached, step = start, 0.0, 0.0, 1.0
        critical: float | None = None
        while reached < 1.0:
            share = min(1.0, reached + step)
            search = _Search(body, z, reached, share)
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

    def __init__(self, body: Body, start: Floats, before: float, share: float) -> None:
        self._body, self._start, self._before, self._share = body, start, before, share
        self._z, self._best, self._least, self._since = start, start, np.inf, 0
        #: What the last step would have won, the least of these lately, and how often not less.
        self._won, self._lowest, self._often = np.inf, np.inf, 0
        #: How much of the stresses that do not pull the tangent is without.
        self._firm = 1.0
        #: Whether each step has to lower the energy; if not, stresses of the last step's solution.
        self._careful = False
        self._carried: list[Floats] | None = None
        #: Share of the load at which the straight way stops being stable.
        self.critical: float | None = None

    def run(self, limit: int) -> tuple[Floats, float] | None:
        """Return the state and its residual, or None where it takes more steps."""
        body, share = self._body, self._share
        full = share * float(np.linalg.norm(body.along_free(body.load)))
        while body.steps < limit:
            parts = body.at(self._z)
            force = body.forces(parts, share)
            strain_energy = sum(float(np.vdot(part.strain, part.stress)) / 2 for part in parts)
            work = share * float(np.vdot(body.load, self._z - body.start))
            energy, size = strain_energy - work, strain_energy + abs(work)
            left = float(np.linalg.norm(force))
            full = full or left or 1.0
            settled = (
                left <= RESIDUAL * full or self._won <= DECREMENT * size or self._often >= OFTEN
            )
            if self._astray(energy, size, settled):
                continue
            if settled or self._firm < EXACT or self._won <= EARLY * size:
                self._firm = 0.0
            own = settled or self._careful
            matrix = body.tangent(parts, None if own else self._carried, self._firm)
            try:
                solve = (body.definite if self._firm == 1.0 else body.solution)(matrix)
            except SolverError:
                if self._firm > 0.0:
                    self._firm = min(1.0, 3.0 * self._firm)
                    continue
                self._firm = SOFT
                found = settled or self._won <= EARLY * size
                if not (found and not self._left(parts, matrix) and settled):
                    continue
            if settled and not body.inside_out(self._z):
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
            self._step(parts, body.moved(q))
        return None

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

    def _step(self, parts: list[Part], move: Floats) -> None:
        """Make a step along a move, and choose the next tangent."""
        most = TURN / self._body.turn(move)
        if self._careful:
            length = _least(self._body.along(parts, move, self._share), min(2.0, most))[1]
            near = length > 0.5
        else:
            length, near = min(1.0, most), NEAR * most > TURN
        self._firm = self._firm / 3 if near else 1.0
        move = length * move
        self._carried = [
            part.kind.stresses(part.strain + part.kind.changes(part.gradients, move))
            for part in parts
        ]
        self._z = self._z + move

    def _left(self, parts: list[Part], matrix: sp.csr_matrix) -> bool:
        """Leave a state whose tangent is not definite; tell whether it is so beyond rounding."""
        body = self._body
        value, q, solve = body.lowest(matrix, body.tangent(parts, firm=1.0))
        self._won = np.inf
        if value > -ROUNDING * float(abs(q) @ (abs(matrix) @ abs(q))):
            return False
        if self.critical is None and body.turn(self._z - self._start) < STRAIGHT:
            stable = body.tangent(body.at(self._start))
            way = -1.0 / body.lowest(matrix - stable, stable)[0]
            self.critical = self._before + (self._share - self._before) * way
        # The first of the largest components is positive, so that rounding does not choose a side.
        move = body.moved(q * np.sign(q[(abs(q) > 0.999 * abs(q).max()).argmax()]))
        move *= TURN / body.turn(move)
        # What bends must not stretch, and so the way curves: z + a Δz + a² w (Koiter 1945).
        push, changes = np.zeros_like(move), []
        for kind, _, gradients, _ in parts:
            first, (second, slopes) = kind.changes(gradients, move), kind.squares(move)
            push += kind.summed(kind.stresses(second), gradients, len(move))
            push += kind.summed(kind.stresses(first), slopes, len(move))
            changes.append((first, second))
        curve = body.moved(-solve(body.along_free(push)))
        powers = body.along(parts, move, self._share)
        powers[0] += float(np.vdot(push, curve)) / 2
        value, length = _least(powers, 1.0)
        back, far = _least(powers * (1, -1, 1, -1, 1), 1.0)
        length = -far if back < value else length
        self._carried = [
            kind.stresses(
                strain + length * first + length**2 * (second + kind.changes(gradients, curve))
            )
            for (kind, strain, gradients, _), (first, second) in zip(parts, changes, strict=True)
        ]
        self._z = self._z + length * move + length**2 * curve
        return True


def _least(powers: Floats, most: float) -> tuple[float, float]:
    """Return the least value above zero, up to `most`, of a polynomial, and where it has it."""
    roots = np.roots(np.polyder(powers))
    sizes = np.append(roots.real[abs(roots.imag) <= 1e-9 * abs(roots)], most)
    sizes = sizes[(sizes > 0) & (sizes <= most)]
    values = np.polyval(powers, sizes)
    return float(values.min()), float(sizes[values.argmin()])
