"""The closest sett of a weave, by Ashenhurst's rule of diameters and intersections.

Source: T. R. Ashenhurst, "A Treatise on Textile Calculations and the Structure of Fabrics" (1884).
"""

from __future__ import annotations

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
