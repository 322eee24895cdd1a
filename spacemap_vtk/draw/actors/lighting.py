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

from spacemap_vtk.filters.patch_tessellator import STRANDS
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.styles import Style

#: Largest number of lamps of a style.
_LAMPS = 3

#: GLSL functions that light a surface; `lighting_code` puts the constants before them.
_FUNCTIONS = """
// Light that leaves a surface: in its own colour, and white.
vec4 lit(vec3 n, vec3 eye)
{
  vec3 own = mix(earth, sky, 0.5 + 0.5 * n.y);
  own += max(dot(n, towards0) + wrap, 0.0) * lamp0;
  own += max(dot(n, towards1) + wrap, 0.0) * lamp1;
  own += max(dot(n, towards2) + wrap, 0.0) * lamp2;
  float front = max(dot(n, eye), 0.0), aside = 1.0 - front, away = max(1.0 - front / 0.75, 0.0);
  own *= 1.0 - facing * away * away;
  float white = gloss * pow(max(dot(n, halfway), 0.0), glossPower);
  white += sheen * aside * aside * aside * own.g;
  return vec4(own, white);
}

// The colour that a style has for one.
vec3 tinted(vec3 hue)
{
  return mix(mix(dark, pale, dot(hue, vec3(0.299, 0.587, 0.114))), hue, colored);
}

// What is seen of a colour under the light, and under a line; fibres that stand out keep something
// of theirs.
vec3 seen(vec3 hue, vec4 light, float line)
{
  vec3 own = tinted(hue);
  return mix(sqrt(own * own * light.rgb + light.a * mix(vec3(1.0), own, 0.4)), ink, line);
}
"""

#: Fragment shader code that computes `eye` and the coverage `line` of an outline.
_LINE = """
  vec3 eye = cameraParallel == 1 ? vec3(0.0, 0.0, 1.0) : normalize(-vertexVC.xyz);
  float line = 0.0;
  if (lineWidth > 0.0)
  {
    // Of what is round, the edge is half so far as the cosine takes to fall to naught.
    float front = dot(normalVCVSOutput, eye);
    float slope = length(vec2(dFdx(front), dFdy(front)));
    line = 1.0 - smoothstep(lineWidth - 0.7, lineWidth + 0.7, 0.5 * front / max(slope, 1e-6));
    line *= 1.0 - smoothstep(rim, 1.1 * rim, front);
  }
"""
#: Fragment shader code that replaces VTK's lights on a smooth surface.
_FRAGMENT = f"""{_LINE}
  gl_FragData[0] = vec4(seen(diffuseColor, lit(normalVCVSOutput, eye), line), opacity);
"""


@lru_cache(32)
def lighting_code(style: Style, point: float = 1.0) -> str:
    """Return the GLSL constants and functions of a style's light; `point` is pixels per point."""
    # With uniforms in place of constants, software OpenGL takes 50 % more time for a picture. The
    # lamps turn with the camera, so the constants stay valid when the camera moves.
    triples, numbers = _constants(style, point)
    lines = []
    for key, triple in triples.items():
        x, y, z = map(float, triple)
        lines.append(f"const vec3 {key} = vec3({x!r}, {y!r}, {z!r});")
    lines += [f"const float {key} = {float(value)!r};" for key, value in numbers.items()]
    return "\n".join(["", *lines, _FUNCTIONS])


def _constants(style: Style, point: float) -> tuple[dict[str, Any], dict[str, float]]:
    """Return colours and directions, and numbers, by their names in shaders."""
    places, colors = np.zeros((2, _LAMPS, 3))
    for number, lamp in enumerate(style.lamps):
        places[number] = np.array(lamp.place) / np.linalg.norm(lamp.place)
        colors[number] = lamp.strength / (1.0 + style.wrap) * np.array(lamp.color)
    halfway = places[0] + (0.0, 0.0, 1.0)
    dark, pale = style.tint
    triples = {f"towards{k}": places[k] for k in range(_LAMPS)}
    triples |= {f"lamp{k}": colors[k] for k in range(_LAMPS)}
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
        # Half the width of a line. `OutlineActor` draws the other half outside the silhouette.
        "lined": style.outline_far_share if style.outline else 0.0,
        "lineWidth": 0.5 * style.outline * point,
        # Cosine between normal and view at the largest distance of a line from the silhouette.
        "rim": math.sqrt(1.0 - (1.0 - 2.0 * style.outline_share) ** 2),
    }
    return triples, numbers


@lru_cache(32)
def lighting_tables(style: Style, point: float) -> tuple[Floats, Floats]:
    """Return a style's light as tables for `spacemap_vtk.draw.software.raster_loops`."""
    # Rows: directions to the lamps, their colours, then the names in the lists below.
    triples, numbers = _constants(style, point)
    ways = [f"{name}{k}" for name in ("towards", "lamp") for k in range(_LAMPS)]
    rows = [*ways, "sky", "earth", "halfway", "dark", "pale", "ink"]
    names = ("wrap", "gloss", "glossPower", "sheen", "facing", "colored", "lineWidth", "rim")
    return (
        np.array([triples[name] for name in rows], np.float64),
        np.array([numbers[name] for name in names], np.float64),
    )


def set_lighting(actor: vtkActor, light: str) -> None:
    """Light an actor in its fragment shader by the code that `lighting_code` returns."""
    shader, declared = actor.GetShaderProperty(), "//VTK::Light::Dec"
    shader.AddFragmentShaderReplacement(declared, True, declared + light, False)
    shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _FRAGMENT, False)


