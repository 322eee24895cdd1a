"""Changing a loom by hand: another heddle, another tie, another treadle.

Every function returns a new loom; ends, picks, shafts and treadles are counted from 1, as weavers
do and as `Loom` has them.
"""

from __future__ import annotations

from dataclasses import replace

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.loom import Loom, Rows, highest


def threaded(loom: Loom, end: int, shafts: tuple[int, ...]) -> Loom:
    """Thread an end.

    Parameters
    ----------
    loom : Loom
        The loom.
    end : int
        Which end.
    shafts : tuple of int
        The shafts whose heddles it passes through; none: it floats.

    Returns
    -------
    Loom
        With more shafts, if these are beyond its last one.

    Raises
    ------
    InputError
        If there is no such end or shaft.
    """
    return replace(loom, threading=_put(loom.threading, end, shafts, "end"))


def treadled(loom: Loom, pick: int, pressed: tuple[int, ...]) -> Loom:
    """Choose what makes the shed of a pick.

    Parameters
    ----------
    loom : Loom
        The loom.
    pick : int
        Which pick.
    pressed : tuple of int
        Treadles; with a liftplan, shafts.

    Returns
    -------
    Loom
        With more treadles or shafts, if these are beyond the last one.

    Raises
    ------
    InputError
        If there is no such pick or treadle.
    """
    if loom.liftplan is not None:
        return replace(loom, liftplan=_put(loom.liftplan, pick, pressed, "pick"))
    return replace(loom, treadling=_put(loom.treadling, pick, pressed, "pick"))


def tied(loom: Loom, treadle: int, shafts: tuple[int, ...]) -> Loom:
    """Tie shafts to a treadle.

    Parameters
    ----------
    loom : Loom
        A loom without a liftplan.
    treadle : int
        Which treadle; it can be one that has no tie yet.
    shafts : tuple of int
        All shafts that it moves.

    Returns
    -------
    Loom
        The loom with that tie.

    Raises
    ------
    InputError
        If there is no such treadle or shaft, or the loom has a liftplan, and so no tie-up.
    """
    if loom.liftplan is not None:
        raise InputError(
            "a liftplan needs no tie-up", cure="Turn the liftplan into treadles first."
        )
    missing = loom.treadles - len(loom.tieup)
    ties = (*loom.tieup, *((),) * missing)
    return replace(loom, tieup=_put(ties, treadle, shafts, "treadle"))


def toggled(row: tuple[int, ...], number: int) -> tuple[int, ...]:
    """Put a number into a row, or take it out.

    Parameters
    ----------
    row : tuple of int
        Shafts or treadles.
    number : int
        Which.

    Returns
    -------
    tuple of int
        Sorted.

    Examples
    --------
    >>> toggled((1, 4), 3), toggled((1, 3, 4), 3)
    ((1, 3, 4), (1, 4))
    """
    return tuple(sorted(set(row) ^ {number}))


def sized(loom: Loom, shafts: int, treadles: int) -> Loom:
    """Give a loom more shafts and treadles, or take away such as are not used.

    Parameters
    ----------
    loom : Loom
        The loom.
    shafts, treadles : int
        How many it should have; never fewer than are used.

    Returns
    -------
    Loom
        The loom of that size.
    """
    ties = loom.tieup[: max(treadles, used(loom)[1])]
    return replace(loom, shafts=shafts, treadles=treadles, tieup=ties)


def used(loom: Loom) -> tuple[int, int]:
    """Return the highest shaft and treadle that are used.

    Parameters
    ----------
    loom : Loom
        The loom.

    Returns
    -------
    shafts, treadles : int
        A loom cannot have fewer.
    """
    lifted = loom.tieup if loom.liftplan is None else loom.liftplan
    ties = max((number for number, tie in enumerate(loom.tieup, start=1) if tie), default=0)
    return highest(loom.threading, lifted), max(ties, highest(loom.treadling))


def tiled(loom: Loom, ends: int, picks: int) -> Loom:
    """Repeat threading and treadling over a cloth of another size, and cut them off there."""
    return replace(
        loom,
        threading=_along(loom.threading, ends),
        treadling=_along(loom.treadling, picks),
        liftplan=None if loom.liftplan is None else _along(loom.liftplan, picks),
    )


def with_liftplan(loom: Loom) -> Loom:
    """Say for each pick which shafts move, in place of tie-up and treadling.

    Parameters
    ----------
    loom : Loom
        The loom.

    Returns
    -------
    Loom
        It weaves the same cloth, as a dobby or a table loom does.
    """
    return Loom(
        loom.threading, liftplan=loom.sheds(), rising=loom.rising, shafts=loom.shafts, treadles=0
    )


def with_treadles(loom: Loom) -> Loom:
    """Make a tie-up and a treadling of a liftplan.

    Parameters
    ----------
    loom : Loom
        The loom.

    Returns
    -------
    Loom
        With a treadle for each distinct shed, in the order in which they first appear; picks
        without a shed press none. It weaves the same cloth.
    """
    if loom.liftplan is None:
        return loom
    number: dict[tuple[int, ...], int] = {}
    treadling = []
    for row in loom.liftplan:
        shed = tuple(sorted(set(row)))
        treadling.append((number.setdefault(shed, len(number) + 1),) if shed else ())
    return Loom(
        loom.threading, tuple(number), tuple(treadling), rising=loom.rising, shafts=loom.shafts
    )


def _along(rows: Rows, count: int) -> Rows:
    return tuple(rows[i % len(rows)] for i in range(count)) if rows else rows


def _put(rows: Rows, number: int, row: tuple[int, ...], what: str) -> Rows:
    if not 1 <= number <= len(rows):
        raise InputError(f"there is no {what} {number}", allowed=f"1 to {len(rows)}")
    if any(n < 1 for n in row):
        raise InputError(f"{row} at {what} {number} is no row of numbers", allowed="from 1 on")
    return (*rows[: number - 1], tuple(sorted(set(row))), *rows[number:])
