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
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.textile.rods.alexander import alexander_value, require_same_crossings
from spacemap_vtk.textile.rods.crossings import ASKEW, find_crossings
from spacemap_vtk.textile.rods.ends import FREE, Ends
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.loops import POINTS, column_starts, draw_loops
from spacemap_vtk.textile.rods.relax import STAGES, Relaxed, Stage, relax_yarns
from spacemap_vtk.textile.rods.stitches import Pass, plan_passes
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points that a course leaves out at each end, before the middle of a sinker loop.
_CUT = 2
#: Depth of a turn that is drawn over half of the course spacing.
_DEPTH = 1.2
#: Stages of knits with floats or held loops, which slide far and come to rest slowly.
_STAGES = (*STAGES[:4], Stage(1.0, 0.03, 1e-4), Stage(1.0, 0.2, 1e-4), Stage(1.0, 1.0, 1e-5))
#: Stages in which selvedges relax; fewer digits than those of stitches are seen.
_SIDE_STAGES = (*STAGES[:4], Stage(1.0, 0.03, 1e-3), Stage(1.0, 1.0, 1e-4))
#: Stitches of the strip on which selvedges are relaxed.
_STRIP = 4
#: Stiffness in tension and contact, for a bending stiffness and a diameter of 1: yarns stretch by
#: less than 0.1 %.
_TENSION, _CONTACT = 1e3, 1.2e4
#: Largest overlap of two yarns of a repeat [diameters].
OVERLAP = 5e-3
#: Diameters of yarn in a stitch: yarns of shorter loops have no room, and longer ones do not hold
#: each other.
SHORTEST, LONGEST = 14.0, 40.0


