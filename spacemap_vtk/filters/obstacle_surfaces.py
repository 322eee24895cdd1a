"""ObstacleSurfaces: the surfaces of the obstacles that a cage touches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals, vtkTriangleFilter
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from spacemap_vtk.datasets.arrays import (
    add_array,
    points_of,
    to_array,
    to_cells,
    to_points,
)
from spacemap_vtk.datasets.modal_model import bodies_of
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.io import registry
from spacemap_vtk.io.reading import read_object
from spacemap_vtk.mechanics.contact.obstacles import frame_along
from spacemap_vtk.mechanics.contact.surfaces import (
    Surface,
    box_surface,
    plane_surface,
    turned_surface,
)
from spacemap_vtk.ndarrays import Floats

#: Shapes of bodies without an end, of which only a part can be shown.
ENDLESS = "plane"
#: Half the side of the shown part of a plane, and of the length of a cylinder without ends, over
#: the radius of the cage.
_PLANE_SHARE, _CYLINDER_SHARE = 3.0, 1.25
#: Edges of a mesh above this angle look sharp, in degrees.
_SHARP = 40.0


class ObstacleSurfaces(Stage):
    """Return the surfaces of the obstacles of a cage, as drawn in pictures.

    The obstacles are those of a ModalSolver above. Of a plane, and of a cylinder without ends, the
    part around the cage is returned. The cell array ``obstacle`` gives the number of each obstacle,
    from 0.

    Examples
    --------
    >>> from spacemap_vtk import ModalSolver, TetraCage, WeaveSource, connect
    >>> from spacemap_vtk.filters.obstacle_surfaces import ObstacleSurfaces
    >>> ball = [{"shape": "sphere", "radius": "1 mm", "center": [0, 0, "-2 mm"]}]
    >>> solver = ModalSolver(obstacles=ball, gravity=(0, 0, -9.81), modes=1)
    >>> surfaces = connect(WeaveSource(), TetraCage(), solver, ObstacleSurfaces()).update()
    >>> round(surfaces.output.GetLength() * 1e3, 2)  # mm
    3.46
    """

    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    output_type = "vtkPolyData"
    provides: ClassVar = {"obstacle": ProvidedArray("cell")}

    def run(self, inputs: list[vtkUnstructuredGrid], output: vtkPolyData, time: float) -> None:
        """Join the surfaces of all obstacles."""
        output.ShallowCopy(join_surfaces(obstacle_surfaces(inputs[0])))


def obstacle_surfaces(cage: vtkUnstructuredGrid, plane_cells: int = 2) -> list[tuple[str, Surface]]:
    """Return the shape and the surface of each obstacle of a cage, in their order.

    Parameters
    ----------
    cage : vtkUnstructuredGrid
        Output of ModalSolver, or of a stage after it.
    plane_cells : int
        Number of cells along each side of a plane.

    Returns
    -------
    list of (str, Surface)
        Empty if the cage has no obstacles.
    """
    return [obstacle_surface(body, cage, plane_cells) for body in bodies_of(cage)]


def obstacle_surface(
    body: Mapping[str, Any], cage: vtkUnstructuredGrid, plane_cells: int = 2
) -> tuple[str, Surface]:
    """Return the shape and the surface of one obstacle, whether or not the cage has it.

    Parameters
    ----------
    body : mapping
        Shape and place, from `spacemap_vtk.filters.obstacle.Obstacle.body`.
    cage : vtkUnstructuredGrid
        Of a plane, and of a cylinder without ends, the part around this cage is returned.
    plane_cells : int
        Number of cells along each side of a plane.

    Returns
    -------
    (str, Surface)
        As one item of `obstacle_surfaces`.
    """
    points = points_of(cage).astype(np.float64)
    equilibrium = cage.GetPointData().GetArray("equilibrium")
    if equilibrium is not None:
        points = points + vtk_to_numpy(equilibrium)
    low, high = points.min(axis=0), points.max(axis=0)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    return body["shape"], _placed_surface(body, middle, radius, plane_cells)


def join_surfaces(surfaces: Sequence[tuple[str, Surface]]) -> vtkPolyData:
    """Join surfaces to one, with normals and the number of each.

    Parameters
    ----------
    surfaces : sequence of (str, Surface)
        As from `obstacle_surfaces`.

    Returns
    -------
    vtkPolyData
        Triangles with the cell array ``obstacle``; empty without surfaces.
    """
    joined = vtkPolyData()
    if not surfaces:
        return joined
    parts = [surface for _, surface in surfaces]
    starts = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    corners = [part.triangles + start for part, start in zip(parts, starts, strict=True)]
    joined.SetPoints(to_points(np.concatenate([part.points for part in parts])))
    joined.SetPolys(to_cells(np.concatenate(corners)))
    normals = np.concatenate([part.normals for part in parts]).astype(np.float32)
    joined.GetPointData().SetNormals(to_array(normals, "Normals"))
    numbers = np.repeat(np.arange(len(parts), dtype=np.int32), [len(each) for each in corners])
    add_array(joined.GetCellData(), "obstacle", numbers)
    return joined


def _placed_surface(
    body: Mapping[str, Any], middle: Floats, radius: float, plane_cells: int
) -> Surface:
    """Return the surface of a body at its place, near a sphere around the cage."""
    frame, center = frame_along(body["axis"]), np.asarray(body["center"], dtype=np.float64)
    local = frame @ (middle - center)
    shape, rounding = body["shape"], body.get("rounding", 0.0)
    if shape == "plane":
        surface, shift = plane_surface(_PLANE_SHARE * radius, plane_cells), local * [1.0, 1.0, 0.0]
    elif shape == "sphere":
        size = body["radius"]
        surface, shift = turned_surface(size, 2 * size, size), np.zeros(3)
    elif shape == "box":
        surface, shift = box_surface(body["size"], rounding), np.zeros(3)
    elif shape == "mesh":
        surface, shift = _read_surface(body["file"], tuple(body["state"])), np.zeros(3)
    else:
        height, shift = body.get("height"), np.zeros(3)
        if height is None:
            height, shift = 2 * _CYLINDER_SHARE * radius, local * [0.0, 0.0, 1.0]
        elif shape == "disc":  # the centre is that of its upper face
            shift = np.array([0.0, 0.0, -height / 2])
        surface = turned_surface(body["radius"], height, rounding)
    placed = (surface.points + shift) @ frame + center
    return Surface(placed, surface.normals @ frame, surface.triangles)


@lru_cache(8)
def _read_surface(file: str, state: tuple[int, ...]) -> Surface:
    """Read the surface of a closed mesh, with normals that are smooth except at sharp edges."""
    outer, triangles, normals = vtkGeometryFilter(), vtkTriangleFilter(), vtkPolyDataNormals()
    outer.SetInputData(read_object(registry.require_file(Path(file))).data)
    triangles.SetInputConnection(outer.GetOutputPort())
    triangles.PassLinesOff()
    triangles.PassVertsOff()
    normals.SetInputConnection(triangles.GetOutputPort())
    normals.ConsistencyOn()
    normals.AutoOrientNormalsOn()
    normals.SetFeatureAngle(_SHARP)
    normals.Update()
    made = normals.GetOutput()
    corners = vtk_to_numpy(made.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    facing = vtk_to_numpy(made.GetPointData().GetNormals())
    return Surface(points_of(made).astype(np.float64), facing.astype(np.float64), corners)
