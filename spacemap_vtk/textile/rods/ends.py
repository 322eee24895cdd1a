"""Ends of knits: a cast-on of closed loops below, and a chain that binds off the loops above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.alexander import alexander_value, require_same_crossings
from spacemap_vtk.textile.rods.crossings import ASKEW, find_crossings
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.loops import POINTS
from spacemap_vtk.textile.rods.relax import STAGES, Stage, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Courses at an end that follow it, and courses beyond that are held.
FREE, HELD = 2, 2
#: Stages in which ends relax; fewer digits than those of stitches are seen.
_STAGES = (*STAGES[:4], Stage(1.0, 0.03, 1e-3), Stage(1.0, 1.0, 1e-4))
#: Stiffness in tension and contact, for a bending stiffness and a diameter of 1.
TENSION, CONTACT = 1e3, 1.6e4
#: Control points of a stitch up to the neck of its loop, and up to where its leg leaves the loop
#: through which it is pulled.
_NECK, LEG = POINTS // 8, 7 * POINTS // 24
#: Yarn in a stitch of the chain over its length as it is drawn.
TIGHT = 0.75
#: Least wale spacing at which a chain can be drawn [diameters].
NARROWEST = 2.0


class Ends(NamedTuple):
    """Yarn at both ends of a knit."""

    cast_on: Yarn
    """Of a repeat, with as many control points in each stitch."""
    bind_off: Yarn
    lower: list[Floats]
    """Control points of the first courses, which follow the cast-on."""
    upper: list[Floats]
    """Control points of the last courses, which follow the chain."""
    overlap: float
    """Largest overlap of two yarns, in diameters."""


def relax_ends(
    yarns: Sequence[Yarn],
    cell: Floats,
    length: float,
    courses: int,
    progress: Progress | None = None,
) -> Ends:
    """Relax a cast-on below the first course and a chain above the last one.

    Parameters
    ----------
    yarns : sequence of Yarn
        Relaxed yarns of a repeat, one for each row, in diameters. The courses from the one before
        the first to the fourth, and from the fourth last to the one after the last, are of knit
        and purl stitches.
    cell : ndarray of float64, shape (2, 3)
        Period vectors.
    length : float
        Length of yarn in a stitch [diameters].
    courses : int
        Courses of the piece, 4 or more.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    Ends
        In the place of the piece's first courses, and of its last ones.

    Raises
    ------
    GeometryError
        If stitches are too narrow for the chain, or if yarns have passed through each other.
    SolverError
        If the yarns do not come to rest.
    """
    step = length / POINTS
    before, after = _row(yarns, cell, -1), _row(yarns, cell, courses)
    require_room(cell[0, 0] * POINTS / len(before.points))
    first = [_row(yarns, cell, row) for row in range(FREE + HELD)]
    last = [_row(yarns, cell, row) for row in range(courses - FREE - HELD, courses)]
    below = _resample(draw_cast_on(before, cell), step)
    above = _resample(draw_chain(after, cell), step)
    lower, low = _relax_strip([below, *first], cell, step, step, progress)
    upper, high = _relax_strip([above, *last[::-1]], cell, step, TIGHT * step, progress)
    return Ends(
        lower[0],
        upper[0],
        [yarn.points for yarn in lower[1 : FREE + 1]],
        [yarn.points for yarn in upper[FREE:0:-1]],
        max(low, high),
    )


def require_room(pitch: float) -> None:
    """Raise GeometryError if stitches are too narrow for a chain."""
    if pitch < NARROWEST:
        raise GeometryError(
            "stitches are too narrow for a chain that binds them off",
            key="wale_spacing",
            value=f"{pitch:.3g} diameters",
            allowed=f"{NARROWEST:g} diameters or more",
            cure='Give a larger wale_spacing, or set ends = "cut".',
        )


def _relax_strip(
    yarns: list[Yarn], cell: Floats, step: float, outermost: float, progress: Progress | None
) -> tuple[list[Yarn], float]:
    """Relax the first yarns of a strip along x, and hold the others."""
    # Lengths of a span are `step`, and `outermost` in the first yarn.
    strip = np.stack([cell[0], np.zeros(3)])
    held = [np.full(len(yarn.points), number > FREE) for number, yarn in enumerate(yarns)]
    ones, lengths = np.ones(len(yarns)), np.full(len(yarns), step)
    lengths[0] = outermost
    value = alexander_value(yarns, find_crossings(yarns, strip, ASKEW))
    found = relax_yarns(
        yarns,
        strip,
        RodMechanics(TENSION * ones, ones, CONTACT, lengths),
        np.zeros((2, 3), dtype=bool),
        held=np.concatenate(held),
        stages=_STAGES,
        progress=progress,
    )
    require_same_crossings(value, found.yarns, strip)
    return found.yarns, found.overlap


def _row(yarns: Sequence[Yarn], cell: Floats, course: int) -> Yarn:
    """Return the yarn of any course."""
    turn, row = divmod(course, len(yarns))
    return yarns[row]._replace(points=yarns[row].points + turn * cell[1])


def _part(yarn: Yarn, cell: Floats, stitch: int, begin: int, end: int) -> Floats:
    """Return control points of a stitch of a course, which has `POINTS` of them."""
    index = stitch * POINTS + np.arange(begin, end + 1)
    period, index = np.divmod(index, len(yarn.points))
    return np.asarray(yarn.points[index] + period[:, None] * cell[0])


def draw_cast_on(course: Yarn, cell: Floats) -> list[Floats]:
    """Draw a stitch of the cast-on after the other: its loops are closed, as their legs cross."""
    # The heads of a course, backwards, joined by yarn that crosses itself below each of them.
    count = len(course.points) // POINTS
    heads = [_part(course, cell, k, _NECK, POINTS - _NECK)[::-1] for k in range(count)]
    low = min(head[[0, -1], 1].min() for head in heads) - 1.0
    middles = np.array([head.mean(axis=0) for head in heads])
    closed = np.concatenate([middles[-1:] - cell[0], middles, middles[:1] + cell[0]])
    joints = (closed[1:] + closed[:-1]) / 2
    joints[:, 1] = low - 0.9
    stitches = []
    for k, head in enumerate(heads):
        crossing = head[[0, -1]].mean(axis=0)
        crossing[1] = low
        back, front = crossing + np.array([[[0.0, 0.0, -0.6]], [[0.0, 0.0, 0.6]]])
        stitches.append(np.concatenate([joints[k : k + 1], back, head, front]))
    return stitches


def draw_chain(course: Yarn, cell: Floats) -> list[Floats]:
    """Draw a stitch of the chain after the other: each loop through the head of the last one."""
    # The feet of a course. Each head lies to the right, behind the legs of the next stitch.
    count = len(course.points) // POINTS
    left = [_part(course, cell, k, 0, LEG) for k in range(count)]
    right = [_part(course, cell, k, POINTS - LEG, POINTS - 1) for k in range(count)]
    tops = np.array([(a[-1] + b[0]) / 2 for a, b in zip(left, right, strict=True)])
    top = max(float(part[:, 1].max()) for part in (*left, *right)) + 0.2
    # Links of equal length at one depth, wherever the wales are.
    pitch, z = cell[0, 0] / count, float(tops[:, 2].mean())
    reach, side = min(1.3, 0.32 * pitch), min(0.5, 0.125 * pitch)
    start = float((tops[:, 0] - pitch * np.arange(count)).mean())
    stitches = []
    for k, depth in enumerate(tops[:, 2]):
        x, far = start + k * pitch, start + (k + 1) * pitch
        loop = [
            (x - side, 0.4, depth - 0.2),
            (x - side, 1.4, z - 0.8),
            (x - 0.8 * side, 2.7, z - 0.3),
            (x + reach, 3.5, z + 0.8),
            (x + 0.6 * pitch, 3.9, z),
            (far + 0.4 * reach, 3.9, z - 0.6),
            (far + reach, 2.5, z - 0.8),
            (far + 0.6 * reach, 1.2, z - 0.1),
            (far, 1.0, z + 0.8),
            (x + 0.6 * pitch, 1.3, z + 0.7),
            (x + reach, 2.1, z + 0.9),
            (x + 1.3 * side, 2.1, z - 0.1),
            (x + side, 1.4, z - 0.8),
            (x + side, 0.4, depth - 0.2),
        ]
        stitches.append(np.concatenate([left[k], loop + np.array([0.0, top, 0.0]), right[k]]))
    return stitches


def _resample(stitches: list[Floats], step: float) -> Yarn:
    """Make a yarn of stitches, with as many control points on each of them."""
    ways = [
        np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        for line in stitches
    ]
    count = round(float(np.mean([way[-1] for way in ways])) / step)
    points = [
        np.column_stack([np.interp(np.arange(count) / count * way[-1], way, x) for x in line.T])
        for line, way in zip(stitches, ways, strict=True)
    ]
    return Yarn(np.concatenate(points), (1, 0))
