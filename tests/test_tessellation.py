"""The tessellated surface: against VTK, against exact shapes, and its memory."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import mutable, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkBezierQuadrilateral, vtkPolyData

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.memory import ArrayPool
from spacemap_vtk.textile.patches import tessellation as module
from spacemap_vtk.textile.patches.bezier import arc_handle, bernstein, quadrilateral_order
from spacemap_vtk.textile.patches.tessellation import Tessellation


def random_patches(count, p, q, seed=0, shared=True):
    """Patches over a bumpy sheet, each with its own net or with points picked from all."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(p + 1), np.arange(q + 1))
    net = np.stack((i / p, j / q, 0 * i), axis=-1).reshape(-1, 3)
    nets = net + rng.uniform(-0.05, 0.05, (count, *net.shape)) + rng.uniform(-3, 3, (count, 1, 3))
    connectivity = np.empty((count, len(net)), dtype=np.int64)
    connectivity[:, quadrilateral_order(p, q)] = np.arange(count * len(net)).reshape(count, -1)
    if shared:  # the numbers shuffled, so that chunks refer to points all over
        place = rng.permutation(connectivity.size)
        points = np.empty((connectivity.size, 3))
        points[place] = nets.reshape(-1, 3)
        return points, place[connectivity]
    return nets.reshape(-1, 3), connectivity


def corners_of(surface):
    """(P, n + 1, n + 1) point numbers [patch, v, u], read off the quadrilaterals."""
    n = surface.subdivisions
    quads = surface.quads.reshape(-1, n, n, 4)
    places = np.empty((len(quads), n + 1, n + 1), dtype=np.int64)
    places[:, :-1, :-1] = quads[..., 0]
    places[:, :-1, 1:] = quads[..., 1]
    places[:, 1:, 1:] = quads[..., 2]
    places[:, 1:, :-1] = quads[..., 3]
    return places


def vtk_position(net, p, q, u, v):
    cell = vtkBezierQuadrilateral()
    cell.GetPointIds().SetNumberOfIds(len(net))
    cell.GetPoints().SetNumberOfPoints(len(net))
    cell.SetOrder(p, q)
    for i, point in enumerate(net):
        cell.GetPointIds().SetId(i, i)
        cell.GetPoints().SetPoint(i, point)
    position = [0.0, 0.0, 0.0]
    cell.EvaluateLocation(mutable(0), [u, v, 0.0], position, [0.0] * len(net))
    return position


@pytest.mark.parametrize(("p", "q"), [(3, 3), (1, 1), (2, 3), (4, 1), (3, 5)])
@pytest.mark.parametrize("subdivisions", [1, 3])
def test_positions_are_vtks(p, q, subdivisions):
    points, connectivity = random_patches(5, p, q)
    surface = Tessellation(connectivity, (p, q), subdivisions)
    exact, _ = surface.evaluate(points, np.float64)
    single, _ = surface.evaluate(points)
    assert exact.dtype == np.float64
    assert single.dtype == np.float32
    t = np.linspace(0, 1, subdivisions + 1)
    places = corners_of(surface)
    for patch, net in enumerate(points[connectivity]):
        oracle = [[vtk_position(net, p, q, u, v) for u in t] for v in t]
        np.testing.assert_allclose(exact[places[patch]], oracle, atol=1e-13)
        np.testing.assert_allclose(single[places[patch]], oracle, atol=1e-6)


@pytest.mark.parametrize("count", [1, 335, 336, 337, 5000])
@pytest.mark.parametrize("threads", [1, 3])
def test_chunks_are_written_to_their_rows(count, threads):
    points, connectivity = random_patches(count, 3, 3, shared=count % 2 == 0)
    surface = Tessellation(connectivity, (3, 3), 3, threads=threads)
    positions, normals = surface.evaluate(points)
    assert positions.shape == normals.shape == (16 * count, 3)
    assert positions.flags.c_contiguous
    places = corners_of(surface)
    assert sorted(places.ravel()) == list(range(16 * count))
    basis = bernstein(3, np.linspace(0, 1, 4))
    nets = points[connectivity[:, quadrilateral_order(3, 3)]].reshape(-1, 4, 4, 3)
    expected = np.einsum("vj,ui,pjik->pvuk", basis, basis, nets)
    np.testing.assert_allclose(positions[places], expected, atol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)


