"""Crimp interchange: yarns that keep their length, or their tension, when the cloth is stretched.

Space is stretched by lambda_w along the warp and lambda_f along the weft. A crossing then has new
spacings and two unknowns: h1, the crimp height of the warp, and D, twice the distance of the axes
(h2 = D - h1). Each crossing is solved as if it were repeated all over the cloth. If neighbours were
coupled by the rise between them, heights that alternate from crossing to crossing would cost no
energy, and the problem would have no unique solution. `joined` corrects crossings that differ.

- In a gap where a yarn changes side, its length follows Peirce. Flats of the crossed yarn, and
  floats, are straight. Floats are distributed evenly over the gaps with a change of side in the
  repeat of the drawdown, so that a repeat of each yarn has the right length.
- Yarns pull and do not push: a yarn that is longer than its room is slack. Touching yarns can only
  be pressed together, down to the least D, where fibres are packed as closely as possible.
- Yarns that do not stretch are the limit of stiff ones: lengths come first, then contact, then
  bending. Where both yarns are slack, bending decides. Where both are pulled, the crossing flattens
  as little as the lengths allow. At the least D they strain, by least squares.
- The angle of a gap resists with 12 B (s/l)²/l, with the straight and the whole length at rest. So
  a strip begins to stretch with Leaf and Kandil's modulus, for yarns that bend over their whole
  length. If only the arcs bent, an open cloth would be too stiff without limit.
- At a jam a yarn has no straight part left while it is still slack. The crossing cannot be pressed
  any further: it keeps the stretch at which the jam occurs.

Sources: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45; S.
Kawabata, M. Niwa, H. Kawai, "The Finite-deformation Theory of Plain-weave Fabrics", J. Textile
Inst. 64 (1973) 21, for the balance of tensions and the pressed crossing; G. A. V. Leaf, K. H.
Kandil, "The Initial Load-extension Behaviour of Plain-woven Fabrics", J. Textile Inst. 71 (1980) 1.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from math import inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk import cancel
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.crimp.contact_law import ContactLaw
from spacemap_vtk.textile.crimp.crimp_energy import (
    CrimpEnergy,
    angle_derivatives,
    energy_derivatives,
    minimise_energy,
    select_crossings,
    yarn_forces,
)
from spacemap_vtk.textile.crimp.crossings import Crossings, build_crossings
from spacemap_vtk.textile.crimp.length_correction import CrossingResults, LengthCorrection
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import solve_gaps, taut_heights

#: Share of a section that fibres fill in the closest (hexagonal) packing.
CLOSEST = pi / (2.0 * sqrt(3.0))
#: A yarn is slack if its axis is shorter than its length by more than this share.
_SLACK = 1e-9
#: Stretches less 1 along warp and weft at which kinds of crossings are compared, as shares of the
#: stretch that straightens a yarn, which counts as at least the second number.
_SAMPLED = ((0.5, 0), (0, 0.5), (0.5, 0.5), (1, -0.5), (-0.5, 1), (1, 1), (0.2, 0.2))
_LEAST_OPENING = 1e-3
#: Number of crossings that are solved in one block, which takes some ten megabytes.
_BLOCK = 50_000


class YarnMechanics(NamedTuple):
    """Stiffnesses of yarns."""

    tension: ArrayLike = (inf, inf)
    """EA of warp and weft in N, or (2, picks, ends) at each crossing; inf for both means that the
    yarns do not stretch."""
    contact: float = 0.0
    """Stiffness k_D of crossings in N; inf means hard contact."""
    bending: tuple[float, float] = (0.0, 0.0)
    """Bending stiffness B of warp and weft, in N m2."""
    flattest: float = 0.6 / CLOSEST
    """Least D over D at rest: packing over `CLOSEST`; 1 for hard contact."""
    law: ContactLaw = ContactLaw()
    """How the force of a crossing grows as it is flattened; `contact` is its factor k."""
    rigid_arcs: bool = False
    """Whether the arcs of yarns around each other do not bend with the cloth."""


class CrimpState(NamedTuple):
    """State of crossings; arrays are (picks, ends), or (2, picks, ends) for warp and weft."""

    height: Floats
    """(2, ...) Distances of the axes from the mid-surface, h1 / 2 and h2 / 2, in metres."""
    distance: Floats
    """D = h1 + h2, in metres."""
    theta: Floats
    """(2, ...) Peirce's angle, in radians."""
    crimp: Floats
    """(2, ...) Crimp of the axes over the stretched space, including floats."""
    strain: Floats
    """(2, ...) Strain of the yarns, at least 0."""
    contact: Floats
    """Force that presses the yarns together, in N; 0 where neither EA nor k_D is known."""
    slack: Bools
    """(2, ...) Whether the yarn is longer than its room."""
    jammed: Bools
    """(2, ...) Whether the crossing resists the stretch along warp or weft."""
    stretch: Floats
    """(2, ...) Stretches that are reached: those given, or those at which the crossing jams."""


