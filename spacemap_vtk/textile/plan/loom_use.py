"""What a project needs of the loom: heddles, treadles, order of colours, selvedges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spacemap_vtk.ndarrays import Bools, Bytes, Ints
from spacemap_vtk.textile.drafts.loom import Loom

#: An edge end that the weft does not bind within so many picks needs a floating selvedge.
_LONGEST_LOOSE = 4

Color = tuple[int, int, int]


@dataclass(frozen=True)
class Step:
    """What a weaver does at a pick: the pressed treadles, or the lifted shafts."""

    #: Numbers of treadles or shafts, from 1.
    pressed: tuple[int, ...]
    #: Number of picks.
    picks: int


def count_heddles(loom: Loom, ends: int) -> dict[int, int]:
    """Count the heddles on each shaft of a loom whose threading is repeated over the ends."""
    rounds, rest = divmod(ends, len(loom.threading))
    counts: Counter[int] = Counter()
    for number, shafts in enumerate(loom.threading):
        for shaft in shafts:
            counts[shaft] += rounds + (number < rest)
    return {shaft: counts[shaft] for shaft in range(1, loom.shafts + 1)}


def count_steps(loom: Loom, picks: int, pieces: int = 1) -> list[Step]:
    """Count how often each treadle, or each lift, is used in all pieces."""
    # Treadles that are pressed together are one step. Each piece begins with the first pick.
    rows = loom.treadling if loom.liftplan is None else loom.liftplan
    rounds, rest = divmod(picks, len(rows))
    counts: Counter[tuple[int, ...]] = Counter()
    for number, row in enumerate(rows):
        if uses := rounds + (number < rest):
            counts[tuple(sorted(set(row)))] += uses
    return [Step(pressed, count * pieces) for pressed, count in sorted(counts.items())]


def color_order(colors: Bytes, kinds: Ints) -> list[tuple[Color, int]]:
    """Find the stripes of a warp or weft, of one colour and yarn: colour and number of threads."""
    differs = (colors[1:] != colors[:-1]).any(axis=1) | (kinds[1:] != kinds[:-1])
    changes = np.flatnonzero(differs) + 1
    begins = np.concatenate([[0], changes, [len(colors)]])
    return [
        (_rgb(colors[begin]), int(size))
        for begin, size in zip(begins[:-1], np.diff(begins), strict=True)
    ]


def _rgb(color: Sequence[int]) -> Color:
    red, green, blue = (int(part) for part in color)
    return red, green, blue


@dataclass(frozen=True)
class Edges:
    """Whether the weft binds the outer ends."""

    #: Whether an extra end at each side, which no shaft lifts, is needed.
    need_floating: bool
    #: Side from which the first pick must come, "left" or "right"; empty if it does not matter.
    start: str = ""


def check_edges(first: Bools, last: Bools, shuttles: int) -> Edges:
    """Check whether the weft binds the outer ends, given where they lie over the picks."""
    # The weft turns around an end that changes side between two picks. With one shuttle it turns at
    # each edge after every other pick; with several, an end must change side after every pick.
    # After an odd number of picks the shuttle starts the next repeat from the other side.
    left, right = (
        np.tile(end != np.roll(end, -1), 2 if len(end) % 2 else 1) for end in (first, last)
    )
    if left.all() and right.all():
        return Edges(False)
    if shuttles > 1:
        return Edges(True)
    good = [
        start
        for start, far, near in (("left", right, left), ("right", left, right))
        if _is_bound(far[0::2]) and _is_bound(near[1::2])
    ]
    return Edges(not good, good[0] if len(good) == 1 else "")


def _is_bound(turns: Bools) -> bool:
    """Return whether an edge end is bound at least every few picks."""
    bound = np.flatnonzero(turns)
    if not len(bound):
        return False
    gaps = np.diff(np.append(bound, bound[0] + len(turns)))
    return bool(2 * gaps.max() <= _LONGEST_LOOSE)
