"""A yarn between two crossings, after Peirce: arcs and a straight part, for many at once.

Arrays have the families first, (2, n): the gap of the warp over picks, that of the weft over ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints

#: Steps of squares of heights, in which lengths are all but linear, that are enough, over D**2.
_ALIKE = 1e-7
#: Over D: a height below which a yarn is straight.
_LEAST = 1e-9


class Gap(NamedTuple):
    """A yarn between two crossings: Peirce's figures, without refusals."""

    theta: Floats
    straight: Floats
    length: Floats
    sin: Floats
    cos: Floats
    half: Floats
    """The tangent of half of theta."""


def bend(room: Floats, height: Floats, distance: Floats) -> Gap:
    """Return Peirce's figures; past the jam those of no straight part."""
    # few arrays at once: memory that is given back and taken anew costs as much as the arithmetic
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
    """Return the height at which no straight part is left, or the most there is, D."""
    room = np.minimum(room, distance)
    # D - sqrt(D**2 - p**2), and nothing large is subtracted
    return room**2 / (distance + np.sqrt((distance - room) * (distance + room)))


def taut_height(room: Floats, length: Floats, distance: Floats) -> Floats:
    """Return the heights at which yarns are as long as asked; 0 where they are too short."""
    shape = room.shape
    most = jam_height(room, distance).ravel() ** 2
    live: Ints = np.arange(room.size)
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
        if 8 * np.count_nonzero(done) > len(done):
            result[live[done]] = square[done]
            on = np.flatnonzero(~done)
            live = live[on]
            square, p, goal, d, most = (one[on] for one in (square, p, goal, d, most))
        if not len(live):
            break
    result[live] = square
    return np.sqrt(result).reshape(shape)


def both_taut(room: Floats, length: Floats, height: Floats, floor: Floats) -> Floats:
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
        if 8 * np.count_nonzero(done) > len(done):
            result[:, live[done]] = h[:, done]
            on = np.flatnonzero(~done)
            live, least, floor = live[on], least[on], floor[on]
            h, p, goal = (one.take(on, axis=1) for one in (h, p, goal))
        if not len(live):
            return result
    result[:, live] = _both_taut_surely(p, goal, h.sum(axis=0), floor)
    return result


def _both_taut_surely(room: Floats, length: Floats, above: Floats, floor: Floats) -> Floats:
    """Return what `both_taut` does, by halving: the lower D, the more height there is for it."""
    low, high = 0.5 * floor, np.maximum(2.0 * above, 2.0 * floor)
    for _ in range(50):
        middle = 0.5 * (low + high)
        height = taut_height(room, length, np.broadcast_to(middle, room.shape))
        enough = height.sum(axis=0) >= middle * (1.0 - 1e-12)
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return taut_height(room, length, np.broadcast_to(low, room.shape))
