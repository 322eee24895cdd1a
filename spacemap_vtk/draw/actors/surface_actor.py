"""Draw the surface of a scene in any colouring, with a scale for colours that show numbers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLookupTable
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkTextProperty, vtkTexture

from spacemap_vtk.datasets.arrays import color_array_name, to_array
from spacemap_vtk.draw.actors.color_values import COLOR_VALUES, round_ticks, scale_unit
from spacemap_vtk.draw.actors.lighting import (
    LOOK_ATTRIBUTE,
    lighting_code,
    set_fibre_samples,
    set_fibres,
    set_lighting,
)
from spacemap_vtk.filters.patch_tessellator import LOOK, STRANDS
from spacemap_vtk.ndarrays import Bytes
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.settings import is_dark
from spacemap_vtk.scenes.styles import STYLES, Style
from spacemap_vtk.units import typeset_units

#: Colours of warp and weft, if the families have different colours.
FAMILIES = ("#2f7fb0", "#e2a03f")
#: Colours of yarns, used in turn, if the yarns have different colours.
YARNS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb")
#: Colours of each colouring by class; "jammed" has one colour for free and one for jammed yarns.
CLASSES = {"family": FAMILIES, "yarn": YARNS, "jammed": ("#b9c4cf", "#c8372d")}
#: Colours of numbers, from the lowest to the highest.
RAMP = ("#2c1e5c", "#3b528b", "#21908d", "#5dc963", "#fde725")

Span = tuple[float, float]
STUDIO = STYLES["studio"]
Rgb = tuple[float, float, float]
#: VTK_FONT_FILE, a constant that VTK does not export to Python: the font is read from a file.
_FONT_FILE = 4
#: Opacity of the plate behind text.
PLATE = 0.8


class Lighting(NamedTuple):
    """The lighting of a surface."""

    #: Whether the surface has faces that are lit; lines and dots have none.
    has_faces: bool
    #: Whether fibres are shaded.
    fibres: bool
    #: Whether points have an exposure and a relative brightness.
    looks: bool
    style: Style
    #: Pixels per point, the unit of line widths.
    pixels_per_point: float


class SurfaceActor(vtkActor):
    """The surface of a fabric or object; `bar` is the scale of its colours."""

    def __init__(self, samples: int = 0) -> None:
        super().__init__()
        #: Samples of fibres along each side of a pixel; 0: always one, fixed in the shader.
        self._samples = samples
        self._mapper = vtkPolyDataMapper()
        # Shaders need lengths in world coordinates, and outlines share this mapper's buffers. With
        # VTK's shift and scale both would be wrong.
        self._mapper.SetVBOShiftScaleMethod(0)
        self.SetMapper(self._mapper)
        #: Arguments from which the current shader was made; empty before the first surface.
        self._shader_key: tuple[object, ...] = ()
        #: Lighting of the surface; None before the first surface.
        self.lighting: Lighting | None = None
        self._texture: vtkTexture | None = None
        self._table = vtkLookupTable()
        self.color_bar = make_color_bar()
        self.color_bar.SetLookupTable(self._table)

    def show(
        self,
        surface: vtkPolyData,
        color: str,
        plain_color: Sequence[int] = (185, 196, 207),
        span: Span | None = None,
        picture: vtkImageData | None = None,
        style: Style = STUDIO,
        pixels_per_point: float = 1.0,
    ) -> None:
        """Draw a surface; points are the unit of line widths."""
        mapper, points, cells = self._mapper, surface.GetPointData(), surface.GetCellData()
        numbers = points.GetArray(COLOR_VALUES)
        shown_span: Span | None = None
        mapper.SetScalarVisibility(True)
        if numbers is not None:
            values = vtk_to_numpy(numbers)
            shown_span = span or natural_span(values)
            # Labels of the scale are the numbers themselves, so these are in the scale's unit.
            size = self.update_scale(color, shown_span)
            points.AddArray(to_array(values / np.float32(size), "in unit"))
            mapper.SetScalarModeToUsePointFieldData()
        elif color in CLASSES and cells.GetArray(color) is not None:
            count = int(cells.GetArray(color).GetRange()[1]) + 1
            colors = np.resize(rgb_table(CLASSES[color]), (count, 3))
            self._color_by(color, colors, (0, count - 1))
            mapper.SetScalarModeToUseCellFieldData()
        else:
            self._show_own(surface, plain_color, picture)
        self._set_texture(picture if shown_span is None and color == "own" else None)
        self.color_bar.SetVisibility(shown_span is not None)
        mapper.SetInputData(surface)
        self._apply_style(
            surface, style if shown_span is None else style.for_numbers, pixels_per_point
        )

    def update_scale(self, color: str, span: Span) -> float:
        """Set unit, labels and title of the scale; return the size of its unit in SI units."""
        name, size = scale_unit(color, max(map(abs, span)))
        ends = span[0] / size, span[1] / size
        self._color_by("in unit", ramp_table(), ends)
        self.color_bar.SetCustomLabels(to_array(np.array(round_ticks(*ends))))
        self.color_bar.SetTitle(color_bar_title(color, name))
        return size

    def _apply_style(self, surface: vtkPolyData, style: Style, pixels_per_point: float) -> None:
        """Light a surface in a style; lines and dots without normals stay unlit."""
        has_faces = surface.GetPointData().GetNormals() is not None
        has_faces |= (
            surface.GetNumberOfPolys() + surface.GetNumberOfStrips() == surface.GetNumberOfCells()
        )
        # Fibres need a style with sheen: styles with outlines draw smooth yarns, and the style for
        # numbers shows no fibres that could change the colours.
        fibres = style.sheen > 0.0 and surface.GetPointData().HasArray(STRANDS) == 1
        looks = has_faces and surface.GetPointData().HasArray(LOOK) == 1
        self.lighting = Lighting(has_faces, fibres, looks, style, pixels_per_point)
        shader_key = has_faces, fibres, looks, lighting_code(style, pixels_per_point)
        if shader_key != self._shader_key:
            self._shader_key = shader_key
            self.GetShaderProperty().ClearAllShaderReplacements()
            self._mapper.RemoveVertexAttributeMapping(LOOK_ATTRIBUTE)
            if has_faces:
                set_lighting(self, shader_key[3], self._mapper if looks else None)
            set_fibres(self, self._mapper, fibres, self._samples > 0)
            if fibres and self._samples:
                set_fibre_samples(self, self._samples)

    def set_samples(self, side: int) -> None:
        """Set the number of samples of fibres along each side of a pixel."""
        if side != self._samples:
            self._samples = side
            set_fibre_samples(self, side)

    def _set_texture(self, picture: vtkImageData | None) -> None:
        if picture is None:
            self.SetTexture(None)
            return
        # The texture is kept for ever, because freeing one can deadlock: VTK's garbage collector
        # holds a global lock and needs the window's OpenGL context; Python, which provides it, may
        # switch to a thread that waits for that lock.
        if self._texture is None:
            self._texture = vtkTexture()
            self._texture.InterpolateOn()
            self._texture.MipmapOn()
            self._texture.RepeatOn()
        if self._texture.GetInput() is not picture:
            self._texture.SetInputData(picture)
        self.SetTexture(self._texture)

    def _show_own(
        self, surface: vtkPolyData, plain_color: Sequence[int], picture: vtkImageData | None
    ) -> None:
        mapper, stored = self._mapper, own_colors(surface)
        if picture is not None:  # VTK would multiply the picture by the surface's colours
            stored, plain_color = None, (255, 255, 255)
        mapper.SetScalarVisibility(stored is not None)
        self.GetProperty().SetColor(*(part / 255 for part in plain_color))
        if stored is not None:
            belongs_to_points, name = stored
            if belongs_to_points:
                mapper.SetScalarModeToUsePointFieldData()
            else:
                mapper.SetScalarModeToUseCellFieldData()
            mapper.SetColorModeToDirectScalars()
            mapper.SelectColorArray(name)

    def _color_by(self, name: str, colors: Bytes, span: Span) -> None:
        table = self._table
        table.SetNumberOfTableValues(len(colors))
        table.SetTableRange(*span)
        for number, color in enumerate((colors / 255).tolist()):
            table.SetTableValue(number, *color, 1.0)
        self._mapper.SetColorModeToMapScalars()
        self._mapper.SetLookupTable(table)
        self._mapper.UseLookupTableScalarRangeOn()
        self._mapper.SelectColorArray(name)


def natural_span(values: np.ndarray) -> Span:
    """Return the ends of a scale that contains all numbers and 0."""
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    # A tiny negative clearance is rounding, not an overlap of yarns, and must not move the end.
    low = 0.0 if -low < 0.02 * high else low
    if low == 0.0 and high > 0.0:
        # The scale ends at a round number.
        size = 10.0 ** np.floor(np.log10(high))
        high = next(float(n * size) for n in (1, 2, 4, 6, 8, 10) if high <= n * size * (1 + 1e-6))
    return (low, high) if high > low else (0.0, 1e-9)


def ramp_colors(values: np.ndarray, span: Span) -> np.ndarray:
    """Return the colours of numbers on a scale: red, green and blue, 0 to 255."""
    steps = 256 * (values - span[0]) / (span[1] - span[0])
    return ramp_table()[np.clip(steps, 0, 255).astype(np.intp)]


def own_colors(surface: vtkPolyData) -> tuple[bool, str] | None:
    """Return whether a surface's stored colours belong to points, and their array name, or None."""
    cell_array, point_array = (
        color_array_name(d) for d in (surface.GetCellData(), surface.GetPointData())
    )
    name = cell_array or point_array
    return None if name is None else (cell_array is None, name)


