"""Energy terms of a cage's vertices, converted to the nodes of its model."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, digest_of
from spacemap_vtk.ndarrays import Floats


class VertexTerm(EnergyTerm):
    """Term of a cage's vertices as a term of its model's nodes, multiplied by a factor."""

    # The nodes of a sheet are mid-points and half thicknesses of pairs of vertices, see
    # `spacemap_vtk.mechanics.elements.shell.MidSurface`. The nodes of a solid are the vertices.

    def __init__(self, term: EnergyTerm, surface: MidSurface | None, factor: float = 1.0) -> None:
        self._term, self._surface, self._factor = term, surface, factor
        self.nodes = term.nodes
        self.conservative = term.conservative
        if surface is not None:
            ends, signs = surface.vertex_nodes()
            self.nodes = ends[term.nodes].reshape(len(term.nodes), -1)
            #: (E, n, 2) Signs of the mid-point and the half thickness of each vertex.
            self._signs = signs[term.nodes]

    @property
    def digest(self) -> str:
        """Digest of the term and the factor; the mesh determines the surface."""
        return digest_of(self._term.digest, self._factor)

    def energy(self, positions: Floats) -> float:
        """Compute the energy times the factor."""
        return self._factor * self._term.energy(self._vertices(positions))

    def forces(self, positions: Floats) -> Floats:
        """Compute the gradient of the energy by the nodes."""
        forces = self._factor * self._term.forces(self._vertices(positions))
        return forces if self._surface is None else 2 * self._surface.to_nodes(forces)

    def tangent(self, positions: Floats) -> Floats:
        """Compute the second derivatives of the energy by the nodes."""
        return self._factor * self._of_nodes(self._term.tangent(self._vertices(positions)))

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Compute the largest step that the wrapped term admits."""
        return self._term.largest_step(self._vertices(positions), self._vertices(move))

    def admits(self, start: Floats, positions: Floats) -> bool:
        """Check whether the wrapped term admits the positions."""
        return self._term.admits(self._vertices(start), self._vertices(positions))

    def resistance_matrices(self) -> Floats:
        """Compute the matrices of the wrapped term by the nodes."""
        return self._of_nodes(self._term.resistance_matrices())

    def _vertices(self, nodal: Floats) -> Floats:
        return nodal if self._surface is None else self._surface.to_vertices(nodal)

    def _of_nodes(self, blocks: Floats) -> Floats:
        if self._surface is None:
            return blocks
        count, size = self._term.nodes.shape
        parts = blocks.reshape(count, size, 3, size, 3)
        parts = np.einsum("eaikj,eap,ekq->eapikqj", parts, self._signs, self._signs)
        return np.asarray(parts.reshape(count, 6 * size, 6 * size))
