"""Draw a cloth as a sheet with yarn colours as textures, if its yarns are too small to be modelled.

How it is shaded: `spacemap_vtk.draw.actors.sheet_shaders`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkTexture

from spacemap_vtk.datasets.arrays import (
    copy_rows,
    points_of,
    to_array,
    to_cells,
    to_image,
    to_points,
)
from spacemap_vtk.draw.actors.cloth_appearance import AppearanceTables
from spacemap_vtk.draw.actors.color_values import COLOR_VALUES
from spacemap_vtk.draw.actors.lighting import lighting_code
from spacemap_vtk.draw.actors.sheet_shaders import (
    CODES,
    FRAGMENT_FUNCTIONS,
    VERTEX_FUNCTIONS,
    sheet_constants,
)
from spacemap_vtk.draw.actors.sheet_textures import make_sheet_textures
from spacemap_vtk.draw.actors.surface_actor import (
    STUDIO,
    Span,
    SurfaceActor,
    natural_span,
)
from spacemap_vtk.ndarrays import AnyFloats, Ints
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.styles import Style
from spacemap_vtk.textile.geometry.cloth_texture import grid_lines
from spacemap_vtk.textile.weave.cloth import Cloth

#: Numbers of cells along each side of a simplified sheet. The least is enough for the eye's
#: direction, which differs from cell to cell by a degree.
_FEW_CELLS = (24, 48, 96)
#: Largest error of a simplified sheet's unit vectors, and of its numbers as a share of their range.
_TURNED = 0.02
_NUMBER_ERROR = 0.002

_DECLARED, _COMPUTED = "//VTK::TCoord::Dec", "//VTK::TCoord::Impl"
_VERTEX_INPUTS = """
in vec3 warpMC;
in vec3 weftMC;
"""
_VERTEX = """
  mat3 turned = mat3(MCVCMatrix);
  vec3 place = (MCVCMatrix * vertexMC).xyz;
  lightYarns(place, MCDCMatrix * vertexMC, normalize(turned * warpMC), normalize(turned * weftMC));
"""
_FRAGMENT = """
  gl_FragData[0] = vec4(encoded(sheetLight(tcoordVCVSOutput, diffuseColor)), 1.0);