def test_degenerate_connectivity():
    nothing = Tessellation(np.empty((0, 16), int), (3, 3), 2)
    positions, normals = nothing.evaluate(np.empty((0, 3)))
    assert positions.shape == normals.shape == (0, 3)
    assert nothing.quads.shape == (0, 4)
    assert nothing.interpolate(np.empty((0, 2))).shape == (0, 2)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_normals_are_those_of_finite_differences(dtype):
    points, connectivity = random_patches(40, 3, 2)
    n, h = 4, 1e-6
    surface = Tessellation(connectivity, (3, 2), n)
    _, normals = surface.evaluate(points, dtype)
    nets = points[connectivity[:, quadrilateral_order(3, 2)]].reshape(-1, 3, 4, 3)
    t = np.linspace(0, 1, n + 1)

    def at(u, v):
        return np.einsum("vj,ui,pjik->pvuk", bernstein(2, v), bernstein(3, u), nets)

    cross = np.cross(at(t + h, t) - at(t - h, t), at(t, t + h) - at(t, t - h))
    cross /= np.linalg.norm(cross, axis=-1, keepdims=True)
    tolerance = 1e-7 if dtype == np.float64 else 1e-5
    np.testing.assert_allclose(normals[corners_of(surface)], cross, atol=tolerance)


def cylinder(radius=1.0, length=2.0, offset=(0.0, 0.0, 0.0)):
    """Four cubic patches round the z axis, u round it and v along it: normals point outwards."""
    handle = arc_handle(np.pi / 2)
    quarter = np.array([[1, 0], [1, handle], [handle, 1], [0, 1]])
    nets = []
    for turn in range(4):
        c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn]
        ring = quarter @ np.array([[c, s], [-s, c]])
        for j in range(4):
            nets.append(np.column_stack((radius * ring, np.full(4, length * j / 3))))
    points = np.concatenate(nets) + offset
    connectivity = np.empty((4, 16), dtype=np.int64)
    connectivity[:, quadrilateral_order(3, 3)] = np.arange(64).reshape(4, 16)
    return points, connectivity


def test_cylinder():
    points, connectivity = cylinder()
    surface = Tessellation(connectivity, (3, 3), 8)
    positions, normals = surface.evaluate(points, np.float64)
    radius = np.linalg.norm(positions[:, :2], axis=1)
    assert 0 <= (radius - 1).max() == pytest.approx(2.7e-4, rel=0.05)
    radial = positions * [1, 1, 0] / radius[:, None]
    # the slope of a radial error of 2.7e-4 with three waves in 90 degrees
    np.testing.assert_allclose(normals, radial, atol=2e-3)
    ends = corners_of(surface)[:, :, [0, 8]]
    np.testing.assert_allclose(normals[ends], radial[ends], atol=1e-14)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_far_from_the_origin(dtype):
    near, connectivity = cylinder(radius=1e-4, length=1e-3)
    offset = np.array([1e3, -2e3, 5e2])
    surface = Tessellation(connectivity, (3, 3), 4)
    positions, normals = surface.evaluate(near + offset, dtype)
    near_positions, near_normals = surface.evaluate(near, np.float64)
    # the input itself is rounded to 1e-13 m, a billionth of the radius
    np.testing.assert_allclose(normals, near_normals, atol=1e-6 if dtype == np.float32 else 1e-8)
    worst = np.abs(positions - (near_positions + offset)).max()
    assert worst <= (np.spacing(np.float32(2e3)) if dtype == np.float32 else 1e-12)


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e6, 1e12])
def test_scale_does_not_matter(scale):
    points, connectivity = random_patches(50, 3, 3)
    surface = Tessellation(connectivity, (3, 3), 2)
    unit_positions, unit_normals = surface.evaluate(points)
    positions, normals = surface.evaluate(scale * points)
    np.testing.assert_allclose(positions / np.float32(scale), unit_positions, atol=1e-5)
    np.testing.assert_allclose(normals, unit_normals, atol=1e-5)


def test_small_patches_beside_large_ones():
    points, connectivity = random_patches(3, 3, 3, shared=False)
    small = 1e-5 * points
    surface = Tessellation(np.concatenate((connectivity, connectivity + len(points))), (3, 3), 3)
    _, normals = surface.evaluate(np.concatenate((points, small)))
    places = corners_of(surface)
    np.testing.assert_allclose(normals[places[3:]], normals[places[:3]], atol=2e-6)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("side", range(4))
@pytest.mark.parametrize("shift", [0.0, 100.0])
def test_collapsed_edge(dtype, side, shift):
    """The octant of a sphere with its pole on each side of the patch in turn."""
    k = arc_handle(np.pi / 2)
    meridian = np.array([[1, 0], [1, k], [k, 1], [0, 1]])  # equator to pole: distance, height
    parallel = np.array([[1, 0], [1, k], [k, 1], [0, 1]])
    net = np.array([[(*(d * around), h) for around in parallel] for d, h in meridian])
    net = [
        net,
        np.flip(net, (0, 1)),
        net.transpose(1, 0, 2)[:, ::-1],
        net.transpose(1, 0, 2)[::-1],
    ][side]
    connectivity = quadrilateral_order(3, 3).argsort()[None]
    surface = Tessellation(connectivity, (3, 3), 6)
    positions, normals = surface.evaluate(net.reshape(-1, 3) + shift, dtype)
    assert np.isfinite(normals).all()
    out = positions.astype(np.float64) - shift
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    np.testing.assert_allclose((out * normals).sum(1), 1, atol=2e-3)
    poles = out[:, 2] > 1 - 1e-9
    assert poles.sum() == 7
    assert normals[poles, 2].min() > 1 - 1e-5


