"""Modes of matrices, of which no mesh is known."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.mechanics.elements.elasticity import assemble, mass_matrix, stiffness_matrix
from spacemap_vtk.mechanics.modal.eigen import solve_modes
from spacemap_vtk.mechanics.modal.pencil import Pencil, free_columns


def stiffness_and_mass(points: Any, cells: Any, elasticity: Any, density: float) -> tuple[Any, Any]:
    """Return K and consistent M of a mesh of tetrahedra."""
    assembly = assemble(points, cells)
    return stiffness_matrix(assembly, elasticity), mass_matrix(assembly, density)


def solve_matrices(
    stiffness: Any, mass: Any, free: Any, count: int, progress: Any = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest modes of K s = λ M s, of which some components, (3V,), are free."""
    return solve_modes(Pencil(stiffness, mass, free_columns(np.asarray(free))), count, progress)[:2]
