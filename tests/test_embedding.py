"""Points in tetrahedra: location, weights, interpolation."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import Delaunay
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkStaticCellLocator, vtkUnstructuredGrid

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.lattice_locate import recognise_lattice
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.embedding.triangles import FACES, nearest_on_triangles
from spacemap_vtk.errors import GeometryError, InputError

UNIT = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
ONE = np.array([[0, 1, 2, 3]])


def reproduced(where, vertices, tetrahedra):
    return np.einsum("ni,nik->nk", where.weights, vertices[tetrahedra[where.tetrahedron]])


def cloud(count, seed, low=-0.5, high=1.5):
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def random_mesh(count, seed):
    vertices = cloud(count, seed, 0, 1)
    return vertices, Delaunay(vertices).simplices.astype(np.int64)


def distances_to_all(point, vertices, tetrahedra):
    """Distance of a point to each tetrahedron, by another method: non-negative least squares."""
    result = []
    for corners in vertices[tetrahedra]:
        # the sum of weights as one more equation, heavy enough to be kept
        matrix = np.vstack((corners.T, np.full(4, 1e6)))
        weights, _ = nnls(matrix, np.append(point, 1e6))
        result.append(np.linalg.norm(corners.T @ (weights / weights.sum()) - point))
    return np.array(result)


def affine(seed):
    rng = np.random.default_rng(seed)
    matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    return lambda x: x @ matrix + shift


def test_cage_of_the_published_experiment():
    points = cloud(20_000, 1, 0, 1) * [1, 1, 0.1]
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, 0.1), (5, 5, 1))
    where = locate(points, vertices, tetrahedra)
    assert where.outside == 0
    assert where.largest_distance == 0
    assert not where.is_outside.any()
    assert where.weights.min() >= -1e-9
    np.testing.assert_allclose(where.weights.sum(1), 1, rtol=1e-15)
    np.testing.assert_allclose(reproduced(where, vertices, tetrahedra), points, atol=1e-15)
    assert where.tetrahedron.dtype == np.int32
    assert set(where.tetrahedron) == set(range(125))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(["extrapolate", "clamp"]))
@example(36224, "clamp")  # a point within 1e-6 of the plane between two cells
def test_affine_motion_is_reproduced(seed, outside):
    vertices, tetrahedra = build_lattice(UNIT, (3, 2, 4))
    points, motion = cloud(300, seed), affine(seed)
    where = locate(points, vertices, tetrahedra, outside)
    moved = Interpolation(where, tetrahedra, len(vertices)).apply(motion(vertices))
    np.testing.assert_allclose(where.weights.sum(1), 1, rtol=1e-14)
    inside = ((points >= 0) & (points <= 1)).all(1)
    np.testing.assert_array_equal(where.is_outside, ~inside)
    assert where.outside == (~inside).sum()
    if outside == "extrapolate":
        np.testing.assert_allclose(moved, motion(points), atol=1e-12)
    else:  # clamping to a box is clipping
        # Distances that differ by less than 1e-12 are equal, and the lowest tetrahedron wins: close
        # to the plane between two cells its nearest point is up to sqrt(2e-12) distances away.
        error = abs(moved - motion(np.clip(points, 0, 1)))
        assert np.quantile(error, 0.99) < 1e-12
        assert error.max() < 1e-5
        assert where.weights.min() >= -1e-9
    gap = np.linalg.norm(points - np.clip(points, 0, 1), axis=1)
    assert where.largest_distance == pytest.approx(gap.max(), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_points_outside_belong_to_the_nearest_tetrahedron(seed):
    vertices, tetrahedra = random_mesh(25, seed)
    rng = np.random.default_rng(seed)
    keep = rng.random(len(tetrahedra)) < 0.5  # holes, and pieces that do not touch
    tetrahedra = tetrahedra[keep]
    points = cloud(150, seed + 100, -1, 2)
    where = locate(points, vertices, tetrahedra, "clamp")
    nearest = reproduced(where, vertices, tetrahedra)
    far = np.linalg.norm(nearest - points, axis=1)
    for i, point in enumerate(points):
        all_of_them = distances_to_all(point, vertices, tetrahedra)
        assert far[i] == pytest.approx(all_of_them.min(), abs=1e-7)
        assert all_of_them[where.tetrahedron[i]] == pytest.approx(all_of_them.min(), abs=1e-7)
        assert where.is_outside[i] == (all_of_them.min() > 1e-7)
    assert where.outside == where.is_outside.sum() > 0


def test_the_nearest_face_need_not_have_the_nearest_centre():
    # a long tetrahedron whose tip is at the point, and a small one whose middle is nearer
    vertices = np.array(
        [
            *([0, 0, 0], [10, 1, 0], [10, -1, 0], [10, 0, 1]),
            *([-1, 0, 0], [-1.2, 0.1, 0], [-1.2, -0.1, 0], [-1.2, 0, 0.1]),
        ],
        dtype=float,
    )
    tetrahedra = np.array([[4, 5, 6, 7], [0, 1, 2, 3]])
    where = locate([[-0.4, 0, 0], [-0.6, 0, 0]], vertices, tetrahedra)
    assert where.tetrahedron.tolist() == [1, 0]
    assert where.largest_distance == pytest.approx(0.4)


def test_nearest_point_of_a_triangle():
    rng = np.random.default_rng(3)
    a, b, c = rng.normal(size=(3, 3, 200))
    points = 2 * rng.normal(size=(3, 200))
    squared, weights = nearest_on_triangles(points, a, b, c)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(0), 1, rtol=1e-14)
    grid = np.array([(i, j, 60 - i - j) for i in range(61) for j in range(61 - i)]) / 60
    sampled = np.einsum("si,ikn->skn", grid, np.stack((a, b, c)))
    least = ((sampled - points) ** 2).sum(1).min(0)
    assert (squared <= least * (1 + 1e-12)).all()
    at = weights[0] * a + weights[1] * b + weights[2] * c
    np.testing.assert_allclose(((at - points) ** 2).sum(0), squared, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(np.sqrt(squared), np.sqrt(least), atol=0.1)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("outside", ["extrapolate", "clamp"])
def test_scale_does_not_matter(scale, outside):
    vertices, tetrahedra = random_mesh(200, 5)
    points = cloud(3000, 6)
    unit = locate(points, vertices, tetrahedra, outside)
    where = locate(scale * points, scale * vertices, tetrahedra, outside)
    np.testing.assert_array_equal(where.is_outside, unit.is_outside)
    assert where.largest_distance == pytest.approx(scale * unit.largest_distance, rel=1e-9)
    same = where.tetrahedron == unit.tetrahedron
    assert same.mean() > 0.999  # the rest are equally near within rounding
    np.testing.assert_allclose(where.weights[same], unit.weights[same], rtol=1e-6, atol=1e-9)


def test_results_do_not_depend_on_order_other_points_or_threads():
    vertices, tetrahedra = build_lattice(UNIT, (4, 4, 4))
    rng = np.random.default_rng(8)
    # many on shared faces, edges and corners, inside and out
    points = np.concatenate((rng.integers(-2, 7, (30_000, 3)) / 4, cloud(30_000, 9)))
    first = locate(points, vertices, tetrahedra, "clamp", threads=1)
    shuffle = rng.permutation(len(points))
    second = locate(points[shuffle], vertices, tetrahedra, "clamp", threads=3)
    np.testing.assert_array_equal(second.tetrahedron, first.tetrahedron[shuffle])
    np.testing.assert_array_equal(second.weights, first.weights[shuffle])
    some = rng.integers(0, len(points), 40)
    for i in some:
        alone = locate(points[i : i + 1], vertices, tetrahedra, "clamp")
        assert alone.tetrahedron[0] == first.tetrahedron[i]
        np.testing.assert_array_equal(alone.weights[0], first.weights[i])


def test_shared_faces_go_to_the_lowest_number():
    vertices, tetrahedra = build_lattice(UNIT, (3, 3, 3))
    rng = np.random.default_rng(1)
    tetrahedra = rng.permutation(tetrahedra)
    for corners in (2, 3):  # middles of edges and of faces
        which = tetrahedra[rng.integers(0, len(tetrahedra), 200)][:, :corners]
        points = vertices[which].mean(1)
        holders = [
            min(i for i, t in enumerate(tetrahedra) if set(face) <= set(t)) for face in which
        ]
        np.testing.assert_array_equal(locate(points, vertices, tetrahedra).tetrahedron, holders)
    holders = [np.flatnonzero((tetrahedra == i).any(1))[0] for i in range(len(vertices))]
    where = locate(vertices, vertices, tetrahedra, "error")
    np.testing.assert_array_equal(where.tetrahedron, holders)
    # and outside: along the normals of the middles of boundary edges
    outward = 2 * vertices - 0.5
    far = locate(outward, vertices, tetrahedra)
    # those that have a face there: one that only touches the border with a corner lies behind
    for i in (0, 3, 12, 15, 48, 51, 60, 63):
        same_side = (vertices[tetrahedra] == vertices[i]).sum(axis=1) >= 3
        has_face = same_side.any(axis=1) & (tetrahedra == i).any(axis=1)
        assert far.tetrahedron[i] == np.flatnonzero(has_face)[0]


@pytest.mark.parametrize("seed", range(3))
def test_random_meshes_against_scipy_and_vtk(seed):
    vertices, tetrahedra = random_mesh(300, seed)
    points = cloud(5000, seed + 50, -0.1, 1.1)
    where = locate(points, vertices, tetrahedra)
    oracle = Delaunay(vertices)
    simplex = oracle.find_simplex(points)
    np.testing.assert_array_equal(where.is_outside, simplex < 0)
    inside = ~where.is_outside
    np.testing.assert_array_equal(where.tetrahedron[inside], simplex[inside])

    grid = vtkUnstructuredGrid()
    coordinates = vtkPoints()
    coordinates.SetData(numpy_to_vtk(vertices))
    grid.SetPoints(coordinates)
    grid.AllocateExact(len(tetrahedra), 4)
    for corners in tetrahedra.tolist():
        grid.InsertNextCell(VTK_TETRA, 4, corners)
    locator = vtkStaticCellLocator()
    locator.SetDataSet(grid)
    locator.BuildLocator()
    theirs = np.array([locator.FindCell(point) for point in points])
    differ = np.flatnonzero(theirs != np.where(where.is_outside, -1, where.tetrahedron))
    assert len(differ) < 0.01 * len(points)
    # VTK takes a thousandth outside for inside, and so finds a neighbour now and then
    one = np.ones((len(differ), 1))
    system = np.concatenate(
        (vertices[tetrahedra[theirs[differ]]], np.broadcast_to(1.0, (len(differ), 4, 1))), axis=2
    )
    target = np.concatenate((points[differ], one), axis=1)[:, :, None]
    least = np.linalg.solve(system.transpose(0, 2, 1), target)[:, :, 0].min(axis=1)
    known = theirs[differ] >= 0
    assert (least[known] < 0).all()
    assert (least[known] > -1.1e-3).all()


def test_orientation_does_not_matter():
    vertices, tetrahedra = build_lattice(UNIT, (3, 3, 3))
    flipped = tetrahedra.copy()
    odd = np.random.default_rng(0).random(len(flipped)) < 0.5
    flipped[odd] = flipped[odd][:, [1, 0, 2, 3]]
    points = cloud(3000, 1)
    one, two = (locate(points, vertices, cells, "clamp") for cells in (tetrahedra, flipped))
    np.testing.assert_array_equal(one.tetrahedron, two.tetrahedron)
    np.testing.assert_allclose(
        reproduced(one, vertices, tetrahedra), reproduced(two, vertices, flipped), atol=1e-14
    )


def test_flat_tetrahedra_contain_no_points():
    vertices = np.concatenate((CORNERS, [[0.5, 0.5, 0.0], [5, 5, 5], [6, 5, 5], [5, 6, 5]]))
    tetrahedra = np.array([[0, 1, 2, 4], [5, 6, 7, 5], [0, 1, 2, 3]])
    where = locate([[0.2, 0.2, 0.0], [5.1, 5.1, 5.0], [0.1, 0.1, 0.1]], vertices, tetrahedra)
    assert where.tetrahedron.tolist() == [2, 2, 2]
    assert where.outside == 1
    with pytest.raises(GeometryError, match="all 2 tetrahedra of the cage are flat"):
        locate([[0, 0, 0]], vertices, tetrahedra[:2])


@pytest.mark.parametrize("thin", [1e-3, 1e-6, 1e-9, 1e-11])
def test_slivers(thin):
    """One thin layer: affine motion to rounding, and no point on the surface is lost."""
    points = np.random.default_rng(2).random((5000, 3)) * [1, 1, thin]
    points[::3, 2] = 0
    points[1::3, 2] = thin
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, thin), (4, 4, 1))
    shift = np.array([0.3, 0.1, 0.7])  # so that the coordinates are rounded
    for offset in (0 * shift, shift):
        where = locate(points + offset, vertices + offset, tetrahedra)
        assert where.outside == 0
        motion = affine(3)
        moved = Interpolation(where, tetrahedra, len(vertices)).apply(motion(vertices + offset))
        np.testing.assert_allclose(moved, motion(points + offset), atol=1e-12)


def test_a_sliver_next_to_good_ones():
    vertices, tetrahedra = build_lattice(UNIT, (2, 2, 2))
    middle = np.append(vertices, [[0.25, 0.25, 1e-10]], axis=0)
    # one more, lying flat on the floor but for 1e-10, overlapping those above
    cells = np.append([[0, 2, 6, len(vertices)]], tetrahedra, axis=0)
    points = cloud(4000, 4)
    where = locate(points, middle, cells)
    np.testing.assert_allclose(
        reproduced(where, middle, cells), points, atol=1e-9 * np.abs(where.weights).max()
    )
    assert where.outside == locate(points, vertices, tetrahedra).outside


def test_rounding_of_the_boundary_is_inside():
    vertices, tetrahedra = build_lattice((0.1, 0.7, 0.1, 0.7, 0.1, 0.7), (3, 3, 3))
    rng = np.random.default_rng(0)
    points = rng.uniform(0.1, 0.7, (3000, 3))
    axis = rng.integers(0, 3, 3000)
    points[np.arange(3000), axis] = np.where(rng.random(3000) < 0.5, 0.1, 0.7)
    assert locate(points * (1 + 1e-15), vertices, tetrahedra, "error").outside == 0
    assert locate(points.astype(np.float32), vertices, tetrahedra, "error").outside == 0
    # 30 thousand kilometres away, where a coordinate has nine digits behind the point
    far = 3e7
    assert locate(points + far, vertices + far, tetrahedra, "error").outside == 0
    assert locate(points * 1.0001, vertices, tetrahedra).outside > 0


def test_error_names_count_distance_and_cure():
    vertices, tetrahedra = build_lattice(UNIT, (2, 2, 2))
    points = np.array([[0.5, 0.5, 0.5], [1.25, 0.5, 0.5], [0.5, 0.5, -0.125]])
    with pytest.raises(GeometryError, match=r"2 of 3 points lie outside .* 0\.25 m.*padding"):
        locate(points, vertices, tetrahedra, "error")
    assert locate(points[:1], vertices, tetrahedra, "error").outside == 0


def test_meshes_that_do_not_conform():
    # each tetrahedron with vertices of its own, and all of them twice
    vertices, tetrahedra = build_lattice(UNIT, (2, 3, 2))
    loose, cells = vertices[tetrahedra].reshape(-1, 3), np.arange(tetrahedra.size).reshape(-1, 4)
    points = cloud(2000, 3)
    expected = locate(points, vertices, tetrahedra, "clamp")
    for mesh in (
        (loose, cells),
        (vertices, np.concatenate((tetrahedra, tetrahedra))),
    ):
        where = locate(points, *mesh, "clamp")
        np.testing.assert_array_equal(where.is_outside, expected.is_outside)
        np.testing.assert_allclose(
            reproduced(where, *mesh), reproduced(expected, vertices, tetrahedra), atol=1e-14
        )
        # inner faces count as boundary here, and may be as near as outer ones
        inside = ~where.is_outside
        np.testing.assert_array_equal(where.tetrahedron[inside], expected.tetrahedron[inside])


def test_overlapping_tetrahedra_on_one_side_of_a_face():
    vertices = np.concatenate((CORNERS, [[0.2, 0.2, 3.0]]))
    tetrahedra = np.array([[0, 1, 2, 3], [0, 1, 2, 4]])
    where = locate([[0.2, 0.2, -1.0]], vertices, tetrahedra, "clamp")
    assert where.largest_distance == 1
    assert where.tetrahedron[0] == 0


def test_faces_look_outwards():
    a, b, c = CORNERS[FACES].transpose(1, 0, 2)
    outward = np.cross(b - a, c - a)
    assert (np.einsum("ik,ik->i", outward, a - CORNERS.mean(0)) > 0).all()


def test_few_points_and_none():
    empty = locate(np.empty((0, 3)), CORNERS, ONE, "error")
    assert empty.weights.shape == (0, 4)
    assert empty.outside == 0
    assert empty.largest_distance == 0
    assert Interpolation(empty, ONE, 4).apply(CORNERS).shape == (0, 3)
    single = locate([[9, 9, 9]], CORNERS, ONE, "clamp")
    np.testing.assert_allclose(single.weights, [[0, 1 / 3, 1 / 3, 1 / 3]], atol=1e-15)


@pytest.mark.parametrize(
    ("points", "vertices", "tetrahedra", "word"),
    [
        ([[0, np.nan, 0]], CORNERS, ONE, "point 0 is not finite"),
        ([[0, 0, 0], [np.inf, 0, 0], [0, np.nan, 0]], CORNERS, ONE, "point 1 .* and 1 more"),
        ([[0, 0, 0]], CORNERS * np.nan, ONE, "vertex of the cage 0 is not finite"),
        ([[0, 0]], CORNERS, ONE, r"shape \(1, 2\)"),
        ([[0, 0, 0]], CORNERS, [[0, 1, 2]], "vertex numbers"),
        ([[0, 0, 0]], CORNERS, [[0.0, 1, 2, 3]], "vertex numbers"),
        ([[0, 0, 0]], CORNERS, [[0, 1, 2, 4]], "uses vertex 4; allowed: 0 to 3"),
        ([[0, 0, 0]], CORNERS, [[0, 1, 2, -1]], "uses vertex -1"),
        ([[0, 0, 0]], CORNERS, np.empty((0, 4), int), "no tetrahedra"),
    ],
)
def test_refusals(points, vertices, tetrahedra, word):
    with pytest.raises(GeometryError, match=word):
        locate(points, vertices, tetrahedra)


def test_refused_names():
    with pytest.raises(InputError, match=r'outside = "ignore".*extrapolate, clamp, error'):
        locate([[0, 0, 0]], CORNERS, ONE, "ignore")
    ride = Interpolation(locate([[0, 0, 0]], CORNERS, ONE), ONE, 4)
    with pytest.raises(InputError, match=r"\(4,\) or \(4, k\)"):
        ride.apply(np.zeros((5, 3)))
    with pytest.raises(InputError, match=r"\(4,\) or \(4, k\)"):
        ride.apply(np.zeros((4, 3, 3)))


def test_interpolation_is_the_weighted_sum():
    vertices, tetrahedra = build_lattice(UNIT, (3, 3, 3))
    where = locate(cloud(70_000, 2), vertices, tetrahedra)
    random = np.random.default_rng(0)
    for threads, shape in itertools.product((1, 3), ((), (7,))):
        ride = Interpolation(where, tetrahedra, len(vertices), threads=threads)
        values = random.normal(size=(len(vertices), *shape))
        result = ride.apply(values)
        assert result.dtype == np.float64
        assert result.shape == (70_000, *shape)
        expected = np.einsum("ni,ni...->n...", where.weights, values[tetrahedra[where.tetrahedron]])
        reported = f"{threads} threads, {shape}"
        np.testing.assert_allclose(result, expected, atol=1e-12, err_msg=reported)
        kept = result.copy()
        for step in range(1, 4):
            ride.apply(step * values)
        np.testing.assert_array_equal(result, kept, err_msg=reported)
        single = ride.apply(values.astype(np.float32))
        np.testing.assert_allclose(single, expected, atol=1e-4, err_msg=reported)


# --- lattices, found by arithmetic -------------------------------------------------------------


def searched(monkeypatch, *arguments):
    """Locate as in a mesh that is no lattice."""
    import spacemap_vtk.embedding.locate as module

    with monkeypatch.context() as patch:
        patch.setattr(module, "recognise_lattice", lambda *_: None)
        return locate(*arguments)


def carved(vertices, tetrahedra, seed, share=0.6):
    kept = np.random.default_rng(seed).random(len(tetrahedra) // 5) < share
    kept[[0, -1]] = True
    return vertices, tetrahedra.reshape(-1, 5, 4)[kept].reshape(-1, 4)


@pytest.mark.parametrize(
    "bounds",
    [pytest.param(UNIT, marks=pytest.mark.nightly), (0.1, 0.7, -3, -2.9, 1e3, 1e3 + 2)],
)
@pytest.mark.parametrize(("whole", "outside"), [(True, "clamp"), (False, "extrapolate")])
def test_a_lattice_equals_the_search(monkeypatch, bounds, whole, outside):
    divisions = np.array([5, 4, 3])
    mesh = build_lattice(bounds, divisions)
    if not whole:
        mesh = carved(*mesh, 1)
    assert (recognise_lattice(*mesh).slots is None) == whole
    low, high = np.reshape(bounds, (3, 2)).T
    # on corners, edges, faces and diagonals, in and out; and anywhere
    exact = np.random.default_rng(2).integers(-1, 4 * divisions + 2, (8_000, 3)) / (4 * divisions)
    points = low + (high - low) * np.concatenate((exact, cloud(8_000, 3)))
    fast, slow = locate(points, *mesh, outside), searched(monkeypatch, points, *mesh, outside)
    np.testing.assert_array_equal(fast.tetrahedron, slow.tetrahedron)
    np.testing.assert_allclose(fast.weights, slow.weights, atol=1e-11)
    np.testing.assert_array_equal(fast.is_outside, slow.is_outside)
    assert fast.largest_distance == slow.largest_distance
    inside = ~fast.is_outside
    assert fast.weights[inside].min() > -1e-8
    # sums of four weights within rounding
    np.testing.assert_allclose(fast.weights[inside].sum(1), 1, rtol=1e-15)


def test_only_exact_lattices_are_recognised():
    vertices, tetrahedra = build_lattice(UNIT, (3, 4, 2))
    pattern = recognise_lattice(vertices, tetrahedra)
    assert pattern.divisions.tolist() == [3, 4, 2]
    assert recognise_lattice(vertices + np.array((3.0, -4.0, 1e3)), tetrahedra) is not None
    for vertex in range(0, len(vertices), 7):
        moved = vertices.copy()
        moved[vertex, vertex % 3] += 1e-6
        assert recognise_lattice(moved, tetrahedra) is None
    for cells in (tetrahedra[1:], tetrahedra[5:3], tetrahedra[::-1], tetrahedra[:, [1, 0, 2, 3]]):
        assert recognise_lattice(vertices, cells) is None
    groups = tetrahedra.reshape(-1, 5, 4)
    assert recognise_lattice(vertices, groups[::-1].reshape(-1, 4)) is None
    turned = vertices @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    assert recognise_lattice(turned, tetrahedra) is None
    # the lower half, whose first hexahedron is an odd one
    odd = carved(vertices, tetrahedra, 0, 2.0)[1].reshape(-1, 5, 4)[12:].reshape(-1, 4)
    assert recognise_lattice(vertices, odd).divisions.tolist() == [3, 4, 1]
    assert recognise_lattice(*random_mesh(40, 1)) is None
