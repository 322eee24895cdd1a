"""Energy of a motion: kinetic, strain, dissipated, and supplied from outside.

The work of the loads, Σ ∫ w q̇ dt, has a closed form on each piece. For a linear load it needs ∫ q,
which follows from the kernel of a parabola. For a sine it needs H = ∫ e^{ps} q ds, p = iΩ, which
follows from the equation of motion: (p² - 2hp + λ) H = ∫ e^{ps} w - [e^{ps} (q̇ - p q + 2h q)].
"""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.boundary.time_functions import PiecewiseLinear
from spacemap_vtk.mechanics.response.harmonic import ComplexArray, response_from_rest
from spacemap_vtk.mechanics.response.modal_motion import ModalMotion, ModalState
from spacemap_vtk.mechanics.response.oscillator import compute_kernels
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks

#: If the factor of H is below this share of λ + Ω², cancellation has cost too many digits, and H is
#: integrated numerically.
RESONANT = 1e-4
#: Number of Gauss points on a panel of half a turn, where H is integrated numerically.
POINTS = 16
#: Largest number of pieces whose work is summed: some 30 s, and 100 MB with 50 modes.
MOST = 100_000
#: Number of spans times modes that are processed at once.
CHUNK = 200_000


class Energy(NamedTuple):
    """Energies at one time [J]; kinetic + strain + dissipated = work."""

    kinetic: float
    """Kinetic energy of the motion relative to the base."""
    strain: float
    """Energy stored as strain."""
    dissipated: float
    """Energy dissipated by damping since t = 0."""
    work: float
    """Energy supplied from outside: by loads, by jumps of the base, and by the initial state."""


class EnergyBalance(NamedTuple):
    """Energies over time [J], each (t,); their total is the same at all times."""

    kinetic: Floats
    strain: Floats
    potential: Floats
    """Potential energy of loads that never change, such as weight; 0 at t = 0."""
    dissipated: Floats
    """Energy dissipated by damping since t = 0."""
    work: Floats
    """Work since t = 0 of the loads that change with time or with the motion."""
    total: Floats
    """kinetic + strain + potential + dissipated - work, which is conserved."""


def balance_energies(energies: Floats, potential: Floats, work_at_start: float) -> EnergyBalance:
    """Compute the balance of energies over time, with a total that is conserved.

    Parameters
    ----------
    energies : ndarray of float64, shape (t, 4)
        Kinetic, strain and dissipated energy, and the work of all loads, see `Energy` [J].
    potential : ndarray of float64, shape (t,)
        Potential energy of the loads that never change [J], 0 at t = 0.
    work_at_start : float
        `Energy.work` at t = 0, which is the energy of the initial state [J].

    Returns
    -------
    Balance
        Energies, with the potential of constant loads and the work of all others.
    """
    kinetic, strain, dissipated, work = energies.T
    # The work of a constant load is the decrease of its potential.
    others = work + potential - work_at_start
    total = kinetic + strain + potential + dissipated - others
    return EnergyBalance(kinetic, strain, potential, dissipated, others, total)


