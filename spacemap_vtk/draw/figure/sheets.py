"""Draw sheets of several pictures: storyboards as in the paper's figure 6, and mode shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkFeatureEdges
from vtkmodules.vtkFiltersGeneral import vtkWarpVector
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.datasets.arrays import points_of, shallow_copy
from spacemap_vtk.datasets.modal_model import model_of
from spacemap_vtk.draw.actors.color_values import add_color_values
from spacemap_vtk.draw.actors.surface_actor import SurfaceActor, rgb
from spacemap_vtk.draw.camera import aim_camera
from spacemap_vtk.draw.compose import compose, gradient_background
from spacemap_vtk.draw.frame import apply_mode_shape
from spacemap_vtk.draw.graphics import WITHOUT_OPENGL, uses_software_renderer
from spacemap_vtk.draw.offscreen import open_offscreen
from spacemap_vtk.draw.picture import Picture, combine_extents, motion_extent
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.mechanics.response.linear_range import measure_extremes
from spacemap_vtk.ndarrays import Bytes, StepProgress
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.motions import MOTIONS, require_loads, set_motion
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import format_quantity

#: Size of a storyboard in pixels, without its labels.
_BOARD = (2240, 640)
#: Number of columns if no times are given.
_TIMES = 7
#: Largest number of mode shapes on a sheet.
MOST_SHAPES = 12
#: Number of mode shapes in a row.
COLUMNS = 4
#: Size of a mode shape's picture, in pixels.
_CELL = (440, 400)
#: Height of the label below a mode shape, in pixels.
_LABEL = 46
#: Largest displacement of a mode shape, as a share of the diagonal of the cage's bounding box.
_SWING = 0.12
_INK = (40, 46, 54)
_FAINT = (118, 126, 138)
_PAPER = (255, 255, 255)


def period_times(scene: Scene) -> list[float]:
    """Return times over a period of a scene's first vibrating mode, or over its whole motion."""
    if not scene.stage("solver"):
        mover = scene.stage("mover") or scene.cage_stage
        first, last = mover.time_range([]) or (0.0, 0.0)
        return np.linspace(first, last, _TIMES).tolist()
    vibrating = [
        m["frequency_hz"] for m in report.report_modes(scene)["modes"] if m["frequency_hz"] > 0.0
    ]
    period = 1 / vibrating[0] if vibrating else scene.animation.stop
    return [float(f"{time:.3g}") for time in np.linspace(0.0, period, _TIMES).tolist()]


def storyboard(
    scene: Scene,
    times: Sequence[float],
    size: tuple[int, int] | None,
    report_progress: StepProgress,
) -> Bytes:
    """Draw the paper's figure 6: cage above, fabric below, time from left to right."""
    width, height = size or _BOARD
    cell = width // len(times), height // 2
    report_progress(0, len(times))
    picture = Picture(scene, times, (2 * cell[0], cell[1]), ["cage", "fabric"])
    columns = []
    for count, time in enumerate(times, 1):
        cage, fabric = np.split(picture.draw(time), 2, axis=1)
        columns.append(np.concatenate([cage, fabric]))
        report_progress(count, len(times))
    picture.close()
    return _add_labels(np.concatenate(columns, axis=1), ["(a)", "(b)"], times)


