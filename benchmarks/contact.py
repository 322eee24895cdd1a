"""Processor time of a 300 mm cloth that settles on a disc: contact.py [CELLS …]."""

from __future__ import annotations

import sys
import time

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm, contact_stiffness
from spacemap_vtk.mechanics.contact.obstacles import Cylinder
from spacemap_vtk.mechanics.contact.resting import find_resting_state
from spacemap_vtk.mechanics.contact.samples import sample_sheet
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.units import GRAVITY

#: Side [m], thickness [m] and mass per area [kg/m²] of the cloth; friction on the disc.
SIDE, THICKNESS, MASS, FRICTION = 0.3, 3e-4, 0.15, 0.3
PLATE = Plate(1500.0 * np.diag([1, 1, 0.5]), 1e-5 * np.diag([1, 1, 0.5]))


def make_cloth(cells: int) -> Model:
    """Make the cloth, level and just above a disc of 180 mm."""
    half = SIDE / 2, THICKNESS / 2
    box = (-half[0], half[0], -half[0], half[0], -half[1], half[1])
    points, tetrahedra = build_lattice(box, (cells, cells, 1))
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    term = ObstacleTerm(
        Cylinder(0.09, 0.02, 0.005, (0, 0, -0.01)),
        sample_sheet(points, surface),
        contact_stiffness(PLATE, SIDE / cells),
        half[1],
        FRICTION,
        surface=surface,
    )
    free = np.zeros(points.shape, dtype=bool)
    return Model(points, tetrahedra, PLATE, MASS / THICKNESS, free, terms=[term])


if __name__ == "__main__":
    for text in sys.argv[1:] or ["18", "39"]:
        cloth = make_cloth(int(text))
        weight = np.outer(cloth.nodal_mass, [0, 0, -GRAVITY])
        begun = time.process_time()
        find_resting_state(cloth, weight.ravel())
        spent = time.process_time() - begun
        print(f"{text} x {text} cells, {cloth.pencil.size} unknowns: {spent:.2f} s")
