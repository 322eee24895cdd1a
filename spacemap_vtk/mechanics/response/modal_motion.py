"""Exact motion of vibration modes under loads, each of which has its time function.

The motion is linear in the loads, so each kind of time function has its method: all piecewise
linear functions together (`Linear`), each periodic one (`Repeated`), and each sine. There is no
time step; only states at the times where a piece starts are kept.

With a moving base the coordinates are relative to it: q̈ + 2h q̇ + λ q = -Γ d̈(t). Where d is
linear, no force acts. Where d or its slope jumps, the state jumps by the effect of an impulse and
its derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.time_functions import PiecewiseLinear, Sine, TimeFunction
from spacemap_vtk.mechanics.response.harmonic import receptance, response_from_rest
from spacemap_vtk.mechanics.response.periodic import PeriodicMotion, PiecewiseLinearMotion
from spacemap_vtk.ndarrays import Floats

#: Latest time [s]. Its third power, which occurs under a load that rises for ever, is still finite.
LATEST = 1e100
#: A force on a rigid mode below this share of the largest modal force is rounding.
BALANCED = 1e-10


class ModalLoad(NamedTuple):
    """Load on the modes, with its time function."""

    gain: Floats
    """(n,), load on each mode for a factor of one: Sᵀf; for a moving base, Γ = Sᵀ M r times the
    displacement."""
    function: TimeFunction
    """Factor over time."""
    moves_base: bool = False
    """Whether the factor is the displacement of the base."""


class ModalState(NamedTuple):
    """Modal coordinates and their two derivatives at one time, each of shape (n,)."""

    position: Floats
    """q."""
    rate: Floats
    """q̇ [1/s]."""
    acceleration: Floats
    """q̈ [1/s²]."""


class ModalMotion:
    """Motion of modes from an initial state and under loads, at any time from t = 0 on."""

    def __init__(
        self,
        stiffness: Floats,
        half: Floats,
        drives: Sequence[ModalLoad] = (),
        *,
        equilibrium: bool = False,
        position: Floats | None = None,
        rate: Floats | None = None,
    ) -> None:
        self.stiffness, self.half, self.drives = stiffness, half, tuple(drives)
        #: State before t = 0, without steady responses.
        self.start = np.zeros((2, len(stiffness)))
        if equilibrium:
            self.start[0] = self._static_position()
        if position is not None:
            self.start[0] += position
        if rate is not None:
            self.start[1] += rate
        self._held = equilibrium
        linear = [
            (drive, drive.function)
            for drive in self.drives
            if isinstance(drive.function, PiecewiseLinear) and drive.function.period is None
        ]
        self._linear = self._make_linear(linear)
        self.repeated = [
            self._make_periodic(drive, drive.function)
            for drive in self.drives
            if isinstance(drive.function, PiecewiseLinear) and drive.function.period is not None
        ]
        self.sines = [
            (self._phasor(drive, drive.function), drive.function)
            for drive in self.drives
            if isinstance(drive.function, Sine)
        ]

    def at_time(self, time: float) -> ModalState:
        """Compute the motion at a time, after any jump at that time; at rest before 0."""
        if not abs(time) <= LATEST:
            allowed = f"a finite number of seconds, up to {LATEST:g}"
            raise InputError("not a time", key="time", value=time, allowed=allowed)
        q, rate = self.state(max(time, 0.0))
        if time < 0.0:  # the displacement is constant there
            return ModalState(q, np.zeros_like(q), np.zeros_like(q))
        acceleration = self.load(time) - 2 * self.half * rate - self.stiffness * q
        return ModalState(q, rate, acceleration)

    def state(self, time: float) -> Floats:
        """Compute positions and rates at a time, after any jump at that time."""
        state = self._linear.at_time(time)
        for repeated in self.repeated:
            state = state + repeated.at_time(time)
        for phasor, sine in self.sines:
            if sine.steady:
                forced = phasor * receptance(self.stiffness, self.half, sine.omega)
                forced = forced * np.exp(1j * sine.omega * time)
                state = state + np.stack([forced.imag, (1j * sine.omega * forced).imag])
            else:
                rested = response_from_rest(self.stiffness, self.half, sine.omega, time)
                state = state + np.stack(
                    [(phasor * rested.value).imag, (phasor * rested.rate).imag]
                )
        return state

    def load(self, time: float) -> Floats:
        """Compute the load on each mode at a time."""
        total = np.zeros(len(self.stiffness))
        for drive in self.drives:
            function = drive.function
            if not drive.moves_base:
                total = total + drive.gain * function.value(time)
            elif isinstance(function, Sine):
                total = total + drive.gain * (function.omega**2 * function.value(time))
        return total

    def jump(self, time: float) -> Floats:
        """Compute the jump of the state at a time."""
        total = np.zeros((2, len(self.stiffness)))
        for drive in self.drives:
            if drive.moves_base:
                total += self._jump(drive, *jump_of(drive.function, time, self._held))
        return total

    def _jump(self, drive: ModalLoad, value: float, slope: float) -> Floats:
        """Compute the jump of the state due to -Γ d̈ where d jumps by `value` and ḋ by `slope`."""
        q = -drive.gain * value
        return np.stack([q, -drive.gain * slope - 2 * self.half * q])

    def _static_position(self) -> Floats:
        load = np.zeros(len(self.stiffness))
        size = np.zeros(len(self.stiffness))
        for drive in self.drives:
            if not drive.moves_base and not drive.function.steady:
                part = drive.gain * drive.function.value(0.0)
                load, size = load + part, size + abs(part)
        rigid = self.stiffness == 0.0
        falling = rigid & (abs(load) > BALANCED * size.max(initial=0.0))
        if falling.any():
            raise InputError(
                f"there is no equilibrium: {falling.sum()} rigid modes are free to fall",
                key="initial",
                value="equilibrium",
                cure='Fix the cage ([modal] fixed = "+y"), or start from "rest".',
            )
        return np.divide(load, self.stiffness, out=np.zeros_like(load), where=~rigid)

    def _make_linear(
        self, parts: Sequence[tuple[ModalLoad, PiecewiseLinear]]
    ) -> PiecewiseLinearMotion:
        times = np.sort(np.concatenate([[0.0], *(f.times for _, f in parts)]))
        times = times[np.diff(times, prepend=-np.inf) > 0.0]
        pushing = [(d, f) for d, f in parts if not d.moves_base]
        shape = len(times), len(pushing)
        values = np.reshape([[f.value(t) for _, f in pushing] for t in times], shape)
        slopes = np.reshape([[f.slope(t) for _, f in pushing] for t in times], shape)
        gains = np.reshape([d.gain for d, _ in pushing], (len(pushing), len(self.stiffness)))
        jumps = None
        moving = [(d, f) for d, f in parts if d.moves_base]
        sines = [d for d in self.drives if d.moves_base and isinstance(d.function, Sine)]
        if moving or sines:
            jumps = np.zeros((len(times), 2, len(self.stiffness)))
            for drive, function in moving:
                for k, time in enumerate(times):
                    jumps[k] += self._jump(drive, *jump_of(function, time, self._held))
            for drive in sines:
                jumps[0] += self._jump(drive, *jump_of(drive.function, 0.0, self._held))
        data = times, values, slopes, gains, jumps, self.start
        return PiecewiseLinearMotion(self.stiffness, self.half, *data)

    def _make_periodic(self, drive: ModalLoad, function: PiecewiseLinear) -> PeriodicMotion:
        gain = np.zeros_like(drive.gain) if drive.moves_base else drive.gain
        jumps = np.zeros((len(function.times) + 1, 2, len(self.stiffness)))
        if drive.moves_base:
            starts = [*function.times, function.period]
            for k, time in enumerate(starts):
                jumps[k] = self._jump(drive, *jump_of(function, time, self._held))
        return PeriodicMotion(self.stiffness, self.half, function, gain, jumps)

    def _phasor(self, drive: ModalLoad, sine: Sine) -> np.ndarray:
        """Compute the complex amplitude of the load Im(phasor e^{iΩt})."""
        gain = drive.gain * sine.omega**2 if drive.moves_base else drive.gain
        return gain * np.exp(1j * sine.phase)


def base_factors(function: TimeFunction, time: float) -> Floats:
    """Compute the factors of a base's displacement, velocity and acceleration at a time, (3,)."""
    value = function.value(max(time, 0.0))
    if time < 0.0:
        return np.array([value, 0.0, 0.0])
    # Only a sine has a curvature; a linear piece has none.
    curvature = -(getattr(function, "omega", 0.0) ** 2) * value
    return np.array([value, function.slope(time), curvature])


def jump_of(function: TimeFunction, time: float, held: bool) -> tuple[float, float]:
    """Compute the jumps of a function and its slope at a time."""
    # If the base is held at the first value of its function, only the slope jumps at t = 0.
    if isinstance(function, Sine) or time == 0.0:
        if time > 0.0 or function.steady:
            return 0.0, 0.0
        return (0.0 if held else function.value(0.0)), function.slope(0.0)
    _, rest = function.phase(time)
    k = int(np.searchsorted(function.times, rest))
    if k == len(function.times) or function.times[k] != rest:
        return 0.0, 0.0
    before = (k - 1) % len(function.times)
    length = (rest or function.period or 0.0) - function.times[before]
    end = function.values[before] + function.slopes[before] * length
    return float(function.values[k] - end), float(function.slopes[k] - function.slopes[before])
