"""Response of a cage's modes to loads: motion over time, energies and frequency response.

There is no time step: every result is a closed-form sum over modes (for the modal coordinates see
`spacemap_vtk.mechanics.response.modal_motion`). `Motion` is the interface that plots and pictures
use. Other models of a motion can implement it, including those that do step.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.time_functions import is_constant
from spacemap_vtk.mechanics.modal.cage_modes import CageModes, LoadVector, Statics
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.response.energy import Energy, EnergyAccount
from spacemap_vtk.mechanics.response.harmonic import receptance
from spacemap_vtk.mechanics.response.modal_motion import (
    ModalLoad,
    ModalMotion,
    ModalState,
    base_factors,
)
from spacemap_vtk.mechanics.response.oscillator import LOST
from spacemap_vtk.ndarrays import Floats, Ints

#: A warning is given if rounding is more than this share of a static shape.
ROUNDING = 1e-4
#: Value of h t after which a free vibration has decayed, to 1e-3.
_DECAYED = 7.0

#: Share of the movable mass that the kept modes should hold along a loaded axis.
ENOUGH = 0.9

#: Number of frequencies that are computed together; one at a time, Python's overhead dominates.
_BLOCK = 256


@runtime_checkable
class Motion(Protocol):
    """Motion of a cage: the displacements of its vertices or of a point, and energies."""

    points: Floats
    """Vertices at rest [m], (V, 3)."""
    cells: Ints
    """Tetrahedra, (T, 4) or (T, 10)."""

    def at_time(self, time: float) -> Floats:
        """Compute displacement, velocity and acceleration of vertices [m, m/s, m/s²], (3, V, 3)."""

    def history(self, weights: Floats, times: Floats) -> Floats:
        """Compute the same for a point, given by its vertex weights, at times [s], (3, t, 3)."""

    def energies(self, times: Floats) -> Floats:
        """Compute kinetic, strain and dissipated energy and external work [J], (t, 4)."""

    def potential(self, times: Floats) -> Floats:
        """Compute the potential energy of loads that never change [J], 0 at t = 0, (t,)."""


class Response(Motion):
    """Motion of a cage as a sum over its modes, at any time from t = 0 on.

    Parameters
    ----------
    modes : CageModes
        Modes of the cage.
    loads : sequence of LoadVector
        Loads, made by `CageModes.load_vector`.
    damping : Damping
        Damping of the modes.
    equilibrium : bool, optional
        Whether the cage is in equilibrium under the loads at t = 0; otherwise it starts from rest,
        undeformed.
    displacement, velocity : ndarray of float64, shape (V, 3), optional
        Added to the state at t = 0 [m, m/s], except on held components.
    residual : bool, optional
        Whether a residual vector for each load adds the part of its static response that the modes
        leave out.
    statics : callable, optional
        Solver of the static responses; by default the model.

    Raises
    ------
    InputError
        If there is no equilibrium because a rigid mode is loaded or rounding has destroyed the
        shape, or if there is no steady state.
    SolverError
        If no digit of a static response is correct.

    Notes
    -----
    Equations (16) to (20) of Furukawa, Kitagawa and Shimizu, with the corrections of `ModalMotion`.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.modal.eigen import lowest
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> from spacemap_vtk.mechanics.modal.model import Model
    >>> from spacemap_vtk.mechanics.boundary.time_functions import step
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> held = np.arange(4)[:, None] < [3, 3, 3]
    >>> model = Model(corners, [[0, 1, 2, 3]], isotropic(1e6, 0.0), 1000.0, held)
    >>> values, shapes, lost = lowest(model.pencil, 3)
    >>> values, shapes = values * model.modulus / model.density, shapes / model.density**0.5
    >>> modes = CageModes(model, values, shapes.reshape(3, -1), lost)
    >>> load = modes.load_vector("gravity", (0, 0, -10.0), step())
    >>> hung = Response(modes, [load], Damping(alpha=1.0), equilibrium=True)
    >>> hung.at_time(5.0)[0, 3].round(9).tolist()  # of the vertex that is free [m]
    [0.0, 0.0, -0.0025]
    """

    def __init__(
        self,
        modes: CageModes,
        loads: Sequence[LoadVector],
        damping: Damping,
        *,
        equilibrium: bool = False,
        displacement: Floats | None = None,
        velocity: Floats | None = None,
        residual: bool = True,
        statics: Statics | None = None,
    ) -> None:
        self.modes, self.loads, self.damping = modes, tuple(loads), damping
        self.points, self.cells = modes.model.points, modes.model.cells
        rest = modes.model.displacement
        #: Displacement of the equilibrium about which the cage moves [m], (V, 3).
        self.rest = np.zeros_like(self.points) if rest is None else rest
        lost = int((modes.eigenvalue_rounding > LOST).sum())
        if equilibrium and lost:
            raise InputError(
                f"the shape at rest cannot be computed: {lost} of the cage's modes are lost in "
                "rounding",
                key="initial",
                value="equilibrium",
                cure='Use a thicker cage, fewer divisions or more modes, or start from "rest".',
            )
        eigenvalues, self._shapes = modes.basis(self.loads, residual, statics)
        drives = [
            ModalLoad(self._shapes @ modes.vertex_forces(p), p.function, p.moves_base is not None)
            for p in self.loads
        ]
        #: Warnings about the accuracy, in sentences.
        self.warnings = _truncation_warnings(modes, self.loads, residual) + _rounding_warnings(
            modes, self.loads
        )
        self.warnings += [
            "a load acts only on fixed vertices and has no effect"
            for force in map(modes.vertex_forces, self.loads)
            if force.any()
            and abs(modes.model.pencil.remove_held(force[:, None])).max() < 1e-12 * abs(force).max()
        ]
        self.modal = ModalMotion(
            eigenvalues,
            damping.decay_rates(eigenvalues),
            drives,
            equilibrium=equilibrium,
            position=self._initial_coordinates(displacement, "displacement"),
            rate=self._initial_coordinates(velocity, "velocity"),
        )
        #: Forces on each mode that hold the equilibrium; their work is stored as strain energy.
        self._pull = self._shapes @ modes.model.forces
        self._last_states: tuple[Floats, list[ModalState]] | None = None

    def _initial_coordinates(self, field: Floats | None, what: str) -> Floats | None:
        """Convert a field to modal coordinates; warn if the modes miss much of it."""
        if field is None:
            return None
        moved = self.modes.model.pencil.remove_held(field.reshape(-1, 1))[:, 0]
        if not moved.any():
            return None
        inertia = self.modes.model.mass @ moved
        start: Floats = self._shapes @ inertia
        missed = 1.0 - float(start @ start) / float(moved @ inertia)
        if missed > 1.0 - ENOUGH:
            self.warnings.append(
                f"the modes leave out {missed:.0%} of the initial {what}; raise modal.modes"
            )
        return start

    @cached_property
    def _energy_account(self) -> EnergyAccount:
        return EnergyAccount(self.modal)

    def at_time(self, time: float, state: ModalState | None = None) -> Floats:
        """Compute the motion of the vertices; before 0 they rest in the initial state."""
        state = self.modal.at_time(time) if state is None else state
        return self._expand(state, self._shapes, self.rest, time)

    def count_lost_phases(self, time: float, state: ModalState) -> int:
        """Count the modes that still vibrate although rounding has destroyed their phase.

        Parameters
        ----------
        time : float
            Time [s].
        state : State
            Modal coordinates at that time.

        Returns
        -------
        int
            Number of these modes. Frequency and time have a limited number of digits, so after
            enough periods no digit of the phase is correct.
        """
        omega, lost, first = self._phases
        if time < first:
            return 0
        count = len(omega)
        with np.errstate(invalid="ignore", divide="ignore"):
            swing = np.hypot(state.rate[:count], state.acceleration[:count] / omega)
        wrong = (lost * time > 1.0) & (self.modal.half[:count] * time < _DECAYED)
        wrong &= swing > 0.01 * np.nanmax(swing, initial=0.0)
        return int(wrong.sum())

    @cached_property
    def _phases(self) -> tuple[Floats, Floats, float]:
        """Each mode's ω and growth of phase error [rad/s], and when the first phase is lost [s]."""
        omega = np.sqrt(self.modal.stiffness[: len(self.modes.eigenvalues)])
        lost = omega * (self.modes.eigenvalue_rounding / 2 + 2.0**-53)
        return omega, lost, 1.0 / max(float(lost.max(initial=0.0)), 1e-300)

    def energy(self, time: float, state: ModalState | None = None) -> Energy:
        """Compute the energies at a time [J], as `EnergyAccount.at_time` does.

        Parameters
        ----------
        time : float
            Time [s]; before 0 the initial state is held at rest.
        state : State, optional
            Modal coordinates at that time, if they are already known.

        Returns
        -------
        Energy
            Energies [J]. After many thousand periods, work and dissipated energy are NaN. Energy
            stored in the equilibrium counts as strain and as work.
        """
        state = self.modal.at_time(time) if state is None else state
        found = self._energy_account.at_time(time, state)
        hung = self.modes.model.strain_energy + float(self._pull @ state.position)
        return found._replace(strain=found.strain + hung, work=found.work + hung)

    def history(self, weights: Floats, times: Floats) -> Floats:
        """Compute the motion of a point over time."""
        shapes = self._shapes_at_point(weights)  # the point is a mesh of one vertex
        states = self._states(times)
        rest = (weights @ self.rest)[None]
        rows = [
            self._expand(now, shapes, rest, t)[:, 0] for t, now in zip(times, states, strict=True)
        ]
        return np.stack(rows, axis=1)

    def energies(self, times: Floats) -> Floats:
        """Compute the energies over time."""
        states = zip(times, self._states(times), strict=True)
        return np.array([self.energy(t, now) for t, now in states]).reshape(-1, 4)

    def potential(self, times: Floats) -> Floats:
        """Compute the potential energy over time of the loads that never change."""
        # In an equilibrium the weight is among them, though it is not a load of the modes.
        dead = self._pull.copy()
        for drive in self.modal.drives:
            if not drive.moves_base and is_constant(drive.function):
                dead += drive.gain * drive.function.value(0.0)
        start = self.modal.state(0.0)[0]
        positions = np.array([now.position for now in self._states(times)]).reshape(-1, len(start))
        result: Floats = -(positions - start) @ dead
        return result

    def _states(self, times: Floats) -> list[ModalState]:
        """Compute the states at given times, and keep them for other curves over the same times."""
        if self._last_states is None or not np.array_equal(self._last_states[0], times):
            self._last_states = times.copy(), [self.modal.at_time(t) for t in times]
        return self._last_states[1]

    def frequency_response(self, weights: Floats, frequencies: Floats) -> NDArray[np.complex128]:
        """Compute the frequency response of a point to the loads as sines, all in phase.

        Parameters
        ----------
        weights : ndarray of float64, shape (V,)
            Weights of the vertices in the point's displacement.
        frequencies : ndarray of float64, shape (f,)
            Frequencies of the sines [Hz], above 0. The amplitude of each is the load at factor 1.

        Returns
        -------
        ndarray of complex128, shape (f, 3)
            Displacement [m] as amplitude and phase, along x, y and z.

        Raises
        ------
        InputError
            If an undamped mode is excited at its natural frequency.
        """
        shapes = self._shapes_at_point(weights)
        result = np.zeros((len(frequencies), 3), dtype=np.complex128)
        for first in range(0, len(frequencies), _BLOCK):
            rows = slice(first, first + _BLOCK)
            omega = 2 * np.pi * np.asarray(frequencies)[rows, None]
            factors = receptance(self.modal.stiffness, self.modal.half, omega)
            for drive, load in zip(self.modal.drives, self.loads, strict=True):
                factor = omega**2 if drive.moves_base else 1.0
                result[rows] += (factors * drive.gain * factor) @ shapes
                if load.moves_base is not None:
                    result[rows] += load.moves_base * weights.sum()
        return result

    def _shapes_at_point(self, weights: Floats) -> Floats:
        shapes = self._shapes.reshape(len(self.modal.stiffness), -1, 3)
        return np.einsum("nvc,v->nc", shapes, weights)

    def _expand(self, state: ModalState, shapes: Floats, rest: Floats, time: float) -> Floats:
        fields: Floats = (np.array(state) @ shapes).reshape(3, -1, 3)
        fields[0] += rest
        for load in self.loads:
            if load.moves_base is not None:
                fields += np.outer(base_factors(load.function, time), load.moves_base)[:, None]
        return fields


