"""Plates: what homogeneous ones and measured ones resist."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.materials import fabric_to_xyz, isotropic, orthotropic
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.mechanics.elements.plates import (
    apply_measurements,
    data_sheet,
    homogeneous_plate,
    keep_normals_upright,
)

E, NU, H = 2e6, 0.3, 3e-4


@pytest.mark.parametrize("normal", [0, 1, 2])
def test_isotropic_plate_has_textbook_stiffness(normal):
    """Kirchhoff's E h/(1-ν²) and E h³/12/(1-ν²), Reissner's 5/6 G h."""
    plate, shear = homogeneous_plate(isotropic(E, NU), H, normal), E / 2 / (1 + NU)
    form = np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]]) / (1 - NU**2)
    np.testing.assert_allclose(plate.membrane, E * H * form, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(plate.bending, E * H**3 / 12 * form, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(plate.shear, 5 / 6 * shear * H * np.eye(2), rtol=1e-12, atol=1e-9)
    assert plate.thickness == pytest.approx(E * H, rel=1e-12)


def test_plate_axes_follow_the_normal_cyclically():
    """Three different moduli along x, y and z: each stands where its axis does."""
    moduli, shears = [1e6, 2e6, 4e6], {"yz": 1e5, "xz": 2e5, "xy": 3e5}
    solid = orthotropic(moduli, [shears["xy"], shears["xz"], shears["yz"]], [0, 0, 0])
    for normal, axes, plane, across in (
        (0, (1, 2), "yz", ("xy", "xz")),
        (1, (2, 0), "xz", ("yz", "xy")),
        (2, (0, 1), "xy", ("xz", "yz")),
    ):
        plate = homogeneous_plate(solid, 1.0, normal)
        expected = [moduli[axes[0]], moduli[axes[1]], shears[plane]]
        np.testing.assert_allclose(np.diag(plate.membrane), expected, rtol=1e-12)
        sheared = [5 / 6 * shears[name] for name in across]
        np.testing.assert_allclose(np.diag(plate.shear), sheared, rtol=1e-12)
        assert plate.thickness == pytest.approx(moduli[normal])


def test_plate_without_thickness_is_refused():
    with pytest.raises(InputError, match="thickness"):
        homogeneous_plate(isotropic(E, NU), 0.0)


def stiffness_along(stiffness, angle):
    """Return what a sheet held in all its width resists along a direction, from x to y."""
    c, s = np.cos(angle), np.sin(angle)
    strain = np.array([c * c, s * s, 2 * c * s])
    return strain @ stiffness @ strain


def test_measurements_are_reproduced_by_strips_and_frames():
    tensile, bending, ratio = (4000.0, 1000.0), (2e-5, 5e-6), 0.8
    plate = apply_measurements(
        homogeneous_plate(isotropic(E, NU), H),
        tensile=tensile,
        shear=30.0,
        ratio=ratio,
        bending=bending,
        twisting=3e-6,
    )
    compliance = np.linalg.inv(plate.membrane)
    assert (1 / np.diag(compliance)).tolist() == pytest.approx([1000.0, 4000.0, 30.0])
    # pulled along the warp, y, by a unit strain
    assert -compliance[0, 1] / compliance[1, 1] == pytest.approx(ratio)
    bent = np.linalg.inv(plate.bending)
    assert (1 / np.diag(bent)).tolist() == pytest.approx([5e-6, 2e-5, 3e-6])
    # Maxwell and Betti: ν12 ν21 = ν12² T2/T1 is that of bending, too
    assert bent[0, 1] ** 2 / bent[0, 0] / bent[1, 1] == pytest.approx(ratio**2 / 4)
    for matrix in (plate.membrane, plate.bending):
        np.linalg.cholesky(matrix)
    # normals of cloth stay upright, whatever it resists stretching with
    assert plate.shear is None
    assert plate.thickness is None
    cells = keep_normals_upright(plate, 0.01)
    assert cells.thickness == cells.shear[0, 0] == pytest.approx(1e4 * plate.bending[1, 1] / 1e-4)


def test_measurements_of_an_isotropic_plate_reproduce_it():
    """Strips resist E h and E h³/12; the rest follows from Poisson's ratio."""
    soft, plate = homogeneous_plate(isotropic(1.0, NU), H), homogeneous_plate(isotropic(E, NU), H)
    made = apply_measurements(soft, tensile=(E * H, E * H), bending=(E * H**3 / 12, E * H**3 / 12))
    np.testing.assert_allclose(made.membrane, plate.membrane, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(made.bending, plate.bending, rtol=1e-12, atol=1e-18)
    other = homogeneous_plate(isotropic(E, 0.1), H)
    stretch, bend = (E * H, E * H), (E * H**3 / 12, E * H**3 / 12)
    made = apply_measurements(plate, tensile=stretch, bending=bend, ratio=0.1)
    np.testing.assert_allclose(made.membrane, other.membrane, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(made.bending, other.bending, rtol=1e-12, atol=1e-18)


def test_unmeasured_stiffness_is_unchanged():
    plate = homogeneous_plate(isotropic(E, NU), H)
    bent = apply_measurements(plate, bending=(2e-6, 1e-6))
    assert bent.membrane is plate.membrane
    assert bent.shear is None
    sheared = apply_measurements(plate, shear=3.0)
    assert sheared.shear is plate.shear
    assert sheared.bending is plate.bending
    np.testing.assert_allclose(sheared.membrane[:2, :2], plate.membrane[:2, :2], rtol=1e-12)
    assert sheared.membrane[2, 2] == 3.0
    twisted = apply_measurements(plate, twisting=1e-9)
    np.testing.assert_allclose(twisted.bending[:2, :2], plate.bending[:2, :2], rtol=1e-12)
    assert twisted.bending[2, 2] == 1e-9


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_sheet_that_is_not_positive_definite_is_refused(sign):
    plate = homogeneous_plate(isotropic(E, NU), H)
    why = r"poissons_ratio_in_plane.*between -2 and 2, the square root of .*not the reverse"
    with pytest.raises(InputError, match=why):
        apply_measurements(plate, tensile=(4e3, 1e3), ratio=2.0 * sign)
    near = apply_measurements(plate, tensile=(4e3, 1e3), ratio=1.999 * sign, bending=(1e-6, 1e-6))
    assert np.linalg.eigvalsh(near.membrane)[0] > 0
    assert np.linalg.eigvalsh(near.bending)[0] > 0


@pytest.mark.parametrize(
    ("key", "measures"),
    [
        ("tensile_rigidity", {"tensile": (1.0, 0.0)}),
        ("shear_rigidity", {"shear": -1.0}),
        ("bending_rigidity", {"bending": (np.nan, 1.0)}),
        ("twisting_rigidity", {"twisting": 0.0}),
    ],
)
def test_stiffness_beyond_double_precision_is_refused(key, measures):
    with pytest.raises(InputError, match=f"{key}.*allowed: 1e-50 to 1e.50 N"):
        apply_measurements(homogeneous_plate(isotropic(E, NU), H), **measures)


@pytest.mark.parametrize("name", FABRICS)
def test_measured_fabric_reproduces_its_measurements(name):
    fabric = FABRICS[name]
    sheet, (along, askew, across) = fabric.sheet, fabric.bending
    found = [stiffness_along(sheet.bending, angle) for angle in (0, np.pi / 4, np.pi / 2)]
    assert found == pytest.approx([along, askew, across], rel=1e-12)
    np.linalg.cholesky(sheet.bending)
    # it stretches as the solid that it is made into for tetrahedra does
    solid = homogeneous_plate(fabric_to_xyz(orthotropic(*fabric.solid(1e-3)[:3])), 1e-3)
    np.testing.assert_allclose(sheet.membrane, solid.membrane, rtol=1e-12, atol=1e-9)
    # and leans by less than 0.1 % of the slope in waves of eight cells
    shear = keep_normals_upright(sheet, 1e-3).shear[0, 0]
    assert max(fabric.bending) * (2 * np.pi / 8e-3) ** 2 / shear < 1e-3


def test_data_sheet_contains_the_measurements():
    """It is read off the plate, and not what was given."""
    given = {"tensile": (4000.0, 1000.0), "shear": 50.0, "ratio": 0.8, "bending": (2e-5, 5e-6)}
    plate = apply_measurements(homogeneous_plate(isotropic(E, NU), H), **given, twisting=3e-6)
    found = data_sheet(plate, 0.15)
    assert found.tensile_rigidity == pytest.approx(given["tensile"])
    assert found.bending_rigidity == pytest.approx(given["bending"])
    assert found[1:3] == pytest.approx((50.0, 0.8))
    assert found[5:] == pytest.approx((3e-6, 0.15))
    # Peirce's cantilever: the flexural rigidity in mg.cm is c³ [cm] times the mass in mg/cm².
    length = [(rigidity / (9.80665e-6 * 1e-2) / 15.0) ** (1 / 3) for rigidity in (2e-5, 5e-6)]
    assert found.bending_length == pytest.approx([1e-2 * c for c in length])
    again = apply_measurements(
        plate, tensile=found.tensile_rigidity, bending=found.bending_rigidity
    )
    np.testing.assert_allclose(again.membrane[:2, :2], plate.membrane[:2, :2], rtol=1e-12)
