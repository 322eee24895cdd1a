"""Draw a cloth as a sheet with yarn colours as textures, if its yarns are too small to be modelled.

The light of the sheet is the mean light of its yarns: at each vertex it is summed over the normals
that are visible from the direction of the eye, as `spacemap_vtk.draw.actors.cloth_appearance`
measures them on the yarns of near pictures. Where yarns are a few pixels wide, the light of a pixel
follows the mean normal of the yarns in it, and its mean over many pixels is still the former one.

A pixel shows the exact mean of the crossings around it, in linear light: half black and half white
gives the sRGB value 188. Each crossing counts by its area, weighted by a tent over two pixels. A
plain mean over the pixel would leave false stripes where colours alternate within a pixel.
OpenGL's filters cannot do this. The mip levels of a texture whose size is not a power of two leave
out rows and columns, so that one of two alternating colours can vanish.
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
from spacemap_vtk.draw.actors.cloth_appearance import (
    NODES,
    TILE,
    TILES_IN_ROW,
    TILTS,
    TURNS,
    AppearanceTables,
    ClothAppearance,
    appearance_of,
)
from spacemap_vtk.draw.actors.color_values import COLOR_VALUES
from spacemap_vtk.draw.actors.lighting import lighting_code, mean_light
from spacemap_vtk.draw.actors.surface_actor import (
    CLASSES,
    STUDIO,
    Span,
    SurfaceActor,
    natural_span,
    ramp_colors,
    rgb_table,
)
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Bytes, Floats, Ints, Singles
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import texture_halvings
from spacemap_vtk.scenes.styles import Style
from spacemap_vtk.textile.geometry.cloth_texture import grid_lines, visible_colors
from spacemap_vtk.textile.weave.cloth import Cloth

#: Names of the textures of colours, and the face and family that they show. A texel contains the
#: colours of the visible yarns of a crossing, each times the light that it sends to the eye.
_LAYERS = {
    "warpFront": (1, 0),
    "weftFront": (1, 1),
    "warpBack": (-1, 0),
    "weftBack": (-1, 1),
}
#: Largest light of a crossing that a texel can store, relative to the mean of its family.
_MOST_LIGHT = 1.6
#: Number of mip levels that are exact means: the sides of a texture are multiples of 2 to this
#: power.
_LEVELS = 6
#: Number of picks whose texels are made together, a power of 2.
_BAND = 512
#: Largest number of texels that a pixel sums. Beyond it, the next coarser mip level is used.
_MOST_TEXELS = 400
#: Largest number of texels of tiles that a pixel sums along each side.
_MOST_TILE_TEXELS = 4.5
#: Yarns wider than this number of pixels are drawn by their tiles.
_TILED = 1.3
#: Numbers of cells along each side of a simplified sheet. The least is enough for the eye's
#: direction, which differs from cell to cell by a degree.
_FEW_CELLS = (24, 48, 96)
#: Largest error of a simplified sheet's unit vectors, and of its numbers as a share of their range.
_TURNED = 0.02
_NUMBER_ERROR = 0.002

_VERTEX_DECLARATIONS = """
//VTK::TCoord::Dec
in vec3 warpMC;
in vec3 weftMC;
uniform sampler2D views;  // shares and exposures of normals, see ClothAppearance
out vec4 lightVS[2];  // mean light of warp and weft if the yarns are black
out vec2 bounceVS, spreadVS;  // its growth if yarns are white, and its relative deviation
out vec2 gainVS, whiteGainVS;  // light relative to that of the tiles
out vec2 coverGainVS;  // share of a crossing relative to that seen from the face
out vec2 openVS;  // share of a crossing that is open, and relative to that of the tiles
out float heightVS;
out vec3 warpVS, weftVS, eyeVS;
"""

_CONSTANTS = f"""
const int NODES = {NODES}, TURNS = {TURNS}, TILTS = {len(TILTS)};
const float TILT[TILTS] = float[TILTS]({", ".join(f"{np.radians(t):.6f}" for t in TILTS)});
const float LEVELS = {float(_LEVELS)}, MOST_TEXELS = {float(_MOST_TEXELS)};
const int TILE = {TILE}, TILES_IN_ROW = {TILES_IN_ROW};
const float MOST_TILE_TEXELS = {_MOST_TILE_TEXELS}, TILED = {_TILED};
const float MOST_LIGHT = {_MOST_LIGHT};
"""

_VERTEX_FUNCTIONS = """
// Column of the table of views, interpolated between four of them.
vec4 sharesOf(int column, int face, int rows, int left, int right, float aside, float steep)
{
  vec4 a = texelFetch(views, ivec2(column, rows + left), 0);
  vec4 b = texelFetch(views, ivec2(column, rows + right), 0);
  vec4 c = texelFetch(views, ivec2(column, rows + TURNS + left), 0);
  vec4 d = texelFetch(views, ivec2(column, rows + TURNS + right), 0);
  return mix(mix(a, b, aside), mix(c, d, aside), steep);
}

