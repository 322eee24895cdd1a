"""Pieces of knit of one yarn: cast on, turned at the sides, bound off and fastened off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints, Progress
from spacemap_vtk.textile.rods.alexander import alexander_value, require_same_crossings
from spacemap_vtk.textile.rods.crossings import ASKEW, find_crossings
from spacemap_vtk.textile.rods.ends import (
    CONTACT,
    FREE,
    LEG,
    TENSION,
    TIGHT,
    draw_cast_on,
    draw_chain,
    require_room,
)
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.knit import draw_turn
from spacemap_vtk.textile.rods.loops import POINTS
from spacemap_vtk.textile.rods.relax import STAGES, Stage, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Stages; fewer digits than those of stitches are seen.
_STAGES = (*STAGES[:4], Stage(1.0, 0.03, 1e-3, 1e-4), Stage(1.0, 1.0, 1e-4, 1e-5))
#: Control points at each end of the yarn that are held; without friction the knit would ravel.
_HELD = 4
#: Ends of the yarn, in diameters: where it enters, relative to the first point of the cast-on,
#: and where it leaves, relative to the last loop of the bind-off.
_FIRST_TAIL = np.array([[3.5, -0.8, 0.0], [2.0, -0.5, 0.0]])
_LAST_TAIL = np.array([[1.5, 0.5, 0.0], [3.5, 0.8, 0.0]])
_MIRROR = np.array([-1.0, 1.0, 1.0])


class BoundPiece(NamedTuple):
    """A relaxed piece of knitting that is one yarn from the cast-on to the bind-off."""

    parts: list[Floats]
    """(k, 3) Control points of the cast-on, of each course and of the chain, each with the turn
    after it."""
    overlap: float
    """Largest overlap of the yarn with itself, in diameters."""


class Drawn(NamedTuple):
    """A piece as it is drawn, before it relaxes."""

    parts: list[Floats]
    """As of `BoundPiece`."""
    held: list[Bools]
    """(k,) Control points that stay."""


def relax_bound_piece(
    yarns: Sequence[Yarn],
    cell: Floats,
    length: float,
    wales: int,
    courses: int,
    progress: Progress | None = None,
) -> BoundPiece:
    """Relax the edges of a whole piece, from the first loop that is cast on to the fastened end.

    Parameters
    ----------
    yarns : sequence of Yarn
        Relaxed yarns of a repeat of knit and purl stitches, one for each row, in diameters.
    cell : ndarray of float64, shape (2, 3)
        Period vectors.
    length : float
        Length of yarn in a stitch [diameters].
    wales, courses : int
        Stitches and courses of the piece, 3 and 4 or more.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    BoundPiece
        Its inner stitches stay as they are, and both ends of the yarn.

    Raises
    ------
    GeometryError
        If stitches are too narrow for the chain, or if yarns have passed through each other.
    SolverError
        If the yarn does not come to rest.
    """
    require_room(cell[0, 0] * POINTS / len(yarns[0].points))
    drawn = draw_bound_piece(yarns, cell, length, wales, courses)
    yarn, nowhere, ones = Yarn(np.concatenate(drawn.parts), None), np.zeros((2, 3)), np.ones(1)
    value = knot_value(yarn.points)
    found = relax_yarns(
        [yarn],
        nowhere,
        RodMechanics(TENSION * ones, ones, CONTACT, length / POINTS * ones),
        np.zeros((2, 3), dtype=bool),
        held=np.concatenate(drawn.held),
        stages=_STAGES,
        progress=progress,
    )
    points = found.yarns[0].points
    require_same_crossings(value, [close_yarn(points)], nowhere)
    ends = np.cumsum([len(part) for part in drawn.parts])[:-1]
    return BoundPiece(np.split(points, ends), found.overlap)


def draw_bound_piece(
    yarns: Sequence[Yarn], cell: Floats, length: float, wales: int, courses: int
) -> Drawn:
    """Draw a cast-on, courses that turn at the sides, and a chain, as one yarn."""
    step, rows = length / POINTS, range(courses)
    inside = np.arange(1, wales * POINTS)
    lines = [_course(yarns, cell, row, inside) for row in range(courses + 1)]
    # The first course runs to the right. So the loops below it are cast on to the left.
    wide = _course(yarns, cell, -1, np.arange((wales + 1) * POINTS))
    period = np.stack([cell[0] * len(wide) / len(yarns[0].points), cell[1]])
    loops = draw_cast_on(Yarn(wide, (1, 0)), period)
    below = np.concatenate([*loops[:wales], loops[wales][:1]])[::-1]
    below = _resample(np.concatenate([below[0] + _FIRST_TAIL, below]), step)
    parts = [np.concatenate([below, draw_turn(below[-1], lines[0][0], -1.0, step)])]
    held = [np.arange(len(parts[0])) < _HELD]
    inner = (inside >= POINTS) & (inside < (wales - 1) * POINTS)
    for row in rows:
        way = 1 if row % 2 == 0 else -1
        line, above = lines[row][::way], lines[row + 1][::way]
        turn = draw_turn(line[-1], above[-1], float(way), step)
        parts.append(np.concatenate([line, turn]))
        is_inner = inner[::way] & (FREE <= row < courses - FREE)
        held.append(np.append(is_inner, np.zeros(len(turn), dtype=bool)))
    # The chain runs on from the last turn, with one more stitch, of which the end of the yarn is.
    index, mirror = np.arange((wales + 1) * POINTS), np.ones(3)
    if courses % 2:
        index, mirror = wales * POINTS - index, _MIRROR
    wide = _course(yarns, cell, courses, index) * mirror
    stitches = draw_chain(Yarn(wide, (1, 0)), period)
    tail = stitches[wales][LEG + 1 : LEG + 5]
    chain = _resample(np.concatenate([*stitches[:wales], tail])[1:] * mirror, step / TIGHT)
    end = (tail[-1] + _LAST_TAIL) * mirror
    end = _resample(np.concatenate([chain[-1:], end]), step)[1:]
    parts.append(np.concatenate([chain, end]))
    held.append(np.arange(len(parts[-1])) >= len(parts[-1]) - _HELD)
    return Drawn(parts, held)


def knot_value(points: Floats) -> float:
    """Compute the value of Alexander's polynomial of a yarn whose ends are joined above it."""
    yarns = [close_yarn(points)]
    return alexander_value(yarns, find_crossings(yarns, np.zeros((2, 3)), ASKEW))


def close_yarn(points: Floats) -> Yarn:
    """Join the ends of a yarn above all of it."""
    over = points[[-1, 0]]
    over[:, 2] = points[:, 2].max() + 3.0
    way = _resample(np.concatenate([points[-1:], over, points[:1]]), 1.0)
    return Yarn(np.concatenate([points, way[1:]]), (0, 0))


def _course(yarns: Sequence[Yarn], cell: Floats, course: int, index: Ints) -> Floats:
    """Return control points of any course, counted from the left side of the piece."""
    turn, row = divmod(course, len(yarns))
    points = yarns[row].points
    period, own = np.divmod(index, len(points))
    return np.asarray(points[own] + period[:, None] * cell[0] + turn * cell[1])


def _resample(line: Floats, step: float) -> Floats:
    """Return points at equal distances of about a step on a polygon."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, way[-1], max(2, round(way[-1] / step) + 1))
    return np.column_stack([np.interp(at, way, x) for x in line.T])
