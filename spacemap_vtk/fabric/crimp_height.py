"""The crimp height of a cloth whose crimp was measured in one of its families."""

from __future__ import annotations

from dataclasses import replace

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import Cloth

#: A crimp may pass the end of its interval by this share of the largest, by rounding.
_GRACE = 1e-9


def crimp_at(cloth: Cloth, family: str, height: float) -> float:
    """Return the crimp of a family at a warp crimp height."""
    families = replace(cloth, warp_crimp_height=height).families
    return float(families[0 if family == "warp" else 1].crimp.crimp)


def feasible_crimp(cloth: Cloth, family: str) -> tuple[float, float]:
    """Return the interval of crimps that a family can have."""
    low, high = (crimp_at(cloth, family, height) for height in cloth.feasible_heights)
    return min(low, high), max(low, high)


def height_for_crimp(cloth: Cloth, family: str, crimp: float) -> float:
    """Return the warp crimp height at which a family has a given crimp."""
    low, high = cloth.feasible_heights
    least, most = feasible_crimp(cloth, family)
    if not least - _GRACE * most <= crimp <= most * (1.0 + _GRACE):
        raise GeometryError(
            f"the {family} cannot have this crimp with these yarns and spacings",
            key=f"{family}_crimp",
            value=crimp,
            allowed=f"{least:.6g} to {most:.6g}",
            cure="Thinner yarns or wider spacings allow other crimps",
        )
    ends = (least, most) if family == "warp" else (most, least)
    for end, height in zip(ends, (low, high), strict=True):
        if abs(crimp - end) <= _GRACE * most:
            return height

    def remainder(height: float) -> float:
        return crimp_at(cloth, family, height) - crimp

    from scipy.optimize import brentq  # with all it brings: a tenth of a second

    return float(brentq(remainder, low, high, xtol=1e-15 * cloth.diameter_sum, rtol=1e-15))
