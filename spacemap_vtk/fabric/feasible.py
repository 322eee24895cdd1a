"""The interval in which each measure of a cloth may lie, for whoever lets a user change it."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.crimp_height import feasible_crimp

Interval = tuple[float, float]

#: A search starts from the value itself, and goes up and down by factors of 2 this often.
_STEPS = 60
#: Where the search ends: the ends of an interval are found to this share of themselves.
_TOLERANCE = 1e-12


def feasible_intervals(
    measures: dict[str, object], crimp: tuple[str, float] | None = None
) -> dict[str, Interval]:
    """Return the interval of each input of a cloth, all the others as they are.

    Parameters
    ----------
    measures : dict
        Arguments of `Cloth`, which need not be feasible.
    crimp : tuple of str and float, optional
        Family and crimp that stand in for the crimp height.

    Returns
    -------
    dict
        ``warp_crimp_height`` (m), ``warp_crimp`` and ``weft_crimp``; and ``warp_diameter``,
        ``weft_diameter``, ``warp_spacing``, ``weft_spacing`` (m) where they are one value. Low and
        high, feasible themselves but for a diameter of 0; infinite where there is no bound. An
        input without any feasible value is left out.

    Notes
    -----
    Found by bisection of `Cloth` itself, to 1e-12 of the value: what these intervals allow is what
    is accepted, whatever the sections of the yarns.
    """
    free = {**measures, "warp_crimp_height": None}
    result: dict[str, Interval] = {}
    try:
        cloth = Cloth(**free)  # type: ignore[arg-type]
        result["warp_crimp_height"] = cloth.feasible_heights
        result["warp_crimp"] = feasible_crimp(cloth, "warp")
        result["weft_crimp"] = feasible_crimp(cloth, "weft")
    except GeometryError:
        pass  # no height is feasible at all; a diameter or spacing may still mend it
    for name in ("warp_diameter", "weft_diameter", "warp_spacing", "weft_spacing"):
        value = measures[name]
        if isinstance(value, float):
            interval = _interval(lambda x, n=name: _woven({**measures, n: x}, crimp), value)  # type: ignore[misc]
            if interval is not None:
                result[name] = interval
    return result


def _woven(measures: dict[str, object], crimp: tuple[str, float] | None) -> bool:
    try:
        cloth = Cloth(**measures)  # type: ignore[arg-type]
        if crimp is None:
            return True
        family, wanted = crimp
        low, high = feasible_crimp(cloth, family)
    except GeometryError:
        return False
    return low <= wanted <= high


def _interval(feasible: Callable[[float], bool], start: float) -> Interval | None:
    """Return the ends of the feasible values next to `start`; None if none is found."""
    tried = (start * 2.0 ** (k / 4 * sign) for k in range(_STEPS) for sign in (1, -1))
    inside = next((value for value in tried if feasible(value)), None)
    if inside is None:
        return None
    return _end(feasible, inside, 0.5, 0.0), _end(feasible, inside, 2.0, inf)


def _end(feasible: Callable[[float], bool], inside: float, factor: float, limit: float) -> float:
    outside, start = inside, inside
    for step in range(_STEPS):
        outside *= factor
        if not feasible(outside):
            break
        inside = outside
        if not 2.0**-_STEPS < inside / start < 2.0**_STEPS:
            return limit
        if step > 2:  # most ends are near, and what is far has none
            factor *= factor
    while abs(outside - inside) > _TOLERANCE * inside:
        middle = 0.5 * (inside + outside)
        if not min(inside, outside) < middle < max(inside, outside):
            break
        inside, outside = (middle, outside) if feasible(middle) else (inside, middle)
    return inside
