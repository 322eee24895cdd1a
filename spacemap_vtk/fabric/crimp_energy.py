"""Energy of a crossing whose yarns exchange crimp, and its least value, for many crossings at once.

Unknown are h1, the warp's crimp height, and D, twice the distance of the axes; the weft has
h2 = D - h1. Peirce's length l(p, h, D) is convex, and its derivatives need no more than theta:

    dl = cos(theta) dp + sin(theta) dh + (theta - sin(theta)) dD
    s dtheta = -sin(theta) dp + cos(theta) dh + (1 - cos(theta)) dD =: q
    d2l = q q / s

so that the energy of yarns that pull only is convex, and Newton's method safe. Arrays have the
families first, (2, n): the gap of the warp over picks, that of the weft over ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Over D: a height below which a yarn is straight, and a straight part that is no part any more.
_LEAST, _SLIVER = 1e-9, 1e-7
#: Steps below this share of D end Newton's method, for the next one would be its square.
_ENOUGH = 1e-8


class Gap(NamedTuple):
    """A yarn between two crossings: Peirce's figures, without refusals."""

    theta: Array
    straight: Array
    length: Array
    sin: Array
    cos: Array


def bend(room: Array, height: Array, distance: Array) -> Gap:
    """Return Peirce's figures; past the jam those of no straight part."""
    s = np.sqrt(np.maximum(room * room - height * (2.0 * distance - height), 0.0))
    t = height / (room + s)
    theta, share = 2.0 * np.arctan(t), 1.0 / (1.0 + t * t)
    return Gap(theta, s, distance * theta + s, 2.0 * t * share, (1.0 - t * t) * share)


def jam_height(room: Array, distance: Array) -> Array:
    """Return the height at which no straight part is left, or the most there is, D."""
    room = np.minimum(room, distance)
    # D - sqrt(D**2 - p**2), and nothing large is subtracted
    height: Array = room**2 / (distance + np.sqrt((distance - room) * (distance + room)))
    return height


def taut_height(room: Array, length: Array, distance: Array) -> Array:
    """Return the heights at which yarns are as long as asked; 0 where they are too short."""
    shape = room.shape
    most = jam_height(room, distance).ravel()
    p, goal, d = room.ravel(), length.ravel(), distance.ravel()
    # Peirce's own approximation, c = (9/16) (h/p)**2, is off by some per cent
    square = np.minimum(16.0 / 9.0 * p * np.maximum(goal - p, 0.0), most * most)
    result, live = square.copy(), np.arange(len(p))
    for _ in range(40):
        h = np.sqrt(square)
        s = np.sqrt(np.maximum(p * p - h * (2.0 * d - h), 0.0))
        t = h / (p + s)
        # in h**2 the length is all but linear: d l / d(h**2) = sin(theta) / (2 h)
        step = (goal - 2.0 * d * np.arctan(t) - s) * (p + s) * (1.0 + t * t)
        fresh = np.clip(square + step, 0.0, most * most)
        result[live] = fresh
        going = np.abs(fresh - square) > 1e-13 * d * d
        if not going.any():
            break
        live, square = live[going], fresh[going]
        p, goal, d, most = p[going], goal[going], d[going], most[going]
    return np.sqrt(result).reshape(shape)


def both_taut(room: Array, length: Array, height: Array, floor: Array) -> Array:
    """Return heights (2, n) at which both yarns are as long as asked, by crossings that flatten."""
    # Heights whose sum is below the floor say no more than that; the start is that of a larger D.
    result, live = height.copy(), np.arange(height.shape[1])
    # a yarn that is too short to bend at all is straight
    p, goal, least = room, np.maximum(length, room), _LEAST * floor
    h = np.maximum(height, least)
    for _ in range(30):
        d = h.sum(axis=0)
        gap = bend(p, h, d)
        a, b = gap.theta, gap.theta - gap.sin
        missing = goal - gap.length
        step = a[::-1] * missing - b * missing[::-1]
        step /= a[0] * a[1] - b[0] * b[1]
        # Newton's step, taken in squares: lengths are all but linear in them
        fresh = np.maximum(np.sqrt(np.maximum(h * (h + 2.0 * step), 0.0)), least)
        result[:, live] = fresh
        going = (np.abs(fresh - h) > 1e-13 * d).any(axis=0)
        if not going.any():
            return result
        h, p, goal = fresh[:, going], p[:, going], goal[:, going]
        live, least = live[going], least[going]
    result[:, live] = _both_taut_surely(p, goal, h.sum(axis=0), floor[live])
    return result


