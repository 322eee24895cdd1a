"""Where the energy of a motion is: kinetic, strain, dissipated, and put in from outside.

The work of the loads, Σ ∫ w q̇ dt, has a closed form on each piece. For a linear load it needs ∫ q,
which the kernel of a parabola gives. For a sine it needs H = ∫ e^{ps} q ds, p = iΩ, which follows
from the equation of motion itself: (p² - 2hp + λ) H = ∫ e^{ps} w - [e^{ps} (q̇ - p q + 2h q)].
"""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.harmonic import ComplexArray, from_rest
from spacemap_vtk.mechanics.motion import ModalMotion, State
from spacemap_vtk.mechanics.oscillator import kernels
from spacemap_vtk.mechanics.timefunctions import Pieces
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks

#: Below this share of λ + Ω² the factor of H has lost too many digits, and H is integrated.
RESONANT = 1e-4
#: Points of Gauss's rule on a panel of half a turn, where H is integrated.
POINTS = 16
#: Starts of pieces that work is added up over: some 30 s, and 100 MB with 50 modes.
MOST = 100_000
#: Numbers of spans times modes that are worked on at once.
CHUNK = 200_000


class Energy(NamedTuple):
    """Energies at one time [J]; kinetic + strain + dissipated = work."""

    kinetic: float
    """Of the motion relative to the base."""
    strain: float
    """Stored in the springs."""
    dissipated: float
    """Lost in the dampers since t = 0."""
    work: float
    """Put in from outside: by the loads, by a base that jumps, and by whoever made the start."""


class Balance(NamedTuple):
    """Energies over time [J], each (t,); their total is the same at all times."""

    kinetic: Floats
    strain: Floats
    potential: Floats
    """Of the loads that never change (weight, for example); 0 at t = 0."""
    dissipated: Floats
    """Lost in the dampers since t = 0."""
    work: Floats
    """Done since t = 0 by the loads that change with time or with the motion."""
    total: Floats
    """kinetic + strain + potential + dissipated - work, which is conserved."""


def balance(energies: Floats, potential: Floats, work_at_start: float) -> Balance:
    """Return the balance of energies over time, with a total that is conserved.

    Parameters
    ----------
    energies : ndarray of float64, shape (t, 4)
        Kinetic, strain and dissipated energy, and the work of all loads, see `Energy` [J].
    potential : ndarray of float64, shape (t,)
        Of the loads that never change [J], 0 at t = 0.
    work_at_start : float
        What `Energy.work` is at t = 0: the energy of the initial state [J].

    Returns
    -------
    Balance
        With the work of the loads that have no potential apart.
    """
    kinetic, strain, dissipated, work = energies.T
    # A load that never changes does the work that its potential loses.
    others = work + potential - work_at_start
    total = kinetic + strain + potential + dissipated - others
    return Balance(kinetic, strain, potential, dissipated, others, total)


