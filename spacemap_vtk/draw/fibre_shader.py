"""Fibres and plies of yarns in a surface's shading, as far as pixels can show them.

Two sizes of strands lie along the fibres' helices: each tilts the normal and has a tone of its own,
as staple yarns have, and goes where it would be finer than two pixels. Of plies that are too few
pixels wide to be made, the normals alone are theirs.
"""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.filters.patch_tessellator import STRANDS

_IN, _OUT = "strandsMC", "strandsVSOutput"

# Gradients of what varies over the surface come from its differences between pixels, as M. S.
# Mikkelsen has bump maps without texture coordinates (J. Graphics Tools 15, 2010).
_DECLARED = f"""
in vec3 {_OUT};
// a number from 0 to 1 for each strand: no two beside each other are alike
float tone(float strand) {{ return fract(strand * 0.7548777 + strand * strand * 0.2360680); }}
// along the way that a phase grows: x, y of its slopes on the screen
vec3 growing(vec2 slope, vec3 right, vec3 up) {{
  vec3 way = slope.x * right + slope.y * up;
  return way * inversesqrt(max(dot(way, way), 1e-30));
}}
"""
_SHADED = f"""
vec3 strands = {_OUT}, strandsX = dFdx(vertexVC.xyz), strandsY = dFdy(vertexVC.xyz);
vec3 right = cross(strandsY, normalVCVSOutput), up = cross(normalVCVSOutput, strandsX);
if (dot(strandsX, right) < 0.0) {{ right = -right; up = -up; }}
vec2 slope = vec2(dFdx(strands.x), dFdy(strands.x));
float width = abs(slope.x) + abs(slope.y), tilt = 0.0, light = 1.0;
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
vec3 bent = normalVCVSOutput + tilt * growing(slope, right, up);
slope = vec2(dFdx(strands.y), dFdy(strands.y));
width = abs(slope.x) + abs(slope.y);
if (width > 0.0) {{
  // a groove between two plies: steep beside it, and dark in it
  float seen = clamp(2.0 - 4.0 * width, 0.0, 1.0), way = fract(strands.y + 0.5) - 0.5;
  bent += seen * 2.4 * way * growing(slope, right, up);
  light *= 1.0 - seen * 6.0 * way * way * way * way;
}}
normalVCVSOutput = normalize(bent);
diffuseColor *= light;
"""


def show_fibres(actor: vtkActor, mapper: vtkPolyDataMapper, wanted: bool) -> None:
    """Shade fibres, on a surface whose points say where they run; else forget those points."""
    if not wanted:
        mapper.RemoveVertexAttributeMapping(_IN)
        return
    points = vtkDataObject.FIELD_ASSOCIATION_POINTS
    mapper.MapDataArrayToVertexAttribute(_IN, STRANDS, points, -1)
    shader, declared, made = actor.GetShaderProperty(), "//VTK::Normal::Dec", "//VTK::Normal::Impl"
    vertex = f"{declared}\nin vec3 {_IN};\nout vec3 {_OUT};\n"
    shader.AddVertexShaderReplacement(declared, True, vertex, False)
    shader.AddVertexShaderReplacement(made, True, f"{made}\n  {_OUT} = {_IN};\n", False)
    shader.AddFragmentShaderReplacement(declared, True, declared + _DECLARED, False)
    shader.AddFragmentShaderReplacement(made, True, made + _SHADED, False)
