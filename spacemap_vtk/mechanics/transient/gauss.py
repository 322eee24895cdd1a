"""One time step of a body's nonlinear equations of motion, of fourth order, that conserves energy.

    M ẍ + (α M + U Uᵀ) ẋ + f(x, ẋ) = F,    f = Σ G(x)ᵀ C (ε + β ε̇)

The step is the two-stage Gauss collocation method, applied to positions, rates and strains
together: strains are integrated from ε̇ = G(x) ẋ; they are not computed from the positions of the
stages. Strains are quadratic in the positions. Therefore the energy ½ ẋᵀ M ẋ + ½ ε C ε and the
difference between integrated and computed strains are both quadratic in these variables, and Gauss
methods conserve quadratic invariants exactly (Cooper, IMA J. Numer. Anal. 7 (1987) 1). The change
of energy is the work of the loads less the dissipated energy, whatever the length of the step. The
same holds for elements whose stress follows a law, with means of the stress over the step; see
`spacemap_vtk.mechanics.transient.stage_stress`.

With one stage this would be the midpoint rule with the mean of the stresses at both ends (Simo and
Tarnow, Int. J. Numer. Meth. Eng. 37 (1994) 2527). Its periods are too long by (ω h)²/12; with two
stages they are too long by (ω h)⁴/720.

Terms other than strains (`EnergyTerm`) are integrated by a quadrature over the step (Hairer, JNAIAM
5 (2010) 73). The part of their energy change that the quadrature misses, for example at a contact,
is added to the equations as a force along M ẋ (Gonzalez, J. Nonlinear Sci. 6 (1996) 449). The
energy is thus conserved for any term. A term may also compute its own mean force over the step
(`EnergyTerm.begin_step`), which acts at both stages; obstacles do.

The damping β resists rates of strain, and therefore not rotation; about an unstrained state it is
Rayleigh's β K.

Vibrations much faster than 1/h, such as those of a sheet's directors across its thickness, are not
resolved. Their amplification tends to +1, so that a deviation persists unchanged; with the midpoint
rule it tends to -1, and a deviation changes sign in every step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.mechanics.elements.law_strains import LawStrains
from spacemap_vtk.mechanics.elements.strains import Strains, StrainState
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, TermState, TermStep
from spacemap_vtk.mechanics.equilibrium.reduced_system import ReducedSystem
from spacemap_vtk.mechanics.linalg.factors import Solve, SquarePattern, factorise_square
from spacemap_vtk.mechanics.transient.stage_stress import (
    LAGRANGE,
    SHARES,
    STAGES,
    TIMES,
    StageStress,
    stage_weights,
    viscous_stress,
)
from spacemap_vtk.ndarrays import Bools, Floats

#: Matrix A of the method, and its inverse.
_A = np.array([[0.25, STAGES[0] - 0.25], [STAGES[1] - 0.25, 0.25]])
_INVERSE = np.linalg.inv(_A)

#: Largest number of Newton corrections in a step.
MAX_CORRECTIONS = 40

#: The tangent is recomputed after a correction that is larger than this share of the one before.
MAX_RATIO = 0.3

#: The tangent is recomputed after a move of more than this share of the largest admissible move;
#: for elements this is a rotation of 0.003 rad.
NEAR = 0.006

#: Largest number of tangents computed in a step. A correction larger than the one before ends the
#: step at once: a step of half the length costs less than further corrections.
MAX_TANGENTS = 12

#: Where something can touch an obstacle, a correction may be larger than the one before by this
#: factor: as measured, samples that come and go cause no more.
CONTACT_GROWTH = 3.0

#: Newton's method has converged when a correction is below this share of the step.
CONVERGED = 1e-10

#: It has also converged when a correction below this share of the step is not smaller than the one
#: before: only rounding is left.
STALLED = 1e-6

#: It has also converged when a correction moves less than this share of the body's size.
NEGLIGIBLE = 1e-15

#: Where something can touch an obstacle, it has also converged when what is left could change the
#: energy by less than this share of it. At rest, rounding may change which samples stick, so that
#: corrections that are small against the step would never come.
CONTACT_ENERGY = 1e-12

#: A change of energy below this share of the energy is rounding.
ENERGY_ROUNDING = 1e-14


class ActingLoads(NamedTuple):
    """Loads at one time."""

    push: Floats
    """Forces, (N,)."""
    factors: Floats
    """Factors of the terms that do external work, (n,)."""
    nodal: Floats
    """Forces on all nodes, also on held ones, (V, 3)."""


class Step(NamedTuple):
    """State at the end of a step, and the energy exchanged in the step."""

    position: Floats
    """q, (N,)."""
    rate: Floats
    """q̇ [1/s], (N,)."""
    parts: list[TermState]
    """All terms, evaluated in this state."""
    damped: float
    """Energy dissipated in the step."""
    work: float
    """Work of the loads in the step."""
    error: Floats
    """Estimated errors of the nodal vectors per radian of vibration [m], (V, 3)."""
    stress: list[Floats]
    """Stress at the second stage, for each kind of element."""
    terms: list[EnergyTerm]
    """All terms as they are from now on."""
    rubbed: float
    """Energy that terms with forces of their own dissipated in the step."""
    pushed: float
    """Work that these terms did."""
    moves: Floats
    """Moves of q from the start to both stages, (2, N)."""
    gripped: float
    """Work of the coordinates whose motion is prescribed."""
    holding: Floats
    """Forces that hold the nodes at both stages, less the loads in `ActingLoads.held`, (2, V, 3):
    0 but for rounding where nothing is held or prescribed."""
    pressing: dict[int, Floats]
    """Mean forces that hold the nodes of each term with forces of its own, (V, 3), by number."""


class _ElementStages(NamedTuple):
    """Elements of one kind; each list has an entry for each of the two stages."""

    slopes: list[Floats]
    """Gradients G."""
    spins: list[Floats]
    """Rate of G."""
    rates: list[Floats]
    """Strain rates ε̇."""
    response: StageStress
    """Stresses, and how they change."""


class _KeptTangent(NamedTuple):
    """Factorised tangent, with the step length and position for which it was computed."""

    span: float
    position: Floats
    solve: Solve


class GaussIntegrator:
    """Equations of motion of a body; forces and energies are divided by its modulus."""

    # Terms of the system that are not conservative do external work. Each is multiplied by a factor
    # that may change with time, see `ActingLoads`. The motion of the coordinates `prescribed` is
    # given; their equations yield the forces that it needs. `whole` is the mass of all nodes.

    def __init__(
        self,
        system: ReducedSystem,
        mass: sp.csr_matrix,
        alpha: float,
        beta: float,
        drag: Floats | None = None,
        prescribed: Bools | None = None,
        whole: sp.csr_matrix | None = None,
    ) -> None:
        self.system, self.mass, self.alpha, self.beta = system, mass.tocsr(), alpha, beta
        #: Numbers of the terms that are strains, and of those that are integrated by a
        #: quadrature; `_driven` marks those of the latter that do external work.
        self._strained = [k for k, t in enumerate(system.terms) if isinstance(t, Strains)]
        self._kinds = [term for term in system.terms if isinstance(term, Strains)]
        self._follows_law = any(isinstance(kind, LawStrains) for kind in self._kinds)
        begun = [t.begin_step(system.start, 0.0, 0.0) for t in system.terms]
        #: Numbers of the terms that compute their own mean forces in a step.
        self._own = [k for k, each in enumerate(begun) if each is not None]
        self._others = [
            k
            for k, t in enumerate(system.terms)
            if not isinstance(t, Strains) and k not in self._own
        ]
        self._driven = np.array(
            [not system.terms[k].conservative for k in self._others], dtype=bool
        )
        #: Whether samples or layers can touch something.
        self._touches = bool(self._own) or any(
            type(term).follow is not EnergyTerm.follow for term in system.terms
        )
        size = self.mass.shape[0]
        #: Matrix U of the equations above, (N, m).
        self.drag = np.empty((size, 0)) if drag is None else drag
        #: (N,), coordinates whose motion is prescribed.
        self.prescribed = np.zeros(size, dtype=bool) if prescribed is None else prescribed
        self._whole = whole
        if self.drag.size:
            self.drag = np.where(self.prescribed[:, None], 0.0, self.drag)
        extent = float(np.linalg.norm(np.ptp(system.start, axis=0)))
        self._least_correction = NEGLIGIBLE * extent * math.sqrt(float(mass.diagonal().sum()))
        self._stage_system = _StageSystem(system, self.mass, self.prescribed)
        self._kept: _KeptTangent | None = None

    def evaluate(self, position: Floats) -> list[TermState]:
        """Evaluate all terms at q."""
        return self.system.evaluate(self._nodal(position))

    def accept(self, step: Step) -> None:
        """Continue from the end of a step."""
        self.system.terms = step.terms

    def strain_states(self, parts: list[TermState]) -> list[StrainState]:
        """Select the terms that are strains."""
        return [part for part in parts if isinstance(part, StrainState)]

    def stored_energy(self, rate: Floats, parts: list[TermState]) -> tuple[float, float]:
        """Compute the kinetic energy, and the energy of all conservative terms."""
        held = sum(part.energy for part in parts if part.term.conservative)
        return 0.5 * float(rate @ (self.mass @ rate)), held

    def damping_impulse(self, parts: list[TermState], move: Floats) -> Floats:
        """Compute the impulse of the damping against a sudden move q."""
        return self._apply_damping(move) + self._viscous_forces(parts, move)

    def make_step(
        self,
        position: Floats,
        rate: Floats,
        parts: list[TermState],
        loads_at: Callable[[float], ActingLoads],
        time: float,
        span: float,
        guess: Floats,
        stress: list[Floats],
    ) -> Step | None:
        """Compute the state after a span [s]; None if Newton's method does not converge."""
        # `loads_at` returns the loads at a time [s]. `guess`, (2, N), estimates the moves
        # from the start to both stages, and gives those of prescribed coordinates; `stress` is that
        # of each kind of element.
        pushes = np.stack([loads_at(time + share * span).push for share in STAGES])
        factors = np.stack([self._term_factors(loads_at(time + share * span)) for share in TIMES])
        strains, start = self.strain_states(parts), self._nodal(position)
        own = {n: self.system.terms[n].begin_step(start, time, span) for n in self._own}
        steps = {number: step for number, step in own.items() if step is not None}
        stored = self.stored_energy(rate, parts)
        slack = CONTACT_ENERGY * sum(map(abs, stored)) if steps else 0.0
        least, size, tangent_count = self._least_correction / span, math.inf, 0
        moves, stage_stress = guess, [[each, each] for each in stress]
        kept = self._kept
        if kept is None or kept.span != span or self._is_far(position, position - kept.position):
            kept = None
        for _ in range(MAX_CORRECTIONS):
            end = self._nodal(_end_position(position, moves))
            if not self._is_admissible(position, moves, end, steps):
                return None
            speeds = _INVERSE @ moves / span
            stages = self._evaluate_stages(position, moves, speeds, strains, span)
            inertia = self._inertia(speeds - rate, span)
            residual = inertia + self._apply_damping(speeds.T).T - pushes
            for i in range(2):
                residual[i] += self._element_forces(
                    strains, [s.response.stress[i] for s in stages], [s.slopes[i] for s in stages]
                )
            for each in steps.values():
                residual += self.system.reduce_forces(each.forces(end))
            between = self._evaluate_between(position, moves)
            residual += self._external_forces(between, factors)
            residual += self._conservative_forces(
                between, factors, parts, stages, position, moves, speeds, span
            )
            residual[:, self.prescribed] = 0.0
            if kept is None:
                if tangent_count == MAX_TANGENTS:
                    return None
                # The geometric stiffness uses the stress predicted by the last linear solution.
                # The stress computed from its positions contains the spurious stretch of a
                # linearised rotation. The static equilibrium does the same.
                if self.system.follow(end):
                    self._stage_system = _StageSystem(self.system, self.mass, self.prescribed)
                tangents = {number: each.tangent(end) for number, each in steps.items()}
                solve = self._factorise(stages, stage_stress, between, factors, tangents, span)
                if solve is None:
                    return None
                kept = self._kept = _KeptTangent(span, position + moves.mean(axis=0), solve)
                tangent_count += 1
            change = -kept.solve(residual)
            before, size = size, math.sqrt(abs(float(np.vdot(change, residual))))
            moves = moves + change
            # The size of the step in the norm of a correction: A⁻² / h² has the determinant
            # (12 / h²)², so the moves weigh √12 / h.
            step_size = math.sqrt(float(np.vdot(moves, (self.mass @ moves.T).T))) * 12**0.5 / span
            most = (CONTACT_GROWTH if self._touches else 1.0) * before
            if size > max(STALLED * step_size, most) or not math.isfinite(size):
                if tangent_count == 0:  # the tangent of an earlier step no longer fits
                    kept, moves, size = None, moves - change, math.inf
                    continue
                return None
            if size <= max(least, CONVERGED * step_size) or size * step_size <= slack:
                break
            if STALLED * step_size > size >= before and not steps:
                break
            if size > MAX_RATIO * before or (tangent_count and self._is_far(position, change)):
                kept = None
                stage_stress = self._predict_stress(stages, change, span)
        else:
            return None
        speeds = _INVERSE @ moves / span
        stages = self._evaluate_stages(position, moves, speeds, strains, span)
        last = _end_position(position, moves)
        end = self._nodal(last)
        later = rate + 3**0.5 * (speeds[1] - speeds[0])
        inertia = self._inertia(speeds - rate, span)
        damped = span / 2 * float(np.vdot(speeds, self._apply_damping(speeds.T).T))
        for part, stage in zip(strains, stages, strict=True):
            for flow in stage.rates:
                damped += self.beta * span / 2 * float(np.vdot(flow, viscous_stress(part, flow)))
        between = self._evaluate_between(position, moves)
        driving = self._external_forces(between, factors)
        work = span / 2 * float(np.vdot(pushes - driving, speeds))
        mean = np.zeros_like(rate)
        for each in steps.values():
            mean += self.system.reduce_forces(each.forces(end))
        error = self._estimate_error(rate, parts, loads_at(time), inertia, mean, kept.solve)
        pulls = [stage.response.stress[1] for stage in stages]
        finished = {number: each.finish(end) for number, each in steps.items()}
        terms = list(self.system.terms)
        for number, result in finished.items():
            terms[number] = result.term
        rubbed = sum(result.dissipated for result in finished.values())
        pushed = sum(result.work for result in finished.values())
        pressing = {number: each.forces(end) for number, each in steps.items()}
        holding, gripped = np.zeros((2, *start.shape)), 0.0
        if self._whole is not None:
            missing = self._missing_share(
                between, factors, parts, stages, position, moves, speeds, span
            )
            accelerations = _INVERSE @ (speeds - rate) / span + (self.alpha + missing) * speeds
            holding = self._mean_nodal_forces(between, factors)
            for i, share in enumerate(STAGES):
                swing = self.system.node_moves(accelerations[i])
                holding[i] += (self._whole @ swing.ravel()).reshape(-1, 3)
                holding[i] -= loads_at(time + share * span).nodal
                for part, stage in zip(strains, stages, strict=True):
                    pull = stage.response.stress[i]
                    holding[i] += part.kind.sum_forces(pull, stage.slopes[i], len(end))
            holding += sum(pressing.values())
            held = np.stack([self.system.reduce_forces(each) for each in holding])
            moved = self.prescribed
            gripped = span / 2 * float(np.vdot(held[:, moved], speeds[:, moved]))
        parts = [term.evaluate(end) for term in terms]
        return Step(
            last,
            later,
            parts,
            damped,
            work,
            error,
            pulls,
            terms,
            rubbed,
            pushed,
            moves,
            gripped,
            holding,
            pressing,
        )

    def _estimate_error(
        self,
        rate: Floats,
        parts: list[TermState],
        load: ActingLoads,
        inertia: Floats,
        mean: Floats,
        solve: Solve,
    ) -> Floats:
        """Estimate the errors per radian of vibration [m], (V, 3)."""
        # `mean` are the forces of terms that have their own in a step. They do not change within
        # it, so that they are no part of the difference.
        # The accelerations of the stages, extrapolated linearly to the start, differ from the
        # acceleration there by h²/12 of its second derivative: by a ω⁴ h²/12 for a vibration of
        # amplitude a and frequency ω. The error per radian is a (ω h)⁴/720, which is h²/60 times
        # that difference. Solving with the tangent turns the difference into a move to the second
        # stage: c₂² h²/2 times the difference if h is short, and no more than the amplitude for a
        # vibration faster than the step (Hosea and Shampine 1996).
        difference = inertia[0] - (3**0.5 - 1) / 2 * (inertia[1] - inertia[0])
        strains = self.strain_states(parts)
        pulls, slopes = [p.stress for p in strains], [p.gradients for p in strains]
        difference = difference + self._element_forces(strains, pulls, slopes)
        difference += self._apply_damping(rate) + self._viscous_forces(parts, rate) - load.push
        difference = difference + mean
        for number, factor in zip(self._others, self._term_factors(load), strict=True):
            if factor:
                difference += factor * self.system.reduce_forces(parts[number].forces)
        difference[self.prescribed] = 0.0
        found = solve(np.stack([difference, difference]))
        return self.system.node_moves(found[1] / (30 * STAGES[1] ** 2))

    def _inertia(self, changes: Floats, span: float) -> Floats:
        """Compute M ẍ at the stages from the changes of their rates since the start, (2, N)."""
        return np.asarray((self.mass @ (_INVERSE @ changes / span).T).T)

    def _evaluate_stages(
        self, position: Floats, moves: Floats, speeds: Floats, parts: list[StrainState], span: float
    ) -> list[_ElementStages]:
        places = [self.system.start + self.system.node_moves(position + move) for move in moves]
        flows = [self.system.node_moves(speed) for speed in speeds]
        found = []
        for part in parts:
            kind = part.kind
            slopes = [kind.gradients(place) for place in places]
            spins = [kind.spins(flow) for flow in flows]
            rates = [kind.strain_changes(g, flow) for g, flow in zip(slopes, flows, strict=True)]
            gains = [span * (_A[i, 0] * rates[0] + _A[i, 1] * rates[1]) for i in range(2)]
            response = StageStress(part, gains, rates, self.beta)
            found.append(_ElementStages(slopes, spins, rates, response))
        return found

    def _strain_shares(self, span: float, i: int, k: int) -> tuple[Floats, Floats]:
        """Compute the factors of G at both stages and of the spin at stage k in strain changes."""
        # The changes are those with the move to stage k: of the gains to both stages, (2, 3), and
        # of the strain rate at stage i, (3,).
        gains = np.column_stack([_A * _INVERSE[:, k], span * _A[:, k]])
        rates = np.zeros(3)
        rates[i] = _INVERSE[i, k] / span
        rates[2] = float(i == k)
        return gains, rates

    def _predict_stress(
        self, stages: list[_ElementStages], change: Floats, span: float
    ) -> list[list[Floats]]:
        """Predict the stress at the stages after a correction, to first order."""
        moved = [self.system.node_moves(part) for part in change]
        found = []
        for kind, stage in zip(self._kinds, stages, strict=True):
            # Changes of strain that the move to stage k causes by G₁, G₂ and the spin at stage k.
            parts = [
                [
                    kind.strain_changes(g, moved[k])[..., None]
                    for g in (*stage.slopes, stage.spins[k])
                ]
                for k in range(2)
            ]
            predicted = []
            for i in range(2):
                stress = stage.response.stress[i].copy()
                for k in range(2):
                    shares = self._strain_shares(span, i, k)
                    stress += stage.response.changes(i, parts[k], *shares)[..., 0]
                predicted.append(stress)
            found.append(predicted)
        return found

    def _factorise(
        self,
        stages: list[_ElementStages],
        stress: list[list[Floats]],
        between: list[list[TermState]],
        factors: Floats,
        own: dict[int, Floats],
        span: float,
    ) -> Solve | None:
        """Factorise the tangent of both stages; return its solver, or None if it is singular."""
        others = self._mean_tangents(between, factors)
        tangents = np.empty((2, 2, self._stage_system.count))
        for i, k in np.ndindex(2, 2):
            blocks = {number: found[i, k] for number, found in others.items()}
            # The end of the step is the start + √3 (second - first move).
            blocks |= {n: (3**0.5 if k else -(3**0.5)) * each for n, each in own.items()}
            for number, kind, pull, stage in zip(
                self._strained, self._kinds, stress, stages, strict=True
            ):
                flat = [g.reshape(*g.shape[:3], -1) for g in (*stage.slopes, stage.spins[k])]
                blocks[number] = kind.tangent_with_stress(
                    pull[i] if i == k else np.zeros_like(pull[i]),
                    stage.slopes[i],
                    stage.response.changes(i, flat, *self._strain_shares(span, i, k)),
                )
            ordered = [blocks[number] for number in range(len(blocks))]
            tangents[i, k] = self.system.assemble(ordered).data
        heavy = _INVERSE @ _INVERSE / span**2 + self.alpha / span * _INVERSE
        solve = self._stage_system.solution(tangents, heavy)
        drag = self.drag
        if solve is None or not drag.size:
            return solve
        # Woodbury: the drag adds (U Uᵀ) A⁻¹ / h.
        count = drag.shape[1]
        pushes = np.zeros((2 * count, 2, len(drag)))
        pushes[:count, 0], pushes[count:, 1] = drag.T, drag.T
        whole = np.stack([solve(push) for push in pushes])
        seen = (whole @ drag).reshape(2 * count, 2 * count).T
        small = np.linalg.inv(np.kron(span * _A, np.eye(count)) + seen)

        def solve_with_drag(right: Floats) -> Floats:
            found = solve(right)
            share = small @ (found @ drag).ravel()
            return found - np.tensordot(share, whole, 1)

        return solve_with_drag

    def _term_factors(self, load: ActingLoads) -> Floats:
        """Return the factor of each term other than strains: 1 unless it does external work."""
        factors = np.ones(len(self._others))
        factors[self._driven] = load.factors
        return factors

    def _evaluate_between(self, position: Floats, moves: Floats) -> list[list[TermState]]:
        """Evaluate the terms other than strains at each point of the quadrature."""
        if not self._others:
            return [[] for _ in TIMES]
        terms = [self.system.terms[number] for number in self._others]
        places = [self._nodal(position + stage_weights(time) @ moves) for time in TIMES]
        return [[term.evaluate(place) for term in terms] for place in places]

    def _external_forces(self, between: list[list[TermState]], factors: Floats) -> Floats:
        """Compute the forces at the stages of terms that do external work, (2, N)."""
        return self._mean_forces(between, factors * self._driven)

    def _mean_forces(self, between: list[list[TermState]], factors: Floats) -> Floats:
        """Compute weighted means of forces over the step, whose work at the stages is exact."""
        if not any(map(len, between)):
            return np.zeros((2, len(self.drag)))
        found = self._mean_nodal_forces(between, factors)
        return np.stack([self.system.reduce_forces(each) for each in found])

    def _mean_nodal_forces(self, between: list[list[TermState]], factors: Floats) -> Floats:
        """Compute the means of `_mean_forces` at all nodes, (2, V, 3)."""
        # The work is exact if the power is of at most fifth degree in time. A constant pressure
        # does the work p ΔV.
        total = np.zeros((2, *self.system.start.shape))
        for point, (states, sizes) in enumerate(zip(between, factors, strict=True)):
            for state, size in zip(states, sizes, strict=True):
                if size:
                    force = size * state.forces
                    total += 2 * SHARES[point] * LAGRANGE[:, point, None, None] * force
        return total

    def _mean_tangents(self, between: list[list[TermState]], factors: Floats) -> dict[int, Floats]:
        """Differentiate `_mean_forces` at stage i by the move to stage k, (2, 2, E, …)."""
        found = {}
        for column, number in enumerate(self._others):
            total: Floats | float = 0.0
            for point, sizes in enumerate(factors):
                weights = 2 * SHARES[point] * LAGRANGE[:, point, None] * stage_weights(TIMES[point])
                blocks = sizes[column] * between[point][column].tangent()
                total = total + weights[:, :, None, None, None] * blocks
            found[number] = np.asarray(total)
        return found

    def _conservative_forces(
        self,
        between: list[list[TermState]],
        factors: Floats,
        parts: list[TermState],
        stages: list[_ElementStages],
        position: Floats,
        moves: Floats,
        speeds: Floats,
        span: float,
    ) -> Floats:
        """Compute the forces of conservative terms at the stages; their work is the energy gain."""
        forces = self._mean_forces(between, factors * ~self._driven)
        missing = self._missing_share(
            between, factors, parts, stages, position, moves, speeds, span, forces
        )
        return forces + missing * (self.mass @ speeds.T).T if missing else forces

    def _missing_share(
        self,
        between: list[list[TermState]],
        factors: Floats,
        parts: list[TermState],
        stages: list[_ElementStages],
        position: Floats,
        moves: Floats,
        speeds: Floats,
        span: float,
        forces: Floats | None = None,
    ) -> float:
        """Compute the factor of M ẋ in the forces that make the work the energy gain."""
        # Elements whose stress follows a law add only what their own forces leave to the gain.
        held = [n for n, drives in zip(self._others, self._driven, strict=True) if not drives]
        if not held and not self._follows_law:
            return 0.0
        if forces is None:
            forces = self._mean_forces(between, factors * ~self._driven)
        heavy = (self.mass @ speeds.T).T
        weight = span / 2 * float(np.vdot(speeds, heavy))
        if weight == 0.0:
            return 0.0
        end = self._nodal(_end_position(position, moves))
        before = np.array([parts[number].energy for number in held])
        after = np.array([self.system.terms[number].energy(end) for number in held])
        missing = float((after - before).sum()) - span / 2 * float(np.vdot(forces, speeds))
        missing += sum(stage.response.missing(span) for stage in stages)
        size = float((abs(before) + abs(after)).sum())
        size += sum(abs(part.energy) for part in self.strain_states(parts))
        return 0.0 if abs(missing) <= ENERGY_ROUNDING * size else missing / weight

    def _is_admissible(
        self, position: Floats, moves: Floats, end: Floats, steps: dict[int, TermStep]
    ) -> bool:
        """Check whether the terms other than strains admit the positions of a step."""
        if not self._others and not steps:
            return True
        places = [position + stage_weights(time) @ moves for time in TIMES]
        nodal = [*(self._nodal(place) for place in places), end]
        if not all(step.admits(np.append(TIMES, 1.0), nodal) for step in steps.values()):
            return False
        terms = [self.system.terms[number] for number in self._others]
        path = [self._nodal(position), *nodal]
        return all(term.passes(a, b) for a, b in pairwise(path) for term in terms)

    def _nodal(self, position: Floats) -> Floats:
        return self.system.start + self.system.node_moves(position)

    def _is_far(self, position: Floats, moves: Floats) -> bool:
        """Check whether a tangent at a position no longer fits after any of the given moves."""
        place = self._nodal(position)
        return any(
            NEAR * self.system.largest_step(place, self.system.node_moves(move)) < 1.0
            for move in np.atleast_2d(moves)
        )

    def _apply_damping(self, move: Floats) -> Floats:
        """Multiply a move or a rate by α M + U Uᵀ."""
        return self.alpha * (self.mass @ move) + self.drag @ (self.drag.T @ move)

    def _viscous_forces(self, parts: list[TermState], move: Floats) -> Floats:
        """Multiply a move or a rate by β Gᵀ C G."""
        if self.beta == 0.0:
            return np.zeros_like(move)
        moved, strains = self.system.node_moves(move), self.strain_states(parts)
        stress = [
            self.beta * viscous_stress(part, part.kind.strain_changes(part.gradients, moved))
            for part in strains
        ]
        return self._element_forces(strains, stress, [part.gradients for part in strains])

    def _element_forces(
        self, parts: list[StrainState], stress: list[Floats], gradients: list[Floats]
    ) -> Floats:
        total = np.zeros_like(self.system.start)
        for part, pull, slope in zip(parts, stress, gradients, strict=True):
            total += part.kind.sum_forces(pull, slope, len(total))
        return self.system.reduce_forces(total)


