"""Energy of elastic yarns in contact, with its gradient and its second derivatives.

    E = ½ (EA/ℓ) ∫ (|r′| - ℓ)² du + ½ B ∫ κ² ds + ½ k ∬ max(D - |r_i - r_j - m·P|, 0)² ds ds′

ℓ is the length of a span at rest, κ² ds = |r′ × r″|²/|r′|⁵ du, and D the mean of two diameters.
Lengths in the contact term are those at rest, so that its weights are constant.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.contact import Pairs, find_pairs, mean_diameters
from spacemap_vtk.textile.rods.yarns import Samples

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_EYE = np.eye(3)


class RodMechanics(NamedTuple):
    """Stiffness of Y yarns and of their contact."""

    tension: Floats
    """(Y,) EA [N]."""
    bending: Floats
    """(Y,) B [N m²]."""
    contact: float
    """Stiffness k of contact per length of both yarns [N/m³]."""
    length: Floats
    """(Y,) Length of a span at rest [m]."""


class State(NamedTuple):
    """Energy of yarns in one place, and its derivatives."""

    z: Floats
    """(n + 2, 3) Control points and period vectors [m]."""
    parts: Floats
    """(3,) Energies of stretch, bending and contact per cell [J]."""
    gradient: Floats
    """(n + 2, 3) Derivatives by z [N]."""
    tangent: csr_matrix
    """(3n + 6, 3n + 6) Second derivatives [N/m]: exact for contact; without the negative part of
    compressed yarns; those of bending are Gauss and Newton's."""

    @property
    def energy(self) -> float:
        """Energy per cell [J]."""
        return float(self.parts.sum())


