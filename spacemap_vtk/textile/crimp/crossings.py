"""Crossings of a cloth as arrays, with all that decides how their yarns exchange crimp."""

from __future__ import annotations

from math import inf, isfinite, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.crimp.contact_law import ContactLaw
from spacemap_vtk.textile.crimp.crimp_energy import CrimpEnergy
from spacemap_vtk.textile.drafts.drawdown import repeat_size
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import solve_gaps, taut_height

#: Least straight share of a yarn's length at rest in formulas for bending: a jammed yarn bends too.
_STRAIGHT = 0.05
#: Least room in a gap, as a share of D; the formulas for angles need some.
_LEAST_ROOM = 1e-9
#: Least contact stiffness, as a share of the yarns' stiffness; it fixes D if nothing else does.
_LEAST_CONTACT = 1e-12


class Crossings(NamedTuple):
    """Crossings of a cloth: arrays (2, n), families first, or (n,)."""

    gap_spacing: Floats
    """Spacing of the gap in which the yarn changes side; 0 for a yarn that never does."""
    flat: Floats
    """Part of the spacing that is flat."""
    floats: Floats
    """Length of floats for each gap with a change of side."""
    length: Floats
    """Length of the yarn in the gap at rest, without the flat."""
    full_length: Floats
    """The same with flat and floats."""
    spacing: Floats
    is_straight: Floats
    """Whether the yarn never changes side."""
    theta: Floats
    """Angle at rest."""
    tension: Floats
    """EA over the whole length, times this crossing's share; EA is 1 N if yarns do not stretch."""
    hinge: Floats
    """6 B D (s/l)²/l at rest, times this crossing's share; B is 1 if it is not known."""
    gain: Floats
    """Derivative of h1 at rest by the stretch along each family, where bending alone decides."""
    jam: Floats
    """Stretch at which the yarn, at its length at rest, has no straight part."""
    largest_height: Floats
    """Height of the yarn at that stretch, its largest."""
    arcs: Floats
    """Sum of the radii of a gap's arcs over D; 1 where round yarns are crossed."""
    rest_distance: Floats
    """(n,) D at rest."""
    least_distance: Floats
    """(n,) Least D."""
    rest_height: Floats
    """(n,) h1 at rest."""
    contact: Floats
    """(n,) k_D over D at rest; 0 for hard contact."""

    def room_and_length(self, stretch: Floats) -> tuple[Floats, Floats]:
        """Compute the room for the arcs of each gap, and the yarn length that is left for it."""
        return (
            np.maximum(self.gap_spacing * stretch - self.flat, _LEAST_ROOM * self.rest_distance),
            self.length + self.floats * (1.0 - stretch),
        )

    def reach_stretch(self, stretch: Floats) -> tuple[Floats, Floats]:
        """Compute the stretch that crossings reach, and the heights that D at rest allows there."""
        room, length = self.room_and_length(stretch)
        full = np.broadcast_to(self.rest_distance, room.shape)
        height = taut_height(room, length, self.arcs * full)
        # A jammed yarn leaves the other one at least this height.
        needed = np.clip(full - height[::-1], 0.0, self.largest_height)
        own = np.where(self.gap_spacing > 0.0, self.gap_spacing, 1.0)
        jam = (np.sqrt(needed * (2.0 * self.arcs * full - needed)) + self.flat) / own
        jam = np.where(self.gap_spacing > 0.0, np.minimum(jam, self.jam), -inf)
        jammed = stretch < jam
        return np.where(jammed, jam, stretch), np.where(jammed, needed, height)

    def energy(self, hinged: bool, law: ContactLaw) -> CrimpEnergy:
        """Build the energy of the crossings, with or without bending."""
        hinge = self.hinge if hinged else np.zeros_like(self.hinge)
        tension = np.where(self.is_straight, 0.0, self.tension)
        contact = np.maximum(self.contact, _LEAST_CONTACT * tension.max(axis=0))
        at_rest = self.theta, self.rest_distance, self.arcs
        return CrimpEnergy(tension, contact, hinge, *at_rest, law)

    def bending_energy(self) -> CrimpEnergy:
        """Build the energy of bending alone, which decides where yarns are slack."""
        zero = np.zeros_like(self.hinge)
        return CrimpEnergy(zero, zero[0], self.hinge, self.theta, self.rest_distance, self.arcs)


