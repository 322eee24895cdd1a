"""First guess of a weft knit's yarns from its stitches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.crossings import find_crossings
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points of a stitch.
POINTS = 24
#: Shape of a loop: width of its neck against the wale spacing, and height over the course spacing.
_NECK, _HEIGHT = 0.18, 0.80


class KnitGuess(NamedTuple):
    """Yarns of one repeat, one for each row, and its cell."""

    yarns: list[Yarn]
    cell: Floats


def guess_knit(rows: Sequence[str], diameter: float, stitch_length: float) -> KnitGuess:
    """Draw the loops of a knit.

    Parameters
    ----------
    rows : sequence of str
        Stitches of a repeat, the lowest row first: k for knit and p for purl, seen from the face.
    diameter : float
        Diameter of the yarn [m].
    stitch_length : float
        Length of yarn in a stitch [m].

    Returns
    -------
    KnitGuess
        Each row is one yarn along x.

    Raises
    ------
    InputError
        If the rows have no stitches, different lengths, or an unknown letter.
    """
    width = len(rows[0]) if rows else 0
    if not width or any(len(row) != width for row in rows) or set("".join(rows)) - set("kp"):
        raise InputError(
            "these are no stitches of a knit",
            key="rows",
            value=list(rows),
            allowed="rows of equal length, of the letters k and p",
        )
    wale, course = stitch_length / 4.0, stitch_length / 5.0
    t = 2 * np.pi * (np.arange(width * POINTS) - 1) / POINTS
    x = wale * (t / (2 * np.pi) + _NECK * np.sin(2 * t))
    y = _HEIGHT * course * np.cos(t)
    flat = [
        Yarn(np.stack([x, y + row * course, 0 * x], axis=1), (1, 0), diameter)
        for row in range(len(rows))
    ]
    cell = np.array([[wale * width, 0.0, 0.0], [0.0, course * len(rows), 0.0]])
    crossings = find_crossings(flat, cell)
    # The loops of a row are drawn through those of the row below it: seen from the face, the legs
    # of a knit stitch lie above the head of the loop below, and its feet below that loop's legs.
    height = crossings.yarns + len(rows) * np.stack(
        [np.zeros(len(crossings.yarns), dtype=np.int64), crossings.shift[:, 1]], axis=1
    )
    upper = height.argmax(axis=1)[:, None]
    phase = crossings.parameters / POINTS
    from_foot = abs(np.take_along_axis(phase, upper, 1) % 1.0 - 0.5)[:, 0]
    other = np.take_along_axis(phase, 1 - upper, 1)[:, 0]
    from_head = abs(other - np.round(other))
    stitches = np.array([list(row) for row in rows])
    stitch = np.round(np.take_along_axis(phase, upper, 1)[:, 0]).astype(int) % width
    knit = stitches[np.take_along_axis(crossings.yarns, upper, 1)[:, 0], stitch] == "k"
    is_leg = from_head < from_foot
    upper_is_above = is_leg == knit
    return KnitGuess(lift_yarns(flat, crossings, upper_is_above == (upper[:, 0] == 0)), cell)
