"""The smooth map: affine motions to rounding, and kinks that shrink faster."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import Delaunay

from spacemap_vtk import BarycentricWarp, TetraCage
from spacemap_vtk.cage.lattice import lattice
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.embedding.smooth import SmoothInterpolation
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import add_array

UNIT = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)


def meshes() -> list[tuple[np.ndarray, np.ndarray]]:
    scattered = np.random.default_rng(0).random((60, 3))
    return [lattice(UNIT, (4, 3, 5)), (scattered, Delaunay(scattered).simplices)]


def smooth(points: np.ndarray, vertices: np.ndarray, cells: np.ndarray, outside="extrapolate"):
    where = locate(points, vertices, cells, outside)
    return SmoothInterpolation(points, where, vertices, cells, outside == "clamp")


@pytest.mark.parametrize("which", [0, 1])
def test_affine_motions_inside_and_outside(which: int) -> None:
    vertices, cells = meshes()[which]
    rng = np.random.default_rng(1)
    points, matrix = rng.uniform(-0.5, 1.5, (4000, 3)), rng.normal(size=(3, 3))
    moved, shift = smooth(points, vertices, cells).displace(points, vertices @ matrix + 0.7)
    np.testing.assert_allclose(shift, points @ matrix + 0.7, atol=1e-12)
    np.testing.assert_allclose(moved, points + shift, atol=1e-15)
    gradient = smooth(points, vertices, cells).gradients(vertices @ matrix)
    np.testing.assert_allclose(gradient, np.broadcast_to(np.eye(3) + matrix.T, (4000, 3, 3)))


def test_a_displacement_of_another_size_is_refused() -> None:
    vertices, cells = meshes()[1]
    ride = smooth(vertices, vertices, cells)
    for shape in ((59, 3), (60, 2), (60,)):
        with pytest.raises(InputError, match=r"allowed: \(60, 3\)"):
            ride.displace(vertices, np.zeros(shape))


def test_vertices_go_where_the_cage_says() -> None:
    vertices, cells = meshes()[1]
    values = np.random.default_rng(2).normal(size=vertices.shape)
    _, shift = smooth(vertices, vertices, cells).displace(vertices, values)
    np.testing.assert_allclose(shift, values, atol=1e-9)


def test_it_is_continuous() -> None:
    """Points of a face have one value, whichever tetrahedron they are asked in."""
    vertices, cells = meshes()[1]
    values = np.random.default_rng(2).normal(size=vertices.shape)
    rng = np.random.default_rng(3)
    inside = rng.uniform(0.2, 0.8, (3000, 3))
    step = 1e-9 * rng.normal(size=(3000, 3))
    here = smooth(inside, vertices, cells).displace(inside, values)[1]
    there = smooth(inside + step, vertices, cells).displace(inside + step, values)[1]
    assert np.abs(here - there).max() < 1e-6
    # through the border, outwards
    face = inside.copy()
    vertices, cells = meshes()[0]
    values = np.random.default_rng(2).normal(size=vertices.shape)
    face[:, 0] = 1.0 - 1e-9
    out = face + np.array([2e-9, 0, 0])
    for outside in ("extrapolate", "clamp"):
        one = smooth(face, vertices, cells, outside).displace(face, values)[1]
        two = smooth(out, vertices, cells, outside).displace(out, values)[1]
        assert np.abs(one - two).max() < 1e-6


def bent(points: np.ndarray) -> np.ndarray:
    """A displacement that bends, twists and stretches."""
    x, y, z = points.T
    return np.stack([np.sin(2 * y) * z, x * z, np.cos(2 * x) + y**2], axis=1)


def kinks(divisions: int, kind: type) -> tuple[float, float]:
    """Return the largest jump of slope on lines through a lattice, and the largest error."""
    vertices, cells = lattice(UNIT, (divisions,) * 3)
    rng = np.random.default_rng(5)
    start, way = rng.uniform(0.3, 0.7, (40, 3)), rng.normal(size=(40, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    along = np.linspace(-0.25, 0.25, 4001)
    points = (start[:, None] + along[:, None] * way[:, None]).reshape(-1, 3)
    where = locate(points, vertices, cells)
    if kind is Interpolation:
        shift = Interpolation(where, cells, len(vertices)).displace(points, bent(vertices))[1]
    else:
        shift = smooth(points, vertices, cells).displace(points, bent(vertices))[1]
    slope = np.diff(shift.reshape(40, -1, 3), axis=1) / (along[1] - along[0])
    jump = np.abs(np.diff(slope, axis=1)).max()
    return float(jump), float(np.abs(shift - bent(points)).max())


def test_kinks_and_errors_shrink_faster() -> None:
    plain = [kinks(n, Interpolation) for n in (4, 8)]
    soft = [kinks(n, SmoothInterpolation) for n in (4, 8)]
    for (jump, error), (soft_jump, soft_error) in zip(plain, soft, strict=True):
        assert soft_jump < 0.25 * jump
        assert soft_error < 0.6 * error
    # first order and second order in the edge length
    assert plain[0][0] / plain[1][0] == pytest.approx(2, rel=0.3)
    assert soft[0][0] / soft[1][0] > 3


def test_the_filter_has_it_as_an_option() -> None:
    ball = pv.Sphere(radius=1.0)
    ball.points = ball.points.astype(np.float64)
    cage = TetraCage(divisions=(3, 3, 3), padding=-0.0)
    cage.SetInputDataObject(ball)
    cage.update()
    grid = pv.wrap(cage.GetOutputDataObject(0)).copy()
    add_array(grid.GetPointData(), "displacement", 0.3 * bent(grid.points))
    warp = BarycentricWarp()
    warp.SetInputDataObject(0, ball)
    warp.SetInputDataObject(1, grid)
    errors = []
    for option in (False, True):
        warp.smooth = option
        warp.update()
        moved = pv.wrap(warp.GetOutputDataObject(0))
        exact = ball.points + 0.3 * bent(ball.points)
        errors.append(np.abs(moved.points - exact).max())
        # normals stay near those of the moved surface itself
        fresh = moved.compute_normals(
            cell_normals=False, consistent_normals=False, split_vertices=False
        )
        turn = np.einsum("nk,nk->n", fresh["Normals"], moved.point_data.active_normals)
        assert np.median(turn) > 0.99
    assert errors[1] < errors[0]
