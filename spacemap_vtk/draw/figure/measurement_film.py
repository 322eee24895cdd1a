"""The film of a test: the specimen with its yarns, and its curve with the present point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import add_array, to_array, to_cells, to_points
from spacemap_vtk.draw.figure.measurement_plot import draw_curves
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.draw.picture import Image, Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.pictures import write_png
from spacemap_vtk.io.registry import writer
from spacemap_vtk.laboratory.catalogue import LaboratoryTest
from spacemap_vtk.laboratory.records import Axis, Measurement, States
from spacemap_vtk.mechanics.contact.surfaces import Surface
from spacemap_vtk.ndarrays import Bytes, Floats, Ints, StepProgress
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.temporary_files import temporary_folder
from spacemap_vtk.textile.weave.cloth import Cloth

if TYPE_CHECKING:
    from matplotlib.artist import Artist

#: Duration of a film [s], and frames per second.
DURATION, RATE = 4.0, 20.0
#: Steps of the progress of finding the states.
_STEPS = 100
#: Width of the plot as a share of the frame.
_SHARE = 0.42
#: Width of the plot [in]; its height follows from the frame.
_INCHES = 4.9
#: Upper end of the plot over the largest value of a line.
_ROOM = 1.04
#: Pixels along a side of the picture of a specimen, and rows below it for fixtures.
_PIXELS, _PLAIN = 2048, 32
#: Colour of fixtures.
_FIXTURE = (150.0, 158.0, 168.0)
#: How much darker the edges of a yarn are than its middle.
_RELIEF = 0.45
#: Distance and width of the lines on a specimen [m], and their brightness.
_LINES, _LINE_WIDTH, _LINE_SHADE = 10e-3, 0.5e-3, 0.45
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
    cloth, source, mover = scene.woven.cloth, scene.source.section, scene.motion.section
    with temporary_folder() as folder:
        file = folder / "states.pvd"
        writer(file).write(file, _motion(states))
        settings = {name: dict(values) for name, values in scene.settings.items()}
        if states.surface is None:
            counts = [
                max(2, round(size / family.spacing))
                for size, family in zip(states.size, cloth.families, strict=True)
            ]
            settings[source] |= {"ends": counts[0], "picks": counts[1]}
        else:
            source = "object"
            settings[source] = _write_specimen(folder, cloth, states.surface, states.fixtures)
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
    points, cells = _with_fixtures(states)
    still = np.zeros((len(points) - len(states.points), 3))
    for time, displacement in zip(times.tolist(), states.displacements, strict=True):
        grid = vtkUnstructuredGrid()
        grid.SetPoints(to_points(points))
        grid.SetCells(VTK_TETRA, to_cells(cells))
        add_array(grid.GetPointData(), "displacement", np.concatenate([displacement, still]))
        yield time, grid


def _with_fixtures(states: States) -> tuple[Floats, Ints]:
    """Return the cage of the specimen together with a box round each fixture."""
    points, cells, count = [states.points], [states.cells], len(states.points)
    for fixture in states.fixtures:
        bounds = np.stack([fixture.points.min(axis=0), fixture.points.max(axis=0)], axis=1)
        corners, box = build_lattice(bounds.ravel().tolist(), (1, 1, 1))
        points.append(corners)
        cells.append(box + count)
        count += len(corners)
    return np.concatenate(points), np.concatenate(cells)


def _write_specimen(
    folder: Path, cloth: Cloth, specimen: Surface, fixtures: Sequence[Surface]
) -> dict[str, object]:
    """Write the drawn surfaces and a picture of the cloth; return the settings of the object."""
    file, picture = folder / "specimen.vtp", folder / "cloth.png"
    low, high = specimen.points[:, :2].min(axis=0), specimen.points[:, :2].max(axis=0)
    write_png(picture, draw_cloth(cloth, low, high))
    # Fixtures have the colour of the picture's lowest rows.
    share = _PLAIN / (_PIXELS + _PLAIN)
    places = (specimen.points[:, :2] - low) / (high - low)
    texels = [places * [1.0, 1.0 - share] + [0.0, share]]
    texels += [np.tile([0.5, share / 2], (len(each.points), 1)) for each in fixtures]
    parts = [specimen, *fixtures]
    starts = np.cumsum([0, *(len(each.points) for each in parts)])
    surface = vtkPolyData()
    surface.SetPoints(to_points(np.concatenate([each.points for each in parts])))
    triangles = [each.triangles + at for each, at in zip(parts, starts, strict=False)]
    surface.SetPolys(to_cells(np.concatenate(triangles)))
    surface.GetPointData().SetTCoords(to_array(np.concatenate(texels), "texels"))
    writer(file).write(file, surface)
    return {"file": file, "texture": picture, "up": "z"}


def draw_cloth(cloth: Cloth, low: Floats, high: Floats) -> Bytes:
    """Draw flat cloth between two corners, with lines along its yarns, above rows of one colour."""
    # A laboratory marks specimens with such lines, which show how the cloth is sheared.
    places = [
        at + (np.arange(_PIXELS) + 0.5) / _PIXELS * (end - at)
        for at, end in zip(low, high, strict=True)
    ]
    numbers, shades, marks = [], [], []
    for place, family in zip(places, cloth.families, strict=True):
        yarn, across = np.divmod(place / family.spacing, 1.0)
        numbers.append(yarn.astype(np.int64))
        shades.append(1.0 - _RELIEF * (2.0 * across - 1.0) ** 2)
        marks.append(abs(place / _LINES - np.round(place / _LINES)) * _LINES < _LINE_WIDTH / 2)
    ends, picks = numbers
    face = np.asarray(cloth.drawdown)
    above = face[picks[:, None] % face.shape[0], ends % face.shape[1]].astype(bool)[..., None]
    warp, weft = (each.colors.astype(np.float64) for each in (cloth.warp, cloth.weft))
    warp = (warp[ends % len(warp)] * shades[0][:, None])[None]
    weft = (weft[picks % len(weft)] * shades[1][:, None])[:, None]
    found = np.where(above, warp, weft)
    found[marks[1][:, None] | marks[0]] *= _LINE_SHADE
    picture = np.concatenate([found, np.full((_PLAIN, _PIXELS, 3), _FIXTURE)])
    # Rows of a picture run downwards, and those of the cloth upwards.
    picture[:_PIXELS] = picture[_PIXELS - 1 :: -1]
    return picture.round().astype(np.uint8)


class CurvePanel:
    """The plot of a test, drawn once, with a point that moves on it."""

    def __init__(
        self,
        test: LaboratoryTest,
        measurement: Measurement,
        size: tuple[int, int],
        lines: Floats | None = None,
    ) -> None:
        width, height = size
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        dpi = width / _INCHES  # texts are as large as the plot allows
        figure = new_figure(figsize=(width / dpi, height / dpi), dpi=dpi, layout="constrained")
        panel = figure.subplots()
        figure.suptitle(f"{test.title}\n{test.instrument}", fontsize=11)
        draw_curves(panel, measurement, with_si=False)
        if lines is not None:
            panel.set_ylim(top=_ROOM * float(lines[..., 1].max()) / measurement.y_axis.unit.size)
        (self._dot,) = panel.plot([], [], "o", color="#26323e", markersize=8, animated=True)
        self._caption = panel.text(
            0.04, 0.96, "", transform=panel.transAxes, va="top", fontsize=10, animated=True
        )
        (self._line,) = panel.plot([], [], color="#26323e", linewidth=2.0, animated=True)
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
        return self._draw_artists(self._dot, self._caption)

    def draw_line(self, line: Floats, caption: str) -> Image:
        """Return the plot with a line, (k, 2) [SI], and a caption."""
        self._canvas.restore_region(self._empty)
        self._caption.set(y=0.04, va="bottom", text=caption)
        self._line.set_data(*(line / [axis.unit.size for axis in self._axes]).T)
        return self._draw_artists(self._line, self._caption)

    def _draw_artists(self, *artists: Artist) -> Image:
        for artist in artists:
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
    if measurement.find_states is not None:
        states = measurement.find_states(
            lambda share: report_progress(round(_STEPS * share), _STEPS)
        )
    elif measurement.states is not None:
        states = measurement.states
    else:
        raise InputError(
            f'the test "{test.name}" has no film', cure="Choose a plot (.png) or a table (.csv)"
        )
    width, height = size
    plot_width = round(_SHARE * width)
    times = np.arange(0.0, DURATION, 1.0 / RATE)
    steps = np.linspace(0.0, DURATION, len(states.displacements))
    panel = CurvePanel(test, measurement, (plot_width, height), states.lines)

    def draw_plot(time: float) -> Image:
        if states.lines is None:
            x, y = (float(np.interp(time, steps, values)) for values in states.marks.T)
            return panel.draw((x, y))
        nearest = int(abs(steps - time).argmin())
        return panel.draw_line(states.lines[nearest], states.captions[nearest])

    with specimen_scene(scene, states) as film:
        picture = Picture(film, times.tolist(), (width - plot_width, height))
        try:
            for number, time in enumerate(times.tolist()):
                report_progress(number, len(times))
                yield np.concatenate([picture.draw(time), draw_plot(time)], axis=1)
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
