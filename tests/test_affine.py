"""Points that ride along with linear tetrahedra, by one affine map each."""

from __future__ import annotations

import numpy as np
import pytest
from test_embedding import CORNERS, ONE, UNIT, affine, cloud, random_mesh

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.embedding.affine import AffineInterpolation
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError


def ride_of(points, vertices, tetrahedra, outside="extrapolate", **more):
    where = locate(points, vertices, tetrahedra, outside)
    return where, AffineInterpolation(
        points, where, vertices, tetrahedra, outside == "clamp", **more
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("far", [0.0, 50.0])
def test_an_affine_motion_is_reproduced_inside_and_outside(seed, far):
    vertices, tetrahedra = build_lattice(UNIT, (3, 2, 4)) if seed else random_mesh(60, 1)
    points, motion = cloud(3000, seed), affine(seed)
    points, vertices = points + far, vertices + far
    _, ride = ride_of(points, vertices, tetrahedra)
    moved, shift = ride.displace(points, motion(vertices) - vertices)
    tolerance = 1e-12 * max(1.0, far)
    np.testing.assert_allclose(moved, motion(points), rtol=0, atol=tolerance)
    np.testing.assert_array_equal(moved, points + shift)
    np.testing.assert_allclose(ride.apply(motion(vertices)), motion(points), atol=tolerance)
    gradient = motion(np.eye(3)) - motion(np.zeros((3, 3)))  # a row for each axis
    found = ride.gradients(motion(vertices) - vertices)
    np.testing.assert_allclose(found, np.broadcast_to(gradient.T, found.shape), atol=1e-8)


@pytest.mark.parametrize("thin", [1e-3, 1e-6, 1e-9, 1e-11])
def test_slivers(thin):
    points = np.random.default_rng(2).random((5000, 3)) * [1, 1, thin]
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, thin), (4, 4, 1))
    for offset in ([0.0, 0.0, 0.0], [0.3, 0.1, 0.7]):  # so that the coordinates are rounded
        motion, places, corners = affine(3), points + offset, vertices + offset
        _, ride = ride_of(places, corners, tetrahedra)
        moved, _ = ride.displace(places, motion(corners) - corners)
        np.testing.assert_allclose(moved, motion(places), atol=1e-12)


@pytest.mark.parametrize("outside", ["extrapolate", "clamp"])
@pytest.mark.parametrize("threads", [pytest.param(1, marks=pytest.mark.nightly), 3])
def test_the_map_equals_the_sum_over_the_weights(outside, threads):
    vertices, tetrahedra = build_lattice(UNIT, (3, 3, 3))
    points = cloud(30_000, 2)
    where, ride = ride_of(points, vertices, tetrahedra, outside, threads=threads)
    assert 0 < where.outside < len(points)
    corners, random = tetrahedra[where.tetrahedron], np.random.default_rng(0)
    for shape in ((), (1,), (3,), (7,)):
        values = random.normal(size=(len(vertices), *shape))
        made = ride.apply(values)
        expected = np.einsum("ni,ni...->n...", where.weights, values[corners])
        assert made.shape == expected.shape
        np.testing.assert_allclose(made, expected, atol=1e-12)
    u = random.normal(size=(len(vertices), 3))
    expected = np.einsum("ni,nik->nk", where.weights, u[corners])
    for kind, error in ((np.float64, 1e-12), (np.float32, 5e-6)):
        own = points.astype(kind)
        moved, shift = ride.displace(own, u)
        assert moved.dtype == shift.dtype == kind
        np.testing.assert_allclose(shift, expected, rtol=0, atol=error)
        np.testing.assert_array_equal(moved, own + shift)
    kept = moved.copy()
    for step in range(3):
        ride.displace(own, step * u)
    np.testing.assert_array_equal(moved, kept)  # memory is used again once nobody holds it


def test_replaced_points_use_the_map_of_the_located_ones():
    vertices, tetrahedra = build_lattice(UNIT, (2, 2, 2))
    points, random = cloud(500, 3), np.random.default_rng(1)
    where, ride = ride_of(points, vertices, tetrahedra)
    u, offset = random.normal(size=(len(vertices), 3)), random.normal(size=points.shape)
    moved = ride.displace(points + offset, u)[0]
    turned = np.einsum("nij,nj->ni", ride.gradients(u)[where.tetrahedron], offset)
    np.testing.assert_allclose(moved, ride.displace(points, u)[0] + turned, atol=1e-12)


def test_only_the_tetrahedron_of_a_point_is_stored():
    vertices, tetrahedra = build_lattice(UNIT, (3, 3, 3))
    points = cloud(20_000, 1, 0, 1)
    ride = ride_of(points, vertices, tetrahedra)[1]
    kept = [value for value in vars(ride).values() if isinstance(value, np.ndarray)]
    assert sum(array.nbytes for array in kept if array is not points) <= 4 * len(points) + 250 * 135


def test_a_flat_tetrahedron_has_no_map():
    vertices = np.concatenate((CORNERS, [[0.5, 0.5, 0.0]]))
    tetrahedra = np.array([[0, 1, 2, 4], [0, 1, 2, 3]])
    ride = ride_of(np.array([[0.1, 0.1, 0.1]]), vertices, tetrahedra)[1]
    stretched = ride.gradients(vertices)
    np.testing.assert_allclose(stretched, [np.eye(3), 2 * np.eye(3)], atol=1e-15)


def test_refused_shapes():
    ride = ride_of(np.zeros((1, 3)), CORNERS, ONE)[1]
    with pytest.raises(InputError, match=r"\(4,\) or \(4, k\)"):
        ride.apply(np.zeros((5, 3)))
    with pytest.raises(InputError, match="1 of the cage's 4 displacements are not finite numbers"):
        ride.displace(np.zeros((1, 3)), [[0, 0, np.nan], *3 * [[0, 0, 0]]])
    with pytest.raises(InputError, match=r"\(4, 3\): a row for each vertex"):
        ride.displace(np.zeros((1, 3)), np.zeros((4, 2)))
    with pytest.raises(InputError, match=r"\(1, 3\)"):
        ride.displace(np.zeros((2, 3)), np.zeros((4, 3)))
    assert ride_of(np.empty((0, 3)), CORNERS, ONE)[1].apply(CORNERS).shape == (0, 3)
