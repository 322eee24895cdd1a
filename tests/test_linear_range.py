"""How far a linear motion is from what it stands for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.mechanics.elements.kinematics import MeanGradient, largest_rotation
from spacemap_vtk.mechanics.elements.shell import SheetGradient, find_mid_surface
from spacemap_vtk.mechanics.response.linear_range import MotionExtremes, measure_extremes

FloatArray = NDArray[np.float64]


@pytest.mark.parametrize(
    ("degrees", "longer"), [(0, 1.0), (30, 1.0174), (45, 1.0400), (60, 1.0732), (90, 1.1803)]
)
def test_pendulum_period_grows_with_amplitude(degrees: float, longer: float) -> None:
    assert MotionExtremes(math.radians(degrees), 0.0, 0.0).pendulum_period == pytest.approx(
        longer, abs=5e-5
    )


def test_upside_down_pendulum_has_an_infinite_period() -> None:
    assert (
        MotionExtremes(math.pi, 0.0, 0.0).pendulum_period
        == MotionExtremes(7.0, 0.0, 0.0).pendulum_period
        == math.inf
    )


class Turning:
    """A body that turns linearly, with a swelling on top."""

    def __init__(self) -> None:
        self.points, self.cells = build_lattice((0, 1, 0, 1, 0, 1), (2, 2, 2))

    def at_time(self, time: float) -> FloatArray:
        x, y, z = self.points.T
        moved = np.stack([-math.sin(time) * y, math.sin(time) * x, 0.1 * time * z], axis=1)
        return np.stack([moved, moved, moved])

    def history(self, weights: FloatArray, times: FloatArray) -> FloatArray:
        raise NotImplementedError

    def energies(self, times: FloatArray) -> FloatArray:
        raise NotImplementedError


def test_largest_rotation_stretch_and_volume_are_measured() -> None:
    """u = sin t (-y, x) turns by sin t, and stretches by √(1 + sin² t) - 1 across its axis."""
    body = Turning()
    found = measure_extremes(body, body.points, (0.0, math.pi / 2, math.pi))
    assert found.rotation == pytest.approx(1.0)
    assert found.stretch == pytest.approx(math.sqrt(2) - 1)
    # At t = π/2: (1 + sin² t) (1 + 0.1 t); at π 1.31.
    assert found.volume == pytest.approx(2 * (1 + 0.05 * math.pi) - 1)


def test_tight_folds_in_equilibrium_are_not_rotations() -> None:
    """A strip bent to a circle turns at its end by its length times the change in curvature."""
    flat, cells = build_lattice((0, 1, 0, 0.1, -0.05, 0.05), (80, 2, 1))
    surface = find_mid_surface(flat, cells)
    assert surface is not None

    def bent(curvature: float) -> FloatArray:
        angle, across = flat[:, 0] * curvature, flat[:, 2]
        x = np.sin(angle) / curvature - across * np.sin(angle)
        z = (1 - np.cos(angle)) / curvature + across * np.cos(angle)
        return np.stack([x, flat[:, 1], z], axis=1)

    # To a tenth more than half its thickness, and to less.
    for curvature in (18.0, 22.0):
        rest, moved = bent(curvature), bent(curvature + 0.05)
        gradient = SheetGradient(flat, surface, rest - flat)
        assert largest_rotation(gradient.evaluate(moved - rest)) == pytest.approx(0.05, rel=0.02)
    # Tetrahedra are flat within, and have none.
    with pytest.raises(GeometryError, match="flat"):
        MeanGradient(bent(20.0), cells)
