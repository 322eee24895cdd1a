"""Peirce's geometry of plain cloth: round yarns that bend over each other and are not squeezed.

Between two neighbouring crossings a yarn runs arc - straight - arc. The arcs have the angle
theta, and the sum of their radii is D, the sum of the two yarn diameters. Over the spacing p of the
crossings the height of the axis changes by h:

    p = D sin(theta) + s cos(theta)        h = D (1 - cos(theta)) + s sin(theta)

with the straight length s. The warp bends over the weft spacing p2 with h1, and the weft over the
warp spacing p1 with h2. h1 + h2 = D because the yarns touch where they cross.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45. His
equations are solved for theta in closed form: with t = tan(theta/2) both give
t**2 (2D - h) - 2 p t + h = 0.

`solve` and the functions after it refuse jammed yarns. `solve_gaps` and the functions after it
handle many gaps at once and refuse nothing. Their arrays have the families first, (2, n): the gap
of the warp over picks, that of the weft over ends.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.weave.families import QuantityNames, quantity_name
from spacemap_vtk.units import format_length

#: Rounding tolerance of the square of the straight length, over D**2. A square within it is set to
#: 0, which moves the yarn by about this tolerance times D.
JAM = 1e-12
#: A straight length whose square is below this, over D**2, counts as zero; it would be a sliver.
_SLIVER = 1e-14
#: Below this tan(theta/2) the series of t - arctan(t) is more accurate than the difference.
_SERIES_BELOW = 0.1
#: Tolerance of the squares of heights, over D**2; Newton's method uses them because lengths are
#: almost linear in them.
_TOLERANCE = 1e-7
#: Height over D below which a yarn is straight.
_STRAIGHT = 1e-9


class Crimp(NamedTuple):
    """Bending of a yarn between two neighbouring crossings where it changes side."""

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
    """Compute angle, straight length, axis length and crimp of a yarn between two crossings."""
    p, h, d = np.broadcast_arrays(
        np.asarray(spacing, np.float64),
        np.asarray(height, np.float64),
        np.asarray(diameter_sum, np.float64),
    )
    square = _straight_squared(p, h, d)
    refused = ~((square >= -JAM * d * d) & (h >= 0) & np.isfinite(square))
    if refused.any():
        where = int(np.argmax(refused))
        _refuse_height(float(p.flat[where]), float(h.flat[where]), float(d.flat[where]))
    s = np.sqrt(np.where(square > _SLIVER * d * d, square, 0.0))
    # p + s is 0 only if both crossings are at the same point.
    theta = 2.0 * np.arctan2(h, p + s)
    length = d * theta + s
    # l - p = h t - 2 D (t - arctan t), because p - s = t (2D - h). This subtracts no large numbers.
    t = np.tan(0.5 * theta)
    excess = h * t - 2.0 * d * _subtract_arctan(t)
    crimp = np.divide(excess, p, out=np.zeros_like(excess), where=p > 0)
    return Crimp(theta[()], s[()], length[()], crimp[()])


def feasible_height(
    warp_spacing: float, weft_spacing: float, diameter_sum: float
) -> tuple[float, float]:
    """Compute the interval of warp crimp heights h1 that leave room for both families."""
    return (
        _least_height(warp_spacing, diameter_sum),
        diameter_sum - _least_height(weft_spacing, diameter_sum),
    )


def balanced_height(warp_spacing: float, weft_spacing: float, diameter_sum: float) -> float:
    """Compute the middle of the feasible interval of the warp crimp height h1."""
    low, high = feasible_height(warp_spacing, weft_spacing, diameter_sum)
    return 0.5 * (low + high)


def largest_diameter_sum(warp_spacing: float, weft_spacing: float) -> float:
    """Compute the largest sum of diameters that can be woven at given spacings (jammed cloth)."""
    # Relative to the larger spacing, so that squares of tiny lengths do not underflow.
    scale = max(warp_spacing, weft_spacing)
    a, b = (warp_spacing / scale) ** 2, (weft_spacing / scale) ** 2
    return scale * sqrt((a + b + 2.0 * sqrt(a * a - a * b + b * b)) / 3.0)


def check_height(
    warp_spacing: float,
    weft_spacing: float,
    diameter_sum: float,
    height: float,
    names: QuantityNames = quantity_name,
) -> None:
    """Refuse a crimp height h1 that leaves no room for the warp or the weft."""
    crimp_height, diameter = names("crimp_height", 0), names("diameter", 0)
    d, p1, p2 = diameter_sum, warp_spacing, weft_spacing
    low, high = feasible_height(p1, p2, d)
    middle = balanced_height(p1, p2, d)
    if _is_jammed(p1, p2, middle, d):
        raise GeometryError(
            f"the cloth is jammed at every {crimp_height}: the weft needs at least "
            f"{format_length(low)}, the warp at most {format_length(high)}",
            key=diameter,
            allowed=f"{diameter} + {names('diameter', 1)} up to "
            f"{format_length(largest_diameter_sum(p1, p2))} at these spacings, "
            f"not {format_length(d)}",
            cure="Use thinner yarns or a larger spacing",
        )
    inside = -JAM * d <= height <= (1.0 + JAM) * d
    if not inside or _is_jammed(p1, p2, height, d):
        side = "warp" if height > middle else "weft"
        # Bounds are printed slightly inside, so that one copied from the message is accepted.
        margin = 5e-6 * d if high - low > 1e-4 * d else 0.0
        shown_low = format_length(low + margin) if low > 0.0 else "0 mm"
        raise GeometryError(
            f"the cloth is jammed: no room for the {side} to bend at a height of "
            f"{format_length(height)}",
            key=crimp_height,
            value=height,
            allowed=f"{shown_low} to {format_length(high - margin if high < d else high)}",
            cure=f"Leave it out to use the middle, {format_length(middle)}; thinner yarns or wider "
            "spacings allow more",
        )


def _straight_squared(p: NDArray, h: NDArray, d: NDArray) -> Floats:
    with np.errstate(invalid="ignore", over="ignore"):
        result: Floats = p * p - h * (2.0 * d - h)
    return result


def _is_jammed(p1: float, p2: float, height: float, d: float) -> bool:
    # Compare squares: the roots in the interval lose half the digits where D is almost p.
    square = _straight_squared(np.array([p2, p1]), np.array([height, d - height]), np.array(d))
    return not bool(np.all(square >= -JAM * d * d))


def _least_height(p: float, d: float) -> float:
    square = (d - p) * (d + p)
    return sqrt(square) if square > JAM * d * d else 0.0


def _subtract_arctan(t: NDArray) -> Floats:
    """Compute t - arctan(t) for t >= 0 without loss of digits for small t."""
    small = np.minimum(t, _SERIES_BELOW) ** 2
    series = np.zeros_like(small)
    for n in range(17, 1, -2):
        series = small * (1.0 / n - series)
    return np.where(t < _SERIES_BELOW, t * series, t - np.arctan(t))


def _refuse_height(p: float, h: float, d: float) -> None:
    allowed = "finite lengths"
    if isfinite(p + h + d) and d >= 0.0:
        allowed = f"a height of 0 m to {format_length(d - _least_height(p, d))}"
    raise GeometryError(
        f"a yarn over a spacing of {format_length(p)} cannot bend by this height where the sum of "
        f"diameters is {format_length(d)}",
        key="height",
        value=h,
        allowed=allowed,
        cure="Use less height, a wider spacing or thinner yarns",
    )


class Gap(NamedTuple):
    """Peirce's figures of a yarn between two crossings, without checks."""

    theta: Floats
    straight: Floats
    length: Floats
    sin: Floats
    cos: Floats
    half: Floats
    """The tangent of half of theta."""


