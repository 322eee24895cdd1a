"""The film of a test: the specimen with its yarns, and its curve with the present point."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, to_cells, to_points
from spacemap_vtk.draw.figure.measurement_plot import draw_curves
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.draw.picture import Image, Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import writer
from spacemap_vtk.laboratory.catalogue import LaboratoryTest
from spacemap_vtk.laboratory.records import Axis, Measurement, States
from spacemap_vtk.ndarrays import StepProgress
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.temporary_files import temporary_folder

#: Duration of a film [s], and frames per second.
DURATION, RATE = 4.0, 20.0
#: Width of the plot as a share of the frame.
_SHARE = 0.42
#: Width of the plot [in]; its height follows from the frame.
_INCHES = 4.9
#: Settings of the film's view that replace those of the scene.
_VIEW = {
    "show": "fabric",
    "color": "own",
    "zoom": 1.0,
    "clip_normal": None,
    "ghost": False,
    "loads": False,
    "time_stamp": False,
    "scale_bar": True,
}


@contextmanager
def specimen_scene(scene: Scene, states: States) -> Iterator[Scene]:
    """Yield a scene of the specimen, cut from the cloth of a scene, whose motion are the states."""
    if scene.woven is None:
        raise InputError(
            f"{scene.file or scene.title}: only woven cloth can be filmed in a test",
            cure="Choose a plot (.png) or a table (.csv), or add a section [weave]",
        )
    source, mover = scene.source.section, scene.motion.section
    counts = [
        max(2, round(size / family.spacing))
        for size, family in zip(states.size, scene.woven.cloth.families, strict=True)
    ]
    with temporary_folder() as folder:
        file = folder / "states.pvd"
        writer(file).write(file, _motion(states))
        settings = {name: dict(values) for name, values in scene.settings.items()}
        settings[source] |= {"ends": counts[0], "picks": counts[1]}
        settings[mover] |= {"file": file, "array": "displacement", "scale": 1.0}
        settings["warp"] |= {"smooth": True}
        settings["view"] |= _VIEW | {"camera": states.camera}
        film = Scene({}, scene.file)
        film.apply_settings(settings, {source, mover, "warp", "surface", "view"})
        film.title = scene.title
        yield film


def _motion(states: States) -> Iterator[tuple[float, vtkUnstructuredGrid]]:
    """Yield time and cage of each state."""
    times = np.linspace(0.0, DURATION, len(states.displacements))
    points, cells = to_points(states.points), to_cells(states.cells)
    for time, displacement in zip(times.tolist(), states.displacements, strict=True):
        grid = vtkUnstructuredGrid()
        grid.SetPoints(points)
        grid.SetCells(VTK_TETRA, cells)
        add_array(grid.GetPointData(), "displacement", displacement)
        yield time, grid


class CurvePanel:
    """The plot of a test, drawn once, with a point that moves on it."""

    def __init__(
        self, test: LaboratoryTest, measurement: Measurement, size: tuple[int, int]
    ) -> None:
        width, height = size
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        dpi = width / _INCHES  # texts are as large as the plot allows
        figure = new_figure(figsize=(width / dpi, height / dpi), dpi=dpi, layout="constrained")
        panel = figure.subplots()
        figure.suptitle(f"{test.title}\n{test.instrument}", fontsize=11)
        draw_curves(panel, measurement, with_si=False)
        (self._dot,) = panel.plot([], [], "o", color="#26323e", markersize=8, animated=True)
        self._caption = panel.text(
            0.04, 0.96, "", transform=panel.transAxes, va="top", fontsize=10, animated=True
        )
        self._axes, self._panel = (measurement.x_axis, measurement.y_axis), panel
        self._canvas = FigureCanvasAgg(figure)
        self._canvas.draw()
        self._empty = self._canvas.copy_from_bbox(figure.bbox)

    def draw(self, mark: tuple[float, float]) -> Image:
        """Return the plot with its point at a place [SI]."""
        x, y = (value / axis.unit.size for value, axis in zip(mark, self._axes, strict=True))
        self._canvas.restore_region(self._empty)
        self._dot.set_data([x], [y])
        pairs = zip(self._axes, (x, y), strict=True)
        self._caption.set_text("\n".join(_caption(axis, value) for axis, value in pairs))
        for artist in (self._dot, self._caption):
            self._panel.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


def _caption(axis: Axis, value: float) -> str:
    gap = "" if axis.unit.name == "°" else " "
    return f"{axis.name}: {value:.3g}{gap}{axis.unit.name}"


def film_frames(
    scene: Scene,
    test: LaboratoryTest,
    measurement: Measurement,
    size: tuple[int, int],
    report_progress: StepProgress,
) -> Iterator[Image]:
    """Yield the frames of a test's film."""
    states = measurement.states
    if states is None:
        raise InputError(
            f'the test "{test.name}" has no film', cure="Choose a plot (.png) or a table (.csv)"
        )
    width, height = size
    plot_width = round(_SHARE * width)
    times = np.arange(0.0, DURATION, 1.0 / RATE)
    steps = np.linspace(0.0, DURATION, len(states.marks))
    panel = CurvePanel(test, measurement, (plot_width, height))
    with specimen_scene(scene, states) as film:
        picture = Picture(film, times.tolist(), (width - plot_width, height))
        try:
            for number, time in enumerate(times.tolist()):
                report_progress(number, len(times))
                x, y = (float(np.interp(time, steps, values)) for values in states.marks.T)
                yield np.concatenate([picture.draw(time), panel.draw((x, y))], axis=1)
        finally:
            picture.close()
            for text in film.warnings:
                scene.warn(text)


def write_film(
    file: Path,
    scene: Scene,
    test: LaboratoryTest,
    measurement: Measurement,
    size: tuple[int, int],
    report_progress: StepProgress,
) -> None:
    """Write the film of a test."""
    frames = film_frames(scene, test, measurement, size, report_progress)
    writer(file, "film").write(file, frames, RATE)
