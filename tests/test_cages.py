"""Cages that follow the object: carved, and filled by fTetWild."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import spacemap_vtk.accessor  # noqa: F401
from spacemap_vtk import BarycentricWarp, ModalSolver, TetraCage
from spacemap_vtk.cage import split, tetwild
from spacemap_vtk.cage.carve import find_touched_cells
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.cage.split import repair_tetrahedra
from spacemap_vtk.datasets.arrays import add_array, tetrahedra_of
from spacemap_vtk.datasets.extent import filled_share
from spacemap_vtk.datasets.outline import extract_outline, make_envelope
from spacemap_vtk.embedding.enclose import enclose_points, enclosed_share
from spacemap_vtk.embedding.lattice_locate import recognise_lattice
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.filters.patch_tessellator import polygons_of

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


def cage_of(mesh: pv.DataSet, **values: object) -> tuple[TetraCage, pv.UnstructuredGrid]:
    cage = TetraCage(**values)
    cage.SetInputDataObject(mesh)
    cage.update()
    return cage, pv.wrap(cage.GetOutputDataObject(0))


def check_mesh(points: np.ndarray, tetrahedra: np.ndarray, closed: bool = True) -> float:
    """Positive volumes, every face shared by at most two, no vertex unused; return the volume."""
    a, b, c = (points[tetrahedra[:, i]] - points[tetrahedra[:, 0]] for i in (1, 2, 3))
    volumes = np.einsum("ij,ij->i", np.cross(a, b), c) / 6
    assert volumes.min() > 0
    faces = np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    assert np.unique(faces, axis=0, return_counts=True)[1].max() <= 2
    if closed:
        assert len(np.unique(tetrahedra)) == len(points)
    return float(volumes.sum())


def boundary_area(points: np.ndarray, tetrahedra: np.ndarray) -> float:
    faces = np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    unique, counts = np.unique(faces, axis=0, return_counts=True)
    a, b, c = points[unique[counts == 1]].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


# --- carved ------------------------------------------------------------------------------------


def test_touched_hexahedra_against_many_samples() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 1, (60, 3))
    triangles = np.arange(60).reshape(-1, 3)
    triangles[-3:, 2] = triangles[-3:, 1]  # segments
    counts = np.array([9, 7, 5])
    found = find_touched_cells(points, triangles, np.zeros(3), 1 / counts, counts.tolist())
    weights = rng.dirichlet([0.7] * 3, 20_000)
    samples = np.einsum("sk,fkc->fsc", weights, points[triangles]).reshape(-1, 3)
    x, y, z = np.minimum((samples * counts).astype(int), counts - 1).T
    sampled = np.zeros_like(found)
    sampled[z, y, x] = True
    assert (found | ~sampled).all()  # none is missed
    # what samples have missed is grazed at a corner
    assert (found & ~sampled).sum() < 0.05 * found.sum()


def test_a_large_triangle_touches_hexahedra_without_its_points() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    found = find_touched_cells(
        points, np.array([[0, 1, 2]]), np.zeros(3), np.full(3, 0.1), [10, 10, 10]
    )
    assert found[1:].sum() == 0
    # the lower half of a chessboard, its diagonal, and what touches that from the other side
    x, y = np.meshgrid(np.arange(10), np.arange(10))
    np.testing.assert_array_equal(found[0], x + y <= 10)


def test_a_carved_cage_contains_the_whole_surface() -> None:
    ring = pv.ParametricTorus(ringradius=1.0, crosssectionradius=0.2)
    cage, grid = cage_of(ring, method="carved", divisions=(9, 9, 3))
    tetrahedra = tetrahedra_of(grid)
    volume = check_mesh(grid.points, tetrahedra)
    whole = np.prod(np.ptp(np.reshape(ring.bounds, (3, 2)), axis=1))
    assert ring.volume < volume < 0.75 * whole  # a hole, and no corners
    assert cage.warnings == ()
    samples = ring.subdivide(1).points
    assert locate(ring.points, grid.points, tetrahedra, "error").outside == 0
    assert locate(samples, grid.points, tetrahedra, "error").outside == 0
    assert recognise_lattice(grid.points, tetrahedra).slots is not None
    # it can be solved: no vertex without a tetrahedron
    solver = ModalSolver(modes=7, fixed="")
    solver.SetInputConnection(cage.GetOutputPort())
    solver.update()
    frequencies = pv.wrap(solver.GetOutputDataObject(0)).field_data["frequencies"]
    assert (frequencies < 1e-3 * frequencies[6]).sum() == 6  # one piece has six rigid modes


def test_margin_and_fill() -> None:
    ball = pv.Sphere(radius=1.0)
    count = [
        cage_of(ball, method="carved", divisions=(8, 8, 8), **values)[1].n_cells // 5
        for values in ({"fill": False}, {}, {"margin": 1}, {"margin": 2})
    ]
    assert count == sorted(set(count))
    _, grid = cage_of(ball, method="carved", divisions=(8, 8, 8), margin=1)
    # no point of the ball is nearer to the outside than a hexahedron
    inner, outer = locate(1.24 * ball.points, grid.points, tetrahedra_of(grid)), None
    assert inner.outside == 0
    outer = locate(1.9 * ball.points, grid.points, tetrahedra_of(grid))
    assert outer.outside == ball.n_points


def test_each_piece_is_reported() -> None:
    two = pv.Sphere(radius=0.5).merge(pv.Sphere(radius=0.5, center=(3, 0, 0)))
    cage, _ = cage_of(two, method="carved", divisions=(8, 2, 2))
    assert (
        "2 separate pieces of 8, 8 hexahedra; pieces that are not fixed move separately"
        in cage.warnings[0]
    )
    cage, _ = cage_of(two, method="carved", divisions=(8, 2, 2), margin=2)
    assert cage.warnings == ()
    diagonal = pv.PolyData(np.array([[0.2, 0.2, 0], [0.8, 0.8, 0], [0, 0, 1], [1, 1, 1.0]]))
    cage, _ = cage_of(diagonal, method="carved", divisions=(2, 2, 1))
    assert (
        "2 separate pieces of 1, 1 hexahedra; 1 of them are joined only by an edge"
        in cage.warnings[0]
    )


def test_points_outside_are_reported_with_count_and_distance() -> None:
    ball = pv.Sphere(radius=1.0)
    _, grid = cage_of(pv.Sphere(radius=0.9), method="carved", divisions=(12, 12, 12))
    add_array(grid.GetPointData(), "displacement", np.zeros((grid.n_points, 3)))
    warp = BarycentricWarp()
    warp.SetInputDataObject(0, ball)
    warp.SetInputDataObject(1, grid)
    warp.update()
    assert " %) lie outside the cage, by up to " in warp.warnings[0]
    assert 'with cage.inflate = "' in warp.warnings[0]


# --- tetwild -----------------------------------------------------------------------------------

# fTetWild takes the longer the fewer tetrahedra it may make: a quarter of a cube's edge is soonest.


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_surface_is_filled_once(cache: Path) -> None:
    pytest.importorskip("pytetwild")
    part = pv.Cube(x_length=2.0).triangulate()
    _, first = cage_of(part, method="tetwild", edge_length=0.5)
    assert check_mesh(first.points, tetrahedra_of(first)) == pytest.approx(2.0, rel=0.02)
    _, again = cage_of(part, method="tetwild", edge_length=0.5)
    np.testing.assert_array_equal(again.points, first.points)
    np.testing.assert_array_equal(tetrahedra_of(again), tetrahedra_of(first))
    assert len(list(cache.glob("*"))) == 1
    _, finer = cage_of(part, method="tetwild", edge_length=0.35)
    assert finer.n_cells > first.n_cells
    assert len(list(cache.glob("*"))) == 2
    # a damaged file is made again
    for file in cache.glob("*"):
        file.write_bytes(b"PK")
    _, third = cage_of(part, method="tetwild", edge_length=0.5)
    assert check_mesh(third.points, tetrahedra_of(third)) == pytest.approx(2.0, rel=0.02)


@pytest.mark.nightly
def test_a_ball_is_enclosed_with_its_mass_and_lambs_frequencies(cache: Path) -> None:
    pytest.importorskip("pytetwild")
    ball = pv.Sphere(radius=0.05, theta_resolution=20, phi_resolution=20)
    cage, grid = cage_of(ball, method="tetwild", order=2)
    assert cage.warnings == ()
    tetrahedra = tetrahedra_of(grid)
    volume = check_mesh(grid.points, tetrahedra, closed=False)
    assert ball.volume < volume < 1.03 * ball.volume
    # Nothing leaves the ball's box, so that flat sides stay flat: a few near its poles may.
    where = locate(ball.points, grid.points, tetrahedra)
    assert where.outside < 0.03 * ball.n_points
    assert where.largest_distance < 1e-3 * ball.length
    modal = ModalSolver(youngs_modulus=210e9, density=7850.0, modes=12, fixed="")
    modal.SetInputConnection(cage.GetOutputPort())
    modal.update()
    solved = pv.wrap(modal.GetOutputDataObject(0))
    assert solved["nodal_mass"].sum() == pytest.approx(7850.0 * ball.volume, rel=1e-6)
    # H. Lamb, Proc. London Math. Soc. 13 (1882): ω R / c = 2.501, twisted against itself
    radius, speed = np.cbrt(0.75 / np.pi * ball.volume), np.sqrt(210e9 / 2.6 / 7850.0)
    lamb = 2.501 * speed / (2 * np.pi * radius)
    np.testing.assert_allclose(solved.field_data["frequencies"][6:11], lamb, rtol=0.012)


def test_enclosing_points_moves_only_necessary_vertices() -> None:
    corners = pv.Icosahedron(radius=1.0)
    vertices = np.concatenate((np.zeros((1, 3)), corners.points)).astype(float)
    tetrahedra = repair_tetrahedra(vertices, np.insert(corners.regular_faces + 1, 0, 0, axis=1))[0]
    ball = pv.Icosphere(radius=1.0, nsub=3).points.astype(float)
    box = 3.0 * np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
    held = enclose_points(np.concatenate((ball, box)), vertices, tetrahedra, 0.25)
    check_mesh(held, tetrahedra)
    assert locate(ball, held, tetrahedra, "error").outside == 0
    # by as much as the middles of its faces are too near; what is too far away counts for nothing
    inside = np.sqrt((5 + 2 * np.sqrt(5)) / 15)
    np.testing.assert_allclose(np.linalg.norm(held[1:], axis=1), 1 / inside, rtol=0.02)
    # on one side alone
    held = enclose_points(np.concatenate((ball[ball[:, 2] > 0.9], box)), vertices, tetrahedra, 0.25)
    low = vertices[:, 2] < 0.0
    np.testing.assert_array_equal(held[low], vertices[low])
    assert (np.linalg.norm(held[1:], axis=1) > 1.001).any()


def test_flat_sides_stay_flat_when_points_are_enclosed() -> None:
    """A prism of six corners in a round bar; one whose cell would turn over stays as it is."""
    vertices, tetrahedra = build_lattice((-0.7, 0.7, -0.7, 0.7, 0.0, 1.0), (2, 2, 2))
    bar = pv.Cylinder(center=(0, 0, 0.5), direction=(0, 0, 1), radius=1.0, resolution=40).points
    held = enclose_points(bar.astype(float), vertices, tetrahedra, 1.0)
    for side in (0.0, 1.0):
        on = vertices[:, 2] == side
        np.testing.assert_array_equal(held[on, 2], side)
    assert (np.abs(held) <= 1.0).all()
    check_mesh(held, tetrahedra)
    deep = enclose_points(np.array([[0.0, 0.0, 9.0], [1.0, 1.0, 0.5]]), vertices, tetrahedra, 99.0)
    check_mesh(deep, tetrahedra)


def test_enclosed_share_of_a_cage() -> None:
    one = pv.Cube().triangulate()
    two = one.merge(one.translate((0.5, 0.0, 0.0)))
    for mesh, made in ((one, 0.98), (two, 1.45)):
        # of what crosses itself the tetrahedra know
        share = enclosed_share(mesh.points, mesh.regular_faces, made, 2.0, 0.01)
        assert share == pytest.approx(0.5 if mesh is one else made / 2.0)
    assert enclosed_share(one.points, one.regular_faces[:0], 0.98, 2.0, 0.01) == 0.49


@pytest.mark.nightly
def test_no_files_are_left_in_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither fTetWild's own file, nor, where the cache is off, anything of ours."""
    pytest.importorskip("pytetwild")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SPACEMAP_CACHE", "off")
    part = pv.Cube().triangulate()
    assert cage_of(part, method="tetwild", edge_length=0.25)[1].n_cells
    assert list(tmp_path.iterdir()) == []


