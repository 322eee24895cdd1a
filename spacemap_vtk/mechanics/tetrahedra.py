"""Tetrahedral meshes as the element routines want them: checked, with edges and volumes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.mechanics.elements import EDGES

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: A tetrahedron is flat when six times its volume is below this share of its longest edge cubed:
#: closer to zero, rounding in the edges alone decides the volume.
FLAT = 1e-12

#: How far, as a share of its edge, a midpoint may lie from the middle of that edge.
STRAIGHT = 1e-6


def volumes(points: ArrayLike, tetrahedra: ArrayLike) -> FloatArray:
    """Return the volume of each tetrahedron, of either orientation."""
    points, tetrahedra = checked_mesh(points, tetrahedra)
    return edges_and_volumes(points, tetrahedra)[1]


def checked_mesh(points: ArrayLike, tetrahedra: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Return the mesh as float64 and int64 arrays, or say what is wrong with it."""
    vertices = np.asarray(points, dtype=np.float64)
    cells = np.asarray(tetrahedra)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise GeometryError(f"points have shape {vertices.shape}", allowed="shape (V, 3)")
    if cells.ndim != 2 or cells.shape[1] not in (4, 10) or len(cells) == 0:
        raise GeometryError(
            f"tetrahedra have shape {cells.shape}",
            allowed="shape (T, 4) or (T, 10), at least one tetrahedron",
            cure="Give a mesh of linear or quadratic tetrahedra",
        )
    if not np.issubdtype(cells.dtype, np.integer):
        raise GeometryError(f"tetrahedra are of type {cells.dtype}", allowed="integers")
    _refuse(~np.isfinite(vertices).all(axis=1), "points", "have a coordinate that is not finite")
    outside = ((cells < 0) | (cells >= len(vertices))).any(axis=1)
    _refuse(outside, "tetrahedra", f"name a vertex beyond the {len(vertices)} there are")
    cells = cells.astype(np.int64, copy=False)
    if cells.shape[1] == 10:
        ends = vertices[cells[:, EDGES]]
        off = vertices[cells[:, 4:]] - ends.mean(axis=2)
        length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        _refuse(
            (np.linalg.norm(off, axis=2) > STRAIGHT * length).any(axis=1),
            "tetrahedra",
            "are curved",
            "Move each midpoint to the middle of its edge",
        )
    return vertices, cells


def edges_and_volumes(points: FloatArray, tetrahedra: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return what the shape functions of each tetrahedron are made of."""
    corners = points[tetrahedra[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    six_volumes = np.abs(np.einsum("tk,tk->t", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])))
    six_edges = np.concatenate([edges, edges - edges[:, [1, 2, 0]]], axis=1)
    longest = np.sqrt((six_edges**2).sum(axis=2).max(axis=1))
    # Not "volume <= ...": a tetrahedron whose edges overflow or vanish must not pass either.
    _refuse(
        ~(six_volumes > FLAT * longest**3),
        "tetrahedra",
        "are flat",
        "Remove them or remesh the cage",
    )
    return edges, six_volumes / 6


def _refuse(
    bad: ArrayLike, things: str, what: str, cure: str = "Repair the mesh of the cage"
) -> None:
    which = np.flatnonzero(bad)
    if len(which):
        raise GeometryError(
            f"{len(which)} of {np.size(bad)} {things} {what}, the first is index {which[0]}",
            cure=cure,
        )
