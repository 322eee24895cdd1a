"""Plies and fibres of yarns as curves with radii, wherever the yarns have been moved to.

A curve is a uniform cubic B-spline: hair of renderers. It begins at the second of its control
points and ends at the last but one, and runs through its samples but for a fourth power of the
angle between them, see `_control`.

A ply's fibres turn against the ply, so far that those on its outside lie along the yarn: so a
balanced yarn looks. Migration of fibres from layer to layer is left at a share of the radius.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.memory import require
from spacemap_vtk.ndarrays import AnyFloats, Bools, Ints
from spacemap_vtk.textile.geometry.plies import APART, frames, middle_of_plies
from spacemap_vtk.textile.geometry.sweep import Tubes
from spacemap_vtk.textile.patches.bezier import bernstein
from spacemap_vtk.textile.weave.cloth import Cloth

#: Says of places, (n, 3), which are wanted.
Within = Callable[[AnyFloats], Bools]

#: Linear density of a cotton fibre [kg/m], by which fibres are counted where nobody does (W. E.
#: Morton, J. W. S. Hearle, "Physical Properties of Textile Fibres": 1 to 2.5 dtex).
FIBRE = 1.7e-7
#: Fibres of a yarn, at most, where they are counted.
_MOST = 400
#: Samples of a turn, of a part of an axis at least, and of a part at most.
_BY_TURN, _LEAST_OF_PART, _MOST_OF_PART = 12, 5, 2000
#: How far fibres wander from their layer, as a share of the radius, in how many diameters.
_WANDER, _WAVE = 0.06, 5.3
#: Share of a section that fibres fill: those that are seen through are few.
_DENSE = 0.75
#: From a fibre of a section to the next: no two of a sunflower's seeds lie in a row.
_GOLDEN = pi * (3.0 - sqrt(5.0))


class StrandCurves(NamedTuple):
    """Strands as uniform cubic B-splines, end to end."""

    points: AnyFloats
    """(N, 3) Control points in m."""
    counts: Ints
    """(curves,) Control points of each."""
    radii: AnyFloats
    """(curves,) In m."""
    yarn: Ints
    """(curves,) Number of the yarn each is of: the ends first, then the picks."""


class _Yarn(NamedTuple):
    number: int
    rings: slice
    tubes: Tubes
    parts: slice


def fibre_count(cloth: Cloth) -> int:
    """Return how many fibres the mean yarn of a cloth has.

    Parameters
    ----------
    cloth : Cloth
        One whose density is not known has yarns of cotton.

    Returns
    -------
    int
        From 20 on, and at most what can be drawn.
    """
    area = np.mean(cloth.strands[2] ** 2) * pi / 4
    return int(np.clip((cloth.density or 900.0) * area / FIBRE, 20, _MOST))


def strand_curves(
    cloth: Cloth,
    tubes: tuple[Tubes, ...],
    places: AnyFloats,
    points: NDArray[Any],
    weights: NDArray[Any] | None = None,
    fibres: int = 0,
    within: Within | None = None,
) -> StrandCurves:
    """Return the plies of yarns, or their fibres.

    Parameters
    ----------
    cloth : Cloth
        Theirs.
    tubes, places : tuple of Tubes, ndarray of float
        Of its `spacemap_vtk.textile.geometry.weave.Weave`.
    points : ndarray of float, shape (N, 3)
        Its control points, wherever they have been moved to [m].
    weights : ndarray of float, shape (N,), optional
        Of rational patches.
    fibres : int
        How many each yarn has, about; 0: its plies are returned.
    within : callable, optional
        Takes places (n, 3), and returns for each whether it is wanted; yarns are cut to that.

    Returns
    -------
    StrandCurves
        Yarn by yarn; fibres are so thick that they fill three quarters of the yarn's section.

    Raises
    ------
    SizeError
        If they would not fit into memory.
    """
    turns, plies, diameter = cloth.strands
    made: list[tuple[AnyFloats, int, float, int]] = []
    for yarn in _yarns(tubes, places):
        number, of_ply = yarn.number, int(plies[yarn.number])
        way = places[yarn.parts, :2]
        length = way[:, 1] - way[:, 0]
        count = np.ceil(_BY_TURN * abs(turns[number]) * length).astype(int)
        axis = _sampled(yarn, np.clip(count, _LEAST_OF_PART, _MOST_OF_PART), way, points, weights)
        if within is not None:
            there = np.flatnonzero(within(axis[0]))
            if not len(there):
                continue
            axis = tuple(each[there[0] : there[-1] + 1] for each in axis)
            if len(axis[0]) < 2:
                continue
        each = max(1, round(fibres / of_ply))
        strands = of_ply * each
        size = 12 * strands * (len(axis[0]) + 2)
        require(2 * size, f"the {strands} strands of a yarn", cure="Ask for fewer fibres.")
        if fibres:
            found = _fibres(axis, turns[number], of_ply, each, diameter[number], number)
            radius = 0.5 * diameter[number] * sqrt(_DENSE / strands)
        else:
            found, reach = _plies(axis, turns[number], of_ply, number)
            radius = 0.5 * diameter[number] * (1.0 - reach)
        made.append((_control(found).astype(np.float32), len(axis[0]) + 2, radius, number))
    if not made:
        none = np.zeros(0, np.int64)
        return StrandCurves(np.zeros((0, 3), np.float32), none, np.zeros(0), none)
    every = [len(found) for found, *_ in made]
    rest = (np.repeat([row[k] for row in made], every) for k in (1, 2, 3))
    return StrandCurves(np.concatenate([p.reshape(-1, 3) for p, *_ in made]), *rest)


def _yarns(tubes: tuple[Tubes, ...], places: AnyFloats) -> Iterator[_Yarn]:
    """Yield where the rings and parts of each yarn are."""
    first_part = 0
    for bundle in tubes:
        ring = 0
        for parts in bundle.parts.tolist():
            rings, which = 3 * parts + 1, slice(first_part, first_part + parts)
            yield _Yarn(int(places[first_part, 2]), slice(ring, ring + rings), bundle, which)
            ring, first_part = ring + rings, first_part + parts


def _sampled(
    yarn: _Yarn, count: Ints, way: AnyFloats, points: NDArray[Any], weights: NDArray[Any] | None
) -> tuple[AnyFloats, ...]:
    """Return middle, half height and half width of a yarn's section all along, and the way."""
    tubes, size = yarn.tubes, yarn.tubes.ring
    own = slice(tubes.first + size * yarn.rings.start, tubes.first + size * yarn.rings.stop)
    rings = np.stack(frames(points[own].reshape(-1, size, 3).astype(np.float64)), axis=1)
    part = np.append(np.repeat(np.arange(len(count)), count), len(count) - 1)
    step = np.arange(len(part)) - np.append((np.cumsum(count) - count)[part[:-1]], 0)
    u = np.append(step[:-1] / count[part[:-1]], 1.0)
    at, basis = 3 * part[:, None] + np.arange(4), bernstein(3, u)
    if weights is not None:
        basis = basis * weights[own][::size][at]
        basis /= basis.sum(axis=1, keepdims=True)
    middle, top, side = np.einsum("sk,skcx->csx", basis, rings[at])
    return middle, top, side, (1.0 - u) * way[part, 0] + u * way[part, 1]


