"""Convert the loads on a cage at a time into arrows."""

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

#: Colour of the arrows of each kind of load.
ARROW_COLORS = {
    "gravity": "#c8323a",
    "pressure": "#2f8f5b",
    "traction": "#2f8f5b",
    "force": "#b0307a",
    "array": "#b0307a",
    "base_acceleration": "#7a4fb5",
    "base_displacement": "#7a4fb5",
}
#: Length of an arrow as a share of the cage's diagonal, for loads with a single arrow.
_LONG = 0.24
#: The same for loads with many arrows.
_SHORT = 0.11
#: Lengths of arrows by kind of load, as shares of the cage's diagonal; _LONG for other kinds.
_LENGTHS = {"pressure": _SHORT, "traction": _SHORT, "array": _SHORT}
#: Kinds of load that act on the whole cage.
_WHOLE_CAGE = ("gravity", "base_acceleration", "base_displacement")
#: Largest number of arrows on a side of the cage; more would only hide the view.
_MAX_ARROWS = 48
#: Number of times at which the largest factor of a load is searched.
_SAMPLES = 200


class Arrows(NamedTuple):
    """Arrows of loads, in m."""

    starts: Floats
    """(n, 3) Starts of the arrows."""
    vectors: Floats
    """(n, 3) Vectors from start to tip."""
    kinds: tuple[str, ...]
    """(n,) Kinds of load, keys of `ARROW_COLORS`."""
    places: Floats
    """(n, 3) Points where the loads act; NaN for loads on the whole cage."""
    reach: Floats
    """(m, 3) Ends of all arrows at the least and at the largest factor of their loads."""


def load_arrows(
    response: LoadParameters,
    cage: vtkUnstructuredGrid,
    time: float,
    dead_loads: Sequence[Load] = (),
) -> Arrows:
    """Return the arrows of the loads on a cage; dead loads, of its equilibrium, act always."""
    rest = points_of(cage).astype(np.float64)
    moved = rest + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
    size = float(np.linalg.norm(np.ptp(rest, axis=0)))
    empty = np.zeros((0, 3))
    starts, vectors, places, reach, kinds = [empty], [empty], [empty], [empty], []

    def add(
        load: str, ends: Floats, directions: Floats, starts_here: bool, factors: _Factors
    ) -> None:
        arrows = directions * (_LENGTHS.get(load, _LONG) * size)
        for factor in (factors.least, factors.largest):
            reach.extend([ends, ends + arrows * (factor if starts_here else -factor)])
        visible = np.linalg.norm(directions, axis=1) * abs(factors.now) > 0.02
        scaled = arrows[visible] * factors.now
        starts.append(ends[visible] if starts_here else ends[visible] - scaled)
        vectors.append(scaled)
        places.append(np.where(load in _WHOLE_CAGE, np.nan, ends[visible]))
        kinds.extend([load] * int(visible.sum()))

    always = _Factors(1.0, 1.0, 1.0)
    gravity = response.gravity_for(cage)
    if gravity.any() and time >= 0.0:
        direction = _unit(tuple(gravity))
        add("gravity", _exit_point(moved, cage, direction), direction, True, always)
    acting = [(load, always) for load in dead_loads]
    acting += [(load, _factors(load, time, response.duration)) for load in response.loads]
    for load, factors in acting:
        for ends, directions, starts_here in _places_and_directions(load, rest, moved, cage):
            add(load.action, ends, directions, starts_here, factors)
    all_starts, all_vectors, all_places, all_reach = map(
        np.concatenate, (starts, vectors, places, reach)
    )
    return Arrows(all_starts, all_vectors, tuple(kinds), all_places, all_reach)


def _places_and_directions(
    load: Load, rest: Floats, moved: Floats, cage: vtkUnstructuredGrid
) -> Iterator[tuple[Floats, Floats, bool]]:
    """Yield places of a load, directions with sizes up to 1, and whether arrows start there."""
    action, value = load.action, getattr(load, load.action)
    if action in ("pressure", "traction"):
        wall = forces.find_side_faces(rest, elements_of(cage), load.on)
        shown = np.unique(np.linspace(0, len(wall.nodes) - 1, _MAX_ARROWS).astype(int))
        places = moved[wall.nodes[shown]].mean(axis=1)
        direction = -np.sign(value) * wall.normal if action == "pressure" else _unit(value)[0]
        directions = np.tile(direction, (len(places), 1))
        if load.follower:
            edges = np.diff(moved[wall.faces[shown, :3]], axis=1)
            normals = np.cross(edges[:, 0], edges[:, 1])
            directions = -np.sign(value) * normals / np.linalg.norm(normals, axis=1, keepdims=True)
        # The arrows of a pressure end at the side that it pushes; those of a suction begin there.
        yield places, directions, action == "traction" or value < 0
    elif action == "force":
        nearest = forces.nearest_vertices(rest, load.at)
        yield moved[nearest].mean(axis=0, keepdims=True), _unit(value), False
    elif action == "array":
        array = cage.GetPointData().GetArray(load.array)
        if array is not None:
            field = vtk_to_numpy(array).astype(np.float64)
            largest = float(np.linalg.norm(field, axis=1).max()) or 1.0
            yield moved, field / largest, False
    else:
        direction = _unit(value)
        yield _exit_point(moved, cage, direction), direction, True


def _exit_point(points: Floats, cage: vtkUnstructuredGrid, direction: Floats) -> Floats:
    """Return the point where a line from the centre of the points leaves their cage, (1, 3)."""
    # The line crosses several faces of tetrahedra; the farthest crossing is the result.
    middle, along = points.mean(axis=0), direction[0]
    across = np.linalg.svd(direction)[2][1:]
    across_line, depth = (points - middle) @ across.T, (points - middle) @ along
    faces = elements_of(cage)[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3)
    x, y = np.moveaxis(across_line[faces], 2, 0)
    # Barycentric coordinates of the line in each face, times twice the face's projected area.
    weights = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - x[:, [2, 0, 1]] * y[:, [1, 2, 0]]
    total = weights.sum(axis=1)
    crossed = (np.abs(total) > 1e-12 * np.abs(total).max()) & (
        weights * np.sign(total)[:, None] >= -1e-9 * np.abs(total)[:, None]
    ).all(axis=1)
    if not crossed.any():  # the cage is a ring, and its centre is empty
        return middle[None]
    depths = (weights[crossed] * depth[faces[crossed]]).sum(axis=1) / total[crossed]
    return (middle + along * max(0.0, depths.max()))[None]


def _unit(vector: tuple[float, ...]) -> Floats:
    values = np.array([vector], np.float64)
    return values / (float(np.linalg.norm(values)) or 1.0)


class _Factors(NamedTuple):
    """Factors of a load, divided by the largest absolute factor over the duration."""

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
