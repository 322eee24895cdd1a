"""Cubic splines whose knots are close to each other at zero and far apart elsewhere.

They approximate functions with kinks: the first guess at a coefficient is the function's value at
the average of three knots (Schoenberg's spline), with which the spline is convex where the function
is. An interpolating spline would swing beside a kink, with curvature of the wrong sign. What the
guess gets wrong is proportional to the second derivative; it is corrected by the smallest of three
neighbouring estimates, which leaves kinks as they are and makes the spline exact for parabolas.

Source: I. J. Schoenberg, "On Spline Functions", in Inequalities (1967) 255.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints

#: Corrections until a spline passes through values; each leaves a third of what is left.
_ROUNDS = 30


class GradedKnots:
    """Knots of a cubic spline for |x| up to `reach`."""

    # Near zero the distance of the knots is `ratio` times `fine`; then it grows in proportion to x,
    # as `ratio` times x, up to `widest`. Beyond `reach` the last cubic goes on.

    def __init__(self, reach: float, fine: float, ratio: float, widest: float) -> None:
        self._fine, self._ratio, self._widest = fine, ratio, widest
        #: Where the distance has become `widest`, and the number of the knot there.
        self._turn = fine * float(np.sqrt(max((widest / (ratio * fine)) ** 2 - 1.0, 0.0)))
        self._turn_number = float(np.arcsinh(self._turn / fine)) / ratio
        self._count = int(np.ceil(self._numbers(np.array([reach]))[0]))
        numbers = np.arange(-self._count - 3.0, self._count + 4.0)
        graded = np.minimum(np.abs(numbers), self._turn_number)
        beyond = np.abs(numbers) - graded
        knots = np.copysign(fine * np.sinh(ratio * graded) + widest * beyond, numbers)
        self.knots: Floats = knots
        #: Places at which the values of a function are the coefficients.
        self.places: Floats = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
        #: First knots of the cells.
        self._starts = knots[3:-4]

    def coefficients(self, values: Floats, axis: int = 0) -> Floats:
        """Compute the coefficients of a spline near values at `places` along an axis."""
        f, t, x = np.moveaxis(values, axis, 0), self.knots, self.places
        products = (t[1:-3] * t[2:-2] + t[1:-3] * t[3:-1] + t[2:-2] * t[3:-1]) / 3.0
        slopes = np.diff(f, axis=0) / _along(np.diff(x), f)
        bends = np.diff(slopes, axis=0) / _along(0.5 * (x[2:] - x[:-2]), f)
        three = np.stack([bends[:-2], bends[1:-1], bends[2:]])
        least = np.where((three > 0.0).all(axis=0), three.min(axis=0), 0.0)
        least = np.where((three < 0.0).all(axis=0), three.max(axis=0), least)
        result = f.copy()
        result[2:-2] += 0.5 * _along((products - x * x)[2:-2], f) * least
        return np.moveaxis(result, 0, axis)

    def interpolate(self, values: Floats) -> Floats:
        """Compute the coefficients of the spline through values (n,) at `places`."""
        from scipy.interpolate import BSpline

        result = values.copy()
        for _ in range(_ROUNDS):
            left = values - BSpline(self.knots, result, 3)(self.places)
            result[3:-3] += left[3:-3]  # the others are outside of the knots
        return result

    def find_cells(self, x: Floats) -> tuple[Ints, Floats]:
        """Find the cell of each place, and the distance from its first knot."""
        found = self._numbers(x) + self._count
        cell = np.clip(found.astype(np.int64), 0, len(self._starts) - 1)
        return cell, x - self._starts.take(cell)

    def _numbers(self, x: Floats) -> Floats:
        """Compute the numbers of the knots at places, with fractions between them."""
        size = np.abs(x)
        near = np.minimum(size, self._turn)
        numbers = np.arcsinh(near / self._fine) / self._ratio + (size - near) / self._widest
        return np.copysign(numbers, x)

    def cubics(self, coefficients: Floats, axis: int = 0) -> Floats:
        """Compute the cubics of the cells from coefficients along an axis, lowest power first."""
        from scipy.interpolate import BSpline

        spline = BSpline(self.knots, coefficients, 3, axis=axis)
        return np.stack([spline(self._starts, m) / (1.0, 1.0, 2.0, 6.0)[m] for m in range(4)])


def _along(values: Floats, like: Floats) -> Floats:
    """Shape values so that they run along the first axis of another array."""
    return values.reshape(-1, *(1,) * (like.ndim - 1))
