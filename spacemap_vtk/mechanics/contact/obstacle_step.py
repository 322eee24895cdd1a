"""Contact with an obstacle over one time step, exact in energy.

With the distances g₀ and g₁ of a sample at both ends of a step, and U(g) the energy of its spring,
the force of the whole step is (Gonzalez, J. Nonlinear Sci. 6 (1996) 449)

    f = (U(g₁) - U(g₀))/(g₁ - g₀) n,    n = ∇g(x̄) + (g₁ - g₀ - ∇g(x̄)·Δx) Δx/|Δx|²

with the middle x̄ of the sample's move Δx relative to the obstacle. As n·Δx = g₁ - g₀, its work is
the change of U, however long the step: an impact neither gains nor loses energy.

Friction is an elastic slip e of each sample along the surface, which pulls with k A e, and which is
bounded by μ times the mean normal force p of the step:

    f = k A e₁,    e₁ = e₀ + Δx, of length μ p/(k A) at most

The energy ½ k A e² is stored, and f·(e₀ + Δx - e₁) + ½ k A (e₁ - e₀)² ≥ 0 is dissipated. The last
part vanishes in short steps; in long ones it damps the vibrations of samples that stick. A sample
that no longer touches at the end of a step loses its slip.

The springs stiffen towards the middle of the obstacle, where their energy is infinite: nothing
passes through, however fast it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.obstacles import BodyMotion
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    FinishedStep,
    TermStep,
    digest_of,
    sum_at_nodes,
)
from spacemap_vtk.ndarrays import Bools, Floats

#: Rounding error of the change of a distance in a step, as a share of the size of the coordinates.
_ROUNDING = 16 * float(np.finfo(np.float64).eps)


class _Mean(NamedTuple):
    """Mean contact of the samples of some elements over a step."""

    elements: Bools
    """(E,), elements of which a sample touches in the step."""
    force: Floats
    """(e, m), mean of U′(g): the negative of the normal force."""
    normal: Floats
    """(e, m, 3), direction n of the module's equation."""
    unit: Floats
    """(e, m, 3), normal of the obstacle in the middle of the step."""
    each: Floats
    """(e, m, 3, 3), derivative of the force by the position at the end."""
    growth: Floats
    """(e, m, 3), derivative of U′ by the position at the end."""
    moved: Floats
    """(e, m, 3), move relative to the obstacle."""


class SteppedObstacle(EnergyTerm):
    """Contact with an obstacle between two time steps; `slip` (E, m, 3) is that of friction [m]."""

    def __init__(self, term: ObstacleTerm, slip: Floats) -> None:
        self.obstacle_term, self.slip, self.nodes = term, slip, term.nodes
        self._springs = term.stiffness * term.samples.areas

    @property
    def digest(self) -> str:
        """Digest of the term and its slip."""
        return digest_of(self.obstacle_term.digest, self.slip)

    def energy(self, positions: Floats) -> float:
        """Compute the energy of springs and friction [J]."""
        term = self.obstacle_term
        depth = np.maximum(-term.gaps(positions), 0.0)
        hard = 1.0 - (depth / term.room) ** 2
        square = (self.slip**2).sum(axis=2)
        return 0.5 * float(np.vdot(self._springs, depth**2 / hard + square))

    def forces(self, positions: Floats) -> Floats:
        """Compute the forces of the springs that hold the nodes [N], (V, 3)."""
        return self.obstacle_term.replace(friction=None).forces(positions)

    def tangent(self, positions: Floats) -> Floats:
        """Compute the tangent of the springs [N/m], (E, 3 n, 3 n)."""
        return self.obstacle_term.replace(friction=None).tangent(positions)

    def at_time(self, time: float, slip: Floats | None = None) -> SteppedObstacle:
        """Return the same contact at another time [s], from its state at the start."""
        term = self.obstacle_term
        moved = term.replace(obstacle=term.obstacle.moved(self._moves(0.0, time)))
        return SteppedObstacle(moved, self.slip if slip is None else slip)

    def begin_step(self, positions: Floats, time: float, span: float) -> ObstacleStep:
        """Begin a time step."""
        return ObstacleStep(self, positions, self._moves(time, time + span))

    def _moves(self, begin: float, end: float) -> Floats:
        """Compute the move of the obstacle between two times [m], (3,)."""
        motion = self.obstacle_term.motion
        return np.zeros(3) if motion is None else motion.at_time(end) - motion.at_time(begin)


