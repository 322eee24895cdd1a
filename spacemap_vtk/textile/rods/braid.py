"""Braids: carriers that cross each other on a mandrel or in a flat strip, drawn and pulled taut.

All carriers of one direction are images of one yarn, so that a cell is as long as one crossing: in
a tube it holds two yarns, in a strip one, which goes to and fro.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.rods.crossings import find_crossings
from spacemap_vtk.textile.rods.guess import Guess, make_taut, roll
from spacemap_vtk.textile.rods.lift import lift_yarns
from spacemap_vtk.textile.rods.yarns import Yarn, basis_functions

#: Control points between two crossings.
_POINTS = 8


def draw_tube(carriers: int, over: int, mandrel: float, pitch: float) -> Guess:
    """Draw a braid round a mandrel.

    Parameters
    ----------
    carriers : int
        Number of yarns, half of them in each direction; a multiple of 4 `over`, or of 2 if that
        is 1.
    over : int
        Number of yarns that each yarn passes over, and then under.
    mandrel : float
        Diameter of the mandrel [diameters].
    pitch : float
        Length along the tube between two crossings of a yarn's neighbours: a carrier goes round
        once in carriers / 2 of them [diameters].

    Returns
    -------
    Guess
        Two yarns of opposite directions along y, each of which goes round once.

    Raises
    ------
    GeometryError
        If the number of carriers does not fit.
    """
    half = carriers // 2
    if carriers % 2 or half % (2 * over if over > 1 else 1):
        raise GeometryError(
            "the carriers of a tube cannot pass over each other so",
            key="carriers",
            value=carriers,
            allowed=f"multiples of {4 * over if over > 1 else 2} for over = {over}",
        )
    radius = mandrel / 2 + 1.0
    # Rolled out: the circumference along x.
    circumference = 2 * np.pi * radius
    plane = np.array([[circumference, 0.0, 0.0], [0.0, pitch, 0.0]])
    count = half * _POINTS
    share = np.arange(count) / count
    flat = [
        Yarn(
            np.stack([way * circumference * share, half * pitch * share, 0 * share], axis=1),
            (way, half),
        )
        for way in (1, -1)
    ]
    crossings = find_crossings(flat, plane)
    # Crossings stand in columns along the tube, 2 for each yarn of a direction.
    place = _place_of(flat, crossings.yarns[:, 0], crossings.parameters[:, 0])
    column = np.round(place[:, 0] / circumference * carriers).astype(int)
    column -= column.min()
    goes_right = crossings.yarns[:, 0] == 0
    above = (column // over % 2 == 0) == goes_right
    yarns, cell = roll(lift_yarns(flat, crossings, above), plane, radius)
    return Guess(yarns, cell, make_taut(yarns, cell)._replace(mandrel=mandrel / 2))


def draw_strip(carriers: int, over: int, pitch: float) -> Guess:
    """Draw a flat braid, such as a three-strand plait.

    Parameters
    ----------
    carriers : int
        Number of yarns, 3 or more.
    over : int
        Number of yarns that each yarn passes over, and then under.
    pitch : float
        Length along the strip after which the next yarn has the same place [diameters].

    Returns
    -------
    Guess
        One yarn along y that goes to the right and back in as many cells as there are carriers.
    """
    if (carriers - 1) % over:
        raise GeometryError(
            "the carriers of a strip cannot pass over each other so",
            key="carriers",
            value=carriers,
            allowed=f"one more than a multiple of {over} for over = {over}",
        )
    count = 2 * _POINTS * carriers
    share = (np.arange(count) - 1) / count
    width = carriers - 1.0
    # A wave whose crests are rounded over about the room of one carrier.
    angle = 2 * np.pi * share
    sharp = 1.0 - 0.35 / carriers
    x = width / 2 * 1.2 * np.arcsin(sharp * np.sin(angle)) / np.arcsin(sharp)
    points = np.stack([x, carriers * pitch * share, 0 * share], axis=1)
    flat = [Yarn(points, (0, carriers))]
    plane = np.array([[0.0, 0.0, 0.0], [0.0, pitch, 0.0]])
    crossings = find_crossings(flat, plane)
    place = _place_of(flat, crossings.yarns[:, 0], crossings.parameters[:, 0])
    # Crossings stand in columns, one less than carriers.
    order = np.unique(np.round(place[:, 0], 3))
    column = np.searchsorted(order, np.round(place[:, 0], 3))
    part = crossings.parameters[:, 0] / count
    goes_right = (part < 0.25) | (part > 0.75)
    above = (column // over % 2 == 0) == goes_right
    yarns = lift_yarns(flat, crossings, above)
    return Guess(yarns, plane, make_taut(yarns, plane))


def _place_of(yarns: list[Yarn], which: Ints, parameters: Floats) -> Floats:
    """Compute the places of parameters on yarns, (c, 3)."""
    span, t = np.divmod(parameters, 1.0)
    weights = basis_functions(t)[0]
    found = np.empty((len(span), 3))
    for k, (yarn, index) in enumerate(zip(which, span.astype(int), strict=True)):
        points = yarns[yarn].points
        corners = points[np.minimum(index + np.arange(4), len(points) - 1)]
        wrapped = index + np.arange(4) >= len(points)
        corners = np.where(wrapped[:, None], points[-1] + (points[-1] - points[-2]), corners)
        found[k] = weights[k] @ corners
    return found
