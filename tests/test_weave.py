"""Weave geometry: Bézier tubes that touch, never overlap, and stay round and smooth."""

from __future__ import annotations

import doctest
import tracemalloc
from functools import cache
from math import pi, sqrt
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import mutable, vtkPoints
from vtkmodules.vtkCommonDataModel import (
    VTK_BEZIER_QUADRILATERAL,
    vtkCellArray,
    vtkUnstructuredGrid,
)
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
from weaves import PLACES, bernstein, changed, measured, plain, scaled, surface, woven

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.geometry import arcs, axis_parts, cloth_axes, section, sweep, weave
from spacemap_vtk.textile.geometry.cloth_axes import sample_axes
from spacemap_vtk.textile.geometry.weave import Weave, build_weave
from spacemap_vtk.textile.weave import cloth, figures, threads
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import feasible_height

MM = 1e-3
#: Control points in a ring of a round yarn.
RING = 12
#: Cut ends stay open here: caps have tests of their own.
SQUARE = measured(
    warp_diameter=0.25 * MM,
    weft_diameter=0.25 * MM,
    warp_spacing=0.6 * MM,
    weft_spacing=0.6 * MM,
    caps=False,
)
UNEQUAL = measured(
    warp_diameter=0.25,
    weft_diameter=0.30,
    warp_spacing=0.55,
    weft_spacing=0.60,
    warp_crimp_height=0.20,
    caps=False,
)
#: All crimp in the warp, whose arcs turn by nearly 90 degrees.
STEEP = measured(
    warp_diameter=0.2,
    weft_diameter=0.3,
    warp_spacing=0.7,
    weft_spacing=0.501,
    warp_crimp_height=0.5,
    caps=False,
)
JAMMED = measured(
    warp_diameter=0.1,
    weft_diameter=0.1,
    warp_spacing=0.1 * sqrt(3),
    weft_spacing=0.1 * sqrt(3),
    caps=False,
)
CLOTHS = {"square": SQUARE, "unequal": UNEQUAL, "steep": STEEP, "jammed": JAMMED}
DRAWDOWNS = {
    "plain": plain(5, 4),
    "twill": tile_drawdown(patterns.twill(2, 1), 5, 6),
    "satin": tile_drawdown(patterns.satin(5, 2), 6, 7),
    "basket": tile_drawdown(patterns.basket(2), 5, 5),
    "all up": np.ones((3, 4), dtype=bool),
    "one": np.ones((1, 1), dtype=bool),
}
ALL = [(d, c) for d in DRAWDOWNS for c in CLOTHS]


@cache
def built(drawdown: str, cloth: str) -> Weave:
    return build_weave(changed(CLOTHS[cloth], drawdown=DRAWDOWNS[drawdown]))


def expected_lengths(drawdown: np.ndarray, cloth: Cloth) -> np.ndarray:
    result = []
    for side, family in zip((drawdown.T, drawdown), cloth.families, strict=True):
        changes = np.count_nonzero(np.diff(side.astype(int), axis=1), axis=1)
        float_length = (side.shape[1] - 1 - changes) * family.crossed
        result.append(changes * family.crimp.length + float_length + 2 * family.overhang)
    return np.concatenate(result)


@pytest.mark.parametrize(
    "module", [arcs, cloth_axes, axis_parts, cloth, figures, section, sweep, threads, weave]
)
def test_examples(module: ModuleType) -> None:
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize(("size", "parts"), [(7, 280), (100, 59_800)])
def test_counts_of_plain_weave(size: int, parts: int) -> None:
    made = build_weave(changed(SQUARE, drawdown=plain(size, size)))
    assert made.patches.shape == (4 * parts, 16)
    assert made.points.shape == (12 * (3 * parts + 2 * size), 3)
    used = np.bincount(made.patches.ravel())
    assert len(used) == len(made.points)
    assert used.all()
    assert (np.bincount(made.yarn) == 4 * parts / (2 * size)).all()
    assert np.array_equal(made.family, made.yarn >= size)
    assert made.points.dtype == np.float64
    assert made.patches.dtype == np.int32
    assert made.yarn.dtype == np.int32
    assert made.family.dtype == np.uint8


