"""What hangs or lies, and how it vibrates there, against CalculiX (Debian's calculix-ccx).

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
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm, contact_stiffness
from spacemap_vtk.mechanics.contact.obstacles import Plane
from spacemap_vtk.mechanics.contact.resting import find_resting_state
from spacemap_vtk.mechanics.contact.samples import sample_sheet
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.units import GRAVITY

pytestmark = pytest.mark.skipif(CCX is None, reason=ABSENT)

FloatArray = NDArray[np.float64]

COUNT = 5
#: Corners of a brick, then the middles of its edges: below, above, upright.
_BRICK = """000 200 220 020 002 202 222 022 100 210 120 010 102 212 122 012
            001 201 221 021"""


def bricks(
    size: tuple[float, float, float],
    divisions: tuple[int, int],
    material: tuple[float, float, float],
) -> tuple[FloatArray, list[str]]:
    """Return nodes, and the lines of an input file for a strip that is held where x = 0."""
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
    return points, lines + [f"{n + 1}, 1, 3" for n in np.flatnonzero(points[:, 0] == 0)]


def calculix(
    folder: Path,
    size: tuple[float, float, float],
    divisions: tuple[int, int],
    material: tuple[float, float, float],
    gravity: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return undeformed nodes, their displacements and the lowest frequencies [Hz]."""
    points, lines = bricks(size, divisions, material)
    amount = float(np.linalg.norm(gravity))
    way = ", ".join(str(g / amount) for g in gravity)
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.1, 1.", "*DLOAD"]
    lines += [f"SHEET, GRAV, {amount}, {way}", "*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    lines += ["*STEP, PERTURBATION", "*FREQUENCY", str(COUNT), "*END STEP"]
    (folder / "sheet.inp").write_text("\n".join(lines) + "\n")
    subprocess.run([CCX, "sheet"], cwd=folder, check=True, capture_output=True, timeout=300)
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


def calculix_on_ground(
    folder: Path,
    size: tuple[float, float, float],
    along: int,
    material: tuple[float, float, float],
    depth: float,
) -> tuple[FloatArray, FloatArray, float]:
    """Return nodes, their displacements, and the force on the ground at a depth below the strip."""
    points, lines = bricks(size, (along, 2), material)
    first = len(points) + 1
    ground = [(x, y, z) for z in (-depth - 0.02, -depth) for x, y in _SQUARE]
    lines.append("*NODE, NSET=GROUND")
    lines += [f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(ground, first)]
    corners = ", ".join(str(first + k) for k in range(8))
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=BLOCK", f"{2 * along + 1}, {corners}"]
    lines += ["*SOLID SECTION, ELSET=BLOCK, MATERIAL=M", "*BOUNDARY", "GROUND, 1, 3"]
    lines += ["*SURFACE, NAME=BELOW", "SHEET, S1", "*SURFACE, NAME=TOP", "BLOCK, S2"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines.append("1e6")  # the weight presses it in by 0.1 µm
    lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "BELOW, TOP"]
    lines += ["*STEP, NLGEOM, INC=2000", "*STATIC", "0.05, 1., 1e-6", "*DLOAD"]
    lines += [f"SHEET, GRAV, {GRAVITY}, 0, 0, -1", "*NODE PRINT, NSET=ALL", "U"]
    lines += ["*NODE PRINT, NSET=GROUND, TOTALS=ONLY", "RF", "*END STEP"]
    (folder / "ground.inp").write_text("\n".join(lines) + "\n")
    subprocess.run([CCX, "ground"], cwd=folder, check=True, capture_output=True, timeout=300)
    text = (folder / "ground.dat").read_text()
    rows = re.findall(r"^\s+\d+\s+(\S+E\S+)\s+(\S+E\S+)\s+(\S+E\S+)$", text, re.M)
    totals = re.findall(r"^\s+(\S+E\S+)\s+(\S+E\S+)\s+(\S+E\S+)$", text, re.M)
    moved = np.array(rows[-len(points) :], dtype=np.float64)
    return points, moved, float(totals[-1][2])


#: Corners x, y of the rigid ground in CalculiX [m].
_SQUARE = ((-0.05, -0.05), (0.3, -0.05), (0.3, 0.1), (-0.05, 0.1))


@pytest.mark.nightly
def test_strip_lies_on_the_ground_as_in_calculix(tmp_path: Path) -> None:
    """Held at one end above the ground: the force on it, and the shape, against its contact."""
    size, material, depth = (0.15, 0.01, 5e-4), (1e6, 0.0, 30.0), 0.01
    nodes, theirs, force = calculix_on_ground(tmp_path, size, 30, material, depth)
    low = np.isclose(nodes[:, 2], 0) & (nodes[:, 1] == 0)
    errors = []
    for cells in (30, 60):
        points, lattice = build_lattice(np.stack([np.zeros(3), size], 1).ravel(), (cells, 1, 1))
        surface = find_mid_surface(points, lattice)
        assert surface is not None
        plate = homogeneous_plate(isotropic(*material[:2]), size[2])
        stiffness = contact_stiffness(plate, size[0] / cells)
        ground = Plane((0, 0, -depth))
        samples = sample_sheet(points, surface)
        term = ObstacleTerm(ground, samples, stiffness, size[2] / 2, surface=surface)
        held = np.repeat(points[:, :1] == 0, 3, axis=1)
        model = Model(points, lattice, plate, material[2], held, terms=[term])
        weight = np.outer(model.nodal_mass, (0, 0, -GRAVITY))
        moved = find_resting_state(model, weight.ravel()).displacement
        ours = -term.evaluate(points + moved).report().force[2]
        below = np.isclose(points[:, 2], 0) & (points[:, 1] == 0)
        order = np.argsort(nodes[low, 0])
        shape = np.interp(points[below, 0], nodes[low, 0][order], theirs[low, 2][order])
        errors.append((abs(ours / force - 1), abs(moved[below, 2] - shape).max() / depth))
    # The force on the ground, and the shape as a share of the depth.
    assert max(errors[1]) < 1e-3
    assert np.less(errors[1], errors[0]).all()
