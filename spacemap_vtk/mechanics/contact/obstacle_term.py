"""Energy of a cage against a rigid obstacle: one-sided springs at samples of its surface.

A sample of area A at the signed distance g has the depth d = max(T/2 - g, 0), with half the
sheet's thickness T, and the energy

    U = ½ k A d²/(1 - (d/B)²)

It is infinite at the depth B of the obstacle's middle, so that nothing passes through. The
stiffness k is the largest that the mesh resolves: a plate of rigidity D on a bed of stiffness k has
a boundary layer of length (4 D/k)^¼, which is a quarter of a cell for

    k = 1024 D/cell⁴

This is 10.5 times the stiffness D (π/cell)⁴ of the shortest wave of the mesh. The surface of a
solid resists its shortest wave with E/(1 - ν²) π/(2 cell); 10.5 times this is about
16 E/(1 - ν²)/cell, of which the mean Young's modulus is taken without ν.

Friction is Coulomb's. Each sample has an anchor a, and the friction that holds it is k A (x - a)
along the surface, projected onto the disc of radius μ n with the normal force n. Anchors follow
only from one balanced state to the next (`ObstacleTerm.advance_friction`); a sample is anchored at
the end of the step in which it first touches. With the normal force of the current state the
tangent of sliding is unsymmetric; with given limits friction has a potential, and a state can be
found as the least of an energy.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk.mechanics.contact.obstacles import BodyMotion, Obstacle
from spacemap_vtk.mechanics.contact.samples import Samples
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    PairedNodes,
    TermState,
    digest_of,
    sum_at_nodes,
)
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: Stiffness times cell⁴/D of a sheet.
SHEET_STIFFNESS = 1024.0
#: Stiffness times cell/E of a solid.
SOLID_STIFFNESS = 16.0

#: For vibrations about a state at rest, what touches is held by this multiple of its springs: where
#: a sheet touches down, its place, slope and curvature are those of the obstacle, so that the line
#: of contact does not move to first order.
SUPPORT = 1e3
#: Samples up to this share of the largest depth away from the obstacle are held, too: behind a line
#: of contact a sheet on springs rises again, by up to a fifth of their depth as measured.
NEAR = 0.3

#: Share of the way to the middle of an obstacle up to which springs stiffen.
_STIFFEST = 0.99
#: Largest share of the way to the middle in one step of a search, and the least length of a step
#: over the whole of this way.
_APPROACH, _LEAST_MOVE = 0.9, 1e-3

#: A sample slides if its friction is at least this share of the limit.
SLIDES = 1.0 - 1e-6


def contact_stiffness(material: Floats | Plate, cell: float) -> float:
    """Compute the stiffness of contact per area that a mesh resolves.

    Parameters
    ----------
    material : ndarray of float64, shape (6, 6), or Plate
        Elasticity of a solid [Pa], or stiffness of a sheet.
    cell : float
        Width of the cells [m].

    Returns
    -------
    float
        Stiffness [N/m³], see the module.
    """
    if isinstance(material, Plate):
        return SHEET_STIFFNESS * float(material.bending.diagonal()[:2].max()) / cell**4
    normal = float(np.mean(1 / np.linalg.inv(material)[:3, :3].diagonal()))
    return SOLID_STIFFNESS * normal / cell


def press_springs(springs: Floats, depth: Floats, room: float) -> tuple[Floats, Floats, Floats]:
    """Compute energy, force and its slope of springs k A at depths d ≥ 0, see the module."""
    # Near the middle, and for starts beyond it, the slope is constant.
    share = np.minimum(depth / room, _STIFFEST)
    left = 1.0 - share**2
    beyond = np.maximum(depth - _STIFFEST * room, 0.0) if np.isfinite(room) else 0.0
    inner = depth - beyond
    slope = springs * (1.0 + 3.0 * share**2) / left**3
    force = springs * inner / left**2
    energy = springs * inner**2 / (2.0 * left) + (force + slope * beyond / 2.0) * beyond
    return energy, force + slope * beyond, slope


class Friction(NamedTuple):
    """Friction at the samples of an obstacle."""

    anchors: Floats
    """(E, m, 3), where each sample is held [m]; NaN where none."""
    normals: Floats
    """(E, m, 3), normal of the obstacle at each sample; friction acts across it."""
    limits: Floats
    """(E, m), largest friction [N], unless it follows the normal force."""
    follows: bool = False
    """Whether the largest friction is μ times the normal force of the current state."""


class Contact(NamedTuple):
    """What an obstacle and a cage do to each other."""

    force: Floats
    """(3,), force on the obstacle [N]."""
    points: int
    """Number of samples that touch."""
    penetration: float
    """Largest depth [m]."""
    sliding: int
    """Number of these samples whose friction has reached its limit; all without friction."""


class Held(NamedTuple):
    """Samples that an obstacle holds in vibrations about a state at rest, in some elements."""

    elements: Ints
    """(e,), elements with such samples."""
    springs: Floats
    """(e, m), constants of the springs that hold them along the normal [N/m]; else 0."""
    press: Floats
    """(e, m), normal forces at rest [N]."""
    normal: Floats
    """(e, m, 3), gradient of the distance."""
    curvature: Floats
    """(e, m, 3, 3), curvature of the distance [1/m]."""


class ObstacleTerm(EnergyTerm):
    """Contact with one obstacle; a sheet's nodes are pairs of vertices, see `in_model_nodes`."""

    def __init__(
        self,
        obstacle: Obstacle,
        samples: Samples,
        stiffness: float,
        offset: float = 0.0,
        coefficient: float = 0.0,
        friction: Friction | None = None,
        surface: MidSurface | None = None,
        motion: BodyMotion | None = None,
    ) -> None:
        #: Motion of the obstacle in time steps; elsewhere it stays at its place of t = 0, so that
        #: the motion is not in the digest.
        self.motion = motion
        self.obstacle, self.samples, self.stiffness = obstacle, samples, stiffness
        self.offset, self.coefficient, self.friction = offset, coefficient, friction
        self.surface = surface
        self.nodes = samples.nodes
        if surface is not None:
            # The mid-point of a pair is the mean of its vertices.
            self.nodes = surface.pairs[samples.nodes].reshape(len(samples.nodes), -1)
            weights = np.repeat(samples.weights, 2, axis=1) / 2
            self.samples = samples._replace(nodes=self.nodes, weights=weights)
        self._given = samples

    def replace(self, **changes: Any) -> ObstacleTerm:
        """Make a copy with other values of the constructor's arguments.

        Parameters
        ----------
        **changes : object
            New values by name.

        Returns
        -------
        ObstacleTerm
            The copy.
        """
        given = {
            "obstacle": self.obstacle,
            "samples": self._given,
            "stiffness": self.stiffness,
            "offset": self.offset,
            "coefficient": self.coefficient,
            "friction": self.friction,
            "surface": self.surface,
            "motion": self.motion,
        }
        return ObstacleTerm(**{**given, **changes})

    def in_model_nodes(self, surface: PairedNodes | None, factor: float) -> ObstacleTerm:
        """Return the term of a sheet's mid-points, or of a solid's vertices, times a factor."""
        friction = self.friction
        if friction is not None:
            friction = friction._replace(limits=factor * friction.limits)
        return self.replace(surface=None, stiffness=factor * self.stiffness, friction=friction)

    def at_rest(self, positions: Floats, anchors: Floats) -> ObstacleTerm:
        """Return the term of a state at rest with its anchors of friction.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].
        anchors : ndarray of float64, shape (S, 3)
            Anchors of all samples [m], NaN where none.

        Returns
        -------
        ObstacleTerm
            Its limits of friction are those of these positions.
        """
        if self.coefficient == 0.0:
            return self
        given = anchors.reshape(*self.samples.areas.shape, 3)
        limits = np.zeros(self.samples.areas.shape)
        term = self.replace(friction=Friction(given, np.zeros_like(given), limits))
        return term.advance_friction(positions)

    def follow_friction(self, positions: Floats, follows: bool = True) -> ObstacleTerm:
        """Renew the normals and limits of friction within a step; anchors stay.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].
        follows : bool
            Whether the limits follow the normal forces of any state that is evaluated.

        Returns
        -------
        ObstacleTerm
            The term with these limits.
        """
        if self.friction is None:
            return self
        _, _, normals, limits = _press(self, positions)
        return self.replace(friction=Friction(self.friction.anchors, normals, limits, follows))

    def advance_friction(self, positions: Floats) -> ObstacleTerm:
        """End a step: anchors follow samples that slide, and new contacts are anchored.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m], in balance.

        Returns
        -------
        ObstacleTerm
            The term with the friction of this state.
        """
        if self.coefficient == 0.0:
            return self
        where, touches, normals, limits = _press(self, positions)
        springs = self.stiffness * self.samples.areas
        before = np.nan if self.friction is None else self.friction.anchors
        moved = np.nan_to_num(where - before)
        moved -= normals * (normals * moved).sum(axis=2, keepdims=True)
        length = np.linalg.norm(moved, axis=2)
        too_far = springs * length > limits
        share = np.where(too_far, limits / (springs * np.where(too_far, length, 1.0)), 1.0)
        anchors = where - share[..., None] * moved
        anchors[~touches] = np.nan
        return self.replace(friction=Friction(anchors, normals, limits))

    @property
    def digest(self) -> str:
        """Digest of obstacle, samples, stiffness and friction."""
        friction = () if self.friction is None else self.friction
        given = self.stiffness, self.offset, self.coefficient
        return digest_of(self.obstacle.digest, *self.samples, *given, *friction)

    def evaluate(self, positions: Floats) -> ObstacleState:
        """Evaluate gaps and forces."""
        return ObstacleState(self, positions)

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        """Whether friction has a potential, as its limits are given."""
        return self.friction is None or not self.friction.follows

    def energy(self, positions: Floats) -> float:
        """Compute the energy of springs and friction [J]."""
        return self.evaluate(positions).energy

    def forces(self, positions: Floats) -> Floats:
        """Compute the forces that hold the cage against the obstacle [N], (V, 3)."""
        return self.evaluate(positions).forces

    def tangent(self, positions: Floats) -> Floats:
        """Compute the exact tangent [N/m], (E, 3 n, 3 n)."""
        return self.evaluate(positions).tangent()

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Compute the largest step with which no sample passes through the obstacle's middle."""
        if not np.isfinite(self.room):
            return np.inf
        room = np.maximum(_APPROACH * (self.gaps(positions) + self.room), _LEAST_MOVE * self.room)
        moved = np.linalg.norm(self.samples.positions(move), axis=2)
        return float((room / np.maximum(moved, 1e-300)).min())

    @property
    def room(self) -> float:
        """Depth of a sample in the middle of the obstacle [m]."""
        return self.obstacle.depth + self.offset

    def gaps(self, positions: Floats) -> Floats:
        """Compute the distance of each sample from the obstacle, less the offset.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        ndarray of float64, shape (E, m)
            Distances [m]; negative where a sample touches.
        """
        where = self.samples.positions(positions)
        return self.obstacle.gap(where.reshape(-1, 3)).reshape(where.shape[:2]) - self.offset

    def assemble(self, elements: Ints, each: Floats) -> Floats:
        """Assemble matrices at the samples of some elements by the nodes of all.

        Parameters
        ----------
        elements : ndarray of int64, shape (e,)
            The elements.
        each : ndarray of float64, shape (e, m, 3, 3)
            A matrix for each of their samples [N/m].

        Returns
        -------
        ndarray of float64, shape (E, 3 n, 3 n)
            Matrices of all elements [N/m].
        """
        samples = self.samples
        count, size = len(samples.nodes), samples.nodes.shape[1]
        result = np.zeros((count, 3 * size, 3 * size))
        if not len(elements):
            return result
        products = samples.weights[:, :, None] * samples.weights[:, None, :]
        products = products.reshape(len(products), -1)
        blocks = each.reshape(*each.shape[:2], 9).swapaxes(1, 2) @ products
        blocks = blocks.reshape(-1, 3, 3, size, size).transpose(0, 3, 1, 4, 2)
        result[elements] = blocks.reshape(-1, 3 * size, 3 * size)
        return result


