"""GLSL source that shades a cloth drawn as a sheet, for VTK's OpenGL and for web pages (WebGL 2).

The light of the sheet is the mean light of its yarns: at each vertex it is summed over the normals
that are visible from the direction of the eye, as `spacemap_vtk.draw.actors.cloth_appearance`
measures them on the yarns of near pictures. Where yarns are a few pixels wide, the light of a pixel
follows the mean normal of the yarns in it, and its mean over many pixels is still the former one.

A pixel shows the exact mean of the crossings around it, in linear light: half black and half white
gives the sRGB value 188. Each crossing counts by its area, weighted by a tent over two pixels. A
plain mean over the pixel would leave false stripes where colours alternate within a pixel.
OpenGL's filters cannot do this. The mip levels of a texture whose size is not a power of two leave
out rows and columns, so that one of two alternating colours can vanish.

A program declares uniforms, which `spacemap_vtk.draw.actors.sheet_textures` fills, the constants,
the light of a style (`spacemap_vtk.draw.actors.lighting`), and then
`VERTEX_FUNCTIONS` or `FRAGMENT_FUNCTIONS`.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.draw.actors.cloth_appearance import NODES, TILE, TILES_IN_ROW, TILTS, TURNS

#: Largest light of a crossing that a texel can store, relative to the mean of its family.
MOST_LIGHT = 1.6
#: Number of mip levels that are exact means: the sides of a texture are multiples of 2 to this
#: power.
LEVELS = 6
#: The same for the tiles.
TILE_LEVELS = 2
#: Largest number of texels that a pixel sums. Beyond it, the next coarser mip level is used.
_MOST_TEXELS = 400
#: Largest number of texels of tiles that a pixel sums along each side.
_MOST_TILE_TEXELS = 4.5
#: Yarns wider than this number of pixels are drawn by their tiles, at least in part.
_TILED = 1.3


def sheet_constants(most_texels: int = _MOST_TEXELS) -> str:
    """Return the constants of the shaders; a pixel sums at most so many texels."""
    # Beyond this number, the next coarser mip level is used.
    tilts = ", ".join(f"{np.radians(tilt):.6f}" for tilt in TILTS)
    return f"""
const int NODES = {NODES}, TURNS = {TURNS}, TILTS = {len(TILTS)};
const float TILT[TILTS] = float[TILTS]({tilts});
const float LEVELS = {float(LEVELS)}, MOST_TEXELS = {float(most_texels)};
const int TILE = {TILE}, TILES_IN_ROW = {TILES_IN_ROW};
const float MOST_TILE_TEXELS = {_MOST_TILE_TEXELS}, TILED = {_TILED};
const float TILE_LEVELS = {float(TILE_LEVELS)};
const float MOST_LIGHT = {MOST_LIGHT};
"""


#: Functions of the vertex shader; `lightYarns` sets all that the fragment shader needs.
VERTEX_FUNCTIONS = """
uniform sampler2D views;  // shares and exposures of normals, see ClothAppearance
// Without `centroid`, they would be extrapolated in pixels that a fold only grazes.
centroid out vec4 lightVS[2];  // mean light of warp and weft if the yarns are black
centroid out vec2 bounceVS, spreadVS;  // its growth if yarns are white, and its relative deviation
centroid out vec2 gainVS;  // light relative to that of the tiles
centroid out vec2 coverGainVS;  // share of a crossing relative to that seen from the face
centroid out vec2 openVS;  // share of a crossing that is open, and relative to that of the tiles
centroid out float heightVS;
centroid out vec3 warpVS, weftVS, eyeVS;

// Column of the table of views, interpolated between four of them.
vec4 sharesOf(int column, int face, int rows, int left, int right, float aside, float steep)
{
  vec4 a = texelFetch(views, ivec2(column, rows + left), 0);
  vec4 b = texelFetch(views, ivec2(column, rows + right), 0);
  vec4 c = texelFetch(views, ivec2(column, rows + TURNS + left), 0);
  vec4 d = texelFetch(views, ivec2(column, rows + TURNS + right), 0);
  return mix(mix(a, b, aside), mix(c, d, aside), steep);
}