"""


class SheetActor(SurfaceActor):
    """A cloth drawn as a sheet."""

    def __init__(self) -> None:
        super().__init__()
        mapper = self.GetMapper()
        for name in ("warp", "weft"):
            where = vtkDataObject.FIELD_ASSOCIATION_POINTS
            mapper.MapDataArrayToVertexAttribute(f"{name}MC", name, where, -1)
        self._shown: tuple[Any, ...] | None = None
        self._crossings: NDArray[Any] | None = None
        self.set_background((255, 255, 255), (255, 255, 255))
        self.set_hole_color(None)
        self.set_grain(1)
        self._tables: AppearanceTables | None = None
        self._strength = 0.0
        #: Whether the sheet is flat and only seen from its face; then it is shown sooner.
        self.shows_face = False

    def set_background(self, below: Sequence[int], above: Sequence[int]) -> None:
        """Set the colours of the background, which is visible between yarns."""
        uniforms = self.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform3f("below", [part / 255 for part in below])
        uniforms.SetUniform3f("above", [part / 255 for part in above])

    def set_hole_color(self, color: tuple[float, float, float] | None) -> None:
        """Set the colour that is visible between yarns; None: the background."""
        uniforms = self.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform4f("hole", [0.0] * 4 if color is None else [*color, 1.0])

    def set_grain(self, grain: int) -> None:
        """Set how many drawn pixels, along each side, make one pixel of the finished picture."""
        self.GetShaderProperty().GetFragmentCustomUniforms().SetUniformf("grain", float(grain))

    def show_sheet(
        self,
        sheet: vtkPolyData,
        cloth: Cloth,
        color: str,
        span: Span | None,
        style: Style = STUDIO,
        crossings: NDArray[Any] | None = None,
    ) -> None:
        """Draw the deformed sheet of a cloth."""
        has_numbers = COLORINGS[color].shows_numbers
        numbers = crossings if has_numbers else None
        lighting_style = style if numbers is None else style.for_numbers
        self.show(
            sheet, color if has_numbers else "own", (255, 255, 255), span, style=lighting_style
        )
        if numbers is not None:
            span = span or natural_span(numbers)
            self.update_scale(color, span)
            self.GetMapper().SetScalarVisibility(False)  # the texture contains the colours
            self.color_bar.SetVisibility(True)
        shadows = self._strength > 0.0
        state = cloth, color, None if numbers is None else span, lighting_style, shadows
        if self._shown == state and self._crossings is crossings:
            return
        self._shown, self._crossings = state, crossings
        fragment = self.GetShaderProperty().GetFragmentCustomUniforms()
        scale = None if numbers is None else span
        textures = make_sheet_textures(
            cloth, color, scale, lighting_style, crossings, self._strength, self.shows_face
        )
        fragment.SetUniform2f("crossings", textures.crossings)
        fragment.SetUniformi("averaged", textures.averaged)
        fragment.SetUniform2f("mixing", textures.mixing)
        for name, pixels in textures.layers.items():
            texture = self.GetProperty().GetTexture(name)
            if texture is None:
                texture = _make_texture()
                self.GetProperty().SetTexture(name, texture)
            # The texture is never replaced: see `SurfaceActor._set_texture`.
            texture.SetInputData(to_image(pixels))
        self._set_data("tileNumbers", to_image(textures.tile_numbers))
        self._show_tables(textures.tables)

    def set_shadow_strength(self, strength: float) -> None:
        """Set the strength of the yarns' contact shadows, 0 to 1."""
        self._strength = strength
        shader = self.GetShaderProperty()
        for uniforms in (shader.GetVertexCustomUniforms(), shader.GetFragmentCustomUniforms()):
            uniforms.SetUniformf("shaded", strength)

    def _show_tables(self, tables: AppearanceTables) -> None:
        if tables is self._tables:
            return
        self._tables = tables
        views = vtkImageData()
        views.SetDimensions(tables.views.shape[1], tables.views.shape[0], 1)
        views.GetPointData().SetScalars(to_array(tables.views.reshape(-1, 4), "views"))
        self._set_data("views", views)
        self._set_data("tiles", to_image(tables.tiles))

    def _set_data(self, name: str, image: vtkImageData) -> None:
        """Set a texture of numbers, which are not colours."""
        texture = self.GetProperty().GetTexture(name)
        if texture is None:
            texture = _make_texture()
            texture.UseSRGBColorSpaceOff()
            texture.SetMipmap(name == "tiles")
            self.GetProperty().SetTexture(name, texture)
        texture.SetInputData(image)

    def _apply_style(self, surface: vtkPolyData, style: Style, pixels_per_point: float) -> None:
        light, shader = lighting_code(style, pixels_per_point), self.GetShaderProperty()
        if self._shader_key == (light,):
            return
        self._shader_key = (light,)
        shader.ClearAllShaderReplacements()
        light = sheet_constants() + light
        vertex = f"{_DECLARED}{_VERTEX_INPUTS}{light}{VERTEX_FUNCTIONS}"
        shader.AddVertexShaderReplacement(_DECLARED, True, vertex, False)
        shader.AddVertexShaderReplacement(_COMPUTED, True, _COMPUTED + _VERTEX, False)
        fragment = f"{_DECLARED}\n{light}{CODES}{FRAGMENT_FUNCTIONS}"
        shader.AddFragmentShaderReplacement(_DECLARED, True, fragment, False)
        shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _FRAGMENT, False)
        shader.AddFragmentShaderReplacement(_COMPUTED, True, "", False)


def make_sheet(cloth: Cloth, cells: tuple[int, int]) -> vtkPolyData:
    """Return the flat mid-plane of a cloth as quadrilaterals, with the given columns and rows."""
    x, y = (grid_lines(cloth, number, cells[number]) for number in (0, 1))
    across, up = np.meshgrid(x, y)
    points = np.stack([across, up, np.zeros_like(up)], axis=-1).reshape(-1, 3)
    s, t = np.meshgrid(*(np.linspace(0.0, 1.0, n + 1, dtype=np.float32) for n in cells))
    sheet = vtkPolyData()
    sheet.SetPoints(to_points(points))
    sheet.SetPolys(to_cells(quadrilaterals(*cells)))
    sheet.GetPointData().SetTCoords(to_array(np.stack([s, t], axis=-1).reshape(-1, 2), "texels"))
    add_directions(sheet, cells)
    return sheet


def add_directions(sheet: vtkPolyData, cells: tuple[int, int]) -> None:
    """Add the directions of warp and weft to a deformed sheet as point arrays."""
    points = points_of(sheet).astype(np.float32).reshape(cells[1] + 1, cells[0] + 1, 3)
    for name, axis in (("warp", 0), ("weft", 1)):
        along = np.asarray(np.gradient(points, axis=axis), np.float32)
        sheet.GetPointData().AddArray(to_array(along.reshape(-1, 3), name))


