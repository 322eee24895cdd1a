"""First guesses of textiles, and their relaxation with a check of their crossings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Bools, Floats, Progress
from spacemap_vtk.textile.rods.crossings import linking_numbers
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.relax import Relaxed, Stage, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Bending stiffness of taut yarns over EA and the square of their diameter: nearly none, but enough
#: to round off what they are laid around.
SOFT = 2e-3
#: Length of a taut yarn without tension, as a share of the length that is drawn.
SLACK = 0.9
#: Stiffness of contact of taut yarns over EA and the cube of their diameter: overlaps stay below
#: 0.5 %.
HARD = 450.0
#: Stages in which taut yarns find their shape; their forces are of the order of EA.
TAUT = (
    Stage(0.4, 0.03, 1e-2, 1e-2),
    Stage(0.7, 0.03, 1e-2, 1e-2),
    Stage(1.0, 0.03, 1e-3, 3e-3),
    Stage(1.0, 0.2, 1e-3, 3e-3),
    Stage(1.0, 1.0, 1e-4, 3e-5),
)


class Guess(NamedTuple):
    """Yarns of a textile as they are drawn: near to their shape at rest, with its crossings."""

    yarns: list[Yarn]
    """Centre lines."""
    cell: Floats
    """(2, 3) Period vectors [m]; those of a tube on a mandrel are along y and 0."""
    mechanics: RodMechanics
    """Stiffness and length of the yarns."""
    free: Bools = np.zeros((2, 3), dtype=bool)
    """(2, 3) Components of the period vectors that follow the yarns."""
    stages: tuple[Stage, ...] = TAUT
    """Stages of the search."""


def make_taut(yarns: Sequence[Yarn], cell: Floats, bending: float = SOFT) -> RodMechanics:
    """Choose the stiffness of yarns that are pulled taut: they take the shortest way."""
    samples, z = sample_yarns(yarns), unknowns(yarns, cell)
    speed = np.linalg.norm(samples.slopes(z), axis=1)
    drawn = np.bincount(samples.yarn, speed * samples.weight) / samples.spans
    tension = samples.diameter / samples.diameter.max()
    size = float(samples.diameter.max())
    return RodMechanics(
        tension, bending * tension * samples.diameter**2, HARD / size**3, SLACK * drawn
    )


def relax_guess(guess: Guess, progress: Progress | None = None) -> Relaxed:
    """Relax a first guess; refuse a result whose crossings changed.

    Parameters
    ----------
    guess : Guess
        The yarns as they are drawn.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    Relaxed
        The yarns at rest.

    Raises
    ------
    GeometryError
        If yarns are too near each other in the guess, or have passed through each other.
    SolverError
        If the yarns do not come to rest.
    """
    before = _crossings(guess.yarns, guess.cell, guess.mechanics.mandrel)
    found = relax_yarns(
        guess.yarns, guess.cell, guess.mechanics, guess.free, progress=progress, stages=guess.stages
    )
    if _crossings(found.yarns, found.cell, guess.mechanics.mandrel) != before:
        raise GeometryError(
            "yarns have passed through each other while they relaxed",
            cure="Draw the first guess with more control points",
        )
    return found


def _crossings(yarns: Sequence[Yarn], cell: Floats, mandrel: float) -> dict[tuple[int, ...], int]:
    return linking_numbers(*(unroll(yarns, cell) if mandrel else (yarns, cell)))


def roll(yarns: Sequence[Yarn], cell: Floats, radius: float) -> tuple[list[Yarn], Floats]:
    """Roll a plane with a cell (circumference, 0, 0), (0, pitch, 0) to a tube about y."""
    # z = 0 comes to the given radius. The cell of the tube is its pitch along y, and 0.
    turn = 2 * np.pi / cell[0, 0]
    rolled = []
    for yarn in yarns:
        x, y, z = yarn.points.T
        angle, away = turn * x, radius + z
        points = np.stack([away * np.sin(angle), y, away * np.cos(angle)], axis=1)
        periods = None if yarn.periods is None else (yarn.periods[1], 0)
        rolled.append(yarn._replace(points=points, periods=periods))
    return rolled, np.array([cell[1], np.zeros(3)])


def unroll(yarns: Sequence[Yarn], cell: Floats) -> tuple[list[Yarn], Floats]:
    """Unroll a tube about y to a plane with a circumference of 2π; the reverse of `roll`."""
    flat = []
    for yarn in yarns:
        x, y, z = yarn.points.T
        angle = np.unwrap(np.arctan2(x, z))
        points = np.stack([angle, y, np.hypot(x, z)], axis=1)
        # the number of turns until the yarn repeats itself
        step = (np.arctan2(x[0], z[0]) - angle[-1] + np.pi) % (2 * np.pi) - np.pi
        turns = round((angle[-1] + step - angle[0]) / (2 * np.pi))
        periods = None if yarn.periods is None else (turns, yarn.periods[0])
        flat.append(yarn._replace(points=points, periods=periods))
    return flat, np.array([[2 * np.pi, 0.0, 0.0], cell[0]])
