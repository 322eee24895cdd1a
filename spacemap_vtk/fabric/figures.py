"""The figures by which a cloth is judged: crimp, cover, thickness, volume and mass."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.fabric.axis import checked
from spacemap_vtk.fabric.cloth import Cloth


def fabric_figures(
    drawdown: ArrayLike, cloth: Cloth, density: float | None = None
) -> dict[str, Any]:
    """Return the figures by which a cloth is judged.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        As for `build`.
    cloth : Cloth
        As for `build`.
    density : float, optional
        Density of the yarns, the air between their fibres included, in kg/m3.

    Returns
    -------
    dict
        ``ends`` and ``picks``; under ``warp`` and ``weft``

        - ``theta_deg``, ``length`` (m), ``crimp``, ``height`` (m): Peirce's figures where a yarn
          changes side;
        - ``mean_crimp``: floats included, the crimp times the share of the gaps between crossings
          in which the yarn changes side;
        - ``cover``: K = d / p;
        - ``yarn_length``: all yarns of the family as built, overhang included (m);

        and of the cloth, away from its edges

        - ``thickness``: max(h1 + d1, h2 + d2) (m);
        - ``cover``: K1 + K2 - K1 K2, the share of the plane that the yarns cover;
        - ``volume_fraction``: V / thickness, with the volume of yarn per area
          V = pi/4 (d1**2 (1 + c1) / p1 + d2**2 (1 + c2) / p2) and the mean crimps;
        - ``areal_mass``: density V (kg/m2), None without a density.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> figures = fabric_figures([[1, 0], [0, 1]], cloth)
    >>> figures["thickness"], figures["cover"]
    (0.2, 0.75)
    """
    over = checked(drawdown, cloth)
    result: dict[str, Any] = {"ends": over.shape[1], "picks": over.shape[0]}
    volume = 0.0
    for name, family, side in zip(("warp", "weft"), cloth.families, (over.T, over), strict=True):
        yarns, gaps = len(side), side.size - len(side)
        changes = int(np.count_nonzero(side[:, 1:] != side[:, :-1]))
        crimp = float(family.crimp.crimp)
        mean = crimp * changes / max(gaps, 1)
        result[name] = {
            "theta_deg": float(np.degrees(family.crimp.theta)),
            "length": float(family.crimp.length),
            "crimp": crimp,
            "height": family.height,
            "mean_crimp": mean,
            "cover": family.diameter / family.spacing,
            "yarn_length": 2 * yarns * family.overhang + gaps * family.crossed * (1.0 + mean),
        }
        volume += 0.25 * pi * family.diameter**2 * (1.0 + mean) / family.spacing
    thickness = max(family.height + family.diameter for family in cloth.families)
    k1, k2 = result["warp"]["cover"], result["weft"]["cover"]
    result["thickness"] = thickness
    result["cover"] = k1 + k2 - k1 * k2
    result["volume_fraction"] = volume / thickness
    result["areal_mass"] = None if density is None else density * volume
    return result
