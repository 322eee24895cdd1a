"""Closed yarns: caps and rational patches, compared with closed forms and with VTK."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given
from test_weave import grid_of
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import mutable
from weaves import changed, measured, surface, woven

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.geometry.cloth_axes import cloth_axes, sample_axes
from spacemap_vtk.textile.geometry.weave import Weave, build_weave
from spacemap_vtk.textile.patches import bezier
from spacemap_vtk.textile.patches.bezier import rational_handles
from spacemap_vtk.textile.patches.tessellation import Tessellation
from spacemap_vtk.textile.weave.cloth import Cloth

OVER = tile_drawdown(patterns.twill(2, 1), 4, 5)
ROUND = measured(
    drawdown=OVER,
    warp_diameter=0.25,
    weft_diameter=0.30,
    warp_spacing=0.55,
    weft_spacing=0.60,
    warp_crimp_height=0.20,
)
#: All crimp in the warp, whose arcs turn by nearly 90 degrees.
STEEP = measured(
    drawdown=OVER,
    warp_diameter=0.2,
    weft_diameter=0.3,
    warp_spacing=0.7,
    weft_spacing=0.501,
    warp_crimp_height=0.5,
)
FLAT = measured(
    drawdown=OVER,
    warp_diameter=0.25,
    weft_diameter=0.30,
    warp_spacing=0.75,
    weft_spacing=0.80,
    warp_section="elliptic",
    warp_aspect=1.4,
    weft_section="racetrack",
    weft_aspect=1.5,
)
CLOTHS = {"round": ROUND, "steep": STEEP, "flat": FLAT}
AREAS = {
    "round": (pi / 4 * 0.25**2, pi / 4 * 0.30**2),
    "steep": (pi / 4 * 0.2**2, pi / 4 * 0.3**2),
    "flat": (pi / 4 * 0.25 * 0.35, pi / 4 * 0.30**2 + 0.30 * 0.15),
}


def volumes(weave: Weave, nodes: int = 24) -> np.ndarray:
    """Volume inside each yarn, by the divergence theorem: wrong if a patch is missing."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    points, du, dv = surface(weave, (x + 1) / 2)
    flux = np.einsum("puvc,puvc,u,v->p", points, np.cross(du, dv), w / 2, w / 2)
    return np.bincount(weave.yarn, weights=flux / 3)


def lengths(cloth: Cloth) -> np.ndarray:
    return np.concatenate(
        [
            np.add.reduceat(family.length, np.cumsum(family.parts) - family.parts)
            for family in cloth_axes(cloth)
        ]
    )


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("kind", CLOTHS)
def test_yarn_surfaces_are_closed_and_have_the_exact_volume(kind: str, exact: bool) -> None:
    """By Pappus the volume of a tube is its section times its length."""
    cloth = changed(CLOTHS[kind], exact=exact)
    found = volumes(build_weave(cloth))
    expected = lengths(cloth) * np.repeat(AREAS[kind], [4, 5])
    np.testing.assert_allclose(found, expected, rtol=1e-12 if exact else 1e-3)
    if not exact:
        assert abs(found / expected - 1).max() > 1e-6


@pytest.mark.parametrize("kind", CLOTHS)
def test_caps_share_the_points_of_their_ring(kind: str) -> None:
    weave = build_weave(CLOTHS[kind])
    bare = build_weave(changed(CLOTHS[kind], caps=False))
    tubes = weave.tube_patches
    assert np.array_equal(weave.patches[:tubes], bare.patches)
    assert np.array_equal(weave.points[: len(bare.points)], bare.points)
    # an edge of a patch is shared by two, or collapsed into a pole
    corners = weave.patches[:, [[0, 4, 5, 1], [1, 6, 7, 2], [3, 8, 9, 2], [0, 10, 11, 3]]]
    edges = corners.reshape(-1, 4)
    poles = edges[(edges == edges[:, :1]).all(axis=1)]
    edges = edges[(edges != edges[:, :1]).any(axis=1)]
    ordered = np.where((edges[:, 0] < edges[:, 3])[:, None], edges, edges[:, ::-1])
    _, count = np.unique(ordered, axis=0, return_counts=True)
    assert (count == 2).all()
    assert len(poles) == 2 * 2 * 9
    # patches of one yarn only
    of_point = np.full(len(weave.points), -1)
    of_point[weave.patches] = weave.yarn[:, None]
    assert np.array_equal(of_point[weave.patches], np.repeat(weave.yarn[:, None], 16, axis=1))