def test_cancelling_ends_the_process_of_ftetwild(tmp_path: Path) -> None:
    pytest.importorskip("pytetwild")
    program = "import sys, numpy as np; from spacemap_vtk.cage import tetwild\n"
    program += "tetwild._PROGRAM = 'import time; time.sleep(60)'  # a large surface\n"
    program += "tetwild.fill_surface(np.eye(3), np.array([[0, 1, 2]]), 0.1)"
    given = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", program], env=given) as process:
        try:
            end = time.monotonic() + 300
            while not (child := _child(process.pid)):
                assert time.monotonic() < end
                time.sleep(0.02)
            process.terminate()
            assert process.wait(300) == 143
        finally:
            process.kill()
    assert list(tmp_path.iterdir()) == []
    # The child was killed. Its new parent may let it remain as a zombie (Z) for any time.
    end = time.monotonic() + 300
    while _state(child) not in ("", "Z"):
        assert time.monotonic() < end
        time.sleep(0.02)


def _state(process: str) -> str:
    """Return the letter of a process's state in Linux; empty if it is gone."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2][:1]
    except OSError:
        return ""


def _child(process: int) -> str | None:
    """Return, in Linux's own words, the child that has begun its work."""
    started = (path.read_text() for path in Path(f"/proc/{process}/task").glob("*/children"))
    for child in " ".join(started).split():
        words = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        if words[2:3] == [b"import time; time.sleep(60)"]:
            return child
    return None


