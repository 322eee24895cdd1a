"""Sheets on the pairs of vertices of a one-layer lattice, against plates and beams of the books."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import lattice
from spacemap_vtk.mechanics.materials import isotropic
from spacemap_vtk.mechanics.model import Model
from spacemap_vtk.mechanics.plates import homogeneous

FloatArray = NDArray[np.float64]

E, NU, RHO = 1e6, 0.3, 300.0
STUFF = isotropic(E, NU)


def clamped(points: FloatArray) -> NDArray[np.bool_]:
    """Hold the side where y is least."""
    return np.repeat(points[:, 1:2] < points[:, 1].min() + 1e-9 * np.ptp(points[:, 1]), 3, axis=1)


def square(side: float, thickness: float, cells: int, free: bool = False) -> Model:
    """Return a square sheet across z, a cantilever unless it is free."""
    points, tetrahedra = lattice((0, side, 0, side, 0, thickness), (cells, cells, 1))
    held = clamped(points) & (not free)
    return Model(points, tetrahedra, homogeneous(STUFF, thickness), RHO, held)


def leissa(model: Model, count: int) -> tuple[FloatArray, FloatArray]:
    """Return ω a² √(ρh/D) of the lowest modes, and their rounding."""
    found = model.modes(count)
    side, _, thickness = np.ptp(model.points, axis=0)
    rigidity = E * thickness**3 / 12 / (1 - NU**2)
    rate = np.sqrt(found.eigenvalues * model.modulus / RHO)
    return rate * side**2 * math.sqrt(RHO * thickness / rigidity), found.rounding


@pytest.mark.parametrize(("free", "cells"), [(False, 5), (False, 20), (True, 12)])
def test_no_digit_is_lost_in_sheets_a_million_times_wider_than_thick(free, cells):
    """And as many modes are rigid as the supports leave: six of a free sheet."""
    wide, rounding = leissa(square(1e4, 1.0, cells, free), 12)
    assert (wide == 0).sum() == (6 if free else 0)
    assert rounding.max() < 1e-5
    wider, rounding = leissa(square(1e6, 1.0, cells, free), 12)
    np.testing.assert_allclose(wider, wide, rtol=1e-6)
    assert rounding.max() < 1e-5
    thinnest, rounding = leissa(square(3e7, 1.0, cells, free), 12)
    error = abs((thinnest[wide > 0] / wide[wide > 0]) ** 2 - 1)
    assert (error < rounding[wide > 0] + 1e-4).all()
