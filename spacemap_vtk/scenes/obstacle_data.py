"""The obstacles of a scene as data for files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.obstacle_surfaces import join_surfaces, obstacle_surfaces

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    from spacemap_vtk.scenes.scene import Scene


def obstacle_data(scene: Scene) -> vtkPolyData:
    """Return the surfaces of the obstacles that the scene's cage touches."""
    found = obstacle_surfaces(scene.deformed_cage) if scene.moves else []
    if not found:
        raise InputError(
            "the scene has no obstacles",
            key="what",
            value="obstacles",
            cure="Add [[modal.obstacles]] to the scene, and a load under which the cage hangs.",
        )
    return join_surfaces(found)
