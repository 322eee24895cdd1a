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
#: Over the room: a straight part below which a yarn is near its jam.
_NEAR = 0.5
#: Steps below this share of D end Newton's method, for the next one would be its square; where
#: yarns that bend come near a jam, steps are small before that.
_ENOUGH, _ENOUGH_BENT = 1e-7, 1e-8
#: Likewise of squares of heights, in which lengths are all but linear, over D**2.
_ALIKE = 1e-7


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
    theta, share = 2.0 * np.arctan(t), 2.0 / (1.0 + t * t)
    return Gap(theta, s, distance * theta + s, t * share, share - 1.0)


def jam_height(room: Array, distance: Array) -> Array:
    """Return the height at which no straight part is left, or the most there is, D."""
    room = np.minimum(room, distance)
    # D - sqrt(D**2 - p**2), and nothing large is subtracted
    height: Array = room**2 / (distance + np.sqrt((distance - room) * (distance + room)))
    return height


def taut_height(room: Array, length: Array, distance: Array) -> Array:
    """Return the heights at which yarns are as long as asked; 0 where they are too short."""
    shape = room.shape
    most = jam_height(room, distance).ravel() ** 2
    live: NDArray[np.int64] = np.arange(room.size)
    p, goal, d = room.ravel(), length.ravel(), distance.ravel()
    # Peirce's own approximation, c = (9/16) (h/p)**2, is off by some per cent
    square = np.minimum(16.0 / 9.0 * p * np.maximum(goal - p, 0.0), most)
    result = np.empty_like(square)
    for _ in range(40):
        h = np.sqrt(square)
        s = np.sqrt(np.maximum(p * p - h * (2.0 * d - h), 0.0))
        reach = p + s
        t = h / reach
        # in h**2 the length is all but linear: d l / d(h**2) = sin(theta) / (2 h)
        step = (goal - 2.0 * d * np.arctan(t) - s) * reach * (1.0 + t * t)
        before, square = square, np.clip(square + step, 0.0, most)
        done = np.abs(square - before) <= _ALIKE * d * d
        if done.any():
            result[live[done]] = square[done]
            on = np.flatnonzero(~done)
            live = live[on]
            square, p, goal, d, most = (one[on] for one in (square, p, goal, d, most))
        if not len(live):
            break
    result[live] = square
    return np.sqrt(result).reshape(shape)


def both_taut(room: Array, length: Array, height: Array, floor: Array) -> Array:
    """Return heights (2, n) at which both yarns are as long as asked, by crossings that flatten."""
    # Heights whose sum is below the floor say no more than that; the start is that of a larger D.
    result, live = np.empty_like(height), np.arange(height.shape[1])
    p, goal, least = room, length, _LEAST * floor
    h = np.where(length > room, np.maximum(height, least), least)
    for _ in range(30):
        d = h[0] + h[1]
        gap = bend(p, h, d)
        a, b = gap.theta, gap.theta - gap.sin
        # a yarn that is too short to bend at all is straight
        missing = np.where(goal > p, goal - gap.length, 0.0)
        step = a[::-1] * missing - b * missing[::-1]
        step /= a[0] * a[1] - b[0] * b[1]
        # Newton's step, taken in squares: lengths are all but linear in them
        square, before = np.maximum(h * (h + 2.0 * step), 0.0), h
        h = np.maximum(np.sqrt(square), least)
        # pressed far past the floor it does not matter how far
        done = (np.abs(h * h - before * before) <= _ALIKE * d * d).all(axis=0) | (d <= 0.5 * floor)
        if done.any():
            result[:, live[done]] = h[:, done]
            on = np.flatnonzero(~done)
            live, least, floor = live[on], least[on], floor[on]
            h, p, goal = (one.take(on, axis=1) for one in (h, p, goal))
        if not len(live):
            return result
    result[:, live] = _both_taut_surely(p, goal, h.sum(axis=0), floor)
    return result


