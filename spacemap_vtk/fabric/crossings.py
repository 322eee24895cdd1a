"""Crossings of a cloth in a row, each with what its two yarns have to exchange crimp with."""

from __future__ import annotations

from math import inf, isfinite, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.crimp_energy import CrimpEnergy
from spacemap_vtk.fabric.drawdown import repeat
from spacemap_vtk.fabric.peirce import bend, taut_height
from spacemap_vtk.ndarrays import Bools, Floats

#: Least share of a yarn's length that is straight at rest, to bending: in a jam it bends, too.
_STRAIGHT = 0.05
#: Least room in a gap, over D: angles need some.
_LEAST_ROOM = 1e-9
#: Over what yarns resist with: contact that keeps D where nothing else says how much it is.
_LEAST_CONTACT = 1e-12


class Crossings(NamedTuple):
    """Crossings in a row: arrays (2, n), families first, or (n,)."""

    own: Floats
    """Spacing, where the yarn changes side; 0 for one that never does."""
    flat: Floats
    """What of it is flat."""
    floats: Floats
    """Length of floats for each such gap."""
    length: Floats
    """Of the yarn in the gap at rest, less the flat."""
    whole: Floats
    """The same with flat and floats."""
    spacing: Floats
    loose: Floats
    """Whether the yarn never changes side."""
    theta: Floats
    """At rest."""
    tension: Floats
    """EA over the whole length, a crossing's part of it; of yarns that do not stretch EA is 1 N."""
    hinge: Floats
    """6 B D (s/l)²/l at rest, where B is known, else that of 1; a crossing's part of it."""
    gain: Floats
    """What h1 at rest gains with the stretch along each family, where bending alone decides."""
    jam: Floats
    """Stretch at which the yarn of its own length has no straight part."""
    most: Floats
    """Its height there: it has no greater one."""
    full: Floats
    """(n,) D at rest."""
    floor: Floats
    """(n,) Least D."""
    rest: Floats
    """(n,) h1 at rest."""
    contact: Floats
    """(n,) k_D over D at rest; 0 where contact is hard."""

    def asked(self, stretch: Floats) -> tuple[Floats, Floats]:
        """Return the room for the gap's arcs, and the length that its yarn has for it."""
        return (
            np.maximum(self.own * stretch - self.flat, _LEAST_ROOM * self.full),
            self.length + self.floats * (1.0 - stretch),
        )

    def held(self, stretch: Floats) -> tuple[Floats, Floats]:
        """Return the stretch at which crossings stand, and heights that D at rest allows there."""
        room, length = self.asked(stretch)
        full = np.broadcast_to(self.full, room.shape)
        height = taut_height(room, length, full)
        # a yarn that is jammed leaves the other one no less than this
        needed = np.clip(full - height[::-1], 0.0, self.most)
        own = np.where(self.own > 0.0, self.own, 1.0)
        jam = (np.sqrt(needed * (2.0 * full - needed)) + self.flat) / own
        jam = np.where(self.own > 0.0, np.minimum(jam, self.jam), -inf)
        jammed = stretch < jam
        return np.where(jammed, jam, stretch), np.where(jammed, needed, height)

    def energy(self, hinged: bool) -> CrimpEnergy:
        """Return the crossings' energy, with or without bending."""
        hinge = self.hinge if hinged else np.zeros_like(self.hinge)
        tension = np.where(self.loose, 0.0, self.tension)
        contact = np.maximum(self.contact, _LEAST_CONTACT * tension.max(axis=0))
        return CrimpEnergy(tension, contact, hinge, self.theta, self.full)

    def bending(self) -> CrimpEnergy:
        """Return the energy of bending alone, which decides where yarns are slack."""
        zero = np.zeros_like(self.hinge)
        return CrimpEnergy(zero, zero[0], self.hinge, self.theta, self.full)


