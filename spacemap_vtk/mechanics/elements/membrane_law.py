"""Laws of a sheet's membrane: energy, stress and tangent from Green's strain.

The strain has the components e11, e22, 2 e12 along the sheet's axes, see
`spacemap_vtk.mechanics.elements.plates.Plate`: of woven cloth, axis 1 is the weft and axis 2 the
warp. The stress is the derivative of the energy per undeformed area by these components (the second
Piola-Kirchhoff stress), and the tangent is the derivative of the stress.

Cloth is described more naturally by the stretches of its two yarn directions and by the angle
between them. With r_i = 1 + 2 e_ii these are

    lambda_i = sqrt(r_i),    sin gamma = 2 e12/(lambda_1 lambda_2),

where gamma is the shear angle: 90 degrees less the angle between the directions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import Floats

#: Least square r0 of a stretch for which the formulas hold. Below it, r0²/(2 r0 - r) replaces the
#: square r, and stays above 0. Only strains that no shape has come there, as those that Newton's
#: method predicts.
_LEAST_SQUARE = 0.01

#: Sine of the shear angle beyond which formulas of the angle are continued by straight lines.
_LARGEST_SINE = np.sin(np.radians(88.0))


class LawResponse(NamedTuple):
    """Response of a membrane to strains of shape (…, 3)."""

    energy: Floats
    """Energy per undeformed area [J/m²], (…)."""
    stress: Floats
    """Its derivatives by e11, e22, 2 e12 [N/m], (…, 3)."""
    tangent: Floats
    """Its second derivatives [N/m], (…, 3, 3)."""


class MembraneLaw(ABC):
    """Relation between a sheet's strain in its plane and its energy."""

    #: Name of this kind of law.
    kind: ClassVar[str]

    #: Arrays that state the law, of at most two dimensions, by the constructor's arguments.
    arrays: dict[str, Floats]

    @cached_property
    def digest(self) -> str:
        """Text that differs between different laws; part of the cache key."""
        return digest_of(self.kind, *(part for pair in self.arrays.items() for part in pair))

    @abstractmethod
    def evaluate(self, strain: Floats) -> LawResponse:
        """Compute energy, stress and tangent.

        Parameters
        ----------
        strain : ndarray of float64, shape (…, 3)
            Green's strain e11, e22, 2 e12 along the axes of the sheet. Every finite value is
            allowed, also one that no shape has.

        Returns
        -------
        LawResponse
            The stress is continuous and the derivative of the energy; the tangent is that of the
            stress.
        """

    def stress(self, strain: Floats) -> Floats:
        """Compute the stress alone.

        Parameters
        ----------
        strain : ndarray of float64, shape (…, 3)
            As for `evaluate`.

        Returns
        -------
        ndarray of float64, shape (…, 3)
            Stress [N/m].
        """
        return self.evaluate(strain).stress


class LinearLaw(MembraneLaw):
    """Stress in proportion to the strain, as that of a `Plate` without a law: (3, 3) in N/m."""

    kind = "linear"

    def __init__(self, stiffness: ArrayLike) -> None:
        self.stiffness = np.asarray(stiffness, dtype=np.float64)
        self.arrays = {"stiffness": self.stiffness}
        if self.stiffness.shape != (3, 3) or not np.allclose(self.stiffness, self.stiffness.T):
            raise InputError(
                "the stiffness of a membrane is a symmetric matrix",
                key="stiffness",
                value=self.stiffness.tolist(),
                allowed="3 x 3 values in N/m",
            )

    def evaluate(self, strain: Floats) -> LawResponse:
        """Compute ½ e C e, C e and C."""
        stress = strain @ self.stiffness
        tangent = np.broadcast_to(self.stiffness, (*strain.shape, 3))
        return LawResponse(0.5 * (strain * stress).sum(axis=-1), stress, tangent)


class StretchResponse(NamedTuple):
    """Derivatives of an energy by the stretches of axes 1 and 2 and by sin γ."""

    energy: Floats
    """Energy per undeformed area [J/m²], (n,)."""
    first: Floats
    """First derivatives [N/m], (3, n)."""
    second: Floats
    """Second derivatives [N/m] by 11, 22, 33, 12, 13 and 23, (6, n)."""