def begin_stepping(
    term: ObstacleTerm, positions: Floats, motion: BodyMotion | None = None
) -> SteppedObstacle:
    """Make the term of the first time step from that of a state at rest."""
    where = term.samples.positions(positions)
    deepest = -float(term.gaps(positions).min(initial=0.0))
    if deepest >= term.room:
        raise InputError(
            "the cage reaches through an obstacle at the start",
            key="obstacles",
            value=f"{deepest:.3g} m deep",
            allowed=f"less than {term.room:.3g} m",
            cure="Move the obstacle or the cage, or make the obstacle thicker",
        )
    slip = np.zeros_like(where)
    if term.friction is not None:
        moved = np.nan_to_num(where - term.friction.anchors)
        slip = _across(moved, term.friction.normals)
    return SteppedObstacle(term.replace(friction=None, motion=motion), slip)


class ObstacleStep(TermStep):
    """Contact with an obstacle in a step, in which the obstacle moves by `shift` (3,) [m]."""

    def __init__(self, stepped: SteppedObstacle, positions: Floats, shift: Floats) -> None:
        self.term = stepped.obstacle_term
        self._slip, self._shift, self._count = stepped.slip, shift, len(positions)
        self._positions = positions
        self._start = self.term.samples.positions(positions)
        self._gap = self._gaps(self._start)
        self._springs = self.term.stiffness * self.term.samples.areas
        self._kept: tuple[Floats, _Mean] | None = None

    def admits(self, shares: Floats, places: list[Floats]) -> bool:
        """Check that no sample can have passed the middle of the obstacle between two places."""
        depth = self.term.room
        if not np.isfinite(depth):
            return True
        before, room = self._start, self._gap + depth
        # Distances change by no more than the samples move: where a step is short against all of
        # them, which nearly all are, the samples need not be followed one by one.
        if 3.0 * max(map(self._largest_move, places)) < float(room.min(initial=math.inf)):
            return True
        for share, place in zip(shares, places, strict=True):
            now = self.term.samples.positions(place) - share * self._shift
            if (np.linalg.norm(now - before, axis=2) >= room).any():
                return False
            before, room = now, self._gaps(now) + depth
        return True

    def forces(self, end: Floats) -> Floats:
        """Compute the mean forces that hold the nodes against the obstacle [N], (V, 3)."""
        mean = self._mean(end)
        return self._at_nodes(mean, self._sample_forces(mean))

    def tangent(self, end: Floats) -> Floats:
        """Compute the derivative of the forces by the positions at the end [N/m]."""
        mean = self._mean(end)
        each = mean.each
        if self.term.coefficient > 0.0:
            each = each + self._friction_tangent(mean)
        return self.term.assemble(np.flatnonzero(mean.elements), each)

    def finish(self, end: Floats) -> FinishedStep:
        """Return the term at the end, the energy that friction dissipates, and the work done."""
        mean, term = self._mean(end), self.term
        # What holds the cage against the obstacle moves with it.
        work = -float(self._sample_forces(mean).sum(axis=(0, 1)) @ self._shift)
        moved = term.replace(obstacle=term.obstacle.moved(self._shift))
        if term.coefficient == 0.0:
            return FinishedStep(SteppedObstacle(moved, self._slip), 0.0, work)
        friction, slip, trial = self._friction(mean)
        springs = self._springs[mean.elements][..., None]
        lost = float((friction * (trial - friction) / springs).sum())
        lost += 0.5 * float((springs * (friction / springs - slip) ** 2).sum())
        later = np.zeros_like(self._slip)
        later[mean.elements] = friction / springs
        where = term.samples.positions(end)
        found = moved.obstacle.distance(where.reshape(-1, 3))
        opens = found.gap.reshape(where.shape[:2]) >= term.offset
        lost += 0.5 * float((self._springs * opens * (later**2).sum(axis=2)).sum())
        later = _turned(later, _normalised(found.gradient).reshape(where.shape))
        later[opens] = 0.0
        return FinishedStep(SteppedObstacle(moved, later), lost, work)

    def _largest_move(self, place: Floats) -> float:
        """Compute how far samples can have moved against the obstacle since the start [m]."""
        spread = float(abs(self.term.samples.weights).sum(axis=1).max(initial=0.0))
        nodes = float(np.linalg.norm(place - self._positions, axis=1).max())
        return spread * nodes + float(np.linalg.norm(self._shift))

    def _gaps(self, where: Floats) -> Floats:
        gap = self.term.obstacle.gap(where.reshape(-1, 3)) - self.term.offset
        return gap.reshape(where.shape[:2])

    def _at_nodes(self, mean: _Mean, forces: Floats) -> Floats:
        samples = self.term.samples
        return sum_at_nodes(samples.nodes[mean.elements], samples.weights.T @ forces, self._count)

    def _mean(self, end: Floats) -> _Mean:
        """Compute the mean contact of the step to the given positions."""
        if self._kept is not None and self._kept[0] is end:
            return self._kept[1]
        term = self.term
        where = term.samples.positions(end) - self._shift
        near = np.flatnonzero((self._gap < self._largest_move(end)).any(axis=1))
        gaps = self._gaps(where[near])
        touches = np.any((self._gap[near] < 0) | (gaps < 0), axis=1)
        part = np.zeros(len(where), dtype=bool)
        part[near] = touches
        first, last, springs = self._gap[part], gaps[touches], self._springs[part]
        force, slope = _mean_slope(first, last, springs, term.room)
        moved = where[part] - self._start[part]
        middle = term.obstacle.distance((where[part] - moved / 2).reshape(-1, 3))
        ahead = term.obstacle.distance(where[part].reshape(-1, 3)).gradient.reshape(moved.shape)
        gradient = middle.gradient.reshape(moved.shape)
        curvature = middle.curvature.reshape(*moved.shape, 3)
        square = np.maximum((moved**2).sum(axis=2), 1e-300)[..., None]
        missing = last - first - (gradient * moved).sum(axis=2)
        # Divided by a tiny move, rounding would be a force that no step could balance.
        size = abs(where).max() + abs(where - term.obstacle.center).max()
        missing = np.sign(missing) * np.maximum(abs(missing) - _ROUNDING * size, 0.0)
        missing = missing[..., None] / square
        normal = gradient + missing * moved
        # The derivatives of the normal and of the force by the position at the end.
        bend = (curvature @ moved[..., None])[..., 0] / 2
        turning = ahead - gradient - bend - 2 * missing * moved
        each = curvature / 2 + missing[..., None] * np.eye(3)
        each += (moved / square)[..., :, None] * turning[..., None, :]
        growth = slope[..., None] * ahead
        each = force[..., None, None] * each + normal[..., :, None] * growth[..., None, :]
        found = _Mean(part, force, normal, _normalised(gradient), each, growth, moved)
        self._kept = end, found
        return found

    def _sample_forces(self, mean: _Mean) -> Floats:
        """Compute the forces that hold the samples [N], (e, m, 3)."""
        forces = mean.force[..., None] * mean.normal
        return forces + self._friction(mean)[0] if self.term.coefficient > 0.0 else forces

    def _friction(self, mean: _Mean) -> tuple[Floats, Floats, Floats]:
        """Compute friction, slip at the start, and the friction if nothing slid, (e, m, 3)."""
        slip = _turned(self._slip[mean.elements], mean.unit)
        trial = slip + _across(mean.moved, mean.unit)
        trial *= self._springs[mean.elements][..., None]
        length = np.linalg.norm(trial, axis=2)
        limit = -self.term.coefficient * mean.force
        share = np.where(length > limit, limit / np.where(length > 0, length, 1.0), 1.0)
        return share[..., None] * trial, slip, trial

    def _friction_tangent(self, mean: _Mean) -> Floats:
        friction, _, trial = self._friction(mean)
        length = np.linalg.norm(trial, axis=2)
        held = np.linalg.norm(friction, axis=2)
        slides = (length > held * (1 + 1e-12))[..., None, None]
        share = np.where(length > 0, held / np.where(length > 0, length, 1.0), 1.0)
        way = trial / np.where(length > 0, length, 1.0)[..., None]
        across = np.eye(3) - mean.unit[..., :, None] * mean.unit[..., None, :]
        along = slides * way[..., :, None] * way[..., None, :]
        springs = (share * self._springs[mean.elements])[..., None, None]
        grip = self.term.coefficient * slides * way[..., :, None] * mean.growth[..., None, :]
        return np.asarray(springs * (across - along) - grip)


