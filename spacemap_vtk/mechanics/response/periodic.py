"""Response of oscillators to a piecewise linear load, periodic or not, without time steps.

The state (q, q̇) at the start of each piece is computed once. Any later state then needs a single
evaluation, however many pieces precede it. A periodic load maps the state over a period as
x → A x + b: after m periods it is Aᵐ x + (1 + A + … + Aᵐ⁻¹) b. The powers of A have a closed form.
The sum is built by doubling, which needs no division and therefore also works at resonance.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.time_functions import PiecewiseLinear
from spacemap_vtk.mechanics.response.oscillator import Kernels, compute_kernels
from spacemap_vtk.ndarrays import Floats

#: Number of kernel values that are computed at once for the states at the starts of the pieces.
CHUNK = 2_000_000


def propagate(kernel: Kernels, state: Floats, load: Floats, slope: Floats) -> Floats:
    """Propagate the state of oscillators in time under a load that is linear in time."""
    q, rate = state
    return np.array(
        [
            q * kernel.free + rate * kernel.impulse + load * kernel.step + slope * kernel.ramp,
            # `free_rate` is not needed for the load, as the rates of its kernels are kernels.
            q * kernel.free_rate
            + rate * kernel.impulse_rate
            + load * kernel.impulse
            + slope * kernel.step,
        ]
    )


class PiecewiseLinearMotion:
    """Motion of oscillators under several piecewise linear loads."""

    def __init__(
        self,
        stiffness: Floats,
        half: Floats,
        times: Floats,
        values: Floats,
        slopes: Floats,
        gains: Floats,
        jumps: Floats | None,
        start: Floats,
    ) -> None:
        self._stiffness, self._half, self._times = stiffness, half, times.tolist()
        self._values, self._slopes, self._gains = values, slopes, gains
        #: Piece that was evaluated last: its number, its load at the start, and the load's slope.
        self._last: tuple[int, Floats, Floats] | None = None
        count, size = len(times), len(stiffness)
        self._starts = np.empty((count, 2, size))
        self._starts[0] = start if jumps is None else start + jumps[0]
        spans = np.diff(times)[:, None]
        chunk = max(1, CHUNK // (7 * size))
        for first in range(0, count - 1, chunk):
            block = compute_kernels(stiffness, half, spans[first : first + chunk])
            for k, kernel in enumerate(zip(*block, strict=True), first):
                end = propagate(Kernels(*kernel), self._starts[k], *self._load(k))
                self._starts[k + 1] = end if jumps is None else end + jumps[k + 1]

    def _load(self, k: int) -> tuple[Floats, Floats]:
        return self._values[k] @ self._gains, self._slopes[k] @ self._gains

    def at_time(self, time: float) -> Floats:
        """Compute the state at a time, after any jump at that time."""
        k = bisect_right(self._times, time) - 1
        if time == self._times[k]:
            return self._starts[k]
        if self._last is None or self._last[0] != k:
            self._last = k, *self._load(k)
        kernel = compute_kernels(self._stiffness, self._half, time - self._times[k])
        return propagate(kernel, self._starts[k], *self._last[1:])


class PeriodicMotion:
    """Motion of oscillators, from rest, under one periodic load."""

    def __init__(
        self,
        stiffness: Floats,
        half: Floats,
        function: PiecewiseLinear,
        gain: Floats,
        jumps: Floats,
    ) -> None:
        assert function.period is not None
        self._stiffness, self._half = stiffness, half
        self._function, self._period = function, function.period
        inner = jumps[:-1].copy()
        inner[0] = 0.0
        rest = np.zeros_like(jumps[0])
        columns = function.values[:, None], function.slopes[:, None]
        self._inside = PiecewiseLinearMotion(
            stiffness, half, function.times, *columns, gain[None, :], inner, rest
        )
        #: Change of the state from rest in m = 1, 2, 4, … periods, and the kernels of these spans.
        self.sums = [self._inside.at_time(self._period) + jumps[-1]]
        self._moves = [compute_kernels(stiffness, half, self._period)]
        self._first = self._steady_state() if function.steady else jumps[0]

    def at_time(self, time: float) -> Floats:
        """Compute the state at a time, after any jump at that time."""
        count, rest = self._function.phase(time)
        state = self._first
        level = 0
        while count >> level:
            if level == len(self.sums):
                move = self._moves[-1]
                self.sums.append(_propagate_free(move, self.sums[-1]) + self.sums[-1])
                self._moves.append(
                    compute_kernels(self._stiffness, self._half, self._period * float(1 << level))
                )
            if count >> level & 1:
                state = _propagate_free(self._moves[level], state) + self.sums[level]
            level += 1
        free = _propagate_free(compute_kernels(self._stiffness, self._half, rest), state)
        return free + self._inside.at_time(rest)

    def _steady_state(self) -> Floats:
        """Solve x = A x + b for the steady state x."""
        move, (q, rate) = self._moves[0], self.sums[0]
        # (1 - A)⁻¹ by Cramer's rule, mode by mode, with 1 - C = λ S₂ and 1 - Ṡ = λ S₂ + 2h S: for a
        # mode much slower than the period, the differences would lose all digits.
        a = self._stiffness * move.step
        d = a + 2 * self._half * move.impulse
        b, c = -move.impulse, self._stiffness * move.impulse
        determinant = a * d - b * c
        driven = (abs(q) > 0) | (abs(rate) > 0)
        # Off resonance the determinant is of the order of min(1, λτ²), where τ is the period.
        least = 1e-20 * np.minimum(1.0, self._stiffness * self._period**2)
        if (lost := driven & (determinant <= least)).any():
            raise InputError(
                f"mode {int(np.argmax(lost)) + 1} has no steady state under the periodic load",
                cure="Add damping, or start from rest",
            )
        safe = np.where(driven, determinant, 1.0)
        return np.stack([(d * q - b * rate) / safe, (a * rate - c * q) / safe])


def _propagate_free(move: Kernels, state: Floats) -> Floats:
    q, rate = state
    return np.stack(
        [q * move.free + rate * move.impulse, q * move.free_rate + rate * move.impulse_rate]
    )
