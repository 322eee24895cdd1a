"""Edits of a whole loom: treadling from the threading, the other face, the turned draft."""

from __future__ import annotations

from dataclasses import replace

from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.drafts.loom import Loom, Rows


def weave_as_drawn_in(loom: Loom) -> Loom:
    """Press the treadles in the order of the threading, one pick for each end.

    Parameters
    ----------
    loom : Loom
        With tie-up and treadling.

    Returns
    -------
    Loom
        Whose treadling is its threading; it has at least as many treadles as shafts in use.

    Raises
    ------
    InputError
        The loom has a liftplan.
    """
    if loom.liftplan is not None:
        raise InputError(
            "a liftplan has no treadles", cure="Choose Treadles instead of Liftplan first"
        )
    return replace(loom, treadling=loom.threading)


def swap_faces(loom: Loom) -> Loom:
    """Set up a loom that weaves the same cloth with its reverse up.

    Parameters
    ----------
    loom : Loom
        Any loom.

    Returns
    -------
    Loom
        Its drawdown is the complement. Its tie-up or liftplan is inverted; if an end has not
        exactly one shaft or a pick not exactly one treadle, that is not enough, and its shed
        changes between rising and sinking instead.
    """
    lifted = loom.liftplan is not None
    single = all(len(row) == 1 for row in (*loom.threading, *(() if lifted else loom.treadling)))
    if not single:
        return replace(loom, rising=not loom.rising)
    # Shafts without ends need not move.
    used = sorted({shaft for row in loom.threading for shaft in row})
    if loom.liftplan is not None:
        return replace(loom, liftplan=_invert(loom.liftplan, used))
    ties = (*loom.tieup, *((),) * (loom.treadles - len(loom.tieup)))
    return replace(loom, tieup=_invert(ties, used))


def turn_loom(loom: Loom) -> Loom:
    """Exchange warp and weft: the turned draft.

    Parameters
    ----------
    loom : Loom
        Any loom; a liftplan is converted to treadles first.

    Returns
    -------
    Loom
        Where an end lay over a pick, the pick that was this end now lies over the end that was
        this pick.
    """
    loom = loom.with_treadles
    ties: list[list[int]] = [[] for _ in range(loom.shafts)]
    for treadle, shafts in enumerate(loom.tieup, start=1):
        for shaft in shafts:
            ties[shaft - 1].append(treadle)
    turned = Loom(
        loom.treadling,
        tuple(map(tuple, ties)),
        loom.threading,
        rising=loom.rising,
        shafts=loom.treadles,
        treadles=loom.shafts,
    )
    return swap_faces(turned)


def exchange(loom: Loom, what: str, first: int, second: int) -> Loom:
    """Exchange two shafts or two treadles; the cloth stays the same.

    Parameters
    ----------
    loom : Loom
        Any loom.
    what : {"shaft", "treadle"}
        What is exchanged.
    first, second : int
        Their numbers, from 1.

    Returns
    -------
    Loom
        With the ends and ties of one shaft on the other one; or with the picks and ties of one
        treadle on the other one.
    """
    other = {first: second, second: first}

    def renumber(rows: Rows) -> Rows:
        return tuple(tuple(sorted(other.get(number, number) for number in row)) for row in rows)

    if what == "shaft":
        lifted = None if loom.liftplan is None else renumber(loom.liftplan)
        return replace(
            loom, threading=renumber(loom.threading), tieup=renumber(loom.tieup), liftplan=lifted
        )
    ties = [*loom.tieup, *[()] * (loom.treadles - len(loom.tieup))]
    ties[first - 1], ties[second - 1] = ties[second - 1], ties[first - 1]
    return replace(loom, treadling=renumber(loom.treadling), tieup=tuple(ties))


def _invert(rows: Rows, used: list[int]) -> Rows:
    return tuple(tuple(shaft for shaft in used if shaft not in row) for row in rows)
