"""The damped oscillator in closed form, q'' + 2 h q' + λ q = w, without losing digits.

With 2h = α + βλ the decay rates are r1 = h - d and r2 = h + d, d² = h² - λ. The textbook formulas
divide by d or ω, subtract nearly equal exponentials and overflow; here everything is made of

- S, the response to a unit impulse: t exp(-r1 t) exprel(-2 d t), or t exp(-h t) sinc(ω t);
- C, the free response from q = 1 at rest: exp(-r1 t) + r1 S, or exp(-h t) cos(ω t) + h S;
- P, the response to a unit step, the integral of S.

r1 is computed as λ / r2, and d and ω are only ever multiplied. Source: equation (20) of Furukawa,
Kitagawa and Shimizu for the underdamped case; the others by the same route.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import exprel

FloatArray = NDArray[np.float64]

#: Below this value of (largest rate) x t the step response comes from its Taylor series, where
#: the closed forms subtract nearly equal numbers.
_SERIES = 0.5
#: Terms of that series: 0.5**18 / 18! is below rounding.
_TERMS = 18


class Oscillation(NamedTuple):
    """Responses of one oscillator for each mode, at one time; arrays of shape (n,)."""

    free: FloatArray
    """q(t) from q(0) = 1 at rest."""
    free_rate: FloatArray
    """Its derivative [1/s]."""
    impulse: FloatArray
    """q(t) from q(0) = 0 with q'(0) = 1 [s]."""
    impulse_rate: FloatArray
    """Its derivative."""
    step: FloatArray
    """q(t) from rest under w = 1 from t = 0 on [s²]; its derivative is `impulse`."""


def oscillate(eigenvalues: ArrayLike, alpha: float, beta: float, time: float) -> Oscillation:
    """Return the responses at a time, in all four damping cases.

    Parameters
    ----------
    eigenvalues : array_like, shape (n,)
        λ [1/s²], at least 0.
    alpha : float
        Damping proportional to mass [1/s], at least 0.
    beta : float
        Damping proportional to stiffness [s], at least 0.
    time : float
        t [s], at least 0.

    Returns
    -------
    Oscillation
        Free, impulse and step responses.

    Examples
    --------
    >>> import math
    >>> round(float(oscillate([4.0], 0.0, 0.0, math.pi / 4).impulse[0]), 12)
    0.5
    """
    value = np.atleast_1d(np.asarray(eigenvalues, dtype=np.float64))
    half = 0.5 * (alpha + beta * value)
    square = _minus_square_root_squared(half, value)
    over = square >= 0.0
    d = np.sqrt(np.where(over, square, 0.0))
    omega = np.sqrt(np.where(over, 0.0, -square))
    fast = half + d
    slow = np.divide(value, fast, out=np.zeros_like(value), where=fast > 0.0)
    slow = np.where(over, slow, half)  # both decay rates are h where it swings

    decay = np.exp(-slow * time)
    shape = np.where(over, exprel(-2.0 * d * time), np.sinc(omega * time / np.pi))
    impulse = time * decay * shape
    swing = decay * np.where(over, 1.0, np.cos(omega * time))
    free = swing + slow * impulse
    last = np.where(over, np.exp(-np.where(over, fast, 0.0) * time), swing)
    impulse_rate = last - slow * impulse
    largest = np.maximum(fast, np.sqrt(value))
    return Oscillation(
        free=free,
        free_rate=-value * impulse,
        impulse=impulse,
        impulse_rate=impulse_rate,
        step=_step(value, half, fast, slow, over, largest, free, impulse, time),
    )


def damping_ratio(eigenvalues: ArrayLike, alpha: float, beta: float) -> FloatArray:
    """Return h / sqrt(λ) of each mode.

    Parameters
    ----------
    eigenvalues : array_like, shape (n,)
        λ [1/s²].
    alpha, beta : float
        Damping proportional to mass [1/s] and to stiffness [s].

    Returns
    -------
    ndarray of float64, shape (n,)
        NaN for a rigid mode, which has no frequency to compare its decay with.
    """
    value = np.asarray(eigenvalues, dtype=np.float64)
    half, root = 0.5 * (alpha + beta * value), np.sqrt(value)
    return np.divide(half, root, out=np.full_like(value, np.nan), where=value > 0.0)


def regime(eigenvalues: ArrayLike, alpha: float, beta: float) -> list[str]:
    """Return how each mode moves.

    Parameters
    ----------
    eigenvalues : array_like, shape (n,)
        λ [1/s²].
    alpha, beta : float
        Damping proportional to mass [1/s] and to stiffness [s].

    Returns
    -------
    list of str
        ``"rigid"``, ``"underdamped"``, ``"critical"`` (to 1e-9) or ``"overdamped"``.
    """
    names = []
    for ratio in damping_ratio(eigenvalues, alpha, beta):
        if np.isnan(ratio):
            names.append("rigid")
        elif abs(ratio - 1.0) <= 1e-9:
            names.append("critical")
        else:
            names.append("underdamped" if ratio < 1.0 else "overdamped")
    return names


def _minus_square_root_squared(half: FloatArray, value: FloatArray) -> FloatArray:
    """Return h² - λ as (h - sqrt λ)(h + sqrt λ), which keeps its digits near critical damping."""
    root = np.sqrt(value)
    return (half - root) * (half + root)


def _step(
    value: FloatArray,
    half: FloatArray,
    fast: FloatArray,
    slow: FloatArray,
    over: NDArray[np.bool_],
    largest: FloatArray,
    free: FloatArray,
    impulse: FloatArray,
    time: float,
) -> FloatArray:
    early = largest * time <= _SERIES
    closed_over = np.divide(
        time * exprel(-slow * time) - impulse, fast, out=np.zeros_like(value), where=over & ~early
    )
    closed_under = np.divide(1.0 - free, value, out=np.zeros_like(value), where=~over & ~early)
    closed = np.where(over, closed_over, closed_under)
    # P'' + 2 h P' + λ P = 1, term by term: a[n+2] (n+2)(n+1) = -2 h (n+1) a[n+1] - λ a[n].
    h, v = np.where(early, half * time, 0.0), np.where(early, value * time * time, 0.0)
    before, term = np.zeros_like(value), np.full_like(value, 0.5)
    series = term.copy()
    for n in range(1, _TERMS):
        before, term = term, (-2.0 * h * (n + 1) * term - v * before) / ((n + 2) * (n + 1))
        series += term
    return np.where(early, series * time * time, closed)
