"""Obstacles as further parts of a moving surface, for files that show a scene."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.filters.obstacle_surfaces import ENDLESS, obstacle_surfaces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from spacemap_vtk.datasets.moving_surface import MovingSurface
    from spacemap_vtk.ndarrays import MessageCallback
    from spacemap_vtk.scenes.scene import Scene


def add_obstacles(moving: MovingSurface, scene: Scene, warn: MessageCallback) -> MovingSurface:
    """Return a surface with the obstacles of its scene as further parts, which no target moves."""
    found = obstacle_surfaces(scene.deformed_cage) if scene.moves and scene.view.obstacles else []
    if not found:
        return moving
    if moving.numbers is not None:
        warn("obstacles are left out, because the colours of all points show numbers")
        return moving
    names = [f"obstacle {k} ({shape})" for k, (shape, _) in enumerate(found, 1)]
    order = sorted(range(len(found)), key=lambda k: found[k][0] == ENDLESS)  # planes come last
    names, found = [names[k] for k in order], [found[k] for k in order]
    count, parts = len(moving.points), [surface for _, surface in found]
    sizes = [len(part.points) for part in parts]
    starts = count + np.cumsum([0, *sizes[:-1]])
    numbers = np.repeat(np.arange(len(parts)) + len(moving.part_names), sizes)
    style = scene.view.resolved_style
    hues = [style.ground_color if shape == ENDLESS else style.obstacle_color for shape, _ in found]
    colors = np.repeat(np.array(hues, np.uint8), sizes, axis=0)
    corners = [part.triangles + start for part, start in zip(parts, starts, strict=True)]
    normals, quantised = moving.normals, moving.quantised
    if normals is not None:
        facing = np.concatenate([part.normals for part in parts])
        normals = np.concatenate([normals, facing.astype(normals.dtype)])
    if quantised is not None:
        quantised = quantised._replace(
            targets=_still(quantised.targets, sum(sizes)),
            normals=None if quantised.normals is None else _still(quantised.normals, sum(sizes)),
        )
    shading = moving.shading
    if shading is not None and shading.exposures is not None:
        open_ = np.pad(shading.exposures, (0, sum(sizes)), constant_values=255)
        shading = shading._replace(exposures=open_)
    more = None if moving.normal_targets is None else _still(moving.normal_targets, sum(sizes))
    points = np.concatenate([part.points for part in parts]).astype(np.float32)
    return replace(
        moving,
        points=np.concatenate([moving.points, points]),
        targets=_still(moving.targets, sum(sizes)),
        normals=normals,
        normal_targets=more,
        triangles=np.concatenate([moving.triangles, *corners]).astype(moving.triangles.dtype),
        colors=np.concatenate([moving.colors, colors]),
        parts=np.concatenate([moving.parts, numbers.astype(np.asarray(moving.parts).dtype)]),
        part_names=[*moving.part_names, *names],
        quantised=quantised,
        shading=shading,
        obstacle_points=sum(sizes),
        plane_points=sum(len(part.points) for shape, part in found if shape == ENDLESS),
    )


def _still(targets: NDArray[Any], count: int) -> NDArray[Any]:
    """Return targets (K, N, 3) that do not move `count` further points."""
    return np.pad(targets, ((0, 0), (0, count), (0, 0)))
