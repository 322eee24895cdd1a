"""The light of a style on a surface: the same in the shaders of yarns, of sheets and of cuts."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from vtkmodules.vtkRenderingCore import vtkActor

from spacemap_vtk.scenes.styles import Style

#: Most lamps of a style.
_LAMPS = 3

#: What lights something, of constants that `light_of` puts before it.
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

#: In a fragment shader, in place of VTK's lights.
_FRAGMENT = """
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
  gl_FragData[0] = vec4(seen(diffuseColor, lit(normalVCVSOutput, eye), line), opacity);
"""


@lru_cache(32)
def light_of(style: Style, point: float = 1.0) -> str:
    """Return what a shader needs to light something in a style; a point is so many pixels."""
    # Constants: uniforms take software OpenGL half as long again for a picture. The lamps turn with
    # the camera, so that nothing of this changes while it does.
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
    triples["ink"] = np.array(style.outline_ink) / 255
    numbers = {
        "wrap": style.wrap,
        "gloss": style.gloss,
        "glossPower": style.gloss_power,
        "sheen": style.sheen,
        "facing": style.facing,
        "colored": style.colored,
        # Half of a line: the other half is beyond the edge, see `OutlineActor`.
        "lined": style.outline_afar if style.outline else 0.0,
        "lineWidth": 0.5 * style.outline * point,
        # The cosine as far from the edge as a line is wide at most.
        "rim": math.sqrt(1.0 - (1.0 - 2.0 * style.outline_share) ** 2),
    }
    lines = []
    for key, triple in triples.items():
        x, y, z = map(float, triple)
        lines.append(f"const vec3 {key} = vec3({x!r}, {y!r}, {z!r});")
    lines += [f"const float {key} = {float(value)!r};" for key, value in numbers.items()]
    return "\n".join(["", *lines, _FUNCTIONS])


def light_by_shader(actor: vtkActor, light: str) -> None:
    """Let an actor be lit by what `light_of` returns, in its fragment shader."""
    shader, declared = actor.GetShaderProperty(), "//VTK::Light::Dec"
    shader.AddFragmentShaderReplacement(declared, True, declared + light, False)
    shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _FRAGMENT, False)