class _StageSystem:
    """Linear systems for both stages, in which each unknown of the system occurs twice."""

    # Those of prescribed coordinates only keep their value.

    def __init__(self, system: ReducedSystem, mass: sp.csr_matrix, prescribed: Bools) -> None:
        pattern = system.pattern()
        size, count = pattern.shape[0], pattern.nnz
        #: Number of entries in the pattern of a tangent.
        self.count = count
        rows = np.repeat(np.arange(size), np.diff(pattern.indptr))
        keys, given = rows * size + pattern.indices, mass.tocoo()
        self._mass = np.zeros(count)
        slots = np.searchsorted(keys, given.row * size + given.col.astype(np.int64))
        self._mass[slots] = given.data
        #: Entries of prescribed coordinates, and those of them on the diagonal.
        self._fixed = np.zeros(0, dtype=np.int64)
        if prescribed.any():
            self._fixed = np.flatnonzero(prescribed[rows] | prescribed[pattern.indices])
            self._unit = np.flatnonzero(prescribed[rows] & (rows == pattern.indices))
        numbers = np.arange(count) + 1.0
        blocks = sp.bmat(
            [
                [
                    sp.csr_matrix((numbers + (2 * i + k) * count, pattern.indices, pattern.indptr))
                    for k in range(2)
                ]
                for i in range(2)
            ],
            format="csr",
        )
        blocks.data = blocks.data.astype(np.int64) - 1
        self._pattern = SquarePattern(blocks, system.analysis.repeat(2))

    def solution(self, tangents: Floats, heavy: Floats) -> Solve | None:
        """Factorise tangents (2, 2, n) plus mass times factors (2, 2); None if singular."""
        values = tangents + heavy[:, :, None] * self._mass
        if len(self._fixed):
            values[:, :, self._fixed] = 0.0
            for i in range(2):
                values[i, i, self._unit] = 1.0
        values = values.ravel()
        solve = factorise_square(values, self._pattern)
        if solve is None:
            return None
        return lambda right: solve(right.ravel()).reshape(2, -1)


def moves_to_stages(speeds: Floats, span: float) -> Floats:
    """Compute the moves to both stages, (2, n), from the speeds there."""
    return np.asarray(span * _A @ speeds)


def _end_position(position: Floats, moves: Floats) -> Floats:
    """Compute the position at the end of a step from the moves to its stages."""
    return position + 3**0.5 * (moves[1] - moves[0])
