"""Bernstein polynomials, arcs, and VTK's order of the control points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly
from vtkmodules.vtkCommonDataModel import vtkHigherOrderQuadrilateral

from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.patches.bezier import (
    arc_handle,
    bernstein,
    bernstein_derivative,
    quadrilateral_order,
)

T = np.linspace(0, 1, 101)


@pytest.mark.parametrize("degree", range(9))
def test_bernstein_against_scipy(degree):
    basis, slope = bernstein(degree, T), bernstein_derivative(degree, T)
    assert basis.shape == slope.shape == (101, degree + 1)
    for i in range(degree + 1):
        oracle = BPoly(np.eye(degree + 1)[:, [i]], [0, 1])
        np.testing.assert_allclose(basis[:, i], oracle(T), atol=1e-14)
        np.testing.assert_allclose(slope[:, i], oracle(T, 1), atol=1e-13)
    np.testing.assert_allclose(basis.sum(1), 1, rtol=1e-14)
    np.testing.assert_allclose(slope.sum(1), 0, atol=1e-13)


def test_ends_are_exact():
    np.testing.assert_array_equal(bernstein(3, [0, 1]), [[1, 0, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(bernstein_derivative(3, [0, 1]), [[-3, 3, 0, 0], [0, 0, -3, 3]])


@pytest.mark.parametrize(
    ("degrees", "published"), [(30, 3.7e-7), (60, 2.4e-5), (90, 2.7e-4), (-90, 2.7e-4)]
)
def test_error_of_one_cubic_for_an_arc(degrees, published):
    angle = np.radians(degrees)
    handle = arc_handle(angle)
    end = np.array([np.cos(angle), np.sin(angle)])
    points = np.array([[1, 0], [1, handle], end - handle * np.array([-end[1], end[0]]), end])
    radius = np.linalg.norm(bernstein(3, np.linspace(0, 1, 2001)) @ points, axis=1)
    assert radius.min() > 1 - 1e-14
    assert abs(radius - 1).max() == pytest.approx(published, rel=0.03)


def test_rational_quadratic_is_an_exact_arc():
    half = np.pi / 6
    points = np.array([[1, 0], [1, np.tan(half)], [np.cos(2 * half), np.sin(2 * half)]])
    weights = np.array([1, np.cos(half), 1])
    basis = bernstein(2, T)
    arc = (basis * weights) @ points / (basis @ weights)[:, None]
    np.testing.assert_allclose(np.linalg.norm(arc, axis=1), 1, rtol=1e-15)


@settings(deadline=None)
@given(st.integers(1, 10), st.integers(1, 10))
def test_order_is_vtks(p, q):
    oracle = [
        vtkHigherOrderQuadrilateral.PointIndexFromIJK(i, j, (p, q))
        for j in range(q + 1)
        for i in range(p + 1)
    ]
    np.testing.assert_array_equal(quadrilateral_order(p, q), oracle)
    assert sorted(oracle) == list(range((p + 1) * (q + 1)))


def test_refusals():
    with pytest.raises(InputError, match="at least 1"):
        quadrilateral_order(0, 1)
