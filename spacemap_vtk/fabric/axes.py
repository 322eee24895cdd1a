"""From a drawdown and a cloth to the axes of all yarns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.arcs import arc_axes
from spacemap_vtk.fabric.axis import Axes, sampled
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.spline import spline_axes


class Share(NamedTuple):
    """Some of the yarns of a cloth."""

    ends: slice | NDArray[np.int64]
    """Numbers of the ends, ascending."""
    picks: slice | NDArray[np.int64]
    """Numbers of the picks, ascending."""


#: Every yarn of a cloth.
ALL = Share(slice(None), slice(None))


def checked(drawdown: ArrayLike, cloth: Cloth) -> NDArray[np.bool_]:
    """Return a drawdown as a matrix, and refuse one that is none."""
    over = np.asarray(drawdown, dtype=bool)
    if over.ndim != 2 or over.size == 0:
        raise InputError(
            f"a drawdown is a matrix of at least one pick and one end, not one of {over.shape}",
            key="drawdown",
            cure="Give a row for each pick and a column for each end",
        )
    if cloth.overhang == 0.0 and min(over.shape) == 1:
        raise InputError(
            "a yarn with one crossing needs an overhang",
            key="overhang",
            value=0.0,
            allowed="more than 0 m",
        )
    return over


def axes(drawdown: ArrayLike, cloth: Cloth, share: Share = ALL) -> tuple[Axes, Axes]:
    """Return the axes of warp and weft."""
    over = checked(drawdown, cloth)
    warp, weft = cloth.yarns("warp", over.shape[1]), cloth.yarns("weft", over.shape[0])
    past = [family.overhang for family in cloth.families]
    ends, picks = warp.chosen(share.ends), weft.chosen(share.picks)
    upper, under = over.T[share.ends], ~over[share.picks]
    height = cloth.share
    if cloth.axis == "spline":
        return (
            spline_axes(upper, ends, weft, height, past[0]),
            spline_axes(under, picks, warp, 1.0 - height, past[1]),
        )
    return (
        arc_axes(upper, ends, weft, height, past[0], cloth.exact),
        arc_axes(under, picks, warp, 1.0 - height, past[1], cloth.exact),
    )


def axis_points(
    drawdown: ArrayLike, cloth: Cloth, samples: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return points on the exact axes of the yarns, which the patches approximate."""
    result, owners, first_yarn = [], [], 0
    for number, family in enumerate(axes(drawdown, cloth)):
        part, station, fraction = sampled(family, samples)
        points = np.empty((len(part), 3))
        points[:, 1 - number], points[:, 2], _ = family.at(part, station, fraction)
        yarn = station - part
        points[:, number] = family.lateral[yarn]
        result.append(points)
        owners.append((first_yarn + yarn).astype(np.int32))
        first_yarn += len(family.parts)
    return np.concatenate(result), np.concatenate(owners)