def relax_knit(
    rows: Sequence[str],
    length: float,
    chart: Sequence[str] = (),
    spacings: tuple[float | None, float | None] = (None, None),
    progress: Progress | None = None,
    knitted_back: bool = False,
) -> Relaxed:
    """Relax a knit without friction or set, in a cell that follows its yarns.

    Parameters
    ----------
    rows : sequence of str
        Stitches of a repeat, the lowest row first.
    length : float
        Length of yarn in a stitch [diameters].
    chart : sequence of str, optional
        Colours of a repeat, as for `plan_passes`; by default there is one.
    spacings : tuple of (float or None, float or None), optional
        Wale and course spacing of the face to which the knit is stretched [diameters]; None for
        that of yarns at rest.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.
    knitted_back : bool, optional
        Whether a second bed knits the back of the chart, as for `plan_passes`.

    Returns
    -------
    Relaxed
        Yarns at rest, one for each pass, in diameters, for a bending stiffness of 1.

    Raises
    ------
    InputError
        If the stitches cannot be knitted.
    GeometryError
        If a stitch is too short for loops that hold each other, or too long, or if yarns have
        passed through each other.
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
    passes = plan_passes(rows, chart, knitted_back)
    drawing = draw_loops(passes, length)
    wales = len(passes[0].letters) // (2 if knitted_back else 1)
    free, size = np.zeros((2, 3), dtype=bool), np.ones(3)
    for axis, (given, count) in enumerate(zip(spacings, (wales, passes[-1].row + 1), strict=True)):
        free[axis, axis] = given is None
        if given is not None:
            size[axis] = given * count / drawing.cell[axis, axis]
    mechanics = _mechanics(len(passes), length)
    stages = STAGES if set("".join(rows)) <= set("kp") and not chart else _STAGES
    yarns = [yarn._replace(points=yarn.points * size) for yarn in drawing.yarns]
    found = relax_yarns(
        yarns, drawing.cell * size, mechanics, free, stages=stages, progress=progress
    )
    while found.overlap > OVERLAP:
        # Dense stitches press yarns harder against each other: they need a stiffer contact.
        stiffer = 1.2 * found.overlap / OVERLAP * mechanics.contact
        mechanics = mechanics._replace(contact=stiffer)
        found = relax_yarns(found.yarns, found.cell, mechanics, free, stages=stages[-1:])
    pattern = alexander_value(drawing.yarns, drawing.crossings)
    require_same_crossings(pattern, found.yarns, found.cell)
    return found


def _mechanics(count: int, length: float) -> RodMechanics:
    """Return the stiffness of yarns with a given length in a stitch, all in diameters."""
    ones = np.ones(count)
    return RodMechanics(_TENSION * ones, ones, _CONTACT, length / POINTS * ones)


class Selvedges(NamedTuple):
    """Yarn at both sides of a knit, of as many courses as repeat themselves."""

    left: list[Floats]
    """(k, 3) Control points of the first stitch of each course."""
    right: list[Floats]
    """(k, 3) Those of the last stitch, for a piece of `wales` stitches."""
    turns: list[Floats]
    """(m, 3) Control points of the turn after each course: right, left, right, …"""
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
    yarns: Sequence[Yarn],
    cell: Floats,
    passes: Sequence[Pass],
    length: float,
    wales: int,
    progress: Progress | None = None,
) -> Selvedges:
    """Relax the sides of a knit whose yarn turns after each course, at the right and left in turn.

    Parameters
    ----------
    yarns : sequence of Yarn
        Relaxed yarns of a repeat, one for each pass, in diameters.
    cell : ndarray of float64, shape (2, 3)
        Period vectors.
    passes : sequence of Pass
        Passes of the repeat, one for each row.
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
    GeometryError
        If yarns have passed through each other.
    SolverError
        If the yarns do not come to rest.
    """
    rows, strip = int(np.lcm(2, len(yarns))), strip_wales(len(passes[0].letters), wales)
    courses = [
        _course(yarns[row % len(yarns)], cell, column_starts(passes[row % len(yarns)]), strip)
        + row // len(yarns) * cell[1]
        for row in range(rows + 1)
    ]
    sides = [_side_points(passes[row % len(yarns)], strip) for row in range(rows)]
    points, held = [], []
    for row, (line, above) in enumerate(itertools.pairwise(courses)):
        inner = np.zeros(len(line), dtype=bool)
        inner[sides[row][0] : -sides[row][1]] = True
        side = 1.0 if row % 2 == 0 else -1.0
        inner, line, above = (each if side > 0 else each[::-1] for each in (inner, line, above))
        turn = draw_turn(line[-1], above[-1], side, length / POINTS)
        points += [line, turn]
        held += [inner, np.zeros(len(turn), dtype=bool)]
    period = np.stack([np.zeros(3), rows // len(yarns) * cell[1]])
    mechanics = _mechanics(1, length)
    drawn = [Yarn(np.concatenate(points), (0, 1))]
    before = alexander_value(drawn, find_crossings(drawn, period, ASKEW))
    found = relax_yarns(
        drawn,
        period,
        mechanics,
        np.zeros((2, 3), dtype=bool),
        held=np.concatenate(held),
        stages=_SIDE_STAGES,
        progress=progress,
    )
    require_same_crossings(before, found.yarns, period)
    ends = np.cumsum([len(part) for part in points])[:-1]
    parts = np.split(found.yarns[0].points, ends)
    lines = [line if row % 2 == 0 else line[::-1] for row, line in enumerate(parts[::2])]
    return Selvedges(
        [line[:left] for line, (left, _) in zip(lines, sides, strict=True)],
        [line[-right:] for line, (_, right) in zip(lines, sides, strict=True)],
        parts[1::2],
        strip,
        found.overlap,
    )


def repeat_knit(
    yarns: Sequence[Yarn],
    cell: Floats,
    passes: Sequence[Pass],
    wales: int,
    courses: int,
    selvedges: Selvedges | None = None,
    joined: Sequence[bool] = (),
    ends: Ends | None = None,
) -> list[Floats]:
    """Repeat the yarns of a cell over a piece of knit.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns of a repeat, one for each pass.
    cell : ndarray of float64, shape (2, 3)
        Period vectors.
    passes : sequence of Pass
        Passes of the repeat.
    wales, courses : int
        Stitches across, and rows.
    selvedges : Selvedges, optional
        Sides at which the yarn turns; without them each pass is a yarn of its own.
    joined : sequence of bool, optional
        For each course but the last, whether its yarn turns and knits the next course.
    ends : Ends, optional
        Cast-on and chain of a piece of as many courses without selvedges; by default loops are
        open there.

    Returns
    -------
    list of ndarray of float64, shape (n, 3)
        Control points of each yarn, from the lowest one up.
    """
    lines: list[Floats] = []
    height = passes[-1].row + 1
    moved = _moves_of_ends(yarns, cell, wales, courses, ends)
    for course, number in courses_and_passes(passes, courses):
        line = _course(yarns[number], cell, column_starts(passes[number]), wales)
        line = line + course // height * cell[1]
        if selvedges is None:
            lines.append(line + moved[course])
            continue
        turn, row = divmod(course, len(selvedges.left))
        up = turn * (len(selvedges.left) // len(yarns)) * cell[1]
        across = (wales - selvedges.wales) // len(passes[0].letters) * cell[0]
        line[: len(selvedges.left[row])] = selvedges.left[row] + up
        line[-len(selvedges.right[row]) :] = selvedges.right[row] + up + across
        line = line if row % 2 == 0 else line[::-1]
        if course and joined[course - 1]:
            line = np.concatenate([lines.pop(), line])
        if course < courses - 1 and joined[course]:
            end = selvedges.turns[row] + up + (across if row % 2 == 0 else 0.0)
            line = np.concatenate([line, end])
        lines.append(line)
    if ends is None:
        return lines
    count = len(passes[0].letters)
    cast_on, bind_off = (
        _course(yarn, cell, np.arange(count + 1) * (len(yarn.points) // count), wales)
        for yarn in (ends.cast_on, ends.bind_off)
    )
    return [cast_on, *lines, bind_off]


def _moves_of_ends(
    yarns: Sequence[Yarn], cell: Floats, wales: int, courses: int, ends: Ends | None
) -> list[Floats]:
    """Return by how much the ends move the control points of each course."""
    moves = [np.zeros((1, 3))] * courses
    if ends is None:
        return moves
    near = [*range(FREE), *range(courses - FREE, courses)]
    for course, points in zip(near, [*ends.lower, *ends.upper], strict=True):
        turn, row = divmod(course, len(yarns))
        starts = np.arange(0, len(points) + 1, POINTS)
        move = yarns[row]._replace(points=points - yarns[row].points - turn * cell[1])
        moves[course] = _course(move, np.zeros((2, 3)), starts, wales)
    return moves


def courses_and_passes(passes: Sequence[Pass], courses: int) -> list[tuple[int, int]]:
    """List the passes of a piece: the course and the number of the pass in the repeat of each.

    Parameters
    ----------
    passes : sequence of Pass
        Passes of a repeat.
    courses : int
        Number of rows.

    Returns
    -------
    list of (int, int)
        From the lowest course up.
    """
    height = passes[-1].row + 1
    return [
        (course, number)
        for course in range(courses)
        for number, each in enumerate(passes)
        if each.row == course % height
    ]


def _side_points(each: Pass, wales: int) -> tuple[int, int]:
    """Return how many control points of a course belong to its first and to its last stitch."""
    sizes = np.diff(column_starts(each)) - _CUT
    return int(sizes[0]), int(sizes[(wales - 1) % len(sizes)])


def _course(yarn: Yarn, cell: Floats, starts: Ints, wales: int) -> Floats:
    """Return the control points of a course, between the middles of two sinker loops."""
    turns, rest = divmod(wales, len(starts) - 1)
    count = turns * starts[-1] + starts[rest] + 3 - 2 * _CUT
    period, index = np.divmod(_CUT - 1 + np.arange(count), starts[-1])
    return np.asarray(yarn.points[index] + period[:, None] * cell[0])


def draw_turn(start: Floats, end: Floats, side: float, step: float) -> Floats:
    """Draw the half ellipse by which a yarn turns from the end of a course to the next one."""
    middle, radius = (start + end) / 2, (start - end) / 2
    size = float(np.linalg.norm(radius))
    count = max(3, round(np.pi * size / step))
    angle = np.linspace(0.0, np.pi, count + 1)[1:-1, None]
    outwards = np.array([side * _DEPTH * size, 0.0, 0.0])
    return np.asarray(middle + radius * np.cos(angle) + outwards * np.sin(angle))
