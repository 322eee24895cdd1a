"""Draws: the orders in which ends are threaded on shafts, or in which treadles are pressed.

Each function returns the numbers, counted from 1, of `count` threads. `first` may be larger than
`last`; the draw then runs downwards. Of draws that do not fill the last repeat, the beginning is
kept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Ints


def straight_draw(count: int, first: int, last: int, step: int = 1) -> Ints:
    """Draw through the shafts in order, or with a step as in satins.

    Parameters
    ----------
    count : int
        Number of threads.
    first, last : int
        First and last shaft, or treadle.
    step : int
        Shafts from each thread to the next one, after the last shaft again from the first.

    Returns
    -------
    (count,) ndarray of int

    Examples
    --------
    >>> straight_draw(6, 1, 4).tolist(), straight_draw(5, 1, 5, step=2).tolist()
    ([1, 2, 3, 4, 1, 2], [1, 3, 5, 2, 4])
    """
    return _as_numbers(step * np.arange(count), first, last)


def point_draw(count: int, first: int, last: int) -> Ints:
    """Draw to the last shaft and back; neither turning point is doubled.

    Parameters
    ----------
    count : int
        Number of threads.
    first, last : int
        First and last shaft, or treadle.

    Returns
    -------
    (count,) ndarray of int

    Examples
    --------
    >>> point_draw(8, 1, 4).tolist()
    [1, 2, 3, 4, 3, 2, 1, 2]
    """
    highest = abs(last - first)
    place = np.arange(count) % max(2 * highest, 1)
    return _as_numbers(np.minimum(place, 2 * highest - place), first, last)


def broken_draw(count: int, first: int, last: int, run: int = 0) -> Ints:
    """Draw runs that alternately rise and fall, each half the shafts away from the one before.

    With a balanced twill the threads at each break lie opposite each other, so the twill has a
    clean cut: herringbone, or dornik. Runs of two on four shafts are broken twill, 1 2 4 3.

    Parameters
    ----------
    count : int
        Number of threads.
    first, last : int
        First and last shaft, or treadle.
    run : int
        Threads of a run; 0: as many as shafts.

    Returns
    -------
    (count,) ndarray of int

    Examples
    --------
    >>> broken_draw(8, 1, 4).tolist(), broken_draw(4, 1, 4, run=2).tolist()
    ([1, 2, 3, 4, 2, 1, 4, 3], [1, 2, 4, 3])
    """
    shafts = abs(last - first) + 1
    run = run or shafts
    number, place = np.divmod(np.arange(count), run)
    falls = number % 2 == 1
    along = np.where(falls, run - 1 - place, place)
    return _as_numbers(number * (shafts // 2) + along, first, last)


def advancing_draw(count: int, first: int, last: int, run: int, advance: int = 1) -> Ints:
    """Draw rising runs, each of which begins some shafts after the beginning of the one before.

    Parameters
    ----------
    count : int
        Number of threads.
    first, last : int
        First and last shaft, or treadle; after the last one the runs go on at the first.
    run : int
        Threads of a run.
    advance : int
        Shafts from the beginning of a run to the beginning of the next one.

    Returns
    -------
    (count,) ndarray of int

    Examples
    --------
    >>> advancing_draw(9, 1, 8, run=3).tolist()
    [1, 2, 3, 2, 3, 4, 3, 4, 5]
    """
    if run < 1:
        raise InputError("a run needs threads", key="run", value=run, allowed="1 or more")
    number, place = np.divmod(np.arange(count), run)
    return _as_numbers(number * advance + place, first, last)


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


def _as_numbers(place: Ints, first: int, last: int) -> Ints:
    """Convert places, from 0 and repeated after the last shaft, to numbers of shafts."""
    if min(first, last) < 1:
        raise InputError(
            "shafts and treadles are counted from 1", key="first", value=min(first, last)
        )
    place = place % (abs(last - first) + 1)
    return first + place if first <= last else first - place
