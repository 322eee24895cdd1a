"""Feasible intervals of the measures of a cloth, for a user interface that changes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from math import inf
from typing import Any

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.threads import Threads

Interval = tuple[float, float]
#: A quantity of a family: its name in `Threads`, and 0 for the warp or 1 for the weft.
Quantity = tuple[str, int]

#: Largest number of steps of a search, and the power of 2 beyond which an interval has no bound.
_STEPS = 60
#: Relative tolerance of the ends of an interval.
_TOLERANCE = 1e-12


def feasible_intervals(cloth: Cloth) -> dict[Quantity, Interval]:
    """Find the interval of each input of a cloth while the other inputs stay unchanged.

    Parameters
    ----------
    cloth : Cloth
        It need not be feasible.

    Returns
    -------
    dict
        By quantity and family (0: warp, 1: weft): ``crimp_height`` of the warp (m), ``crimp`` of
        both, and ``diameter`` and ``spacing`` (m) where all yarns have one value. Low and high end;
        both are feasible, except a diameter of 0, and infinite if there is no bound. An input
        without a feasible value is left out.

    Notes
    -----
    The ends are found by bisection on `Cloth` itself, to 1e-12 of the value. So values inside an
    interval are accepted whatever the sections of the yarns.
    """
    result: dict[Quantity, Interval] = {}
    try:
        result["crimp_height", 0] = cloth.feasible_heights
        result["crimp", 0] = cloth.feasible_crimps(0)
        result["crimp", 1] = cloth.feasible_crimps(1)
    except GeometryError:
        pass  # no height is feasible; another diameter or spacing may help
    for measure, number in product(("diameter", "spacing"), (0, 1)):
        threads, family = cloth.threads[number], FAMILIES[number]
        changed = partial(_is_feasible_with, cloth, family, threads, measure)
        if isinstance(value := getattr(threads, measure), float):
            interval = _find_interval(changed, value)
            if interval is not None:
                result[measure, number] = interval
    return result


def _is_feasible_with(
    cloth: Cloth, family: str, threads: Threads, measure: str, value: float
) -> bool:
    """Check whether a cloth can be woven with another measure of a family."""
    own: Any = {measure: value}
    changed: Any = {family: replace(threads, **own)}
    return _is_feasible(replace(cloth, **changed))


def _is_feasible(cloth: Cloth) -> bool:
    try:
        for number, threads in enumerate(cloth.threads):
            if threads.crimp is not None:
                low, high = cloth.feasible_crimps(number)
                return low <= threads.crimp <= high
        cloth.check()
    except GeometryError:
        return False
    return True


def _find_interval(feasible: Callable[[float], bool], start: float) -> Interval | None:
    """Find the ends of the feasible values around `start`; None if there are none."""
    tried = (start * 2.0 ** (k / 4 * sign) for k in range(_STEPS) for sign in (1, -1))
    inside = next((value for value in tried if feasible(value)), None)
    if inside is None:
        return None
    return _find_end(feasible, inside, 0.5, 0.0), _find_end(feasible, inside, 2.0, inf)


def _find_end(
    feasible: Callable[[float], bool], inside: float, factor: float, limit: float
) -> float:
    outside, start = inside, inside
    for step in range(_STEPS):
        outside *= factor
        if not feasible(outside):
            break
        inside = outside
        if not 2.0**-_STEPS < inside / start < 2.0**_STEPS:
            return limit
        if step > 2:  # most ends are close, so a distant one is searched with growing steps
            factor *= factor
    while abs(outside - inside) > _TOLERANCE * inside:
        middle = 0.5 * (inside + outside)
        if not min(inside, outside) < middle < max(inside, outside):
            break
        inside, outside = (middle, outside) if feasible(middle) else (inside, middle)
    return inside
