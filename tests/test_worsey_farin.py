"""The twelve-fold split: smooth across faces for any values and gradients at the vertices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.embedding.triangles import FACES
from spacemap_vtk.embedding.worsey_farin import control_factors, point_factors, split_points


def mesh(kind: str) -> tuple[np.ndarray, np.ndarray]:
    if kind == "lattice":
        return build_lattice((0, 1, 0, 0.7, 0, 1.3), (2, 3, 2))
    vertices = np.random.default_rng(1).random((120, 3))
    return vertices, Delaunay(vertices).simplices


class Spline:
    """Values and gradients at the vertices, as a function of points inside."""

    def __init__(
        self, vertices: np.ndarray, cells: np.ndarray, value: np.ndarray, slope: np.ndarray
    ):
        self.vertices, self.cells = vertices, cells
        self.split = split_points(vertices, cells)
        corners = vertices[cells]
        self.table = control_factors(corners, *self.split)
        towards = np.einsum("tja,tjka->tjk", slope[cells], corners[:, None] - corners[:, :, None])
        self.numbers = np.concatenate((value[cells], towards.reshape(-1, 16)), axis=1)

    def at(self, weights: np.ndarray, which: np.ndarray, ways: np.ndarray | None = None):
        factors = point_factors(weights, which, self.table, *self.split, ways)
        return np.einsum("mnd,nd->mn", factors, self.numbers[which])

    def value(self, weights: np.ndarray, which: np.ndarray) -> np.ndarray:
        return self.at(weights, which)[0]

    def gradient(self, weights: np.ndarray, which: np.ndarray) -> np.ndarray:
        corners = self.vertices[self.cells[which]]
        inverse = np.linalg.inv(corners[:, 1:] - corners[:, :1])  # axis, weight
        ways = np.concatenate((-inverse.sum(axis=2, keepdims=True), inverse), axis=2)
        return self.at(weights, which, ways.transpose(1, 0, 2))[1:].T


@pytest.mark.parametrize("kind", ["lattice", "Delaunay"])
def test_values_and_gradients_agree_on_shared_faces(kind: str) -> None:
    vertices, cells = mesh(kind)
    rng = np.random.default_rng(2)
    spline = Spline(
        vertices, cells, rng.normal(size=len(vertices)), rng.normal(size=vertices.shape)
    )
    faces = np.sort(cells[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = (faces[order[1:]] == faces[order[:-1]]).all(axis=1)
    one, two = order[:-1][same], order[1:][same]
    assert len(one) > 20
    shares = rng.dirichlet(np.ones(3), len(one))
    sides = []
    for half in (one, two):
        weights = np.zeros((len(half), 4))
        corner = (cells[half // 4][:, :, None] == faces[one][:, None]).argmax(axis=1)
        np.put_along_axis(weights, corner, shares, axis=1)
        sides.append((spline.value(weights, half // 4), spline.gradient(weights, half // 4)))
    np.testing.assert_allclose(sides[0][0], sides[1][0], atol=1e-11)
    np.testing.assert_allclose(sides[0][1], sides[1][1], atol=1e-9)


@pytest.mark.parametrize("kind", ["lattice", "Delaunay"])
def test_quadratic_functions_are_reproduced(kind: str) -> None:
    vertices, cells = mesh(kind)
    rng = np.random.default_rng(3)
    form, line = rng.normal(size=(3, 3)), rng.normal(size=3)
    form += form.T

    def value(x: np.ndarray) -> np.ndarray:
        return np.einsum("na,ab,nb->n", x, form, x) + x @ line + 0.5

    spline = Spline(vertices, cells, value(vertices), 2 * vertices @ form + line)
    points = rng.uniform(0.25, 0.5, (3000, 3))
    where = locate(points, vertices, cells, "error")
    found = spline.value(where.weights, where.tetrahedron)
    np.testing.assert_allclose(found, value(points), atol=1e-11)
    slopes = spline.gradient(where.weights, where.tetrahedron)
    np.testing.assert_allclose(slopes, 2 * points @ form + line, atol=1e-9)


def test_gradients_by_differences() -> None:
    vertices, cells = mesh("Delaunay")
    rng = np.random.default_rng(4)
    spline = Spline(
        vertices, cells, rng.normal(size=len(vertices)), rng.normal(size=vertices.shape)
    )
    points = rng.uniform(0.3, 0.7, (300, 3))
    where = locate(points, vertices, cells, "error")
    slopes = spline.gradient(where.weights, where.tetrahedron)
    step = 1e-6
    for axis in range(3):
        ends = []
        for sign in (-1, 1):
            near = points.copy()
            near[:, axis] += sign * step
            there = locate(near, vertices, cells, "error")
            ends.append(spline.value(there.weights, there.tetrahedron))
        np.testing.assert_allclose((ends[1] - ends[0]) / (2 * step), slopes[:, axis], atol=1e-4)
