"""Steps of the nonlinear equations against CalculiX's *DYNAMIC, NLGEOM, on the same mesh.

CalculiX's steps are of second order, and so it takes shorter ones.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from calculix import ABSENT, CCX, cards, mesh, their_mass

from spacemap_vtk.mechanics.boundary import time_functions
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion

pytestmark = pytest.mark.skipif(CCX is None, reason=ABSENT)

MODULUS, RATIO, DENSITY, FORCE = 1e5, 0.3, 300.0, 60.0
THEIRS, OURS, RISE, END = 0.001, 0.005, 0.2, 0.5


@pytest.mark.nightly
def test_large_bending_of_a_beam_equals_that_of_calculix(tmp_path: Path) -> None:
    points, cells = mesh((1, 4, 1), 2, (0, 0.4, 0, 2, 0, 0.3))
    held = points[:, 1] == 0
    loaded = int(np.argmax(points @ [1.0, 10.0, 1.0]))
    lines = cards(points, cells, held, f"*ELASTIC\n{MODULUS}, {RATIO}", DENSITY)
    lines += [f"*NSET, NSET=POINT\n{loaded + 1}"]
    lines += [f"*AMPLITUDE, NAME=FACTOR\n0., 0., {RISE}, 1., 10., 1."]
    lines += ["*STEP, NLGEOM, INC=100000", "*DYNAMIC, ALPHA=0., DIRECT", f"{THEIRS}, {END}"]
    lines += ["*CLOAD, AMPLITUDE=FACTOR", f"{loaded + 1}, 3, {FORCE}"]
    lines += ["*NODE PRINT, NSET=POINT, FREQUENCY=1", "U", "*END STEP", ""]
    (tmp_path / "cage.inp").write_text("\n".join(lines))
    assert CCX is not None
    done = subprocess.run(
        [CCX, "-i", "cage"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:]
    found = re.findall(
        r"displacements.*?time\s+(\S+)\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)",
        (tmp_path / "cage.dat").read_text(),
        re.DOTALL,
    )
    times, theirs = np.split(np.array(found, dtype=np.float64), [1], axis=1)

    fixed = np.repeat(held[:, None], 3, axis=1)
    model = Model(points, cells, isotropic(MODULUS, RATIO), DENSITY, fixed)
    model.pencil.__dict__["full_mass"] = their_mass(points, cells, 1.0)
    cage = CageModes(model, np.empty(0), np.empty((0, points.size)), np.empty(0))
    load = cage.load_vector(
        "force",
        (0, 0, FORCE),
        time_functions.table([0, RISE], [0, 1]),
        tuple(points[loaded].tolist()),
    )
    motion = SteppedMotion(cage, [load], tolerance=np.inf, max_step=OURS)
    weights = np.zeros(len(points))
    weights[loaded] = 1.0
    ours = motion.history(weights, times[:, 0])[0]
    assert abs(theirs[:, 1]).max() > 0.1  # it turns: the linear solution has nothing of this
    np.testing.assert_allclose(ours, theirs, atol=1e-4 * abs(theirs).max())
