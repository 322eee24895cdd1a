"""Stresses of elements at the two stages of a Gauss step, whose work is the gain of energy.

Strains are integrated from the strain rates of the stages, see
`spacemap_vtk.mechanics.transient.gauss`. Between the start and the end of a step they are

    ε(τ) = ε(0) + Σ_j s_j(τ) Δε_j,    s_j the polynomials of `stage_weights`

with Δε_j the gain from the start to stage j. Where the stress is proportional to the strain, its
values at the stages do exactly the work ΔW. Where it follows a law, the mean

    S_i = 2 Σ_k w_k l_i(τ_k) σ(ε(τ_k)),    l_i the stages' Lagrange polynomials

over three Gauss points τ_k replaces the value at stage i (E. Hairer, JNAIAM 5 (2010) 73). For a
stress in proportion to the strain it is the same. The work of S differs from ΔW only by the error
of the quadrature, which `missing` returns.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from spacemap_vtk.mechanics.elements.law_strains import LawStrains
from spacemap_vtk.mechanics.elements.strains import StrainState
from spacemap_vtk.ndarrays import Floats

#: Times of the two stages, as shares of the step. Their weights are ½, ½.
STAGES = np.array([0.5 - 3**0.5 / 6, 0.5 + 3**0.5 / 6])

#: Points and weights of a quadrature over the step. The work of a pressure is of fifth degree in
#: time, so three Gauss points integrate it exactly.
TIMES = 0.5 + np.array([-1.0, 0.0, 1.0]) * 15**0.5 / 10
SHARES = np.array([5.0, 8.0, 5.0]) / 18
#: The stages' Lagrange polynomials at these points.
LAGRANGE = np.stack(
    [(TIMES - STAGES[1]) / (STAGES[0] - STAGES[1]), (TIMES - STAGES[0]) / (STAGES[1] - STAGES[0])]
)


def stage_weights(share: float) -> Floats:
    """Compute the weights of both stages' moves in the move at a share of a step, (2,)."""
    first, second = STAGES
    return np.array(
        [
            share * (share - second) / (first * (first - second)),
            share * (share - first) / (second * (second - first)),
        ]
    )


class StageStress:
    """Stresses of elements of one kind at both stages."""

    # `start` is the state at the start of the step; `gains` and `rates` are those of the strains,
    # for both stages. Damping adds β C ε̇ with the definite moduli at the start.

    def __init__(
        self, start: StrainState, gains: list[Floats], rates: list[Floats], beta: float
    ) -> None:
        self._start, self._gains, self._rates, self._beta = start, gains, rates, beta
        self._kind = start.kind

    @property
    def _has_law(self) -> bool:
        return isinstance(self._kind, LawStrains)

    @cached_property
    def _between(self) -> list[tuple[Floats, Floats]]:
        """Stress and moduli at the points of the quadrature."""
        found = []
        for time in TIMES:
            one, two = stage_weights(time)
            strain = self._start.strain + one * self._gains[0] + two * self._gains[1]
            found.append(self._kind.respond(strain)[1:])
        return found

    @cached_property
    def stress(self) -> list[Floats]:
        """Stress at both stages, damping included, (E, Q, s)."""
        if not self._has_law:
            strain = self._start.strain
            return [
                self._kind.stresses(strain + gain + self._beta * rate)
                for gain, rate in zip(self._gains, self._rates, strict=True)
            ]
        result = []
        for i in range(2):
            total = np.zeros_like(self._start.strain)
            for k, (stress, _) in enumerate(self._between):
                total += 2.0 * SHARES[k] * LAGRANGE[i, k] * stress
            if self._beta:
                total += self._beta * viscous_stress(self._start, self._rates[i])
            result.append(total)
        return result

    @cached_property
    def _moduli(self) -> Floats:
        """Derivatives of the stress at stage i by the gain at stage j, (2, 2, E, Q, s, s)."""
        result = np.zeros((2, 2, *self._start.response.moduli.shape))
        for k, (_, moduli) in enumerate(self._between):
            weights = 2.0 * SHARES[k] * np.outer(LAGRANGE[:, k], stage_weights(TIMES[k]))
            for i, j in np.ndindex(2, 2):
                result[i, j] += weights[i, j] * moduli
        return result

    def changes(self, i: int, parts: list[Floats], gains: Floats, rates: Floats) -> Floats:
        """Compute changes of the stress at stage i, (E, Q, s, m)."""
        # `parts` are changes of strain, each (E, Q, s, m). `gains`, (2, n), are their factors in
        # the gains to both stages, and `rates`, (n,), those in the rate at stage i.
        if not self._has_law:
            return self._kind.stiffness @ _combine(gains[i] + self._beta * rates, parts)
        moduli = self._moduli
        result = moduli[i, 0] @ _combine(gains[0], parts)
        result += moduli[i, 1] @ _combine(gains[1], parts)
        if self._beta:
            result += self._beta * (self._start.definite_moduli @ _combine(rates, parts))
        return result

    def missing(self, span: float) -> float:
        """Compute the gain of energy less the work of the stresses over a span [s], in J."""
        if not self._has_law:
            return 0.0
        last = 3**0.5 * (self._gains[1] - self._gains[0])
        gained = self._kind.respond(self._start.strain + last).energy - self._start.energy
        work = 0.0
        for i, (stress, rate) in enumerate(zip(self.stress, self._rates, strict=True)):
            if self._beta:
                stress = stress - self._beta * viscous_stress(self._start, self._rates[i])
            work += span / 2 * float(np.vdot(stress, rate))
        return gained - work


def _combine(factors: Floats, parts: list[Floats]) -> Floats:
    result = factors[0] * parts[0]
    for factor, part in zip(factors[1:], parts[1:], strict=True):
        result += factor * part
    return result


def viscous_stress(state: StrainState, rate: Floats) -> Floats:
    """Compute the stress C ε̇ against rates (E, Q, s) of strain, for a damping β of one second."""
    return (state.definite_moduli @ rate[..., None])[..., 0]
