"""Materials: compliances, stability, and what an orthotropic cage does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource
from spacemap_vtk.cage.lattice import lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.modal.eigen import solve_modes
from spacemap_vtk.modal.elasticity import stiffness_and_mass
from spacemap_vtk.modal.materials import along_fabric, isotropic, orthotropic

MODULI, SHEARS, RATIOS = [2e6, 1e6, 1e5], [3e5, 4e4, 5e4], [0.2, 0.1, 0.05]


def test_isotropic_is_a_special_case():
    shear = 2e6 / 2.6
    np.testing.assert_allclose(
        orthotropic([2e6] * 3, [shear] * 3, [0.3] * 3), isotropic(2e6, 0.3), rtol=1e-13, atol=1e-6
    )


def test_constants_are_what_tests_would_show():
    compliance = np.linalg.inv(orthotropic(MODULI, SHEARS, RATIOS))
    np.testing.assert_allclose(1 / np.diag(compliance), MODULI + SHEARS[::-1])
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), RATIOS, strict=True):
        assert -compliance[j, i] / compliance[i, i] == pytest.approx(ratio)
        assert compliance[j, i] == pytest.approx(compliance[i, j])


@given(
    st.lists(st.floats(1e2, 1e10), min_size=3, max_size=3),
    st.lists(st.floats(1e2, 1e10), min_size=3, max_size=3),
    st.lists(st.floats(-1.2, 1.2), min_size=3, max_size=3),
)
def test_what_is_taken_is_positive_definite(moduli, shears, ratios):
    try:
        matrix = orthotropic(moduli, shears, ratios)
    except InputError:
        return
    scale = np.sqrt(np.diag(matrix))
    assert np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] > 0


@pytest.mark.parametrize(
    ("moduli", "shears", "ratios", "what"),
    [
        ([1e6, 0, 1e6], SHEARS, RATIOS, "youngs_moduli.*no positive stiffness"),
        (MODULI, [1e5, -1, 1e5], RATIOS, "shear_moduli.*no positive stiffness"),
        ([1e6, 4e6, 1e6], SHEARS, [0.6, 0, 0], r"ν12 between -0\.5 and 0\.5.*was ν21 given"),
        ([1e6] * 3, SHEARS, [0.6, 0.6, 0.6], "these three ratios together"),
        (MODULI[:2], SHEARS, RATIOS, "not three numbers"),
        ([1e6, np.nan, 1], SHEARS, RATIOS, "not three numbers"),
    ],
)
def test_impossible_ones_are_refused(moduli, shears, ratios, what):
    with pytest.raises(InputError, match=what):
        orthotropic(moduli, shears, ratios)


def test_the_warp_lies_along_y():
    compliance = np.linalg.inv(along_fabric(orthotropic(MODULI, SHEARS, RATIOS)))
    np.testing.assert_allclose(1 / np.diag(compliance)[:3], [1e6, 2e6, 1e5])
    # yz is the warp's thickness (13), zx the weft's (23).
    np.testing.assert_allclose(1 / np.diag(compliance)[3:], [4e4, 5e4, 3e5])
    assert -compliance[0, 1] / compliance[1, 1] == pytest.approx(0.2)


@pytest.mark.parametrize(("axis", "modulus"), [(0, 1e6), (1, 2e6), (2, 1e5)])
def test_a_bar_sounds_with_the_modulus_of_its_axis(axis, modulus):
    elasticity = along_fabric(orthotropic(MODULI, SHEARS, [0, 0, 0]))
    bounds, divisions = [0, 0.05] * 3, [1, 1, 1]
    bounds[2 * axis + 1], divisions[axis] = 1.0, 40
    points, tetrahedra = lattice(bounds, divisions)
    K, M = stiffness_and_mass(points, tetrahedra, elasticity, 100.0)
    eigenvalues = solve_modes(K, M, np.arange(K.shape[0]) % 3 == axis, 2)[0]
    frequency = math.sqrt(eigenvalues[1]) / (2 * math.pi)
    assert frequency == pytest.approx(math.sqrt(modulus / 100.0) / 2, rel=1e-3)


def solver(**settings):
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(3, 3, 2))
    cage.SetInputConnection(weave.GetOutputPort())
    made = ModalSolver(modes=6, **settings)
    made.SetInputConnection(cage.GetOutputPort())
    return made


def test_the_solver_takes_it():
    stiff = solver(
        material="orthotropic",
        youngs_moduli=["2 MPa", "1 MPa", "100 kPa"],
        shear_moduli=SHEARS,
        poissons_ratios=RATIOS,
    )
    stiff.update()
    field = stiff.GetOutputDataObject(0).GetFieldData().GetArray("elasticity")
    written = [field.GetComponent(i, j) for i in range(6) for j in range(6)]
    expected = along_fabric(orthotropic(MODULI, SHEARS, RATIOS))
    np.testing.assert_allclose(np.reshape(written, (6, 6)), expected)


def test_what_does_not_belong_together_is_refused():
    with pytest.raises(InputError, match=r"modal\.shear_moduli: an orthotropic.*G12, G13, G23"):
        solver(material="orthotropic", youngs_moduli=MODULI).update()
    with pytest.raises(InputError, match=r'modal\.youngs_moduli.*Set material = "orthotropic"'):
        solver(youngs_moduli=MODULI).update()


def test_lumped_mass_brings_frequencies_from_below():
    first = []
    for mass in ("lumped", "consistent"):
        made = solver(mass=mass)
        made.update()
        first.append(made.GetOutputDataObject(0).GetFieldData().GetArray("frequencies").GetValue(0))
    assert first[0] < first[1]


def test_warnings_say_how_far_off():
    weave, cage = WeaveSource(), TetraCage(divisions=(5, 5, 1))
    cage.SetInputConnection(weave.GetOutputPort())
    made = ModalSolver()
    made.SetInputConnection(cage.GetOutputPort())
    made.update()
    (text,) = made.warnings
    assert "times too stiffly" in text
    assert "order = 2" in text
    made.poissons_ratio = 0.49
    made.update()
    assert len(made.warnings) == 2
    assert "lock in volume" in made.warnings[1]
    cage.order = 2
    made.update()
    assert made.warnings == ()
    cage.configure(order=1, divisions=(5, 5, 3))
    made.update()
    assert len(made.warnings) == 1
