"""Place cameras, convert between metres and pixels, and light renderers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera, vtkLight, vtkRenderer, vtkRenderWindow

from spacemap_vtk.ndarrays import AnyFloats, Floats, Ints, Singles
from spacemap_vtk.scenes.cameras import CAMERAS, FLAT, VIEW_ANGLE
from spacemap_vtk.scenes.saved_cameras import SavedCamera
from spacemap_vtk.scenes.settings import View

#: Least component of the camera's up vector along the up axis: cameras turn no nearer to a pole.
_POLE = 0.01
#: A camera that is rolled by less than this, as 1 minus a cosine, is upright.
_ROLL = 1e-4


def camera_up_axis(aim: Aim) -> int:
    """Return the index of the up axis for a camera."""
    if isinstance(aim, Viewpoint):
        return int(np.abs(aim.up).argmax())
    return 2 if aim == "lying" else 1


def camera_directions(name: str, up: int) -> Floats:
    """Return the direction to a named camera and its up direction, for an up axis, (2, 3)."""
    directions = np.array(CAMERAS[name])
    if up == 2 and name not in ("lying", FLAT):
        directions = directions[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    return directions


def keep_upright(camera: vtkCamera, up: int, before: Viewpoint | None = None) -> None:
    """Align a camera with the up axis, like a turntable; a turn over a pole is undone."""
    axis = np.eye(3)[up]
    if before is not None and np.dot(camera.GetViewUp(), axis) < _POLE:
        before.apply_to(camera)
    height = -float(np.dot(camera.GetDirectionOfProjection(), axis))
    if abs(height) > 1.0 - 0.4 * _POLE**2:  # at the pole, the up axis has no direction in the view
        camera.OrthogonalizeViewUp()
        camera.Elevation(-float(np.sign(height)))
    camera.SetViewUp(*axis)


class Viewpoint(NamedTuple):
    """The placement of a camera, in m."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float]
    parallel_scale: float = 0.0
    """Half the height of the visible area in parallel projection, in m; 0 for perspective."""
    angle: float = VIEW_ANGLE
    """Vertical view angle of the camera, in degrees."""

    @classmethod
    def from_camera(cls, camera: vtkCamera) -> Viewpoint:
        """Return the placement of a camera."""
        scale = camera.GetParallelScale() if camera.GetParallelProjection() else 0.0
        placement = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
        return cls(*placement, scale, camera.GetViewAngle())

    @classmethod
    def from_json(cls, numbers: Sequence[Any]) -> Viewpoint:
        """Return the viewpoint in a JSON list; older lists lack the angle."""
        position, focus, up = [(float(x), float(y), float(z)) for x, y, z in numbers[:3]]
        return cls(position, focus, up, *map(float, numbers[3:]))

    def apply_to(self, camera: vtkCamera) -> None:
        """Place a camera at this viewpoint."""
        camera.SetPosition(*self.position)
        camera.SetFocalPoint(*self.focus)
        camera.SetViewUp(*self.up)
        camera.SetViewAngle(self.angle)
        camera.SetParallelProjection(bool(self.parallel_scale))
        if self.parallel_scale:
            camera.SetParallelScale(self.parallel_scale)

    @classmethod
    def from_saved(cls, camera: SavedCamera) -> Viewpoint:
        """Return the placement of a saved camera."""
        scale = 0.0 if camera.height is None else camera.height / 2
        return cls(camera.position, camera.focal_point, camera.up, scale, camera.angle)

    def as_saved(self, axis: int) -> dict[str, Any]:
        """Return the values of a saved camera at this viewpoint; `axis` is up in the scene."""
        # The axis itself is easier to read than the camera's up direction, unless the camera has
        # been rolled, or looks along the axis.
        ahead, upright = np.subtract(self.focus, self.position), np.eye(3)[axis]
        across = np.cross(ahead, upright)
        own = np.cross(ahead, self.up)
        sine = np.linalg.norm(across) / np.linalg.norm(ahead)
        turned = across @ own / (np.linalg.norm(across) * np.linalg.norm(own) or 1.0)
        up = upright if sine > _POLE and turned > 1.0 - _ROLL else np.array(self.up)
        values: dict[str, Any] = {
            "position": _round_values(self.position),
            "focal_point": _round_values(self.focus),
            "up": _round_values(up),
        }
        if self.parallel_scale:
            values["height"] = _round_values([2 * self.parallel_scale])[0]
        elif abs(self.angle - VIEW_ANGLE) > 1e-9:
            values["angle"] = _round_values([self.angle])[0]
        return values

    def turned(self, angle: float, axis: int, about: Floats | None = None) -> Viewpoint:
        """Return this viewpoint, turned about an axis through a point by an angle in degrees."""
        # The point, (3,), is the focus by default.
        cosine, sine = float(np.cos(np.radians(angle))), float(np.sin(np.radians(angle)))
        matrix = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        matrix[[first, first, second, second], [first, second, first, second]] = (
            *(cosine, -sine),
            *(sine, cosine),
        )
        middle = np.array(self.focus if about is None else about)
        position, focus = (
            tuple((middle + matrix @ np.subtract(place, middle)).tolist())
            for place in (self.position, self.focus)
        )
        up = tuple((matrix @ np.array(self.up)).tolist())
        return self._replace(position=position, focus=focus, up=up)

    def widen(self, factor: float) -> Viewpoint:
        """Return this viewpoint with a field of view that is `factor` times as high."""
        slope = factor * np.tan(np.radians(self.angle / 2))
        angle = float(np.degrees(2 * np.arctan(slope)))
        return self._replace(parallel_scale=factor * self.parallel_scale, angle=angle)