// Share of the light that arrives at an exposure, as for yarns: see `shadedLight`.
vec2 openTo(vec2 exposure)
{
  vec2 open = 1.0 - shaded * (1.0 - exposure);
  return open * open;
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
  bool front = dot(up, eye) >= 0.0;
  up = front ? up : -up;
  // Between the tilts and turns of the table, the shares are interpolated.
  float tilt = acos(clamp(dot(up, eye), 0.0, 1.0));
  int lower = 0;
  for (int k = 1; k < TILTS - 1; ++k) lower = tilt > TILT[k] ? k : lower;
  float steep = clamp((tilt - TILT[lower]) / (TILT[lower + 1] - TILT[lower]), 0.0, 1.0);
  float turn = atan(dot(eye, warp), dot(eye, weft) + 1e-9) / 6.28318531;
  turn = float(TURNS) * (turn < 0.0 ? turn + 1.0 : turn);
  int left = int(turn) % TURNS, right = (left + 1) % TURNS;
  float aside = fract(turn);
  int face = front ? 0 : TILTS * TURNS, rows = face + lower * TURNS;
  vec4 sums[2] = vec4[2](vec4(0.0), vec4(0.0));
  vec3 means[2] = vec3[2](vec3(0.0), vec3(0.0));
  vec2 total = vec2(0.0), ofFace = vec2(0.0), exposed = vec2(0.0);
  vec2 bounced = vec2(0.0), squares = vec2(0.0);
  for (int node = 0; node < NODES * NODES; ++node)
  {
    vec4 here = texelFetch(views, ivec2(node, face), 0);
    vec4 seen = sharesOf(node, face, rows, left, right, aside, steep);
    vec2 share = seen.xy;
    if (share + here.xy == vec2(0.0)) continue;
    vec2 open = openTo(seen.zw);
    vec2 t = 2.0 * vec2(node % NODES, node / NODES) / float(NODES - 1) - 1.0, p = t * abs(t);
    vec3 own = vec3(2.0 * p, 1.0 - dot(p, p)) / (1.0 + dot(p, p));
    vec4 light = reflectedLight(normalize(own.x * weft + own.y * warp + own.z * up), eye);
    vec2 amount = share * open;
    for (int k = 0; k < 2; ++k)
    {
      sums[k] += amount[k] * light;
      means[k] += here[k] * own;
    }
    bounced += light.g * amount / (1.0 - BOUNCE * (1.0 - open));
    squares += light.g * light.g * amount * open;
    total += share;
    ofFace += here.xy;
    exposed += here.xy * here.zw;
  }
  coverGainVS = total / max(ofFace, 1e-3);
  exposed = openTo(exposed / max(ofFace, 1e-6));
  for (int k = 0; k < 2; ++k)
  {
    lightVS[k] = sums[k] / max(total[k], 1e-6);
    vec3 own = means[k] / max(ofFace[k], 1e-6);
    vec4 ofMean = reflectedLight(own.x * weft + own.y * warp + own.z * up, eye) * exposed[k];
    gainVS[k] = min(lightVS[k].g / max(ofMean.g, 1e-3), 4.0);
    whiteGainVS[k] = min(lightVS[k].a / max(ofMean.a, 1e-4), 8.0);
    float mean = max(lightVS[k].g, 1e-6);
    bounceVS[k] = bounced[k] / max(sums[k].g, 1e-6);
    spreadVS[k] = sqrt(max(squares[k] / max(total[k], 1e-6) / (mean * mean) - 1.0, 0.0));
  }
  int last = NODES * NODES;
  openVS.x = sharesOf(last, face, rows, left, right, aside, steep).x;
  openVS.y = openVS.x / max(texelFetch(views, ivec2(last, face), 0).x, 1e-3);
  heightVS = 0.5 + 0.5 * place.y / place.w;
  warpVS = warp;
  weftVS = weft;
  eyeVS = eye;
"""

_FRAGMENT_DECLARATIONS = """
//VTK::TCoord::Dec
in vec4 lightVS[2];
in vec2 bounceVS, spreadVS, gainVS, whiteGainVS, coverGainVS, openVS;
in float heightVS;
in vec3 warpVS, weftVS, eyeVS;
"""

_FRAGMENT_FUNCTIONS = """
// Convert sRGB to linear light, and back.
vec3 decoded(vec3 code)
{
  return mix(code / 12.92, pow((code + 0.055) / 1.055, vec3(2.4)), step(0.04045, code));
}

vec3 encoded(vec3 light)
{
  return mix(12.92 * light, 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, light));
}

