"""The classical patterns: plain weave, twill, satin, basket and rib, as drawdowns."""

from __future__ import annotations

from collections.abc import Sequence
from math import gcd

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.drawdown import at_least_one, tile
from spacemap_vtk.ndarrays import Bools


def plain(ends: int = 2, picks: int = 2) -> Bools:
    """Return plain weave: every end goes over one pick and under the next."""
    return twill(1, 1, ends, picks)


def twill(
    over: int = 2,
    under: int = 2,
    ends: int | None = None,
    picks: int | None = None,
    direction: str = "right",
) -> Bools:
    """Return a twill: each end does what its neighbour does, one pick later."""
    return compound_twill((over, under), ends, picks, direction)


def compound_twill(
    counts: Sequence[int],
    ends: int | None = None,
    picks: int | None = None,
    direction: str = "right",
) -> Bools:
    """Return a twill with any number of floats: 3/1/1/2 goes over 3, under 1, over 1, under 2."""
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
) -> Bools:
    """Return a satin: one binding point in each end and pick of the repeat, none adjacent."""
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


def basket(n: int = 2, ends: int | None = None, picks: int | None = None) -> Bools:
    """Return basket (hopsack) weave: plain weave of groups of n ends and n picks."""
    at_least_one(n=n)
    width, height = _size(ends, picks, 2 * n, 2 * n)
    return tile(np.kron(plain(), np.ones((n, n), dtype=bool)), width, height)


def rib(
    over: int = 2,
    under: int | None = None,
    ends: int | None = None,
    picks: int | None = None,
    family: str = "warp",
) -> Bools:
    """Return a rib: plain weave drawn out along one family, whose floats lie side by side."""
    under = over if under is None else under
    at_least_one(over=over, under=under)
    if family not in ("warp", "weft"):
        raise InputError("unknown family", key="family", value=family, allowed="warp or weft")
    drawn_out = np.repeat(plain(), (over, under), axis=0 if family == "warp" else 1)
    height, width = drawn_out.shape
    return tile(drawn_out, *_size(ends, picks, width, height))


def satin_step(shafts: int) -> int:
    """Return the smallest step of a satin."""
    step = next((k for k in range(2, shafts - 1) if gcd(k, shafts) == 1), None)
    if step is None:
        satin(shafts, 2)  # refuses it, with the reason
        raise AssertionError
    return step


def _size(ends: int | None, picks: int | None, width: int, height: int) -> tuple[int, int]:
    size = (width if ends is None else ends, height if picks is None else picks)
    at_least_one(ends=size[0], picks=size[1])
    return size
