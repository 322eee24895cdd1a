"""How well a sheet's cells resolve its modes, against frequencies that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.resolution import describe_unresolved_modes, mode_errors
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.scene import Scene

E, RHO, SIDE, THICK = 1e6, 300.0, 0.1, 3e-4


def solve_with_errors(model, count):
    """Return ω of the modes of a sheet and the error that is estimated of each."""
    found = model.modes(count)
    values = found.eigenvalues * model.modulus / model.density
    shapes = found.shapes.reshape(len(values), -1) / math.sqrt(model.density)
    return np.sqrt(values), np.array(list(mode_errors(model, values, shapes)))


@pytest.mark.parametrize("cells", [(8, 8), (12, 12), (16, 8)], ids=str)
def test_the_error_of_a_simply_supported_plates_modes_is_estimated(cells):
    """ω = π² (m² + n²)/a² √(D/(ρ h)): at all sizes of cells, square or not."""
    points, tetrahedra = build_lattice((0, SIDE, 0, SIDE, 0, THICK), (*cells, 1))
    held = np.zeros(points.shape, bool)
    for axis in range(2):
        edge = np.isin(points[:, axis], [points[:, axis].min(), points[:, axis].max()])
        held[np.ix_(edge, [1 - axis, 2])] = True
    model = Model(points, tetrahedra, homogeneous_plate(isotropic(E, 0.3), THICK), RHO, held)
    found, estimated = solve_with_errors(model, 8)
    m, n = np.mgrid[1:9, 1:9]
    rate = math.pi**2 * math.sqrt(E * THICK**2 / 12 / (1 - 0.3**2) / RHO) / SIDE**2
    exact = np.sort((m**2 + n**2).ravel())[:8] * rate
    true = found / exact - 1
    assert true[0] < 0.02 < 0.06 < true[-1]
    np.testing.assert_allclose(estimated, true, rtol=0.15)


def test_the_error_of_a_cantilevers_modes_is_estimated():
    """Against finer cells: half of it to all of it, as free edges resolve worse."""
    frequencies, estimated = [], []
    for cells in (10, 32):
        points, tetrahedra = build_lattice((0, SIDE, 0, SIDE, 0, THICK), (cells, cells, 1))
        held = np.repeat(points[:, 1:2] == 0, 3, axis=1)
        model = Model(points, tetrahedra, homogeneous_plate(isotropic(E, 0.3), THICK), RHO, held)
        found, errors = solve_with_errors(model, 24)
        frequencies.append(found)
        estimated.append(errors)
    true = frequencies[0] / frequencies[1] - 1
    large = true > 0.05
    assert large.sum() > 12
    assert (estimated[0][large] > 0.5 * true[large]).all()
    assert (estimated[0][large] < 1.2 * true[large]).all()
    assert estimated[1].max() < 0.03


def test_axial_modes_are_resolved_better_than_bending_modes():
    """ω = (2 n - 1) π c/(2 L) of a strip that moves in its plane alone."""
    points, tetrahedra = build_lattice((0, 1.0, 0, 0.05, 0, 1e-3), (20, 1, 1))
    held = np.tile([False, True, True], (len(points), 1)) | (points[:, :1] == 0)
    model = Model(points, tetrahedra, homogeneous_plate(isotropic(E, 0.0), 1e-3), RHO, held)
    found, estimated = solve_with_errors(model, 8)
    exact = (2 * np.arange(1, 9) - 1) * math.pi / 2 * math.sqrt(E / RHO)
    true = found / exact - 1
    assert 1e-4 < true[0] < 1e-3 < 0.05 < true[-1]
    np.testing.assert_allclose(estimated, true, rtol=0.2)


def test_resolved_modes_between_unresolved_ones_are_not_counted():
    assert describe_unresolved_modes([0.01, 0.3, 0.05, 0.2, 0.02]) == (
        "2 of the modes 2 to 4 are not resolved by the cage's cells: frequencies are at least "
        "about 20% too high"
    )
    assert describe_unresolved_modes([0.01, 0.2]).startswith("mode 2 is not resolved")
    assert describe_unresolved_modes([0.0, 0.1]) == ""


@pytest.mark.parametrize(("modes", "warned"), [(20, True), (5, False)])
def test_unresolved_modes_are_reported(modes, warned):
    """Of the paper's 5 x 5 cells the 7th is a quarter too high."""
    scene = Scene.read("plain_weave")
    scene.set("modal.elements=sheet")
    scene.set("modal.tensile_rigidity=1 kN/m")
    scene.set("modal.bending_rigidity=0.001 uN.m")
    scene.set(f"modal.modes={modes}")
    report.report_modes(scene)
    texts = [text for text in scene.warnings if "not resolved by the cage's cells" in text]
    assert [text.split(" are")[0] for text in texts] == ["modes 7 to 20"] * warned
