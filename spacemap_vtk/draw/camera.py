"""Where a picture is seen from, and by what light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera, vtkLight, vtkRenderer, vtkRenderWindow

from spacemap_vtk.ndarrays import AnyFloats, Floats, Singles
from spacemap_vtk.scenes.settings import CAMERAS, FLAT

#: How much of what is up must be seen of it: nearer to a pole no camera turns.
_POLE = 0.01


def upward(name: str) -> int:
    """Return which axis is up for a camera."""
    return 2 if name == "lying" else 1


def seen_from(name: str, up: int) -> Floats:
    """Return the way to a camera, and what is up in its picture, where an axis is up, (2, 3)."""
    way = np.array(CAMERAS[name])
    if up == 2 and name not in ("lying", FLAT):
        way = way[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    return way


def stand_upright(camera: vtkCamera, up: int, before: Viewpoint | None = None) -> None:
    """Have a camera turn about an axis, as on a turntable; what is over a pole goes back."""
    axis = np.eye(3)[up]
    if before is not None and np.dot(camera.GetViewUp(), axis) < _POLE:
        before.take(camera)
    height = -float(np.dot(camera.GetDirectionOfProjection(), axis))
    if abs(height) > 1.0 - 0.4 * _POLE**2:  # nothing is up there
        camera.OrthogonalizeViewUp()
        camera.Elevation(-float(np.sign(height)))
    camera.SetViewUp(*axis)


class Viewpoint(NamedTuple):
    """Where a camera stands, in m."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float]
    parallel_scale: float = 0.0
    """Half the height of what a parallel projection shows; 0 for perspective."""

    @classmethod
    def of(cls, camera: vtkCamera) -> Viewpoint:
        """Return where a camera stands."""
        scale = camera.GetParallelScale() if camera.GetParallelProjection() else 0.0
        return cls(camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp(), scale)

    def take(self, camera: vtkCamera) -> None:
        """Let a camera stand here."""
        camera.SetPosition(*self.position)
        camera.SetFocalPoint(*self.focus)
        camera.SetViewUp(*self.up)
        camera.SetParallelProjection(bool(self.parallel_scale))
        if self.parallel_scale:
            camera.SetParallelScale(self.parallel_scale)


#: Full opening of the lens, in degrees.
VIEW_ANGLE = 24.0


class Seen(NamedTuple):
    """What a view looks at."""

    place: Viewpoint
    #: Share of the width by which the middle of the picture is aside.
    aside: float
    #: Width and height in pixels.
    size: tuple[int, int]

    @property
    def camera(self) -> vtkCamera:
        """A camera of its own that sees the same."""
        camera = vtkCamera()
        camera.SetViewAngle(VIEW_ANGLE)
        self.place.take(camera)
        camera.SetWindowCenter(self.aside, 0.0)
        return camera


#: Share of the picture left free at each edge, and by `FLAT`.
_MARGIN, _FLAT_MARGIN = 0.06, 0.01


#: Place, strength and colour of each light of what no style lights (signs, ghosts, lines), in the
#: camera's coordinates: it looks along -z, y is up.
LIGHTS = (
    ((-0.9, 1.0, 0.9), 0.85, (1.0, 0.98, 0.94)),
    ((1.0, 0.1, 0.8), 0.30, (0.90, 0.94, 1.0)),
    ((0.0, 0.0, 1.0), 0.15, (1.0, 1.0, 1.0)),
)


def lit_renderer() -> vtkRenderer:
    """Return a renderer that lights what it draws."""
    renderer = vtkRenderer()
    renderer.AutomaticLightCreationOff()
    for position, intensity, color in LIGHTS:
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*position)
        light.SetIntensity(intensity)
        light.SetColor(*color)
        renderer.AddLight(light)
    return renderer


def set_background(renderer: vtkRenderer, below: Sequence[int], above: Sequence[int]) -> None:
    """Let the background go from one colour to another."""
    renderer.GradientBackgroundOn()
    renderer.SetBackground(*(part / 255 for part in below))
    renderer.SetBackground2(*(part / 255 for part in above))


