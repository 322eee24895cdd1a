"""Shaders for the light of a style, and for the fibres and plies of yarns.

Surfaces of yarns, sheets and cut faces use the same light. Fibres and plies are shaded only as
finely as pixels can show them.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.filters.patch_tessellator import LOOK, STRANDS
from spacemap_vtk.ndarrays import AnyFloats, Floats
from spacemap_vtk.scenes.styles import Style

#: Largest number of lamps of a style.
_MAX_LAMPS = 3

#: Vertex attribute with exposure and relative brightness.
LOOK_ATTRIBUTE = "lookMC"

#: GLSL functions that light a surface; `lighting_code` puts the constants before them.
#: Displayed value that white approaches where a style has a knee: it leaves room for bright fibres.
WHITEST = 0.92
#: Share of the light that is hidden where a contact shadow has become visible.
SOFT = 0.05
#: Share of the light from the walls of a gap that reaches its other walls.
BOUNCE = 0.35

_FUNCTIONS = """
// Light that a surface reflects: rgb is multiplied by the surface's colour, alpha is white.
vec4 reflectedLight(vec3 n, vec3 eye)
{
  vec3 received = mix(earth, sky, 0.5 + 0.5 * n.y);
  received += max(dot(n, towards0) + wrap, 0.0) * lamp0;
  received += max(dot(n, towards1) + wrap, 0.0) * lamp1;
  received += max(dot(n, towards2) + wrap, 0.0) * lamp2;
  float front = max(dot(n, eye), 0.0), aside = 1.0 - front, away = max(1.0 - front / 0.75, 0.0);
  received *= 1.0 - facing * away * away;
  // White surfaces keep their shades: they stay below 1. Because this is a matter of the light and
  // not of the colour, the light of several yarns is still that of their mean colour.
  float most = sqrt(max(max(received.r, received.g), received.b)), room = WHITEST - knee;
  float least = room > 0.0 && most > knee ? knee + room * tanh((most - knee) / room) : most;
  received *= least * least / max(most * most, 1e-6);
  float rim = sheen * aside * aside * aside;
  float white = gloss * pow(max(dot(n, halfway), 0.0), glossPower) + rim * received.g;
  // What is reflected white is not reflected in colour.
  return vec4(received * (1.0 - gloss - rim), white);
}

// Share of the light that arrives at two exposures; shadows begin without an edge.
vec2 openTo(vec2 exposure, float strength)
{
  vec2 hidden = clamp(1.0 - exposure, 0.0, 1.0);
  vec2 open = 1.0 - strength * hidden * hidden * (1.0 + SOFT) / (hidden + SOFT);
  return open * open;
}

// Light on a surface that is exposed to a part of its surroundings. Bright walls reflect light to
// one another, so that gaps between them are less dark, and keep their colour.
vec4 shadedLight(vec4 light, float exposure, vec3 hue)
{
  float open = openTo(vec2(exposure), shadows).x;
  return vec4(light.rgb * open / (1.0 - BOUNCE * hue * hue * (1.0 - open)), light.a * open);
}

// Colour in which the style shows a hue.
vec3 styleColor(vec3 hue)
{
  return mix(mix(dark, pale, dot(hue, vec3(0.299, 0.587, 0.114))), hue, colored);
}

// Visible colour of a hue under a light, covered by an outline with the coverage `line`. White
// light keeps some of the hue, as from fibres that stand out.
vec3 visibleColor(vec3 hue, vec4 light, float line)
{
  vec3 base = styleColor(hue);
  return mix(sqrt(base * base * light.rgb + light.a * mix(vec3(1.0), base, 0.4)), ink, line);
}
"""

#: GLSL function for fragment shaders: the coverage of an outline with half its width in pixels.
OUTLINE = """
float outlineAt(vec3 n, vec3 eye, float wide)
{
  if (wide <= 0.0) return 0.0;
  // On a round surface, the cosine between normal and view falls to zero over twice the distance
  // to the edge.
  float front = dot(n, eye);
  float slope = length(vec2(dFdx(front), dFdy(front)));
  float line = 1.0 - smoothstep(wide - 0.7, wide + 0.7, 0.5 * front / max(slope, 1e-6));
  return line * (1.0 - smoothstep(rimCosine, 1.1 * rimCosine, front));
}
"""

#: Fragment shader code that computes `eye` and the coverage `line` of an outline.
_LINE = """
  vec3 eye = cameraParallel == 1 ? vec3(0.0, 0.0, 1.0) : normalize(-vertexVC.xyz);
  float line = outlineAt(normalVCVSOutput, eye, lineWidth);