@given(woven(most=3))
def test_caps_are_flat_and_face_outwards(cloth: Cloth) -> None:
    weave = build_weave(cloth)
    assert len(build_weave(changed(cloth, caps=False)).patches) == weave.tube_patches
    tessellation = Tessellation(weave.patches, (3, 3), 3)
    positions, normals = tessellation.evaluate(weave.points, np.float64)
    assert np.isfinite(positions).all()
    assert np.isfinite(normals).all()
    # the same order of samples as the quads'
    first = tessellation.quads.reshape(-1, 9, 4)[weave.tube_patches :]
    for patch, quads in enumerate(first, start=weave.tube_patches):
        along = 1 - weave.family[patch]
        place = positions[quads.ravel()]
        assert np.ptp(place[:, along]) <= 1e-12 * abs(weave.points).max()
        outwards = np.sign(place[0, along])
        np.testing.assert_allclose(normals[quads.ravel()][:, along], outwards, rtol=0, atol=1e-6)


def test_shortest_ends_are_closed() -> None:
    cloth = changed(FLAT, overhang=0.0)
    weave = build_weave(cloth)
    assert np.isfinite(weave.points).all()
    expected = lengths(cloth) * np.repeat(AREAS["flat"], [4, 5])
    np.testing.assert_allclose(volumes(weave), expected, rtol=1e-3)
    # a single crossing, cut on the flat of the yarn crossed
    short = changed(FLAT, overhang=0.05)
    weave = build_weave(changed(short, drawdown=[[1]]))
    assert weave.points[:, 1].max() == pytest.approx(0.225)
    np.testing.assert_allclose(volumes(weave), 0.1 * np.array(AREAS["flat"]), rtol=1e-3)


@pytest.mark.parametrize("kind", CLOTHS)
def test_rational_patches_lie_exactly_on_the_tube(kind: str) -> None:
    """Every point of the surface is at the radius from the axis, to rounding."""
    cloth = changed(CLOTHS[kind], exact=True)
    weave = build_weave(cloth)
    assert weave.radial_error == 0.0
    points, *_ = surface(weave, np.linspace(0, 1, 7), slice(0, weave.tube_patches))
    aspect = cloth.warp.aspect, cloth.weft.aspect
    for number, family in enumerate(cloth_axes(cloth)):
        # seen from each part's own arc: its centre, and the distance from it
        part = np.arange(len(family.length))
        station = part + family.owner
        along, height, angle = (x[station] for x in (family.along, family.height, family.angle))
        mine = points[weave.family[: weave.tube_patches] == number]
        mine = mine.reshape(len(part), -1, 3)
        k = family.curvature[0][:, None]
        du = mine[..., 1 - number] - along[:, None]
        dz = mine[..., 2] - height[:, None]
        t, n = np.cos(angle)[:, None], np.sin(angle)[:, None]
        # above the axis, measured from the arc's centre: k q**2 / (1 + sqrt) without cancelling
        x, y = du * t + dz * n, dz * t - du * n
        above = (2 * y - k * (x * x + y * y)) / (
            1 + np.sqrt(1 - 2 * k * y + k * k * (x * x + y * y))
        )
        beside = mine[..., number] - family.lateral[family.owner][:, None]
        radius = family.radius[family.owner][:, None]
        if cloth.threads[number].section == "racetrack":
            beside = np.maximum(abs(beside) - (aspect[number] - 1) * radius, 0)
        elif aspect[number] > 1:
            beside = beside / aspect[number]
        np.testing.assert_allclose(np.hypot(above, beside) / radius, 1, rtol=0, atol=5e-14)


def test_a_rational_cloth_needs_fewer_patches() -> None:
    exact = build_weave(changed(STEEP, exact=True))
    assert exact.tube_patches < build_weave(STEEP).tube_patches
    assert exact.weights is not None
    assert exact.weights.shape == (len(exact.points),)
    assert exact.weights.min() > 0.5
    # corners of patches have weight 1, so that neighbours agree
    assert (exact.weights[exact.patches[: exact.tube_patches, :4]] == 1).all()
    assert build_weave(STEEP).weights is None


