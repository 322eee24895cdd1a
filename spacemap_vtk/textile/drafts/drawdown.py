"""Drawdowns: matrices that define which yarn lies on top at each crossing.

A drawdown has a row for each pick (weft yarn) and a column for each end (warp yarn), first pick
and first end first; True: the end lies over the pick. Seen from above (from +z) the first pick is
at the bottom and the first end at the left.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools


def from_matrix(matrix: Sequence[str | Sequence[int]] | NDArray) -> Bools:
    """Convert rows of 0 and 1 to a drawdown.

    Parameters
    ----------
    matrix : sequence of str, or of sequences of int
        A row for each pick, the first pick and the first end first.

    Returns
    -------
    (picks, ends) ndarray of bool
        True: the end lies over the pick.

    Raises
    ------
    InputError
        There are no rows, rows have different lengths, or they contain anything but 0 and 1.
    """
    # A string is also a sequence of strings; it would be read as a cloth of one end.
    if isinstance(matrix, str) or not isinstance(matrix, (Sequence, np.ndarray)) or not len(matrix):
        raise InputError(
            "a drawdown needs at least one row", key="matrix", value=matrix, allowed='["10", "01"]'
        )
    result: list[list[object]] = []
    for number, row in enumerate(matrix, start=1):
        if not isinstance(row, (str, Sequence, np.ndarray)) or not len(row):
            raise _row_error(number, row, "must consist of 0 and 1")
        cells = [{"0": 0, "1": 1}.get(c, c) for c in row] if isinstance(row, str) else list(row)
        for column, cell in enumerate(cells, start=1):
            if not np.isscalar(cell) or cell not in (0, 1):
                raise _row_error(number, row, f"has {cell!r} at end {column}")
        if result and len(cells) != len(result[0]):
            raise _row_error(number, row, f"has {len(cells)} ends, but row 1 has {len(result[0])}")
        result.append(cells)
    return np.array(result, dtype=bool)


def tile_drawdown(matrix: ArrayLike, ends: int, picks: int) -> Bools:
    """Repeat a drawdown over a cloth, and cut it off at the far edges.

    Parameters
    ----------
    matrix : (rows, columns) array_like
        Drawdown of one repeat.
    ends, picks : int
        Numbers of ends and picks of the cloth.

    Returns
    -------
    (picks, ends) ndarray of bool
        Drawdown of the cloth.
    """
    unit = as_drawdown(matrix)
    check_counts(ends=ends, picks=picks)
    return unit[np.arange(picks)[:, None] % len(unit), np.arange(ends) % unit.shape[1]]


def repeat_size(drawdown: ArrayLike) -> tuple[int, int]:
    """Find the size of the smallest repeat of a drawdown.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        Drawdown of the cloth.

    Returns
    -------
    ends, picks : int
        Size of the whole cloth if nothing in it repeats.
    """
    matrix = as_drawdown(drawdown)
    return _period(matrix.T), _period(matrix)


def longest_floats(drawdown: ArrayLike) -> tuple[int, int]:
    """Find the longest floats of a cloth on either side.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        Drawdown of the cloth.

    Returns
    -------
    warp, weft : int
        Number of crossings that a yarn passes on one side.
    """
    matrix = as_drawdown(drawdown)
    return _longest_run(matrix.T), _longest_run(matrix)


def mean_floats(drawdown: ArrayLike) -> tuple[float | None, float | None]:
    """Compute the mean number of crossings that ends and picks pass on one side.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        Drawdown of the cloth; it is continued by repeats without end.

    Returns
    -------
    warp, weft : float or None
        None if the yarns never change side.
    """
    ends, picks = repeat_size(drawdown)
    unit = as_drawdown(drawdown)[:picks, :ends]
    changes = (np.count_nonzero(unit != np.roll(unit, 1, axis)) for axis in (0, 1))
    warp, weft = (unit.size / count if count else None for count in changes)
    return warp, weft


def to_rows(drawdown: ArrayLike) -> list[str]:
    """Write a drawdown as text, the inverse of `from_matrix`.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        Drawdown of the cloth.

    Returns
    -------
    list of str
        A string of 0 and 1 for each pick, the first pick and the first end first.

    Examples
    --------
    >>> to_rows([[True, False]])
    ['10']
    """
    digits = as_drawdown(drawdown).astype(np.uint8) + ord("0")
    return [row.tobytes().decode("ascii") for row in digits]


def as_drawdown(drawdown: ArrayLike) -> Bools:
    """Convert a drawdown to an array, and check it."""
    matrix = np.ascontiguousarray(drawdown, dtype=bool)
    # ascontiguousarray turns a single number into shape (1,).
    if matrix.ndim != 2 or matrix.size == 0:
        raise InputError(
            f"a drawdown must be a matrix with at least one pick and one end, not {matrix.shape}",
            key="drawdown",
            cure="Give a row for each pick and a column for each end",
        )
    return matrix


def check_counts(**counts: int) -> None:
    """Refuse numbers of yarns that are not whole or are below 1."""
    for key, count in counts.items():
        if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
            raise InputError(
                "the number of yarns must be a whole number",
                key=key,
                value=count,
                allowed="1 or more",
            )


def _row_error(number: int, row: object, what: str) -> InputError:
    return InputError(
        f"row {number} {what}",
        key="matrix",
        value=row,
        allowed="rows of 0 and 1, all of the same length",
    )


def _period(lines: Bools) -> int:
    return period([line.tobytes() for line in np.packbits(lines, axis=1)])


def period(words: Sequence[Hashable]) -> int:
    """Find the period of a sequence by the failure function of Knuth, Morris and Pratt.

    Parameters
    ----------
    words : sequence of hashable
        At least one.

    Returns
    -------
    int
        Smallest number after which all items repeat; the last repeat may be incomplete.
    """
    border = [0] * len(words)
    for i in range(1, len(words)):
        k = border[i - 1]
        while k and words[i] != words[k]:
            k = border[k - 1]
        border[i] = k + 1 if words[i] == words[k] else 0
    return len(words) - border[-1]


def _longest_run(lines: Bools) -> int:
    starts = np.ones(lines.shape, dtype=bool)
    np.not_equal(lines[:, 1:], lines[:, :-1], out=starts[:, 1:])
    return int(np.diff(np.flatnonzero(starts), append=lines.size).max())