def _both_taut_surely(room: Array, length: Array, above: Array, floor: Array) -> Array:
    """Return what `both_taut` does, by halving: the lower D, the more height there is for it."""
    low, high = 0.5 * floor, np.maximum(2.0 * above, 2.0 * floor)
    for _ in range(50):
        middle = 0.5 * (low + high)
        height = taut_height(room, length, np.broadcast_to(middle, room.shape))
        enough = height.sum(axis=0) >= middle * (1.0 - 1e-12)
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
    """(2, n) Half of D times what an angle resists with at rest, in N m2."""
    rest: Array
    """(2, n) Angles at rest."""
    full: Array
    """(n,) D at rest."""

    def some(self, which: NDArray) -> CrimpEnergy:
        """Return that of some crossings."""
        return CrimpEnergy(*(array.take(which, axis=-1) for array in self))


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
    first, across = [force * one for one in by], force * s
    hinged = bool(energy.hinge.any())
    if hinged:
        hinge, bent = energy.hinge / distance, theta - energy.rest
        moment, work = 2.0 * hinge * bent, hinge * bent * bent
        value += work.sum(axis=0)
        across += 2.0 * hinge
    left, right = [pull * one for one in by], [across * one for one in turn]
    if hinged:
        # theta by i and j is change_i turn_j - turn_i thin_j
        lean, square = sin / s, s * s
        change, thin = [-lean, lean], [(h - distance) / square, -h / square]
        if along is not None:
            change.insert(0, -cos * along[0] / s)
            thin.insert(0, room * along[0] / square)
        turned = [moment * one for one in turn]
        right = [one + moment * two for one, two in zip(right, change, strict=True)]
    second = {
        (i, j): left[i] * by[j] + right[i] * turn[j] for j in range(last + 1) for i in range(j + 1)
    }
    if hinged:
        for (i, j), term in second.items():
            term -= turned[i] * thin[j]
        for i in range(last + 1):
            first[i] += turned[i]
            second[i, last] -= turned[i] / distance
        second[last, last] += 2.0 * work / distance**2 - turned[last] / distance
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
    """Return (h1, D) of the least energy, by Newton's method with a line search."""
    # `most` bounds both heights, (2, n), beside the jam; `distances` bound D.
    low, high = distances
    firm = low is high
    result, live, lost = np.empty((2, len(low))), np.arange(len(low)), np.ones(len(low), bool)
    hinged = bool(energy.hinge.any())
    whole, enough = (energy, room, length, most, low, high), _ENOUGH_BENT if hinged else _ENOUGH
    noise = 1e-18 * (energy.tension * length**2 + energy.hinge / energy.full).sum(axis=0)
    d = np.clip(start[1], low, high)
    bottom, top, _ = _bounds(room, most, d)
    # where both are jammed there is no way but to lower D
    if not firm and (tight := top - bottom < 1e-3 * d).any():
        d = np.where(tight, np.maximum(low, d - 0.1 * (high - low)), d)
        bottom, top, _ = _bounds(room, most, d)
    # at the jam itself bending has no slope to start from
    inside = 0.01 * hinged * (top - bottom)
    h = np.clip(start[0], bottom + inside, top - inside)
    now, part = derivatives(energy, room, length, h, d), np.ones(len(low))
    for _ in range(30):
        to, new = _step(now, hinged, part, room, most, h, d, low, high)
        done = np.maximum(np.abs(to - h), np.abs(new - d)) < enough * d
        if done.any():
            result[:, live[done]] = to[done], new[done]
            lost[live[done & (part > 0.1)]] = False
            on = np.flatnonzero(~done)
            live, part, noise, energy = live[on], part[on], noise[on], energy.some(on)
            h, d, low, to, new = (one[on] for one in (h, d, low, to, new))
            high = low if firm else high[on]
            room, length, most = (one.take(on, axis=1) for one in (room, length, most))
            now = Derivatives(*(one.take(on, axis=-1) for one in now))
        if not len(live):
            break
        then = derivatives(energy, room, length, to, new)
        better = then.value <= now.value * (1.0 + 1e-12) + noise
        if better.all():
            part = np.minimum(3.0 * part, 1.0)
        else:
            to, new = np.where(better, to, h), np.where(better, new, d)
            then = Derivatives(*(np.where(better, y, x) for x, y in zip(now, then, strict=True)))
            part = np.where(better, np.minimum(3.0 * part, 1.0), part / 3.0)
        h, d, now = to, new, then
    result[:, live] = h, d
    if not firm and (lost := lost & (whole[-2] < whole[-1])).any():
        left, (energy, *rest) = np.flatnonzero(lost), whole
        result[:, left] = _least_surely(
            energy.some(left), *(array[..., left] for array in (*rest, result))
        )
    return result[0], result[1]


