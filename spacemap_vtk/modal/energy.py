"""Where the energy of a motion is: kinetic, strain, dissipated, and put in from outside.

The work of the loads, Σ ∫ w q̇ dt, has a closed form on each piece. For a linear load it needs ∫ q,
which the kernel of a parabola gives. For a sine it needs H = ∫ e^{ps} q ds, p = iΩ, which follows
from the equation of motion itself: (p² - 2hp + λ) H = ∫ e^{ps} w - [e^{ps} (q̇ - p q + 2h q)].
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spacemap_vtk.modal.harmonic import ComplexArray, from_rest
from spacemap_vtk.modal.motion import Motion, State
from spacemap_vtk.modal.oscillator import FloatArray, kernels
from spacemap_vtk.modal.timefunctions import Pieces

#: Below this share of λ + Ω² the factor of H has lost too many digits, and H is integrated.
RESONANT = 1e-4
#: Points of Gauss's rule on a panel of half a turn, where H is integrated.
POINTS = 16


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


class Account:
    """Energies of a motion at any time.

    The work up to the start of each piece is kept, so that later times cost no more than earlier
    ones when they are visited again.

    Parameters
    ----------
    motion : Motion
        Of mass-normalised modes.
    """

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        first = np.stack(motion.at(0.0)[:2])
        #: Of each start of a piece: time, state and the work done until then.
        self._marks, self._states = [0.0], [first]
        self._works = [_stored(motion, first)]
        self._lossless = not motion.half.any()

    def at(self, time: float, state: State | None = None) -> Energy:
        """Return the energies at a time.

        Parameters
        ----------
        time : float
            In s; those at 0 hold before it.
        state : State, optional
            Of the motion at that time, where it is known already.

        Returns
        -------
        Energy
            In J.
        """
        time = max(time, 0.0)
        self._reach(time)
        k = int(np.searchsorted(self._marks, time, side="right")) - 1
        state = self._motion.at(time) if state is None else state
        work = self._works[k] + self._work(k, time, np.stack(state[:2]))
        kinetic = 0.5 * float(state.rate @ state.rate)
        strain = 0.5 * float(self._motion.stiffness @ state.position**2)
        # The balance is exact, so what is not there any more was lost.
        lost = 0.0 if self._lossless else max(0.0, work - kinetic - strain)
        return Energy(kinetic, strain, lost, work)

    def _reach(self, time: float) -> None:
        """Add up the work until the last start of a piece up to a time."""
        last = self._marks[-1]
        starts = [
            start
            for drive in self._motion.drives
            if isinstance(drive.function, Pieces)
            for start in _starts(drive.function, last, time)
        ]
        starts.sort()
        for start, following in pairwise([*starts, math.inf]):
            # Of starts that differ by rounding the last: all that jumps there has jumped then.
            if following - start <= 1e-15 * start or start - self._marks[-1] <= 1e-15 * start:
                continue
            now = np.stack(self._motion.at(start)[:2])
            before = now - self._motion.jump(start)
            work = self._works[-1] + self._work(len(self._marks) - 1, start, before)
            self._works.append(work + _stored(self._motion, now) - _stored(self._motion, before))
            self._marks.append(start)
            self._states.append(now)

    def _work(self, k: int, end: float, last: FloatArray) -> float:
        """Return the work of the loads from the start of piece k until a time within it."""
        motion, begin, first = self._motion, self._marks[k], self._states[k]
        span = end - begin
        if span <= 0.0:
            return 0.0
        zero = np.zeros(len(motion.stiffness))
        load, slope = zero, zero
        for drive in motion.drives:
            if isinstance(drive.function, Pieces) and not drive.moves_base:
                load = load + drive.gain * drive.function.value(begin)
                slope = slope + drive.gain * drive.function.slope(begin)
        total = (load + slope * span) @ last[0] - load @ first[0]
        sines = [(phasor * np.exp(1j * s.omega * begin), s.omega) for phasor, s in motion.sines]
        piece = _Piece(motion, span, first, load, slope, sines)
        if slope.any():
            total -= slope @ piece.integral()
        for phasor, omega in sines:
            at_end = (phasor * np.exp(1j * omega * span)).imag
            whole = (phasor * (1j * omega) * piece.transform(omega, last)).imag
            total += at_end @ last[0] - phasor.imag @ first[0] - whole.sum()
        return float(total)


class _Piece(NamedTuple):
    """A motion from a state under a linear load and sines."""

    motion: Motion
    span: float
    state: FloatArray
    load: FloatArray
    slope: FloatArray
    sines: list[tuple[ComplexArray, float]]

    def integral(self) -> FloatArray:
        """Return ∫ q."""
        kernel = kernels(self.motion.stiffness, self.motion.half, self.span)
        q, rate = self.state
        # The integral of the free response C = 1 - λ S₂ is t - λ S₃.
        total = q * (self.span - self.motion.stiffness * kernel.ramp) + rate * kernel.step
        total = total + self.load * kernel.ramp + self.slope * kernel.parabola
        for phasor, omega in self.sines:
            forced = from_rest(self.motion.stiffness, self.motion.half, omega, self.span)
            total = total + (phasor * (forced.value - kernel.step) / (1j * omega)).imag
        return total

    def transform(self, omega: float, last: FloatArray) -> ComplexArray:
        """Return ∫ e^{ps} q ds, p = iΩ."""
        motion, span, p = self.motion, self.span, 1j * omega
        twice = 2 * motion.half
        factor = p * p - twice * p + motion.stiffness
        turn = np.exp(p * span)
        right = self.load * ((turn - 1) / p) + self.slope * ((span * turn - (turn - 1) / p) / p)
        for phasor, other in self.sines:
            # Im(c e^{iωs}) = (c e^{iωs} - c* e^{-iωs}) / 2i
            plus, minus = _turned(omega + other, span), _turned(omega - other, span)
            right = right + (phasor * plus - phasor.conj() * minus) / 2j
        (q0, v0), (q1, v1) = self.state, last
        ends = turn * (v1 - p * q1 + twice * q1) - (v0 - p * q0 + twice * q0)
        near = abs(factor) < RESONANT * (motion.stiffness + omega**2)
        result: ComplexArray = (right - ends) / np.where(near, 1.0, factor)
        if near.any():
            result[near] = self._integrated(omega, near)
        return result

    def _integrated(self, omega: float, modes: np.ndarray) -> ComplexArray:
        """Return ∫ e^{ps} q ds of modes that are driven at their own frequency, hardly damped."""
        stiffness, half = self.motion.stiffness[modes], self.motion.half[modes]
        fastest = max(omega, *(other for _, other in self.sines))
        panels = 1 + math.ceil(2 * fastest * self.span / math.pi)
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        width = self.span / panels
        times = (width * (np.arange(panels)[:, None] + (nodes + 1) / 2)).reshape(-1, 1)
        kernel = kernels(stiffness, half, times)
        q, rate = self.state[:, modes]
        motion = q * kernel.free + rate * kernel.impulse
        motion = motion + self.load[modes] * kernel.step + self.slope[modes] * kernel.ramp
        for phasor, other in self.sines:
            forced = from_rest(stiffness, half, other, times)
            motion = motion + (phasor[modes] * forced.value).imag
        weighted = np.tile(weights * width / 2, panels)[:, None] * np.exp(1j * omega * times)
        return np.asarray((weighted * motion).sum(axis=0))


def _turned(omega: float, span: float) -> complex:
    """Return ∫ e^{iωs} ds."""
    return span * np.exp(0.5j * omega * span) * np.sinc(omega * span / (2 * math.pi))


def _stored(motion: Motion, state: FloatArray) -> float:
    q, rate = state
    return 0.5 * float(rate @ rate + motion.stiffness @ q**2)


def _starts(function: Pieces, after: float, until: float) -> list[float]:
    """Return the times where a piece starts, after one time and up to another."""
    period = function.period
    if period is None:
        return [float(t) for t in function.times if after < t <= until]
    counts = range(math.floor(after / period), math.floor(until / period) + 1)
    starts = [count * period + float(t) for count in counts for t in function.times]
    return [t for t in starts if after < t <= until]
