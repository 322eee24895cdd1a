"""The lattice cage: counts, conformity, orientation, errors."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spacemap_vtk.cage.lattice import build_lattice, estimate_bytes
from spacemap_vtk.errors import GeometryError, InputError

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
counts = st.integers(1, 6)


def volumes(points, tetrahedra):
    a, b, c, d = (points[tetrahedra[:, i]] for i in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6


def test_cage_of_the_published_experiment():
    points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 0.1), (5, 5, 1))
    assert points.shape == (72, 3)
    assert points.dtype == np.float64
    assert tetrahedra.shape == (125, 4)
    assert tetrahedra.dtype == np.int64
    assert points.flags.c_contiguous
    assert tetrahedra.flags.c_contiguous
    # x runs fastest
    np.testing.assert_allclose(points[:6, 0], np.linspace(0, 1, 6))
    assert (points[:6, 1:] == 0).all()
    # 180 degrees of freedom with one edge face fixed
    assert 3 * np.count_nonzero(points[:, 1] < 1) == 180


@given(counts, counts, counts)
def test_conforms_and_fills_the_box(nx, ny, nz):
    bounds = (-1.0, 2.5, 0.25, 1.0, 3.0, 3.125)
    points, tetrahedra = build_lattice(bounds, (nx, ny, nz))
    assert len(points) == (nx + 1) * (ny + 1) * (nz + 1)
    assert len(tetrahedra) == 5 * nx * ny * nz
    assert set(tetrahedra.ravel()) == set(range(len(points)))
    np.testing.assert_array_equal(points.min(0), bounds[0::2])
    np.testing.assert_array_equal(points.max(0), bounds[1::2])

    volume = volumes(points, tetrahedra)
    assert (volume > 0).all()
    cell = 3.5 * 0.75 * 0.125 / (nx * ny * nz)
    np.testing.assert_allclose(volume.sum(), cell * nx * ny * nz, rtol=1e-13)
    np.testing.assert_allclose(
        volume.reshape(-1, 5) / cell, [[1 / 3, *[1 / 6] * 4]] * len(volume[::5])
    )

    faces = np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    unique, times = np.unique(faces, axis=0, return_counts=True)
    assert set(times) <= {1, 2}
    corners = points[unique[times == 1]]
    on_box = [
        (corners[:, :, axis] == bounds[2 * axis + side]).all(1)
        for axis in range(3)
        for side in (0, 1)
    ]
    assert np.array(on_box).any(0).all(), (
        "a boundary face inside the box: the split does not conform"
    )
    area = (
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        / 2
    )
    np.testing.assert_allclose(area.sum(), 2 * (3.5 * 0.75 + 0.75 * 0.125 + 3.5 * 0.125))


def test_numpy_integers_are_whole_numbers():
    assert len(build_lattice(np.array([0, 1, 0, 1, 0, 1]), np.array([1, 2, 3]))[1]) == 30


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_scale_does_not_matter(scale):
    unit, cells = build_lattice((0, 1, 0, 2, 0, 1e-3), (2, 3, 1))
    points, tetrahedra = build_lattice(scale * np.array((0, 1, 0, 2, 0, 1e-3)), (2, 3, 1))
    np.testing.assert_array_equal(cells, tetrahedra)
    np.testing.assert_allclose(points, scale * unit, rtol=1e-15)


@pytest.mark.parametrize(
    ("bounds", "word"),
    [
        ((0, 1, 0, 1, 0, 0), "flat along z"),
        ((0, 1, 0, 1, 0, 1e-13), "flat along z"),
        ((0, 1, 5, 5, 0, 1), "flat along y"),
        ((1, -1, 1, -1, 1, -1), "empty along x"),  # what VTK calls the bounds of nothing
        ((0, 0, 0, 0, 0, 0), "flat along x"),
        ((1e9, 1e9 + 1e-7, 0, 1e-7, 0, 1e-7), "flat along x"),
        ((0, np.nan, 0, 1, 0, 1), "finite"),
        ((0, np.inf, 0, 1, 0, 1), "finite"),
        ((0, 1, 0, 1), "six"),
    ],
)
def test_impossible_boxes(bounds, word):
    with pytest.raises(GeometryError, match=word):
        build_lattice(bounds, (1, 1, 1))


@pytest.mark.parametrize("divisions", [(0, 1, 1), (1, -1, 1), (1.5, 1, 1), (1, 1), (True, 1, 1)])
def test_impossible_divisions(divisions):
    with pytest.raises(InputError, match="whole numbers"):
        build_lattice((0, 1, 0, 1, 0, 1), divisions)
    with pytest.raises(InputError, match="whole numbers"):
        estimate_bytes(divisions)


def test_estimate_is_near_the_peak():
    divisions = (60, 50, 40)
    tracemalloc.start()
    build_lattice((0, 1, 0, 1, 0, 1), divisions)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.5 * peak < estimate_bytes(divisions) < 2.0 * peak
