"""The classical patterns, one repeat of each: plain weave, twill, satin, basket and rib."""

from __future__ import annotations

from itertools import cycle
from math import gcd

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.drawdown import at_least_one
from spacemap_vtk.ndarrays import Bools


def plain() -> Bools:
    """Return plain weave: every end goes over one pick and under the next."""
    return twill(1, 1)


def twill(*counts: int, direction: str = "right") -> Bools:
    """Return a twill: each end does what its neighbour does, one pick later."""
    # With any even number of floats: 3, 1, 1, 2 goes over 3, under 1, over 1, under 2.
    for name, count in zip(cycle(("over", "under")), counts, strict=False):
        at_least_one(**{name: count})
    line = np.repeat(np.arange(len(counts)) % 2 == 0, counts)
    end = np.arange(len(line))
    pick = end[:, None]
    return line[(end - pick if direction == "right" else end + pick) % len(line)]


def satin(shafts: int, step: int, face: str = "warp") -> Bools:
    """Return a satin: one binding point in each end and pick of the repeat, none adjacent."""
    at_least_one(shafts=shafts)
    if step not in range(2, shafts - 1) or gcd(step, shafts) != 1:
        steps = [str(k) for k in range(2, min(shafts, 100) - 1) if gcd(k, shafts) == 1]
        raise InputError(
            f"a satin of {shafts} shafts cannot have this step",
            key="step",
            value=step,
            allowed=", ".join(steps[:12]) or "none: use 5 shafts, or 7 and more",
            cure="Step and shafts have no common divisor, and 1 < step < shafts - 1",
        )
    place = np.arange(shafts)
    bound = (place - step * place[:, None]) % shafts == 0
    return ~bound if face == "warp" else bound


def basket(n: int) -> Bools:
    """Return basket (hopsack) weave: plain weave of groups of n ends and n picks."""
    at_least_one(n=n)
    return np.kron(plain(), np.ones((n, n), dtype=bool))


def rib(over: int, under: int, family: str = "warp") -> Bools:
    """Return a rib: plain weave drawn out along one family, whose floats lie side by side."""
    at_least_one(over=over, under=under)
    return np.repeat(plain(), (over, under), axis=0 if family == "warp" else 1)


def satin_step(shafts: int) -> int:
    """Return the smallest step of a satin; where there is none one that `satin` refuses."""
    return next((k for k in range(2, shafts - 1) if gcd(k, shafts) == 1), 2)
