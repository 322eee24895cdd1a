"""A cloth whose yarns are too small to be seen, drawn as a sheet with its colours as textures.

The sheet is lit as its yarns would be. A tube's half that is seen holds normals all round its axis,
so that its mean light is not that of a plane: it is summed up over the part of the half that its
neighbour does not hide, at each vertex, for tubes of both families, on top and between others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkTexture

from spacemap_vtk.datasets.arrays import (
    points_of,
    take_arrays,
    to_array,
    to_cells,
    to_image,
    to_points,
)
from spacemap_vtk.draw.lighting import light_of
from spacemap_vtk.draw.surface_actor import (
    CLASSES,
    STUDIO,
    Span,
    SurfaceActor,
    natural_span,
    ramp_colors,
    rgb_table,
)
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.faces import grid_lines, layers, tubes
from spacemap_vtk.ndarrays import Bytes, Ints
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.styles import Style

#: Layers of `spacemap_vtk.fabric.faces.layers`, as the shader calls them.
_LAYERS = ("warpOver", "weftOver", "warpUnder", "weftUnder")

_VERTEX_DECLARATIONS = """
//VTK::TCoord::Dec
in vec3 warpMC;
in vec3 weftMC;
out vec4 lightVS[4];  // the root of what falls on it, and what shines white
out vec4 coverVS;  // of warp and weft, on top and between
out vec2 tiltVS;
out float heightVS;
"""

_VERTEX_FUNCTIONS = """
// The mean light of tubes along an axis; and what they cover.
vec4 tubes(vec3 along, vec3 up, vec3 eye, float aspect, float cover, float slope, out float covered)
{
  vec4 sum = vec4(0.0);
  float weights = 0.0;
  covered = 0.0;
  vec3 run = along - dot(along, eye) * eye, across = eye - dot(eye, along) * along;
  float wide = aspect / cover * max(dot(across, up) / length(across), 0.05);
  for (int way = -1; way <= 1; way += 2)
  {
    vec3 axis = normalize(along + float(way) * tan(slope) * up);
    vec3 normal = normalize(up - dot(up, axis) * axis);
    vec3 seen = eye - dot(eye, axis) * axis;
    float weight = length(seen);  // parts that turn towards the eye are seen larger
    seen /= weight;
    weight *= dot(seen, normal) > 0.0 ? 1.0 : 0.1;
    float c = max(dot(seen, normal), 0.05);
    vec3 aside = normal - dot(normal, seen) * seen;
    float s = length(aside);
    aside = s > 1e-4 ? aside / s : normalize(cross(axis, seen));
    // In units of the height; from the lower horizon on, what the neighbour leaves to be seen.
    float flat_ = 0.5 * (aspect - 1.0) * c;
    float whole = 1.0 + 2.0 * flat_;
    float pitch = aspect / cover * c;
    float part = min(whole, pitch);
    // Where it rises, a yarn that is seen from aside runs askew, and hides more.
    vec3 askew = axis - dot(axis, eye) * eye;
    float skew = dot(run, askew) / (length(run) * length(askew));
    covered += 0.5 * min(1.0, whole / (wide * max(skew, 0.3)));
    weights += weight;
    const int SAMPLES = 12;
    for (int k = 0; k < SAMPLES; ++k)
    {
      float x = 0.5 * whole - part * (float(k) + 0.5) / float(SAMPLES);
      float first = 2.0 * (x + flat_);
      float sine = clamp(first < s ? first : max(s, 2.0 * (x - flat_)), -1.0, 1.0);
      vec3 n = sqrt(1.0 - sine * sine) * seen + sine * aside;
      vec4 light = lit(n, eye);
      sum += weight * vec4(sqrt(light.rgb), light.a) / float(SAMPLES);
    }
  }
  return sum / weights;
}
"""

_VERTEX = """
//VTK::TCoord::Impl
  vec3 positionVC = (MCVCMatrix * vertexMC).xyz;
  vec4 place = MCDCMatrix * vertexMC;
  bool parallel = abs(place.w + positionVC.z) > 1e-4 * abs(positionVC.z);
  vec3 eye = parallel ? vec3(0.0, 0.0, 1.0) : normalize(-positionVC);
  vec3 warp = normalize(mat3(MCVCMatrix) * warpMC), weft = normalize(mat3(MCVCMatrix) * weftMC);
  vec3 up = normalize(cross(weft, warp));
  up = dot(up, eye) < 0.0 ? -up : up;
  vec4 a = aspectAndCover;
  vec3 overWarp = eye - dot(eye, warp) * warp, overWeft = eye - dot(eye, weft) * weft;
  tiltVS = vec2(dot(overWarp, up) / length(overWarp), dot(overWeft, up) / length(overWeft));
  tiltVS = 1.0 - tiltVS * tiltVS;
  lightVS[0] = tubes(warp, up, eye, a.x, a.z, slopes.x, coverVS.x);
  lightVS[1] = tubes(weft, up, eye, a.y, a.w, slopes.y, coverVS.y);
  lightVS[2] = tubes(warp, up, eye, a.x, a.z, slopes.z, coverVS.z);
  lightVS[3] = tubes(weft, up, eye, a.y, a.w, slopes.w, coverVS.w);
  heightVS = 0.5 + 0.5 * place.y / place.w;
