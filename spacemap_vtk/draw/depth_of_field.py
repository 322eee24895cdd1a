"""Depth of field: a picture is the mean of pictures from points all over the camera's lens.

Each of these cameras looks in the same direction, and its picture is shifted so that the plane of
focus stays in place (P. Haeberli and K. Akeley, "The accumulation buffer: hardware support for
high-quality rendering", SIGGRAPH 1990). Light is added, not displayed values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import AnyFloats, Bytes, Floats, Progress
from spacemap_vtk.scenes.settings import View

#: Number of points on the lens.
LENS_POINTS = 64
#: Distance from the middle of the picture over half its height, at which points count as there.
_MIDDLE = 0.04
#: Steps of a sequence that fills a square evenly.
_EVEN = np.array([0.7548776662466927, 0.5698402909980532])
#: Angle from each point of a spiral to the next one, with which they are spread evenly over a disc
#: (H. Vogel, Mathematical Biosciences 44, 1979).
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


def lens_points(count: int) -> Floats:
    """Return points spread evenly over the unit disc, shape (count, 2)."""
    number = np.arange(count)
    radius, angle = np.sqrt((number + 0.5) / count), number * _GOLDEN_ANGLE
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _places_in_pixel(count: int) -> Floats:
    """Return places spread evenly over a pixel, from -1/2 to 1/2, shape (count, 2)."""
    # The steps are 1/g and 1/g² for the root g of x³ = x + 1.
    return np.asarray(np.arange(1, count + 1)[:, None] * _EVEN % 1.0 - 0.5)


def focus_distance(viewpoint: Viewpoint, focus: Sequence[float] | None) -> float:
    """Return the distance [m] of the plane of focus from the lens."""
    ahead = np.subtract(viewpoint.focus, viewpoint.position)
    middle = float(np.linalg.norm(ahead))
    if focus is None:
        return middle
    distance = float(np.subtract(focus, viewpoint.position) @ ahead) / middle
    if distance <= 0.0:
        error = InputError(
            "the point in focus is behind the camera",
            key="focus",
            value=list(focus),
            cure="Choose a point in the picture, or another camera.",
        )
        error.section = View.section
        raise error
    return distance


def point_in_middle(viewpoint: Viewpoint, points: AnyFloats) -> Floats:
    """Return the nearest of points (n, 3) that are about in the middle of the picture, (3,)."""
    ahead = np.subtract(viewpoint.focus, viewpoint.position)
    ahead /= np.linalg.norm(ahead)
    from_eye = points - np.array(viewpoint.position)
    depth = from_eye @ ahead
    aside = np.linalg.norm(from_eye - depth[:, None] * ahead, axis=1) / np.abs(depth)
    aside[depth <= 0.0] = np.inf
    near = _MIDDLE * math.tan(math.radians(viewpoint.angle / 2))
    chosen = np.flatnonzero(aside <= max(near, float(aside.min())))
    return np.asarray(points[chosen[depth[chosen].argmin()]], np.float64)


def distance_in_focus(viewpoint: Viewpoint, view: View, points: AnyFloats | None) -> float:
    """Return the distance [m] of what is sharp: as the view says, else in the middle."""
    focus = view.focus
    if focus is None and points is not None and len(points):
        focus = point_in_middle(viewpoint, points).tolist()
    return focus_distance(viewpoint, focus)


def mean_over_lens(
    camera: vtkCamera,
    view: View,
    size: tuple[int, int],
    draw: Callable[[Callable[[], None]], Bytes],
    report_progress: Progress = lambda _: None,
    points: AnyFloats | None = None,
) -> Bytes:
    """Return the mean of the pictures that `draw` returns for all points of a view's lens."""
    # Sharp is the focus of the view, else what is in the middle of the picture of points (n, 3).
    # `draw` gets a function that places the camera; `size` is that of the picture in pixels. Each
    # picture is also shifted within a pixel, so that the mean has smooth edges.
    viewpoint = Viewpoint.from_camera(camera)
    distance = distance_in_focus(viewpoint, view, points)
    back = np.subtract(viewpoint.position, viewpoint.focus)
    back /= np.linalg.norm(back)
    right = np.cross(viewpoint.up, back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right)])
    high = distance * math.tan(math.radians(viewpoint.angle / 2))
    half = np.array([high * size[0] / size[1], high])
    center = camera.GetWindowCenter()
    light: Floats | float = 0.0
    cover: Floats | float = 0.0
    places = 0.5 * view.aperture * distance * lens_points(LENS_POINTS)
    pixels = 2.0 * _places_in_pixel(LENS_POINTS) / size
    for number, (on_lens, pixel) in enumerate(zip(places, pixels, strict=True)):
        report_progress(number / LENS_POINTS)
        shift, middle = on_lens @ axes, center - on_lens / half + pixel

        def place(shift: Floats = shift, middle: Floats = middle) -> None:
            camera.SetPosition(*(viewpoint.position + shift).tolist())
            camera.SetFocalPoint(*(viewpoint.focus + shift).tolist())
            camera.SetWindowCenter(*middle.tolist())

        picture = draw(place).astype(np.float64)
        # Without background, the fourth number is the coverage of a pixel.
        opaque = picture[..., 3:] if picture.shape[2] == 4 else np.full((1, 1, 1), 255.0)
        light = light + opaque * np.square(picture[..., :3])
        cover = cover + opaque
    viewpoint.apply_to(camera)
    camera.SetWindowCenter(*center)
    colors = np.sqrt(light / np.maximum(cover, 1e-9))
    if np.size(cover) > 1:
        colors = np.concatenate([colors, cover / LENS_POINTS], axis=2)
    return np.rint(colors).astype(np.uint8)