def test_ftetwild_needs_no_pyvista() -> None:
    pytest.importorskip("pytetwild")
    code = tetwild._PROGRAM.partition("given")[0] + "print('pyvista' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_crash_of_ftetwild_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pytetwild")
    monkeypatch.setattr(tetwild, "_PROGRAM", "import os; os.abort()")
    with pytest.raises(GeometryError, match=r"its process ended with code -6.*inflate"):
        cage_of(pv.Cube().triangulate(), method="tetwild", edge_length=0.6)


def crossed_planes() -> pv.PolyData:
    """Return two squares, open and thin, that cross each other."""
    one = pv.Plane(i_size=1.0, j_size=1.0)
    return one.merge(one.rotate_x(60).rotate_z(20))


def test_an_envelope_encloses_open_crossed_and_thin_surfaces() -> None:
    crossed = crossed_planes()
    shape = extract_outline(crossed, polygons_of(crossed))
    low, high = shape[0].min(axis=0), shape[0].max(axis=0)
    points, triangles = make_envelope(low, high, partial(find_touched_cells, *shape), 0.2)
    skin = pv.PolyData.from_regular_faces(points, triangles)
    assert skin.is_manifold
    away = pv.PolyData(shape[0]).compute_implicit_distance(skin)["implicit_distance"]
    assert np.abs(away).min() >= 0.2
    assert np.abs(away).max() <= 0.7