def coarsen_sheet(
    sheet: vtkPolyData,
    cells: tuple[int, int],
    max_cells: int,
    hole: tuple[slice, slice] | None = None,
) -> vtkPolyData:
    """Return a sheet with at most `max_cells` cells along each side, without those in a hole."""
    # Fewer vertices mean less work, because the sheet is lit at its vertices. The hole is given in
    # columns and rows of the original cells.
    lines = [sparse_lines(n, max_cells) for n in cells]
    chosen = (lines[1][:, None] * (cells[0] + 1) + lines[0]).ravel()
    polygons = quadrilaterals(len(lines[0]) - 1, len(lines[1]) - 1)
    if hole is not None:
        columns, rows = (
            (line[:-1] >= hole_range.start) & (line[1:] <= hole_range.stop)
            for line, hole_range in zip(lines, hole, strict=True)
        )
        polygons = polygons[~(rows[:, None] & columns).ravel()]
    coarse = vtkPolyData()
    coarse.SetPoints(to_points(points_of(sheet)[chosen]))
    coarse.SetPolys(to_cells(polygons))
    copy_rows(sheet.GetPointData(), coarse.GetPointData(), chosen)
    return coarse


def simplify_sheet(sheet: vtkPolyData, cells: tuple[int, int], tolerance: float) -> vtkPolyData:
    """Return a sheet with fewer cells that looks the same; `sheet` itself if it bends too much."""
    # Positions differ by at most `tolerance`, in m. OpenGL shades pixels in blocks of 2 x 2, also
    # those of a block that lie outside a triangle: many small triangles take several times as long.
    data, shape = sheet.GetPointData(), (cells[1] + 1, cells[0] + 1, -1)
    columns = [points_of(sheet).reshape(shape) / tolerance]
    for name in ("warp", "weft"):
        along = vtk_to_numpy(data.GetArray(name)).reshape(shape)
        length = np.linalg.norm(along, axis=-1, keepdims=True)
        columns.append(along / np.maximum(length, 1e-30) / _TURNED)
    if (numbers := data.GetArray(COLOR_VALUES)) is not None:
        values = vtk_to_numpy(numbers).reshape(shape)
        columns.append(values / max(float(np.ptp(values)) * _NUMBER_ERROR, 1e-30))
    count = fewest_cells(np.concatenate(columns, axis=-1))
    return sheet if count is None else coarsen_sheet(sheet, cells, count)


def fewest_cells(exact: AnyFloats) -> int | None:
    """Return how many cells along each side are enough for values that may differ by up to 1."""
    # `exact` has the shape (rows + 1, columns + 1, n). None: all cells are needed.
    cells = exact.shape[1] - 1, exact.shape[0] - 1
    for count in _FEW_CELLS:
        if count >= max(cells):
            break
        lines = [sparse_lines(n, count) for n in cells]
        kept = exact[np.ix_(lines[1], lines[0])]
        rebuilt = _interpolate(_interpolate(kept, lines[1], 0), lines[0], 1)
        if np.abs(rebuilt - exact).max() <= 1.0:
            return count
    return None


def _interpolate(values: AnyFloats, lines: Ints, axis: int) -> AnyFloats:
    """Return values at all lines of a sheet from those at some lines."""
    every = np.arange(lines[-1] + 1)
    before = np.clip(np.searchsorted(lines, every, side="right") - 1, 0, len(lines) - 2)
    share = (every - lines[before]) / (lines[before + 1] - lines[before])
    share = share.reshape([-1 if k == axis else 1 for k in range(values.ndim)])
    low, high = values.take(before, axis), values.take(before + 1, axis)
    return np.asarray(low + share * (high - low))


def sparse_lines(cells: int, most: int) -> Ints:
    """Return the lines between cells that remain if there are at most `most` cells."""
    return np.linspace(0, cells, min(cells, most) + 1).astype(np.int64)


def quadrilaterals(columns: int, rows: int) -> Ints:
    """Return the corners of a sheet's cells, row by row, (cells, 4)."""
    place = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    corners = [place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _make_texture() -> vtkTexture:
    texture = vtkTexture()
    texture.UseSRGBColorSpaceOn()  # OpenGL converts texels to linear light before it averages
    texture.SetColorModeToDirectScalars()
    texture.InterpolateOn()
    texture.MipmapOn()
    # Anisotropic filtering in Mesa's software renderer causes stripes and takes 50 % more time.
    texture.SetMaximumAnisotropicFiltering(1.0)
    texture.RepeatOff()
    texture.EdgeClampOn()
    return texture
