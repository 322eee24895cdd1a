"""Shadows of shapes whose area is known, and the drape coefficient made of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.equilibrium.drape import drape_coefficient, shadow_area


def grid(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a square of side 1 of count² squares, each of two triangles."""
    u, v = np.meshgrid(*[np.linspace(0.0, 1.0, count + 1)] * 2, indexing="ij")
    points = np.stack([u.ravel(), v.ravel(), 0.0 * u.ravel()], axis=1)
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    step = count + 1
    first = np.stack([corner, corner + step, corner + step + 1], axis=1)
    second = np.stack([corner, corner + step + 1, corner + 1], axis=1)
    return points, np.concatenate([first, second])


def test_shadow_of_flat_cloth_is_its_area() -> None:
    points, triangles = grid(7)
    assert shadow_area(points, triangles, [0.0, 0.0, -9.81]) == pytest.approx(1.0, rel=1e-12)
    # Tilted light, light along the cloth, and the shadow of an affine image.
    assert shadow_area(points, triangles, [0.0, 1.0, 1.0]) == pytest.approx(0.5**0.5, rel=1e-4)
    assert shadow_area(points, triangles, [1.0, 0.0, 0.0]) == pytest.approx(0.0, abs=1e-12)
    turned = points @ np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    normal = np.cross(turned[1] - turned[0], turned[-1] - turned[0])
    assert shadow_area(turned, triangles, normal) == pytest.approx(1.0, rel=1e-4)
    assert drape_coefficient(1.0, 1.0, 0.3) == 1.0


def test_overlapping_parts_count_once() -> None:
    points, triangles = grid(30)
    u = points[:, 0].copy()
    # In three layers, back and forth, then upright.
    points[:, 0] = abs((u + 1 / 3) % (2 / 3) - 1 / 3)
    points[:, 2] = 0.01 * u
    assert shadow_area(points, triangles, [0.0, 0.0, 1.0]) == pytest.approx(1 / 3, rel=1e-9)
    points[:, 0], points[:, 2] = 0.0, u
    assert shadow_area(points, triangles, [0.0, 0.0, 1.0]) == pytest.approx(0.0, abs=1e-12)


def test_limp_cloth_has_drape_coefficient_zero() -> None:
    # A round cloth of radius 1 in n sectors; beyond the disc it hangs down as a pleated tube whose
    # folds go in and out by a tenth: the shadow is that star's.
    radius, depth, around = 0.6, 0.06, 400
    angle = np.linspace(0.0, 2 * math.pi, around + 1)
    reach = radius * (1 - depth + depth * np.cos(12 * angle))
    rings = [0.0 * reach, reach, reach]
    heights = [0.0, 0.0, -0.4]
    points = np.concatenate(
        [
            np.stack([r * np.cos(angle), r * np.sin(angle), np.full(around + 1, z)], axis=1)
            for r, z in zip(rings, heights, strict=True)
        ]
    )
    first = (np.arange(2)[:, None] * (around + 1) + np.arange(around)).ravel()
    lower = first + around + 1
    triangles = np.concatenate(
        [np.stack([first, lower, lower + 1], 1), np.stack([first, lower + 1, first + 1], 1)]
    )
    # Of the polygon with these corners, by Gauss's formula.
    x, y = points[around + 1 : 2 * around + 2, :2].T
    star = float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()) / 2
    found = shadow_area(points, triangles, [0.0, 0.0, -1.0])
    assert found == pytest.approx(star, rel=1e-4)
    assert drape_coefficient(found, math.pi, star) == pytest.approx(0.0, abs=1e-4)


def test_more_lines_give_more_digits() -> None:
    # A disc of 600 sides.
    angle = np.linspace(0.0, 2 * math.pi, 601)
    points = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    fan = np.arange(1, 599)
    triangles = np.stack([0 * fan, fan, fan + 1], axis=1)
    area = 600 / 2 * math.sin(2 * math.pi / 600)
    off = [abs(shadow_area(points, triangles, [0, 0, 1], n) / area - 1) for n in (50, 1000)]
    assert off[0] < 1e-3
    assert off[1] < 2e-5


def test_impossible_shadows_and_discs_are_refused() -> None:
    points, triangles = grid(2)
    with pytest.raises(InputError, match="must not be zero"):
        shadow_area(points, triangles, [0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="smaller than the cloth"):
        drape_coefficient(1.0, 1.0, 2.0)
