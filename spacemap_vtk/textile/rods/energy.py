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
from spacemap_vtk.textile.rods.contact import Pairs, find_pairs, mean_diameters, separate
from spacemap_vtk.textile.rods.yarns import Samples, image_matrices

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
    mandrel: float = 0.0
    """Radius of a rigid cylinder about the y axis, which yarns do not enter [m]; 0 for none."""


class State:
    """Energy of yarns in one place, its gradient, and its second derivatives when asked for."""

    def __init__(
        self,
        z: Floats,
        parts: Floats,
        gradient: Floats,
        products: list[tuple[csr_matrix, Floats]],
    ) -> None:
        #: (n + 2, 3) Control points and period vectors [m].
        self.z = z
        #: (3,) Energies of stretch, bending and contact per cell [J].
        self.parts = parts
        #: (n + 2, 3) Derivatives by z [N].
        self.gradient = gradient
        #: Matrices X (m k, 3n + 6) and blocks (m, k, k), whose sum of X^T blocks X is the tangent.
        self._products = products

    @property
    def energy(self) -> float:
        """Energy per cell [J]."""
        return float(self.parts.sum())

    def tangent(self, definite: bool = False) -> csr_matrix:
        """Compute the second derivatives, (3n + 6, 3n + 6) [N/m]."""
        # If `definite`, the negative curvature of each sample and each contact is left out.
        from scipy.sparse import csr_matrix

        total = csr_matrix((self.z.size, self.z.size))
        for wide, blocks in self._products:
            if definite:
                values, vectors = np.linalg.eigh(blocks)
                blocks = (vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2)
            total = total + wide.T @ (_block_diagonal(blocks) @ wide)
        return total


