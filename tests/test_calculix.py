"""Exported cages in CalculiX, an independent solver (Debian's calculix-ccx): modes and bending.

Its stiffness is ours. Its consistent mass is under-integrated: with one point in linear tetrahedra
(a sixteenth of the mass in all sixteen entries), with four in quadratic ones. With those masses its
eigenvalues are reproduced to the digits it prints; with ours they converge to each other. A lumped
mass is the same in both.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
from calculix import ABSENT, CCX, mesh, their_mass
from pencils import solve_matrices

from spacemap_vtk.datasets.arrays import array_of
from spacemap_vtk.datasets.modal_model import InputDeck
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import writer
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.mechanics.boundary.fittings import Fittings
from spacemap_vtk.mechanics.elements.elasticity import assemble, mass_matrix, stiffness_matrix
from spacemap_vtk.mechanics.elements.materials import isotropic, orthotropic
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.scenes.scene import Scene

needs_calculix = pytest.mark.skipif(CCX is None, reason=ABSENT)

DENSITY, SLAB = 300.0, (0, 1, 0, 1, 0, 0.1)
ISOTROPIC = isotropic(1e6, 0.3)
WOVEN = orthotropic([2e6, 1e6, 1e5], [3e5, 4e4, 5e4], [0.2, 0.1, 0.05])


def calculix(file):
    """Return the eigenvalues and frequencies that CalculiX finds."""
    subprocess.run([CCX, file.stem], cwd=file.parent, check=True, capture_output=True, timeout=300)
    rows = re.findall(
        r"^\s+\d+\s+(\S+)\s+\S+\s+(\S+)\s+\S+\s*$", file.with_suffix(".dat").read_text(), re.M
    )
    return np.array(rows, dtype=float).T


def eigenvalues(folder, points, cells, material, held):
    model = Model(points, cells, material, DENSITY, np.repeat(held[:, None], 3, axis=1))
    nothing = np.zeros_like(points)
    file = folder / "slab.inp"
    writer(file, "analysis").write(file, InputDeck("", model, 10, nothing[0], nothing, []))
    return calculix(file)[0][:10]


@needs_calculix
@pytest.mark.parametrize("material", [ISOTROPIC, WOVEN], ids=["isotropic", "orthotropic"])
@pytest.mark.parametrize(("divisions", "order"), [((5, 5, 1), 1), ((3, 3, 1), 2)])
def test_eigenvalues_agree_with_the_mass_of_calculix(tmp_path, divisions, order, material):
    points, cells = mesh(divisions, order, SLAB)
    held = points[:, 1] == 1
    theirs = eigenvalues(tmp_path, points, cells, material, held)
    free = np.repeat(~held, 3)
    K = stiffness_matrix(assemble(points, cells), material)[free][:, free].toarray()
    M = their_mass(points, cells, DENSITY)[free][:, free].toarray()
    # Of the inverse, because that mass is singular.
    ours = 1 / la.eigh(M, K, eigvals_only=True)[::-1][:10]
    assert len(theirs) == 10
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


@needs_calculix
@pytest.mark.parametrize(("order", "most"), [(1, 0.15), (2, 0.03)])
def test_eigenvalues_converge_to_those_of_calculix(tmp_path, order, most):
    differences = []
    for divisions in ((5, 5, 1), (10, 10, 2)) if order == 1 else ((3, 3, 1), (6, 6, 2)):
        points, cells = mesh(divisions, order, SLAB)
        held = points[:, 1] == 1
        theirs = eigenvalues(tmp_path, points, cells, ISOTROPIC, held)
        made = assemble(points, cells)
        K, M = stiffness_matrix(made, ISOTROPIC), mass_matrix(made, DENSITY)
        ours = solve_matrices(K, M, np.repeat(~held, 3), 10)[0]
        differences.append(abs(ours / theirs - 1).max())
    assert differences[0] < most
    assert differences[1] < 0.5 * differences[0]


@needs_calculix
def test_stiffness_and_density_factors_are_written(tmp_path):
    points, cells = mesh((3, 3, 1), 1, SLAB)
    stiff, heavy = np.ones(len(cells)), np.ones(len(cells))
    stiff[:20], heavy[10:30] = 3.0, 2.0
    model = Model(
        *(points, cells[:, [1, 0, 2, 3]], ISOTROPIC, DENSITY),  # inside out, as meshes may be
        held=np.repeat(points[:, 1:2] == 1, 3, axis=1),
        lumped=True,
        fittings=Fittings(stiffness_factors=stiff, mass_factors=heavy),
    )
    file, nothing = tmp_path / "slab.inp", np.zeros_like(points)
    writer(file, "analysis").write(file, InputDeck("", model, 10, nothing[0], nothing, []))
    ours = model.modes(10).eigenvalues * model.modulus / model.density
    np.testing.assert_allclose(calculix(file)[0][:10], ours, rtol=1e-6)


def export_scene(folder, mass="lumped", **modal):
    """Return a scene whose cage is a slab, with gravity and two loads."""
    material = {
        "material": "orthotropic",
        "youngs_moduli": [2e6, 1e6, 1e5],
        "shear_moduli": [3e5, 4e4, 5e4],
        "poissons_ratios": [0.2, 0.1, 0.05],
    }
    scene = Scene(
        {
            "cage": {"divisions": [3, 3, 1], "order": 2},
            "modal": {
                "elements": "tetrahedra",
                "modes": 10,
                "mass": mass,
                "fixed": ["+y", "-x:z"],
                **material,
                **modal,
            },
            "response": {
                "loads": [
                    {"traction": [0, 0, 5.0], "on": "-y", "time": "ramp", "rise": 0.1},
                    {"pressure": 1.0, "on": "+z", "time": "harmonic", "frequency": 5.0},
                ]
            },
        }
    )
    make_data_job(folder / "slab.inp").run(scene)
    return scene


@needs_calculix
@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_exported_scene_has_the_same_frequencies(tmp_path, mass):
    scene = export_scene(tmp_path, mass)
    frequencies = calculix(tmp_path / "slab.inp")[1][:10]
    found = scene.stage("solver").output
    ours = array_of(found.GetFieldData(), "frequencies", "")
    np.testing.assert_allclose(frequencies, ours, rtol=1e-6 if mass == "lumped" else 0.02)
    # What the motion comes to rest at, once the harmonic load is taken away.
    scene.assign("response", "loads", [{"traction": [0, 0, 5.0], "on": "-y"}])
    scene.set("response.initial=equilibrium")
    scene.update_stage(scene.cage_stage, 0.0)
    rest = array_of(scene.deformed_cage.GetPointData(), "displacement", "")
    shown = Path(tmp_path / "slab.frd").read_text().rpartition(" -4  DISP")[2].partition(" -3\n")[0]
    rows = [line for line in shown.splitlines() if line.startswith(" -1")]
    moved = [[float(row[13 + 12 * axis : 25 + 12 * axis]) for axis in range(3)] for row in rows]
    np.testing.assert_allclose(moved, rest, rtol=0, atol=1e-5 * abs(rest).max())


def test_features_that_calculix_lacks_are_refused(tmp_path):
    scene = export_scene(tmp_path)
    sentence = "the static step leaves out loads[1], a pressure (harmonic)"
    assert sentence in scene.warnings
    assert f"** Note: {sentence}." in (tmp_path / "slab.inp").read_text()
    for values, key, cure in (
        ({"springs": "-y 5 N/m"}, "springs", "modal.springs="),
        ({"gravity": [0, 0, -9.81]}, "gravity", "modal.hang=false"),
    ):
        with pytest.raises(InputError) as refused:
            export_scene(tmp_path, **values)
        assert (refused.value.section, refused.value.key) == ("modal", key)
        assert cure in refused.value.cure
    free = export_scene(tmp_path, fixed=[])
    assert any("supports do not hold the cage" in text for text in free.warnings)
    assert "*STATIC" not in (tmp_path / "slab.inp").read_text()
    with pytest.raises(InputError, match="sheet elements cannot be exported") as refused:
        Scene({"cage": {"divisions": [9, 9, 1]}, "modal": {"elements": "sheet"}}).data("analysis")
    assert "modal.elements=tetrahedra" in refused.value.cure
    with pytest.raises(InputError, match="no cage with computed modes"):
        Scene({"weave": {}}).data("analysis")
