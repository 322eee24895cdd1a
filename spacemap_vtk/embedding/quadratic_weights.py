"""Weights of the ten nodes of quadratic tetrahedra at points that ride along."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.mechanics.elements import shape_functions, shape_slopes


def quadratic_weights(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights of all ten nodes from those of the corners."""
    # Inside they are the shape functions. Outside, a quadratic would turn back on itself before
    # long: there the field goes on from the border as its tangent does, so that an affine motion is
    # reproduced at any distance.
    outside = np.flatnonzero((weights < 0).any(axis=1))
    if not len(outside):
        return shape_functions(weights)
    inside = weights.copy()
    inside[outside] = np.maximum(weights[outside], 0.0)
    inside[outside] /= inside[outside].sum(axis=1, keepdims=True)
    result = shape_functions(inside)
    away = weights[outside] - inside[outside]
    result[outside] += np.einsum("nai,ni->na", shape_slopes(inside[outside]), away)
    return result
