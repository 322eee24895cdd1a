"""Friction between layers of a sheet that touch each other.

Friction acts on both sides of each mid-point of the sheet. What presses on a side is a sum over
pairs of points of both layers (`self_contact.PressingPairs`). The pair that presses most holds
this side: its two points are joined by a spring along the layers, whose elastic slip e pulls with

    f = k A e/2,    |f| ≤ μ p/2

with the stiffness of contact k, the mid-point's area A, and the force p on this side. Each layer
contributes one half. The points of a pair receive opposite forces. The slip belongs to the side,
not to the pair, and remains when another pair holds it: nothing creeps.

At rest the slip grows from one balanced state to the next (`LayerFriction.advance_friction`), as
with obstacles. In a time step from e₀ with the relative move Δ of the pair along the layers

    f = k A e₁/2,    e₁ = e₀ + Δ, shortened to |f| = μ p/2

where pair, direction and p are those at the start of the step. The energy ¼ k A e² is stored, and
f·(e₀ + Δ - e₁) + ¼ k A (e₁ - e₀)² ≥ 0 is dissipated, so that the sum of all energies stays. A side
on which nothing presses at the end of a step loses its slip.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.mechanics.contact.obstacle_term import SLIDES, SUPPORT
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    FinishedStep,
    PairedNodes,
    TermState,
    TermStep,
    digest_of,
)
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


class Grips(NamedTuple):
    """What holds the sides of mid-points at some positions; there are m such sides."""

    sides: Ints
    """(m,), twice the number of the mid-point, plus 1 for its upper side; ascending."""
    nodes: Ints
    """(m, 4), mid-points on which the pair depends that presses most."""
    weights: Floats
    """(m, 4), their weights in the place of this side relative to the other layer."""
    normals: Floats
    """(m, 3), direction in which the pair presses."""
    press: Floats
    """(m,), force on the side [N]."""

    def across(self, moves: Floats) -> Floats:
        """Compute the moves of the sides along the other layer, from those of mid-points."""
        moved = (self.weights[..., None] * moves[self.nodes]).sum(axis=1)
        return _across(moved, self.normals)

    def at_points(self, forces: Floats, count: int) -> Floats:
        """Sum the forces on the sides, and their reactions, at `count` mid-points."""
        shared = (self.weights[..., None] * forces[:, None]).reshape(-1, 3)
        rows = self.nodes.ravel()
        return np.stack([np.bincount(rows, shared[:, i], count) for i in range(3)], axis=1)

    def matrix(self, blocks: Floats, count: int) -> csr_matrix:
        """Assemble matrices (m, 3, 3) of the sides by all mid-points, (3 count, 3 count)."""
        # Commands that only read results do not need scipy.
        from scipy.sparse import coo_matrix

        weights = self.weights[:, :, None] * self.weights[:, None, :]
        values = weights[..., None, None] * blocks[:, None, None]
        dof = 3 * self.nodes[..., None] + np.arange(3)
        rows = np.broadcast_to(dof[:, :, None, :, None], values.shape)
        columns = np.broadcast_to(dof[:, None, :, None, :], values.shape)
        where = rows.ravel(), columns.ravel()
        return coo_matrix((values.ravel(), where), shape=(3 * count, 3 * count)).tocsr()


class Hold(NamedTuple):
    """Friction of a balanced state, from which sides are held."""

    grips: Grips
    """What holds them."""
    slip: Floats
    """(m, 3), their slip in this state [m]."""
    middle: Floats
    """(n, 3), mid-points in this state [m]."""
    limits: Floats
    """(m,), largest friction [N]."""


class LayerFriction(EnergyTerm):
    """Friction between layers of a sheet.

    Parameters
    ----------
    contact : SelfContact
        Contact of the layers, for the use of this term alone.
    coefficient : float
        Coefficient of Coulomb friction μ.
    hold : Hold, optional
        Friction of a balanced state; by default nothing is held.
    """

    def __init__(self, contact: SelfContact, coefficient: float, hold: Hold | None = None) -> None:
        self.contact, self.coefficient, self.hold = contact, coefficient, hold
        self.nodes = contact.nodes
        #: (n,) Spring constant of each side of a mid-point [N/m].
        self.springs = contact.stiffness * contact.areas / 2

    def replace(self, hold: Hold | None) -> LayerFriction:
        """Make a copy with another hold, and with the pattern of this one.

        Parameters
        ----------
        hold : Hold or None
            Friction of a balanced state.

        Returns
        -------
        LayerFriction
            The copy.
        """
        found = LayerFriction(self.contact, self.coefficient, hold)
        found.nodes = self.nodes
        return found

    def in_model_nodes(self, surface: PairedNodes | None, factor: float) -> LayerFriction:
        """Return the term of the sheet's mid-points, times a factor."""
        hold = self.hold
        if hold is not None:
            grips = hold.grips._replace(press=factor * hold.grips.press)
            hold = hold._replace(grips=grips, limits=factor * hold.limits)
        return LayerFriction(self.contact.in_model_nodes(surface, factor), self.coefficient, hold)

    @property
    def digest(self) -> str:
        """Digest of contact, coefficient and hold."""
        held = () if self.hold is None else (*self.hold.grips, *self.hold[1:])
        return digest_of("layer friction", self.contact.digest, self.coefficient, *held)

    @property
    def sides(self) -> int:
        """Number of sides of all mid-points."""
        return 2 * len(self.springs)

    def evaluate(self, positions: Floats) -> LayerFrictionState:
        """Evaluate the friction that the hold exerts."""
        return LayerFrictionState(self, positions)

    def energy(self, positions: Floats) -> float:
        """Compute the energy of friction with given limits [J]."""
        return self.evaluate(positions).energy

    def forces(self, positions: Floats) -> Floats:
        """Compute the friction that holds the nodes [N], (V, 3)."""
        return self.evaluate(positions).forces

    def tangent(self, positions: Floats) -> Floats:
        """Compute the second derivatives of the energy at the pairs of the pattern [N/m]."""
        return self.evaluate(positions).tangent()

    def follow(self, positions: Floats) -> bool:
        """Add the pairs of nodes that may come near to the pattern of the tangent."""
        self.contact.follow(positions)
        changed = self.nodes is not self.contact.nodes
        self.nodes = self.contact.nodes
        return changed

    def resistance_matrices(self) -> Floats:
        """Return zeros: friction does not hold a sheet."""
        size = 3 * self.nodes.shape[1]
        return np.zeros((len(self.nodes), size, size))

    def find_grips(self, middle: Floats) -> Grips:
        """Find what holds the sides of the mid-points.

        Parameters
        ----------
        middle : ndarray of float64, shape (n, 3), in columns
            Mid-points [m].

        Returns
        -------
        Grips
            One for each side on which something presses.
        """
        self.contact.follow_middle(middle)
        pairs, facings = self.contact.pressing_pairs(middle), self.contact.facings(middle)
        # The other layer is against the normal of a pair's first point, and along that of the
        # second one.
        ways = -np.sign(pairs.weights)
        upper = ways * (facings[pairs.nodes] * pairs.normals[:, None]).sum(axis=2) > 0
        shares = (abs(pairs.weights) * pairs.forces[:, None]).ravel()
        sides = (2 * pairs.nodes + upper).ravel()
        press = np.bincount(sides, shares, self.sides)
        order = np.lexsort((shares, sides))
        last = np.append(np.diff(sides[order]) > 0, True)[: len(order)]
        chosen = order[last]
        chosen = chosen[shares[chosen] > 0]
        pair, column = np.divmod(chosen, 4)
        signs = np.sign(pairs.weights[pair, column])[:, None]
        found = sides[chosen]
        return Grips(
            found, pairs.nodes[pair], signs * pairs.weights[pair], pairs.normals[pair], press[found]
        )

    def at_rest(self, positions: Floats, anchors: Floats) -> LayerFriction:
        """Return the term of a state at rest with its anchors of friction.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].
        anchors : ndarray of float64, shape (3 n, 3) or (0, 3)
            `anchors` of the state [m]; if there are none, nothing has slipped.

        Returns
        -------
        LayerFriction
            Its limits of friction are those of these positions.
        """
        # The positions may differ from those of the state, as where a held part is moved.
        given = np.asfortranarray(anchors[self.sides :])
        if not len(given) or np.isnan(given).any():
            return self.replace(None).advance_friction(positions)
        grips = self.find_grips(given)
        slip = np.nan_to_num(given[grips.sides // 2] - anchors[grips.sides])
        return self.replace(self._hold(grips, slip, given))

    @property
    def anchors(self) -> Floats:
        """The hold as points [m], (3 n, 3).

        For the lower and the upper side of each mid-point its place less the slip, NaN where
        nothing holds it; and then all mid-points.
        """
        count = len(self.springs)
        found = np.full((3 * count, 3), np.nan)
        if self.hold is not None:
            sides = self.hold.grips.sides
            found[sides] = self.hold.middle[sides // 2] - self.hold.slip
            found[2 * count :] = self.hold.middle
        return found

    def follow_friction(self, positions: Floats, follows: bool = True) -> LayerFriction:
        """Renew the limits of friction within a step; what holds each side stays.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].
        follows : bool
            Without effect: limits are those of these positions, see `ObstacleTerm`.

        Returns
        -------
        LayerFriction
            The term with these limits.
        """
        if self.hold is None:
            return self
        grips, now = self.hold.grips, self.find_grips(self.contact.to_middle(positions))
        place, known = _find(now.sides, grips.sides)
        press = np.where(known, now.press[place], 0.0)
        return self.replace(self.hold._replace(limits=self.coefficient / 2 * press))

    def advance_friction(self, positions: Floats) -> LayerFriction:
        """End a step: slip is limited where sides slide, and new contacts are held.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m], in balance.

        Returns
        -------
        LayerFriction
            The term with the friction of this state.
        """
        middle = self.contact.to_middle(positions)
        grips = self.find_grips(middle)
        slip = np.zeros((len(grips.sides), 3))
        if self.hold is not None:
            before = self.evaluate(positions)
            place, known = _find(self.hold.grips.sides, grips.sides)
            slip[known] = before.slip[place[known]]
        return self.replace(self._hold(grips, slip, middle))

    def _hold(self, grips: Grips, slip: Floats, middle: Floats) -> Hold:
        """Hold sides with a slip, which is turned along the layers and limited."""
        limits = self.coefficient / 2 * grips.press
        slip = _turned(slip, grips.normals)
        springs = self.springs[grips.sides // 2]
        return Hold(grips, _shortened(slip, limits / springs), np.array(middle), limits)


class LayerFrictionState(TermState):
    """Friction between layers at fixed positions."""

    def __init__(self, term: LayerFriction, positions: Floats) -> None:
        super().__init__(term, positions)
        self._friction = term

    @cached_property
    def _trial(self) -> tuple[Floats, Floats, Floats]:
        """Slip without a limit, its length, and the secant stiffness of the springs."""
        term, hold = self._friction, self._friction.hold
        assert hold is not None
        moved = term.contact.to_middle(self._positions) - hold.middle
        trial = hold.slip + hold.grips.across(moved)
        length = np.linalg.norm(trial, axis=1)
        springs = term.springs[hold.grips.sides // 2]
        slides = springs * length > hold.limits
        secant = np.where(slides, hold.limits / np.where(slides, length, 1.0), springs)
        return trial, length, secant

    @property
    def slip(self) -> Floats:
        """Slip of the held sides, limited where they slide [m], (m, 3)."""
        hold = self._friction.hold
        assert hold is not None
        trial, _, secant = self._trial
        return np.asarray((secant / self._friction.springs[hold.grips.sides // 2])[:, None] * trial)

    @cached_property
    def energy(self) -> float:
        """Energy [J]: ½ k s² up to the limit L, and L s - ½ L²/k beyond it."""
        term = self._friction
        if term.hold is None:
            return 0.0
        _, length, secant = self._trial
        springs = term.springs[term.hold.grips.sides // 2]
        return float((secant * length**2 * (1 - secant / springs / 2)).sum())

    @cached_property
    def forces(self) -> Floats:
        """Friction that holds the nodes [N], (V, 3)."""
        term = self._friction
        if term.hold is None:
            return np.zeros_like(self._positions)
        trial, _, secant = self._trial
        held = term.hold.grips.at_points(secant[:, None] * trial, len(term.springs))
        return term.contact.to_nodes(held, len(self._positions))

    def tangent(self, removed: float = 0.0, predicted: object = None) -> Floats:
        """Compute the second derivatives at the pairs of nodes in the pattern."""
        hold = self._friction.hold
        if hold is None or not len(hold.grips.sides):
            return self._friction.resistance_matrices()
        trial, length, secant = self._trial
        slides = secant < self._friction.springs[hold.grips.sides // 2]
        blocks = _springs_across(hold.grips.normals, secant, slides, trial, length)
        return self._at_pairs(hold.grips, blocks)

    def tangent_at_rest(self, removed: float = 0.0) -> Floats:
        """Compute the tangent with what sticks held as by supports, and other friction constant."""
        hold = self._friction.hold
        if hold is None or not len(hold.grips.sides):
            return self._friction.resistance_matrices()
        _, length, secant = self._trial
        sticks = SUPPORT * secant * (secant * length < SLIDES * hold.limits)
        nothing = np.zeros(len(sticks), dtype=bool)
        blocks = _springs_across(hold.grips.normals, sticks, nothing, hold.slip, length)
        return self._at_pairs(hold.grips, blocks)

    def _at_pairs(self, grips: Grips, blocks: Floats) -> Floats:
        term = self._friction
        return term.contact.blocks_at_pairs(grips.matrix(blocks, len(term.springs)))

    def count(self) -> tuple[int, int]:
        """Count the sides that touch, and those of them that slide."""
        hold = self._friction.hold
        if hold is None:
            return 0, 0
        _, length, secant = self._trial
        slides = secant * length >= SLIDES * hold.limits
        return len(slides), int(slides.sum())


class SteppedLayers(EnergyTerm):
    """Friction between layers between two time steps; `slip` (S, 3) is that of all sides [m]."""

    def __init__(self, friction: LayerFriction, slip: Floats, grips: Grips | None = None) -> None:
        self.friction, self.slip, self.nodes = friction, slip, friction.nodes
        #: What holds the sides at the start of the next step, if that is known.
        self._grips = grips

    @property
    def digest(self) -> str:
        """Digest of the term and its slip."""
        return digest_of(self.friction.digest, self.slip)

    def energy(self, positions: Floats) -> float:
        """Compute the energy of the slip [J]."""
        return 0.5 * float(np.repeat(self.friction.springs, 2) @ (self.slip**2).sum(axis=1))

    def forces(self, positions: Floats) -> Floats:
        """Return zeros: friction acts within steps."""
        return np.zeros_like(positions)

    def tangent(self, positions: Floats) -> Floats:
        """Return zeros: friction acts within steps."""
        return self.friction.resistance_matrices()

    def resistance_matrices(self) -> Floats:
        """Return zeros: friction does not hold a sheet."""
        return self.friction.resistance_matrices()

    def follow(self, positions: Floats) -> bool:
        """Add the pairs of nodes that may come near to the pattern of the tangent."""
        changed = self.friction.follow(positions)
        self.nodes = self.friction.nodes
        return changed

    def with_slip(self, slip: Floats) -> SteppedLayers:
        """Return the same friction with another slip, (S, 3) [m]."""
        return SteppedLayers(self.friction, slip)

    def begin_step(self, positions: Floats, time: float, span: float) -> LayerStep:
        """Begin a time step."""
        if self._grips is None:
            self._grips = self.friction.find_grips(self.friction.contact.to_middle(positions))
        return LayerStep(self, positions, self._grips)


def begin_stepping_layers(term: LayerFriction, positions: Floats) -> SteppedLayers:
    """Make the term of the first time step from that of a state at rest."""
    held = term.advance_friction(positions).hold
    assert held is not None
    slip = np.zeros((term.sides, 3))
    slip[held.grips.sides] = held.slip
    return SteppedLayers(term.replace(None), slip, held.grips)


class LayerStep(TermStep):
    """Friction between layers in a step."""

    def __init__(self, stepped: SteppedLayers, positions: Floats, grips: Grips) -> None:
        self._stepped, self._friction, self._grips = stepped, stepped.friction, grips
        self._start = self._friction.contact.to_middle(positions)
        self._springs = self._friction.springs[grips.sides // 2]
        self._limits = self._friction.coefficient / 2 * grips.press
        self._slip = _turned(stepped.slip[grips.sides], grips.normals)

    def admits(self, shares: Floats, places: list[Floats]) -> bool:
        """Admit everything: contact itself keeps the layers apart."""
        return True

    def forces(self, end: Floats) -> Floats:
        """Compute the friction that holds the nodes [N], (V, 3)."""
        _, force = self._pull(end)
        held = self._grips.at_points(force, len(self._start))
        return self._friction.contact.to_nodes(held, len(end))

    def tangent(self, end: Floats) -> Floats:
        """Compute the derivative of the forces by the positions at the end [N/m]."""
        term = self._friction
        if not len(self._springs):
            return term.resistance_matrices()
        trial, force = self._pull(end)
        length = np.linalg.norm(trial, axis=1)
        slides = self._springs * length > self._limits
        held = np.linalg.norm(force, axis=1)
        secant = np.where(slides, held / np.where(slides, length, 1.0), self._springs)
        blocks = _springs_across(self._grips.normals, secant, slides, trial, length)
        return term.contact.blocks_at_pairs(self._grips.matrix(blocks, len(self._start)))

    def finish(self, end: Floats) -> FinishedStep:
        """Return the term at the end and the energy that friction dissipates; it does no work."""
        trial, force = self._pull(end)
        later = force / self._springs[:, None]
        lost = float((force * (trial - later)).sum())
        lost += 0.5 * float((self._springs * ((later - self._slip) ** 2).sum(axis=1)).sum())
        grips = self._friction.find_grips(self._friction.contact.to_middle(end))
        place, known = _find(self._grips.sides, grips.sides)
        slip = np.zeros_like(self._stepped.slip)
        slip[grips.sides[known]] = _turned(later[place[known]], grips.normals[known])
        opens = np.ones(len(later), dtype=bool)
        opens[place[known]] = False
        lost += 0.5 * float((self._springs * (later**2).sum(axis=1))[opens].sum())
        return FinishedStep(SteppedLayers(self._friction, slip, grips), lost, 0.0)

    def _pull(self, end: Floats) -> tuple[Floats, Floats]:
        """Return the slip without a limit, and the friction, (m, 3)."""
        moved = self._friction.contact.to_middle(end) - self._start
        trial = self._slip + self._grips.across(moved)
        return trial, self._springs[:, None] * _shortened(trial, self._limits / self._springs)


def _springs_across(
    normals: Floats, secant: Floats, slides: Bools, trial: Floats, length: Floats
) -> Floats:
    """Compute the matrices (m, 3, 3) of springs across normals, some of which slide."""
    across = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    way = trial / np.where(length > 0, length, 1.0)[:, None]
    along = slides[:, None, None] * way[:, :, None] * way[:, None, :]
    return np.asarray(secant[:, None, None] * (across - along))


def _across(vectors: Floats, normals: Floats) -> Floats:
    """Compute the parts of vectors (m, 3) across unit normals."""
    return np.asarray(vectors - normals * (normals * vectors).sum(axis=1, keepdims=True))


def _turned(vectors: Floats, normals: Floats) -> Floats:
    """Turn vectors (m, 3) so that they are across unit normals, without a change of length."""
    across = _across(vectors, normals)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    whole = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(across * (whole / np.where(length > 0, length, 1.0)))


def _shortened(vectors: Floats, most: Floats) -> Floats:
    """Shorten vectors (m, 3) to lengths of at most `most`, (m,)."""
    length = np.linalg.norm(vectors, axis=1)
    share = np.where(length > most, most / np.where(length > 0, length, 1.0), 1.0)
    return np.asarray(share[:, None] * vectors)


def _find(known: Ints, wanted: Ints) -> tuple[Ints, Bools]:
    """Find numbers in an ascending list: their places, and whether they are there."""
    if not len(known):
        return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=bool)
    place = np.searchsorted(known, wanted).clip(max=len(known) - 1)
    return place, known[place] == wanted
