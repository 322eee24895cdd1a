"""Plies and fibres of yarns as curves with radii, wherever the yarns are moved.

A curve is a uniform cubic B-spline, as renderers use for hair. It begins at its second control
point and ends at its last but one. It passes through its samples up to the fourth power of the
angle between them, see `_control_points`.

The fibres of a ply turn against the ply, so that those on its outside lie along the yarn, as in a
balanced yarn. Migration of fibres from layer to layer is limited to a share of the radius.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import AnyFloats, Bools, Ints
from spacemap_vtk.textile.geometry.plies import PHASE_STEP, ply_distance, ring_frames
from spacemap_vtk.textile.geometry.sweep import Tubes
from spacemap_vtk.textile.patches.bezier import bernstein
from spacemap_vtk.textile.weave.cloth import Cloth

#: Function that decides which of the points (n, 3) to include.
PointFilter = Callable[[AnyFloats], Bools]

#: Linear density of a cotton fibre [kg/m]; it gives the default number of fibres (W. E.
#: Morton, J. W. S. Hearle, "Physical Properties of Textile Fibres": 1 to 2.5 dtex).
FIBRE = 1.7e-7
#: Largest default number of fibres of a yarn.
_MOST = 400
#: Number of samples of a turn.
_BY_TURN = 12
#: Least number of samples of a part of an axis.
_LEAST_OF_PART = 5
#: Largest number of samples of a part of an axis.
_MOST_OF_PART = 2000
#: Amplitude by which fibres leave their layer, as a share of the radius.
_WANDER = 0.06
#: Wavelength of this, in diameters.
_WAVE = 5.3
#: Share of a section that fibres fill; with few fibres one could see through the yarn.
_DENSE = 0.75
#: Angle from a fibre of a section to the next, as between seeds of a sunflower: no two are in line.
_GOLDEN = pi * (3.0 - sqrt(5.0))


class StrandCurves(NamedTuple):
    """Strands as uniform cubic B-splines, one after another."""

    points: AnyFloats
    """(N, 3) Control points in m."""
    counts: Ints
    """(curves,) Number of control points of each curve."""
    radii: AnyFloats
    """(curves,) In m."""
    yarn: Ints
    """(curves,) Yarn of each curve; ends are numbered first, then picks."""


class _YarnRings(NamedTuple):
    number: int
    rings: slice
    tubes: Tubes
    parts: slice


def fibre_count(cloth: Cloth) -> int:
    """Compute the number of fibres in the mean yarn of a cloth.

    Parameters
    ----------
    cloth : Cloth
        If its density is not known, yarns are of cotton.

    Returns
    -------
    int
        At least 20, and at most the number that can be drawn.
    """
    area = np.mean(cloth.strands[2] ** 2) * pi / 4
    return int(np.clip(float(np.mean(cloth.densities or 900.0)) * area / FIBRE, 20, _MOST))


def build_strand_curves(
    cloth: Cloth,
    tubes: tuple[Tubes, ...],
    places: AnyFloats,
    points: NDArray[Any],
    weights: NDArray[Any] | None = None,
    fibres: int = 0,
    within: PointFilter | None = None,
) -> StrandCurves:
    """Compute the plies of yarns, or their fibres.

    Parameters
    ----------
    cloth : Cloth
        The cloth of the yarns.
    tubes, places : tuple of Tubes, ndarray of float
        Fields of its `spacemap_vtk.textile.geometry.weave.Weave`.
    points : ndarray of float, shape (N, 3)
        Its control points, wherever they have been moved [m].
    weights : ndarray of float, shape (N,), optional
        Weights of rational patches.
    fibres : int
        Approximate number of fibres of each yarn; 0 returns the plies instead.
    within : callable, optional
        Receives points (n, 3) and returns which to include; yarns are cut to these.

    Returns
    -------
    StrandCurves
        Yarn by yarn; fibres are thick enough to fill three quarters of the yarn's section.

    Raises
    ------
    SizeError
        The curves would not fit into memory.
    """
    turns, plies, diameter = cloth.strands
    made: list[tuple[AnyFloats, int, float, int]] = []
    for yarn in _iterate_yarns(tubes, places):
        number, of_ply = yarn.number, int(plies[yarn.number])
        way = places[yarn.parts, :2]
        length = way[:, 1] - way[:, 0]
        count = np.ceil(_BY_TURN * abs(turns[number]) * length).astype(int)
        axis = _sample_yarn(
            yarn, np.clip(count, _LEAST_OF_PART, _MOST_OF_PART), way, points, weights
        )
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
        require_memory(
            2 * size, f"the {strands} strands of a yarn", cure="Reduce the number of fibres."
        )
        if fibres:
            found = _fibre_curves(axis, turns[number], of_ply, each, diameter[number], number)
            radius = 0.5 * diameter[number] * sqrt(_DENSE / strands)
        else:
            found, reach = _ply_axes(axis, turns[number], of_ply, number)
            radius = 0.5 * diameter[number] * (1.0 - reach)
        made.append((_control_points(found).astype(np.float32), len(axis[0]) + 2, radius, number))
    if not made:
        none = np.zeros(0, np.int64)
        return StrandCurves(np.zeros((0, 3), np.float32), none, np.zeros(0), none)
    every = [len(found) for found, *_ in made]
    rest = (np.repeat([row[k] for row in made], every) for k in (1, 2, 3))
    return StrandCurves(np.concatenate([p.reshape(-1, 3) for p, *_ in made]), *rest)


def _iterate_yarns(tubes: tuple[Tubes, ...], places: AnyFloats) -> Iterator[_YarnRings]:
    """Yield the rings and parts of each yarn."""
    first_part = 0
    for bundle in tubes:
        ring = 0
        for parts in bundle.parts.tolist():
            rings, which = 3 * parts + 1, slice(first_part, first_part + parts)
            yield _YarnRings(int(places[first_part, 2]), slice(ring, ring + rings), bundle, which)
            ring, first_part = ring + rings, first_part + parts


def _sample_yarn(
    yarn: _YarnRings,
    count: Ints,
    way: AnyFloats,
    points: NDArray[Any],
    weights: NDArray[Any] | None,
) -> tuple[AnyFloats, ...]:
    """Sample centre, half height and half width of a yarn's section, and the position along it."""
    tubes, size = yarn.tubes, yarn.tubes.ring
    own = slice(tubes.first + size * yarn.rings.start, tubes.first + size * yarn.rings.stop)
    rings = np.stack(ring_frames(points[own].reshape(-1, size, 3).astype(np.float64)), axis=1)
    part = np.append(np.repeat(np.arange(len(count)), count), len(count) - 1)
    step = np.arange(len(part)) - np.append((np.cumsum(count) - count)[part[:-1]], 0)
    u = np.append(step[:-1] / count[part[:-1]], 1.0)
    at, basis = 3 * part[:, None] + np.arange(4), bernstein(3, u)
    if weights is not None:
        basis = basis * weights[own][::size][at]
        basis /= basis.sum(axis=1, keepdims=True)
    middle, top, side = np.einsum("sk,skcx->csx", basis, rings[at])
    return middle, top, side, (1.0 - u) * way[part, 0] + u * way[part, 1]


