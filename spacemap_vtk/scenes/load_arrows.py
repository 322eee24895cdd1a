"""Loads as arrows: what acts on a cage at a time, where, and which way."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.filters.arrays import elements_of, points_of
from spacemap_vtk.filters.load import Load
from spacemap_vtk.filters.modal_response import ModalResponse
from spacemap_vtk.modal import loads as forces

FloatArray = NDArray[np.float64]

#: What an arrow stands for, and its colour.
KINDS = {
    "gravity": "#5b6b7d",
    "pressure": "#2f8f5b",
    "traction": "#2f8f5b",
    "force": "#b0307a",
    "array": "#b0307a",
    "base_acceleration": "#7a4fb5",
    "base_displacement": "#7a4fb5",
}
#: Lengths as shares of the cage's diagonal: of a load on the whole cage, and of one at a place.
_LONG, _SHORT = 0.24, 0.11
#: On a side no more arrows are drawn: a forest says no more than a row.
_MOST = 48
#: Times over which a load's largest factor is looked for.
_SAMPLES = 200


class Arrows(NamedTuple):
    """Arrows, in m."""

    starts: FloatArray
    """(n, 3)"""
    vectors: FloatArray
    """(n, 3), from start to tip."""
    kinds: tuple[str, ...]
    """(n,), keys of `KINDS`."""


def load_arrows(response: ModalResponse, cage: vtkUnstructuredGrid, time: float) -> Arrows:
    """Return what acts on a cage.

    Parameters
    ----------
    response : ModalResponse
        Gravity and loads.
    cage : vtkUnstructuredGrid
        Its output: a mesh at rest with ``displacement``.
    time : float
        In s.

    Returns
    -------
    Arrows
        As long as the load's factor is at the time, compared with its largest; none where it is
        zero. Forces end where they act, on the cage as it is moved.
    """
    rest = points_of(cage).astype(np.float64)
    moved = rest + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
    size = float(np.linalg.norm(np.ptp(rest, axis=0)))
    starts, vectors, kinds = [], [], []

    def add(kind: str, tips: FloatArray, arrows: FloatArray, length: float, pull: bool) -> None:
        sizes = np.linalg.norm(arrows, axis=1)
        seen = sizes > 0.02
        scaled = arrows[seen] * length * size
        starts.append(tips[seen] if pull else tips[seen] - scaled)
        vectors.append(scaled)
        kinds.extend([kind] * int(seen.sum()))

    if any(response.gravity) and time >= 0.0:
        way = _unit(response.gravity)
        add("gravity", _leaving(moved, way), way, _LONG, True)
    for load in response.loads:
        factor = _share(load, time, response.duration)
        for tips, arrows, pull in _placed(load, rest, moved, cage):
            whole = load.action in ("gravity", "base_acceleration", "base_displacement")
            add(load.action, tips, arrows * factor, _LONG if whole else _SHORT, pull)
    if not starts:
        return Arrows(np.zeros((0, 3)), np.zeros((0, 3)), ())
    return Arrows(np.concatenate(starts), np.concatenate(vectors), tuple(kinds))


def _placed(
    load: Load, rest: FloatArray, moved: FloatArray, cage: vtkUnstructuredGrid
) -> Iterator[tuple[FloatArray, FloatArray, bool]]:
    """Yield where a load acts, its direction there with a size up to 1, and if it starts there."""
    action, value = load.action, getattr(load, load.action)
    if action in ("pressure", "traction"):
        where = forces.wall(rest, elements_of(cage), load.on)
        places = moved[where.nodes].mean(axis=1)
        places = places[np.unique(np.linspace(0, len(places) - 1, _MOST).astype(int))]
        way = -np.sign(value) * where.normal if action == "pressure" else _unit(value)[0]
        # A pressure ends at the side that it pushes, a suction begins there.
        yield places, np.tile(way, (len(places), 1)), action == "traction" or value < 0
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
        yield _leaving(moved, way), way, True


def _leaving(points: FloatArray, way: FloatArray) -> FloatArray:
    """Return where a line from the middle leaves the box of some points, (1, 3)."""
    half = np.ptp(points, axis=0) / 2
    sizes = np.abs(way[0])
    steps = np.divide(half, sizes, out=np.full(3, np.inf), where=sizes > 0.0)
    middle = points.min(axis=0) + half
    return (middle + way[0] * (steps.min() if np.isfinite(steps.min()) else 0.0))[None]


def _unit(vector: tuple[float, ...]) -> FloatArray:
    values = np.array([vector], np.float64)
    return values / (float(np.linalg.norm(values)) or 1.0)


def _share(load: Load, time: float, duration: float) -> float:
    """Return a load's factor at a time as a share of its largest over the duration."""
    largest = _largest(load, duration)
    return float(load.function.value(time)) / largest if largest > 0.0 else 0.0


@lru_cache(maxsize=64)
def _largest(load: Load, duration: float) -> float:
    times = np.linspace(0.0, duration, _SAMPLES)
    return max(abs(float(load.function.value(time))) for time in times)
