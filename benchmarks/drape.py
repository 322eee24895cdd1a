"""Processor time and steps in which the tablecloth of the scene drape hangs: drape.py [CELLS …].

Cells along both sides are given as 56x72. Steps are linear systems, also those in wider cells.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.sparse import csr_matrix

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.equilibrium.reduced_system import ReducedSystem
from spacemap_vtk.mechanics.linalg.factors import Solve
from spacemap_vtk.mechanics.modal.hanging import find_hung_state
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.units import GRAVITY

#: Half of the sides and of the thickness, radius of the table [m], and mass per area [kg/m²].
HALF, TABLE, MASS = (0.3, 0.375, 4.2e-3), 0.125, 0.15


class CountSteps:
    """Counts the linear systems of each size that are solved."""

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}
        self._factorise = ReducedSystem.factorise
        ReducedSystem.factorise = lambda system, matrix: self.count(system, matrix)

    def count(self, system: ReducedSystem, matrix: csr_matrix) -> Solve:
        """Count one system and factorise its matrix."""
        size = system.basis.shape[1]
        self.counts[size] = self.counts.get(size, 0) + 1
        return self._factorise(system, matrix)


def make_tablecloth(cells: tuple[int, int]) -> Model:
    """Make the cloth, level and held on the table."""
    box = tuple(side * half for half in HALF for side in (-1, 1))
    points, tetrahedra = build_lattice(box, (*cells, 1))
    plate = apply_measurements(
        homogeneous_plate(isotropic(1e6, 0.3), 2 * HALF[2]),
        tensile=(1500.0, 1500.0),
        shear=40.0,
        bending=(2e-5, 2e-5),
    )
    held = np.linalg.norm(points, axis=1) <= TABLE
    return Model(points, tetrahedra, plate, MASS / (2 * HALF[2]), np.repeat(held[:, None], 3, 1))


if __name__ == "__main__":
    counter = CountSteps()
    for text in sys.argv[1:] or ["56x72", "112x144"]:
        along, across = map(int, text.split("x"))
        cloth = make_tablecloth((along, across))
        weight = np.outer(cloth.nodal_mass, [0, 0, -GRAVITY]).ravel()
        counter.counts.clear()
        begun = time.process_time()
        moved = find_hung_state(cloth, weight)[0]
        spent = time.process_time() - begun
        steps = ", ".join(f"{n} steps of {size} unknowns" for size, n in counter.counts.items())
        print(f"{text} cells: {spent:.2f} s, {steps}, {-moved[:, 2].min():.4f} m low")
