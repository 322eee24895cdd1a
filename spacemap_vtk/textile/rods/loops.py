"""Weft knits drawn flat: loops pulled through loops, and which yarn is above at each crossing.

A needle holds a stack of loops. In each pass a yarn is laid across all needles. A stitch (k, p)
pulls a new loop through the whole stack, which is cast off: the new loop is all that the needle
holds then. A tuck (t) adds an open loop to the stack. A miss (m) leaves the stack; the yarn floats
behind it. All crossings follow from this, seen from the face along -z:

- a new loop and one that it is pulled through: the legs of the new loop lie before the head of the
  old one, and its feet behind the legs of the old one; a purl stitch is the other way round;
- a float lies behind all loops that are there before it;
- a tuck lies behind the loops that are there before it; where a purl stitch casts it off, before.

A loop is drawn where it is made, and its head where it is cast off: loops that are held while other
courses are knitted are longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.rods.crossings import Crossings, find_crossings
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.stitches import Pass
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points of a stitch, and of what a tuck and a miss lay below a needle. A span has the same
#: length everywhere, so that these are lengths of yarn, too: 24, 17 and 6 parts of a stitch.
POINTS = 24
_SPANS = {"k": POINTS, "p": POINTS, "t": 17, "m": 6}
#: Wale and course spacing of the drawing, as shares of the length of a stitch.
WALE, COURSE = 1 / 4, 1 / 5
#: Shape of a loop that is drawn: width of its neck against the wale spacing, and height over the
#: course spacing.
_NECK, _HEIGHT = 0.18, 0.80
#: By how much a loop is wider and higher than the next one of its stack, in the same spacings, and
#: how much wider than the last one it is at most.
_WIDER, _HIGHER, _WIDEST = 0.08, 0.1, 0.2
#: How far the feet of each yarn of a row lie above those of the one before, in course spacings.
_APART = 0.15


class Drawing(NamedTuple):
    """Yarns of a repeat, one for each pass."""

    yarns: list[Yarn]
    cell: Floats
    """(2, 3) Period vectors."""
    crossings: Crossings
    """The crossings of the pattern, with the yarn above first."""


class _Loops(NamedTuple):
    """Where loops are made and cast off; passes are counted on from one repeat to the next."""

    letters: Ints
    """(P, W) Letters of the passes, as characters."""
    cast_off: Ints
    """(P, W) The pass that casts off what each pass lays on a needle."""
    above: Ints
    """(P, W) Number of loops that are laid on each one before it is cast off."""


def column_starts(each: Pass) -> Ints:
    """Return the control points at which a yarn's way below each needle starts.

    Parameters
    ----------
    each : Pass
        A pass.

    Returns
    -------
    ndarray of int64, shape (wales + 1,)
        Numbers of control points, with that of all at the end.
    """
    return np.cumsum([0, *(_SPANS[letter] for letter in each.letters)])


def draw_loops(passes: Sequence[Pass], length: float) -> Drawing:
    """Draw the loops of a repeat, each through those that it casts off."""
    # `length` is that of yarn in a stitch; the face looks along z. First flat, with as many points
    # as the drawing needs; once lifted, with as many as there is yarn.
    loops = _hang_loops(passes)
    count, width = loops.letters.shape
    rows = np.array([each.row for each in passes])
    height = int(rows[-1]) + 1
    size = np.array([WALE * length, COURSE * length, 0.0])
    cell = size * [[width, 0.0, 0.0], [0.0, height, 0.0]]
    wider = min(_WIDER, _WIDEST / max(int(loops.above.max()), 1))
    flat, starts = [], []
    for number, each in enumerate(passes):
        foot = _APART * (number - int(np.argmax(rows == each.row)))
        parts = []
        for needle, letter in enumerate(each.letters):
            turn, other = divmod(int(loops.cast_off[number, needle]), count)
            held = rows[other] + turn * height - each.row - 1
            above = int(loops.above[number, needle])
            part = _draw_float(foot) if letter == "m" else _draw_loop(held, foot, above, wider)
            parts.append(part + np.array([needle, each.row, 0.0]))
        flat.append(Yarn(size * np.concatenate(parts), (1, 0)))
        starts.append(np.cumsum([0, *map(len, parts)]))
    found = find_crossings(flat, cell)
    first_is_above = _order_crossings(passes, loops, flat, starts, found, size[1])
    yarns = [
        _thin(yarn, np.interp(np.arange(ends[-1]), ends, start), cell[0])
        for yarn, start, ends in zip(
            lift_yarns(flat, found, first_is_above), starts, map(column_starts, passes), strict=True
        )
    ]
    return Drawing(yarns, cell, _reorder(found, first_is_above))


def _hang_loops(passes: Sequence[Pass]) -> _Loops:
    """Find the pass that casts off each loop."""
    letters = np.array([list(each.letters) for each in passes])
    count, width = letters.shape
    cast_off, above = np.zeros((2, count, width), dtype=np.int64)
    for needle in range(width):
        following, tucks = 0, 0
        # Two repeats, so that stacks that are held across the border are counted, too.
        for number in range(2 * count - 1, -1, -1):
            turn, own = divmod(number, count)
            cast_off[own, needle], above[own, needle] = following - turn * count, tucks
            letter = letters[own, needle]
            if letter in "kp":
                following, tucks = number, 0
            tucks += letter == "t"
    return _Loops(letters, cast_off, above)


def _draw_float(foot: float) -> Floats:
    """Draw a float from one side of a needle to the other, (n, 3), in wale and course spacings."""
    x = np.arange(_SPANS["m"]) / _SPANS["m"] - 0.5
    return np.column_stack([x, np.full(len(x), foot - _HEIGHT), 0 * x])


def _draw_loop(held: float, foot: float, above: int, wider: float) -> Floats:
    """Draw a loop that is held for some courses, (n, 3), in wale and course spacings."""
    # The upper half of a plain loop, straight legs, and the lower half.
    t = 2 * np.pi * np.arange(POINTS) / POINTS - np.pi
    quarter, more = POINTS // 4, max(round(held / (2 * np.pi / POINTS * _HEIGHT)), 0)
    leg, last = quarter + more, POINTS + 2 * more
    legs = np.repeat([quarter, 3 * quarter], more)
    t = np.insert(t, legs, t[legs])
    corners = [quarter - 0.5, leg + 0.5, last - leg - 0.5, last - quarter + 0.5]
    lift = np.interp(np.arange(last), corners, [0.0, 1.0, 1.0, 0.0])
    x = t / (2 * np.pi) + _NECK * np.sin(2 * t) + above * wider * np.sin(t)
    size = np.where(abs(t) > np.pi / 2, _HEIGHT - foot, _HEIGHT)
    return np.column_stack([x, size * np.cos(t) + lift * (held + above * _HIGHER), 0 * x])


def _thin(yarn: Yarn, at: Floats, period: Floats) -> Yarn:
    """Return the same curve with control points at fewer places."""
    from scipy.linalg import solve_circulant

    count = len(yarn.points)
    drift = np.outer(np.arange(count) / count, period)
    # A spline passes its control points at a third of their second difference; see yarns.py.
    points = yarn.points - drift
    curve = (np.roll(points, 1, axis=0) + 4 * points + np.roll(points, -1, axis=0)) / 6
    closed = np.concatenate([curve, curve[:1]])
    curve = np.column_stack([np.interp(at, np.arange(count + 1), x) for x in closed.T])
    column = np.zeros(len(at))
    column[[0, 1, -1]] = [4 / 6, 1 / 6, 1 / 6]
    return yarn._replace(points=solve_circulant(column, curve) + np.outer(at / count, period))


def _order_crossings(
    passes: Sequence[Pass],
    loops: _Loops,
    yarns: Sequence[Yarn],
    starts: Sequence[Ints],
    crossings: Crossings,
    course: float,
) -> Bools:
    """Return whether the first yarn of each crossing is above the second one, (c,)."""
    count = len(passes)
    turn = np.stack([np.zeros(len(crossings.signs), dtype=np.int64), crossings.shift[:, 1]], axis=1)
    side = (crossings.yarns + count * turn).argmax(axis=1)
    # What is laid later decides: its letter, and which part of it crosses the earlier one.
    new, place = (
        np.take_along_axis(each, side[:, None], axis=1)[:, 0]
        for each in (crossings.yarns, crossings.parameters)
    )
    is_before = np.zeros(len(new), dtype=bool)
    for number, (each, start) in enumerate(zip(passes, starts, strict=True)):
        on = np.flatnonzero(new == number)
        height = yarns[number].points[:, 1] / course
        # A parameter is that of the control point after the one where its span starts.
        at = (place[on] + 1.0) % start[-1]
        needle = np.searchsorted(start, at, side="right") - 1
        letter = loops.letters[number, needle]
        by = loops.letters[loops.cast_off[number, needle] % count, needle]
        level = np.interp(at, np.arange(start[-1] + 1), np.append(height, height[0]))
        is_head = level > each.row - 0.5
        is_before[on] = np.where(
            letter == "t", by == "p", (letter != "m") & (is_head == (letter == "k"))
        )
    return np.asarray(is_before == (side == 0))


def _reorder(found: Crossings, first_is_above: Bools) -> Crossings:
    """Exchange the yarns of crossings whose first one is below."""
    turned = ~first_is_above
    yarns, parameters = (
        np.where(turned[:, None], each[:, ::-1], each) for each in (found.yarns, found.parameters)
    )
    sign = np.where(turned, -1, 1)
    return Crossings(yarns, parameters, sign[:, None] * found.shift, sign * found.signs)
