"""Closed-form response of q̈ + 2h q̇ + λ q = w, with 2h = α + βλ, at any time.

Equations (19) and (20) of Furukawa et al., with the decay exp(-ht), for all four cases: under-,
critically and overdamped, and rigid (λ = 0). The roots of r² - 2hr + λ are r₁,₂ = h ∓ d,
d = √(h² - λ). All kernels follow from the impulse response S and its integrals over time: S₂ for a
step, S₃ for a ramp, S₄ for a parabola. No form loses digits where two cases meet:

- r₁ is computed as λ / (h + d), never as the difference h - d;
- sinh and sin are divided by their argument (exprel, sinc), never by d, which can be zero;
- no growing exponential is computed, so nothing overflows however overdamped a mode is;
- for short times, where the closed forms of the integrals cancel, a Taylor series is summed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats

#: Up to this product of the larger root and t, integrals of the impulse response are summed as a
#: series.
SHORT = 1.0
#: Number of terms of this series; they decrease as 2ⁿ / n!.
TERMS = 24
#: Damping is called critical if ζ differs from 1 by at most this much.
CRITICAL = 1e-9
#: A mode is lost if rounding is more than this share of its eigenvalue.
LOST = 0.1


class Kernels(NamedTuple):
    """Responses that a piecewise linear load is composed of, of the arguments' broadcast shape."""

    free: Floats
    """q after q(0) = 1, q̇(0) = 0 [1]."""
    free_rate: Floats
    """Derivative of `free` [1/s]."""
    impulse: Floats
    """q after q(0) = 0, q̇(0) = 1 [s]."""
    impulse_rate: Floats
    """Derivative of `impulse` [1]."""
    step: Floats
    """q from rest under w = 1 [s²]; its derivative is `impulse`."""
    ramp: Floats
    """q from rest under w = t [s³]; its derivative is `step`."""
    parabola: Floats
    """q from rest under w = t²/2 [s⁴]; its derivative is `ramp`."""


def compute_kernels(stiffness: Floats, half: Floats, time: Floats | float) -> Kernels:
    """Compute the responses of q̈ + 2h q̇ + λ q = w; values are not checked."""
    over = half > np.sqrt(stiffness)
    if not over.any():
        return _underdamped(half, stiffness, time)
    if over.all():
        return _overdamped(half, stiffness, time)
    spring, h, t, over = np.broadcast_arrays(stiffness, half, time, over)
    result = Kernels(*np.empty((7, *t.shape)))
    for case, response in ((over, _overdamped), (~over, _underdamped)):
        for whole, part in zip(result, response(h[case], spring[case], t[case]), strict=True):
            whole[case] = part
    return result


def damping_ratio(eigenvalues: ArrayLike, alpha: ArrayLike, beta: ArrayLike) -> Floats:
    """Compute the damping ratio ζ = h / √λ of each mode.

    Parameters
    ----------
    eigenvalues : array_like of float, shape (n,)
        Eigenvalues λ ≥ 0 [1/s²].
    alpha, beta : array_like of float
        Damping α [1/s] and β [s], not negative.

    Returns
    -------
    ndarray of float64, shape (n,)
        Damping ratios ζ; NaN for a rigid mode, which has no critical damping.

    Raises
    ------
    InputError
        If a value is negative or not finite.
    """
    stiffness, a, b = _check_all((eigenvalues, alpha, beta), ("eigenvalues", "alpha", "beta"))
    h, omega = (a + b * stiffness) / 2, np.sqrt(stiffness)
    return np.divide(h, omega, out=np.full(h.shape, np.nan), where=omega > 0)


def classify_regimes(
    eigenvalues: ArrayLike, alpha: ArrayLike, beta: ArrayLike, rounding: ArrayLike = 0.0
) -> list[str]:
    """Classify the motion of each mode.

    Parameters
    ----------
    eigenvalues : array_like of float, shape (n,)
        Eigenvalues λ ≥ 0 [1/s²].
    alpha, beta : array_like of float
        Damping α [1/s] and β [s], not negative.

    rounding : array_like of float, optional
        Share of each λ that is rounding.

    Returns
    -------
    list of str
        ``"rigid"`` (λ = 0), ``"underdamped"``, ``"critical"`` (ζ = 1 within 1e-9) or
        ``"overdamped"``; ``"lost in rounding"`` if no digit of λ is correct.

    Raises
    ------
    InputError
        If a value is negative or not finite.
    """
    zeta = damping_ratio(eigenvalues, alpha, beta)
    kinds = np.select(
        [np.asarray(rounding) > LOST, np.isnan(zeta), abs(zeta - 1) <= CRITICAL, zeta < 1],
        ["lost in rounding", "rigid", "critical", "underdamped"],
        "overdamped",
    )
    return [str(kind) for kind in kinds]


