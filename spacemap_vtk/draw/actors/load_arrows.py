"""Loads as arrows: what acts on a cage at a time, where, and which way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import elements_of, points_of
from spacemap_vtk.filters.load import Load
from spacemap_vtk.filters.load_parameters import LoadParameters
from spacemap_vtk.mechanics.boundary import loads as forces
from spacemap_vtk.ndarrays import Floats

#: What an arrow stands for, and its colour.
KINDS = {
    "gravity": "#c8323a",
    "pressure": "#2f8f5b",
    "traction": "#2f8f5b",
    "force": "#b0307a",
    "array": "#b0307a",
    "base_acceleration": "#7a4fb5",
    "base_displacement": "#7a4fb5",
}
#: Lengths as shares of the cage's diagonal: of a load on the whole cage or at one place, and of
#: those that many arrows stand for.
_LONG, _SHORT = 0.24, 0.11
_LENGTHS = {"pressure": _SHORT, "traction": _SHORT, "array": _SHORT}
#: What acts on all of a cage.
_WHOLE = ("gravity", "base_acceleration", "base_displacement")
#: On a side no more arrows are drawn: a forest says no more than a row.
_MOST = 48
#: Times over which a load's largest factor is looked for.
_SAMPLES = 200


class Arrows(NamedTuple):
    """Arrows, in m."""

    starts: Floats
    """(n, 3)"""
    vectors: Floats
    """(n, 3), from start to tip."""
    kinds: tuple[str, ...]
    """(n,), keys of `KINDS`."""
    places: Floats
    """(n, 3), which of its ends is where it acts; of a load on the whole cage not a number."""
    reach: Floats
    """(m, 3), both ends of all arrows while their loads are strongest, one way and the other."""


def load_arrows(
    response: LoadParameters, cage: vtkUnstructuredGrid, time: float, dead: Sequence[Load] = ()
) -> Arrows:
    """Return what acts on a cage; dead loads, under which it hangs, always do."""
    rest = points_of(cage).astype(np.float64)
    moved = rest + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
    size = float(np.linalg.norm(np.ptp(rest, axis=0)))
    none = np.zeros((0, 3))
    starts, vectors, places, reach, kinds = [none], [none], [none], [none], []

    def add(load: str, ends: Floats, ways: Floats, pull: bool, factors: _Factors) -> None:
        arrows = ways * (_LENGTHS.get(load, _LONG) * size)
        for factor in (factors.least, factors.largest):
            reach.extend([ends, ends + arrows * (factor if pull else -factor)])
        seen = np.linalg.norm(ways, axis=1) * abs(factors.now) > 0.02
        scaled = arrows[seen] * factors.now
        starts.append(ends[seen] if pull else ends[seen] - scaled)
        vectors.append(scaled)
        places.append(np.where(load in _WHOLE, np.nan, ends[seen]))
        kinds.extend([load] * int(seen.sum()))

    always = _Factors(1.0, 1.0, 1.0)
    gravity = response.gravity_on(cage)
    if gravity.any() and time >= 0.0:
        way = _unit(tuple(gravity))
        add("gravity", _leaving(moved, cage, way), way, True, always)
    acting = [(load, always) for load in dead]
    acting += [(load, _factors(load, time, response.duration)) for load in response.loads]
    for load, factors in acting:
        for ends, ways, pull in _placed(load, rest, moved, cage):
            add(load.action, ends, ways, pull, factors)
    begun, along, where, far = map(np.concatenate, (starts, vectors, places, reach))
    return Arrows(begun, along, tuple(kinds), where, far)


def _placed(
    load: Load, rest: Floats, moved: Floats, cage: vtkUnstructuredGrid
) -> Iterator[tuple[Floats, Floats, bool]]:
    """Yield where a load acts, its direction there with a size up to 1, and if it starts there."""
    action, value = load.action, getattr(load, load.action)
    if action in ("pressure", "traction"):
        where = forces.wall(rest, elements_of(cage), load.on)
        shown = np.unique(np.linspace(0, len(where.nodes) - 1, _MOST).astype(int))
        places = moved[where.nodes[shown]].mean(axis=1)
        way = -np.sign(value) * where.normal if action == "pressure" else _unit(value)[0]
        ways = np.tile(way, (len(places), 1))
        if load.follower:
            legs = np.diff(moved[where.faces[shown, :3]], axis=1)
            out = np.cross(legs[:, 0], legs[:, 1])
            ways = -np.sign(value) * out / np.linalg.norm(out, axis=1, keepdims=True)
        # A pressure ends at the side that it pushes, a suction begins there.
        yield places, ways, action == "traction" or value < 0
    elif action == "force":
        nearest = forces.nearest(rest, load.at)
        yield moved[[nearest]], _unit(value), False
    elif action == "array":
        array = cage.GetPointData().GetArray(load.array)
        if array is not None:
            field = vtk_to_numpy(array).astype(np.float64)
            largest = float(np.linalg.norm(field, axis=1).max()) or 1.0
            yield moved, field / largest, False
    else:
        way = _unit(value)
        yield _leaving(moved, cage, way), way, True


def _leaving(points: Floats, cage: vtkUnstructuredGrid, way: Floats) -> Floats:
    """Return where a line from the middle of some points leaves their cage, (1, 3)."""
    # Whatever does not cross the line in its own plane is left out; of the rest the farthest
    # counts.
    middle, ahead = points.mean(axis=0), way[0]
    across = np.linalg.svd(way)[2][1:]
    aside, depth = (points - middle) @ across.T, (points - middle) @ ahead
    faces = elements_of(cage)[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3)
    x, y = np.moveaxis(aside[faces], 2, 0)
    # Barycentric coordinates of the line, times twice the area that a face shows along it.
    weights = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - x[:, [2, 0, 1]] * y[:, [1, 2, 0]]
    total = weights.sum(axis=1)
    crossed = (np.abs(total) > 1e-12 * np.abs(total).max()) & (
        weights * np.sign(total)[:, None] >= -1e-9 * np.abs(total)[:, None]
    ).all(axis=1)
    if not crossed.any():  # a ring, whose middle is no part of it
        return middle[None]
    far = (weights[crossed] * depth[faces[crossed]]).sum(axis=1) / total[crossed]
    return (middle + ahead * max(0.0, far.max()))[None]


def _unit(vector: tuple[float, ...]) -> Floats:
    values = np.array([vector], np.float64)
    return values / (float(np.linalg.norm(values)) or 1.0)


class _Factors(NamedTuple):
    """A load's factor as shares of its largest size over the duration."""

    now: float
    least: float
    largest: float


def _factors(load: Load, time: float, duration: float) -> _Factors:
    function = load.function
    values = [function.value(t) for t in np.linspace(0.0, duration, _SAMPLES).tolist()]
    least, largest = min(0.0, *values), max(0.0, *values)
    size = max(-least, largest)
    if size <= 0.0:
        return _Factors(0.0, 0.0, 0.0)
    return _Factors(function.value(time) / size, least / size, largest / size)
