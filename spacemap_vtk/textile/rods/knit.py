"""Weft knits: loops drawn from stitches, and relaxed.

Shapes follow from the number of diameters in a stitch alone, if the yarn hardly stretches. So all
lengths here are in diameters.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.crossings import find_crossings
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.relax import STAGES, Relaxed, Stage, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points of a stitch.
POINTS = 24
#: Shape of a loop that is drawn: width of its neck against the wale spacing, and height over the
#: course spacing.
_NECK, _HEIGHT = 0.18, 0.80
#: Wale and course spacing of the drawing, as shares of the length of a stitch.
_WALE, _COURSE = 1 / 4, 1 / 5
#: Control points that a course leaves out at each end, before the middle of a sinker loop, and
#: those of the first and of the last stitch.
_CUT = 2
_SIDE = POINTS - _CUT
#: Depth of a turn that is drawn over half of the course spacing.
_DEPTH = 1.2
#: Stages in which selvedges relax; fewer digits than those of stitches are seen.
_SIDE_STAGES = (*STAGES[:2], Stage(1.0, 0.03, 1e-3), Stage(1.0, 1.0, 1e-4))
#: Stitches of the strip on which selvedges are relaxed.
_STRIP = 4
#: Stiffness in tension and contact, for a bending stiffness and a diameter of 1: yarns stretch by
#: less than 0.1 % and overlap by less than 0.6 %.
_TENSION, _CONTACT = 1e3, 3e3
#: Diameters of yarn in a stitch: yarns of shorter loops overlap by more than 0.6 %, and longer ones
#: do not hold each other.
SHORTEST, LONGEST = 14.0, 40.0


class KnitGuess(NamedTuple):
    """Yarns of one repeat, one for each row, and its cell."""

    yarns: list[Yarn]
    cell: Floats


def draw_knit(rows: Sequence[str], length: float) -> KnitGuess:
    """Draw the loops of a knit, each through the loop below it."""
    # Each row is one yarn along x; the face looks along z. Lengths are in diameters.
    width = len(rows[0])
    wale, course = _WALE * length, _COURSE * length
    t = 2 * np.pi * (np.arange(width * POINTS) - 1) / POINTS
    x = wale * (t / (2 * np.pi) + _NECK * np.sin(2 * t))
    y = _HEIGHT * course * np.cos(t)
    flat = [
        Yarn(np.stack([x, y + row * course, 0 * x], axis=1), (1, 0)) for row in range(len(rows))
    ]
    cell = np.array([[wale * width, 0.0, 0.0], [0.0, course * len(rows), 0.0]])
    crossings = find_crossings(flat, cell)
    # Seen from the face, the legs of a knit stitch lie above the head of the loop below, and its
    # feet below the legs of that loop; those of a purl stitch the other way round.
    height = crossings.yarns.copy()
    height[:, 1] += len(rows) * crossings.shift[:, 1]
    upper = height.argmax(axis=1)[:, None]
    stitch = crossings.parameters / POINTS
    above, below = (np.take_along_axis(stitch, side, axis=1)[:, 0] for side in (upper, 1 - upper))
    from_foot, from_head = abs(above % 1.0 - 0.5), abs(below - np.round(below))
    row = np.take_along_axis(crossings.yarns, upper, axis=1)[:, 0]
    is_knit = np.array([list(each) for each in rows])[row, np.round(above).astype(int) % width]
    upper_is_above = (from_head < from_foot) == (is_knit == "k")
    return KnitGuess(lift_yarns(flat, crossings, upper_is_above == (upper[:, 0] == 0)), cell)


def relax_knit(rows: Sequence[str], length: float, progress: Progress | None = None) -> Relaxed:
    """Relax a knit without friction or set, in a cell that follows its yarns.

    Parameters
    ----------
    rows : sequence of str
        As for `draw_knit`.
    length : float
        Length of yarn in a stitch [diameters].
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    Relaxed
        Yarns at rest, in diameters, for a bending stiffness of 1.

    Raises
    ------
    GeometryError
        If a stitch is too short for loops that hold each other, or too long.
    SolverError
        If the yarns do not come to rest.
    """
    if not SHORTEST <= length <= LONGEST:
        raise GeometryError(
            "a stitch has too little or too much yarn",
            key="stitch_length",
            value=f"{length:.4g} diameters",
            allowed=f"{SHORTEST:g} to {LONGEST:g} diameters; usual knits have up to 25",
        )
    guess, count = draw_knit(rows, length), len(rows)
    mechanics = _mechanics(count, length)
    free = np.array([[True, False, False], [False, True, False]])
    return relax_yarns(guess.yarns, guess.cell, mechanics, free, progress=progress)


def _mechanics(count: int, length: float) -> RodMechanics:
    """Return the stiffness of yarns with a given length in a stitch, all in diameters."""
    ones = np.ones(count)
    return RodMechanics(_TENSION * ones, ones, _CONTACT, length / POINTS * ones)


class Selvedges(NamedTuple):
    """Yarn at both sides of a knit, of as many courses as repeat themselves."""

    left: Floats
    """(R, k, 3) Control points of the first stitch of each course."""
    right: Floats
    """(R, k, 3) Those of the last stitch, for a piece of `wales` stitches."""
    turns: Floats
    """(R, m, 3) Control points of the turn after each course: right, left, right, …"""
    wales: int
    """Stitches of the strip that was relaxed."""
    overlap: float
    """Largest overlap of two yarns, in diameters."""


def strip_wales(repeat: int, wales: int) -> int:
    """Return how many stitches the strip has on which the selvedges of a piece are relaxed.

    Parameters
    ----------
    repeat, wales : int
        Stitches of a repeat, and of the piece.

    Returns
    -------
    int
        So many that the last stitch of the strip is that of the piece.
    """
    return wales if wales < _STRIP else _STRIP + (wales - _STRIP) % repeat


def relax_selvedges(
    yarns: Sequence[Yarn], cell: Floats, length: float, wales: int, progress: Progress | None = None
) -> Selvedges:
    """Relax the sides of a knit whose yarn turns after each course, at the right and left in turn.

    Parameters
    ----------
    yarns : sequence of Yarn
        Relaxed yarns of a repeat, one for each row, in diameters.
    cell : ndarray of float64, shape (2, 3)
        Period vectors.
    length : float
        Length of yarn in a stitch [diameters].
    wales : int
        Stitches of the piece, 3 or more.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    Selvedges
        Of a narrow strip whose inner stitches stay as they are.

    Raises
    ------
    SolverError
        If the yarns do not come to rest.
    """
    rows, strip = int(np.lcm(2, len(yarns))), strip_wales(len(yarns[0].points) // POINTS, wales)
    courses = [_course(yarns, cell, strip, row) for row in range(rows + 1)]
    points, held = [], []
    for row, (line, above) in enumerate(itertools.pairwise(courses)):
        side = 1.0 if row % 2 == 0 else -1.0
        inner = np.zeros(len(line), dtype=bool)
        inner[_SIDE:-_SIDE] = True
        line, above = (each if side > 0 else each[::-1] for each in (line, above))
        turn = _draw_turn(line[-1], above[-1], side, length / POINTS)
        points += [line, turn]
        held += [inner, np.zeros(len(turn), dtype=bool)]
    period = np.stack([np.zeros(3), rows // len(yarns) * cell[1]])
    mechanics = _mechanics(1, length)
    found = relax_yarns(
        [Yarn(np.concatenate(points), (0, 1))],
        period,
        mechanics,
        np.zeros((2, 3), dtype=bool),
        held=np.concatenate(held),
        stages=_SIDE_STAGES,
        progress=progress,
    )
    ends = np.cumsum([len(part) for part in points])[:-1]
    parts = np.split(found.yarns[0].points, ends)
    lines = [line if row % 2 == 0 else line[::-1] for row, line in enumerate(parts[::2])]
    return Selvedges(
        np.stack([line[:_SIDE] for line in lines]),
        np.stack([line[-_SIDE:] for line in lines]),
        np.stack(parts[1::2]),
        strip,
        found.overlap,
    )


def repeat_knit(
    yarns: Sequence[Yarn],
    cell: Floats,
    wales: int,
    courses: int,
    selvedges: Selvedges | None = None,
    joined: Sequence[bool] = (),
) -> list[Floats]:
    """Repeat the yarns of a cell over a piece of knit.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns of a repeat, one for each row.
    cell : ndarray of float64, shape (2, 3)
        Period vectors.
    wales, courses : int
        Stitches across, and rows.
    selvedges : Selvedges, optional
        Sides at which the yarn turns; without them each course is a yarn of its own.
    joined : sequence of bool, optional
        For each course but the last, whether its yarn turns and knits the next course.

    Returns
    -------
    list of ndarray of float64, shape (n, 3)
        Control points of each yarn, from the lowest course up.
    """
    lines: list[Floats] = []
    for course in range(courses):
        line = _course(yarns, cell, wales, course)
        if selvedges is None:
            lines.append(line)
            continue
        turn, row = divmod(course, len(selvedges.left))
        up = turn * (len(selvedges.left) // len(yarns)) * cell[1]
        across = (wales - selvedges.wales) / (len(yarns[0].points) // POINTS) * cell[0]
        line[:_SIDE] = selvedges.left[row] + up
        line[-_SIDE:] = selvedges.right[row] + up + across
        line = line if row % 2 == 0 else line[::-1]
        if course and joined[course - 1]:
            line = np.concatenate([lines.pop(), line])
        if course < courses - 1 and joined[course]:
            end = selvedges.turns[row] + up + (across if row % 2 == 0 else 0.0)
            line = np.concatenate([line, end])
        lines.append(line)
    return lines


def _course(yarns: Sequence[Yarn], cell: Floats, wales: int, course: int) -> Floats:
    """Return the control points of a course, between the middles of two sinker loops."""
    turn, row = divmod(course, len(yarns))
    points = yarns[row].points
    first, count = POINTS // 2 + _CUT, POINTS * wales + 3 - 2 * _CUT
    period, index = np.divmod(np.arange(first, first + count), len(points))
    return np.asarray(points[index] + (period - 1)[:, None] * cell[0] + turn * cell[1])


def _draw_turn(start: Floats, end: Floats, side: float, step: float) -> Floats:
    """Draw the half ellipse by which a yarn turns from the end of a course to the next one."""
    middle, radius = (start + end) / 2, (start - end) / 2
    size = float(np.linalg.norm(radius))
    count = max(3, round(np.pi * size / step))
    angle = np.linspace(0.0, np.pi, count + 1)[1:-1, None]
    outwards = np.array([side * _DEPTH * size, 0.0, 0.0])
    return np.asarray(middle + radius * np.cos(angle) + outwards * np.sin(angle))
