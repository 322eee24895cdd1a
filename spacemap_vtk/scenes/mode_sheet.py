"""A sheet of a scene's mode shapes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

from spacemap_vtk.filters.arrays import add_array, array_of, points_of
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.modal_solver import MODE_NAME
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.camera import add_lights, aim
from spacemap_vtk.scenes.graphics import prepare_offscreen
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.shading import averaged

#: Most shapes on a sheet, and how many in a row.
MOST_SHAPES, COLUMNS = 12, 4
#: A cell of the sheet in pixels, and the room below it for its label.
_CELL, _LABEL = (440, 400), 46
#: Largest displacement of a shape, in diagonals of the cage's box.
_SWING = 0.12
_INK, _FAINT = (40, 46, 54), (118, 126, 138)


def mode_sheet(scene: Scene, progress: Callable[[int], None] | None = None) -> NDArray[np.uint8]:
    """Draw the fabric in the shape of each of the first modes, with the cage at rest and moved.

    Parameters
    ----------
    scene : Scene
        A scene that moves.
    progress : callable, optional
        Told the number of shapes drawn.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Up to `MOST_SHAPES`, the lowest first, each with its frequency; brighter moves further.

    Raises
    ------
    InputError
        If the scene has no cage.
    MissingLibraryError
        If this machine cannot draw.
    """
    figures = report.modes(scene)
    prepare_offscreen()
    scene.update_stage(scene.weave)
    grid = scene.modal.GetOutputDataObject(0)
    shapes = figures["modes"][:MOST_SHAPES]
    columns = min(COLUMNS, len(shapes))
    rows = math.ceil(len(shapes) / columns)
    sheet = Image.new("RGB", (columns * _CELL[0], rows * (_CELL[1] + _LABEL)), (255, 255, 255))
    pen = ImageDraw.Draw(sheet)
    for number, mode in enumerate(shapes):
        left, top = number % columns * _CELL[0], number // columns * (_CELL[1] + _LABEL)
        sheet.paste(Image.fromarray(_shape(scene, grid, number)), (left, top))
        middle, line = left + _CELL[0] / 2, top + _CELL[1]
        title = f"mode {number}: {mode['frequency_hz']:.4g} Hz"
        pen.text((middle, line + 6), title, _INK, ImageFont.load_default(19), anchor="ma")
        pen.text((middle, line + 28), _note(mode), _FAINT, ImageFont.load_default(14), anchor="ma")
        if progress:
            progress(number + 1)
    return np.asarray(sheet)


def _note(mode: dict[str, Any]) -> str:
    shares = mode["effective_mass_share"]
    most = int(np.argmax(shares))
    damping = "rigid" if mode["regime"] == "rigid" else f"damping {mode['damping_ratio']:.3g}"
    if shares[most] < 0.005:
        return f"{damping}, moves no mass as a whole"
    return f"{damping}, {shares[most]:.0%} of the mass along {'xyz'[most]}"


def _shape(scene: Scene, grid: vtkUnstructuredGrid, number: int) -> NDArray[np.uint8]:
    """Draw one mode shape."""
    vertices = points_of(grid)
    shape = array_of(grid.GetPointData(), MODE_NAME.format(number), "a sheet of modes")
    largest = float(np.linalg.norm(shape, axis=1).max())
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    moved = vtkUnstructuredGrid()
    moved.ShallowCopy(grid)
    add_array(moved.GetPointData(), "displacement", shape * (_SWING * diagonal / largest))
    moved.GetPointData().SetActiveVectors("displacement")
    cage = vtkTrivialProducer()
    cage.SetOutput(moved)
    warp, surface = BarycentricWarp(), PatchTessellator(subdivisions=scene.surface.subdivisions)
    warp.SetInputConnection(0, scene.weave.GetOutputPort())
    warp.SetInputConnection(1, cage.GetOutputPort())
    surface.SetInputConnection(warp.GetOutputPort())
    surface.update()
    mesh = pv.wrap(surface.GetOutputDataObject(0))
    mesh["size"] = np.linalg.norm(mesh["displacement"], axis=1)

    # Two samples a pixel each way, averaged: what a screen's driver smooths varies.
    size = _CELL[0] * 2, _CELL[1] * 2
    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
    plotter.set_background("#ffffff", top="#eef2f6")
    add_lights(plotter.renderer)
    plotter.add_mesh(
        mesh,
        scalars="size",
        clim=[0.0, _SWING * diagonal],
        cmap="viridis",
        show_scalar_bar=False,
        smooth_shading=True,
        ambient=0.3,
        diffuse=0.8,
        specular=0.1,
    )
    # Of the cage only its corner lines, which its faces share at an angle: enough to see it bend.
    lines = pv.wrap(moved).extract_surface(algorithm="dataset_surface").extract_feature_edges(30.0)
    bent = lines.warp_by_vector("displacement")
    for mesh, color, width in ((lines, "#c3cad3", 2.0), (bent, "#4a5563", 2.6)):
        plotter.add_mesh(mesh, color=color, line_width=width, lighting=False)
    # All shapes from one place, with room for the swing to every side.
    swing = 0.6 * _SWING * diagonal
    room = np.concatenate([vertices + swing * side for side in (*np.eye(3), *-np.eye(3))])
    aim(plotter.camera, room, size[0] / size[1], "three-quarter", 1.0)
    plotter.camera_set = True
    plotter.renderer.ResetCameraClippingRange()
    image = plotter.screenshot(None, return_img=True).astype(np.float32)
    plotter.close()
    return np.clip(averaged(image, 2) + 0.5, 0, 255).astype(np.uint8)
