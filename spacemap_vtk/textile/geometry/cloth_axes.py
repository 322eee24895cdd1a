"""Compute the axes of all yarns of a cloth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.geometry.arcs import Gaps, build_axes, build_gaps
from spacemap_vtk.textile.geometry.axis_parts import Axes, sample_places
from spacemap_vtk.textile.geometry.spline import build_spline_axes
from spacemap_vtk.textile.geometry.swelling import float_growth
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import YarnIndices


class YarnSelection(NamedTuple):
    """A selection of the yarns of a cloth."""

    ends: YarnIndices
    """Numbers of the ends, ascending."""
    picks: YarnIndices
    """Numbers of the picks, ascending."""


#: Every yarn of a cloth.
ALL_YARNS = YarnSelection(slice(None), slice(None))


def cloth_axes(cloth: Cloth, selection: YarnSelection = ALL_YARNS) -> tuple[Axes, Axes]:
    """Compute the axes of warp and weft."""
    warp, weft = (family_axes(cloth, number, some) for number, some in enumerate(selection))
    return warp, weft


def family_axes(cloth: Cloth, number: int, some: YarnIndices) -> Axes:
    """Compute the axes of some ends (0) or picks (1)."""
    own, crossed = cloth.yarns[number].select(some), cloth.yarns[1 - number]
    if cloth.axis == "spline":
        height = cloth.crossing_profile(number, some).height
        return build_spline_axes(own, crossed, height, cloth.families[number].overhang)
    return build_axes(
        0.5 * own.diameter,
        own.position,
        woven_gaps(cloth, number, some),
        cloth.exact,
        floats=swelling_floats(cloth, number, some),
        growth=float_growth(cloth, number),
    )


def swelling_floats(cloth: Cloth, number: int, some: YarnIndices) -> Bools | None:
    """Return whether yarns lie over those that they cross; None if their floats do not swell."""
    if cloth.threads[number].shape != "lenticular" or cloth.layers is not None:
        return None
    # On the flats of racetracks there are more parts than crossings.
    return None if cloth.threads[1 - number].has_flats else cloth.is_over(number, some)


def woven_gaps(cloth: Cloth, number: int, some: YarnIndices = slice(None)) -> Gaps:
    """Compute the gaps of ends (0) or picks (1) as woven, for axes by arcs."""
    arc, height, bends = cloth.crossing_profile(number, some)
    past = cloth.families[number].overhang
    return build_gaps(cloth.yarns[1 - number], arc, height, past, bends=bends)


def sample_axes(cloth: Cloth, samples: int = 8) -> tuple[Floats, NDArray[np.int32]]:
    """Sample the exact axes of the yarns; the patches approximate these axes.

    Parameters
    ----------
    cloth : Cloth
        At rest.
    samples : int
        Number of points on each part of an axis.

    Returns
    -------
    points : (N, 3) float64
        In m, yarn by yarn, ends first.
    yarn : (N,) int32
        Yarn of each point.
    """
    result, owners, first_yarn = [], [], 0
    for number, family in enumerate(cloth_axes(cloth)):
        part, station, fraction = sample_places(family, samples)
        points = np.empty((len(part), 3))
        points[:, 1 - number], points[:, 2], _ = family.evaluate(part, station, fraction)
        yarn = station - part
        points[:, number] = family.lateral[yarn]
        result.append(points)
        owners.append((first_yarn + yarn).astype(np.int32))
        first_yarn += len(family.parts)
    return np.concatenate(result), np.concatenate(owners)