# Strands of two sizes follow the helices of the fibres. Each strand tilts the normal and has a
# different brightness, as in staple yarns. A strand fades out where it would be finer than two
# samples. Plies that are too narrow to be modelled appear only in the normals. Each pixel has
# `fine` samples along each side. A picture, whose pixels are means of smaller ones, has one sample
# in each of these; a window has as many as it has time for. So both show fibres of the same width.
_IN, _OUT = "strandsMC", "strandsVSOutput"
_FINE = "fine"
#: Samples along each side of a pixel in a window at rest: as many as in a picture.
FINE_SAMPLES = 2

# Gradients on the surface are computed from differences between pixels, as for bump maps without
# texture coordinates (M. S. Mikkelsen, J. Graphics Tools 15, 2010).
_DECLARED = f"""
in vec3 {_OUT};
// a number from 0 to 1 for each strand: no two beside each other are alike
float tone(float strand) {{ return fract(strand * 0.7548777 + strand * strand * 0.2360680); }}
// along the way that a phase grows: x, y of its slopes on the screen
vec3 growing(vec2 slope, vec3 right, vec3 up) {{
  vec3 way = slope.x * right + slope.y * up;
  return way * inversesqrt(max(dot(way, way), 1e-30));
}}
// how far fibres tilt the normal where the phase grows by so much in a sample, and their tone
vec2 fibresAt(vec3 strands, float width) {{
  float tilt = 0.0, light = 1.0;
  // fibres wander, in parabolas, and come and go: they are short
  float along = fract(0.366 * strands.z) - 0.5;
  float wander = strands.x + 0.11 * along * (1.0 - 2.0 * abs(along));
  for (int size = 0; size < 2; size++) {{
    float count = size == 0 ? 13.0 : 47.0, seen = clamp(2.0 - 4.0 * count * width, 0.0, 1.0);
    if (seen > 0.0) {{
      float place = count * wander, first = floor(place), side = 2.0 * (place - first) - 1.0;
      float own = tone(mod(first, count)), square = side * side;
      float strength = seen * abs(2.0 * fract(own + (0.17 + 0.3 * own) * strands.z) - 1.0);
      tilt += (size == 0 ? 0.6 : 1.0) * strength * side * (1.0 - square);
      light *= 1.0 + strength * (0.16 * own - 0.08 - 0.10 * square * square);
    }}
  }}
  return vec2(tilt, light);
}}
// likewise of a groove between two plies: steep beside it, and dark in it
vec2 grooveAt(float phase, float width) {{
  if (width == 0.0) {{ return vec2(0.0, 1.0); }}
  float seen = clamp(2.0 - 4.0 * width, 0.0, 1.0), way = fract(phase + 0.5) - 0.5;
  return vec2(seen * 2.4 * way, 1.0 - seen * 6.0 * way * way * way * way);
}}
"""
_SHADED = f"""
vec3 strandsX = dFdx(vertexVC.xyz), strandsY = dFdy(vertexVC.xyz);
vec3 right = cross(strandsY, normalVCVSOutput), up = cross(normalVCVSOutput, strandsX);
if (dot(strandsX, right) < 0.0) {{ right = -right; up = -up; }}
vec3 byX = dFdx({_OUT}), byY = dFdy({_OUT});
vec3 acrossFibres = growing(vec2(byX.x, byY.x), right, up);
vec3 acrossPlies = growing(vec2(byX.y, byY.y), right, up);
// in each of the samples
vec2 widths = (abs(byX.xy) + abs(byY.xy)) / float({_FINE});
"""
#: Fragment shader code that lights a surface with fibres; it takes the place of `_FRAGMENT`.
_LIT_FIBRES = f"""
  // what is far finer than a sample, or far wider than a pixel, needs no more than one
  float finest = 47.0 * widths.x * float({_FINE});
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
      vec3 hue = diffuseColor * fibre.y * groove.y;
      mean += seen(hue, lit(normalize(bent), eye), line);
    }}
  }}
  gl_FragData[0] = vec4(mean / float(side * side), opacity);
"""


def set_fibres(
    actor: vtkActor, mapper: vtkPolyDataMapper, wanted: bool, sampled: bool = False
) -> None:
    """Shade fibres on a surface with strand coordinates; or stop using the coordinates."""
    # If `sampled`, the number of samples is a uniform that `set_fibre_samples` sets.
    if not wanted:
        mapper.RemoveVertexAttributeMapping(_IN)
        return
    points = vtkDataObject.FIELD_ASSOCIATION_POINTS
    mapper.MapDataArrayToVertexAttribute(_IN, STRANDS, points, -1)
    shader, declared, made = actor.GetShaderProperty(), "//VTK::Normal::Dec", "//VTK::Normal::Impl"
    vertex = f"{declared}\nin vec3 {_IN};\nout vec3 {_OUT};\n"
    shader.AddVertexShaderReplacement(declared, True, vertex, False)
    shader.AddVertexShaderReplacement(made, True, f"{made}\n  {_OUT} = {_IN};\n", False)
    fine = "" if sampled else f"const int {_FINE} = 1;\n"
    shader.AddFragmentShaderReplacement(declared, True, declared + fine + _DECLARED, False)
    shader.AddFragmentShaderReplacement(made, True, made + _SHADED, False)
    shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _LINE + _LIT_FIBRES, False)


def set_fibre_samples(actor: vtkActor, side: int) -> None:
    """Set the samples along each side of a pixel, for an actor whose fibres are sampled."""
    actor.GetShaderProperty().GetFragmentCustomUniforms().SetUniformi(_FINE, side)
