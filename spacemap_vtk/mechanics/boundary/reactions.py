"""Reactions: the forces and moments by which supports and grips hold a body."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.mechanics.boundary.grips import Grip
from spacemap_vtk.mechanics.boundary.places import (
    Masks,
    directions,
    find_vertices,
    parse_places,
)
from spacemap_vtk.ndarrays import Floats


class Reaction(NamedTuple):
    """Force and moment that a support, grip or obstacle exerts on the body."""

    kind: str
    """``"support"``, ``"grip"``, ``"springs"`` or ``"obstacle"``."""
    name: str
    """Place of a support or grip; empty for others."""
    force: Floats
    """(3,), force on the body [N]."""
    moment: Floats
    """(3,), moment about the point `about` [N m]."""
    about: Floats
    """(3,), point of the moment [m]."""


class Bearing(NamedTuple):
    """What holds a part of the vertices: a support or a grip."""

    kind: str
    """``"support"`` or ``"grip"``."""
    name: str
    """Its place."""
    shares: Floats
    """(V, 3, 3), projection of the force that holds each vertex on the share of this bearing."""
    about: Floats
    """(3,), point of moments: the centre of a grip, or the mean of a support's vertices [m]."""

    def reaction(self, forces: Floats, positions: Floats, moved: ArrayLike = 0.0) -> Reaction:
        """Sum the forces that hold vertices.

        Parameters
        ----------
        forces : ndarray of float64, shape (V, 3)
            Forces that hold the vertices [N].
        positions : ndarray of float64, shape (V, 3)
            Positions of the vertices [m].
        moved : array_like of float, shape (3,), optional
            Move of the point of moments from its place at rest [m].

        Returns
        -------
        Reaction
            Its share, with the moment about the moved point.
        """
        mine = np.einsum("vij,vj->vi", self.shares, forces)
        about = self.about + np.asarray(moved, dtype=np.float64)
        moment = np.cross(positions - about, mine).sum(axis=0)
        return Reaction(self.kind, self.name, mine.sum(axis=0), moment, about)


def find_bearings(
    points: Floats, supports: Iterable[str], grips: Sequence[Grip] = (), masks: Masks | None = None
) -> list[Bearing]:
    """List the grips and supports of a cage, each with its share of the forces that hold it.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    supports : iterable of str
        Texts for `parse_places`.
    grips : sequence of Grip, optional
        Grips.
    masks : callable, optional
        Function from the name of a point array to its values.

    Returns
    -------
    list of Bearing
        Supports, then grips, in their order. A component that two of them hold counts for the
        first of these, so that the sum of all reactions is what holds the body.
    """
    found: list[Bearing] = []
    sums = np.zeros((len(points), 3, 3))

    def add(kind: str, name: str, held: Floats, about: Floats) -> None:
        nonlocal sums
        before, sums = _projections(sums), sums + held
        found.append(Bearing(kind, name, _projections(sums) - before, about))

    for place in parse_places(" ".join(supports)):
        middle = points[find_vertices(points, place, masks)].mean(axis=0)
        add("support", str(place), directions(points, place, masks), middle)
    for grip in grips:
        add("grip", grip.name, grip.held[:, :, None] * np.eye(3), grip.center)
    return found


def _projections(sums: Floats) -> Floats:
    """Compute the projections (V, 3, 3) on the range of sums of n nᵀ."""
    result = np.zeros_like(sums)
    some = np.flatnonzero(sums.any(axis=(1, 2)))
    values, vectors = np.linalg.eigh(sums[some])
    result[some] = (vectors * (values > 1e-9)[:, None]) @ vectors.swapaxes(1, 2)
    return result