@pytest.mark.parametrize(("drawdown", "cloth"), ALL)
def test_control_points_are_shared_inside_a_yarn(drawdown: str, cloth: str) -> None:
    made = built(drawdown, cloth)
    yarns = sum(DRAWDOWNS[drawdown].shape)
    assert len(made.points) == RING * (3 * len(made.patches) // 4 + yarns)
    used = np.bincount(made.patches.ravel())
    assert len(used) == len(made.points)
    assert used.all()
    assert np.array_equal(np.unique(made.yarn), np.arange(yarns))
    first, last = np.full(yarns, len(made.points)), np.full(yarns, -1)
    np.minimum.at(first, made.yarn, made.patches.min(axis=1))
    np.maximum.at(last, made.yarn, made.patches.max(axis=1))
    assert (first[1:] == last[:-1] + 1).all()
    # no two points of a yarn coincide: nothing is degenerate, not even at exact jam
    for begin, end in zip(first, last, strict=True):
        points = made.points[begin : end + 1]
        assert cKDTree(points).count_neighbors(cKDTree(points), 1e-3 * made.points.max() / 20) == (
            len(points)
        )


@pytest.mark.parametrize(("drawdown", "cloth"), ALL)
def test_surface_lies_on_the_tube(drawdown: str, cloth: str) -> None:
    made, families = built(drawdown, cloth), CLOTHS[cloth].families
    points, _, _ = surface(made, np.linspace(0, 1, 7))
    axis, owner = sample_axes(changed(CLOTHS[cloth], drawdown=DRAWDOWNS[drawdown]), samples=90)
    for yarn in range(owner[-1] + 1):
        mine = made.yarn == yarn
        radius = families[made.family[mine][0]].diameter / 2
        distance = cKDTree(axis[owner == yarn]).query(points[mine])[0] / radius - 1
        # the axis is sampled: it seems a little further than it is
        assert distance.max() < made.radial_error + 2e-4
        assert distance.min() > -made.radial_error
        # corners of the patches are on it exactly, above a station of the axis
        assert abs(distance[:, ::6, ::6]).max() < 1e-12
    assert abs(distance).max() > 2e-4
    assert made.radial_error < 4e-4


@pytest.mark.parametrize(("drawdown", "cloth"), ALL)
def test_tangents_are_continuous(drawdown: str, cloth: str) -> None:
    made = built(drawdown, cloth)
    net = made.points[made.patches][:, PLACES]
    before, after = made.patches[:-4], made.patches[4:]
    follows = made.yarn[:-4] == made.yarn[4:]
    assert np.array_equal(before[follows][:, [1, 2]], after[follows][:, [0, 3]])
    arrive = (net[:-4, 3] - net[:-4, 2])[follows]
    leave = (net[4:, 1] - net[4:, 0])[follows]
    for end in (arrive, leave):
        end /= np.linalg.norm(end, axis=-1, keepdims=True)
    assert abs(arrive - leave).max(initial=0) < 1e-11
    # round the yarn: each quarter goes on into the next
    rings = made.points.reshape(-1, RING, 3)
    arrive, leave = rings[:, [0, 3, 6, 9]] - rings[:, [11, 2, 5, 8]], rings[:, [1, 4, 7, 10]]
    leave = leave - rings[:, [0, 3, 6, 9]]
    assert abs(arrive - leave).max() < 1e-12 * abs(made.points).max()


@pytest.mark.parametrize(("drawdown", "cloth"), ALL)
def test_normals_point_outwards(drawdown: str, cloth: str) -> None:
    made = built(drawdown, cloth)
    t = np.linspace(0, 1, 5)
    points, du, dv = surface(made, t)
    rings = made.points.reshape(-1, RING, 3)
    first = made.patches[:, 0] // RING
    centres = np.stack([(rings[first + k, 0] + rings[first + k, 6]) / 2 for k in range(4)], axis=1)
    middle = np.einsum("ui,pic->puc", bernstein(t)[0], centres)[:, :, None]
    normal = np.cross(du, dv)
    size = np.linalg.norm(normal, axis=-1)
    assert size.min() > 1e-3 * np.median(size)
    outward = points - middle
    cosine = (normal * outward).sum(-1) / size / np.linalg.norm(outward, axis=-1)
    assert cosine.min() > 0.99


@pytest.mark.parametrize(("drawdown", "cloth"), ALL)
def test_yarns_touch_and_never_overlap(drawdown: str, cloth: str) -> None:
    points, yarn = sample_axes(changed(CLOTHS[cloth], drawdown=DRAWDOWNS[drawdown]), samples=20)
    warp = yarn < DRAWDOWNS[drawdown].shape[1]
    distance = cKDTree(points[warp]).query(points[~warp])[0]
    contact = CLOTHS[cloth].diameter_sum / 2
    assert distance.min() == pytest.approx(contact, rel=1e-12)
    # every crossing is a contact
    assert np.count_nonzero(distance < contact * (1 + 1e-12)) >= DRAWDOWNS[drawdown].size


cloths = st.builds(
    lambda *measures: cloth_of(*measures),
    *[st.floats(0.1, 1)] * 2,
    *[st.floats(1.0, 3)] * 2,
    st.floats(0, 1),
)


def cloth_of(d1: float, d2: float, s1: float, s2: float, share: float) -> Cloth:
    p1, p2 = s1 * d1, s2 * d2
    # stretch the spacings until the cloth can be woven
    for _ in range(60):
        low, high = feasible_height(p1, p2, d1 + d2)
        if low <= high:
            break
        p1, p2 = 1.05 * p1, 1.05 * p2
    return measured(
        warp_diameter=d1,
        weft_diameter=d2,
        warp_spacing=p1,
        weft_spacing=p2,
        warp_crimp_height=low + share * (high - low),
    )


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=6)), cloths)
def test_any_weave_touches_and_never_overlaps(over: np.ndarray, cloth: Cloth) -> None:
    points, yarn = sample_axes(changed(cloth, drawdown=over), samples=12)
    warp = yarn < over.shape[1]
    distance = cKDTree(points[warp]).query(points[~warp])[0]
    assert distance.min() == pytest.approx(cloth.diameter_sum / 2, rel=1e-9)
    made = build_weave(changed(cloth, drawdown=over))
    assert np.isfinite(made.points).all()
    assert made.radial_error < 1e-2
    tallest = max(family.height + family.diameter for family in cloth.families)
    assert 2 * abs(made.points[:, 2]).max() == pytest.approx(tallest, rel=1e-12)


