"""Processor time of a 300 mm cloth that falls on a sphere for 0.3 s: drop.py [CELLS …].

With contact of the cloth with itself where ipctk is installed.
"""

from __future__ import annotations

import importlib.util
import sys
import time

import numpy as np
from contact import MASS, PLATE, SIDE, THICKNESS

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary.time_functions import step
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm, contact_stiffness
from spacemap_vtk.mechanics.contact.obstacles import Sphere
from spacemap_vtk.mechanics.contact.samples import sample_sheet
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion
from spacemap_vtk.units import GRAVITY

#: Radius of the sphere [m], friction on it, and duration of the fall [s].
RADIUS, FRICTION, DURATION = 0.06, 0.3, 0.3


def drop_cloth(cells: int) -> SteppedMotion:
    """Begin the motion of the cloth, level and 4 mm above the sphere."""
    half = SIDE / 2, THICKNESS / 2
    box = (-half[0], half[0], -half[0], half[0], -half[1], half[1])
    points, tetrahedra = build_lattice(box, (cells, cells, 1))
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    stiffness = contact_stiffness(PLATE, SIDE / cells)
    sphere = Sphere(RADIUS, (0.004, 0.003, -RADIUS - 0.004))
    samples = sample_sheet(points, surface)
    terms: list[EnergyTerm] = [
        ObstacleTerm(sphere, samples, stiffness, half[1], FRICTION, surface=surface)
    ]
    if importlib.util.find_spec("ipctk") is not None:
        terms.append(SelfContact(points, surface, THICKNESS, stiffness))
    free = np.zeros(points.shape, dtype=bool)
    model = Model(points, tetrahedra, PLATE, MASS / THICKNESS, free, terms=terms)
    cage = CageModes(model, np.empty(0), np.empty((0, points.size)), np.empty(0))
    weight = cage.load_vector("gravity", (0, 0, -GRAVITY), step())
    return SteppedMotion(cage, [weight], Damping(alpha=1.0, beta=1e-3), tolerance=1.0)


if __name__ == "__main__":
    for text in sys.argv[1:] or ["16"]:
        motion = drop_cloth(int(text))
        begun = time.process_time()
        motion.step_until(DURATION)
        spent = time.process_time() - begun
        print(
            f"{text} x {text} cells, {motion.model.pencil.size} unknowns: {spent:.2f} s, "
            f"{len(motion.states)} steps"
        )