def _ply_axes(
    axis: tuple[AnyFloats, ...], turns: float, plies: int, number: int
) -> tuple[AnyFloats, float]:
    """Compute axes of plies, (plies, samples, 3), and their distance over the yarn's radius."""
    middle, top, side, way = axis
    reach = float(ply_distance(np.array(float(plies)))) if plies > 1 else 0.0
    # As for the crowns of the surface, turns are counted against the screw.
    begun = np.arange(plies)[:, None] / plies - PHASE_STEP * number
    phi = 2.0 * pi * (begun - turns * way)[..., None]
    return middle + reach * (np.cos(phi) * top + np.sin(phi) * side), reach


def _fibre_curves(
    axis: tuple[AnyFloats, ...], turns: float, plies: int, each: int, diameter: float, number: int
) -> AnyFloats:
    """Compute fibres, (fibres, samples, 3): in each ply they lie like the seeds of a sunflower."""
    _, top, side, way = axis
    centres, reach = _ply_axes(axis, turns, plies, number)
    seed = np.arange(plies * each).reshape(plies, each, 1)
    layer = np.sqrt((seed % each + 0.5) / each)
    wave = 2.0 * pi * (way / (_WAVE * diameter) + PHASE_STEP * seed)
    layer = (1.0 - _WANDER) * layer + _WANDER * layer * np.sin(wave)
    own = turns if plies == 1 else -turns * reach / (1.0 - reach)
    phi = _GOLDEN * seed - 2.0 * pi * (own * way + PHASE_STEP * number)
    out = (1.0 - reach - sqrt(_DENSE / (plies * each))) * layer
    across, up = (out * np.sin(phi))[..., None], (out * np.cos(phi))[..., None]
    found = centres[:, None] + up * top + across * side
    return found.reshape(plies * each, len(way), 3)


def _control_points(samples: AnyFloats) -> AnyFloats:
    """Compute control points of B-splines through samples (n, s, 3), one more at each end."""
    # (c- + 4 c + c+) / 6 = p is solved by c = p - p''/6 up to fourth differences: on a helix with
    # 12 samples per turn the radius is off by 0.2 %.
    control = samples.copy()
    control[:, 1:-1] -= np.diff(samples, 2, axis=1) / 6.0
    first, last = 2.0 * control[:, :1] - control[:, 1:2], 2.0 * control[:, -1:] - control[:, -2:-1]
    return np.concatenate([first, control, last], axis=1)