def _least_surely(
    energy: CrimpEnergy,
    room: Array,
    length: Array,
    most: Array,
    low: Array,
    high: Array,
    start: Array,
) -> tuple[Array, Array]:
    """Return what `least` does, by a search for D alone (Illinois, and halving): h1 follows."""
    h = start[0]

    def slope(d: Array) -> Array:
        nonlocal h
        h, _ = least(energy, room, length, (h, d), most, (d, d))
        now = derivatives(energy, room, length, h, d)
        bottom, top, _ = _bounds(room, most, d)
        # only at h1 = 0 and h2 = 0 is it caught; else what it is off counts by its square
        curve = np.where(now.curve[0, 0] == 0.0, 1.0, now.curve[0, 0])
        along = np.where(h >= top, 1.0, np.where(h <= bottom, 0.0, -now.curve[0, 1] / curve))
        by: Array = now.slope[1] + along * now.slope[0]
        return by

    # not at the highest D itself: where both jam there h1 has no room to follow
    top, high = high, high - 1e-6 * (high - low)
    ends, values = [low, high], [slope(low), slope(high)]
    lowest, highest = values[0] >= 0.0, values[1] <= 0.0
    same = np.zeros(len(low))
    for turn in range(60):
        a, b = ends
        fa, fb = values
        part = np.clip(fa / np.where(fa == fb, 1.0, fa - fb), 0.02, 0.98) if turn % 3 else 0.5
        d = np.where(lowest, low, np.where(highest, high, a + part * (b - a)))
        if (b - a < 1e-9 * high).all():
            break
        f = slope(d)
        left = f < 0.0
        # the end that stays twice is halved
        fb = np.where(left, np.where(same > 0.0, 0.5 * fb, fb), f)
        fa = np.where(left, f, np.where(same < 0.0, 0.5 * fa, fa))
        same = np.where(left, 1.0, -1.0)
        settled = lowest | highest | (f == 0.0)
        ends = [np.where(left | settled, d, a), np.where(left & ~settled, b, d)]
        values = [fa, fb]
    d = np.where(d >= high, top, d)
    slope(d)
    return h, d