def build_crossings(
    cloth: Cloth, tension: Floats, contact: float, bending: tuple[float, float], flattest: float
) -> tuple[Crossings, Floats]:
    """Compute the crossings of a cloth, and the area of each."""
    (warp, weft), shape = cloth.yarns, (2, *cloth.drawdown.shape)
    full = np.add.outer(weft.diameter, warp.diameter)
    rest, arcs = 2.0 * cloth.rest_heights, cloth.arc_ratios * full
    along = _mean_spacing_around(weft.spacing, cloth.families[0].crossed)
    across = _mean_spacing_around(warp.spacing, cloth.families[1].crossed)

    def spread(of_picks: ArrayLike, of_ends: ArrayLike) -> Floats:
        """Spread values of picks (for the warp) and ends (for the weft) over all crossings."""
        result = np.empty(shape)
        result[0], result[1] = np.asarray(of_picks)[:, None], of_ends
        return result

    spacing = spread(along, across)
    # Where thick yarns lie among thin ones, a crossing that is repeated may be tighter than any
    # gap of the cloth.
    flat = np.minimum(spread(weft.flat, warp.flat), spacing - np.sqrt(rest * (2.0 * arcs - rest)))
    share, float_ = np.empty((2, *shape))
    share[0], share[1] = (
        _floats_per_change(cloth.drawdown),
        _floats_per_change(cloth.drawdown.T)[:, None],
    )
    float_[0] = _float_spacing(cloth.drawdown, weft.spacing, along)
    float_[1] = _float_spacing(cloth.drawdown.T, warp.spacing, across).T
    loose = np.isinf(share)
    # A yarn that never changes side bends nowhere: its gap is always wide enough, and it never
    # reaches its length.
    floats, own = float_ * np.where(loose, 0.0, share), np.where(loose, 0.0, spacing)
    flat = np.where(loose, -10.0 * full, flat)
    gap = solve_gaps(own - flat, rest, arcs)
    length = np.where(loose, 1e3 * full, gap.length)
    whole = np.where(loose, spacing, length + flat + floats)
    stiffness = np.array(bending if any(bending) else (1.0, 1.0))[:, None, None]
    # Each crossing gets this share of a gap with its floats.
    part = np.where(loose, 1.0, own / np.where(loose, 1.0, own + floats))
    straight = np.maximum(gap.straight / gap.length, _STRAIGHT)
    hinge = np.where(loose, 0.0, part * 6.0 * stiffness * full * straight**2 / gap.length)
    # Both angles stay as close as possible to those at rest.
    give = hinge * gap.cos / (straight * gap.length) ** 2
    gain = own * give * gap.sin / np.maximum((give * gap.cos).sum(axis=0), 1e-300)
    gain[1] *= -1.0
    hard = not isfinite(contact)
    jam, most = _find_jam(own, flat, floats, length, arcs)
    most = np.where(loose, full, most)
    pull = part * np.where(np.isinf(tension), 1.0, tension) / whole
    yarns = (
        own,
        flat,
        floats,
        length,
        whole,
        spacing,
        loose,
        gap.theta,
        pull,
        hinge,
        gain,
        jam,
        most,
        cloth.arc_ratios,
    )
    single = (
        full,
        full * (1.0 if hard else flattest),
        rest[0],
        np.zeros_like(full) if hard else contact / full,
    )
    return (
        Crossings(
            *(array.reshape(2, -1) for array in yarns),
            *(one.ravel() for one in single),
        ),
        np.multiply.outer(along, across),
    )


def _find_jam(
    own: Floats, flat: Floats, floats: Floats, length: Floats, arcs: Floats
) -> tuple[Floats, Floats]:
    """Find stretch and height at which a yarn of given length has no straight part left."""
    stretch = np.ones_like(own)
    # Floats release length as they get shorter. The function is convex, so Newton's method
    # converges from above.
    for _ in range(30 if floats.any() else 2):
        angle = np.minimum((length + floats * (1.0 - stretch)) / arcs, 0.5 * pi)
        rest = own * stretch - flat - arcs * np.sin(angle)
        step = rest / np.where(own > 0.0, own + floats * np.cos(angle), inf)
        stretch -= step
        if np.abs(step).max() < 1e-15:
            break
    angle = np.minimum((length + floats * (1.0 - stretch)) / arcs, 0.5 * pi)
    return stretch, arcs * (1.0 - np.cos(angle))


def _floats_per_change(drawdown: Bools) -> Floats:
    """Compute, for the yarn of each column, the gaps without a change of side per gap with one."""
    period = repeat_size(drawdown)[1]
    line = drawdown[:period]
    changes = np.count_nonzero(line != np.roll(line, 1, axis=0), axis=0)
    with np.errstate(divide="ignore"):
        share: Floats = (period - changes) / changes
    return share


def _float_spacing(drawdown: Bools, spacing: Floats, around: Floats) -> Floats:
    """Compute the mean spacing in the floats of each column's yarn; if all agree, the local one."""
    if not len(spacing) or np.ptp(spacing) == 0.0:
        return np.broadcast_to(around[:, None], drawdown.shape)
    same = drawdown[1:] == drawdown[:-1]
    same |= ~same.any(axis=0)
    return np.broadcast_to(spacing @ same / same.sum(axis=0), drawdown.shape)


def _mean_spacing_around(spacing: Floats, alone: float) -> Floats:
    """Compute the mean spacing on both sides of each yarn."""
    if not len(spacing):
        return np.array([alone])
    return 0.5 * (np.append(spacing, spacing[-1]) + np.append(spacing[0], spacing))
