"""Facets of yarns near a camera: outlines are within a quarter of a pixel, at the least cost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import PatchTessellator
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.camera import (
    CameraView,
    Viewpoint,
    pixels_per_metre,
    pixels_per_metre_at_focus,
    project_points,
)
from spacemap_vtk.draw.detail.facets import choose_facets
from spacemap_vtk.filters.patch_tessellator import MOST_SIDES
from spacemap_vtk.scenes.level_of_detail import (
    LEAST_SIDES,
    DrawnCloth,
    facets_at_scale,
    quads_in_view,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative, quadrilateral_order

SIZE_4K = 3840, 2160
#: Yarns with sharp edges, which are outlines too.
LENSES = {
    "pattern": "twill 2/2",
    **{f"{family}_section": "lenticular" for family in ("warp", "weft")},
    **{f"{family}_aspect": 3.2 for family in ("warp", "weft")},
    **{f"{family}_diameter": 1.1e-4 for family in ("warp", "weft")},
}
#: Cosine between eye and surface below which a facet is at an outline.
_ASIDE = 0.15


def cloth(**weave: Any) -> Scene:
    scene = Scene({"weave": {"ends": 6, "picks": 6, **weave}})
    scene.source.update()
    return scene


def close_up(scene: Scene, near: float, flat: bool = False, size: Any = SIZE_4K) -> CameraView:
    """Look slantwise at the middle from so many widths of the cloth."""
    points = points_of(scene.source.output).astype(float)
    middle, width = points.mean(axis=0), float(np.ptp(points[:, 0]))
    way = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])
    scale = 0.2 * near * width if flat else 0.0
    return CameraView(
        Viewpoint(tuple(middle + near * width * way), tuple(middle), (0.0, 1.0, 0.0), scale),
        0.0,
        size,
    )


def choose_facets_for(scene: Scene, seen: CameraView) -> PatchTessellator:
    """Return what makes the facets that are seen."""
    stage, grid = PatchTessellator(), scene.source.output
    stage.SetInputDataObject(grid)
    scale = pixels_per_metre(seen.camera, points_of(grid).astype(float), seen.size[1])
    numbers = DrawnCloth.from_scene(scene)
    assert numbers is not None
    choose_facets(stage, facets_at_scale(numbers, scale, seen.size), seen)
    return stage


def surface_of(scene: Scene, seen: CameraView) -> PatchTessellator:
    stage = choose_facets_for(scene, seen)
    stage.update()
    return stage


def sides_of(stage: PatchTessellator, patches: np.ndarray, points: np.ndarray) -> np.ndarray:
    sides, _, detail, _ = stage.detail
    return np.full(len(patches), sides) if detail is None else detail(points, patches)


def patches_of(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    grid = scene.source.output
    table = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 16)
    return points_of(grid).astype(float), table


def outline_error(scene: Scene, stage: PatchTessellator, seen: CameraView) -> float:
    """Return how many pixels the facets at outlines are off the patches, at most."""
    points, patches = patches_of(scene)
    sides, camera = sides_of(stage, patches, points), seen.camera
    corners = vtk_to_numpy(stage.output.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    drawn, first, worst = points_of(stage.output).astype(float), 0, 0.0
    nets = points[patches[:, quadrilateral_order(3, 3)]].reshape(-1, 4, 4, 3)
    eye, ahead = np.array(camera.GetPosition()), np.array(camera.GetDirectionOfProjection())
    for n in np.unique(sides):
        net = nets[sides == n]
        count = len(net) * n * n
        quads = drawn[corners[first : first + count]].reshape(len(net), n, n, 4, 3)
        first += count
        # The middle of each facet and of two of its edges, (u, v) in facets from its first corner.
        for u, v, flat in (
            (0.5, 0.5, quads.mean(axis=3)),
            (0.5, 0.0, quads[:, :, :, :2].mean(axis=3)),
            (0.0, 0.5, quads[:, :, :, [0, 3]].mean(axis=3)),
        ):
            at = [(np.arange(n) + share) / n for share in (u, v)]
            along, around = (bernstein(3, each) for each in at)
            pace, turn = (bernstein_derivative(3, each) for each in at)
            exact, by_u, by_v = (
                np.einsum("jv,iu,pvuk->pjik", one, other, net)
                for one, other in ((around, along), (around, pace), (turn, along))
            )
            normal = np.cross(by_u, by_v)
            length = np.linalg.norm(normal, axis=-1, keepdims=True)
            normal /= np.where(length > 0.0, length, 1.0)
            sight = exact - eye if not camera.GetParallelProjection() else ahead
            sight = np.broadcast_to(sight, exact.shape)
            aside = np.abs((sight * normal).sum(-1)) < _ASIDE * np.linalg.norm(sight, axis=-1)
            x, y, _, w = project_points(camera, exact.reshape(-1, 3), seen.size[0] / seen.size[1]).T
            inside = ((np.abs(x) < w) & (np.abs(y) < w)).reshape(aside.shape)
            scale = np.full(aside.shape, pixels_per_metre_at_focus(camera, seen.size[1]))
            if not camera.GetParallelProjection():
                scale *= camera.GetDistance() / ((exact - eye) @ ahead)
            off = np.abs(((flat - exact) * normal).sum(-1)) * scale
            worst = max(worst, float(off[aside & inside].max(initial=0.0)))
    assert first == len(corners)
    return worst


def edge_error(scene: Scene, stage: PatchTessellator, seen: CameraView) -> float:
    """Return how many pixels the drawn edges of patches are off the exact ones, at most."""
    points, patches = patches_of(scene)
    sides, (width, height) = sides_of(stage, patches, points), seen.size
    nets = points[patches[:, quadrilateral_order(3, 3)]].reshape(-1, 4, 4, 3)
    worst = 0.0

    def project(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y, _, w = project_points(seen.camera, places.reshape(-1, 3), width / height).T
        inside = (np.abs(x) < w) & (np.abs(y) < w)
        place = 0.5 * np.stack([x * width, y * height], axis=1) / w[:, None]
        return place.reshape(*places.shape[:2], 2), inside.reshape(places.shape[:2])

    for n in np.unique(sides):
        net = nets[sides == n]
        for curve in (net[:, 0], net[:, -1], net[:, :, 0], net[:, :, -1]):
            (ends, _), (middle, inside) = (
                project(np.einsum("ti,pik->ptk", bernstein(3, at), curve))
                for at in (np.arange(n + 1) / n, (np.arange(n) + 0.5) / n)
            )
            chord, arm = np.diff(ends, axis=1), middle - ends[:, :-1]
            off = np.abs(chord[..., 0] * arm[..., 1] - chord[..., 1] * arm[..., 0])
            off /= np.maximum(np.linalg.norm(chord, axis=2), 1e-9)
            worst = max(worst, float(off[inside].max(initial=0.0)))
    return worst


@pytest.mark.parametrize(
    ("near", "flat", "weave"),
    [
        (4.0, False, {}),
        (0.2, True, {}),
        *(
            pytest.param(*case, marks=pytest.mark.nightly)
            for case in [
                (
                    0.2,
                    False,
                    {"weft_section": "racetrack", "weft_aspect": 2.0, "pattern": "twill 3/1"},
                ),
                (1.0, False, LENSES),
                (0.5, False, {}),
                (0.2, False, {"weft_section": "elliptic", "weft_aspect": 2.0}),
                (20.0, False, {}),
            ]
        ),
    ],
)
def test_outlines_deviate_by_a_quarter_of_a_pixel_at_most(
    near: float, flat: bool, weave: dict[str, Any]
) -> None:
    scene = cloth(**weave)
    seen = close_up(scene, near, flat)
    stage = surface_of(scene, seen)
    assert outline_error(scene, stage, seen) < 0.25
    assert edge_error(scene, stage, seen) < 0.25
    if near == 0.2:  # which as many facets everywhere do not give
        stage.set_detail(MOST_SIDES)
        stage.update()
        assert outline_error(scene, stage, seen) > 0.25


def test_only_visible_patches_get_more_facets() -> None:
    scene = cloth(ends=30, picks=30)
    seen = close_up(scene, 0.05)
    stage = surface_of(scene, seen)
    points, patches = patches_of(scene)
    sides = sides_of(stage, patches, points)
    assert sides.max() > MOST_SIDES
    assert (sides <= LEAST_SIDES).mean() > 0.9
    x, y, _, w = project_points(seen.camera, points, 16 / 9).T
    seen_any = ((np.abs(x) < w) & (np.abs(y) < w))[patches].any(axis=1)
    assert (sides[seen_any] > LEAST_SIDES).all()
    quads = stage.output.GetNumberOfCells()
    assert quads == (sides**2).sum()
    assert quads < quads_in_view(SIZE_4K) + LEAST_SIDES**2 * len(patches)


def test_many_near_yarns_share_the_largest_number_of_facets() -> None:
    scene = cloth(ends=60, picks=60, weft_plies=3, warp_plies=3)
    seen = close_up(scene, 0.2, size=(1280, 720))
    points, patches = patches_of(scene)
    sides = sides_of(choose_facets_for(scene, seen), patches, points)
    assert sides.max() > MOST_SIDES
    assert (sides[sides > sides.min()] ** 2).sum() <= quads_in_view(seen.size)


def test_patches_with_different_subdivisions_meet_without_gaps() -> None:
    scene = cloth(weft_plies=2)
    stage = surface_of(scene, close_up(scene, 0.6))
    points, patches = patches_of(scene)
    sides = sides_of(stage, patches, points)
    assert len(np.unique(sides)) > 2
    surface = stage.output
    corners = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    drawn = points_of(surface).astype(float)
    owner = np.concatenate([np.repeat(np.flatnonzero(sides == n), n * n) for n in np.unique(sides)])
    edges = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    whose = np.repeat(owner, 4)
    number = np.sort(edges, axis=1) @ [len(drawn), 1]
    _, which, times = np.unique(number, return_index=True, return_counts=True)
    rim = which[times == 1]  # edges of facets that are edges of patches
    ends, of = drawn[edges[rim]], whose[rim]
    order = quadrilateral_order(3, 3)
    nets = patches[:, order].reshape(-1, 4, 4)
    tried = 0
    for one, other in neighbours(nets, sides):
        fine, coarse = ends[of == one], ends[of == other]
        # Each point of the finer rim that lies near the coarser patch lies on its facets' edges.
        shared = np.unique(fine.reshape(-1, 3), axis=0)
        along, start = coarse[:, 1] - coarse[:, 0], coarse[:, 0]
        length = np.maximum(np.square(along).sum(axis=1), 1e-30)  # those of caps end in a point
        share = np.einsum("fek,ek->fe", shared[:, None] - start, along) / length
        share = np.clip(share, 0.0, 1.0)
        far = np.linalg.norm(shared[:, None] - start - share[..., None] * along, axis=2).min(axis=1)
        scale = np.linalg.norm(np.ptp(fine.reshape(-1, 3), axis=0))
        assert (far < 1e-6 * scale + 1e-10).sum() >= sides[one] + 1
        tried += 1
    assert tried > 20


def neighbours(nets: np.ndarray, sides: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of patches that share an edge, the one with more facets first."""
    seen: dict[tuple[int, ...], int] = {}
    found = []
    for number, net in enumerate(nets):
        for edge in (net[0], net[-1], net[:, 0], net[:, -1]):
            if edge[0] == edge[-1]:
                continue
            key = tuple(sorted(edge.tolist()))
            other = seen.setdefault(key, number)
            if sides[other] != sides[number]:
                pair = sorted((number, other), key=lambda each: -sides[each])
                found.append((pair[0], pair[1]))
    return found