"""
#: Fragment shader code that replaces VTK's lights on a smooth surface.
_FRAGMENT = f"""{_LINE}
  vec3 hue = diffuseColor * lookVSOutput.y;
  vec4 light = shadedLight(reflectedLight(normalVCVSOutput, eye), lookVSOutput.x, hue);
  gl_FragData[0] = vec4(visibleColor(hue, light, line), opacity);
"""


def arriving_light(exposure: AnyFloats, strength: float) -> Floats:
    """Return the share of the light that arrives at an exposure, as in `shadedLight`."""
    hidden = np.clip(1.0 - np.asarray(exposure, dtype=np.float64), 0.0, 1.0)
    return np.asarray((1.0 - strength * hidden**2 * (1.0 + SOFT) / (hidden + SOFT)) ** 2)


def exposure_of(arrived: Floats, strength: float) -> Floats:
    """Return the exposure at which this share of the light arrives."""
    dark = (1.0 - np.sqrt(arrived)) / strength
    hidden = (dark + np.sqrt(dark * (dark + 4.0 * SOFT * (1.0 + SOFT)))) / (2.0 * (1.0 + SOFT))
    return np.asarray(1.0 - hidden)


@lru_cache(32)
def lighting_code(style: Style, pixels_per_point: float = 1.0) -> str:
    """Return the GLSL constants and functions of a style's light."""
    # With uniforms in place of constants, software OpenGL takes 50 % more time for a picture. The
    # lamps turn with the camera, so the constants stay valid when the camera moves.
    triples, numbers = _constants(style, pixels_per_point)
    lines = []
    for key, triple in triples.items():
        x, y, z = map(float, triple)
        lines.append(f"const vec3 {key} = vec3({x!r}, {y!r}, {z!r});")
    lines += [f"const float {key} = {float(value)!r};" for key, value in numbers.items()]
    lines.append(f"const float BOUNCE = {BOUNCE!r}, SOFT = {SOFT!r}, WHITEST = {WHITEST!r};")
    return "\n".join(["", *lines, _FUNCTIONS])


def _constants(style: Style, point: float) -> tuple[dict[str, Any], dict[str, float]]:
    """Return colours and directions, and numbers, by their names in shaders."""
    places, colors = np.zeros((2, _MAX_LAMPS, 3))
    for number, lamp in enumerate(style.lamps):
        places[number] = np.array(lamp.place) / np.linalg.norm(lamp.place)
        colors[number] = lamp.strength / (1.0 + style.wrap) * np.array(lamp.color)
    halfway = places[0] + (0.0, 0.0, 1.0)
    dark, pale = style.tint
    triples = {f"towards{k}": places[k] for k in range(_MAX_LAMPS)}
    triples |= {f"lamp{k}": colors[k] for k in range(_MAX_LAMPS)}
    triples |= {"halfway": halfway / np.linalg.norm(halfway), "sky": style.sky}
    triples |= {"earth": style.earth, "dark": dark, "pale": pale}
    triples["ink"] = np.array(style.outline_color) / 255
    numbers = {
        "wrap": style.wrap,
        "gloss": style.gloss,
        "glossPower": style.gloss_power,
        "sheen": style.sheen,
        "facing": style.facing,
        "colored": style.colored,
        "shadows": style.occlusion,
        "knee": style.knee,
        # Half the width of a line. `OutlineActor` draws the other half outside the silhouette.
        "lined": style.outline_far_share if style.outline else 0.0,
        "lineWidth": 0.5 * style.outline * point,
        # Cosine between normal and view at the largest distance of a line from the silhouette.
        "rimCosine": math.sqrt(1.0 - (1.0 - 2.0 * style.outline_share) ** 2),
    }
    return triples, numbers


@lru_cache(32)
def lighting_tables(style: Style, point: float) -> tuple[Floats, Floats]:
    """Return a style's light as tables for `spacemap_vtk.draw.software.raster_loops`."""
    # Rows: directions to the lamps, their colours, then the names in the lists below.
    triples, numbers = _constants(style, point)
    lamp_names = [f"{name}{k}" for name in ("towards", "lamp") for k in range(_MAX_LAMPS)]
    rows = [*lamp_names, "sky", "earth", "halfway", "dark", "pale", "ink"]
    names = (
        "wrap",
        "gloss",
        "glossPower",
        "sheen",
        "facing",
        "colored",
        "lineWidth",
        "rimCosine",
        "shadows",
        "knee",
    )
    return (
        np.array([triples[name] for name in rows], np.float64),
        np.array([numbers[name] for name in names], np.float64),
    )


