"""Double weaves: two cloths in one draft, one above the other, that may change places.

Each end and each pick belongs to one of two cloths. Threads of one cloth interlace where they
cross. Where threads of different cloths cross, the thread of the upper cloth passes over. Where it
does not, the cloths are stitched, or change places (interchange). In some drafts only the threads
of one family change from one cloth to the other, while those of the other family stay above or
below. A yarn of a cloth that stays in place does not bend at yarns of the other cloth; it bends
only between the crossings of its own cloth.

Heights above the middle of both cloths; axes are D/2 = R apart where they touch:

- In the upper cloth all axes are at least H - h/2 high, in the lower one at most -(H - h/2).
  2 H - R exceeds R by at least a gap, so no yarn of one cloth can touch one of the other.
- Between two crossings of its own cloth, a yarn that changes cloths, or is stitched, passes every
  yarn of the other cloth at H - h/2 or at -(H - h/2). It is level there, on arcs of radius
  (1 + `LAYER_CLEARANCE`) R with centres beyond the highest point of the yarn that it passes. In
  gaps as wide as the sum of the radii all arcs turn by at most a right angle. An arc that does is a
  radius aside before it is as low as its centre, so the axis keeps that distance.

Source of the terms (double cloth, self-stitched; interchanging double plain): Z. Grosicki,
"Watson's Advanced Textile Design".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import inf

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import Bools, Ints
from spacemap_vtk.textile.weave.families import FAMILIES, QuantityNames, quantity_name
from spacemap_vtk.textile.weave.peirce import JAM
from spacemap_vtk.textile.weave.threads import Threads, YarnIndices
from spacemap_vtk.units import format_quantity

#: Yarns of different cloths are further apart than touching yarns by this share of R.
LAYER_CLEARANCE = 0.05
#: Ends and picks of the part that is searched for two cloths; the result holds for the whole.
_SEARCHED = 96
#: Longest repeat of an arrangement of threads that is tried: 1 to 1, 2 to 1, 2 to 2, 3 to 1.
_REPEAT = 4
#: Least number of ends and of picks in which two cloths can be recognised.
LEAST_YARNS = 2 * _REPEAT
#: Least share of threads that interlace with their cloth wherever it stays; the rest are edges of
#: blocks.
_LEAST_INTERLACED = 0.9
#: Least share of crossings with the other cloth at which the upper cloth lies on top; the rest are
#: stitches.
_LEAST_ON_TOP = 0.85
#: Least mean number of crossings of a cloth between two changes of place.
_LEAST_STAY = 2.0
#: Largest share of neighbouring crossings with the other cloth that disagree on the upper cloth.
_MOST_DISAGREEING = 0.6
#: Neighbours that are compared: offsets in picks and ends, and the direction along the ends.
_NEIGHBOURS = (1, 1, 1), (1, 1, -1), (0, 1, 1), (1, 0, 1), (0, 2, 1), (2, 0, 1)
#: Least number of crossings for each change of a yarn from one cloth to the other.
_CROSSINGS_PER_CHANGE = 8
#: Arrangements that are tried; the first thread belongs to the first cloth.
_ARRANGEMENTS = [
    np.array((False, *rest))
    for size in range(2, _REPEAT + 1)
    for rest in product((False, True), repeat=size - 1)
    if any(rest)
]


def one_layer_cure(names: QuantityNames = quantity_name) -> str:
    """Explain how to draw a double weave as one layer."""
    return f"set {names('layer', 0)} = 1 to draw one layer"


@dataclass(frozen=True, eq=False)
class Layers:
    """The two cloths of a double weave: which threads belong to each, and which is above.

    Parameters
    ----------
    drawdown : (picks, ends) ndarray of bool
        True: the end lies over the pick.
    ends, picks : ndarray of bool, optional
        Whether each thread belongs to the second cloth. One of the two may be None: then the second
        cloth is below everywhere, and the threads of that family change between the cloths.

    Examples
    --------
    Two plain weaves, the first above:

    >>> plain = np.indices((4, 4)).sum(axis=0) % 2 == 0
    >>> both = np.zeros((8, 8), dtype=bool)
    >>> both[::2, ::2], both[1::2, 1::2], both[1::2, ::2] = plain, plain, True
    >>> layers = Layers(both, np.arange(8) % 2 == 1, np.arange(8) % 2 == 1)
    >>> upper = layers.in_upper_cloth
    >>> bool(upper[::2, ::2].all()), bool(upper[1::2, 1::2].any()), layers.has_changes
    (True, False, (False, False))
    """

    drawdown: Bools
    ends: Bools | None
    picks: Bools | None

    @property
    def is_fixed(self) -> bool:
        """Whether every thread stays in one cloth."""
        return self.ends is not None and self.picks is not None

    @property
    def same_cloth(self) -> Bools:
        """(picks, ends) Whether both threads of a crossing belong to the same cloth there."""
        return self._crossings[0]

    @property
    def in_upper_cloth(self) -> Bools:
        """(picks, ends) Whether the cloth of both threads is the upper one; see `own`."""
        return self._crossings[1]

    def crop(self, ends: YarnIndices, picks: YarnIndices) -> Layers:
        """Select some neighbouring threads; all threads still decide which cloth is above.

        Parameters
        ----------
        ends, picks : slice or ndarray of int
            Selected threads.

        Returns
        -------
        Layers
            Layers of these threads.
        """
        part = Layers(
            self.drawdown[picks][:, ends],
            None if self.ends is None else self.ends[ends],
            None if self.picks is None else self.picks[picks],
        )
        # Threads that are cut off have decided too.
        part.__dict__["_crossings"] = (
            self.same_cloth[picks][:, ends],
            self.in_upper_cloth[picks][:, ends],
        )
        return part

    @cached_property
    def _crossings(self) -> tuple[Bools, Bools]:
        if self.ends is not None and self.picks is not None:
            own = self.picks[:, None] == self.ends
            return own, _vote_for_upper(self.drawdown, self.ends, self.picks)
        if self.picks is not None:
            own = _is_above_by_nearest(self.drawdown, self.picks) != self.picks[:, None]
            return own, np.broadcast_to(~self.picks[:, None], own.shape)
        assert self.ends is not None
        own = self.ends != _is_above_by_nearest(~self.drawdown.T, self.ends).T
        return own, np.broadcast_to(~self.ends, own.shape)

    def bends(self, number: int) -> Bools:
        # (yarns, crossings) The crossings at which ends (0) or picks (1) bend.
        return self._family_bends[number][0]

    @property
    def has_changes(self) -> tuple[bool, bool]:
        """Whether any end, and any pick, passes from one cloth to the other."""
        return self._family_bends[0][1], self._family_bends[1][1]

    def check_room(
        self,
        threads: tuple[Threads, Threads],
        gap: float | None,
        axis: str,
        names: QuantityNames = quantity_name,
    ) -> None:
        """Refuse yarns that have no room to pass from one cloth to the other."""
        cure = one_layer_cure(names)
        if axis != "arcs":
            raise InputError(
                "splines do not keep the two cloths of a double weave apart",
                key="axis",
                value=axis,
                allowed='"arcs"',
                cure=f"Leave axis out, or {cure}",
            )
        if gap is not None and not 0.0 < gap < inf:
            raise GeometryError(
                "the two cloths need a gap between them",
                key="layer_gap",
                value=gap,
                allowed="more than 0 m",
            )
        for number, (own, crossed) in enumerate((threads, threads[::-1])):
            room, between = crossed.gaps()
            if not (self.has_changes[number] and room.size):
                continue
            # With less room an arc would turn by more than a right angle.
            arcs = 2.0 * crossed.face_ratio * between + np.max(own.diameter)
            needed = (1.0 + LAYER_CLEARANCE) * arcs
            lack = needed - room
            if lack.max() > JAM * between.max():
                worst = int(np.argmax(lack))
                wanted, there = (
                    format_quantity(float(np.broadcast_to(x, lack.shape)[worst]), "m")
                    for x in (needed, room)
                )
                raise GeometryError(
                    "the two cloths of the double weave have no room to change places: the "
                    f"{FAMILIES[number]} needs {wanted} between neighbouring "
                    f"{FAMILIES[1 - number]} yarns, but has {there}",
                    key=names("diameter", number),
                    value=float(np.max(own.diameter)),
                    allowed="less"
                    if crossed.shape == "lenticular"
                    else f"{names('diameter', 0)} + {names('diameter', 1)} up to "
                    f"1 / {1.0 + LAYER_CLEARANCE:g} of that",
                    cure=f"Use thinner yarns or a larger spacing, or {cure}",
                )

    @cached_property
    def _family_bends(self) -> tuple[tuple[Bools, bool], tuple[Bools, bool]]:
        warp, weft = (self._find_bends(number) for number in (0, 1))
        return warp, weft

    def _find_bends(self, number: int) -> tuple[Bools, bool]:
        own, above = (
            (self.same_cloth, self.in_upper_cloth)
            if number
            else (self.same_cloth.T, self.in_upper_cloth.T)
        )
        upper = ~self.drawdown if number else self.drawdown.T
        before, after = _values_before_and_after(own, above)
        astray = ~own & ((upper != before) | (upper != after))
        # A yarn that never crosses its own cloth can only bend at the other one.
        astray |= ~own.any(axis=1, keepdims=True)
        leaps = own[:, 1:] & own[:, :-1] & (above[:, 1:] != above[:, :-1])
        if not astray.any():
            return own, bool(leaps.any())
        # Keep all crossings of a gap that contains a crossing astray.
        gap = np.cumsum(own, axis=1) + np.arange(len(own))[:, None] * (own.shape[1] + 1)
        marked = np.zeros(own.shape[0] * (own.shape[1] + 1), bool)
        marked[gap[astray]] = True
        return own | marked[gap], True


def _vote_for_upper(drawdown: Bools, ends: Bools, picks: Bools) -> Bools:
    """Decide from neighbouring threads whether the cloth of both threads of a crossing is above."""
    # The nearest threads of the other cloth vote, before and after, for both threads. At a corner
    # of a block the vote is two against two; then the voters that form pairs with them decide.
    over = np.where(drawdown, 1, -1).astype(np.int8)
    votes = np.zeros(over.shape, np.int8)
    for table, tally, crossed, weight in ((over, votes, picks, 2), (-over.T, votes.T, ends, 1)):
        for after in (False, True):
            line = crossed[::-1] if after else crossed
            beside = _last_of_other_cloth(line)
            there = (beside >= 0)[:, None]
            vote = table[:: -1 if after else 1][beside] * there
            partner = ((line == crossed[0]) == after)[:, None]
            tally[:: -1 if after else 1] += (4 + weight * partner) * vote
    return votes > 0


def _is_above_by_nearest(over: Bools, second: Bools) -> Bools:
    """Decide whether the columns' yarns are above, from the nearest thread that shows it."""
    # A yarn over a thread of the lower cloth, or under one of the upper, may be in either cloth.
    decisive = over != second[:, None]
    place = np.arange(len(over))[:, None]
    last = np.maximum.accumulate(np.where(decisive, place, -len(over)), axis=0)
    following = np.where(decisive, place, 2 * len(over))[::-1]
    following = np.minimum.accumulate(following, axis=0)[::-1]
    nearest = np.where(place - last <= following - place, last, following)
    return np.take_along_axis(over, nearest.clip(0, len(over) - 1), axis=0)