// Light of the yarns at a vertex with a position relative to the eye and on the screen, and unit
// vectors along warp and weft.
void lightYarns(vec3 positionVC, vec4 place, vec3 warp, vec3 weft)
{
  bool parallel = abs(place.w + positionVC.z) > 1e-4 * abs(positionVC.z);
  vec3 eye = parallel ? vec3(0.0, 0.0, 1.0) : normalize(-positionVC);
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
    vec2 open = openTo(seen.zw, shaded);
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
  exposed = openTo(exposed / max(ofFace, 1e-6), shaded);
  for (int k = 0; k < 2; ++k)
  {
    lightVS[k] = sums[k] / max(total[k], 1e-6);
    vec3 own = means[k] / max(ofFace[k], 1e-6);
    float ofMean = reflectedLight(own.x * weft + own.y * warp + own.z * up, eye).g * exposed[k];
    gainVS[k] = min(lightVS[k].g / max(ofMean, 1e-3), 4.0);
    float mean = max(lightVS[k].g, 1e-6);
    bounceVS[k] = bounced[k] / max(sums[k].g, 1e-6);
    spreadVS[k] = sqrt(max(squares[k] / max(total[k], 1e-6) / (mean * mean) - 1.0, 0.0));
  }
  int last = NODES * NODES;
  vec4 whole = sharesOf(last, face, rows, left, right, aside, steep);
  bounceVS *= whole.zw;
  openVS.x = whole.x;
  openVS.y = openVS.x / max(texelFetch(views, ivec2(last, face), 0).x, 1e-3);
  heightVS = 0.5 + 0.5 * place.y / place.w;
  warpVS = warp;
  weftVS = weft;
  eyeVS = eye;
}
"""

#: Functions that convert displayed values.
CODES = """
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

#: Functions of the fragment shader, after `CODES`; `sheetLight` returns the light of a pixel.
FRAGMENT_FUNCTIONS = """
centroid in vec4 lightVS[2];
centroid in vec2 bounceVS, spreadVS, gainVS, coverGainVS, openVS;
centroid in float heightVS;
centroid in vec3 warpVS, weftVS, eyeVS;

// Hue of a code in the textures: see `response`.
vec3 hueOf(vec3 code)
{
  float room = 1.0 - knee;
  vec3 above_ = clamp((code - knee) / max(room, 1e-6), 0.0, 0.999);
  vec3 shown = mix(code, knee + room * atanh(above_), step(knee, code));
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
  float texels = 2.0 * sqrt(reach.x * reach.y) * float(TILE);
  int level = int(clamp(ceil(log2(texels / MOST_TILE_TEXELS)), 0.0, TILE_LEVELS));
  int side = TILE >> level;
  ivec2 last = ivec2(crossings) * side - 1;
  ivec2 first = clamp(ivec2(floor((place - reach) * float(side))), ivec2(0), last);
  ivec2 end = clamp(ivec2(floor((place + reach) * float(side))), ivec2(0), last);
  // Of several levels, Mesa's software renderer returns the same size to neighbouring pixels.
  int block = (textureSize(tiles, 0).y / 6) >> level, face = gl_FrontFacing ? 0 : 2;
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
      normals[0] += area * vec4((255.0 * ofWarp.xy - 128.0) / 127.0, ofWarp.zw);
      normals[1] += area * vec4((255.0 * ofWeft.xy - 128.0) / 127.0, ofWeft.zw);
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
    vec3 own = normals[k].x * weft + normals[k].y * warp + normals[k].z * up;
    // Texels of small shares are rounded. A normal longer than 1 would have a white highlight.
    vec4 light = reflectedLight(own / max(share, length(own)), eye);
    light *= openTo(vec2(exposed[k] / share), shaded).x * vec4(vec3(gainVS[k]), 1.0);
    light.a = mix(light.a, lightVS[k].a, blurred);
    vec3 tone = hue * hueOf(encoded(colors[k] / share));
    light.rgb *= mix(vec3(1.0), vec3(bounceVS[k]), tone * tone);
    sum += share / whole * coverGainVS[k] * meanLight(tone, light, spreadVS[k] * blurred);
  }
  return sum;
}

// Linear light of the cloth at texture coordinates, whose yarns are tinted by a hue.
vec3 sheetLight(vec2 coordinates, vec3 hue)
{
  // Centre, width and height of the finished picture's pixel, in crossings. For a pixel that is
  // rotated against the yarns, a rectangle with the same spread along both families.
  vec2 place = coordinates * crossings, right = dFdx(place), above_ = dFdy(place);
  vec2 aside = (floor(gl_FragCoord.xy / grain) + 0.5) * grain - gl_FragCoord.xy;
  place = clamp(place + aside.x * right + aside.y * above_, vec2(0.0), crossings);
  vec2 reach = max(grain * sqrt(right * right + above_ * above_), vec2(1e-4));
  vec3 open_ = decoded(mix(mix(below, above, heightVS), hole.rgb, hole.a));
  // Without a blend, an edge would show where obliquely viewed cloth loses the form of its yarns.
  float far = averaged == 0 ? smoothstep(0.7, 1.0, TILED * sqrt(reach.x * reach.y)) : 1.0;
  vec3 light = vec3(0.0);
  if (far < 1.0) light += (1.0 - far) * tiledLight(place, reach, hue, open_);
  if (far > 0.0) light += far * mixedLight(place, reach, hue, open_);
  return light;
}
"""