def test_patches_without_area_have_some_normal():
    line = np.column_stack((np.repeat(np.arange(4.0), 4), np.zeros((16, 2))))
    point = np.full((16, 3), 7.0)
    cross = np.array([[i, j, 0] for j in range(4) for i in (0, 1, 2, 3)], float)
    nets = np.concatenate((line, point, cross))
    surface = Tessellation(np.arange(48).reshape(3, 16), (3, 3), 4)
    for dtype in (np.float32, np.float64):
        normals = surface.evaluate(nets, dtype)[1]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
        places = corners_of(surface)
        np.testing.assert_allclose(normals[places[0]][..., 0], 0, atol=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("corner", [0, 5, 15])
def test_a_broken_point_spoils_only_its_patch(value, corner):
    points, connectivity = random_patches(400, 3, 3, shared=False)
    surface = Tessellation(connectivity, (3, 3), 3)
    good = surface.evaluate(points)
    points[corner] = value
    bad = surface.evaluate(points)
    first = corners_of(surface)[0].ravel()
    for before, after in zip(good, bad, strict=True):
        assert not np.isfinite(after[first]).all()
        rest = np.delete(np.arange(len(before)), first)
        np.testing.assert_allclose(after[rest], before[rest], rtol=0, atol=0)


def test_cells_and_orientation():
    points, connectivity = random_patches(700, 3, 3)
    surface = Tessellation(connectivity, (3, 3), 5)
    positions, normals = surface.evaluate(points, np.float64)
    assert surface.quads.shape == (700 * 25, 4)
    assert surface.quads.dtype == np.int32
    a, b, c, d = (positions[surface.quads[:, i]] for i in range(4))
    facing = (np.cross(c - a, d - b) * normals[surface.quads[:, 0]]).sum(1)
    assert (facing > 0).mean() > 0.99  # bumps may turn a corner, not the lot
    # a cell's points belong to its patch
    patch = np.empty(surface.point_count, dtype=int)
    patch[corners_of(surface)] = np.arange(700)[:, None, None]
    owner = np.repeat(np.arange(700), 25)
    np.testing.assert_array_equal(patch[surface.quads], owner[:, None].repeat(4, 1))


@pytest.mark.parametrize("columns", [1, 2, 3, 4, 9])
def test_point_arrays_are_carried_over(columns):
    points, connectivity = random_patches(500, 3, 3)
    surface = Tessellation(connectivity, (3, 3), 3)
    positions, _ = surface.evaluate(points, np.float64)
    rng = np.random.default_rng(1)
    linear, constant = rng.normal(size=(3, columns)), rng.normal(size=columns)
    carried = surface.interpolate(points @ linear + constant)
    assert carried.dtype == np.float64
    np.testing.assert_allclose(carried, positions @ linear + constant, atol=1e-12)


def test_kinds_of_point_arrays():
    points, connectivity = random_patches(20, 3, 3)
    surface = Tessellation(connectivity, (3, 3), 3)
    flat = surface.interpolate(points[:, 0].astype(np.float32))
    assert flat.shape == (surface.point_count,)
    assert flat.dtype == np.float32
    seven = surface.interpolate(np.full(len(points), 7, dtype=np.uint8))
    assert seven.dtype == np.float64
    assert (seven == 7).all()
    assert (surface.interpolate(np.full(len(points), 0.1, np.float32)) == np.float32(0.1)).all()
    assert surface.interpolate(np.ones(len(points), bool)).min() == 1


def test_refusals():
    square = [[0, 1, 2, 3]]
    with pytest.raises(InputError, match="subdivisions = 0"):
        Tessellation(square, (1, 1), 0)
    with pytest.raises(InputError, match="at least 1"):
        Tessellation(square, (0, 3), 1)
    with pytest.raises(GeometryError, match="16 control points"):
        Tessellation(square, (3, 3), 1)
    with pytest.raises(GeometryError, match="negative"):
        Tessellation([[0, 1, 2, -3]], (1, 1), 1)
    surface = Tessellation(square, (1, 1), 1)
    with pytest.raises(GeometryError, match="use point 3, but there are 3"):
        surface.evaluate(np.zeros((3, 3)))
    with pytest.raises(GeometryError, match="use point 3"):
        surface.interpolate(np.zeros(3))
    with pytest.raises(GeometryError, match=r"\(4, 2\)"):
        surface.evaluate(np.zeros((4, 2)))
    with pytest.raises(InputError, match="float32, float64"):
        surface.evaluate(np.zeros((4, 3)), np.int32)
    with pytest.raises(ValueError, match="read-only"):
        surface.quads[0] = 0


def test_results_are_never_overwritten():
    points, connectivity = random_patches(3000, 3, 3, shared=False)
    surface = Tessellation(connectivity, (3, 3), 3)
    rng = np.random.default_rng(0)
    kept = []
    for step in range(12):
        positions, normals = surface.evaluate(points + step)
        if rng.random() < 0.6:  # views of all kinds, the arrays themselves dropped
            view = [positions[5:], positions.ravel()[::3], positions.T, memoryview(normals)][
                step % 4
            ]
            kept.append((view, np.array(view)))
    for view, copy in kept:
        np.testing.assert_array_equal(np.asarray(view), copy)


def test_memory_shared_with_vtk_is_not_reused():
    points, connectivity = random_patches(2000, 3, 3, shared=False)
    surface = Tessellation(connectivity, (3, 3), 3)
    data = vtkPolyData()
    coordinates = vtkPoints()
    coordinates.SetData(numpy_to_vtk(surface.evaluate(points)[0]))
    data.SetPoints(coordinates)
    del coordinates
    gc.collect()
    before = data.GetPoint(12345)
    for step in range(1, 5):
        surface.evaluate(points + step)
    assert data.GetPoint(12345) == before


def test_memory_of_results_is_reused():
    recycler = ArrayPool()
    first = recycler.empty((1000, 3), np.float32)
    address = first.ctypes.data
    view = first[10:20]
    del first
    assert recycler.empty((1000, 3), np.float32).ctypes.data != address
    del view
    held = [recycler.empty((3000,), np.int32) for _ in range(3)]  # as many bytes
    assert address in [array.ctypes.data for array in held]
    # another size lets go of the free blocks, and the recycler may die before its arrays
    del held
    other = recycler.empty((5,), np.float64)
    assert len(recycler.free) == 0
    del recycler
    other[:] = 1
    del other
    assert ArrayPool().empty((0, 3), np.float32).shape == (0, 3)


def test_two_threads_may_evaluate_at_once():
    points, connectivity = random_patches(4000, 3, 3, shared=False)
    surface = Tessellation(connectivity, (3, 3), 3)
    expected = [surface.evaluate(points + step)[0].copy() for step in range(2)]
    failures = []

    def call(step):
        for _ in range(10):
            if not np.array_equal(surface.evaluate(points + step)[0], expected[step]):
                failures.append(step)

    callers = [threading.Thread(target=call, args=(step,)) for step in range(2)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert not failures


def test_an_error_in_a_thread_is_raised(monkeypatch):
    points, connectivity = random_patches(5000, 3, 3, shared=False)
    surface = Tessellation(connectivity, (3, 3), 3, threads=2)

    def broken(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(module.Scratch, "multiply", broken)
    with pytest.raises(ZeroDivisionError):
        surface.evaluate(points)


def test_deleting_an_array_runs_no_python() -> None:
    recycler = ArrayPool()
    array, reported = recycler.empty((10,), np.float64), []
    sys.setprofile(lambda _frame, event, _argument: reported.append(event))
    try:
        del array
    finally:
        sys.setprofile(None)
    # Python's functions are "call"; turning the profile off is a "c_call".
    assert "call" not in reported


_TWO_THREADS = """
import sys, threading
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from spacemap_vtk.memory import ArrayPool

sys.setswitchinterval(1e-5)
recycler, over = ArrayPool(), threading.Event()

def work():
    while not over.is_set():
        vtkPolyData(), vtkTriangleFilter()

thread = threading.Thread(target=work, daemon=True)
thread.start()
shown = vtkTriangleFilter()
for _ in range(2000):
    array, points, data = recycler.empty((9, 3), np.float32), vtkPoints(), vtkPolyData()
    array[:] = 0.0
    points.SetData(numpy_to_vtk(array))
    data.SetPoints(points)
    shown.SetInputData(data)
    del array, points, data
over.set()
thread.join()
"""


def test_threads_that_release_arrays_and_vtk_objects_do_not_block() -> None:
    # VTK's collector freed the last frame's array, whose memory Python gave back; Python let the
    # other thread work, which waited for the collector: the window stood still for ever.
    subprocess.run([sys.executable, "-c", _TWO_THREADS], check=True, timeout=300)