def motions_board(
    scene: Scene,
    motions: Sequence[str],
    times: Sequence[float],
    size: tuple[int, int] | None,
    report_progress: StepProgress,
) -> Bytes:
    """Draw several motions of a scene, one row for each, with time from left to right."""
    width, height = size or (_BOARD[0], _BOARD[1] * len(motions) // 2)
    initial_cage, cell = require_loads(scene), (width // len(times), height // len(motions))
    report_progress(0, 2 * len(motions))
    extents = []
    for count, name in enumerate(motions, 1):
        set_motion(scene, name, initial_cage)
        extents.append(motion_extent(scene, times))
        report_progress(count, 2 * len(motions))
    show = "both" if scene.view.show == "side by side" else scene.view.show
    picture = Picture(scene, times, cell, [show], extent=combine_extents(extents))
    rows, labels = [], []
    for count, name in enumerate(motions, 1):
        set_motion(scene, name, initial_cage)
        rows.append(np.concatenate([picture.draw(time) for time in times], axis=1))
        stretch = 100 * _largest_stretch(scene, times)
        percent = f"{stretch:.0f}" if stretch >= 1 else f"{stretch:.1g}"
        labels.append(f"{MOTIONS[name][1]}\n\nlengths change\nby {percent} %")
        report_progress(len(motions) + count, 2 * len(motions))
    picture.close()
    return _add_labels(np.concatenate(rows), labels, times)


def _largest_stretch(scene: Scene, times: Sequence[float]) -> float:
    """Return the largest relative change of length of the cage's edges over the times."""
    model, motion = model_of(scene.deformed_cage), scene.cage_stage.motion
    assert motion is not None
    rest = motion.points if model.displacement is None else motion.points + model.displacement
    return measure_extremes(motion, rest, times, surface=model.pencil.surface).stretch


def _add_labels(image: Bytes, rows: Sequence[str], times: Sequence[float]) -> Bytes:
    """Add labels of the rows at the left, and times of the columns below."""
    height, width = image.shape[:2]
    size = max(14, height // (16 * len(rows)))
    font = ImageFont.load_default(size)
    pen = ImageDraw.Draw(Image.new("RGB", (1, 1)))
    left = size + max(pen.multiline_textbbox((0, 0), text, font)[2] for text in rows)
    sheet = Image.new("RGB", (round(left) + width, height + 2 * size), _PAPER)
    sheet.paste(Image.fromarray(image), (round(left), 0))
    pen = ImageDraw.Draw(sheet)
    for row, text in enumerate(rows):
        middle = (row + 0.5) * height / len(rows)
        pen.multiline_text((left / 2, middle), text, _INK, font, anchor="mm", align="center")
    for column, time in enumerate(times):
        middle = left + (column + 0.5) * width / len(times)
        pen.text((middle, height + size), format_quantity(time, "s", 4), _INK, font, anchor="mm")
    return np.asarray(sheet)


def mode_sheet(scene: Scene, report_progress: StepProgress) -> Bytes:
    """Draw the fabric in each of the first mode shapes, with the cage at rest and displaced."""
    figures = report.report_modes(scene)
    solver = scene.stage("solver")
    assert solver is not None
    scene.update_stage(solver)
    drawing = _ModePainter(scene, solver.output)
    shapes = figures["modes"][:MOST_SHAPES]
    report_progress(0, len(shapes))
    columns = min(COLUMNS, len(shapes))
    rows = math.ceil(len(shapes) / columns)
    sheet = Image.new("RGB", (columns * _CELL[0], rows * (_CELL[1] + _LABEL)), _PAPER)
    pen = ImageDraw.Draw(sheet)
    for number, mode in enumerate(shapes):
        left, top = number % columns * _CELL[0], number // columns * (_CELL[1] + _LABEL)
        sheet.paste(Image.fromarray(drawing.draw(number)), (left, top))
        middle, line = left + _CELL[0] / 2, top + _CELL[1]
        title = f"mode {number + 1}: {mode['frequency_hz']:.4g} Hz"
        pen.text((middle, line + 6), title, _INK, ImageFont.load_default(19), anchor="ma")
        pen.text(
            (middle, line + 28),
            _mode_caption(mode),
            _FAINT,
            ImageFont.load_default(14),
            anchor="ma",
        )
        report_progress(number + 1, len(shapes))
    drawing.close()
    return np.asarray(sheet)


def _mode_caption(mode: dict[str, Any]) -> str:
    shares = mode["effective_mass_share"]
    axis = int(np.argmax(shares))
    damping = mode["regime"]
    if damping not in ("rigid", "lost in rounding"):
        damping = f"damping {mode['damping_ratio']:.3g}"
    if shares[axis] < 0.005:
        return f"{damping}, effective mass below 0.5 %"
    return f"{damping}, {shares[axis]:.0%} of the mass along {'xyz'[axis]}"


class _ModePainter:
    """Draws mode shapes with a fixed camera that has room for displacements in all directions."""

    def __init__(self, scene: Scene, cage: vtkUnstructuredGrid) -> None:
        if uses_software_renderer():
            scene.warn(WITHOUT_OPENGL)
        self._scene, self._cage = scene, shallow_copy(cage)
        vertices = points_of(self._cage)
        self._amplitude = _SWING * float(np.linalg.norm(np.ptp(vertices, axis=0)))
        # The drawing is twice as large and then averaged, because drivers smooth differently.
        size = _CELL[0] * 2, _CELL[1] * 2
        self._window = open_offscreen(size, samples=4)
        self._window.hide_background()
        self._background = gradient_background(_CELL, (255, 255, 255), (238, 242, 246))
        self._fabric = SurfaceActor()
        self._warp = BarycentricWarp()
        self._surface = PatchTessellator(subdivisions=scene.surface.sides)
        # Only edges where faces of the cage meet at an angle are drawn; they show the bending.
        faces, lines, displaced = vtkDataSetSurfaceFilter(), vtkFeatureEdges(), vtkWarpVector()
        faces.SetInputData(self._cage)
        lines.SetInputConnection(faces.GetOutputPort())
        lines.SetFeatureAngle(30.0)
        lines.ColoringOff()
        displaced.SetInputConnection(lines.GetOutputPort())
        displaced.SetInputArrayToProcess(
            0, 0, 0, vtkDataObject.FIELD_ASSOCIATION_POINTS, "displacement"
        )
        self._window.renderer.AddActor(self._fabric)
        for stage, color, width in ((lines, "#c3cad3", 2.0), (displaced, "#4a5563", 2.6)):
            actor, mapper = vtkActor(), vtkPolyDataMapper()
            mapper.SetInputConnection(stage.GetOutputPort())
            mapper.ScalarVisibilityOff()
            actor.SetMapper(mapper)
            actor.GetProperty().SetColor(*rgb(color))
            actor.GetProperty().SetLineWidth(width)
            actor.GetProperty().LightingOff()
            self._window.renderer.AddActor(actor)
        swing = 0.6 * self._amplitude
        points = np.concatenate([vertices + swing * side for side in (*np.eye(3), *-np.eye(3))])
        aim_camera(self._window.camera, points, size[0] / size[1], "three-quarter", 1.0)

    def draw(self, number: int) -> Bytes:
        """Draw a mode shape."""
        apply_mode_shape(self._scene, self._cage, number, self._amplitude)
        self._cage.GetPointData().SetActiveVectors("displacement")
        self._cage.Modified()
        mesh = self._surface(self._warp(self._scene.object_at_rest.output, self._cage))
        add_color_values(mesh, "displacement")
        self._fabric.show(mesh, "displacement", span=(0.0, self._amplitude))
        return compose(self._window.draw(), self._background)

    def close(self) -> None:
        """Close the window and free its resources."""
        self._window.close()