def _both_taut_surely(room: Array, length: Array, above: Array, floor: Array) -> Array:
    """Return what `both_taut` does, by halving: the lower D, the more height there is for it."""
    low, high = 0.5 * floor, np.maximum(2.0 * above, 2.0 * floor)
    for _ in range(50):
        middle = 0.5 * (low + high)
        height = taut_height(room, length, np.broadcast_to(middle, room.shape))
        enough = height.sum(axis=0) >= middle
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return taut_height(room, length, np.broadcast_to(low, room.shape))


class CrimpEnergy(NamedTuple):
    """What a crossing's energy is made of."""

    # 1/2 tension (l - length)**2 of each yarn whose axis is longer than it, 1/2 contact (D -
    # full)**2, and hinge (theta - rest)**2 / D of each yarn.

    tension: Array
    """(2, n) EA over the yarn's length, in N/m."""
    contact: Array
    """(n,) In N/m."""
    hinge: Array
    """(2, n) B over the angle at rest, in N m2."""
    rest: Array
    """(2, n) Angles at rest."""
    full: Array
    """(n,) D at rest."""

    def some(self, which: NDArray) -> CrimpEnergy:
        """Return that of some crossings."""
        return CrimpEnergy(*(array[..., which] for array in self))


class Derivatives(NamedTuple):
    """Energy of crossings and its derivatives by what they are taken by."""

    value: Array
    """(n,) J"""
    slope: Array
    """(k, n)"""
    curve: Array
    """(k, k, n)"""


def derivatives(
    energy: CrimpEnergy,
    room: Array,
    length: Array,
    height: Array,
    distance: Array,
    along: tuple[Array, Array] | None = None,
) -> Derivatives:
    """Return the energy and its derivatives by (h1, D), or by (warp and weft stretch, h1, D)."""
    # `along` are d(room) and -d(length) by the stretch: spacing, and floats, of each yarn. A yarn
    # that is neither slack nor strained counts as pulling: the stiffness at rest is that of cloth
    # that is pulled.
    h = np.stack([height, distance - height])
    gap = bend(room, h, distance)
    theta, sin, cos = gap.theta, gap.sin, gap.cos
    s = np.maximum(gap.straight, _SLIVER * distance)
    over = gap.length - length
    pull = energy.tension * (over >= -1e-12 * length)
    force = pull * np.maximum(over, 0.0)
    squash = distance - energy.full
    value = 0.5 * (force * over).sum(axis=0) + 0.5 * energy.contact * squash**2

    by = [sin, theta - sin]  # of l, by h and D
    turn = [cos / s, (1.0 - cos) / s]  # of theta
    if along is not None:
        by.insert(0, cos * along[0] + along[1])
        turn.insert(0, -sin * along[0] / s)
    last = len(by) - 1
    first = [force * one for one in by]
    second = {
        (i, j): pull * by[i] * by[j] + force * s * turn[i] * turn[j]
        for j in range(last + 1)
        for i in range(j + 1)
    }
    if energy.hinge.any():
        hinge, bent = energy.hinge / distance, theta - energy.rest
        moment, work = 2.0 * hinge * bent, hinge * bent * bent
        value += work.sum(axis=0)
        # theta by i and j is change_i turn_j - turn_i thin_j
        change, thin = [-sin / s, sin / s], [(h - distance) / s**2, -h / s**2]
        if along is not None:
            change.insert(0, -cos * along[0] / s)
            thin.insert(0, room * along[0] / s**2)
        for (i, j), term in second.items():
            term += 2.0 * hinge * turn[i] * turn[j]
            term += moment * (change[i] * turn[j] - turn[i] * thin[j])
        for i in range(last + 1):
            first[i] += moment * turn[i]
            second[i, last] -= moment * turn[i] / distance
        second[last, last] += 2.0 * work / distance**2 - moment * turn[last] / distance
        first[last] -= work / distance
    slope, curve = _of_both(first, second, last)
    slope[-1] += energy.contact * squash
    curve[-1, -1] += energy.contact
    return Derivatives(value, slope, curve)