@pytest.mark.nightly
def test_the_envelope_of_open_crossed_and_thin_surfaces_is_filled(cache: Path) -> None:
    pytest.importorskip("pytetwild")
    crossed = crossed_planes()
    shape = extract_outline(crossed, polygons_of(crossed))
    cage, grid = cage_of(crossed, method="tetwild", inflate=0.1, edge_length=0.25)
    assert cage.warnings == ()
    check_mesh(grid.points, tetrahedra_of(grid))
    assert locate(shape[0], grid.points, tetrahedra_of(grid), "error").outside == 0


def test_surfaces_that_cannot_be_filled(cache: Path) -> None:
    pytest.importorskip("pytetwild")
    with pytest.raises(GeometryError, match=r"cage.inflate.*no surface to fill.*inflate"):
        cage_of(pv.Line(), method="tetwild")
    cup = pv.Sphere(theta_resolution=12, phi_resolution=12).clip("z")
    cage, _ = cage_of(cup, method="tetwild", edge_length=0.25)
    assert "open edges" in cage.warnings[0]


@pytest.mark.nightly
def test_surfaces_that_cross_themselves_or_branch(cache: Path) -> None:
    pytest.importorskip("pytetwild")
    one = pv.Cube().triangulate()
    crossing = one.merge(one.translate((0.5, 0.3, 0.2)))
    cage, grid = cage_of(crossing, method="tetwild", edge_length=0.25)
    assert cage.warnings == ()
    # the union of both
    union = 2.0 - 0.5 * 0.7 * 0.8
    assert check_mesh(grid.points, tetrahedra_of(grid)) == pytest.approx(union, rel=0.05)
    fin = one.merge(pv.Triangle([[0.5, -0.5, 0.5], [0.5, 0.5, 0.5], [1.0, 0.0, 0.5]]))
    cage, grid = cage_of(fin, method="tetwild", edge_length=0.25)
    assert "2 open edges and 1 branching edges" in cage.warnings[0]
    volume = check_mesh(grid.points, tetrahedra_of(grid))
    assert volume == pytest.approx(1.0, rel=0.05)