class EnergyAccount:
    """Energies of a motion of mass-normalised modes, at any time."""

    # The work up to the start of each piece is kept. A late time that is evaluated again therefore
    # costs no more than an early one.

    def __init__(self, motion: ModalMotion) -> None:
        self._motion = motion
        first = motion.state(0.0)
        #: For each start of a piece: time, state, and work done until then.
        self._marks, self._states = [0.0], [first]
        self._works = [float(_stored_energy(motion, first))]
        #: Piece that was evaluated last: its number, its load at the start, and the load's slope.
        self._last: tuple[int, Floats, Floats] | None = None
        self._lossless = not motion.half.any()
        functions = [drive.function for drive in motion.drives]
        #: Number of pieces that start per second.
        self._rate = sum(
            len(function.times) / function.period
            for function in functions
            if isinstance(function, PiecewiseLinear) and function.period is not None
        )

    def at_time(self, time: float, state: ModalState | None = None) -> Energy:
        """Compute the energies at a time; before 0, those of the initial state, held at rest."""
        state = self._motion.at_time(time) if state is None else state
        kinetic = 0.5 * float(state.rate @ state.rate)
        strain = 0.5 * float(self._motion.stiffness @ state.position**2)
        if time < 0.0:
            return Energy(kinetic, strain, 0.0, kinetic + strain)
        if time * self._rate > MOST:  # too many pieces to sum: work and loss are unknown
            return Energy(kinetic, strain, math.nan, math.nan)
        self._sum_work_until(time)
        k = bisect_right(self._marks, time) - 1
        work = self._works[k]
        if time > self._marks[k]:
            begin, end = np.array([self._marks[k]]), np.array([time])
            if self._last is None or self._last[0] != k:
                self._last = k, *self._load(begin)
            now = np.array([state[:2]])
            work += float(self._work(begin, end, self._states[k][None], now, *self._last[1:])[0])
        # The balance is exact, so energy that is missing was dissipated.
        lost = 0.0 if self._lossless else max(0.0, work - kinetic - strain)
        return Energy(kinetic, strain, lost, work)

    def _sum_work_until(self, time: float) -> None:
        """Sum the work of all pieces up to the last one that starts before or at a time."""
        motion, last = self._motion, self._marks[-1]
        found = [
            start
            for drive in motion.drives
            if isinstance(drive.function, PiecewiseLinear)
            for start in _piece_starts(drive.function, last, time)
        ]
        found.sort()
        # If starts differ only by rounding, the last is kept: all jumps have happened by then.
        starts = [
            start
            for start, following in pairwise([*found, math.inf])
            if following - start > 1e-15 * start and start - last > 1e-15 * start
        ]
        size = max(1, CHUNK // len(motion.stiffness))
        for part in blocks(len(starts), size):
            ends = np.array(starts[part])
            after = np.stack([motion.state(float(end)) for end in ends])
            before = after
            if any(drive.moves_base for drive in motion.drives):
                before = after - np.stack([motion.jump(float(end)) for end in ends])
            begins = np.array([self._marks[-1], *ends[:-1]])
            states = np.concatenate([self._states[-1][None], after[:-1]])
            gained = self._work(begins, ends, states, before, *self._load(begins))
            # A jump of the base does work in an instant.
            gained = gained + _stored_energy(motion, after) - _stored_energy(motion, before)
            self._works += list(self._works[-1] + gained.cumsum())
            self._marks += ends.tolist()
            self._states += list(after)

    def _load(self, begins: Floats) -> tuple[Floats, Floats]:
        """Compute the piecewise linear load and its slope at the beginning of spans, (p, n)."""
        shape = len(begins), len(self._motion.stiffness)
        load, slope = np.zeros(shape), np.zeros(shape)
        for drive in self._motion.drives:
            function = drive.function
            if isinstance(function, PiecewiseLinear) and not drive.moves_base:
                load += np.array([[function.value(t)] for t in begins]) * drive.gain
                slope += np.array([[function.slope(t)] for t in begins]) * drive.gain
        return load, slope

    def _work(
        self,
        begins: Floats,
        ends: Floats,
        firsts: Floats,
        lasts: Floats,
        load: Floats,
        slope: Floats,
    ) -> Floats:
        """Compute the work of the loads over spans in which no piece starts, (p,)."""
        # `lasts`, (p, 2, n), are the states just before any jump at the ends of the spans.
        motion = self._motion
        spans = (ends - begins)[:, None]
        sines = [
            (phasor * np.exp(1j * sine.omega * begins)[:, None], sine.omega)
            for phasor, sine in motion.sines
        ]
        work = load * (lasts[:, 0] - firsts[:, 0])
        motions = _Spans(motion, spans, firsts, lasts, load, slope, sines)
        if slope.any():
            work += slope * (spans * lasts[:, 0] - motions.integral())
        for phasor, omega in sines:
            at_end = (phasor * np.exp(1j * omega * spans)).imag
            integral = (phasor * (1j * omega) * motions.transform(omega)).imag
            work += at_end * lasts[:, 0] - phasor.imag * firsts[:, 0] - integral
        return np.asarray(work.sum(axis=1))


class _Spans(NamedTuple):
    """Motions between given states, each under a linear load and sines."""

    motion: ModalMotion
    spans: Floats
    """(p, 1), lengths in time."""
    firsts: Floats
    lasts: Floats
    """(p, 2, n), also for `firsts`."""
    load: Floats
    slope: Floats
    """(p, n), also for `load`."""
    sines: list[tuple[ComplexArray, float]]
    """Phasors (p, n), and Ω."""

    def integral(self) -> Floats:
        """Integrate q over each span."""
        stiffness, half = self.motion.stiffness, self.motion.half
        kernel = compute_kernels(stiffness, half, self.spans)
        q, rate = self.firsts[:, 0], self.firsts[:, 1]
        # The integral of the free response C = 1 - λ S₂ is t - λ S₃.
        total = q * (self.spans - stiffness * kernel.ramp) + rate * kernel.step
        total = total + self.load * kernel.ramp + self.slope * kernel.parabola
        for phasor, omega in self.sines:
            forced = response_from_rest(stiffness, half, omega, self.spans)
            total = total + (phasor * (forced.value - kernel.step) / (1j * omega)).imag
        return total

    def transform(self, omega: float) -> ComplexArray:
        """Compute H = ∫ e^{ps} q ds, p = iΩ."""
        motion, spans, p = self.motion, self.spans, 1j * omega
        twice = 2 * motion.half
        factor = p * p - twice * p + motion.stiffness
        turn = np.exp(p * spans)
        right = self.load * ((turn - 1) / p) + self.slope * ((spans * turn - (turn - 1) / p) / p)
        for phasor, other in self.sines:
            # Im(c e^{iωs}) = (c e^{iωs} - c* e^{-iωs}) / 2i
            plus, minus = (
                _integrate_oscillation(omega + other, spans),
                _integrate_oscillation(omega - other, spans),
            )
            right = right + (phasor * plus - phasor.conj() * minus) / 2j
        (q0, v0), (q1, v1) = self.firsts.swapaxes(0, 1), self.lasts.swapaxes(0, 1)
        ends = turn * (v1 - p * q1 + twice * q1) - (v0 - p * q0 + twice * q0)
        near = abs(factor) < RESONANT * (motion.stiffness + omega**2)
        result: ComplexArray = (right - ends) / np.where(near, 1.0, factor)
        if near.any():
            for row in range(len(spans)):
                result[row, near] = self._integrate_numerically(omega, near, row)
        return result

    def _integrate_numerically(self, omega: float, modes: np.ndarray, row: int) -> ComplexArray:
        """Integrate e^{ps} q numerically for modes driven near resonance with little damping."""
        stiffness, half = self.motion.stiffness[modes], self.motion.half[modes]
        span = float(self.spans[row, 0])
        fastest = max(omega, *(other for _, other in self.sines))
        panels = 1 + math.ceil(2 * fastest * span / math.pi)
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        width = span / panels
        times = (width * (np.arange(panels)[:, None] + (nodes + 1) / 2)).reshape(-1, 1)
        kernel = compute_kernels(stiffness, half, times)
        q, rate = self.firsts[row][:, modes]
        motion = q * kernel.free + rate * kernel.impulse
        motion = motion + self.load[row, modes] * kernel.step
        motion = motion + self.slope[row, modes] * kernel.ramp
        for phasor, other in self.sines:
            forced = response_from_rest(stiffness, half, other, times)
            motion = motion + (phasor[row, modes] * forced.value).imag
        weighted = np.tile(weights * width / 2, panels)[:, None] * np.exp(1j * omega * times)
        return np.asarray((weighted * motion).sum(axis=0))


def _integrate_oscillation(omega: float, spans: Floats) -> ComplexArray:
    """Integrate e^{iωs} over spans that start at s = 0."""
    turned: ComplexArray = np.exp(0.5j * omega * spans) * np.sinc(omega * spans / (2 * math.pi))
    return spans * turned


def _stored_energy(motion: ModalMotion, states: Floats) -> Floats:
    """Compute kinetic plus strain energy of states (…, 2, n)."""
    q, rate = states[..., 0, :], states[..., 1, :]
    return np.asarray(0.5 * (rate**2 + motion.stiffness * q**2).sum(axis=-1))


def _piece_starts(function: PiecewiseLinear, after: float, until: float) -> list[float]:
    """List the times in (after, until] at which a piece starts."""
    period = function.period
    if period is None:
        return [float(t) for t in function.times if after < t <= until]
    counts = range(math.floor(after / period), math.floor(until / period) + 1)
    starts = [count * period + float(t) for count in counts for t in function.times]
    return [t for t in starts if after < t <= until]
