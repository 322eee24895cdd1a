"""Draws: the orders in which ends are threaded on shafts, or in which treadles are pressed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Ints


def make_draw(kind: str, count: int, first: int, last: int, *details: int) -> Ints:
    """Return the shaft or treadle of each thread in a draw.

    Parameters
    ----------
    kind : {"straight", "point", "broken", "advancing"}
        Straight: in order, again and again. Point: to the last shaft and back; neither turning
        point is doubled. Broken: runs that alternately rise and fall, each half the shafts away
        from the one before, so that a balanced twill has a clean cut (herringbone, dornik).
        Advancing: rising runs, each of which begins some shafts after the one before.
    count : int
        Number of threads. Of draws that do not fill the last repeat, the beginning is kept.
    first, last : int
        First and last shaft, counted from 1; if `first` is larger, the draw runs downwards.
    *details : int
        Straight: shafts from each thread to the next one (1), as in satins. Broken: threads in a
        run (0: as many as shafts). Advancing: threads in a run, and shafts to the next run (1).

    Returns
    -------
    (count,) ndarray of int

    Raises
    ------
    InputError
        A shaft is below 1, or a run has no threads.

    Examples
    --------
    >>> make_draw("straight", 6, 1, 4).tolist(), make_draw("straight", 5, 1, 5, 2).tolist()
    ([1, 2, 3, 4, 1, 2], [1, 3, 5, 2, 4])
    >>> make_draw("point", 8, 1, 4).tolist(), make_draw("broken", 4, 1, 4, 2).tolist()
    ([1, 2, 3, 4, 3, 2, 1, 2], [1, 2, 4, 3])
    >>> make_draw("advancing", 9, 1, 8, 3).tolist()
    [1, 2, 3, 2, 3, 4, 3, 4, 5]
    """
    if min(first, last) < 1:
        raise InputError(
            "shafts and treadles are counted from 1", key="first", value=min(first, last)
        )
    shafts = abs(last - first) + 1
    places = _DRAWS[kind](np.arange(count), shafts, *details) % shafts
    return first + places if first <= last else first - places


# Each of these functions returns places from 0 of threads from 0; places that exceed the number of
# shafts go on at the first one.


def _straight(threads: Ints, _shafts: int, step: int = 1) -> Ints:
    return step * threads


def _point(threads: Ints, shafts: int) -> Ints:
    highest = shafts - 1
    place = threads % max(2 * highest, 1)
    return np.minimum(place, 2 * highest - place)


def _broken(threads: Ints, shafts: int, run: int = 0) -> Ints:
    run = run or shafts
    number, place = np.divmod(threads, run)
    along = np.where(number % 2 == 1, run - 1 - place, place)
    return number * (shafts // 2) + along


def _advancing(threads: Ints, _shafts: int, run: int, advance: int = 1) -> Ints:
    if run < 1:
        raise InputError("a run needs threads", key="run", value=run, allowed="1 or more")
    number, place = np.divmod(threads, run)
    return number * advance + place


_DRAWS: dict[str, Callable[..., Ints]] = {
    "straight": _straight,
    "point": _point,
    "broken": _broken,
    "advancing": _advancing,
}


def network_draw(line: ArrayLike, shafts: int, initial: int) -> Ints:
    """Move a pattern line onto a network, so that any twill of `initial` shafts can be woven.

    Each thread moves up to the next shaft of the network, whose threads k, k + `initial`, … may
    be on shafts k, k + `initial`, … only. After the last shaft it goes on at the first.

    Parameters
    ----------
    line : (n,) array_like of int
        Shafts of the pattern line.
    shafts : int
        Number of shafts, a multiple of `initial`.
    initial : int
        Size of the initial, a straight draw.

    Returns
    -------
    (n,) ndarray of int

    Raises
    ------
    InputError
        The shafts are no multiple of the initial.

    Notes
    -----
    A. Schlein, *Network Drafting: An Introduction* (1994): the initial is repeated over the ends
    and, as a network, over the shafts.

    Examples
    --------
    >>> network_draw([1, 1, 2, 2, 3, 3, 4, 4], shafts=8, initial=4).tolist()
    [1, 2, 3, 4, 5, 6, 7, 4]
    """
    if initial < 1 or shafts % initial:
        raise InputError(
            f"a network on {shafts} shafts is not possible",
            key="initial",
            value=initial,
            allowed=f"numbers that divide {shafts}",
        )
    place = np.asarray(line, dtype=np.int64) - 1
    place = place + (np.arange(len(place)) - place) % initial
    return place % shafts + 1
