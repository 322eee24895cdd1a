"""How a crossing resists being flattened: linear, by van Wyk's law, or by a measured curve.

With x = D/D₀, the distance of the axes over that at rest, the energy of a crossing's contact is
k D₀ u(x). The axes are D/2 apart, so that the contact force is -2 k u'(x). All crossings of a cloth
share the function u.

Source: C. M. van Wyk, "Note on the Compressibility of Wool", J. Textile Inst. 37 (1946) T285: the
pressure of a mass of fibres is K E (φ³ - φ₀³), with E the modulus of a fibre and φ the share of
fibre in the volume. K was measured on wool in bulk; for yarns at crossings no value was verified.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.force_curve import ForceCurve
from spacemap_vtk.ndarrays import Floats


class ContactLaw:
    """Force in proportion to the loss of thickness: u = (x - 1)²/2."""

    #: Numbers that state the law.
    numbers: Floats = np.zeros(0)

    def evaluate(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute u and its first two derivatives.

        Parameters
        ----------
        x : ndarray of float64, shape (n,)
            D/D₀.

        Returns
        -------
        tuple of 3 ndarray of float64, shape (n,)
            u, u' and u''.
        """
        loss = x - 1.0
        return 0.5 * loss * loss, loss, np.ones_like(x)

    def take(self, which: object, axis: int = -1) -> ContactLaw:
        """Return the law itself, which is the same for all crossings that may be selected.

        Parameters
        ----------
        which : object
            Crossings, as of an array's method of this name.
        axis : int
            Axis, likewise.

        Returns
        -------
        ContactLaw
            This law.
        """
        return self


class VanWykContact(ContactLaw):
    """Force c (x⁻³ - 1), with 2 k = c: pressed fibres have more contacts and shorter spans."""

    numbers = np.ones(1)

    def evaluate(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute u and its first two derivatives at x = D/D₀."""
        inverse = 1.0 / x
        square = inverse * inverse
        value = 0.5 * square + x - 1.5
        return value, 1.0 - square * inverse, 3.0 * square * square


class MeasuredContact(ContactLaw):
    """Force through measured points: relative loss of thickness 1 - x from 0 on, and force [N]."""

    def __init__(self, points: ArrayLike) -> None:
        self.numbers = np.array(points, np.float64)
        if self.numbers.ndim != 2 or self.numbers.shape[1] != 2:
            raise InputError("a curve of contact has pairs of numbers")
        loss, force = self.numbers.T
        if loss[0] > 0.0:
            loss, force = np.append(0.0, loss), np.append(0.0, force)
        if loss[0] < 0.0 or loss[-1] >= 1.0 or force[0] != 0.0:
            raise InputError(
                "a curve of contact states the loss of thickness over the thickness at rest, and "
                "the force in N",
                value=f"{loss[0]:g} to {loss[-1]:g}, first force {force[0]:g}",
                allowed="a loss from 0, without a force, to less than 1",
            )
        self._curve = ForceCurve(loss, force)
        if not self._curve.evaluate(np.zeros(1))[2][0] > 0.0:
            raise InputError(
                "the curve of contact begins without stiffness",
                value=f"{loss[1]:g}, {force[1]:g}",
                cure="Add a point at a small loss of thickness",
            )

    def evaluate(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute u and its first two derivatives at x = D/D₀."""
        energy, force, slope = self._curve.evaluate(1.0 - x)
        return energy, -force, slope
