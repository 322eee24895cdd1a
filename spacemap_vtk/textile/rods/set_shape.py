"""The shape in which yarns are set: they keep it without any force.

Each sample remembers its slope a₀ = s₀ t₀ and its curvature vector κ₀. With the turn R that takes
t₀ to the tangent t by the shortest way, the energy of bending is

    ½ B s₀ |κ - R κ₀|²,    κ · R κ₀ = (b · κ₀ - (a · κ₀)(b · t₀ + a · b/s)/(s + a · t₀))/s²

for a slope a of size s and r″ = b. To first order this is the energy of
`spacemap_vtk.textile.rods.stiffness.set_stiffness`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.yarns import Samples


class SetShape(NamedTuple):
    """Slopes and curvatures of samples of set yarns."""

    speed: Floats
    """(S,) s₀, the length of r′ [m]."""
    tangent: Floats
    """(S, 3) t₀."""
    curvature: Floats
    """(S, 3) κ₀ [1/m]."""

    @classmethod
    def from_flat_cell(cls, samples: Samples, z: Floats) -> SetShape:
        """Compute the shape of the yarns of a flat cell from its unknowns z, shape (N,)."""
        samples = samples._replace(turn=0.0)
        a, b = samples.slopes(z), samples.bends(z)
        speed = np.linalg.norm(a, axis=1)
        tangent = a / speed[:, None]
        across = b - (tangent * b).sum(axis=1)[:, None] * tangent
        return cls(speed, tangent, across / speed[:, None] ** 2)

    def curvature_along(self, a: Floats, b: Floats) -> Jet:
        """Compute κ · R κ₀ with its derivatives by a and b."""
        nothing = np.zeros_like(a)
        square, mixed = _dot(a, a), _dot(a, b)
        size = square.power(0.5)
        lean = _linear(a, self.curvature, nothing)
        bend = _linear(b, nothing, self.curvature)
        ahead = _linear(b, nothing, self.tangent) + mixed * size.power(-1.0)
        whole = (size + _linear(a, self.tangent, nothing)).power(-1.0)
        return (bend - lean * ahead * whole) * square.power(-1.0)


class Jet(NamedTuple):
    """A function of a and b at samples, with its first and second derivatives."""

    value: Floats
    """(S,)"""
    slope: Floats
    """(S, 6)"""
    bend: Floats
    """(S, 6, 6)"""

    def __add__(self, other: Jet) -> Jet:  # type: ignore[override]
        return Jet(*(one + two for one, two in zip(self, other, strict=True)))

    def __sub__(self, other: Jet) -> Jet:
        return Jet(*(one - two for one, two in zip(self, other, strict=True)))

    def __mul__(self, other: Jet) -> Jet:  # type: ignore[override]
        one, two = self.value[:, None], other.value[:, None]
        mixed = self.slope[:, :, None] * other.slope[:, None]
        return Jet(
            self.value * other.value,
            one * other.slope + two * self.slope,
            one[..., None] * other.bend + two[..., None] * self.bend + mixed + mixed.swapaxes(1, 2),
        )

    def power(self, exponent: float) -> Jet:
        """Raise to a power."""
        value = self.value**exponent
        first = exponent * value / self.value
        second = (exponent - 1.0) * first / self.value
        square = self.slope[:, :, None] * self.slope[:, None]
        return Jet(
            value,
            first[:, None] * self.slope,
            first[:, None, None] * self.bend + second[:, None, None] * square,
        )


def _linear(vectors: Floats, by_a: Floats, by_b: Floats) -> Jet:
    """Return the product of a or b with a constant vector, which is its derivative."""
    slope = np.concatenate([by_a, by_b], axis=1)
    value = (vectors * (by_a + by_b)).sum(axis=1)
    return Jet(value, slope, np.zeros((*slope.shape, 6)))


def _dot(a: Floats, b: Floats) -> Jet:
    """Return a · b, or a · a if both are the same array."""
    bend = np.zeros((len(a), 6, 6))
    if a is b:
        bend[:, :3, :3] = 2.0 * np.eye(3)
        return Jet((a * a).sum(axis=1), np.concatenate([2.0 * a, 0.0 * a], axis=1), bend)
    bend[:, :3, 3:] = bend[:, 3:, :3] = np.eye(3)
    return Jet((a * b).sum(axis=1), np.concatenate([b, a], axis=1), bend)