def _truncation_warnings(
    modes: CageModes, loads: Sequence[LoadVector], residual: bool
) -> list[str]:
    """List warnings for loaded axes along which the modes hold too little of the mass."""
    if modes.is_complete:
        return []
    movable = modes.model.movable_mass
    # Along an axis in which nothing can move, no mass is missing.
    held = np.divide(modes.effective_masses.sum(axis=0), movable, out=np.ones(3), where=movable > 0)
    return [
        f"the {len(modes.eigenvalues)} modes contain {share:.0%} of the mass along {axis}, the "
        "direction of a load; raise modal.modes for accurate motion"
        + (" (the position at rest is exact)" if residual else "")
        for share, axis, loaded in zip(held, "xyz", modes.loaded_axes(loads), strict=True)
        if loaded and share < ENOUGH
    ]


def _rounding_warnings(modes: CageModes, loads: Sequence[LoadVector]) -> list[str]:
    if (share := modes.static_rounding(loads)) <= ROUNDING:
        return []
    digits = int(-np.log10(share))
    verb = "is" if digits == 1 else "are"
    return [
        f"about {digits} digit{'s' * (digits != 1)} of the shape at rest {verb} correct, because "
        "the cage is much softer in bending than in stretching; use fewer divisions, linear "
        "tetrahedra or a thicker cage"
    ]
