"""Energy of elastic yarns in contact, with its gradient and its second derivatives.

    E = ½ (EA/ℓ) ∫ (|r′| - ℓ)² du + ½ B ∫ κ² ds + ½ k ∬ max(D - |r_i - r_j - m·P|, 0)² ds ds′

ℓ is the length of a span at rest, κ² ds = |r′ × r″|²/|r′|⁵ du, and D the mean of two diameters.
Lengths in the contact term are those at rest, so that its weights are constant. Contact has samples
of its own, closer together than those of stretch and bending.

Yarns that are set have no force in the shape in which they were laid: they are as long, as bent
(`spacemap_vtk.textile.rods.set_shape`) and as flat as there. Where they overlapped, both have a
dent of half of the overlap.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.rods.assembly import Blocks, add_blocks, add_gradients
from spacemap_vtk.textile.rods.contact import find_pairs, mean_diameters, separate
from spacemap_vtk.textile.rods.set_shape import SetShape
from spacemap_vtk.textile.rods.yarns import Samples

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_EYE = np.eye(3)
#: Distance of the samples of contact for the whole stiffness, in diameters. Yarns that cross touch
#: over a length that grows with the fourth root of what they overlap.
SPACING = 0.05
#: Most samples of contact in a span.
_MOST = 64


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
    set_in: Floats | None = None
    """(n + 2, 3) z in which the yarns are set [m]; None if they are straight when free."""


class ImagePairs(NamedTuple):
    """Pairs of samples that may touch."""

    images: Samples
    """The spans of the cell, followed by those of images that are near it."""
    first: Ints
    """(C,) Number of the first sample; pairs of the same two spans follow each other."""
    second: Ints
    """(C,) Number of the second sample."""
    diameter: Floats
    """(C,) Mean diameter of the two yarns, less their dents [m]."""
    area: Floats
    """(C,) Product of the lengths at rest that both stand for [m²]."""

    def select(self, which: Bools | Ints) -> ImagePairs:
        """Return some of the pairs."""
        return ImagePairs(
            self.images,
            self.first[which],
            self.second[which],
            self.diameter[which],
            self.area[which],
        )

    def separate(self, z: Floats) -> Floats:
        """Compute the vectors from the second to the first samples, (C, 3) [m]."""
        place = self.images.places(z)
        return np.asarray(place[self.first] - place[self.second])


class RodEnergy:
    """Energy of yarns in a periodic cell as a function of z."""

    def __init__(self, samples: Samples, mechanics: RodMechanics, spacing: float = SPACING) -> None:
        # `spacing` is the distance of samples of contact in diameters.
        self.samples, self.mechanics = samples, mechanics
        fewest = float((mechanics.length / samples.diameter).max()) / spacing
        count = int(np.clip(np.ceil(fewest), 1, _MOST))
        at = (np.arange(count) + 0.5) / count
        #: Samples of contact.
        self.surface = samples.resample(at, np.full(count, 1.0 / count))
        #: Shape in which yarns are set.
        self.set_shape: SetShape | None = None
        if mechanics.set_in is not None:
            self.set_shape = SetShape.from_flat_cell(samples, mechanics.set_in)
            self._dents = self._find_dents(mechanics.set_in)

    def _find_dents(self, z: Floats) -> Floats:
        """Compute half of the largest overlap at each sample of contact, in a flat cell."""
        flat = self.surface._replace(turn=0.0)
        pairs = find_pairs(flat, z, self.mechanics.length, float(flat.diameter.max()))
        distance = np.linalg.norm(separate(flat, pairs, z), axis=1)
        depth = np.maximum(mean_diameters(flat, pairs) - distance, 0.0) / 2
        dents = np.zeros(len(flat.weight))
        np.maximum.at(dents, pairs.first, depth)
        np.maximum.at(dents, pairs.second, depth)
        return dents

    def softened(self, share: float) -> RodEnergy:
        """Return the energy with a share of the stiffness of tension and contact."""
        own = self.mechanics
        soft = own._replace(tension=share * own.tension, contact=share * own.contact)
        return RodEnergy(self.samples, soft, SPACING * share**-0.25)

    def pairs_within(self, z: Floats, reach: float) -> ImagePairs:
        """Find the pairs of samples nearer than `reach` [m]."""
        surface, count = self.surface, len(self.surface.basis[0])
        found = find_pairs(surface, z, self.mechanics.length, reach)
        spans = len(surface.nodes)
        span, part = np.divmod(found.second, count)
        moved = found.shift.any(axis=1)
        keys = np.column_stack([span, found.shift])[moved]
        images, which = np.unique(keys, axis=0, return_inverse=True)
        image = span.copy()
        image[moved] = spans + which.ravel()
        own, shift = images[:, 0], images[:, 1:]
        whole = surface._replace(
            nodes=np.concatenate([surface.nodes, surface.nodes[own]]),
            wraps=np.concatenate([surface.wraps, surface.wraps[own] + shift[:, None]]),
        )
        ds = surface.weight * self.mechanics.length[surface.yarn]
        diameter = mean_diameters(surface, found)
        if self.set_shape is not None:
            diameter -= self._dents[found.first] + self._dents[found.second]
        return ImagePairs(
            whole,
            found.first,
            image * count + part,
            diameter,
            ds[found.first] * ds[found.second],
        )

    def evaluate(self, z: Floats, pairs: ImagePairs, thickness: float = 1.0) -> State:
        """Compute the energy and its derivatives."""
        # `pairs` are at least all pairs of samples nearer than a diameter; `thickness` is the
        # share of their diameters that yarns have.
        return State(self, z, pairs, thickness)

    def lengths(self, z: Floats) -> Floats:
        """Compute the length of each yarn in one period [m], (Y,)."""
        speed = np.linalg.norm(self.samples.slopes(z), axis=1)
        lengths = np.bincount(self.samples.yarn, speed * self.samples.weight)
        return np.asarray(lengths, dtype=np.float64)


class State:
    """Energy of yarns in one place, its gradient, and its second derivatives when asked for."""

    def __init__(self, energy: RodEnergy, z: Floats, pairs: ImagePairs, thickness: float) -> None:
        samples, images = energy.samples, pairs.images
        corners, places = samples.corners(z), images.places(z)
        self._beam = _Beam(energy, samples.combine(corners, 1), samples.combine(corners, 2))
        self._contact = _Contact(energy.mechanics.contact, places, pairs, thickness)
        self._mandrel = _Mandrel(energy, places[: len(energy.surface.weight)], thickness)
        forces = self._contact.sum(self._contact.force, len(places))
        forces[: len(self._mandrel.force)] += self._mandrel.force
        values = images.gather(forces, 0)
        own = values[: len(corners)]
        own += samples.gather(self._beam.by_slope, 1) + samples.gather(self._beam.by_bend, 2)
        #: (n + 2, 3) Control points and period vectors [m].
        self.z = z
        #: (3,) Energies of stretch, bending and contact per cell [J].
        self.parts = np.array([*self._beam.parts, self._contact.energy + self._mandrel.energy])
        #: (n + 2, 3) Derivatives by z [N].
        self.gradient = add_gradients(images, values, len(z))
        self._samples, self._images = samples, images

    @property
    def energy(self) -> float:
        """Energy per cell [J]."""
        return float(self.parts.sum())

    def tangent(self, convexity: float = 0.0) -> csr_matrix:
        """Compute the second derivatives, (3n + 6, 3n + 6) [N/m]."""
        # A share `convexity` of the negative curvature of each sample and contact is left out.
        images, contact = self._images, self._contact
        blocks = contact.blocks(convexity)
        places = contact.sum(blocks, len(images.nodes) * len(images.basis[0]))
        mandrel = self._mandrel.blocks(convexity)
        places[: len(mandrel)] += mandrel
        own = _weigh(places[:, None, :, None], images.basis[:1])
        spans = len(self._samples.nodes)
        own[:spans] += _weigh(self._beam.blocks(convexity), self._samples.basis[1:])
        numbers = np.arange(len(images.nodes))
        first, second, mixed = contact.mixed(blocks, images.basis[0])
        parts = [
            Blocks(numbers, numbers, own),
            Blocks(first, second, mixed),
            Blocks(second, first, mixed.transpose(0, 3, 4, 1, 2)),
        ]
        return add_blocks(images, parts, len(self.z)).tocsr()


class _Beam:
    """Stretch and bending at the samples."""

    def __init__(self, energy: RodEnergy, a: Floats, b: Floats) -> None:
        samples, mechanics, shape = energy.samples, energy.mechanics, energy.set_shape
        span = mechanics.length[samples.yarn]
        aa, bb, ab = (np.einsum("si,si->s", *pair) for pair in ((a, a), (b, b), (a, b)))
        speed = np.sqrt(aa)
        stiff = mechanics.tension[samples.yarn] / span * samples.weight
        rest = span if shape is None else shape.speed
        over = speed - rest
        # κ² ds = f du with f = (aa bb - ab²)/aa^power, a = r′ and b = r″; the power is 5/2, or 3
        # for the κ² ds₀ of set yarns. Derivatives of f by the three products:
        rigid = mechanics.bending[samples.yarn] * samples.weight / 2
        if shape is not None:
            rigid = rigid * shape.speed
        self._power = power = 2.5 if shape is None else 3.0
        p5, p7 = rigid * aa**-power, rigid * aa ** -(power + 1.0)
        less = 1.0 - power
        f_a = power * p7 * ab**2 + less * p5 * bb
        f_aa = -power * less * p7 * bb - power * (power + 1.0) * p7 / aa * ab**2
        f_b, f_ab, f_c, f_cc = p5 * aa, less * p5, -2.0 * p5 * ab, -2.0 * p5
        f_ac = 2.0 * power * p7 * ab
        # The stretch is a function of aa, too.
        f_a += stiff * over / speed / 2
        f_aa += stiff * rest / (4 * speed**3)
        pulled = stiff * over / speed
        self._aa, self._p5 = aa, p5
        self._stretch = pulled, (stiff - np.maximum(pulled, 0.0)) / aa
        self.parts = float(stiff @ over**2) / 2, float((p5 * (aa * bb - ab**2)).sum())
        self.by_slope = 2 * f_a[:, None] * a + f_c[:, None] * b
        self.by_bend = 2 * f_b[:, None] * b + f_c[:, None] * a
        self._a, self._b, self._f = a, b, (f_a, f_b, f_c, f_aa, f_ab, f_ac, f_cc)
        self._tangent, self._kept = None, None
        if shape is not None:
            # ½ B s₀ (κ² + κ₀² - 2 κ · R κ₀), of which f is the first part
            kept = shape.curvature_along(a, b)
            own = rigid @ ((shape.curvature**2).sum(axis=1) - 2 * kept.value)
            self.parts = self.parts[0], self.parts[1] + float(own)
            self.by_slope -= 2 * rigid[:, None] * kept.slope[:, :3]
            self.by_bend -= 2 * rigid[:, None] * kept.slope[:, 3:]
            self._tangent = a / speed[:, None]
            self._kept = -2 * (rigid[:, None, None] * kept.bend).reshape(-1, 2, 3, 2, 3)

    def blocks(self, convexity: float) -> Floats:
        """Compute the second derivatives by slope and bend, (S, 2, 3, 2, 3)."""
        a, b = self._a, self._b
        f_a, f_b, f_c, f_aa, f_ab, f_ac, f_cc = (each[:, None, None] for each in self._f)
        a_a, a_b, b_b = _outer(a, a), _outer(a, b), _outer(b, b)
        b_a = a_b.swapaxes(1, 2)
        blocks = np.empty((len(a), 2, 3, 2, 3))
        blocks[:, 0, :, 0] = 2 * f_a * _EYE + 4 * f_aa * a_a
        blocks[:, 0, :, 0] += 2 * f_ac * (a_b + b_a) + f_cc * b_b
        blocks[:, 0, :, 1] = 4 * f_ab * a_b + 2 * f_ac * a_a + f_c * _EYE + f_cc * b_a
        blocks[:, 1, :, 0] = blocks[:, 0, :, 1].swapaxes(1, 2)
        blocks[:, 1, :, 1] = 2 * f_b * _EYE + f_cc * a_a
        if self._kept is not None:
            blocks += self._kept
        if convexity:
            blocks += convexity * (self._convex_blocks() - blocks)
        return blocks

    def _convex_blocks(self) -> Floats:
        """Compute the second derivatives without those of what is squared, (S, 2, 3, 2, 3)."""
        # f = w² with w = r′ × r″/|r′|^power (Gauss and Newton).
        a, b, aa = self._a, self._b, self._aa
        turned = np.cross(a, b)
        changes = np.empty((len(a), 3, 2, 3))
        changes[:, :, 0] = _crosses(-b) - self._power / aa[:, None, None] * _outer(turned, a)
        changes[:, :, 1] = _crosses(a)
        if (t := self._tangent) is not None:
            # R κ₀ turns with the tangent
            along = np.einsum("si,sikl->skl", t, changes)
            changes -= t[:, :, None, None] * along[:, None]
        changes *= np.sqrt(2.0 * self._p5)[:, None, None, None]
        wide = changes.reshape(-1, 3, 6)
        found = (wide.swapaxes(1, 2) @ wide).reshape(-1, 2, 3, 2, 3)
        pulled, stretched = (each[:, None, None] for each in self._stretch)
        found[:, 0, :, 0] += stretched * _outer(a, a) + np.maximum(pulled, 0.0) * _EYE
        return found


class _Contact:
    """Pairs of samples that overlap."""

    def __init__(
        self, stiffness: float, places: Floats, pairs: ImagePairs, thickness: float
    ) -> None:
        vectors = places[pairs.first] - places[pairs.second]
        reach = thickness * pairs.diameter
        square = np.einsum("ci,ci->c", vectors, vectors)
        (on,) = np.nonzero(square < reach * reach)
        self._first, self._second = pairs.first[on], pairs.second[on]
        distance = np.sqrt(square[on])
        overlap = reach[on] - distance
        self._normal = vectors[on] / distance[:, None]
        self._stiff = stiffness * pairs.area[on]
        push = self._stiff * overlap
        self._side = push / distance
        self.energy = float(push @ overlap) / 2
        #: (c, 3) Derivatives of the energy by the first sample of each pair.
        self.force = -push[:, None] * self._normal

    def sum(self, values: Floats, count: int) -> Floats:
        """Sum vectors or blocks of pairs at the samples, (count, …)."""
        wide = values.reshape(-1, int(np.prod(values.shape[1:])))
        signed = -wide if values.ndim == 2 else wide
        where = np.concatenate([self._first, self._second])
        both = np.concatenate([wide, signed])
        found = [np.bincount(where, each, count) for each in both.T]
        # Of no pairs, the sums are integers.
        return np.stack(found, axis=1).astype(np.float64).reshape(count, *values.shape[1:])

    def blocks(self, convexity: float) -> Floats:
        """Compute the second derivatives by the first sample of each pair, (c, 3, 3)."""
        along = _outer(self._normal, self._normal)
        across = (1.0 - convexity) * self._side[:, None, None] * (_EYE - along)
        return np.asarray(self._stiff[:, None, None] * along - across)

    def mixed(self, blocks: Floats, basis: Floats) -> tuple[Ints, Ints, Floats]:
        """Sum the derivatives by both samples of pairs for each two spans, (n, 4, 3, 4, 3)."""
        count = len(basis)
        (first, i), (second, j) = np.divmod(self._first, count), np.divmod(self._second, count)
        # First over the samples of the second span, then over those of the first one.
        wide = basis[j][:, :, None] * -blocks.reshape(-1, 1, 9)
        starts = _changes(self._first, second)
        first, second, i = first[starts], second[starts], i[starts]
        wide = np.add.reduceat(wide, starts) if len(starts) else wide
        wide = basis[i][:, :, None, None] * wide[:, None]
        starts = _changes(first, second)
        wide = np.add.reduceat(wide, starts) if len(starts) else wide
        wide = wide.reshape(-1, 4, 4, 3, 3).transpose(0, 1, 3, 2, 4)
        return first[starts], second[starts], wide


class _Mandrel:
    """Samples that are pressed on the mandrel."""

    def __init__(self, energy: RodEnergy, places: Floats, thickness: float) -> None:
        surface, mechanics = energy.surface, energy.mechanics
        self.energy, self.force = 0.0, np.zeros((0, 3))
        self._blocks = np.zeros((2, 0, 3, 3))
        if not mechanics.mandrel:
            return
        away = places * np.array([1.0, 0.0, 1.0])
        distance = np.linalg.norm(away, axis=1)
        diameter = surface.diameter[surface.yarn]
        overlap = np.maximum(mechanics.mandrel + thickness * diameter / 2 - distance, 0.0)
        stiff = mechanics.contact * diameter * surface.weight * mechanics.length[surface.yarn]
        push, normal = stiff * overlap, away / distance[:, None]
        self.energy = float(push @ overlap) / 2
        #: (S, 3) Derivatives of the energy by the places of samples, none without a mandrel.
        self.force = -push[:, None] * normal
        along = np.where(overlap > 0.0, stiff, 0.0)[:, None, None] * _outer(normal, normal)
        sideways = np.diag([1.0, 0.0, 1.0]) - _outer(normal, normal)
        self._blocks = np.stack([along, (push / distance)[:, None, None] * sideways])

    def blocks(self, convexity: float) -> Floats:
        """Return the second derivatives by the places of samples, (S, 3, 3)."""
        along, across = self._blocks
        return np.asarray(along - (1.0 - convexity) * across)


def _weigh(blocks: Floats, basis: tuple[Floats, ...]) -> Floats:
    """Sum blocks (S, x, 3, x, 3) of samples to those of control points, (E, 4, 3, 4, 3)."""
    shapes = np.stack(basis, axis=1)
    weights = np.einsum("gxk,gyl->gxykl", shapes, shapes).reshape(-1, 16)
    wide = blocks.reshape(-1, len(shapes), *blocks.shape[1:]).transpose(0, 3, 5, 1, 2, 4)
    found = wide.reshape(-1, len(weights)) @ weights
    return found.reshape(-1, 3, 3, 4, 4).transpose(0, 3, 1, 4, 2)


def _changes(*keys: Ints) -> Ints:
    """List the numbers of the first of equal items that follow each other."""
    new = np.zeros(len(keys[0]), dtype=bool)
    new[:1] = True
    for key in keys:
        new[1:] |= key[1:] != key[:-1]
    return np.flatnonzero(new)


def _crosses(vectors: Floats) -> Floats:
    """Return the matrices (n, 3, 3) of the products v × x."""
    return np.cross(vectors[:, None], _EYE).swapaxes(1, 2)


def _outer(left: Floats, right: Floats) -> Floats:
    return left[:, :, None] * right[:, None, :]
