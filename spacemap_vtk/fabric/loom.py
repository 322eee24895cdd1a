"""The loom: threading, tie-up and treadling, and the drawdown that they weave."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

#: Shafts of each end, shafts of each treadle, treadles of each pick: 1-based numbers, one row each.
Rows = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Loom:
    """How a draft is set up on a loom.

    Parameters
    ----------
    threading : tuple of tuple of int
        For each end, the first end first, the shafts whose heddles it passes through, counted
        from 1; an empty row is an end that is not threaded.
    tieup : tuple of tuple of int
        For each treadle, the shafts tied to it.
    treadling : tuple of tuple of int
        For each pick, the first pick first, the treadles that are pressed.
    liftplan : tuple of tuple of int, optional
        For each pick, the shafts that move. Where it is given, it stands in for tie-up and
        treadling.
    rising : bool, optional
        True: a moved shaft rises (jack loom). False: it sinks (counterbalance).
    shafts, treadles : int, optional
        How many the loom has; never fewer than are used.
    """

    threading: Rows
    tieup: Rows = ()
    treadling: Rows = ()
    liftplan: Rows | None = None
    rising: bool = True
    shafts: int = 0
    treadles: int = 0

    def __post_init__(self) -> None:
        lifted = self.tieup if self.liftplan is None else self.liftplan
        object.__setattr__(self, "shafts", max(self.shafts, highest(self.threading, lifted)))
        treadles = max(self.treadles, len(self.tieup), highest(self.treadling))
        object.__setattr__(self, "treadles", treadles)

    def sheds(self) -> Rows:
        """Return the shafts that move at each pick.

        Returns
        -------
        tuple of tuple of int
            Sorted shaft numbers, one row per pick; empty where nothing moves.
        """
        if self.liftplan is not None:
            return self.liftplan
        tied = dict(enumerate(self.tieup, start=1))
        return tuple(
            tuple(sorted({shaft for treadle in pressed for shaft in tied.get(treadle, ())}))
            for pressed in self.treadling
        )

    def drawdown(self) -> NDArray[np.bool_]:
        """Weave the cloth.

        Returns
        -------
        numpy.ndarray
            (picks, ends) bool, True where the end lies over the pick. An end in no heddle is moved
            at no pick, and a pick without a shed moves no end: they float across the cloth.
        """
        sheds = self.sheds()
        distinct = list(dict.fromkeys(sheds))
        heddles = [len(shafts) for shafts in self.threading]
        end = np.repeat(np.arange(len(self.threading)), heddles)
        shaft = np.fromiter(chain.from_iterable(self.threading), np.intp, sum(heddles))
        moved = np.zeros((len(distinct), len(self.threading)), dtype=np.bool_)
        moves = np.zeros(self.shafts + 1, dtype=np.bool_)
        for row, shed in zip(moved, distinct, strict=True):
            chosen = list(shed)
            moves[chosen] = True
            row[end[moves[shaft]]] = True
            moves[chosen] = False
        number = {shed: index for index, shed in enumerate(distinct)}
        cloth = moved[[number[shed] for shed in sheds]]
        return cloth if self.rising else ~cloth

    @classmethod
    def from_drawdown(cls, drawdown: NDArray[np.bool_]) -> Loom:
        """Set up the smallest loom that weaves a drawdown.

        Ends that are always raised together share a shaft, and equal picks a treadle; both are
        numbered in the order in which they first appear.

        Parameters
        ----------
        drawdown : numpy.ndarray
            (picks, ends) bool, True where the end lies over the pick.

        Returns
        -------
        Loom
            A rising-shed loom with tie-up and treadling.
        """
        shaft_of_end, first_end = _numbered(drawdown.T)
        treadle_of_pick, first_pick = _numbered(drawdown)
        raised = drawdown[np.ix_(first_pick, first_end)]
        return cls(
            threading=tuple((shaft,) for shaft in shaft_of_end),
            tieup=tuple(tuple((np.flatnonzero(row) + 1).tolist()) for row in raised),
            treadling=tuple((treadle,) for treadle in treadle_of_pick),
        )


def highest(*rows: Iterable[tuple[int, ...]]) -> int:
    """Return the highest number in any row."""
    return max(chain.from_iterable(chain.from_iterable(rows)), default=0)


def _numbered(lines: NDArray[np.bool_]) -> tuple[list[int], list[int]]:
    """Number equal rows alike from 1; return each row's number, and each number's first row."""
    number: dict[bytes, int] = {}
    first: list[int] = []
    numbers: list[int] = []
    for index, line in enumerate(lines):
        code = line.tobytes()
        if code not in number:
            number[code] = len(number) + 1
            first.append(index)
        numbers.append(number[code])
    return numbers, first
