"""Materials: compliances, stability, and what an orthotropic cage does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pencils import solve_matrices, stiffness_and_mass
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.materials import (
    equivalent_poissons_ratio,
    fabric_to_xyz,
    isotropic,
    orthotropic,
)
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS

MODULI, SHEARS, RATIOS = [2e6, 1e6, 1e5], [3e5, 4e4, 5e4], [0.2, 0.1, 0.05]


def test_isotropic_is_a_special_case_of_orthotropic():
    shear = 2e6 / 2.6
    np.testing.assert_allclose(
        orthotropic([2e6] * 3, [shear] * 3, [0.3] * 3), isotropic(2e6, 0.3), rtol=1e-13, atol=1e-6
    )


def test_constants_are_reproduced_by_tests():
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
def test_accepted_materials_are_positive_definite(moduli, shears, ratios):
    try:
        matrix = orthotropic(moduli, shears, ratios)
    except InputError:
        return
    scale = np.sqrt(np.diag(matrix))
    assert np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] > 0


@pytest.mark.parametrize(
    ("moduli", "shears", "ratios", "what"),
    [
        ([1e6, 0, 1e6], SHEARS, RATIOS, "youngs_moduli.*must be above 0 Pa"),
        (MODULI, [1e5, -1, 1e5], RATIOS, "shear_moduli.*must be above 0 Pa"),
        (
            [1e6, 4e6, 1e6],
            SHEARS,
            [0.6, 0, 0],
            r"ν12 between -0\.5 and 0\.5.*that ν21 was not given",
        ),
        ([1e6] * 3, SHEARS, [0.6, 0.6, 0.6], "these three Poisson's ratios"),
        (MODULI[:2], SHEARS, RATIOS, "three finite numbers"),
        ([1e6, np.nan, 1], SHEARS, RATIOS, "three finite numbers"),
    ],
)
def test_impossible_materials_are_refused(moduli, shears, ratios, what):
    with pytest.raises(InputError, match=what):
        orthotropic(moduli, shears, ratios)


def test_the_warp_lies_along_y():
    compliance = np.linalg.inv(fabric_to_xyz(orthotropic(MODULI, SHEARS, RATIOS)))
    np.testing.assert_allclose(1 / np.diag(compliance)[:3], [1e6, 2e6, 1e5])
    # yz is the warp's thickness (13), zx the weft's (23).
    np.testing.assert_allclose(1 / np.diag(compliance)[3:], [4e4, 5e4, 3e5])
    assert -compliance[0, 1] / compliance[1, 1] == pytest.approx(0.2)


@pytest.mark.parametrize(("axis", "modulus"), [(0, 1e6), (1, 2e6), (2, 1e5)])
def test_frequency_of_a_bar_follows_the_modulus_along_its_axis(axis, modulus):
    elasticity = fabric_to_xyz(orthotropic(MODULI, SHEARS, [0, 0, 0]))
    bounds, divisions = [0, 0.05] * 3, [1, 1, 1]
    bounds[2 * axis + 1], divisions[axis] = 1.0, 40
    points, tetrahedra = build_lattice(bounds, divisions)
    K, M = stiffness_and_mass(points, tetrahedra, elasticity, 100.0)
    eigenvalues = solve_matrices(K, M, np.arange(K.shape[0]) % 3 == axis, 2)[0]
    frequency = math.sqrt(eigenvalues[1]) / (2 * math.pi)
    assert frequency == pytest.approx(math.sqrt(modulus / 100.0) / 2, rel=1e-3)


def solver(**settings):
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(3, 3, 2))
    cage.SetInputConnection(weave.GetOutputPort())
    made = ModalSolver(modes=6, **settings)
    made.SetInputConnection(cage.GetOutputPort())
    return made


def test_solver_uses_an_orthotropic_material():
    stiff = solver(
        material="orthotropic",
        youngs_moduli=["2 MPa", "1 MPa", "100 kPa"],
        shear_moduli=SHEARS,
        poissons_ratios=RATIOS,
    )
    stiff.update()
    field = stiff.GetOutputDataObject(0).GetFieldData().GetArray("elasticity")
    written = [field.GetComponent(i, j) for i in range(6) for j in range(6)]
    expected = fabric_to_xyz(orthotropic(MODULI, SHEARS, RATIOS))
    np.testing.assert_allclose(np.reshape(written, (6, 6)), expected)


def test_incomplete_or_unused_constants_are_refused():
    with pytest.raises(InputError, match=r"modal\.shear_moduli: an orthotropic.*G12, G13, G23"):
        solver(material="orthotropic", youngs_moduli=MODULI).update()
    with pytest.raises(
        InputError,
        match=r'modal\.youngs_moduli.*It has an effect where material is neither "isotropic"',
    ):
        solver(youngs_moduli=MODULI).update()


def test_lumped_mass_brings_frequencies_from_below():
    first = []
    for mass in ("lumped", "consistent"):
        made = solver(mass=mass)
        made.update()
        first.append(made.GetOutputDataObject(0).GetFieldData().GetArray("frequencies").GetValue(0))
    assert first[0] < first[1]


def test_warnings_name_the_factor_and_a_cure():
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
    assert "volumetric locking" in made.warnings[1]
    cage.order = 2
    made.update()
    assert made.warnings == ()
    cage.configure(order=1, divisions=(15, 15, 3))
    made.update()
    assert len(made.warnings) == 1


# Rows of the source's table, read by another hand than mechanics/elements/measured_fabrics.py:
# kg/m², C11, C12, C22 and C33 in N/m at no strain, bending stiffness along, askew and across in N
# m.
TABLE = """
11oz-black-denim   .324 205.352005 10.234077  1013.88629 53.387184  64.196457 73.384567 96.951576
camel-ponte-roma   .284 31.146198  -12.802702 44.028667  31.896357  36.348366 33.013252 37.157593
gray-interlock     .187 16.593832  -14.695990 34.477123  36.860302  23.191698 24.749964 14.267624
ivory-rib-knit     .276 42.871021  -0.234556  65.166023  83.175644  46.237591 30.015930 32.243889
pink-ribbon-brown  .228 151.503906 106.028160 244.830673 30.250183  117.070122 87.509773 59.774277
royal-target       .220 2016.55456 9.170511   2034.97644 104.759674 125.409805 107.997696 125.409805
tango-red-jet-set  .113 43.067627  54.373299  171.424835 14.314700  14.293814 21.951700 20.345654
white-dots-on-blk  .128 2002.08618 0.345588   2027.48559 19.189022  51.713814 40.659470 31.282822
white-swim-solid   .204 47.971176  6.834521   104.615456 60.773663  60.237942 58.803211 51.018833
"""


def test_fabrics_are_those_of_the_table():
    rows = {}
    for line in TABLE.strip().splitlines():
        sample, *numbers = line.split()
        rows[sample] = [float(number) for number in numbers]
    assert {fabric.sample for fabric in FABRICS.values()} == set(rows)
    for fabric in FABRICS.values():
        bending = [1e6 * b for b in fabric.bending]
        assert [fabric.areal_mass, *fabric.stiffness, *bending] == pytest.approx(
            rows[fabric.sample], rel=1e-12
        )


@pytest.mark.parametrize("name", FABRICS)
def test_a_fabric_is_a_stable_solid_that_stretches_as_the_sheet(name):
    fabric = FABRICS[name]
    solid = fabric.solid(2e-3)
    matrix = orthotropic(*solid[:3])
    np.linalg.cholesky(matrix)
    # Nothing presses on the faces of a sheet: its stiffness is the inverse of a part of S.
    plane = np.linalg.inv(np.linalg.inv(matrix)[np.ix_([0, 1, 5], [0, 1, 5])]) * 2e-3
    c11, c12, c22, c33 = fabric.stiffness
    c12 = max(c12, 0.0)
    expected = [[c22, c12, 0], [c12, c11, 0], [0, 0, c33 / 2]]
    np.testing.assert_allclose(plane, expected, rtol=1e-12, atol=1e-9)
    assert solid.density * 2e-3 == pytest.approx(fabric.areal_mass)
    with pytest.raises(InputError, match="thickness"):
        fabric.solid(0.0)


def test_cage_of_denim_has_the_constants_of_denim():
    made = solver(material="denim")
    made.update()
    data = made.GetOutputDataObject(0)
    low, high = np.reshape(data.GetBounds(), (3, 2)).T
    area, thickness = (high - low)[0] * (high - low)[1], (high - low)[2]
    mass = vtk_to_numpy(data.GetPointData().GetArray("nodal_mass")).sum()
    assert mass / area == pytest.approx(0.324, rel=1e-9)
    # another thickness: another mass, the same frequencies
    first = vtk_to_numpy(data.GetFieldData().GetArray("frequencies")).copy()
    made.thickness = 2 * thickness
    made.update()
    data = made.GetOutputDataObject(0)
    second = vtk_to_numpy(data.GetFieldData().GetArray("frequencies"))
    np.testing.assert_allclose(first, second, rtol=1e-9)
    mass = vtk_to_numpy(data.GetPointData().GetArray("nodal_mass")).sum()
    assert mass / area == pytest.approx(0.162, rel=1e-9)


def test_given_constants_replace_measured_ones():
    made = solver(material="denim", thickness="1 mm", youngs_moduli=MODULI, density=500.0)
    made.update()
    field = made.GetOutputDataObject(0).GetFieldData()
    written = vtk_to_numpy(field.GetArray("elasticity")).reshape(6, 6)
    measured = FABRICS["denim"].solid(1e-3)
    expected = fabric_to_xyz(orthotropic(MODULI, measured[1], measured[2]))
    np.testing.assert_allclose(written, expected)
    assert field.GetArray("density").GetValue(0) == 500.0
    with pytest.raises(InputError, match=r"poissons_ratios.*ν12 = 9 is not possible"):
        solver(material="denim", poissons_ratios=[9, 0, 0]).update()


def test_fabric_constants_have_no_effect_on_other_materials():
    with pytest.raises(InputError, match=r'denin.*"denim" or "trousers".*Did you mean "denim"'):
        solver(material="denin")
    why = r'modal\.thickness = .*has no effect: material is "isotropic"'
    with pytest.raises(InputError, match=why):
        solver(thickness="1 mm").update()
    fabric = solver(material="denim", youngs_modulus="2 MPa")
    fabric.update()
    assert 'modal.youngs_modulus has no effect: material is "denim"' in fabric.warnings[-1]
    plain = solver()
    plain.update()
    assert plain.GetOutputDataObject(0).GetFieldData().GetArray("density").GetValue(0) == 300.0


def test_cage_that_bends_unlike_the_fabric_causes_a_warning():
    """The cure: with the moduli raised by the stated factor a strip bends as the measured plate."""
    weave, cage = WeaveSource(ends=5, picks=31), TetraCage(divisions=(3, 20, 1), order=2)
    cage.SetInputConnection(weave.GetOutputPort())
    made = ModalSolver(material="denim", modes=1)
    made.SetInputConnection(cage.GetOutputPort())
    made.update()
    (text,) = made.warnings
    data, fabric = made.GetOutputDataObject(0), FABRICS["denim"]
    extent = data.GetBounds()[5] - data.GetBounds()[4]
    times = (fabric.plate_thickness / extent) ** 2
    assert f"bends {times:.2g} times too softly" in text
    assert f"raise youngs_moduli and shear_moduli {times:.2g} times" in text
    solid = fabric.solid(extent)
    made.configure(
        youngs_moduli=[times * modulus for modulus in solid.youngs_moduli],
        shear_moduli=[times * modulus for modulus in solid.shear_moduli],
    )
    made.update()
    found = made.GetOutputDataObject(0).GetFieldData().GetArray("frequencies").GetValue(0)
    assert made.warnings == ()
    # Euler's cantilever with the bending stiffness of the plate along the warp, D = E1 h² / 12;
    # shear softens so short a one a little.
    length = data.GetBounds()[3] - data.GetBounds()[2]
    bending = fabric.solid(fabric.plate_thickness).youngs_moduli[0] * fabric.plate_thickness**3 / 12
    euler = 1.875104**2 / (2 * math.pi * length**2) * math.sqrt(bending / fabric.areal_mass)
    assert 0.9 < found / euler < 1.05


def test_equivalent_ratio_is_poissons_ratio_for_isotropic_solids():
    for ratio in (-0.5, 0.0, 0.3, 0.499):
        assert equivalent_poissons_ratio(isotropic(3e6, ratio)) == pytest.approx(ratio, abs=1e-12)
    # without contraction the axes do not matter
    assert equivalent_poissons_ratio(orthotropic(MODULI, SHEARS, [0.0] * 3)) == pytest.approx(
        0.0, abs=1e-12
    )
    # volume is kept where the compliances sum to nothing: ν12 = 1/2, and what is left for ν13
    near = orthotropic([4e6, 1e6, 1e6], SHEARS, [0.495, 0.495, 0.87])
    pressure = np.linalg.solve(near[:3, :3], np.ones(3))
    assert equivalent_poissons_ratio(near) > 0.45
    assert pressure.sum() < 0.1 / 1e6


@pytest.mark.nightly
def test_nearly_incompressible_orthotropic_cage_causes_a_warning():
    weave, cage = WeaveSource(), TetraCage(divisions=(15, 15, 3))
    cage.SetInputConnection(weave.GetOutputPort())
    made = ModalSolver(
        material="orthotropic",
        youngs_moduli=[1e6] * 3,
        shear_moduli=[1e6 / 2.98] * 3,
        poissons_ratios=[0.49] * 3,
    )
    made.SetInputConnection(cage.GetOutputPort())
    made.update()
    (text,) = made.warnings
    assert "the equivalent Poisson's ratio is 0.49" in text
    assert "lower poissons_ratios" in text
    made.poissons_ratios = [0.3] * 3
    made.update()
    assert made.warnings == ()


@pytest.mark.parametrize("sign", [-1, 1])
def test_values_beyond_double_precision_are_refused(sign):
    for name in ("density", "youngs_modulus"):
        with pytest.raises(InputError, match=rf"{name} = .*must be 0, or between 1e-36 and 1e\+36"):
            solver(**{name: 10.0 ** (40 * sign)})
    with pytest.raises(InputError, match=r"modal\.thickness = .*between 1e-09 m and 1e\+09 m"):
        solver(material="denim", thickness=10.0 ** (35 * sign)).update()
