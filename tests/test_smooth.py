"""The smooth map: affine motions to rounding, and no kinks."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import Delaunay

from spacemap_vtk import BarycentricWarp, TetraCage
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.embedding.smooth import SmoothInterpolation
from spacemap_vtk.errors import InputError

UNIT = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)


def meshes() -> list[tuple[np.ndarray, np.ndarray]]:
    scattered = np.random.default_rng(0).random((60, 3))
    return [build_lattice(UNIT, (4, 3, 5)), (scattered, Delaunay(scattered).simplices)]


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


@pytest.mark.parametrize("which", [0, 1])
def test_the_gradient_is_that_of_the_map(which: int) -> None:
    vertices, cells = meshes()[which]
    values = np.random.default_rng(2).normal(size=vertices.shape)
    points = np.random.default_rng(3).uniform(0.3, 0.7, (500, 3))
    found = smooth(points, vertices, cells).gradients(values)
    step = 1e-6
    for axis, way in enumerate(step * np.eye(3)):
        ends = [
            smooth(points + sign * way, vertices, cells).displace(points + sign * way, values)[0]
            for sign in (-1, 1)
        ]
        np.testing.assert_allclose(found[:, :, axis], (ends[1] - ends[0]) / (2 * step), atol=1e-3)


def test_a_displacement_of_another_size_is_refused() -> None:
    vertices, cells = meshes()[1]
    ride = smooth(vertices, vertices, cells)
    for shape in ((59, 3), (60, 2), (60,)):
        with pytest.raises(InputError, match=r"allowed: \(60, 3\)"):
            ride.displace(vertices, np.zeros(shape))


def test_vertices_move_as_the_cage() -> None:
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


def jumps(mesh: tuple, kind: type, samples: int, values: np.ndarray, reach: float) -> float:
    """Return the largest jump of the slope between neighbours of dense samples on lines."""
    vertices, cells = mesh
    rng = np.random.default_rng(5)
    start, way = rng.uniform(0.35, 0.65, (6, 3)), rng.normal(size=(6, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    along = np.linspace(-reach, reach, samples)
    points = (start[:, None] + along[:, None] * way[:, None]).reshape(-1, 3)
    where = locate(points, vertices, cells)
    if kind is Interpolation:
        shift = Interpolation(where, cells, len(vertices)).displace(points, values)[1]
    else:
        shift = smooth(points, vertices, cells).displace(points, values)[1]
    slope = np.diff(shift.reshape(6, -1, 3), axis=1) / (along[1] - along[0])
    return float(np.abs(np.diff(slope, axis=1)).max())


@pytest.mark.parametrize("which", [0, pytest.param(1, marks=pytest.mark.nightly)])
def test_slopes_are_continuous(which: int) -> None:
    """Of a smooth map what the slope changes by between samples shrinks with their distance."""
    mesh = meshes()[which]
    values = np.random.default_rng(2).normal(size=mesh[0].shape)
    plain = [jumps(mesh, Interpolation, n, values, 0.2) for n in (2_001, 20_001)]
    soft = [jumps(mesh, SmoothInterpolation, n, values, 0.2) for n in (2_001, 20_001)]
    assert plain[1] > 0.5 * plain[0]  # kinks stay
    assert soft[1] == pytest.approx(soft[0] / 10, rel=0.2)
    assert soft[1] < 0.01 * plain[1]


def test_slopes_are_continuous_through_the_border() -> None:
    """Outside, the map goes on along its tangent."""
    mesh = build_lattice(UNIT, (3, 3, 3))
    values = np.random.default_rng(2).normal(size=mesh[0].shape)
    way = np.zeros((20_001, 3))
    way[:, 0] = np.linspace(0.8, 1.2, 20_001)
    way[:, 1:] = 0.4, 0.45
    shift = smooth(way, *mesh).displace(way, values)[1]
    slope = np.diff(shift, axis=0) / 2e-5
    assert np.abs(np.diff(slope, axis=0)).max() < 0.01


def test_a_quadratic_motion_is_reproduced_far_from_the_border() -> None:
    """Where vertices around tell its gradient: second derivatives are damped by a hundredth."""
    vertices, cells = build_lattice(UNIT, (8, 8, 8))
    points = np.random.default_rng(3).uniform(0.3, 0.7, (2000, 3))
    form = np.random.default_rng(4).normal(size=(3, 3, 3))

    def field(x: np.ndarray) -> np.ndarray:
        return np.einsum("na,abk,nb->nk", x, form, x)

    shift = smooth(points, vertices, cells).displace(points, field(vertices))[1]
    np.testing.assert_allclose(shift, field(points), atol=1e-4)


def test_errors_shrink_faster() -> None:
    points = np.random.default_rng(6).uniform(0.05, 0.95, (4000, 3))
    errors = {}
    for divisions in (4, 8):
        vertices, cells = build_lattice(UNIT, (divisions,) * 3)
        plain = Interpolation(locate(points, vertices, cells), cells, len(vertices))
        for name, ride in (("plain", plain), ("soft", smooth(points, vertices, cells))):
            shift = ride.displace(points, bent(vertices))[1]
            errors[name, divisions] = np.abs(shift - bent(points)).max()
    assert errors["soft", 4] < 0.4 * errors["plain", 4]
    assert errors["plain", 4] / errors["plain", 8] == pytest.approx(4, rel=0.3)
    assert errors["soft", 4] / errors["soft", 8] > 5


def test_the_warp_has_a_smooth_option() -> None:
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
