"""Where linear vibrations about a state at rest on obstacles would open its contact.

In linear vibrations what touches stays as it is: samples that touch are held along the normal, and
only the force that presses them changes. Contact would open where this force becomes a pull. At a
line of contact the change is a couple, for which the cells choose single samples; so forces are
spread over neighbouring cells first, which keeps their sum and moment. The line has the reaction R
per length; a moment M of the vibration would move it by M/R. The spread force becomes a pull where
it would move by about a cell.
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
    """The multiples of moves at which contact with an obstacle opens first."""

    forwards: Floats
    """(n,) Multiple of each move; infinite if it presses everywhere."""
    backwards: Floats
    """(n,) Multiple of the opposite of each move."""


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
        """Find the multiples of moves from rest at which the contact opens.

        Parameters
        ----------
        moves : ndarray of float64, shape (n, V, 3)
            Displacements of the vertices from the state at rest [m], which solve the equations of
            linear vibrations about it.

        Returns
        -------
        Opening
            Multiples of all moves.
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
