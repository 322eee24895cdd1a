"""Actors drawn with the object: outlines, ghost, cage, supports, loads, dots, ground shadow."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersSources import vtkArrowSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkPolyDataMapper, vtkTexture

from spacemap_vtk.datasets.arrays import (
    elements_of,
    points_of,
    to_array,
    to_cells,
    to_image,
    to_points,
)
from spacemap_vtk.draw.actors.contact_shadows import blur
from spacemap_vtk.draw.actors.load_arrows import ARROW_COLORS, Arrows
from spacemap_vtk.draw.actors.surface_actor import rgb, rgb_table
from spacemap_vtk.embedding.triangles import boundary_faces
from spacemap_vtk.ndarrays import AnyFloats, Floats, Ints
from spacemap_vtk.scenes.settings import View
from spacemap_vtk.scenes.styles import Style

#: Normal and origin of a clipping plane; the normal points to the side that remains visible.
Cut = tuple[tuple[float, float, float], tuple[float, float, float]]

#: Width of a support's dot, in points.
DOT = 9.0
#: Width of the dot at a picked point, in points.
PICKED = 14.0
#: Width of the cage's lines in points, if nothing else is drawn.
LINE = 1.5
#: Width of the cage's lines over the cloth, in points.
THIN = 1.2
#: Opacity of the cage's lines over the cloth, for a cage and for a dense cage.
_LINE_OPACITIES = (0.55, 0.45)
#: If a cage has more tetrahedra than this, only the edges of its surface are drawn.
_DENSE_CAGE = 1000

#: Margin of the shadow's image on each side, as a share of the image.
_SHADOW_MARGIN = 0.21
#: Largest number of cells along the rest of the image.
_MAX_CELLS = 92
#: Points for each cell along a side; with fewer the shadow would have holes.
_POINTS_PER_CELL = 1.5
#: Largest number of points that cast a shadow.
_MAX_POINTS = 150_000
#: Number of horizontal slices that are blurred separately.
_SLICES = 4
#: Blur of a point on the ground, as a share of the shadow's length.
_GROUND_BLUR = 0.01
#: Additional blur of a point that is as high as the shadow is long.
_HEIGHT_BLUR = 0.1

#: Vertex shader that moves the vertices of an outline away from the yarn's axis and backwards.
_ENLARGE = """
  //VTK::PositionVC::Impl
  vec2 away = (normalMatrix * normalMC).xy;
  vec2 across = vec2(length(vec3(MCDCMatrix[0][0], MCDCMatrix[1][0], MCDCMatrix[2][0])),
                     length(vec3(MCDCMatrix[0][1], MCDCMatrix[1][1], MCDCMatrix[2][1])));
  vec2 shift = min(lineWidth * gl_Position.w, maxWidth * across);
  gl_Position.xy += away / max(length(away), 1e-6) * shift;
  // The outline is moved behind the surface that it surrounds, in case that surface is open.
  vec4 back = gl_Position;
  back.z += 0.2 * maxWidth * length(vec3(MCDCMatrix[0][2], MCDCMatrix[1][2], MCDCMatrix[2][2]));
  back.w += 0.2 * maxWidth * length(vec3(MCDCMatrix[0][3], MCDCMatrix[1][3], MCDCMatrix[2][3]));
  gl_Position = vec4(gl_Position.xy * back.w / gl_Position.w, back.zw);