class StretchLaw(MembraneLaw):
    """Law that is given in the stretches of the sheet's axes and the sine of its shear angle."""

    @abstractmethod
    def respond(self, first: Floats, second: Floats, sine: Floats) -> StretchResponse:
        """Compute the energy and its derivatives.

        Parameters
        ----------
        first, second : ndarray of float64, shape (n,)
            Stretches along axes 1 and 2, more than 0.
        sine : ndarray of float64, shape (n,)
            sin γ; beyond -1 and 1 for strains that no shape has.

        Returns
        -------
        StretchResponse
            Energy and derivatives.
        """

    def evaluate(self, strain: Floats) -> LawResponse:
        """Compute energy, stress and tangent by the chain rule."""
        flat = strain.reshape(-1, 3).T
        # `slope` is the derivative of the square by 2 e, and `bend` its own derivative.
        square = 1.0 + 2.0 * flat[:2]
        slope, bend = np.ones_like(square), np.zeros_like(square)
        low = square < _LEAST_SQUARE
        if low.any():
            share = _LEAST_SQUARE / (2.0 * _LEAST_SQUARE - square[low])
            square[low], slope[low] = _LEAST_SQUARE * share, share**2
            bend[low] = 2.0 / _LEAST_SQUARE * share**3
        stretch = np.sqrt(square)
        # Derivatives of the stretches and of sin γ by the strains.
        by = slope / stretch
        twice = 2.0 * bend / stretch - slope * slope / (square * stretch)
        one, two = by
        turn = 1.0 / (stretch[0] * stretch[1])
        sine = flat[2] * turn
        lean = -by / stretch  # d(ln(1/lambda))/de
        energy, (f1, f2, f3), (h11, h22, h33, h12, h13, h23) = self.respond(
            stretch[0], stretch[1], sine
        )
        s1, s2 = sine * lean
        stress = np.empty((len(energy), 3))
        stress[:, 0] = f1 * one + f3 * s1
        stress[:, 1] = f2 * two + f3 * s2
        stress[:, 2] = f3 * turn
        # Second derivatives of sin γ: by e11 twice, e22 twice, and both.
        curl = lean * lean + (by * by / stretch - twice) / stretch
        tangent = np.empty((len(energy), 3, 3))
        g1, g2 = h13 * one + h33 * s1, h23 * two + h33 * s2
        tangent[:, 0, 0] = (h11 * one + 2.0 * h13 * s1) * one + h33 * s1 * s1
        tangent[:, 0, 0] += f1 * twice[0] + f3 * sine * curl[0]
        tangent[:, 1, 1] = (h22 * two + 2.0 * h23 * s2) * two + h33 * s2 * s2
        tangent[:, 1, 1] += f2 * twice[1] + f3 * sine * curl[1]
        tangent[:, 0, 1] = h12 * one * two + h13 * one * s2 + h23 * two * s1 + h33 * s1 * s2
        tangent[:, 0, 1] += f3 * s1 * lean[1]
        tangent[:, 0, 2] = (g1 + f3 * lean[0]) * turn
        tangent[:, 1, 2] = (g2 + f3 * lean[1]) * turn
        tangent[:, 2, 2] = h33 * turn * turn
        tangent[:, 1, 0], tangent[:, 2, 0] = tangent[:, 0, 1], tangent[:, 0, 2]
        tangent[:, 2, 1] = tangent[:, 1, 2]
        shape = strain.shape
        return LawResponse(
            energy.reshape(shape[:-1]), stress.reshape(shape), tangent.reshape(*shape, 3)
        )


def shear_angle(sine: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute the shear angle and its two derivatives by its sine.

    Parameters
    ----------
    sine : ndarray of float64, shape (n,)
        sin γ; beyond 88 degrees, and for values that no angle has, straight lines go on.

    Returns
    -------
    tuple of 3 ndarray of float64, shape (n,)
        Angle [rad], first and second derivative.
    """
    s = np.clip(sine, -_LARGEST_SINE, _LARGEST_SINE)
    slope = 1.0 / np.sqrt(1.0 - s * s)
    return np.arcsin(s) + slope * (sine - s), slope, np.where(s == sine, s * slope**3, 0.0)


def shear_cosine(sine: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute the cosine of the shear angle and its two derivatives by the sine.

    Parameters
    ----------
    sine : ndarray of float64, shape (n,)
        sin γ; beyond 88 degrees, and for values that no angle has, straight lines go on.

    Returns
    -------
    tuple of 3 ndarray of float64, shape (n,)
        cos γ, first and second derivative.
    """
    s = np.clip(sine, -_LARGEST_SINE, _LARGEST_SINE)
    cosine = np.sqrt(1.0 - s * s)
    slope = -s / cosine
    return cosine + slope * (sine - s), slope, np.where(s == sine, -1.0 / cosine**3, 0.0)