def mean_light(style: Style, normals: Floats, amounts: Floats) -> tuple[float, float]:
    """Return the coloured (green) and the white light that normals reflect to a camera above."""
    # As `reflectedLight` in the shaders, which also compresses the light of bright surfaces.
    triples, _ = _constants(style, 1.0)
    up = 0.5 + 0.5 * normals[:, 1]
    received = triples["earth"][1] * (1.0 - up) + triples["sky"][1] * up
    for k in range(_MAX_LAMPS):
        reached = np.maximum(normals @ triples[f"towards{k}"] + style.wrap, 0.0)
        received = received + reached * triples[f"lamp{k}"][1]
    front = np.maximum(normals[:, 2], 0.0)
    received = received * (1.0 - style.facing * np.maximum(1.0 - front / 0.75, 0.0) ** 2)
    rim = style.sheen * (1.0 - front) ** 3
    white = style.gloss * np.maximum(normals @ triples["halfway"], 0.0) ** style.gloss_power
    colored = received * (1.0 - style.gloss - rim)
    return float(amounts @ colored), float(amounts @ (white + rim * received))


def set_lighting(actor: vtkActor, light: str, looks_of: vtkPolyDataMapper | None = None) -> None:
    """Light an actor in its fragment shader by the code that `lighting_code` returns."""
    # `looks_of` is the mapper of a surface with the array LOOK; without, all of it is exposed.
    shader, declared = actor.GetShaderProperty(), "//VTK::Light::Dec"
    look = "const vec2 lookVSOutput = vec2(1.0);\n"
    if looks_of is not None:
        points = vtkDataObject.FIELD_ASSOCIATION_POINTS
        looks_of.MapDataArrayToVertexAttribute(LOOK_ATTRIBUTE, LOOK, points, -1)
        tag, at = "//VTK::Clip::Dec", "//VTK::Clip::Impl"
        vertex = f"{tag}\nin vec2 {LOOK_ATTRIBUTE};\nout vec2 lookVSOutput;\n"
        shader.AddVertexShaderReplacement(tag, True, vertex, False)
        shader.AddVertexShaderReplacement(
            at, True, f"{at}\n  lookVSOutput = {LOOK_ATTRIBUTE};\n", False
        )
        look = "in vec2 lookVSOutput;\n"
    shader.AddFragmentShaderReplacement(declared, True, declared + look + light + OUTLINE, False)
    shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _FRAGMENT, False)


# Strands of three sizes follow the helices of the fibres. Each strand tilts the normal and has a
# different brightness, as in staple yarns. A strand fades out where it would be finer than two
# samples. Plies that are too narrow to be modelled appear only in the normals. Each pixel has
# `fine` samples along each side. A picture, whose pixels are means of smaller ones, has one sample
# in each of these; a window has as many as it has time for. So both show fibres of the same width.
#: Vertex attribute with the strand coordinates.
_IN = "strandsMC"
#: Strand coordinates that the vertex shader hands to the fragment shader.
_OUT = "strandsVSOutput"
#: Uniform or constant with the number of samples along each side of a pixel.
_FINE = "fine"
#: Samples along each side of a pixel in a window at rest: as many as in a picture.
FINE_SAMPLES = 2