"""


class PlainActor(vtkActor):
    """An actor of a single colour that cannot be picked."""

    def __init__(self) -> None:
        super().__init__()
        self.SetMapper(vtkPolyDataMapper())
        self.GetMapper().ScalarVisibilityOff()
        self.SetPickable(False)


class OutlineActor(PlainActor):
    """Lines around yarns: the back faces, slightly enlarged, in one colour."""

    def __init__(self) -> None:
        super().__init__()
        self.GetMapper().SetVBOShiftScaleMethod(0)
        #: Width of the lines, as shares of half the picture's width and height.
        self.width = (0.0, 0.0)
        #: Largest width of the lines [m].
        self.max_width = 0.0
        self.GetProperty().FrontfaceCullingOn()
        shader = self.GetShaderProperty()
        shader.AddVertexShaderReplacement("//VTK::PositionVC::Impl", True, _ENLARGE, False)
        line = "  gl_FragData[0] = vec4(diffuseColor, 1.0);"
        shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, line, False)

    def show(
        self,
        surface: vtkPolyData,
        style: Style,
        pixels: float,
        size: tuple[int, int],
        max_width: float,
    ) -> None:
        """Draw lines `pixels` wide, in a picture of `size`, but at most `max_width` m wide."""
        self.GetMapper().SetInputData(surface)
        self.GetProperty().SetColor(*(part / 255 for part in style.outline_color))
        uniforms = self.GetShaderProperty().GetVertexCustomUniforms()
        self.width, self.max_width = (2.0 * pixels / size[0], 2.0 * pixels / size[1]), max_width
        uniforms.SetUniform2f("lineWidth", self.width)
        uniforms.SetUniformf("maxWidth", max_width)


class UnderlayActor(PlainActor):
    """The dark layer inside a closed cloth, unlit; each of its sheets has one visible side."""

    def __init__(self) -> None:
        super().__init__()
        self.GetProperty().LightingOff()
        self.GetProperty().BackfaceCullingOn()
        self.VisibilityOff()

    def show(self, surface: vtkPolyData | None) -> None:
        """Draw the layer; None hides it."""
        self.SetVisibility(surface is not None)
        if surface is not None:
            self.GetMapper().SetInputData(surface)


class GhostActor(PlainActor):
    """The pale fabric at rest: its moved points minus their displacements."""

    def __init__(self) -> None:
        super().__init__()
        self.GetProperty().SetColor(*rgb("#8a94a3"))
        self.GetProperty().SetOpacity(0.25)

    def show(self, surface: vtkPolyData, closed: bool = False) -> None:
        """Draw the rest shape of a surface that has displacements."""
        rest = vtkPolyData()
        if surface.GetPointData().GetArray("displacement") is not None:
            rest.ShallowCopy(surface)
            rest.SetPoints(to_points(rest_points(surface)))
            # Normals of the moved surface would show its folds on the flat rest shape.
            rest.GetPointData().SetNormals(None)
        self.GetMapper().SetInputData(rest)
        # Back faces would shine through the front faces and darken the ghost.
        self.GetProperty().SetBackfaceCulling(closed)


class CageActor(PlainActor):
    """The edges of the deformed cage."""

    def __init__(self) -> None:
        super().__init__()
        # The lines are blended when they are drawn, after the cloth. VTK's pass for translucent
        # actors would make a frame 25 % slower.
        self.ForceOpaqueOn()
        self.GetProperty().SetLighting(False)
        self._edges: tuple[Ints, vtkCellArray] | None = None

    def show(
        self, cage: vtkUnstructuredGrid | None, pixels_per_point: float = 1.0, thin: bool = False
    ) -> None:
        """Draw a cage; `thin` makes the lines thin and translucent."""
        lines, opacity = (
            vtkPolyData(),
            _LINE_OPACITIES[cage is not None and cage.GetNumberOfCells() > _DENSE_CAGE],
        )
        self.GetProperty().SetLineWidth((THIN if thin else LINE) * pixels_per_point)
        self.GetProperty().SetOpacity(opacity if thin else 1.0)
        if cage is not None:
            elements = elements_of(cage)
            # Elements are compared by content: a box of another size often has the same edges.
            if self._edges is None or not np.array_equal(self._edges[0], elements):
                self._edges = elements, to_cells(_cage_edges(elements, points_of(cage)))
            lines.SetPoints(to_points(moved_points(cage).astype(np.float32)))
            lines.SetLines(self._edges[1])
        self.GetMapper().SetInputData(lines)


class GroundActor(PlainActor):
    """A soft shadow on level ground; higher parts of the object cast a more blurred shadow."""

    def __init__(self) -> None:
        super().__init__()
        texture = vtkTexture()
        texture.SetColorModeToDirectScalars()
        texture.InterpolateOn()
        texture.EdgeClampOn()
        self.SetTexture(texture)
        self.GetProperty().LightingOff()
        self.ForceTranslucentOn()

    def show(self, points: AnyFloats, up: int, floor: float, strength: float) -> None:
        """Draw the shadow of points (n, 3) on a floor at height `floor` along the axis `up`."""
        points = points[:: 1 + len(points) // _MAX_POINTS]
        sides = [(up + 1) % 3, (up + 2) % 3]
        low, high = points[:, sides].min(axis=0), points[:, sides].max(axis=0)
        length = float((high - low).max()) / (1.0 - 2.0 * _SHADOW_MARGIN) or 1.0
        cells = int(
            min(_MAX_CELLS, np.sqrt(len(points)) / _POINTS_PER_CELL + 8)
            / (1.0 - 2.0 * _SHADOW_MARGIN)
        )
        corner = 0.5 * (low + high) - 0.5 * length
        places = ((points[:, sides] - corner) * (cells / length)).astype(np.int64) @ (1, cells)
        heights = (points[:, up] - floor) / length
        slices = np.minimum(heights * _SLICES, _SLICES - 1).astype(np.int64)
        light = np.ones((cells, cells), np.float32)
        for number in range(_SLICES):
            covered = np.bincount(places[slices == number], minlength=cells**2) > 0
            if covered.any():
                spread = cells * (_GROUND_BLUR + _HEIGHT_BLUR * (number + 0.5) / _SLICES)
                cast = blur(covered.reshape(cells, cells).astype(np.float32), spread)
                light *= 1.0 - cast
        black = np.zeros((cells, cells, 4), np.uint8)
        black[..., 3] = np.rint(255.0 * strength * (1.0 - light))
        self.GetTexture().SetInputData(to_image(black))
        square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        corners = np.full((4, 3), floor)
        corners[:, sides] = corner + length * square
        ground = vtkPolyData()
        ground.SetPoints(to_points(corners))
        ground.SetPolys(to_cells(np.arange(4).reshape(1, 4)))
        ground.GetPointData().SetTCoords(to_array(square.astype(np.float32), "texels"))
        self.GetMapper().SetInputData(ground)


class DotsActor(PlainActor):
    """Dots at points."""

    def __init__(self) -> None:
        super().__init__()
        self.GetProperty().SetRenderPointsAsSpheres(True)

    def set_points(self, points: AnyFloats) -> None:
        """Draw dots at points (n, 3)."""
        dots = vtkPolyData()
        if len(points):
            dots.SetPoints(to_points(points))
            dots.SetVerts(to_cells(np.arange(len(points)).reshape(-1, 1)))
        self.GetMapper().SetInputData(dots)


class SupportActor(DotsActor):
    """The cage's fixed vertices."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: tuple[Any, Any] = None, None

    def show(self, cage: vtkUnstructuredGrid | None) -> None:
        """Draw a cage's supports."""
        fixed = None if cage is None else cage.GetPointData().GetArray("fixed")
        rest = None if cage is None else cage.GetPoints()
        if (rest, fixed) == self._shown and fixed is not None:
            return
        self._shown = rest, fixed
        has_supports = cage is not None and fixed is not None
        self.set_points(
            points_of(cage)[vtk_to_numpy(fixed) != 0] if has_supports else np.zeros((0, 3))
        )