// Hue of a code in the textures: see `response`.
vec3 hueOf(vec3 code)
{
  float room = 1.0 - KNEE;
  vec3 above_ = clamp((code - KNEE) / max(room, 1e-6), 0.0, 0.999);
  vec3 shown = mix(code, KNEE + room * atanh(above_), step(KNEE, code));
  float part = 0.4 * mixing.y;
  vec3 root = sqrt(max(part * part + 4.0 * mixing.x * (shown * shown - 0.6 * mixing.y), 0.0));
  return max(root - part, 0.0) / (2.0 * mixing.x);
}

// Colours of the visible yarns of a crossing or block, times their light.
vec4 colorsOf(int family, ivec2 at, int level)
{
  if (gl_FrontFacing)
    return texelFetch(warpFront, at, level) * float(1 - family)
      + texelFetch(weftFront, at, level) * float(family);
  return texelFetch(warpBack, at, level) * float(1 - family)
    + texelFetch(weftBack, at, level) * float(family);
}

// Share of a tent of half width 1 on the negative side of a place.
float tent(float x)
{
  float inside = clamp(x, -1.0, 1.0);
  return 0.5 + inside - 0.5 * inside * abs(inside);
}

// Linear light of yarns whose light has this mean and relative deviation.
vec3 meanLight(vec3 hue, vec4 light, float deviation)
{
  // Two values with this mean and deviation give the mean of any smooth function.
  float apart = min(deviation, 0.95);
  vec3 dark_ = visibleColor(hue, (1.0 - apart) * light, lined);
  return 0.5 * (decoded(dark_) + decoded(visibleColor(hue, (1.0 + apart) * light, lined)));
}

// Light of the crossings around a place, each by its area.
vec3 mixedLight(vec2 place, vec2 reach, vec3 hue, vec3 open)
{
  // Many crossings are summed in blocks, which hold the exact means of their crossings.
  float count = 4.0 * reach.x * reach.y;
  int level = int(clamp(ceil(0.5 * log2(count / MOST_TEXELS)), 0.0, LEVELS));
  float size = float(1 << level);
  vec2 low = clamp(place - reach, vec2(0.0), crossings - 0.001) / size;
  vec2 high = clamp(place + reach, vec2(0.001), crossings) / size;
  place /= size;
  vec2 scale = size / reach;
  ivec2 first = ivec2(floor(low)), end = max(ivec2(ceil(high)), first + 1);
  vec4 texels[2] = vec4[2](vec4(0.0), vec4(0.0));
  float whole = 0.0;
  for (int y = first.y; y < end.y; ++y)
  {
    float tall = tent((float(y + 1) - place.y) * scale.y) - tent((float(y) - place.y) * scale.y);
    for (int x = first.x; x < end.x; ++x)
    {
      float wide = tent((float(x + 1) - place.x) * scale.x) - tent((float(x) - place.x) * scale.x);
      float area = tall * wide;
      for (int k = 0; k < 2; ++k) texels[k] += area * colorsOf(k, ivec2(x, y), level);
      // A block at the edge of the cloth is not full.
      vec2 full = clamp(crossings / size - vec2(x, y), 0.0, 1.0);
      whole += area * full.x * full.y;
    }
  }
  vec3 sum = openVS.x * open;
  for (int k = 0; k < 2; ++k)
  {
    float share = MOST_LIGHT * texels[k].a / whole;
    vec3 own = hue * hueOf(encoded(texels[k].rgb / max(texels[k].a, 1e-3 * whole)));
    vec4 light = lightVS[k];
    light.rgb *= mix(vec3(1.0), vec3(bounceVS[k]), own * own);
    sum += share * coverGainVS[k] * meanLight(own, light, spreadVS[k]);
  }
  return sum;
}