def _check_all(values: tuple[ArrayLike, ...], names: tuple[str, ...]) -> list[Floats]:
    arrays = []
    for value, name in zip(values, names, strict=True):
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
        if not (np.isfinite(array) & (array >= 0)).all():
            raise InputError("must be finite and at least 0", key=name, value=value)
        arrays.append(array)
    return list(np.broadcast_arrays(*arrays))


def _overdamped(h: Floats, stiffness: Floats, t: Floats | float) -> Kernels:
    from scipy.special import exprel  # this import costs a tenth of a second

    omega = np.sqrt(stiffness)
    d = np.sqrt(h - omega) * np.sqrt(h + omega)
    fast = h + d
    slow = stiffness / fast
    decay = np.exp(-slow * t)
    impulse = t * decay * exprel(-2 * d * t)
    free = decay + slow * impulse
    # Ṡ + r₁ S = exp(-r₂ t): every other form of Ṡ contains a difference of exponentials.
    impulse_rate = np.exp(-fast * t) - slow * impulse
    # Integrals of Ṡ + r₂ S = exp(-r₁ t); those of the exponential are t φ₁, t² φ₂, t³ φ₃.
    first, second, third = _exponential_integrals(slow * t)
    step = (t * first - impulse) / fast
    ramp = (t * t * second - step) / fast
    parabola = (t * t * t * third - ramp) / fast
    integrals = _replace_early(fast * t, h, stiffness, t, [step, ramp, parabola])
    return Kernels(free, -stiffness * impulse, impulse, impulse_rate, *integrals)


def _underdamped(h: Floats, stiffness: Floats, t: Floats | float) -> Kernels:
    omega = np.sqrt(stiffness)
    # At critical damping, rounding may leave h above √λ in its last digit.
    phase = np.sqrt(np.maximum(omega - h, 0.0) * (omega + h)) * t
    decay = np.exp(-h * t)
    # Not np.sinc: its factor π costs digits of a large phase.
    sinc = np.divide(np.sin(phase), phase, out=np.ones_like(phase), where=phase > 0)
    impulse = t * decay * sinc
    swing = decay * np.cos(phase)
    free = swing + h * impulse
    # λ S₂ = 1 - C, and integrals of it: λ S₃ = t - S - 2h S₂, λ S₄ = t²/2 - S₂ - 2h S₃.
    with np.errstate(all="ignore"):  # early values have no digits here and are replaced below
        step = (1 - free) / stiffness
        ramp = (t - impulse - 2 * h * step) / stiffness
        parabola = (t * t / 2 - step - 2 * h * ramp) / stiffness
    integrals = _replace_early(omega * t, h, stiffness, t, [step, ramp, parabola])
    return Kernels(free, -stiffness * impulse, impulse, swing - h * impulse, *integrals)


def _replace_early(
    phase: Floats, h: Floats, stiffness: Floats, t: Floats | float, late: list[Floats]
) -> list[Floats]:
    """Replace the integrals S₂, S₃ and S₄ by their Taylor series where `phase` is small."""
    # From the term tᵐ/m! on, S'' + 2h S' + λ S = tᵐ⁻² / (m - 2)! gives the recursion
    # T[k+1] (k + 1) k = -2h t k T[k] - λ t² T[k-1].
    early = phase <= SHORT
    if early.any():
        h, stiffness, t = (np.broadcast_to(x, early.shape)[early] for x in (h, stiffness, t))
        damping, spring = 2 * h * t, stiffness * t * t
        term = np.stack([t * t / 2, t**3 / 6, t**4 / 24])
        order = np.array([[2.0], [3.0], [4.0]])
        previous, total = np.zeros_like(term), term.copy()
        for k in range(TERMS):
            power = order + k
            previous, term = (
                term,
                -(power * damping * term + spring * previous) / (power * (power + 1)),
            )
            total += term
        for integral, part in zip(late, total, strict=True):
            integral[early] = part
    return late


def _exponential_integrals(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute φ₁, φ₂, φ₃ of -x, x ≥ 0: φₖ(z) = Σ zⁿ / (n + k)!, integrals of the exponential."""
    from scipy.special import exprel  # this import costs a tenth of a second

    first = exprel(-x)
    small = x < 1.0
    safe = np.where(small, 1.0, x)
    second = (1.0 - first) / safe
    third = (0.5 - second) / safe
    if small.any():
        z = -x[small]
        # Horner's scheme for Σ zⁿ / (n + 3)!; 1/21! is below rounding.
        total = np.ones_like(z)
        for n in range(18, 0, -1):
            total = 1.0 + total * z / (n + 3)
        third[small] = total / 6.0
        second[small] = 0.5 + z * third[small]
    return first, second, third
