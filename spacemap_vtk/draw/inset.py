"""Insets of a picture: where they look, and how they are placed over it in a frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkStaticCellLocator
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.draw.annotate.view_scale import round_length
from spacemap_vtk.draw.camera import Viewpoint, pixels_per_metre_at_focus
from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bytes, Floats
from spacemap_vtk.scenes.insets import Inset
from spacemap_vtk.scenes.settings import View, is_dark
from spacemap_vtk.units import format_quantity

#: Distance of an inset from the edges of the picture, as a share of the picture's height.
_EDGE = 0.025
#: Width of the frame's line, as a share of the picture's height.
_LINE = 0.0035
#: Largest length of the scale bar, as a share of the inset's width.
_LONGEST_BAR = 0.34
#: Height of letters, as a share of the inset's width.
_LETTER = 0.058
#: Where the depth of a place is looked for, until something is found, in widths of the place.
_RADII = (0.0, 0.12, 0.25, 0.5, 1.0)
#: Lines and text are drawn this many times larger, then reduced.
_FINE = 3
#: Coverage of the line below, of 255.
_HALO = 150
_DARK = (52, 60, 70)
_LIGHT = (236, 240, 245)


@dataclass(frozen=True)
class InsetView:
    """Where an inset is in its picture, and what it shows."""

    inset: Inset
    #: Width and height of the inset in pixels.
    side: int
    #: Left and upper edge of the inset in pixels.
    corner: tuple[int, int]
    #: The magnified place in pixels from the left and from above, and its width.
    place: tuple[float, float]
    field: float
    viewpoint: Viewpoint

    @property
    def pixels_per_metre(self) -> float:
        """Scale of the inset at its middle."""
        camera = vtkCamera()
        self.viewpoint.apply_to(camera)
        return pixels_per_metre_at_focus(camera, self.side)


def view_of_inset(
    number: int,
    inset: Inset,
    camera: vtkCamera,
    surface: vtkPolyData,
    size: tuple[int, int],
    scale_width: float = 0.0,
    plates: Sequence[tuple[float, ...]] = (),
) -> InsetView:
    """Return the view of an inset in a picture of a surface with a camera."""
    # `scale_width` is the share of the width that a colour scale takes on the right. `plates` are
    # those of axes, scale bar and time: left, bottom, right and top in pixels.
    width, height = size
    side = max(16, round(inset.size * height))
    if side > width:
        raise _refused(number, "size", inset.size, "the inset is wider than the picture")
    field = side / inset.magnification
    edge = round(_EDGE * height)
    right, upper = inset.corner_of_picture
    free = round((1.0 - scale_width) * width)
    left = free - edge - side if right else edge
    # Beyond the plates in this corner, if there is room.
    heights = [
        height - low if upper else high
        for first, low, last, high in plates
        if first < left + side and last > left and (low > height / 2) == bool(upper)
    ]
    away = math.ceil(max(heights, default=0.0)) + edge
    away = away if away + side + edge <= height else edge
    corner = left, away if upper else height - away - side
    place = inset.place[0] * width, (1.0 - inset.place[1]) * height
    point = _point_at(camera, surface, inset.place, size, field)
    if point is None:
        raise _refused(number, "place", list(inset.place), "there is nothing to magnify here")
    return InsetView(inset, side, corner, place, field, _viewpoint(camera, point, size, field))


def _refused(number: int, key: str, value: object, message: str) -> InputError:
    error = InputError(
        message,
        key=f"insets[{number}].{key}",
        value=value,
        cure="Choose a place on the cloth, as shares of the picture from the left and from below."
        if key == "place"
        else "Make the inset smaller.",
    )
    error.section = View.section
    return error


def _point_at(
    camera: vtkCamera,
    surface: vtkPolyData,
    place: tuple[float, float],
    size: tuple[int, int],
    field: float,
) -> Floats | None:
    """Return the point in the middle of a place, at the depth of what is there or around it."""
    locator = vtkStaticCellLocator()
    locator.SetDataSet(surface)
    locator.BuildLocator()
    from_clip = np.asarray(np.linalg.inv(_matrix(camera, size)), np.float64)
    shift = 2.0 * field / np.array(size)
    for radius in _RADII:
        shares = []
        for angle in np.linspace(0.0, 2 * np.pi, 8 if radius else 1, endpoint=False):
            aside = radius * shift * (math.cos(angle), math.sin(angle))
            first, last = _ray(from_clip, 2.0 * np.array(place) - 1.0 + aside)
            if (share := _first_hit(locator, first, last)) is not None:
                shares.append(share)
        if shares:
            first, last = _ray(from_clip, 2.0 * np.array(place) - 1.0)
            return np.asarray(first + min(shares) * (last - first))
    return None


def _ray(from_clip: Floats, at: Floats) -> Floats:
    """Return the ends of a ray through a point of the picture, at the clipping planes, (2, 3)."""
    ends = np.array([[*at, -1.0, 1.0], [*at, 1.0, 1.0]]) @ from_clip.T
    return np.asarray(ends[:, :3] / ends[:, 3:])


def _first_hit(locator: vtkStaticCellLocator, first: Floats, last: Floats) -> float | None:
    """Return where a line first meets a surface, as a share of its length; None if nowhere."""
    share, part = reference(0.0), reference(0)
    hit = locator.IntersectWithLine(first, last, 0.0, share, [0.0] * 3, [0.0] * 3, part)
    return float(share) if hit else None


def _matrix(camera: vtkCamera, size: tuple[int, int]) -> Floats:
    matrix = camera.GetCompositeProjectionTransformMatrix(size[0] / size[1], -1.0, 1.0)
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def _viewpoint(camera: vtkCamera, point: Floats, size: tuple[int, int], field: float) -> Viewpoint:
    """Return the viewpoint of the same camera, turned or moved to a point of its picture."""
    now = Viewpoint.from_camera(camera)
    share = field / size[1]
    if now.parallel_scale:
        shift = point - now.focus
        back = np.array(camera.GetDirectionOfProjection())
        across = shift - (shift @ back) * back
        position = tuple((now.position + across).tolist())
        focus = tuple((now.focus + across).tolist())
        return now._replace(
            position=position, focus=focus, parallel_scale=share * now.parallel_scale
        )
    away = point - now.position
    depth = float(away @ camera.GetDirectionOfProjection())
    high = share * depth * math.tan(math.radians(now.angle / 2))
    angle = 2 * math.degrees(math.atan(high / float(np.linalg.norm(away))))
    return now._replace(focus=tuple(point.tolist()), angle=angle)


def place_inset(picture: Bytes, drawn: Bytes, shown: InsetView, view: View) -> Bytes:
    """Return a picture with an inset, which has been drawn with coverage, over it."""
    height, width = picture.shape[:2]
    style = view.resolved_style
    ink = _LIGHT if is_dark(style.bottom_color) else _DARK
    mode = "RGB" if picture.shape[2] == 3 else "RGBA"
    page = Image.fromarray(picture, mode).convert("RGBA")
    line = max(1.0, _LINE * height)
    # A wider line of the opposite colour below makes it visible on cloth of any colour.
    below = _DARK if ink == _LIGHT else _LIGHT
    for color, wide in (((*below, _HALO), 3.0 * line), ((*ink, 255), line)):
        lines = Image.new("RGBA", (width * _FINE, height * _FINE))
        _draw_leaders(ImageDraw.Draw(lines), shown, color, wide)
        page.alpha_composite(lines.reduce(_FINE))
    inside = Image.new("RGBA", (shown.side, shown.side), (*style.top_color, 255))
    inside.alpha_composite(Image.fromarray(drawn, "RGBA"))
    if shown.inset.scale_bar:
        inside.alpha_composite(_scale_bar(shown, ink, style.bottom_color))
    outline = Image.new("L", (shown.side * _FINE, shown.side * _FINE))
    _draw_shape(ImageDraw.Draw(outline), shown, (0.0, 0.0), shown.side, fill=255)
    inside.putalpha(outline.reduce(_FINE))
    page.alpha_composite(inside, shown.corner)
    frame = Image.new("RGBA", (width * _FINE, height * _FINE))
    _draw_shape(
        ImageDraw.Draw(frame),
        shown,
        shown.corner,
        shown.side,
        outline=(*ink, 255),
        width=round(1.6 * line * _FINE),
    )
    page.alpha_composite(frame.reduce(_FINE))
    return np.asarray(page.convert(mode))


def _draw_shape(
    pen: ImageDraw.ImageDraw,
    shown: InsetView,
    corner: tuple[float, float],
    side: float,
    **look: object,
) -> None:
    left, top = corner
    box = [_FINE * left, _FINE * top, _FINE * (left + side) - 1, _FINE * (top + side) - 1]
    draw = pen.ellipse if shown.inset.shape == "circle" else pen.rectangle
    draw(box, **look)  # type: ignore[arg-type]


def _draw_leaders(
    pen: ImageDraw.ImageDraw, shown: InsetView, color: tuple[int, int, int, int], line: float
) -> None:
    """Draw the frame of the magnified place, and two lines from it to the inset."""
    width = max(1, round(line * _FINE))
    small, large = 0.5 * shown.field, 0.5 * shown.side
    begin, end = np.array(shown.place), np.array(shown.corner) + large
    corner = begin - small
    _draw_shape(pen, shown, (corner[0], corner[1]), shown.field, outline=color, width=width)
    for first, last in _leaders(shown.inset.shape, begin, small, end, large):
        pen.line([*(_FINE * first).tolist(), *(_FINE * last).tolist()], color, width)


def _leaders(
    shape: str, begin: Floats, small: float, end: Floats, large: float
) -> list[tuple[Floats, Floats]]:
    """Return the ends of the two outer lines that touch the frames of place and inset."""
    vector = end - begin
    if shape == "circle":
        distance = float(np.hypot(*vector))
        if distance <= large - small:
            return []
        # The common tangents: their normals make an angle with the line of the centres.
        along = vector / distance
        across = np.array([-along[1], along[0]])
        cosine = (small - large) / distance
        sine = math.sqrt(1.0 - cosine**2)
        normals = [cosine * along + side * sine * across for side in (-1.0, 1.0)]
        return [(begin + small * normal, end + large * normal) for normal in normals]
    if float(np.abs(vector).max()) <= large - small:
        return []
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    # The lines between corners that leave both squares on one side.
    pairs = [(begin + small * corner, end + large * corner) for corner in corners]
    offsets = [vector[0] * corner[1] - vector[1] * corner[0] for corner in corners]
    return [pairs[int(np.argmin(offsets))], pairs[int(np.argmax(offsets))]]


def _scale_bar(
    shown: InsetView, ink: tuple[int, int, int], below: tuple[int, int, int]
) -> Image.Image:
    """Return a transparent picture of an inset's scale bar, with its length, on a plate."""
    side, scale = shown.side * _FINE, shown.pixels_per_metre * _FINE
    length = round_length(_LONGEST_BAR * side / scale)
    letter = max(9 * _FINE, round(_LETTER * side))
    font, text = ImageFont.load_default(letter), format_quantity(length, "m")
    bar, wide = scale * length, font.getlength(text)
    plate = max(bar, wide) + 1.2 * letter
    low = side - (0.09 if shown.inset.shape == "circle" else 0.05) * side
    made = Image.new("RGBA", (side, side))
    pen = ImageDraw.Draw(made)
    box = [(side - plate) / 2, low - 2.3 * letter, (side + plate) / 2, low]
    pen.rounded_rectangle(box, 0.3 * letter, (*below, 205))
    pen.text((side / 2, low - 1.0 * letter), text, (*ink, 255), font, anchor="ms")
    thick = 0.28 * letter
    pen.rectangle(
        [(side - bar) / 2, low - 0.45 * letter - thick, (side + bar) / 2, low - 0.45 * letter],
        (*ink, 255),
    )
    return made.reduce(_FINE)