#: Where a camera is: the name of one that shows the whole scene, or a viewpoint.
Aim = str | Viewpoint


def aim_of(view: View) -> Aim | None:
    """Return where the camera of a view is; None if that follows from the scene."""
    saved = view.saved_camera
    return view.camera if saved is None else Viewpoint.from_saved(saved)


class CameraView(NamedTuple):
    """The viewpoint and size of a view."""

    viewpoint: Viewpoint
    #: Horizontal offset of the picture's centre, as in vtkCamera.SetWindowCenter.
    offset: float
    #: Width and height in pixels.
    size: tuple[int, int]

    @classmethod
    def from_camera(cls, camera: vtkCamera, size: tuple[int, int]) -> CameraView:
        """Return the view of a picture with a size, through a camera."""
        return cls(Viewpoint.from_camera(camera), camera.GetWindowCenter()[0], size)

    @property
    def camera(self) -> vtkCamera:
        """A new camera with this view."""
        camera = vtkCamera()
        self.viewpoint.apply_to(camera)
        camera.SetWindowCenter(self.offset, 0.0)
        return camera


#: Margin of the picture at each edge, as a share of the picture, in perspective.
_MARGIN = 0.06
#: The same for the camera `FLAT`.
_FLAT_MARGIN = 0.01

#: Position, intensity and colour of each light for objects that no style lights (arrows, ghosts,
#: lines), in the camera's coordinates: it looks along -z, y is up.
LIGHTS = (
    ((-0.9, 1.0, 0.9), 0.85, (1.0, 0.98, 0.94)),
    ((1.0, 0.1, 0.8), 0.30, (0.90, 0.94, 1.0)),
    ((0.0, 0.0, 1.0), 0.15, (1.0, 1.0, 1.0)),
)


def make_renderer() -> vtkRenderer:
    """Return a renderer with lights."""
    renderer = vtkRenderer()
    if hasattr(renderer, "SetUseOIT"):
        # VTK would blend translucent surfaces pixel by pixel, so that edges in front of them, which
        # share pixels with them, would be white.
        renderer.SetUseOIT(False)
    add_lights(renderer)
    return renderer


def add_lights(renderer: vtkRenderer) -> None:
    """Add the lights of `LIGHTS` to a renderer."""
    renderer.AutomaticLightCreationOff()
    for position, intensity, color in LIGHTS:
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*position)
        light.SetIntensity(intensity)
        light.SetColor(*color)
        renderer.AddLight(light)


def set_background(renderer: vtkRenderer, below: Sequence[int], above: Sequence[int]) -> None:
    """Set a background gradient from one colour at the bottom to another at the top."""
    renderer.GradientBackgroundOn()
    renderer.SetBackground(*(part / 255 for part in below))
    renderer.SetBackground2(*(part / 255 for part in above))


def add_front_renderer(window: vtkRenderWindow, renderer: vtkRenderer) -> vtkRenderer:
    """Return a renderer that draws in front of another one, with the same camera."""
    front = vtkRenderer()
    front.AutomaticLightCreationOff()
    front.SetActiveCamera(renderer.GetActiveCamera())
    front.SetLayer(1)
    front.InteractiveOff()
    window.SetNumberOfLayers(2)
    window.AddRenderer(front)
    return front


def aim_camera(
    camera: vtkCamera, points: Floats, aspect: float, name: Aim | None, zoom: float, axis: int = 1
) -> None:
    """Place a camera so that the points just fill the picture, or at a viewpoint."""
    # `axis` is up for a named camera; without a name, the camera keeps its direction.
    if isinstance(name, Viewpoint):
        name.apply_to(camera)
        zoom_in(camera, zoom)
        return
    if name is None:
        directions = np.subtract(camera.GetPosition(), camera.GetFocalPoint()), camera.GetViewUp()
    else:
        directions = tuple(camera_directions(name, axis))
    direction, up = (np.array(v) / np.linalg.norm(v) for v in directions)
    right = np.cross(up, direction)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    axes = np.stack([right, up, direction])
    coordinates = points @ axes.T
    middle = (coordinates.min(axis=0) + coordinates.max(axis=0)) / 2
    slope = np.tan(np.radians(VIEW_ANGLE / 2)) * (1 - 2 * _MARGIN)
    # Near points look larger, so the centre of the picture is not the centre of the scene. A few
    # rounds of placing the camera and centring the picture converge.
    for _ in range(4):
        across, above, toward = (coordinates - middle).T
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
        _use_parallel_projection(camera, points[:, :2], aspect, zoom)