def test_sides_and_directions() -> None:
    over = np.array([[1, 0, 1], [1, 1, 0]], dtype=bool)
    points, yarn = sample_axes(changed(UNEQUAL, drawdown=over), samples=1)
    for end, pick in np.ndindex(3, 2):
        place = (end - 1) * 0.55, (pick - 0.5) * 0.60
        at = np.linalg.norm(points[:, :2] - place, axis=1) < 1e-9
        warp, weft = (points[at & (yarn == y), 2] for y in (end, 3 + pick))
        sign = 1 if over[pick, end] else -1
        assert warp == pytest.approx(sign * 0.10)
        assert weft == pytest.approx(-sign * 0.175)
    for y, fixed in ((0, 0), (3, 1)):
        assert np.ptp(points[yarn == y, fixed]) == 0
        assert (np.diff(points[yarn == y, 1 - fixed]) > 0).all()
    box = np.array([points.min(axis=0), points.max(axis=0)])
    assert box[:, :2] == pytest.approx(np.array([[-0.825, -0.6], [0.825, 0.6]]))


@pytest.mark.parametrize("overhang", [0.0, 0.1, 2.0])
def test_overhang(overhang: float) -> None:
    cloth = changed(SQUARE, overhang=overhang * MM)
    made = build_weave(changed(cloth, drawdown=plain(4, 4)))
    assert len(made.patches) == 4 * 8 * (9 + 2 * (overhang > 0))
    assert made.points[:, 0].max() == pytest.approx((0.9 + max(overhang, 0.125)) * MM)
    points, _ = sample_axes(changed(cloth, drawdown=plain(4, 4)))
    assert points[:, 1].max() == pytest.approx((0.9 + overhang) * MM)
    if overhang == 0:
        with pytest.raises(InputError, match="overhang"):
            build_weave(changed(cloth, drawdown=[[1, 0]]))


