"""Plates: what homogeneous ones and measured ones resist."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.materials import isotropic, orthotropic
from spacemap_vtk.mechanics.plates import homogeneous

E, NU, H = 2e6, 0.3, 3e-4


@pytest.mark.parametrize("normal", [0, 1, 2])
def test_an_isotropic_plate_is_that_of_the_books(normal):
    """Kirchhoff's E h/(1-ν²) and E h³/12/(1-ν²), Reissner's 5/6 G h."""
    plate, shear = homogeneous(isotropic(E, NU), H, normal), E / 2 / (1 + NU)
    form = np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]]) / (1 - NU**2)
    np.testing.assert_allclose(plate.membrane, E * H * form, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(plate.bending, E * H**3 / 12 * form, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(plate.shear, 5 / 6 * shear * H * np.eye(2), rtol=1e-12, atol=1e-9)
    assert plate.thickness == pytest.approx(E * H, rel=1e-12)


def test_the_plane_of_a_plate_follows_its_normal_in_a_circle():
    """Three different moduli along x, y and z: each stands where its axis does."""
    moduli, shears = [1e6, 2e6, 4e6], {"yz": 1e5, "xz": 2e5, "xy": 3e5}
    solid = orthotropic(moduli, [shears["xy"], shears["xz"], shears["yz"]], [0, 0, 0])
    for normal, axes, plane, across in (
        (0, (1, 2), "yz", ("xy", "xz")),
        (1, (2, 0), "xz", ("yz", "xy")),
        (2, (0, 1), "xy", ("xz", "yz")),
    ):
        plate = homogeneous(solid, 1.0, normal)
        expected = [moduli[axes[0]], moduli[axes[1]], shears[plane]]
        np.testing.assert_allclose(np.diag(plate.membrane), expected, rtol=1e-12)
        sheared = [5 / 6 * shears[name] for name in across]
        np.testing.assert_allclose(np.diag(plate.shear), sheared, rtol=1e-12)
        assert plate.thickness == pytest.approx(moduli[normal])


def test_a_plate_has_a_thickness():
    with pytest.raises(InputError, match="thickness"):
        homogeneous(isotropic(E, NU), 0.0)
