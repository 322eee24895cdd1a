"""Weft knits drawn flat: loops pulled through loops, and which yarn is above at each crossing.

A needle holds a stack of loops. In each pass a yarn is laid across all needles. A stitch (k, p)
pulls a new loop through the whole stack, which is cast off: the new loop is all that the needle
holds then. A tuck (t) adds an open loop to the stack. A yarn over (y) is a tuck on an empty needle.
A miss (m, f) leaves the stack; the yarn floats. All crossings follow from this, seen from the face
along -z:

- a yarn passes between two beds: behind the loops that are there before it and that a knit stitch
  casts off, before those that a purl stitch casts off;
- the head and the legs of a new loop are on the other side of the loops that it is pulled through;
- a float lies behind all loops that are there before it (m), or before them (f);
- where stitches of a cable cross, half of them are in front; of a decrease, one after the other.

A loop is drawn where it is made, and its head where it is cast off: loops that are held while other
courses are knitted are longer, and those of a cable, and between a yarn over and a decrease, lean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.rods.crossings import Crossings, find_crossings
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.stitches import Pass, needles_above
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points of a stitch, and of what a tuck and a miss lay below a needle. A span has the same
#: length everywhere, so that these are lengths of yarn, too: 32, 23 and 8 parts of a stitch.
POINTS = 32
_SPANS = {"k": POINTS, "p": POINTS, "t": 23, "y": 23, "m": 8, "f": 8}
#: Wale and course spacing of the drawing, as shares of the length of a stitch.
WALE, COURSE = 1 / 4, 1 / 5
#: Shape of a loop that is drawn: width of its neck against the wale spacing, and height over the
#: course spacing.
_NECK, _HEIGHT = 0.18, 0.80
#: By how much a loop is wider and higher than the next one of its stack, in the same spacings; by
#: how much wider than the next one of a decrease, which it crosses; and how much wider it is at
#: most than the last one.
_WIDER, _HIGHER, _WIDER_JOINED, _WIDEST = 0.08, 0.1, 0.16, 0.25
#: How far the feet of each yarn of a row lie above those of the one before, in course spacings.
_APART = 0.15
#: Room above a course for each stitch of a cable, and for each wale by which loops lean, in course
#: spacings.
_CROSSED, _LEANING = 0.5, 0.5


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
    needle: Ints
    """(P, W) The needle at which that is."""
    above: Ints
    """(P, W) Number of loops that are laid on each one before it is cast off."""
    group: Ints
    """(P, W) Number of the cable by which it is moved, or of the decrease that casts it off, from 1
    on; 0 for none."""
    depth: Ints
    """(P, W) How many loops or halves of the group are before it."""


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
    spans = np.array([_SPANS[letter] for letter in each.letters])
    if each.moves:
        # A loop of a cable has as much more yarn as a float over the needles that it passes.
        spans += np.where(spans < POINTS, 0, _SPANS["m"] * abs(np.array(each.moves)))
    return np.concatenate([[0], np.cumsum(spans)])


def draw_loops(passes: Sequence[Pass], length: float) -> Drawing:
    """Draw the loops of a repeat, each through those that it casts off."""
    # `length` is that of yarn in a stitch; the face looks along z. First flat, with as many points
    # as the drawing needs; once lifted, with as many as there is yarn.
    loops = _hang_loops(passes)
    count, width = loops.letters.shape
    rows = np.array([each.row for each in passes])
    # Cables need room between the courses.
    leans = {each.row: max(map(abs, each.shifts), default=0) for each in passes}
    room = [
        _CROSSED * max((each.size for each in one.cables), default=0)
        + (_LEANING * leans[one.row - 1 if one.row else rows[-1]] if one.row != below else 0.0)
        for below, one in zip([-1, *rows], passes, strict=False)
    ]
    levels, height = rows + np.cumsum(room), rows[-1] + 1 + sum(room)
    size = np.array([WALE * length, COURSE * length, 0.0])
    cell = size * [[width, 0.0, 0.0], [0.0, height, 0.0]]
    wider = np.minimum(
        np.where(loops.group > 0, _WIDER_JOINED, _WIDER), _WIDEST / max(int(loops.above.max()), 1)
    )
    flat, starts = [], []
    for number, each in enumerate(passes):
        foot = _APART * (number - int(np.argmax(rows == each.row)))
        parts = []
        for needle, letter in enumerate(each.letters):
            turn, other = divmod(int(loops.cast_off[number, needle]), count)
            held = levels[other] + turn * height - levels[number] - 1
            lean = int(loops.needle[number, needle]) - needle
            above = int(loops.above[number, needle])
            part = (
                _draw_float(foot)
                if letter in "mf"
                else _draw_loop(np.array([lean, held]), foot, above, wider[number, needle])
            )
            parts.append(part + np.array([needle, levels[number], 0.0]))
        flat.append(Yarn(size * np.concatenate(parts), (1, 0)))
        starts.append(np.cumsum([0, *map(len, parts)]))
    found = find_crossings(flat, cell)
    first_is_above = _order_crossings(loops, flat, starts, levels, found, size[1])
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
    # Backwards: the next pass that casts off, with what is laid until then, as seen by a loop on
    # each needle. Two repeats, so that stacks that are held across the border are counted, too.
    cast_off, at, above, group, depth = found = np.zeros((5, count, width), dtype=np.int64)
    state = np.zeros((5, width), dtype=np.int64)
    groups = [len(each.cables) + len(each.decreases) for each in passes]
    first = np.cumsum([1, *groups])
    for number in range(2 * count - 1, -1, -1):
        turn, own = divmod(number, count)
        found[:, own] = state
        cast_off[own] -= turn * count
        for needle, letter in enumerate(letters[own]):
            if letter in "kp":
                state[:, needle] = number, needle, 0, 0, 0
            state[2, needle] += letter == "t"
        if own and passes[own - 1].row == passes[own].row:
            continue
        state = state[:, needles_above(passes[own - 1])]
        for place, (left, size, is_left) in enumerate(passes[own].cables, first[own]):
            half = size // 2
            state[3, left : left + size] = place
            state[4, left : left + half] = is_left
            state[4, left + half : left + size] = not is_left
        for place, (left, order) in enumerate(
            passes[own].decreases, first[own] + len(passes[own].cables)
        ):
            joined = left + np.array(order)
            state[3, joined], state[4, joined] = place, np.arange(len(order))
            state[2, joined] += np.arange(len(order))[::-1]
    return _Loops(letters, cast_off, at, above, group, depth)


def _draw_float(foot: float) -> Floats:
    """Draw a float from one side of a needle to the other, (n, 3), in wale and course spacings."""
    x = np.arange(_SPANS["m"]) / _SPANS["m"] - 0.5
    return np.column_stack([x, np.full(len(x), foot - _HEIGHT), 0 * x])


def _draw_loop(held: Floats, foot: float, above: int, wider: float) -> Floats:
    """Draw a loop whose head is held some wales and courses away, (n, 3), in their spacings."""
    # The upper half of a plain loop, straight legs, and the lower half.
    t = 2 * np.pi * np.arange(POINTS) / POINTS - np.pi
    quarter, more = POINTS // 4, max(round(held[1] / (2 * np.pi / POINTS * _HEIGHT)), 0)
    leg, last = quarter + more, POINTS + 2 * more
    legs = np.repeat([quarter, 3 * quarter], more)
    t = np.insert(t, legs, t[legs])
    corners = [quarter - 0.5, leg + 0.5, last - leg - 0.5, last - quarter + 0.5]
    lift = np.interp(np.arange(last), corners, [0.0, 1.0, 1.0, 0.0])
    # Heads are wider, not necks, which must fit through the heads of others.
    spread = np.sign(t) * abs(np.sin(t)) ** np.where(abs(t) > np.pi / 2, 8, 1)
    x = t / (2 * np.pi) + _NECK * np.sin(2 * t) + above * wider * spread + lift * held[0]
    # A loop that leans to the right is bent a little, so that its corners do not coincide with
    # those of a loop that leans to the left.
    x += 0.02 * max(held[0], 0.0) * np.sin(np.pi * lift)
    size = np.where(abs(t) > np.pi / 2, _HEIGHT - foot, _HEIGHT)
    return np.column_stack([x, size * np.cos(t) + lift * (held[1] + above * _HIGHER), 0 * x])


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
    loops: _Loops,
    yarns: Sequence[Yarn],
    starts: Sequence[Ints],
    levels: Floats,
    crossings: Crossings,
    course: float,
) -> Bools:
    """Return whether the first yarn of each crossing is above the second one, (c,)."""
    count = len(loops.letters)
    needle, level = np.zeros(crossings.yarns.shape, dtype=np.int64), np.zeros(crossings.yarns.shape)
    for number, (yarn, start) in enumerate(zip(yarns, starts, strict=True)):
        on = crossings.yarns == number
        # A parameter is that of the control point after the one where its span starts.
        at = (crossings.parameters[on] + 1.0) % start[-1]
        needle[on] = np.searchsorted(start, at, side="right") - 1
        height = yarn.points[:, 1] / course - levels[number]
        level[on] = np.interp(at, np.arange(start[-1] + 1), np.append(height, height[0]))
    # What is laid later decides, by the bed on which the earlier loop hangs.
    turn = np.stack([np.zeros(len(crossings.signs), dtype=np.int64), crossings.shift[:, 1]], axis=1)
    laid = crossings.yarns + count * turn
    side = laid.argmax(axis=1)
    (new, old), rows = (side, 1 - side), np.arange(len(side))
    pass_, at = crossings.yarns[rows, new], needle[rows, new]
    held = crossings.yarns[rows, old], needle[rows, old]
    caster = loops.cast_off[held]
    letter = loops.letters[pass_, at]
    by = loops.letters[caster % count, loops.needle[held]]
    is_pulled = (caster + count * turn[rows, old] == laid[rows, new]) & (loops.needle[held] == at)
    is_pulled &= np.isin(letter, ["k", "p"]) & (level[rows, new] > -0.5)
    is_before = np.where(np.isin(letter, ["m", "f"]), letter == "f", is_pulled != (by == "p"))
    first_is_above = is_before == (side == 0)
    group, depth = loops.group[crossings.yarns, needle], loops.depth[crossings.yarns, needle]
    ordered = (group[:, 0] > 0) & (group[:, 0] == group[:, 1]) & (depth[:, 0] != depth[:, 1])
    return np.where(ordered, depth[:, 0] < depth[:, 1], first_is_above)


def _reorder(found: Crossings, first_is_above: Bools) -> Crossings:
    """Exchange the yarns of crossings whose first one is below."""
    turned = ~first_is_above
    yarns, parameters = (
        np.where(turned[:, None], each[:, ::-1], each) for each in (found.yarns, found.parameters)
    )
    sign = np.where(turned, -1, 1)
    return Crossings(yarns, parameters, sign[:, None] * found.shift, sign * found.signs)
