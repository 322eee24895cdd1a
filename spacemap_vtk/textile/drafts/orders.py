"""Orders of threads: which of the present threads stands at each place after an edit.

An order is an array of indices from 0. Applied to all values of the threads (marks, colours,
spacings), it inserts, removes, repeats and reverses ends or picks.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.ndarrays import Ints


def insert_order(count: int, before: int, added: int) -> Ints:
    """Insert threads that are copies of a neighbour.

    Parameters
    ----------
    count : int
        Number of present threads.
    before : int
        Thread before which they are inserted, from 0; `count` appends them.
    added : int
        Number of new threads.

    Returns
    -------
    (count + added,) ndarray of int
    """
    return np.insert(np.arange(count), before, np.full(added, min(before, count - 1)))


def delete_order(count: int, part: slice) -> Ints:
    """Remove the threads of a part.

    Parameters
    ----------
    count : int
        Number of present threads.
    part : slice
        Threads to remove.

    Returns
    -------
    (n,) ndarray of int
    """
    return np.delete(np.arange(count), part)


def reverse_order(count: int, part: slice) -> Ints:
    """Reverse the threads of a part; the others stay.

    Parameters
    ----------
    count : int
        Number of present threads.
    part : slice
        Threads to reverse.

    Returns
    -------
    (count,) ndarray of int
    """
    order = np.arange(count)
    order[part] = order[part][::-1]
    return order


def repeat_order(count: int, part: slice, times: int, mirrored: bool = False) -> Ints:
    """Repeat a part; the threads after it move on.

    Parameters
    ----------
    count : int
        Number of present threads.
    part : slice
        Threads to repeat.
    times : int
        How often they stand there afterwards.
    mirrored : bool
        Whether every second copy is reversed; the thread at a turn then stands only once.

    Returns
    -------
    (n,) ndarray of int

    Examples
    --------
    >>> repeat_order(4, slice(0, 3), times=2).tolist()
    [0, 1, 2, 0, 1, 2, 3]
    >>> repeat_order(3, slice(0, 3), times=3, mirrored=True).tolist()
    [0, 1, 2, 1, 0, 1, 2]
    """
    order = np.arange(count)
    repeated = order[part]
    copies = [
        repeated if not mirrored else (repeated, repeated[::-1])[number % 2][1:]
        for number in range(1, times)
    ]
    return np.concatenate([order[: part.start], repeated, *copies, order[part.stop :]])


def interleave_order(count: int, part: slice) -> Ints:
    """Insert a copy of each thread of a part after it.

    Parameters
    ----------
    count : int
        Number of present threads.
    part : slice
        Threads to double.

    Returns
    -------
    (n,) ndarray of int
    """
    order = np.arange(count)
    return np.repeat(order, 1 + np.isin(order, order[part]))
