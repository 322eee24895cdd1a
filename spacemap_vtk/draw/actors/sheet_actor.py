"""Draw a cloth as a sheet with yarn colours as textures, if its yarns are too small to be seen.

The sheet is lit like its yarns. The visible half of a tube has normals in all directions around its
axis, so its mean light differs from that of a plane. The light is therefore summed at each vertex
over the part of this half that the neighbouring tube does not hide, for tubes of both families, on
top and between others.

A pixel shows the exact mean of the crossings in it, weighted by their areas in the pixel, in linear
light: half black and half white gives the sRGB value 188. OpenGL's filters cannot do this. The mip
levels of a texture whose size is not a power of two leave out rows and columns, so that one of two
alternating colours can vanish, and they blur over several pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkTexture

from spacemap_vtk.datasets.arrays import (
    copy_rows,
    points_of,
    to_array,
    to_cells,
    to_image,
    to_points,
)
from spacemap_vtk.draw.actors.lighting import lighting_code
from spacemap_vtk.draw.actors.surface_actor import (
    CLASSES,
    STUDIO,
    Span,
    SurfaceActor,
    natural_span,
    ramp_colors,
    rgb_table,
)
from spacemap_vtk.ndarrays import Bytes, Ints
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import LONGEST_ROW
from spacemap_vtk.scenes.styles import Style
from spacemap_vtk.textile.geometry.cloth_texture import color_layers, grid_lines, yarn_shading
from spacemap_vtk.textile.weave.cloth import Cloth

#: Names of the textures. The first two contain the colours of yarns where they lie on top, and 0
#: elsewhere. The last two contain the colours everywhere, with alpha 1 where the yarn lies on top.
#: Means over several crossings need all four, a single texel only the last two.
_LAYERS = ("warpOver", "weftOver", "warpColors", "weftColors")
#: Number of mip levels that are exact means: the sides of a texture are multiples of 2 to this
#: power.
_LEVELS = 6
#: Largest number of texels that a pixel sums. Beyond it, the next coarser mip level is used.
_MOST_TEXELS = 1024
#: Number of samples along each side of a pixel if single yarns are drawn.
_POINTS = 4
#: Fraction by which contact shadows darken a yarn where it lies deepest.
_SHADOW = 0.8

_VERTEX_DECLARATIONS = """
//VTK::TCoord::Dec
in vec3 warpMC;
in vec3 weftMC;
out vec4 lightVS[4];  // mean reflected light of warp and weft, on top and between
out vec4 coverVS;  // cover of warp and weft, on top and between
out vec2 tiltVS;
out float heightVS;
out vec3 warpVS, weftVS, eyeVS;
"""

_VERTEX_FUNCTIONS = """
// Mean light that tubes along an axis reflect; `covered` is the share of the area that they cover.
vec4 tubes(vec3 along, vec3 up, vec3 eye, float aspect, float cover, float slope, out float covered)
{
  vec4 sum = vec4(0.0);
  float weights = 0.0;
  covered = 0.0;
  vec3 run = along - dot(along, eye) * eye, across = eye - dot(eye, along) * along;
  float wide = aspect / cover * max(dot(across, up) / length(across), 0.05);
  for (int side = -1; side <= 1; side += 2)
  {
    vec3 axis = normalize(along + float(side) * tan(slope) * up);
    vec3 normal = normalize(up - dot(up, axis) * axis);
    vec3 toEye = eye - dot(eye, axis) * axis;
    float weight = length(toEye);  // parts that face the eye look larger
    toEye /= weight;
    weight *= dot(toEye, normal) > 0.0 ? 1.0 : 0.1;
    float c = max(dot(toEye, normal), 0.05);
    vec3 aside = normal - dot(normal, toEye) * toEye;
    float s = length(aside);
    aside = s > 1e-4 ? aside / s : normalize(cross(axis, toEye));
    // In units of the tube's height. `part` is the visible part, from the lower horizon up to the
    // neighbour.
    float flat_ = 0.5 * (aspect - 1.0) * c;
    float whole = 1.0 + 2.0 * flat_;
    float pitch = aspect / cover * c;
    float part = min(whole, pitch);
    // A rising yarn looks askew from the side, and hides more.
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
      vec3 n = sqrt(1.0 - sine * sine) * toEye + sine * aside;
      sum += weight * reflectedLight(n, eye) / float(SAMPLES);
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
  warpVS = warp;
  weftVS = weft;
  eyeVS = eye;
"""

_FRAGMENT_DECLARATIONS = """
//VTK::TCoord::Dec
in vec4 lightVS[4];
in vec4 coverVS;
in vec2 tiltVS;
in float heightVS;
in vec3 warpVS, weftVS, eyeVS;
"""

_FRAGMENT_FUNCTIONS = (
    f"""
const float LEVELS = {float(_LEVELS)}, MOST_TEXELS = {float(_MOST_TEXELS)};
"""
    + """
// Convert sRGB to linear light, and back.
vec3 decoded(vec3 code)
{
  return mix(code / 12.92, pow((code + 0.055) / 1.055, vec3(2.4)), step(0.04045, code));
}

vec3 encoded(vec3 light)
{
  return mix(12.92 * light, 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, light));
}
"""
)

_RESOLVED_FUNCTIONS = (
    f"""
const int POINTS = {_POINTS};
const float SHADOW = {_SHADOW};
"""
    + """
// Height and slope of a yarn's axis at a place between two crossings.
vec2 axis_at(float along, float pitch, float flat_, float here, float next)
{
  float room = max(pitch - 2.0 * flat_, 1e-3 * pitch);
  float part = 3.14159265 * clamp((abs(along) * pitch - flat_) / room, 0.0, 1.0);
  float slope = (next - here) * 0.5 * sin(part) * 3.14159265 / room;
  return vec2(mix(here, next, 0.5 - 0.5 * cos(part)), along < 0.0 ? -slope : slope);
}

// Sine and cosine of the angle of a section's normal at a place across it; z is 1 inside, else 0.
vec3 section_at(float across, float halfWidth, float radius)
{
  float beyond = max(abs(across) - (halfWidth - radius), 0.0) / radius;
  float sine = min(beyond, 1.0);
  return vec3(across < 0.0 ? -sine : sine, sqrt(1.0 - sine * sine), beyond <= 1.0 ? 1.0 : 0.0);
}

// Light of the upper yarn at a place, found from the heights of both yarns.
vec3 yarn_at(vec2 place, vec3 hue, vec3 warp, vec3 weft, vec3 up, vec3 eye, vec3 open)
{
  ivec2 last = ivec2(crossings) - 1;
  ivec2 at = clamp(ivec2(floor(place)), ivec2(0), last);
  vec2 away = place - vec2(at) - 0.5;
  ivec2 end = ivec2(clamp(at.x + (away.x < 0.0 ? -1 : 1), 0, last.x), at.y);
  ivec2 pick = ivec2(at.x, clamp(at.y + (away.y < 0.0 ? -1 : 1), 0, last.y));
  vec4 ofWarp = texelFetch(warpColors, at, 0), ofWeft = texelFetch(weftColors, at, 0);
  float side = gl_FrontFacing ? 1.0 : -1.0;
  float over = side * (2.0 * ofWarp.a - 1.0);
  float overEnd = side * (2.0 * texelFetch(warpColors, end, 0).a - 1.0);
  float overPick = side * (2.0 * texelFetch(warpColors, pick, 0).a - 1.0);
  vec2 flat_ = sections.xz - sections.yw;
  vec2 a = axis_at(away.y, pitches.y, flat_.y, over * rises.x, overPick * rises.x);
  vec2 b = axis_at(away.x, pitches.x, flat_.x, -over * rises.y, -overEnd * rises.y);
  vec3 acrossWarp = section_at(away.x * pitches.x, sections.x, sections.y);
  vec3 acrossWeft = section_at(away.y * pitches.y, sections.z, sections.w);
  if (acrossWarp.z + acrossWeft.z == 0.0) return open;
  float warpTop = acrossWarp.z > 0.0 ? a.x + sections.y * acrossWarp.y : -1e9;
  float weftTop = acrossWeft.z > 0.0 ? b.x + sections.w * acrossWeft.y : -1e9;
  bool warpOnTop = warpTop >= weftTop;
  vec3 along = warpOnTop ? warp : weft, across = warpOnTop ? weft : warp;
  vec2 bent = warpOnTop ? a : b;
  vec3 round_ = warpOnTop ? acrossWarp : acrossWeft;
  vec3 n = normalize(round_.y * normalize(up - bent.y * along) + round_.x * across);
  // The lower a yarn lies below its top position, the darker is its contact shadow.
  float rise = warpOnTop ? rises.x : rises.y;
  float shade = 1.0 - shaded * SHADOW * clamp(0.5 - 0.5 * bent.x / max(rise, 1e-6), 0.0, 1.0);
  vec3 own = hue * encoded(warpOnTop ? ofWarp.rgb : ofWeft.rgb);
  return decoded(shade * visibleColor(own, reflectedLight(n, eye), lined));
}

// Mean light of a pixel.
vec3 yarns_in(vec2 place, vec2 right, vec2 above_, vec3 hue, vec3 open)
{
  vec3 warp = normalize(warpVS), weft = normalize(weftVS), eye = normalize(eyeVS);
  vec3 up = normalize(cross(weft, warp));
  up = dot(up, eye) < 0.0 ? -up : up;
  vec3 sum = vec3(0.0);
  for (int j = 0; j < POINTS; ++j)
    for (int i = 0; i < POINTS; ++i)
    {
      vec2 share = grain * ((vec2(i, j) + 0.5) / float(POINTS) - 0.5);
      sum += yarn_at(place + share.x * right + share.y * above_, hue, warp, weft, up, eye, open);
    }
  return sum / float(POINTS * POINTS);
}
"""
)

_FRAGMENT = """
  // Centre, and half of width and height, of the finished picture's pixel, in crossings. For a
  // pixel that is rotated against the yarns, a rectangle with the same spread along both families.
  vec2 place = tcoordVCVSOutput * crossings, right = dFdx(place), above_ = dFdy(place);
  vec2 aside = (floor(gl_FragCoord.xy / grain) + 0.5) * grain - gl_FragCoord.xy;
  place += aside.x * right + aside.y * above_;
  vec3 open_ = decoded(mix(below, above, heightVS));
  if (resolved > 0.5)
  {
    gl_FragData[0] = vec4(encoded(yarns_in(place, right, above_, diffuseColor, open_)), 1.0);
  }
  else
  {
  vec2 reach = 0.5 * grain * sqrt(right * right + above_ * above_);
  vec2 low = clamp(place - reach, vec2(0.0), crossings - 0.001);
  vec2 high = clamp(place + reach, low + 0.001, crossings);
  // Many crossings are summed in blocks, which hold the exact means of their crossings.
  int level = int(clamp(ceil(0.5 * log2(4.0 * reach.x * reach.y / MOST_TEXELS)), 0.0, LEVELS));
  low /= float(1 << level);
  high /= float(1 << level);
  ivec2 first = ivec2(floor(low)), end = ivec2(ceil(high));
  vec4 texels[4] = vec4[4](vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
  if (level == 0 && averaged == 0)
  {
    for (int y = first.y; y < end.y; ++y)
    {
      float tall = min(high.y, float(y + 1)) - max(low.y, float(y));
      for (int x = first.x; x < end.x; ++x)
      {
        float area = tall * (min(high.x, float(x + 1)) - max(low.x, float(x)));
        vec4 warp = texelFetch(warpColors, ivec2(x, y), 0);
        vec4 weft = texelFetch(weftColors, ivec2(x, y), 0);
        texels[0] += area * warp.a * vec4(warp.rgb, 1.0);
        texels[1] += area * weft.a * vec4(weft.rgb, 1.0);
        texels[2] += area * weft.a * vec4(warp.rgb, 1.0);
        texels[3] += area * warp.a * vec4(weft.rgb, 1.0);
      }
    }
  }
  else
  {
    // In a block, the mean of products is not the product of means.
    for (int y = first.y; y < end.y; ++y)
    {
      float tall = min(high.y, float(y + 1)) - max(low.y, float(y));
      for (int x = first.x; x < end.x; ++x)
      {
        float area = tall * (min(high.x, float(x + 1)) - max(low.x, float(x)));
        vec4 warpOn = texelFetch(warpOver, ivec2(x, y), level);
        vec4 weftOn = texelFetch(weftOver, ivec2(x, y), level);
        texels[0] += area * warpOn;
        texels[1] += area * weftOn;
        vec3 warp = texelFetch(warpColors, ivec2(x, y), level).rgb;
        vec3 weft = texelFetch(weftColors, ivec2(x, y), level).rgb;
        texels[2] += area * vec4(warp - warpOn.rgb, weftOn.a);
        texels[3] += area * vec4(weft - weftOn.rgb, warpOn.a);
      }
    }
  }
  float area = texels[0].a + texels[1].a;  // at each crossing, one of the two families is on top
  int top = gl_FrontFacing ? 0 : 2;  // from behind, the lower yarns are on top
  // The rarer a family is on top, the darker are its contact shadows.
  vec2 there = tcoordVCVSOutput * crossings / vec2(textureSize(warpOver, 0));
  vec2 q = vec2(texture(warpOver, there, 5.0).a, texture(weftOver, there, 5.0).a);
  q /= q.x + q.y;
  q = gl_FrontFacing ? q : q.yx;
  vec2 tilted = 1.0 - 0.22 * min(tiltVS, 0.5);
  vec2 over = tilted * (1.0 - 0.26 * (1.0 - q) * (1.0 - q)), under = tilted * (0.36 + 0.6 * q);
  over = mix(vec2(1.0), over, shaded);
  under = mix(vec2(1.0), under, shaded);
  vec4 shades = vec4(over, under);
  for (int k = 0; k < 4; ++k)  // each family is multiplied by its share
  {
    int layer = (k + top) % 4;
    vec3 hue = diffuseColor * encoded(texels[k].rgb / max(texels[k].a, 1e-3 * area));
    vec3 light = decoded(shades[layer] * visibleColor(hue, lightVS[layer], lined));
    texels[k] = texels[k].a / area * vec4(light, 1.0);
  }
  vec2 k = coverVS.xy, between = coverVS.zw;
  vec4 yarns = k.x * texels[top] + k.y * texels[top + 1]
    + (1.0 - k.y) * between.x * texels[2 - top] + (1.0 - k.x) * between.y * texels[3 - top];
  // At a slant, gaps close sooner than the cover of both families says.
  float aslant = 1.0 - 0.5 * max(tiltVS.x, tiltVS.y);
  float open = aslant * dot(q, (1.0 - k) * (1.0 - between.yx));
  gl_FragData[0] = vec4(encoded(yarns.rgb + open * open_), 1.0);
  }
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
        self.set_grain(1)
        self.show_single_yarns(False)

    def set_background(self, below: Sequence[int], above: Sequence[int]) -> None:
        """Set the colours of the background, which is visible between yarns."""
        uniforms = self.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform3f("below", [part / 255 for part in below])
        uniforms.SetUniform3f("above", [part / 255 for part in above])

    def set_grain(self, grain: int) -> None:
        """Set how many drawn pixels, along each side, make one pixel of the finished picture."""
        self.GetShaderProperty().GetFragmentCustomUniforms().SetUniformf("grain", float(grain))

    def show_single_yarns(self, resolved: bool) -> None:
        """Draw single yarns, over and under each other; for yarns that are a few pixels wide."""
        uniforms = self.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniformf("resolved", float(resolved))

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
        state = cloth, color, None if numbers is None else span
        if self._shown == state and self._crossings is crossings:
            return
        self._shown, self._crossings = state, crossings
        warp, weft = yarn_shading(cloth)
        vertex = self.GetShaderProperty().GetVertexCustomUniforms()
        vertex.SetUniform4f("aspectAndCover", [warp.aspect, weft.aspect, warp.cover, weft.cover])
        fragment = self.GetShaderProperty().GetFragmentCustomUniforms()
        halvings = _halving_count(max(cloth.size))
        fragment.SetUniform2f("crossings", [count / 2**halvings for count in cloth.size])
        fragment.SetUniformi("averaged", halvings > 0)
        ends, picks = cloth.families
        unit = ends.spacing
        fragment.SetUniform2f("pitches", [1.0, picks.spacing / unit])
        sections = [
            0.5 * size / unit for each in (ends, picks) for size in (each.width, each.diameter)
        ]
        fragment.SetUniform4f("sections", sections)
        fragment.SetUniform2f("rises", [0.5 * each.height / unit for each in (ends, picks)])
        slopes = [warp.slope_over, weft.slope_over, warp.slope_under, weft.slope_under]
        vertex.SetUniform4f("slopes", slopes)
        if crossings is None:
            colors = _yarn_colors(cloth, color)
        else:
            colors = _crossing_colors(crossings, color, state[2])
        warp_over, weft_over, warp_under, weft_under = color_layers(
            cloth.drawdown, *colors, cloth.layers
        )
        for everywhere, on_top in ((warp_under, warp_over), (weft_under, weft_over)):
            everywhere[..., :3] += on_top[..., :3]
            everywhere[..., 3] = on_top[..., 3]
        textures = warp_over, weft_over, warp_under, weft_under
        for name, pixels in zip(_LAYERS, textures, strict=True):
            texture = self.GetProperty().GetTexture(name)
            if texture is None:
                texture = _make_texture()
                self.GetProperty().SetTexture(name, texture)
            # The texture is never replaced: see `SurfaceActor._paint`.
            for _ in range(halvings):
                pixels = _halve(pixels)
            texture.SetInputData(to_image(_pad(pixels, _LEVELS)))

    def set_shadow_strength(self, strength: float) -> None:
        """Set the strength of the yarns' contact shadows, 0 to 1."""
        self.GetShaderProperty().GetFragmentCustomUniforms().SetUniformf("shaded", strength)

    def _apply_style(self, surface: vtkPolyData, style: Style, pixels_per_point: float) -> None:
        light, shader = lighting_code(style, pixels_per_point), self.GetShaderProperty()
        if self._shader_key == (light,):
            return
        self._shader_key = (light,)
        shader.ClearAllShaderReplacements()
        for tag, text in (
            ("//VTK::TCoord::Dec", _VERTEX_DECLARATIONS + light + _VERTEX_FUNCTIONS),
            ("//VTK::TCoord::Impl", _VERTEX),
        ):
            shader.AddVertexShaderReplacement(tag, True, text, False)
        for tag, text in (
            (
                "//VTK::TCoord::Dec",
                _FRAGMENT_DECLARATIONS + _FRAGMENT_FUNCTIONS + light + _RESOLVED_FUNCTIONS,
            ),
            ("//VTK::Light::Impl", _FRAGMENT),
            ("//VTK::TCoord::Impl", ""),
        ):
            shader.AddFragmentShaderReplacement(tag, True, text, False)


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
    lines = [np.linspace(0, n, min(n, max_cells) + 1).astype(np.int64) for n in cells]
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


def quadrilaterals(columns: int, rows: int) -> Ints:
    """Return the corners of a sheet's cells, row by row, (cells, 4)."""
    place = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    corners = [place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _yarn_colors(cloth: Cloth, color: str) -> tuple[Bytes, Bytes]:
    """Return the colours of ends and picks; white for colourings that do not use them."""
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


def _crossing_colors(crossings: NDArray[Any], color: str, span: Span | None) -> tuple[Bytes, Bytes]:
    """Return the colours of ends and picks at each crossing."""
    if span is None:
        colors = rgb_table(CLASSES[color])[crossings.astype(np.uint8)]
    else:
        colors = ramp_colors(crossings, span)
    return colors[0], colors[-1]


def _pad(pixels: Bytes, levels: int) -> Bytes:
    """Return an image padded with empty texels, so that its sides can be halved `levels` times."""
    more = [(0, -count % 2**levels) for count in pixels.shape[:2]]
    return np.pad(pixels, (*more, (0, 0)))


def _halving_count(count: int) -> int:
    """Return how often `count` texels must be halved until they fit into an OpenGL texture."""
    return max(0, (count - 1).bit_length() - LONGEST_ROW.bit_length() + 1)


def _halve(pixels: Bytes) -> Bytes:
    """Return the means of blocks of 2 x 2 texels, computed in linear light."""
    even = _pad(pixels, 1)
    share = np.arange(256, dtype=np.float32) / 255
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    halved = np.empty((even.shape[0] // 2, even.shape[1] // 2, 4), np.uint8)
    for channel in range(4):
        table = share if channel == 3 else light
        parts = [table[even[row::2, column::2, channel]] for row in (0, 1) for column in (0, 1)]
        mean = 0.25 * sum(parts)
        if channel < 3:
            mean = np.where(mean <= 0.0031308, 12.92 * mean, 1.055 * mean ** (1 / 2.4) - 0.055)
        halved[..., channel] = np.rint(255 * mean)
    return halved


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
