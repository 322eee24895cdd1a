"""The classical patterns: plain weave, twill, satin, basket and rib, as drawdowns."""

from __future__ import annotations

from collections.abc import Sequence
from math import gcd

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.drawdown import at_least_one, tile


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
    >>> from spacemap_vtk.fabric.drawdown import rows
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
    >>> from spacemap_vtk.fabric.drawdown import rows
    >>> rows(twill(2, 1))
    ['110', '011', '101']
    """
    return compound_twill((over, under), ends, picks, direction)


def compound_twill(
    counts: Sequence[int],
    ends: int | None = None,
    picks: int | None = None,
    direction: str = "right",
) -> NDArray[np.bool_]:
    """Return a twill with any number of floats: 3/1/1/2 goes over 3, under 1, over 1, under 2.

    Parameters
    ----------
    counts : sequence of int
        Picks that an end goes over and under, in turn; an even number of them.
    ends, picks : int, optional
        Size of the cloth; by default one repeat.
    direction : str
        As for `twill`.

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0.

    Raises
    ------
    InputError
        An odd number of counts, one below 1, or another direction.

    Examples
    --------
    >>> from spacemap_vtk.fabric.drawdown import rows
    >>> rows(compound_twill((2, 1, 1, 1)))[0]
    '11010'
    """
    names = ("over", "under") * ((len(counts) + 1) // 2)
    for name, count in zip(names, counts, strict=False):
        at_least_one(**{name: count})
    if len(counts) % 2 or not len(counts):
        raise InputError(
            "a twill goes over and under in turn",
            key="counts",
            value=tuple(counts),
            allowed="an even number of counts",
        )
    size = sum(counts)
    n, m = _size(ends, picks, size, size)
    if direction not in ("right", "left"):
        raise InputError(
            "a twill rises to one side",
            key="direction",
            value=direction,
            allowed="right or left",
        )
    line = np.repeat(np.arange(len(counts)) % 2 == 0, counts)
    end, pick = np.arange(n), np.arange(m)[:, None]
    return line[(end - pick if direction == "right" else end + pick) % size]


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
    >>> from spacemap_vtk.fabric.drawdown import rows
    >>> rows(satin(5, 2))
    ['01111', '11011', '11110', '10111', '11101']
    """
    at_least_one(shafts=shafts)
    n, m = _size(ends, picks, shafts, shafts)
    if isinstance(step, bool) or step not in range(2, shafts - 1) or gcd(step, shafts) != 1:
        steps = [str(k) for k in range(2, min(shafts, 100) - 1) if gcd(k, shafts) == 1]
        raise InputError(
            f"a satin of {shafts} shafts cannot have this step",
            key="step",
            value=step,
            allowed=", ".join(steps[:12]) or "none: use 5 shafts, or 7 and more",
            cure="Step and shafts have no common divisor, and 1 < step < shafts - 1",
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
    >>> from spacemap_vtk.fabric.drawdown import rows
    >>> rows(basket(2))
    ['1100', '1100', '0011', '0011']
    """
    at_least_one(n=n)
    width, height = _size(ends, picks, 2 * n, 2 * n)
    return tile(np.kron(plain(), np.ones((n, n), dtype=bool)), width, height)


def rib(
    over: int = 2,
    under: int | None = None,
    ends: int | None = None,
    picks: int | None = None,
    family: str = "warp",
) -> NDArray[np.bool_]:
    """Return a rib: plain weave drawn out along one family, whose floats lie side by side.

    Parameters
    ----------
    over, under : int
        How many yarns one of the family goes over, and then under; by default as many.
    ends, picks : int, optional
        Size of the cloth; by default one repeat.
    family : str
        The family that floats: ``"warp"`` (ribs across the cloth: neighbouring picks lie in one
        shed) or ``"weft"`` (ribs along it: neighbouring ends work alike).

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0.

    Raises
    ------
    InputError
        A count below 1, or another family.

    Examples
    --------
    >>> from spacemap_vtk.fabric.drawdown import rows
    >>> rows(rib(2, 1)), rows(rib(2, 1, family="weft"))
    (['10', '10', '01'], ['110', '001'])
    """
    under = over if under is None else under
    at_least_one(over=over, under=under)
    if family not in ("warp", "weft"):
        raise InputError("unknown family", key="family", value=family, allowed="warp or weft")
    drawn_out = np.repeat(plain(), (over, under), axis=0 if family == "warp" else 1)
    height, width = drawn_out.shape
    return tile(drawn_out, *_size(ends, picks, width, height))


def satin_step(shafts: int) -> int:
    """Return the smallest step of a satin.

    Parameters
    ----------
    shafts : int
        Ends and picks of its repeat.

    Returns
    -------
    int
        2 for 5 shafts, 3 for 8.

    Raises
    ------
    InputError
        If there is no satin of that size.

    Examples
    --------
    >>> satin_step(8)
    3
    """
    step = next((k for k in range(2, shafts - 1) if gcd(k, shafts) == 1), None)
    if step is None:
        satin(shafts, 2)  # refuses it, with the reason
        raise AssertionError
    return step


def _size(ends: int | None, picks: int | None, width: int, height: int) -> tuple[int, int]:
    size = (width if ends is None else ends, height if picks is None else picks)
    at_least_one(ends=size[0], picks=size[1])
    return size
