"""The distance to the next yarn, against closed forms and against the exact clearance."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk import WeaveSource
from spacemap_vtk.draw.actors.color_values import color_values, largest_principal, scale_unit
from spacemap_vtk.draw.actors.surface_actor import natural_span
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.point_clearance import point_clearances
from spacemap_vtk.textile.geometry.yarn_clearance import least_clearance


def tube(axis: np.ndarray, along: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of a round tube along an axis of coordinates, 200 x 120."""
    turn, way = np.meshgrid(np.arange(120) * np.pi / 60, np.linspace(-2, 2, 200), indexing="ij")
    normals = np.zeros((*turn.shape, 3))
    normals[..., (along + 1) % 3], normals[..., (along + 2) % 3] = np.cos(turn), np.sin(turn)
    points = axis + radius * normals
    points[..., along] += way
    return points.reshape(-1, 3), normals.reshape(-1, 3)


@pytest.mark.parametrize("distance", [-0.02, 0.0, 0.05, 0.4])
def test_parallel_tubes(distance: float) -> None:
    radius = 0.5
    one = tube(np.zeros(3), 0, radius)
    other = tube(np.array([0, 0, 2 * radius + distance]), 0, radius)
    found = point_clearances(
        np.concatenate([one[0], other[0]]),
        np.concatenate([one[1], other[1]]),
        np.repeat([0, 1], len(one[0])),
        reach=0.015,
    )
    # From a point at the angle a of the first tube to the axis of the second, less its radius.
    angle = np.arctan2(one[0][:, 2], one[0][:, 1])
    height, across = radius * np.sin(angle), radius * np.cos(angle)
    exact = np.hypot(across, 2 * radius + distance - height) - radius
    np.testing.assert_allclose(found[: len(angle)], exact, atol=1e-3)
    assert abs(found.min() - distance) < 3e-4


@pytest.mark.nightly
def test_crossed_tubes_of_many_yarns() -> None:
    tubes = [tube(np.array([0, k * 1.5, 0.0]), 0, 0.3) for k in (0, 1)]
    tubes += [tube(np.array([k * 1.5, 0, 0.7]), 1, 0.3) for k in (0, 1)]
    points, normals = (np.concatenate([t[i] for t in tubes]) for i in (0, 1))
    yarn = np.repeat(np.arange(4), len(tubes[0][0]))
    found = point_clearances(points, normals, yarn, reach=0.015)
    assert abs(found.min() - 0.1) < 5e-4
    # All four crossed pairs come as near.
    for number in range(4):
        assert abs(found[yarn == number].min() - 0.1) < 5e-4


def test_one_yarn_has_no_neighbour() -> None:
    points, normals = tube(np.zeros(3), 0, 0.5)
    assert np.isinf(point_clearances(points, normals, np.zeros(len(points), int), 0.01)).all()


def test_a_cloth_as_woven_touches_and_an_open_one_does_not() -> None:
    values = {"weave": {"ends": 4, "picks": 4}, "surface": {"subdivisions": 12}}
    scene = Scene(values)
    scene.update()
    found = color_values(scene.polygons, "clearance")
    assert found is not None
    diameter = scene.woven.cloth.diameter_sum / 2
    weave = WeaveSource(ends=4, picks=4)
    exact = least_clearance(weave.cloth).distance
    assert abs(exact) < 1e-12
    assert abs(found.min() - exact) < 0.01 * diameter
    assert found.max() > 0.3 * diameter


def test_the_largest_principal_value_is_numpys() -> None:
    rng = np.random.default_rng(1)
    parts = rng.normal(size=(500, 6))
    parts[:5] = 0.0
    parts[5:10, 3:] = 0.0
    xx, yy, zz, xy, yz, xz = parts.T
    full = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1)
    expected = np.linalg.eigvalsh(full.reshape(-1, 3, 3))[:, -1]
    np.testing.assert_allclose(largest_principal(parts), expected, atol=1e-12)
    np.testing.assert_allclose(largest_principal(full), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("color", "largest", "unit"),
    [
        ("displacement", 3e-3, "mm"),
        ("displacement", natural_span(np.array([0.0, 0.101]))[1], "mm"),
        ("displacement", 2.0, "m"),
        ("clearance", 4e-5, "µm"),
        ("velocity", 0.02, "mm/s"),
        ("velocity", 3.0, "m/s"),
        ("stress", 129.0, "Pa"),
        ("stress", 3e7, "MPa"),
        ("strain", 0.06, "%"),
    ],
)
def test_a_scale_has_a_handy_unit(color: str, largest: float, unit: str) -> None:
    name, size = scale_unit(color, largest)
    assert name == unit
    assert 0.1 <= largest / size < 1000
    assert color in COLORINGS