class RodEnergy:
    """Energy of yarns in a periodic cell as a function of z.

    Parameters
    ----------
    samples : Samples
        Samples of the yarns, at which the energy is summed.
    mechanics : RodMechanics
        Stiffness of the yarns.
    """

    def __init__(self, samples: Samples, mechanics: RodMechanics) -> None:
        self.samples, self.mechanics = samples, mechanics
        #: (S,) Length of a span at rest [m], and length that a sample stands for [m].
        self._span = mechanics.length[samples.yarn]
        self._ds = samples.weight * self._span

    def pairs_within(self, z: Floats, reach: float) -> Pairs:
        """Find the pairs of samples nearer than `reach` [m]."""
        return find_pairs(self.samples, z, self.mechanics.length, reach)

    def evaluate(self, z: Floats, pairs: Pairs, thickness: float = 1.0) -> State:
        """Compute the energy and its derivatives.

        Parameters
        ----------
        z : ndarray of float64, shape (n + 2, 3)
            Control points and period vectors [m].
        pairs : Pairs
            Pairs that may touch: at least all that are nearer than a diameter.
        thickness : float, optional
            Share of their diameters that yarns have.

        Returns
        -------
        State
            The energy and its derivatives.
        """
        samples = self.samples
        slope, bend = samples.slope @ z, samples.bend @ z
        speed = np.linalg.norm(slope, axis=1)
        along = slope / speed[:, None]
        outer = along[:, :, None] * along[:, None, :]

        stiff = self.mechanics.tension[samples.yarn] / self._span * samples.weight
        over = speed - self._span
        by_slope = (stiff * over)[:, None] * along
        rise = np.maximum(over / speed, 0.0)[:, None, None]
        slope_slope = stiff[:, None, None] * (outer + rise * (_EYE - outer))

        # κ² ds is the square of ρ = r′ × r″ / |r′|^(5/2).
        rigid = self.mechanics.bending[samples.yarn] * samples.weight
        power = speed**-2.5
        curve = np.cross(slope, bend) * power[:, None]
        of_bend = _cross_matrix(slope) * power[:, None, None]
        of_slope = -_cross_matrix(bend) * power[:, None, None]
        of_slope -= 2.5 / speed[:, None, None] * curve[:, :, None] * along[:, None, :]
        moment = rigid[:, None] * curve
        by_slope += np.einsum("sij,si->sj", of_slope, moment)
        by_bend = np.einsum("sij,si->sj", of_bend, moment)
        turned = rigid[:, None, None] * of_slope.swapaxes(1, 2)
        slope_slope += turned @ of_slope
        bend_bend = rigid[:, None, None] * of_bend.swapaxes(1, 2) @ of_bend

        one, two = self._slopes, self._bends
        mixed = one.T @ (_block_diagonal(turned @ of_bend) @ two)
        tangent = one.T @ (_block_diagonal(slope_slope) @ one) + mixed + mixed.T
        tangent = tangent + two.T @ (_block_diagonal(bend_bend) @ two)
        gradient = samples.slope.T @ by_slope + samples.bend.T @ by_bend
        parts = np.array([stiff @ over**2, rigid @ (curve**2).sum(axis=1), 0.0]) / 2

        contacts = self.contacts(z, pairs, thickness)
        if len(contacts.overlap):
            parts[2] = contacts.stiff @ contacts.overlap**2 / 2
            gradient -= contacts.apart.T @ (
                (contacts.stiff * contacts.overlap)[:, None] * contacts.normal
            )
            outer = contacts.normal[:, :, None] * contacts.normal[:, None, :]
            less = (contacts.overlap / contacts.distance)[:, None, None]
            blocks = contacts.stiff[:, None, None] * (outer - less * (_EYE - outer))
            wide = _by_components(contacts.apart)
            tangent = tangent + wide.T @ (_block_diagonal(blocks) @ wide)
        return State(z, parts, gradient, tangent.tocsr())

    def contacts(self, z: Floats, pairs: Pairs, thickness: float = 1.0) -> Contacts:
        """Find the pairs that overlap."""
        from scipy.sparse import csr_matrix, hstack

        place = self.samples.place
        vectors = pairs.separate(place @ z, z[-2:])
        distance = np.linalg.norm(vectors, axis=1)
        overlap = thickness * mean_diameters(self.samples, pairs) - distance
        (on,) = np.nonzero(overlap > 0.0)
        i, j = pairs.first[on], pairs.second[on]
        moved = hstack([csr_matrix((len(on), len(z) - 2)), csr_matrix(pairs.shift[on])])
        return Contacts(
            (place[i] - place[j] - moved).tocsr(),
            vectors[on] / distance[on, None],
            distance[on],
            overlap[on],
            self.mechanics.contact * self._ds[i] * self._ds[j],
        )

    def lengths(self, z: Floats) -> Floats:
        """Compute the length of each yarn in one period [m], (Y,)."""
        speed = np.linalg.norm(self.samples.slope @ z, axis=1)
        return np.bincount(self.samples.yarn, speed * self.samples.weight)

    @cached_property
    def _slopes(self) -> csr_matrix:
        return _by_components(self.samples.slope)

    @cached_property
    def _bends(self) -> csr_matrix:
        return _by_components(self.samples.bend)


class Contacts(NamedTuple):
    """Pairs of samples that overlap."""

    apart: csr_matrix
    """(c, n + 2) Vectors from the second to the first sample, from z."""
    normal: Floats
    """(c, 3) Unit vectors of the same."""
    distance: Floats
    """(c,) Their lengths [m]."""
    overlap: Floats
    """(c,) Amount by which the pair overlaps [m]."""
    stiff: Floats
    """(c,) Stiffness [N/m]."""


def _block_diagonal(blocks: Floats) -> csr_matrix:
    """Build the matrix of blocks (n, 3, 3) on its diagonal."""
    from scipy.sparse import bsr_matrix

    count = len(blocks)
    return bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(3 * count,) * 2)


def _by_components(matrix: csr_matrix) -> csr_matrix:
    """Repeat a matrix for x, y and z: (m, n) becomes (3m, 3n)."""
    from scipy.sparse import identity, kron

    return kron(matrix, identity(3), format="csr")


def _cross_matrix(vectors: Floats) -> Floats:
    """Build the matrices of v × (·) of vectors (n, 3), (n, 3, 3)."""
    return -np.cross(_EYE[None], vectors[:, None]).swapaxes(1, 2)
