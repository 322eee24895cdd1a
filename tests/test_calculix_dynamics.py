"""ModalMotion over time against CalculiX, which solves the same equations with code of its own.

With its under-integrated mass the modes are the same, and *MODAL DYNAMIC is exact for piecewise
linear loads.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
from calculix import ABSENT, CCX, cards, mesh, their_mass

from spacemap_vtk.mechanics.boundary import time_functions
from spacemap_vtk.mechanics.elements.elasticity import assemble, stiffness_matrix
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.response.modal_motion import ModalLoad, ModalMotion

pytestmark = pytest.mark.skipif(CCX is None, reason=ABSENT)

MODULUS, RATIO, DENSITY, FORCE = 1e4, 0.3, 300.0, 0.5
MODES, STEP, END = 10, 0.02, 1.0

CASES = {
    # name: *AMPLITUDE, *MODAL DAMPING, our function, our damping
    "step": (
        "0., 1., 10., 1.",
        "RAYLEIGH\n,, 0.8, 2e-4",
        time_functions.step(),
        Damping(0.8, 2e-4),
    ),
    "table": (
        "0., 0., 0.2, 1., 0.5, -0.4, 0.6, 0.\n10., 0.",
        "RAYLEIGH\n,, 0.8, 2e-4",
        time_functions.table([0.0, 0.2, 0.5, 0.6], [0.0, 1.0, -0.4, 0.0]),
        Damping(0.8, 2e-4),
    ),
    "direct damping": (
        "0., 1., 10., 1.",
        "\n1, 10, 0.04",
        time_functions.step(),
        Damping(ratio=0.04),
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("order", [1, 2], ids=["C3D4", "C3D10"])
def test_response_to_a_vertex_force_equals_that_of_calculix(
    name: str, order: int, tmp_path: Path
) -> None:
    amplitude, damping_card, function, damping = CASES[name]
    points, cells = mesh((2, 4, 1), order, (0, 1, 0, 2, 0, 0.4))
    held = points[:, 1] == 0
    loaded = int(np.argmax(points @ [1.0, 10.0, 1.0]))
    times, theirs = calculix(tmp_path, points, cells, held, loaded, amplitude, damping_card)
    assert len(times) == round(END / STEP)

    free = np.repeat(~held, 3)
    whole = stiffness_matrix(assemble(points, cells), isotropic(MODULUS, RATIO))
    k = whole[free][:, free].toarray()
    m = their_mass(points, cells, DENSITY)[free][:, free].toarray()
    # So few points of integration leave the mass singular: the inverse has the lowest modes.
    inverse, shapes = la.eigh(m, k)
    eigenvalues = 1 / inverse[::-1][:MODES]
    shapes = shapes[:, ::-1][:, :MODES] * np.sqrt(eigenvalues)
    force = np.zeros(3 * len(points))
    force[3 * loaded + 2] = FORCE
    drive = ModalLoad(shapes.T @ force[free], function)
    motion = ModalMotion(eigenvalues, damping.decay_rates(eigenvalues), [drive])
    everywhere = np.zeros((3 * len(points), MODES))
    everywhere[free] = shapes
    ours = np.stack(
        [everywhere[3 * loaded : 3 * loaded + 3] @ motion.at_time(time).position for time in times]
    )
    # CalculiX prints seven digits, and its iterative modes have about as many.
    np.testing.assert_allclose(ours, theirs, atol=2e-6 * abs(theirs).max())


def calculix(
    folder: Path,
    points: np.ndarray,
    cells: np.ndarray,
    held: np.ndarray,
    loaded: int,
    amplitude: str,
    damping: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Return times and displacements of the loaded vertex."""
    elastic = f"*ELASTIC\n{MODULUS}, {RATIO}"
    lines = cards(points, cells, held, elastic, DENSITY)
    lines += [f"*NSET, NSET=POINT\n{loaded + 1}", f"*AMPLITUDE, NAME=FACTOR\n{amplitude}"]
    lines += ["*STEP", "*FREQUENCY, STORAGE=YES", f"{MODES}", "*END STEP"]
    lines += ["*STEP, INC=100000", "*MODAL DYNAMIC", f"{STEP}, {END}"]
    lines += [f"*MODAL DAMPING{',' if damping[0] != chr(10) else ''}{damping}"]
    lines += ["*CLOAD, AMPLITUDE=FACTOR", f"{loaded + 1}, 3, {FORCE}"]
    lines += ["*NODE PRINT, NSET=POINT, FREQUENCY=1", "U", "*END STEP", ""]
    (folder / "cage.inp").write_text("\n".join(lines))
    assert CCX is not None
    done = subprocess.run(
        [CCX, "-i", "cage"], cwd=folder, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:]
    text = (folder / "cage.dat").read_text()
    found = re.findall(
        r"displacements.*?time\s+(\S+)\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)", text, re.DOTALL
    )
    table = np.array(found, dtype=np.float64)
    return table[:, 0], table[:, 1:]
