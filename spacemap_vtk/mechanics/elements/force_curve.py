"""A measured curve of force as a smooth function, with its energy."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats


class ForceCurve:
    """Curve of force through points, monotone between them, with the energy of its force.

    Parameters
    ----------
    places : ndarray of float64, shape (n,)
        Where the force was measured, ascending; n is at least 2.
    forces : ndarray of float64, shape (n,)
        Forces there, which must not fall.

    Raises
    ------
    InputError
        The points do not ascend, or the force falls.

    Notes
    -----
    The curve is the monotone cubic of F. N. Fritsch and R. E. Carlson, SIAM J. Numer. Anal. 17
    (1980) 238. Beyond the first and the last point it goes on along its tangents there.
    """

    def __init__(self, places: Floats, forces: Floats) -> None:
        x, f = np.asarray(places, np.float64), np.asarray(forces, np.float64)
        if x.ndim != 1 or x.shape != f.shape or len(x) < 2 or not np.isfinite([x, f]).all():
            raise InputError("a curve of force needs at least two points")
        if (np.diff(x) <= 0.0).any():
            number = int((np.diff(x) <= 0.0).argmax())
            raise InputError(f"point {number + 2} of the curve is not beyond the one before it")
        if (np.diff(f) < 0.0).any():
            number = int((np.diff(f) < 0.0).argmax())
            raise InputError(
                f"the force falls from point {number + 1} to point {number + 2} of the curve",
                value=f"{f[number]:g}, {f[number + 1]:g}",
                cure="Leave out the points after which the material tears or slips",
            )
        from scipy.interpolate import PchipInterpolator

        force = PchipInterpolator(x, f)
        #: First and last place.
        self.first, self.last = float(x[0]), float(x[-1])
        self._parts = force.antiderivative(), force, force.derivative()

    def evaluate(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute energy, force and slope.

        Parameters
        ----------
        x : ndarray of float64, shape (n,)
            Any places.

        Returns
        -------
        tuple of 3 ndarray of float64, shape (n,)
            The integral of the force from the first point on, the force, and its derivative.
        """
        inside = np.clip(x, self.first, self.last)
        over = x - inside
        energy, force, slope = (np.asarray(part(inside)) for part in self._parts)
        return energy + (force + 0.5 * slope * over) * over, force + slope * over, slope
