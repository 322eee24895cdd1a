"""Figures of a cloth: crimp, cover, thickness, volume fraction and areal mass."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.geometry.cloth_axes import family_axes, woven_gaps
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.peirce import solve
from spacemap_vtk.textile.weave.yarn import section_factor


def fabric_figures(cloth: Cloth) -> dict[str, Any]:
    """Compute the figures of a cloth.

    Parameters
    ----------
    cloth : Cloth
        As for `build`.

    Returns
    -------
    dict
        ``ends`` and ``picks``; under ``warp`` and ``weft``

        - ``theta_deg``, ``length`` (m), ``crimp``, ``height`` (m): Peirce's figures where a yarn
          changes side, for mean diameters and spacings;
        - ``mean_crimp``: mean over all yarns, for the axes as built, including floats;
        - ``cover``: K = width / p;
        - ``yarn_length``: total length of the family's yarns as built, including overhang (m);

        and for the cloth, away from its edges

        - ``cloths``: 2 for a double weave, otherwise 1;
        - ``thickness``: max(h1 + d1, h2 + d2) for the thickest yarns (m); for a double weave twice
          that, plus the gap between its cloths;
        - ``cover``: K1 + K2 - K1 K2, the share of the plane that the yarns cover;
        - ``volume_fraction``: V / thickness, with the volume of yarn per area
          V = A1 (1 + c1) / p1 + A2 (1 + c2) / p2, section areas A, and the crimp of each yarn;
        - ``areal_mass``: sum of density V of both families (kg/m2), None for a cloth without a
          density.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> figures = fabric_figures(Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads))
    >>> figures["thickness"], figures["cover"]
    (0.2, 0.75)
    """
    result: dict[str, Any] = dict(zip(("ends", "picks"), cloth.size, strict=True))
    volume, areal_mass, densities = 0.0, 0.0, cloth.densities
    for number, (name, family) in enumerate(zip(FAMILIES, cloth.families, strict=True)):
        yarns, across = cloth.yarns[number], cloth.yarns[1 - number].spacing.sum()
        crimp = yarn_crimps(cloth, number)
        result[name] = {
            "theta_deg": float(np.degrees(family.crimp.theta)),
            "length": float(family.crimp.length),
            "crimp": float(family.crimp.crimp),
            "height": family.height,
            "mean_crimp": float(crimp.mean()),
            "cover": family.width / family.spacing,
            "yarn_length": float((2 * family.overhang + across * (1.0 + crimp)).sum()),
        }
        area = section_factor(yarns.aspect, yarns.section) * yarns.diameter**2
        own_volume = float(np.mean(area * (1.0 + crimp))) / family.spacing
        volume += own_volume
        areal_mass += 0.0 if densities is None else densities[number] * own_volume
    k1, k2 = result["warp"]["cover"], result["weft"]["cover"]
    result["cloths"] = len(cloth.sheets)
    result["thickness"] = thickness = cloth.sheet_thickness + 2.0 * cloth.level
    result["cover"] = k1 + k2 - k1 * k2
    result["volume_fraction"] = volume / thickness
    result["areal_mass"] = None if densities is None else areal_mass
    return result


def yarn_crimps(cloth: Cloth, family: int) -> Floats:
    """Compute the crimp of each yarn as built, including its floats.

    Parameters
    ----------
    cloth : Cloth
        As for `build`.
    family : int
        0 for the ends, 1 for the picks.

    Returns
    -------
    (n,) ndarray
        Length of the axis over its straight projection, minus 1, from the first to the last
        crossing.
    """
    across = cloth.yarns[1 - family].spacing.sum()
    excess = _excess_lengths(cloth, family)
    return excess / across if across > 0.0 else np.zeros_like(excess)


def _excess_lengths(cloth: Cloth, number: int) -> Floats:
    """Compute how much longer each yarn of a family is than its straight projection, in m."""
    chosen, which = cloth.yarn_groups[number]
    if cloth.axis == "spline":
        path = family_axes(cloth, number, chosen)
        straight = path.along[path.last] - path.along[0]
        return np.asarray(path.length.reshape(len(path.parts), -1).sum(axis=1) - straight)[which]
    excess = np.empty(len(chosen))
    for some in cloth.yarn_blocks(number, len(excess)):
        gaps = woven_gaps(cloth, number, chosen[some])
        rise = np.abs(np.diff(gaps.height, axis=1))
        crimp = solve(gaps.spacing, rise, gaps.arc[:, 1:] + gaps.arc[:, :-1]).crimp
        excess[some] = (crimp * gaps.spacing).sum(axis=1)
    return excess[which]
