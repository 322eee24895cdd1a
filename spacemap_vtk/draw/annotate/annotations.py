"""Draw annotations over a view: scale bar, axes, time and labels of points, on plates."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkActor2D,
    vtkCamera,
    vtkPolyDataMapper2D,
    vtkProp,
    vtkRenderer,
    vtkRenderWindow,
    vtkTextActor,
    vtkTextRenderer,
)

from spacemap_vtk.datasets.arrays import to_array, to_points, to_ragged
from spacemap_vtk.draw.actors.surface_actor import (
    PLATE,
    color_bar_share,
    font_size,
    rgb,
    set_font,
    text_colors,
)
from spacemap_vtk.draw.annotate.view_scale import AXES, ViewScale, round_length, view_scale
from spacemap_vtk.draw.camera import Viewpoint, project_points
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.settings import View, is_dark
from spacemap_vtk.units import format_quantity

#: Largest length of the scale bar, as a share of the picture's width.
_LONGEST = 0.2
#: Largest number of labels of points.
MOST_LABELS = 6

Polygon = Floats
#: A polygon and its colour.
ColoredPolygon = tuple[Polygon, Any]


class Annotations:
    """Annotations over a renderer's view; they follow its camera."""

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._plates, self._shapes = _Polygons(), _Polygons()
        #: Texts: scale bar, time, three names of axes (centred at their places), labels of points.
        self._texts = [vtkTextActor() for _ in range(5 + MOST_LABELS)]
        for text in self._texts:
            set_font(text.GetTextProperty())
        for text in self._texts[2:5]:
            text.GetTextProperty().SetJustificationToCentered()
            text.GetTextProperty().SetVerticalJustificationToCentered()
        #: All props of the annotations.
        self.props: list[vtkProp] = [self._plates, self._shapes, *self._texts]
        for prop in self.props:
            renderer.AddViewProp(prop)
        #: Left, bottom, right, top of the plates in drawn pixels. The list object stays the same.
        self.boxes: list[tuple[float, float, float, float]] = []
        #: Position [m] and text of each label.
        self.labels: list[tuple[Floats, str]] = []
        #: Ends of the axes in positive and in negative direction, (2, 3, 3): right and up in drawn
        #: pixels, and towards the eye. None if no axes are shown or they cannot be clicked.
        self.ends: Floats | None = None
        self._view, self._has_scale = View(), False
        #: Whether axes and scale bar are shown, and whether the axes can be clicked. Only then are
        #: their negative ends shown.
        self._triad = self._bar = self._axes_clickable = False
        self._time: float | None = None
        self._size, self._pixels = (1, 1), 1.0
        self._background: tuple[int, ...] = ()
        self._ink, self._axes = (0.0, 0.0, 0.0), [(0.0, 0.0, 0.0)] * 3
        self._plate_color = np.ones(3)
        #: State for which the annotations were last placed.
        self._last_state: tuple[object, ...] | None = None
        # The reference is weak, because VTK would keep the object of a callback alive.
        place = weakref.WeakMethod(self._update)
        self._observer = renderer.AddObserver("StartEvent", lambda *_: (now := place()) and now())

    def detach_from_camera(self) -> Callable[[], None]:
        """Stop following the camera; call the returned function before each drawing instead."""
        # numpy releases Python's global lock, which a window must keep while VTK draws.
        self._renderer.RemoveObserver(self._observer)
        return self._update

    def fit(self, background: Sequence[int], size: tuple[int, int], pixels: float) -> None:
        """Set background and size of the picture, and the drawn pixels per pixel of the picture."""
        self._size, self._pixels = size, pixels
        self._background = tuple(background)
        self._ink, plate = text_colors(background)
        self._plate_color = np.array(plate)
        self._axes = [rgb(color) for color in AXES[is_dark(background)]]
        self._plates.GetProperty().SetColor(*plate)
        self._plates.GetProperty().SetOpacity(PLATE)
        colors = [self._ink, self._ink, *self._axes, *[self._ink] * MOST_LABELS]
        for text, color in zip(self._texts, colors, strict=True):
            text.GetTextProperty().SetFontSize(font_size(size))
            text.GetTextProperty().SetColor(*color)

    def show(
        self,
        view: View,
        time: float | None,
        has_scale: bool,
        triad: bool,
        scale_bar: bool,
        axes_clickable: bool,
    ) -> None:
        """Show the annotations that a view or the other arguments request, at a time."""
        self._view, self._time, self._has_scale = view, time, has_scale
        self._triad, self._bar = triad or view.triad, scale_bar or view.scale_bar
        self._axes_clickable = axes_clickable
        for prop in self.props:
            prop.VisibilityOn()

    @property
    def has_content(self) -> bool:
        """Whether any annotation is shown."""
        stamped = self._view.time_stamp and self._time is not None
        return stamped or self._has_scale or self._triad or self._bar or bool(self.labels)

    def axis_at(self, x: float, y: float) -> Floats | None:
        """Return the unit vector of the axis that ends at a drawn pixel; None if there is none."""
        if self.ends is None:
            return None
        distances = np.linalg.norm(self.ends[..., :2] - (x, y), axis=2)
        if distances.min() > 0.75 * self._letter_height:
            return None
        depths = np.where(distances > 0.75 * self._letter_height, -2.0, self.ends[..., 2])
        side, axis = np.unravel_index(depths.argmax(), (2, 3))
        return np.eye(3)[axis] * (1, -1)[side]

    @property
    def _letter_height(self) -> float:
        return self._pixels * font_size(self._size)

    def _update(self) -> None:
        if not self._plates.GetVisibility():
            return
        view, camera = self._view, self._renderer.GetActiveCamera()
        # VTK renders a text again whenever it is set. So nothing is set while the view stays.
        shown = self._has_scale, self._triad, self._bar, self._axes_clickable, self._background
        time = self._time if view.time_stamp else None
        camera_state = Viewpoint.from_camera(camera), self._renderer.GetSize()
        state = *shown, time, *camera_state, self._size, self._pixels, len(self.labels)
        if state == self._last_state and not self.labels:
            return
        self._last_state = state
        # The window may have been resized after `fit`.
        width, height = (side / self._pixels for side in self._renderer.GetSize())
        self.boxes.clear()
        self.ends = None
        for text in self._texts:
            text.SetInput("")
        edge = 0.7 * font_size(self._size)
        scale = view_scale(camera, height)
        free_width = width * (1.0 - color_bar_share(self._size) * self._has_scale)
        shapes: list[ColoredPolygon] = []
        if self._has_scale:
            self._add_plate(free_width, 0.25 * height - edge, width, 0.75 * height + edge)
        if self._triad:
            shapes += self._add_axes(scale.axes, edge)
        if self._bar:
            shapes.append(self._add_scale_bar(scale, width, free_width, edge))
        if time is not None:
            self._add_time(time, height, edge)
        self._add_labels(camera, (width, height), free_width, edge)
        self._plates.fill([_box(np.array(b[:2]), np.array(b[2:])) for b in self.boxes])
        self._shapes.fill([self._pixels * shape for shape, _ in shapes], [c for _, c in shapes])

    def _add_axes(self, axes: Floats, edge: float) -> list[ColoredPolygon]:
        """Add the plate and names of the axes; return the arrows and the ends to click."""
        letter, shapes = font_size(self._size), []
        middle = np.full(2, edge + 2.9 * letter)
        self._add_plate(*(middle - 2.9 * letter), *(middle + 2.9 * letter))
        if self._axes_clickable:
            places = np.stack([1.75 * axes[:, :2], -1.75 * axes[:, :2]])
            toward = np.stack([axes[:, 2], -axes[:, 2]])[..., None]
            self.ends = np.concatenate([self._pixels * (middle + letter * places), toward], axis=2)
            for axis, color in zip(axes, self._axes, strict=True):
                end, pale = middle - 1.75 * letter * axis[:2], 0.45 * np.array(color)
                shapes.append((_disc(end, 0.32 * letter), tuple(pale + 0.55 * self._plate_color)))
        for k in np.argsort(axes[:, 2]).tolist():
            tip = middle + 1.75 * letter * axes[k, :2]
            shapes += [(shape, self._axes[k]) for shape in _arrow(middle, tip, letter)]
            vector = tip - middle
            length = float(np.hypot(*vector))
            away = vector / length if length > 0.15 * letter else np.array([-0.7, 0.7])
            self._write(2 + k, "xyz"[k], tip + 0.62 * letter * away)
        return shapes

    def _add_scale_bar(
        self, scale: ViewScale, width: float, free_width: float, edge: float
    ) -> ColoredPolygon:
        """Add the plate and text of the scale bar; return the bar."""
        letter = font_size(self._size)
        length = round_length(_LONGEST * width * scale.unit_length)
        bar_width = length / scale.unit_length
        left = edge * (1 + self._triad) + 5.8 * letter * self._triad
        text = format_quantity(length, "m")
        long_text = text + ("" if scale.is_parallel else " in the focal plane")
        if self._measure_text(0, long_text)[1][0] < free_width - left - 2 * edge:
            text = long_text
        right = left + 2 * edge + max(bar_width, self._measure_text(0, text)[1][0])
        self._add_plate(left, edge, right, edge + 2.7 * letter)
        low = np.array([left + edge, edge + 0.5 * letter])
        self._write(0, text, low + np.array([0.0, 0.7 * letter]))
        return _box(low, low + np.array([bar_width, 0.28 * letter])), self._ink

    def _add_time(self, time: float, height: float, edge: float) -> None:
        text = f"t = {format_quantity(time, 's', 4)}"
        begin, size = self._measure_text(1, text)
        self._add_plate(edge, height - 3 * edge - size[1], 3 * edge + size[0], height - edge)
        self._write(1, text, np.array([2 * edge, height - 2 * edge - size[1]]) - begin)

    def _add_labels(
        self, camera: vtkCamera, size: tuple[float, float], free_width: float, edge: float
    ) -> None:
        """Add the labels of points that are in front of the camera."""
        points = np.array([point for point, _ in self.labels]).reshape(-1, 3)
        x, y, _, depth = project_points(camera, points, size[0] / size[1]).T
        places = (np.stack([x, y]) / np.where(depth > 0.0, depth, 1.0) + 1.0).T / 2 * size
        free_area, distance = np.array([free_width, size[1]]), 0.8 * font_size(self._size)
        for number in np.flatnonzero(depth[:MOST_LABELS] > 0.0).tolist():
            text = self.labels[number][1]
            begin, text_size = self._measure_text(5 + number, text)
            plate = text_size + edge
            low = self._find_free_place(places[number], places, plate, free_area, distance)
            self._add_plate(*low, *(low + plate))
            self._write(5 + number, text, low + 0.5 * edge - begin)

    def _find_free_place(
        self, point: Polygon, others: Polygon, size: Polygon, free_area: Polygon, distance: float
    ) -> Polygon:
        """Return a place near a point where a plate overlaps no other; else the first candidate."""
        points = np.stack([others - 0.7 * distance, others + 0.7 * distance], axis=1)
        boxes = np.concatenate([np.array(self.boxes).reshape(-1, 2, 2) / self._pixels, points])
        directions = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
        # Further candidates lie above and below, for labels that are close together.
        offsets = distance + np.arange(MOST_LABELS)[:, None, None] * [0.0, size[1]]
        lows = (point + directions * offsets - size * (directions < 0.0)).reshape(-1, 2)
        lows = np.clip(lows, 0.0, np.maximum(free_area - size, 0.0))
        overlaps = (lows[:, None] < boxes[:, 1]) & (lows[:, None] + size > boxes[:, 0])
        return lows[overlaps.all(axis=2).any(axis=1).argmin()]

    def _add_plate(self, left: float, low: float, right: float, high: float) -> None:
        self.boxes.append(tuple(self._pixels * np.array([left, low, right, high])))

    def _measure_text(self, number: int, text: str) -> tuple[Polygon, Polygon]:
        """Return the lower left corner of a text placed at the origin, and its size."""
        ends = np.zeros(4)
        self._write(number, text, np.zeros(2))
        if isinstance(self._renderer.GetRenderWindow(), vtkRenderWindow):
            self._texts[number].GetBoundingBox(self._renderer, ends)
        else:  # GetBoundingBox would need a VTK window for the resolution
            properties, box = self._texts[number].GetTextProperty(), [0, 0, 0, 0]
            dpi = round(72 * self._pixels)
            vtkTextRenderer.GetInstance().GetBoundingBox(properties, text, box, dpi)
            ends[:4] = box
        begin, end = ends.reshape(2, 2).T / self._pixels
        return begin, end - begin

    def _write(self, number: int, text: str, place: Polygon) -> None:
        self._texts[number].SetInput(text)
        self._texts[number].SetPosition(*(self._pixels * place).tolist())