class Account:
    """Energies of a motion of mass-normalised modes, at any time."""

    # The work up to the start of each piece is kept, so that later times cost no more than earlier
    # ones when they are visited again.

    def __init__(self, motion: ModalMotion) -> None:
        self._motion = motion
        first = motion.state(0.0)
        #: Of each start of a piece: time, state and the work done until then.
        self._marks, self._states = [0.0], [first]
        self._works = [float(_stored(motion, first))]
        #: The piece that was asked for last, its load at its start, and the slope.
        self._last: tuple[int, Floats, Floats] | None = None
        self._lossless = not motion.half.any()
        functions = [drive.function for drive in motion.drives]
        #: Pieces that start in a second.
        self._rate = sum(
            len(function.times) / function.period
            for function in functions
            if isinstance(function, Pieces) and function.period is not None
        )

    def at(self, time: float, state: State | None = None) -> Energy:
        """Return the energies at a time; before 0 those of the initial state, held at rest."""
        state = self._motion.at(time) if state is None else state
        kinetic = 0.5 * float(state.rate @ state.rate)
        strain = 0.5 * float(self._motion.stiffness @ state.position**2)
        if time < 0.0:
            return Energy(kinetic, strain, 0.0, kinetic + strain)
        if time * self._rate > MOST:  # too many to add up: work and loss are unknown
            return Energy(kinetic, strain, math.nan, math.nan)
        self._reach(time)
        k = bisect_right(self._marks, time) - 1
        work = self._works[k]
        if time > self._marks[k]:
            begin, end = np.array([self._marks[k]]), np.array([time])
            if self._last is None or self._last[0] != k:
                self._last = k, *self._load(begin)
            now = np.array([state[:2]])
            work += float(self._work(begin, end, self._states[k][None], now, *self._last[1:])[0])
        # The balance is exact, so what is not there any more was lost.
        lost = 0.0 if self._lossless else max(0.0, work - kinetic - strain)
        return Energy(kinetic, strain, lost, work)

    def _reach(self, time: float) -> None:
        """Add up the work until the last start of a piece up to a time."""
        motion, last = self._motion, self._marks[-1]
        found = [
            start
            for drive in motion.drives
            if isinstance(drive.function, Pieces)
            for start in _starts(drive.function, last, time)
        ]
        found.sort()
        # Of starts that differ by rounding the last: all that jumps there has jumped then.
        starts = [
            start
            for start, following in pairwise([*found, math.inf])
            if following - start > 1e-15 * start and start - last > 1e-15 * start
        ]
        size = max(1, CHUNK // len(motion.stiffness))
        for some in blocks(len(starts), size):
            ends = np.array(starts[some])
            after = np.stack([motion.state(float(end)) for end in ends])
            before = after
            if any(drive.moves_base for drive in motion.drives):
                before = after - np.stack([motion.jump(float(end)) for end in ends])
            begins = np.array([self._marks[-1], *ends[:-1]])
            states = np.concatenate([self._states[-1][None], after[:-1]])
            gained = self._work(begins, ends, states, before, *self._load(begins))
            # A base that jumps does work at once.
            gained = gained + _stored(motion, after) - _stored(motion, before)
            self._works += list(self._works[-1] + gained.cumsum())
            self._marks += ends.tolist()
            self._states += list(after)

    def _load(self, begins: Floats) -> tuple[Floats, Floats]:
        """Return the piecewise linear load, and its slope, where spans begin, (p, n)."""
        shape = len(begins), len(self._motion.stiffness)
        load, slope = np.zeros(shape), np.zeros(shape)
        for drive in self._motion.drives:
            function = drive.function
            if isinstance(function, Pieces) and not drive.moves_base:
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
        """Return the work of the loads over spans in which no piece starts, (p,)."""
        # The states at their ends, (p, 2, n), are those before a jump that happens there.
        motion = self._motion
        spans = (ends - begins)[:, None]
        sines = [
            (phasor * np.exp(1j * sine.omega * begins)[:, None], sine.omega)
            for phasor, sine in motion.sines
        ]
        work = load * (lasts[:, 0] - firsts[:, 0])
        spells = _Spells(motion, spans, firsts, lasts, load, slope, sines)
        if slope.any():
            work += slope * (spans * lasts[:, 0] - spells.integral())
        for phasor, omega in sines:
            at_end = (phasor * np.exp(1j * omega * spans)).imag
            whole = (phasor * (1j * omega) * spells.transform(omega)).imag
            work += at_end * lasts[:, 0] - phasor.imag * firsts[:, 0] - whole
        return np.asarray(work.sum(axis=1))


class _Spells(NamedTuple):
    """Motions from given states to given states, each under a linear load and sines."""

    motion: ModalMotion
    spans: Floats
    """(p, 1)."""
    firsts: Floats
    lasts: Floats
    """(p, 2, n)."""
    load: Floats
    slope: Floats
    """(p, n)."""
    sines: list[tuple[ComplexArray, float]]
    """Phasors (p, n), and Ω."""

    def integral(self) -> Floats:
        """Return ∫ q."""
        stiffness, half = self.motion.stiffness, self.motion.half
        kernel = kernels(stiffness, half, self.spans)
        q, rate = self.firsts[:, 0], self.firsts[:, 1]
        # The integral of the free response C = 1 - λ S₂ is t - λ S₃.
        total = q * (self.spans - stiffness * kernel.ramp) + rate * kernel.step
        total = total + self.load * kernel.ramp + self.slope * kernel.parabola
        for phasor, omega in self.sines:
            forced = from_rest(stiffness, half, omega, self.spans)
            total = total + (phasor * (forced.value - kernel.step) / (1j * omega)).imag
        return total

    def transform(self, omega: float) -> ComplexArray:
        """Return ∫ e^{ps} q ds, p = iΩ."""
        motion, spans, p = self.motion, self.spans, 1j * omega
        twice = 2 * motion.half
        factor = p * p - twice * p + motion.stiffness
        turn = np.exp(p * spans)
        right = self.load * ((turn - 1) / p) + self.slope * ((spans * turn - (turn - 1) / p) / p)
        for phasor, other in self.sines:
            # Im(c e^{iωs}) = (c e^{iωs} - c* e^{-iωs}) / 2i
            plus, minus = _turned(omega + other, spans), _turned(omega - other, spans)
            right = right + (phasor * plus - phasor.conj() * minus) / 2j
        (q0, v0), (q1, v1) = self.firsts.swapaxes(0, 1), self.lasts.swapaxes(0, 1)
        ends = turn * (v1 - p * q1 + twice * q1) - (v0 - p * q0 + twice * q0)
        near = abs(factor) < RESONANT * (motion.stiffness + omega**2)
        result: ComplexArray = (right - ends) / np.where(near, 1.0, factor)
        if near.any():
            for row in range(len(spans)):
                result[row, near] = self._integrated(omega, near, row)
        return result

    def _integrated(self, omega: float, modes: np.ndarray, row: int) -> ComplexArray:
        """Return ∫ e^{ps} q ds of modes that are driven at their own frequency, hardly damped."""
        stiffness, half = self.motion.stiffness[modes], self.motion.half[modes]
        span = float(self.spans[row, 0])
        fastest = max(omega, *(other for _, other in self.sines))
        panels = 1 + math.ceil(2 * fastest * span / math.pi)
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        width = span / panels
        times = (width * (np.arange(panels)[:, None] + (nodes + 1) / 2)).reshape(-1, 1)
        kernel = kernels(stiffness, half, times)
        q, rate = self.firsts[row][:, modes]
        motion = q * kernel.free + rate * kernel.impulse
        motion = motion + self.load[row, modes] * kernel.step
        motion = motion + self.slope[row, modes] * kernel.ramp
        for phasor, other in self.sines:
            forced = from_rest(stiffness, half, other, times)
            motion = motion + (phasor[row, modes] * forced.value).imag
        weighted = np.tile(weights * width / 2, panels)[:, None] * np.exp(1j * omega * times)
        return np.asarray((weighted * motion).sum(axis=0))


def _turned(omega: float, spans: Floats) -> ComplexArray:
    """Return ∫ e^{iωs} ds."""
    turned: ComplexArray = np.exp(0.5j * omega * spans) * np.sinc(omega * spans / (2 * math.pi))
    return spans * turned


def _stored(motion: ModalMotion, states: Floats) -> Floats:
    """Return kinetic and strain energy of states (…, 2, n)."""
    q, rate = states[..., 0, :], states[..., 1, :]
    return np.asarray(0.5 * (rate**2 + motion.stiffness * q**2).sum(axis=-1))


def _starts(function: Pieces, after: float, until: float) -> list[float]:
    """Return the times where a piece starts, after one time and up to another."""
    period = function.period
    if period is None:
        return [float(t) for t in function.times if after < t <= until]
    counts = range(math.floor(after / period), math.floor(until / period) + 1)
    starts = [count * period + float(t) for count in counts for t in function.times]
    return [t for t in starts if after < t <= until]
