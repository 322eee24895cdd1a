"""Damping of a cage: α and β from two measured ratios, or damping ratios of the modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.units import format_quantity


class Damping(NamedTuple):
    """Damping of the modes, 2hₖ = α + βλₖ + 2ζₖ√λₖ."""

    alpha: float = 0.0
    """Damping α proportional to mass [1/s]."""
    beta: float = 0.0
    """Damping β proportional to stiffness [s]."""
    ratio: float | tuple[float, ...] = 0.0
    """ζ of every mode with a frequency; or ζ of each mode, the last also for all higher modes."""

    def mass_damping(self, eigenvalues: Floats) -> Floats:
        """Compute each mode's mass-proportional damping, α + 2ζ√λ.

        Parameters
        ----------
        eigenvalues : ndarray of float64, shape (n,)
            Eigenvalues λ [1/s²], those of the modes first.

        Returns
        -------
        ndarray of float64, shape (n,)
            Damping [1/s].
        """
        given = np.atleast_1d(self.ratio)
        ratios = given[np.minimum(np.arange(len(eigenvalues)), len(given) - 1)]
        return np.asarray(self.alpha + 2.0 * ratios * np.sqrt(eigenvalues))

    def decay_rates(self, eigenvalues: Floats) -> Floats:
        """Compute h of each mode, the rate at which its oscillation decays.

        Parameters
        ----------
        eigenvalues : ndarray of float64, shape (n,)
            Eigenvalues λ [1/s²].

        Returns
        -------
        ndarray of float64, shape (n,)
            Rates h [1/s].
        """
        return 0.5 * (self.mass_damping(eigenvalues) + self.beta * eigenvalues)


@runtime_checkable
class HasDamping(Protocol):
    """Object that defines how much modes are damped."""

    @property
    def damping(self) -> Damping:
        """Damping of the modes; raises InputError if parameters contradict each other."""


def rayleigh(pairs: Sequence[tuple[float, float]]) -> Damping:
    """Compute the α and β that give two damping ratios at two frequencies.

    Parameters
    ----------
    pairs : sequence of tuple of float
        Two pairs of frequency [Hz] and ratio ζ.

    Returns
    -------
    Damping
        With ζ = α / (2ω) + βω / 2 at both frequencies.

    Raises
    ------
    InputError
        If the frequencies are equal, or α or β would be negative, as damping would then feed energy
        into some frequencies.

    Examples
    --------
    >>> damping = rayleigh([(1.0, 0.02), (10.0, 0.02)])
    >>> round(damping.alpha, 4), round(damping.beta, 6)
    (0.2285, 0.000579)
    """
    (first, low), (second, high) = sorted(pairs)
    if first == second:
        raise InputError(
            f"both pairs have the same frequency, {first:g} Hz",
            cure="Give two different frequencies",
        )
    omega, omega2 = 2 * math.pi * first, 2 * math.pi * second
    spread = omega2 * omega2 - omega * omega
    alpha = 2 * omega * omega2 * (low * omega2 - high * omega) / spread
    beta = 2 * (high * omega2 - low * omega) / spread
    if alpha < 0 or beta < 0:
        least, most = low * first / second, low * second / first
        raise InputError(
            f"damping ratios of {low:g} at {format_quantity(first, 'Hz')} and {high:g} at "
            f"{format_quantity(second, 'Hz')} would need a negative α or β",
            allowed=f"with the first pair, a second ratio from {least:.4g} to {most:.4g}",
        )
    return Damping(alpha, beta)
