"""The crimp height of a cloth whose crimp was measured in one of its families."""

from __future__ import annotations

from dataclasses import replace

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import Cloth

#: A crimp may pass the end of its interval by this share of the largest, by rounding.
_GRACE = 1e-9


def crimp_at(cloth: Cloth, family: str, height: float) -> float:
    """Return the crimp of a family at a warp crimp height.

    Parameters
    ----------
    cloth : Cloth
        Its other measures.
    family : {"warp", "weft"}
        Which.
    height : float
        Crimp height h1 of the warp, in metres, inside the feasible interval.

    Returns
    -------
    float
        Crimp c = l / p - 1 where a yarn changes side.
    """
    families = replace(cloth, warp_crimp_height=height).families
    return float(families[0 if family == "warp" else 1].crimp.crimp)


def feasible_crimp(cloth: Cloth, family: str) -> tuple[float, float]:
    """Return the interval of crimps that a family can have.

    Parameters
    ----------
    cloth : Cloth
        Its crimp height does not count.
    family : {"warp", "weft"}
        Which.

    Returns
    -------
    low, high : float
        Crimps at the ends of the feasible interval of heights.
    """
    low, high = (crimp_at(cloth, family, height) for height in cloth.feasible_heights)
    return min(low, high), max(low, high)


def height_for_crimp(cloth: Cloth, family: str, crimp: float) -> float:
    """Return the warp crimp height at which a family has a given crimp.

    Parameters
    ----------
    cloth : Cloth
        Its crimp height does not count.
    family : {"warp", "weft"}
        Which.
    crimp : float
        Crimp c = l / p - 1 where a yarn changes side.

    Returns
    -------
    float
        Crimp height h1 of the warp, in metres.

    Raises
    ------
    GeometryError
        If no feasible height gives this crimp; the interval is named.

    Notes
    -----
    The warp's crimp grows with h1 and the weft's falls, so Brent's method finds the one height.

    Examples
    --------
    Published exam figure: the warp's crimp is 9 %.

    >>> cloth = Cloth(warp_diameter=0.2, weft_diameter=0.3, warp_spacing=0.6, weft_spacing=0.4)
    >>> round(height_for_crimp(cloth, "warp", 0.09), 5)
    0.15556
    """
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
