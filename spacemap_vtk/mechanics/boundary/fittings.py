"""Fittings of a cage: what it has in addition to supports along axes and a uniform material.

Fittings are sliders along other directions, rigid bodies, springs between the cage and its base,
masses, and factors by which tetrahedra are stiffer or heavier than the material.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.mechanics.boundary.loads import FACES, find_side_faces, traction_forces
from spacemap_vtk.mechanics.boundary.places import (
    SIDES,
    Masks,
    directions,
    find_vertices,
    parse_places,
)
from spacemap_vtk.mechanics.boundary.supports import held_components, held_directions, rigid_bodies
from spacemap_vtk.mechanics.elements.shell import find_hexahedra
from spacemap_vtk.mechanics.elements.tetrahedra import EDGES, ELEMENTS, volumes
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: Units of springs: of a whole place, and per area.
SPRING_UNITS = ("N/m", "N/m3")
#: Units of point masses.
MASS_UNITS = ("kg",)


class Fittings(NamedTuple):
    """Arrays of fittings; None for those that the cage does not have."""

    normals: Floats | None = None
    """(V, 3, 3), Σ n nᵀ over the directions n along which a vertex is held."""
    bodies: Ints | None = None
    """(V,), number of the rigid body of each vertex, from 1; 0 for none."""
    springs: Floats | None = None
    """(V, 3, 3), stiffness of springs to the base [N/m]."""
    masses: Floats | None = None
    """(V,), point masses [kg]."""
    stiffness_factors: Floats | None = None
    """(T,), factor of the elasticity of each tetrahedron."""
    mass_factors: Floats | None = None
    """(T,), factor of the density of each tetrahedron."""

    @property
    def given(self) -> dict[str, NDArray[Any]]:
        """Arrays that are not None, by name."""
        return {name: array for name, array in self._asdict().items() if array is not None}


#: Faces of a hexahedron with corners x + 2y + 4z, each with its corners in cyclic order; and edges.
_HEXAHEDRON_FACES = np.array(
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]]
)
_HEXAHEDRON_EDGES = np.array(
    [[k, k | bit] for bit in (1, 2, 4) for k in range(8) if not k & bit], dtype=np.int64
)

#: Fittings of a cage that has none.
NO_FITTINGS = Fittings()


def make_fittings(
    vertices: Floats,
    cells: Ints,
    fixed: Sequence[str],
    rigid: Sequence[str],
    springs: Sequence[str],
    masses: Sequence[str],
    masks: Masks | None = None,
) -> tuple[Bools, Fittings]:
    """Find the held components of a cage, and make its fittings.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    fixed, rigid, springs, masses : sequence of str
        Texts for `parse_places`. Supports have components or a direction. Springs have the
        stiffness of the whole place in N/m, or that per area of a side in N/m³. Masses in kg are
        each spread evenly over their place.
    masks : callable, optional
        Function from the name of a point array to its values, of shape (V,) or, for components,
        (V, 3).

    Returns
    -------
    held : ndarray of bool, shape (V, 3)
        Components that cannot move.
    fittings : Fittings
        Fittings without factors.

    Raises
    ------
    InputError
        If a place contains no vertex, two bodies share a vertex, a spring per area is not on a side
        with faces, or nothing can move. The key of the error is the name of the argument.
    """
    with add_key_to_errors("fixed"):
        held = held_components(vertices, fixed, masks)
        normals = held_directions(vertices, fixed, masks)
    with add_key_to_errors("rigid"):
        bodies = rigid_bodies(vertices, rigid, masks)
    with add_key_to_errors("springs"):
        stiffness = spring_stiffness(vertices, cells, springs, masks)
    with add_key_to_errors("masses"):
        found = point_masses(vertices, cells, masses, masks)
    return held, Fittings(normals, bodies, stiffness, found)


def spring_stiffness(
    points: Floats, cells: Ints, springs: Iterable[str], masks: Masks | None = None
) -> Floats | None:
    """Compute the stiffness of springs at each vertex, (V, 3, 3) [N/m]; None without springs."""
    # A spring in N/m is shared equally by the vertices of its place. A spring in N/m³ is shared by
    # the vertices of a side as a constant pressure is.
    parsed = parse_places(" ".join(springs), SPRING_UNITS, what="spring")
    if not parsed:
        return None
    total = np.zeros((len(points), 3, 3))
    for place in parsed:
        along = directions(points, place, masks, "spring")
        if place.unit == "N/m":
            share = 1.0 / along.any(axis=(1, 2)).sum()
        elif place.shape in SIDES:
            faces = find_side_faces(points, cells, place.shape)
            share = traction_forces(len(points), faces, [1.0])[:, 0, None, None]
        else:
            raise InputError(
                f'the spring "{place}" has a stiffness per area, which needs a side',
                value=str(place),
                allowed=f"one of {', '.join(SIDES)}, or the stiffness of the whole place in N/m",
            )
        total += place.value * share * along
    return total


def point_masses(
    points: Floats, cells: Ints, masses: Iterable[str], masks: Masks | None = None
) -> Floats | None:
    """Compute the masses at each vertex, (V,) [kg], each spread evenly over its place."""
    parsed = parse_places(" ".join(masses), MASS_UNITS, what="mass", whole=True)
    if not parsed:
        return None
    total = np.zeros(len(points))
    for place in parsed:
        found = find_vertices(points, place, masks, "mass")
        total += place.value * even_shares(points, cells, found)
    return total


def even_shares(points: Floats, cells: Ints, inside: Bools) -> Floats:
    """Compute the share of each vertex, (V,), in a mass spread evenly over a set of vertices."""
    # The mass is spread by volume, area or length: by the first of these for which every vertex
    # belongs to a solid, face or edge that lies within the set. Scattered vertices share equally.
    for corners, weights in _solids_faces_edges(points, cells, inside):
        share = np.bincount(corners.ravel(), weights.ravel(), len(points))
        if (np.bincount(corners.ravel(), minlength=len(points))[inside] > 0).all():
            return share / share.sum()
    return inside / inside.sum()


def _solids_faces_edges(
    points: Floats, cells: Ints, inside: Bools
) -> Iterator[tuple[Ints, Floats]]:
    """Yield vertices of the solids, faces and edges in a set, and their shares of each size."""
    # Solids of a lattice are its hexahedra. By tetrahedra, neighbouring vertices would have
    # different shares.
    blocks, size = find_hexahedra(cells), volumes(points, cells)
    if blocks is not None:
        size = size.reshape(len(blocks), -1).sum(axis=1)
        parts = (blocks, blocks[:, _HEXAHEDRON_FACES], blocks[:, _HEXAHEDRON_EDGES])
        shares = [np.full(count, 1 / count) for count in (8, 4, 2)]
        corners = 4
    else:
        linear, corners = cells.shape[1] == 4, 3
        lines = cells[:, EDGES]
        if not linear:
            lines = np.concatenate([lines, cells[:, 4:, None]], axis=2)
        parts = (cells, cells[:, FACES[:, :3] if linear else FACES], lines)
        # shares of a constant density on a face or edge; by Simpson's rule if there are midpoints
        on_face = np.full(3, 1 / 3) if linear else np.repeat([0.0, 1 / 3], 3)
        on_line = np.full(2, 1 / 2) if linear else np.array([1.0, 1.0, 4.0]) / 6
        shares = [ELEMENTS[cells.shape[1]].lumps, on_face, on_line]
    solids = inside[parts[0]].all(axis=1)
    yield parts[0][solids], size[solids, None] * shares[0]
    faces = _select_unique(parts[1], inside)
    out = points[faces[:, :corners]] - points[faces[:, :1]]
    areas = np.linalg.norm(np.cross(out[:, 1:-1], out[:, 2:]).sum(axis=1), axis=1) / 2
    yield faces, areas[:, None] * shares[1]
    lines = _select_unique(parts[2], inside)
    lengths = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    yield lines, lengths[:, None] * shares[2]


def _select_unique(groups: Ints, inside: Bools) -> Ints:
    """Select the groups of vertices, (…, n), that lie inside, each group once."""
    groups = groups.reshape(-1, groups.shape[-1])
    groups = groups[inside[groups].all(axis=1)]
    return groups[np.unique(np.sort(groups, axis=1), axis=0, return_index=True)[1]]