# Gradients on the surface are computed from differences between pixels, as for bump maps without
# texture coordinates (M. S. Mikkelsen, J. Graphics Tools 15, 2010).
_DECLARED = f"""
in vec3 {_OUT};
// Tone of a strand, from 0 to 1; neighbouring strands have different tones.
float tone(float strand) {{ return fract(strand * 0.7548777 + strand * strand * 0.2360680); }}
// Unit vector in which a phase grows, from its slopes along x and y of the screen.
vec3 phaseDirection(vec2 slope, vec3 right, vec3 up) {{
  vec3 direction = slope.x * right + slope.y * up;
  return direction * inversesqrt(max(dot(direction, direction), 1e-30));
}}
// Tilt of the normal by fibres, and their tone; `width` is the growth of the phase in a sample.
vec2 fibresAt(vec3 strands, float width) {{
  float tilt = 0.0, light = 1.0;
  // Fibres are short: they wander sideways in parabolas, and fade in and out.
  float along = fract(0.366 * strands.z) - 0.5;
  float wander = strands.x + 0.11 * along * (1.0 - 2.0 * abs(along));
  for (int size = 0; size < 3; size++) {{
    float count = size == 0 ? 13.0 : size == 1 ? 47.0 : 149.0;
    float visible = clamp(2.0 - 4.0 * count * width, 0.0, 1.0);
    if (visible > 0.0) {{
      float place = count * wander, first = floor(place), side = 2.0 * (place - first) - 1.0;
      float t = tone(mod(first, count)), square = side * side;
      float fade = 97.0 * t * t + (0.17 + 0.3 * t) * strands.z;
      float strength = visible * abs(2.0 * fract(fade) - 1.0);
      tilt += (size == 0 ? 0.5 : 0.85) * strength * side * (1.0 - square);
      light *= 1.0 + strength * (0.12 * t - 0.03 - 0.10 * square * square);
    }}
  }}
  return vec2(tilt, light);
}}
// The same for a groove between two plies: its sides are steep, and it is dark.
vec2 grooveAt(float phase, float width) {{
  if (width == 0.0) {{ return vec2(0.0, 1.0); }}
  float visible = clamp(2.0 - 4.0 * width, 0.0, 1.0), x = fract(phase + 0.5) - 0.5;
  return vec2(visible * 2.4 * x, 1.0 - visible * 6.0 * x * x * x * x);
}}
"""
_SHADED = f"""
vec3 strandsX = dFdx(vertexVC.xyz), strandsY = dFdy(vertexVC.xyz);
vec3 right = cross(strandsY, normalVCVSOutput), up = cross(normalVCVSOutput, strandsX);
if (dot(strandsX, right) < 0.0) {{ right = -right; up = -up; }}
vec3 byX = dFdx({_OUT}), byY = dFdy({_OUT});
vec3 acrossFibres = phaseDirection(vec2(byX.x, byY.x), right, up);
vec3 acrossPlies = phaseDirection(vec2(byX.y, byY.y), right, up);
// Growth of the phases in a sample.
vec2 widths = (abs(byX.xy) + abs(byY.xy)) / float({_FINE});
"""
#: Fragment shader code that lights a surface with fibres; it takes the place of `_FRAGMENT`.
_LIT_FIBRES = f"""
  // Fibres that are far finer than a sample, or far wider than a pixel, need only one sample.
  float finest = 149.0 * widths.x * float({_FINE});
  int side = 13.0 * widths.x < 0.5 && finest > 0.1 ? {_FINE} : 1;
  vec3 mean = vec3(0.0);
  for (int down = 0; down < side; down++)
  {{
    for (int across = 0; across < side; across++)
    {{
      vec2 aside = (vec2(float(across), float(down)) + 0.5) / float(side) - 0.5;
      vec3 strands = {_OUT} + aside.x * byX + aside.y * byY;
      vec2 fibre = fibresAt(strands, widths.x), groove = grooveAt(strands.y, widths.y);
      vec3 bent = normalVCVSOutput + fibre.x * acrossFibres + groove.x * acrossPlies;
      vec3 hue = diffuseColor * lookVSOutput.y * fibre.y * groove.y;
      vec4 light = shadedLight(reflectedLight(normalize(bent), eye), lookVSOutput.x, hue);
      mean += visibleColor(hue, light, line);
    }}
  }}
  gl_FragData[0] = vec4(mean / float(side * side), opacity);
"""


def set_fibres(
    actor: vtkActor, mapper: vtkPolyDataMapper, wanted: bool, has_uniform: bool = False
) -> None:
    """Shade fibres on a surface with strand coordinates; or stop using the coordinates."""
    # If `sampled`, the number of samples is a uniform that `set_fibre_samples` sets.
    if not wanted:
        mapper.RemoveVertexAttributeMapping(_IN)
        return
    points = vtkDataObject.FIELD_ASSOCIATION_POINTS
    mapper.MapDataArrayToVertexAttribute(_IN, STRANDS, points, -1)
    shader, declared, computed = (
        actor.GetShaderProperty(),
        "//VTK::Normal::Dec",
        "//VTK::Normal::Impl",
    )
    vertex = f"{declared}\nin vec3 {_IN};\nout vec3 {_OUT};\n"
    shader.AddVertexShaderReplacement(declared, True, vertex, False)
    shader.AddVertexShaderReplacement(computed, True, f"{computed}\n  {_OUT} = {_IN};\n", False)
    fine = "" if has_uniform else f"const int {_FINE} = 1;\n"
    shader.AddFragmentShaderReplacement(declared, True, declared + fine + _DECLARED, False)
    shader.AddFragmentShaderReplacement(computed, True, computed + _SHADED, False)
    shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _LINE + _LIT_FIBRES, False)


def set_fibre_samples(actor: vtkActor, side: int) -> None:
    """Set the samples along each side of a pixel, for an actor whose fibres are sampled."""
    actor.GetShaderProperty().GetFragmentCustomUniforms().SetUniformi(_FINE, side)
