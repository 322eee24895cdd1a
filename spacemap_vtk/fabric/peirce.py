"""Peirce's geometry of plain cloth: round yarns that bend over each other without being squeezed.

Between two neighbouring crossings a yarn runs arc - straight - arc. The arcs have the angle
theta and radii that sum up to D, the sum of the two yarn diameters; then, over the spacing p of
the crossings and the height h by which the axis changes,

    p = D sin(theta) + s cos(theta)        h = D (1 - cos(theta)) + s sin(theta)

with the straight length s. The warp bends over the weft spacing p2 with h1, the weft over the
warp spacing p1 with h2, and h1 + h2 = D because the yarns touch where they cross.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45. His
equations are solved for theta here in closed form: with t = tan(theta/2) both give
t**2 (2D - h) - 2 p t + h = 0.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.naming import Naming, in_words
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.units import metres

#: Rounding allowed in the square of the straight length, over D**2. Clamping inside it moves the
#: yarn by about as much, times D.
JAM = 1e-12
#: A straight length whose square is below this, over D**2, is taken for zero: it would be a sliver.
_SLIVER = 1e-14
#: Below this tan(theta/2) the series of t - arctan(t) is better than the difference.
_SERIES_BELOW = 0.1


class Crimp(NamedTuple):
    """How a yarn bends between two neighbouring crossings where it changes side."""

    # Each field is a float64 array of the arguments' common shape, a scalar for scalars.

    theta: Floats
    """Angle of each arc, and slope of the straight length between them, in radians."""
    straight: Floats
    """Length s of the straight part, in metres."""
    length: Floats
    """Length l of the yarn's axis, in metres."""
    crimp: Floats
    """Crimp c = l / p - 1."""


def solve(spacing: ArrayLike, height: ArrayLike, diameter_sum: ArrayLike) -> Crimp:
    """Return angle, straight length, axis length and crimp of a yarn between two crossings."""
    p, h, d = np.broadcast_arrays(
        np.asarray(spacing, np.float64),
        np.asarray(height, np.float64),
        np.asarray(diameter_sum, np.float64),
    )
    square = _straight_squared(p, h, d)
    refused = ~((square >= -JAM * d * d) & (h >= 0) & np.isfinite(square))
    if refused.any():
        where = int(np.argmax(refused))
        _refuse(float(p.flat[where]), float(h.flat[where]), float(d.flat[where]))
    s = np.sqrt(np.where(square > _SLIVER * d * d, square, 0.0))
    # p + s is 0 only for crossings on one spot
    theta = 2.0 * np.arctan2(h, p + s)
    length = d * theta + s
    # l - p = h t - 2 D (t - arctan t), because p - s = t (2D - h): nothing large is subtracted
    t = np.tan(0.5 * theta)
    excess = h * t - 2.0 * d * _minus_arctan(t)
    crimp = np.divide(excess, p, out=np.zeros_like(excess), where=p > 0)
    return Crimp(theta[()], s[()], length[()], crimp[()])


def feasible_height(
    warp_spacing: float, weft_spacing: float, diameter_sum: float
) -> tuple[float, float]:
    """Return the interval of warp crimp heights h1 that leave room for both families."""
    return (
        _least_height(warp_spacing, diameter_sum),
        diameter_sum - _least_height(weft_spacing, diameter_sum),
    )


def balanced_height(warp_spacing: float, weft_spacing: float, diameter_sum: float) -> float:
    """Return the middle of the feasible interval of the warp crimp height h1."""
    low, high = feasible_height(warp_spacing, weft_spacing, diameter_sum)
    return 0.5 * (low + high)


def largest_diameter_sum(warp_spacing: float, weft_spacing: float) -> float:
    """Return the largest sum of diameters that can be woven at given spacings: a jammed cloth."""
    # over the larger spacing, so that the squares of tiny lengths stay normal numbers
    scale = max(warp_spacing, weft_spacing)
    a, b = (warp_spacing / scale) ** 2, (weft_spacing / scale) ** 2
    return scale * sqrt((a + b + 2.0 * sqrt(a * a - a * b + b * b)) / 3.0)


def check_height(
    warp_spacing: float,
    weft_spacing: float,
    diameter_sum: float,
    height: float,
    names: Naming = in_words,
) -> None:
    """Refuse a crimp height h1 that leaves no room for the warp or the weft."""
    crimp_height, diameter = names("crimp_height", 0), names("diameter", 0)
    d, p1, p2 = diameter_sum, warp_spacing, weft_spacing
    low, high = feasible_height(p1, p2, d)
    middle = balanced_height(p1, p2, d)
    if _jammed(p1, p2, middle, d):
        raise GeometryError(
            f"the cloth is jammed at every {crimp_height}: the weft needs at least "
            f"{metres(low)}, the warp at most {metres(high)}",
            key=diameter,
            allowed=f"{diameter} + {names('diameter', 1)} up to "
            f"{metres(largest_diameter_sum(p1, p2))} at these spacings, not {metres(d)}",
            cure="Make the yarns thinner or a spacing larger",
        )
    inside = -JAM * d <= height <= (1.0 + JAM) * d
    if not inside or _jammed(p1, p2, height, d):
        side = "warp" if height > middle else "weft"
        # printed a little inside, so that a bound copied from the message is accepted
        margin = 5e-6 * d if high - low > 1e-4 * d else 0.0
        shown_low = metres(low + margin) if low > 0.0 else "0 mm"
        raise GeometryError(
            f"the cloth is jammed: no room for the {side} to bend at a height of {metres(height)}",
            key=crimp_height,
            value=height,
            allowed=f"{shown_low} to {metres(high - margin if high < d else high)}",
            cure=f"Leave it out for the middle of these, {metres(middle)}; thinner yarns or wider "
            "spacings allow more",
        )


def _straight_squared(p: NDArray, h: NDArray, d: NDArray) -> Floats:
    with np.errstate(invalid="ignore", over="ignore"):
        result: Floats = p * p - h * (2.0 * d - h)
    return result


def _jammed(p1: float, p2: float, height: float, d: float) -> bool:
    # by the squares, not by the interval: its roots lose half the digits where D is nearly p
    square = _straight_squared(np.array([p2, p1]), np.array([height, d - height]), np.array(d))
    return not bool(np.all(square >= -JAM * d * d))


def _least_height(p: float, d: float) -> float:
    square = (d - p) * (d + p)
    return sqrt(square) if square > JAM * d * d else 0.0


def _minus_arctan(t: NDArray) -> Floats:
    """Return t - arctan(t) for t >= 0, without loss where t is small."""
    small = np.minimum(t, _SERIES_BELOW) ** 2
    series = np.zeros_like(small)
    for n in range(17, 1, -2):
        series = small * (1.0 / n - series)
    return np.where(t < _SERIES_BELOW, t * series, t - np.arctan(t))


def _refuse(p: float, h: float, d: float) -> None:
    allowed = "finite lengths"
    if isfinite(p + h + d) and d >= 0.0:
        allowed = f"a height of 0 m to {metres(d - _least_height(p, d))}"
    raise GeometryError(
        f"a yarn over a spacing of {metres(p)} cannot bend by this height where the sum of "
        f"diameters is {metres(d)}",
        key="height",
        value=h,
        allowed=allowed,
        cure="Less height, a wider spacing or thinner yarns",
    )