class _Polygons(vtkActor2D):
    """Polygons in pixel coordinates of a view."""

    def __init__(self) -> None:
        super().__init__()
        self.SetMapper(vtkPolyDataMapper2D())
        self.VisibilityOff()

    def fill(self, polygons: list[Polygon], colors: list[Any] | None = None) -> None:
        """Replace the polygons and their colours."""
        drawn, flat = vtkPolyData(), np.concatenate([*polygons, np.zeros((0, 2))])
        offsets = np.cumsum([0, *map(len, polygons)], dtype=np.int64)
        drawn.SetPoints(to_points(np.column_stack([flat, np.zeros(len(flat))])))
        drawn.SetPolys(to_ragged(offsets, np.arange(len(flat))))
        if colors:
            drawn.GetCellData().SetScalars(to_array((np.array(colors) * 255).astype(np.uint8)))
        self.GetMapper().SetInputData(drawn)


def _box(low: Polygon, high: Polygon) -> Polygon:
    return np.array([low, [high[0], low[1]], high, [low[0], high[1]]])


def _disc(middle: Polygon, radius: float) -> Polygon:
    turn = np.linspace(0.0, 2 * np.pi, 20, endpoint=False)
    return middle + radius * np.column_stack([np.cos(turn), np.sin(turn)])


def _arrow(begin: Polygon, end: Polygon, letter: float) -> list[Polygon]:
    """Return shaft and head of an arrow; a dot if the arrow points at the eye."""
    vector = end - begin
    size = float(np.hypot(*vector))
    if size < 0.15 * letter:
        return [_disc(begin, 0.22 * letter)]
    along = vector / size
    across = np.array([-along[1], along[0]])
    neck = end - min(0.6 * letter, 0.7 * size) * along
    side, wide = 0.07 * letter * across, 0.25 * letter * across
    return [
        np.array([begin - side, neck - side, neck + side, begin + side]),
        np.array([neck - wide, end, neck + wide]),
    ]