def front_of(window: vtkRenderWindow, renderer: vtkRenderer) -> vtkRenderer:
    """Return a renderer that draws over another one, through the same camera."""
    front = vtkRenderer()
    front.AutomaticLightCreationOff()
    front.SetActiveCamera(renderer.GetActiveCamera())
    front.SetLayer(1)
    front.InteractiveOff()
    window.SetNumberOfLayers(2)
    window.AddRenderer(front)
    return front


def aim(
    camera: vtkCamera, points: Floats, aspect: float, name: str | None, zoom: float, axis: int = 1
) -> None:
    """Place the camera so that the points just fill the picture; an axis is up for its name."""
    if name is None:
        ways = np.subtract(camera.GetPosition(), camera.GetFocalPoint()), camera.GetViewUp()
    else:
        ways = tuple(seen_from(name, axis))
    direction, up = (np.array(v) / np.linalg.norm(v) for v in ways)
    right = np.cross(up, direction)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    axes = np.stack([right, up, direction])
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    slope = np.tan(np.radians(VIEW_ANGLE / 2)) * (1 - 2 * _MARGIN)
    # What is near looks larger, so the middle of the picture is not that of the scene: a few
    # rounds of placing the camera and centring what it sees.
    for _ in range(4):
        across, above, toward = (seen - middle).T
        # A point is in the picture if |across| <= slope * (distance - toward), above likewise.
        distance = max(
            float((np.abs(across) / (slope * aspect) + toward).max()),
            float((np.abs(above) / slope + toward).max()),
        )
        for axis, offset in enumerate((across, above)):
            ratio = offset / (distance - toward)
            middle[axis] += (ratio.min() + ratio.max()) / 2 * distance
    focus = middle @ axes
    camera.SetFocalPoint(*focus.tolist())
    camera.SetPosition(*(focus + direction * distance / zoom).tolist())
    camera.SetViewUp(*up.tolist())
    camera.SetViewAngle(VIEW_ANGLE)
    if name == FLAT:
        _flatten(camera, points[:, :2], aspect, zoom)


def nearer(camera: vtkCamera, factor: float) -> None:
    """Look from so many times as near."""
    if camera.GetParallelProjection():
        camera.SetParallelScale(camera.GetParallelScale() / factor)
    else:
        camera.Dolly(factor)


def half_height(camera: vtkCamera) -> float:
    """Return half the height of what a camera shows in perspective, at its focus."""
    return camera.GetDistance() * float(np.tan(np.radians(camera.GetViewAngle() / 2)))


def _flatten(camera: vtkCamera, seen: Floats, aspect: float, zoom: float) -> None:
    """Take the perspective away, and with it most of the margin."""
    across, above = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    half = 0.5 * float((np.ptp(seen, axis=0) / (aspect, 1.0)).max()) / (1 - 2 * _FLAT_MARGIN)
    camera.SetPosition(across, above, camera.GetPosition()[2])
    camera.SetFocalPoint(across, above, camera.GetFocalPoint()[2])
    camera.SetParallelProjection(True)
    camera.SetParallelScale(half / zoom)


def metres_from(camera: vtkCamera, depths: Singles) -> Singles:
    """Return how far from a camera is what OpenGL has these depths of; nan where nothing is."""
    near, far = camera.GetClippingRange()
    distance = depths * np.float32(far - near)
    if camera.GetParallelProjection():
        distance += np.float32(near)
    else:
        np.subtract(np.float32(far), distance, out=distance)
        np.divide(np.float32(near * far), distance, out=distance)
    distance[depths >= 1.0] = np.nan
    return distance


def pixels_of(camera: vtkCamera, height: float) -> float:
    """Return how many pixels of a picture's height a metre has at the camera's focus."""
    flat = camera.GetParallelProjection()
    return height / (2 * (camera.GetParallelScale() if flat else half_height(camera)))


def projected(camera: vtkCamera, points: AnyFloats, aspect: float) -> Floats:
    """Return homogeneous places of points, (n, 4): in the picture x and y are within w."""
    matrix = camera.GetCompositeProjectionTransformMatrix(aspect, -1.0, 1.0)
    table = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    return np.column_stack([points, np.ones(len(points))]) @ table.T
