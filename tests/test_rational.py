"""Rational patches: exact circles, and VTK's own evaluation."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonCore import vtkDoubleArray
from vtkmodules.vtkCommonDataModel import vtkBezierQuadrilateral

from spacemap_vtk.textile.patches.bezier import quadrilateral_order
from spacemap_vtk.textile.patches.tessellation import Tessellation


def quarter_tube(radius: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Control points and weights of a quarter of a tube along x, exact, u along, v round."""
    # A rational quadratic quarter circle, weights 1, 1/sqrt 2, 1, raised to degree 3.
    corner = np.sqrt(0.5)
    section = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, 0.0]]) * radius
    weight = np.array([1.0, corner, 1.0])
    h = np.column_stack([section * weight[:, None], weight])
    raised = np.stack([h[0], (h[0] + 2 * h[1]) / 3, (2 * h[1] + h[2]) / 3, h[2]])
    points = np.empty((4, 4, 3))
    for i in range(4):
        points[:, i] = raised[:, :3] / raised[:, 3:]
        points[:, i, 0] = length * i / 3
    order = quadrilateral_order(3, 3)
    flat, weights = np.empty((16, 3)), np.empty(16)
    flat[order] = points.reshape(16, 3)
    weights[order] = np.repeat(raised[:, 3], 4)
    return flat, weights


def test_a_rational_quarter_is_a_circle_with_radial_normals() -> None:
    for scale in (1e-6, 1.0, 1e3):
        points, weights = quarter_tube(2.0 * scale, 5.0 * scale)
        surface = Tessellation([np.arange(16)], (3, 3), 8)
        positions, normals = surface.evaluate(points, weights=weights)
        radial = positions[:, 1:] / scale
        np.testing.assert_allclose(np.hypot(*radial.T), 2.0, rtol=2e-7)
        np.testing.assert_allclose(np.abs((normals[:, 1:] * radial).sum(axis=1)), 2.0, rtol=1e-6)


def test_vtk_evaluates_the_same_points() -> None:
    rng = np.random.default_rng(5)
    points, weights = rng.random((16, 3)), 0.5 + rng.random(16)
    positions, _ = Tessellation([np.arange(16)], (3, 3), 4).evaluate(points, weights=weights)
    cell = vtkBezierQuadrilateral()
    cell.GetPointIds().SetNumberOfIds(16)
    cell.GetPoints().SetNumberOfPoints(16)
    for k, point in enumerate(points):
        cell.GetPointIds().SetId(k, k)
        cell.GetPoints().SetPoint(k, point)
    cell.SetOrder(3, 3)
    array = vtkDoubleArray()
    for weight in weights:
        array.InsertNextValue(weight)
    cell.GetRationalWeights().DeepCopy(array)
    for k, position in enumerate(positions):
        where, shares = [0.0] * 3, [0.0] * 16
        from vtkmodules.vtkCommonCore import reference

        cell.EvaluateLocation(reference(0), [k % 5 / 4, k // 5 / 4, 0.0], where, shares)
        np.testing.assert_allclose(position, where, atol=1e-6)


def test_a_disc_has_one_normal_at_its_corners_too() -> None:
    # Four quarter circles round a flat patch: both derivatives are parallel at each corner.
    k = 4 / 3 * np.tan(np.pi / 8)
    ring = []
    for quarter in range(4):
        a = quarter * np.pi / 2
        start, tangent = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
        end, last = tangent, -start
        ring += [start, start + k * tangent, end - k * last]
    grid = np.zeros((4, 4, 3))
    border = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 3), (2, 3), (3, 3), (3, 2), (3, 1), (3, 0)]
    border += [(2, 0), (1, 0)]
    for (j, i), point in zip(border, ring, strict=True):
        grid[j, i, :2] = point
    grid[1:3, 1:3, :2] = np.array([[[0.3, 0.3], [-0.3, 0.3]], [[0.3, -0.3], [-0.3, -0.3]]])
    points = np.empty((16, 3))
    points[quadrilateral_order(3, 3)] = grid.reshape(16, 3)
    surface = Tessellation([np.arange(16)], (3, 3), 6)
    _, normals = surface.evaluate(points, weights=np.ones(16))
    np.testing.assert_allclose(np.abs(normals[:, 2]), 1.0, atol=1e-6)
