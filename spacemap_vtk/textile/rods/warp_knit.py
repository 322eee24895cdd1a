"""Warp knits: loops drawn from the laps of guide bars.

Every yarn knits one loop in each course and goes on to the next course by an underlap on the back.
Seen from the face, the spaces between needles are numbered from the left, from 0; needle n is
between the spaces n and n + 1. Lengths are in diameters.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import lcm
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.rods.crossings import Crossings, find_crossings, linking_numbers
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics
from spacemap_vtk.textile.rods.guess import Guess
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.relax import NEAREST, STAGES, nearest_distance
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Most courses in a repeat, and largest number of a space.
MOST_COURSES, MOST_SPACES = 48, 24
#: Control points in a diameter of length.
_DENSITY = 1.2
#: Wale and course spacing of the drawing, with one yarn in a loop and with two.
_SPACINGS = ((5.0, 4.0), (7.0, 5.5))
#: Half of a loop as it is drawn, in wale and course spacings from its needle and course: control
#: points from a foot to the head.
_LOOP = np.array([[0.10, 0.05], [0.33, 0.60], [0.29, 1.08], [0.0, 1.30]])
#: Feet of the loops of both bars in the drawings that are tried, and size of the loops: those of
#: two bars must not lie on each other.
_FEET = (
    ((0.12, -0.45), (0.06, -0.15)),
    ((0.08, -0.45), (0.06, -0.15)),
    ((0.12, -0.38), (0.03, -0.15)),
    ((0.16, -0.45), (0.03, -0.15)),
)
_SIZES = (1.15, 0.85)
#: Control points of an underlap as it is drawn, and samples in a span of the drawing.
_UNDERLAP, _FINE = 3, 64
#: Places along a loop at which the loop of the front bar is held above that of the back bar.
_PLATED = (np.arange(8) + 0.5) / 8
#: Stiffness in tension and contact, for a bending stiffness and a diameter of 1.
_TENSION, _CONTACT = 1e3, 1.2e4


class Lap(NamedTuple):
    """Overlap of a guide bar in a course."""

    start: int
    """Space between needles from which the bar swings to the hooks."""
    end: int
    """Space through which it swings back, next to `start`."""


class Bar(NamedTuple):
    """A guide bar."""

    laps: tuple[Lap, ...]
    """Laps of a repeat."""
    threads: tuple[bool, ...] = (True,)
    """Whether each guide of a repeat carries a yarn, from the left."""


def parse_laps(text: str) -> tuple[Lap, ...]:
    """Convert the chain notation of a guide bar to its laps, one for each course.

    Parameters
    ----------
    text : str
        Spaces between needles before and after each overlap: ``1-0/1-2//``.

    Returns
    -------
    tuple of Lap
        Laps of a repeat.

    Raises
    ------
    InputError
        If a link is no overlap of one needle.

    Examples
    --------
    >>> parse_laps("1-0/1-2//")
    (Lap(start=1, end=0), Lap(start=1, end=2))
    """
    links = "".join(str(text).split()).rstrip("/").split("/")
    found = [re.fullmatch(r"(\d{1,2})-(\d{1,2})", link) for link in links]
    laps = tuple(Lap(int(one[1]), int(one[2])) for one in found if one)
    if len(laps) < len(links) or any(abs(lap.end - lap.start) != 1 for lap in laps):
        raise InputError(f'"{text}" has a link that is not the overlap of one needle, as 1-0 is')
    if len(laps) > MOST_COURSES or max(map(max, laps)) > MOST_SPACES:
        raise InputError(
            f"a bar has at most {MOST_COURSES} courses in a repeat and {MOST_SPACES} spaces"
        )
    return laps


def are_open(laps: Sequence[Lap]) -> list[bool]:
    """Return whether each lap is open: its underlap does not go back over its needle.

    Parameters
    ----------
    laps : sequence of Lap
        Laps of a repeat.

    Returns
    -------
    list of bool
        One for each lap.
    """
    return [
        (after.start - lap.end) * (lap.end - lap.start) >= 0
        for lap, after in pairwise([*laps, laps[0]])
    ]


class _Drawn(NamedTuple):
    """A yarn of the cell, drawn flat."""

    yarn: Yarn
    bar: int
    feet: Floats
    """(courses, 2) Parameters at which each loop begins and ends."""
    needles: list[int]
    """Needle in each course."""
    goes_left: list[bool]
    """Whether each loop begins at its right foot."""


@lru_cache(maxsize=8)
def draw_warp_knit(
    bars: tuple[Bar, ...],
    lengths: tuple[float | None, ...],
    spacings: tuple[float | None, float | None] = (None, None),
) -> Guess:
    """Draw a repeat of a warp knit.

    Parameters
    ----------
    bars : tuple of Bar
        One or two guide bars, the front bar first. Its loops lie on the face over those of the back
        bar, and its underlaps on the back over those of the back bar.
    lengths : tuple of float or None
        Length of yarn of each bar in a course [diameters]; None: as it is drawn.
    spacings : tuple of float or None, optional
        Wale and course spacing [diameters]; None: as the yarns come to rest.

    Returns
    -------
    Guess
        Yarns along y, bar by bar, in a cell as wide as the repeat of the threading.

    Raises
    ------
    GeometryError
        If a needle gets no yarn, or the laps cannot be drawn with room between the yarns.
    """
    courses = lcm(*(len(bar.laps) for bar in bars))
    width = lcm(*(len(bar.threads) for bar in bars))
    usual = _SPACINGS[len(bars) > 1]
    wale, course = (own or given for own, given in zip(spacings, usual, strict=True))
    cell = np.array([[width * wale, 0.0, 0.0], [0.0, courses * course, 0.0]])
    for feet in _FEET:
        drawn = _draw_flat(bars, feet, cell / [[width], [courses]], width, courses)
        yarns = _lift(drawn, cell, width, courses)
        given = [
            _length(one.yarn, cell) / courses if lengths[one.bar] is None else lengths[one.bar]
            for one in drawn
        ]
        counts = np.array([len(one.yarn.points) for one in drawn])
        ones = np.ones(len(drawn))
        mechanics = RodMechanics(
            _TENSION * ones, ones, _CONTACT, np.array(given) * courses / counts
        )
        energy = RodEnergy(sample_yarns(yarns), mechanics)
        room = nearest_distance(energy, unknowns(yarns, cell))
        # Guide bars always pass each other on the same side, so that no yarn winds about another.
        if room > NEAREST and not linking_numbers(yarns, cell):
            break
    else:
        raise GeometryError(
            "laps could not be drawn with room between the yarns",
            key="laps",
            cure="Use shorter underlaps, or one guide bar",
        )
    # Without underlaps between wales nothing determines the wale spacing.
    is_joined = any(len(set(one.needles)) > 1 for one in drawn)
    free = np.zeros((2, 3), dtype=bool)
    free[[0, 1], [0, 1]] = [spacings[0] is None and is_joined, spacings[1] is None]
    return Guess(yarns, cell, mechanics, free, STAGES)


def _draw_flat(
    bars: Sequence[Bar],
    feet: Sequence[tuple[float, float]],
    step: Floats,
    width: int,
    courses: int,
) -> list[_Drawn]:
    """Draw all yarns of a repeat flat; the rows of `step` are the wale and the course spacing."""
    drawn = []
    for number, bar in enumerate(bars):
        laps = bar.laps * (courses // len(bar.laps))
        yarn, ends = _draw_yarn(laps, step[0, 0], step[1, 1], feet[number], _SIZES[number])
        for guide in range(width):
            if bar.threads[guide % len(bar.threads)]:
                needles = [guide + min(lap) for lap in laps]
                goes_left = [lap.start > lap.end for lap in laps]
                moved = yarn._replace(points=yarn.points + guide * step[0])
                drawn.append(_Drawn(moved, number, ends, needles, goes_left))
    return drawn


def _lift(drawn: Sequence[_Drawn], cell: Floats, width: int, courses: int) -> list[Yarn]:
    """Give flat yarns their heights."""
    flat = [one.yarn for one in drawn]
    crossings = find_crossings(flat, cell)
    plated = _find_plated(drawn, courses, width)
    both = Crossings(*(np.concatenate(each) for each in zip(crossings, plated, strict=True)))
    is_first = _first_is_above(crossings, drawn, courses)
    return lift_yarns(flat, both, np.append(is_first, np.ones(len(plated.signs), dtype=bool)))


def _draw_yarn(
    laps: Sequence[Lap], wale: float, course: float, foot: tuple[float, float], size: float
) -> tuple[Yarn, Floats]:
    """Draw a yarn flat; return it and the parameters of both feet of each loop."""
    half = np.array([foot, *size * _LOOP])
    loops = []
    for row, lap in enumerate([laps[-1], *laps], -1):
        leg = half * (lap.start - lap.end, 1.0)
        loop = np.concatenate([leg, leg[-2::-1] * (-1.0, 1.0)])
        loops.append((loop + np.array([min(lap) + 0.5, row])) * (wale, course))
    share = np.arange(1, _UNDERLAP + 1)[:, None] / (_UNDERLAP + 1)
    corners = np.concatenate(
        [
            np.concatenate([before[-1] + share * (own[0] - before[-1]), own])
            for before, own in pairwise(loops)
        ]
    )
    # The corners control a spline that is divided into equal lengths.
    line = Yarn(np.column_stack([corners, np.zeros(len(corners))]), (0, 1))
    cell = np.array([[0.0, 0.0, 0.0], [0.0, len(laps) * course, 0.0]])
    fine = sample_yarns([line], np.arange(_FINE) / _FINE, np.ones(_FINE))
    place = fine.places(unknowns([line], cell))
    place = np.concatenate([place, place[:1] + cell[1]])
    run = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
    total = round(_DENSITY * run[-1])
    at = np.arange(total) * run[-1] / total
    points = np.stack([np.interp(at, run, axis) for axis in place.T], axis=1)
    # The control point k of a spline is near its parameter k - 1.
    points = np.concatenate([points[-1:] - cell[1], points[:-1]])
    last = np.arange(1, len(laps) + 1)[:, None] * (len(corners) // len(laps)) - 1
    feet = run[(last - [len(loops[0]), 1]) * _FINE] / run[-1] * total
    return Yarn(points, (0, 1)), feet


def _find_plated(drawn: Sequence[_Drawn], courses: int, width: int) -> Crossings:
    """List places at which the loop of one yarn lies on that of another one in the same needle."""
    pairs, parameters, shifts = [], [], []
    for course in range(courses):
        for needle in range(width):
            here = [k for k, one in enumerate(drawn) if (one.needles[course] - needle) % width == 0]
            if not here:
                raise GeometryError(
                    "a needle gets no yarn", key="laps", value=f"needle {needle}, course {course}"
                )
            for pair in pairwise(here):
                both = [drawn[k] for k in pair]
                starts, ends = np.transpose([one.feet[course] for one in both])[..., None]
                share = np.stack(
                    [1 - _PLATED if one.goes_left[course] else _PLATED for one in both]
                )
                parameters.append((starts + (ends - starts) * share).T)
                pairs.append(np.tile(pair, (len(_PLATED), 1)))
                periods = (both[0].needles[course] - both[1].needles[course]) // width
                shifts.append(np.tile([periods, 0], (len(_PLATED), 1)))
    if not pairs:
        none = np.empty((0, 2), dtype=np.int64)
        return Crossings(none, np.empty((0, 2)), none, none[:, 0])
    which, where, shift = (np.concatenate(each) for each in (pairs, parameters, shifts))
    return Crossings(which, where, shift, np.ones(len(which), dtype=np.int64))


def _first_is_above(crossings: Crossings, drawn: Sequence[_Drawn], courses: int) -> Bools:
    """Return whether the first yarn of each crossing is above the second one."""
    # Loops lie above underlaps. Of two loops the later one, which is pulled through the earlier
    # one, and then that of the front bar, lies above; of two underlaps it lies below. Underlaps of
    # one bar and course do not wind about each other: the right one lies above.
    ranks = []
    for side in (0, 1):
        own = []
        for yarn, parameter, shift in zip(
            crossings.yarns[:, side], crossings.parameters[:, side], crossings.shift, strict=True
        ):
            one = drawn[yarn]
            course = int(np.searchsorted(one.feet[:, 0], parameter, side="right")) - 1
            is_loop = course >= 0 and parameter < one.feet[course, 1]
            sign = 1 if is_loop else -1
            course += courses * int(shift[1]) * side
            place = int(shift[0]) * len(drawn) * side + yarn
            own.append((is_loop, sign * course, -sign * one.bar, place))
        ranks.append(own)
    return np.array([first > second for first, second in zip(*ranks, strict=True)])


def _length(yarn: Yarn, cell: Floats) -> float:
    """Compute the length of a yarn until it repeats itself."""
    samples = sample_yarns([yarn])
    speed = np.linalg.norm(samples.slopes(unknowns([yarn], cell)), axis=1)
    return float(speed @ samples.weight)
