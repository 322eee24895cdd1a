"""The light of a style on a surface: the same in the shaders of yarns, of sheets and of cuts."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

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


_WIDER = """
  //VTK::PositionVC::Impl
  vec2 away = (normalMatrix * normalMC).xy;
  vec2 across = vec2(length(vec3(MCDCMatrix[0][0], MCDCMatrix[1][0], MCDCMatrix[2][0])),
                     length(vec3(MCDCMatrix[0][1], MCDCMatrix[1][1], MCDCMatrix[2][1])));
  gl_Position.xy += away / max(length(away), 1e-6) * min(wider * gl_Position.w, most * across);
  // Behind what it surrounds, should that be open.
  vec4 back = gl_Position;
  back.z += 0.2 * most * length(vec3(MCDCMatrix[0][2], MCDCMatrix[1][2], MCDCMatrix[2][2]));
  back.w += 0.2 * most * length(vec3(MCDCMatrix[0][3], MCDCMatrix[1][3], MCDCMatrix[2][3]));
  gl_Position = vec4(gl_Position.xy * back.w / gl_Position.w, back.zw);
"""


class OutlineActor(vtkActor):
    """Lines round yarns: their far sides, a little wider, in one colour."""

    def __init__(self) -> None:
        super().__init__()
        mapper = vtkPolyDataMapper()
        mapper.ScalarVisibilityOff()
        mapper.SetVBOShiftScaleMethod(0)
        self.SetMapper(mapper)
        self.SetPickable(False)
        self.GetProperty().FrontfaceCullingOn()
        shader = self.GetShaderProperty()
        shader.AddVertexShaderReplacement("//VTK::PositionVC::Impl", True, _WIDER, False)
        line = "  gl_FragData[0] = vec4(diffuseColor, 1.0);"
        shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, line, False)

    def show(
        self, surface: vtkPolyData, style: Style, pixels: float, size: tuple[int, int], most: float
    ) -> None:
        """Draw lines of so many pixels, of `size` in all, and at most so wide [m]."""
        self.GetMapper().SetInputData(surface)
        self.GetProperty().SetColor(*(part / 255 for part in style.outline_ink))
        uniforms = self.GetShaderProperty().GetVertexCustomUniforms()
        uniforms.SetUniform2f("wider", [2.0 * pixels / side for side in size])
        uniforms.SetUniformf("most", most)