@pytest.mark.parametrize("kind", CLOTHS)
def test_vtk_agrees_with_rational_patches(kind: str) -> None:
    weave = build_weave(changed(CLOTHS[kind], exact=True))
    grid = grid_of(weave)
    weights = numpy_to_vtk(weave.weights)
    weights.SetName("RationalWeights")
    grid.GetPointData().SetRationalWeights(weights)
    points, *_ = surface(weave, np.array([0.2, 0.7]))
    for patch in [*range(0, len(weave.patches), 37), len(weave.patches) - 1]:
        location, shape = [0.0] * 3, [0.0] * 16
        grid.GetCell(patch).EvaluateLocation(mutable(0), (0.7, 0.2, 0.0), location, shape)
        np.testing.assert_allclose(location, points[patch, 1, 0], atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.3, pi / 3, pi / 2, 2.0])
def test_rational_arcs_are_arcs(angle: float) -> None:
    handle, weight = rational_handles(angle)
    c, s = np.cos(angle), np.sin(angle)
    net = np.array([[1, 0], [1, handle], [c + handle * s, s - handle * c], [c, s]])
    t = np.linspace(0, 1, 11)
    basis = bezier.bernstein(3, t) * [1, weight, weight, 1]
    points = basis @ net / basis.sum(axis=1)[:, None]
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(points[5], [np.cos(angle / 2), np.sin(angle / 2)], atol=1e-15)


def test_largest_deviation_is_reported() -> None:
    """The bound holds, and is not far from what is found."""
    for cloth in (ROUND, STEEP):
        weave = build_weave(cloth)
        axis, yarn = sample_axes(cloth, samples=300)
        points, *_ = surface(weave, np.linspace(0, 1, 9), weave.yarn == 1)
        points = points[:-4].reshape(-1, 3)
        line = axis[yarn == 1]
        away = np.array([np.linalg.norm(line - p, axis=1).min() for p in points[::7]])
        worst = abs(away / (cloth.warp.diameter / 2) - 1).max()
        assert worst < weave.radial_error + 1e-4
        assert weave.radial_error < 2 * worst + 1e-4


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("kind", CLOTHS)
def test_rational_patches_are_tessellated(kind: str, dtype: type) -> None:
    """Positions and normals by the formula of one patch, and the surface exactly round."""
    weave = build_weave(changed(CLOTHS[kind], exact=True))
    n = 3
    tessellation = Tessellation(weave.patches, (3, 3), n)
    positions, normals = tessellation.evaluate(weave.points, dtype, weave.weights)
    points, du, dv = surface(weave, np.linspace(0, 1, n + 1))
    corner = tessellation.quads.reshape(-1, n, n, 4)  # [patch, v, u]
    size = abs(weave.points).max()
    tolerance = 1e-6 if dtype == np.float32 else 1e-14
    inner = points[:, :n, :n].swapaxes(1, 2)
    assert abs(positions[corner[..., 0]] - inner).max() < tolerance * size
    expected = np.cross(du, dv)
    expected /= np.maximum(np.linalg.norm(expected, axis=-1, keepdims=True), 1e-300)
    sides = slice(0, weave.tube_patches)
    away = normals[corner[sides, ..., 0]] - expected[sides, :n, :n].swapaxes(1, 2)
    assert abs(away).max() < 1000 * tolerance
    assert np.isfinite(normals).all()
    # arrays are carried over by the same functions: positions come out as positions
    carried = tessellation.interpolate(weave.points, weave.weights)
    assert abs(carried - positions).max() < tolerance * size
    with pytest.raises(GeometryError, match="one positive rational weight"):
        tessellation.evaluate(weave.points, dtype, np.zeros(len(weave.points)))


def test_the_filter_accepts_rational_weights_of_vtk() -> None:
    weave = build_weave(changed(ROUND, exact=True, drawdown=[[1]]))
    grid = grid_of(weave)
    weights = numpy_to_vtk(weave.weights)
    weights.SetName("RationalWeights")
    grid.GetPointData().SetRationalWeights(weights)
    mine = numpy_to_vtk(
        ((np.arange(len(weave.patches)) < weave.tube_patches) & (weave.yarn == 0)) * 1
    )
    mine.SetName("mine")
    grid.GetCellData().AddArray(mine)
    tessellator = PatchTessellator(subdivisions=5)
    tessellator.SetInputDataObject(grid)
    tessellator.update()
    result = tessellator.GetOutputDataObject(0)
    assert result.GetPointData().GetArray("RationalWeights") is None
    points = vtk_to_numpy(result.GetPoints().GetData()).astype(float)
    cells = vtk_to_numpy(result.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    mine = vtk_to_numpy(result.GetCellData().GetArray("mine")) > 0
    warp = points[np.unique(cells[mine])]
    away = np.hypot(warp[:, 0], warp[:, 2] - ROUND.height / 2) / 0.125
    assert abs(away - 1).max() < 1e-6
