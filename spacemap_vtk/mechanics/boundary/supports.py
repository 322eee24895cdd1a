"""Supports that hold parts of a cage, along its axes or any direction, and rigid bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.places import (
    SIDES,
    Masks,
    directions,
    find_components,
    find_vertices,
    parse_places,
)
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix


#: Name of the places of `rigid_bodies` in messages.
RIGID_PLACE = "rigid place"

#: A slab is flat, up to rounding, if its height is below this share of the extent.
_FLAT = 1e-3
#: A box is as thin as a sheet if its smallest side is below this share of the second smallest.
_THIN = 0.1
#: A motion counts as held if the square of its part along held directions is more than this share.
_HELD = 1e-10


def held_components(vertices: Floats, supports: Iterable[str], masks: Masks | None = None) -> Bools:
    """Find the components of the vertices that supports without a direction hold.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    supports : iterable of str
        Texts for `parse_places`; without any, nothing is held.
    masks : callable, optional
        Function from the name of a point array to its values, of shape (V,) or, for components,
        (V, 3).

    Returns
    -------
    ndarray of bool, shape (V, 3)
        True where held.

    Raises
    ------
    InputError
        If a support contains no vertex, or nothing is left that can move.

    Examples
    --------
    >>> held_components(np.eye(3), ["+x:z", "sphere(0, 1, 0, 0.1)"]).astype(int).tolist()
    [[0, 0, 1], [1, 1, 1], [0, 0, 0]]
    """
    held = np.zeros(vertices.shape, dtype=np.bool_)
    text = " ".join(supports)
    for support in parse_places(text):
        if not support.direction:
            found = find_components(vertices, support, masks).reshape(len(vertices), -1)
            held |= found & [axis in support.components for axis in "xyz"]
    if held.all():
        raise InputError(
            "all vertices of the cage are fixed, so nothing can move",
            value=text,
            cure="Fix fewer sides, or divide the cage more finely.",
        )
    return held


def loose_sides(vertices: Floats, supports: Iterable[str], masks: Masks | None = None) -> list[str]:
    """List the sides among the supports that should hold the cage but leave it free to turn.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    supports : iterable of str
        As for `held_components`.
    masks : callable, optional
        As for `held_components`.

    Returns
    -------
    list of str
        Empty if the supports prevent any rotation, if one of them is meant to slide, or if no
        support is a side.

    Examples
    --------
    >>> loose_sides(np.array([[0, 0, 0], [1, 1, 0], [1, -1, 0], [2, 0, 1.0]]), ["-x"])
    ['-x']
    """
    places = parse_places(" ".join(supports))
    if not places or any(place.components != "xyz" for place in places):
        return []
    held = [find_vertices(vertices, place, masks) for place in places]
    if np.linalg.matrix_rank(rigid_motions(vertices[np.any(held, axis=0)])) == 6:
        return []
    return [str(place) for place in places if place.shape in SIDES]


def default_support(vertices: Floats, up: int) -> str:
    """Choose the place at which an object is held by default.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Vertices of its cage [m].
    up : int
        Axis that points up.

    Returns
    -------
    str
        The lowest slab in which the cage cannot turn, or a side if this slab is flat. For a thin
        object its upper end; if the object lies level, the lower end of its longest axis.

    Examples
    --------
    >>> default_support(np.array([[x, y, z] for x in (0, 2) for y in (0, 1) for z in (0, 1.0)]), 2)
    '-z'
    """
    extent = np.ptp(vertices, axis=0)
    axis, sign = up, -1
    if is_thin(extent):
        level = int(extent.argmin()) == up
        axis, sign = (int(extent.argmax()), -1) if level else (up, 1)
    height = sign * (vertices[:, axis] - vertices[:, axis].mean())
    for share in (0.05, 0.1, 0.2, 0.4, 1.0):
        slab = height >= height.max() - share * extent[axis]
        if np.linalg.matrix_rank(rigid_motions(vertices[slab])) == 6:
            break
    held = vertices[slab, axis]
    if np.ptp(held) <= _FLAT * extent[axis]:
        return f"{'+' if sign > 0 else '-'}{'xyz'[axis]}"
    ends = ["-inf", "inf"] * 3
    end = held.min() if sign > 0 else held.max()
    ends[2 * axis + (sign < 0)] = f"{end + -sign * _FLAT * extent[axis]:.6g}"
    return f"box({', '.join(ends)})"


def is_thin(extent: Floats) -> bool:
    """Check whether a box is as thin as a sheet.

    Parameters
    ----------
    extent : ndarray of float64, shape (3,)
        Sides of the box, in any unit.

    Returns
    -------
    bool
        True if its smallest side is far below the second smallest, so a bar is not thin.
    """
    thin, narrow, _ = np.sort(extent)
    return bool(thin < _THIN * narrow)


def held_directions(
    vertices: Floats, supports: Iterable[str], masks: Masks | None = None
) -> Floats | None:
    """Compute the directions that supports with a direction hold.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    supports : iterable of str
        As for `held_components`.
    masks : callable, optional
        As for `held_components`.

    Returns
    -------
    ndarray of float64, shape (V, 3, 3), or None
        Σ n nᵀ over the directions n held at each vertex; None if no support has a direction.

    Raises
    ------
    InputError
        If a support contains no vertex.
    """
    inclined = [place for place in parse_places(" ".join(supports)) if place.direction]
    if not inclined:
        return None
    return np.sum([directions(vertices, place, masks) for place in inclined], axis=0)


def rigid_bodies(
    vertices: Floats, places: Iterable[str], masks: Masks | None = None
) -> Ints | None:
    """Number the rigid body of each vertex, (V,), from 1, or 0 for none; None without places."""
    parsed = parse_places(" ".join(places), what=RIGID_PLACE, whole=True)
    if not parsed:
        return None
    body = np.zeros(len(vertices), dtype=np.int64)
    for number, place in enumerate(parsed, 1):
        found = find_vertices(vertices, place, masks, RIGID_PLACE)
        if (shared := body[found].max()) > 0:
            raise InputError(
                f'the {RIGID_PLACE}s "{parsed[shared - 1]}" and "{place}" share a vertex',
                value=str(place),
                allowed="places without common vertices; one box or mask over both makes one body",
            )
        body[found] = number
    return body


def free_motions(
    points: Floats, held: Bools, normals: Floats | None = None, bodies: Ints | None = None
) -> csc_matrix:
    """Compute T, (3V, n), of u = T q: the displacements u that supports and rigid bodies allow."""
    # The columns are orthonormal, and unit vectors for vertices held along axes only. They are in
    # the order of the vertices; those of a body come at its first vertex.
    from scipy.sparse import csc_matrix

    count = len(points)
    body = np.zeros(count, dtype=np.int64) if bodies is None else bodies
    normal = np.zeros((count, 3, 3)) if normals is None else normals
    bound = held[:, :, None] * np.eye(3) + normal
    inclined = normal.any(axis=(1, 2)) & (body == 0)
    # One block of columns for all vertices held along axes, one for inclined supports, and one for
    # each body.
    axes = np.flatnonzero((~held & ~inclined[:, None] & (body == 0)[:, None]).ravel())
    blocks = [_Block(axes, np.arange(len(axes)), np.ones(len(axes)), axes)]
    sliders = np.flatnonzero(inclined)
    if len(sliders):
        held_shares, vectors = np.linalg.eigh(bound[sliders])
        vertex, which = np.nonzero(held_shares <= _HELD)
        rows = 3 * sliders[vertex, None] + np.arange(3)
        columns = np.repeat(np.arange(len(vertex)), 3)
        entries = vectors[vertex, :, which].ravel()
        blocks.append(_Block(rows.ravel(), columns, entries, rows[:, 0]))
    for number in range(1, int(body.max(initial=0)) + 1):
        members = np.flatnonzero(body == number)
        rows = (3 * members[:, None] + np.arange(3)).ravel()
        left, sizes, _ = np.linalg.svd(rigid_motions(points[members]), full_matrices=False)
        basis = left[:, sizes > _HELD * sizes[0]]  # a body of two vertices has only five motions
        motions = basis.reshape(len(members), 3, -1)
        held_shares, turn = np.linalg.eigh(
            np.einsum("vim,vij,vjn->mn", motions, bound[members], motions)
        )
        basis = basis @ turn[:, held_shares <= _HELD]
        size = basis.shape[1]
        columns = np.tile(np.arange(size), len(rows))
        blocks.append(_Block(np.repeat(rows, size), columns, basis.ravel(), rows[:1].repeat(size)))
    order = np.argsort(np.concatenate([block.first for block in blocks]), kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    starts = np.cumsum([0, *(len(block.first) for block in blocks[:-1])])
    where = [place[block.columns + at] for block, at in zip(blocks, starts, strict=True)]
    entries, rows = (np.concatenate([b[k] for b in blocks]) for k in (2, 0))
    shape = 3 * count, len(order)
    return csc_matrix((entries, (rows, np.concatenate(where))), shape=shape)


class _Block(NamedTuple):
    """Entries of several columns of a matrix, and the first row of each column."""

    rows: Ints
    columns: Ints
    entries: Floats
    first: Ints


def rigid_motions(points: Floats, places: Bools | None = None) -> Floats:
    """Compute three translations and three rotations about the middle, (3V, 6), of similar size."""
    # Nodes that are not positions, such as half thicknesses, only turn.
    shifts = np.ones(len(points), dtype=bool) if places is None else places
    arms = _arms(points, shifts) / largest_arm(points, shifts)
    motions = np.zeros((len(points), 3, 6))
    motions[shifts, :, :3] = np.eye(3)
    motions[:, :, 3:] = small_rotations(arms)
    return motions.reshape(-1, 6)


def largest_arm(points: Floats, places: Bools) -> float:
    """Compute the length by which `rigid_motions` divides rotations."""
    return max(float(np.abs(_arms(points, places)).max()), float(np.finfo(float).tiny))


def _arms(points: Floats, places: Bools) -> Floats:
    middle = (
        points[places].mean(axis=0) if places.any() else 0.0
    )  # half thicknesses alone have none
    return points - np.where(places[:, None], middle, 0.0)


def small_rotations(vectors: Floats) -> Floats:
    """Compute the changes of vectors in small rotations about x, y and z, (n, 3, 3)."""
    return np.cross(np.eye(3)[None], vectors[:, None]).swapaxes(1, 2)
