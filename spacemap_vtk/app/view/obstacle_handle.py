"""Handle by which the mouse moves an obstacle and changes its radius.

Three arrows along the axes move the obstacle along them, the ball between them moves it in the
plane of the screen, and a ball on its rim changes the radius. VTK's own widgets are not used: its
point handle can be held in the middle only, and each shape has a widget with other habits.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkCleanPolyData
from vtkmodules.vtkFiltersGeneral import vtkTransformFilter
from vtkmodules.vtkFiltersHybrid import vtkPolyDataSilhouette
from vtkmodules.vtkFiltersSources import vtkArrowSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.draw.actors.surface_actor import rgb
from spacemap_vtk.draw.camera import pixels_per_metre_at_focus, project_points
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.obstacle import Obstacle
from spacemap_vtk.filters.obstacle_surfaces import join_surfaces, obstacle_surface
from spacemap_vtk.mechanics.contact.obstacles import frame_along
from spacemap_vtk.ndarrays import Floats

#: Colours of the arrows along x, y and z, and of the balls and the outline.
_ARROWS = (214, 64, 58), (63, 155, 77), (49, 110, 190)
_COLOR = "#d9642c"
#: Length of an arrow, radius of a ball, and distance at which the mouse holds a part, in pixels.
_LENGTH, _BALL, _REACH = 64.0, 7.0, 9.0
#: The mouse can hold an arrow beyond this share of its length.
_SHAFT = 0.3
#: An arrow that is nearly along the line of sight, within this sine, cannot be dragged.
_END_ON = 0.15
#: Digits of the size of the cage to which places and radii are rounded.
_DIGITS = 1e-3

#: The parts besides the arrows, which are 0, 1 and 2.
CENTER, RADIUS = "center", "radius"


class ObstacleHandle:
    """Arrows, balls and outline of one obstacle; positions of the mouse are in device pixels."""

    def __init__(self, renderer: vtkRenderer, front: vtkRenderer) -> None:
        self._renderer = renderer
        self.outline, self._surface = _make_outline(renderer)
        self.arrows, self.rim = _make_actor(_make_arrows()), _make_actor(_make_ball(1.0))
        self.rim.GetProperty().SetColor(*rgb(_COLOR))
        for actor in (self.outline, self.arrows, self.rim):
            front.AddActor(actor)
        self._cage: vtkUnstructuredGrid | None = None
        self.obstacle: Obstacle | None = None
        #: The held part, see `part_at`; None if the mouse holds none.
        self.held: str | int | None = None
        self._held_from: Obstacle | None = None
        self._held_at = np.zeros(3)
        #: Unit vector from the centre to the ball on the rim.
        self._out = np.array([1.0, 0.0, 0.0])
        self.show(False)

    def place(self, obstacle: Obstacle, cage: vtkUnstructuredGrid) -> None:
        """Show the handle at an obstacle of a cage."""
        self.obstacle, self._cage = obstacle, cage
        self._surface.SetInputData(join_surfaces([obstacle_surface(obstacle.body, cage)]))
        self.show(True)

    def show(self, on: bool) -> None:
        """Show or hide the handle."""
        if not on:
            self.obstacle = self.held = None
        for actor in (self.outline, self.arrows):
            actor.SetVisibility(on)
        self.rim.SetVisibility(
            on and self.obstacle is not None and self.obstacle.radius is not None
        )

    def fit(self, height: int, pixels: float) -> None:
        """Give the handle its size on a screen, of a view with a height in device pixels."""
        if self.obstacle is None:
            return
        if self.held is None:
            self._out = self._rim_direction()
        self.outline.GetProperty().SetLineWidth(2.0 * pixels)
        for actor, place, size in (
            (self.arrows, self._center, _LENGTH * pixels),
            (self.rim, self._rim, _BALL * pixels),
        ):
            actor.SetPosition(*place.tolist())
            actor.SetScale(size * self._metres_per_pixel(place, height))

    def part_at(self, x: float, y: float, pixels: float) -> str | int | None:
        """Return the part at a position: `CENTER`, `RADIUS`, or the axis of an arrow."""
        if self.obstacle is None:
            return None
        mouse, reach = np.array([x, y]), _REACH * pixels
        center = self.project(self._center)
        if self.rim.GetVisibility() and np.linalg.norm(mouse - self.project(self._rim)) <= reach:
            return RADIUS
        if np.linalg.norm(mouse - center) <= reach:
            return CENTER
        length = self.arrows.GetScale()[0]
        for axis, end in enumerate(self._center + length * np.eye(3)):
            along = self.project(end) - center
            share = float((mouse - center) @ along) / (float(along @ along) or 1.0)
            away = np.linalg.norm(mouse - center - share * along)
            end_on = np.linalg.norm(along) < _END_ON * _LENGTH * pixels
            if _SHAFT <= share <= 1.05 and away <= reach and not end_on:
                return axis
        return None

    def hold(self, part: str | int, x: float, y: float) -> None:
        """Begin to drag a part."""
        self.held, self._held_from = part, self.obstacle
        self._held_at = self._follow(x, y)

    def drag(self, x: float, y: float) -> None:
        """Move the obstacle as the mouse has moved since `hold`."""
        assert self._held_from is not None
        assert self._cage is not None
        now, start = self._follow(x, y), self._held_from
        size = float(np.ptp(np.reshape(self._cage.GetBounds(), (3, 2)), axis=1).max())
        step = 10.0 ** np.floor(np.log10(size * _DIGITS))
        if self.held == RADIUS:
            changes: dict[str, Any] = {"radius": _rounded(float(np.linalg.norm(now)), step)}
            self._out = now / np.linalg.norm(now)
        else:
            moved = np.array(start.center) + now - self._held_at
            still = moved == start.center
            changes = {
                "center": [
                    a if kept else _rounded(b, step)
                    for a, b, kept in zip(start.center, moved.tolist(), still, strict=True)
                ]
            }
        try:
            self.place(Obstacle(**{**start._values, **changes}), self._cage)
        except InputError:
            return  # a radius below that of the rounded edges; the last valid one stays

    def release(self) -> dict[str, Any]:
        """End the drag; return the changed values of the obstacle."""
        before, now, self.held = self._held_from, self.obstacle, None
        assert before is not None
        assert now is not None
        return {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in (("center", now.center), ("radius", now.radius))
            if value != getattr(before, key)
        }

    def cancel(self) -> None:
        """End the drag where it began."""
        self.held = None
        if self._held_from is not None and self._cage is not None:
            self.place(self._held_from, self._cage)

    @property
    def _center(self) -> Floats:
        assert self.obstacle is not None
        return np.array(self.obstacle.body["center"])  # at the end of its path

    @property
    def _rim(self) -> Floats:
        """Place of the ball on the rim."""
        assert self.obstacle is not None
        return self._center + (self.obstacle.radius or 0.0) * self._out

    def _rim_direction(self) -> Floats:
        """Return the direction across the line of sight in which the radius is seen best."""
        assert self.obstacle is not None
        camera = self._renderer.GetActiveCamera()
        sight = np.array(camera.GetDirectionOfProjection())
        first = np.array(camera.GetViewUp())
        if self.obstacle.shape in ("cylinder", "disc"):
            axis = frame_along(self.obstacle.axis)[2]
            if np.linalg.norm(np.cross(axis, sight)) > _END_ON:
                first = axis
        across = np.cross(sight, first)
        return np.asarray(across / np.linalg.norm(across))

    def _follow(self, x: float, y: float) -> Floats:
        """Return what the mouse points at: a point, or for a radius the vector to the rim."""
        start = self._held_from
        assert start is not None
        origin = np.array(start.body["center"])
        near, way = self._sight_line(x, y)
        if isinstance(self.held, int):
            # The point of the arrow's line that is nearest to the line of sight.
            axis = np.eye(3)[self.held]
            across = way - (way @ axis) * axis
            hit = near - ((near - origin) @ across) / (across @ across) * way
            return origin + ((hit - origin) @ axis) * axis
        normal = np.array(self._renderer.GetActiveCamera().GetDirectionOfProjection())
        hit = near + ((origin - near) @ normal) / (way @ normal) * way
        if self.held != RADIUS:
            return np.asarray(hit)
        out = hit - origin
        if start.shape in ("cylinder", "disc"):
            axis = frame_along(start.axis)[2]
            out = out - (out @ axis) * axis
        return np.asarray(out)

    def _sight_line(self, x: float, y: float) -> tuple[Floats, Floats]:
        """Return a point and the direction of the line of sight through a position."""
        ends = []
        for depth in (0.0, 1.0):
            self._renderer.SetDisplayPoint(x, y, depth)
            self._renderer.DisplayToWorld()
            *point, w = self._renderer.GetWorldPoint()
            ends.append(np.array(point) / w)
        way = ends[1] - ends[0]
        return ends[0], way / np.linalg.norm(way)

    def project(self, place: Floats) -> Floats:
        """Return the position of a point in device pixels."""
        size = np.array(self._renderer.GetSize())
        camera = self._renderer.GetActiveCamera()
        clip = project_points(camera, place[None], size[0] / max(1, size[1]))[0]
        return np.asarray((clip[:2] / clip[3] + 1.0) / 2.0 * size)

    def _metres_per_pixel(self, place: Floats, height: int) -> float:
        camera = self._renderer.GetActiveCamera()
        at_focus = 1.0 / pixels_per_metre_at_focus(camera, height)
        if camera.GetParallelProjection():
            return at_focus
        sight = np.array(camera.GetDirectionOfProjection())
        depth = (place - camera.GetPosition()) @ sight
        return float(at_focus * max(depth, 0.0) / camera.GetDistance())


def _rounded(length: float, step: float) -> float:
    """Round a length to whole steps, without digits that are rounding."""
    return float(f"{round(length / step) * step:.6g}")


def _make_outline(renderer: vtkRenderer) -> tuple[vtkActor, vtkCleanPolyData]:
    """Make the outline of a surface as the camera sees it, and the filter for the surface."""
    joined, silhouette = vtkCleanPolyData(), vtkPolyDataSilhouette()
    silhouette.SetInputConnection(joined.GetOutputPort())
    silhouette.SetCamera(renderer.GetActiveCamera())
    silhouette.SetEnableFeatureAngle(False)
    silhouette.BorderEdgesOn()  # of a plane
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(silhouette.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.PickableOff()
    actor.GetProperty().SetColor(*rgb(_COLOR))
    actor.GetProperty().LightingOff()
    return actor, joined


def _make_ball(radius: float) -> vtkPolyData:
    source = vtkSphereSource()
    source.SetRadius(radius)
    source.SetThetaResolution(24)
    source.SetPhiResolution(13)
    source.Update()
    return source.GetOutput()


def _make_arrows() -> vtkPolyData:
    """Make arrows of length one along x, y and z, coloured, with a ball between them."""
    source = vtkArrowSource()
    source.SetShaftResolution(16)
    source.SetTipResolution(24)
    source.SetShaftRadius(0.022)
    source.SetTipRadius(0.075)
    source.SetTipLength(0.22)
    joined = vtkAppendPolyData()
    turns = (0.0, (0.0, 0.0, 1.0)), (90.0, (0.0, 0.0, 1.0)), (-90.0, (0.0, 1.0, 0.0))
    for (angle, axis), color in zip(turns, _ARROWS, strict=True):
        turned, transform = vtkTransformFilter(), vtkTransform()
        transform.RotateWXYZ(angle, *axis)
        turned.SetTransform(transform)
        turned.SetInputConnection(source.GetOutputPort())
        turned.Update()
        joined.AddInputData(_colored(turned.GetOutput(), color))
    ball = tuple(round(255 * part) for part in rgb(_COLOR))
    joined.AddInputData(_colored(_make_ball(_BALL / _LENGTH), ball))
    joined.Update()
    return joined.GetOutput()


def _colored(part: vtkPolyData, color: Iterable[int]) -> vtkPolyData:
    colors = np.tile(np.array([*color], np.uint8), (part.GetNumberOfPoints(), 1))
    add_array(part.GetPointData(), "color", colors)
    part.GetPointData().SetActiveScalars("color")
    return part


def _make_actor(data: vtkPolyData) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.PickableOff()
    actor.GetProperty().SetAmbient(0.55)
    actor.GetProperty().SetDiffuse(0.55)
    return actor
