"""Which vertices are held, and how well the mesh can bend."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError

#: The sides of a box, and for each its axis and its end.
SIDES = {"-x": (0, -1), "+x": (0, 1), "-y": (1, -1), "+y": (1, 1), "-z": (2, -1), "+z": (2, 1)}


def on_sides(vertices: NDArray[np.float64], sides: Iterable[str]) -> NDArray[np.bool_]:
    """Return which vertices lie on given sides of the bounding box.

    Parameters
    ----------
    vertices : ndarray, shape (n_vertices, 3)
        Positions in m.
    sides : iterable of str
        Names out of `SIDES`.

    Returns
    -------
    ndarray of bool, shape (n_vertices,)
        True where a vertex is held.

    Raises
    ------
    InputError
        If every vertex would be held.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    # A share of the box, so that the cage's unit of length does not matter.
    tolerance = 1e-6 * float(np.linalg.norm(high - low))
    held = np.zeros(len(vertices), dtype=bool)
    for side in sides:
        axis, end = SIDES[side]
        wall = high[axis] if end > 0 else low[axis]
        held |= np.abs(vertices[:, axis] - wall) <= tolerance
    if held.all():
        raise InputError(
            "every vertex of the cage is held, nothing can move",
            key="fixed",
            value=" ".join(sides),
            cure="Fix fewer sides, or divide the cage more finely.",
        )
    return held


def layers_through_thickness(vertices: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> float:
    """Return how many tetrahedra lie on top of each other where the mesh is thinnest.

    Parameters
    ----------
    vertices : ndarray, shape (n_vertices, 3)
        Positions in m.
    tetrahedra : ndarray of int, shape (n_tetrahedra, 4)
        Vertex numbers.

    Returns
    -------
    float
        Extent of the bounding box along its thinnest axis over the mean extent of a tetrahedron
        along it; infinite for a mesh that is no sheet or bar (thinnest extent above a third of
        the largest one).
    """
    extent = np.ptp(vertices, axis=0)
    thin = int(np.argmin(extent))
    if extent[thin] > extent.max() / 3:
        return float("inf")
    along = vertices[tetrahedra, thin]
    return float(extent[thin] / np.ptp(along, axis=1).mean())