def make_color_bar() -> vtkScalarBarActor:
    """Return a hidden scale for the right edge of a view."""
    bar = vtkScalarBarActor()
    bar.UseCustomLabelsOn()
    # VTK 9.6 replaced printf formats by those of std::format.
    bar.SetLabelFormat("{:.3g}" if "{" in bar.GetLabelFormat() else "%.3g")
    bar.SetUnconstrainedFontSize(True)
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        set_font(text)
        text.SetItalic(False)
        text.SetBold(False)
        text.SetShadow(False)
    bar.SetHeight(0.5)
    bar.SetVisibility(False)
    return bar


def set_font(text: vtkTextProperty) -> None:
    """Set the font to DejaVu Sans, as in figures and plots and on most Linux desktops."""
    if file := _find_font():
        text.SetFontFamily(_FONT_FILE)
        text.SetFontFile(file)


@cache
def _find_font() -> str:
    """Return the path of DejaVu Sans, or an empty text; the search takes 1.5 ms."""
    spec = find_spec("matplotlib")  # installed with PyVista; only its folder is needed
    file = Path((spec and spec.origin) or "").parent / "mpl-data/fonts/ttf/DejaVuSans.ttf"
    return str(file) if file.is_file() else ""


def text_colors(background: Sequence[int]) -> tuple[Rgb, Rgb]:
    """Return the colours of text on a background, and of the plate behind the text."""
    red, green, blue = (part / 255 for part in background)
    text = (0.95, 0.965, 0.98) if is_dark(background) else (0.11, 0.13, 0.16)
    return text, (red, green, blue)