def _plies(
    axis: tuple[AnyFloats, ...], turns: float, plies: int, number: int
) -> tuple[AnyFloats, float]:
    """Return (plies, samples, 3), and the share of the radius at which their middles are."""
    middle, top, side, way = axis
    reach = float(middle_of_plies(np.array(float(plies)))) if plies > 1 else 0.0
    # as the surface's crowns are: the way round is against the screw
    begun = np.arange(plies)[:, None] / plies - APART * number
    phi = 2.0 * pi * (begun - turns * way)[..., None]
    return middle + reach * (np.cos(phi) * top + np.sin(phi) * side), reach


def _fibres(
    axis: tuple[AnyFloats, ...], turns: float, plies: int, each: int, diameter: float, number: int
) -> AnyFloats:
    """Return (fibres, samples, 3): of each ply a sunflower's seeds."""
    _, top, side, way = axis
    centres, reach = _plies(axis, turns, plies, number)
    seed = np.arange(plies * each).reshape(plies, each, 1)
    layer = np.sqrt((seed % each + 0.5) / each)
    wave = 2.0 * pi * (way / (_WAVE * diameter) + APART * seed)
    layer = (1.0 - _WANDER) * layer + _WANDER * layer * np.sin(wave)
    own = turns if plies == 1 else -turns * reach / (1.0 - reach)
    phi = _GOLDEN * seed - 2.0 * pi * (own * way + APART * number)
    out = (1.0 - reach - sqrt(_DENSE / (plies * each))) * layer
    across, up = (out * np.sin(phi))[..., None], (out * np.cos(phi))[..., None]
    found = centres[:, None] + up * top + across * side
    return found.reshape(plies * each, len(way), 3)


def _control(samples: AnyFloats) -> AnyFloats:
    """Return the control points of B-splines through samples (n, s, 3), one more at each end."""
    # (c- + 4 c + c+) / 6 = p is solved by c = p - p''/6 but for fourth differences: on a helix of
    # 12 samples a turn the radius is off by 0.2 %
    control = samples.copy()
    control[:, 1:-1] -= np.diff(samples, 2, axis=1) / 6.0
    first, last = 2.0 * control[:, :1] - control[:, 1:2], 2.0 * control[:, -1:] - control[:, -2:-1]
    return np.concatenate([first, control, last], axis=1)