class RodEnergy:
    """Energy of yarns in a periodic cell as a function of z."""

    def __init__(self, samples: Samples, mechanics: RodMechanics) -> None:
        self.samples, self.mechanics = samples, mechanics
        #: (S,) Length of a span at rest [m], and length that a sample stands for [m].
        self._span = mechanics.length[samples.yarn]
        self._ds = samples.weight * self._span

    def softened(self, share: float) -> RodEnergy:
        """Return the energy with a share of the stiffness of tension and contact."""
        own = self.mechanics
        soft = own._replace(tension=share * own.tension, contact=share * own.contact)
        return RodEnergy(self.samples, soft)

    def pairs_within(self, z: Floats, reach: float) -> Pairs:
        """Find the pairs of samples nearer than `reach` [m]."""
        return find_pairs(self.samples, z, self.mechanics.length, reach)

    def evaluate(self, z: Floats, pairs: Pairs, thickness: float = 1.0) -> State:
        """Compute the energy and its derivatives."""
        # `pairs` are at least all pairs of samples nearer than a diameter; `thickness` is the
        # share of their diameters that yarns have.
        samples = self.samples
        a, b = ((each @ z.ravel()).reshape(-1, 3) for each in (samples.slope, samples.bend))
        aa, bb, ab = (np.einsum("si,si->s", *pair) for pair in ((a, a), (b, b), (a, b)))
        speed = np.sqrt(aa)

        stiff = self.mechanics.tension[samples.yarn] / self._span * samples.weight
        over = speed - self._span
        along = a / speed[:, None]
        by_a = (stiff * over)[:, None] * along
        by_aa = (stiff * self._span / speed)[:, None, None] * _outer(along, along)
        by_aa += (stiff * over / speed)[:, None, None] * _EYE

        # κ² ds = f du with f = (aa bb - ab²)/aa^(5/2), a = r′ and b = r″. Derivatives of f by the
        # three products:
        rigid = self.mechanics.bending[samples.yarn] * samples.weight / 2
        p5, p7 = rigid * aa**-2.5, rigid * aa**-3.5
        f_a = 2.5 * p7 * ab**2 - 1.5 * p5 * bb
        f_aa = 3.75 * p7 * bb - 8.75 * p7 / aa * ab**2
        f_b, f_ab, f_c, f_cc, f_ac = p5 * aa, -1.5 * p5, -2.0 * p5 * ab, -2.0 * p5, 5.0 * p7 * ab
        by_a += 2 * f_a[:, None] * a + f_c[:, None] * b
        by_b = 2 * f_b[:, None] * b + f_c[:, None] * a
        f_a, f_aa, f_b, f_ab, f_c, f_cc, f_ac = (
            each[:, None, None] for each in (f_a, f_aa, f_b, f_ab, f_c, f_cc, f_ac)
        )
        a_a, a_b, b_b = _outer(a, a), _outer(a, b), _outer(b, b)
        b_a = a_b.swapaxes(1, 2)
        blocks = np.empty((len(a), 6, 6))
        blocks[:, :3, :3] = by_aa + 2 * f_a * _EYE + 4 * f_aa * a_a
        blocks[:, :3, :3] += 2 * f_ac * (a_b + b_a) + f_cc * b_b
        blocks[:, :3, 3:] = 4 * f_ab * a_b + 2 * f_ac * a_a + f_c * _EYE + f_cc * b_a
        blocks[:, 3:, :3] = blocks[:, :3, 3:].swapaxes(1, 2)
        blocks[:, 3:, 3:] = 2 * f_b * _EYE + f_cc * a_a
        products = [(self._slopes_and_bends, blocks)]

        gradient = samples.slope.T @ by_a.ravel() + samples.bend.T @ by_b.ravel()
        curved = p5 * (aa * bb - ab**2)
        parts = np.array([stiff @ over**2 / 2, curved.sum(), 0.0])

        contacts = self.contacts(z, pairs, thickness)
        if len(contacts.overlap):
            push = contacts.stiff * contacts.overlap
            parts[2] = push @ contacts.overlap / 2
            gradient -= contacts.apart.T @ (push[:, None] * contacts.normal).ravel()
            blocks = (contacts.stiff + push / contacts.distance)[:, None, None] * _outer(
                contacts.normal, contacts.normal
            )
            blocks -= (push / contacts.distance)[:, None, None] * _EYE
            products.append((contacts.apart, blocks))
        if self.mechanics.mandrel:
            energy, force, mandrel = self._press_on_mandrel(z, thickness)
            parts[2] += energy
            gradient += samples.place.T @ force.ravel()
            products.append((samples.place, mandrel))
        return State(z, parts, gradient.reshape(-1, 3), products)

    def _press_on_mandrel(self, z: Floats, thickness: float) -> tuple[float, Floats, Floats]:
        """Compute energy, its derivatives by places (S, 3), and its second ones (S, 3, 3)."""
        away = self.samples.places(z) * np.array([1.0, 0.0, 1.0])
        distance = np.linalg.norm(away, axis=1)
        diameter = self.samples.diameter[self.samples.yarn]
        overlap = np.maximum(self.mechanics.mandrel + thickness * diameter / 2 - distance, 0.0)
        stiff = self.mechanics.contact * diameter * self._ds
        push, normal = stiff * overlap, away / distance[:, None]
        sideways = np.diag([1.0, 0.0, 1.0]) - _outer(normal, normal)
        blocks = np.where(overlap > 0.0, stiff, 0.0)[:, None, None] * _outer(normal, normal)
        blocks -= (push / distance)[:, None, None] * sideways
        return float(push @ overlap) / 2, -push[:, None] * normal, blocks

    def contacts(self, z: Floats, pairs: Pairs, thickness: float = 1.0) -> Contacts:
        """Find the pairs that overlap."""
        from scipy.sparse import bsr_matrix

        samples = self.samples
        vectors = separate(samples, pairs, z)
        distance = np.linalg.norm(vectors, axis=1)
        overlap = thickness * mean_diameters(samples, pairs) - distance
        (on,) = np.nonzero(overlap > 0.0)
        i, j, count = pairs.first[on], pairs.second[on], len(on)
        turned, along, across = image_matrices(pairs.shift[on], samples.turn)
        periods = bsr_matrix(
            (
                np.stack([along, across], axis=1).reshape(-1, 3, 3),
                np.tile(np.array([0, 1]) + len(z) - 2, count),
                np.arange(0, 2 * count + 1, 2),
            ),
            shape=(3 * count, 3 * len(z)),
        )
        first, second = (samples.place[(3 * k[:, None] + np.arange(3)).ravel()] for k in (i, j))
        if samples.turn:
            second = _block_diagonal(turned) @ second
        return Contacts(
            (first - second - periods).tocsr(),
            vectors[on] / distance[on, None],
            distance[on],
            overlap[on],
            self.mechanics.contact * self._ds[i] * self._ds[j],
        )

    def lengths(self, z: Floats) -> Floats:
        """Compute the length of each yarn in one period [m], (Y,)."""
        speed = np.linalg.norm((self.samples.slope @ z.ravel()).reshape(-1, 3), axis=1)
        lengths = np.bincount(self.samples.yarn, speed * self.samples.weight)
        return np.asarray(lengths, dtype=np.float64)

    @cached_property
    def _slopes_and_bends(self) -> csr_matrix:
        """The six components of r′ and r″ of each sample, (6 S, 3n + 6)."""
        from scipy.sparse import vstack

        count = len(self.samples.weight)
        order = np.arange(6 * count).reshape(2, count, 3).swapaxes(0, 1).ravel()
        return vstack([self.samples.slope, self.samples.bend]).tocsr()[order]


class Contacts(NamedTuple):
    """Pairs of samples that overlap."""

    apart: csr_matrix
    """(3 c, 3 n + 6) Vectors from the second to the first sample, from z."""
    normal: Floats
    """(c, 3) Unit vectors of the same."""
    distance: Floats
    """(c,) Their lengths [m]."""
    overlap: Floats
    """(c,) Amount by which the pair overlaps [m]."""
    stiff: Floats
    """(c,) Stiffness [N/m]."""


def _block_diagonal(blocks: Floats) -> csr_matrix:
    """Build the matrix of blocks (n, k, k) on its diagonal."""
    from scipy.sparse import bsr_matrix

    count, size = blocks.shape[:2]
    return bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(count * size,) * 2)


def _outer(left: Floats, right: Floats) -> Floats:
    return left[:, :, None] * right[:, None, :]
