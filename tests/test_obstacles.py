"""Signed distances of obstacles, against nearest points of densely sampled surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.contact.obstacles import (
    Cylinder,
    Obstacle,
    Plane,
    RoundedBox,
    SampledBody,
    Sphere,
    frame_along,
)

FloatArray = NDArray[np.float64]
CENTER, AXIS = np.array([0.2, -0.1, 0.3]), np.array([1.0, -2.0, -1.5])


def box_surface(size: tuple[float, ...], rounding: float) -> FloatArray:
    """Return points of a box with rounded edges: a ball that rolls over its core."""
    half = np.array(size) / 2
    way = np.random.default_rng(1).normal(size=(400_000, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    random = np.random.default_rng(2)
    core = random.uniform(-1, 1, way.shape) * (half - rounding)
    # In each direction the ball touches only at the corner of the core, or anywhere on an edge or
    # face across which the direction is level.
    level = random.random(way.shape) < 0.5
    level &= ~level.all(axis=1)[:, None]
    way = np.where(level, 0.0, way)
    way /= np.linalg.norm(way, axis=1)[:, None]
    corner = np.sign(way) * (half - rounding)
    return np.where(level, core, corner) + rounding * way


def cylinder_surface(radius: float, height: float, rounding: float) -> FloatArray:
    """Return points of a cylinder with rounded rims, by turning its outline."""
    turn = np.linspace(0, np.pi / 2, 60)
    rim = np.column_stack([radius - rounding + rounding * np.sin(turn), rounding * np.cos(turn)])
    rim[:, 1] += height / 2 - rounding
    top = np.column_stack([np.linspace(0, radius - rounding, 100), np.full(100, height / 2)])
    side = np.column_stack([np.full(100, radius), np.linspace(0, height / 2 - rounding, 100)])
    upper = np.concatenate([top, rim, side])
    outline = np.concatenate([upper, upper * [1, -1]])
    angle = np.linspace(0, 2 * np.pi, 400)[:, None]
    r, z = outline.T
    parts = (r * np.cos(angle), r * np.sin(angle), np.broadcast_to(z, (400, len(z))))
    return np.stack(parts, axis=-1).reshape(-1, 3)


def sphere_surface(radius: float) -> FloatArray:
    return box_surface((2 * radius,) * 3, radius)


PLACE = (CENTER, AXIS)
BODIES = [
    (Sphere(0.5, *PLACE), sphere_surface(0.5)),
    (RoundedBox((1.0, 0.8, 0.6), 0.1, *PLACE), box_surface((1.0, 0.8, 0.6), 0.1)),
    (Cylinder(0.5, 0.9, 0.1, *PLACE), cylinder_surface(0.5, 0.9, 0.1)),
    (Cylinder(0.6, 0.1, 0.05, *PLACE), cylinder_surface(0.6, 0.1, 0.05)),
]


def sampled_sphere() -> SampledBody:
    axis = np.linspace(-1, 1, 41)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    return SampledBody(np.linalg.norm(grid, axis=-1) - 0.5, (-1, -1, -1), 0.05, *PLACE)


@pytest.mark.parametrize(("body", "surface"), BODIES, ids=["sphere", "box", "cylinder", "disc"])
def test_distance_is_that_of_the_nearest_point(body: Obstacle, surface: FloatArray) -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (2000, 3))
    found = body.distance(points @ body.frame + CENTER)
    far, nearest = cKDTree(surface).query(points)
    # No sample is nearer, and one is as near as samples lie apart, 0.02 at most.
    assert (far > abs(found.gap) - 1e-9).all()
    assert (far**2 < found.gap**2 + 0.02**2).all()
    # The way to the nearest point is the normal, except near edges of the core.
    outside = found.gap > 0.05
    way = (points - surface[nearest])[outside] / far[outside, None]
    cosine = (way * (found.gradient @ body.frame.T)[outside]).sum(axis=1)
    assert cosine.min() > 0.99
    assert (found.gap < 0).any()


@pytest.mark.parametrize(
    "body",
    [*(body for body, _ in BODIES), Cylinder(0.5), Plane(*PLACE), sampled_sphere()],
    ids=["sphere", "box", "cylinder", "disc", "endless", "plane", "sampled"],
)
def test_gradient_and_curvature_are_derivatives(body: Obstacle) -> None:
    random = np.random.default_rng(3)
    points = CENTER + random.uniform(-0.8, 0.8, (500, 3)) @ body.frame
    way = random.normal(size=points.shape)
    step = 1e-6
    ahead, here, behind = (body.distance(points + s * step * way) for s in (1, 0, -1))
    slope = (here.gradient * way).sum(axis=1)
    smooth = abs(ahead.gradient - behind.gradient).max(axis=1) < 1e-3  # no edge of a core between
    assert smooth.mean() > 0.98
    difference = (ahead.gap - behind.gap) / (2 * step)
    np.testing.assert_allclose(difference[smooth], slope[smooth], atol=1e-5)
    turned = (ahead.gradient - behind.gradient) / (2 * step)
    expected = np.einsum("nij,nj->ni", here.curvature, way)
    scale = 1 + abs(expected).max(axis=1, keepdims=True)
    found = abs(turned - expected) / scale
    assert np.quantile(found[smooth], 0.98) < 1e-3


def test_splines_of_a_sampled_distance_are_near_it() -> None:
    points = CENTER + np.random.default_rng(0).uniform(-0.5, 0.5, (500, 3))
    radius = np.linalg.norm(points - CENTER, axis=1)
    found = sampled_sphere().distance(points[radius > 0.2])
    np.testing.assert_allclose(found.gap, radius[radius > 0.2] - 0.5, atol=2e-4)
    # Far from the grid, too.
    far = sampled_sphere().distance(CENTER + np.array([[9.0, 0, 0]]))
    assert far.gap[0] > 7


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -2), (1, 2, 3), (1, 2, -3), (0.1, 0, -1)])
def test_frame_is_a_rotation_with_the_axis_as_z(axis: tuple[float, ...]) -> None:
    frame = frame_along(axis)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    np.testing.assert_allclose(frame[2], np.array(axis) / np.linalg.norm(axis), atol=1e-12)


def test_axis_of_zero_is_refused() -> None:
    with pytest.raises(InputError, match="axis"):
        Plane((0, 0, 0), (0, 0, 0))
