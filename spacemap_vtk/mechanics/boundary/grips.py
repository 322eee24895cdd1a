"""Grips: sets of held vertices that are moved and turned by prescription."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.places import (
    Masks,
    Place,
    find_components,
    parse_places,
)
from spacemap_vtk.mechanics.boundary.time_functions import TimeFunction
from spacemap_vtk.ndarrays import Bools, Floats

#: Word for the place of a grip in messages.
PLACE = "grip"


class GripMotion(NamedTuple):
    """Motion of a grip in time: a displacement and a rotation vector times a function."""

    displacement: Floats
    """(3,), displacement where the function is 1 [m]."""
    rotation: Floats
    """(3,), rotation vector where the function is 1 [rad]."""
    function: TimeFunction
    """Factor over time, which is continuous and begins with 0."""

    def displace(self, points: Floats, center: Floats, time: float) -> tuple[Floats, Floats]:
        """Compute the motion of points, and how it changes with the factor.

        Parameters
        ----------
        points : ndarray of float64, shape (V, 3)
            Positions before the motion [m].
        center : ndarray of float64, shape (3,)
            Centre of the rotation [m], which moves with the points.
        time : float
            Time [s].

        Returns
        -------
        displacement : ndarray of float64, shape (V, 3)
            Displacement since t = 0 [m].
        change : ndarray of float64, shape (V, 3)
            Its derivative by the factor [m]; times the slope of the function it is the velocity.
        """
        factor = self.function.value(time)
        turned = displace_rigidly(points, center, np.zeros(3), factor * self.rotation)
        change = self.displacement + np.cross(self.rotation, points - center + turned)
        return turned + factor * self.displacement, change


class Grip(NamedTuple):
    """Vertices that move as a rigid body along a prescribed path.

    A held component of a vertex X is displaced by R (X - c) + c + m - X: the grip turns about its
    centre c, and moves. Components that are not held stay free.
    """

    held: Bools
    """(V, 3), components that the grip holds."""
    center: Floats
    """(3,), centre c about which it turns [m]."""
    moves: Floats
    """(S, 3), move m at each of the S places of its path [m]."""
    turns: Floats
    """(S, 3), rotation vector at each of these places [rad], in the direction of the axis."""
    name: str = "grip"
    """Name in reports."""
    motion: GripMotion | None = None
    """Motion in time, from the last place of the path on."""

    def displacement(self, points: Floats, at: float) -> Floats:
        """Compute the prescribed displacement.

        Parameters
        ----------
        points : ndarray of float64, shape (V, 3)
            Vertices at rest [m].
        at : float
            Number of the place on the path, from 0; moves and rotation vectors are linear between
            two places.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Displacement of the held components [m]; 0 for all others.
        """
        pose = self.pose(at)
        return np.where(self.held, displace_rigidly(points, self.center, *pose), 0.0)

    def pose(self, at: float) -> tuple[Floats, Floats]:
        """Compute move and rotation vector.

        Parameters
        ----------
        at : float
            Number of the place on the path, see `displacement`.

        Returns
        -------
        move : ndarray of float64, shape (3,)
            Move [m].
        turn : ndarray of float64, shape (3,)
            Rotation vector [rad].
        """
        last = len(self.moves) - 1
        before = min(int(at), max(last - 1, 0))
        after, share = min(before + 1, last), at - before
        return (
            (1 - share) * self.moves[before] + share * self.moves[after],
            (1 - share) * self.turns[before] + share * self.turns[after],
        )


def make_grip(
    points: Floats,
    place: str,
    *,
    moves: ArrayLike | None = None,
    turns: ArrayLike | None = None,
    center: ArrayLike | None = None,
    name: str = "",
    masks: Masks | None = None,
) -> Grip:
    """Make a grip of the vertices in a place, or in several that move together.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    place : str
        Text of one or more places for `parse_places`, which may name components: ``"+x:x"``.
    moves, turns : array_like of float, shape (S, 3), optional
        Moves [m] and rotation vectors [rad] at the places of the path, the first of them 0; by
        default all are 0.
    center : array_like of float, shape (3,), optional
        Centre of the turns, and of moments [m]; by default the mean of the vertices.
    name : str, optional
        Name in reports; by default the text of the place.
    masks : callable, optional
        Function from the name of a point array to its values.

    Returns
    -------
    Grip
        The grip.

    Raises
    ------
    InputError
        If the place contains no vertex, is along a direction, or a grip that does not hold all
        components is to be turned.

    Examples
    --------
    A square whose side at +x is turned by a quarter about z:

    >>> square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0.0]])
    >>> grip = make_grip(square, "+x", turns=[[0, 0, 0], [0, 0, np.pi / 2]])
    >>> grip.displacement(square, 1.0).round(9).tolist()[1]
    [1.0, 1.0, 0.0]
    """
    parsed = parse_places(place, what=PLACE)
    if not parsed:
        raise InputError("a grip needs a place", key="place", value=place)
    held = np.any([grip_components(points, each, masks) for each in parsed], axis=0)
    places = max(1 if part is None else len(np.asarray(part)) for part in (moves, turns))
    shift, turn = (
        np.zeros((places, 3)) if part is None else np.array(part, dtype=np.float64)
        for part in (moves, turns)
    )
    if shift.shape != turn.shape or shift.shape[1:] != (3,):
        raise InputError(
            f"moves have shape {shift.shape} and turns {turn.shape}", allowed="(S, 3) both"
        )
    if turn.any() and any(each.components != "xyz" for each in parsed):
        raise InputError(
            "a grip that leaves components free cannot turn",
            key="turns",
            value=turn.tolist(),
            cure='Let it hold all components: leave out ":…" behind its place',
        )
    middle = points[held.any(axis=1)].mean(axis=0) if center is None else np.array(center, float)
    return Grip(held, middle, shift, turn, name or " ".join(map(str, parsed)))


def check_axes(place: Place) -> None:
    """Refuse a place of a grip that is along a direction.

    Parameters
    ----------
    place : Place
        The place.

    Raises
    ------
    InputError
        If it has a direction.
    """
    if place.direction:
        raise InputError(
            "a grip holds components along the axes, not along a direction",
            key="place",
            value=str(place),
            allowed='a place such as "+x" or "+x:yz"',
        )


def grip_components(points: Floats, place: Place, masks: Masks | None = None) -> Bools:
    """Find the components, (V, 3), that a grip at a place holds."""
    check_axes(place)
    held = find_components(points, place, masks, PLACE).reshape(len(points), -1)
    return held & np.array([axis in place.components for axis in "xyz"])


def rotation_change(vector: ArrayLike) -> Floats:
    """Compute R - 1, (3, 3), of a rotation vector [rad] by Rodrigues' formula."""
    # Without cancellation, so that a small turn keeps its digits.
    turn = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(turn))
    cross = np.cross(np.eye(3), turn)  # cross @ x = turn × x
    # sin(a)/a and (1 - cos a)/a², which have no singularity
    first = np.sinc(angle / np.pi)
    second = np.sinc(angle / (2 * np.pi)) ** 2 / 2
    return np.asarray(first * cross + second * cross @ cross)


def displace_rigidly(points: Floats, center: Floats, move: Floats, turn: Floats) -> Floats:
    """Compute the displacement R (X - c) + c + m - X of points (V, 3) [m]."""
    return (points - center) @ rotation_change(turn).T + move


def prescribed_displacement(points: Floats, grips: Iterable[Grip], at: float) -> Floats:
    """Compute the displacement (V, 3) [m] that grips prescribe; 0 for components of none."""
    total = np.zeros_like(points)
    for grip in grips:
        total = np.where(grip.held, grip.displacement(points, at), total)
    return total


def held_by(grips: Sequence[Grip], shape: tuple[int, ...]) -> Bools:
    """Find the components that any of some grips holds.

    Parameters
    ----------
    grips : sequence of Grip
        The grips.
    shape : tuple of int
        (V, 3).

    Returns
    -------
    ndarray of bool, shape (V, 3)
        True where a grip holds.
    """
    return np.any([np.zeros(shape, dtype=bool), *(grip.held for grip in grips)], axis=0)
