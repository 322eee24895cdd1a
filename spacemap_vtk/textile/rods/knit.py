"""Weft knits: loops drawn from stitches, and relaxed.

Shapes follow from the number of diameters in a stitch alone, if the yarn hardly stretches. So all
lengths here are in diameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.crossings import find_crossings
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.relax import Relaxed, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points of a stitch.
POINTS = 24
#: Shape of a loop that is drawn: width of its neck against the wale spacing, and height over the
#: course spacing.
_NECK, _HEIGHT = 0.18, 0.80
#: Wale and course spacing of the drawing, as shares of the length of a stitch.
_WALE, _COURSE = 1 / 4, 1 / 5
#: Depth of the loops at a selvedge over half of the course spacing.
_SELVEDGE = 0.6
#: Stiffness in tension and contact, for a bending stiffness and a diameter of 1: yarns stretch by
#: less than 0.1 % and overlap by less than 0.6 %.
_TENSION, _CONTACT = 1e3, 3e3
#: Diameters of yarn in a stitch for which loops are possible and hold each other.
SHORTEST, LONGEST = 12.0, 40.0


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
            allowed=f"{SHORTEST:g} to {LONGEST:g} diameters; usual knits have 14 to 25",
        )
    guess, count = draw_knit(rows, length), len(rows)
    mechanics = RodMechanics(
        np.full(count, _TENSION), np.ones(count), _CONTACT, np.full(count, length / POINTS)
    )
    free = np.array([[True, False, False], [False, True, False]])
    return relax_yarns(guess.yarns, guess.cell, mechanics, free, progress=progress)


def repeat_knit(
    yarns: Sequence[Yarn], cell: Floats, wales: int, courses: int, joined: Sequence[bool]
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
    joined : sequence of bool
        For each course but the first, whether the yarn of the course below turns at the selvedge
        and knits it, too; it turns at the right and at the left in turn.

    Returns
    -------
    list of ndarray of float64, shape (n, 3)
        Control points of each yarn, from the lowest course up.
    """
    lines: list[Floats] = []
    for course in range(courses):
        turn, row = divmod(course, len(yarns))
        line = _course(yarns[row].points, cell[0], wales) + turn * cell[1]
        if course and joined[course - 1]:
            # the yarn below ends at the right if an odd number of courses was knitted
            goes_left = bool((lines[-1][-1] - lines[-1][-2])[0] > 0.0)
            line = line[::-1] if goes_left else line
            lines[-1] = np.concatenate([lines[-1], _selvedge(lines[-1], line), line])
        else:
            lines.append(line)
    return lines


def _course(points: Floats, period: Floats, wales: int) -> Floats:
    """Return the control points of a course, from the middle of a sinker loop to another one."""
    first, count = POINTS // 2, POINTS * wales + 3
    turn, index = np.divmod(np.arange(first, first + count), len(points))
    return np.asarray(points[index] + (turn - 1)[:, None] * period)


def _selvedge(below: Floats, above: Floats) -> Floats:
    """Draw the half ellipse by which a yarn turns from the end of a course to the next one."""
    start, end = below[-1], above[0]
    outwards = start - below[-2]
    outwards[1:] = 0.0
    radius = (end - start) / 2
    size = float(np.linalg.norm(radius))
    step = float(np.linalg.norm(np.diff(below[-4:], axis=0), axis=1).mean())
    angle = np.linspace(0.0, np.pi, max(3, round(np.pi * size / step)) + 1)[1:-1, None]
    way = outwards / np.linalg.norm(outwards) * (_SELVEDGE * size)
    return np.asarray((start + end) / 2 - radius * np.cos(angle) + way * np.sin(angle))