"""

_FRAGMENT_DECLARATIONS = """
//VTK::TCoord::Dec
in vec4 lightVS[4];
in vec4 coverVS;
in vec2 tiltVS;
in float heightVS;
"""

_FRAGMENT = """
  vec4 texels[4] = vec4[4](
    texture(warpOver, tcoordVCVSOutput, 2.5), texture(weftOver, tcoordVCVSOutput, 2.5),
    texture(warpUnder, tcoordVCVSOutput, 2.5), texture(weftUnder, tcoordVCVSOutput, 2.5));
  for (int k = 0; k < 4; ++k)  // each is multiplied by its share
  {
    vec4 light = vec4(lightVS[k].rgb * lightVS[k].rgb, lightVS[k].a);
    vec3 hue = diffuseColor * texels[k].rgb / max(texels[k].a, 1e-3);
    texels[k].rgb = texels[k].a * seen(hue, light, lined);
  }
  int top = gl_FrontFacing ? 0 : 2;  // what lies under on one face lies on top on the other
  // Contact shadows are the deeper, the rarer a family lies on top.
  float often = texture(warpOver, tcoordVCVSOutput, 5.0).a;
  often = gl_FrontFacing ? often : 1.0 - often;
  vec2 q = vec2(often, 1.0 - often), tilted = 1.0 - 0.22 * min(tiltVS, 0.5);
  vec2 over = tilted * (1.0 - 0.26 * (1.0 - q) * (1.0 - q)), under = tilted * (0.36 + 0.6 * q);
  over = mix(vec2(1.0), over, shaded);
  under = mix(vec2(1.0), under, shaded);
  vec2 k = coverVS.xy, between = coverVS.zw;
  vec4 yarns = over.x * k.x * texels[top] + over.y * k.y * texels[top + 1]
    + under.x * (1.0 - k.y) * between.x * texels[2 - top]
    + under.y * (1.0 - k.x) * between.y * texels[3 - top];
  float open = dot(q, (1.0 - k) * (1.0 - between.yx));
  gl_FragData[0] = vec4(yarns.rgb + open * mix(below, above, heightVS), 1.0);
"""


class SheetActor(SurfaceActor):
    """A cloth as a sheet."""

    def __init__(self) -> None:
        super().__init__()
        mapper = self.GetMapper()
        for name in ("warp", "weft"):
            where = vtkDataObject.FIELD_ASSOCIATION_POINTS
            mapper.MapDataArrayToVertexAttribute(f"{name}MC", name, where, -1)
        self._shown: tuple[Any, ...] | None = None
        self._crossings: NDArray[Any] | None = None
        self.behind((255, 255, 255), (255, 255, 255))

    def behind(self, below: Sequence[int], above: Sequence[int]) -> None:
        """Take the colours of the background, which is seen between yarns."""
        uniforms = self.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform3f("below", [part / 255 for part in below])
        uniforms.SetUniform3f("above", [part / 255 for part in above])

    def show_sheet(
        self,
        sheet: vtkPolyData,
        cloth: Cloth,
        color: str,
        span: Span | None,
        style: Style = STUDIO,
        crossings: NDArray[Any] | None = None,
    ) -> None:
        """Draw a cloth's sheet, where it has been moved to."""
        scaled = COLORINGS[color].numbers
        numbers = crossings if scaled else None
        worn = style if numbers is None else style.of_numbers
        self.show(sheet, color if scaled else "own", (255, 255, 255), span, style=worn)
        if numbers is not None:
            span = span or natural_span(numbers)
            self.scale(color, span)
            self.GetMapper().SetScalarVisibility(False)  # they are in the texture
            self.bar.SetVisibility(True)
        wanted = cloth, color, None if numbers is None else span
        if self._shown == wanted and self._crossings is crossings:
            return
        self._shown, self._crossings = wanted, crossings
        warp, weft = tubes(cloth)
        vertex = self.GetShaderProperty().GetVertexCustomUniforms()
        vertex.SetUniform4f("aspectAndCover", [warp.aspect, weft.aspect, warp.cover, weft.cover])
        slopes = [warp.slope_over, weft.slope_over, warp.slope_under, weft.slope_under]
        vertex.SetUniform4f("slopes", slopes)
        if crossings is None:
            colors = _colors(cloth, color)
        else:
            colors = _of_crossings(crossings, color, wanted[2])
        for name, pixels in zip(
            _LAYERS, layers(cloth.drawdown, *colors, cloth.layers), strict=True
        ):
            texture = self.GetProperty().GetTexture(name)
            if texture is None:
                texture = _texture()
                self.GetProperty().SetTexture(name, texture)
            # the same one for good, see `SurfaceActor`
            texture.SetInputData(to_image(pixels))

    def shade(self, depth: float) -> None:
        """Have the contact shadows of yarns, so deep."""
        self.GetShaderProperty().GetFragmentCustomUniforms().SetUniformf("shaded", depth)

    def _wear(self, surface: vtkPolyData, style: Style, point: float) -> None:
        light, shader = light_of(style, point), self.GetShaderProperty()
        if self._worn == (light,):
            return
        self._worn = (light,)
        shader.ClearAllShaderReplacements()
        for tag, text in (
            ("//VTK::TCoord::Dec", _VERTEX_DECLARATIONS + light + _VERTEX_FUNCTIONS),
            ("//VTK::TCoord::Impl", _VERTEX),
        ):
            shader.AddVertexShaderReplacement(tag, True, text, False)
        for tag, text in (
            ("//VTK::TCoord::Dec", _FRAGMENT_DECLARATIONS + light),
            ("//VTK::Light::Impl", _FRAGMENT),
            ("//VTK::TCoord::Impl", ""),
        ):
            shader.AddFragmentShaderReplacement(tag, True, text, False)


