"""Compiled loops against the NumPy code beside them, and what is done without a compiler."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from test_tessellation import random_patches
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import PatchTessellator, WeaveSource, connect, memory, parallel
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.embedding import affine, interpolation
from spacemap_vtk.embedding.affine import AffineInterpolation
from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.textile.patches import tessellation
from spacemap_vtk.textile.patches.tessellation import Tessellation

pytest.importorskip("numba")


@pytest.fixture
def small(monkeypatch):
    """Compiled loops for small work, too."""
    for module in (affine, interpolation, tessellation):
        monkeypatch.setattr(module, "MANY_POINTS", 0)


def both(monkeypatch, module, make):
    """Two of the same: by compiled loops, and by NumPy."""
    compiled = make()
    with monkeypatch.context() as patch:
        patch.setattr(module, "load_loops", lambda *_: None)
        return compiled, make()


def surfaces(monkeypatch, connectivity, subdivisions):
    compiled, plain = both(
        monkeypatch, tessellation, lambda: Tessellation(connectivity, (3, 3), subdivisions)
    )
    assert compiled.bicubic is not None
    assert plain.bicubic is None
    return compiled, plain


@pytest.mark.parametrize("count", [1, 15, 16, 17, 3000])
@pytest.mark.parametrize("subdivisions", [1, 3, 4])
@pytest.mark.parametrize("shared", [True, False])
def test_patches_equal_matrix_products(monkeypatch, small, count, subdivisions, shared):
    points, connectivity = random_patches(count, 3, 3, shared=shared)
    compiled, plain = surfaces(monkeypatch, connectivity, subdivisions)
    np.testing.assert_array_equal(compiled.quads, plain.quads)
    # Many patches have wider indices, for which loops are compiled again: for one precision.
    kinds = [(np.float32, 1e-5), (np.float64, 1e-13)]
    for kind, error in kinds[:1] if count == 3000 else kinds:
        for made, expected in zip(
            compiled.evaluate(points, kind), plain.evaluate(points, kind), strict=True
        ):
            assert made.dtype == kind
            np.testing.assert_allclose(made, expected, rtol=0, atol=error)


def test_environment_variable_compiles_small_fabrics(monkeypatch):
    connectivity = random_patches(20, 3, 3)[1]
    assert Tessellation(connectivity, (3, 3), 3).bicubic is None
    monkeypatch.setenv("SPACEMAP_COMPILED", "always")
    made = Tessellation(connectivity, (3, 3), 3)
    assert made.bicubic is not None
    assert made._threads == 1


def test_small_surface_is_compiled_after_many_steps(monkeypatch):
    source, stage = WeaveSource(ends=3, picks=2), PatchTessellator(subdivisions=2)
    connect(source, stage).update()
    steps = []
    stage.AddObserver("ProgressEvent", lambda *_: steps.append(stage.GetProgressText()))
    once = points_of(stage.output).copy(), normals_of(stage)
    monkeypatch.setattr(tessellation, "COMPILE_AFTER", 3 * len(once[0]))
    for run in range(2, 6):
        stage.Modified()
        stage.update()
        assert (stage.tessellation.bicubic is not None) is (run > 4)
        assert ("compiling" in steps) is (run > 4)
    assert not stage.tessellation.can_compile
    np.testing.assert_allclose(points_of(stage.output), once[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(normals_of(stage), once[1], rtol=0, atol=1e-5)
    # who wants the same bits however many steps there were
    monkeypatch.setenv("SPACEMAP_COMPILED", "never")
    stage.subdivisions = 3
    for _ in range(6):
        stage.Modified()
        stage.update()
    assert stage.tessellation.bicubic is None
    assert not stage.tessellation.can_compile


def normals_of(stage):
    return vtk_to_numpy(stage.output.GetPointData().GetNormals()).copy()


@pytest.mark.nightly
def test_points_of_single_precision_far_from_the_origin(monkeypatch, small):
    points, connectivity = random_patches(500, 3, 3)
    points = (1e-4 * points + 7.0).astype(np.float32)
    compiled, plain = surfaces(monkeypatch, connectivity, 3)
    made, expected = compiled.evaluate(points), plain.evaluate(points)
    np.testing.assert_allclose(made[0], expected[0], rtol=0, atol=5e-7)  # a float32 at 7
    np.testing.assert_allclose(made[1], expected[1], rtol=0, atol=2e-5)


@pytest.mark.parametrize("scale", [1e-25, 1e-4, 1e25])
def test_collapsed_edges_have_the_same_normals(monkeypatch, small, scale):
    points, connectivity = random_patches(300, 3, 3, shared=False)
    net = points[connectivity]
    net[::7, [0, 4, 5, 1]] = net[::7, :1]  # an edge collapsed: corners 0 and 1, and between
    points[connectivity] = net
    compiled, plain = surfaces(monkeypatch, connectivity, 4)
    with np.errstate(all="ignore"):
        made, expected = (
            surface.evaluate(points * scale, np.float64) for surface in (compiled, plain)
        )
    assert np.isfinite(made[1]).all()
    np.testing.assert_allclose(np.linalg.norm(made[1], axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(made[1], expected[1], rtol=0, atol=1e-9)


def test_invalid_patches_do_not_affect_others(monkeypatch, small):
    points, connectivity = random_patches(40, 3, 3, shared=False)
    points[connectivity[5, 3]], points[connectivity[30, 0]] = np.nan, np.inf
    compiled, plain = surfaces(monkeypatch, connectivity, 2)
    with np.errstate(all="ignore"):
        for made, expected in zip(compiled.evaluate(points), plain.evaluate(points), strict=True):
            np.testing.assert_array_equal(
                np.isfinite(made).all(axis=1), np.isfinite(expected).all(axis=1)
            )
            assert (~np.isfinite(made)).any(axis=1).sum() == 2 * 9


@pytest.mark.parametrize("columns", [0, 1, 2, 3, 6])
@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int16, np.uint8])
def test_arrays_are_interpolated(monkeypatch, small, columns, kind):
    points, connectivity = random_patches(700, 3, 3)
    compiled, plain = surfaces(monkeypatch, connectivity, 3)
    shape = (len(points), columns) if columns else len(points)
    values = np.random.default_rng(1).uniform(0, 100, shape).astype(kind)
    made, expected = compiled.interpolate(values), plain.interpolate(values)
    assert made.dtype == expected.dtype
    assert made.shape == expected.shape
    error = 1e-4 if made.dtype == np.float32 else 1e-12
    np.testing.assert_allclose(made, expected, rtol=0, atol=error)
    constant = np.full(shape, 0.1 if kind in (np.float64, np.float32) else 7, dtype=kind)
    same = compiled.interpolate(constant)
    assert (same == same.dtype.type(constant.flat[0])).all()


def test_rational_patches_use_numpy(small):
    points, connectivity = random_patches(50, 3, 3)
    surface = Tessellation(connectivity, (3, 3), 2)
    weights = np.random.default_rng(2).uniform(0.5, 2, len(points))
    ones = surface.evaluate(points, np.float64, weights=np.ones(len(points)))
    np.testing.assert_allclose(surface.evaluate(points, np.float64)[0], ones[0], atol=1e-13)
    other = surface.evaluate(points, np.float64, weights=weights)
    assert np.abs(other[0] - ones[0]).max() > 1e-3
    assert Tessellation(random_patches(50, 2, 3)[1], (2, 3), 2).bicubic is None


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("outside", ["extrapolate", "clamp"])
@pytest.mark.parametrize("cells", [2, 12])  # many points a tetrahedron, and few
def test_embedded_points_equal_matrix_products(monkeypatch, small, order, outside, cells):
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, 1), (cells, cells, 1))
    nodes, elements = (vertices, tetrahedra) if order == 1 else add_midpoints(vertices, tetrahedra)
    rng = np.random.default_rng(order)
    points = rng.uniform(-0.2, 1.2, (20_000, 3))
    where = locate(points, vertices, tetrahedra, outside)
    compiled, plain = both(
        monkeypatch, interpolation, lambda: Interpolation(where, elements, len(nodes))
    )
    shift = rng.normal(size=(len(nodes), 3))
    for kind, error in ((np.float64, 1e-13), (np.float32, 1e-5)):
        own = points.astype(kind)
        moved, made = compiled.displace(own, shift)
        assert made.dtype == moved.dtype == kind
        np.testing.assert_allclose(made, plain.displace(own, shift)[1], rtol=0, atol=error)
        np.testing.assert_array_equal(moved, own + made)
    for columns in ((), (1,), (7,)):
        values = rng.normal(size=(len(nodes), *columns))
        made, expected = compiled.apply(values), plain.apply(values)
        assert made.shape == expected.shape == (len(points), *columns)
        np.testing.assert_allclose(made, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("outside", ["extrapolate", "clamp"])
def test_embedded_points_equal_numpy(monkeypatch, small, outside):
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, 1), (4, 4, 1))
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.2, 1.2, (20_000, 3))
    where, clamp = locate(points, vertices, tetrahedra, outside), outside == "clamp"
    compiled, plain = both(
        monkeypatch,
        affine,
        lambda: AffineInterpolation(points, where, vertices, tetrahedra, clamp),
    )
    shift = rng.normal(size=(len(vertices), 3))
    for kind, error in ((np.float64, 1e-13), (np.float32, 1e-5)):
        own = points.astype(kind)
        moved, made = compiled.displace(own, shift)
        assert made.dtype == moved.dtype == kind
        np.testing.assert_allclose(made, plain.displace(own, shift)[1], rtol=0, atol=error)
        np.testing.assert_array_equal(moved, own + made)
    for columns in ((), (1,), (7,)):
        values = rng.normal(size=(len(vertices), *columns))
        np.testing.assert_allclose(compiled.apply(values), plain.apply(values), atol=1e-12)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("count", [16, 17, 64, 80, 5000])
def test_streamed_results_are_bit_identical(monkeypatch, small, count, kind):
    points, connectivity = random_patches(count, 3, 3)
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, 1), (3, 3, 1))
    places = np.random.default_rng(7).uniform(0, 1, (count + 150_000, 3)).astype(kind)
    where = locate(places, vertices, tetrahedra)
    shift = np.random.default_rng(8).normal(size=(len(vertices), 3))
    made = []
    for least in (2**62, 0):
        monkeypatch.setattr(memory, "_STREAMED", least)
        surface = Tessellation(connectivity, (3, 3), 3)
        ride = AffineInterpolation(places, where, vertices, tetrahedra)
        made.append(
            [
                *surface.evaluate(points, kind),
                surface.interpolate(points, dtype=kind),
                *ride.displace(places, shift),
            ]
        )
        assert memory.is_streamed(*made[-1]) is (least == 0)
    for cached, streamed in zip(*made, strict=True):
        assert cached.tobytes() == streamed.tobytes()


def test_unaligned_results_are_not_streamed(monkeypatch):
    monkeypatch.setattr(memory, "_STREAMED", 0)
    line = memory.allocate_aligned(64, np.float32)
    assert memory.is_streamed(line)
    assert memory.is_streamed(line, line[16:])
    assert not memory.is_streamed(line, line[1:])


def test_small_work_does_not_load_the_compiler(monkeypatch):
    monkeypatch.setattr(parallel, "import_module", None)  # not to be called
    points, connectivity = random_patches(10, 3, 3)
    Tessellation(connectivity, (3, 3), 3).evaluate(points)
    vertices, tetrahedra = build_lattice((0, 1, 0, 1, 0, 1), (1, 1, 1))
    where = locate(vertices, vertices, tetrahedra)
    Interpolation(where, tetrahedra, len(vertices)).apply(vertices)
    AffineInterpolation(vertices, where, vertices, tetrahedra).apply(vertices)


@pytest.mark.parametrize(
    "without",
    [
        pytest.param(
            "import sys; sys.modules['numba'] = None", id="missing", marks=pytest.mark.nightly
        ),
        pytest.param("import os; os.environ['NUMBA_DISABLE_JIT'] = '1'", id="switched off"),
    ],
)
def test_everything_runs_without_a_compiler(without):
    program = f"""
{without}
import numpy as np
from spacemap_vtk import WeaveSource, PatchTessellator
from spacemap_vtk.parallel import load_loops
from spacemap_vtk.textile.patches.tessellation import MANY_POINTS
assert load_loops("spacemap_vtk.textile.patches.patch_loops", True) is None
weave, surface = WeaveSource(ends=20, picks=20), PatchTessellator(subdivisions=4)
surface.SetInputConnection(weave.GetOutputPort())
surface.update()
assert surface.GetOutputDataObject(0).GetNumberOfPoints() > MANY_POINTS
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=300)


@pytest.mark.nightly
def test_loops_run_without_a_folder_for_machine_code(tmp_path):
    """Where nothing can be kept, as of a program without a file, the loops still run."""
    program = """
import numpy as np
from spacemap_vtk.parallel import compile_function

@compile_function
def total(values):
    result = 0.0
    for value in values:
        result += value
    return result

assert total(np.arange(4.0)) == 6.0
assert total.stats.cache_path is None
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=300, cwd=tmp_path)
