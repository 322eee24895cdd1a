"""The closest sett of a weave, by Ashenhurst's rule of diameters and intersections.

Source: T. R. Ashenhurst, "A Treatise on Textile Calculations and the Structure of Fabrics" (1884).
"""

from __future__ import annotations

from collections.abc import Sequence

from spacemap_vtk.textile.weave.yarn_library import Yarn

#: Share of the largest sett that is usual for cloth that is neither loose nor stiff (P. Osterkamp,
#: "Winding a Warp and Using a Paddle", after Ashenhurst).
USUAL_SHARE = 0.8


def largest_sett(own: float, crossed: float, mean_float: float | None) -> float:
    """Compute the largest sett of a family.

    Parameters
    ----------
    own : float
        Number of the family's yarns that lie side by side in a metre, in 1/m.
    crossed : float
        The same for the yarns that cross them, in 1/m.
    mean_float : float or None
        Mean number of the family's yarns that a crossed yarn passes before it changes side; None
        if it never does.

    Returns
    -------
    float
        In 1/m. Each change of side needs room for one crossed yarn: R yarns with I changes of side
        are R d + I d' wide.

    Examples
    --------
    >>> round(largest_sett(52.0, 52.0, 1.0)), round(largest_sett(52.0, 52.0, 2.0))
    (26, 35)
    """
    between = 0.0 if mean_float is None else 1.0 / (crossed * mean_float)
    return 1.0 / (1.0 / own + between)


def suggest_sett(
    named: Sequence[Yarn], largest: float, firmness: float | None = None
) -> tuple[float, str]:
    """Suggest the sett of yarns for a weave.

    Parameters
    ----------
    named : sequence of Yarn
        The yarns of the family, at least one.
    largest : float
        The largest sett for this weave, in 1/m.
    firmness : float, optional
        Share of the largest sett. By default a single yarn of the library has its usual sett for
        plain weave, closer for weaves with floats, at most the highest usual sett; other yarns have
        `USUAL_SHARE` of the largest sett.

    Returns
    -------
    sett : float
        In 1/m.
    reason : str
        Where it comes from, with its source.
    """
    yarn = named[0]
    published = yarn.published if len(named) == 1 else None
    if firmness is not None or published is None or published.plain_sett is None:
        share = USUAL_SHARE if firmness is None else firmness
        return share * largest, f"{share:.0%} of the closest one by Ashenhurst's rule"
    plain = largest_sett(yarn.diameters_per_metre, yarn.diameters_per_metre, 1.0)
    wanted = published.plain_sett * largest / plain
    if published.highest_sett is not None:
        wanted = min(wanted, published.highest_sett)
    return wanted, f"usual for {yarn.name} in this weave ({published.source})"