def sheet_of(cloth: Cloth, cells: tuple[int, int]) -> vtkPolyData:
    """Return the middle of a cloth as quadrilaterals, flat."""
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
    """Put on a sheet which way its yarns run, where it has been moved to."""
    points = points_of(sheet).astype(np.float32).reshape(cells[1] + 1, cells[0] + 1, 3)
    for name, axis in (("warp", 0), ("weft", 1)):
        along = np.asarray(np.gradient(points, axis=axis), np.float32)
        sheet.GetPointData().AddArray(to_array(along.reshape(-1, 3), name))


def thinned(
    sheet: vtkPolyData, cells: tuple[int, int], most: int, hole: tuple[slice, slice] | None = None
) -> vtkPolyData:
    """Return a sheet of at most so many cells along each side, without those in a hole."""
    # Its shader works at vertices. The hole is said in columns and rows of the cells as they are.
    lines = [np.linspace(0, n, min(n, most) + 1).astype(np.int64) for n in cells]
    chosen = (lines[1][:, None] * (cells[0] + 1) + lines[0]).ravel()
    polygons = quadrilaterals(len(lines[0]) - 1, len(lines[1]) - 1)
    if hole is not None:
        columns, rows = (
            (line[:-1] >= some.start) & (line[1:] <= some.stop)
            for line, some in zip(lines, hole, strict=True)
        )
        polygons = polygons[~(rows[:, None] & columns).ravel()]
    made = vtkPolyData()
    made.SetPoints(to_points(points_of(sheet)[chosen]))
    made.SetPolys(to_cells(polygons))
    take_arrays(sheet.GetPointData(), made.GetPointData(), chosen)
    return made


def quadrilaterals(columns: int, rows: int) -> Ints:
    """Return the corners of the cells of a sheet, row by row, (cells, 4)."""
    place = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    corners = [place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _colors(cloth: Cloth, color: str) -> tuple[Bytes, Bytes]:
    """Return the colours of ends and picks, white where they are not shown."""
    if color == "own":
        return cloth.warp.colors, cloth.weft.colors
    if color not in ("family", "yarn"):
        white = np.full((1, 3), 255, np.uint8)
        return white, white
    ends, picks = cloth.size
    palette = rgb_table(CLASSES[color])
    numbers = np.repeat([0, 1], cloth.size) if color == "family" else np.arange(ends + picks)
    chosen = palette[numbers % len(palette)]
    return chosen[:ends], chosen[ends:]


def _of_crossings(crossings: NDArray[Any], color: str, span: Span | None) -> tuple[Bytes, Bytes]:
    """Return the colours of ends and picks at each crossing."""
    if span is None:
        found = rgb_table(CLASSES[color])[crossings.astype(np.uint8)]
    else:
        found = ramp_colors(crossings, span)
    return found[0], found[-1]


def _texture() -> vtkTexture:
    texture = vtkTexture()
    texture.SetColorModeToDirectScalars()
    texture.InterpolateOn()
    texture.MipmapOn()
    # Mesa's software makes stripes of it, and takes half as long again.
    texture.SetMaximumAnisotropicFiltering(1.0)
    texture.RepeatOff()
    texture.EdgeClampOn()
    return texture