@pytest.mark.nightly
def test_plied_yarns_are_as_smooth_as_others() -> None:
    scene = cloth(weft_plies=3, warp_plies=2)
    seen = close_up(scene, 1.0, size=(640, 360))
    stage = surface_of(scene, seen)
    points, patches = patches_of(scene)
    sides, twice = sides_of(stage, patches, points), PatchTessellator()
    assert sides.max() > MOST_SIDES
    twice.SetInputDataObject(scene.source.output)
    twice.set_detail(LEAST_SIDES, False, lambda *_: 2 * sides)
    twice.update()
    worst, first = 0.0, [0, 0]
    drawn = [points_of(each.output).astype(float) for each in (stage, twice)]
    corners = [
        vtk_to_numpy(each.output.GetPolys().GetConnectivityArray()).reshape(-1, 4)
        for each in (stage, twice)
    ]
    normals = vtk_to_numpy(twice.output.GetPointData().GetNormals())
    camera = seen.camera
    for n in np.unique(sides):
        count = int((sides == n).sum())
        few = corners[0][first[0] : first[0] + count * n * n].reshape(count, n, n, 4)
        many = corners[1][first[1] : first[1] + count * 4 * n * n].reshape(count, 2 * n, 2 * n, 4)
        first = [first[0] + count * n * n, first[1] + count * 4 * n * n]
        exact = many[:, ::2, ::2, 2]  # the middle of each facet
        normal, sight = normals[exact], drawn[1][exact] - camera.GetPosition()
        depth = sight @ np.array(camera.GetDirectionOfProjection())
        x, y, _, w = project_points(camera, drawn[1][exact].reshape(-1, 3), 16 / 9).T
        inside = ((np.abs(x) < w) & (np.abs(y) < w)).reshape(depth.shape)
        aside = np.abs((sight * normal).sum(-1)) < _ASIDE * np.linalg.norm(sight, axis=-1)
        off = np.abs(((drawn[0][few].mean(axis=3) - drawn[1][exact]) * normal).sum(-1))
        off *= pixels_per_metre_at_focus(camera, 360) * camera.GetDistance() / depth
        worst = max(worst, float(off[inside & aside].max(initial=0.0)))
    assert 0.0 < worst < 0.25
