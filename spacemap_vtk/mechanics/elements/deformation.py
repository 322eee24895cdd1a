"""How much a shape strains, shears and folds: largest values over all elements.

Strains are columns xx, yy, zz, yz, zx, xy with engineering shears, as
`spacemap_vtk.mechanics.modal.model.Model.strain_and_stress` returns them; Green's strain, of which
linear strain is the limit of small motions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.ndarrays import Floats

#: The sides of a quadrilateral.
SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))


class Fold(NamedTuple):
    """The tightest fold of a sheet."""

    turn: float
    """Largest angle between the normals of neighbouring vertices [rad]."""
    curvature: float
    """Largest such angle over the distance of the vertices at rest [1/m]."""
    lean: float
    """Largest angle between the normal of a vertex and the cells around it [rad]."""


def stretch_of(strain: Floats) -> Floats:
    """Compute the relative change of a length from Green's strain along it.

    Parameters
    ----------
    strain : ndarray of float64, shape (…)
        Green's strain along the length.

    Returns
    -------
    ndarray of float64
        Stretch minus 1, of the same shape.
    """
    return np.asarray(np.sqrt(np.maximum(1.0 + 2.0 * strain, 0.0)) - 1.0)


def largest_stretch(strain: Floats, in_plane: bool) -> float:
    """Compute the largest relative change of any length in any element.

    Parameters
    ----------
    strain : ndarray of float64, shape (T, 6)
        Green's strain of each element.
    in_plane : bool
        Whether only lengths along x and y count: those of a sheet.

    Returns
    -------
    float
        The largest stretch or compression, at least 0.
    """
    xx, yy, zz, yz, zx, xy = strain.T
    if in_plane:
        middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy / 2)
        principal = np.stack([middle + radius, middle - radius])
    else:
        rows = [[xx, xy / 2, zx / 2], [xy / 2, yy, yz / 2], [zx / 2, yz / 2, zz]]
        principal = np.linalg.eigvalsh(np.moveaxis(np.array(rows), 2, 0))
    return float(np.abs(stretch_of(principal)).max(initial=0.0))


def shear_angles(strain: Floats) -> Floats:
    """Compute by how much the right angle between x and y changes in each element.

    Parameters
    ----------
    strain : ndarray of float64, shape (T, 6)
        Green's strain of each element.

    Returns
    -------
    ndarray of float64
        Angles of shear, (T,) [rad].
    """
    xx, yy, xy = strain[:, 0], strain[:, 1], strain[:, 5]
    sides = np.sqrt(np.maximum((1.0 + 2.0 * xx) * (1.0 + 2.0 * yy), 1e-12))
    return np.asarray(np.arcsin(np.clip(xy / sides, -1.0, 1.0)))


def find_tightest_fold(rest: Floats, moved: Floats, surface: MidSurface) -> Fold:
    """Find the tightest fold of a sheet.

    Parameters
    ----------
    rest, moved : ndarray of float64, shape (V, 3)
        Vertices undeformed and deformed [m].
    surface : MidSurface
        Mid-surface of the sheet.

    Returns
    -------
    Fold
        The tightest fold between neighbouring vertices.
    """
    count = len(surface.pairs)
    first, last = surface.quads[:, SIDES].reshape(-1, 2).T
    middle, normals = surface.to_nodes(rest)[:count], surface.to_nodes(moved)[count:]
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    turns = _angles(normals[last], normals[first])
    widths = np.linalg.norm(middle[last] - middle[first], axis=1)
    around = _cell_normals(surface.to_nodes(moved)[:count], surface)
    upright = _cell_normals(middle, surface)[:, surface.normal]
    around *= np.sign(surface.to_nodes(rest)[count:, surface.normal] * upright)[:, None]
    leans = _angles(normals, around)
    return Fold(
        float(turns.max(initial=0.0)),
        float((turns / widths).max(initial=0.0)),
        float(leans.max(initial=0.0)),
    )


def _angles(first: Floats, other: Floats) -> Floats:
    """Compute the angles between unit vectors (n, 3)."""
    # By the chord: an angle from its cosine would have half the digits.
    chords = np.linalg.norm(first - other, axis=1)
    return np.asarray(2.0 * np.arcsin(np.minimum(chords / 2.0, 1.0)))


def _cell_normals(middle: Floats, surface: MidSurface) -> Floats:
    """Compute the mean normal of the cells around each vertex, (V, 3), of unit length."""
    corners = middle[surface.quads]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    sums = np.zeros_like(middle)
    np.add.at(sums, surface.quads, normals[:, None])
    return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-12)[:, None])