def _of_both(
    slope: list[Array], curve: dict[tuple[int, int], Array], last: int
) -> tuple[Array, Array]:
    """Put the yarns' derivatives by (stretch,) h, D together: the weft's h is D - h1."""
    h, n = last - 1, slope[0].shape[-1]
    hh, hd, dd = curve[h, h], curve[h, last], curve[last, last]
    k = 2 + 2 * h
    first, second = np.zeros((k, n)), np.zeros((k, k, n))
    first[-2] = slope[h][0] - slope[h][1]
    first[-1] = slope[last].sum(axis=0) + slope[h][1]
    second[-2, -2] = hh.sum(axis=0)
    second[-2, -1] = second[-1, -2] = hd[0] - hd[1] - hh[1]
    second[-1, -1] = dd.sum(axis=0) + 2.0 * hd[1] + hh[1]
    if h:
        first[:2] = slope[0]
        second[[0, 1], [0, 1]] = curve[0, 0]
        second[0, 2], second[0, 3] = curve[0, 1][0], curve[0, 2][0]
        second[1, 2], second[1, 3] = -curve[0, 1][1], curve[0, 1][1] + curve[0, 2][1]
        second[2:, :2] = second[:2, 2:].swapaxes(0, 1)
    return first, second


def least(
    energy: CrimpEnergy,
    room: Array,
    length: Array,
    start: tuple[Array, Array],
    most: Array,
    distances: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Return (h1, D) of the least energy, by Newton's method with damping."""
    # `most` bounds both heights, (2, n), beside the jam; `distances` bound D.
    low, high = distances
    result = np.empty((2, len(low)))
    live = np.arange(len(low))
    noise = 1e-18 * (energy.tension * length**2 + energy.hinge / energy.full).sum(axis=0)

    d = np.clip(start[1], low, high)
    h = np.clip(start[0], *_bounds(room, most, d))
    now, damping = derivatives(energy, room, length, h, d), np.zeros(len(low))
    for _ in range(80):
        to = _step(now, damping, room, most, h, d, low, high)
        then = derivatives(energy, room, length, *to)
        better = then.value <= now.value * (1.0 + 1e-12) + noise
        moved = np.maximum(np.abs(to[0] - h), np.abs(to[1] - d))
        done = (moved < _ENOUGH * d) & (better | (damping > 0.0))
        h, d = np.where(better, to[0], h), np.where(better, to[1], d)
        damping = np.where(better, 0.1 * damping, np.maximum(4.0 * damping, 0.5))
        damping[damping < 0.01] = 0.0
        result[:, live] = h, d
        if done.all():
            break
        now = Derivatives(*(np.where(better, b, a) for a, b in zip(now, then, strict=True)))
        if done.any():
            on = ~done
            live, h, d, low, high = live[on], h[on], d[on], low[on], high[on]
            room, length, most, noise = room[:, on], length[:, on], most[:, on], noise[on]
            damping, energy = damping[on], energy.some(on)
            now = Derivatives(*(array[..., on] for array in now))
    return result[0], result[1]


def _bounds(room: Array, most: Array, distance: Array) -> tuple[Array, Array]:
    """Return between which heights of the warp no yarn is jammed, nor past its most."""
    up = np.minimum(most, jam_height(room, np.broadcast_to(distance, room.shape)))
    low = distance - up[1]
    return low, np.maximum(up[0], low)


def _step(
    now: Derivatives,
    damping: Array,
    room: Array,
    most: Array,
    h: Array,
    d: Array,
    low: Array,
    high: Array,
) -> tuple[Array, Array]:
    """Return where Newton's damped step leads inside the bounds."""
    (gh, gd), curve = now.slope, now.curve
    # against a saddle: downhill along either variable
    tiny = np.finfo(float).tiny
    hh = np.maximum(np.abs(curve[0, 0]), tiny) * (1.0 + damping)
    hd, dd = curve[0, 1], np.abs(curve[1, 1])
    bottom, top = _bounds(room, most, d)
    held = ((h <= bottom) & (gh > 0.0)) | ((h >= top) & (gh < 0.0))
    # how D alone would go on, h following freely, or along the bound that holds it
    slide = np.where(held, _slide(room, most, h, d, bottom), -hd / hh)
    along = np.abs(dd * (1.0 + damping) + slide * (2.0 * hd + slide * hh))
    down = gd + slide * gh
    new = np.clip(d - down / np.maximum(along, 1e-9 * dd + tiny), low, high)
    move = np.where(held, slide * (new - d), -(gh + hd * (new - d)) / hh)
    return np.clip(h + move, *_bounds(room, most, new)), new


def _slide(room: Array, most: Array, h: Array, d: Array, bottom: Array) -> Array:
    """Return d h1 / d D along the bound that h1 lies on."""
    jam = jam_height(room, np.broadcast_to(d, room.shape))
    root = np.sqrt(np.maximum(d * d - room * room, (1e-3 * d) ** 2))
    change = np.where(most < jam, 0.0, np.where(room < d, 1.0 - d / root, 1.0))
    slide: Array = np.where(h <= bottom, 1.0 - change[1], change[0])
    return slide