class ObstacleState(TermState):
    """An obstacle's term at fixed positions."""

    def __init__(self, term: ObstacleTerm, positions: Floats) -> None:
        super().__init__(term, positions)
        self._obstacle, samples, self._count = term, term.samples, len(positions)
        self._points = samples.positions(positions)
        gap = term.obstacle.gap(self._points.reshape(-1, 3)) - term.offset
        self._gap = gap.reshape(samples.areas.shape)
        depth = np.maximum(-self._gap, 0.0)
        #: (E,) Elements of which a sample touches.
        self.elements = np.flatnonzero(depth.any(axis=1))
        part = self.elements
        #: (e, m) Depth and normal forces at the samples of these elements.
        self.depth = depth[part]
        self._springs = term.stiffness * samples.areas[part]
        self._spring_energy, self.press, self._slopes = press_springs(
            self._springs, self.depth, term.room
        )
        self._inside = self.depth > 0

    @cached_property
    def _distance(self) -> tuple[Floats, Floats]:
        """Gradient (e, m, 3) and curvature (e, m, 3, 3) of the distance where a sample touches."""
        shape = self.depth.shape
        gradient, curvature = np.zeros((*shape, 3)), np.zeros((*shape, 3, 3))
        found = self._obstacle.obstacle.distance(self._points[self.elements][self._inside])
        gradient[self._inside], curvature[self._inside] = found.gradient, found.curvature
        return gradient, curvature

    @cached_property
    def _slip(self) -> tuple[Floats, Floats, Floats] | None:
        """Move from the anchors along the surface, its length, and the secant stiffness."""
        friction = self._obstacle.friction
        if friction is None:
            return None
        part = self.elements
        normals = friction.normals[part]
        moved = np.nan_to_num(self._points[part] - friction.anchors[part])
        moved -= normals * (normals * moved).sum(axis=2, keepdims=True)
        length = np.linalg.norm(moved, axis=2)
        limit = self._limit
        slides = self._springs * length > limit
        secant = np.where(slides, limit / np.where(slides, length, 1.0), self._springs)
        secant[np.isnan(friction.anchors[part, :, 0])] = 0.0
        return moved, length, secant

    @property
    def _limit(self) -> Floats:
        """Largest friction at the samples of the touching elements [N], (e, m)."""
        friction = self._obstacle.friction
        assert friction is not None
        if friction.follows:
            return self._obstacle.coefficient * self.press
        return friction.limits[self.elements]

    @cached_property
    def energy(self) -> float:
        """Energy of springs and friction [J]."""
        total = float(self._spring_energy.sum())
        if self._slip is not None:
            _, length, secant = self._slip
            # ½ k s² up to the limit L, and L s - ½ L²/k beyond it.
            total += float((secant * length**2 * (1 - secant / self._springs / 2)).sum())
        return total

    @cached_property
    def friction(self) -> Floats:
        """Friction at the samples of the touching elements [N], (e, m, 3)."""
        if self._slip is None:
            return np.zeros((*self.depth.shape, 3))
        moved, _, secant = self._slip
        return secant[..., None] * moved

    @cached_property
    def sample_forces(self) -> Floats:
        """Forces that hold the samples of the touching elements [N], (e, m, 3)."""
        return self.friction - self.press[..., None] * self._distance[0]

    @cached_property
    def forces(self) -> Floats:
        """Forces that hold the nodes [N], (V, 3)."""
        samples = self._obstacle.samples
        nodal = samples.weights.T @ self.sample_forces
        return sum_at_nodes(samples.nodes[self.elements], nodal, self._count)

    def tangent(self, removed: float = 0.0, predicted: Any = None) -> Floats:
        """Compute the tangent; without its share of the obstacle's curvature, which is negative."""
        normal, curvature = self._distance
        springs = (self._slopes * self._inside)[..., None, None]
        each = springs * normal[..., :, None] * normal[..., None, :]
        each -= ((1.0 - removed) * self.press)[..., None, None] * curvature
        return self._obstacle.assemble(self.elements, each + self._friction_tangent())

    @cached_property
    def held(self) -> Held:
        """What is held in vibrations about this state: samples that touch, or almost do."""
        term = self._obstacle
        held = self._gap < NEAR * self.depth.max(initial=0.0)
        part = np.flatnonzero(held.any(axis=1))
        held = held[part]
        normal, curvature = np.zeros((*held.shape, 3)), np.zeros((*held.shape, 3, 3))
        found = term.obstacle.distance(self._points[part][held])
        normal[held], curvature[held] = found.gradient, found.curvature
        springs = term.stiffness * term.samples.areas[part] * held
        press = press_springs(springs, np.maximum(-self._gap[part], 0.0), term.room)[1]
        return Held(part, SUPPORT * springs, press, normal, curvature)

    def tangent_at_rest(self, removed: float = 0.0) -> Floats:
        """Compute the tangent with what touches held as by supports, and friction constant."""
        part, springs, press, normal, curvature = self.held
        each = springs[..., None, None] * normal[..., :, None] * normal[..., None, :]
        each -= ((1.0 - removed) * press)[..., None, None] * curvature
        if self._slip is not None:
            # Samples that stick are held across the normal, too.
            _, length, secant = self._slip
            sticks = (self._inside & (secant * length < SLIDES * self._limit)) * secant
            rows = np.searchsorted(part, self.elements)
            each[rows] += SUPPORT * sticks[..., None, None] * self._across
        return self._obstacle.assemble(part, each)

    @property
    def _across(self) -> Floats:
        """Projections (e, m, 3, 3) along the surface of the obstacle at each sample."""
        friction = self._obstacle.friction
        assert friction is not None
        normals = friction.normals[self.elements]
        return np.asarray(np.eye(3) - normals[..., :, None] * normals[..., None, :])

    def _friction_tangent(self) -> Floats | float:
        friction = self._obstacle.friction
        if friction is None or self._slip is None:
            return 0.0
        moved, length, secant = self._slip
        slides = secant < self._springs
        way = moved / np.where(length > 0, length, 1.0)[..., None]
        along = slides[..., None, None] * way[..., :, None] * way[..., None, :]
        result = secant[..., None, None] * (self._across - along)
        if friction.follows:
            anchored = ~np.isnan(friction.anchors[self.elements, :, 0])
            grip = self._obstacle.coefficient * self._slopes * (slides & anchored & self._inside)
            # The normal force grows against the gradient of the distance.
            result -= grip[..., None, None] * way[..., :, None] * self._distance[0][..., None, :]
        return np.asarray(result)

    def report(self) -> Contact:
        """Summarise the contact."""
        touching = int(self._inside.sum())
        sliding = touching
        if self._slip is not None and self._obstacle.friction is not None:
            _, length, secant = self._slip
            sticks = secant * length < SLIDES * self._limit
            sliding -= int((self._inside & sticks).sum())
        # What holds the cage is the negative of the force that pushes it away.
        force = self.sample_forces.sum(axis=(0, 1))
        return Contact(force, touching, float(self.depth.max(initial=0.0)), sliding)


def stiffen(term: ObstacleTerm, stiffness: float, positions: Floats) -> ObstacleTerm:
    """Change the stiffness of the springs; anchors move so that friction stays the same."""
    if term.friction is not None:
        where = term.samples.positions(positions)
        anchors = where - term.stiffness / stiffness * (where - term.friction.anchors)
        term = term.replace(friction=term.friction._replace(anchors=anchors))
    return term.replace(stiffness=stiffness)


def _press(term: ObstacleTerm, positions: Floats) -> tuple[Floats, Bools, Floats, Floats]:
    """Return places (E, m, 3) of samples, whether they touch, normals, and limits of friction."""
    where = term.samples.positions(positions)
    shape = where.shape[:2]
    found = term.obstacle.distance(where.reshape(-1, 3))
    depth = np.maximum(term.offset - found.gap, 0.0).reshape(shape)
    normals = found.gradient / np.linalg.norm(found.gradient, axis=1, keepdims=True)
    springs = term.stiffness * term.samples.areas
    limits = term.coefficient * press_springs(springs, depth, term.room)[1]
    return where, depth > 0, normals.reshape(where.shape), limits
