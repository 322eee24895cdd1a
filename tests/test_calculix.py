"""Frequencies against CalculiX, an independent solver (Debian's calculix-ccx).

Its stiffness is ours. Its mass is under-integrated: with one point in linear tetrahedra (a
sixteenth of the mass in all sixteen entries), with four in quadratic ones. With those masses its
eigenvalues are reproduced to the digits it prints; with ours they converge to each other.
"""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest
import scipy.linalg as la
from calculix import ABSENT, CCX, cards, mesh, their_mass

from spacemap_vtk.mechanics.eigen import solve_modes
from spacemap_vtk.mechanics.elasticity import assemble, isotropic, mass, stiffness
from spacemap_vtk.mechanics.materials import orthotropic

pytestmark = pytest.mark.skipif(CCX is None, reason=ABSENT)

DENSITY, SLAB = 300.0, (0, 1, 0, 1, 0, 0.1)
ISOTROPIC = isotropic(1e6, 0.3), "*ELASTIC\n1e6, 0.3"
WOVEN = (
    orthotropic([2e6, 1e6, 1e5], [3e5, 4e4, 5e4], [0.2, 0.1, 0.05]),
    "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n2e6, 1e6, 1e5, 0.2, 0.1, 0.05, 3e5, 4e4\n5e4",
)


def calculix(folder, points, cells, material, held, count):
    """Return the eigenvalues that CalculiX finds."""
    lines = cards(points, cells, held, material, DENSITY)
    lines += ["*STEP", "*FREQUENCY", str(count), "*NODE FILE", "U", "*END STEP"]
    (folder / "cage.inp").write_text("\n".join(lines) + "\n")
    subprocess.run([CCX, "cage"], cwd=folder, check=True, capture_output=True, timeout=120)
    rows = re.findall(
        r"^\s+(\d+)\s+(\S+)\s+\S+\s+\S+\s+\S+\s*$", (folder / "cage.dat").read_text(), re.M
    )
    return np.array([float(value) for _, value in rows[:count]])


@pytest.mark.parametrize("material", [ISOTROPIC, WOVEN], ids=["isotropic", "orthotropic"])
@pytest.mark.parametrize(("divisions", "order"), [((5, 5, 1), 1), ((3, 3, 1), 2)])
def test_eigenvalues_with_its_mass(tmp_path, divisions, order, material):
    points, cells = mesh(divisions, order, SLAB)
    held = points[:, 1] == 1
    theirs = calculix(tmp_path, points, cells, material[1], held, 10)
    free = np.repeat(~held, 3)
    K = stiffness(assemble(points, cells), material[0])[free][:, free].toarray()
    M = their_mass(points, cells, DENSITY)[free][:, free].toarray()
    # Of the inverse, because that mass is singular.
    ours = 1 / la.eigh(M, K, eigvals_only=True)[::-1][:10]
    assert len(theirs) == 10
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


@pytest.mark.parametrize(("order", "most"), [(1, 0.15), (2, 0.03)])
def test_refinement_brings_agreement(tmp_path, order, most):
    differences = []
    for divisions in ((5, 5, 1), (10, 10, 2)) if order == 1 else ((3, 3, 1), (6, 6, 2)):
        points, cells = mesh(divisions, order, SLAB)
        held = points[:, 1] == 1
        theirs = calculix(tmp_path, points, cells, ISOTROPIC[1], held, 10)
        made = assemble(points, cells)
        K, M = stiffness(made, ISOTROPIC[0]), mass(made, DENSITY)
        ours = solve_modes(K, M, np.repeat(~held, 3), 10)[0]
        differences.append(abs(ours / theirs - 1).max())
    assert differences[0] < most
    assert differences[1] < 0.5 * differences[0]