// Light of the yarns around a place, by the tiles of its crossings.
vec3 tiledLight(vec2 place, vec2 reach, vec3 hue, vec3 open)
{
  float longest = 2.0 * max(reach.x, reach.y) * float(TILE);
  int level = int(clamp(ceil(log2(longest / MOST_TILE_TEXELS)), 0.0, 2.0));
  int side = TILE >> level;
  ivec2 last = ivec2(crossings) * side - 1;
  ivec2 first = clamp(ivec2(floor((place - reach) * float(side))), ivec2(0), last);
  ivec2 end = clamp(ivec2(floor((place + reach) * float(side))), ivec2(0), last);
  int block = textureSize(tiles, level).y / 6, face = gl_FrontFacing ? 0 : 2;
  vec2 texel = 1.0 / (float(side) * reach);
  vec2 start = (place * float(side));
  vec4 normals[2] = vec4[2](vec4(0.0), vec4(0.0));
  vec3 colors[2] = vec3[2](vec3(0.0), vec3(0.0));
  vec2 exposed = vec2(0.0);
  float whole = 0.0, opened = 0.0;
  for (int y = first.y; y <= end.y; ++y)
  {
    float tall = tent((float(y + 1) - start.y) * texel.y) - tent((float(y) - start.y) * texel.y);
    for (int x = first.x; x <= end.x; ++x)
    {
      float wide = tent((float(x + 1) - start.x) * texel.x) - tent((float(x) - start.x) * texel.x);
      float area = tall * wide;
      ivec2 crossing = ivec2(x, y) / side;
      vec2 code = texelFetch(tileNumbers, crossing, 0).rg;
      int number = int(255.0 * code.r + 0.5) + 256 * int(255.0 * code.g + 0.5);
      ivec2 at = ivec2(number % TILES_IN_ROW, number / TILES_IN_ROW) * side + ivec2(x, y) % side;
      vec4 ofWarp = texelFetch(tiles, at + ivec2(0, face * block), level);
      vec4 ofWeft = texelFetch(tiles, at + ivec2(0, (face + 1) * block), level);
      vec4 exposures = texelFetch(tiles, at + ivec2(0, 4 * block), level);
      vec2 ofFace = gl_FrontFacing ? exposures.xy : exposures.zw;
      vec2 holes = texelFetch(tiles, at + ivec2(0, 5 * block), level).xy;
      vec4 warp = colorsOf(0, crossing, 0), weft = colorsOf(1, crossing, 0);
      normals[0] += area * vec4(2.0 * ofWarp.xy - 1.0, ofWarp.zw);
      normals[1] += area * vec4(2.0 * ofWeft.xy - 1.0, ofWeft.zw);
      colors[0] += area * ofWarp.w * warp.rgb / max(warp.a, 1e-3);
      colors[1] += area * ofWeft.w * weft.rgb / max(weft.a, 1e-3);
      exposed += area * ofFace;
      opened += area * (gl_FrontFacing ? holes.x : holes.y);
      whole += area;
    }
  }
  vec3 warp = normalize(warpVS), weft = normalize(weftVS), eye = normalize(eyeVS);
  vec3 up = normalize(cross(weft, warp));
  up = dot(up, eye) < 0.0 ? -up : up;
  // Where a pixel contains a whole crossing, its light is spread as everywhere.
  float blurred = clamp(max(reach.x, reach.y) * TILED, 0.0, 1.0);
  vec3 sum = min(openVS.y * opened / whole, 1.0) * open;
  for (int k = 0; k < 2; ++k)
  {
    float share = normals[k].w;
    if (share < 1e-4 * whole) continue;
    vec3 own = normals[k].xyz / share;
    vec4 light = reflectedLight(own.x * weft + own.y * warp + own.z * up, eye);
    float arrived = 1.0 - shaded * (1.0 - exposed[k] / share);
    light *= arrived * arrived * vec4(vec3(gainVS[k]), whiteGainVS[k]);
    vec3 tone = hue * hueOf(encoded(colors[k] / share));
    light.rgb *= mix(vec3(1.0), vec3(bounceVS[k]), tone * tone);
    sum += share / whole * coverGainVS[k] * meanLight(tone, light, spreadVS[k] * blurred);
  }
  return sum;
}
"""

_FRAGMENT = """
  // Centre, width and height of the finished picture's pixel, in crossings. For a pixel that is
  // rotated against the yarns, a rectangle with the same spread along both families.
  vec2 place = tcoordVCVSOutput * crossings, right = dFdx(place), above_ = dFdy(place);
  vec2 aside = (floor(gl_FragCoord.xy / grain) + 0.5) * grain - gl_FragCoord.xy;
  place += aside.x * right + aside.y * above_;
  vec2 reach = max(grain * sqrt(right * right + above_ * above_), vec2(1e-4));
  vec3 open_ = decoded(mix(mix(below, above, heightVS), hole.rgb, hole.a));
  bool tiled = averaged == 0 && TILED * max(reach.x, reach.y) < 1.0;
  vec3 light = tiled ? tiledLight(place, reach, diffuseColor, open_)
    : mixedLight(place, reach, diffuseColor, open_);
  gl_FragData[0] = vec4(encoded(light), 1.0);
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
        halvings = texture_halvings(cloth.size)
        fragment.SetUniform2f("crossings", [count / 2**halvings for count in cloth.size])
        fragment.SetUniformi("averaged", halvings > 0)
        if crossings is None:
            colors = _yarn_colors(cloth, color)
        else:
            colors = _crossing_colors(crossings, color, state[2])
        appearance = appearance_of(cloth)
        normals, amounts = appearance.visible_normals(self._strength)
        mixing = mean_light(lighting_style, normals, amounts)
        fragment.SetUniform2f("mixing", mixing)
        displayed = decode(response(lighting_style, np.arange(256) / 255, mixing))
        for name, (side, family) in _LAYERS.items():
            # Nothing is seen of the reverse of a cloth that faces the camera.
            tiles = appearance.numbers if side > 0 or not self.shows_face else np.zeros((1, 1), int)
            shares = appearance.light_shares(side, shadows)[:, family]
            pixels = _make_layer(tiles, shares, family, displayed[colors[family]], halvings)
            texture = self.GetProperty().GetTexture(name)
            if texture is None:
                texture = _make_texture()
                self.GetProperty().SetTexture(name, texture)
            # The texture is never replaced: see `SurfaceActor._set_texture`.
            texture.SetInputData(to_image(_pad(pixels, _LEVELS)))
        tiles = appearance.numbers[:1, :1] if halvings else appearance.numbers
        bytes_ = [(tiles % 256).astype(np.uint8), (tiles // 256).astype(np.uint8)]
        self._set_data("tileNumbers", to_image(np.stack([*bytes_, bytes_[1]], axis=-1)))
        self._show_appearance(appearance)

    def set_shadow_strength(self, strength: float) -> None:
        """Set the strength of the yarns' contact shadows, 0 to 1."""
        self._strength = strength
        shader = self.GetShaderProperty()
        for uniforms in (shader.GetVertexCustomUniforms(), shader.GetFragmentCustomUniforms()):
            uniforms.SetUniformf("shaded", strength)

    def _show_appearance(self, appearance: ClothAppearance) -> None:
        """Show the tables of a cloth."""
        tables = appearance.tables(tilted=not self.shows_face)
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
        mean = f"const float KNEE = {style.knee!r};\n"
        shader.ClearAllShaderReplacements()
        for tag, text in (
            ("//VTK::TCoord::Dec", _VERTEX_DECLARATIONS + _CONSTANTS + light + _VERTEX_FUNCTIONS),
            ("//VTK::TCoord::Impl", _VERTEX),
        ):
            shader.AddVertexShaderReplacement(tag, True, text, False)
        for tag, text in (
            (
                "//VTK::TCoord::Dec",
                _FRAGMENT_DECLARATIONS + _CONSTANTS + mean + light + _FRAGMENT_FUNCTIONS,
            ),
            ("//VTK::Light::Impl", _FRAGMENT),
            ("//VTK::TCoord::Impl", ""),
        ):
            shader.AddFragmentShaderReplacement(tag, True, text, False)


def response(style: Style, hue: Floats, mixing: tuple[float, float]) -> Floats:
    """Return the displayed values of hues under a coloured and a white light, 0 to 1."""
    # The textures contain these values, because means over many yarns are those of displayed light,
    # in which bright colours are compressed. The shader turns the means back into hues, which it
    # lights as a surface is lit.
    received, white = mixing
    shown = np.sqrt(hue**2 * received + white * (0.6 + 0.4 * hue))
    if style.knee < 1.0:
        room = 1.0 - style.knee
        bent = style.knee + room * np.tanh((shown - style.knee) / room)
        shown = np.where(shown > style.knee, bent, shown)
    return np.minimum(shown, 1.0)


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
    lines = [_chosen_lines(n, max_cells) for n in cells]
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
    exact = np.concatenate(columns, axis=-1)
    for count in _FEW_CELLS:
        if count >= max(cells):
            break
        lines = [_chosen_lines(n, count) for n in cells]
        kept = exact[np.ix_(lines[1], lines[0])]
        rebuilt = _interpolate(_interpolate(kept, lines[1], 0), lines[0], 1)
        if np.abs(rebuilt - exact).max() <= 1.0:
            return coarsen_sheet(sheet, cells, count)
    return sheet


def _interpolate(values: AnyFloats, lines: Ints, axis: int) -> AnyFloats:
    """Return values at all lines of a sheet from those at some lines."""
    every = np.arange(lines[-1] + 1)
    before = np.clip(np.searchsorted(lines, every, side="right") - 1, 0, len(lines) - 2)
    share = (every - lines[before]) / (lines[before + 1] - lines[before])
    share = share.reshape([-1 if k == axis else 1 for k in range(values.ndim)])
    low, high = values.take(before, axis), values.take(before + 1, axis)
    return np.asarray(low + share * (high - low))


def _chosen_lines(cells: int, most: int) -> Ints:
    """Return the lines between cells that remain if there are at most `most` cells."""
    return np.linspace(0, cells, min(cells, most) + 1).astype(np.int64)


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


def _make_layer(
    weaves: AnyInts, shares: Singles, family: int, colors: Singles, halvings: int
) -> Bytes:
    """Return a texture of a cloth, halved some times; it is made in bands of picks."""
    bands = []
    for start in range(0, len(weaves), _BAND):
        band = weaves[start : start + _BAND]
        light = visible_colors(band, shares / _MOST_LIGHT, family, colors, start)
        for _ in range(halvings):
            light = _halve(light)
        bands.append(_encode(light))
    return np.concatenate(bands)


def decode(shares: Floats) -> Singles:
    """Return the linear light of sRGB values from 0 to 1."""
    light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


def _encode(light: Singles) -> Bytes:
    """Return texels of linear light: colours as sRGB values, and their sum of shares."""
    # A table is faster than powers.
    steps = np.arange(65536) / 65535
    code = np.where(steps <= 0.0031308, 12.92 * steps, 1.055 * steps ** (1 / 2.4) - 0.055)
    table = np.rint(255 * code).astype(np.uint8)
    texels = np.empty(light.shape, np.uint8)
    texels[..., :3] = table[np.rint(65535 * np.minimum(light[..., :3], 1.0)).astype(np.uint16)]
    texels[..., 3] = np.rint(255 * np.minimum(light[..., 3], 1.0))
    return texels


def _pad(pixels: Bytes, levels: int) -> Bytes:
    """Return an image padded with empty texels, so that its sides can be halved `levels` times."""
    more = [(0, -count % 2**levels) for count in pixels.shape[:2]]
    return np.pad(pixels, (*more, (0, 0)))


def _halve(light: Singles) -> Singles:
    """Return the means of blocks of 2 x 2 texels."""
    even = np.pad(light, [(0, count % 2) for count in light.shape[:2]] + [(0, 0)])
    tall = even[::2] + even[1::2]
    return np.asarray(0.25 * (tall[:, ::2] + tall[:, 1::2]), np.float32)


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