def color_bar_title(color: str, unit: str) -> str:
    """Return the title of a scale, broken into short lines."""
    quantity, _, which = COLORINGS[color].label.partition(", ")
    lines = [quantity, *([which] if len(which) <= len("Displacement") else which.split())]
    return "\n".join(line for line in (*lines, unit and f"[{typeset_units(unit)}]") if line)


def color_bar_share(size: tuple[float, float]) -> float:
    """Return the width of the scale at the right edge, as a share of the picture's width."""
    return min(0.36, max(104.0, 0.21 * size[1]) / max(1, size[0]))


def font_size(size: tuple[int, int]) -> int:
    """Return the font size for a picture, in pixels."""
    return max(12, size[1] // 38)


def fit_color_bar(
    bar: vtkScalarBarActor, size: tuple[int, int], background: Sequence[int], pixels: float = 1.0
) -> None:
    """Fit size, position and colours of a scale to a picture."""
    (width, height), share = size, color_bar_share(size)
    edge = 0.7 * font_size(size) / max(1, width)  # margin of the plate behind the scale
    bar.SetPosition(1.0 - share + edge, 0.25)
    bar.SetWidth(share - edge)
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        text.SetFontSize(font_size(size))
        text.SetColor(*text_colors(background)[0])
    bar.SetMaximumWidthInPixels(round(pixels * share * width))
    bar.SetVerticalTitleSeparation(round(pixels * max(6, height // 90)))
    bar.SetTextPad(round(pixels * max(3, height // 200)))


def rgb(color: str) -> tuple[float, float, float]:
    """Return red, green and blue of ``"#rrggbb"``, 0 to 1."""
    red, green, blue = bytes.fromhex(color[1:])
    return red / 255, green / 255, blue / 255


def rgb_table(colors: Sequence[str]) -> Bytes:
    """Return red, green and blue of colours ``"#rrggbb"``, 0 to 255, (n, 3)."""
    return np.array([list(bytes.fromhex(color[1:])) for color in colors], np.uint8)


def ramp_table() -> Bytes:
    """Return the colours of numbers from the lowest to the highest, (256, 3)."""
    stops = rgb_table(RAMP)
    at, places = np.linspace(0, len(stops) - 1, 256), np.arange(len(stops))
    return np.stack([np.interp(at, places, part) for part in stops.T], axis=1).astype(np.uint8)
