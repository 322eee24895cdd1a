"""Find the tetrahedron of each point, and the weights of its corners.

Equations (6) to (9) of Furukawa, Kitagawa and Shimizu, "Deformation of Flexible Objects Based on
Space Mapping". In (9) the orientation of the tetrahedron is included, so any orientation works. The
paper does not define points outside the cage; they belong to the nearest tetrahedron, by exact
distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from spacemap_vtk.embedding.background_grid import BackgroundGrid
from spacemap_vtk.embedding.frames import Frames
from spacemap_vtk.embedding.lattice_locate import recognise_lattice
from spacemap_vtk.embedding.nearest import NearestTetrahedron
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import AnyInts, Bools, Floats
from spacemap_vtk.parallel import blocks, for_each

_BLOCK = 2**14  # points in one block; it limits the temporary memory


@dataclass(frozen=True)
class Location:
    """Positions of points in a tetrahedral mesh.

    Parameters
    ----------
    tetrahedron : (N,) int32
        Tetrahedron of each point.
    weights : (N, 4) float64
        Weights of its corners, with the sum 1; negative ones extrapolate. (0, 4) if not requested.
    is_outside : (N,) bool
        True for points outside every tetrahedron.
    outside : int
        Number of these points.
    largest_distance : float
        Their largest distance from the mesh, in the unit of the points; 0 if there are none.
    """

    tetrahedron: NDArray[np.int32]
    weights: Floats
    is_outside: Bools
    outside: int
    largest_distance: float


def locate(
    points: ArrayLike,
    vertices: ArrayLike,
    tetrahedra: ArrayLike,
    outside: str = "extrapolate",
    *,
    weighted: bool = True,
    threads: int | None = None,
) -> Location:
    """Find the tetrahedron that each point belongs to, and the weights of its corners.

    A point on a face that several tetrahedra share belongs to the one with the lowest number. This
    depends neither on other points nor on their order. A point outside every tetrahedron belongs
    to the nearest one, by exact distance.

    Parameters
    ----------
    points : (N, 3) array_like
        In m.
    vertices : (V, 3) array_like
        Vertices of the mesh in m.
    tetrahedra : (T, 4) array_like of int
        Vertices of each tetrahedron, in any orientation. Flat ones contain no points.
    outside : {"extrapolate", "clamp", "error"}
        Treatment of points outside: weights of their position, some of them negative; weights of
        the nearest point of the mesh; or an error.
    weighted : bool, optional
        Whether weights are returned.
    threads : int, optional
        Number of threads; by default one for each processor.

    Returns
    -------
    Location
        Tetrahedra, weights, and points outside.

    Raises
    ------
    GeometryError
        A coordinate is not finite, a shape or vertex number is wrong, there are no tetrahedra or
        all are flat; with ``outside="error"``, points lie outside.
    InputError
        `outside` is not one of the three values.

    Notes
    -----
    In a lattice (see `spacemap_vtk.embedding.lattice_locate`) points are found by arithmetic.
    Elsewhere, and outside, they are searched in a grid of cells.

    A point is inside if its barycentric coordinates are at least -1e-9, or if it is outside by less
    than the rounding of the coordinates (in the precision in which points are passed).

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> where = locate([[0.5, 0.25, 0.125], [2, 0, 0]], corners, [[0, 1, 2, 3]])
    >>> where.weights.tolist()
    [[0.125, 0.5, 0.25, 0.125], [-1.0, 2.0, 0.0, 0.0]]
    >>> where.outside, where.largest_distance
    (1, 1.0)
    """
    if outside not in ("extrapolate", "clamp", "error"):
        raise InputError(
            "unknown treatment of points outside",
            key="outside",
            value=outside,
            allowed="extrapolate, clamp, error",
        )
    given = np.asarray(points)
    single = given.dtype in (np.float32, np.float16)
    places = _check_points(given, "point", np.float32 if single else np.float64)
    nodes = _check_points(vertices, "vertex of the cage", np.float64)
    cells = _check_tetrahedra(tetrahedra, len(nodes))
    epsilon = float(np.finfo(np.float32 if single else np.float64).eps)
    tetrahedron = np.empty(len(places), dtype=np.int32)
    weights = np.empty((len(places) if weighted else 0, 4))

    def coordinates(which: slice | NDArray[np.intp]) -> Floats:
        return np.asarray(places[which], np.float64)  # block by block: a full copy would be large

    pattern = recognise_lattice(nodes, cells)
    left: NDArray[np.intp] | None = None  # points that must be searched; None: all
    if pattern is not None:

        def calculate(block: slice) -> None:
            some = coordinates(block)
            rows = weights[block] if weighted else np.empty((len(some), 4))
            pattern.find(some, epsilon, tetrahedron[block], rows)

        for_each(blocks(len(places), _BLOCK), lambda: calculate, threads)
        left = np.flatnonzero(tetrahedron < 0)
        if not len(left):
            return Location(tetrahedron, weights, np.zeros(len(places), dtype=np.bool_), 0, 0.0)

    frames = Frames(nodes, cells, epsilon)
    grid = BackgroundGrid(frames, threads)

    def search(some: slice) -> None:
        block = some if left is None else left[some]
        tetrahedron[block] = found = grid.find(coordinates(block))
        if weighted:
            # Points outside get weights of any tetrahedron here, and the right ones below.
            weights[block] = frames.weights(coordinates(block), np.maximum(found, 0))

    count = len(places) if left is None else len(left)
    for_each(blocks(count, _BLOCK), lambda: search, threads)
    missed = np.flatnonzero(tetrahedron < 0)
    distance = np.empty(len(missed))
    if len(missed):
        nearest = NearestTetrahedron(nodes, cells, frames)

        def measure(block: slice) -> None:
            which = missed[block]
            owner, clamped, far = nearest.find(coordinates(which))
            tetrahedron[which], distance[block] = owner, far
            if weighted:
                extrapolated = frames.weights(coordinates(which), owner)
                clamp = (outside == "clamp") & (far > frames.distance)
                weights[which] = np.where(clamp[:, None], clamped, extrapolated)

        for_each(blocks(len(missed), _BLOCK), lambda: measure, threads)

    # Gaps between faces that are due to rounding do not count as outside.
    far_out = distance > frames.distance
    is_outside = np.zeros(len(places), dtype=np.bool_)
    is_outside[missed[far_out]] = True
    count = int(np.count_nonzero(far_out))
    largest = float(distance.max(initial=0.0, where=far_out))
    if count and outside == "error":
        raise GeometryError(
            f"{count} of {len(places)} points lie outside the cage, by up to {largest:.3g} m",
            cure='Enlarge the cage (padding), or set outside to "extrapolate" or "clamp"',
        )
    return Location(tetrahedron, weights, is_outside, count, largest)


def _check_points(values: ArrayLike, what: str, kind: DTypeLike) -> NDArray[Any]:
    result = np.ascontiguousarray(values, dtype=kind)
    if result.ndim != 2 or result.shape[1] != 3:
        raise GeometryError(f"the {what} coordinates have shape {result.shape}", allowed="(N, 3)")
    finite = np.isfinite(result).all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise GeometryError(
            f"{what} {bad[0]} is not finite: {tuple(result[bad[0]].tolist())}"
            + (f", and {len(bad) - 1} more" if len(bad) > 1 else ""),
            cure="Remove or correct it",
        )
    return result


def _check_tetrahedra(values: ArrayLike, vertex_count: int) -> AnyInts:
    result = np.asarray(values)
    if result.ndim != 2 or result.shape[1] != 4 or result.dtype.kind not in "iu":
        raise GeometryError(
            f"the tetrahedra have shape {result.shape} and type {result.dtype}",
            allowed="(T, 4) vertex numbers",
        )
    if not len(result):
        raise GeometryError("the cage has no tetrahedra")
    if result.min() < 0 or result.max() >= vertex_count:
        raise GeometryError(
            f"the cage uses vertex {result.min() if result.min() < 0 else result.max()}",
            allowed=f"0 to {vertex_count - 1}",
        )
    return result
