"""Looms: threading, tie-up and treadling, the drawdown that they weave, and edits of them.

An edit returns a new loom. Ends, picks, shafts and treadles are counted from 1, as weavers do.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools

#: Shafts of each end, shafts of each treadle, or treadles of each pick: numbers from 1, a row each.
Rows = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Loom:
    """The set-up of a loom: threading, and tie-up and treadling or a liftplan.

    Parameters
    ----------
    threading : tuple of tuple of int
        For each end, first end first, the shafts whose heddles it passes through, counted from 1;
        an empty row is an end that is not threaded.
    tieup : tuple of tuple of int
        For each treadle, the shafts tied to it.
    treadling : tuple of tuple of int
        For each pick, first pick first, the treadles that are pressed.
    liftplan : tuple of tuple of int, optional
        For each pick, the shafts that move. It replaces tie-up and treadling.
    rising : bool, optional
        True: a moved shaft rises (jack loom). False: it sinks (counterbalance).
    shafts, treadles : int, optional
        Number of each on the loom; never fewer than are used.
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
        object.__setattr__(self, "shafts", max(self.shafts, highest_number(self.threading, lifted)))
        treadles = max(self.treadles, len(self.tieup), highest_number(self.treadling))
        object.__setattr__(self, "treadles", treadles)

    def sheds(self) -> Rows:
        """Find the shafts that move at each pick.

        Returns
        -------
        tuple of tuple of int
            Sorted shaft numbers, one row for each pick; empty where nothing moves.
        """
        if self.liftplan is not None:
            return self.liftplan
        tied = dict(enumerate(self.tieup, start=1))
        return tuple(
            tuple(sorted({shaft for treadle in pressed for shaft in tied.get(treadle, ())}))
            for pressed in self.treadling
        )

    def drawdown(self) -> Bools:
        """Compute the drawdown of the woven cloth.

        Returns
        -------
        numpy.ndarray
            (picks, ends) bool, True where the end lies over the pick. An end without a heddle moves
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
    def from_drawdown(cls, drawdown: Bools) -> Loom:
        """Set up the smallest loom that weaves a drawdown.

        Ends that are always raised together share a shaft, and equal picks share a treadle. Both
        are numbered in the order of first appearance.

        Parameters
        ----------
        drawdown : numpy.ndarray
            (picks, ends) bool, True where the end lies over the pick.

        Returns
        -------
        Loom
            A rising-shed loom with tie-up and treadling.
        """
        shaft_of_end, first_end = _number_rows(drawdown.T)
        treadle_of_pick, first_pick = _number_rows(drawdown)
        raised = drawdown[np.ix_(first_pick, first_end)]
        return cls(
            threading=tuple((shaft,) for shaft in shaft_of_end),
            tieup=tuple(tuple((np.flatnonzero(row) + 1).tolist()) for row in raised),
            treadling=tuple((treadle,) for treadle in treadle_of_pick),
        )

    def replace_threading(self, end: int, shafts: tuple[int, ...]) -> Loom:
        # An end without shafts floats. Shafts beyond the last one are added to the loom.
        return replace(self, threading=_replace_row(self.threading, end, shafts, "end"))

    def replace_treadling(self, pick: int, pressed: tuple[int, ...]) -> Loom:
        # `pressed` holds treadles, or shafts if there is a liftplan.
        name = "treadling" if self.liftplan is None else "liftplan"
        rows: Rows = getattr(self, name)
        return replace(self, **{name: _replace_row(rows, pick, pressed, "pick")})  # type: ignore[arg-type]

    def replace_tie(self, treadle: int, shafts: tuple[int, ...]) -> Loom:
        if self.liftplan is not None:
            raise InputError(
                "a loom with a liftplan has no tie-up",
                cure="Convert the liftplan to treadles first.",
            )
        # The treadle may have no tie yet.
        ties = (*self.tieup, *((),) * (self.treadles - len(self.tieup)))
        return replace(self, tieup=_replace_row(ties, treadle, shafts, "treadle"))

    @staticmethod
    def toggle(row: tuple[int, ...], number: int) -> tuple[int, ...]:
        # Add the shaft or treadle to the row, or remove it.
        return tuple(sorted(set(row) ^ {number}))

    def resize(self, shafts: int, treadles: int) -> Loom:
        # Tied treadles are kept.
        ties = self.tieup[: max(treadles, self.highest_used[1])]
        return replace(self, shafts=shafts, treadles=treadles, tieup=ties)

    @property
    def highest_used(self) -> tuple[int, int]:
        """Highest shaft and treadle in use: the loom needs at least that many."""
        lifted = self.tieup if self.liftplan is None else self.liftplan
        ties = max((number for number, tie in enumerate(self.tieup, start=1) if tie), default=0)
        return highest_number(self.threading, lifted), max(ties, highest_number(self.treadling))

    def repeat(self, ends: int, picks: int) -> Loom:
        # Repeat threading and treadling over a cloth of another size, and cut them off there.
        return replace(
            self,
            threading=_repeat_rows(self.threading, ends),
            treadling=_repeat_rows(self.treadling, picks),
            liftplan=None if self.liftplan is None else _repeat_rows(self.liftplan, picks),
        )

    @property
    def with_liftplan(self) -> Loom:
        """Equivalent loom with a liftplan, as for a dobby or a table loom."""
        return Loom(
            self.threading,
            liftplan=self.sheds(),
            rising=self.rising,
            shafts=self.shafts,
            treadles=0,
        )

    @property
    def with_treadles(self) -> Loom:
        """Equivalent loom with one treadle for each shed, in order of appearance."""
        if self.liftplan is None:
            return self
        number: dict[tuple[int, ...], int] = {}
        treadling = []
        for row in self.liftplan:
            shed = tuple(sorted(set(row)))
            treadling.append((number.setdefault(shed, len(number) + 1),) if shed else ())
        return Loom(
            self.threading, tuple(number), tuple(treadling), rising=self.rising, shafts=self.shafts
        )


def to_marks(rows: Iterable[Sequence[int]], columns: int) -> Bools:
    """Convert numbers to a grid of marks.

    Parameters
    ----------
    rows : sequence of sequence of int
        Numbers, from 1, of each row.
    columns : int
        Numbers that are larger get no mark.

    Returns
    -------
    (rows, columns) bool
        True where a row contains the number.
    """
    rows = list(rows)
    row = np.repeat(np.arange(len(rows)), [len(numbers) for numbers in rows])
    number = np.fromiter(chain.from_iterable(rows), np.intp)
    marks = np.zeros((len(rows), columns), bool)
    marks[row[number <= columns], number[number <= columns] - 1] = True
    return marks


def from_marks(marks: Bools) -> Rows:
    """Convert a grid of marks to numbers, the inverse of `to_marks`.

    Parameters
    ----------
    marks : (rows, columns) bool
        True where a row contains the number.

    Returns
    -------
    tuple of tuple of int
        Numbers, from 1, of each row.
    """
    return tuple(tuple((np.flatnonzero(row) + 1).tolist()) for row in marks)


def count_marks(rows: Rows, columns: int) -> tuple[int, ...]:
    """Count in how many rows each number occurs.

    Parameters
    ----------
    rows : tuple of tuple of int
        For each end the numbers of its shafts, or for each pick the numbers of its treadles.
    columns : int
        Number of shafts or treadles.

    Returns
    -------
    tuple of int
        Heddles on each shaft, or picks of each treadle.
    """
    numbers = np.fromiter(chain.from_iterable(map(set, rows)), np.intp)
    return tuple(np.bincount(numbers, minlength=columns + 1)[1:].tolist())


def highest_number(*rows: Iterable[tuple[int, ...]]) -> int:
    """Find the highest number in any row."""
    return max(chain.from_iterable(chain.from_iterable(rows)), default=0)


def _number_rows(lines: Bools) -> tuple[list[int], list[int]]:
    """Number distinct rows from 1; return each row's number and each number's first row."""
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


def _repeat_rows(rows: Rows, count: int) -> Rows:
    return tuple(rows[i % len(rows)] for i in range(count)) if rows else rows


def _replace_row(rows: Rows, number: int, row: tuple[int, ...], what: str) -> Rows:
    if not 1 <= number <= len(rows):
        raise InputError(f"{what} {number} does not exist", allowed=f"1 to {len(rows)}")
    if any(n < 1 for n in row):
        raise InputError(f"numbers at {what} {number} must be at least 1: {row}")
    return (*rows[: number - 1], tuple(sorted(set(row))), *rows[number:])
