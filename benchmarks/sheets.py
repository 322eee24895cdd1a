"""Seconds of sheets: modes, a drape from level, and a large one that is hung and solved.

    OPENBLAS_NUM_THREADS=1 python benchmarks/sheets.py

Each beside a fixed piece of numpy work that is measured in the same run, so that the ratio says
more than the seconds where other programs run at the same time. Seconds are the processor's.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.units import GRAVITY

FloatArray = NDArray[np.float64]

#: Side, diameter of the disc below and thickness [m]; 0.15 kg/m².
SIDE, DISC, THICKNESS = 0.3, 0.18, 1e-3
DENSITY = 0.15 / THICKNESS


def square(cells: int, held: str, displacement: FloatArray | None = None) -> Model:
    """Return a square of 1.5 kN/m and 1e-5 N m, held by its upper edge or on a disc."""
    points, tetrahedra = build_lattice((0, SIDE, 0, SIDE, 0, THICKNESS), (cells, cells, 1))
    within = np.linalg.norm(points[:, :2] - SIDE / 2, axis=1) < DISC / 2
    fixed = np.repeat((within if held == "disc" else points[:, 1] == SIDE)[:, None], 3, axis=1)
    plate = apply_measurements(
        homogeneous_plate(isotropic(1.5e6, 0.3), THICKNESS),
        tensile=(1500.0,) * 2,
        bending=(1e-5,) * 2,
    )
    return Model(points, tetrahedra, plate, DENSITY, fixed, displacement=displacement)


def modes(model: Model) -> str:
    """Solve 30 modes, and return the lowest frequency."""
    rate = np.sqrt(model.modes(30).eigenvalues[0] * model.modulus / DENSITY)
    return f"{rate / (2 * np.pi):.5f} Hz"


def drape(cells: int) -> FloatArray:
    """Return the displacement of a level square that comes to hang over its disc."""
    rest = square(cells, "disc")
    return rest.solve_equilibrium(np.outer(rest.nodal_mass, [0, 0, -GRAVITY]).ravel())[0]


def yardstick() -> str:
    """Do fixed numpy work: products of small matrices, and eigenvalues of a large one."""
    random = np.random.default_rng(0)
    small, large = random.random((20_000, 24, 24)), random.random((1000, 1000))
    return f"{(small @ small).sum() + np.linalg.eigvalsh(large + large.T)[0]:.6g}"


def seconds(run: Callable[[], str], repeats: int) -> tuple[str, float]:
    """Return what it says, and the least processor time of a few runs."""
    taken = []
    for _ in range(repeats):
        start = time.process_time()
        result = run()
        taken.append(time.process_time() - start)
    return result, min(taken)


def main() -> None:
    """Print the table."""
    unit = 0.0
    print(f"{'':<32}{'seconds':>9}{'ratio':>8}")
    for name, run, repeats in (
        ("numpy: the unit", yardstick, 5),
        ("20 x 20, 30 modes", lambda: modes(square(20, "edge")), 5),
        ("24 x 24, draped from level", lambda: f"{-drape(24)[:, 2].min():.4f} m low", 3),
        ("60 x 60, draped, 30 modes", lambda: modes(square(60, "disc", drape(60))), 1),
    ):
        result, taken = seconds(run, repeats)
        unit = unit or taken
        print(f"{name:<32}{taken:>9.2f}{taken / unit:>8.1f}   {result}")


if __name__ == "__main__":
    main()