def _bounds(room: Array, most: Array, d: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return between which h1 no yarn is jammed nor past its most, and (2, n) which ends jam."""
    root = np.sqrt(np.maximum((d - room) * (d + room), 0.0))
    jam = d - root
    up = np.minimum(most, jam)
    low = d - up[1]
    return low, np.maximum(up[0], low), (room < d) & (jam <= most * (1.0 + 1e-9))


def _step(
    now: Derivatives,
    hinged: bool,
    part: Array,
    room: Array,
    most: Array,
    h: Array,
    d: Array,
    low: Array,
    high: Array,
) -> tuple[Array, Array]:
    """Return h1 and D after a part of Newton's step, inside their bounds."""
    # Where a straight part vanishes theta goes like the root of what is left. Near such an end h1
    # is what a variable u from 0 to 1 makes of its bounds, whose square is the distance from there.
    bottom, top, jams = _bounds(room, most, d)
    width = np.maximum(top - bottom, _LEAST * d)
    u = share = np.clip((h - bottom) / width, 0.0, 1.0)
    # near an end, or on it, h1 moves with it as D changes
    moves, some = np.stack([share >= 1.0, share <= 0.0]), False
    firm, (gh, gd), ((hh, hd), (_, dd)) = low is high, now.slope, now.curve
    gu, uu, ud = gh * width, hh * width**2, hd * width
    if hinged:
        heights = np.stack([h, d - h])
        near = jams & (room**2 - heights * (2.0 * d - heights) < (_NEAR * room) ** 2)
        ends, some = near[::-1], bool(near.any())
        moves |= near
    first: Array | float = 1.0
    if some:
        u = _inverse(share, ends)
        _, first, second = _shape(u, ends)
        uu, ud = uu * first**2 + gu * second, ud * first
        gu = gu * first
    if moving := not firm and bool(moves.any()):
        root = np.maximum(np.sqrt(np.maximum((d - room) * (d + room), 0.0)), 1e-3 * d)
        slope = jams * (1.0 - d / root) + (~jams & (room >= d) & (most >= d))
        bend = (moves & jams) * (room**2 / root**3)
        up, down = moves[0] * slope[0], moves[1] * (1.0 - slope[1])
        by_d = down + (up - down) * share
        gd = gd + gh * by_d
        ud += (hh * by_d * width + gh * (up - down)) * first
        dd = dd + 2.0 * hd * by_d + hh * by_d**2
        dd += gh * (bend[0] * share - bend[1] * (1.0 - share))
    # against a saddle: downhill along either variable
    tiny = np.finfo(float).tiny ** 0.5
    uu = np.maximum(np.abs(uu), tiny)
    held = ((u <= 0.0) & (gu >= 0.0)) | ((u >= 1.0) & (gu <= 0.0))
    move: Array | float = 0.0
    if not firm:
        slide = np.where(held, 0.0, -ud / uu)
        dd = np.abs(dd)
        along = np.maximum(np.abs(dd + slide * (2.0 * ud + slide * uu)), 1e-9 * dd + tiny)
        move = np.clip(d - (gd + slide * gu) / along, low, high) - d
    v = np.clip(u - np.where(held, 0.0, part * (gu + ud * move) / uu), 0.0, 1.0)

    new, lowest, highest = d, bottom, top
    if not firm:
        new = d + part * move
        lowest, highest, jams = _bounds(room, most, new)
    if moving:
        bottom, top = np.where(moves[1], lowest, bottom), np.where(moves[0], highest, top)
    to = bottom + (top - bottom) * (_shape(v, ends)[0] if some else v)
    if hinged:
        # where there is bending not all the way to a jam, where it would be caught
        gap = 0.05 * (highest - lowest)
        lowest = lowest + jams[1] * gap * share
        highest = highest - jams[0] * gap * (1.0 - share)
    return np.clip(to, lowest, highest), new


def _shape(u: Array, ends: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return how far h1 is from its low to its high bound, and the derivatives by u."""
    low, high = ends
    cubic = -2.0 * (low & high)
    square = 1.0 * low - 1.0 * high - 1.5 * cubic
    line = 1.0 - square - cubic
    return (
        u * (line + u * (square + u * cubic)),
        line + u * (2.0 * square + 3.0 * u * cubic),
        2.0 * square + 6.0 * u * cubic,
    )


def _inverse(share: Array, ends: NDArray[np.bool_]) -> Array:
    """Return the u of that share."""
    low, high = ends
    result = share.copy()
    one, other, both = (np.flatnonzero(x) for x in (low & ~high, high & ~low, low & high))
    result[one] = np.sqrt(share[one])
    result[other] = 1.0 - np.sqrt(1.0 - share[other])
    result[both] = 0.5 - np.sin(np.arcsin(1.0 - 2.0 * share[both]) / 3.0)
    return result