@pytest.mark.parametrize("cloth", CLOTHS)
def test_shape_does_not_depend_on_the_unit(cloth: str) -> None:
    over, reference = DRAWDOWNS["twill"], built("twill", cloth)
    for unit in (1e3, 1e6, 1e-3, 1 / 3):
        made = build_weave(changed(scaled(CLOTHS[cloth], unit), drawdown=over))
        assert np.array_equal(made.patches, reference.patches)
        size = abs(reference.points).max()
        assert abs(made.points / unit - reference.points).max() < 1e-12 * size


def test_long_arcs_are_split() -> None:
    assert np.degrees(STEEP.families[0].crimp.theta) == pytest.approx(86.4, abs=0.1)
    made = build_weave(changed(STEEP, drawdown=plain(3, 3)))
    # in a gap of the warp 2 + 1 + 2 parts, of the (straight) weft 1; an overhang at either end
    assert (np.bincount(made.yarn) == 4 * np.array([12] * 3 + [4] * 3)).all()
    # 60 degrees up to rounding are not split, and there is no straight between the arcs
    assert (np.bincount(build_weave(changed(JAMMED, drawdown=plain(3, 3))).yarn) == 4 * 6).all()


def test_arcs_of_different_radii() -> None:
    rng = np.random.default_rng(1)
    gaps, yarns = 12, 5
    arc = rng.uniform(0.1, 0.6, (yarns, gaps + 1))
    height = rng.uniform(-0.2, 0.2, (yarns, gaps + 1))
    height[:, 3:6] = height[:, 2:3]
    bounds = np.cumsum(rng.uniform(1.0, 1.5, gaps + 1))
    one = np.ones((1, len(bounds) - 1))
    laid = arcs.Gaps(bounds[None], np.diff(bounds)[None], height, arc, one)
    path = arcs.build_axes(np.full(yarns, 0.1), np.arange(5.0), laid)
    part = np.arange(len(path.length))
    start = part + path.owner
    for fraction in (0.0, 1.0):
        ends = path.evaluate(part, start, np.full(len(part), fraction))
        for found, array in zip(ends, (path.along, path.height, path.angle), strict=True):
            np.testing.assert_allclose(found, array[start + int(fraction)], rtol=0, atol=1e-14)
    k, last = path.curvature[0], path.last
    assert set(np.round(1 / abs(k[k != 0]), 9)) <= set(np.round(arc.ravel(), 9))
    np.testing.assert_array_equal(path.height[last], height[:, -1])
    assert (np.bincount(np.searchsorted(last, np.flatnonzero(path.angle == 0))) > gaps).all()


def test_flat_families_are_straight() -> None:
    for height in (0.0, 1e-14, 1e-9):
        made = build_weave(changed(UNEQUAL, warp_crimp_height=height, drawdown=plain(4, 4)))
        assert (np.bincount(made.yarn)[:4] == 4 * 5).all()
        assert abs(made.points[made.patches[made.family == 0], 2]).max() < 0.126


def grid_of(made: Weave) -> vtkUnstructuredGrid:
    points, cells, grid = vtkPoints(), vtkCellArray(), vtkUnstructuredGrid()
    points.SetData(numpy_to_vtk(made.points))
    # deep: vtkCellArray of VTK 9.2 takes the memory, but not the array that keeps it alive
    cells.SetData(
        numpy_to_vtkIdTypeArray(np.arange(0, made.patches.size + 1, 16), deep=True),
        numpy_to_vtkIdTypeArray(made.patches.ravel().astype(np.int64), deep=True),
    )
    grid.SetPoints(points)
    grid.SetCells(VTK_BEZIER_QUADRILATERAL, cells)
    return grid


