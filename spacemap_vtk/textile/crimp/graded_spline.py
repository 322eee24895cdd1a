"""Cubic splines whose knots are close to each other at zero and far apart elsewhere.

The coefficients of Schoenberg's spline are the values of a function at the averages of three knots.
The spline is convex where the function is, and where the function has a kink, the spline has no
curvature of the wrong sign beside it, as an interpolating one has. Its error is r²/3 of a smooth
function's second-order part, with r the ratio of the distance of knots to their distance from zero.

Source: I. J. Schoenberg, "On Spline Functions", in Inequalities (1967) 255.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints


class GradedKnots:
    """Knots of a cubic spline for |x| up to `reach`, equally spaced in asinh(x/fine)."""

    # `ratio` is the distance of neighbouring knots, over x where x is large and over `fine` at
    # zero. Beyond `reach` the last cubic goes on.
    def __init__(self, reach: float, fine: float, ratio: float) -> None:
        self._fine, self._ratio = fine, ratio
        self._count = int(np.ceil(np.arcsinh(reach / fine) / ratio))
        knots = fine * np.sinh(ratio * np.arange(-self._count - 3, self._count + 4))
        self.knots: Floats = knots
        #: Places at which the values of a function are the coefficients.
        self.places: Floats = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
        #: First knots of the cells.
        self._starts = knots[3:-4]

    @property
    def step(self) -> float:
        """Distance of the knots at zero."""
        return self._fine * float(np.sinh(self._ratio))

    def find_cells(self, x: Floats) -> tuple[Ints, Floats]:
        """Find the cell of each place, and the distance from its first knot."""
        found = np.arcsinh(x / self._fine) / self._ratio + self._count
        cell = np.clip(found.astype(np.int64), 0, len(self._starts) - 1)
        return cell, x - self._starts.take(cell)

    def cubics(self, coefficients: Floats, axis: int = 0) -> Floats:
        """Compute the cubics of the cells from coefficients along an axis, lowest power first."""
        from scipy.interpolate import BSpline

        spline = BSpline(self.knots, coefficients, 3, axis=axis)
        return np.stack([spline(self._starts, m) / (1.0, 1.0, 2.0, 6.0)[m] for m in range(4)])