def crossings(
    cloth: Cloth, tension: Floats, contact: float, bending: tuple[float, float], flattest: float
) -> tuple[Crossings, Floats]:
    """Return the crossings of a cloth, and the area of each."""
    (warp, weft), shape = cloth.yarns, (2, *cloth.drawdown.shape)
    full = np.add.outer(weft.diameter, warp.diameter)
    rest = np.array(cloth.shares)[:, None, None] * full
    along = _around(weft.spacing, cloth.families[0].crossed)
    across = _around(warp.spacing, cloth.families[1].crossed)

    def each(of_picks: ArrayLike, of_ends: ArrayLike) -> Floats:
        """Put what picks are to the warp, and ends to the weft, at all crossings."""
        result = np.empty(shape)
        result[0], result[1] = np.asarray(of_picks)[:, None], of_ends
        return result

    spacing = each(along, across)
    # thick among thin, a crossing that is repeated may be tighter than any gap of the cloth
    flat = np.minimum(each(weft.flat, warp.flat), spacing - np.sqrt(rest * (2.0 * full - rest)))
    share, float_ = np.empty((2, *shape))
    share[0], share[1] = _floats(cloth.drawdown), _floats(cloth.drawdown.T)[:, None]
    float_[0] = _float_spacing(cloth.drawdown, weft.spacing, along)
    float_[1] = _float_spacing(cloth.drawdown.T, warp.spacing, across).T
    loose = np.isinf(share)
    # such a yarn bends nowhere: a gap that is always wide, for a length that is never reached
    floats, own = float_ * np.where(loose, 0.0, share), np.where(loose, 0.0, spacing)
    flat = np.where(loose, -10.0 * full, flat)
    gap = bend(own - flat, rest, full)
    length = np.where(loose, 1e3 * full, gap.length)
    whole = np.where(loose, spacing, length + flat + floats)
    stiffness = np.array(bending if any(bending) else (1.0, 1.0))[:, None, None]
    # of a gap with its floats so much falls to each crossing
    part = np.where(loose, 1.0, own / np.where(loose, 1.0, own + floats))
    straight = np.maximum(gap.straight / gap.length, _STRAIGHT)
    hinge = np.where(loose, 0.0, part * 6.0 * stiffness * full * straight**2 / gap.length)
    # both angles stay as near to those at rest as they can
    give = hinge * gap.cos / (straight * gap.length) ** 2
    gain = own * give * gap.sin / np.maximum((give * gap.cos).sum(axis=0), 1e-300)
    gain[1] *= -1.0
    hard = not isfinite(contact)
    jam, most = _jam(own, flat, floats, length, full)
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
    )
    single = (
        full,
        full * (1.0 if hard else flattest),
        rest[0],
        np.zeros_like(full) if hard else contact / full,
    )
    return (
        Crossings(*(array.reshape(2, -1) for array in yarns), *(one.ravel() for one in single)),
        np.multiply.outer(along, across),
    )


def _jam(
    own: Floats, flat: Floats, floats: Floats, length: Floats, full: Floats
) -> tuple[Floats, Floats]:
    """Return stretch and height at which a yarn of its own length has no straight part left."""
    stretch = np.ones_like(own)
    # its floats give it more length as they get shorter: convex, and Newton's method comes down
    for _ in range(30 if floats.any() else 2):
        angle = np.minimum((length + floats * (1.0 - stretch)) / full, 0.5 * pi)
        rest = own * stretch - flat - full * np.sin(angle)
        step = rest / np.where(own > 0.0, own + floats * np.cos(angle), inf)
        stretch -= step
        if np.abs(step).max() < 1e-15:
            break
    angle = np.minimum((length + floats * (1.0 - stretch)) / full, 0.5 * pi)
    return stretch, np.where(own > 0.0, full * (1.0 - np.cos(angle)), full)


def _floats(drawdown: Bools) -> Floats:
    """Return the gaps without a change of side for each gap with one, of each column's yarn."""
    period = repeat(drawdown)[1]
    line = drawdown[:period]
    changes = np.count_nonzero(line != np.roll(line, 1, axis=0), axis=0)
    with np.errstate(divide="ignore"):
        share: Floats = (period - changes) / changes
    return share


def _float_spacing(drawdown: Bools, spacing: Floats, around: Floats) -> Floats:
    """Return the mean spacing in the floats of each column's yarn; that at each where all agree."""
    if not len(spacing) or np.ptp(spacing) == 0.0:
        return np.broadcast_to(around[:, None], drawdown.shape)
    same = drawdown[1:] == drawdown[:-1]
    same |= ~same.any(axis=0)
    return np.broadcast_to(spacing @ same / same.sum(axis=0), drawdown.shape)


def _around(spacing: Floats, alone: float) -> Floats:
    """Return the mean spacing on both sides of each yarn."""
    if not len(spacing):
        return np.array([alone])
    return 0.5 * (np.append(spacing, spacing[-1]) + np.append(spacing[0], spacing))
