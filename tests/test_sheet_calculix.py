"""What hangs, and how it vibrates there, against CalculiX (Debian's calculix-ccx).

*STEP, NLGEOM finds the equilibrium, *STEP, PERTURBATION with *FREQUENCY the modes about it; bricks
C3D20R, one through the thickness, are what it makes of its shells S8R too.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from calculix import ABSENT, CCX
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.modal.model import Model

pytestmark = pytest.mark.skipif(CCX is None, reason=ABSENT)

FloatArray = NDArray[np.float64]

COUNT = 5
#: Corners of a brick, then the middles of its edges: below, above, upright.
_BRICK = """000 200 220 020 002 202 222 022 100 210 120 010 102 212 122 012
            001 201 221 021"""


def calculix(
    folder: Path,
    size: tuple[float, float, float],
    divisions: tuple[int, int],
    material: tuple[float, float, float],
    gravity: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return undeformed nodes, their displacements and the lowest frequencies [Hz]."""
    shape = 2 * np.array([*divisions, 1]) + 1
    first = np.stack(np.meshgrid(*(np.arange(n) for n in (*divisions, 1)), indexing="ij"), -1)
    places = 2 * first.reshape(-1, 1, 3) + [[int(i) for i in node] for node in _BRICK.split()]
    number, cells = np.unique(
        np.ravel_multi_index(places.reshape(-1, 3).T, shape), return_inverse=True
    )
    points = np.stack(np.unravel_index(number, shape), 1) / (shape - 1) * size
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in enumerate(points.tolist(), 1)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=SHEET")
    for n, cell in enumerate(cells.reshape(-1, 20) + 1, 1):
        lines += [f"{n}, " + ", ".join(map(str, cell[:12])) + ",", ", ".join(map(str, cell[12:]))]
    young, ratio, density = material
    lines += ["*MATERIAL, NAME=M", f"*ELASTIC\n{young}, {ratio}", f"*DENSITY\n{density}"]
    lines += ["*SOLID SECTION, ELSET=SHEET, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{n + 1}, 1, 3" for n in np.flatnonzero(points[:, 0] == 0)]
    amount = float(np.linalg.norm(gravity))
    way = ", ".join(str(g / amount) for g in gravity)
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.1, 1.", "*DLOAD"]
    lines += [f"SHEET, GRAV, {amount}, {way}", "*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    lines += ["*STEP, PERTURBATION", "*FREQUENCY", str(COUNT), "*END STEP"]
    (folder / "sheet.inp").write_text("\n".join(lines) + "\n")
    subprocess.run([CCX, "sheet"], cwd=folder, check=True, capture_output=True, timeout=120)
    hung, modes = (folder / "sheet.dat").read_text().split("E I G E N V A L U E   O U T P U T")
    rows = re.findall(r"^\s+\d+\s+(\S+E\S+)\s+(\S+E\S+)\s+(\S+E\S+)$", hung, re.M)
    moved = np.array(rows[-len(points) :], dtype=np.float64)
    rows = re.findall(r"^\s+\d+\s+(\S+)\s+\S+\s+(\S+)\s+\S+\s*$", modes, re.M)
    return points, moved, np.array([float(row[1]) for row in rows[:COUNT]])


def solve_sheet(
    size: tuple[float, float, float],
    divisions: tuple[int, int],
    material: tuple[float, float, float],
    gravity: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the same of a sheet."""
    points, cells = build_lattice(np.stack([np.zeros(3), size], 1).ravel(), (*divisions, 1))
    young, ratio, density = material
    plate = homogeneous_plate(isotropic(young, ratio), size[2])
    held = np.repeat(points[:, :1] == 0, 3, axis=1)
    rest = Model(points, cells, plate, density, held)
    moved, _ = rest.solve_equilibrium(np.outer(rest.nodal_mass, gravity).ravel())
    hung = Model(points, cells, plate, density, held, displacement=moved)
    rate = np.sqrt(hung.modes(COUNT).eigenvalues * hung.modulus / density)
    return points, moved, rate / (2 * np.pi)


CASES = {
    # name: size, E ν ρ, gravity; held where x = 0
    "curtain": ((1.0, 0.1, 3e-4), (40e6, 0.0, 300.0), (9.81, 0.0, 0.0)),
    "thick curtain": ((1.0, 0.2, 2e-3), (4e6, 0.3, 300.0), (9.81, 0.0, 0.0)),
    # Peirce's cantilever, of twice its bending length
    "level": ((0.1, 0.02, 1e-3), (1e6, 0.3, 68.0), (0.0, 0.0, -9.81)),
    # hangs down by more than nine tenths, and to one side
    "long, askew": ((0.15, 0.02, 5e-4), (1e6, 0.3, 30.0), (0.0, -2.0, -9.0)),
}


#: The cases of the gate: one that is pulled, and one that bends far.
GATE = ("curtain", "level")


@pytest.mark.parametrize(
    "name",
    [pytest.param(each, marks=() if each in GATE else pytest.mark.nightly) for each in CASES],
)
def test_equilibrium_and_frequencies_equal_those_of_calculix(name: str, tmp_path: Path) -> None:
    """Place of the free end and five frequencies: refined, within 1 % of 20 quadratic bricks."""
    size, material, gravity = CASES[name]
    along = 20
    across = max(2, round(along * size[1] / size[0]))
    nodes, hung, frequencies = calculix(tmp_path, size, (along, across), material, gravity)
    assert len(frequencies) == COUNT
    end = hung[nodes[:, 0] == size[0]].mean(axis=0)
    assert np.linalg.norm(end) > (0.5 * size[0] if "curtain" not in name else 0.0)
    errors = []
    for finer in (1, 2):
        points, moved, ours_ = solve_sheet(size, (finer * along, finer * across), material, gravity)
        place = moved[points[:, 0] == size[0]].mean(axis=0)
        errors.append([*abs(place - end) / np.linalg.norm(end), *abs(ours_ / frequencies - 1)])
    first, second = np.max(errors, axis=1)
    assert second < 0.01
    assert second < first
