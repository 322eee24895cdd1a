"""Strain and rotation of each tetrahedron in a displacement field."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk import cancel
from spacemap_vtk.mechanics.elements.elasticity import barycentric_gradients
from spacemap_vtk.mechanics.elements.tetrahedra import EDGES, shape_slopes
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parallel import blocks


class MeanGradient:
    """Mean gradient of displacement fields in each tetrahedron."""

    def __init__(self, points: ArrayLike, cells: ArrayLike) -> None:
        nodes = np.asarray(cells, dtype=np.int64)
        slopes = barycentric_gradients(np.asarray(points, dtype=np.float64), nodes)[0]
        if nodes.shape[1] == 10:
            # N = L (2L - 1) at a corner, 4 Lᵢ Lⱼ on an edge. Where all L are 1/4, the gradients of
            # the corners are zero, and that of an edge is the sum of those of its corners' L.
            slopes = slopes[:, EDGES].sum(axis=2)
            nodes = nodes[:, 4:]
        # The tetrahedra are the last axis, so that each sum runs along contiguous memory.
        self._nodes = np.ascontiguousarray(nodes.T)
        self._slopes = np.ascontiguousarray(slopes.transpose(2, 1, 0))

    def evaluate(self, displacement: Floats) -> Floats:
        """Compute the gradients of a field."""
        values = np.ascontiguousarray(displacement.T).take(self._nodes, axis=1)
        return np.einsum("int,jnt->ijt", values, self._slopes)


def largest_rotation(gradients: Floats) -> float:
    """Compute the largest rotation of any tetrahedron, half the curl of the displacement.

    Parameters
    ----------
    gradients : ndarray of float64, shape (3, 3, T)
        Gradients from `MeanGradient`.

    Returns
    -------
    float
        Largest rotation [rad].
    """
    twice = gradients - gradients.swapaxes(0, 1)  # each component of the curl, with both signs
    return 0.5 * math.sqrt(0.5 * np.einsum("ijt,ijt->t", twice, twice).max())


def strains(gradients: Floats) -> Floats:
    """Compute the strain of each tetrahedron: xx, yy, zz, yz, zx, xy, shears γ = 2ε, (T, 6)."""
    twice = (gradients + gradients.swapaxes(0, 1)).reshape(9, -1)
    strain = twice.take([0, 4, 8, 5, 6, 1], axis=0)
    strain[:3] *= 0.5
    return np.asarray(strain.T)


#: Quadrature points of a quadratic tetrahedron in barycentric coordinates; for a product of two
#: strains the mean of the values there is exact.
QUADRATURE_POINTS = np.full((4, 4), (5 - 5**0.5) / 20) + np.eye(4) / 5**0.5

#: Number of tetrahedra that are processed at a time.
_CHUNK = 4096


def strain_products(
    points: Floats, cells: Ints, elasticity: Floats, fields: Floats, factors: Floats | None = None
) -> Floats:
    """Compute the work of each field's stresses on every other field's strains, ∫ εᵀ C ε."""
    # This equals fields · K · fieldsᵀ, except for rounding. With K, the energy of a thin sheet that
    # bends is the small difference of large forces. Here only displacements within a tetrahedron
    # are subtracted; the energy is a sum of positive terms, with twice as many correct digits.
    gradients, volume = barycentric_gradients(points, cells)
    if factors is not None:
        volume = volume * factors
    linear = cells.shape[1] == 4
    slopes = np.eye(4)[None] if linear else shape_slopes(QUADRATURE_POINTS)
    total = np.zeros((len(fields), len(fields)))
    for part in blocks(len(cells), _CHUNK):
        cancel.check()
        moved = fields[:, cells[part]]
        moved = (moved - moved[:, :, :1]).swapaxes(2, 3)
        for slope in slopes:
            gradient = moved @ (slope @ gradients[part])  # n, t, i, j
            strain = strains(gradient.transpose(2, 3, 0, 1).reshape(3, 3, -1))
            stress = strain @ elasticity
            stress.reshape(len(fields), -1, 6)[...] *= volume[part, None] / len(slopes)
            total += stress.reshape(len(fields), -1) @ strain.reshape(len(fields), -1).T
    return (total + total.T) / 2


#: Map from a stress to terms whose squares sum to the square of the von Mises stress: differences
#: of the normal stresses by √½, shears by √3.
_MISES = np.zeros((6, 6))
_MISES[:3, :3] = 0.5**0.5 * (np.eye(3) - np.roll(np.eye(3), 1, axis=0))
_MISES[3:, 3:] = 3**0.5 * np.eye(3)


def von_mises(stress: Floats) -> Floats:
    """Compute the von Mises stress.

    Parameters
    ----------
    stress : ndarray of float64, shape (T, 6)
        Components xx, yy, zz, yz, zx, xy [Pa].

    Returns
    -------
    ndarray of float64, shape (T,)
        Von Mises stress [Pa].
    """
    parts = stress @ _MISES
    return np.asarray(np.sqrt(np.einsum("ti,ti->t", parts, parts)))