def solve_gaps(room: Floats, height: Floats, distance: Floats) -> Gap:
    """Compute Peirce's figures; past a jam there is no straight part."""
    # Few arrays are alive at once: allocating memory anew costs as much as the arithmetic.
    s = room * room
    s -= height * (2.0 * distance - height)
    np.sqrt(np.maximum(s, 0.0, out=s), out=s)
    t = room + s
    np.divide(height, t, out=t)
    theta, share = np.arctan(t), t * t
    theta *= 2.0
    share += 1.0
    np.divide(2.0, share, out=share)
    return Gap(theta, s, distance * theta + s, t * share, share - 1.0, t)


def jam_height(room: Floats, distance: Floats) -> Floats:
    """Compute the height at which no straight part is left; at most D."""
    room = np.minimum(room, distance)
    # This is D - sqrt(D**2 - p**2), without subtracting large numbers.
    return room**2 / (distance + np.sqrt((distance - room) * (distance + room)))


def taut_height(room: Floats, length: Floats, distance: Floats) -> Floats:
    """Compute heights at which yarns have the given lengths; 0 for yarns that are too short."""
    shape = room.shape
    most = jam_height(room, distance).ravel() ** 2
    live: Ints = np.arange(room.size)
    p, goal, d = room.ravel(), length.ravel(), distance.ravel()
    # Start with Peirce's approximation, c = (9/16) (h/p)**2, which is off by some per cent.
    square = np.minimum(16.0 / 9.0 * p * np.maximum(goal - p, 0.0), most)
    result = np.empty_like(square)
    for _ in range(40):
        h = np.sqrt(square)
        s = np.sqrt(np.maximum(p * p - h * (2.0 * d - h), 0.0))
        reach = p + s
        t = h / reach
        # The length is almost linear in h**2: d l / d(h**2) = sin(theta) / (2 h).
        step = (goal - 2.0 * d * np.arctan(t) - s) * reach * (1.0 + t * t)
        before, square = square, np.clip(square + step, 0.0, most)
        done = np.abs(square - before) <= _TOLERANCE * d * d
        if 8 * np.count_nonzero(done) > len(done):
            result[live[done]] = square[done]
            on = np.flatnonzero(~done)
            live = live[on]
            square, p, goal, d, most = (one[on] for one in (square, p, goal, d, most))
        if not len(live):
            break
    result[live] = square
    return np.sqrt(result).reshape(shape)