def _mean_slope(first: Floats, last: Floats, springs: Floats, room: float) -> tuple[Floats, Floats]:
    """Compute ΔU/Δg of springs from one distance to another, and its derivative by the last."""
    # U = ½ k g²/(1 - (g/B)²) where g < 0. The difference of two such quotients is that of the
    # squares over both denominators.
    both = (first < 0) & (last < 0)
    change = np.where(both | (first == last), 1.0, last - first)
    a, b = np.minimum(first, 0.0), np.minimum(last, 0.0)
    mean = np.where(both, a + b, (b**2 - a**2) / change)
    slope = np.where(both, 1.0, (2 * b * change - (b**2 - a**2)) / change**2)
    hard = 1.0 - (a / room) ** 2
    harder = 1.0 - (b / room) ** 2
    slope = (slope + mean * 2 * b / room**2 / harder) / (hard * harder)
    return springs / 2 * mean / (hard * harder), springs / 2 * slope


def _normalised(vectors: Floats) -> Floats:
    """Scale vectors to unit length; those of no length stay."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def _across(vectors: Floats, normals: Floats) -> Floats:
    """Compute the parts of vectors across unit normals."""
    return vectors - normals * (normals * vectors).sum(axis=-1, keepdims=True)


def _turned(vectors: Floats, normals: Floats) -> Floats:
    """Turn vectors so that they are across unit normals, without a change of length."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return length * _normalised(_across(vectors, normals))
