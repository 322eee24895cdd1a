"""A step of a body's nonlinear equations of motion, that keeps energy whatever its length.

    M ẍ + (α M + U Uᵀ) ẋ + f(x, ẋ) = F,    f = Σ G(x)ᵀ C (ε + β ε̇)

Between two states the midpoint rule is taken, with the mean of both ends' stresses in place of the
stress in the middle. As strains are quadratic in the positions z, the gradients G in the middle do
the work of that stress exactly, G(z̄) Δz = Δε: energy is what the loads put in less what is damped
(Simo and Tarnow, Int. J. Numer. Meth. Eng. 37 (1994) 2527). The damping β resists rates of strain,
which turning alone has none of; about an unstrained state it is Rayleigh's β K.

Where a rate is `late`, positions follow that of the end, Δz = h ż₁, which takes ½ Δż M Δż out of it
in a step (Armero and Romero, Comp. Meth. Appl. Mech. Eng. 190 (2001) 2603): of directors, whose
inertia is nothing beside their stiffness, and which would otherwise turn to and fro step by step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.body import Body, Part
from spacemap_vtk.mechanics.factors import Solve
from spacemap_vtk.mechanics.follower import Pressed
from spacemap_vtk.ndarrays import Bools, Floats

#: Corrections that a step may take, and how much smaller each has to be than the one before, or the
#: tangent is made anew.
TRIES, GAIN = 40, 0.3

#: Rotation of a correction from which the tangent is made anew, too [rad].
NEAR = 0.003

#: Tangents that a step may take. A correction that is larger than the one before ends it at once:
#: half the step costs less than what may come of that.
MADE = 12

#: A correction below this share of the step is the last one; one that is no smaller than the one
#: before is as well below the other share: it shows rounding.
LAST, LOST = 1e-10, 1e-6

#: A correction that moves less than this share of the body's size is the last one, too.
LEAST = 1e-15


class Acting(NamedTuple):
    """What acts at a time."""

    push: Floats
    """Forces, (N,)."""
    pressures: Floats
    """On each of what is pressed, (n,)."""


class Step(NamedTuple):
    """A state, and what happened on the way to it."""

    position: Floats
    """q, (N,)."""
    rate: Floats
    """q̇ [1/s], (N,)."""
    parts: list[Part]
    """Strains and stresses there."""
    damped: float
    """Energy that was dissipated."""
    work: float
    """Of the load."""
    error: float
    """An estimate of the largest error of a nodal vector [m]."""


class Midpoint:
    """The equations of a body; forces and energies are those of a unit modulus."""

    def __init__(
        self,
        body: Body,
        mass: sp.csr_matrix,
        alpha: float,
        beta: float,
        pressed: Sequence[Pressed] = (),
        late: Bools | None = None,
        drag: Floats | None = None,
    ) -> None:
        self.body, self.mass, self.alpha, self.beta = body, mass.tocsr(), alpha, beta
        self.pressed, self._late = pressed, 0.0 if late is None else late.astype(np.float64)
        #: U, (N, m).
        self.drag = np.empty((self.mass.shape[0], 0)) if drag is None else drag
        #: What a change of rate in a step resists with, over the mean rate less that of the start.
        self._heavy = self.mass if late is None else self.mass @ sp.diags(1 / (1 + self._late))
        self._kept: tuple[float, sp.csr_matrix] = (0.0, self.mass)
        size = float(np.linalg.norm(np.ptp(body.start, axis=0)))
        self._least = LEAST * size * math.sqrt(float(mass.diagonal().sum()))

    def at(self, position: Floats) -> list[Part]:
        """Return strains and stresses at q."""
        return self.body.at(self.body.start + self.body.moved(position))

    def stored(self, rate: Floats, parts: list[Part]) -> tuple[float, float]:
        """Return kinetic and strain energy."""
        strain = sum(float(np.vdot(part.strain, part.stress)) for part in parts)
        return 0.5 * float(rate @ (self.mass @ rate)), 0.5 * strain

    def impulse(self, parts: list[Part], move: Floats) -> Floats:
        """Return that of the damping against a sudden move q."""
        return self._dragged(move) + self._viscous(parts, move)

    def step(
        self,
        position: Floats,
        rate: Floats,
        parts: list[Part],
        loads: tuple[Acting, Acting],
        span: float,
        guess: Floats,
        carried: list[Floats],
    ) -> Step | None:
        """Return the state after a span [s], or None where Newton's method finds none."""
        # `loads` act at the start, and on the average over the span; `guess` is of the move, and
        # `carried` of the stress in the middle.
        heavy = self._inertia(span)
        moving = 2 / span * (self._heavy @ rate)
        least, size, made = self._least / span, math.inf, 0
        move, solve = guess, None
        for _ in range(TRIES):
            ends = self.at(position + move)
            stress = [self._mean(a, b, span) for a, b in zip(parts, ends, strict=True)]
            middle = [(a.gradients + b.gradients) / 2 for a, b in zip(parts, ends, strict=True)]
            left = heavy @ move - moving + self._force(parts, stress, middle)
            left += self.drag @ (self.drag.T @ move) / span - self._load(loads[1], position, move)
            if solve is None:
                if made == MADE:
                    return None
                # The tangent has the stress that the last linear solution balances, not that of its
                # spurious stretch, as that of an equilibrium has.
                slopes = [(0.5 + self.beta / span) * end.gradients for end in ends]
                blocks = [
                    end.kind.tangent_of(pull / 2, mean, slope)
                    for end, pull, mean, slope in zip(ends, carried, middle, slopes, strict=True)
                ]
                try:
                    tangent = self.body.matrix(blocks) + heavy
                    for pressed, pressure in zip(self.pressed, loads[1].pressures, strict=True):
                        if pressure:
                            tangent -= pressure * pressed.tangent(position, move)
                    solve = self._solution(tangent, span)
                except SolverError:
                    return None
                made += 1
            change = -solve(left)
            before, size = size, math.sqrt(abs(float(change @ left)))
            move = move + change
            whole = math.sqrt(float(move @ (heavy @ move)))
            if size > max(LOST * whole, before) or not math.isfinite(size):
                return None
            if size <= max(least, LAST * whole) or LOST * whole > size >= before:
                return self._reached(position, rate, parts, loads, span, move, solve)
            moved = self.body.moved(change)
            if self.body.turn(moved) > NEAR or size > GAIN * before:
                solve, share = None, 0.5 + self.beta / span
                carried = [
                    pull + share * end.kind.stresses(end.kind.changes(end.gradients, moved))
                    for pull, end in zip(stress, ends, strict=True)
                ]
        return None

    def _inertia(self, span: float) -> sp.csr_matrix:
        """Return what a move in a span resists with; the last is kept, as many spans are alike."""
        if self._kept[0] != span:
            self._kept = span, 2 / span**2 * self._heavy + self.alpha / span * self.mass
        return self._kept[1]

    def _reached(
        self,
        position: Floats,
        rate: Floats,
        parts: list[Part],
        loads: tuple[Acting, Acting],
        span: float,
        move: Floats,
        solve: Solve,
    ) -> Step:
        ends = self.at(position + move)
        later = rate + 2 / (1 + self._late) * (move / span - rate)
        damped = float(move @ self._dragged(move)) / span
        damped += float((self._late * (later - rate)) @ (self.mass @ (later - rate))) / 2
        for a, b in zip(parts, ends, strict=True):
            damped += self.beta / span * float(np.vdot(b.strain - a.strain, b.stress - a.stress))
        # The rule's error is h³/12 of the third derivative, which the acceleration's change from
        # the start to the middle of the step gives. The tangent takes out of it what swings faster
        # than the step, whose error is bounded by how far it swings (Hosea and Shampine 1996).
        push = self._force(parts, [p.stress for p in parts], [p.gradients for p in parts])
        push += self._dragged(rate) + self._viscous(parts, rate)
        push -= self._load(loads[0], position, np.zeros_like(move))
        wrong = solve(self.mass @ ((later - rate) / span) + push) / 3
        error = float(abs(self.body.basis @ wrong).max())
        work = float(self._load(loads[1], position, move) @ move)
        return Step(position + move, later, ends, damped, work, error)

    def _load(self, loads: Acting, position: Floats, move: Floats) -> Floats:
        """Return the mean forces of loads on the way from q to q + Δ."""
        total = loads.push
        for pressed, pressure in zip(self.pressed, loads.pressures, strict=True):
            if pressure:
                total = total + pressure * pressed.force(position, move)
        return total

    def _mean(self, first: Part, last: Part, span: float) -> Floats:
        change = last.stress - first.stress
        return first.stress + (0.5 + self.beta / span) * change

    def _solution(self, tangent: sp.csr_matrix, span: float) -> Solve:
        """Return the solution with a tangent and U Uᵀ / span (Woodbury)."""
        solve, drag = self.body.unsymmetric(tangent), self.drag
        if not drag.size:
            return solve
        whole = solve(drag)
        small = np.linalg.inv(span * np.eye(drag.shape[1]) + drag.T @ whole)

        def solved(right: Floats) -> Floats:
            found = solve(right)
            return found - whole @ (small @ (drag.T @ found))

        return solved

    def _dragged(self, move: Floats) -> Floats:
        """Return (α M + U Uᵀ) of a move, or of a rate."""
        return self.alpha * (self.mass @ move) + self.drag @ (self.drag.T @ move)

    def _viscous(self, parts: list[Part], move: Floats) -> Floats:
        """Return β Gᵀ C G of a move, or of a rate."""
        if self.beta == 0.0:
            return np.zeros_like(move)
        moved = self.body.moved(move)
        stress = [
            self.beta * part.kind.stresses(part.kind.changes(part.gradients, moved))
            for part in parts
        ]
        return self._force(parts, stress, [part.gradients for part in parts])

    def _force(self, parts: list[Part], stress: list[Floats], gradients: list[Floats]) -> Floats:
        total = np.zeros_like(self.body.start)
        for part, pull, slope in zip(parts, stress, gradients, strict=True):
            total += part.kind.summed(pull, slope, len(total))
        return self.body.along_free(total)