def _last_of_other_cloth(second: Bools) -> Ints:
    """Find for each thread the last thread of the other cloth before it, or -1."""
    place = np.arange(len(second))
    first, other = (np.maximum.accumulate(np.where(mine, place, -1)) for mine in (~second, second))
    return np.where(second, first, other)


def _values_before_and_after(own: Bools, above: Bools) -> tuple[Bools, Bools]:
    """Look up `above` at the own crossings before and after each place of a row."""
    count = own.shape[1]
    place = np.arange(count, dtype=np.int32)
    last = np.maximum.accumulate(np.where(own, place, np.int32(-1)), axis=1)
    following = np.where(own, place, np.int32(count))[:, ::-1]
    following = np.minimum.accumulate(following, axis=1)[:, ::-1]
    # Before the first own crossing and after the last one, that crossing counts for both sides.
    before = np.where(last < 0, following, last)
    after = np.where(following == count, last, following)
    np.clip(before, 0, count - 1, out=before)
    np.clip(after, 0, count - 1, out=after)
    return np.take_along_axis(above, before, axis=1), np.take_along_axis(above, after, axis=1)


def find_layers(
    drawdown: Bools, ends: Bools | None = None, picks: Bools | None = None
) -> Layers | None:
    """Find two cloths in a drawdown, or None; threads of the second cloth may be given."""
    if ends is not None and picks is not None:
        return Layers(drawdown, ends, picks)
    rows, columns = (
        slice(at, at + _SEARCHED)
        for at in (max((size - _SEARCHED) // 2, 0) // 12 * 12 for size in drawdown.shape)
    )
    part = drawdown[rows, columns]
    known = None if ends is None else ends[columns], None if picks is None else picks[rows]
    found = _find_arrangement(
        part.tobytes(), part.shape, *(None if one is None else one.tobytes() for one in known)
    )
    if found is None:
        return None
    whole = Layers(
        drawdown,
        *(
            given if given is not None or one is None else np.resize(one, size)
            for given, one, size in zip((ends, picks), found, drawdown.T.shape, strict=True)
        ),
    )
    return whole if _fitting_share(whole) > 0.0 else None


@lru_cache(maxsize=16)  # the window repeats its request whenever the yarns change
def _find_arrangement(
    crossings: bytes, shape: tuple[int, int], ends: bytes | None, picks: bytes | None
) -> tuple[Bools | None, Bools | None] | None:
    """Find the simplest arrangement of threads; among equals, the one that fits two cloths best."""
    drawdown = np.frombuffer(crossings, bool).reshape(shape)
    if min(shape) < LEAST_YARNS:
        return None
    turned = [*_ARRANGEMENTS, *(~one for one in _ARRANGEMENTS)]
    of_ends, of_picks = (
        turned if known is None else [np.frombuffer(known, bool)] for known in (ends, picks)
    )
    tried: list[tuple[Bools | None, Bools | None]] = []
    # If either cloth can be above, it makes no difference which one is called the first.
    tried += product(of_ends if picks is not None else of_ends[: len(_ARRANGEMENTS)], of_picks)
    tried += [(one, None) for one in of_ends if picks is None]
    tried += [(None, one) for one in of_picks if ends is None]
    most, best = 0.0, None
    for arranged in sorted(tried, key=_rank):
        if best is not None and _rank(arranged) > _rank(best):
            break
        one, other = (
            None if given is None else np.resize(given, size)
            for given, size in zip(arranged, shape[::-1], strict=True)
        )
        layers = Layers(drawdown, one, other)
        if _may_be_double(layers) and (share := _fitting_share(layers)) > most:
            most, best = share, arranged
    return best


def _rank(arranged: tuple[Bools | None, ...]) -> tuple[bool, int]:
    simple = all(one is not None for one in arranged)
    return not simple, max(len(one) for one in arranged if one is not None)


def _may_be_double(layers: Layers) -> bool:
    """Check quickly whether two cloths are possible at all."""
    ends, picks = layers.ends, layers.picks
    if ends is None or picks is None:
        above = layers.same_cloth == layers.in_upper_cloth  # for the yarns that change
        changes = np.count_nonzero(np.diff(above, axis=0 if ends is None else 1))
        return changes * _CROSSINGS_PER_CHANGE < above.size
    # Neighbouring crossings with the other cloth mostly agree on which cloth is above.
    other, first_above = picks[:, None] != ends, layers.drawdown ^ ends
    rows, columns = other.shape
    for up, aside, turn in _NEIGHBOURS:
        (one, two), (high, low) = (
            (table[up:, aside:], table[: rows - up, : columns - aside])
            for table in (other[:, ::turn], first_above[:, ::turn])
        )
        both = one & two
        if np.count_nonzero(both & (high ^ low)) > _MOST_DISAGREEING * np.count_nonzero(both):
            return False
    return True


def _fitting_share(layers: Layers) -> float:
    """Compute the share of crossings with the other cloth that fit two cloths; 0: none do."""
    share = 1.0
    for number in (0, 1):
        own, above = (
            (layers.same_cloth, layers.in_upper_cloth)
            if number
            else (layers.same_cloth.T, layers.in_upper_cloth.T)
        )
        upper = ~layers.drawdown if number else layers.drawdown.T
        before, after = _values_before_and_after(own, above)
        astray, of_other = (upper != before).astype(np.int8) + (upper != after), ~own
        if np.count_nonzero(of_other & (astray == 2)) > (1.0 - _LEAST_ON_TOP) * np.count_nonzero(
            of_other
        ):
            return 0.0
        place = np.flatnonzero(own)
        row, (high, over) = (
            place // own.shape[1],
            (table.ravel()[place] for table in (above, upper)),
        )
        same = row[1:] == row[:-1]
        stays = same & (high[1:] == high[:-1])
        if np.count_nonzero(same & ~stays) * _LEAST_STAY > len(place):
            return 0.0
        run = np.concatenate([[0], np.cumsum(~stays)])
        turns = np.bincount(run[1:][stays & (over[1:] != over[:-1])], minlength=len(place))
        woven = turns[run] > 0
        if high.all() or not high.any():
            return 0.0
        if min(woven[high].mean(), woven[~high].mean()) < _LEAST_INTERLACED:
            return 0.0
        share = min(share, 1.0 - float(astray[of_other].mean()) / 2.0)
    return share