def _round_values(values: Sequence[float] | Floats) -> list[float]:
    """Round numbers to six digits of the largest."""
    largest = max(map(abs, values)) or 1.0
    digits = 5 - int(np.floor(np.log10(largest)))
    return [round(float(value), digits) + 0.0 for value in values]


def zoom_in(camera: vtkCamera, factor: float) -> None:
    """Move a camera nearer by a factor, or zoom in by it without perspective."""
    if camera.GetParallelProjection():
        camera.SetParallelScale(camera.GetParallelScale() / factor)
    else:
        camera.Dolly(factor)


def half_height(camera: vtkCamera) -> float:
    """Return half the height [m] of the visible area at the focus of a perspective camera."""
    return camera.GetDistance() * float(np.tan(np.radians(camera.GetViewAngle() / 2)))


def _use_parallel_projection(camera: vtkCamera, points: Floats, aspect: float, zoom: float) -> None:
    """Switch to parallel projection, with a smaller margin."""
    across, above = 0.5 * (points.min(axis=0) + points.max(axis=0))
    half = 0.5 * float((np.ptp(points, axis=0) / (aspect, 1.0)).max()) / (1 - 2 * _FLAT_MARGIN)
    camera.SetPosition(across, above, camera.GetPosition()[2])
    camera.SetFocalPoint(across, above, camera.GetFocalPoint()[2])
    camera.SetParallelProjection(True)
    camera.SetParallelScale(half / zoom)


def depths_to_metres(camera: vtkCamera, depths: Singles) -> Singles:
    """Convert OpenGL's depths to distances from the camera [m]; NaN where nothing is drawn."""
    near, far = camera.GetClippingRange()
    distance = depths * np.float32(far - near)
    if camera.GetParallelProjection():
        distance += np.float32(near)
    else:
        np.subtract(np.float32(far), distance, out=distance)
        np.divide(np.float32(near * far), distance, out=distance)
    distance[depths >= 1.0] = np.nan
    return distance


def pixels_per_metre_at_focus(camera: vtkCamera, height: float) -> float:
    """Return the pixels per metre at the camera's focus, in a picture of some height."""
    parallel = camera.GetParallelProjection()
    return height / (2 * (camera.GetParallelScale() if parallel else half_height(camera)))


def pixels_per_metre(camera: vtkCamera, points: Floats, height: int) -> float:
    """Return the pixels per metre at the nearest of some points, in a picture of some height."""
    if camera.GetParallelProjection():
        return pixels_per_metre_at_focus(camera, height)
    away = (points - camera.GetPosition()) @ np.array(camera.GetDirectionOfProjection())
    near = max(float(away.min()), 1e-3 * camera.GetDistance())
    return pixels_per_metre_at_focus(camera, height) * camera.GetDistance() / near


def project_points(camera: vtkCamera, points: AnyFloats, aspect: float) -> Floats:
    """Return clip coordinates of points, (n, 4); points in the picture have |x| and |y| <= w."""
    matrix = camera.GetCompositeProjectionTransformMatrix(aspect, -1.0, 1.0)
    table = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    return np.column_stack([points, np.ones(len(points))]) @ table.T


def refit_viewpoint(
    viewpoint: Viewpoint,
    objects: Sequence[tuple[AnyFloats, Ints]],
    aspect: float,
    new_aspect: float,
) -> Viewpoint:
    """Return a viewpoint that shows the same content in a picture of another aspect ratio."""
    # Each thing is the corners of its cells, and the index of each cell's first corner. The visible
    # part becomes as large as the new picture allows, and the centre stays. If nothing is visible,
    # the height stays.
    camera = vtkCamera()
    viewpoint.apply_to(camera)
    reach = np.zeros(2)
    for points, first in objects:
        if not len(points):
            continue
        clip = project_points(camera, points, aspect)
        w = clip[:, 3:]
        # Corners behind the camera count as beyond all edges of the picture.
        xy = np.where(w > 0.0, clip[:, :2] / np.where(w > 0.0, w, 1.0), [[np.inf, np.inf]])
        low, high = (op.reduceat(xy, first, axis=0) for op in (np.minimum, np.maximum))
        visible = ((low < 1.0) & (high > -1.0)).all(axis=1)
        far = np.minimum(np.maximum(-low, high), 1.0)[visible]
        reach = np.maximum(reach, far.max(axis=0, initial=0.0))
    largest = float(reach.max())
    if largest == 0.0:
        return viewpoint
    return viewpoint.widen(max(float(reach[0]) * aspect / new_aspect, float(reach[1])) / largest)