def taut_heights(
    room: Floats, length: Floats, height: Floats, floor: Floats, arcs: Floats
) -> Floats:
    """Compute heights (2, n) at which both yarns have the given lengths; crossings may flatten."""
    # `arcs` is the sum of the radii of both arcs of a gap over the sum of the heights.
    # Heights whose sum is below the floor only mean that D is at the floor. The start is the
    # solution for a larger D.
    result, live = np.empty_like(height), np.arange(height.shape[1])
    p, goal, ratio, least = room, length, arcs, _STRAIGHT * floor
    h = np.where(length > room, np.maximum(height, least), least)
    for _ in range(30):
        d = h[0] + h[1]
        gap = solve_gaps(p, h, ratio * d)
        b = ratio * (gap.theta - gap.sin)
        a = b + gap.sin
        # A yarn that is too short to bend at all is straight.
        missing = np.where(goal > p, goal - gap.length, 0.0)
        step = a[::-1] * missing - b * missing[::-1]
        step /= a[0] * a[1] - b[0] * b[1]
        # Newton's step in squares of heights, because lengths are almost linear in them.
        square, before = np.maximum(h * (h + 2.0 * step), 0.0), h
        h = np.maximum(np.sqrt(square), least)
        # Far below the floor the exact value does not matter.
        done = (np.abs(h * h - before * before) <= _TOLERANCE * d * d).all(axis=0) | (
            d <= 0.5 * floor
        )
        if 8 * np.count_nonzero(done) > len(done):
            result[:, live[done]] = h[:, done]
            on = np.flatnonzero(~done)
            live, least, floor = live[on], least[on], floor[on]
            h, p, goal, ratio = (one.take(on, axis=1) for one in (h, p, goal, ratio))
        if not len(live):
            return result
    result[:, live] = _bisect_taut_heights(p, goal, h.sum(axis=0), floor, ratio)
    return result


def _bisect_taut_heights(
    room: Floats, length: Floats, above: Floats, floor: Floats, arcs: Floats
) -> Floats:
    """Solve as `taut_heights` does, by bisection: a lower D leaves more height relative to it."""
    low, high = 0.5 * floor, np.maximum(2.0 * above, 2.0 * floor)
    for _ in range(50):
        middle = 0.5 * (low + high)
        height = taut_height(room, length, arcs * middle)
        enough = height.sum(axis=0) >= middle * (1.0 - 1e-12)
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return taut_height(room, length, arcs * low)
