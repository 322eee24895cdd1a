"""Knits whose sides are joined: tubes, in which each course is a ring.

Their cell is bent: each repeat is turned against its neighbour, so that all of them close a circle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics
from spacemap_vtk.textile.rods.overlap import largest_overlap
from spacemap_vtk.textile.rods.relax import relax_again
from spacemap_vtk.textile.rods.yarns import Yarn, move_to_image, sample_yarns, unknowns


class Rolled(NamedTuple):
    """Yarns of a repeat in a tube."""

    yarns: list[Yarn]
    """Yarns at rest."""
    cell: Floats
    """(2, 3) Period round the tube, whose length is that of an arc, and period along it."""
    overlap: float
    """Largest overlap of two yarns, in diameters."""


def roll_yarns(
    yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics, repeats: int
) -> Rolled:
    """Let flat yarns come to rest in a tube about y, z outside.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns at rest in a flat cell [diameters].
    cell : ndarray of float64, shape (2, 3)
        Period vectors along x and y [diameters].
    mechanics : RodMechanics
        Stiffness of the yarns.
    repeats : int
        Number of repeats round the tube.

    Returns
    -------
    Rolled
        Yarns beside the plane z = 0, in which the tube has its mean diameter.

    Raises
    ------
    SolverError
        If the yarns do not come to rest.
    """
    samples = sample_yarns(yarns, turn=-2 * np.pi / repeats)
    energy = RodEnergy(samples, mechanics)
    z = relax_again(energy, unknowns(yarns, cell), np.eye(2, 3, dtype=bool)).z
    parts = np.split(z[:-2], np.cumsum([len(yarn.points) for yarn in yarns])[:-1])
    rolled = [yarn._replace(points=part) for yarn, part in zip(yarns, parts, strict=True)]
    return Rolled(rolled, z[-2:], largest_overlap(rolled, z[-2:], samples.turn))


def repeat_round(rolled: Rolled, laid: Sequence[tuple[int, int]], repeats: int) -> list[Floats]:
    """Repeat yarns round a tube about y.

    Parameters
    ----------
    rolled : Rolled
        Yarns of a repeat.
    laid : sequence of tuple of int
        Period along the tube, and number, of each yarn.
    repeats : int
        Number of repeats round the tube.

    Returns
    -------
    list of ndarray of float64, shape (n, 3)
        Control points of rings.
    """
    turn = -2 * np.pi / repeats
    # A repeat is an arc along x at first, as long as the first period.
    middle = np.array([0.0, 0.0, rolled.cell[0, 0] / turn])
    rings = []
    for period, number in laid:
        points = rolled.yarns[number].points
        shifts: Ints = np.array([[repeat, period] for repeat in range(repeats)])
        ring = np.concatenate([move_to_image(points, shift, rolled.cell, turn) for shift in shifts])
        rings.append(np.concatenate([ring, ring[:3]]) - middle)
    return rings
