"""Drafts: which yarn lies on top at each crossing, and the classical patterns.

A drawdown has a row for each pick (weft yarn) and a column for each end (warp yarn), first pick
and first end first; True: the end lies over the pick. Seen from above (from +z) the first pick is
at the bottom and the first end at the left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError


@dataclass(frozen=True, eq=False)
class Draft:
    """A weave to be made: its drawdown and what else a draft file may say.

    Parameters
    ----------
    drawdown : (picks, ends) bool
        True: the end lies over the pick.
    warp_colors : (ends, 3) uint8, optional
        RGB colour of each end.
    weft_colors : (picks, 3) uint8, optional
        RGB colour of each pick.
    warp_spacing, weft_spacing : float, optional
        Distance between ends and between picks, in metres.
    warp_thickness, weft_thickness : float, optional
        Diameter of the warp and weft yarns, in metres.
    title : str, optional
        Name of the draft.
    warnings : tuple of str, optional
        What was odd about the source of the draft.

    Raises
    ------
    InputError
        The drawdown is not a matrix with at least one pick and one end, or the number of colours
        is not the number of yarns.

    Examples
    --------
    >>> Draft(plain(3, 2)).drawdown.shape
    (2, 3)
    """

    drawdown: NDArray[np.bool_]
    warp_colors: NDArray[np.uint8] | None = None
    weft_colors: NDArray[np.uint8] | None = None
    warp_spacing: float | None = None
    weft_spacing: float | None = None
    warp_thickness: float | None = None
    weft_thickness: float | None = None
    title: str = ""
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        drawdown = _matrix(self.drawdown)
        object.__setattr__(self, "drawdown", drawdown)
        object.__setattr__(self, "warnings", tuple(self.warnings))
        yarns = {"warp_colors": (drawdown.shape[1], "end"), "weft_colors": (len(drawdown), "pick")}
        for name, (count, yarn) in yarns.items():
            colors = getattr(self, name)
            if colors is None:
                continue
            colors = np.ascontiguousarray(colors, dtype=np.uint8)
            if colors.shape != (count, 3):
                raise InputError(
                    f"one RGB colour for each {yarn} is needed, not an array of {colors.shape}",
                    key=name,
                    allowed=f"({count}, 3)",
                )
            object.__setattr__(self, name, colors)


def plain(ends: int = 2, picks: int = 2) -> NDArray[np.bool_]:
    """Return plain weave: every end goes over one pick and under the next.

    Parameters
    ----------
    ends, picks : int
        Size of the cloth; by default one repeat.

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0.

    Examples
    --------
    >>> rows(plain(3, 2))
    ['101', '010']
    """
    return twill(1, 1, ends, picks)


def twill(
    over: int = 2,
    under: int = 2,
    ends: int | None = None,
    picks: int | None = None,
    direction: str = "right",
) -> NDArray[np.bool_]:
    """Return a twill: each end does what its neighbour does, one pick later.

    Parameters
    ----------
    over, under : int
        How many picks an end goes over, and then under: 2 and 1 for a 2/1 twill.
    ends, picks : int, optional
        Size of the cloth; by default one repeat.
    direction : str
        Where the diagonal rises to, seen from above with the first pick at the bottom: ``"right"``
        (Z twill) or ``"left"`` (S twill).

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0.

    Raises
    ------
    InputError
        A count below 1, or another direction.

    Examples
    --------
    >>> rows(twill(2, 1))
    ['110', '011', '101']
    """
    _at_least_one(over=over, under=under)
    size = over + under
    n, m = _size(ends, picks, size, size)
    if direction not in ("right", "left"):
        raise InputError(
            "a twill rises to one side",
            key="direction",
            value=direction,
            allowed="right or left",
        )
    end, pick = np.arange(n), np.arange(m)[:, None]
    shift = end - pick if direction == "right" else end + pick
    lifted: NDArray[np.bool_] = shift % size < over
    return lifted


def satin(
    shafts: int = 5,
    step: int = 2,
    ends: int | None = None,
    picks: int | None = None,
    face: str = "warp",
) -> NDArray[np.bool_]:
    """Return a satin: one binding point in each end and pick of the repeat, none next to another.

    Parameters
    ----------
    shafts : int
        Ends and picks of the repeat, 5 or more.
    step : int
        How many ends further the next pick has its binding point.
    ends, picks : int, optional
        Size of the cloth; by default one repeat.
    face : str
        The family that covers the upper side: ``"warp"`` (satin: an end goes under one pick and
        over all others) or ``"weft"`` (sateen: over one and under all others).

    Returns
    -------
    (picks, ends) bool
        Pick 0 has its binding point at end 0.

    Raises
    ------
    InputError
        A step that is no satin's: step and shafts must have no common divisor (or some ends would
        never be bound) and ``1 < step < shafts - 1`` (or it would be a twill). For 6 shafts there
        is none.

    Examples
    --------
    >>> rows(satin(5, 2))
    ['01111', '11011', '11110', '10111', '11101']
    """
    _at_least_one(shafts=shafts)
    n, m = _size(ends, picks, shafts, shafts)
    if isinstance(step, bool) or step not in range(2, shafts - 1) or gcd(step, shafts) != 1:
        steps = [str(k) for k in range(2, min(shafts, 100) - 1) if gcd(k, shafts) == 1]
        raise InputError(
            f"a satin of {shafts} shafts cannot have this step",
            key="step",
            value=step,
            allowed=", ".join(steps[:12]) or "none: use 5 shafts, or 7 and more",
            cure="Step and shafts need to have no common divisor, and 1 < step < shafts - 1",
        )
    if face not in ("warp", "weft"):
        raise InputError("unknown face", key="face", value=face, allowed="warp or weft")
    bound = (np.arange(n) - step * np.arange(m)[:, None]) % shafts == 0
    return ~bound if face == "warp" else bound


def basket(n: int = 2, ends: int | None = None, picks: int | None = None) -> NDArray[np.bool_]:
    """Return basket (hopsack) weave: plain weave of groups of n ends and n picks.

    Parameters
    ----------
    n : int
        Yarns in a group.
    ends, picks : int, optional
        Size of the cloth; by default one repeat, 2 n.

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0.

    Examples
    --------
    >>> rows(basket(2))
    ['1100', '1100', '0011', '0011']
    """
    _at_least_one(n=n)
    width, height = _size(ends, picks, 2 * n, 2 * n)
    return tile(np.kron(plain(), np.ones((n, n), dtype=bool)), width, height)


def from_matrix(matrix: Sequence[str | Sequence[int]] | NDArray) -> NDArray[np.bool_]:
    """Return the drawdown that a user wrote as rows of 0 and 1.

    Parameters
    ----------
    matrix : sequence of str, or of sequences of int
        A row for each pick, the first pick first: ``"0101"`` or ``[0, 1, 0, 1]``.

    Returns
    -------
    (picks, ends) bool
        True where a 1 stands: the end lies over the pick.

    Raises
    ------
    InputError
        No row, an empty row, rows of different lengths, or something that is neither 0 nor 1; the
        row is named, counted from 1.

    Examples
    --------
    >>> from_matrix(["10", [0, 1]]).tolist()
    [[True, False], [False, True]]
    """
    # one string is a sequence of strings: it would be read as a cloth of one end
    if isinstance(matrix, str) or not isinstance(matrix, (Sequence, np.ndarray)) or not len(matrix):
        raise InputError(
            "a drawdown needs at least one row", key="matrix", value=matrix, allowed='["10", "01"]'
        )
    result: list[list[object]] = []
    for number, row in enumerate(matrix, start=1):
        if not isinstance(row, (str, Sequence, np.ndarray)) or not len(row):
            raise _bad_row(number, row, "is no row of 0 and 1")
        cells = [{"0": 0, "1": 1}.get(c, c) for c in row] if isinstance(row, str) else list(row)
        for column, cell in enumerate(cells, start=1):
            if not np.isscalar(cell) or cell not in (0, 1):
                raise _bad_row(number, row, f"has {cell!r} at end {column}")
        if result and len(cells) != len(result[0]):
            raise _bad_row(number, row, f"has {len(cells)} ends, but row 1 has {len(result[0])}")
        result.append(cells)
    return np.array(result, dtype=bool)


def tile(matrix: ArrayLike, ends: int, picks: int) -> NDArray[np.bool_]:
    """Repeat a drawdown over a cloth, and cut it off at its far edges.

    Parameters
    ----------
    matrix : (m, n) array_like
        One repeat.
    ends, picks : int
        Size of the cloth.

    Returns
    -------
    (picks, ends) bool
        ``matrix[j % m, i % n]`` at pick j and end i.

    Raises
    ------
    InputError
        A size below 1, or no matrix.

    Examples
    --------
    >>> rows(tile([[1, 0], [0, 1]], 3, 3))
    ['101', '010', '101']
    """
    unit = _matrix(matrix)
    n, m = _size(ends, picks, 1, 1)
    return unit[np.arange(m)[:, None] % len(unit), np.arange(n) % unit.shape[1]]


def repeat(drawdown: ArrayLike) -> tuple[int, int]:
    """Return the size of the smallest repeat of a drawdown.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        The cloth, which may end in the middle of a repeat.

    Returns
    -------
    ends, picks : int
        The smallest size for which ``tile(drawdown[:picks, :ends], ...)`` is the drawdown again.

    Examples
    --------
    >>> repeat(plain(7, 7))
    (2, 2)
    """
    matrix = _matrix(drawdown)
    return _period(matrix.T), _period(matrix)


def floats(drawdown: ArrayLike) -> tuple[int, int]:
    """Return the longest floats of a cloth, on either side of it.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        The cloth.

    Returns
    -------
    warp, weft : int
        The largest number of neighbouring picks that an end crosses on one side of the cloth, and
        of ends that a pick crosses. 1 is plain weave.

    Examples
    --------
    >>> floats(twill(3, 1, 8, 8))
    (3, 3)
    """
    matrix = _matrix(drawdown)
    return _longest_run(matrix.T), _longest_run(matrix)


def rows(drawdown: ArrayLike) -> list[str]:
    """Return a drawdown as text, the inverse of `from_matrix`.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        The cloth.

    Returns
    -------
    list of str
        A string of 0 and 1 for each pick, the first pick and the first end first.

    Examples
    --------
    >>> rows([[True, False]])
    ['10']
    """
    digits = _matrix(drawdown).astype(np.uint8) + ord("0")
    return [row.tobytes().decode("ascii") for row in digits]


def _matrix(drawdown: ArrayLike) -> NDArray[np.bool_]:
    matrix = np.ascontiguousarray(drawdown, dtype=bool)
    # ascontiguousarray makes (1,) of a bare number
    if matrix.ndim != 2 or matrix.size == 0:
        raise InputError(
            f"a drawdown is a matrix of at least one pick and one end, not one of {matrix.shape}",
            key="drawdown",
            cure="Give a row for each pick and a column for each end",
        )
    return matrix


def _size(ends: int | None, picks: int | None, width: int, height: int) -> tuple[int, int]:
    size = (width if ends is None else ends, height if picks is None else picks)
    _at_least_one(ends=size[0], picks=size[1])
    return size


def _at_least_one(**counts: int) -> None:
    for key, count in counts.items():
        if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
            raise InputError(
                "not a number of yarns", key=key, value=count, allowed="a whole number from 1 on"
            )


def _bad_row(number: int, row: object, what: str) -> InputError:
    return InputError(
        f"row {number} {what}",
        key="matrix",
        value=row,
        allowed="rows of 0 and 1, all of the same length",
    )


def _period(lines: NDArray[np.bool_]) -> int:
    """Return the period of the lines by the failure function of Knuth, Morris and Pratt."""
    words = [line.tobytes() for line in np.packbits(lines, axis=1)]
    border = [0] * len(words)
    for i in range(1, len(words)):
        k = border[i - 1]
        while k and words[i] != words[k]:
            k = border[k - 1]
        border[i] = k + 1 if words[i] == words[k] else 0
    return len(words) - border[-1]


def _longest_run(lines: NDArray[np.bool_]) -> int:
    starts = np.ones(lines.shape, dtype=bool)
    np.not_equal(lines[:, 1:], lines[:, :-1], out=starts[:, 1:])
    return int(np.diff(np.flatnonzero(starts), append=lines.size).max())
