"""The figures by which a cloth is judged: crimp, cover, thickness, volume and mass."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.fabric.axes import checked
from spacemap_vtk.fabric.axis import crossing_heights
from spacemap_vtk.fabric.cloth import Cloth, Yarns
from spacemap_vtk.fabric.peirce import solve
from spacemap_vtk.fabric.spline import spline_axes

#: Crossings that are looked at in one go: some ten megabytes.
_CROSSINGS = 20_000


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
          changes side, for mean diameters and spacings;
        - ``mean_crimp``: of the axes as built, floats included, over all yarns;
        - ``cover``: K = width / p;
        - ``yarn_length``: all yarns of the family as built, overhang included (m);

        and of the cloth, away from its edges

        - ``thickness``: max(h1 + d1, h2 + d2), for the thickest yarns (m);
        - ``cover``: K1 + K2 - K1 K2, the share of the plane that the yarns cover;
        - ``volume_fraction``: V / thickness, with the volume of yarn per area
          V = A1 (1 + c1) / p1 + A2 (1 + c2) / p2, sections A and each yarn's own crimp;
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
    shares = cloth.share, 1.0 - cloth.share
    tallest = [float(np.max(d)) for d in (cloth.warp_diameter, cloth.weft_diameter)]
    volume = thickness = 0.0
    excess = _excess_lengths(over, cloth)
    for number, (name, family) in enumerate(zip(("warp", "weft"), cloth.families, strict=True)):
        yarns = cloth.yarns(name, over.shape[1 - number])
        across = cloth.yarns("weft" if number == 0 else "warp", over.shape[number]).spacing.sum()
        crimp = excess[number] / across if across > 0.0 else np.zeros_like(excess[number])
        result[name] = {
            "theta_deg": float(np.degrees(family.crimp.theta)),
            "length": float(family.crimp.length),
            "crimp": float(family.crimp.crimp),
            "height": family.height,
            "mean_crimp": float(crimp.mean()),
            "cover": family.width / family.spacing,
            "yarn_length": float(
                len(crimp) * (2 * family.overhang + across) + excess[number].sum()
            ),
        }
        volume += float(np.mean(_area(yarns) * (1.0 + crimp))) / family.spacing
        thickness = max(thickness, shares[number] * sum(tallest) + tallest[number])
    k1, k2 = result["warp"]["cover"], result["weft"]["cover"]
    result["thickness"] = thickness
    result["cover"] = k1 + k2 - k1 * k2
    result["volume_fraction"] = volume / thickness
    result["areal_mass"] = None if density is None else density * volume
    return result


def _excess_lengths(over: NDArray[np.bool_], cloth: Cloth) -> list[NDArray[np.float64]]:
    """Return by how much each yarn of each family is longer than straight, in m."""
    warp, weft = cloth.yarns("warp", over.shape[1]), cloth.yarns("weft", over.shape[0])
    result = []
    for number, (side, own, crossed, share) in enumerate(
        ((over.T, warp, weft, cloth.share), (~over, weft, warp, 1.0 - cloth.share))
    ):
        if cloth.axis == "spline":
            family = cloth.families[number]
            path = spline_axes(side, own, crossed, share, family.overhang)
            straight = path.along[path.last] - path.along[0]
            result.append(path.length.reshape(len(side), -1).sum(axis=1) - straight)
            continue
        room = crossed.spacing - 0.5 * (crossed.flat[1:] + crossed.flat[:-1])
        excess, step = np.empty(len(side)), max(1, _CROSSINGS // side.shape[1])
        for first in range(0, len(side), step):
            some = slice(first, first + step)
            arc, height = crossing_heights(side[some], own.chosen(some), crossed, share)
            rise = np.abs(np.diff(height, axis=1))
            crimp = solve(room, rise, arc[:, 1:] + arc[:, :-1]).crimp
            excess[some] = (crimp * room).sum(axis=1)
        result.append(excess)
    return result


def _area(yarns: Yarns) -> NDArray[np.float64]:
    """Return the area of each yarn's section, in m2."""
    square = yarns.diameter**2
    if yarns.section == "racetrack":
        return square * (0.25 * pi + yarns.aspect - 1.0)
    return square * (0.25 * pi * yarns.aspect)