class LoadActor(vtkActor):
    """Arrows of loads on the cage; `through` draws them pale, for a renderer in front."""

    # A load acts at the cloth and often behind it. There the pale arrow shines through the cloth.

    def __init__(self) -> None:
        super().__init__()
        self.pale_copy = vtkActor()
        for actor in (self, self.pale_copy):
            actor.SetMapper(_make_arrow_mapper())
            actor.SetPickable(False)
        self.GetProperty().SetAmbient(0.35)
        properties = self.pale_copy.GetProperty()
        properties.SetLighting(False)
        properties.SetOpacity(0.7)
        properties.BackfaceCullingOn()

    def show(self, arrows: Arrows | None, cut: Cut | None = None) -> None:
        """Draw arrows; a cut hides those whose load acts on the hidden side."""
        data = vtkPolyData()
        if arrows is not None and len(arrows.starts):
            visible = np.ones(len(arrows.starts), bool)
            if cut is not None:
                visible = ~((arrows.places - cut[1]) @ np.array(cut[0]) < 0.0)
            colors = rgb_table([ARROW_COLORS[k] for k in arrows.kinds])
            data.SetPoints(to_points(arrows.starts[visible]))
            data.GetPointData().AddArray(to_array(arrows.vectors[visible], "vector"))
            data.GetPointData().AddArray(to_array(colors[visible], "color"))
        for actor in (self, self.pale_copy):
            actor.GetMapper().SetInputData(data)


def _make_arrow_mapper() -> vtkGlyph3DMapper:
    shape, mapper = vtkArrowSource(), vtkGlyph3DMapper()
    shape.SetTipResolution(24)
    shape.SetShaftResolution(24)
    shape.SetTipRadius(0.09)
    shape.SetTipLength(0.3)
    shape.SetShaftRadius(0.032)
    mapper.SetSourceConnection(shape.GetOutputPort())
    mapper.SetOrientationArray("vector")
    mapper.SetScaleArray("vector")
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("color")
    mapper.SetColorModeToDirectScalars()
    return mapper


def moved_points(cage: vtkUnstructuredGrid) -> Floats:
    """Return the displaced vertices of a cage, (V, 3)."""
    return points_of(cage) + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))


def _cage_edges(elements: Ints, points: AnyFloats) -> Ints:
    """Return distinct edges (n, 2): of a dense cage the surface's; half edges for 10 nodes."""
    ends = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
    shown = np.ones((len(elements), 6), bool)
    if len(elements) > _DENSE_CAGE:
        corners = points[elements[:, :4]]
        positive = np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0.0
        tetrahedra, face = boundary_faces(elements[:, :4], positive)
        shown[:] = False
        # A face contains the edges that do not end at the opposite corner.
        np.logical_or.at(shown, tetrahedra, (ends != face[:, None, None]).all(axis=2))
    if elements.shape[1] == 10:
        ends = np.stack([ends, np.stack([np.arange(4, 10)] * 2, axis=1)], axis=2)
    pairs = np.sort(elements[:, ends][shown].reshape(-1, 2), axis=1)
    pairs = pairs[np.lexsort(pairs.T)]
    return pairs[np.diff(pairs, axis=0, prepend=-1).any(axis=1)]


def rest_points(surface: vtkPolyData) -> AnyFloats:
    """Return the rest positions of a surface's points."""
    displacement = surface.GetPointData().GetArray("displacement")
    return (
        points_of(surface)
        if displacement is None
        else points_of(surface) - vtk_to_numpy(displacement)
    )


def cut_of(view: View, surface: vtkPolyData) -> Cut | None:
    """Return the clipping plane of a view; None without one. It defaults to the centre at rest."""
    if view.clip_normal is None:
        return None
    if view.clip_origin is not None:
        return view.clip_normal, view.clip_origin
    rest = rest_points(surface)
    x, y, z = ((rest.min(axis=0) + rest.max(axis=0)) / 2).tolist()
    return view.clip_normal, (x, y, z)
