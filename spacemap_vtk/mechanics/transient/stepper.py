"""Motion of a cage with large rotations: implicit time steps, and interpolation between them.

A state is a row of numbers. A step is of fourth order and conserves energy (see
`spacemap_vtk.mechanics.transient.gauss`). Between two states the motion is their cubic Hermite
interpolation.

The motion determines the length of a step: the estimated error per radian of vibration may be at
most a share of the largest displacement since the start, however small that is. A vibration at ω
with most of the motion's amplitude needs steps of (ω h)⁴ = 720 times that share. A vibration with
little of the amplitude may be resolved less well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, hstack
from scipy.sparse.linalg import spsolve

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.boundary.follower import FollowerPressure
from spacemap_vtk.mechanics.boundary.grips import Grip, held_by
from spacemap_vtk.mechanics.boundary.reactions import Bearing
from spacemap_vtk.mechanics.boundary.time_functions import Sine, is_constant
from spacemap_vtk.mechanics.contact.layer_friction import (
    LayerFriction,
    SteppedLayers,
    begin_stepping_layers,
)
from spacemap_vtk.mechanics.contact.obstacle_step import SteppedObstacle, begin_stepping
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.resting import obstacles_of
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.elements.shell import free_sheet_motions
from spacemap_vtk.mechanics.elements.strains import StrainState
from spacemap_vtk.mechanics.equilibrium.energy_terms import TermState, VertexTerm
from spacemap_vtk.mechanics.equilibrium.reduced_system import ReducedSystem
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.mechanics.modal.cage_modes import CageModes, LoadVector
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.pencil import free_columns
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.mechanics.response.modal_motion import base_factors, jump_of
from spacemap_vtk.mechanics.transient.gauss import (
    ActingLoads,
    GaussIntegrator,
    Step,
    moves_to_stages,
)
from spacemap_vtk.mechanics.transient.stage_stress import STAGES, viscous_stress
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Bools, Floats, Progress

#: First step, as a share of the longest one.
FIRST = 1 / 256
#: Shortest step, as a share of the longest one.
SHORTEST = 1e-9

#: Share that is used of the step which the error bound allows.
SAFETY = 0.75
#: Largest ratio of a step to the one before.
MAX_GROWTH = 2.0
#: Smallest ratio of a step to the one before.
MIN_GROWTH = 0.1

#: Least number of steps in a period of a sine.
STEPS_PER_PERIOD = 20

#: Number of periods after which the error must be within the tolerance.
PERIODS = 10

#: Errors across a node's direction of motion, and errors of nodes that hardly move, may be larger
#: by this factor than those along the motion.
SIDEWAYS = 100.0

#: A motion smaller than this share of the cage's diagonal is resolved as if it were that large;
#: otherwise rounding would limit the step.
MIN_MOTION = 1e-7

#: If the next step could be longer by at most this factor, it is as long as the last one, so that
#: its matrix need not be factorised again.
SAME_STEP = 1.2

#: Number of columns before reactions, positions and rates: time, the step to try next, kinetic,
#: strain and dissipated energy, external work, and the parts of the last two by friction, by
#: obstacles and by grips.
COLUMNS = 9


class SteppedMotion(Motion):
    """Motion of a cage by time steps, at any time from t = 0 on.

    Parameters
    ----------
    cage : CageModes
        The cage; its modes are only used for damping ratios. Loads of its equilibrium, if it has
        one, continue to act.
    loads : sequence of LoadVector
        Further loads, made by `CageModes.load_vector`.
    damping : Damping
        α and β, or damping ratios of the cage's modes. With ratios, forces resist the velocity of
        each mode, and a β gives higher modes at least the ratio of the last one.
    displacement : ndarray of float64, shape (V, 3), optional
        Displacement at t = 0 from the undeformed shape [m]; by default that of the equilibrium.
    velocity : ndarray of float64, shape (V, 3), optional
        Velocity at t = 0 [m/s], except on held components.
    settled : bool, optional
        Whether the cage is at rest under its loads at t = 0, so that a moving base starts at the
        first value of its function.
    tolerance : float, optional
        Error of the motion after ten periods, as a share of the largest displacement since t = 0.
        If it is infinite, only the other limits bound the steps.
    max_step : float, optional
        Longest step [s].
    grips : sequence of Grip, optional
        Grips, in their last places on the path; those with a motion move in time, relative to the
        base if it moves.
    bearings : sequence of Bearing, optional
        Supports and grips whose reactions are wanted.
    holding : ndarray of float64, shape (V, 3), optional
        Forces that hold the cage in its equilibrium [N], see `Model.holding_forces`; by default
        all forces on held components, without the loads there.

    Raises
    ------
    InputError
        If the damping, the loads or the cage are not supported with time steps.

    Notes
    -----
    Nothing is computed before a time is requested, and nothing twice: every method steps on as far
    as it needs. The steps do not depend on the requested times.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> from spacemap_vtk.mechanics.modal.model import Model
    >>> from spacemap_vtk.mechanics.boundary.time_functions import step
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> held = np.arange(4)[:, None] < [3, 3, 3]
    >>> model = Model(corners, [[0, 1, 2, 3]], isotropic(1e6, 0.0), 1000.0, held)
    >>> cage = CageModes(model, np.empty(0), np.empty((0, 12)), np.empty(0))
    >>> load = cage.load_vector("gravity", (0, 0, -10.0), step())
    >>> motion = SteppedMotion(cage, [load], Damping(alpha=50.0))
    >>> float(motion.at_time(0.5)[0, 3, 2].round(4))  # of the vertex that is free [m]
    -0.0025
    """

    def __init__(
        self,
        cage: CageModes,
        loads: Sequence[LoadVector] = (),
        damping: Damping = Damping(),  # noqa: B008
        *,
        displacement: Floats | None = None,
        velocity: Floats | None = None,
        settled: bool = False,
        tolerance: float = 1e-4,
        max_step: float = 0.02,
        grips: Sequence[Grip] = (),
        bearings: Sequence[Bearing] = (),
        holding: Floats | None = None,
    ) -> None:
        self.model = model = cage.model
        self.points, self.cells = model.points, model.cells
        self.loads, self._settled = tuple(loads), settled
        _check_supported(cage, self.loads)
        self._all_grips = tuple(grips)
        self._grips = [grip for grip in grips if grip.motion is not None]
        self.bearings = tuple(bearings)
        size = float(np.linalg.norm(np.ptp(model.points, axis=0)))
        #: Largest error per radian, as a share of the motion. A vibration about an equilibrium
        #: moves away from its start by twice its amplitude.
        self._max_error = tolerance / (4 * math.pi * PERIODS)
        self._min_motion = MIN_MOTION * size
        motions = [term.motion for term in obstacles_of(model)]
        #: Time functions of loads, obstacles and grips.
        self._functions = [load.function for load in self.loads]
        self._functions += [motion.function for motion in motions if motion is not None]
        self._functions += [grip.motion.function for grip in self._grips if grip.motion]
        sines = [function for function in self._functions if isinstance(function, Sine)]
        self.max_step = min(
            [max_step, *(2 * math.pi / (STEPS_PER_PERIOD * s.omega) for s in sines)]
        )
        pencil = model.pencil
        # All forces are divided by the model's modulus, as the strains have a unit modulus.
        start, forces = pencil.nodes.positions, pencil.nodes.forces
        #: Farthest displacement of each nodal vector from its start.
        self._farthest = np.zeros_like(start)
        dead = np.zeros_like(start) if forces is None else forces
        self._holding = np.zeros_like(self.points) if holding is None else holding
        dead = dead - self._forces_to_nodes(self._holding)
        followers = [
            VertexTerm(FollowerPressure(load.faces), pencil.surface)
            for load in self.loads
            if load.faces is not None
        ]
        #: Displacement of the equilibrium [m]; zero if there is none.
        self.rest = np.zeros_like(self.points)
        if model.displacement is not None:
            self.rest = model.displacement
        moved = np.zeros_like(self.points) if displacement is None else displacement - self.rest
        self._basis, prescribed = self._extend_basis()
        q, v = (
            self._basis.T @ self._to_nodes(field).ravel()
            for field in (moved, np.zeros_like(moved) if velocity is None else velocity)
        )
        v[prescribed] = 0.0
        first = start + (self._basis @ q).reshape(-1, 3)
        # A pencil is shared by models that differ only in the motions of their obstacles.
        moving = iter(motions)
        terms = []
        for term in pencil.terms:
            if isinstance(term, SelfContact):
                term.check_start(first)
            if isinstance(term, ObstacleTerm):
                term = begin_stepping(term, first, next(moving))
            elif isinstance(term, LayerFriction):
                term = begin_stepping_layers(term, first)
            terms.append(term)
        system = ReducedSystem([*terms, *followers], self._basis, start)
        #: Number of terms other than followers that do external work.
        self._driven_count = sum(not term.conservative for term in pencil.terms)
        whole = (model.density / model.modulus) * pencil.full_mass
        mass = (model.density / model.modulus) * pencil.mass
        if prescribed.any():
            mass = (self._basis.T @ whole @ self._basis).tocsr()
        beta, drag = _damping_from_ratios(cage, system, mass, damping)
        needs_holding = bool(self._grips or self.bearings or motions)
        self._integrator = GaussIntegrator(
            system, mass, damping.alpha, beta, drag, prescribed, whole if needs_holding else None
        )
        #: Loads on all nodes (V, 3), and on the coordinates: dead ones, and each of `loads`.
        self._nodal_dead = dead
        self._nodal_pushes = [
            self._forces_to_nodes(cage.vertex_forces(load).reshape(-1, 3)) for load in self.loads
        ]
        self._dead = system.reduce_forces(dead)
        self._pushes = [system.reduce_forces(push) for push in self._nodal_pushes]
        #: Number of bodies whose reactions are computed, and of columns before positions.
        self._bodies = len(self.bearings) + len(motions)
        self._head = COLUMNS + 6 * self._bodies
        self._rows = np.empty((64, self._head + 2 * len(q)))
        self._count = 0
        kinetic, strain = self._integrator.stored_energy(v, self._integrator.evaluate(q))
        begun = [0.0, FIRST * self.max_step, kinetic, strain, 0.0, kinetic + strain, 0.0, 0.0, 0.0]
        self._append(np.concatenate([begun, self._static_reactions(first), q, v]))
        #: Number of the last state, its terms, and the stress of each kind of element.
        self._last_state: tuple[int, list[TermState], list[Floats]] = 0, [], []
        #: Number of steps that this object has made, and how often one was halved because it did
        #: not converge.
        self.steps = self.halvings = 0
        #: Number of states that `_farthest` includes.
        self._seen_count = 1
        self._append_jump(0.0)

    def _to_nodes(self, moved: Floats) -> Floats:
        """Convert vectors of the vertices to those of the nodes, (V, 3)."""
        surface = self.model.pencil.surface
        return moved if surface is None else surface.to_nodes(moved)

    def _forces_to_nodes(self, forces: Floats) -> Floats:
        """Convert forces on the vertices [N] to those on the nodes over the modulus, (V, 3)."""
        found = self._to_nodes(forces) / self.model.modulus
        return found if self.model.pencil.surface is None else 2 * found

    def _forces_to_vertices(self, forces: Floats) -> Floats:
        """Convert forces on the nodes over the modulus to those on the vertices [N], (V, 3)."""
        surface = self.model.pencil.surface
        found = forces if surface is None else surface.to_vertices(forces) / 2
        return self.model.modulus * found

    def _to_vertices(self, nodal: Floats) -> Floats:
        """Convert vectors of the nodes to those of the vertices, (V, 3)."""
        surface = self.model.pencil.surface
        return nodal if surface is None else surface.to_vertices(nodal)

    def _extend_basis(self) -> tuple[csc_matrix, Bools]:
        """Add coordinates of what moving grips hold to the basis; return which these are."""
        pencil, points = self.model.pencil, self.points
        free = pencil.basis.shape[1]
        if not self._grips:
            return pencil.basis, np.zeros(free, dtype=bool)
        held = held_by(self._grips, points.shape)
        if pencil.surface is None:
            more = free_columns(held.ravel())
        else:
            more = free_sheet_motions(points, pencil.surface, ~held)
        basis = hstack([pencil.basis, more], format="csc")
        return basis, np.arange(basis.shape[1]) >= free

    @property
    def states(self) -> Floats:
        """States so far, (n, 9 + 6K + 2N); a time occurs twice if a base or grip jumps."""
        return self._rows[: self._count]

    @property
    def slips(self) -> Floats:
        """Slip of friction in the last state [m], (S, 3): at samples of obstacles, and of sides."""
        found = [each.slip.reshape(-1, 3) for each in self._obstacles()]
        found += [each.slip for each in self._layers()]
        return np.concatenate([np.empty((0, 3)), *found])

    @property
    def last_time(self) -> float:
        """Time of the last state [s]."""
        return float(self._rows[self._count - 1, 0])

    def resume(self, rows: Floats, slips: Floats | None = None) -> bool:
        """Continue from states of the same motion that were computed elsewhere.

        Parameters
        ----------
        rows : ndarray of float64, shape (n, 8 + 2N)
            `states` of the other `SteppedMotion`, from the first one on.
        slips : ndarray of float64, shape (S, 3), optional
            `slips` of the other one [m]; needed with friction.

        Returns
        -------
        bool
            False if these are not states of this motion; then nothing changes.
        """
        mine = self.states
        if rows.ndim != 2 or rows.shape[1] != mine.shape[1] or len(rows) < len(mine):
            return False
        if not (np.isfinite(rows).all() and np.array_equal(rows[: len(mine)], mine)):
            return False
        rubs = any(each.obstacle_term.coefficient for each in self._obstacles())
        if slips is None and (rubs or self._layers()):
            return False
        self._rows, self._count = rows, len(rows)
        first = 0
        terms = list(self._integrator.system.terms)
        for number, term in enumerate(terms):
            if isinstance(term, SteppedObstacle):
                last = first + term.slip[..., 0].size
                slip = None if slips is None else slips[first:last].reshape(term.slip.shape)
                terms[number] = term.at_time(self.last_time, slip)
                first = last
            elif isinstance(term, SteppedLayers) and slips is not None:
                terms[number] = term.with_slip(slips[first : first + len(term.slip)])
        self._integrator.system.terms = terms
        return True

    def _obstacles(self) -> list[SteppedObstacle]:
        terms = self._integrator.system.terms
        return [term for term in terms if isinstance(term, SteppedObstacle)]

    def _layers(self) -> list[SteppedLayers]:
        terms = self._integrator.system.terms
        return [term for term in terms if isinstance(term, SteppedLayers)]

    def step_until(self, time: float, progress: Progress | None = None) -> None:
        """Step until there is a state beyond a time.

        Parameters
        ----------
        time : float
            Time to reach [s].
        progress : callable, optional
            Called with the share that is done, 0 to 1, after each step; may raise to stop. Steps
            made so far are kept.

        Raises
        ------
        InputError
            If the time is not a finite number.
        SizeError
            If the steps up to this time do not fit into memory.
        SolverError
            If even the shortest step does not converge.
        """
        if not math.isfinite(time):
            raise InputError(
                "not a time", key="time", value=time, allowed="a finite number of seconds"
            )
        first = self.last_time
        least = min(max(time - first, 0.0) / self.max_step, 1e30)
        require_memory(
            round(least) * self._rows[0].nbytes,
            f"{least:.3g} steps or more, up to {time:g} s,",
            cure="Request an earlier time, or raise max_step.",
        )
        with blas_threads.use_one_thread():
            while self.last_time <= time:
                self._make_step()
                if progress is not None:
                    progress(min(1.0, (self.last_time - first) / max(time - first, 1e-300)))

    def at_time(self, time: float) -> Floats:
        """Compute the motion of the vertices at a time; before 0 they rest in the initial state."""
        system = self._integrator.system
        fields = np.stack([self._to_vertices(system.node_moves(q)) for q in self._state(time)])
        fields = fields + self.base_motion(time)[:, None]
        fields[0] += self.rest
        return fields

    def history(self, weights: Floats, times: Floats) -> Floats:
        """Compute the motion of a point over time."""
        # The point is a mesh of one vertex; gathering of forces is the transpose of spreading.
        reduce, size = self._integrator.system.reduce_forces, self.model.modulus
        spread = weights[:, None] * size * np.eye(3)[:, None]  # (3, V, 3)
        point = np.stack([reduce(self._forces_to_nodes(part)) for part in spread], axis=1)
        share = weights.sum()
        found = np.stack(
            [self._state(t) @ point + share * self.base_motion(t) for t in times], axis=1
        )
        found[0] += weights @ self.rest
        return found

    def energies(self, times: Floats) -> Floats:
        """Compute the energies over time, linear between the states."""
        return self._interpolate(times, range(2, 6))

    def contact_energies(self, times: Floats) -> Floats:
        """Compute the exchange of energy with obstacles over time, linear between the states.

        Parameters
        ----------
        times : ndarray of float64, shape (t,)
            Times [s].

        Returns
        -------
        ndarray of float64, shape (t, 2)
            Energy dissipated by friction, and work of moving obstacles [J]; parts of the third and
            fourth column of `energies`.
        """
        return self._interpolate(times, [6, 7])

    def grip_work(self, times: Floats) -> Floats:
        """Compute the work of moving grips over time, linear between the states.

        Parameters
        ----------
        times : ndarray of float64, shape (t,)
            Times [s].

        Returns
        -------
        ndarray of float64, shape (t,)
            Work [J]; a part of the fourth column of `energies`.
        """
        return self._interpolate(times, [8])[:, 0]

    def _interpolate(self, times: Floats, columns: Sequence[int]) -> Floats:
        """Interpolate energies of the states, (t, n) [J]."""
        wanted = np.maximum(np.asarray(times, dtype=np.float64), 0.0)
        self.step_until(float(wanted.max(initial=0.0)))
        table = self.states
        found = [np.interp(wanted, table[:, 0], table[:, k]) for k in columns]
        return self.model.modulus * np.stack(found, axis=1)

    @property
    def grips_move(self) -> bool:
        """Whether a grip moves in time."""
        return bool(self._grips)

    def reactions(self, times: Floats) -> Floats:
        """Compute force and moment of each body that holds the cage, as means over each step.

        Parameters
        ----------
        times : ndarray of float64, shape (t,)
            Times [s].

        Returns
        -------
        ndarray of float64, shape (t, K, 6)
            Force [N] and moment [N m] on the cage of each bearing, then of each obstacle. Their
            impulse over a step, with that of the loads, is the change of momentum.
        """
        wanted = np.asarray(times, dtype=np.float64)
        self.step_until(float(wanted.max(initial=0.0)))
        after = np.searchsorted(self.states[:, 0], wanted, side="right")
        after = np.where(wanted < 0.0, 0, np.minimum(after, self._count - 1))
        return self.states[after, COLUMNS : self._head].reshape(len(wanted), self._bodies, 6)

    def reaction_points(self, time: float) -> Floats:
        """Compute the points of the moments of `reactions`.

        Parameters
        ----------
        time : float
            Time [s].

        Returns
        -------
        ndarray of float64, shape (K, 3)
            Points [m].
        """
        base = self.base_motion(time)[0]
        points = [each.about + base for each in self.bearings]
        obstacles = obstacles_of(self.model)
        return np.reshape(
            [
                *(point + move for point, move in zip(points, self._moved(time), strict=True)),
                *(
                    term.obstacle.center + move
                    for term, move in zip(obstacles, self.obstacle_moves(time), strict=True)
                ),
            ],
            (-1, 3),
        )

    def _moved(self, time: float) -> list[Floats]:
        """Return how far the point of moments of each bearing has moved [m]."""
        grips, found = iter(self._all_grips), []
        for bearing in self.bearings:
            grip = next(grips) if bearing.kind == "grip" else None
            move = np.zeros(3) if grip is None else grip.moves[-1]
            if grip is not None and grip.motion is not None:
                move = move + grip.motion.function.value(max(time, 0.0)) * grip.motion.displacement
            found.append(move)
        return found

    def _static_reactions(self, nodal: Floats) -> Floats:
        """Return the reactions in the state at the start, (6 K,)."""
        terms = [term for term in self.model.pencil.terms if isinstance(term, ObstacleTerm)]
        pressing = [term.forces(nodal) for term in terms]
        return self._sum_reactions(self._holding[None], pressing, [nodal], [0.0], 0.0)

    def _sum_reactions(
        self,
        holding: Floats,
        pressing: Sequence[Floats],
        nodal: Sequence[Floats],
        times: Sequence[float],
        middle: float,
    ) -> Floats:
        """Return means of the reactions, (6 K,), over given states."""
        # `holding` are forces on the vertices at each of the given times, `nodal` the positions of
        # the nodes then; `pressing` are mean forces on the nodes by which obstacles are pressed.
        if not self._bodies:
            return np.empty(0)
        places = [self._to_vertices(each) for each in nodal]
        total = np.zeros((self._bodies, 6))
        for forces, place, time in zip(holding, places, times, strict=True):
            for k, (bearing, move) in enumerate(zip(self.bearings, self._moved(time), strict=True)):
                found = bearing.reaction(forces, place, move)
                total[k] += np.concatenate([found.force, found.moment]) / len(places)
        place, obstacles = np.mean(places, axis=0), obstacles_of(self.model)
        moves = self.obstacle_moves(middle)
        for k, (push, term) in enumerate(zip(pressing, obstacles, strict=True)):
            forces = -self._forces_to_vertices(push)
            arms = place - term.obstacle.center - moves[k]
            moment = np.cross(arms, forces).sum(axis=0)
            total[len(self.bearings) + k] = *forces.sum(axis=0), *moment
        return total.ravel()

    def potential(self, times: Floats) -> Floats:
        """Compute the potential energy of loads that never change, linear between the states."""
        wanted = np.append(np.maximum(np.asarray(times, dtype=np.float64), 0.0), 0.0)
        self.step_until(float(wanted.max()))
        # A follower pressure has no potential.
        dead = self._dead.copy()
        for load, push in zip(self.loads, self._pushes, strict=True):
            if load.faces is None and load.moves_base is None and is_constant(load.function):
                dead += load.function.value(0.0) * push
        table = self.states
        lost = table[:, self._head : self._head + len(dead)] @ dead
        found = -self.model.modulus * np.interp(wanted, table[:, 0], lost)
        return np.asarray(found[:-1] - found[-1])

    def _state(self, time: float) -> Floats:
        """Compute q, its rate and its acceleration at a time, (3, N)."""
        self.step_until(max(time, 0.0))
        now = int(np.searchsorted(self.states[:, 0], max(time, 0.0), side="right")) - 1
        first, last = self._rows[now : now + 2]
        (q, v), (end, later) = (np.split(row[self._head :], 2) for row in (first, last))
        if time < 0.0:
            return np.stack([q, 0.0 * v, 0.0 * v])
        whole = last[0] - first[0]
        since, mean = (time - first[0]) / whole, (end - q) / whole
        bend, twist = 3 * mean - 2 * v - later, v + later - 2 * mean
        place = q + whole * since * (v + since * (bend + since * twist))
        rate = v + since * (2 * bend + 3 * since * twist)
        return np.stack([place, rate, (2 * bend + 6 * since * twist) / whole])

    def obstacle_moves(self, time: float) -> Floats:
        """Compute how far each obstacle has moved.

        Parameters
        ----------
        time : float
            Time [s].

        Returns
        -------
        ndarray of float64, shape (n, 3)
            Displacement of each of the n obstacles [m].
        """
        motions = [term.motion for term in obstacles_of(self.model)]
        moves = [np.zeros(3) if each is None else each.at_time(time) for each in motions]
        return np.reshape(moves, (-1, 3))

    def base_motion(self, time: float) -> Floats:
        """Compute the motion of the base.

        Parameters
        ----------
        time : float
            Time [s].

        Returns
        -------
        ndarray of float64, shape (3, 3)
            Displacement [m], velocity [m/s] and acceleration [m/s²] along x, y and z.
        """
        total = np.zeros((3, 3))
        for load in self.loads:
            if load.moves_base is not None:
                total += np.outer(base_factors(load.function, time), load.moves_base)
        return total

    def _append(self, row: Floats) -> None:
        if self._count == len(self._rows):
            size = (len(row) - self._head) // 2
            require_memory(
                2 * self._rows.nbytes,
                f"keeping more than {self._count} steps of {size} degrees of freedom",
                cure="Use a coarser cage, longer steps or an earlier time.",
            )
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1

    def _loads_at(self, time: float) -> ActingLoads:
        """Compute the loads at a time, after any jump at that time."""
        total, factors = self._dead.copy(), [1.0] * self._driven_count
        nodal = self._nodal_dead.copy()
        for load, push, pushed in zip(self.loads, self._pushes, self._nodal_pushes, strict=True):
            size = load.function.value(time)
            if load.faces is not None:
                factors.append(size * load.pressure / self.model.modulus)
                continue
            if load.moves_base is not None:
                size *= load.function.omega**2 if isinstance(load.function, Sine) else 0.0
            if size:
                total += size * push
                nodal += size * pushed
        return ActingLoads(total, np.array(factors), nodal)

    def _prescribe(self, time: float, slopes: Sequence[float]) -> tuple[Floats, Floats]:
        """Return coordinates of moving grips, (G,), and their rates if the factors have slopes."""
        moved, rate = np.zeros((2, *self.points.shape))
        for grip, slope in zip(self._grips, slopes, strict=True):
            assert grip.motion is not None
            place, center = self.points + self.rest, grip.center + grip.moves[-1]
            displacement, change = grip.motion.displace(place, center, time)
            moved = np.where(grip.held, displacement, moved)
            rate = np.where(grip.held, slope * change, rate)
        own = self._integrator.prescribed
        place, speed = (self._basis.T @ self._to_nodes(each).ravel() for each in (moved, rate))
        return place[own], speed[own]

    def _grip_slopes(self, time: float) -> list[float]:
        """Return the slopes of the functions of moving grips, after a corner at that time."""
        return [grip.motion.function.slope(time) for grip in self._grips if grip.motion]

    def _grip_moves(self, position: Floats, time: float, span: float) -> Floats:
        """Return the moves of prescribed coordinates to both stages, (2, G)."""
        # Speeds at the stages have their exact mean, so that grips end where they are prescribed.
        speeds = np.stack(
            [
                self._prescribe(at, self._grip_slopes(at))[1]
                for at in (time + share * span for share in STAGES)
            ]
        )
        end = self._prescribe(time + span, [0.0] * len(self._grips))[0]
        whole = end - position[self._integrator.prescribed]
        return moves_to_stages(speeds + whole / span - speeds.mean(axis=0), span)

    def _make_step(self) -> None:
        """Make a step and append its state."""
        row = self.states[-1]
        (time, step), (q, v) = row[:2].tolist(), np.split(row[self._head :], 2)
        if self._last_state[0] != self._count:
            terms = self._integrator.evaluate(q)
            stress = [part.stress for part in self._integrator.strain_states(terms)]
            self._last_state = self._count, terms, stress
        _, terms, stress = self._last_state
        for other in self.states[self._seen_count :, self._head : self._head + len(q)]:
            self._farthest = _longer_vectors(self._farthest, self._node_moves(other))
        self._seen_count = self._count
        end = min((each.next_corner(time) for each in self._functions), default=math.inf)
        step = min(step, self.max_step)
        while True:
            # The step is shortened so that no tiny one is left before a corner.
            remaining = end - time
            span = remaining if step >= remaining * (1 - 1e-9) else min(step, remaining / 2)
            guess = self._guess_moves(span)
            if self._grips:
                guess[:, self._integrator.prescribed] = self._grip_moves(q, time, span)
            found = self._integrator.make_step(
                q, v, terms, self._loads_at, time, span, guess, stress
            )
            shortest = span <= SHORTEST * self.max_step
            if found is None:
                if shortest:
                    raise SolverError(
                        f"time stepping does not converge at {time:.6g} s, even with the shortest "
                        "step",
                        cure="Make the cage stiffer, damp it, or change its divisions",
                    )
                step = span / 2
                self.halvings += 1
                continue
            error = self._relative_error(found.error, found.position)
            share = SAFETY * max(error / self._max_error, 1e-30) ** (-1 / 4)
            if share >= SAFETY or shortest:
                break
            step = span * max(share, MIN_GROWTH)
        longer = 1.0 if SAFETY <= share <= SAME_STEP else min(share, MAX_GROWTH)
        # A step that a corner has shortened does not limit the next one.
        following = max(span * longer, step if span < step else 0.0)
        self._integrator.accept(found)
        kinetic, strain = self._integrator.stored_energy(found.rate, found.parts)
        damped = row[4] + found.damped + found.rubbed
        work = row[5] + found.work + found.pushed + found.gripped
        head = [end if span == remaining else time + span, following, kinetic, strain, damped, work]
        head += [row[6] + found.rubbed, row[7] + found.pushed, row[8] + found.gripped]
        reactions = self._mean_reactions(q, v, found, time, span)
        self._append(np.concatenate([head, reactions, found.position, found.rate]))
        self.steps += 1
        self._last_state = self._count, found.parts, found.stress
        if span == remaining:
            self._append_jump(end)

    def _mean_reactions(
        self, q: Floats, v: Floats, found: Step, time: float, span: float
    ) -> Floats:
        """Return the mean reactions of a step that starts at q with rates v, (6 K,)."""
        if not self._bodies:
            return np.empty(0)
        system = self._integrator.system
        nodal = [system.start + system.node_moves(q + move) for move in found.moves]
        holding = np.stack([self._forces_to_vertices(each) for each in found.holding])
        terms = [isinstance(term, SteppedObstacle) for term in system.terms]
        pressing = [push for number, push in found.pressing.items() if terms[number]]
        times = [time + share * span for share in STAGES]
        return self._sum_reactions(holding, pressing, nodal, times, time + span / 2)

    def _node_moves(self, position: Floats) -> Floats:
        """Compute the move of the nodal vectors from the first state, (V, 3)."""
        first = self.states[0, self._head : self._head + len(position)]
        return self._integrator.system.node_moves(position - first)

    def _relative_error(self, errors: Floats, position: Floats) -> float:
        """Compare the estimated errors (V, 3) of a step with the motion up to its end."""
        # Errors count along the path of each node, weighted by its length. Sideways, as along a
        # strip that swings, there are vibrations that are too small to matter.
        farthest = _longer_vectors(self._farthest, self._node_moves(position))
        largest = max(float(np.linalg.norm(farthest, axis=1).max()), self._min_motion)
        along = float(abs(np.einsum("ni,ni->n", errors, farthest)).max()) / largest
        return max(along, float(abs(errors).max()) / SIDEWAYS) / largest

    def _guess_moves(self, span: float) -> Floats:
        """Estimate the moves to both stages from the parabola of the last step."""
        row = self.states[-1]
        v: Floats = np.split(row[self._head :], 2)[1]
        times = STAGES[:, None] * span
        if self._count < 2 or (since := row[0] - self.states[-2][0]) <= 0.0:
            return times * v
        before = np.split(self.states[-2][self._head :], 2)[1]
        return times * v + times**2 / 2 * (v - before) / since

    def _append_jump(self, time: float) -> None:
        """Append the state after a base jumps or starts to move; inertia holds the cage back."""
        moving = [load.moves_base is not None for load in self.loads]
        if self._grips:
            self._append_impulse(time)
        if not any(moving):
            return
        row = self.states[-1].copy()
        q, v = np.split(row[self._head :], 2)
        way, speed = np.zeros((2, len(q)))
        for load, push, moves in zip(self.loads, self._pushes, moving, strict=True):
            if moves:
                value, slope = jump_of(load.function, time, self._settled)
                way, speed = way - value * push, speed - slope * push
        if not (way.any() or speed.any()):
            return
        way = self._divide_by_mass(way)
        parts = self._integrator.evaluate(q + way / 2)
        v = v + self._divide_by_mass(speed - self._integrator.damping_impulse(parts, way))
        q = q + way
        kinetic, strain = self._integrator.stored_energy(v, self._integrator.evaluate(q))
        row[5] += kinetic + strain - row[2] - row[3]
        row[1:4] = FIRST * self.max_step, kinetic, strain
        self._append(np.concatenate([row[: self._head], q, v]))

    def _divide_by_mass(self, forces: Floats) -> Floats:
        """Return accelerations under forces, (N,); 0 for coordinates that grips prescribe."""
        own, mass = self._integrator.prescribed, self._integrator.mass
        free = diags((~own).astype(np.float64))
        alone = (free @ mass @ free + diags(own.astype(np.float64))).tocsr()
        found: Floats = spsolve(alone, np.where(own, 0.0, forces))
        return found

    def _append_impulse(self, time: float) -> None:
        """Append the state after the speed of a grip jumps; the momentum of the rest stays."""
        slopes = [jump_of(g.motion.function, time, True)[1] for g in self._grips if g.motion]
        if not any(slopes):
            return
        row, own, mass = self.states[-1].copy(), self._integrator.prescribed, self._integrator.mass
        q, v = np.split(row[self._head :], 2)
        jump = np.zeros_like(v)
        jump[own] = self._prescribe(time, slopes)[1]
        v = v + jump + self._divide_by_mass(-(mass @ jump))
        kinetic, strain = self._integrator.stored_energy(v, self._integrator.evaluate(q))
        gained = kinetic + strain - row[2] - row[3]
        row[5] += gained
        row[8] += gained
        row[1:4] = FIRST * self.max_step, kinetic, strain
        self._append(np.concatenate([row[: self._head], q, v]))


def _longer_vectors(first: Floats, second: Floats) -> Floats:
    """Choose the longer vector of each pair, (V, 3)."""
    longer = np.linalg.norm(second, axis=1) > np.linalg.norm(first, axis=1)
    return np.where(longer[:, None], second, first)


def _damping_from_ratios(
    cage: CageModes, system: ReducedSystem, mass: csr_matrix, damping: Damping
) -> tuple[float, Floats | None]:
    """Compute β and U so that C = β K + U Uᵀ gives the modes their damping ratios."""
    values = cage.eigenvalues
    swing = values > 0
    if not np.any(damping.ratio):
        return damping.beta, None
    if not swing.any():
        raise InputError(
            "a damping ratio needs modes that vibrate, but all computed modes are rigid",
            key="damping_ratio",
            cure="Raise modal.modes, or give alpha and beta.",
        )
    # C = M φ (2 ζ ω) φᵀ M (Caughey and O'Kelly 1965). β K is as large a part of it as leaves the
    # rest without negative damping. Short waves have no mode here; only β K damps them.
    resisted = Damping(ratio=damping.ratio).mass_damping(np.maximum(values, 0.0))
    beta = damping.beta + float((resisted[swing] / values[swing]).min())
    fields = cage.model.pencil.reduce_displacements(cage.shapes.T)
    # Coordinates of moving grips, which follow those of the modes, do not vibrate.
    fields = np.pad(fields, ((0, len(system.inertia) - len(fields)), (0, 0)))
    mine = np.zeros((len(values), len(values)))
    for part in (
        state for state in system.evaluate(system.start) if isinstance(state, StrainState)
    ):
        strained = np.stack(
            [
                part.kind.strain_changes(part.gradients, system.node_moves(field))
                for field in fields.T
            ]
        )
        stress = np.stack([viscous_stress(part, change) for change in strained])
        mine += stress.reshape(len(values), -1) @ strained.reshape(len(values), -1).T
    rest, turn = np.linalg.eigh(np.diag(resisted) - beta * cage.model.modulus * mine)
    kept = rest > 1e-9 * rest[-1]
    sizes = np.sqrt(cage.model.modulus * rest[kept])
    return beta, mass @ (fields @ turn[:, kept]) * sizes


def _check_supported(cage: CageModes, loads: Sequence[LoadVector]) -> None:
    if any(load.function.steady for load in loads):
        raise InputError(
            "time stepping does not support steady loads, because they have no start",
            key="steady",
            cure="Leave out steady; with damping, the motion becomes steady by itself.",
        )
    if cage.model.fittings.bodies is not None:
        raise InputError(
            "time stepping does not support rigid places, which can turn by small angles only",
            key="rigid",
            cure="Fix the place, hold it with a grip, which moves as a rigid body, or use "
            "[response]; stiffness_factors make a place that is free nearly rigid.",
        )
    if obstacles_of(cage.model) and any(load.moves_base is not None for load in loads):
        raise InputError(
            "time stepping does not support a moving base with obstacles: whether these move with "
            "it is not defined",
            key="base_displacement",
            cure="Move the obstacles instead, or use base_acceleration.",
        )
