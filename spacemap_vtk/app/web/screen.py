"""The picture in the browser: frames drawn offscreen from the user's viewpoint."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from PIL import Image

from spacemap_vtk.draw.actors.glyphs import cut_of
from spacemap_vtk.draw.camera import (
    Aim,
    CameraView,
    Viewpoint,
    aim_camera,
    aim_of,
    half_height,
    zoom_in,
)
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.draw.offscreen import OffscreenWindow
from spacemap_vtk.draw.scene_view import SceneView, ViewOptions, extent_of
from spacemap_vtk.scenes.cameras import FLAT
from spacemap_vtk.scenes.settings import View

#: JPEG quality of still pictures.
_STILL_QUALITY = 92
#: JPEG quality of moving pictures.
_MOVING_QUALITY = 75
#: Smallest side of the picture, in pixels.
_MIN_SIDE = 64
#: Largest side of the picture, in pixels; larger screens get an enlarged picture.
_MAX_SIDE = 2560
#: Rotation in degrees for a drag across the whole picture, as in VTK.
_TURN = 200.0


class Screen:
    """Draw the latest frame on request."""

    def __init__(self) -> None:
        self.window = OffscreenWindow((960, 720))
        self.scene_view = SceneView(self.window.renderer, has_shadows=False)
        self.window.add_front_prop(self.scene_view.loads.pale_copy)
        self.frame: Frame | None = None
        #: Counter of changes of the picture.
        self.version = 0
        #: Whether the camera is being moved, so that pictures must be quick.
        self.steering = False
        #: Whether the page is dark, which also sets the background if the scene sets none.
        self.dark = False
        self._ratio = 1.0
        self._view = View()
        #: The last camera preset, and the viewpoint it gave.
        self._preset: tuple[Aim | None, Viewpoint] | None = None
        self._drawn: tuple[int, bytes] = 0, b""

    def show_frame(self, frame: Frame, view: View, is_new: bool = False) -> None:
        """Set the frame and its view settings; aim the camera at a scene that is new."""
        first = is_new or self.frame is None
        moved = view.camera != self._view.camera
        self.frame = frame
        self._view = view
        self._refresh()
        if first or moved:
            self.aim(aim_of(view) or frame.camera)

    def resize(self, width: float, height: float, ratio: float, dark: bool) -> None:
        """Set the picture's size in CSS pixels, device pixels per CSS pixel, and the theme."""
        max_ratio = _MAX_SIDE / max(width, height, 1.0)
        self._ratio = min(max(ratio, 0.5), 2.0, max(max_ratio, 0.1))
        size = tuple(max(_MIN_SIDE, round(side * self._ratio)) for side in (width, height))
        self.dark = dark
        self._set_size((size[0], size[1]), self._ratio)
        if self._preset is not None and self._preset[1][:3] == self._place[:3]:
            self.aim(self._preset[0])

    def aim(self, name: Aim | None) -> None:
        """Aim at the whole scene, or from a viewpoint; None keeps the direction."""
        if self.frame is None:
            return
        camera, (width, height) = self.window.camera, self.window.size
        points = extent_of(self.frame, self._view.loads)
        aspect = (1.0 - self.scene_view.scale_width) * width / height
        flat = camera.GetParallelProjection() if name is None else name == FLAT
        if isinstance(name, Viewpoint):
            flat = name.parallel_scale > 0.0
        aim_camera(camera, points, aspect, name, self._view.zoom if name else 1.0)
        camera.SetParallelProjection(flat)
        if not (name == FLAT or (isinstance(name, Viewpoint) and flat)):
            camera.SetParallelScale(half_height(camera))
        self._preset = name, self._place
        self.version += 1

    def steer(self, kind: str, x: float, y: float) -> None:
        """Turn, move or zoom by fractions of the picture's width and height, y upwards."""
        camera = self.window.camera
        if kind == "turn":
            camera.Azimuth(-_TURN * x)
            camera.Elevation(-_TURN * y)
            camera.OrthogonalizeViewUp()
        elif kind == "move":
            width, height = self.window.size
            flat = camera.GetParallelProjection()
            height_m = 2 * (camera.GetParallelScale() if flat else half_height(camera))
            up = np.array(camera.GetViewUp())
            right = np.cross(camera.GetDirectionOfProjection(), up)
            shift = -(right * x * width / height + up * y) * height_m
            camera.SetPosition(*(camera.GetPosition() + shift).tolist())
            camera.SetFocalPoint(*(camera.GetFocalPoint() + shift).tolist())
        else:
            zoom_in(camera, min(max(x, 0.1), 10.0))
        self.set_steering(True)
        self.version += 1

    def set_steering(self, steering: bool) -> None:
        """Set whether the camera is being moved, so that drawing must be quick."""
        if steering != self.steering:
            self.steering = steering
            self.scene_view.set_moving(steering)
            self.version += 1

    @property
    def camera_view(self) -> CameraView | None:
        """Camera and size of the picture; None before the first frame."""
        return (
            None
            if self._preset is None
            else CameraView(self._place, self.scene_view.scale_width, self.window.size)
        )

    @property
    def picture(self) -> bytes:
        """The picture as JPEG; drawn again only after a change."""
        if self.frame is not None and self._drawn[0] != self.version:
            moving = self.steering or self.frame.coarse
            # With software rendering, smooth edges cost as much as everything else.
            self.window.renderer.SetUseFXAA(not moving)
            self.window.renderer.ResetCameraClippingRange()
            self.window.render(front=self._view.loads)
            file = io.BytesIO()
            image = Image.fromarray(np.ascontiguousarray(self.window.pixels()[..., :3]))
            quality: dict[str, Any] = {"quality": _MOVING_QUALITY if moving else _STILL_QUALITY}
            image.save(file, "JPEG", **quality, subsampling=2 if moving else 0)
            self._drawn = self.version, file.getvalue()
        return self._drawn[1]

    def draw_file(self, frame: Frame, view: View, size: tuple[int, int] | None) -> bytes:
        """Draw a frame from the present viewpoint, and return it as PNG."""
        # A picture with other proportions shows all that the page shows, and more.
        shown, place = (self.frame, self._view, self.window.size, self._ratio), self._place
        steering, version = self.steering, self.version
        width, height = size or self.window.size
        now_width, now_height = self.window.size
        self.steering, self.frame, self._view = False, frame, view
        try:
            enlargement = min(width / now_width, height / now_height)
            self._set_size((width, height), self._ratio * enlargement)
            narrower = now_width / now_height * height / width
            place.widen(max(1.0, narrower)).apply_to(self.window.camera)
            self.window.renderer.SetUseFXAA(True)
            self.window.renderer.ResetCameraClippingRange()
            self.window.render(front=view.loads)
            image = Image.fromarray(np.ascontiguousarray(self.window.pixels()[..., :3]))
        finally:
            self.steering, (self.frame, self._view, size, ratio) = steering, shown
            self._set_size(size, ratio)
            place.apply_to(self.window.camera)
            self.version = version
        file = io.BytesIO()
        image.save(file, "PNG")
        return file.getvalue()

    def close(self) -> None:
        """Free the window."""
        self.window.close()

    def _set_size(self, size: tuple[int, int], ratio: float) -> None:
        self.window.size, self._ratio = size, ratio
        self.window.render_window.SetSize(*size)
        self.window.render_window.SetDPI(round(72 * ratio))
        self._refresh()

    def _refresh(self) -> None:
        frame, view = self.frame, self._view
        if frame is None:
            return
        view = view.for_window(self.dark)
        width, height = self.window.size
        units = round(width / self._ratio), max(540, round(height / self._ratio) * 3 // 4)
        self.scene_view.fit(view, units, self._ratio, self._ratio * view.line_scale)
        options = ViewOptions(fabric=view.show != "cage", cage=frame.cage is not None)
        options.cage = options.cage and view.show != "fabric"
        cut = cut_of(view, frame.surface)
        self.scene_view.show(frame, view, options, self.scene_view.span_of(frame), cut)
        self.scene_view.set_moving(self.steering)
        self.version += 1

    @property
    def _place(self) -> Viewpoint:
        return Viewpoint.from_camera(self.window.camera)
