"""How far a linear motion exceeds the range of small displacements."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from spacemap_vtk import cancel
from spacemap_vtk.mechanics.elements.kinematics import MeanGradient, largest_rotation
from spacemap_vtk.mechanics.elements.shell import MidSurface, SheetGradient
from spacemap_vtk.mechanics.elements.tetrahedra import EDGES
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.ndarrays import Floats

#: The sides of a quadrilateral.
_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))


class MotionExtremes(NamedTuple):
    """Largest rotation, stretch and change of volume of any cell over several times."""

    rotation: float
    """Largest rotation of a tetrahedron: half the curl of the displacement from rest [rad]."""
    stretch: float
    """Largest relative change of an edge's length; for a sheet, on its mid-surface."""
    volume: float
    """Largest relative change of a tetrahedron's volume."""

    @property
    def pendulum_period(self) -> float:
        """Period of a pendulum of this amplitude, as a multiple of that of a small amplitude."""
        if self.rotation >= math.pi:
            return math.inf  # a pendulum released upside down never returns
        # 2 K(sin θ/2)/π as an arithmetic-geometric mean.
        arithmetic, geometric = 1.0, math.cos(self.rotation / 2)
        while abs(arithmetic - geometric) > 1e-12:
            mean = (arithmetic + geometric) / 2
            arithmetic, geometric = mean, math.sqrt(arithmetic * geometric)
        return 1.0 / arithmetic


def measure_extremes(
    motion: Motion,
    rest: Floats,
    times: Iterable[float],
    gradient: MeanGradient | SheetGradient | None = None,
    surface: MidSurface | None = None,
) -> MotionExtremes:
    """Compute the largest rotation, stretch and change of volume in a motion.

    Parameters
    ----------
    motion : Motion
        Motion of a cage.
    rest : ndarray of float64, shape (V, 3)
        Vertices at rest, undeformed or in equilibrium [m].
    times : iterable of float
        Times to evaluate [s].
    gradient : MeanGradient or SheetGradient, optional
        Gradient of displacements from rest; by default that of each tetrahedron.
    surface : MidSurface, optional
        Mid-surface, if the cage is a sheet.

    Returns
    -------
    Realm
        The largest rotation, stretch and change of volume.
    """
    cells = motion.cells
    gradient = MeanGradient(rest, cells) if gradient is None else gradient
    edges = cells[:, EDGES] if surface is None else surface.quads[:, _SIDES]
    # Each edge once. Not by `np.unique`, whose imports would delay the window's first picture.
    lower, higher = np.sort(edges.reshape(-1, 2), axis=1).T
    keys = np.sort(lower * len(rest) + higher)
    first, last = np.divmod(keys[np.diff(keys, prepend=-1) > 0], len(rest))

    def lengths(vertices: Floats) -> Floats:
        nodes = vertices if surface is None else surface.to_nodes(vertices)
        return np.asarray(np.linalg.norm(nodes[last] - nodes[first], axis=1))

    before = lengths(rest)
    most = MotionExtremes(0.0, 0.0, 0.0)
    for time in times:
        cancel.check()
        moved = motion.points + motion.at_time(time)[0]
        tensor = gradient.evaluate(moved - rest)
        volume_ratios = np.linalg.det(tensor.transpose(2, 0, 1) + np.eye(3))
        now = (
            largest_rotation(tensor),
            abs(lengths(moved) / before - 1).max(),
            abs(volume_ratios - 1).max(),
        )
        most = MotionExtremes(*(max(a, float(b)) for a, b in zip(most, now, strict=True)))
    return most
