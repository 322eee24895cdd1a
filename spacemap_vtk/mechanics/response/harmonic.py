"""Response of oscillators to a sine: steady or from rest, also at resonance.

From rest under w = e^{pt}, p = iΩ, the response is Duhamel's integral

    X(t) = (E - S) / (p - b),    E = t e^{pt} φ₁((a - p) t),    φ₁(z) = (e^z - 1) / z,

where a and b are the roots of r² + 2hr + λ, a is the one closer to p, and S is the impulse
response. At resonance without damping, a = p, E is t e^{pt} and nothing is divided by zero; the
textbook form "steady minus free" would divide by zero. For short times, where E and S cancel, a
Taylor series is summed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.response.oscillator import SHORT, TERMS, compute_kernels
from spacemap_vtk.ndarrays import Floats

ComplexArray = NDArray[np.complex128]


class ForcedResponse(NamedTuple):
    """Response to e^{iΩt}; its imaginary part is the response to sin Ωt."""

    value: ComplexArray
    """X [s²]."""
    rate: ComplexArray
    """Derivative of X [s]."""


def response_from_rest(
    stiffness: Floats, half: Floats, omega: float, time: Floats | float
) -> ForcedResponse:
    """Compute the response of q̈ + 2h q̇ + λ q = e^{iΩt} from rest."""
    spring, h, t = np.broadcast_arrays(stiffness, half, time)
    p = 1j * omega
    root = np.sqrt(spring)
    over = h > root
    d = np.sqrt(abs(h - root)) * np.sqrt(h + root)
    fast = h + d
    slow = np.divide(spring, fast, out=np.zeros(t.shape), where=fast > 0)
    near = np.where(over, -slow, -h + 1j * d)
    far = np.where(over, -fast, -h - 1j * d)
    impulse = compute_kernels(spring, h, t).impulse
    value = (t * np.exp(p * t) * _phi1(near - p, t) - impulse) / (p - far)
    early = abs(p - far) * t <= SHORT
    if early.any():
        value[early] = _taylor_series(spring[early], h[early], p, t[early])
    return ForcedResponse(value, impulse + p * value)


def receptance(stiffness: Floats, half: Floats, omega: Floats | float) -> ComplexArray:
    """Compute the receptance: the steady response of q̈ + 2h q̇ + λ q = e^{iΩt} at t = 0."""
    # Frequencies of shape (f, 1) give one row each.
    root = np.sqrt(stiffness)
    inverse = (root - omega) * (root + omega) + 2j * half * omega
    if (inverse == 0).any():
        raise InputError(
            f"mode {np.nonzero(inverse == 0)[-1][0] + 1} is excited at its natural frequency "
            "without damping, so it has no steady state",
            cure="Add damping, or start from rest",
        )
    return np.asarray(1.0 / inverse)


def _phi1(z: ComplexArray, t: Floats) -> ComplexArray:
    """Compute φ₁(z t)."""
    from scipy.special import expm1  # this import costs a tenth of a second

    x = z * t
    return np.divide(expm1(x), x, out=np.ones_like(x), where=x != 0)


def _taylor_series(spring: Floats, h: Floats, p: complex, t: Floats) -> ComplexArray:
    """Sum X = Σ T[k], (k + 1) k T[k+1] = t² (pt)ᵏ⁻¹ / (k - 1)! - 2h t k T[k] - λt² T[k-1]."""
    damping, stiff = 2 * h * t, spring * t * t
    load: ComplexArray = (t * t).astype(np.complex128)
    previous: ComplexArray = np.zeros_like(load)
    term: ComplexArray = load / 2
    total = term.copy()
    for k in range(2, TERMS + 2):
        load *= p * t / (k - 1)
        previous, term = term, (load - k * damping * term - stiff * previous) / (k * (k + 1))
        total += term
    return total