class EnergyDerivatives(NamedTuple):
    """Energy of crossings, and its derivatives by the stretches along warp and weft."""

    energy: Floats
    """(picks, ends) J"""
    force: Floats
    """(2, picks, ends) J; divided by `Interchange.cell`: forces per width of cloth at rest."""
    tangent: Floats
    """(2, 2, picks, ends) J; h1 and D follow the stretch."""


class Resultants(NamedTuple):
    """Response of a cloth to n uniform stretches."""

    force: Floats
    """(2, n) Force per width of cloth at rest, along warp and weft, in N/m, without the push of
    jams; 0 for yarns that do not stretch, because they carry any force."""
    strain: Floats
    """(2, n) Largest strain of the yarns."""
    slack: Floats
    """(2, n) Least excess of a yarn's length over its room, as a share of the length."""
    distance: Floats
    """(n,) Least D over D at rest."""
    stretch: Floats
    """(2, n) Stretches that are reached: those given, or those at which the first crossing jams."""


class Interchange:
    """The crossings of a cloth, prepared for stretching.

    Parameters
    ----------
    cloth : Cloth
        At rest: any weave, diameters, spacings and sections.
    yarns : YarnMechanics
        Stiffnesses of its yarns; by default they do not stretch.

    Raises
    ------
    GeometryError
        There is no room for the yarns at rest.
    InputError
        A stiffness is not possible.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.25e-3, spacing=0.5e-3)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> crossings = Interchange(cloth)
    >>> state = crossings.solve(np.broadcast_to([[[1.02]], [[0.97]]], (2, 2, 2)))
    >>> bool(state.strain.max() < 1e-9), round(float(state.height[0, 0, 0] / 0.25e-3), 4)
    (True, 0.4714)
    """

    #: Largest difference of the forces from those of all kinds of crossings, as a share of them.
    kinds_error = 0.0

    def __init__(self, cloth: Cloth, yarns: YarnMechanics | None = None) -> None:
        cloth.check()
        if cloth.layers is not None:
            raise InputError(
                "yarns of a double weave cannot exchange crimp: its two cloths have separate "
                "crossings"
            )
        yarns = YarnMechanics() if yarns is None else yarns
        self.shape = cloth.drawdown.shape
        tension = _check_tension(yarns, self.shape)
        self._stretches = bool(np.isfinite(tension).all())
        self._hinged = any(yarns.bending)
        self._contact, self._law = yarns.contact, yarns.law
        #: (picks, ends) Area of cloth at rest that belongs to each crossing, in m2.
        self.cell: Floats
        self._crossings, self.cell = build_crossings(
            cloth, tension, yarns.contact, yarns.bending, yarns.flattest
        )
        same = all((field == field[..., :1]).all() for field in self._crossings)
        loose = self._crossings.is_straight.reshape(2, *self.shape)
        self._correction = None if same else LengthCorrection(cloth, loose)

    def solve(self, stretch: ArrayLike) -> CrimpState:
        """Compute the state of the crossings.

        Parameters
        ----------
        stretch : (2, picks, ends) array_like
            Stretches of space along warp and weft at each crossing; 1 at rest.

        Returns
        -------
        CrimpState
            Continuous in the stretch, and finite for every finite stretch.
        """
        cells, stretches, back = self._distinct_crossings(stretch)
        found = []
        for begin in range(0, stretches.shape[1], _BLOCK):
            cancel.check()
            here = np.arange(begin, min(begin + _BLOCK, stretches.shape[1]))
            found.append(self._solve_block(select_crossings(cells, here), stretches[:, here]))
        *fields, grown, slack = (
            self._arrange(np.concatenate(parts, axis=-1), back)
            for parts in zip(*found, strict=True)
        )
        state = CrimpState(*fields)
        if self._correction is None:
            return state
        floor = 0.5 * self._arrange(cells.least_distance, back)
        height = self._correction.correct_heights(
            state.height, floor, CrossingResults(grown, state.stretch, slack)
        )
        return state._replace(height=height, distance=2.0 * height.sum(axis=0))

    def forces(self, stretch: ArrayLike) -> EnergyDerivatives:
        """Compute the crossings' energy and its derivatives by the stretch.

        Parameters
        ----------
        stretch : (2, picks, ends) array_like
            As for `solve`.

        Returns
        -------
        Forces
            The second derivatives are exact, with h1 and D eliminated, except where bending turns a
            yarn to its jam: the jam pushes as if the room had no effect on bending. A jammed
            crossing has the derivatives at the stretch that it keeps.

        Raises
        ------
        InputError
            The yarns do not stretch, so there is no energy.
        """
        cells, stretches, back = self._distinct_crossings(stretch)
        found = self._energy_derivatives(cells, stretches)
        return EnergyDerivatives(*(self._arrange(array, back) for array in found))

    def resultants(self, stretch: ArrayLike) -> Resultants:
        """Compute the forces of the whole cloth for many uniform stretches.

        Parameters
        ----------
        stretch : (2, n) array_like
            Stretches along warp and weft.

        Returns
        -------
        Resultants
            One entry for each stretch.
        """
        stretches = np.asarray(stretch, np.float64)
        force, over, closeness, reached = self._kind_forces(stretches)
        back = self._kinds[1]
        weights = np.bincount(back, minlength=force.shape[1]) / self.cell.sum()
        return Resultants(
            np.einsum("fkn,k->fn", force, weights),
            np.maximum(over, 0.0).max(axis=1),
            np.maximum(-over, 0.0).min(axis=1),
            closeness.min(axis=0),
            reached.max(axis=1),
        )

    def _kind_forces(self, stretches: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Compute the response of each of K kinds to n stretches."""
        # Forces [J], and the excess of yarns over their rooms, (2, K, n); D over D at rest, (K, n);
        # and the stretches that are reached, (2, K, n).
        first, _ = self._kinds
        shape = 2, len(first), stretches.shape[1]
        cells = select_crossings(self._crossings, np.repeat(first, stretches.shape[1]))
        reached, h, d = self._solve_heights(cells, np.tile(stretches, len(first)))
        room, length = cells.room_and_length(reached)
        gap = solve_gaps(room, np.stack([h, d - h]), cells.arcs * d)
        over = (gap.length - length) / cells.full_length
        over = np.where(cells.is_straight, reached - 1.0, over)
        strain = np.maximum(over, 0.0)
        force = np.zeros_like(reached)
        if self._stretches:
            along = cells.gap_spacing, cells.floats
            energy, heights = cells.energy(self._hinged, self._law), np.stack([h, d - h])
            force = yarn_forces(energy, room, length, heights, d, along)
            force += np.where(cells.is_straight, cells.tension * strain * cells.spacing**2, 0.0)
        return (
            force.reshape(shape),
            over.reshape(shape),
            (d / cells.rest_distance).reshape(shape[1:]),
            reached.reshape(shape),
        )

    def energy(self, stretch: ArrayLike) -> Floats:
        """Compute the energy of the whole cloth for many uniform stretches.

        Parameters
        ----------
        stretch : (2, n) array_like
            Stretches along warp and weft.

        Returns
        -------
        ndarray of float64, shape (n,)
            Energy per area of cloth at rest [J/m²]; a jammed crossing has that of the stretch that
            it keeps.
        """
        stretches = np.asarray(stretch, np.float64)
        first, back = self._kinds
        weights = np.bincount(back, minlength=len(first)) / self.cell.sum()
        result = np.zeros(stretches.shape[1])
        for weight, kind in zip(weights, first, strict=True):
            cancel.check()
            cells = select_crossings(self._crossings, np.full(stretches.shape[1], kind))
            reached, h, d = self._solve_heights(cells, stretches)
            room, length = cells.room_and_length(reached)
            energy = cells.energy(self._hinged, self._law)
            gap = solve_gaps(room, np.stack([h, d - h]), cells.arcs * d)
            over = np.maximum(gap.length - length, 0.0)
            value = (0.5 * energy.tension * over**2).sum(axis=0)
            value += energy.without_pull(gap.theta, d)[0]
            straight = np.maximum(reached - 1.0, 0.0) * cells.spacing
            pull = np.where(cells.is_straight, cells.tension, 0.0)
            result += weight * (value + (0.5 * pull * straight**2).sum(axis=0))
        return result

    def reach_stretch(self, stretch: ArrayLike) -> Floats:
        """Compute the stretches that a cloth reaches.

        Parameters
        ----------
        stretch : (2, n) array_like
            Stretches along warp and weft.

        Returns
        -------
        ndarray of float64, shape (2, n)
            Those given, or those at which the first crossing jams.
        """
        stretches = np.asarray(stretch, np.float64)
        reached = stretches
        for kind in self._kinds[0]:
            cells = select_crossings(self._crossings, np.full(stretches.shape[1], kind))
            reached = np.maximum(reached, cells.reach_stretch(stretches)[0])
        return reached

    @property
    def straight_stretch(self) -> tuple[float, float]:
        """Least stretches along warp and weft at which a yarn is straight."""
        cells = self._crossings
        stretch = np.where(
            cells.is_straight, 1.0, cells.full_length / (cells.spacing + cells.floats)
        )
        warp, weft = stretch.min(axis=1)
        return float(warp), float(weft)

    @cached_property
    def digest(self) -> str:
        """Digest of what `energy` depends on."""
        first, back = self._kinds
        cells = select_crossings(self._crossings, first)
        flags = self._stretches, self._hinged, self._contact, type(self._law).__name__
        return digest_of(*cells, np.bincount(back), self.cell.sum(), *flags, self._law.numbers)

    def with_fewer_kinds(self, most: int) -> Interchange:
        """Let crossings count as equal whose forces are alike.

        Parameters
        ----------
        most : int
            Largest number of kinds that are distinguished.

        Returns
        -------
        Interchange
            This one if it has no more kinds than that. `kinds_error` says how much its forces
            differ from those of all kinds.
        """
        first, back = self._kinds
        if len(first) <= most:
            return self
        open_up = max(min(self.straight_stretch) - 1.0, _LEAST_OPENING)
        stretches = 1.0 + open_up * np.array(_SAMPLED).T
        forces = self._kind_forces(stretches)[0]
        sizes = abs(forces).max(axis=(1, 2), keepdims=True)
        features = (forces / np.maximum(sizes, 1e-300)).swapaxes(0, 1).reshape(len(first), -1)
        counts = np.bincount(back).astype(np.float64)
        chosen, group = [], np.zeros(len(first), dtype=np.int64)
        for number, members in enumerate(_split_by_spread(features, counts, most)):
            mean = np.average(features[members], axis=0, weights=counts[members])
            away = ((features[members] - mean) ** 2).sum(axis=1)
            chosen.append(first[members[away.argmin()]])
            group[members] = number
        result = copy(self)
        result.__dict__.pop("digest", None)
        result.__dict__["_kinds"] = np.array(chosen), group[back]
        exact, found = self.resultants(stretches).force, result.resultants(stretches).force
        result.kinds_error = float((abs(found - exact) / abs(exact).max(axis=0)).max())
        return result

    def with_kinds_of(self, other: Interchange) -> Interchange:
        """Distinguish the same kinds of crossings as for other yarns of the same cloth.

        Parameters
        ----------
        other : Interchange
            Crossings of the same cloth.

        Returns
        -------
        Interchange
            These crossings, represented by those that represent the others.
        """
        result = copy(self)
        result.__dict__.pop("digest", None)
        result.__dict__["_kinds"] = other._kinds
        return result

    @property
    def kind_count(self) -> int:
        """Number of different crossings."""
        return len(self._kinds[0])

    def _solve_block(self, cells: Crossings, stretches: Floats) -> tuple[NDArray[Any], ...]:
        """Compute the fields of `CrimpState`, and lengths and slack for `CrossingResults`."""
        reached, h, d = self._solve_heights(cells, stretches)
        heights = np.stack([h, d - h])
        room, length = cells.room_and_length(reached)
        gap = solve_gaps(room, heights, cells.arcs * d)
        over = np.where(cells.is_straight, cells.spacing * (reached - 1.0), gap.length - length)
        axis = cells.spacing + cells.floats
        crimp = (gap.length + cells.flat + cells.floats * reached) / (axis * reached) - 1.0
        share = self._law.evaluate(d / cells.rest_distance)[1]
        contact = -2.0 * cells.contact * cells.rest_distance * share
        # At the least D the contact force exceeds what k_D gives: it follows from equilibrium.
        at = np.flatnonzero(d <= cells.least_distance)
        if self._stretches and len(at):
            free = select_crossings(
                cells.energy(self._hinged, self._law)._replace(contact=np.zeros_like(d)), at
            )
            arguments = (one.take(at, axis=-1) for one in (room, length, heights, d))
            contact[at] = 2.0 * np.maximum(angle_derivatives(free, *arguments).press(), 0.0)
        return (
            0.5 * heights,
            d,
            gap.theta,
            np.where(cells.is_straight, 0.0, crimp),
            np.where(over > _SLACK * cells.full_length, over / cells.full_length, 0.0),
            contact,
            over < -_SLACK * cells.full_length,
            reached > stretches,
            reached,
            gap.length - cells.length,
            np.maximum(-over / cells.full_length, 0.0) + (reached - stretches).max(axis=0),
        )

    def _distinct_crossings(self, stretch: ArrayLike) -> tuple[Crossings, Floats, Ints | slice]:
        """Return distinct crossings, their stretches, and which of them each crossing is."""
        stretches = np.asarray(stretch, np.float64)
        if stretches.shape != (2, *self.shape):
            raise InputError(
                f"the array has shape {stretches.shape}",
                key="stretch",
                allowed=f"(2, {self.shape[0]}, {self.shape[1]})",
            )
        stretches = stretches.reshape(2, -1)
        if np.ptp(stretches, axis=1).max() <= 1e-14:
            first, back = self._kinds
            return select_crossings(self._crossings, first), stretches[:, first], back
        return self._crossings, stretches, slice(None)

    def _arrange(self, array: NDArray[Any], back: Ints | slice) -> NDArray[Any]:
        """Arrange values of crossings as in the cloth."""
        if not isinstance(back, slice):
            array = array.take(back, axis=-1)
        return array.reshape(*array.shape[:-1], *self.shape)

    @cached_property
    def _kinds(self) -> tuple[Ints, Ints]:
        """First crossing of each kind, and the kind of each crossing."""
        c = self._crossings
        whole = np.stack([c.rest_height, c.rest_distance])
        rows = np.concatenate([c.gap_spacing, c.flat, c.floats, c.tension, c.arcs, whole])
        _, first, back = np.unique(rows, axis=1, return_index=True, return_inverse=True)
        return first, back.ravel()

    def _energy_derivatives(
        self, cells: Crossings, stretch: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Compute the energy and its derivatives by the stretches that the crossings reach."""
        if not self._stretches:
            raise InputError(
                "inextensible yarns carry any force, so they have no energy",
                key="tension",
                allowed="a finite EA of warp and weft",
                cure="Give a tension, for example the modulus times the area of the section",
            )
        reached, h, d = self._solve_heights(cells, stretch)
        energy, (room, length) = (
            cells.energy(self._hinged, self._law),
            cells.room_and_length(reached),
        )
        along, bounds = (
            (cells.gap_spacing, cells.floats),
            (cells.least_distance, cells.rest_distance),
        )
        value, force, tangent = energy_derivatives(
            energy, room, length, np.stack([h, d - h]), d, along, bounds
        )
        # Yarns that never change side are straight.
        pull = np.where(cells.is_straight, cells.tension, 0.0)
        over = np.maximum(reached - 1.0, 0.0) * cells.spacing
        force += pull * over * cells.spacing
        tangent[[0, 1], [0, 1]] += pull * cells.spacing**2 * (reached >= 1.0 - _SLACK)
        value += (0.5 * pull * over**2).sum(axis=0)
        return value, force, tangent

    def _solve_heights(self, cells: Crossings, stretch: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute the stretch that the crossings reach, h1 and D."""
        reached, most = cells.reach_stretch(stretch)
        room, length = cells.room_and_length(reached)
        full, floor = cells.rest_distance, cells.least_distance
        # `most` holds the heights that yarns reach while D is as at rest.
        slack = most.sum(axis=0) >= full * (1.0 - 1e-12)
        bent = cells.rest_height + (cells.gain * (reached - 1.0)).sum(axis=0)
        # Where bending alone would strain a yarn, the yarn keeps its length.
        between = full - most[1], np.maximum(most[0], full - most[1])
        h = np.clip(bent, *between)
        d = full.copy()
        if self._stretches:
            # Yarns and contact share the missing height like springs in series.
            slope = (cells.tension * np.sin(cells.theta) ** 2).clip(1e-300)
            share = cells.contact / slope
            give = np.maximum(full - most.sum(axis=0), 0.0) / (1.0 + share.sum(axis=0))
            d = np.clip(full - give, floor, full)
            h = np.where(slack, h, most[0] + share[0] * give)
        if self._stretches and self._hinged:
            return reached, *minimise_energy(
                cells.energy(True, self._law), room, length, h, d, floor, full
            )

        def settle_heights(which: Floats, energy: CrimpEnergy, low: Floats, high: Floats) -> None:
            chosen = np.flatnonzero(which)
            if len(chosen):
                arguments = (one.take(chosen, axis=-1) for one in (room, length, h, d, low, high))
                h[chosen], d[chosen] = minimise_energy(select_crossings(energy, chosen), *arguments)

        h = np.where(slack, bent, h)
        settle_heights(slack, cells.bending_energy(), full, full)
        h = np.where(slack, np.clip(h, *between), h)
        pulled = ~slack
        if not self._stretches or self._contact == 0.0:
            flat = np.flatnonzero(pulled & (floor < full))
            heights = taut_heights(
                *(one.take(flat, axis=-1) for one in (room, length, most, floor, cells.arcs))
            )
            both = heights[0] + heights[1]
            d[flat] = np.clip(both, floor[flat], full[flat])
            h[flat] = heights[0] * d[flat] / both
            settle_heights(pulled & (d <= floor), cells.energy(False, self._law), floor, floor)
        else:
            settle_heights(pulled, cells.energy(False, self._law), floor, full)
        return reached, h, d


def _check_tension(yarns: YarnMechanics, shape: tuple[int, ...]) -> Floats:
    """Compute EA at each crossing, and refuse impossible yarns."""
    tension = np.asarray(yarns.tension, np.float64)
    tension = tension if tension.ndim == 3 else tension.reshape(-1)[:, None, None]
    for key, values, right, allowed in (
        ("tension", tension, tension > 0.0, "more than 0 N"),
        ("contact", yarns.contact, yarns.contact >= 0.0, "0 N or more"),
        (
            "bending",
            yarns.bending,
            np.isfinite(yarns.bending) & (np.array(yarns.bending) >= 0.0),
            "0 N m2 or more",
        ),
        ("flattest", yarns.flattest, 0.0 < yarns.flattest <= 1.0, "more than 0, at most 1"),
    ):
        if not np.all(right):
            raise InputError("the value is out of range", key=key, value=values, allowed=allowed)
    if np.isinf(tension).any() and not np.isinf(tension).all():
        raise InputError(
            "either all yarns must stretch or none",
            key="tension",
            allowed="a finite EA for all yarns, or inf for all",
            cure="Give stiff yarns a large finite EA",
        )
    return np.broadcast_to(tension, (2, *shape))


def _split_by_spread(features: Floats, weights: Floats, most: int) -> list[Ints]:
    """Split rows into groups of small spread: the widest, across its longest axis, time by time."""

    def spread(rows: Ints) -> tuple[float, Floats]:
        mean = np.average(features[rows], axis=0, weights=weights[rows])
        off = np.sqrt(weights[rows])[:, None] * (features[rows] - mean)
        return float((off**2).sum()), off

    groups = [np.arange(len(features))]
    while len(groups) < most:
        spreads = [spread(rows) for rows in groups]
        widest = int(np.argmax([size for size, _ in spreads]))
        rows, off = groups[widest], spreads[widest][1]
        side = off @ np.linalg.svd(off, full_matrices=False)[2][0] > 0.0
        if side.all() or not side.any():
            break  # all rows of each group are equal
        groups[widest : widest + 1] = [rows[side], rows[~side]]
    return groups
