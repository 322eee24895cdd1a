"""Where linear vibrations about a state at rest on obstacles would open its contact.

In linear vibrations all contacts stay closed: samples that touch are held along the normal, and
only the force between them and the obstacle changes. Contact would open where this force becomes a
pull.

At the edge of the touching region the vibration exerts a moment M per length, which a few
neighbouring samples carry by large opposite forces. Forces are therefore spread over neighbouring
cells first, which keeps their sum and moment. With the reaction R per length at the edge, the real
edge would move by M/R. The spread force becomes a pull when this is about a cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.resting import obstacles_of
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats

#: Forces are spread from nodes to their elements and back so many times, by about a cell.
_SPREADS = 3


class Opening(NamedTuple):
    """Factors by which displacements are multiplied when contact with an obstacle first opens."""

    forwards: Floats
    """(n,), factor of each displacement; infinite if it opens nothing."""
    backwards: Floats
    """(n,), factor of its opposite."""


class RestingContact:
    """Contact of a body at rest with one obstacle.

    Parameters
    ----------
    term : ObstacleTerm
        The obstacle, with the friction of the state at rest.
    rest : ndarray of float64, shape (V, 3)
        Positions of the vertices at rest [m].
    """

    def __init__(self, term: ObstacleTerm, rest: Floats) -> None:
        self._samples, self._held, self._count = term.samples, term.evaluate(rest).held, len(rest)
        self._nodes = self._samples.nodes[self._held.elements]
        self._touching = np.unique(self._nodes[(self._held.press > 0).any(axis=1)])
        self._press = self._spread(self._held.press)

    def find_openings(self, moves: Floats) -> Opening:
        """Find the factors of displacements from rest at which the contact opens.

        Parameters
        ----------
        moves : ndarray of float64, shape (n, V, 3)
            Displacements of the vertices from the state at rest [m], which solve the equations of
            linear vibrations about it.

        Returns
        -------
        Opening
            Factors of all displacements.
        """
        found = np.full((2, len(moves)), np.inf)
        for number, move in enumerate(moves):
            moved = self._samples.positions(move)[self._held.elements]
            pulls = self._spread(self._held.springs * (self._held.normal * moved).sum(axis=2))
            for side, way in enumerate((pulls, -pulls)):
                multiples = self._press[way > 0] / way[way > 0]
                found[side, number] = multiples.min(initial=np.inf)
        return Opening(*found)

    def _spread(self, forces: Floats) -> Floats:
        """Spread the forces of samples over nodes and their neighbours; the sum stays."""
        shared = (forces @ self._samples.weights).ravel()
        values = np.bincount(self._nodes.ravel(), shared, self._count).astype(np.float64)
        nodes = self._samples.nodes
        elements = np.maximum(np.bincount(nodes.ravel(), minlength=self._count), 1)
        for _ in range(_SPREADS):
            shared = np.repeat((values / elements)[nodes].mean(axis=1), nodes.shape[1])
            values = np.bincount(nodes.ravel(), shared, self._count).astype(np.float64)
        return values[self._touching]


def resting_contacts(model: Model) -> list[RestingContact]:
    """Return the contact of a model at rest with each of its obstacles.

    Parameters
    ----------
    model : Model
        A body at rest.

    Returns
    -------
    list of RestingContact
        One for each obstacle.
    """
    rest = model.points if model.displacement is None else model.points + model.displacement
    return [RestingContact(term, rest) for term in obstacles_of(model)]
