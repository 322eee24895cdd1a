"""Time functions of loads, in the two forms with exact responses: linear pieces, and a sine.

A time function is a factor without unit that starts at t = 0. The load that it multiplies (a
pressure, a base acceleration …) has the unit.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats


class PiecewiseLinear(NamedTuple):
    """Piecewise linear function, with or without jumps."""

    # The function is zero before its first time. After the last time its last piece continues. A
    # periodic function repeats from its first time, which is 0.

    times: Floats
    """(k,), start of each piece [s], ascending; the first is 0."""
    values: Floats
    """(k,), value at the start of each piece."""
    slopes: Floats
    """(k,), slope of each piece [1/s]."""
    period: float | None = None
    """Period after which the function repeats [s]."""
    steady: bool = False
    """Whether a periodic function has been repeating for ever."""

    def phase(self, time: float) -> tuple[int, float]:
        """Count the periods before a time, and compute the time since the last one."""
        count, rest, slack = 0, time, 4e-16 * time
        if self.period is not None:
            rest = math.fmod(time, self.period)
            count = round((time - rest) / self.period)
            if self.period - rest <= slack:
                return count + 1, 0.0
        k = bisect_left(self.times, rest)
        for start in self.times[max(0, k - 1) : k + 1]:
            if abs(start - rest) <= slack:
                return count, float(start)
        return count, rest

    def value(self, time: float) -> float:
        """Compute the factor at a time, after any jump at that time."""
        if time < 0.0:
            return 0.0
        _, time = self.phase(time)
        k = bisect_right(self.times, time) - 1
        return float(self.values[k] + self.slopes[k] * (time - self.times[k]))

    def slope(self, time: float) -> float:
        """Compute the rate of change at a time, after any jump at that time."""
        if time < 0.0:
            return 0.0
        _, time = self.phase(time)
        return float(self.slopes[bisect_right(self.times, time) - 1])

    def next_corner(self, time: float) -> float:
        """Find the first time after the given one at which a piece starts; infinity if none."""
        count, rest = self.phase(time)
        k = bisect_right(self.times, rest)
        start = 0.0 if self.period is None else count * self.period
        if k < len(self.times):
            return start + float(self.times[k])
        return math.inf if self.period is None else start + self.period


class Sine(NamedTuple):
    """Factor sin(Ωt + φ), from t = 0 on."""

    omega: float
    """Angular frequency Ω [rad/s], above 0."""
    phase: float = 0.0
    """Phase φ [rad]."""
    steady: bool = False
    """Whether it has been oscillating for ever, so that the response is steady from t = 0."""

    def value(self, time: float) -> float:
        """Compute the factor at a time."""
        return math.sin(self.omega * time + self.phase) if time >= 0.0 or self.steady else 0.0

    def slope(self, time: float) -> float:
        """Compute the rate of change at a time."""
        rate = self.omega * math.cos(self.omega * time + self.phase)
        return rate if time >= 0.0 or self.steady else 0.0

    def next_corner(self, time: float) -> float:
        """Return infinity, as a sine has no corner."""
        return math.inf


TimeFunction = PiecewiseLinear | Sine


def is_constant(function: TimeFunction) -> bool:
    """Check whether a function has the same value at all times from t = 0 on."""
    if isinstance(function, Sine):
        return False
    return not function.slopes.any() and bool((function.values == function.values[0]).all())


def is_continuous(function: TimeFunction) -> bool:
    """Check whether a function starts with 0 at t = 0 and has no jump.

    Parameters
    ----------
    function : PiecewiseLinear or Sine
        The function.

    Returns
    -------
    bool
        False if what the function moves would jump.
    """
    if isinstance(function, Sine):
        return not function.steady and abs(math.sin(function.phase)) < 1e-12
    ends = np.append(function.times[1:], function.period or function.times[-1])
    last = function.values + function.slopes * (ends - function.times)
    if function.period is None:
        last = last[:-1]
    following = np.roll(function.values, -1)[: len(last)]
    size = float(abs(function.values).max())
    return bool(function.values[0] == 0.0 and (abs(last - following) <= 1e-12 * size).all())


def step(start: float = 0.0) -> PiecewiseLinear:
    """Make a function that is 0 before a time and 1 from it on.

    Parameters
    ----------
    start : float
        Time of the step [s].

    Returns
    -------
    Pieces
        The step function.
    """
    return table([0.0], [1.0], start)


def table(times: Sequence[float], values: Sequence[float], start: float = 0.0) -> PiecewiseLinear:
    """Make a function that is linear between given points.

    Parameters
    ----------
    times : sequence of float, shape (k,)
        Times from 0 on, not descending [s]; a time given twice is a jump.
    values : sequence of float, shape (k,)
        Values at the times. The first also holds from `start` on, the last for ever.
    start : float
        Added to the times [s].

    Returns
    -------
    Pieces
        The piecewise linear function.

    Raises
    ------
    InputError
        If there are not as many values as times, or the times descend or start before 0.
    """
    t, v = _check_table(times, values)
    spans = np.diff(t)
    # A jump is a piece of zero length: it is left out, and the next piece starts with its value.
    is_piece = spans > 0
    slopes = np.append(np.diff(v)[is_piece] / spans[is_piece], 0.0)
    t, v = t[np.append(is_piece, True)], v[np.append(is_piece, True)]
    if t[0] > 0.0:
        t, v, slopes = np.r_[0.0, t], np.r_[v[0], v], np.r_[0.0, slopes]
    t = t + start
    if t[0] > 0.0:
        t, v, slopes = np.r_[0.0, t], np.r_[0.0, v], np.r_[0.0, slopes]
    return PiecewiseLinear(t, v, slopes)


def periodic(
    times: Sequence[float], values: Sequence[float], *, steady: bool = False
) -> PiecewiseLinear:
    """Make a periodic function that is linear between given points.

    Parameters
    ----------
    times : sequence of float, shape (k,)
        From 0 to the period [s]; a time given twice is a jump.
    values : sequence of float, shape (k,)
        Values at the times.
    steady : bool
        Whether it has been repeating for ever, so that the response is steady from t = 0.

    Returns
    -------
    Pieces
        The function, whose period is the last time.

    Raises
    ------
    InputError
        If the times and values are not a valid table, do not start at 0, or have no length.
    """
    t, v = _check_table(times, values)
    if t[0] != 0.0 or t[-1] <= 0.0:
        raise InputError(
            f"the times extend from {t[0]:g} s to {t[-1]:g} s",
            key="times",
            allowed="times from 0 s to the period, which must be above 0 s",
        )
    spans = np.diff(t)
    is_piece = spans > 0
    slopes = np.diff(v)[is_piece] / spans[is_piece]
    return PiecewiseLinear(t[:-1][is_piece], v[:-1][is_piece], slopes, float(t[-1]), steady)


def harmonic(frequency: float, phase: float = 0.0, *, steady: bool = False) -> Sine:
    """Make the function sin(2πft + φ).

    Parameters
    ----------
    frequency : float
        Frequency f [Hz], above 0.
    phase : float
        Phase φ [rad]; a quarter turn makes a cosine.
    steady : bool
        Whether it has been oscillating for ever, so that the response is steady from t = 0.

    Returns
    -------
    Sine
        The sine.
    """
    return Sine(2 * math.pi * frequency, phase, steady)


def _check_table(times: Sequence[float], values: Sequence[float]) -> tuple[Floats, Floats]:
    t, v = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if t.ndim != 1 or t.shape != v.shape or len(t) == 0:
        raise InputError(
            f"{t.size} times and {v.size} values are given",
            key="values",
            allowed="one value for each time",
        )
    for key, numbers in (("times", t), ("values", v)):
        if not np.isfinite(numbers).all():
            raise InputError(f"{key} must be finite numbers", key=key)
    if t[0] < 0 or (np.diff(t) < 0).any():
        raise InputError("times must ascend from 0 s on", key="times")
    return t, v