@pytest.mark.nightly
def test_parts_joined_only_by_an_edge_get_an_envelope(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two bars whose surfaces meet in an edge: one hangs by the other, and nothing turns."""
    pytest.importorskip("pytetwild")
    monkeypatch.setattr("spacemap_vtk.datasets.outline._MOST_VOXELS", 30)  # fewer take less time
    one = pv.Cube(x_length=1.0, y_length=1.0, z_length=1.0).triangulate()
    bars = one.merge(one.translate((1.0, 1.0, 0.0)))
    cage, grid = cage_of(bars, method="tetwild", edge_length=0.35)
    _, parts, larger = cage.warnings
    assert "encloses 2 parts" in parts
    assert "cage.inflate" in parts
    assert "times that of the object" in larger
    share = filled_share(grid)
    assert share * check_mesh(grid.points, tetrahedra_of(grid)) == pytest.approx(2.0, rel=1e-5)
    tetrahedra = tetrahedra_of(grid)
    assert split.count_parts(tetrahedra) == ([len(tetrahedra)], 1)
    assert locate(bars.points, grid.points, tetrahedra, "error").outside == 0
    # Of the side at -x fTetWild may leave a single vertex.
    modal = ModalSolver(fixed="box(-1, -0.2, -1, 1, -1, 1)", modes=3)
    modal.SetInputConnection(cage.GetOutputPort())
    modal.update()
    frequencies = pv.wrap(modal.GetOutputDataObject(0)).field_data["frequencies"]
    assert frequencies.min() > 0.01 * frequencies.max()
    # Bodies that do not touch are two cages, and stay as they are.
    apart = one.merge(one.translate((3.0, 0.0, 0.0)))
    cage, grid = cage_of(apart, method="tetwild", edge_length=0.5)
    assert cage.warnings == ()
    assert check_mesh(grid.points, tetrahedra_of(grid)) == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(
    ("second", "expected"),
    [([1, 2, 3, 4], ([2], 1)), ([2, 3, 4, 5], ([1, 1], 1)), ([3, 4, 5, 6], ([1, 1], 1))],
    ids=["face", "edge", "vertex"],
)
def test_parts_are_connected_by_faces(second: list[int], expected: object) -> None:
    assert split.count_parts(np.array([[0, 1, 2, 3], second])) == expected
    away = np.array([[0, 1, 2, 3], second, [7, 8, 9, 10]])
    assert split.count_parts(away) == ([*expected[0], 1], 2)


def test_an_object_with_points_that_are_not_finite() -> None:
    ball = pv.Sphere()
    ball.points[5] = np.nan
    for method in ("carved", "tetwild"):
        with pytest.raises(GeometryError, match="point 5 of the object is not finite"):
            cage_of(ball, method=method)
