"""Figures of a scene's dynamics: a sheet of mode shapes, motion over time, frequency response."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import add_array, array_of, points_of
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.modal_solver import MODE_NAME
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.scenes import picture, report
from spacemap_vtk.scenes.graphics import prepare_offscreen
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.shading import averaged
from spacemap_vtk.units import format_quantity

#: Most shapes on a sheet, and how many in a row.
MOST_SHAPES, COLUMNS = 12, 4
#: A cell of the sheet in pixels, and the room below it for its label.
_CELL, _LABEL = (440, 400), 46
#: Largest displacement of a shape, in diagonals of the cage's box.
_SWING = 0.12
#: Width of a plotted curve, in samples.
SAMPLES = 2000
#: Factor on frequencies that meet an undamped mode exactly.
ASIDE = 1 + 1e-9
QUANTITIES = {"displacement": ("m", 0), "velocity": ("m/s", 1), "acceleration": ("m/s²", 2)}
_INK, _FAINT = (40, 46, 54), (118, 126, 138)
_COLORS = ("#c8502a", "#2f7d5b", "#2c5f9e")


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
    picture.add_lights(plotter)
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
    picture.aim(plotter.camera, room, size[0] / size[1], "three-quarter", 1.0)
    plotter.renderer.ResetCameraClippingRange()
    image = plotter.screenshot(None, return_img=True).astype(np.float32)
    plotter.close()
    return np.clip(averaged(image, 2) + 0.5, 0, 255).astype(np.uint8)


def motion_plot(scene: Scene, file: Path, point: list[float] | None, quantity: str) -> None:
    """Plot how a point of the cage moves over time, and how it answers to each frequency.

    Parameters
    ----------
    scene : Scene
        A scene that moves.
    file : Path
        A picture or a .pdf or .svg; what matplotlib knows.
    point : list of float, optional
        Where at rest [m]; without it, the vertex that moves most in the first mode.
    quantity : str
        Out of `QUANTITIES`.

    Raises
    ------
    InputError
        If the scene has no cage, or the point lies outside it.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figures = report.modes(scene)
    scene.update_stage(scene.response, 0.0)
    response = scene.response
    modes = response.cage_modes()
    if point is None:
        first = modes.shapes[0].reshape(-1, 3)
        place = modes.model.points[int(np.argmax((first**2).sum(axis=1)))]
    else:
        place = np.asarray(point)
    weights = modes.weights(place)
    unit, row = QUANTITIES[quantity]
    times = np.linspace(0.0, response.duration, SAMPLES)
    curves = response.history(weights, times)[row]
    unit, size = handy(unit, float(abs(curves).max()))

    figure = Figure(figsize=(9.6, 7.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    where = ", ".join(format_quantity(float(f"{x:.4g}"), "m") for x in place)
    figure.suptitle(f"{scene.title}\n{quantity} at ({where})", fontsize=12)
    over_time, over_frequency = figure.subplots(2, 1)
    for axis, color in enumerate(_COLORS):
        over_time.plot(times, curves[:, axis] / size, color=color, label="xyz"[axis], linewidth=1.3)
    over_time.set(xlabel="time [s]", ylabel=f"{quantity} [{unit}]", xlim=(0, times[-1]))

    frequencies = frequencies_near([mode["frequency_hz"] for mode in figures["modes"]])
    try:
        answer = abs(response.frequency_response(weights, frequencies))
    except InputError:  # an undamped mode was met exactly
        frequencies *= ASIDE
        answer = abs(response.frequency_response(weights, frequencies))
    answer *= (2 * np.pi * frequencies[:, None]) ** row / size
    for axis, color in enumerate(_COLORS):
        if answer[:, axis].max() > 1e-9 * answer.max():
            over_frequency.loglog(frequencies, answer[:, axis], color=color, linewidth=1.3)
    over_frequency.set(
        xlabel="frequency of all loads [Hz]",
        ylabel=f"amplitude [{unit}]",
        xlim=(frequencies[0], frequencies[-1]),
    )
    for mode in figures["modes"]:
        if frequencies[0] < mode["frequency_hz"] < frequencies[-1]:
            over_frequency.axvline(mode["frequency_hz"], color="#d5dae0", linewidth=0.6, zorder=0)
    for panel in (over_time, over_frequency):
        panel.grid(color="#e6e9ed", linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
    over_time.legend(frameon=False, ncols=3, loc="upper right")
    figure.savefig(file)


def handy(unit: str, largest: float) -> tuple[str, float]:
    """Return a unit in which a value is no tiny number.

    Parameters
    ----------
    unit : str
        As ``"m"``.
    largest : float
        The value.

    Returns
    -------
    unit : str
        As ``"mm"``.
    size : float
        Of that unit in the other one.
    """
    for prefix, size in (("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9), ("p", 1e-12)):
        if largest >= 0.1 * size:
            return prefix + unit, size
    return unit, 1.0


def frequencies_near(natural: list[float]) -> NDArray[np.float64]:
    """Return frequencies to plot, dense about the modes.

    Parameters
    ----------
    natural : list of float
        Frequencies of the modes in Hz, ascending.

    Returns
    -------
    ndarray of float64, shape (n,)
        Ascending, in Hz.
    """
    swinging = [f for f in natural if f > 0.0] or [1.0]
    low, high = swinging[0] / 5, min(swinging[-1] * 1.3, swinging[0] * 40)
    near = np.concatenate([f * (1 + np.linspace(-0.08, 0.08, 41)) for f in swinging])
    every = np.concatenate([np.geomspace(low, high, 800), near])
    return np.unique(every[(every >= low) & (every <= high)])
