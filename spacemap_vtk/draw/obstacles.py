"""The obstacles of a cage as they are drawn: their surfaces, and the light that reaches them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, points_of, to_array, to_image
from spacemap_vtk.datasets.modal_model import bodies_of
from spacemap_vtk.draw.actors.obstacle_shading import (
    DIRECTIONS,
    FEW_DIRECTIONS,
    FEW_SAMPLES,
    SAMPLES,
    exposure,
    sample_surface,
    smooth_over_edges,
)
from spacemap_vtk.filters.obstacle import make_body
from spacemap_vtk.filters.obstacle_surfaces import ENDLESS, join_surfaces, obstacle_surfaces
from spacemap_vtk.filters.patch_tessellator import LOOK
from spacemap_vtk.mechanics.contact.surfaces import Surface
from spacemap_vtk.ndarrays import AnyFloats, Floats

#: Cells along a side of a plane, whose points are shaded.
_PLANE_CELLS = 128
#: Pixels along a side of the image that fades out a plane towards its border.
_FADE = 128
#: Share of half a plane's side at which it begins to fade.
_SOLID = 0.35
#: Parts of obstacles farther from the middle of the cage than this, over its radius, do not count
#: for the camera: it shows the cloth, and of large obstacles only the part near it.
_NEAR = 1.25
#: Largest number of points of a cloth whose distances to bodies are measured.
_MOST_POINTS = 200_000
#: By how much more than their depth bodies are made smaller.
_MARGIN = 1.2
#: Largest such depth over the size of a body: of deeper ones, contact has failed, which must show.
_DEEPEST = 0.01


@dataclass(frozen=True)
class ShownObstacles:
    """Surfaces of obstacles, with the exposure of their points (`LOOK`)."""

    #: Bodies that are shown whole.
    bodies: vtkPolyData
    #: Planes, which fade out towards their borders, with texture coordinates; empty if none.
    planes: vtkPolyData
    #: Points that the camera includes, (n, 3).
    reach: Floats


def show_obstacles(
    cage: vtkUnstructuredGrid, surface: vtkPolyData, shadows: bool = True, quick: bool = False
) -> ShownObstacles | None:
    """Return the obstacles of a cage in the shade of a surface; None without obstacles."""
    directions, count = (FEW_DIRECTIONS, FEW_SAMPLES) if quick else (DIRECTIONS, SAMPLES)
    found = obstacle_surfaces(cage, _PLANE_CELLS)
    if not found:
        return None
    found = [
        (shape, each if shape == ENDLESS else _below(each, body, points_of(surface)))
        for body, (shape, each) in zip(bodies_of(cage), found, strict=True)
    ]
    light = [np.ones(len(each.points)) for _, each in found]
    if shadows:
        objects = {-1: sample_surface(surface, count)}
        for number, part in enumerate(found):
            if part[0] != ENDLESS:
                objects[number] = sample_surface(join_surfaces([part]), count)
        for number, (_, each) in enumerate(found):
            others = [samples for owner, samples in objects.items() if owner != number]
            casters = np.concatenate([points for points, _ in others])
            spacing = max(distance for _, distance in others)
            shade = exposure(each.points, each.normals, casters, spacing, directions)
            light[number] = smooth_over_edges(shade, each)
    solid = [(part, shade) for part, shade in zip(found, light, strict=True) if part[0] != ENDLESS]
    level = [(part, shade) for part, shade in zip(found, light, strict=True) if part[0] == ENDLESS]
    planes = _join(level)
    if level:
        texels = np.concatenate([_texels(part.points) for (_, part), _ in level])
        planes.GetPointData().SetTCoords(to_array(texels.astype(np.float32), "texels"))
    return ShownObstacles(_join(solid), planes, _points_near(cage, found))


def obstacle_reach(cage: vtkUnstructuredGrid) -> Floats:
    """Return the points of the obstacles of a cage that the camera includes, (n, 3)."""
    return _points_near(cage, obstacle_surfaces(cage))


def fading_image(color: Sequence[int]) -> vtkImageData:
    """Return an image of one colour that becomes transparent towards its border, as planes do."""
    side = np.abs(np.linspace(-1.0, 1.0, _FADE))
    away = np.hypot(side, side[:, None])
    share = np.clip((1.0 - away) / (1.0 - _SOLID), 0.0, 1.0)
    image = np.empty((_FADE, _FADE, 4), np.uint8)
    image[..., :3] = color
    image[..., 3] = np.rint(255.0 * share * share * (3.0 - 2.0 * share))
    return to_image(image)


def _below(surface: Surface, body: Mapping[str, Any], points: AnyFloats) -> Surface:
    """Return the surface of a body that points on it do not cut, (n, 3)."""
    # Cloth meets bodies at samples of its cells; between them it would be cut by a hair's breadth.
    some = points[:: 1 + len(points) // _MOST_POINTS].astype(np.float64)
    if not len(some):
        return surface
    depth = -_MARGIN * float(make_body(**body).gap(some).min())
    depth = min(max(depth, 0.0), _DEEPEST * float(np.ptp(surface.points, axis=0).max()))
    return surface._replace(points=surface.points - depth * surface.normals)


def _join(parts: list[tuple[tuple[str, Surface], Floats]]) -> vtkPolyData:
    """Join surfaces with their exposure; their brightness is that of the material."""
    joined = join_surfaces([part for part, _ in parts])
    if parts:
        light = np.concatenate([shade for _, shade in parts])
        look = np.column_stack([light, np.ones_like(light)]).astype(np.float32)
        add_array(joined.GetPointData(), LOOK, look)
    return joined


def _texels(points: Floats) -> Floats:
    """Return coordinates, 0 to 1, of the points of a square grid, row by row."""
    side = round(len(points) ** 0.5)
    axes = points[[side - 1, -side]] - points[0]
    return (points - points[0]) @ (axes / (axes**2).sum(axis=1, keepdims=True)).T


def _points_near(cage: vtkUnstructuredGrid, parts: list[tuple[str, Surface]]) -> Floats:
    """Return points of bodies that are not far from the cage, which the camera includes."""
    low, high = (np.array(cage.GetBounds()).reshape(3, 2)).T
    equilibrium = cage.GetPointData().GetArray("equilibrium")
    if equilibrium is not None:
        places = points_of(cage) + vtk_to_numpy(equilibrium)
        low, high = places.min(axis=0), places.max(axis=0)
    radius = _NEAR * float(np.linalg.norm(high - low)) / 2
    points = np.concatenate(
        [np.zeros((0, 3)), *(p.points for shape, p in parts if shape != ENDLESS)]
    )
    near = np.linalg.norm(points - (low + high) / 2, axis=1) <= radius
    return points[near]