@pytest.mark.parametrize(("drawdown", "cloth"), [("twill", "unequal"), ("plain", "steep")])
def test_vtk_sees_the_same_tubes(drawdown: str, cloth: str) -> None:
    made = built(drawdown, cloth)
    grid = grid_of(made)
    points, _, _ = surface(made, np.array([0.2, 0.7]))
    for patch in range(0, len(made.patches), 37):
        location, weights = [0.0] * 3, [0.0] * 16
        grid.GetCell(patch).EvaluateLocation(mutable(0), (0.7, 0.2, 0.0), location, weights)
        np.testing.assert_allclose(location, points[patch, 1, 0], atol=1e-14)

    tessellator = vtkDataSetSurfaceFilter()
    tessellator.SetNonlinearSubdivisionLevel(3)
    tessellator.PassThroughCellIdsOn()
    tessellator.SetInputData(grid)
    tessellator.Update()
    result = tessellator.GetOutput()
    vertices = vtk_to_numpy(result.GetPoints().GetData()).astype(float)
    triangles = vtk_to_numpy(result.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    a, b, c = vertices[triangles.T]
    patch = vtk_to_numpy(result.GetCellData().GetArray("vtkOriginalCellIds"))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    by_yarn = np.bincount(made.yarn[patch], weights=area)
    # by Pappus the area of a tube is its axis' length times its girth; chords lose (pi/32)**2 / 6
    family = made.family[np.unique(made.yarn, return_index=True)[1]]
    diameter = np.array([f.diameter for f in CLOTHS[cloth].families])[family]
    lengths = by_yarn / (pi * diameter)
    np.testing.assert_allclose(
        lengths, expected_lengths(DRAWDOWNS[drawdown], CLOTHS[cloth]), rtol=3e-3
    )
    assert abs(lengths / expected_lengths(DRAWDOWNS[drawdown], CLOTHS[cloth]) - 1).min() > 1e-4


@pytest.mark.parametrize(("drawdown", "cloth"), ALL)
def test_areas_by_quadrature(drawdown: str, cloth: str) -> None:
    made = built(drawdown, cloth)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    _, du, dv = surface(made, (nodes + 1) / 2)
    element = np.linalg.norm(np.cross(du, dv), axis=-1)
    area = np.einsum("puv,u,v->p", element, weights / 2, weights / 2)
    family = made.family[np.unique(made.yarn, return_index=True)[1]]
    diameter = np.array([f.diameter for f in CLOTHS[cloth].families])[family]
    np.testing.assert_allclose(
        np.bincount(made.yarn, weights=area) / (pi * diameter),
        expected_lengths(DRAWDOWNS[drawdown], CLOTHS[cloth]),
        rtol=4e-4,
    )


@pytest.mark.parametrize("kind", ["plain", "steep", "float"])
def test_memory_is_estimated_from_above(kind: str) -> None:
    over = plain(60, 40) if kind != "float" else np.ones((40, 60), dtype=bool)
    cloth = changed(STEEP if kind == "steep" else SQUARE, drawdown=over)
    tracemalloc.start()
    build_weave(cloth)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    estimate = weave.estimate_bytes(cloth)
    assert peak < estimate
    assert estimate < 2.0 * peak


@given(woven())
def test_counts_are_those_of_what_is_built(cloth: Cloth) -> None:
    made = build_weave(cloth)
    built = len(made.points), len(made.patches)
    counts, error = weave.count_patches(cloth)
    assert counts[:2] == built
    assert error <= made.radial_error * (1 + 1e-12)
    above = weave.estimate_counts(cloth)
    assert above.points >= built[0]
    assert above.patches >= built[1]
    assert above.estimate_bytes(cloth.exact) <= weave.estimate_bytes(cloth)


@pytest.mark.parametrize("pattern", ["plain", "twill", "satin"])
@pytest.mark.parametrize("change", [{}, {"axis": "spline"}, {"exact": True}, {"caps": True}])
def test_counts_of_like_yarns_are_estimated_exactly(pattern: str, change: dict) -> None:
    over = {
        "plain": plain(31, 17),
        "twill": tile_drawdown(patterns.twill(3, 1), 31, 17),
        "satin": tile_drawdown(patterns.satin(8, 3), 31, 17),
    }[pattern]
    for measures in (SQUARE, UNEQUAL, STEEP):
        whole = changed(measures, drawdown=over, **change)
        made = build_weave(whole)
        found = weave.estimate_counts(whole)
        assert found[:2] == (len(made.points), len(made.patches))


def test_figures_of_plain_weave() -> None:
    found = figures.fabric_figures(changed(UNEQUAL, drawdown=plain(7, 5), density=1000.0))
    assert (found["ends"], found["picks"]) == (7, 5)
    warp, weft = found["warp"], found["weft"]
    assert warp["theta_deg"] == pytest.approx(22.097356, abs=5e-7)
    assert weft["theta_deg"] == pytest.approx(50.033787, abs=5e-7)
    assert warp["length"] == pytest.approx(0.63638346, abs=5e-9)
    assert weft["crimp"] == pytest.approx(0.236891, abs=5e-7)
    assert weft["mean_crimp"] == pytest.approx(weft["crimp"], rel=1e-14)
    assert (warp["height"], weft["height"]) == pytest.approx((0.20, 0.35))
    assert found["thickness"] == pytest.approx(0.65)
    assert (warp["cover"], weft["cover"]) == pytest.approx((0.25 / 0.55, 0.5))
    assert found["cover"] == pytest.approx(1 - (1 - 0.25 / 0.55) * 0.5)
    lengths = expected_lengths(plain(7, 5), UNEQUAL)
    assert warp["yarn_length"] == pytest.approx(lengths[:7].sum())
    assert weft["yarn_length"] == pytest.approx(lengths[7:].sum())
    # one repeat, two by two: two lengths of each of two yarns
    volume = pi / 4 * (4 * warp["length"] * 0.25**2 + 4 * weft["length"] * 0.30**2)
    area = 4 * 0.55 * 0.60
    assert found["areal_mass"] == pytest.approx(1000 * volume / area)
    assert found["volume_fraction"] == pytest.approx(volume / area / 0.65)


def test_figures_count_floats() -> None:
    over = tile_drawdown(patterns.twill(3, 1), 9, 9)
    found = figures.fabric_figures(changed(SQUARE, drawdown=over))
    assert found["areal_mass"] is None
    assert found["warp"]["mean_crimp"] == pytest.approx(found["warp"]["crimp"] / 2)
    total = expected_lengths(over, SQUARE).sum()
    assert sum(found[f]["yarn_length"] for f in ("warp", "weft")) == pytest.approx(total)
    alone = figures.fabric_figures(changed(SQUARE, drawdown=[[1]]))
    assert alone["warp"]["mean_crimp"] == 0
    assert alone["warp"]["yarn_length"] == pytest.approx(0.6 * MM)


def test_refusals() -> None:
    for bad in (np.ones(3), np.ones((0, 2)), 1):
        with pytest.raises(InputError, match="drawdown"):
            build_weave(changed(SQUARE, drawdown=bad))
    measures = dict.fromkeys(("warp_diameter", "weft_diameter"), 0.15 * MM)
    measures |= dict.fromkeys(("warp_spacing", "weft_spacing"), 0.27 * MM)
    with pytest.raises(GeometryError, match=r"allowed: 0\.1307\d* mm to 0\.1692\d* mm"):
        measured(**measures, warp_crimp_height=0.2 * MM).check()
    measures |= dict.fromkeys(("warp_spacing", "weft_spacing"), 0.2 * MM)
    with pytest.raises(GeometryError, match="jammed at every"):
        measured(**measures).check()
